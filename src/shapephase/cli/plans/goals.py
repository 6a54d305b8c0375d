"""Options of `shapephase plan` for the goal: a turn, a direction of an axis, or somersaults and twists."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...errors import ShapeError
from ..options import option, rare

if TYPE_CHECKING:
    from ...arrays import Array
    from ...optimal_control.plan_options import Goal

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@Parameter(name="*")
@dataclass(frozen=True)
class GoalOptions:
    """What the motion reaches."""

    undo: Annotated[str | None, option()] = None
    """Motion to undo, a file or a name: back to its first posture and attitude; with momentum give --duration. For
    example `--undo drift.npz`."""
    turn: Annotated[tuple[str, ...], option(negative_iterable="", allow_leading_hyphen=True)] = ()
    """Turn at the end: degrees, and an axis of the base at the start (x, y, z, or three numbers with commas between
    them); of several the cheapest. For example `--turn "90 about y"`."""
    point: Annotated[tuple[str, str] | None, option(negative_iterable="", allow_leading_hyphen=True)] = None
    """Axis of the base, or behind a link's name of this link, and its direction at the end, inertial axes; the turn
    about it is free. For example `--point "dish 0 0 1" "0 1 0"`."""
    somersaults: Annotated[float | None, option()] = None
    """Turns about the momentum; for example `--somersaults 1.5 --momentum 0 40 0`."""
    half_twists: Annotated[float | None, rare()] = None
    """Half turns about the base's z axis, with --somersaults; for example `--half-twists 2`."""
    symmetry: Annotated[str | None, rare(allow_leading_hyphen=True)] = None
    """Symmetry of the body, or of the link of --point: how often it repeats about an axis of the base, or an axis alone
    for all turns about it. For example `--symmetry "4 about x"`."""

    match: Annotated[str | None, rare()] = None
    """Posture and attitude of a motion file at its end, or at a time in s behind @; for example `--match pose.npz@2.5`.
    The body starts with the attitude of --attitude, in the same inertial axes."""

    @property
    def recorded(self) -> str | None:
        """Option whose motion is read; None where the goal is given by numbers."""
        return "--undo" if self.undo is not None else "--match" if self.match is not None else None

    def goal(self) -> Goal | None:
        """Return the goal, None for that of a recording.

        Raises ShapeError for options that exclude or need one another, or not finite numbers.
        """
        from ...optimal_control.plan_options import Goal

        winding = {"--somersaults": self.somersaults, "--half-twists": self.half_twists}
        windings = [name for name, value in winding.items() if value is not None]
        goals = {"--turn": self.turn, "--point": self.point, "--undo": self.undo, "--match": self.match}
        given = [name for name, value in goals.items() if value] + windings[:1]
        if not given:
            raise ShapeError(
                'give --turn "90 about y", --point AXIS DIRECTION, --undo MOTION, --match FILE, or --somersaults and '
                "--half-twists"
            )
        if len(given) > 1:
            raise ShapeError(f"{given[0]} and {given[1]} are two goals; give one of them")
        if self.recorded and self.symmetry is not None:
            raise ShapeError(f"--symmetry: goes with --turn or --point, not with {self.recorded}")
        if self.recorded:
            return None
        if windings:
            if self.symmetry is not None:
                raise ShapeError("--symmetry: goes with --turn or --point, none of which is given")
            for name in windings:
                if not math.isfinite(winding[name] or 0.0):
                    raise ShapeError(f"{name}: a finite number is needed, got {winding[name]:g}")
            return Goal(somersaults=self.somersaults, half_twists=self.half_twists)
        symmetry = None if self.symmetry is None else _symmetry(self.symmetry)
        if self.point is not None:
            (axis, link), direction = _axis_of_link(self.point[0]), _numbers(self.point[1], "--point")
            return Goal(pointing=(axis, direction), link=link, symmetry=symmetry)
        turns = [_turn(turn) for turn in self.turn]
        return Goal(rotation=turns if len(turns) > 1 else turns[0], symmetry=symmetry)


def _turn(text: str) -> Array:
    angle, about, axis = text.partition(" about ")
    try:
        degrees = float(angle)
    except ValueError:
        degrees = math.nan
    if not about or not math.isfinite(degrees):
        raise ShapeError(f'--turn: degrees and an axis, such as "90 about y", are needed, got {text!r}')
    return _rotation(degrees, _axis(axis.strip(), "--turn"))


def _symmetry(text: str) -> Array:
    """Return an axis, or from "4 about x" the rotation by a fourth of a turn about it."""
    count, about, axis = text.partition(" about ")
    if not about:
        return _axis(text.strip(), "--symmetry")
    if not (count.strip().isdecimal() and int(count) > 0):
        raise ShapeError(f'--symmetry: an axis, or a count and an axis as "4 about x", is needed, got {text!r}')
    return _rotation(360.0 / int(count), _axis(axis.strip(), "--symmetry"))


def _rotation(degrees: float, axis: Array) -> Array:
    import numpy as np

    from ... import so3

    return so3.exp(np.radians(degrees) * axis)


def _axis(text: str, option: str) -> Array:
    """Return a unit vector from x, y, z, or three numbers."""
    import numpy as np

    from ... import so3

    return np.array(_AXES[text]) if text in _AXES else so3.normalised(_numbers(text, option))


def _numbers(text: str, option: str) -> Array:
    """Return three numbers with blanks or commas between them, not all zero."""
    import numpy as np

    try:
        axis = np.array([float(number) for number in text.replace(",", " ").split()])
    except ValueError:
        axis = np.zeros(0)
    if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
        choices = "three numbers such as 0,0,1" if option == "--point" else "x, y, z or three numbers such as 1,0,0"
        raise ShapeError(f"{option}: {choices} are needed, got {text!r}")
    return axis


def _axis_of_link(text: str) -> tuple[Array, str | None]:
    """Return an axis and its link; None is the base."""
    words = text.replace(",", " ").split()  # a link's name may have blanks; the numbers come last
    return _numbers(" ".join(words[-3:]), "--point"), " ".join(words[:-3]) or None
