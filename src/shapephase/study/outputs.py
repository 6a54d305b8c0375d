"""What is known of each case at the end: numbers of fixed shape, by name or by a function of the motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from .. import so3
from ..arguments import check_choice, check_function
from ..arrays import Array
from ..display import short_repr
from ..errors import StudyError, WrongObjectError
from ..letters import what_came
from ..phases.phase_split import PhaseSplit
from ..phases.return_map import fixed_points
from ..reconstruction.reconstruction import Motion
from ._axes import LONGEST_NAME

_ROTATION = (3, 3)
MOST_FIXED_POINTS = 12
"""Directions that a case has room for: the cats, the astronaut and the satellite have two to six."""


@dataclass(frozen=True)
class Output:
    """A number, or an array of numbers, of each case.

    Attributes
    ----------
    name : of the array in the store
    function : of the case's `Motion`; another process must find it by its name
    shape : of what it gives
    unit : for people
    about : one sentence

    Examples
    --------
    >>> turns = sp.study.Output("amplification", lambda motion: motion.amplification, about="growth of a small error")
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.1, 0.2]}, outputs=("turn", turns))
    >>> [output.name for output in study.resolved_outputs]
    ['turn', 'amplification']
    """

    name: str
    function: Callable[[Any], Any] = field(repr=False)
    shape: tuple[int, ...] = ()
    unit: str = ""
    about: str = ""

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what came. Raises WrongObjectError, StudyError."""
        check_function(self.function, "function", "a function of a Motion")
        for name in ("name", "unit", "about"):
            if not isinstance(text := getattr(self, name), str):
                raise WrongObjectError(f"{name}: a text is needed, got {what_came(text)}")
        whole = isinstance(self.shape, tuple) and all(isinstance(one, int) and one > 0 for one in self.shape)
        if not whole:
            raise StudyError(f"shape: a tuple of whole numbers above 0 is needed, got {what_came(self.shape)}")

    def of(self, motion: Motion, parts: PhaseSplit | None) -> Array:
        """Its value. Raises StudyError for another shape."""
        found = self.function(motion if parts is None or not isinstance(self, _OfSplit) else parts)
        value = np.asarray(found, dtype=float)
        if value.shape != self.shape:
            raise StudyError(f"output {self.name}: the shape {self.shape} was said, the function gave {value.shape}")
        return value


class _OfSplit(Output):
    """A field of `split`."""


class _OfEnd(Output):
    """What is known from the end alone: batches give it without a motion for each case."""


def final_turn(start: Array, end: Array) -> Array:
    """The angle from the start to the end: (..., 3, 3), (..., 3, 3) -> (...) [rad]."""
    return so3.angle(so3.transpose(start) @ end)


def _directions(motion: Motion) -> Array:
    found = np.full((MOST_FIXED_POINTS, 3), np.nan)
    points = fixed_points(motion.deformation, float(np.linalg.norm(motion.momentum))).directions[:MOST_FIXED_POINTS]
    found[: len(points)] = points
    return found


def _field(name: str, shape: tuple[int, ...], unit: str, about: str) -> _OfSplit:
    return _OfSplit(name, lambda parts: getattr(parts, name), shape, unit, about)


_ALL = (
    _OfEnd("final_attitude", lambda motion: motion.final_attitude, _ROTATION, "", "base axes to inertial axes"),
    _OfEnd("error_estimate", lambda motion: motion.error_estimate, (), "rad", "of the attitude over the whole motion"),
    _OfEnd(
        "turn",
        lambda motion: final_turn(motion.initial_attitude, motion.final_attitude),
        (), "rad", "angle from the start to the end, up to pi",
    ),
    Output("evaluations", lambda motion: motion.evaluations, (), "", "how often inertia and momentum were computed"),
    Output("amplification", lambda motion: motion.amplification, (), "", "the largest growth of a small error"),
    _field("total_rotation", _ROTATION, "", "from the start to the end, inertial axes"),
    _field("holonomy", _ROTATION, "", "what the shape alone does, inertial axes"),
    _field("dynamical_rotation", _ROTATION, "", "what the momentum adds, inertial axes"),
    _field("montgomery_phase", (), "rad", "dynamic and geometric phase together, unwrapped"),
    _field("montgomery_angle", (), "rad", "the same in (-pi, pi]"),
    _field("dynamic_phase", (), "rad", "of the rate along the momentum"),
    _field("geometric_phase", (), "rad", "minus the solid angle"),
    _field("solid_angle", (), "sr", "of the momentum's curve in the gauge"),
    _field("closing_tilt", _ROTATION, "", "transport along the closing great circle"),
    _field("momentum_gap", (), "rad", "between the ends of the momentum's curve"),
    _field("closing_phase", (), "rad", "what the closing great circle adds"),
    _field("shape_gap", (), "rad or m", "between the ends of the path"),
    _field("residual", (), "rad", "between two independent computations of the phase"),
    _field("is_loop", (), "", "1 where the shape closes"),
    _field("has_phase", (), "", "1 where there is momentum"),
    Output(
        "fixed_points", _directions, (MOST_FIXED_POINTS, 3), "",
        "of the return map at the magnitude of the momentum: unit vectors, then NaN",
    ),
)  # fmt: skip
_FORMER = {"tilt": "closing_tilt"}
"""Names that studies and stores had for outputs before."""
OUTPUTS: Mapping[str, Output] = {output.name: output for output in _ALL}
"""What a study can say by name: the end, its error, every field of `split`, fixed points of the return map.

Examples
--------
>>> sp.study.OUTPUTS["solid_angle"].unit
'sr'
"""


def outputs_argument(given: Sequence[str | Output], taken: Sequence[str]) -> tuple[Output, ...]:
    """The outputs of a study; `taken` are names that its arrays have already. Raises UnknownNameError, StudyError."""
    found: list[Output] = []
    if not isinstance(given, Sequence):
        raise WrongObjectError(f"outputs: names, or Output of a function, in a list are needed, got {what_came(given)}")
    for one in (given,) if isinstance(given, str) else given:
        if isinstance(one, Output):
            found.append(one)
        else:
            check_choice(one, "output", {*OUTPUTS, *_FORMER})
            found.append(OUTPUTS[one] if one in OUTPUTS else replace(OUTPUTS[_FORMER[one]], name=one))
    names = [output.name for output in found]
    if not found:
        raise StudyError("outputs: at least one is needed")
    for name in names:
        if len(name) > LONGEST_NAME:
            raise StudyError(f"outputs: a name of {len(name)} characters, {name[:20]!r}...; use {LONGEST_NAME} at most")
        if names.count(name) > 1 or name in taken or not name.isidentifier():
            raise StudyError(f"outputs: {name!r} stands twice, is no plain name, or has another meaning already")
    return tuple(found)


def needs_split(outputs: Sequence[Output]) -> bool:
    """Whether a split is computed."""
    return any(isinstance(output, _OfSplit) for output in outputs)


def ends_suffice(outputs: Sequence[Output]) -> bool:
    """Whether a batch gives all of them."""
    return all(isinstance(output, _OfEnd) for output in outputs)
