"""Bounds of a deformation over intervals of time, from the coefficients of its series and not from samples alone.

On every cell of an interval the nine channels (I^-1 and I^-1 L_o) and their rates lie within `radius` of `middle`: the
Chebyshev series of the sampled deformation is restricted to the cell, where |T_k| <= 1, and rounding and the estimated
error of sampling are added. That estimate is the one link of the chain that is no proof: a deformation is known by
evaluating it, and what happens between all the times at which it was asked nobody can tell.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..arguments import interval_argument
from ..arrays import Array, Mask
from ..deformation.deformation import Deformation
from ..inertia_tensor import inverse_inertia
from ..integrator.interpolant import Interpolant, chebyshev, unit_nodes, values_to_coefficients

_EPS = float(np.finfo(float).eps)
_FULL = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
_CHANNEL = ([0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1])
# Two entries of I^-1 stand behind an off-diagonal channel.
_WEIGHTS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
_MOST_CELLS, _HALVINGS = 4096, 24
_VETTED = np.array([0.0381, 0.2361, 0.6180, 0.8541])
_SAFETY = 4.0
_STEADY = 0.05
_NEGLIGIBLE = 1e-9


@dataclass(frozen=True, eq=False)
class Enclosure:
    """What I^-1, w = I^-1 L_o and their rates can be on each of the K cells of an interval.

    Everything is given in the axes of `frame`, in which I^-1 is as nearly diagonal as can be: there the entries' radii
    are small. With D the diagonal matrix of the sums of their rows, middle - D and middle + D bound a symmetric matrix
    as quadratic forms.

    Attributes
    ----------
    edges : (K + 1,) ends of the cells [s]
    frame : (3, 3) whose columns are the axes, body axes
    start, start_radius : (3, 3) and a number in the spectral norm, I^-1 at the very start [1/(kg m^2)]
    inverse, inverse_radius : (K, 3, 3) of I^-1, entry by entry [1/(kg m^2)]
    inverse_rate, inverse_rate_radius : (K, 3, 3) of its rate [1/(kg m^2 s)]
    drift, drift_radius : (K, 3), (K,) of w, in the Euclidean norm [rad/s]
    drift_rate, drift_rate_radius : (K, 3), (K,) of its rate [rad/s^2]
    sampling_error : (2,) the estimate contained in the radii of I^-1 and w
    """

    edges: Array
    frame: Array
    start: Array
    start_radius: float
    inverse: Array
    inverse_radius: Array
    inverse_rate: Array
    inverse_rate_radius: Array
    drift: Array
    drift_radius: Array
    drift_rate: Array
    drift_rate_radius: Array
    sampling_error: Array

    @property
    def widths(self) -> Array:
        """Of the cells: (K,) [s]."""
        return np.diff(self.edges)

    @property
    def inverse_range(self) -> tuple[Array, Array]:
        """Symmetric matrices below and above I^-1 as quadratic forms: (K, 3, 3), (K, 3, 3)."""
        return _range(self.inverse, self.inverse_radius)

    @property
    def inverse_rate_range(self) -> tuple[Array, Array]:
        """The same of its rate."""
        return _range(self.inverse_rate, self.inverse_rate_radius)

    @property
    def eigenvalues(self) -> tuple[Array, Array]:
        """Bounds from below and above of the eigenvalues of I^-1, ascending: (K, 3), (K, 3) [1/(kg m^2)].

        By Weyl's monotonicity; none is below zero.
        """
        low, high = (np.linalg.eigvalsh(matrix) for matrix in self.inverse_range)
        room = 8.0 * _EPS * np.abs(high).max(axis=1, keepdims=True)
        return np.maximum(low - room, 0.0), high + room

    @property
    def principal_moments(self) -> tuple[Array, Array]:
        """Bounds of the principal moments, ascending: (K, 3), (K, 3) [kg m^2]; infinite where there is none above."""
        low, high = self.eigenvalues
        with np.errstate(divide="ignore"):
            return np.nextafter(1.0 / high[:, ::-1], 0.0), np.nextafter(1.0 / low[:, ::-1], np.inf)

    @property
    def drift_size(self) -> Array:
        """The largest |I^-1 L_o| on each cell: (K,) [rad/s]."""
        return np.linalg.norm(self.drift, axis=1) * (1.0 + 4.0 * _EPS) + self.drift_radius

    @property
    def internal_momentum_size(self) -> Array:
        """A bound of |L_o| on each cell: (K,) [kg m^2/s]; infinite where the cell does not bound the inertia.

        L_o = I w; I lies within |M|^2 r/(1 - |M| r) of M, the inverse of the middle, r the radius of I^-1.
        """
        radius = self.inverse_radius.sum(axis=2).max(axis=1) * (1.0 + 1e-12)
        norm = 1.0 / np.linalg.eigvalsh(self.inverse)[:, 0] * (1.0 + 1e-12)
        left = 1.0 - norm * radius
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = np.where(left > 0.0, norm**2 * radius / left, np.inf)
            reach = np.where(self.drift_size > 0.0, spread * self.drift_size, 0.0)
        centre = np.linalg.norm(np.linalg.solve(self.inverse, self.drift[:, :, None])[:, :, 0], axis=1)
        return (centre + norm * self.drift_radius) * (1.0 + 1e-12) + reach

    def quadratic(self, direction: Array) -> tuple[Array, Array]:
        """Bounds of u . I^-1 u for unit vectors in body axes: (..., 3) -> (..., K), (..., K) [1/(kg m^2)]."""
        seen = direction @ self.frame
        low, high = (np.einsum("...i,kij,...j->...k", seen, matrix, seen) for matrix in self.inverse_range)
        room = 16.0 * _EPS * np.abs(high)
        return low - room, high + room

    def about(self, axis: Array, sign: float) -> tuple[Array, Array, Array]:
        """Bounds of sign I^-1 as seen from a unit vector (3,) in body axes.

        Returns
        -------
        along : (K, 2) bounds of its quadratic form along the axis
        across : (K, 2) bounds of its quadratic form in the plane across
        coupling : (K,) a bound of its component across at the axis
        """
        seen = axis @ self.frame
        first = np.cross(seen, np.eye(3)[np.argmin(np.abs(seen))])
        first /= np.linalg.norm(first)
        turn = np.stack([seen, first, np.cross(seen, first)])
        low, high = (turn @ matrix @ turn.T for matrix in self.inverse_range)
        low, high = (low, high) if sign > 0.0 else (-high, -low)
        room = 32.0 * _EPS * np.abs(high).max(axis=(1, 2))
        along = np.stack([low[:, 0, 0] - room, high[:, 0, 0] + room], axis=1)
        across = np.stack(
            [np.linalg.eigvalsh(low[:, 1:, 1:])[:, 0] - room, np.linalg.eigvalsh(high[:, 1:, 1:])[:, 1] + room], axis=1
        )
        middle = np.abs((turn @ self.inverse @ turn.T)[:, 0, 1:])
        radius = (np.abs(turn) @ self.inverse_radius @ np.abs(turn.T))[:, 0, 1:]
        return along, across, np.linalg.norm(middle + radius, axis=1) + room


def enclosure(
    deformation: Deformation,
    interval: tuple[float, float] | None = None,
    *,
    momentum_size: float = 1.0,
    tolerance: float = 1e-10,
    resolution: float = 5e-3,
) -> Enclosure:
    """Bounds of the channels of a deformation and of their rates over an interval.

    Parameters
    ----------
    interval : (start, end) [s]; None: [0, duration]
    momentum_size : of the momenta for which the deformation is sampled to `tolerance` [kg m^2/s]
    tolerance : as for `reconstruct` [rad]
    resolution : cells are halved until I^-1 varies by less than this part of its size on each, w by that of its own
        or of the rate of rotation, and the rate of I^-1 by a twentieth of the largest

    Raises
    ------
    AccuracyNotReached
        If the deformation is too rough between its breaks to be sampled.

    Source: theory.md E9; Clenshaw 1955 for the bound of a Chebyshev series by its coefficients.
    """
    start, end = interval_argument(interval, deformation.duration)
    sampler = deformation.sampler()
    sampler.refine(momentum_size or 1.0, tolerance)
    sampled = sampler.interpolant()
    error = _sampling_error(deformation, sampled)
    edges, coefficients = _within(sampled, start, end)
    frame, coefficients = _in_best_frame(edges, coefficients)
    parts = _divided(edges, coefficients, resolution, momentum_size)
    left = np.concatenate([left for left, _, _ in parts])
    order = np.argsort(left)
    right = np.concatenate([right for _, right, _ in parts])[order]
    series = np.concatenate([rows for _, _, rows in parts])[order]
    width = right - left[order]
    middle, radius = _ball(series)
    at_start = ((-1.0) ** np.arange(series.shape[1])) @ series[:1]
    start_radius = _matrix_radius(_rounding(series[:1]))[0] + error[0]
    rate_middle, rate_radius = _ball(_rates(series, width))
    # Markov's inequality for what a polynomial of this degree cannot follow.
    steepness = 2.0 * series.shape[1] ** 2 / _panel_width(sampled)
    return Enclosure(
        np.append(left[order], right[-1]),
        frame,
        _matrix(at_start)[0],
        float(start_radius),
        _matrix(middle),
        _matrix(radius) + error[0],
        _matrix(rate_middle),
        _matrix(rate_radius) + error[0] * steepness,
        middle[:, 6:],
        np.linalg.norm(radius[:, 6:], axis=1) + error[1],
        rate_middle[:, 6:],
        np.linalg.norm(rate_radius[:, 6:], axis=1) + error[1] * steepness,
        error,
    )


def series_bounds(coefficients: Array) -> tuple[Array, Array]:
    """Bounds of Chebyshev series on [-1, 1]: (..., n, channels) -> lower and upper (..., channels).

    c_0 plus and minus the sum of the other |c_k|, rounded outwards.
    """
    middle, radius = _ball(coefficients)
    return middle - radius, middle + radius


def restricted(coefficients: Array, left: float, right: float) -> Array:
    """The series on [left, right] of [-1, 1], stretched to [-1, 1]: (..., n, channels), as many coefficients."""
    return _restriction(coefficients.shape[-2], left, right) @ coefficients


def _ball(series: Array) -> tuple[Array, Array]:
    """The constant term, and the sum of all others with what rounding may have done."""
    return series[..., 0, :], np.abs(series[..., 1:, :]).sum(axis=-2) + _rounding(series)


def _rounding(series: Array) -> Array:
    """What rounding may have done to a series' values: those of T_k are good to k^2 eps."""
    degrees = np.arange(series.shape[-2], dtype=np.float64)
    return 4.0 * _EPS * np.einsum("k,...kc->...c", degrees**2 + 16.0, np.abs(series))


