"""What the steps' formula misses of each term of a Chebyshev series: how errors fall when steps are more.

Of a motion about one axis the error of steps is the defect of a quadrature, term by term. Of any other motion the sum
of these defects is no measure of the error itself, but from steps taken two at a time to single ones it falls as that
does.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from math import inf, log2
from typing import NamedTuple

import numpy as np

from ...arrays import Array, Integers, read_only
from ..fast.estimate_constants import (
    AT_REST,
    BY_CHANCE,
    DEFECT_DEGREES,
    DEFECT_STEPS,
    DEGREES_OF_TURN,
    FORESEEN,
    FULL_ORDER,
    LEAST_ORDER,
    LITTLE_TURN,
    MOST_GROWTH_BY_CHANCE,
    NEARLY_AT_REST,
    ORDER,
    POWER_OF_EVENNESS,
    TINY,
    UNRESOLVED,
)
from .rotation_step import tableau
from .step_record import ends_of_pairs

# Of sums of stages by weights up to six.
_ROUNDING = 1e-14


def defect_table() -> Array:
    """Of the term T_k on a panel of width one the largest at any end of a step: [m, k].

    In m equal steps; in row DEFECT_STEPS + 1 + m, in m that are twice as long as one more among them. Rows of m = 0 are
    zero. (2 (DEFECT_STEPS + 1), DEFECT_DEGREES).
    """
    return _tables()[0]


def signed_defects() -> Array:
    """Of the term T_k on a panel of width one in m equal steps, in its middle and at its end: [m, ., k].

    Those of a series are sums of them, in which most of the high terms cancels. Rows of m = 0 are zero.
    (DEFECT_STEPS + 1, 2, DEFECT_DEGREES).
    """
    return _tables()[1]


@lru_cache(maxsize=1)
def _tables() -> tuple[Array, Array]:
    equal = [np.arange(steps + 1.0) / steps for steps in range(1, DEFECT_STEPS + 1)]
    odd = [2 * steps + 1 for steps in range(1, DEFECT_STEPS + 1)]
    found = _defects_along([*equal, *(ends_of_pairs(np.array([steps]), 1) / float(steps) for steps in odd)])
    # Low terms are integrated exactly: what is left of them is rounding.
    found = [np.where(np.abs(one) > _ROUNDING, one, 0.0) for one in found]
    table = np.zeros((2 * (DEFECT_STEPS + 1), DEFECT_DEGREES))
    signed = np.zeros((DEFECT_STEPS + 1, 2, DEFECT_DEGREES))
    for steps, (of_equal, of_odd) in enumerate(zip(found[:DEFECT_STEPS], found[DEFECT_STEPS:], strict=True), 1):
        table[steps], table[DEFECT_STEPS + 1 + steps] = (np.abs(one).max(axis=0) for one in (of_equal, of_odd))
        signed[steps] = of_equal[[(steps - 1) // 2, -1]]
    return read_only(table), read_only(signed)


def _defects_along(every: list[Array]) -> list[Array]:
    """Of every term up to the ends of steps, but the first, with these ends of [0, 1]: (L, DEFECT_DEGREES) each."""
    _, weights, nodes = tableau()
    first, last = (np.concatenate([ends[part] for ends in every]) for part in (slice(-1), slice(1, None)))
    widths = last - first
    stages = _terms(2.0 * (first[:, None] + widths[:, None] * nodes) - 1.0)
    ends = [_terms(2.0 * end - 1.0) for end in (first, last)]
    defects = np.empty((len(widths), DEFECT_DEGREES))
    before, here = np.zeros((2, len(widths))), np.array([next(terms) for terms in ends])
    for k in range(DEFECT_DEGREES):
        after = np.array([next(terms) for terms in ends])
        # But for a constant.
        twice_integral = after / (k + 1) - before / (k - 1) if k > 1 else here * here if k else 2.0 * after
        defects[:, k] = (next(stages) @ weights) * widths - 0.25 * (twice_integral[1] - twice_integral[0])
        before, here = here, after
    counts = np.cumsum([len(ends) - 1 for ends in every])
    return [np.cumsum(part, axis=0) for part in np.split(defects, counts[:-1])]


def _terms(x: Array) -> Iterator[Array]:
    """T_0, T_1 ... of numbers."""
    term, following = np.ones_like(x), x
    while True:
        yield term
        term, following = following, 2.0 * x * following - term


class Defects(NamedTuple):
    """Of all panels, each term weighed by its size.

    Attributes
    ----------
    whole, coarse : of the steps and of pairs of them; without momentum, of twice as many steps and of the steps [rad]
    unresolved : of the steps, by terms that these do little about [rad]
    evenness : of the panels' part in `coarse`, one over their number where all comes from one panel
    paired : how many of the steps belong to a pair, of one
    """

    whole: float
    coarse: float
    unresolved: float
    evenness: float
    paired: float

    @property
    def remaining(self) -> float:
        """The part of the distance from pairs that the error of the steps is."""
        least = FULL_ORDER / self.paired
        return min(max(self.whole / self.coarse, least), 1.0) if self.coarse > 0.0 else least

    @property
    def order(self) -> float:
        """By which power of the steps' length errors fall."""
        return min(max(-log2(self.remaining), LEAST_ORDER), ORDER)

    def excess(self, loops: int, tolerance: float) -> float:
        """What all steps would be off by, were nothing to cancel, as a multiple of what a tolerance [rad] allows."""
        return loops * self.remaining * self.coarse / (FORESEEN * tolerance)

    def error(
        self, distance: Array, loops: int, amplification: Array | float = 1.0, turn_by_momentum: float = inf
    ) -> Array:
        """Bound of the error of steps by their distance from pairs of them, (B,) [rad].

        `amplification` : of an error from one time to a later one, (B,): what grows most hides the rest of the distance
        `turn_by_momentum` : how far the body turns by its momentum alone [rad]
        """
        cancelled = np.maximum(loops * self.coarse / np.maximum(distance, TINY), 1.0)
        factor = BY_CHANCE * self.evenness**-POWER_OF_EVENNESS * np.sqrt(np.sqrt(np.sqrt(np.sqrt(cancelled))))
        share = turn_by_momentum / LITTLE_TURN
        factor = factor * np.sqrt(np.minimum(amplification, MOST_GROWTH_BY_CHANCE))
        factor = factor * (1.0 + NEARLY_AT_REST / (1.0 + share * share))
        return np.minimum(np.maximum(factor * self.remaining * distance, loops * self.unresolved), distance)

    def error_at_rest(self, distance: Array, loops: int) -> Array:
        """Bound of the error of steps without momentum by their distance from twice as many, (B,) [rad]."""
        nearer = min(self.remaining, 0.5)
        return AT_REST * distance / (1.0 - nearer) + loops * self.unresolved


