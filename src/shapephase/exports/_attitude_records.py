"""Times at which an attitude is recorded, so that interpolation between the records is within a requested error."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array
from ..errors import AccuracyNotReached
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._whole_motion import base_attitude, checked_times, continued_quaternions

_MOST_RECORDS = 2_000_000  # of a file: 100 to 200 bytes each
_USED = 0.5  # of the error, where it is measured: between these places it may be larger
# between two records, where errors are measured; a constant rate is farthest off in the middle
_PLACES = np.array([0.25, 0.5, 0.75])
_PARTS = 4  # records of the first guess for a piece of the motion's own solution
_EVEN = 257  # records of the first guess for a motion with a torque, whose steps are unknown
WINDOW = 8  # records that polynomials go through: degree 7, two records at least on both sides but at the ends


def slerp_times(motion: Motion | ForcedMotion, error: float) -> Array:
    """Times between which a turn at a constant rate is within an error of the motion: (N,) [s].

    Raises ShapeError if the motion is a batch; AccuracyNotReached if that takes millions of records.
    """
    checked_times(motion, [0.0])
    if isinstance(motion, ForcedMotion):
        ends = np.union1d(np.linspace(0.0, motion.duration, _EVEN), motion.breaks)
    else:
        ends = np.union1d(motion.solution.times, motion.deformation.breaks)
    times = np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(_PARTS) / _PARTS).ravel(), ends[-1])
    while True:
        off = _off_at_constant_rate(motion, times)
        # Off by the square of the step.
        parts = np.ceil(np.sqrt(off / (_USED * error))).astype(np.int64).clip(1)
        if np.all(parts == 1):
            return times
        _check_count(int(parts.sum()) + 1, error)
        begin, step = np.repeat(times[:-1], parts), np.repeat(np.diff(times) / parts, parts)
        inside = np.arange(len(begin)) - np.repeat(np.cumsum(parts) - parts, parts)
        times = np.append(begin + inside * step, times[-1])


def even_times(motion: Motion | ForcedMotion, error: float) -> Array:
    """Even times whose quaternions, by polynomials through `WINDOW` of them, are within an error: (N,) [s].

    Raises as `slerp_times`.
    """
    checked_times(motion, [0.0])
    count = 2 * WINDOW
    while True:
        times = np.linspace(0.0, motion.duration, count + 1)
        quaternions = continued_quaternions(base_attitude(motion, times))
        place = (np.arange(count, dtype=np.float64)[:, None] + _PLACES).ravel()
        between = interpolated(quaternions, place)
        truth = base_attitude(motion, place * (motion.duration / count))
        if so3.angle(so3.transpose(truth) @ so3.matrix_from_quat(between)).max() <= _USED * error:
            return times
        count *= 2
        _check_count(count, error)


def interpolated(quaternions: Array, place: Array) -> Array:
    """Quaternions of length 1 between even records, by Lagrange's polynomials: (N, 4), (M,) -> (M, 4).

    place : in steps from the first record
    """
    first = np.clip(np.floor(place).astype(np.int64) - WINDOW // 2 + 1, 0, len(quaternions) - WINDOW)
    nodes = np.arange(WINDOW)
    at = (place - first)[:, None]
    weights = np.ones((len(place), WINDOW))
    for k in nodes:
        others = nodes[nodes != k]
        weights[:, k] = np.prod((at - others) / (k - others), axis=1)
    between = np.einsum("mk,mkd->md", weights, quaternions[first[:, None] + nodes])
    return between / np.linalg.norm(between, axis=1, keepdims=True)


def _off_at_constant_rate(motion: Motion | ForcedMotion, times: Array) -> Array:
    """Largest distance of a turn at a constant rate from the motion, in each step: (N - 1,) [rad]."""
    ends = base_attitude(motion, times)
    turns = so3.log(so3.transpose(ends[:-1]) @ ends[1:])
    inside = times[:-1, None] + np.diff(times)[:, None] * _PLACES
    truth = base_attitude(motion, inside.ravel()).reshape(*inside.shape, 3, 3)
    turned = ends[:-1, None] @ so3.exp(turns[:, None] * _PLACES[:, None])
    return so3.angle(so3.transpose(truth) @ turned).max(axis=1)


def _check_count(count: int, error: float) -> None:
    if count > _MOST_RECORDS:
        raise AccuracyNotReached(
            f"error: no {_MOST_RECORDS} records are within {error:g} rad of the motion; allow a larger error"
        )
