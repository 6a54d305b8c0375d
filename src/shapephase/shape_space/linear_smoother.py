"""Smoothing splines and low-pass filters, linear maps of samples: their penalties, transposes and responses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np

from ..arrays import Array
from ..display import frozen

ORDER = 3  # of the penalized derivative: quintic splines have a smooth second derivative
PILOT_ORDER = 5  # its spline shows the third derivative at the ends, where a quintic has none
BUTTERWORTH = 2  # order of the filter, run forwards and backwards
_HALF_POWER = np.sqrt(2.0) - 1.0  # in place of 1 at the cut-off: both passes give 1/sqrt(2), -3 dB
_NARROWEST = 10.0**-0.5  # least width tried, in steps of time: next to no smoothing
_WIDEST = 10.0**2.5  # largest width tried, in steps of time: beyond 300 samples rounding enters the bias
_WIDTHS_A_DECADE = 6  # tried; a parabola through the best and its neighbours has the optimum
_AT_ONCE = 16  # right sides: SuperLU goes through all of them at each row, and many leave the processor's cache
_ROUNDED = 4 * _WIDTHS_A_DECADE  # widths per decade that are used: joints of equal width are smoothed together


@frozen
class LinearSmoother:
    """f with the least sum of w (y - f)^2 + penalty * integral of (d^order f)^2, of each column by its own penalty.

    Its values are those of a spline of degree 2 order - 1, natural at the ends of what is open: derivatives from the
    order-th on are zero there.

    With `digital`, the values are those of a Butterworth filter of second order run forwards and backwards over evenly
    spaced samples: 1/(1 + penalty K) is its squared frequency response, and ends are free as those of a spline.

    times : (N,) of the samples, ascending from 0 [s]
    periodic : True if first and last sample are measurements of one value, which then weighs twice
    penalties : (n,) of each column [s^(2 order - 1)]; of zero, nothing is smoothed
    order : of the derivative that is penalized
    digital : True if K is that of the Butterworth filter, else it is that of the spline

    Source: Reinsch 1967; Wahba 1990, Spline Models for Observational Data, section 1.3; Pollock 2000, Journal of
    Econometrics 99, 317 (the filter of a finite stretch).
    """

    times: Array
    periodic: bool
    penalties: Array
    order: int = ORDER
    digital: bool = False

    @property
    def count(self) -> int:
        """Number of values."""
        return len(self.times) - self.periodic

    def __call__(self, values: Array) -> Array:
        """The smoothed values: (count, n) -> (count, n)."""
        return self.transposed((self.weights[:, None] * values)[:, None])[:, 0] / self.weights[:, None]

    def transposed(self, gradients: Array) -> Array:
        """Convert derivatives by smoothed values to those by the values: (count, m, n) -> (count, m, n)."""
        columns = gradients.copy()
        for penalty in np.unique(self.penalties[self.penalties > 0.0]):
            own = self.penalties == penalty
            right = gradients[:, :, own].reshape(self.count, -1)
            solved = self._system.solve_linear(float(penalty), right).reshape(self.count, -1, int(own.sum()))
            columns[:, :, own] = self.weights[:, None, None] * solved
        return columns

    def degrees_of_freedom(self) -> Array:
        """The trace of the map of each column: (n,)."""
        freedom = np.full(len(self.penalties), float(self.count))
        for penalty in np.unique(self.penalties[self.penalties > 0.0]):
            freedom[self.penalties == penalty] = self._system.trace(float(penalty))
        return freedom

    @property
    def weights(self) -> Array:
        """(count,)."""
        return self._system.weights

    @cached_property
    def _system(self) -> _Roughness:
        return _Roughness(self.times, self.periodic, self.order, digital=self.digital)


@dataclass(frozen=True)
class LowPass:
    """A Butterworth filter of second order, run forwards and backwards.

    cut_off : at which both passes together leave 1/sqrt(2) of an amplitude [Hz]
    rate : samples a second [Hz]

    Both passes leave 1/(1 + (sqrt(2) - 1) (tan(pi f/rate)/tan(pi cut_off/rate))^4). Source: Winter 2009, Biomechanics
    and Motor Control of Human Movement, section 3.4.4.2.
    """

    cut_off: float
    rate: float

    @property
    def twice(self) -> LowPass:
        """The filter of twice the cut-off, on the scale of the tangent, which half the sampling rate ends."""
        return LowPass(self.rate / np.pi * float(np.arctan(2.0 * self._tangent)), self.rate)

    def response(self, frequency: Array) -> Array:
        """The share of an amplitude that is left."""
        with np.errstate(over="ignore"):
            return 1.0 / (1.0 + _HALF_POWER * (np.tan(np.pi * frequency / self.rate) / self._tangent) ** 4)

    def responses(self, count: int) -> Array:
        """The shares of what so many samples can hold beside a line: (count - 2,)."""
        return self.response(0.5 * self.rate * np.arange(1, count - 1) / (count - 1))

    def smoother(self, times: Array, periodic: bool, columns: int) -> LinearSmoother:
        """The filter of evenly spaced samples, so many columns alike."""
        unit = float(times[-1]) / (len(times) - 1)
        penalty = _HALF_POWER / (2.0 * self._tangent) ** 4 * unit ** (2 * BUTTERWORTH - 1)
        return LinearSmoother(times, periodic, np.full(columns, penalty), BUTTERWORTH, digital=True)

    @property
    def _tangent(self) -> float:
        return float(np.tan(np.pi * self.cut_off / self.rate))


def likeliest(
    times: Array, periodic: bool, values: Array, noise: Array, groups: list[list[int]], order: int = ORDER
) -> LinearSmoother:
    """The smoother of the penalties that are likeliest for samples whose noise is known.

    The spline is taken as a random function, whose derivative of the order is white noise of the variance
    noise^2/penalty: the penalty has the greatest likelihood of the samples beyond a polynomial.

    values, noise : (count, n), (n,) [rad or m]; a column without noise is left as it is
    groups : columns that have one penalty together

    Source: Wahba 1985, Annals of Statistics 13, 1378 (generalized maximum likelihood).
    """
    system = _Roughness(times, periodic, order)
    penalties = np.zeros(values.shape[1])
    most = min(_WIDEST, max(float(len(values)), 1.0))
    number = int(_WIDTHS_A_DECADE * np.log10(most / _NARROWEST)) + 1
    widths = _NARROWEST * 10.0 ** (np.arange(number) / _WIDTHS_A_DECADE)
    if not system.modes:
        return LinearSmoother(times, periodic, penalties, order)
    # About the first: what does not move has no digits to lose.
    about = values - values[0]
    squares, determinants = np.empty((len(widths), values.shape[1])), np.empty(len(widths))
    for row, width in enumerate(widths):
        squares[row], determinants[row] = system.likelihood(system.penalty_of(width), about)
    for group in groups:
        own = [column for column in group if noise[column] > 0.0]
        if own:
            misfit = (squares[:, own] / noise[own] ** 2).sum(axis=1)
            width = _least(np.log10(widths), misfit + len(own) * determinants)
            penalties[own] = system.penalty_of(10.0 ** (np.round(_ROUNDED * width) / _ROUNDED))
    return LinearSmoother(times, periodic, penalties, order)


def width_of(smoother: LinearSmoother) -> float:
    """The largest width that is smoothed over, in steps of time."""
    unit = float(smoother.times[-1]) / (len(smoother.times) - 1)
    scaled = float(smoother.penalties.max(initial=0.0)) / unit ** (2 * smoother.order - 1)
    return scaled ** (0.5 / smoother.order)


def _least(places: Array, values: Array) -> float:
    """Place of the minimum of the parabola through the least of evenly placed values and its neighbours."""
    best = int(np.argmin(values))
    if best in (0, len(values) - 1):
        return float(places[best])
    before, here, after = values[best - 1 : best + 2]
    bend = before - 2.0 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0.0 else 0.0
    return float(places[best] + shift * (places[best] - places[best - 1]))


class _Roughness:
    """The integral of the squared derivative of the spline through values f, as g . R g with R g = Q^T f.

    Q^T f are integrals of the derivative against B-splines M of integral one, R is their Gram matrix. Steps of time
    are the unit, and the B-splines are scaled to squares of integral one. f is the solution of

        [W     r Q] [f]   [W y]
        [r Q^T  -R] [g] = [ 0 ],    r^2 = penalty,

    whose condition grows as r: that of the normal equations for g grows as its square, and no digit would be left
    where a hundred samples are smoothed over.
    """

    def __init__(self, times: Array, periodic: bool, order: int, *, digital: bool = False) -> None:
        self._unit = float(times[-1]) / (len(times) - 1)
        self._order = order
        self._count = len(times) - periodic
        self.weights = np.ones(self._count)
        if digital:
            self._differences, self._gram = _butterworth(self._count, periodic)
        else:
            self.weights[0] = 2.0 if periodic else 1.0
            self._differences, self._gram = _splines(times / self._unit, periodic, order)
        self.modes = self._count - (1 if periodic else order)
        """What is penalized at all: all but constants, or polynomials below the order."""

    def penalty_of(self, width: float) -> float:
        """Penalty of a width in steps of time: a swing with it, in radians a step, is halved [s^(2 order - 1)]."""
        return float(width ** (2 * self._order) * self._unit ** (2 * self._order - 1))

    def solve_linear(self, penalty: float, right: Array) -> Array:
        """(W + penalty K)^-1 right: (count, k) -> (count, k)."""
        if not self._differences.shape[1]:
            return right / self.weights[:, None]
        return self._with(self._factor(penalty), right)

    def likelihood(self, penalty: float, values: Array) -> tuple[Array, float]:
        """Misfits y . W (y - S y) of values (count, n): (n,), and the logarithm of the determinant of the samples'
        covariance in units of the noise, but for what no penalty changes."""
        factor = self._factor(penalty)
        weighted = self.weights[:, None] * values
        off = values - self._with(factor, weighted)
        determinant = float(np.log(np.abs(factor.U.diagonal())).sum())
        return (weighted * off).sum(axis=0), determinant - self.modes * float(np.log(self._scaled(penalty)))

    def trace(self, penalty: float) -> float:
        """Trace of S = (W + penalty K)^-1 W: count minus the slope of half the determinant's logarithm by log r."""
        step = 1e-3
        ahead, behind = (
            float(np.log(np.abs(self._factor(penalty * factor).U.diagonal())).sum())
            for factor in (1.0 + step, 1.0 / (1.0 + step))
        )
        return self._count - (ahead - behind) / (2.0 * np.log1p(step))

    def _scaled(self, penalty: float) -> float:
        return penalty / self._unit ** (2 * self._order - 1)

    def _factor(self, penalty: float) -> Any:
        from scipy.sparse.linalg import splu

        fixed, coupling = self._matrices
        return splu((fixed + np.sqrt(self._scaled(penalty)) * coupling).tocsc())

    @cached_property
    def _matrices(self) -> tuple[Any, Any]:
        """Matrices without the penalty, and multiplied by r."""
        from scipy.sparse import block_array, block_diag, diags_array

        fixed = block_diag([diags_array(self.weights), -self._gram])
        coupling = block_array([[None, self._differences], [self._differences.T, None]])
        places = self._places
        return tuple(matrix.tocsc()[places][:, places].tocsc() for matrix in (fixed, coupling))

    def _with(self, factor: Any, right: Array) -> Array:
        both = np.zeros((len(self._places), right.shape[1]))
        both[: len(right)] = right
        for first in range(0, right.shape[1], _AT_ONCE):
            columns = both[:, first : first + _AT_ONCE]
            columns[self._places] = factor.solve(columns[self._places])
        return both[: len(right)]

    @cached_property
    def _places(self) -> Any:
        """Values and B-splines in the order of time, so that the matrix is a band."""
        middles = np.arange(self._differences.shape[1]) + 0.5 * self._order
        return np.argsort(np.concatenate([np.arange(self._count), middles]), kind="stable")


