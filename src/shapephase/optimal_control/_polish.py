"""Exact derivative of the attitude at the end by the path, and Newton corrections that use it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .. import so3
from ..arrays import Array, Mask
from ..chebyshev import gauss_tableau
from ..inertia_tensor import inverse_inertia
from ..reconstruction.reconstruction import Motion
from ..shape_space.shape_path import ShapePath
from ._plan_limits import derivative_limits, shortest_duration
from ._spline_basis import SplineBasis
from ._via_points import via_rows
from .task import Reorientation, motion_along

RECONSTRUCTION_TOLERANCE = 1e-10  # [rad]: a hundredth of what plans have to reach
GOAL_TOLERANCE = 1e-8  # [rad], goal error that counts as reached: a hundred times the reconstruction's
_CONVERGED = 5e-10  # [rad], goal error at which the next Newton step is lost in the reconstruction's error
_STEPS = 8  # Newton steps at most: it converges quadratically
_TOO_FAR = 1.0  # [rad], goal error from which on the linear model is no guide
GAUSS_NODES = 8  # Gauss nodes of a piece for the derivative of the end: order 16
_ACTIVE = 1e-6  # share of the range within which a limit is active: interior-point solutions end inside it
_LEAST_RANGE = 1e-300  # [rad or m], of a fixed coordinate, to divide by
_ROUNDS = 6  # corrections found anew because they would take rates beyond their limits
_RANK = 1e-10  # share of the largest singular value below which held rates depend on each other


@dataclass(frozen=True, eq=False)
class PolishedPath:
    """A path corrected to reach the goal as far as possible.

    control : (k, m) control points
    duration : [s]
    path, motion : path of all joints, and its reconstruction
    goal_error : angle between the end of `motion` and the goal [rad]
    first_goal_error : before the corrections [rad]
    steps : corrections made
    via_places : (v,) where `path` passes the waypoints
    """

    control: Array
    duration: float
    path: ShapePath
    motion: Motion
    goal_error: float
    first_goal_error: float
    steps: int
    via_places: Array


def end_derivative(task: Reorientation, basis: SplineBasis, path: ShapePath, motion: Motion) -> Array:
    """Exact derivative of the attitude at the end by each control point: (3, k, m).

    A change d of the control points turns the end to exp(hat(e)) R(T), e = sum of the entries times d, inertial axes.
    With eta(t) the change of R(t) as a rotation vector, inertial axes,

        eta' = R I^-1 R^T (mu x eta) - R I^-1 (J dr' + (dI/dr_k omega + dJ/dr_k r') dr_k).

    Source: theory.md B2 varied; for loops without momentum equal to `holonomy_derivative`.
    """
    body, momentum = task.body, task.momentum
    places, weights = basis.gauss(GAUSS_NODES)
    duration = motion.duration
    times = np.minimum(places * duration, duration)
    shapes, rates = path.curve(times)
    attitude = motion.attitude(times)
    inverse = inverse_inertia(body.locked_inertia(shapes), times)
    matrix = body.momentum_matrix(shapes)
    back = so3.apply(so3.transpose(attitude), np.broadcast_to(momentum, (len(times), 3)))
    omega = so3.apply(inverse, back - so3.apply(matrix, rates))
    gradient = np.swapaxes(body.angular_momentum_gradient(shapes, rates, omega), -1, -2)
    spatial = -attitude @ inverse
    if np.any(momentum):
        generator = attitude @ inverse @ so3.transpose(attitude) @ so3.hat(momentum)
        spatial = _transported(generator, basis, duration) @ spatial
    by_shape = (spatial @ gradient @ task.coupling) * (weights * duration)[:, None, None]
    by_rate = (spatial @ matrix @ task.coupling) * weights[:, None, None]
    values, slopes = basis.sparse_matrix(places), basis.sparse_matrix(places, 1)
    by_point = values.T @ by_shape.reshape(len(places), -1) + slopes.T @ by_rate.reshape(len(places), -1)
    return np.swapaxes(by_point.reshape(basis.dimension, 3, -1), 0, 1)


def goal_derivative(task: Reorientation, basis: SplineBasis, path: ShapePath, motion: Motion, control: Array) -> Array:
    """Exact derivative of the constrained part of the end by each control point: (j, k, m).

    The last control point also turns a pointed link against the base.
    """
    slopes = end_derivative(task, basis, path, motion)
    slopes[:, -1] += motion.final_attitude @ task.pointed_turn(control[-1])
    return np.tensordot(task.constrained_directions(), slopes, axes=1)


def polish(
    task: Reorientation, basis: SplineBasis, control: Array, duration: float, via_places: Array | None = None
) -> PolishedPath:
    """Return the nearest control points whose reconstructed motion reaches the goal, by Newton's method.

    Nearest in the integral of the squared change of rates. Coordinates at their limits, and rates where the duration is
    given, stay there; a path of least time is stretched instead until its rates are within their limits. Waypoints are
    passed at their places.

    Raises
    ------
    AccuracyNotReached, SingularInertiaError
        See `reconstruct`.
    """
    at = np.zeros(0) if via_places is None else via_places
    first = now = best = _reconstructed(task, basis, control, duration, at)
    for step in range(1, _STEPS + 1):
        if now.goal_error <= _CONVERGED or now.goal_error > _TOO_FAR:
            break
        directions = task.constrained_directions()
        slopes = goal_derivative(task, basis, now.path, now.motion, now.control)
        turn = directions @ task.turn_to_goal(now.motion.final_attitude, now.control[-1])
        passed, values = via_rows(task, basis, at)
        missing = values - np.einsum("jkm,km->j", passed, now.control)
        rows, right = np.concatenate([slopes, passed]).reshape(-1, now.control.size), np.append(turn, missing)
        corrected = _corrected(task, basis, now.control, now.duration, rows, right)
        now = replace(_reconstructed(task, basis, *corrected, at), first_goal_error=first.goal_error, steps=step)
        if now.goal_error < best.goal_error:
            best = now
    return best


def _reconstructed(
    task: Reorientation, basis: SplineBasis, control: Array, duration: float, via_places: Array
) -> PolishedPath:
    """Return the path of control points and its motion, before corrections."""
    path = basis.path(task.shapes(control), duration, task.body.joint_names)
    motion = motion_along(task, path, RECONSTRUCTION_TOLERANCE)
    error = task.goal_error(motion.final_attitude, control[-1])
    return PolishedPath(control, duration, path, motion, error, error, 0, via_places)


def _corrected(
    task: Reorientation, basis: SplineBasis, control: Array, duration: float, slopes: Array, missing: Array
) -> tuple[Array, float]:
    """Return the control points after the least change by which slopes @ points change by `missing`, within limits."""
    roots = _roots(basis, _free(task, basis, control))
    conditions = np.kron(end_conditions(task, basis), np.eye(task.dimension))
    rows, right = np.concatenate([slopes, conditions]), np.concatenate([missing, np.zeros(len(conditions))])
    held = _ActiveSet.at_limits(task, basis, control, duration)
    moved = control
    for _ in range(_ROUNDS):
        every, all_right = np.concatenate([rows, held.rows]), np.concatenate([right, held.changes])
        every = every.reshape(-1, *control.shape)
        # With C C^T the inverse of the norm, the least change is C times the shortest x of rows C x = right.
        scaled = [every[:, points, place] @ root for place, (points, root) in enumerate(roots)]
        shortest = np.linalg.lstsq(np.concatenate(scaled, axis=1), all_right, rcond=_RANK)[0]
        change, last = np.zeros_like(control), 0
        for place, (points, root) in enumerate(roots):
            change[points, place] = root @ shortest[last : last + len(root)]
            last += len(root)
        moved = np.clip(control + change, task.lower, task.upper)
        further = held.with_violated(task, control, moved)
        if further is held:
            break
        held = further
    if task.cost == "time":
        shortest = shortest_duration(task, basis, moved)
        # Efforts have limits of their own, which the solver's duration keeps.
        duration = max(shortest, duration) if task.efforts_limited else shortest
    return moved, duration


def _roots(basis: SplineBasis, free: Mask) -> list[tuple[Mask, Array]]:
    """Return the free points of each coordinate, and C with C C^T the inverse norm of their changes there."""
    inverse = basis.inverse_norm
    roots: dict[bytes, Array] = {}
    for points in free.T:
        if points.tobytes() not in roots:
            roots[points.tobytes()] = np.asarray(np.linalg.cholesky(inverse[np.ix_(points, points)]), np.float64)
    return [(points, roots[points.tobytes()]) for points in free.T]


@dataclass(frozen=True, eq=False)
class _ActiveSet:
    """Limits of rates, accelerations and jerks that a correction holds as equations.

    bounding : (j, k) rows of all bounded derivatives, by place, from control points of the path
    limits : (j, m)
    active : (j, m) which of them are held
    targets : (j, m) change of each that is held
    """

    bounding: Array
    limits: Array
    active: Mask
    targets: Array

    @classmethod
    def at_limits(cls, task: Reorientation, basis: SplineBasis, control: Array, duration: float) -> _ActiveSet:
        """Return those at their limits, which stay there; none for a path of least time, which is stretched instead."""
        bounding, limits = np.zeros((0, basis.dimension)), np.zeros((0, task.dimension))
        for order, limit in enumerate(derivative_limits(task, duration).values(), start=1):
            if np.isfinite(limit).any():
                rows = basis.derivative_control(order)
                bounding = np.concatenate([bounding, rows])
                limits = np.concatenate([limits, np.tile(limit, (len(rows), 1))])
        now = bounding @ control
        active = np.abs(now) > limits * (1.0 - _ACTIVE)
        return cls(bounding, limits, active & (task.cost != "time"), np.zeros_like(now))

    def with_violated(self, task: Reorientation, control: Array, moved: Array) -> _ActiveSet:
        """Return this set with those that a correction violates, put at their limits; itself if there are none."""
        after = self.bounding @ moved
        beyond = (np.abs(after) > self.limits) & ~self.active
        if task.cost == "time" or not beyond.any():
            return self
        targets = np.where(beyond, np.copysign(self.limits, after) - self.bounding @ control, self.targets)
        return _ActiveSet(self.bounding, self.limits, self.active | beyond, targets)

    @property
    def changes(self) -> Array:
        """Change of each that is held: (h,)."""
        return self.targets[self.active]

    @property
    def rows(self) -> Array:
        """Rows of the equations, by the control points of the path: (h, k m)."""
        where = np.argwhere(self.active)
        rows = np.zeros((len(where), self.bounding.shape[1], self.active.shape[1]))
        for row, (point, coordinate) in enumerate(where):
            rows[row, :, coordinate] = self.bounding[point]
        return rows.reshape(len(where), self.bounding.shape[1] * self.active.shape[1])


def end_conditions(task: Reorientation, basis: SplineBasis) -> Array:
    """Rows (j, k) whose product with the control points of each coordinate is zero, besides the fixed points."""
    return basis.end_conditions(
        task.equal_points, end_moves=task.end is None, periodic=task.rates_at_ends == "periodic"
    )


def _free(task: Reorientation, basis: SplineBasis, control: Array) -> Mask:
    """Mask (k, m) of control points that may move: not those of the ends, nor those at their limits."""
    free = np.tile(task.movable, (basis.dimension, 1))
    free[: task.equal_points] = False
    if task.end is not None:
        free[-task.equal_points :] = False
    reach = _ACTIVE * np.maximum(task.upper - task.lower, _LEAST_RANGE)
    return free & (control > task.lower + reach) & (control < task.upper - reach)


def _transported(generator: Array, basis: SplineBasis, duration: float) -> Array:
    """P(t) with P(T) = 1, P' = -P K, by collocation: K at the nodes of all pieces (N, 3, 3) -> P there (N, 3, 3)."""
    _, weights, integrals = gauss_tableau(GAUSS_NODES)
    step, size = duration / basis.pieces, 3 * GAUSS_NODES
    field = step * generator.reshape(basis.pieces, GAUSS_NODES, 3, 3)
    system = np.einsum("ij,pjab->piajb", integrals, field).reshape(basis.pieces, size, size)
    fields = np.linalg.solve(np.eye(size) - system, np.tile(np.eye(3), (GAUSS_NODES, 1)))
    inner = fields.reshape(basis.pieces, GAUSS_NODES, 3, 3)
    whole = np.eye(3) + np.einsum("j,pjab,pjbc->pac", weights, field, inner)
    transported = np.empty_like(inner)
    to_end = np.eye(3)
    for piece in reversed(range(basis.pieces)):
        to_end = to_end @ whole[piece]
        transported[piece] = to_end @ np.linalg.inv(inner[piece])
    return transported.reshape(-1, 3, 3)
