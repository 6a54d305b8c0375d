"""Loops made of recorded cycles whose ends nearly meet: by a periodic smoother, or the drift."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ... import so3
from ...arguments import check_object
from ...arrays import Array
from ...body.body import Body
from ...display import frozen
from ...errors import TrajectoryError, unknown_name
from ..connection import horizontal_lift
from ..curves import CLOSED
from ..shape_path import ShapePath
from .labels import amounts
from .smoothing import Recorded, Smoothing, prepared_path

WAYS = ("smooth", "drift")  # periodic smoother; gap taken off evenly in time


@frozen
class Closing:
    """Loop made of a recorded cycle.

    Attributes
    ----------
    by : "smooth" or "drift"
    gap : (n,) of the samples, the last from the first, whole turns of endless joints taken off [rad or m]
    opened : the path without closing
    closed : the path with it
    body : whose joints these are

    Examples
    --------
    >>> rows = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.3, 0.0], [2.0, 0.0, 0.1, 0.0], [3.0, 0.0, 0.02, 0.0]]
    >>> header = "time,waist_roll,waist_pitch,waist_yaw"
    >>> np.savetxt("bend.csv", rows, delimiter=",", header=header, comments="")
    >>> found = sp.read_recorded_motion("bend.csv", sp.load_body("cat_two_halves"), close="3deg")
    >>> found.closing.by, np.abs(found.closing.gap).max().round(6).item()
    ('drift', 0.02)
    """

    by: str
    gap: Array
    opened: ShapePath
    closed: ShapePath
    body: Body

    @cached_property
    def holonomy_change(self) -> Array:
        """Rotation vector from the lift's end along the open path to the holonomy of the loop: (3,), base axes [rad].

        Raises AccuracyNotReached like `horizontal_lift`.
        """
        ends = [horizontal_lift(self.body, path).end for path in (self.opened, self.closed)]
        return so3.log(so3.transpose(ends[0]) @ ends[1])

    @property
    def record(self) -> dict[str, Any]:
        """Method and gap of the closing, ready for JSON."""
        gap = dict(zip(self.body.joint_names, self.gap.tolist(), strict=True))
        return {"by": self.by, "gap": gap}


def closed_path(
    recorded: Recorded, body: Body, *, within: float | str, by: str | None, penalty: float | None = None
) -> tuple[ShapePath, Smoothing, Closing]:
    """The loop of a recorded cycle."""
    check_object(body, "Body", "body")
    way = ("smooth" if recorded.smoothed else "drift") if by is None else by
    if not isinstance(way, str) or way not in WAYS:
        raise unknown_name("way of closing", f"{way!s:.40}", WAYS)
    first, last = recorded.around().shapes[[0, -1]]
    for ball in body.chain.follows.balls:
        if last[ball.columns] @ first[ball.columns] < 0.0:
            raise TrajectoryError(
                f"ball joint {ball.name} ends more than half a turn from its start, as its quaternion went; leave "
                "close (--close) out"
            )
    turns = np.where(body.continuous, 2.0 * np.pi * np.round((last - first) / (2.0 * np.pi)), 0.0)
    gap = last - first - turns
    _check_gap(gap, amounts(within, "close"), body)
    opened, _ = prepared_path(recorded, periodic=False, penalty=penalty)
    silent = np.flatnonzero((recorded.noise == 0.0) & (np.abs(gap) > CLOSED))
    if way == "smooth" and recorded.cut_off is None and len(silent):
        raise TrajectoryError(
            f"joint {body.joint_names[silent[0]]} does not close, and no noise is given that a smoother could use; "
            "give smooth (--smooth), or close it by drift (close_by, --close-by)"
        )
    closed, smoothing = prepared_path(recorded, periodic=True, penalty=penalty, turns=turns, drift=way == "drift")
    return closed, smoothing, Closing(by=way, gap=gap, opened=opened, closed=closed, body=body)


def close_argument(close: Any) -> float | str | None:
    """The largest gap that is closed; None for none. Raises TrajectoryError."""
    if close is None or close is False:
        return None
    if close is True:
        raise TrajectoryError("close: how large a gap may be closed, such as close=0.05 or close='3deg', is needed")
    amounts(close, "close")
    return close


def _check_gap(gap: Array, within: dict[str, float], body: Body) -> None:
    allowed = np.array([within[unit] for unit in body.joint_units]).reshape(gap.shape)
    excess = np.abs(gap) - np.maximum(allowed, CLOSED)
    if np.any(excess > 0.0):
        joint = int(np.argmax(excess))
        name, unit = body.joint_names[joint], body.joint_units[joint]
        shown = f"{np.degrees(gap[joint]):.4g} deg" if unit == "rad" else f"{gap[joint]:.4g} {unit.replace('1', '')}"
        raise TrajectoryError(
            f"joint {name} ends {shown} from its start, and gaps up to {allowed[joint]:.6g} {unit} are to be closed; "
            "cut the recording at a full cycle (trim, --flight), or allow more (close, --close)"
        )
