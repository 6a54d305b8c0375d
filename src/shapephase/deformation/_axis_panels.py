"""Frames of principal axes on panels of time, each a polynomial, found without regard to its neighbours.

A panel is taken when its frame makes the inertia diagonal at and between the nodes; else it is halved. The module
`_principal_frame` joins the panels.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from .. import so3
from ..arrays import Array, Integers, Mask
from ..chebyshev import chebyshev, exact_local_coordinate, inside
from ..errors import GaugeError
from .deformation import Deformation

COUNT = 20  # coefficients of each polynomial on a panel
_NODES = COUNT + 5  # of a panel: five more than coefficients, so that the error of a fit shows
_NARROW = 1e-3  # of a loop: narrower panels may be less exact, since little time is spent on them
_TINY = 1e-6  # of a loop: the number of narrower panels is limited, so that a failing search does not fill the memory
_LEAST_WIDTH = 1e-13  # of a loop, for panels: the digits of time end there
_DIAGONAL = 2e-14  # of the trace, for entries off the diagonal on wide panels: some hundred roundings
NEARLY_DIAGONAL = 2e-12  # of the trace, for these entries on narrow panels, where the axes turn fast
EQUAL = 4e-13  # of the trace, between equal moments: a few thousand roundings
_ROUNDING = 1e-16  # weight of zero as the first coefficient, beside certain values; for the last one 1e14 times as much
_FASTEST = 2e8  # [rad] in a loop: axes that turn faster count as a jump
SEPARATE, SYMMETRIC, SPHERICAL = range(3)  # kinds of panels: all moments apart, two equal, all equal
NO_TURN = np.array([0.0, 0.0, 0.0, 1.0])  # quaternion xyzw
THIRD = np.array([0.0, 0.0, 1.0])  # the distinct axis of a panel with two equal moments
PANEL_NODES = -np.cos(np.pi * (np.arange(_NODES) + 0.5) / _NODES)  # ascending Chebyshev points inside (-1, 1)
POINTS_BETWEEN = -np.cos(np.pi * np.arange(_NODES + 1) / _NODES)  # the points between the nodes, and the ends
AT_NODES = chebyshev(PANEL_NODES, COUNT)  # Chebyshev coefficients -> values at the nodes: (N, n)
# Values at the nodes -> Chebyshev coefficients of the polynomial nearest to them: (n, N).
TO_SERIES = AT_NODES.T * (2.0 / _NODES) * np.where(np.arange(COUNT) > 0, 1.0, 0.5)[:, None]


@dataclass(frozen=True, eq=False)
class AxisPanels:
    """Frames on panels, each up to a turn from the left.

    left, right : (P,) ends [s]
    series : (P, n, 4) quaternions xyzw as Chebyshev series
    kind : (P,) whether moments are separate, two equal (the distinct axis is then the third), or all equal
    strength : (P, 3) how well each axis' turn is known: the largest gap of the two other moments, per trace
    """

    left: Array
    right: Array
    series: Array
    kind: Integers
    strength: Array

    @property
    def edges(self) -> Array:
        """Where panels meet, and both ends: (P + 1,)."""
        return np.append(self.left, self.right[-1])

    def kept(self, rows: Mask | Integers) -> AxisPanels:
        """Some of them."""
        return AxisPanels(self.left[rows], self.right[rows], self.series[rows], self.kind[rows], self.strength[rows])

    def quats(self, local: Array) -> Array:
        """Quaternions, not of length one, at points (K,) or (P, K) of [-1, 1]: (P, K, 4)."""
        return chebyshev(local, self.series.shape[1]) @ self.series


def halves(left: Array, right: Array) -> tuple[Array, Array]:
    """Ends of the halves of intervals."""
    middle = 0.5 * (left + right)
    return np.concatenate([left, middle]), np.concatenate([middle, right])


def resolved(deformation: Deformation, left: Array, right: Array) -> AxisPanels:
    """Panels that each make the inertia diagonal, by halving those given. Raises GaugeError."""
    duration = deformation.duration
    least = _LEAST_WIDTH * duration / deformation.loops + 256.0 * np.spacing(duration)
    # Fast motions need many panels, but hardly ever many of those that are only found by halving again and again.
    to_try, tiny_to_try = 40_000 + 40 * len(left), 2000 + 100 * len(left)
    taken: list[AxisPanels] = []
    while True:
        panels, good = _fitted(deformation, left, right)
        taken.append(panels.kept(good))
        if good.all():
            return in_order(taken)
        left, right = left[~good], right[~good]
        to_try -= len(good)
        tiny_to_try -= np.count_nonzero(right - left < _TINY * duration / deformation.loops)
        if np.min(right - left) < least or to_try < 0 or tiny_to_try < 0:
            where = 0.5 * (left + right)[np.argmin(right - left)]
            raise GaugeError(
                f"the principal axes have no smooth frame near t = {where:.12g} s, {moments_at(deformation, where)}: "
                "they jump or turn too fast to be followed; declare a break of the motion there, or use the "
                "horizontal gauge"
            )
        left, right = halves(left, right)


def in_order(parts: list[AxisPanels]) -> AxisPanels:
    """Panels put together, by time."""
    panels = AxisPanels(*(np.concatenate(f) for f in zip(*(vars(part).values() for part in parts), strict=True)))
    return panels.kept(np.argsort(panels.left))


def moments_at(deformation: Deformation, time: float) -> str:
    """Principal moments at a time, for messages."""
    moments = np.linalg.eigvalsh(deformation.inertia(time))
    return f"where the principal moments are {moments} kg m^2"


def _fitted(deformation: Deformation, left: Array, right: Array) -> tuple[AxisPanels, Mask]:
    """Frames on panels, and on which of them they make the inertia diagonal."""
    times, inertia = inertia_in(deformation, left, right, PANEL_NODES)
    moments, axes = np.linalg.eigh(inertia)
    low, high = np.moveaxis(np.diff(moments, axis=-1), -1, 0)
    kind = np.where(np.all(np.minimum(low, high) <= EQUAL, axis=-1), SYMMETRIC, SEPARATE)
    kind[np.all(low + high <= EQUAL, axis=-1)] = SPHERICAL
    series = np.zeros((len(left), COUNT, 4))
    series[:, 0] = NO_TURN
    for which, at_nodes in ((SEPARATE, _separate_axes), (SYMMETRIC, _distinct_axis)):
        rows = kind == which
        if rows.any():
            quats, weights = at_nodes(low[rows], high[rows], axes[rows])
            fit = _diagonalising(_least_squares(quats, weights), inertia[rows], which)
            series[rows] = fit if which == SEPARATE else _without_spin(fit)
    panels = AxisPanels(left, right, series, kind, np.zeros((len(left), 3)))
    seen = _seen_from(panels, PANEL_NODES, inertia)
    panels = replace(panels, strength=np.abs(_gaps(seen)).max(axis=1))
    narrow = right - left < _NARROW * deformation.duration / deformation.loops
    limit = np.where(narrow, NEARLY_DIAGONAL, _DIAGONAL)[:, None].repeat(3, axis=1)
    limit[kind == SYMMETRIC, 2] = limit[kind == SPHERICAL] = NEARLY_DIAGONAL
    good = _is_diagonal(seen, limit)
    # What turns that fast bridges a jump where hardly anything is off the diagonal.
    quats = so3.normalised(panels.quats(PANEL_NODES))
    speed = 2.0 * np.linalg.norm(np.diff(quats, axis=1), axis=-1) / np.diff(times, axis=1)
    good &= speed.max(axis=-1) <= _FASTEST * deformation.loops / deformation.duration
    rows = np.flatnonzero(good)
    if len(rows):
        good[rows] = is_diagonal_at(deformation, panels.kept(rows), POINTS_BETWEEN, limit[rows])
    return panels, good


def inertia_in(deformation: Deformation, left: Array, right: Array, local: Array) -> tuple[Array, Array]:
    """Times (P, K) of the points (K,) of [-1, 1] in panels, just inside their ends, and I/trace (P, K, 3, 3) there."""
    first, last = inside(left, right)
    times = 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * local
    times = np.clip(times, first[:, None], last[:, None])
    inertia = deformation.inertia(times)
    return times, inertia / np.trace(inertia, axis1=-2, axis2=-1)[..., None, None]


def _seen_from(panels: AxisPanels, local: Array, inertia: Array) -> Array:
    frames = so3.matrix_from_quat(so3.normalised(panels.quats(local)))
    return frames @ inertia @ so3.transpose(frames)


def _off_diagonal(tensors: Array) -> Array:
    """Entries yz, zx, xy: (..., 3, 3) -> (..., 3)."""
    return tensors[..., [1, 2, 0], [2, 0, 1]]


def _gaps(tensors: Array) -> Array:
    """Differences of the diagonal's entries zz - yy, xx - zz, yy - xx: (..., 3, 3) -> (..., 3)."""
    diagonal = np.diagonal(tensors, axis1=-2, axis2=-1)
    return diagonal[..., [2, 0, 1]] - diagonal[..., [1, 2, 0]]


