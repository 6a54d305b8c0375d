"""Grammars of bodies that other programs read: bioMod, and the measurements of Yeadon's human."""

from __future__ import annotations

from collections.abc import Sequence
from random import Random

from support.engine_files import ACROBAT, MEASUREMENTS, measured

from .pieces import ODD_NAMES, Trial, amount, entry, odd_one, rarely, sometimes_damaged

_ODD_LINES = (
    *("meshfile none.stl", "mesh 0 0 0.1", "meshcolor 1 0 0", "rotations q", "rotations x y", "translations", "mass"),
    *("cm 0 0 0", "mass 1 2", "mass $m", "mass 2*0.5", "inertia", "rangesQ -1 1", "rtinmatrix 2", "endsegment"),
    *("segment", "parent none", "externalforceindex 0", "// a note", "/* a note */", "/*", "\x00", "gravity nan 0 0"),
)
_ODD_BLOCKS = (
    *("gravity 0 0 nan", "version", "version 99", "variables\n$m 1.5\nendvariables", "variables\n$m"),
    *("marker m\nparent part0\nposition 0 0 x\nendmarker", "loopconstraint\nendloopconstraint", "{", "segment"),
    *("imu i\nparent part0\nRT 0 0 0 xyz 0 0 0\nendimu", "contact c\nparent none\nendcontact", "actuator none"),
)


def _numbers(chance: Random, values: Sequence[float]) -> str:
    words = [entry(chance, value, 600).strip() or "0" for value in values]
    # A large E is refused, since biorbd reads it wrong.
    words = [odd_one(chance, word.replace("E", "e"), (word,), 300) for word in words]
    if rarely(chance, 120):
        words = words[:-1] if chance.randrange(2) else [*words, "0"]
    return " ".join(words)


def _segment(chance: Random, name: str, parent: str | None) -> list[str]:
    mass = odd_one(chance, 0.1 + abs(amount(chance, 5.0)), (0.0, -1.0, 1e-9, 1e-320, 1e30), 20)
    size = 0.01 * abs(mass)
    lines = [f"parent {parent}"] if parent else []
    if parent and rarely(chance, 3):
        rows = [[1, 0, 0, 0.1], [0, 0.6, -0.8, 0.2], [0, 0.8, 0.6, 0.3], [0, 0, 0, 1]]
        lines += ["RTinMatrix 1", "RT", *(_numbers(chance, row) for row in rows)]
    elif parent:
        order = odd_one(chance, "xyz", ("zyx", "xyzz", "abc", ""), 15)
        turns, place = [amount(chance, 3.0) for _ in range(3)], [amount(chance, 0.5) for _ in range(3)]
        lines.append(f"RT {_numbers(chance, turns)} {order} {_numbers(chance, place)}")
    rotations = chance.choice(("x", "z", "xz", "zyx", ""))
    slides = odd_one(chance, "", ("z", "xy", "w"), 8)
    lines += [f"translations {slides}"] if slides else []
    lines += [f"rotations {rotations}"] if rotations else []
    if (slides or rotations) and rarely(chance, 4):
        ends = odd_one(chance, [-1.0, 1.0], ([1.0, -1.0], [-1e300, 1e300]), 10)
        lines.append("rangesQ " + " ".join(_numbers(chance, ends) for _ in slides + rotations))
    if not rarely(chance, 12):
        odd = ([0.0] * 3, [size, size, 9.0 * size], [-size] * 3)
        moments = odd_one(chance, [size, 0.9 * size, 0.5 * size], odd, 20)
        rows = [[moments[0], 0.0, 0.0], [0.0, moments[1], 0.0], [0.0, 0.0, moments[2]]]
        lines += [f"mass {_numbers(chance, [mass])}", "inertia", *(_numbers(chance, row) for row in rows)]
        lines.append(f"com {_numbers(chance, [0.0, 0.01, amount(chance, 0.2)])}")
    if rarely(chance, 12):
        lines.insert(chance.randrange(len(lines) + 1), chance.choice(_ODD_LINES))
    if lines and rarely(chance, 25):
        lines.pop(chance.randrange(len(lines)))
    return [f"segment {name}", *("\t" + line for line in lines), odd_one(chance, "endsegment", ("", "endsegmen"), 60)]


def biomod(chance: Random) -> Trial:
    """A model of biorbd: segments that hang on each other, or the acrobat, damaged."""
    if rarely(chance, 6):
        text = ACROBAT
    else:
        names = [odd_one(chance, f"part{k}", ODD_NAMES, 80) for k in range(1 + chance.randrange(4))]
        lines = [odd_one(chance, "version 4", ("Version 3", "/* a\nnote */ version 4", "version 99", ""), 10)]
        for k, name in enumerate(names):
            parent = names[odd_one(chance, chance.randrange(k), (k, len(names) - 1), 40)] if k else None
            lines += ["", *_segment(chance, name, parent)]
        if rarely(chance, 10):
            lines.insert(1 + chance.randrange(len(lines)), chance.choice(_ODD_BLOCKS))
        text = "\n".join(lines) + "\n"
    data = sometimes_damaged(chance, text.encode(errors="replace"), 6 if text != ACROBAT else 1)
    return _trial(chance, data, "bioMod", "body.bioMod")


def yeadon(chance: Random) -> Trial:
    """Ninety-five measurements, some of them odd."""
    scale = odd_one(chance, 1.0, (1000.0, 100.0), 4)
    total = odd_one(chance, 70.0, (None, -1, 0.0, 1e300, -5.0), 4)
    entries = {name: scale * value for name, value in MEASUREMENTS.items()}
    text = measured(total, **entries, measurementconversionfactor=1.0 / scale)
    lines = text.splitlines()
    for _ in range(chance.randrange(3)):
        place = chance.randrange(len(lines))
        name, _, value = lines[place].partition(":")
        # A line that was made odd before may be no measurement any more.
        usual = entries.get(name, 1.0)
        match chance.randrange(7):
            case 0 | 1:
                factor = odd_one(chance, 1.0 + amount(chance, 0.05), (-1.0, 0.0, 10.0, 1e-9, 1e300), 2)
                lines[place] = f"{name}: {usual * factor!r}"
            case 2:
                lines[place] = f"{name}: {entry(chance, usual, 1)}"
            case 3:
                lines.append(f"{name}: {chance.choice((value.strip(), '0.5'))}")
            case 4:
                lines.pop(place)
            case 5:
                odd = ("<<: {a: 1}", "- 1", "---", "? a", "a: !!python/name:os.abort", "x: &a 1", "# note", "\t", "{")
                lines.insert(place, odd_one(chance, chance.choice(odd), (f"{chance.choice(ODD_NAMES)}: 1",), 3))
            case _:
                lines[place] = f"{odd_one(chance, name + 'x', ODD_NAMES, 2)}: {value}"
    start = odd_one(chance, "", ("\ufeff", "%YAML 1.1\n---\n", "\n# note\n"), 10)
    text = start + "\n".join(lines) + "\n"
    return _trial(chance, sometimes_damaged(chance, text.encode(errors="replace"), 8), "Yeadon", "body.txt")


def _trial(chance: Random, data: bytes, source: str, name: str) -> Trial:
    given = odd_one(chance, {}, ({"on_unphysical": "warn"},), 6)
    return Trial(kind="body", source=source, files={name: data}, main=name, options=given)
