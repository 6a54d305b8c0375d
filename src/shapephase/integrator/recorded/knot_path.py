"""A recorded path, polynomials between knots, and what of it panels over several knots hide.

At a knot of a spline a derivative jumps, and a series over it converges slowly. Where a panel spans several knots, a
body is therefore sampled not along the path but along one polynomial with the path's values and slopes at the panel's
ends. How far the path is from it is known: the path is cheap, and on each panel a body turns it into its channels by a
nearly constant matrix. Since the ends agree, the attitude is off by as much within the panel only; what remains at its
end is that times what the body turns and the matrix changes in the panel.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...arrays import Array, Integers, Mask
from ...chebyshev import local_coordinate, nodes_on
from ..resolved import FirstPanels
from .polynomial_fit import basis, binomials, chebyshev_of_powers, fit_nodes, kink_errors, polynomial_fit

# Numbers in the largest intermediate array: a few megabytes.
_CHUNK = 1_000_000
# Panels with more knots each are taken one by one.
_MANY_KNOTS = 64
# Of what is hidden: the matrix that turns the path into channels varies between the times at which it is known.
_SAFETY_FACTOR = 1.5
# Coefficients of a piece of a spline.
_CUBIC = 4
# Degree at which two intervals together need fewer samples than each for itself.
_DEGREE_OF_TWO = 6
# Of the motion's duration: times nearer to each other than this are one, however a path was stretched or reversed.
_SAME_TIME = 1e-12
# Of the largest rate: where the rate changes by more at a knot, it jumps.
_JUMP = 1e-10
# Keeps quotients defined where nothing turns the body.
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Slopes:
    """How the channels of a body follow the joints along a path, at some times.

    Attributes
    ----------
    times : (C,) ascending [s]
    drift : (C, 3, n) of I^-1 L_o by the rates
    change_times : (D,) ascending, fewer [s]
    drift_changes : (D, n, 3, n) of `drift` by the shapes, whose joints count first
    inverse_changes : (D, 6, n) of I^-1 by the shapes: entries xx yy zz yz xz xy, the last three times the root of two
    inverse_norm : the largest norm of I^-1 [1/(kg m^2)]
    """

    times: Array
    drift: Array
    change_times: Array
    drift_changes: Array
    inverse_changes: Array
    inverse_norm: float

    def nearest(self, times: Array) -> Integers:
        """Rows of `drift` for times: (P,) -> (P,)."""
        return np.searchsorted(0.5 * (self.times[1:] + self.times[:-1]), times)

    def nearest_change(self, times: Array) -> Integers:
        """Rows of `drift_changes` and `inverse_changes` for times: (P,) -> (P,)."""
        return np.searchsorted(0.5 * (self.change_times[1:] + self.change_times[:-1]), times)


class PanelsOfPath(NamedTuple):
    """Panels over several intervals between knots.

    Attributes
    ----------
    left, right : (P,) ends [s]
    first, last : (P,) the intervals they reach over, and the one after the last
    matrices : (P, n, 3 or 9) from the joints to what the body's channels see of them, I^-1 L_o and, with momentum, I^-1
    """

    left: Array
    right: Array
    first: Integers
    last: Integers
    matrices: Array

    def of(self, rows: Mask | Integers) -> PanelsOfPath:
        """Some of them."""
        return PanelsOfPath(self.left[rows], self.right[rows], self.first[rows], self.last[rows], self.matrices[rows])


class Hidden(NamedTuple):
    """What some panels hide of the path, as the body's attitude has it: (P,) [rad].

    Attributes
    ----------
    adding : adds up from panel to panel
    within : does not
    explained : (P, degree + 1, 2) the path's own part in the coefficients of the body's channels, I^-1 and I^-1 L_o
    sizes : (P, degree + 2) of the coefficients of the polynomials that stand for the path
    """

    adding: Array
    within: Array
    explained: Array
    sizes: Array


class KnotPath:
    """A path of polynomials between knots, followed by a body."""

    def __init__(
        self,
        knots: Array,
        coefficients: Array,
        slopes: Callable[[], Slopes],
        follow: Callable[[Array, Array], tuple[Array, Array]],
        directly: Callable[[Array, Array], Array | None],
        corners: Integers | None = None,
    ) -> None:
        """A path and its body.

        Parameters
        ----------
        knots : (M,) first zero [s]
        coefficients : (order, M - 1, n) of powers of the time since each knot
        slopes : called when first needed
        follow : shapes (N, n), rates (N, n) -> I (N, 3, 3), L_o (N, 3)
        directly : the same as channels (N, 9), or None where only `follow` will do
        corners : knots that no panel spans, beside those at which the rate jumps
        """
        self.knots, self.follow, self.directly = knots, follow, directly
        self._pieces = np.moveaxis(coefficients, 0, 1)
        self._find_slopes = slopes
        steps = np.diff(knots)[:, None]
        ends, end_rates = _values(self._pieces, steps)
        self._moves = np.abs(ends - self._pieces[:, 0])
        gaps = np.abs(self._pieces[1:, 1] - end_rates[:-1]).max(axis=1, initial=0.0)
        jumps = 1 + np.flatnonzero(gaps > _JUMP * np.abs(end_rates).max(initial=0.0))
        jumps = jumps if corners is None else np.union1d(jumps, corners[(corners > 0) & (corners < len(steps))])
        self.corners: Integers = np.concatenate([[0], jumps, [len(steps)]])
        """The knots that no panel spans: where the rate jumps and those given, first and last the ends: (K,)."""
        self.plans: dict[tuple[float, float], FirstPanels] = {}
        """The last choice of panels, by tolerance and momentum."""
        still = ~self._pieces[:, 1:].any(axis=(1, 2))
        self._still_until = np.append(0, np.cumsum(still))

    @cached_property
    def slopes(self) -> Slopes:
        """How the body follows the path."""
        return self._find_slopes()

    @cached_property
    def weights(self) -> Array:
        """By how much the channels change with each joint, relative to themselves: (n,) [1/rad or 1/m]."""
        slopes = self.slopes
        of_inverse = np.sqrt((slopes.inverse_changes**2).sum(axis=1)).max(axis=0) / slopes.inverse_norm
        # Of the drift at rates as the path has them: arms of little inertia turn a body little, but change that much.
        typical = np.sqrt((self._pieces[:, 1] ** 2).mean(axis=0))
        size = np.sqrt(((slopes.drift * typical) ** 2).sum(axis=(1, 2)).max())
        changes = np.sqrt(((slopes.drift_changes * typical) ** 2).sum(axis=(2, 3)).max(axis=0))
        return np.maximum(of_inverse, changes / max(size, _TINY))

    @cached_property
    def rate_weights(self) -> Array:
        """How fast each joint turns the body at most: (n,)."""
        return np.asarray(np.sqrt((self.slopes.drift**2).sum(axis=1)).max(axis=0, initial=0.0))

    @cached_property
    def _integrals(self) -> Array:
        """Of the shapes over each interval: (M - 1, n)."""
        steps = np.diff(self.knots)[:, None]
        total = np.zeros_like(self._moves)
        for power in range(self._pieces.shape[1] - 1, -1, -1):
            total = total * steps + self._pieces[:, power] / (power + 1.0)
        return total * steps

    @cached_property
    def _swept(self) -> Array:
        """How much the channels may have changed until each knot, relative to themselves: (M,)."""
        return np.append(0.0, np.cumsum(self._moves @ self.weights))

    @cached_property
    def _turned(self) -> Array:
        """How much the path may have turned the body until each knot: (M,) [rad]."""
        return np.append(0.0, np.cumsum(self._moves @ self.rate_weights))

    def kinks(self) -> Array:
        """By how much one polynomial over two neighbouring intervals misses the path: at each knot (M,) [rad].

        Of splines, of which only the third derivative jumps; of other paths zero.
        """
        found = np.zeros(len(self.knots))
        if self._pieces.shape[1] != _CUBIC:
            return found
        jumps = np.diff(self._pieces[:, 3], axis=0)
        drift = self.slopes.nearest(self.knots[1:-1])
        runs = np.concatenate([[0], 1 + np.flatnonzero(np.diff(drift)), [len(drift)]])
        for start, stop in pairwise(runs):
            seen = jumps[start:stop] @ self.slopes.drift[drift[start]].T
            found[start + 1 : stop + 1] = np.sqrt((seen**2).sum(axis=1))
        half = 0.5 * (self.knots[2:] - self.knots[:-2])
        place = (self.knots[1:-1] - self.knots[:-2] - half) / half
        found[1:-1] *= _SAFETY_FACTOR * half**3 * np.interp(np.abs(place), *kink_errors(_DEGREE_OF_TWO))
        return found

    def is_still(self, first: Integers, last: Integers) -> Mask:
        """Whether nothing moves between knots: (P,)."""
        return np.asarray(self._still_until[last] - self._still_until[first] == last - first, dtype=bool)

    def middle(self, left: Array, right: Array) -> Array:
        """Where panels are halved: at the knot in their middle, if there is one within: (P,), (P,) -> (P,) [s]."""
        first, last = self.intervals(left, right)
        return np.where(last - first > 1, self.knots[(first + last) // 2], 0.5 * (left + right))

    def sweep(self, left: Array, right: Array) -> Array:
        """A bound of how much the body's channels change along panels, relative to themselves: (P,), (P,) -> (P,)."""
        return np.interp(right, self.knots, self._swept) - np.interp(left, self.knots, self._swept)

    def turn(self, left: Array, right: Array, magnitude: float) -> Array:
        """A bound of how much the body turns along panels with a momentum: (P,), (P,) -> (P,) [rad]."""
        by_path = np.interp(right, self.knots, self._turned) - np.interp(left, self.knots, self._turned)
        return (right - left) * (magnitude * self.slopes.inverse_norm) + by_path

    def intervals(self, left: Array, right: Array) -> tuple[Integers, Integers]:
        """The intervals between knots that panels reach over, the first and the one after the last: (P,) each."""
        slack = _SAME_TIME * self.knots[-1]
        first = np.searchsorted(self.knots, left + slack, side="right") - 1
        last = np.searchsorted(self.knots, right - slack, side="left")
        return np.clip(first, 0, len(self.knots) - 2), np.clip(last, 1, len(self.knots) - 1)

    def states(self, left: Array, right: Array, degree: int) -> tuple[Array, Array]:
        """Shapes and rates with which panels are sampled, at their Chebyshev points: (P, degree + 1, n) each."""
        first, last = self.intervals(left, right)
        if not degree:
            return _values(self._pieces[first, None], 0.5 * (left + right)[:, None, None] - self._starts(first))
        shapes, rates = np.empty((2, len(left), degree + 1, self._pieces.shape[2]))
        one = last - first == 1
        times = nodes_on(left[one], right[one], degree)[..., None] - self._starts(first[one])
        shapes[one], rates[one] = _values(self._pieces[first[one], None], times)
        over = ~one
        if over.any():
            data, start = self._data(left[over], right[over], first[over], last[over], degree)
            fit = polynomial_fit(degree)
            shapes[over] = start[:, None] + fit.shapes @ data
            rates[over] = (fit.slopes @ data) * (2.0 / (right - left)[over])[:, None, None]
        return shapes, rates

    def panels(self, left: Array, right: Array, first: Integers, last: Integers, magnitude: float) -> PanelsOfPath:
        """Panels, and how the body's channels see the path there."""
        slopes, middle = self.slopes, 0.5 * (left + right)
        matrices = slopes.drift[slopes.nearest(middle)]
        if magnitude:
            matrices = np.concatenate([matrices, slopes.inverse_changes[slopes.nearest_change(middle)]], axis=1)
        return PanelsOfPath(left, right, first, last, np.swapaxes(matrices, 1, 2))

    def hidden(self, left: Array, right: Array, degree: int, magnitude: float) -> Hidden:
        """Of panels that are sampled at a degree, for momenta up to a magnitude [kg m^2/s]."""
        first, last = self.intervals(left, right)
        adding, within = np.zeros((2, len(left)))
        explained, sizes = np.zeros((len(left), degree + 1, 2)), np.zeros((len(left), degree + 2))
        over = np.flatnonzero(last - first > 1)
        for rows in blocks(over, (8 * degree + last[over] - first[over]) * self._pieces.shape[2]):
            panels = self.panels(left[rows], right[rows], first[rows], last[rows], magnitude)
            found = self.measured(panels, degree, magnitude, explain=True)
            adding[rows], within[rows], explained[rows], sizes[rows] = found
        return Hidden(adding, within, explained, sizes)

    def measured(self, panels: PanelsOfPath, degree: int, magnitude: float, *, explain: bool = False) -> Hidden:
        """The same as seen at check points alone; at the knots too and with what is explained, if that is wanted."""
        left, right, first, last, matrices = panels
        parts = blocks(np.arange(len(left)), np.full(len(left), 8 * degree * self._pieces.shape[2]))
        if len(parts) > 1:
            found = [self.measured(panels.of(rows), degree, magnitude, explain=explain) for rows in parts]
            return Hidden(*(np.concatenate(column) for column in zip(*found, strict=True)))
        width = right - left
        data, start = self._data(left, right, first, last, degree)
        data, fit = data @ matrices, polynomial_fit(degree)
        place, since = self._places(nodes_on(left, right, 2 * degree), first, last)
        truth, _ = _values(self._pieces[place], since)
        gone = (fit.between @ data - (truth - start[:, None]) @ matrices) ** 2
        within, inverse = (np.sqrt(part.sum(axis=2).max(axis=1)) for part in (gone[..., :3], gone[..., 3:]))
        series = fit.series @ data[..., :3]
        there = self._at_knots(panels, series, start) if explain else np.zeros(len(left))
        mean = fit.mean @ data - self._means(panels, start)
        within = np.maximum(within, there)
        # By parts: the integral of what is missed, times how fast the body turns and the matrix changes, and once more.
        change = self.turn(left, right, magnitude) + 2.0 * self.sweep(left, right)
        means, of_inverse = (np.sqrt((part**2).sum(axis=1)) for part in (mean[:, :3], mean[:, 3:]))
        adding = change * (means + 0.5 * change * within)
        adding += width * magnitude * (of_inverse + change * inverse)
        explained = np.zeros((len(left), degree + 1, 2))
        order = self._pieces.shape[1]
        if explain and degree >= order:
            # What every polynomial piece has by itself is no sign of a knot.
            shapes, rates = (fit.series @ data[..., 3:])[:, order : degree + 1], fit.slope_series @ data[..., :3]
            explained[:, order:, 0] = np.sqrt((shapes**2).sum(axis=2))
            explained[:, order:, 1] = np.sqrt((rates[:, order:] ** 2).sum(axis=2)) * (2.0 / width)[:, None]
        return Hidden(
            *(_SAFETY_FACTOR * part for part in (adding, within, explained, np.sqrt((series**2).sum(axis=2))))
        )

    def local_series(self, left: Array, right: Array) -> tuple[Array, Array]:
        """Shapes and rates on panels within an interval as Chebyshev series: (P, order, n), (P, order - 1, n).

        What the shapes are at an interval's start is left out.
        """
        first, _ = self.intervals(left, right)
        pieces, order = self._pieces[first].copy(), self._pieces.shape[1]
        pieces[:, 0] = 0.0
        width, powers = (right - left)[:, None], np.arange(order)
        # Of the powers of the time since the panel's start, and from these to a series.
        shift = np.maximum(powers[:, None] - powers, 0)
        recentring = (left - self.knots[first])[:, None, None] ** shift * np.tril(binomials(order))
        recentred = np.swapaxes(recentring, 1, 2) @ pieces * (width**powers)[..., None]
        rates = recentred[:, 1:] * powers[1:, None] / width[..., None]
        return chebyshev_of_powers(order).T @ recentred, chebyshev_of_powers(order - 1).T @ rates

    def _starts(self, first: Integers) -> Array:
        return np.asarray(self.knots[first, None, None])

    def _places(self, times: Array, first: Integers, last: Integers) -> tuple[Integers, Array]:
        """The interval of each time of panels, and the time since its start: (P, k) -> (P, k), (P, k, 1)."""
        place = np.clip(np.searchsorted(self.knots, times, side="right") - 1, first[:, None], (last - 1)[:, None])
        return place, (times - self.knots[place])[..., None]

    def _data(self, left: Array, right: Array, first: Integers, last: Integers, degree: int) -> tuple[Array, Array]:
        """What `PolynomialFit` starts from, values less those at the left ends: (P, d + 2, n); and these (P, n)."""
        times = 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * fit_nodes(degree)
        place, since = self._places(times, first, last)
        shapes, rates = _values(self._pieces[place], since)
        slopes = 0.5 * (right - left)[:, None, None] * rates[:, [0, -1]]
        return np.concatenate([shapes - shapes[:, :1], slopes], axis=1), shapes[:, 0]

    def _means(self, panels: PanelsOfPath, starts: Array) -> Array:
        """The path's mean less its start (P, n), as the channels see it: (P, 3 or 9)."""
        ends = np.stack([panels.first, panels.last], axis=1).ravel()
        low, high = int(ends.min()), int(ends.max())
        integrals = np.concatenate([self._integrals[low:high], np.zeros((1, starts.shape[1]))])
        sums = np.add.reduceat(integrals, ends - low)[::2]
        return (((sums / (panels.right - panels.left)[:, None]) - starts)[:, None] @ panels.matrices)[:, 0]

    def _at_knots(self, panels: PanelsOfPath, series: Array, starts: Array) -> Array:
        """How far polynomials (P, d, 3) from shapes (P, n) on are from the recording at its knots: (P,)."""
        spans = panels.last - panels.first - 1
        worst = np.zeros(len(spans))
        if spans.sum() > _MANY_KNOTS * len(spans):
            for row, (left, right, first, last, matrix) in enumerate(zip(*panels, strict=True)):
                local = local_coordinate(self.knots[first + 1 : last], left, right)
                truth = (self._pieces[first + 1 : last, 0] - starts[row]) @ matrix[:, :3]
                gone = basis(local, series.shape[1]).T @ series[row] - truth
                worst[row] = np.sqrt((gone**2).sum(axis=1).max(initial=0.0))
            return worst
        owner = np.repeat(np.arange(len(spans)), spans)
        place = np.arange(len(owner)) - np.repeat(np.cumsum(spans) - spans - panels.first - 1, spans)
        local = local_coordinate(self.knots[place], panels.left[owner], panels.right[owner])
        truth = ((self._pieces[place, 0] - starts[owner])[:, None] @ panels.matrices[owner, :, :3])[:, 0]
        np.maximum.at(worst, owner, np.sqrt(((_series_at(series, local, owner) - truth) ** 2).sum(axis=1)))
        return worst