def _is_diagonal(tensors: Array, limit: Array) -> Mask:
    return np.all(np.abs(_off_diagonal(tensors)).max(axis=-2) <= limit, axis=-1)


def is_diagonal_at(deformation: Deformation, panels: AxisPanels, points: Array, limit: Array) -> Mask:
    """True where the panels' frames make the inertia diagonal at points (K,) of [-1, 1]."""
    times, inertia = inertia_in(deformation, panels.left, panels.right, points)
    local = exact_local_coordinate(times, panels.left[:, None], panels.right[:, None])
    norm = np.linalg.norm(panels.quats(local), axis=-1)
    return _is_diagonal(_seen_from(panels, local, inertia), limit) & (norm.min(axis=-1) > 0.5)


def _separate_axes(low: Array, high: Array, axes: Array) -> tuple[Array, Array]:
    """Quaternions of the frames at the nodes, their axes named so that they go on smoothly, and their weights."""
    frames = so3.transpose(axes).copy()
    frames[..., 2, :] *= np.sign(np.linalg.det(frames))[..., None]
    quats, gap = so3.quat_from_matrix(frames), np.minimum(low, high)
    group, table = cube_turns()
    steps = nearest_cube_turn(so3.quat_product(quats[:, :-1], so3.quat_inverse(quats[:, 1:])))
    label = np.zeros(gap.shape, dtype=np.int64)
    for node in range(1, _NODES):
        label[:, node] = table[label[:, node - 1], steps[:, node - 1]]
    return _same_sign(so3.quat_product(group[label], quats)), gap