def _butterworth(count: int, periodic: bool) -> tuple[Any, Any]:
    """Sparse Q (count, k) and R (k, k) of `_Roughness`, whose quotient |Q|^2/R is (2 tan(w/2))^4 at w radians a step.

    Q takes second differences, and R is what (1 + z)^2/4 leaves of white noise.
    """
    from scipy.sparse import coo_array

    splines = count if periodic else max(count - BUTTERWORTH, 0)
    first = np.arange(splines)

    def band(entries: Sequence[float] | Array, shift: int, rows: int) -> Any:
        places = first[:, None] + np.arange(len(entries)) + shift
        columns, values = np.broadcast_to(first[:, None], places.shape), np.broadcast_to(entries, places.shape)
        inside = np.ones_like(places, dtype=bool) if periodic else (places >= 0) & (places < rows)
        there = (values[inside], (places[inside] % max(rows, 1), columns[inside]))
        return coo_array(there, shape=(rows, splines)).tocsc()

    return band([1.0, -2.0, 1.0], 0, count), band(np.array([1, 4, 6, 4, 1]) / 16, -2, splines)


def _splines(times: Array, periodic: bool, order: int) -> tuple[Any, Any]:
    """Sparse Q (count, k) and R (k, k) of `_Roughness`: k B-splines, one from each knot, of so many pieces."""
    from numpy.polynomial.legendre import leggauss
    from scipy.sparse import coo_array, diags_array

    count = len(times) - periodic
    splines = count if periodic else max(count - order, 0)
    # The knots of a loop go on, round after round.
    rounds = np.arange(splines + order if periodic else count)
    knots_in_turn = times[:count][rounds % count] + times[-1] * (rounds // count)
    first = np.arange(splines)
    knots = knots_in_turn[first[:, None] + np.arange(order + 1)]
    apart = knots[:, :, None] - knots[:, None, :]
    apart[:, range(order + 1), range(order + 1)] = 1.0
    # The integral of M times a derivative is the divided difference times order!.
    entries = factorial(order) / np.prod(apart, axis=2)
    rows = (first[:, None] + np.arange(order + 1)) % count
    shape = (count, splines)
    differences = coo_array((entries.ravel(), (rows.ravel(), np.repeat(first, order + 1))), shape=shape).tocsc()
    nodes, shares = leggauss(order)
    lengths = np.diff(knots, axis=1)
    values = np.stack([_spline_values(knots, piece, 0.5 * (nodes + 1.0)) for piece in range(order)], axis=1)
    entries_of_gram: list[tuple[Any, Any, Any]] = []
    for shift in range(order):
        before = first if periodic else first[: splines - shift]
        after = (before + shift) % max(splines, 1)
        shared = [
            0.5 * lengths[before, piece] * (shares * values[before, piece] * values[after, piece - shift]).sum(axis=1)
            for piece in range(shift, order)
        ]
        entries_of_gram.append((sum(shared), before, after))
        if shift:
            entries_of_gram.append((sum(shared), after, before))
    entries, rows, columns = (np.concatenate(parts) for parts in zip(*entries_of_gram, strict=True))
    gram = coo_array((entries, (rows, columns)), shape=(splines, splines)).tocsc()
    scale: Any = diags_array(1.0 / np.sqrt(gram.diagonal()))
    return (differences @ scale).tocsc(), (scale @ gram @ scale).tocsc()


def _spline_values(knots: Array, piece: int, places: Array) -> Array:
    """B-splines of integral one at places of one of their pieces: (k, order + 1) -> (k, places).

    Source: de Boor 1978, A Practical Guide to Splines, chapter X.
    """
    order = knots.shape[1] - 1
    ends = knots[:, piece : piece + 2]
    at = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * places
    level = [np.where(k == piece, 1.0 / (ends[:, 1:] - ends[:, :1]), 0.0) * np.ones_like(places) for k in range(order)]
    for degree in range(2, order + 1):
        level = [
            degree
            / (degree - 1)
            * ((at - knots[:, [k]]) * level[k] + (knots[:, [k + degree]] - at) * level[k + 1])
            / (knots[:, [k + degree]] - knots[:, [k]])
            for k in range(order - degree + 1)
        ]
    return level[0]
