"""Which panels over several knots of a recorded path take the fewest samples of a body."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...arrays import Array, Integers, Mask
from ..resolved import FirstPanels
from .body_series import falling_terms
from .knot_path import KnotPath
from .polynomial_fit import missing_terms

# That panels are sampled at first; all but the highest can be doubled.
DEGREES = (4, 5, 6, 8, 12, 16, 24, 32)
# Samples that each interval between two knots takes by itself: panels over several must need fewer.
_LEAST_DEGREE = DEGREES[0]
# Intervals in a row that can be joined: fewer are sampled one by one sooner than the best way to join them is found.
_WORTH_A_SEARCH = 2000
# Intervals between knots that are planned together, so that memory stays bounded.
_AT_ONCE = 16384
# Of the tolerance: what one panel may hide within itself, and what all together may hide at the end.
_WITHIN_SHARE = 0.3
_ADDING_SHARE = 0.2
# Of the tolerance: a kink that hides more where only its two neighbours are joined is never spanned.
_KINK_SHARE = 1.0
# Of the tolerance: what the series of a body along a smooth part of the path may leave, all panels together.
_SMOOTH_SHARE = 0.1
# Of a body's series over several knots: how much smaller a term is than the one before, relative to the sweep.
_DECAY_OF_SWEEP = 0.25
# Of those degrees, how many are tried first on single intervals.
_FEW_DEGREES = 4
# Up to here, halves of a panel that hides little are not looked at: together they hardly ever need fewer samples.
_UNHALVED_DEGREE = 24
# Halves that together need this many times the samples of the whole are not halved further.
_HOPELESS = 1.2
# Rounds of the search for the price of an error.
_PRICES = 8
# A price at which samples do not count [1/rad].
_ANY_PRICE = 1e30


@dataclass(frozen=True, eq=False)
class _Goal:
    """What panels are chosen for."""

    rate: float  # of what they may add up to, by their width [rad/s]
    tolerance: float  # [rad]
    magnitude: float  # of the momentum [kg m^2/s]


@dataclass(frozen=True, eq=False)
class _Level:
    """Panels of one level of the tree: intervals (P,), what they cost by degree (P, d), and rows of their left halves.

    Inadmissible degrees cost infinitely much; children (P,) are -1 where a panel was not halved.
    """

    first: Integers
    last: Integers
    samples: Array
    adding: Array
    children: Integers


def first_panels(path: KnotPath, tolerance: float, magnitude: float) -> FirstPanels:
    """Panels and degrees with few samples that leave half of `tolerance` [rad] hidden, for momenta to a magnitude."""
    known = path.plans.get((tolerance, magnitude))
    if known is not None:
        return known
    goal = _Goal(tolerance / float(path.knots[-1]), tolerance, magnitude)
    ends = np.arange(len(path.knots))
    if len(ends) > _WORTH_A_SEARCH:
        # Nothing spans a knot over which not even its two neighbours can be joined, and short ways do not repay it.
        joined = np.flatnonzero(path.kinks() > _KINK_SHARE * tolerance)
        joined = np.union1d(np.union1d(joined, path.corners), np.arange(0, len(ends), _AT_ONCE))
        inner = np.ones(len(ends), dtype=bool)
        for first, last in pairwise(joined):
            inner[first + 1 : last] = last - first <= _WORTH_A_SEARCH
        ends = np.flatnonzero(inner)
    parts: list[tuple[Integers, Integers, Integers]] = []
    start = 0
    while start < len(ends) - 1:
        stop = max(start + 1, int(np.searchsorted(ends, ends[start] + _AT_ONCE, side="right")) - 1)
        chunk = ends[start : stop + 1]
        budget = _ADDING_SHARE * goal.rate * float(path.knots[chunk[-1]] - path.knots[chunk[0]])
        parts.append(_cheapest(_levels(path, chunk[:-1], chunk[1:], goal), budget))
        start = stop
    degree, first, last = (np.concatenate(column) for column in zip(*parts, strict=True))
    path.plans.clear()
    path.plans[tolerance, magnitude] = plan = FirstPanels(degree, path.knots[first], path.knots[last])
    return plan


def interval_degrees(path: KnotPath, first: Integers, tolerance: float, magnitude: float) -> Integers:
    """Degrees for single intervals between knots: (P,)."""
    goal = _Goal(tolerance / float(path.knots[-1]), tolerance, magnitude)
    good = _smooth_enough(path, first, first + 1, goal)
    return np.where(good.any(axis=1), np.array(DEGREES)[np.argmax(good, axis=1)], DEGREES[-1])


def _levels(path: KnotPath, start: Integers, stop: Integers, goal: _Goal) -> list[_Level]:
    """The trees of panels between pairs of knots, halved as long as that may save samples."""
    levels: list[_Level] = []
    above = np.zeros(0)
    while len(start):
        samples, adding = _costs(path, start, stop, goal)
        own = samples.min(axis=1)
        best = own.copy()
        if levels:
            worse = np.add.reduceat(own, np.arange(0, len(own), 2)) > _HOPELESS * above
            best[np.repeat(worse, 2)] = 0.0
        hidden = adding[np.arange(len(own)), np.argmin(samples, axis=1)]
        enough = hidden <= _ADDING_SHARE * goal.rate * (path.knots[stop] - path.knots[start])
        best[enough & (best <= _UNHALVED_DEGREE)] = 0.0
        halved = (best > _LEAST_DEGREE) & (stop - start > 1)
        children = np.full(len(start), -1)
        children[halved] = 2 * np.arange(int(halved.sum()))
        levels.append(_Level(start, stop, samples, adding, children))
        above = own[halved]
        middle = (start + stop)[halved] // 2
        start = np.stack([start[halved], middle], axis=1).ravel()
        stop = np.stack([middle, stop[halved]], axis=1).ravel()
    return levels


def _costs(path: KnotPath, first: Integers, last: Integers, goal: _Goal) -> tuple[Array, Array]:
    """Samples and what is hidden at the end of panels, by degree: (P, degrees) each."""
    degrees, spans = np.array(DEGREES), last - first
    good, still = _smooth_enough(path, first, last, goal), path.is_still(first, last)
    samples = np.where(still[:, None], 1.0, np.where(good, degrees, np.inf))
    adding = np.zeros(samples.shape)
    rows = np.flatnonzero((spans > 1) & ~still)
    if not len(rows):
        return samples, adding
    samples[rows] = np.where(degrees < _LEAST_DEGREE * spans[rows, None], samples[rows], np.inf)
    ends = path.knots[first[rows]], path.knots[last[rows]]
    panels = path.panels(*ends, first[rows], last[rows], goal.magnitude)
    limit = _WITHIN_SHARE * goal.tolerance
    allowed = np.isfinite(samples[rows])
    samples[rows] = np.inf
    highest = np.where(allowed.any(axis=1), allowed.shape[1] - 1 - np.argmax(allowed[:, ::-1], axis=1), -1)
    lowest = np.full(len(rows), -1)
    for column in range(len(degrees))[::-1]:
        tried = np.flatnonzero((highest == column) | (lowest == column))
        if not len(tried):
            continue
        found = path.measured(panels.of(tried), int(degrees[column]), goal.magnitude)
        kept = found.within <= limit
        samples[rows[tried[kept]], column] = degrees[column]
        adding[rows[tried], column] = found.adding
        # The lowest degree beyond which the series through the path has little left is tried, too.
        beyond = np.cumsum(found.sizes[:, ::-1], axis=1)[:, ::-1]
        fits = (beyond[:, np.minimum(degrees[:column] + 2, degrees[column] + 1)] <= limit) & allowed[tried, :column]
        if column:
            fresh = kept & (highest[tried] == column) & fits.any(axis=1)
            lowest[tried[fresh]] = np.argmax(fits[fresh], axis=1)
    return samples, adding


def _smooth_enough(path: KnotPath, first: Integers, last: Integers, goal: _Goal) -> Mask:
    """Whether the body's own series on panels ends before a degree, as if there were no knots: (P, degrees)."""
    left, right = path.knots[first], path.knots[last]
    degrees, width, sweep = np.array(DEGREES), right - left, path.sweep(left, right)
    adding = path.turn(left, right, goal.magnitude)[:, None] * (_DECAY_OF_SWEEP * sweep[:, None]) ** (degrees - 1.0)
    within = adding.copy()
    share = _SMOOTH_SHARE * goal.rate * width
    single = last - first == 1
    # Few degrees suffice for most intervals; those of a coarse recording need all.
    for count in (_FEW_DEGREES, len(DEGREES)):
        rows = np.flatnonzero(single)
        if not len(rows):
            break
        growth = falling_terms(path, left[rows], right[rows], goal.magnitude, 2 * DEGREES[count - 1] + 1)
        for column, degree in enumerate(DEGREES[:count]):
            both = missing_terms(degree, growth)
            adding[rows, column], within[rows, column] = width[rows] * both[0], width[rows] * both[1]
        single[rows[adding[rows, count - 1] <= share[rows]]] = False
    return (adding <= share[:, None]) & (within <= _SMOOTH_SHARE * goal.tolerance)


