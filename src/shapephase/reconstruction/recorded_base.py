"""The base as somebody recorded it, against the base as it was reconstructed."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, times_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import ShapeError
from .reconstruction import Motion


@dataclass(frozen=True, eq=False)
class BaseDifference:
    """How far a recorded base is from a reconstructed one, both turned to agree at the first sample.

    Attributes
    ----------
    times : (N,) [s]
    rotation : (N, 3, 3) what takes the reconstructed attitude to the recorded one, base axes
    angle : (N,) of it [rad]

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> motion, times = sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), [0.0, 0.5, 1.0]
    >>> turned = sp.so3.exp(np.array([0.0, 0.0, 0.1])) @ motion.attitude(times)
    >>> print(sp.base_difference(motion, times, turned).angle.round(9))  # both agree at the first sample
    [0. 0. 0.]
    """

    times: Array
    rotation: Array
    angle: Array

    __repr__ = short_repr


def base_difference(motion: Motion, times: ArrayLike, attitudes: ArrayLike) -> BaseDifference:
    """Compare a reconstructed motion with recorded attitudes of the base.

    Nobody knows how the recorder's axes stand to the inertial ones of the motion, so the two are made to agree at the
    first sample: what is compared is how the base has turned since, seen from itself.

    Parameters
    ----------
    motion : a single one
    times : (N,) within the motion [s], as in `RecordedMotion.times`
    attitudes : (N, 3, 3), base axes to the recorder's, as in `RecordedMotion.base_attitude`

    Raises
    ------
    ShapeError
        If the shapes disagree, or the motion is a batch.

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
    return BaseDifference(at, difference, so3.angle(difference))