def _range(middle: Array, radius: Array) -> tuple[Array, Array]:
    room = (radius.sum(axis=2) * (1.0 + 8.0 * _EPS))[:, :, None] * np.eye(3)
    return middle - room, middle + room


def _in_best_frame(edges: Array, coefficients: Array) -> tuple[Array, Array]:
    """Axes in which the panels are nearly diagonal, and the series in them.

    Those of the panel, or of the mean, whose eigenvalues are farthest apart: the common ones where there are any.
    """
    matrices = _matrix(
        np.concatenate([coefficients[:, 0], [np.diff(edges) @ coefficients[:, 0] / np.diff(edges).sum()]])
    )
    values, axes = np.linalg.eigh(matrices)
    frame = axes[np.argmax(np.diff(values, axis=1).min(axis=1))]
    # Axes of the body that are principal axes already are not to be rounded.
    frame = np.where(np.abs(frame) < 4.0 * _EPS, 0.0, frame)
    turned = frame.T @ coefficients[:, :, :6][..., _FULL] @ frame
    series = np.empty_like(coefficients)
    series[:, :, :6] = turned[:, :, _CHANNEL[0], _CHANNEL[1]]
    series[:, :, 6:] = coefficients[:, :, 6:] @ frame
    return frame, series


def _matrix(channels: Array) -> Array:
    return channels[:, :6][:, _FULL]


