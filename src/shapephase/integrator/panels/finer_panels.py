"""From panels that are too coarse to finer ones: of a higher degree, or halved."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...arrays import Array, Integers, Mask
from ..fast.estimate_constants import HALF_DEGREE, HIGHEST_DEGREE, MOST_MISSING, MOST_RAISED
from .panel_series import PanelSeries, sample_starts, sample_times


def refining_factors(series: PanelSeries, rough: Mask, errors: Array, share: Array) -> Integers:
    """How many times the degree each panel gets, 1: it stays as it is, 0: it is halved; (P,) each.

    `rough` : which do not stay
    `errors`, `share` : what each is off by, and what it may be [rad]
    """
    degree = series.degree
    with np.errstate(divide="ignore", invalid="ignore"):
        missing = np.log(np.maximum(errors / share, 1.0)) / series.estimate.decay
        # Without any missing degrees, the error was seen between the nodes: the degree is doubled.
        times = np.ceil(np.nan_to_num(missing / degree, nan=0.0, posinf=9.9) + 0.9)
    factor = np.clip(times, 2, MOST_RAISED).astype(np.int64)
    factor[(missing > MOST_MISSING * degree) | (factor * degree > HIGHEST_DEGREE)] = 0
    return np.where(rough, factor, 1)


@dataclass(frozen=True, eq=False)
class FinerPanels:
    """What becomes of panels, in the order of time.

    Attributes
    ----------
    origin : (Q,) the panel that each is made of
    factor : (Q,) how many times its degree it has, 1: it is the same, 0: it is one of its halves
    degree, left, right : (Q,)
    """

    origin: Integers
    factor: Integers
    degree: Integers
    left: Array
    right: Array

    @classmethod
    def of(cls, old: PanelSeries, factor: Integers) -> FinerPanels:
        """By factors as `refining_factors` finds them."""
        origin = np.repeat(np.arange(len(factor)), 1 + (factor == 0))
        factor, left, right = factor[origin], old.left[origin], old.right[origin]
        degree = np.where(factor == 0, HALF_DEGREE, old.degree[origin] * factor)
        first = np.flatnonzero(factor == 0)[::2]
        right[first] = left[first + 1] = 0.5 * (left[first] + right[first])
        return cls(origin, factor, degree, left, right)

    def fresh_times(self, end: float) -> Array:
        """Where nothing was sampled yet (S,) [s]; `end` as of `sample_times`."""
        return sample_times(self.degree, self.left, self.right, end)[self._is_fresh]

    def values(self, old: PanelSeries, fresh: Array) -> Array:
        """All samples, from those at the fresh times (S, 9) and those that there were."""
        is_fresh, known = self._is_fresh, self.factor > 0
        values = np.empty((len(is_fresh), 9))
        values[is_fresh] = fresh
        counts = (old.degree + 1)[self.origin[known]]
        within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
        values[~is_fresh] = old.values[np.repeat(old.starts[self.origin[known]], counts) + within]
        return values

    @cached_property
    def _is_fresh(self) -> Mask:
        """Of all samples, one panel after another."""
        starts, counts = sample_starts(self.degree)[:-1], self.degree + 1
        within = np.arange(int(counts.sum())) - np.repeat(starts, counts)
        factor = np.repeat(self.factor, counts)
        return (factor == 0) | (within % np.maximum(factor, 1) != 0)
