"""Panels sampled at Chebyshev points, the series through the samples, and what these are off by."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import sqrt

import numpy as np

from ...arrays import Array, Integers, Mask
from ...chebyshev import end_margin, nodes_of, values_to_coefficients
from .._spectral_error import SpectralEstimate, averaged_share, estimate_spectra, spectral_norms
from ..fast import engine
from ..fast.estimate_constants import NOISE_FACTOR
from ..fast.panels import errors_of_panels, series_of_panels, times_of_samples
from ..resolved import Hidden


@dataclass(frozen=True, eq=False)
class PanelSeries:
    """Panels in the order of time, each of a degree of its own.

    Attributes
    ----------
    degree, left, right, width : (P,) the ends and what is between them [s]
    values : (S, 9) channels at the ascending Chebyshev points, panel after panel
    coefficients : (P, n, 9) of the Chebyshev series through them, padded with zeros
    estimate : of their errors
    gaps : (P, 2) errors seen between the nodes; NaN: not looked at
    """

    degree: Integers
    left: Array
    right: Array
    width: Array
    values: Array
    coefficients: Array
    estimate: SpectralEstimate
    gaps: Array

    @classmethod
    def of(
        cls, degree: Integers, left: Array, right: Array, values: Array, coefficients: Array, table: Array
    ) -> PanelSeries:
        """That nobody looked at between the nodes; `table` : of `estimate`."""
        gaps = np.empty((len(degree), 2))
        gaps.fill(np.nan)
        return cls(degree, left, right, right - left, values, coefficients, SpectralEstimate(table), gaps)

    @cached_property
    def starts(self) -> Integers:
        """The first sample of each panel, and their number: (P + 1,)."""
        return sample_starts(self.degree)

    def with_gaps(self, rows: Integers, gaps: Array) -> PanelSeries:
        """The same after a look between the nodes of some panels (R,), which found gaps (R, 2)."""
        seen = self.gaps.copy()
        seen[rows] = gaps
        return replace(self, estimate=self.estimate.raised_to(2.0 * gaps, rows), gaps=seen)


@dataclass(frozen=True, eq=False)
class PanelErrors:
    """What panels are off by, a row of `table` each: (P,) [rad].

    Attributes
    ----------
    table : (4, P) attitude error due to what lies between the samples; its part that a path which is resolved has
        beyond the nodes; noise of that path; and last how far the body may turn
    """

    table: Array

    @property
    def whole(self) -> Array:
        """The error of each panel."""
        return self.table[0]

    @property
    def hidden(self) -> Array:
        """Its part that the nodes do not show."""
        return self.table[1]

    @property
    def noise(self) -> Array:
        """Of the path."""
        return self.table[2]

    @cached_property
    def _sums(self) -> list[float]:
        return np.add.reduce(self.table, axis=1).tolist()

    @property
    def total(self) -> float:
        """The errors of all panels, noise apart."""
        return self._sums[0]

    @property
    def total_hidden(self) -> float:
        """Their parts that the nodes do not show."""
        return self._sums[1]

    @property
    def total_turn(self) -> float:
        """How far the body may turn on all of them."""
        return self._sums[3]

    @cached_property
    def sum_of_noise(self) -> float:
        """Of panels whose noise is independent of one another."""
        return sum_of_noise(self.noise)


def sample_starts(degree: Integers) -> Integers:
    """The first sample of each panel, and their number: (P,) -> (P + 1,)."""
    starts = np.zeros(len(degree) + 1, dtype=np.int64)
    np.cumsum(degree + 1, out=starts[1:])
    return starts


def sample_times(degree: Integers, left: Array, right: Array, end: float) -> Array:
    """The Chebyshev points of panels, one after another; the first and last moved to this side of a break: (S,) [s].

    `end` : of all panels [s]
    """
    margin = end_margin(right - left, end)
    if engine.is_ready():
        return times_of_samples(degree, left, right, margin)
    times, starts, moved = nodes_of(left, right, degree), sample_starts(degree), degree > 0
    times[starts[:-1][moved]] = (left + margin)[moved]
    times[starts[1:][moved] - 1] = (right - margin)[moved]
    return times


def series_through(degree: Integers, left: Array, right: Array, values: Array, end: float, moved: Mask) -> PanelSeries:
    """Through samples (S, 9), which are corrected in their place where the ends of panels were `moved` (P,)."""
    shift = np.where(moved & (degree > 0), 2.0 * end_margin(right - left, end) / (right - left), 0.0)
    rounding = 2.0 * np.spacing(np.abs(right)) / (right - left)
    if engine.is_ready():
        coefficients, table = series_of_panels(degree, values, shift, rounding)
    else:
        coefficients = _coefficients(degree, values, shift)
        table = estimate_spectra(spectral_norms(coefficients), degree, rounding).table
    return PanelSeries.of(degree, left, right, values, coefficients, table)


def _coefficients(degree: Integers, values: Array, shift: Array) -> Array:
    """Of the series; the values at the ends are moved along their slopes by `shift` (P,) half widths."""
    degrees = sorted(set(degree.tolist()))
    if len(degrees) == 1:
        return _of_one_degree(degrees[0], values.reshape(len(degree), -1, 9), shift)
    coefficients = np.zeros((len(degree), degrees[-1] + 1 if degrees else 1, 9))
    starts = sample_starts(degree)[:-1]
    for one in degrees:
        rows = np.flatnonzero(degree == one)
        places = starts[rows, None] + np.arange(one + 1)
        there = values[places]
        coefficients[rows, : one + 1] = _of_one_degree(one, there, shift[rows])
        values[places] = there
    return coefficients


def _of_one_degree(degree: int, values: Array, shift: Array) -> Array:
    """The same of panels alike, with values (P, degree + 1, 9)."""
    matrix = values_to_coefficients(degree)
    series = matrix @ values
    if degree and np.count_nonzero(shift):
        slopes = end_slopes(degree) @ series * (shift[:, None, None] * _OUTWARDS)
        series += matrix[:, [0, -1]] @ slopes
        values[:, [0, -1]] += slopes
    return series


# From this side of an end to the end itself, on the left and on the right.
_OUTWARDS = np.array([[-1.0], [1.0]])


@lru_cache(maxsize=64)
def end_slopes(degree: int) -> Array:
    """Chebyshev coefficients -> slopes at -1 and 1: (2, degree + 1)."""
    degrees = np.arange(degree + 1.0)
    return np.stack([(-1.0) ** (degrees + 1.0), np.ones_like(degrees)]) * degrees**2


def panel_errors(series: PanelSeries, hidden: Hidden | None, momentum: float) -> PanelErrors:
    """Of an attitude, for a momentum of this magnitude; hidden: as the series' panels have it, None: nothing is."""
    estimate, width = series.estimate, series.width
    if engine.is_ready():
        of_path = None if hidden is None else hidden.table
        return PanelErrors(errors_of_panels(series.degree, width, estimate.table, of_path, momentum))
    phase = np.asarray(2.0 * series.degree, dtype=np.float64)
    table = np.zeros((4, len(width)))
    table[0] = estimate.error(momentum, width, phase)
    # A shape that is off turns the body by the inertia, for as long as the panel lasts.
    turn = momentum * estimate.inverse_norm * width
    table[3] = turn + width * estimate.drift_norm
    if hidden is not None:
        share = averaged_share(phase, table[3])
        of_path = (share * hidden.higher[:, 0] + hidden.misfit[:, 0]) * turn + share * hidden.higher[:, 1]
        table[1] = of_path + hidden.misfit[:, 1]
        table[2] = hidden.noise * (1.0 + turn)
        np.maximum(table[0], table[1], out=table[0])
    return PanelErrors(table)


def sum_of_noise(noise: Array) -> float:
    """Of panels whose noise is independent of one another: (P,)."""
    squares = float(noise @ noise)
    return min(float(noise.sum()), NOISE_FACTOR * sqrt(squares)) if squares else 0.0