def _matrix_radius(radius: Array) -> Array:
    """Frobenius norm, which bounds the spectral one."""
    return np.sqrt((radius[:, :6] ** 2) @ _WEIGHTS) * (1.0 + 8.0 * _EPS)


def _sampling_error(deformation: Deformation, sampled: Interpolant) -> Array:
    """Four times the largest error of the interpolant seen at times that are no nodes: (2,) of I^-1 and w."""
    panels = len(sampled.coefficients)
    left, right = sampled.edges[:panels], sampled.edges[1 : panels + 1]
    times = (left[:, None] + (right - left)[:, None] * _VETTED).ravel()
    inverse, drift = sampled.inverse_and_drift(times)
    inertia, internal = deformation.description.sample(times)
    truth = inverse_inertia(inertia, times)
    gaps = (
        np.linalg.norm(inverse - truth, axis=(1, 2)).max(),
        np.linalg.norm(drift - (truth @ internal[:, :, None])[:, :, 0], axis=1).max(),
    )
    return _SAFETY * np.array(gaps)


def _panel_width(sampled: Interpolant) -> float:
    return float(np.diff(sampled.edges).min())


def _within(sampled: Interpolant, start: float, end: float) -> tuple[Array, Array]:
    """The panels between two times, the outer ones cut: edges (P + 1,), coefficients (P, n, 9)."""
    edges, count = sampled.edges, len(sampled.coefficients)
    first = int(np.searchsorted(edges, start, side="right")) - 1
    last = min(int(np.searchsorted(edges, end, side="left")), len(edges) - 1)
    kept = np.arange(first, max(last, first + 1))
    coefficients = sampled.coefficients[kept % count]
    ends = np.concatenate([[start], edges[kept[1:]], [end]])
    for panel in {0, len(kept) - 1}:
        left, right = edges[kept[panel]], edges[kept[panel] + 1]
        low, high = (2.0 * ends[panel : panel + 2] - left - right) / (right - left)
        coefficients[panel] = restricted(coefficients[panel], max(-1.0, low), min(1.0, high))
    return ends, coefficients


