"""Times at which an attitude is recorded, so that interpolation between the records is within a requested error."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import minimum_filter1d

from .. import so3
from ..arguments import positive_argument
from ..arrays import Array, Integers, Mask
from ..dynamics.moving_body import check_motion
from ..dynamics.wheels import solution_times
from ..errors import AccuracyNotReached
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._whole_motion import base_attitude, checked_times, continued_quaternions

_EXACT = 1e-8  # [rad] default error of the records
_SMOOTHED = 1e-3  # of the joints' noise, default error after smoothing: it leaves 0.03 to 0.3 of it in attitudes
WINDOW = 8  # records that polynomials go through: degree 7, two records at least on both sides but at the ends
_MOST_RECORDS = 2_000_000  # of a file: 100 to 200 bytes each
_USED = 0.5  # of the error, where it is measured: between these places it may be larger
_PLACES = np.array([np.sqrt(5.0) - 2.0, 0.5, 3.0 - np.sqrt(5.0)])  # of a step: no spin turns whole times to all
_SHORTEST = 64  # last digits of the duration between two records, or their rounding shows


def error_argument(motion: Motion | ForcedMotion, error: float | None) -> float:
    """The error of the records [rad]; None: 1e-8, or for joints smoothed for noise 1e-3 of it. Raises ShapeError."""
    check_motion(motion)
    if error is not None:
        return positive_argument(error, "error", "an angle in rad")
    recording = motion.deformation.made_from.get("recording") or {}
    noise = recording.get("smooth") or (recording.get("lowpass") or {}).get("noise") or {}
    return max(_EXACT, _SMOOTHED * min((level for level in noise.values() if level > 0.0), default=0.0))


def record_times(motion: Motion | ForcedMotion, error: float) -> Array:
    """Times whose quaternions, by polynomials through `WINDOW` of them, are within an error: (N,) [s].

    Steps are halved where the error requires it, measured between records and at the steps of the motion's solution. A
    step is at most twice as long as those in its window. At the ends readers take fewer records (SPICE) or more on the
    inner side (Lagrange): both are within the error.

    Raises ShapeError if the motion is a batch; AccuracyNotReached if that takes millions of records, or steps of a few
    last digits of their times.
    """
    checked_times(motion, [0.0])
    times = np.linspace(0.0, motion.duration, 2 * WINDOW + 1)
    while True:
        halved = _missed(motion, times, (times[:-1, None] + np.diff(times)[:, None] * _PLACES).ravel(), error)
        if not halved.any():
            halved = _missed(motion, times, solution_times(motion), error)
        if not halved.any():
            return times
        while True:
            steps = np.diff(times) / np.where(halved, 2.0, 1.0)
            uneven = steps > 2.5 * minimum_filter1d(steps, WINDOW - 1)
            if not uneven.any():
                break
            halved |= uneven
        if steps.min() < _SHORTEST * np.spacing(motion.duration) or len(times) + halved.sum() > _MOST_RECORDS:
            raise AccuracyNotReached(
                f"error: no {_MOST_RECORDS} records are within {error:g} rad of the motion; allow a larger error"
            )
        times = np.union1d(times, 0.5 * (times[:-1] + times[1:])[halved])


def _missed(motion: Motion | ForcedMotion, times: Array, between: Array, error: float) -> Mask:
    """Steps in which the polynomials miss the motion at one of some times: (N,), (M,) -> (N - 1,)."""
    quaternions = continued_quaternions(base_attitude(motion, times))
    backwards = so3.transpose(base_attitude(motion, between))
    step = np.clip(np.searchsorted(times, between, side="right") - 1, 0, len(times) - 2)
    missed = np.zeros(len(times) - 1, dtype=bool)
    for shifted in (True, False):
        found = so3.matrix_from_quat(_interpolated(times, quaternions, between, step, shifted=shifted))
        missed[step[so3.angle(backwards @ found) > _USED * error]] = True
    return missed


def _interpolated(times: Array, quaternions: Array, between: Array, step: Integers, *, shifted: bool) -> Array:
    """Quaternions of length 1 by Lagrange's polynomials through the nearest records: (N,), (N, 4), (M,) -> (M, 4).

    step : (M,) between which records each time is

    shifted : True for windows of `WINDOW` records at the ends, too; False for those of them that exist
    """
    first = step - WINDOW // 2 + 1
    nodes = np.clip(first, 0, len(times) - WINDOW)[:, None] + np.arange(WINDOW)
    used = shifted | ((nodes >= first[:, None]) & (nodes < first[:, None] + WINDOW))
    at = times[nodes]
    weights = np.empty(nodes.shape)
    for k in range(WINDOW):
        others = used & (np.arange(WINDOW) != k)
        apart = np.where(others, at[:, [k]] - at, 1.0)
        weights[:, k] = used[:, k] * np.prod(np.where(others, between[:, None] - at, 1.0) / apart, axis=1)
    found = np.einsum("mk,mkd->md", weights, quaternions[nodes])
    return found / np.linalg.norm(found, axis=1, keepdims=True)
