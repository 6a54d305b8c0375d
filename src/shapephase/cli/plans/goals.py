"""What `shapephase plan` has to reach, from the words of the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...errors import ShapeError

if TYPE_CHECKING:
    from ...arrays import Array
    from ...body.body import Body
    from ...optimal_control.plan_options import Goal

_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class GoalWords:
    """The options that say what a plan reaches, as they were given; None: not."""

    turn: str | None
    rotate: float | None
    about: str | None
    point: tuple[str, str] | None
    somersaults: float | None
    half_twists: float | None

    def check(self) -> None:
        """Raise ShapeError for options that exclude or need one another, or are no numbers."""
        winding = {"--somersaults": self.somersaults, "--half-twists": self.half_twists}
        windings = [option for option, value in winding.items() if value is not None]
        ways = {"--turn": self.turn, "--rotate": self.rotate, "--point": self.point}
        given = [option for option, value in ways.items() if value is not None] + windings[:1]
        if len(given) > 1:
            raise ShapeError(f"{given[0]} and {given[1]} each say how the body turns; give one of them")
        if self.rotate is None and self.about is not None:
            raise ShapeError("--about: the axis of --rotate DEGREES, which is not given")
        if not given:
            raise ShapeError(
                'give --turn "90 about y", --point AXIS DIRECTION, --rotate DEGREES --about AXIS, or --somersaults and '
                "--half-twists"
            )
        for option, value in {"--rotate": self.rotate, **winding}.items():
            if value is not None and not math.isfinite(value):
                raise ShapeError(f"{option}: a finite number is needed, got {value:g}")

    def goal(self, body: Body, end: Array | None) -> Goal:
        """The goal for a body; `end` is the shape at the end of the plan, None: any."""
        from ...optimal_control.plan_options import Goal

        if self.turn is not None:
            return Goal(rotation=_turn(self.turn))
        if self.rotate is not None:
            return Goal(rotation=_rotation(self.rotate, _axis(self.about or "x", "--about")))
        if self.point is not None:
            axis, direction = self.point
            return Goal(pointing=[_axis_of_body(body, axis, end), _numbers(direction, "--point")])
        return Goal(somersaults=self.somersaults, half_twists=self.half_twists)


def _turn(text: str) -> Array:
    angle, found, axis = text.partition(" about ")
    try:
        degrees = float(angle)
    except ValueError:
        degrees = math.nan
    if not found or not math.isfinite(degrees):
        raise ShapeError(f'--turn: degrees and an axis, such as "90 about y", are needed, got {text!r}')
    return _rotation(degrees, _axis(axis.strip(), "--turn"))


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


def _axis_of_body(body: Body, text: str, end: Array | None) -> Array:
    """An axis of the base, or of a link at the final posture, in axes of the base."""
    # A link's name may have blanks; the numbers come last.
    words = text.replace(",", " ").split()
    axis, link = _numbers(" ".join(words[-3:]), "--point"), " ".join(words[:-3])
    if not link:
        return axis
    if end is None:
        raise ShapeError("--point: where a link points depends on the posture at the end; leave out --to free")
    return body.link_pose(end, link)[:3, :3] @ axis
