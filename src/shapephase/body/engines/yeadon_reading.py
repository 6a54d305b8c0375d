"""Yeadon's model of a human from ninety-five measurements, by the package yeadon (Dembia, Moore and Hubbard 2014).

Mass, centre and inertia of its eleven segments come from the package; so do their poses, which are compared with ours.
Its inertia of the whole human is not used: version 2.0.1 turns the segments' tensors the wrong way round.
"""

from __future__ import annotations

import contextlib
import io
import math
import re
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml
import yeadon

from ...arrays import Array
from ..formats.xml_text import quoted
from .chain import EXACT, Chain, UnusableModelError, inertia_and_momentum, rates_by_differences

_UNITS = np.eye(3)  # x to the left (turns forwards and back), y to the back, z up for a person who stands
_ROOT = "P"
# For each segment the one it hangs on, and the package's names of the turns between them, in their order.
_JOINTS = {
    "T": ("P", (("PTsagittalFlexion", _UNITS[0]), ("PTbending", _UNITS[1]))),
    "C": ("T", (("TCsagittalSpinalFlexion", _UNITS[0]), ("TCspinalTorsion", _UNITS[2]))),
    "A1": ("C", (("CA1extension", _UNITS[0]), ("CA1adduction", _UNITS[1]), ("CA1rotation", _UNITS[2]))),
    "A2": ("A1", (("A1A2extension", _UNITS[0]),)),
    "B1": ("C", (("CB1extension", _UNITS[0]), ("CB1abduction", _UNITS[1]), ("CB1rotation", _UNITS[2]))),
    "B2": ("B1", (("B1B2extension", _UNITS[0]),)),
    "J1": ("P", (("PJ1extension", _UNITS[0]), ("PJ1adduction", _UNITS[1]))),
    "J2": ("J1", (("J1J2flexion", _UNITS[0]),)),
    "K1": ("P", (("PK1extension", _UNITS[0]), ("PK1abduction", _UNITS[1]))),
    "K2": ("K1", (("K1K2flexion", _UNITS[0]),)),
}
_BY_DIFFERENCES = 1e-11  # share of the largest terms in a momentum by differences
# factor off the perimeters possible for a width, 2 to pi times; sample female1 is off by 1.46, a slipped point by more
_TYPO = 2.0
_STADIUM = re.compile(r"Stadium '(.*?)'.*this ratio is ([-+.\deE]+?)\.?$", re.DOTALL)
# as people write them; YAML reads `1:30` as 90, `012` as 10 and `1e3` as a text
_NUMBER = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
_OF_NUMBERS = ("tag:yaml.org,2002:float", "tag:yaml.org,2002:int")


def chain_of(path: str) -> Chain:
    """Links and joints of a file of measurements, on the pelvis."""
    notes: list[str] = []
    human = _human(path, notes)
    limits = dict(zip(human.CFGnames, human.CFGbounds, strict=True))
    _configure(human, {})
    parts = {part.label.split(":")[0]: part for part in human.segments}
    chain = Chain(Path(path).stem, notes=list(notes))
    for key in (_ROOT, *_JOINTS):
        part = parts[key]
        if not (math.isfinite(part.mass) and part.mass > 0.0):
            raise UnusableModelError(f"segment {part.label!r} has a mass of {part.mass:g} kg")
        chain.add_link(_link(part), part.mass, part.rel_center_of_mass, part.rel_inertia)
    for key, (above, turns) in _JOINTS.items():
        part, parent = parts[key], parts[above]
        frame = np.asarray(parent.rot_mat).T
        place, turn = frame @ (np.ravel(part.pos) - np.ravel(parent.pos)), frame @ np.asarray(part.rot_mat)
        axes = [(name, "revolute", axis, list(limits[name])) for name, axis in turns]
        chain.add_joints(_link(parent), _link(part), place, turn, axes)
    for shape, rate in chain.random_shapes():
        chain.add_pose(shape, rate, *_seen(human, shape, rate), (EXACT, _BY_DIFFERENCES))
    return chain