def _values(pieces: Array, since: Array) -> tuple[Array, Array]:
    """Polynomials (..., order, c) and their slopes at times since their starts (..., 1): (..., c) each."""
    order = pieces.shape[-2]
    shapes, rates = pieces[..., -1, :], np.zeros_like(pieces[..., -1, :])
    for power in range(order - 2, -1, -1):
        rates = rates * since + shapes
        shapes = shapes * since + pieces[..., power, :]
    return shapes, rates


def _series_at(series: Array, local: Array, owner: Integers) -> Array:
    """Chebyshev series (P, n, c) at coordinates of given panels: (K,), (K,) -> (K, c)."""
    later, last = np.zeros((2, len(local), series.shape[2]))
    twice = 2.0 * local[:, None]
    for k in range(series.shape[1] - 1, 0, -1):
        later, last = series[owner, k] + twice * later - last, later
    return np.asarray(series[owner, 0] + local[:, None] * later - last)


def blocks(rows: Integers, sizes: Integers, most: int = _CHUNK) -> list[Integers]:
    """Rows in blocks whose intermediate arrays, of these sizes each, stay small."""
    if not len(rows):
        return []
    number = np.cumsum(sizes) // most
    if not number[-1]:
        return [rows]
    return np.split(rows, np.flatnonzero(np.diff(number)) + 1)