def _distinct_axis(low: Array, high: Array, axes: Array) -> tuple[Array, Array]:
    """Quaternions and weights where two moments are equal: the third axis is the distinct one, the others any."""
    upper = (low <= high)[..., None]
    axis, gap = np.where(upper, axes[..., 2], axes[..., 0]), np.maximum(low, high)
    axis = _same_sign(axis)
    best = np.take_along_axis(axis, np.argmax(gap, axis=1)[:, None, None], axis=1)
    upright = so3.quat_from_matrix(so3.between(best, THIRD))
    return so3.quat_product(upright, so3.quat_from_matrix(so3.between(axis, best))), gap


def _same_sign(vectors: Array) -> Array:
    """Vectors (P, N, k) or their opposites, each nearest to the one before."""
    flip = np.where(np.sum(vectors[:, 1:] * vectors[:, :-1], axis=-1) < 0.0, -1.0, 1.0)
    vectors = vectors.copy()
    vectors[:, 1:] *= np.cumprod(flip, axis=1)[..., None]
    return vectors


def _diagonalising(series: Array, inertia: Array, kind: int) -> Array:
    """Frames (P, n, 4) improved twice by Newton's method; each axis' turn is weighted by how well it is known."""
    basis = AT_NODES
    for _ in range(2):
        quats = so3.normalised(basis @ series)
        frames = so3.matrix_from_quat(quats)
        seen = frames @ inertia @ so3.transpose(frames)
        gap = np.swapaxes(_gaps(seen), 1, 2)
        if kind == SYMMETRIC:
            gap[:, 2] = 0.0
        turn = np.divide(np.swapaxes(_off_diagonal(seen), 1, 2), gap, out=np.zeros_like(gap), where=gap != 0.0)
        smooth = _least_squares(turn.reshape(-1, _NODES, 1), np.abs(gap).reshape(-1, _NODES))
        turn = basis @ smooth.reshape(-1, 3, COUNT).swapaxes(1, 2)
        series = TO_SERIES @ so3.quat_product(so3.quat_from_rotation_vector(turn), quats)
    return series


