"""Grammars of studies: their files in TOML, and the Zarr stores that they write."""

from __future__ import annotations

import json
import tempfile
from functools import cache
from pathlib import Path
from random import Random

from .pieces import BODY, ODD_NAMES, Trial, amount, damaged, odd_one, rarely, sometimes_damaged, spelled

GOOD_MOTION = "time,hip,wrist,boom\n0,0,0,0\n0.25,0.2,0.1,0.05\n0.5,0.3,0.3,0.1\n0.75,0.1,0.2,0.02\n1,0,0,0\n"
"""A motion of the body of `pieces`."""
_ODD_ENTRIES = (
    *("true", "false", '"1"', "[]", "[[1.0], 2.0]", "{}", "{a = 1}", "1979-05-27", "07:32:00", "nan", "inf", "-inf"),
    *("1e400", "-1.0", "0", "1e-320", "1e308", "0x10", "1_0", "9223372036854775808", "1" + "0" * 400, "''", "1.5"),
    *('["a", 1]', "[nan]", "[true]", '"\\u0000"', "[[[1.0]]]", "-0.0", "''' '''", "[1, 2, 3, 4, 5]", "", "x"),
)
RIGID = "[rigid]\ninertia = [[1, 0, 0], [0, 2, 0], [0, 0, 2.5]]\nduration = 3.0\n"
_HALVES = 'body = "cat_two_halves"\nmotion = "kane_scher"\nparameters = {alpha = 0.2, beta = 0.9}\n'
_FILES = 'body = "body.urdf"\nmotion = "motion.csv"\n'
_ENTRIES = {
    "seed": ("4", "0"),
    "draws": ("2", "1"),
    "chunk": ("2", "1", "100000"),
    "momentum": ("[0.0, 0.1, 0.02]",),
    "attitude": ("[0, 0, 0, 1]", "[1, 0, 0, 1]"),
    "tolerance": ("1e-7", "1e-9"),
    "gauge": ('"base"', '"principal"', '"link:arm"'),
    "time_limit": ("20.0",),
    "outputs": ('["turn"]', '["montgomery_phase", "error_estimate"]', '["final_attitude"]', '["status"]'),
    "body": ('"cat"', '"nobody"', '"no.urdf"', '"motion.csv"'),
    "motion": ('"none.csv"', '"math:sin"', '"no:where"', '"circle"', '"body.urdf"', '":"'),
    "parameters": ("{alpha = 0.1}", "{gamma = 1.0}", '{beta = "x"}', "{beta = true}", "{beta = nan}"),
    "root": ('"free"', '"fixed"', '""'),
    "root_body": ('"base"', '"none"', "1"),
    "length_unit": ("0.01",),
    "person_mass": ("62",),
    "packages": ('["packages"]', '["none"]', '["."]', '"packages"', "[1]", '["body.urdf"]', '[""]'),
    "unknown": ("1",),
}
_UNITS = ('"deg"', '"rad"', '"m"', '"mm"', '"kg m^2/s"', '"furlong"', '""', "1")
_NUMERIC = ("momentum_x", "momentum_y", "momentum_z", "tolerance", "joint_noise", "masses", "inertias", "masses.arm")
_ONES = ("masses", "inertias", "masses.arm")
_ODD_AXES = ("masses.none", "centres.", "body", "motion", "alpha", '"a.b"', "momentum.x", "gamma", "''", "attitude")
_CALLS = ("support.study_functions:peak_rate", "math:pi", "no.module:f", "os:getcwd", "x", ":", "a:b:c", "math:")
_DISTRIBUTIONS = (
    *("normal\nmean = 0.1\ndeviation = 0.02", "normal", "uniform\nlow = 0.1\nhigh = 0.2", "uniform\nlow = 1\nhigh = 0"),
    *("lognormal\ndeviation = 0.1", "lognormal\ndeviation = -1", "choice\nvalues = [0.1, 0.2]", "choice\nvalues = []"),
    *("directions", "rotations", "none", "", "normal\nmean = 0.1\nnone = 1", "directions\nmagnitude = 0.1"),
)


def _entry(chance: Random, usual: str, times: int = 40) -> str:
    return odd_one(chance, usual, _ODD_ENTRIES, times)


def _value(chance: Random, name: str) -> str:
    if name == "tolerance":
        return _entry(chance, chance.choice(("1e-6", "1e-8")))
    size = 1.0 + 0.1 * amount(chance) if name in _ONES else abs(amount(chance, 0.2))
    return _entry(chance, spelled(chance, size).strip())


def _axis(chance: Random, name: str) -> list[str]:
    if name == "gauge":
        values = ("base", "horizontal", "principal", "none")
        return [f"values = [{', '.join(json.dumps(chance.choice(values)) for _ in range(chance.randrange(3)))}]"]
    unit = [f"unit = {chance.choice(_UNITS)}"] if rarely(chance, 5) else []
    if rarely(chance, 4):
        kind, *numbers = chance.choice(_DISTRIBUTIONS).split("\n")
        return [f'distribution = "{kind}"', *(_odd_number(chance, line) for line in numbers), *unit]
    if rarely(chance, 2):
        values = [_value(chance, name) for _ in range(odd_one(chance, 2, (0, 1), 6))]
        return [f"values = [{', '.join(values)}]", *unit]
    count = odd_one(chance, "2", ("0", "-1", "1.0", "true", "10000001", '"2"', "1" + "0" * 20), 8)
    return [f"from = {_value(chance, name)}", f"to = {_value(chance, name)}", f"count = {count}", *unit]


