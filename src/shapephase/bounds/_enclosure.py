"""Bounds of a deformation over intervals of time, from the coefficients of its series and not from samples alone.

On every cell of an interval the nine channels (I^-1 and I^-1 L_o) and their rates lie within `radius` of `middle`: the
Chebyshev series of the sampled deformation is restricted to the cell, where |T_k| <= 1, and rounding and the estimated
error of sampling are added. That estimate is the one link of the chain that is not a proof: a deformation is known
only at the times where it is evaluated, and nothing rules out a feature that lies between them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arguments import interval_argument
from ..arrays import Array, Mask
from ..chebyshev import derivative_matrix, local_coordinate, restriction_matrix
from ..deformation.deformation import Deformation
from ..display import short_repr
from ..inertia_tensor import FULL_FROM_SIX, SIX_OF_FULL, inverse_inertia
from ..integrator.interpolant import Interpolant

ROUNDING = 32.0 * float(np.finfo(float).eps)  # relative, generous for every formula here: of a few operations each
_WEIGHTS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # entries that each channel stands for
_MAX_CELLS = 4096  # limits the loop of `energy_bounds`; the bounds of coarser cells are looser, but they hold
# Parts of a panel at which the interpolant is compared with the deformation: none is near a Chebyshev node, and they
# are not symmetric, so that an error which is odd or even about the middle shows.
_TEST_POINTS = np.array([0.0381, 0.2361, 0.6180, 0.8541])
RESOLUTION = 5e-3  # share of their size by which the channels may vary on a cell
ROUND_UP = 1.0 + 1e-12  # for products of positive bounds: thousands of times their rounding


@dataclass(frozen=True, eq=False)
class Enclosure:
    """Ranges of I^-1, w = I^-1 L_o and their rates on each of the K cells of an interval.

    Everything is given in the axes of `frame`, in which I^-1 is as nearly diagonal as possible, so that the radii of
    its entries are small. With D the diagonal matrix of the row sums of the radii, middle - D and middle + D bound a
    symmetric matrix as quadratic forms.
    """

    edges: Array
    """(K + 1,) ends of the cells [s]."""
    frame: Array
    """(3, 3) whose columns are the axes, body axes."""
    start: Array
    start_radius: float
    """`start` and `start_radius`: (3, 3) I^-1 at the start of the interval, and its radius in the spectral norm [1/(kg
    m^2)]."""
    inverse: Array
    inverse_radius: Array
    """`inverse` and `inverse_radius`: (K, 3, 3) middle and radius of I^-1, entry by entry [1/(kg m^2)]."""
    inverse_rate: Array
    inverse_rate_radius: Array
    """`inverse_rate` and `inverse_rate_radius`: (K, 3, 3) of its rate [1/(kg m^2 s)]."""
    drift: Array
    drift_radius: Array
    """`drift` and `drift_radius`: (K, 3), (K,) of w, the radius in the Euclidean norm [rad/s]."""
    drift_rate: Array
    drift_rate_radius: Array
    """`drift_rate` and `drift_rate_radius`: (K, 3), (K,) of its rate [rad/s^2]."""
    sampling_error: Array
    """(2,) the estimated error of sampling I^-1 and w, which the radii contain."""

    __repr__ = short_repr

    @property
    def widths(self) -> Array:
        """Lengths of the cells: (K,) [s]."""
        return np.diff(self.edges)

    @property
    def inverse_range(self) -> tuple[Array, Array]:
        """Symmetric matrices below and above I^-1 as quadratic forms: (K, 3, 3), (K, 3, 3)."""
        return _range(self.inverse, self.inverse_radius)

    @property
    def inverse_rate_range(self) -> tuple[Array, Array]:
        """Symmetric matrices below and above the rate of I^-1: (K, 3, 3), (K, 3, 3)."""
        return _range(self.inverse_rate, self.inverse_rate_radius)

    @property
    def eigenvalues(self) -> tuple[Array, Array]:
        """Bounds from below and above of the eigenvalues of I^-1, ascending: (K, 3), (K, 3) [1/(kg m^2)].

        By Weyl's monotonicity; lower bounds are cut at zero, because I^-1 is positive definite.
        """
        low, high = (np.linalg.eigvalsh(matrix) for matrix in self.inverse_range)
        room = ROUNDING * np.abs(high).max(axis=1, keepdims=True)
        return np.maximum(low - room, 0.0), high + room

    @property
    def principal_moments(self) -> tuple[Array, Array]:
        """Bounds of the principal moments, ascending: (K, 3), (K, 3) [kg m^2]; infinite where none is known above."""
        low, high = self.eigenvalues
        with np.errstate(divide="ignore"):
            return np.nextafter(1.0 / high[:, ::-1], 0.0), np.nextafter(1.0 / low[:, ::-1], np.inf)

    @property
    def drift_magnitude(self) -> Array:
        """The largest |I^-1 L_o| on each cell: (K,) [rad/s]."""
        return np.linalg.norm(self.drift, axis=1) * (1.0 + ROUNDING) + self.drift_radius

    @property
    def internal_momentum_magnitude(self) -> Array:
        """A bound of |L_o| on each cell: (K,) [kg m^2/s]; infinite where the cell does not bound the inertia.

        L_o = I w; I lies within |M|^2 r/(1 - |M| r) of M, the inverse of the middle, r the radius of I^-1.
        """
        radius = self.inverse_radius.sum(axis=2).max(axis=1) * ROUND_UP
        norm = 1.0 / np.linalg.eigvalsh(self.inverse)[:, 0] * ROUND_UP
        left = 1.0 - norm * radius
        with np.errstate(divide="ignore", invalid="ignore"):
            spread = np.where(left > 0.0, norm**2 * radius / left, np.inf)
            reach = np.where(self.drift_magnitude > 0.0, spread * self.drift_magnitude, 0.0)
        centre = np.linalg.norm(np.linalg.solve(self.inverse, self.drift[:, :, None])[:, :, 0], axis=1)
        return (centre + norm * self.drift_radius) * ROUND_UP + reach

    def quadratic(self, direction: Array) -> tuple[Array, Array]:
        """Bounds of u . I^-1 u for unit vectors in body axes: (..., 3) -> (..., K), (..., K) [1/(kg m^2)]."""
        u = direction @ self.frame
        low, high = (np.einsum("...i,kij,...j->...k", u, matrix, u) for matrix in self.inverse_range)
        room = ROUNDING * np.abs(high)
        return low - room, high + room

    def about(self, axis: Array, sign: float) -> tuple[Array, Array, Array]:
        """Bounds of the blocks of sign I^-1 along and across a unit vector (3,) in body axes.

        Returns
        -------
        along : (K, 2) bounds of its quadratic form along the axis
        across : (K, 2) bounds of its quadratic form in the plane across the axis
        coupling : (K,) a bound of the block that couples the axis with that plane
        """
        along_axis = axis @ self.frame
        first = np.cross(along_axis, np.eye(3)[np.argmin(np.abs(along_axis))])
        first /= np.linalg.norm(first)
        turn = np.stack([along_axis, first, np.cross(along_axis, first)])
        low, high = (turn @ matrix @ turn.T for matrix in self.inverse_range)
        low, high = (low, high) if sign > 0.0 else (-high, -low)
        room = ROUNDING * np.abs(high).max(axis=(1, 2))
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
    magnitude: float = 1.0,
    tolerance: float = 1e-10,
    resolution: float = RESOLUTION,
) -> Enclosure:
    """Bounds of the channels of a deformation and of their rates over an interval.

    Source: theory.md E9; Clenshaw 1955 for the bound of a Chebyshev series by its coefficients.
    Raises AccuracyNotReached if the deformation is too rough between its breaks to be sampled.

    interval : (start, end) [s]; None: [0, duration]
    magnitude : of the momenta for which the deformation is sampled to `tolerance` [kg m^2/s]
    tolerance : as for `reconstruct` [rad]
    resolution : cells are halved until, on each, I^-1 varies by less than this fraction of its norm, w by that
        fraction of its own norm or of the rate of rotation, and the rate of I^-1 by a twentieth of the steepest
    """
    start, end = interval_argument(interval, deformation.duration)
    sampled = deformation.sampler().samples(magnitude or 1.0, tolerance).interpolant
    error = _sampling_error(deformation, sampled)
    edges, coefficients = _within(sampled, start, end)
    frame, coefficients = _in_best_frame(edges, coefficients)
    edges, series = _cells(edges, coefficients, resolution, magnitude)
    middle, radius = ball(series)
    at_start = ((-1.0) ** np.arange(series.shape[1])) @ series[:1]
    start_radius = _matrix_radius(_rounding(series[:1]))[0] + error[0]
    rate_middle, rate_radius = ball(_rates(series, np.diff(edges)))
    # Markov's inequality: how steep a polynomial of this degree can be that is as large as the sampling error.
    steepness = 2.0 * series.shape[1] ** 2 / float(np.diff(sampled.edges).min())
    return Enclosure(
        edges=edges,
        frame=frame,
        start=_matrix(at_start)[0],
        start_radius=float(start_radius),
        inverse=_matrix(middle),
        inverse_radius=_matrix(radius) + error[0],
        inverse_rate=_matrix(rate_middle),
        inverse_rate_radius=_matrix(rate_radius) + error[0] * steepness,
        drift=middle[:, -3:],
        drift_radius=np.linalg.norm(radius[:, -3:], axis=1) + error[1],
        drift_rate=rate_middle[:, -3:],
        drift_rate_radius=np.linalg.norm(rate_radius[:, -3:], axis=1) + error[1] * steepness,
        sampling_error=error,
    )


def ball(series: Array) -> tuple[Array, Array]:
    """Middle and radius of Chebyshev series on [-1, 1]: (..., n, channels) -> twice (..., channels).

    The constant term, and the sum of the magnitudes of all others with a bound of rounding.
    """
    return series[..., 0, :], np.abs(series[..., 1:, :]).sum(axis=-2) + _rounding(series)


def _rounding(series: Array) -> Array:
    """A bound of the rounding errors in the values of a series: T_k is evaluated to k^2 eps."""
    degrees = np.arange(series.shape[-2], dtype=np.float64)
    return 2.0 * ROUNDING * np.einsum("k,...kc->...c", 1.0 + (degrees / 4.0) ** 2, np.abs(series))


def _range(middle: Array, radius: Array) -> tuple[Array, Array]:
    room = (radius.sum(axis=2) * (1.0 + ROUNDING))[:, :, None] * np.eye(3)
    return middle - room, middle + room


def _in_best_frame(edges: Array, coefficients: Array) -> tuple[Array, Array]:
    """Axes in which I^-1 is nearly diagonal on all panels, and the series in them.

    They are the eigenvectors of the panel, or of the mean, whose eigenvalues are farthest apart; if the principal
    axes stay fixed, these are the principal axes.
    """
    widths, middles = np.diff(edges), coefficients[:, 0]
    values, axes = np.linalg.eigh(_matrix(np.concatenate([middles, [widths @ middles / widths.sum()]])))
    frame = axes[np.argmax(np.diff(values, axis=1).min(axis=1))]
    # Where the body's axes are the principal axes, the frame is exactly the identity or a permutation.
    frame = np.where(np.abs(frame) < ROUNDING, 0.0, frame)
    turned = frame.T @ coefficients[:, :, :-3][..., FULL_FROM_SIX] @ frame
    series = np.empty_like(coefficients)
    series[:, :, :-3] = turned.reshape(*turned.shape[:2], 9)[..., SIX_OF_FULL]
    series[:, :, -3:] = coefficients[:, :, -3:] @ frame
    return frame, series


def _matrix(channels: Array) -> Array:
    return channels[:, :-3][:, FULL_FROM_SIX]


def _matrix_radius(radius: Array) -> Array:
    """Frobenius norm, which bounds the spectral one."""
    return np.sqrt((radius[:, :-3] ** 2) @ _WEIGHTS) * (1.0 + ROUNDING)


def _sampling_error(deformation: Deformation, sampled: Interpolant) -> Array:
    """An estimate of the largest error of the interpolant, from times that are not nodes: (2,) of I^-1 and w."""
    panels = len(sampled.coefficients)
    left, right = sampled.edges[:panels], sampled.edges[1 : panels + 1]
    times = (left[:, None] + (right - left)[:, None] * _TEST_POINTS).ravel()
    inverse, drift = sampled.inverse_and_drift(times)
    inertia, internal = deformation.description.sample(times)
    truth = inverse_inertia(inertia, times)
    gaps = (
        np.linalg.norm(inverse - truth, axis=(1, 2)).max(),
        np.linalg.norm(drift - (truth @ internal[:, :, None])[:, :, 0], axis=1).max(),
    )
    # All points may miss the peaks of an error that oscillates like T_n; hardly ever do all see less than a quarter.
    return 4.0 * np.array(gaps)


def _within(sampled: Interpolant, start: float, end: float) -> tuple[Array, Array]:
    """The panels between two times, the first and the last cut to them: edges (P + 1,), coefficients (P, n, 9)."""
    edges, count = sampled.edges, len(sampled.coefficients)
    first = int(np.searchsorted(edges, start, side="right")) - 1
    last = min(int(np.searchsorted(edges, end, side="left")), len(edges) - 1)
    kept = np.arange(first, max(last, first + 1))
    coefficients = sampled.coefficients[kept % count]
    ends = np.concatenate([[start], edges[kept[1:]], [end]])
    for panel in {0, len(kept) - 1}:
        left, right = edges[kept[panel]], edges[kept[panel] + 1]
        low, high = local_coordinate(ends[panel : panel + 2], left, right)
        coefficients[panel] = restriction_matrix(coefficients.shape[1], low, high) @ coefficients[panel]
    return ends, coefficients


def _cells(edges: Array, coefficients: Array, resolution: float, magnitude: float) -> tuple[Array, Array]:
    """Panels halved until the series hardly vary on each: edges (K + 1,) in order of time, coefficients (K, n, 9)."""
    left, right, series = edges[:-1], edges[1:], coefficients
    count = series.shape[1]
    halves = restriction_matrix(count, -1.0, 0.0), restriction_matrix(count, 0.0, 1.0)
    done: list[tuple[Array, ...]] = []
    finished = 0
    inverse, drift = _norms(np.abs(series).sum(axis=1)).max(axis=0)
    scale = np.array([inverse, max(drift, magnitude * inverse)])
    steepest = _norms(np.abs(_rates(series, right - left)).sum(axis=1))[:, 0].max()
    for _ in range(24):  # far below any time scale of the series
        fine = _fine(series, right - left, scale, steepest, resolution)
        finished += int(fine.sum())
        if finished + 2 * int((~fine).sum()) > _MAX_CELLS:
            break
        done.append((left[fine], right[fine], series[fine]))
        left, right, series = left[~fine], right[~fine], series[~fine]
        if not len(left):
            break
        middle = 0.5 * (left + right)
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
        series = np.concatenate([half @ series for half in halves])
    left, right, series = map(np.concatenate, zip(*done, (left, right, series), strict=True))
    order = np.argsort(left)
    return np.append(left[order], right[order][-1]), series[order]


def _fine(series: Array, width: Array, scale: Array, steepest: float, resolution: float) -> Mask:
    """True for cells that are small enough: (K,)."""
    radius = _norms(ball(series)[1])
    rates = _norms(ball(_rates(series, width))[1])[:, 0]
    # Where the rate varies by a twentieth of the steepest, the drift of the energy bounds comes from other cells.
    rate_resolved = (rates <= 0.05 * steepest) | (rates * width <= 1e-9 * scale[0])
    return np.all(radius <= resolution * scale, axis=1) & rate_resolved


def _norms(channels: Array) -> Array:
    """Norms of I^-1 (Frobenius) and of w (Euclidean): (K, 9) -> (K, 2)."""
    return np.stack([_matrix_radius(channels), np.linalg.norm(channels[:, -3:], axis=1)], axis=-1)


def _rates(series: Array, width: Array) -> Array:
    """The series of the derivatives: (K, n, 9) [1/s]."""
    return (derivative_matrix(series.shape[1]) @ series) * (2.0 / width)[:, None, None]