def _without_spin(series: Array) -> Array:
    """The frames (P, n, 4) turned about their third axes so that these alone turn them: parallel transport."""
    basis = AT_NODES
    quats = basis @ series
    slope = basis[:, :-1] @ np.polynomial.chebyshev.chebder(series, axis=1)
    norm = np.linalg.norm(quats, axis=-1, keepdims=True)
    rate = so3.apply(so3.matrix_from_quat(quats / norm), so3.turn_of(quats, slope) / norm**2)
    spin = np.polynomial.chebyshev.chebint((TO_SERIES @ rate[..., 2:])[:, :-1], axis=1)
    return TO_SERIES @ so3.quat_product(so3.quat_from_rotation_vector(-(basis @ spin) * THIRD), quats / norm)


def _least_squares(values: Array, weights: Array) -> Array:
    """Chebyshev series (P, n, k) near values (P, N, k) at the nodes that are uncertain by rounding/weight (P, N).

    Coefficients are expected to fall to rounding at the last degree. What is expected of them counts where weights are
    small, so that uncertain values do not fill the high degrees.
    """
    top = weights.max(axis=-1)
    series = TO_SERIES @ values
    uncertain = np.flatnonzero((weights.min(axis=-1) < np.maximum(0.03 * top, 1e-4)) & (top > 0.0))
    if len(uncertain):
        part = weights[uncertain, :, None] / top[uncertain, None, None]
        rest = _ROUNDING / top[uncertain, None, None] * np.diag(np.logspace(0.0, 14.0, COUNT))
        q, r = np.linalg.qr(np.concatenate([part * AT_NODES, rest], axis=1))
        series[uncertain] = np.linalg.solve(r, so3.transpose(q[:, :_NODES]) @ (part * values[uncertain]))
    return series


@lru_cache(maxsize=1)
def cube_turns() -> tuple[Array, Integers]:
    """The 24 rotations that name axes anew, as quaternions (24, 4), and the numbers of their products (24, 24)."""
    signed = [
        np.eye(3)[list(order)] * signs
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
    ]
    proper = np.array([matrix for matrix in signed if np.linalg.det(matrix) > 0.0])
    identity = int(np.argmax(np.trace(proper, axis1=1, axis2=2)))
    proper[[0, identity]] = proper[[identity, 0]]
    group = so3.quat_from_matrix(proper)
    products = so3.quat_product(group[:, None], group)
    return group, np.argmax(np.abs(products @ group.T), axis=-1)


def nearest_cube_turn(quat_xyzw: Array) -> Integers:
    """The nearest of the 24: (..., 4) -> (...)."""
    return np.argmax(np.abs(quat_xyzw @ cube_turns()[0].T), axis=-1)
