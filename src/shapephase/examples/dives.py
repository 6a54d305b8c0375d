"""Dives of the `diver`: somersaults that become twists, and somersaults again, by one arm."""

from __future__ import annotations

import numpy as np

from ..arguments import positive_argument
from ..arrays import Array
from ..body.loading import load_body
from ..deformation.deformation import articulated
from ..shape_space.shape_path import ShapePath
from ._closed_form_motions import Example

_ARM_UP, _ARM_DOWN = 3.0, 0.2  # [rad]
# Shares of a simple dive: an arm moves, and half of its stay below.
_ARM_MOVES, _ARM_STAYS = 0.2, 0.13155869448710526
# Shares of the dive of five stages: the arm goes down, stays down, goes up. The last two and the momentum times the
# duration [kg m^2] solve the three equations of the landing, by Newton's method.
_GOES_DOWN, _STAYS_DOWN, _GOES_UP = 0.2, 0.2722422708607259, 0.17453232069381736
_MOMENTUM_TIMES_DURATION = 92.37710163942651


def diver_twist(duration: float = 1.5) -> ShapePath:
    """A dive of the `diver`: forward, one and a half somersaults with a twist, by one arm that goes down and up.

    Both arms are overhead. In a fifth of the time the left one comes down to the side, which tilts the body away from
    the plane of the somersault, so that it twists, and goes up again when the tilt is such that this takes it away.
    With the momentum (0, 92.338247 / duration, 0) kg m^2/s and upright at the start (the somersault is about +y) it
    ends after exactly one and a half somersaults and one twist, 0.016 degrees from the plane. Momentum and the time
    that the arm stays down were solved for. Without momentum nothing is left of it: an arm comes back on its own way.

    From a platform of ten metres a dive takes about 1.5 s. In the manner of Yeadon 1993 and of Dullin and Tong,
    arXiv:1510.08046; the numbers are our own.

    Examples
    --------
    >>> dive = sp.examples.diver_twist()
    >>> print(dive.duration, dive.shape(0.75))
    1.5 [ 0.2 -3. ]
    """
    period = positive_argument(duration)
    moves = 0.5 + np.array([-_ARM_STAYS - _ARM_MOVES, -_ARM_STAYS, _ARM_STAYS, _ARM_STAYS + _ARM_MOVES])
    return _arm_down_and_up(period * np.array([0.0, *moves, 1.0]))


def five_stage_dive(duration: float = 1.6) -> ShapePath:
    """A dive of the `diver` that lands: forward, one and a half somersaults and one twist, exactly.

    Its stages are those of Dullin and Tong: somersault, shape change, twist, the change back, somersault. The left arm
    comes down and goes up again, like in `diver_twist`. Here it goes up a little faster than it came down, because
    the shoulders are not in the plane of the centre of mass: so the twist ends with the momentum exactly along the axis
    of the somersault. `full_dive` has it with its momentum, (0, 92.37710163942651 / duration, 0) kg m^2/s. The arm
    keeps its rate of 20 rad/s in 1.504 s and longer.

    Source: Dullin and Tong 2016 (theory.md F10); the numbers are our own.

    Examples
    --------
    >>> dive = sp.examples.five_stage_dive()
    >>> print(dive.duration, dive.breaks.round(4), dive.shape(0.75))
    1.6 [0.     0.2826 0.6026 1.0382 1.3174 1.6   ] [ 0.2 -3. ]
    """
    period = positive_argument(duration)
    alone = 0.5 * (1.0 - _GOES_DOWN - _STAYS_DOWN - _GOES_UP)
    times = period * np.append(0.0, np.cumsum([alone, _GOES_DOWN, _STAYS_DOWN, _GOES_UP, alone]))
    times[-1] = period
    return _arm_down_and_up(times)


def _arm_down_and_up(times: Array) -> ShapePath:
    """Path of the diver whose left arm goes down and up between these six times."""
    body = load_body("diver")
    both_up = {"left_shoulder_abduction": _ARM_UP, "right_shoulder_abduction": -_ARM_UP}
    up, down = body.shape(both_up), body.shape(both_up | {"left_shoulder_abduction": _ARM_DOWN})
    return ShapePath.waypoints(times, [up, up, down, down, up, up], joint_names=body.joint_names)


def full_dive(duration: float = 1.6) -> Example:
    """F10: `five_stage_dive` with its momentum: half a turn about y in all, after 1.5 somersaults and a twist.

    Source: Dullin and Tong 2016; theory.md F10.

    Examples
    --------
    >>> dive = sp.examples.full_dive()
    >>> motion = sp.reconstruct(dive.deformation, dive.momentum)
    >>> print(motion.final_attitude.round(9) + 0.0)
    [[-1.  0.  0.]
     [ 0.  1.  0.]
     [ 0.  0. -1.]]
    """
    path = five_stage_dive(duration)
    momentum = np.array([0.0, _MOMENTUM_TIMES_DURATION / path.duration, 0.0])
    return Example(deformation=articulated(load_body("diver"), path), momentum=momentum, phase=3.0 * np.pi, turn=np.pi)