def _odd_number(chance: Random, line: str) -> str:
    name, _, value = line.partition(" = ")
    return f"{name} = {_entry(chance, value, 10)}"


def study_file(chance: Random) -> Trial:
    """A study of few cases, and the files that it names."""
    text = chance.choice((RIGID, RIGID, _HALVES, _FILES))
    lines = [] if text == RIGID else text.splitlines()
    for name in chance.sample(sorted(_ENTRIES), chance.randrange(4)):
        if not any(line.startswith(name) for line in lines) or rarely(chance, 10):
            lines.append(f"{name} = {_entry(chance, chance.choice(_ENTRIES[name]), 12)}")
    if text == RIGID:
        lines += RIGID.splitlines()
        if rarely(chance, 8):
            lines[-1] = f"duration = {_entry(chance, '2.0', 2)}"
    for name in dict.fromkeys(_axis_name(chance, text) for _ in range(chance.randrange(3))):
        lines += [f"[over.{name}]", *_axis(chance, name)]
    if rarely(chance, 6):
        shape = odd_one(chance, "[]", ("[3]", "[0]", "3", "[1.0]", "[true]"), 4)
        lines += [f"[functions.{odd_one(chance, 'peak', ('turn', 'a-b', 'status', 'über'), 4)}]"]
        lines += [f"call = {json.dumps(chance.choice(_CALLS))}", f"shape = {shape}"]
    if lines and rarely(chance, 20):
        lines.insert(chance.randrange(len(lines)), chance.choice(("[[over]]", "[over]", "over = 1", "=", "[", "a.b=1")))
    if lines and rarely(chance, 20):
        lines.pop(chance.randrange(len(lines)))
    data = sometimes_damaged(chance, ("\n".join(lines) + "\n").encode(errors="replace"), 12)
    files = {"study.toml": data, "body.urdf": BODY.encode(), "motion.csv": GOOD_MOTION.encode()}
    files["packages/note.txt"] = b""
    return Trial(kind="study", source="study", files=files, main="study.toml")


def _axis_name(chance: Random, text: str) -> str:
    usual = _NUMERIC[:4] if text == RIGID else (*_NUMERIC, "gauge", *(("beta",) if text == _HALVES else ()))
    return odd_one(chance, chance.choice(usual), (*_ODD_AXES, json.dumps(chance.choice(ODD_NAMES))), 10)


@cache
def store_files() -> dict[str, bytes]:
    """A store of six cases, two of which have no results, and the file of its study."""
    from shapephase.study import read_study

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        text = (
            f"chunk = 2\noutputs = ['turn']\n{RIGID}[over.momentum_x]\nvalues = [0.0, 1e-3, 0.5]\n"
            "[over.momentum_z]\nvalues = [0.1, 0.2]\n[functions.poison]\ncall = 'support.study_functions:poisoned'\n"
        )
        (place / "study.toml").write_text(text)
        read_study(place / "study.toml").run(place / "out.zarr", workers=0)
        return {str(file.relative_to(place)): file.read_bytes() for file in place.rglob("*") if file.is_file()}


_ODD_JSON = (None, -1, 0, 1e400, 2.5, 10**10, 10**400, "x", "", [], {}, True, [1, 2], {"a": {}}, "9" * 5000)


def store_trial(chance: Random) -> Trial:
    """A store, in which a file is damaged, lost, another's, or says something else."""
    files = dict(store_files())
    for _ in range(odd_one(chance, 1, (0, 2, 3), 3)):
        kept = sorted(name for name in files if name.startswith("out.zarr"))
        if not kept:
            break
        # Most of the files are chunks, most of what can be said is in the metadata.
        named = [name for name in kept if name.endswith("zarr.json")] if chance.randrange(2) else kept
        name = chance.choice(named or kept)
        match chance.randrange(7):
            case 0:
                files[name] = damaged(chance, files[name])
            case 1:
                del files[name]
            case 2:
                files[name] = files[chance.choice(kept)]
            case 3:
                files[name] = chance.choice((b"", b"{}", b"[]", b"x", b"[" * 3000, b'{"zarr_format": 2}'))
            case 4 if len(kept) > 1:
                part = name.rpartition("/")[0] + "/"
                files = {other: data for other, data in files.items() if not other.startswith(part)}
            case _:
                if name.endswith("zarr.json"):
                    files[name] = _changed(chance, files[name])
    if rarely(chance, 12):
        files = {name: data for name, data in files.items() if not name.startswith("out.zarr")}
        if chance.randrange(2):
            files[odd_one(chance, "out.zarr", ("out.zarr/notes.txt", "out.zarr/.zgroup"), 2)] = b'{"zarr_format": 2}'
    return Trial(kind="store", source="store", files=files, main="out.zarr")


def _changed(chance: Random, data: bytes) -> bytes:
    """Metadata in which something else stands for one entry, at any depth, or it is lost."""
    try:
        said = json.loads(data)
    except ValueError:
        return data
    entry = said
    for _ in range(6):
        if not isinstance(entry, dict) or not entry:
            return data
        key = chance.choice(sorted(entry))
        if not isinstance(entry[key], dict) or not entry[key] or rarely(chance, 6):
            break
        entry = entry[key]
    if rarely(chance, 5):
        del entry[key]
    else:
        entry[key] = chance.choice(_ODD_JSON)
    return json.dumps(said).encode()
