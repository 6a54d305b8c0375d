"""How the attitude at the end answers to a change of the path, exactly, and the correction that uses it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .. import so3
from ..arrays import Array, Mask
from ..deformation.deformation import articulated
from ..inertia_tensor import inverse_inertia
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.shape_path import ShapePath
from .collocation import gauss_tableau
from .spline_basis import SplineBasis
from .task import Reorientation

TOLERANCE = 1e-10
REACHED = 1e-8
_ENOUGH = 5e-10
_STEPS = 8
# Newton's method is not begun further from the goal [rad].
_TOO_FAR = 1.0
_NODES = 8
# A coordinate or rate so near to its limit, relative to the range, stays where it is.
_ACTIVE = 1e-6


@dataclass(frozen=True, eq=False)
class Polished:
    """A path that reaches the goal, as far as it could be corrected.

    Attributes
    ----------
    control : (size, m) control points
    duration : [s]
    path, motion : of all joints, and its reconstruction
    first_miss, miss : of the path that came, and what is left [rad]
    steps : corrections made
    """

    control: Array
    duration: float
    path: ShapePath
    motion: Motion
    first_miss: float
    miss: float
    steps: int


def panel_nodes(basis: SplineBasis) -> tuple[Array, Array]:
    """Gauss nodes of all pieces of [0, 1] and their weights: (N,), (N,)."""
    inside, weights, _ = gauss_tableau(_NODES)
    places = (basis.nodes[:-1, None] + inside / basis.pieces).ravel()
    return places, np.tile(weights, basis.pieces) / basis.pieces


def end_derivative(task: Reorientation, basis: SplineBasis, path: ShapePath, motion: Motion) -> Array:
    """How the attitude at the end answers to each control point, exact: (3, size, m).

    A change d of the control points turns the end to exp(hat(e)) R(T), e = sum of the entries times d, inertial axes.
    With eta the turn of R(t) seen from inertial axes,

        eta' = R I^-1 R^T (mu x eta) - R I^-1 (J dr' + (dI/dr_k omega + dJ/dr_k r') dr_k).

    Source: theory.md B2 varied; `holonomy_derivative` is the same for loops without momentum.
    """
    body, momentum = task.body, task.momentum
    places, weights = panel_nodes(basis)
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
        spatial = _carried(attitude @ inverse @ so3.transpose(attitude) @ so3.hat(momentum), basis, duration) @ spatial
    by_shape = (spatial @ gradient @ task.ties) * (weights * duration)[:, None, None]
    by_rate = (spatial @ matrix @ task.ties) * weights[:, None, None]
    values, slopes = basis.matrix(places), basis.matrix(places, 1)
    return np.einsum("nak,ns->ask", by_shape, values) + np.einsum("nak,ns->ask", by_rate, slopes)


def polished(task: Reorientation, basis: SplineBasis, control: Array, duration: float) -> Polished:
    """The nearest control points whose reconstructed motion reaches the goal, by Newton's method.

    Nearest in the integral of the squared change of rates. Coordinates at their limits, and rates where the duration is
    given, stay there; a path of least time is stretched instead by what its rates exceed their limits.

    Raises
    ------
    AccuracyNotReached, SingularInertiaError
        As `reconstruct`.
    """
    best = _checked(task, basis, control, duration, 0)
    now, first_miss = best, best.miss
    for step in range(1, _STEPS + 1):
        if now.miss <= _ENOUGH or now.miss > _TOO_FAR:
            break
        wanted = task.needed()
        slopes = np.tensordot(wanted, end_derivative(task, basis, now.path, now.motion), axes=1)
        right = wanted @ task.turn(now.motion.final_attitude)
        moved = _corrected(task, basis, now.control, now.duration, slopes.reshape(len(wanted), -1), right)
        now = _checked(task, basis, *moved, step)
        if now.miss < best.miss:
            best = now
    return replace(best, first_miss=first_miss)


def _checked(task: Reorientation, basis: SplineBasis, control: Array, duration: float, steps: int) -> Polished:
    """The path of control points, reconstructed."""
    path = basis.path(task.shapes(control), duration, task.body.joint_names)
    motion = reconstruct(articulated(task.body, path), task.momentum, tolerance=TOLERANCE)
    miss = task.miss(motion.final_attitude)
    return Polished(control, duration, path, motion, miss, miss, steps)


def _corrected(
    task: Reorientation, basis: SplineBasis, control: Array, duration: float, slopes: Array, wanted: Array
) -> tuple[Array, float]:
    """The least change of the control points that turns the end by what is wanted, within the limits."""
    free = _free(task, basis, control).ravel()
    places, weights = panel_nodes(basis)
    rates = basis.matrix(places, 1)
    gram = (rates * weights[:, None]).T @ rates + np.eye(basis.size)
    inverse = np.kron(np.linalg.inv(gram), np.eye(task.size))
    rows, right = slopes, wanted
    if task.cost != "time":
        held = _held_rates(task, basis, control, duration)
        rows = np.concatenate([rows, held])
        right = np.concatenate([wanted, np.zeros(len(held))])
    # The least change in the metric's norm: with C C^T its inverse, the shortest x of rows C x = right.
    root = np.linalg.cholesky(inverse[np.ix_(free, free)])
    change = np.zeros(control.size)
    change[free] = root @ np.linalg.lstsq(rows[:, free] @ root, right, rcond=1e-10)[0]
    moved = np.clip(control + change.reshape(control.shape), task.lower, task.upper)
    if task.cost == "time":
        duration = float(np.max(np.abs(basis.rate_control @ moved) / task.rates))
    return moved, duration


def movable_points(task: Reorientation, basis: SplineBasis) -> Mask:
    """(size, m) which control points may move: not those of the ends."""
    free = np.tile(task.moves, (basis.size, 1))
    fixed = [0, 1] if task.rest_to_rest else [0]
    free[fixed] = False
    if task.end is not None:
        free[[basis.size - 1 - place for place in fixed]] = False
    return free


def _free(task: Reorientation, basis: SplineBasis, control: Array) -> Mask:
    """(size, m) which of them are not at their limits either."""
    reach = _ACTIVE * np.maximum(task.upper - task.lower, 1e-300)
    return movable_points(task, basis) & (control > task.lower + reach) & (control < task.upper - reach)


def _held_rates(task: Reorientation, basis: SplineBasis, control: Array, duration: float) -> Array:
    """Rows (k, size m) of the rates' control points that are at their limits."""
    rates = basis.rate_control @ control / duration
    where = np.argwhere(np.abs(rates) > task.rates * (1.0 - _ACTIVE))
    rows = np.zeros((len(where), basis.size, task.size))
    for row, (point, coordinate) in enumerate(where):
        rows[row, :, coordinate] = basis.rate_control[point]
    return rows.reshape(len(where), control.size)


def _carried(generator: Array, basis: SplineBasis, duration: float) -> Array:
    """P(t) with P(T) = 1, P' = -P K, by collocation: K at the nodes of all pieces (N, 3, 3) -> P there (N, 3, 3)."""
    _, weights, integrals = gauss_tableau(_NODES)
    step = duration / basis.pieces
    field = step * generator.reshape(basis.pieces, _NODES, 3, 3)
    system = np.einsum("ij,pjab->piajb", integrals, field).reshape(basis.pieces, 3 * _NODES, 3 * _NODES)
    solved = np.linalg.solve(np.eye(3 * _NODES) - system, np.tile(np.eye(3), (_NODES, 1)))
    inner = solved.reshape(basis.pieces, _NODES, 3, 3)
    whole = np.eye(3) + np.einsum("j,pjab,pjbc->pac", weights, field, inner)
    carried = np.empty_like(inner)
    onward = np.eye(3)
    for piece in reversed(range(basis.pieces)):
        onward = onward @ whole[piece]
        carried[piece] = onward @ np.linalg.inv(inner[piece])
    return carried.reshape(-1, 3, 3)
