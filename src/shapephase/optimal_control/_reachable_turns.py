"""Goals that no motion reaches, found before the search."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import quad

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
_PLACES = 1001  # on a curve of attitudes, which are close up to a length of
_LONGEST = 60.0  # strokes
_MOST_PLACES = 100_000
_BETWEEN = 1.5  # factor by which a slope may exceed its sampled maximum
_RADII = (np.pi, np.pi / 8.0, np.pi / 64.0)  # [strokes] about the start, where shapes are drawn if limits are wider


@dataclass(frozen=True, eq=False)
class _ReachableTurns:
    """Superset of the attitudes in which a motion can end: exp(angle axis) attitudes[k], inertial axes.

    Attributes
    ----------
    attitudes : (k, 3, 3)
    links : (k, 3, 3) attitude of the link that is pointed against the base
    axis : (3,) unit vector; None: the angle is 0
    angles : (least, most) [rad]; None: any
    counted : (2,) somersault and twist of the motion [rad], NaN where free
    slack : largest distance of an attitude of the set from those listed [rad]
    reason : restriction of the motion, in words
    remedy : advice, in words
    """

    attitudes: Array
    links: Array
    reason: str
    remedy: str
    axis: Array | None = None
    angles: tuple[float, float] | None = None
    counted: Array | None = None
    slack: float = 0.0

    def goal_error(self, task: Reorientation) -> float:
        """Least distance of a goal from all these attitudes [rad]: a lower bound."""
        counted = 0.0
        if task.windings is not None:
            windings = np.full(2, np.nan) if self.counted is None else self.counted.copy()
            if self.angles is not None:
                windings[0] = np.clip(task.windings[0], *self.angles)
            counted = float(np.nanmax(np.abs(windings - task.windings), initial=0.0))
        if task.target is None:
            axis, direction = task.pointing_axes()
            pointed = so3.apply(self.attitudes @ self.links, axis)
            gaps = so3.angle_between(direction, pointed)
            if self.axis is not None:
                gaps = np.abs(so3.angle_between(self.axis, pointed) - so3.angle_between(self.axis, direction))
        else:
            apart = task.target @ np.swapaxes(self.attitudes, -1, -2)
            gaps = so3.angle(apart)
            if self.axis is not None:
                about = self._nearest_angles(apart, task)
                gaps = so3.angle(np.swapaxes(so3.exp(about[:, None] * self.axis), -1, -2) @ apart)
        return max(counted, float(gaps.min())) - self.slack

    def nearest_turn(self, task: Reorientation) -> Array | None:
        """Rotation vector of the attitude nearest to a goal (3,); None for a pointed axis."""
        if task.target is None:
            return None
        apart = task.target @ np.swapaxes(self.attitudes, -1, -2)
        if self.axis is None:
            return so3.log(self.attitudes[int(np.argmin(so3.angle(apart)))])
        return so3.log(so3.exp(self._nearest_angles(apart, task)[0] * self.axis) @ self.attitudes[0])

    def _nearest_angles(self, apart: Array, task: Reorientation) -> Array:
        """Angles about the axis nearest to some rotations: (k, 3, 3) -> (k,)."""
        if self.axis is None:
            return np.zeros(len(apart))
        free = np.asarray(so3.angle_about(apart, self.axis))
        if self.angles is None:
            return free
        least, most = self.angles
        if task.windings is not None:
            return np.clip(np.full(len(free), task.windings[0]), least, most)
        beyond = np.mod(free - least, 2.0 * np.pi)
        past = beyond - (most - least)
        return np.where(past <= 0.0, least + beyond, np.where(past < 2.0 * np.pi - beyond, most, least))


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
    body, moves = task.body, np.flatnonzero(task.movable)
    if not len(moves):
        return _rigid_turns(task)
    still = not task.momentum.any()
    if still and task.end is not None:
        turns = _loop_turns(task, moves, radius)
        if turns is not None:
            return turns
    elif still and len(moves) == 1 and (task.upper - task.lower)[moves[0]] < _LONGEST * _strokes(task)[moves[0]]:
        return _one_joint_turns(task, moves[0])
    return _planar_turns(task, moves, radius) if _is_analytic(body) else None


def _rigid_turns(task: Reorientation) -> _ReachableTurns | None:
    shape = task.shapes(task.start)
    links = _link_attitudes(task, shape[None])
    remedy = "let joints move: leave out joints (--joints), or widen their limits, Limits(joint_limits=False)"
    reason = "none of the joints can move, as they are held or both of their limits are the same"
    if not task.momentum.any():
        return _ReachableTurns(np.eye(3)[None], links, f"{reason}, and without momentum nothing turns it", remedy)
    inertia = task.body.locked_inertia(shape)
    motion = reconstruct(rigid(inertia, task.duration), task.momentum)
    rate = float(np.linalg.norm(task.momentum) / np.linalg.eigvalsh(inertia)[0])
    steps = max(_PLACES, int(20.0 * rate * task.duration))
    if steps > _MOST_PLACES:
        return None
    attitudes = motion.attitude(np.linspace(0.0, task.duration, steps))
    reason = f"{reason}: it turns like a rigid body with the momentum {_text(task.momentum)} kg m^2/s"
    remedy = f"{remedy}, or give another momentum or duration (--momentum, --duration)"
    if task.cost == "time":
        links, slack = np.broadcast_to(links, attitudes.shape), 0.5 * rate * task.duration / (steps - 1)
        return _ReachableTurns(attitudes, links, reason, remedy, slack=slack)
    counted = None if task.windings is None else task.counted_windings(attitudes)
    return _ReachableTurns(attitudes[-1:], links, reason, remedy, counted=counted)


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
    return _ReachableTurns(
        straight[None], np.eye(3)[None], reason, remedy, axis=axes[0] if len(axes) else None, slack=1e-9
    )


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


def _one_joint_turns(task: Reorientation, column: int) -> _ReachableTurns:
    """Attitudes without momentum at a free end of one joint, along its way between its limits."""
    body, start = task.body, task.shapes(task.start)
    attitudes, shapes, slack = [np.eye(3)[None]], [start[None]], 0.0
    for limit in (task.lower[column], task.upper[column]):
        if limit == task.start[column]:
            continue
        end = task.start.copy()
        end[column] = limit
        path = ShapePath.waypoints([0.0, 1.0], [start, task.shapes(end)])
        places = np.linspace(0.0, 1.0, _PLACES)
        attitudes.append(horizontal_lift(body, path, 1e-10).attitude(places))
        shapes.append(path.shape(places))
        turned = (mechanical_connection(body, shapes[-1]) @ task.coupling)[:, :, column]
        rates = np.linalg.norm(turned, axis=-1)
        if task.link is not None:
            speeds = np.broadcast_to(task.coupling[:, column], shapes[-1].shape)
            rates += np.linalg.norm(task.links.link_angular_velocity(shapes[-1], speeds, task.link), axis=-1)
        slack = max(slack, 0.5 * _BETWEEN * float(rates.max()) * abs(limit - task.start[column]) / (_PLACES - 1))
    name = _names(task, np.array([column]))
    return _ReachableTurns(
        np.concatenate(attitudes),
        _link_attitudes(task, np.concatenate(shapes)),
        f"only {name} can move, with one freedom, and where it ends, between its limits, determines the turn (holonomy "
        "algebra of rank 0)",
        f"{_more_joints(task)}, or widen the limits: Limits(joint_limits=False)",
        slack=slack,
    )


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
    links = _link_attitudes(task, task.shapes(task.start)[None])
    if not len(axes):
        return _ReachableTurns(
            np.eye(3)[None],
            links,
            f"motions of {_names(task, moves)} turn the body not at all (holonomy algebra of rank 0)",
            _more_joints(task),
        )
    axis = axes[0] if not size else task.momentum / size
    reason = f"motions of {_names(task, moves)} turn the body about one axis alone, {_text(axis)}"
    remedy = _more_joints(task)
    plane = _ReachableTurns(np.eye(3)[None], links, f"{reason} (holonomy algebra of rank 1 at most)", remedy, axis=axis)
    if not size:
        return plane
    inertias = body.locked_inertia(shapes)
    across = so3.apply(so3.hat(axis), inertias @ axis)
    if np.abs(across).max() > _NOISE * np.abs(inertias).max():
        return None
    plane = replace(
        plane,
        reason=f"{reason}, that of the momentum",
        remedy=f"{remedy}, or give another momentum (--momentum)",
        counted=np.array([np.nan, 0.0]),
    )
    return _with_angles(task, moves, plane) if len(moves) == 1 and task.end is not None else plane


def _with_angles(task: Reorientation, moves: Integers, plane: _ReachableTurns) -> _ReachableTurns:
    """Plane with the angles to which a momentum turns a planar body of one joint."""
    column, axis, body = int(moves[0]), plane.axis, task.body
    lower, upper = task.lower[column], task.upper[column]
    mover = int(np.argmax(np.abs(task.coupling[:, column])))
    if np.count_nonzero(task.coupling) == 1 and body.follows.is_identity and body.joint_units[mover] == "rad":
        upper = min(upper, lower + 2.0 * np.pi)
    if axis is None or task.end is None or upper - lower > _LONGEST * _strokes(task)[column]:
        return plane

    def along(values: ArrayLike) -> Array:
        coordinates = np.repeat(task.start[None], np.size(values), axis=0)
        coordinates[:, column] = values
        return task.shapes(coordinates)

    def turned(value: float) -> float:
        return float(-axis @ (mechanical_connection(body, along(value)) @ task.coupling)[0, :, column])

    inertia = body.locked_inertia(along(np.linspace(lower, upper, 10 * _PLACES))) @ axis @ axis
    margin = 0.5 * _BETWEEN * float(np.abs(np.diff(inertia)).max())
    impulse = float(np.linalg.norm(task.momentum)) * task.duration
    least = 0.0 if task.cost == "time" else impulse / (inertia.max() + margin)
    most = impulse / max(inertia.min() - margin, 0.5 * inertia.min())
    way = float(quad(turned, task.start[column], task.end[column], epsabs=1e-9, epsrel=0.0, limit=1000)[0])
    return replace(
        plane,
        angles=(way + least, way + most),
        reason=(
            f"the momentum {_text(task.momentum)} kg m^2/s turns the body by {np.degrees(way + least):.4g} to "
            f"{np.degrees(way + most):.4g} degrees in {task.duration:g} s, whatever {_names(task, moves)} does"
        ),
        remedy=f"{plane.remedy} or duration (--duration)",
        slack=1e-6,
    )


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


def _link_attitudes(task: Reorientation, shapes: Array) -> Array:
    """Attitude of the pointed link, base axes: (N, n) -> (N, 3, 3); the identity for the base."""
    if task.link is None:
        return np.broadcast_to(np.eye(3), (len(shapes), 3, 3))
    return task.links.link_pose(shapes, task.link)[:, :3, :3]


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
