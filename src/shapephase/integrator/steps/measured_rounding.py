"""Error due to rounding where its bound is too large: what a motion becomes when it is rounded otherwise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Array, Integers
from .._spectral_error import spectral_norms
from ..fast.estimate_constants import (
    EPS,
    LEAST_NOISE,
    LEAST_OF_BOUND,
    MEASURED_ROUNDING,
    OTHER_ROUNDINGS,
    ROUNDING_BY_CHANCE,
)
from ..interpolant import Interpolant
from .step_loop import largest_angle, quaternions_alone
from .step_record import StepRecord

# Numbers of quaternions at once: eight megabytes.
_MOST_NUMBERS = 1_000_000
# Groups of neighbouring panels, and times in each at which samples are compared with the series.
_GROUPS = 16
_TIMES = 8
# Of a group, none of them a node: a low-discrepancy sequence.
_PLACES = np.sort(np.mod(0.5 + 0.6180339887498949 * np.arange(1.0, _TIMES + 1.0), 1.0))
# Times of a motion at which its rate and inertia are looked at.
_PLACES_OF_MOTION = 17
# The channels of I^-1 and of I^-1 L_o.
_PARTS = slice(0, 6), slice(6, 9)


def measured_rounding(
    bound: Array,
    interpolant: Interpolant,
    steps: Integers,
    record: StepRecord,
    magnitudes: Array,
    tolerance: float,
    sample: Callable[[Array], Array],
) -> Array:
    """The bound (B,) [rad], and where it takes up most of the tolerance what it is by marches that round otherwise.

    The bound supposes that all rounding meets the growth of errors at its worst. Series whose samples are rounded
    otherwise show what it does meet: each of some marches on such series is off by rounding of its own.

    Parameters
    ----------
    steps : (P,) on each panel of one loop
    record : of these steps
    magnitudes : (B,) of the momentum [kg m^2/s]
    sample : the channels at times of the first loop, (N,) -> (N, 9)
    """
    large = bound > MEASURED_ROUNDING * tolerance
    if not np.count_nonzero(large) or not len(rows := np.flatnonzero(large & np.isfinite(bound))):
        return bound
    apart = np.zeros(len(rows))
    scatter = SampleScatter(interpolant, sample)
    at_once = max(1, _MOST_NUMBERS // record.quaternions[0].size)
    for number in range(OTHER_ROUNDINGS):
        series = interpolant.coefficients + scatter.of_series(number)
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


def rounding_of_body(interpolant: Interpolant, steps: Integers, record: StepRecord, magnitudes: Array) -> Array:
    """Attitude error because inertia and times are rounded before anything is sampled: (B,) [rad].

    Inertia is off by eps |I| in any direction, which turns a body that spins at omega off by eps |I| |I^-1 omega| a
    second: of a slender body about its long axis that is as many units a radian as its moments differ by. Times are off
    by eps times the duration. No march shows either, since all have them in common.

    Parameters
    ----------
    steps : (P,) on each panel of one loop
    record : of these steps
    magnitudes : (B,) of the momentum [kg m^2/s]
    """
    ends = np.cumsum(steps)
    chosen = np.unique(np.linspace(0, interpolant.loops * int(ends[-1]), _PLACES_OF_MOTION).astype(np.int64))
    of_loop = chosen % ends[-1]
    panel = np.searchsorted(ends, of_loop, side="right")
    share = (of_loop - ends[panel] + steps[panel]) / steps[panel]
    inverse, drift = interpolant.inverse_and_drift(interpolant.edges[panel] + share * interpolant.widths[panel])
    rates = np.broadcast_to(-drift, (len(magnitudes), *drift.shape))
    if record.directions.shape[1]:
        rates = rates + magnitudes[:, None, None] * np.einsum("bmi,mij->bmj", record.directions[:, chosen], inverse)
    sizes = 1.0 / np.linalg.eigvalsh(inverse)[:, 0]
    off = sizes * np.linalg.norm(np.einsum("bmi,mij->bmj", rates, inverse), axis=2)
    inverse_rate, drift_rate = spectral_norms(interpolant.coefficients).sum(axis=1).max(axis=0)
    fastest = magnitudes * inverse_rate + drift_rate
    return EPS * float(interpolant.edges[-1]) * (off.mean(axis=1) + fastest)


class SampleScatter:
    """How samples of a deformation scatter about the series through them.

    What they are off by at times that are no nodes is taken as it is, all nine channels of one time together: of a body
    that hardly resists turning about one axis, samples scatter in that direction more than in others.
    """

    def __init__(self, interpolant: Interpolant, sample: Callable[[Array], Array]) -> None:
        coefficients = interpolant.coefficients
        panels = len(coefficients)
        groups = min(panels, _GROUPS)
        firsts = panels * np.arange(groups + 1) // groups
        ends = interpolant.edges[firsts]
        times = ends[:-1, None] + (ends[1:] - ends[:-1])[:, None] * _PLACES
        there = np.minimum(interpolant.panel_of(times.ravel()), panels - 1)
        off = sample(times.ravel()) - interpolant.channels(times.reshape(-1, 1), there)[:, 0]
        sizes = np.abs(coefficients).max(axis=1)
        self._sizes = np.stack([sizes[:, part].max(axis=1) for part in _PARTS], axis=1)
        for which, part in enumerate(_PARTS):
            size = self._sizes[there, which][:, None]
            off[:, part] = np.divide(off[:, part], size, out=np.zeros_like(off[:, part]), where=size > 0.0)
        self._off = off.reshape(groups, _TIMES, 9)
        self._group = np.repeat(np.arange(groups), np.diff(firsts))
        self._counts = _independent_terms(interpolant)
        self._shape = coefficients.shape

    def of_series(self, number: int) -> Array:
        """Errors (P, n, 9) of the series through samples with other scatter of this kind, the same for a number."""
        rng, (panels, terms, _) = np.random.default_rng(number), self._shape
        weights = rng.standard_normal((panels, terms, _TIMES)) * np.sqrt(2.0 / _TIMES)
        weights /= np.sqrt(self._counts)[:, None, None]
        noise = weights @ self._off[self._group]
        # Steps round otherwise where samples do not scatter at all, too.
        noise += LEAST_NOISE * EPS * rng.uniform(-1.0, 1.0, noise.shape)
        noise[np.arange(terms) >= self._counts[:, None]] = 0.0
        for which, part in enumerate(_PARTS):
            noise[..., part] *= self._sizes[:, which, None, None]
        return noise


def _independent_terms(interpolant: Interpolant) -> Integers:
    """Over how many terms of the series of each panel the scatter of its samples is spread: (P,)."""
    coefficients = interpolant.coefficients if interpolant.sampled is None else interpolant.sampled
    there = np.abs(coefficients).max(axis=2) > 0.0
    counts = there.shape[1] - np.argmax(there[:, ::-1], axis=1)
    if interpolant.band is not None:
        counts = np.minimum(counts, interpolant.band + 1)
    halves = len(interpolant.coefficients) // len(counts)
    return np.repeat(np.maximum(counts // halves, 1), halves)
