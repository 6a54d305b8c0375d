"""Comparison of a recorded base with the reconstructed one."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, times_argument
from ..arrays import Array, finite_array
from ..display import frozen
from ..errors import ShapeError, TrajectoryWarning
from .reconstruction import Motion

W_FIRST = "read as w x y z instead of x y z w, its quaternions agree: were they written with w first?"
"""Hint for a recorded base that agrees with the motion in the other order of its quaternions."""
INVERSE = "read as its inverse, it is one: base_inverse=True (--base-inverse), or so3.transpose(attitudes)"
"""Hint for recorded attitudes that take the recorder's axes to those of the base."""
_APART = 0.3  # [rad] a smaller difference between orders of quaternions is noise
_NEARER = 0.1  # of the difference, left over in the other order of quaternions, where that order is the reason


@frozen
class BaseDifference:
    """Difference between a recorded base and a reconstructed one, both turned to agree at the first sample.

    Made by `base_difference`.

    Attributes
    ----------
    times : (N,) [s]
    rotation : (N, 3, 3) from the reconstructed attitude to the recorded one, base axes
    angle : (N,) rotation angle [rad]
    """

    times: Array
    rotation: Array
    angle: Array


def base_difference(motion: Motion, times: ArrayLike, attitudes: ArrayLike) -> BaseDifference:
    """Compare a reconstructed motion with recorded attitudes of the base.

    The recorder's axes are unknown in the inertial axes of the motion, so both are turned to agree at the first sample:
    the turns since then are compared, in base axes.

    Parameters
    ----------
    motion : a single one
    times : (N,) within the motion [s], as in `RecordedMotion.times`
    attitudes : (N, 3, 3), base axes to the recorder's, as in `RecordedMotion.base_attitude`

    Raises
    ------
    ShapeError
        If the shapes disagree, or the motion is a batch.

    Warns
    -----
    TrajectoryWarning
        Where the two are far apart, but near once the quaternions of the recording are read with w first.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion, times = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), [0.0, 0.5, 1.0]
    >>> found = sp.base_difference(motion, times, motion.attitude(times))
    >>> print(found.angle.round(9))
    [0. 0. 0.]
    """
    check_object(motion, "Motion", "motion")
    if motion.batch:
        raise ShapeError(f"one motion can be compared with a record, this is a batch of {motion.batch}")
    at = times_argument(finite_array(times, "times", (None,), unit="s"), motion.duration)
    recorded = so3.rotation_argument(attitudes, "attitudes")
    if at.ndim != 1 or recorded.shape != (len(at), 3, 3):
        raise ShapeError(f"attitudes: ({at.size}, 3, 3), one for each time, are needed, got {recorded.shape}")
    ours = motion.attitude(at)
    since = so3.transpose(ours[0]) @ ours
    difference = so3.transpose(since) @ so3.transpose(recorded[0]) @ recorded
    apart = so3.angle(difference)
    farthest = float(apart.max(initial=0.0))
    if farthest > _APART:
        other = read_w_first(recorded)
        nearer = so3.angle(so3.transpose(since) @ so3.transpose(other[0]) @ other)
        if nearer.max() < _NEARER * farthest:
            warnings.warn(
                f"the recorded base comes {np.degrees(farthest):.3g} degrees from this motion's; {W_FIRST}",
                TrajectoryWarning,
                stacklevel=2,
            )
    return BaseDifference(at, difference, apart)


def read_w_first(attitudes: Array) -> Array:
    """Return the attitudes that result when x y z w of these are read as w x y z: (..., 3, 3) -> (..., 3, 3)."""
    return so3.matrix_from_quat(np.roll(so3.quat_from_matrix(attitudes), -1, axis=-1))
