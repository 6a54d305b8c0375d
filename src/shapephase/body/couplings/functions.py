"""Functions of one coordinate that are a polynomial between any two knots: everything that joints follow others by."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...arrays import Array, Integers, finite_array
from ...display import frozen
from ...errors import ShapeError

_GAP = 1e-9  # of the sizes on both sides of a knot: more is a jump in the value or the slope
MOST_DEGREE = 30  # of a polynomial: higher powers of radians or metres are noise
MOST_KNOTS = 10_000  # of one function: measured ones have about ten


class Expansion(NamedTuple):
    """Values of a function, its first and its second derivatives at coordinates, each of their shape."""

    value: Array
    slope: Array
    bend: Array


@frozen
class JointFunction:
    """sum_p coefficients[p, i] (q - centres[i])^p between the knots i - 1 and i; the first and last piece have no end.

    knots : (m,) ascending, at which one piece ends and the next begins; none for a polynomial
    centres : (m + 1,) of the pieces
    coefficients : (order, m + 1)
    """

    knots: Array
    centres: Array
    coefficients: Array

    def __call__(self, coordinate: Array) -> Expansion:
        """Value, slope and bend: (...) each; at a knot those of the piece behind it."""
        return self._on(np.searchsorted(self.knots, coordinate, side="right"), coordinate)

    @cached_property
    def kinks(self) -> Array:
        """The knots at which the slope jumps."""
        _, left, right = self._sides()
        return self.knots[np.abs(left - right) > _GAP * (np.abs(left) + np.abs(right))]

    def scaled(self, factor: float) -> JointFunction:
        """The function times a number."""
        return JointFunction(self.knots, self.centres, factor * self.coefficients)

    def steepest(self, lower: float, upper: float) -> float:
        """The largest slope, as a size, between two coordinates; infinite where it is not bounded."""
        ends = np.concatenate([[-np.inf], self.knots, [np.inf]])
        steepest = 0.0
        for piece, centre in enumerate(self.centres):
            low, high = max(lower, ends[piece]), min(upper, ends[piece + 1])
            if low > high:
                continue
            own = np.polynomial.Polynomial(np.trim_zeros(self.coefficients[:, piece], "b")).deriv()
            if not (np.isfinite(low) and np.isfinite(high)):
                if own.degree() > 0:
                    return np.inf
                low = high = float(centre)
            turns = own.deriv().roots() if own.degree() > 1 else np.zeros(0)
            turns = np.clip(turns.real, low - centre, high - centre)
            steepest = max(steepest, float(np.abs(own(np.array([low - centre, high - centre, *turns]))).max()))
        return steepest

    def check_continuous(self) -> None:
        """Raise ShapeError where a piece does not go on where the one before ends."""
        jumps, _, _ = self._sides()
        if not len(jumps):
            return
        size = np.abs(self.coefficients[0]).max() + np.abs(self.coefficients[1:2]).max(initial=0.0) * np.ptp(self.knots)
        if not np.abs(jumps).max() <= _GAP * size:
            worst = int(np.argmax(np.abs(jumps)))
            raise ShapeError(f"the function jumps by {jumps[worst]:.6g} at {self.knots[worst]:.6g}; it must go on")

    def _sides(self) -> tuple[Array, Array, Array]:
        """Jumps of the value at the knots, and the slopes before and behind."""
        before, behind = (self._on(np.arange(len(self.knots)) + side, self.knots) for side in (0, 1))
        return behind.value - before.value, before.slope, behind.slope

    def _on(self, piece: Integers, coordinate: Array) -> Expansion:
        since = coordinate - self.centres[piece]
        value, slope, bend = (np.zeros(np.shape(coordinate)) for _ in range(3))
        for coefficients in self.coefficients[::-1]:
            bend = np.asarray(bend * since + 2.0 * slope)
            slope = np.asarray(slope * since + value)
            value = np.asarray(value * since + coefficients[piece])
        return Expansion(value, slope, bend)


def polynomial(coefficients: Array, about: float = 0.0) -> JointFunction:
    """sum_p coefficients[p] (q - about)^p."""
    powers = finite_array(coefficients, "coefficients", (None,))
    if powers.ndim != 1 or not 1 <= len(powers) <= MOST_DEGREE + 1:
        raise ShapeError(f"coefficients: from 1 to {MOST_DEGREE + 1} numbers are needed, got shape {powers.shape}")
    return JointFunction(np.zeros(0), np.array([float(about)]), powers[:, None].copy())


def piecewise_linear(knots: Array, values: Array) -> JointFunction:
    """Straight between the points, and on beyond them."""
    return hermite(knots, values, None)


def cubic_spline(knots: Array, values: Array, ends: str) -> JointFunction:
    """The C2 cubic spline through points; beyond them it goes on straight.

    ends : "not-a-knot", "natural", or "four points", where the third derivative at both ends is that of the cubic
        through the four points there (Forsythe, Malcolm and Moler 1977, section 4.4: SPLINE)
    """
    from scipy.interpolate import CubicSpline

    x, y = _points(knots, values)
    return hermite(x, y, _four_point_slopes(x, y) if ends == "four points" else CubicSpline(x, y, bc_type=ends)(x, 1))


def hermite(knots: Array, values: Array, slopes: Array | None) -> JointFunction:
    """Cubics with values and slopes at the knots, or without slopes straight lines; beyond them it goes on straight."""
    x, y = _points(knots, values)
    widths, rise = np.diff(x), np.diff(y) / np.diff(x)
    if slopes is None:
        coefficients = np.zeros((2, len(x) + 1))
        ends = rise[[0, -1]]
        coefficients[:, 1:-1] = y[:-1], rise
    else:
        s = finite_array(slopes, "slopes", x.shape)
        coefficients = np.zeros((4, len(x) + 1))
        ends = s[[0, -1]]
        coefficients[:, 1:-1] = (
            y[:-1],
            s[:-1],
            (3.0 * rise - 2.0 * s[:-1] - s[1:]) / widths,
            (s[:-1] + s[1:] - 2.0 * rise) / widths**2,
        )
    coefficients[:2, 0], coefficients[:2, -1] = (y[0], ends[0]), (y[-1], ends[1])
    return JointFunction(x, np.concatenate([x[:1], x]), coefficients)


def _four_point_slopes(x: Array, y: Array) -> Array:
    """Slopes of the spline whose third derivative at both ends is that of the cubic through four points, or zero."""
    widths, rise = np.diff(x), np.diff(y) / np.diff(x)
    if len(x) == 2:
        return np.array([rise[0], rise[0]])
    # For a sixth of the second derivatives: slopes go on, in the first and last piece the third derivative is given.
    matrix, right = np.zeros((len(x), len(x))), np.zeros(len(x))
    inner = np.arange(1, len(x) - 1)
    matrix[inner, inner - 1], matrix[inner, inner + 1] = widths[:-1], widths[1:]
    matrix[inner, inner] = 2.0 * (widths[:-1] + widths[1:])
    right[inner] = np.diff(rise)
    matrix[0, :2], matrix[-1, -2:] = [-1.0, 1.0], [-1.0, 1.0]
    if len(x) > 3:
        right[0], right[-1] = (width * _third_difference(x[p], y[p]) for width, p in (
            (widths[0], slice(0, 4)), (widths[-1], slice(-4, None)),
        ))  # fmt: skip
    bends = np.linalg.solve(matrix, right)
    return np.append(
        rise - widths * (2.0 * bends[:-1] + bends[1:]), rise[-1] + widths[-1] * (bends[-2] + 2.0 * bends[-1])
    )


def _third_difference(x: Array, y: Array) -> float:
    """The divided difference of four points."""
    first = np.diff(y) / np.diff(x)
    second = np.diff(first) / (x[2:] - x[:-2])
    return float((second[1] - second[0]) / (x[3] - x[0]))


def _points(knots: Array, values: Array) -> tuple[Array, Array]:
    x = finite_array(knots, "knots", (None,))
    if x.ndim != 1 or not 2 <= len(x) <= MOST_KNOTS:
        raise ShapeError(f"knots: from 2 to {MOST_KNOTS} numbers are needed, got shape {x.shape}")
    y = finite_array(values, "values", x.shape)
    late = np.flatnonzero(np.diff(x) <= 0.0)
    if len(late):
        raise ShapeError(f"knots must ascend: {x[late[0] + 1]:.9g} follows {x[late[0]]:.9g}")
    return x.copy(), y.copy()
