"""What is wrong with a body of bioMod or Yeadon's that was accepted: plain readers of their texts."""

from __future__ import annotations

import contextlib
import copy
import io
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from .plain_readers import NotPlain, strict_number

_NUMBERS = {"mass": (1, 1), "com": (3, 3), "inertia": (9, 9), "rt": (6, 16)}
"""Words of a segment -> the fewest and the most numbers that follow."""
_WORDS = (*_NUMBERS, "rtinmatrix", "translations", "rotations", "parent", "rangesq", "rangesqdot", "rangesqddot")
_SUM = re.compile(r"[$*/()]|[\d.][-+]")
"""In what is no plain number, and biorbd may compute: the library's own rule says what it reads right."""
_OF_ROUNDING = 1e-9
"""Of a mass: a sum of a few rounded terms."""
_FINEST = 1e-6
"""[kg] below which a segment has no mass for biorbd."""


def biomod_faults(file: Path, body: Any) -> Iterator[str]:
    """Mass, links and coordinates are those of the segments, every number is written strictly."""
    data = file.read_bytes()
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    text = re.sub(r"/\*.*?\*/", " ", text, flags=re.DOTALL)
    words = [word for line in text.splitlines() for word in line.split("//")[0].split()]
    segments: dict[str, dict[str, list[str]]] = {}
    said: list[str] | None = None
    inside: dict[str, list[str]] | None = None
    for place, word in enumerate(words):
        known = word.lower()
        if place and words[place - 1].lower() in ("parent", "segment"):
            if said is not None:
                said.append(word)
        elif known == "segment" and inside is None and place + 1 < len(words):
            said, inside = [], {}
            segments[words[place + 1]] = inside
        elif known == "endsegment":
            said = inside = None
        elif inside is not None and known in _WORDS:
            said = inside.setdefault(known, [])
        elif inside is not None and re.match(r"[a-z]{3,}", known) and known not in ("xyz", "zyx", "nan", "inf"):
            said = []
        elif said is not None:
            said.append(word)
    masses = {}
    for name, traits in segments.items():
        for word, (fewest, most) in _NUMBERS.items():
            given = [text for text in traits.get(word, ()) if not re.fullmatch(r"[xyz]{1,3}", text)]
            if word in traits and not fewest <= len(given) <= most:
                yield f"segment {name}: {word} {given}"
            try:
                values = [np.nan if _SUM.search(text) else strict_number(text) for text in given]
            except NotPlain as fault:
                yield f"segment {name}: {word}: {fault}"
                return
            if word == "mass":
                masses[name] = values[-1] if values else 0.0
    total = sum(value for value in masses.values() if value > _FINEST)
    sums = any(np.isnan(value) for value in masses.values())
    if not sums and not np.isclose(total, body.mass, rtol=1e-6, atol=_FINEST):
        yield f"mass {body.mass}, and the segments have {masses}"
    moving = [
        f"{name}_{kind}{axis.upper()}"
        for name, traits in segments.items()
        if traits.get("parent") and name in body.link_names
        for kind, word in (("Trans", "translations"), ("Rot", "rotations"))
        for axis in "".join(traits.get(word, ()))
        if axis != "q"
    ]
    moving += [
        f"{name}_Quat.{part}"
        for name, traits in segments.items()
        if traits.get("parent") and name in body.link_names and traits.get("rotations") == ["q"]
        for part in "xyzw"
    ]
    below = [
        name for name in moving if not any(name.startswith(f"{body.link_names[0]}_{kind}") for kind in ("T", "R", "Q"))
    ]
    if sorted(below) != sorted(body.joint_names):
        yield f"joints {body.joint_names}, and the segments have {below}"


def yeadon_faults(file: Path, body: Any) -> Iterator[str]:
    """Mass and names are the package's own; every line is a name, once, and a positive number."""
    import yeadon

    found: dict[str, float] = {}
    for line in file.read_bytes().decode("utf-8-sig").splitlines():
        text = line.split("#")[0].strip()
        if not text or text.startswith(("---", "%YAML")):
            continue
        name, mark, value = text.partition(":")
        if not mark or name.strip() in found:
            yield f"the line {line!r}"
            return
        try:
            found[name.strip()] = strict_number(value)
        except NotPlain as fault:
            yield f"{name}: {fault}"
            return
    small = [name for name, value in found.items() if value <= 0.0 and (name, value) != ("totalmass", -1.0)]
    if small:
        yield f"{small} are not above zero"
    # The package scales the densities of all humans to come by the mass of one.
    densities = copy.deepcopy(yeadon.Human.segmental_densities)
    with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        human = yeadon.Human(str(file))
    yeadon.Human.segmental_densities = densities
    said = found.get("totalmass", -1.0)
    for expected in (human.mass, *([said] if said > 0.0 else [])):
        if not np.isclose(expected, body.mass, rtol=_OF_ROUNDING):
            yield f"mass {body.mass}, and {expected} is expected"
    if set(body.joint_names) != set(human.CFGnames) - {"somersault", "tilt", "twist"}:
        yield f"joints {body.joint_names}"