def _human(path: str, notes: list[str]) -> Any:
    content = Path(path).read_bytes()
    _check_numbers(content)
    try:
        with contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings(record=True) as doubts:
            warnings.simplefilter("always")
            human = yeadon.Human(path)
    except Exception as error:
        # The package raises bare exceptions.
        raise UnusableModelError(f"yeadon does not accept it: {' '.join(map(str, error.args))}") from None
    matches = (_STADIUM.search(str(doubt.message)) for doubt in doubts)
    ratios = {match[1]: float(match[2]) for match in matches if match}
    for level, ratio in ratios.items():
        if not 2.0 / _TYPO < ratio < _TYPO * math.pi:
            raise UnusableModelError(
                f"level {level!r}: its perimeter is {ratio:.4g} times its width; of any cut it is from 2 to pi times: "
                "correct one of them"
            )
    if ratios:
        named = ", ".join(f"{level!r} ({ratio:.3g})" for level, ratio in ratios.items())
        notes.append(
            f"levels taken for circles of their perimeter, as yeadon takes them: {named}; their perimeter is so many "
            "times their width, and of any cut it is from 2 to pi times"
        )
    return human


def _check_numbers(content: bytes) -> None:
    """Raise UnusableModelError unless every entry stands once and is a number: the package multiplies anything."""
    try:
        root = yaml.compose(content.decode("utf-8"), Loader=yaml.SafeLoader)
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        line = mark.line + 1 if mark is not None else 1
        raise UnusableModelError("it is not a YAML file of measurements, `name: number` a line", line) from None
    if not isinstance(root, yaml.MappingNode):
        raise UnusableModelError("it is not a YAML file of measurements, `name: number` a line")
    read: dict[str, float] = {}
    for key, value in root.value:
        name, line = quoted(str(key.value)), key.start_mark.line + 1
        if name in read:
            raise UnusableModelError(f"{name} stands twice", line)
        text = value.value if isinstance(value, yaml.ScalarNode) and value.style is None else ""
        number = float(text) if _NUMBER.fullmatch(text) else math.nan
        if _NUMBER.fullmatch(text) and yaml.safe_load(text) != number:
            raise UnusableModelError(f"{name}: for YAML {text} is not this number; write {number!r}", line)
        if not math.isfinite(number) or (number <= 0.0 and not (name == "totalmass" and number == -1.0)):
            shown = value.value if value.tag in _OF_NUMBERS else repr(value.value)
            raise UnusableModelError(f"{name}: a number above zero is needed, got {quoted(shown)}", line)
        read[name] = number
    names = {*yeadon.Human.measnames, "measurementconversionfactor"}
    missing, unknown = sorted(names - set(read)), sorted(map(str, set(read) - names - {"totalmass"}))
    if missing or unknown:
        lacks = f"lacks {', '.join(missing)}" if missing else ""
        has = f"has {', '.join(unknown)}, which are not measurements" if unknown else ""
        raise UnusableModelError(f"the file {' and '.join(text for text in (lacks, has) if text)}")


def _link(part: Any) -> str:
    """The package's label without its key: 'A1: Left upper arm' -> 'left_upper_arm'."""
    return part.label.split(":")[1].strip().lower().replace(" ", "_").replace("-", "_")


def _configure(human: Any, turns: dict[str, float]) -> None:
    human.set_CFG_dict({name: turns.get(name, 0.0) for name in human.CFGnames})


def _placed(human: Any, turns: dict[str, float]) -> tuple[Array, Array]:
    """Centres (N, 3) and axes (N, 3, 3) of the segments."""
    _configure(human, turns)
    return (
        np.array([np.ravel(part.center_of_mass) for part in human.segments]),
        np.array([part.rot_mat for part in human.segments]),
    )


def _seen(human: Any, shape: dict[str, float], rate: dict[str, float]) -> tuple[Array, Array]:
    """Locked inertia and internal momentum from the package's poses, the pelvis at rest."""
    masses = np.array([part.mass for part in human.segments])
    tensors = np.array([part.rel_inertia for part in human.segments])
    moving = rates_by_differences(partial(_placed, human), shape, rate)
    return inertia_and_momentum(masses, tensors, *_placed(human, shape), *moving)