class PanelDefects:
    """What the formula misses on panels, in numbers of steps that are still looked for.

    Parameters
    ----------
    rates : (P, n) the size of each term [rad]
    turns : (P,) how far the body turns on each panel, which makes terms swing faster as seen from space [rad]
    """

    def __init__(self, rates: Array, turns: Array) -> None:
        self._rates, self._further = rates, DEGREES_OF_TURN * turns
        # Every term at once where no degree is beyond the table.
        self._within_table = rates.shape[1] + max(self._further.tolist()) < DEFECT_DEGREES - 1.0
        self._below = self._further.astype(np.int64)
        self._share = (self._further - self._below)[:, None]

    def found(self, steps: Integers) -> Defects:
        """In so many steps on each panel: (P,), at least two."""
        count, terms = self._rates.shape
        if self._is_tabulated(steps):
            windows = self._windows(steps)
            found = windows[..., :-1] + self._share * (windows[..., 1:] - windows[..., :-1])
        else:
            found = _term_by_term(steps, terms, self._further)
        found *= self._rates
        whole, coarse = found
        sums = found.reshape(2 * count, terms) @ ones(terms)
        return _summed_up(steps, sums, float(whole[whole > UNRESOLVED * coarse].sum()))

    def _is_tabulated(self, steps: Integers) -> bool:
        return self._within_table and max(steps.tolist()) <= DEFECT_STEPS

    def _windows(self, steps: Integers) -> Array:
        """Of T_0, T_1 ... and one more, in so many steps and in pairs of them, at each panel: (2, P, n + 1)."""
        return _windows(self._rates.shape[1] + 1)[_tabulated_rows().take(steps, axis=1), self._below]


def _summed_up(steps: Integers, of_panels: Array, unresolved: float) -> Defects:
    """From the sums of each panel's defects, of its steps and then of pairs of them: (2 P,)."""
    # Few numbers are added sooner one by one.
    counts, sums = steps.tolist(), of_panels.tolist()
    coarse = sums[len(counts) :]
    total, squares = sum(coarse), sum(part * part for part in coarse)
    return Defects(
        whole=sum(sums[: len(counts)]),
        coarse=total,
        unresolved=unresolved,
        evenness=total * total / (len(counts) * squares) if squares > 0.0 else 1.0,
        paired=sum(count - count % 2 for count in counts) / sum(counts),
    )


@lru_cache(maxsize=64)
def ones(count: int) -> Array:
    """(count,) that sum up rows by a product."""
    return np.ones(count)


@lru_cache(maxsize=64)
def _windows(terms: int) -> Array:
    """The table from each degree on: (rows, degrees, terms)."""
    return np.lib.stride_tricks.sliding_window_view(defect_table(), terms, axis=1)


@lru_cache(maxsize=1)
def _tabulated_rows() -> Integers:
    """The rows of the table for numbers of steps and for pairs of them: (2, DEFECT_STEPS + 1)."""
    return _rows(np.arange(DEFECT_STEPS + 1))


def _rows(steps: Integers) -> Integers:
    """(N,) -> (2, N); beyond the table they go on as if it did."""
    # Of an odd number the pairs have rows of their own.
    return np.array([steps, steps // 2 + (DEFECT_STEPS + 1) * (steps % 2)])


def _term_by_term(steps: Integers, terms: int, further: Array) -> Array:
    """Of T_0, T_1 ... in steps and in pairs of them, beyond the table's steps and degrees: (P,) -> (2, P, terms).

    As in the most steps that it has, for the terms that swing as fast at the panel's ends.
    """
    counts = np.array([steps, steps // 2])
    fewer = np.minimum(counts, DEFECT_STEPS)
    slower = np.sqrt(fewer / counts)[..., None]
    degrees = np.minimum((np.arange(float(terms)) + further[:, None]) * slower, DEFECT_DEGREES - 1.001)
    below, table = degrees.astype(np.int64), defect_table()
    place = (_rows(steps) - counts + fewer)[..., None] * DEFECT_DEGREES + below
    first, second = table.take(place), table.take(place + 1)
    return slower * slower * (first + (degrees - below) * (second - first))
