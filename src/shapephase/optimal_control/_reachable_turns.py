"""Goals that no motion reaches, found before the search."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array, Integers
from ..body.body import Body
from ..body.particles.point_masses import ParticleBody
from ..deformation.deformation import rigid
from ..errors import AccuracyNotReached, ShapeError, SingularInertiaError, UnreachableGoalError
from ..reconstruction.reconstruction import reconstruct
from ..shape_space.connection import connection_slopes, curvature, horizontal_lift, mechanical_connection
from ..shape_space.reach.holonomy_algebra import carried_curvature
from ..shape_space.shape_path import ShapePath
from .task import Reorientation

_SHAPES = 6  # random shapes within the limits: an analytic function that vanishes at all of them is zero
_SEED = 54
_NOISE = 1e-10  # relative to the curvature's terms: exact symmetries leave 1e-14; less needs 1e9 loops
_NOTHING = 1e-13  # [rad per stroke, or its square] of rounding in motions that turn nothing
_LEAST_MISS = 1e-6  # [rad] by which a goal must be missed: rounding of user input is left to the search
_RADII = (np.pi, np.pi / 8.0, np.pi / 64.0)  # [strokes] about the start, where shapes are drawn if limits are wider


@dataclass(frozen=True, eq=False)
class _ReachableTurns:
    """Superset of the attitudes in which a motion can end: exp(angle axis) attitude for any angle, inertial axes.

    attitude : (3, 3)
    link : (3, 3) attitude of the link that is pointed against the base
    axis : (3,) unit vector; None: the angle is 0
    reason : restriction of the motion, in words
    remedy : advice, in words
    """

    attitude: Array
    link: Array
    reason: str
    remedy: str
    axis: Array | None = None

    def goal_error(self, task: Reorientation) -> float:
        """Least distance of a goal from all these attitudes [rad]: a lower bound."""
        if task.target is not None:
            return float(so3.angle(task.target @ self._nearest(task.target).T))
        axis, direction = task.pointing_axes()
        pointed = self.attitude @ self.link @ axis
        if self.axis is None:
            return float(so3.angle_between(direction, pointed))
        return float(np.abs(so3.angle_between(self.axis, pointed) - so3.angle_between(self.axis, direction)))

    def nearest_turn(self, task: Reorientation) -> Array | None:
        """Rotation vector of the attitude nearest to a goal (3,); None for a pointed axis."""
        return None if task.target is None else so3.log(self._nearest(task.target))

    def _nearest(self, target: Array) -> Array:
        if self.axis is None:
            return self.attitude
        return so3.exp(so3.angle_about(target @ self.attitude.T, self.axis) * self.axis) @ self.attitude


def check_reachable(tasks: Sequence[Reorientation]) -> None:
    """Raise UnreachableGoalError if no motion of the joints reaches any of several goals of one body."""
    turns = None
    for radius in _RADII:  # particles may have no places far away, or lie on a line on the way there
        with suppress(SingularInertiaError, AccuracyNotReached, ShapeError):
            turns = _reachable_turns(tasks[0], radius)
            break
    if turns is None:
        return
    errors = [turns.goal_error(task) for task in tasks]
    nearest = int(np.argmin(errors))
    if errors[nearest] <= _LEAST_MISS:
        return
    turn = turns.nearest_turn(tasks[nearest])
    instead = ""
    if turn is not None and (angle := float(np.linalg.norm(turn))) > _LEAST_MISS:
        about = " ".join(f"{value + 0.0:.6g}" for value in turn / angle)
        instead = (
            f", or take the nearest goal that is not excluded: so3.exp({_text(turn)}), "
            f'--turn "{np.degrees(angle):.6g} about {about}"'
        )
    raise UnreachableGoalError(
        f"no motion of the joints of {tasks[0].body.name} reaches the goal: {turns.reason}; it is missed by "
        f"{np.degrees(errors[nearest]):.4g} degrees or more; {turns.remedy}{instead}"
    )


def _reachable_turns(task: Reorientation, radius: float) -> _ReachableTurns | None:
    """Return the smallest known superset of the attitudes at the end; None where none is known."""
    moves = np.flatnonzero(task.movable)
    if not len(moves):
        return _rigid_turns(task)
    if task.end is not None and not task.momentum.any():
        turns = _loop_turns(task, moves, radius)
        if turns is not None:
            return turns
    return _planar_turns(task, moves, radius) if _is_analytic(task.body) else None


def _rigid_turns(task: Reorientation) -> _ReachableTurns | None:
    link = _link_attitude(task)
    remedy = "let joints move: leave out joints (--joints), or widen their limits, Limits(joint_limits=False)"
    reason = "none of the joints can move, as they are held or both of their limits are the same"
    if not task.momentum.any():
        return _ReachableTurns(np.eye(3), link, f"{reason}, and without momentum nothing turns it", remedy)
    if task.cost == "time" or task.windings is not None:
        return None
    motion = reconstruct(rigid(task.body.locked_inertia(task.shapes(task.start)), task.duration), task.momentum)
    reason = f"{reason}: it turns like a rigid body with the momentum {_text(task.momentum)} kg m^2/s"
    remedy = f"{remedy}, or give another momentum or duration (--momentum, --duration)"
    return _ReachableTurns(motion.final_attitude, link, reason, remedy)


def _loop_turns(task: Reorientation, moves: Integers, radius: float) -> _ReachableTurns | None:
    """Attitudes without momentum between two given shapes: loops at the start, then the straight path."""
    axes = np.zeros((0, 3)) if len(moves) == 1 else _holonomy_axes(task, moves, radius)
    if axes is None:
        return None
    start, end = task.shapes(task.start), task.shapes(task.start if task.end is None else task.end)
    closed = np.array_equal(start, end)
    straight = np.eye(3)
    if not closed:
        straight = horizontal_lift(task.body, ShapePath.waypoints([0.0, 1.0], [start, end]), 1e-10).end
    if len(moves) == 1:
        reason = f"only {_names(task, moves)} can move, with one freedom, whose loops turn the body not at all"
    elif not len(axes):
        reason = f"loops of {_names(task, moves)} turn the body not at all"
    else:
        reason = f"loops of {_names(task, moves)} turn the body about one axis alone, {_text(axes[0])}"
    reason += f" (holonomy algebra of rank {len(axes)})"
    if not closed:
        reason += f", and the way to the end by {_text(so3.log(straight))} rad"
    remedy = f"{_more_joints(task)}, or end elsewhere (end='free', --to free)"
    return _ReachableTurns(straight, np.eye(3), reason, remedy, axis=axes[0] if len(axes) else None)


def _holonomy_axes(task: Reorientation, moves: Integers, radius: float) -> Array | None:
    """Axis of the holonomy algebra at the start, (0, 3) or (1, 3); None: it may be complete."""
    body = task.body
    if not _is_analytic(body):
        return None
    frame = task.coupling[:, moves] * _strokes(task)[moves]
    shapes = task.shapes(_drawn(task, radius))
    first, second = np.triu_indices(len(moves), 1)
    magnitude = 0.0

    def pairs(field: Array) -> Array:
        return np.einsum("ia,pijk,jb->pabk", frame, field, frame)[:, first, second].reshape(-1, 3)

    for shape in shapes[:2]:
        columns, slopes = connection_slopes(body, shape)
        norms = np.abs(frame).T @ np.linalg.norm(columns, axis=-1)
        terms = 2.0 * np.abs(frame).T @ np.linalg.norm(slopes, axis=-1) @ np.abs(frame) + np.outer(norms, norms)
        magnitude = max(magnitude, float(terms.max()))
        # Two axes at one shape have a third for their bracket.
        if len(_axes(pairs(curvature(body, shape[None])), magnitude)) > 1:
            return None
    axes = _axes(pairs(carried_curvature(body, task.shapes(task.start), shapes)), magnitude)
    return axes if len(axes) < 2 else None


def _axes(vectors: Array, magnitude: float) -> Array:
    """Directions spanned by vectors, beyond noise: (N, 3) -> (rank, 3)."""
    _, values, right = np.linalg.svd(vectors, full_matrices=False)
    axes = right[values > _NOISE * magnitude + _NOTHING]
    largest = np.take_along_axis(axes, np.argmax(np.abs(axes), axis=1)[:, None], axis=1)
    return axes * np.sign(largest)


def _planar_turns(task: Reorientation, moves: Integers, radius: float) -> _ReachableTurns | None:
    """Attitudes where all turns, the momentum and a principal axis of inertia at all shapes have one axis."""
    body, coordinates = task.body, _drawn(task, radius)
    shapes, strokes = task.shapes(coordinates), _strokes(task)[moves]
    connection, frame = mechanical_connection(body, shapes), task.coupling[:, moves] * strokes
    vectors = np.swapaxes(connection @ frame, -1, -2).reshape(-1, 3)
    magnitude = float((np.abs(connection) @ np.abs(frame)).max())
    if task.link is not None:
        turned = [task.pointed_turn(row)[:, moves].T * strokes[:, None] for row in coordinates]
        vectors, magnitude = np.concatenate([vectors, *turned]), max(magnitude, 1.0)
    size = float(np.linalg.norm(task.momentum))
    if size:
        vectors = np.concatenate([vectors, task.momentum[None] / size])
    axes = _axes(vectors, magnitude)
    if len(axes) > 1:
        return None
    link, remedy = _link_attitude(task), _more_joints(task)
    if not len(axes):
        reason = f"motions of {_names(task, moves)} turn the body not at all (holonomy algebra of rank 0)"
        return _ReachableTurns(np.eye(3), link, reason, remedy)
    axis = axes[0] if not size else task.momentum / size
    reason = f"motions of {_names(task, moves)} turn the body about one axis alone, {_text(axis)}"
    if not size:
        return _ReachableTurns(np.eye(3), link, f"{reason} (holonomy algebra of rank 1 at most)", remedy, axis=axis)
    inertias = body.locked_inertia(shapes)
    across = so3.apply(so3.hat(axis), inertias @ axis)
    if np.abs(across).max() > _NOISE * np.abs(inertias).max():
        return None
    remedy = f"{remedy}, or give another momentum (--momentum)"
    return _ReachableTurns(np.eye(3), link, f"{reason}, that of the momentum", remedy, axis=axis)


def _drawn(task: Reorientation, radius: float) -> Array:
    """Coordinates drawn within the limits, up to a radius from the start [strokes]: (N, m)."""
    reach = task.reach(radius * _strokes(task))
    return np.random.default_rng(_SEED).uniform(*reach, (_SHAPES, task.dimension))


def _is_analytic(body: Body | ParticleBody) -> bool:
    """True where a property of random shapes holds for all: not for functions with knots."""
    return not any(len(function.knots) for joint in body.follows.curved for _, function in joint.terms)


def _strokes(task: Reorientation) -> Array:
    """Length of one stroke: a radian, or the body's radius of gyration for coordinates that slide (m,)."""
    body = task.body
    radius = float(np.sqrt(0.5 * np.trace(body.locked_inertia(task.shapes(task.start))) / body.mass))
    slides = np.array([unit == "m" for unit in body.joint_units])
    return np.where((np.abs(task.coupling) * slides[:, None]).any(axis=0), radius, 1.0)


def _link_attitude(task: Reorientation) -> Array:
    """Attitude of the pointed link at the start, base axes: (3, 3); the identity for the base."""
    return np.eye(3) if task.link is None else task.links.link_pose(task.shapes(task.start), task.link)[:3, :3]


def _more_joints(task: Reorientation) -> str:
    """Advice about the joints."""
    if np.abs(task.coupling).any(axis=1).all() and task.movable.all() and task.dimension == task.body.n_shape:
        return "all joints move already: choose another goal"
    return "let other joints move (joints, --joints)"


def _names(task: Reorientation, columns: Integers) -> str:
    """Names of the joints that some coordinates move."""
    moved = np.flatnonzero(np.abs(task.coupling[:, columns]).any(axis=1))
    names = [task.body.joint_names[joint] for joint in moved[:4]]
    return ", ".join(names) + (f" and {len(moved) - 4} more" if len(moved) > 4 else "")


def _text(vector: Array) -> str:
    """Text of a vector, as a list that can be typed."""
    rounded = np.where(np.abs(vector) < 1e-9, 0.0, vector)
    return f"[{', '.join(f'{value:.6g}' for value in rounded)}]"
