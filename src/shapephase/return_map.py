"""The momentum map of a loop of shapes, and the motions whose shape and momentum close together."""

from __future__ import annotations

import numpy as np

from . import so3
from .arrays import Array, finite_array
from .deformation import Deformation
from .errors import OpenPathError, ShapeError
from .reconstruction import Motion, reconstruct
from .sphere import fibonacci_directions

_STARTS = 96
_ITERATIONS = 30


def closed_orbits(deformation: Deformation, magnitude: float, *, tolerance: float = 1e-11) -> list[Motion]:
    """Motions (momentum along inertial z) whose body momentum closes in this deformation's gauge with the shape.

    Newton's method on the map Pi(0) -> Pi(T) from 96 even starts on the sphere. Every loop and size has at
    least two such orbits (theory.md section 2); those found are returned, ordered by the height and azimuth of
    Pi(0). Orbits that fill curves (symmetric bodies) come as single points of them.

    Parameters
    ----------
    magnitude : of the angular momentum, above 0 [kg m^2/s]
    tolerance : of each motion's attitude [rad]

    Raises
    ------
    OpenPathError
        If the shape does not close.
    """
    if deformation.closure is None:
        raise OpenPathError(f"closed orbits need a loop of shapes; this one ends {deformation.shape_gap:.3g} off")
    size = finite_array(magnitude, "magnitude", unit="kg m^2/s")
    if size.ndim or size <= 0.0:
        raise ShapeError(f"magnitude: a number above 0 kg m^2/s is needed, got {magnitude!r}")
    points = fibonacci_directions(_STARTS)
    active = np.arange(_STARTS)
    for _ in range(_ITERATIONS):
        points[active], moved = _newton_step(deformation, float(size), points[active], tolerance)
        active = active[moved > 1e-12]
        if not len(active):
            break
    attitudes = _attitude_of(points)
    motion = reconstruct(deformation, [0.0, 0.0, float(size)], attitudes, tolerance=tolerance)
    ends = motion.body_momentum(deformation.duration) / size
    closed = points[np.linalg.norm(ends - points, axis=-1) < max(1e-10, 10.0 * tolerance)]
    found: list[Array] = []
    for point in closed[np.lexsort([np.arctan2(closed[:, 1], closed[:, 0]), -closed[:, 2]])]:
        if all(np.linalg.norm(point - other) > 1e-6 for other in found):
            found.append(point)
    return [
        reconstruct(deformation, [0.0, 0.0, float(size)], _attitude_of(point), tolerance=tolerance) for point in found
    ]


def _newton_step(deformation: Deformation, size: float, points: Array, tolerance: float) -> tuple[Array, Array]:
    """One Newton step on u(T) = u(0) in the tangent planes: the new points and how far each moved.

    A small turn delta of the start moves u by u x delta, and reaches the end as the propagator says.
    """
    motion = reconstruct(deformation, [0.0, 0.0, size], _attitude_of(points), tolerance=tolerance)
    ends = motion.body_momentum(deformation.duration) / size
    first = so3.perpendicular(points)
    basis = np.stack([first, np.cross(points, first)], axis=1)
    turns = np.cross(basis, points[:, None])
    arriving = np.einsum("nij,nkj->nki", motion.propagator, turns)
    slope = np.cross(ends[:, None], arriving)
    derivative = np.einsum("nic,njc->nij", basis, slope) - np.eye(2)
    gap = np.einsum("nic,nc->ni", basis, ends - points)
    scale = np.linalg.norm(derivative, axis=(-1, -2))[:, None, None]
    step = -np.einsum("nij,nj->ni", np.linalg.pinv(derivative / scale, rcond=1e-9) / scale, gap)
    length = np.linalg.norm(step, axis=-1)
    step *= np.minimum(1.0, 0.3 / np.maximum(length, 1e-300))[:, None]
    moved = so3.normalised(points + np.einsum("ni,nic->nc", step, basis))
    return moved, np.linalg.norm(moved - points, axis=-1)


def _attitude_of(direction: Array) -> Array:
    """An attitude that shows the inertial z axis along a body direction: R^T z = direction."""
    return so3.transpose(so3.between(np.broadcast_to([0.0, 0.0, 1.0], direction.shape), direction))
