"""The momentum's direction over one loop of shapes: u(0) to u(T), with derivatives, and Newton's method on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arguments import tolerance_argument
from ..arrays import Array, Integers, Mask
from ..deformation.deformation import Deformation
from ..errors import OpenPathError
from ..integrator.integrate import stepped_rotation
from ..integrator.many_rotations import GroupedRotations, RotationPart
from ..integrator.sampling import Sampler
from ..integrator.stepped import SteppedRotation

UP = np.array([0.0, 0.0, 1.0])  # inertial direction of the momentum
_ROWS_AT_ONCE = 2048  # directions run through the loop together, for memory
_SLOPES_AT_ONCE = 128  # directions with derivatives, some milliseconds each
_LONGEST_STEP = 0.3  # [rad] of Newton's method
TINY = float(np.finfo(float).tiny)  # keeps quotients defined


@dataclass(frozen=True)
class MomentumLoop:
    """A loop of shapes, sampled once for all evaluations of its map.

    goal : tolerance [rad]
    """

    deformation: Deformation
    sampler: Sampler
    goal: float

    @classmethod
    def of(cls, deformation: Deformation, tolerance: float) -> MomentumLoop:
        """Return the loop of a deformation whose shape closes. Raises OpenPathError, ShapeError."""
        if deformation.closure is None:
            raise OpenPathError(f"closed orbits need a loop of shapes; this one ends {deformation.shape_gap:.3g} off")
        return cls(deformation, deformation.sampler(), tolerance_argument(tolerance))

    @property
    def accepted(self) -> float:
        """The gap of what counts as closed [rad]."""
        return max(1e-10, 10.0 * self.goal)

    def run(self, magnitude: float, points: Array, tolerance: float | None = None) -> SteppedRotation:
        """The motions that start with momenta of this magnitude along these directions (N, 3)."""
        return stepped_rotation(self.sampler, magnitude * points, tolerance or self.goal)

    def run_all(self, magnitude: float, points: Array) -> SteppedRotation | GroupedRotations:
        """Return the motions from any number of directions, some thousand at a time."""
        if len(points) <= _ROWS_AT_ONCE:
            return self.run(magnitude, points)
        rows = _in_parts(len(points), _ROWS_AT_ONCE)
        parts = tuple(RotationPart(part, self.run(magnitude, points[part])) for part in rows)
        return GroupedRotations(parts, self.sampler.evaluations)

    def shift(self, magnitude: float, points: Array, tolerance: float) -> Array:
        """u(T) - u(0): (N, 3)."""
        parts = [points[rows] for rows in _in_parts(len(points), _ROWS_AT_ONCE)]
        return np.concatenate([ends_of(self.run(magnitude, part, tolerance), part) for part in parts]) - points

    def exactly(self, magnitude: float, points: Array, tolerance: float | None = None) -> tuple[Array, Array, Array]:
        """u(T) (N, 3), its derivatives by u(0) (N, 3, 3) and by the momentum's magnitude (N, 3)."""
        results = []
        for rows in _in_parts(len(points), _SLOPES_AT_ONCE):
            solution = self.run(magnitude, points[rows], tolerance)
            ends = ends_of(solution, points[rows])
            results.append((ends, *exact_slopes(solution, points[rows], ends, magnitude)))
        ends, by_start, by_magnitude = (np.concatenate(parts) for parts in zip(*results, strict=True))
        return ends, by_start, by_magnitude


def _in_parts(count: int, most: int) -> list[Integers]:
    """Rows in parts of at most so many."""
    return np.split(np.arange(count), range(most, count, most))


def ends_of(solution: SteppedRotation | GroupedRotations, points: Array) -> Array:
    """u(T) of u(0): (N, 3) -> (N, 3)."""
    return so3.apply(so3.transpose(solution.end), points)