def _cheapest(levels: list[_Level], budget: float) -> tuple[Integers, Integers, Integers]:
    """Degree, first and last interval of the panels with the fewest samples that hide less than a budget [rad]."""
    low, high, price, kept = 0.0, np.inf, 0.0, None
    for _ in range(_PRICES):
        chosen, samples, hidden = _choice(levels, price)
        if hidden <= budget:
            high, kept = price, chosen
            if price == 0.0 or hidden > 0.8 * budget:
                break
        else:
            low = price
        # Errors fall with the third power of the samples, so at the best price they are worth a third of these.
        guess = max(price * (hidden / budget) ** 1.2, samples / (3.0 * hidden)) if hidden > 0.0 else price
        price = guess if low < guess < high else np.sqrt(low * high) if np.isfinite(high) and low else 4.0 * price
    if kept is None:
        kept, _, _ = _choice(levels, _ANY_PRICE)
    return kept


def _choice(levels: list[_Level], price: float) -> tuple[tuple[Integers, Integers, Integers], float, float]:
    """The cheapest panels where an error costs `price` samples a radian; their samples, and what they hide."""
    degrees = np.array(DEGREES)
    below = np.zeros(0)
    splits: list[Mask] = []
    columns: list[Integers] = []
    for level in levels[::-1]:
        costs = level.samples + price * level.adding
        column = np.argmin(costs, axis=1)
        cost = costs[np.arange(len(costs)), column]
        halved = level.children >= 0
        split = np.zeros(len(cost), dtype=bool)
        if halved.any():
            halves = np.add.reduceat(below, np.arange(0, len(below), 2))
            split[halved] = halves < cost[halved]
            cost[split] = halves[split[halved]]
        # Where nothing is admissible, the highest degree has to do: the sampler will see.
        splits.append(split)
        columns.append(column)
        below = cost
    found: list[tuple[Integers, Integers, Integers]] = []
    samples = hidden = 0.0
    rows = np.arange(len(levels[0].first))
    for level, split, column in zip(levels, splits[::-1], columns[::-1], strict=True):
        whole = rows[~split[rows]]
        own = level.samples[whole, column[whole]]
        degree = np.where(own == 1.0, 0, np.where(np.isfinite(own), degrees[column[whole]], degrees[-1]))
        found.append((degree, level.first[whole], level.last[whole]))
        samples += float(degree.sum())
        hidden += float(level.adding[whole, column[whole]].sum())
        halves = level.children[rows[split[rows]]]
        rows = np.stack([halves, halves + 1], axis=1).ravel()
    degree, first, last = (np.concatenate(part) for part in zip(*found, strict=True))
    return (degree, first, last), samples, hidden
