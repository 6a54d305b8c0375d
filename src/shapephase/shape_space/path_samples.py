"""The samples that a path was put through: derivatives by them, and the path through others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from ..errors import WrongObjectError
from .curves import PiecewisePolynomial, Reordered
from .interpolation import REST_TO_REST
from .shape_path import SampleOrigin, ShapePath, interpolated, without_joints


@dataclass(frozen=True, eq=False)
class PathSamples:
    """Samples of a path, its joints in the order of the path's columns.

    curve : the polynomials through the samples, or through what was made of them
    order : (n,) which column of theirs is which of the path's
    origin : how the values at their knots follow from the samples; None: they are the samples
    """

    curve: PiecewisePolynomial
    order: Integers
    origin: SampleOrigin | None

    @property
    def count(self) -> int:
        """Number of samples that may differ: the last of a periodic path is the first, unless both were recorded."""
        return self._at_knots if self.origin is None else len(self.origin.samples)

    @property
    def values(self) -> Array:
        """(count, n) [rad or m]."""
        if self.origin is not None:
            return self.origin.samples[:, self.order]
        return self.curve(self.curve.knots[: self._at_knots])[0][:, self.order]

    @property
    def bias(self) -> Array:
        """Known bias of smoothing at the knots: (knots n,) [rad or m]."""
        if self.origin is None:
            return np.zeros(self._at_knots * len(self.order))
        return self.origin.bias[:, self.order].ravel()

    @property
    def _at_knots(self) -> int:
        return len(self.curve.knots) - (self.curve.through == "periodic")

    def path_through(self, values: Array) -> ShapePath:
        """The path of the same kind through other samples (count, n), made of them in the same way."""
        if self.origin is None:
            return interpolated(self.curve.knots, values, self.curve.through)
        # The path may lack joints of the recording, as wheels.
        recorded = self.origin.samples.copy()
        recorded[:, self.order] = values
        whole = self.origin.path(recorded)
        kept = {*self.order.tolist()}
        return without_joints(whole, [name for k, name in enumerate(whole.joint_names or ()) if k not in kept])

    def derivative(self, times: Array, by_shape: Array, by_rate: Array) -> Array:
        """Sums over times of (N, k, n) derivatives by shapes and rates, by the samples: (k, count n)."""
        return self.by_samples(self.by_knots(times, by_shape, by_rate))

    def by_knots(self, times: Array, by_shape: Array, by_rate: Array) -> Array:
        """Sums over times of derivatives by shapes and rates, by the values at the knots: (k, knots n)."""
        from scipy.sparse import csc_array

        pieces, (powers, slopes, _) = self._basis(times)
        order, count, total = powers.shape[1], len(times), self.curve.coefficients.shape[1]
        # Sums over the times in each piece, for each power, as products with a matrix that has a column for each time.
        rows, ends = (np.arange(order) * total + pieces[:, None]).ravel(), order * np.arange(count + 1)
        whole = np.zeros((order * total, by_shape[0].size))
        for factors, values in ((powers, by_shape), (slopes, by_rate)):
            sums = csc_array((factors.ravel(), rows, ends), shape=(len(whole), count))
            whole += sums @ values.reshape(count, -1)
        return self.by_knots_of(whole.reshape(order, total, *by_shape.shape[1:]))

    def _basis(self, times: Array) -> tuple[Integers, Array]:
        """Piece of each time (N,), and derivatives of shape, rate and acceleration there by its coefficients.

        The latter (3, N, order).
        """
        curve = self.curve
        piece = np.searchsorted(curve.knots[1:-1], times, side="right")
        exponents = np.arange(len(curve.coefficients))
        rows = np.zeros((3, len(times), len(exponents)))
        rows[0] = (times - curve.knots[piece])[:, None] ** exponents
        for order in (1, 2):
            rows[order, :, 1:] = exponents[1:] * rows[order - 1, :, :-1]
        return piece, rows

    def rows_by_knots(self, times: Array) -> Array:
        """Shape, rate and acceleration of a joint at times (N,), by its own values at the knots: (3, N, knots)."""
        (pieces, rows), count = self._basis(times), len(times)
        order, total, _ = self.curve.coefficients.shape
        by_coefficients = np.zeros((order, total, 3, count))
        by_coefficients[:, pieces, :, np.arange(count)] = np.moveaxis(rows, 1, 0).swapaxes(1, 2)
        by_knots = self.by_knots_of(by_coefficients.reshape(order, total, 3 * count, 1))
        return by_knots.reshape(3, count, -1)

    def by_knots_of(self, by_coefficients: Array) -> Array:
        """Convert derivatives by coefficients, (order, pieces, k, n), to those by values at the knots: (k, knots n)."""
        curve, (order, pieces, count, n_shape) = self.curve, by_coefficients.shape
        rule = _rest_to_rest if curve.through == "rest to rest" else _spline
        given = by_coefficients.reshape(order, pieces, -1)
        by_knots = rule(np.diff(curve.knots), given, curve.through == "periodic").reshape(-1, count, n_shape)
        return np.moveaxis(by_knots, 0, 1).reshape(count, -1)

    def by_samples(self, by_knots: Array) -> Array:
        """Convert derivatives by the values at the knots to those by the samples: (k, knots n) -> (k, count n)."""
        return by_knots if self.origin is None else self._through(self.origin.by_samples, by_knots)

    def bias_by_samples(self, by_knots: Array) -> Array:
        """Convert derivatives by `bias` to those by the samples, from which it follows linearly, too."""
        if self.origin is None:
            return np.zeros_like(by_knots)
        return self._through(self.origin.bias_by_samples, by_knots)

    @property
    def rules(self) -> tuple[Callable[[Array], Array], ...]:
        """Conversions of derivatives by the values at the knots to those by the samples, for noise of these values, and
        to the estimate of their bias."""
        return self.by_samples, self.bias_by_samples

    def _through(self, rule: Callable[[Array], Array], by_knots: Array) -> Array:
        n_shape = len(self.order)
        of_curve = np.zeros((self._at_knots, len(by_knots), self.curve.coefficients.shape[2]))
        of_curve[:, :, self.order] = np.moveaxis(by_knots.reshape(len(by_knots), -1, n_shape), 1, 0)
        return np.moveaxis(rule(of_curve)[:, :, self.order], 0, 1).reshape(len(by_knots), -1)


def columns_without_samples(path: ShapePath) -> list[int]:
    """Joints without a column in the file, which rest."""
    resting = {} if path.record is None else path.record.get("at_rest", {})
    return [column for column, name in enumerate(path.joint_names or ()) if name in resting]


def path_samples(path: ShapePath) -> PathSamples:
    """The samples of a path; WrongObjectError if it was not put through any."""
    curve, order = path.curve, np.arange(path.n_shape)
    while isinstance(curve, Reordered):
        curve, order = curve.curve, curve.order[order]
    if not isinstance(curve, PiecewisePolynomial) or curve.through is None:
        raise WrongObjectError(
            "this path was not put through samples: derivatives by samples are those of ShapePath.spline, "
            "ShapePath.waypoints and of recorded motions"
        )
    return PathSamples(curve, order, path.origin)


def _rest_to_rest(widths: Array, by_coefficients: Array, _: bool) -> Array:
    """Convert derivatives by coefficients (6, pieces, m) to those by values at the knots: (pieces + 1, m)."""
    by_move = sum(
        factor * by_coefficients[power] / widths[:, None] ** power for power, factor in enumerate(REST_TO_REST, 3)
    )
    by_knots = np.zeros((len(widths) + 1, by_coefficients.shape[2]))
    by_knots[:-1] += by_coefficients[0] - by_move
    by_knots[1:] += by_move
    return by_knots


def _spline(widths: Array, by_coefficients: Array, periodic: bool) -> Array:
    """Derivatives by the values at the knots of a C2 cubic spline.

    With slopes s at the knots and the mean slope m of a piece, c1 = s, c2 = (3 m - 2 s - s_next)/h and
    c3 = (s + s_next - 2 m)/h^2.
    """
    h = widths[:, None]
    by_knots = np.zeros((len(widths) + 1, by_coefficients.shape[2]))
    by_second, by_third = by_coefficients[2] / h, by_coefficients[3] / h**2
    by_slope, by_mean = by_knots.copy(), 3.0 * by_second - 2.0 * by_third
    by_slope[:-1] += by_coefficients[1] - 2.0 * by_second + by_third
    by_slope[1:] += by_third - by_second
    if periodic:
        by_slope[0] += by_slope[-1]
        by_slope = by_slope[:-1]
    by_mean += _by_means(widths, by_slope, periodic)
    by_mean /= h
    by_knots[:-1] += by_coefficients[0] - by_mean
    by_knots[1:] += by_mean
    if periodic:
        by_knots[0] += by_knots[-1]
        by_knots = by_knots[:-1]
    return by_knots


def _by_means(h: Array, by_slopes: Array, periodic: bool) -> Array:
    """Convert derivatives by the slopes at the knots to those by the mean slopes: (knots, m) -> (pieces, m).

    At a knot h_after s_before + 2 (h_before + h_after) s + h_before s_after is 3 (h_after m_before + h_before m_after).
    Without a period the first two pieces, and the last two, are one cubic, of two pieces one parabola, of one a line.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import splu

    pieces, count = len(h), len(by_slopes)
    knots = np.arange(count) if periodic else np.arange(1, count - 1)
    before, after = h[knots - 1], h[knots % pieces]
    slopes = [(knots, knots - 1, after), (knots, knots, 2.0 * (before + after)), (knots, knots + 1, before)]
    means = [(knots, knots - 1, 3.0 * after), (knots, knots, 3.0 * before)]
    for knot, inward in () if periodic else ((0, 1), (count - 1, -1)):
        piece = 0 if knot == 0 else pieces - 1
        near, far = h[piece], h[piece + inward] if pieces > 1 else 0.0
        both = near + far
        weights = {1: (1.0, 0.0, 1.0, 0.0), 2: (1.0, 1.0, 2.0, 0.0)}
        own, other, here, there = weights.get(pieces, (far, both, far * (near + 2.0 * both) / both, near**2 / both))
        slopes += [(knot, knot, own), (knot, knot + inward, other)]
        means += [(knot, piece, here), (knot, piece + inward, there)]

    def matrix(entries: list[tuple[Any, Any, Any]], columns: int) -> Any:
        rows, places, values = (np.concatenate([np.atleast_1d(part) for part in parts]) for parts in zip(*entries))
        return coo_array((values, (rows, places % columns)), shape=(count, columns))

    answers = splu(matrix(slopes, count).T.tocsc()).solve(by_slopes)
    return np.asarray(matrix(means, pieces).T @ answers, dtype=np.float64)
