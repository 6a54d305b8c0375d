"""Error due to rounding where its bound is too large: what a motion becomes when it is rounded otherwise."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Integers
from ..fast.estimate_constants import (
    EPS,
    LEAST_NOISE,
    LEAST_OF_BOUND,
    MEASURED_ROUNDING,
    NOISE_OF_SERIES,
    NOISE_OF_TAIL,
    OTHER_ROUNDINGS,
    ROUNDING_BY_CHANCE,
)
from ..interpolant import Interpolant
from .step_loop import largest_angle, quaternions_alone
from .step_record import StepRecord

# Numbers of quaternions at once: eight megabytes.
_MOST_NUMBERS = 1_000_000
# Terms of a series that tell its noise.
_LAST = 5


def measured_rounding(
    bound: Array,
    interpolant: Interpolant,
    steps: Integers,
    record: StepRecord,
    magnitudes: Array,
    tolerance: float,
) -> Array:
    """The bound (B,) [rad], and where it takes up most of the tolerance what it is by marches that round otherwise.

    The bound supposes that all rounding meets the growth of errors at its worst. Series that differ by units of
    rounding show what it does meet: each of some marches on such series is off by rounding of its own.

    Parameters
    ----------
    steps : (P,) on each panel of one loop
    record : of these steps
    magnitudes : (B,) of the momentum [kg m^2/s]
    """
    large = bound > MEASURED_ROUNDING * tolerance
    if not np.count_nonzero(large) or not len(rows := np.flatnonzero(large & np.isfinite(bound))):
        return bound
    apart = np.zeros(len(rows))
    at_once = max(1, _MOST_NUMBERS // record.quaternions[0].size)
    for number in range(OTHER_ROUNDINGS):
        series = _rounded_otherwise(interpolant, number)
        for first in range(0, len(rows), at_once):
            part = slice(first, first + at_once)
            these = rows[part]
            start = (record.directions[these, 0], magnitudes[these]) if record.directions.shape[1] else ()
            other = quaternions_alone(interpolant, series, steps, *start)
            apart[part] = np.maximum(apart[part], largest_angle(record.quaternions[these], other))
    measured = np.array(bound)
    # Overflown marches tell nothing.
    found = np.where(np.isfinite(apart), ROUNDING_BY_CHANCE * apart, np.inf)
    measured[rows] = np.minimum(bound[rows], np.maximum(found, LEAST_OF_BOUND * bound[rows]))
    return measured


def _rounded_otherwise(interpolant: Interpolant, number: int) -> Array:
    """Series (P, n, 9) with errors like those due to rounding, the same for the same number."""
    coefficients = interpolant.coefficients
    sampled = coefficients if interpolant.sampled is None else interpolant.sampled
    noise = np.random.default_rng(number).uniform(-1.0, 1.0, coefficients.shape)
    for channels in (slice(0, 6), slice(6, 9)):
        sizes = noise_of_series(sampled[..., channels], interpolant.band)
        noise[..., channels] *= np.repeat(sizes, len(coefficients) // len(sizes))[:, None, None]
    return coefficients + noise


def noise_of_series(coefficients: Array, band: int | None = None) -> Array:
    """How large errors due to rounding may be in the series of each panel: (P, n, k) -> (P,); band: of an interpolant.

    Rounding of samples is alike in all terms, and the last ones are hardly anything else.
    """
    sizes = np.abs(coefficients).max(axis=2)
    count = sizes.shape[1]
    last = count - 1 - np.argmax(sizes[:, ::-1] > 0.0, axis=1)
    if band is not None:
        last = np.minimum(last, band)
    ends = np.clip(last[:, None] - np.arange(_LAST), 0, None)
    tail = np.sqrt((np.take_along_axis(coefficients, ends[..., None], axis=1) ** 2).mean(axis=(1, 2)))
    unit = EPS * sizes.max(axis=1)
    # Of few terms the last ones are more than noise.
    tail[last < 2 * _LAST] = np.inf
    return np.clip(NOISE_OF_TAIL * tail, LEAST_NOISE * unit, NOISE_OF_SERIES * unit)
