"""Where the map of a loop may have fixed points: triangles of directions, divided where none can be excluded."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array, Integers, Mask
from ..sphere import fibonacci_directions
from ._loop_map import TINY, MomentumLoop, tangent_basis

_SMALLEST_CELL = 0.002  # [rad] narrower cells are not divided: Newton's method starts from them
_MANY_SMALL_CELLS = 300  # more are thinned out: they line a curve of fixed points
_MOST_STARTS = 1000  # of Newton's method
SEARCH_TOLERANCE = 1e-6  # [rad] of the loops while searching: cells are far wider, and Newton's method ends exactly
FAMILY_SPACING = 0.3  # [rad] of points that represent a curve of fixed points: about twenty along a great circle
_BEND = 0.06  # of a cell's width: sides that bend less count as linear
_SAFETY_FACTOR = 3.0  # times the bend that midpoints show
_WIDE = 0.7  # [rad] images of longer half sides show nothing


def search(loop: MomentumLoop, magnitude: float, count: int, most: int) -> tuple[Array, bool]:
    """Starts of Newton's method (n, 3), and whether some of the sphere was left out.

    Triangles between even directions are divided where a fixed point may be and the map is not yet linear.
    """
    from scipy.spatial import ConvexHull

    corners = fibonacci_directions(count)
    cells = np.asarray(ConvexHull(corners).simplices)
    tolerance = max(SEARCH_TOLERANCE, loop.goal)
    shifts = loop.shift(magnitude, corners, tolerance)
    reach = float(np.linalg.norm(shifts, axis=-1).max())
    if reach < 0.1:
        # The map is nearly the identity, and what it differs by must be known well.
        tolerance = max(loop.goal, 1e-5 * reach)
        shifts = loop.shift(magnitude, corners, tolerance)
    if reach < 100.0 * loop.goal:
        return corners[spaced(corners, FAMILY_SPACING)], True
    starts, tiny, tiny_inside, left_out = [], [], [], np.empty((0, 3))
    exhausted = False
    while len(cells):
        edges = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]), axis=1)
        edges, place = np.unique(edges, axis=0, return_inverse=True)
        if len(corners) + len(edges) > most:
            exhausted = True
            break
        halves = so3.normalised(corners[edges].sum(axis=1))
        (a, b, c), (ab, bc, ca) = cells.T, len(corners) + place.reshape(3, -1)
        corners = np.concatenate([corners, halves])
        shifts = np.concatenate([shifts, loop.shift(magnitude, halves, tolerance)])
        nodes = np.stack([a, b, c, ab, bc, ca], axis=1)
        possible, linear, inside, zero, width = _examined(corners[nodes], shifts[nodes])
        starts.append(zero[possible & linear])
        rough, small = possible & ~linear, width < _SMALLEST_CELL
        tiny.append(zero[rough & small])
        tiny_inside.append(zero[rough & small & inside])
        left_out = zero[rough & ~small & inside]
        a, b, c, ab, bc, ca = nodes[rough & ~small].T
        parts = ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))
        cells = np.concatenate([np.stack(part, axis=1) for part in parts])
    rest = np.concatenate(tiny)
    if len(rest) > _MANY_SMALL_CELLS:
        rest = np.concatenate(tiny_inside)
    if exhausted:
        # Where the search gave up, the zeros of the piecewise linear shift: most are near those of the shift.
        rest = np.concatenate([rest, left_out])
    if len(rest) > _MOST_STARTS:
        exhausted, rest = True, rest[spaced(rest, 0.1 * FAMILY_SPACING)]
    return np.concatenate([*starts, rest]), exhausted


def _examined(points: Array, shifts: Array) -> tuple[Mask, Mask, Mask, Array, Array]:
    """Triangles, by corners and midpoints of sides with their shifts u(T) - u(0), (F, 6, 3) each.

    In the tangent plane at the middle the shift is taken as linear between the corners; the midpoints show its bend,
    which, through the inverse of the slope, is the uncertainty of a zero's place, however much the map shears.

    Returns possible, linear, inside (F,): whether a zero inside cannot be excluded, the shift is nearly linear, the
    zero of the linear shift is inside; that zero (F, 3) if it is inside or reliable, else the middle; and the width
    (F,).
    """
    middle = so3.normalised(points[:, :3].sum(axis=1))
    basis = tangent_basis(middle)
    across = so3.transpose(basis)
    place, shift = (points - middle[:, None]) @ across, shifts @ across
    corner, value, following = place[:, :3], shift[:, :3], [1, 2, 0]
    slope = so3.transpose(
        np.asarray(np.linalg.solve(corner[:, 1:] - corner[:, :1], value[:, 1:] - value[:, :1]), float)
    )
    steepness = np.linalg.norm(slope, axis=(-1, -2))
    flat = np.abs(np.linalg.det(slope)) < 1e-12 * steepness**2
    inverse = np.linalg.inv(np.where(flat[:, None, None], np.eye(2), slope))
    bend = shift[:, 3:] - 0.5 * (value + value[:, following])
    most = np.linalg.norm(bend, axis=-1).max(axis=1)
    seen = np.linalg.norm(so3.apply(inverse[:, None], bend), axis=-1).max(axis=1)
    width = np.linalg.norm(corner - corner[:, following], axis=-1).max(axis=1)
    ends = points + shifts
    wide = np.linalg.norm(ends[:, 3:] - ends[:, :3], axis=-1).max(axis=1) > _WIDE
    zero = corner.mean(axis=1) - so3.apply(inverse, value.mean(axis=1))
    away = _distance_of_origin(corner - zero[:, None])
    linear = ~flat & ~wide & (seen < _BEND * width)
    inside = ~flat & (away < 0.05 * width)
    informative = ~flat & (seen < width)
    possible = _distance_of_origin(value) <= _SAFETY_FACTOR * most + 0.02 * steepness * width
    possible &= ~informative | (away <= _SAFETY_FACTOR * seen + 0.05 * width)
    shown = np.where((linear | inside)[:, None], zero, 0.0)
    return possible | wide, linear, inside, so3.normalised(middle + so3.apply(across, shown)), width


def _distance_of_origin(triangles: Array) -> Array:
    """Distance of the origin from plane triangles: (F, 3, 2) -> (F,), zero inside."""
    start, end = triangles, triangles[:, [1, 2, 0]]
    side = end - start
    length = np.maximum(np.sum(side * side, axis=-1), TINY)
    share = np.clip(-np.sum(start * side, axis=-1) / length, 0.0, 1.0)
    distance = np.linalg.norm(start + share[..., None] * side, axis=-1).min(axis=1)
    turning = start[..., 0] * end[..., 1] - start[..., 1] * end[..., 0]
    inside = np.all(turning > 0.0, axis=1) | np.all(turning < 0.0, axis=1)
    return np.where(inside, 0.0, distance)


def spaced(points: Array, spacing: float) -> Integers:
    """Which points are kept when each must be `spacing` away from those kept before it: (N, 3) -> (n,)."""
    kept: list[int] = []
    for row, point in enumerate(points):
        if np.all(np.linalg.norm(points[kept] - point, axis=-1) > spacing):
            kept.append(row)
    return np.array(kept, dtype=np.int64)
