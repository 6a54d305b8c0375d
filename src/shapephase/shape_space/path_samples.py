"""The samples that a path was put through: derivatives by them, and the path through others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from ..errors import WrongObjectError
from .curves import PiecewisePolynomial, Reordered
from .shape_path import ShapePath

# The quintic of least jerk from 0 to 1: the powers 3, 4, 5 of the share of the time.
_REST_TO_REST = (10.0, -15.0, 6.0)


@dataclass(frozen=True, eq=False)
class PathSamples:
    """Samples of a path, its joints in the order of the path's columns.

    Attributes
    ----------
    curve : the polynomials through the samples, or through what was made of them
    order : (n,) which column of theirs is which of the path's
    """

    curve: PiecewisePolynomial
    order: Integers

    @property
    def count(self) -> int:
        """How many samples there are that may differ: of a periodic path the last is the first, unless both were
        recorded."""
        return self._at_knots if self.curve.origin is None else len(self.curve.origin.samples)

    @property
    def values(self) -> Array:
        """(count, n) [rad or m]."""
        origin = self.curve.origin
        if origin is not None:
            return origin.samples[:, self.order]
        return self.curve(self.curve.knots[: self._at_knots])[0][:, self.order]

    @property
    def bias(self) -> Array:
        """What smoothing took off the motion at the knots, as far as it is known: (knots n,) [rad or m]."""
        origin = self.curve.origin
        if origin is None:
            return np.zeros(self._at_knots * len(self.order))
        return origin.bias[:, self.order].ravel()

    @property
    def _at_knots(self) -> int:
        return len(self.curve.knots) - (self.curve.through == "periodic")

    def path_through(self, values: Array) -> ShapePath:
        """The path of the same kind through other samples (count, n), made of them in the same way."""
        times, origin = self.curve.knots, self.curve.origin
        if origin is not None:
            recorded = np.empty_like(values)
            recorded[:, self.order] = values
            return origin.path(recorded)
        if self.curve.through == "rest to rest":
            return ShapePath.waypoints(times, values)
        periodic = self.curve.through == "periodic"
        return ShapePath.spline(times, np.concatenate([values, values[:1]]) if periodic else values, periodic)

    def derivative(self, times: Array, by_shape: Array, by_rate: Array) -> Array:
        """Sums over times of (N, k, n) derivatives by shapes and rates, by the samples: (k, count n)."""
        return self.by_samples(self.by_knots(times, by_shape, by_rate))

    def by_knots(self, times: Array, by_shape: Array, by_rate: Array) -> Array:
        """The same by the values at the knots: (k, knots n)."""
        from scipy.sparse import coo_array

        curve = self.curve
        order, pieces, n_shape = curve.coefficients.shape
        piece = np.searchsorted(curve.knots[1:-1], times, side="right")
        exponents = np.arange(order)
        powers = (times - curve.knots[piece])[:, None] ** exponents
        slopes = np.zeros_like(powers)
        slopes[:, 1:] = exponents[1:] * powers[:, :-1]
        count = by_shape.shape[1]
        by_coefficients = np.zeros((order, pieces, count * n_shape))
        # Sums over the times in each piece, as products with a matrix of ones.
        within = coo_array((np.ones(len(times)), (piece, np.arange(len(times)))), shape=(pieces, len(times))).tocsr()
        of_shape, of_rate = by_shape.reshape(len(times), -1), by_rate.reshape(len(times), -1)
        for power in range(order):
            by_coefficients[power] = within @ (powers[:, power, None] * of_shape + slopes[:, power, None] * of_rate)
        rule = _rest_to_rest if curve.through == "rest to rest" else _spline
        found = rule(np.diff(curve.knots), by_coefficients, curve.through == "periodic")
        return np.moveaxis(found.reshape(-1, count, n_shape), 0, 1).reshape(count, -1)

    def by_samples(self, by_knots: Array) -> Array:
        """From derivatives by the values at the knots to those by the samples: (k, knots n) -> (k, count n)."""
        if self.curve.origin is None:
            return by_knots
        n_shape = len(self.order)
        of_curve = np.empty((self._at_knots, len(by_knots), n_shape))
        of_curve[:, :, self.order] = np.moveaxis(by_knots.reshape(len(by_knots), -1, n_shape), 1, 0)
        found = self.curve.origin.by_samples(of_curve)[:, :, self.order]
        return np.moveaxis(found, 0, 1).reshape(len(by_knots), -1)


def path_samples(path: ShapePath) -> PathSamples:
    """The samples of a path; WrongObjectError if it was not put through any."""
    curve, order = path.curve, np.arange(path.n_shape)
    while isinstance(curve, Reordered):
        curve, order = curve.curve, curve.order[order]
    if not isinstance(curve, PiecewisePolynomial) or curve.through is None:
        raise WrongObjectError(
            "this path was not put through samples: derivatives by samples are those of ShapePath.spline, "
            "ShapePath.waypoints and of recorded motions that no geodesic closes"
        )
    return PathSamples(curve, order)


def _rest_to_rest(widths: Array, by_coefficients: Array, _: bool) -> Array:
    """From derivatives by coefficients (6, pieces, m) to those by values at the knots: (pieces + 1, m)."""
    by_move = sum(
        factor * by_coefficients[power] / widths[:, None] ** power for power, factor in enumerate(_REST_TO_REST, 3)
    )
    found = np.zeros((len(widths) + 1, by_coefficients.shape[2]))
    found[:-1] += by_coefficients[0] - by_move
    found[1:] += by_move
    return found


def _spline(widths: Array, by_coefficients: Array, periodic: bool) -> Array:
    """As above, of the C2 cubic spline with slopes s at the knots: on a piece c1 = s and, with the mean slope m,
    c2 = (3 m - 2 s - s_next)/h, c3 = (s + s_next - 2 m)/h^2."""
    from scipy.sparse.linalg import splu

    h = widths[:, None]
    pieces = len(widths)
    by_slope = np.zeros((pieces + 1, by_coefficients.shape[2]))
    by_slope[:-1] += by_coefficients[1] - 2.0 * by_coefficients[2] / h + by_coefficients[3] / h**2
    by_slope[1:] += by_coefficients[3] / h**2 - by_coefficients[2] / h
    by_mean = 3.0 * by_coefficients[2] / h - 2.0 * by_coefficients[3] / h**2
    left, right = _slope_equations(widths, periodic)
    if periodic:
        by_slope[0] += by_slope[-1]
        by_slope = by_slope[:-1]
    by_mean = by_mean + right.T @ splu(left.T.tocsc()).solve(by_slope)
    found = np.zeros((pieces + 1, by_coefficients.shape[2]))
    found[:-1] += by_coefficients[0] - by_mean / h
    found[1:] += by_mean / h
    if periodic:
        found[0] += found[-1]
        found = found[:-1]
    return found


def _slope_equations(h: Array, periodic: bool) -> tuple[Any, Any]:
    """The equations left @ slopes = right @ means of a C2 cubic spline, periodic or with ends that are no knots."""
    from scipy.sparse import coo_array

    pieces = len(h)
    count = pieces if periodic else pieces + 1
    knots = np.arange(0 if periodic else 1, pieces)
    before, after = h[knots - 1], h[knots]
    rows, columns = np.tile(knots, 3), np.concatenate([knots, (knots - 1) % count, (knots + 1) % count])
    entries = np.concatenate([2.0 * (before + after), after, before])
    left = coo_array((entries, (rows, columns)), shape=(count, count)).tolil()
    sides = (np.tile(knots, 2), np.concatenate([(knots - 1) % pieces, knots]))
    right = coo_array((3.0 * np.concatenate([after, before]), sides), shape=(count, pieces)).tolil()
    if not periodic:
        _end_equation(left, right, h, 0, 1)
        _end_equation(left, right, h, -1, -1)
    return left.tocsc(), right.tocsc()


def _end_equation(left: Any, right: Any, h: Array, end: int, inward: int) -> None:
    """That the first two pieces, or the last two, are one cubic; of two pieces one parabola, of one a line."""
    pieces = len(h)
    knots, piece = pieces + 1, end % pieces
    here, next_knot = end % knots, (end + inward) % knots
    left[here, here] = 1.0
    if pieces == 1:
        right[here, 0] = 1.0
        return
    if pieces == 2:
        # The second derivative at the end is the one of the whole parabola.
        left[here, next_knot] = 1.0
        right[here, piece] = 2.0
        return
    other = (piece + inward) % pieces
    near, far = h[piece], h[other]
    both = near + far
    left[here, here], left[here, next_knot] = far, both
    right[here, piece] = (near + 2.0 * both) * far / both
    right[here, other] = near * near / both