def exact_slopes(
    solution: SteppedRotation | GroupedRotations, points: Array, ends: Array, magnitude: float
) -> tuple[Array, Array]:
    """Derivatives of u(T) = S^T u(0), by u(0) (N, 3, 3) and by the momentum's magnitude (N, 3)."""
    turning = so3.hat(ends) @ solution.momentum_slope
    return so3.transpose(solution.end) + magnitude * turning, so3.apply(turning, points)


def tangent_basis(points: Array) -> Array:
    """Tangent vectors e and u x e at each direction: (N, 3) -> (N, 2, 3)."""
    first = so3.perpendicular(points)
    return np.stack([first, np.cross(points, first)], axis=-2)


@dataclass(frozen=True)
class ClosedPoints:
    """Result of Newton's method.

    Points (N, 3), gaps and last steps (N,), and the derivatives of u(T) - u(0) by u(0) (N, 2, 2) and by
    magnitude (N, 2).
    """

    points: Array
    gap: Array
    step: Array
    slope: Array
    by_magnitude: Array

    def __getitem__(self, rows: Integers | Mask) -> ClosedPoints:
        """Some of them."""
        return ClosedPoints(
            self.points[rows], self.gap[rows], self.step[rows], self.slope[rows], self.by_magnitude[rows]
        )

    @property
    def excess(self) -> Array:
        """2 - trace; near the identity the determinant of the derivative minus one, which is equal and sharper."""
        trace = np.trace(self.slope, axis1=-2, axis2=-1)
        return np.where(self._steepness < 1.0, np.linalg.det(self.slope), -trace)

    @property
    def doubt(self) -> Array:
        """Bound below which the sign of the excess is unknown, for points known to 1e-12 near a fold."""
        steep = self._steepness
        return np.where(steep < 1e-9, np.inf, 1e-6 * steep * np.minimum(1.0, np.sqrt(steep)))

    @property
    def _steepness(self) -> Array:
        return np.linalg.norm(self.slope, axis=(-1, -2))


def closed_points(
    loop: MomentumLoop, magnitude: float, points: Array, tolerance: float, enough: float, iterations: int = 12
) -> ClosedPoints:
    """Newton's method with exact derivatives, until steps are `enough`, or rounding is all that is left: (N, 3)."""
    count = len(points)
    points, active = points.copy(), np.arange(count)
    gap, length = np.full(count, np.inf), np.full(count, np.inf)
    slope, by_magnitude = np.zeros((count, 2, 2)), np.zeros((count, 2))
    for left in reversed(range(iterations)):
        if not len(active):
            break
        ends, slopes, drift = loop.exactly(magnitude, points[active], tolerance)
        basis = tangent_basis(points[active])
        by_magnitude[active] = so3.apply(basis, drift)
        slope[active] = basis @ slopes @ so3.transpose(basis) - np.eye(2)
        step = -solve_linear(slope[active], so3.apply(basis, ends - points[active]), 1e-7)
        step *= np.minimum(1.0, _LONGEST_STEP / np.maximum(np.linalg.norm(step, axis=-1, keepdims=True), TINY))
        before, length[active] = length[active], np.linalg.norm(step, axis=-1)
        gap[active] = so3.angle_between(points[active], ends)
        settled = (gap[active] < 10.0 * tolerance) & (length[active] > 0.25 * before)
        hopeless = (length[active] > 0.1) & (left < iterations - 5)
        going = (length[active] > enough) & ~settled & ~hopeless & (left > 0)
        active = active[going]
        points[active] = so3.normalised(points[active] + np.einsum("ni,nic->nc", step[going], basis[going]))
    return ClosedPoints(points, gap, length, slope, by_magnitude)


def solve_linear(slope: Array, right: Array, least: float) -> Array:
    """slope^-1 right (N, 2); zero along directions with singular values below `least` of the largest."""
    scale = np.maximum(np.linalg.norm(slope, axis=(-1, -2)), TINY)[:, None, None]
    return so3.apply(np.linalg.pinv(slope / scale, rcond=least) / scale, right)