def _divided(
    edges: Array, coefficients: Array, resolution: float, momentum_size: float
) -> list[tuple[Array, Array, Array]]:
    """Cells on which the series hardly vary: ends and coefficients, in parts of any order."""
    left, right, series = edges[:-1], edges[1:], coefficients
    count = series.shape[1]
    halves = _restriction(count, -1.0, 0.0), _restriction(count, 0.0, 1.0)
    done: list[tuple[Array, Array, Array]] = []
    finished = 0
    inverse, drift = _sizes(np.abs(series).sum(axis=1)).max(axis=0)
    scale = np.array([inverse, max(drift, momentum_size * inverse)])
    steepest = _sizes(np.abs(_rates(series, right - left)).sum(axis=1))[:, 0].max()
    for _ in range(_HALVINGS):
        fine = _fine(series, right - left, scale, steepest, resolution)
        finished += int(fine.sum())
        if finished + 2 * int((~fine).sum()) > _MOST_CELLS:
            break
        done.append((left[fine], right[fine], series[fine]))
        left, right, series = left[~fine], right[~fine], series[~fine]
        if not len(left):
            return done
        middle = 0.5 * (left + right)
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
        series = np.concatenate([half @ series for half in halves])
    return [*done, (left, right, series)]


def _fine(series: Array, width: Array, scale: Array, steepest: float, resolution: float) -> Mask:
    """Which cells are small enough: (K,)."""
    radius = _sizes(_ball(series)[1])
    rates = _sizes(_ball(_rates(series, width))[1])[:, 0]
    calm = (rates <= _STEADY * steepest) | (rates * width <= _NEGLIGIBLE * scale[0])
    return np.all(radius <= resolution * scale, axis=1) & calm


def _sizes(channels: Array) -> Array:
    """(K, 9) -> (K, 2) of I^-1 and w."""
    return np.stack([_matrix_radius(channels), np.linalg.norm(channels[:, 6:], axis=1)], axis=-1)


def _rates(series: Array, width: Array) -> Array:
    """The series of the derivatives: (K, n, 9) [1/s]."""
    return (_derivative(series.shape[1]) @ series) * (2.0 / width)[:, None, None]


@lru_cache(maxsize=64)
def _restriction(count: int, left: float, right: float) -> Array:
    nodes = 0.5 * (left + right) + 0.5 * (right - left) * unit_nodes(count - 1)
    return values_to_coefficients(count - 1) @ chebyshev(np.clip(nodes, -1.0, 1.0), count)


@lru_cache(maxsize=16)
def _derivative(count: int) -> Array:
    """Coefficients of the derivative from those of a series, as many: (count, count)."""
    matrix = np.zeros((count, count))
    if count > 1:
        matrix[:-1] = np.polynomial.chebyshev.chebder(np.eye(count))
    return matrix
