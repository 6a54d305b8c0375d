"""What `shapephase plan` has to reach, from the words of the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...errors import ShapeError

if TYPE_CHECKING:
    from ...arrays import Array
    from ...optimal_control.plan_options import Goal

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class GoalWords:
    """The options that say what a plan reaches, as they were given; None: not."""

    turn: tuple[str, ...]
    rotate: float | None
    about: str | None
    point: tuple[str, str] | None
    symmetry: str | None
    somersaults: float | None
    half_twists: float | None

    def check(self) -> None:
        """Raise ShapeError for options that exclude or need one another, or are no numbers."""
        winding = {"--somersaults": self.somersaults, "--half-twists": self.half_twists}
        windings = [option for option, value in winding.items() if value is not None]
        ways = {"--turn": self.turn or None, "--rotate": self.rotate, "--point": self.point}
        given = [option for option, value in ways.items() if value is not None] + windings[:1]
        if len(given) > 1:
            raise ShapeError(f"{given[0]} and {given[1]} each say how the body turns; give one of them")
        if self.rotate is None and self.about is not None:
            raise ShapeError("--about: the axis of --rotate DEGREES, which is not given")
        if self.symmetry is not None and not (self.turn or self.rotate is not None or self.point):
            raise ShapeError("--symmetry: goes with --turn, --rotate or --point, none of which is given")
        if not given:
            raise ShapeError(
                'give --turn "90 about y", --point AXIS DIRECTION, --rotate DEGREES --about AXIS, or --somersaults and '
                "--half-twists"
            )
        for option, value in {"--rotate": self.rotate, **winding}.items():
            if value is not None and not math.isfinite(value):
                raise ShapeError(f"{option}: a finite number is needed, got {value:g}")

    def goal(self) -> Goal:
        """The goal that they say."""
        from ...optimal_control.plan_options import Goal

        symmetry = None if self.symmetry is None else _symmetry(self.symmetry)
        if self.turn:
            turns = [_turn(turn, "--turn") for turn in self.turn]
            return Goal(rotation=turns if len(turns) > 1 else turns[0], symmetry=symmetry)
        if self.rotate is not None:
            return Goal(rotation=_rotation(self.rotate, _axis(self.about or "x", "--about")), symmetry=symmetry)
        if self.point is not None:
            (axis, link), direction = _axis_of_link(self.point[0]), _numbers(self.point[1], "--point")
            return Goal(pointing=(axis, direction), link=link, symmetry=symmetry)
        return Goal(somersaults=self.somersaults, half_twists=self.half_twists)


def _turn(text: str, option: str) -> Array:
    angle, found, axis = text.partition(" about ")
    try:
        degrees = float(angle)
    except ValueError:
        degrees = math.nan
    if not found or not math.isfinite(degrees):
        raise ShapeError(f'{option}: degrees and an axis, such as "90 about y", are needed, got {text!r}')
    return _rotation(degrees, _axis(axis.strip(), option))


def _symmetry(text: str) -> Array:
    """An axis, or the rotation of a whole part of a turn about it, from "4 about x"."""
    count, found, axis = text.partition(" about ")
    if not found:
        return _axis(text.strip(), "--symmetry")
    if not (count.strip().isdecimal() and int(count) > 0):
        raise ShapeError(
            f'--symmetry: an axis, or how often the body looks the same about it, as "4 about x", got {text!r}'
        )
    return _rotation(360.0 / int(count), _axis(axis.strip(), "--symmetry"))


def _rotation(degrees: float, axis: Array) -> Array:
    import numpy as np

    from ... import so3

    return so3.exp(np.radians(degrees) * axis)


def _axis(text: str, option: str) -> Array:
    """A unit vector: x, y, z, or three numbers."""
    import numpy as np

    from ... import so3

    return np.array(_AXES[text]) if text in _AXES else so3.normalised(_numbers(text, option))


def _numbers(text: str, option: str) -> Array:
    """Three numbers with blanks or commas between them, not all zero."""
    import numpy as np

    try:
        axis = np.array([float(part) for part in text.replace(",", " ").split()])
    except ValueError:
        axis = np.zeros(0)
    if axis.shape != (3,) or not np.isfinite(axis).all() or not axis.any():
        choices = "three numbers such as 0,0,1" if option == "--point" else "x, y, z or three numbers such as 1,0,0"
        raise ShapeError(f"{option}: {choices} are needed, got {text!r}")
    return axis


def _axis_of_link(text: str) -> tuple[Array, str | None]:
    """An axis, and whose: of a link, or None: of the base."""
    # A link's name may have blanks; the numbers come last.
    words = text.replace(",", " ").split()
    return _numbers(" ".join(words[-3:]), "--point"), " ".join(words[:-3]) or None
