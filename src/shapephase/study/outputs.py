"""Results of each case: numbers of fixed shape, by name or by a function of the motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from .. import so3
from ..arguments import check_choice, check_function, check_text
from ..arrays import Array
from ..display import short_repr
from ..errors import StudyError, WrongObjectError
from ..letters import value_text
from ..phases.phase_split import PhaseSplit
from ..phases.return_map import fixed_points
from ..phases.whole_turns import athlete_turns
from ..reconstruction.reconstruction import Motion
from ._axes import check_name

MOST_FIXED_POINTS = 12  # directions that a case has room for: cats, astronaut and satellite have two to six
_ROTATION = (3, 3)


@dataclass(frozen=True, repr=False)
class Output:
    """A number, or an array of numbers, of each case.

    Attributes
    ----------
    name : of the array in the store
    function : of the case's `Motion`; another process must find it by its name
    shape : of its result
    unit : in labels of figures and tables
    about : one sentence

    Examples
    --------
    >>> turns = sp.study.Output("amplification", lambda motion: motion.amplification, about="growth of a small error")
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.1, 0.2]}, outputs=("turn", turns))
    >>> [output.name for output in study.resolved_outputs]
    ['turn', 'amplification']
    """

    name: str
    function: Callable[..., Any] = field(repr=False)
    shape: tuple[int, ...] = ()
    unit: str = ""
    about: str = ""

    needs: ClassVar[str] = "motion"

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what came. Raises WrongObjectError, StudyError."""
        check_function(self.function, "function", "a function of a Motion")
        for name in ("name", "unit", "about"):
            check_text(getattr(self, name), name, "a text")
        if not isinstance(self.shape, tuple) or not all(
            isinstance(length, int) and length > 0 for length in self.shape
        ):
            raise StudyError(f"shape: a tuple of whole numbers above 0 is needed, got {value_text(self.shape)}")

    def of(self, motion: Motion, parts: PhaseSplit | None) -> Array:
        """Return its value for a motion and the split of that. Raises StudyError for another shape."""
        arguments = {"motion": (motion,), "split": (parts,), "ends": ends_of(motion)}[self.needs]
        value = np.asarray(self.function(*arguments), dtype=float)
        if value.shape != self.shape:
            raise StudyError(f"output {self.name}: shape {self.shape} is declared, the function gave {value.shape}")
        return value


class _OfSplit(Output):
    """A field of `split`."""

    needs = "split"


class _OfEnds(Output):
    """A function of start, end and error estimate: batches compute these without a motion for each case."""

    needs = "ends"


def ends_of(motion: Any) -> tuple[Array, Array, Array]:
    """Return start, end and error estimate of a motion or a family of them."""
    return motion.initial_attitude, motion.final_attitude, motion.error_estimate


def _directions(motion: Motion) -> Array:
    rows = np.full((MOST_FIXED_POINTS, 3), np.nan)
    points = fixed_points(motion.deformation, float(np.linalg.norm(motion.momentum))).directions[:MOST_FIXED_POINTS]
    rows[: len(points)] = points
    return rows


def _field(name: str, shape: tuple[int, ...], unit: str, about: str) -> _OfSplit:
    return _OfSplit(name, lambda parts: getattr(parts, name), shape, unit, about)


def _count(name: str, unit: str, about: str) -> Output:
    return Output(name, lambda motion: np.nan if (value := getattr(athlete_turns(motion), name)) is None else value, (),
                  unit, about)  # fmt: skip


_ALL = (
    _OfEnds("final_attitude", lambda _start, end, _error: end, _ROTATION, "", "base axes to inertial axes"),
    _OfEnds("error_estimate", lambda _start, _end, error: error, (), "rad", "of the attitude over the whole motion"),
    _OfEnds(
        "turn", lambda start, end, _error: so3.angle(so3.transpose(start) @ end), (), "rad",
        "angle from the start to the end, up to pi",
    ),
    Output("initial_momentum", lambda motion: motion.momentum, (3,), "kg m^2/s", "inertial axes; fitted or given"),
    Output("evaluations", lambda motion: motion.evaluations, (), "", "how often inertia and momentum were computed"),
    Output("amplification", lambda motion: motion.amplification, (), "", "the largest growth of a small error"),
    _field("total_rotation", _ROTATION, "", "from the start to the end, inertial axes"),
    _field("holonomy", _ROTATION, "", "what the shape alone does, inertial axes"),
    _field("dynamical_rotation", _ROTATION, "", "what the momentum adds, inertial axes"),
    _field("montgomery_phase", (), "rad", "dynamic and geometric phase together, unwrapped"),
    _field("montgomery_angle", (), "rad", "the phase in (-pi, pi]"),
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
    _count("somersaults", "revolutions", "of an athlete, forward ones above zero"),
    _count("twists", "revolutions", "of an athlete, about the longitudinal axis"),
    _count("largest_tilt", "rad", "of an athlete, between the longitudinal axis and the plane of the somersault"),
    _count("tilt_time", "s", "when the tilt of an athlete is largest"),
    _count("somersault_rate", "rad/s", "the largest rate of an athlete's somersault"),
    _count("twist_rate", "rad/s", "the largest rate of an athlete's twist"),
    Output(
        "fixed_points", _directions, (MOST_FIXED_POINTS, 3), "",
        "of the return map at the magnitude of the momentum: unit vectors, then NaN",
    ),
)  # fmt: skip
_FORMER = {"tilt": "closing_tilt"}  # names in studies and stores of earlier versions
OUTPUTS: Mapping[str, Output] = {output.name: output for output in _ALL}
"""Outputs that a study has by name: the end, its error, every field of `split`, fixed points of the return map.

Examples
--------
>>> sp.study.OUTPUTS["solid_angle"].unit
'sr'
"""


def outputs_argument(given: Sequence[str | Output], taken: Sequence[str]) -> tuple[Output, ...]:
    """Return the outputs of a study, whose arrays have names already. Raises UnknownNameError, StudyError."""
    if not isinstance(given, Sequence):
        raise WrongObjectError(
            f"outputs: names, or Output of a function, in a list are needed, got {value_text(given)}"
        )
    outputs: list[Output] = []
    for entry in (given,) if isinstance(given, str) else given:
        if not isinstance(entry, Output):
            check_choice(entry, "output", (*OUTPUTS, *_FORMER))
            entry = OUTPUTS[entry] if entry in OUTPUTS else replace(OUTPUTS[_FORMER[entry]], name=entry)
        outputs.append(entry)
    names = [output.name for output in outputs]
    if not outputs:
        raise StudyError("outputs: at least one is needed")
    for name in names:
        check_name(name, "outputs")
        if names.count(name) > 1 or name in taken or not name.isidentifier():
            raise StudyError(f"outputs: {name!r} stands twice, is no plain name, or has another meaning already")
    return tuple(outputs)
