"""A path that has been resolved in time: Chebyshev series on panels that halve, from which a sampler takes its own.

A path is cheap and a body is not. What is known of the path says on which panels, and to which degree, a function of
it must be sampled so that nothing of the path lies hidden between the nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..arrays import Array, Integers, Mask, lock_arrays, read_only
from ..chebyshev import chebyshev, local_coordinate, unit_nodes, values_to_coefficients

Made = TypeVar("Made")

# Of the series of a panel: about what a sampler at 1e-9 rad asks for.
DEGREE = 32
# Of the series of a sampler's panel, from which its hidden part is read: above the degree of most panels.
_TEST_DEGREE = 48
# The same of panels that reach over several resolved ones; the terms from which on it tells what is beyond it, and how
# many times their sum that may be.
_FINE_TEST_DEGREE = 128
_SEEN = 97
_NOT_SEEN = 4.0
# The most resolved panels that one such reaches over: the test is too coarse for more.
_FEW_LEAVES = 4
# Such panels at once, for some megabytes.
_PANELS_AT_ONCE = 64
# Of the largest value: smaller terms are rounding.
_ROUNDED = 0.5 * 2.0**-52
# [rad] What series at rest are off by rounding.
_RESTING = 1e-14
# Degrees that a path is looked at, and those that a panel is then sampled at first: a body's inertia swings faster than
# its shape. All of the latter can be doubled and trebled.
_DEGREES_OF_PATH = np.array([5, 10, 20, 30])
_FIRST_DEGREES = np.array([10, 15, 30, 40])
# Choices of panels, and what they hide, that are kept with a path.
_MOST_REMEMBERED = 64
# Stands for the degree of a panel that must be halved.
_IMPOSSIBLE = 1_000_000_000


@dataclass(frozen=True, eq=False)
class FirstPanels:
    """Panels for a sampler to begin with: degree (P,), 0 where nothing moves; left and right ends (P,) [s]."""

    degree: Integers
    left: Array
    right: Array


class Hidden(NamedTuple):
    """What the nodes of panels do not show of a path: (P, 5), shapes and rates times half the width, rates second."""

    table: Array

    @property
    def higher(self) -> Array:
        """Terms of higher degrees, which swing and mostly average out: (P, 2)."""
        return self.table[:, :2]

    @property
    def misfit(self) -> Array:
        """What series on these panels cannot follow: (P, 2)."""
        return self.table[:, 2:4]

    @property
    def noise(self) -> Array:
        """The larger of both: (P,)."""
        return self.table[:, 4]


@dataclass(frozen=True, eq=False)
class ResolvedPath:
    """Shapes and rates as Chebyshev series on panels and on their halves, down to where they are right to rounding.

    Attributes
    ----------
    left, right : (N,) ends of the panels [s]
    coefficients : (N, DEGREE + 1, 2 n) of the shapes and of their rates
    misfit : (N, 2) how far the path is from them: shapes, and rates times half the width; 0 for resolved panels
    noise : (N,) of resolved panels, the larger of the same, where their series cannot follow noise
    children : (N,) row of the left half, which the right one follows; -1: resolved
    roots : (R,) rows of the widest panels, in the order of time
    duration : [s]
    defect : sum over the resolved panels of the largest difference between the integral of a rate and its shape [rad]
    """

    left: Array
    right: Array
    coefficients: Array
    misfit: Array
    noise: Array
    children: Integers
    roots: Integers
    duration: float
    defect: float = 0.0
    _first: dict[float, FirstPanels] = field(default_factory=dict, init=False, repr=False)
    _hidden: dict[tuple[bytes, bytes, bytes], Hidden] = field(default_factory=dict, init=False, repr=False)

    __post_init__ = lock_arrays

    @cached_property
    def leaves(self) -> Integers:
        """The rows of the resolved panels, in the order of time."""
        rows = np.flatnonzero(self.children < 0)
        return read_only(rows[np.argsort(self.left[rows])])

    def first_panels(self, tolerance: float) -> FirstPanels:
        """The panels and degrees with the fewest samples that leave less than `tolerance` [rad] of the path hidden."""
        found = self._first.get(tolerance)
        return _remembered(self._first, tolerance, self._chosen(tolerance)) if found is None else found

    def _chosen(self, tolerance: float) -> FirstPanels:
        tails = self._tails(self.coefficients) + self.misfit.max(axis=1)[:, None]
        fits = tails[:, _DEGREES_OF_PATH] <= tolerance
        fits[:, -1] |= self.children < 0
        degree = np.where(fits.any(axis=1), _FIRST_DEGREES[np.argmax(fits, axis=1)], _IMPOSSIBLE)
        moving = self.coefficients[:, :, self._n_shape :].any(axis=(1, 2)) | (self.misfit > 0.0).any(axis=1)
        # Values without rates, as of an inertia that is given, move nevertheless.
        moving |= tails[:, 0] > _RESTING
        degree[~moving] = 0
        cost, splits = degree + 1, np.zeros(len(degree), dtype=bool)
        # Halves stand behind what they are halves of.
        for row in np.flatnonzero(self.children >= 0)[::-1]:
            child = self.children[row]
            halves = cost[child] + cost[child + 1]
            if halves < cost[row]:
                cost[row], splits[row] = halves, True
        kept: list[Integers] = []
        rows = self.roots
        while len(rows):
            kept.append(rows[~splits[rows]])
            halved = self.children[rows[splits[rows]]]
            rows = np.concatenate([halved, halved + 1])
        chosen = np.concatenate(kept)
        chosen = chosen[np.argsort(self.left[chosen])]
        return FirstPanels(degree[chosen], self.left[chosen], self.right[chosen])

    def hidden(self, left: Array, right: Array, degree: Integers) -> Hidden:
        """What of the path lies beyond the degrees (P,) of panels [rad]; of degree zero nothing does."""
        key = degree.tobytes(), left.tobytes(), right.tobytes()
        found = self._hidden.get(key)
        return _remembered(self._hidden, key, self._found_hidden(left, right, degree)) if found is None else found

    def _found_hidden(self, left: Array, right: Array, degree: Integers) -> Hidden:
        rows, half = self._smallest_around(left, right), 0.5 * (right - left)
        table = np.empty((len(left), 5))
        table[:, 2:4], table[:, 4] = self.misfit[rows], self.noise[rows]
        nodes = _nodes(left, right, _TEST_DEGREE)
        local = local_coordinate(nodes, self.left[rows, None], self.right[rows, None])
        beyond = _terms_beyond(chebyshev(local, DEGREE + 1) @ self.coefficients[rows], degree)
        table[:, :2] = self._sums(beyond, half)
        # A panel of more degrees than the series here follows the path better than these do.
        halved = np.flatnonzero((self.children[rows] >= 0) & (degree > 0))
        if len(halved):
            first, last = self._leaves_within(left[halved], right[halved])
            halved = halved[last - first < _FEW_LEAVES]
            for start in range(0, len(halved), _PANELS_AT_ONCE):
                some = halved[start : start + _PANELS_AT_ONCE]
                table[some] = self._hidden_of_halves(left[some], right[some], degree[some], table[some])
        table[degree == 0] = 0.0
        return Hidden(table)

    def _hidden_of_halves(self, left: Array, right: Array, degree: Integers, table: Array) -> Array:
        """The table of panels that reach over several resolved ones, from these; as it is where they have noise."""
        nodes, leaves = _nodes(left, right, _FINE_TEST_DEGREE), self.leaves
        first, last = self._leaves_within(left, right)
        # At the end of a panel its own last one, from which rates may jump to the next.
        place = np.searchsorted(self.left[leaves], nodes, side="right") - 1
        place = np.clip(place, first[:, None], last[:, None]).ravel()
        values = np.empty((nodes.size, self.coefficients.shape[2]))
        order = np.argsort(place, kind="stable")
        for these in np.split(order, 1 + np.flatnonzero(np.diff(place[order]))):
            row = leaves[place[these[0]]]
            local = local_coordinate(nodes.ravel()[these], self.left[row], self.right[row])
            values[these] = chebyshev(local, DEGREE + 1) @ self.coefficients[row]
        beyond, half = _terms_beyond(values.reshape(*nodes.shape, -1), degree), 0.5 * (right - left)
        terms = np.arange(_FINE_TEST_DEGREE + 1)
        # What is far beyond the degree is seen as something slow, and does not average out.
        is_far = (terms > 1.5 * degree[:, None])[:, :, None]
        far = self._sums(beyond * is_far, half) + _NOT_SEEN * self._sums(beyond[:, _SEEN:], half)
        found = np.array(table)
        found[:, :2], found[:, 2:4] = self._sums(beyond * ~is_far, half), np.minimum(far, table[:, 2:4])
        noisy = (self.noise[leaves][place].reshape(nodes.shape) > 0.0).any(axis=1)
        worse = noisy | (found[:, :4].sum(axis=1) > table[:, :4].sum(axis=1))
        return np.where(worse[:, None], table, found)

    def _leaves_within(self, left: Array, right: Array) -> tuple[Integers, Integers]:
        """The first and last places of resolved panels, in the order of time, within others: (P,), (P,)."""
        leaves, slack = self.leaves, 1e-9 * (right - left)
        first = np.searchsorted(self.right[leaves], left + slack, side="right")
        return first, np.searchsorted(self.left[leaves], right - slack) - 1

    def _sums(self, terms: Array, half: Array) -> Array:
        """Of terms (P, k, 2 n), the largest of shapes, and of rates times half the width: (P, 2)."""
        sums = terms.sum(axis=1)
        shapes, rates = sums[:, : self._n_shape], sums[:, self._n_shape :]
        return np.stack([shapes.max(axis=1, initial=0.0), half * rates.max(axis=1, initial=0.0)], axis=1)

    def reversed(self) -> ResolvedPath:
        """Of the path in the opposite order of time."""
        signs = np.where(np.arange(DEGREE + 1) % 2, -1.0, 1.0)[:, None]
        coefficients = self.coefficients * signs
        coefficients[:, :, self._n_shape :] *= -1.0
        children = self.children
        order = np.arange(len(children))
        # The halves of a panel change places.
        for first in children[children >= 0]:
            order[[first, first + 1]] = order[[first + 1, first]]
        ends = self.duration - self.right[order], self.duration - self.left[order]
        return replace(
            self,
            left=ends[0],
            right=ends[1],
            coefficients=coefficients[order],
            misfit=self.misfit[order],
            noise=self.noise[order],
            children=children[order],
            roots=self.roots[::-1],
        )

    def stretched(self, factor: float) -> ResolvedPath:
        """Of the path `factor` times as slowly."""
        coefficients = self.coefficients.copy()
        coefficients[:, :, self._n_shape :] /= factor
        return replace(
            self,
            left=self.left * factor,
            right=self.right * factor,
            coefficients=coefficients,
            duration=self.duration * factor,
        )

    def reordered(self, order: Integers) -> ResolvedPath:
        """Of the path with its joints in another order."""
        columns = np.concatenate([order, self._n_shape + order])
        return replace(self, coefficients=self.coefficients[:, :, columns])

    @property
    def _n_shape(self) -> int:
        return self.coefficients.shape[2] // 2

    def _tails(self, coefficients: Array) -> Array:
        """Sums of the coefficients beyond each degree, the worst of shapes and of rates times half the width."""
        sizes = np.abs(coefficients)
        sizes[:, :, self._n_shape :] *= 0.5 * (self.right - self.left)[:, None, None]
        sums = np.cumsum(sizes[:, ::-1], axis=1)[:, ::-1]
        beyond = np.zeros(sums.shape[:2])
        beyond[:, :-1] = sums[:, 1:].max(axis=2, initial=0.0)
        return beyond

    def _smallest_around(self, left: Array, right: Array) -> Integers:
        """The row of the smallest panel that holds each of others: (P,), (P,) -> (P,)."""
        middle = 0.5 * (left + right)
        rows = self.roots[np.clip(np.searchsorted(self.left[self.roots], middle, side="right") - 1, 0, None)]
        while True:
            first = self.children[rows]
            half = np.where(middle >= self.left[first + 1], first + 1, first)
            slack = 1e-9 * (right - left)
            holds: Mask = (first >= 0) & (self.left[half] <= left + slack) & (self.right[half] >= right - slack)
            if not holds.any():
                return rows
            rows = np.where(holds, half, rows)


def _nodes(left: Array, right: Array, degree: int) -> Array:
    """Of panels: (P,), (P,) -> (P, degree + 1) [s]."""
    return 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * unit_nodes(degree)


def _terms_beyond(values: Array, degree: Integers) -> Array:
    """Sizes of the terms beyond degrees (P,) of series through values at nodes, rounding as zero: (P, k, 2 n)."""
    test = values.shape[1] - 1
    series = np.abs(values_to_coefficients(test) @ values)
    series *= series > _ROUNDED * np.abs(values).max(axis=1, keepdims=True)
    series *= (np.arange(test + 1) > degree[:, None])[:, :, None]
    return series


def _remembered(known: dict[Any, Any], key: Any, value: Made) -> Made:
    """Keep a result for the next motion along the same path, which may be in another thread."""
    if len(known) >= _MOST_REMEMBERED:
        known.clear()
    known[key] = value
    return value


def joined(paths: Sequence[ResolvedPath]) -> ResolvedPath:
    """Of several paths one after another."""
    starts = np.cumsum([0.0, *(path.duration for path in paths)])
    rows = np.cumsum([0, *(len(path.left) for path in paths)])
    return ResolvedPath(
        left=np.concatenate([path.left + start for path, start in zip(paths, starts, strict=False)]),
        right=np.concatenate([path.right + start for path, start in zip(paths, starts, strict=False)]),
        coefficients=np.concatenate([path.coefficients for path in paths]),
        misfit=np.concatenate([path.misfit for path in paths]),
        noise=np.concatenate([path.noise for path in paths]),
        children=np.concatenate(
            [np.where(p.children < 0, -1, p.children + row) for p, row in zip(paths, rows, strict=False)]
        ),
        roots=np.concatenate([path.roots + row for path, row in zip(paths, rows, strict=False)]),
        duration=float(starts[-1]),
        defect=sum(path.defect for path in paths),
    )
