"""Problem that a plan solves: turn, end postures, limits and cost, checked once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_choice, check_mapping, names_argument, positive_argument
from ..arrays import Array, Mask, check_reach, finite_array
from ..body.body import Body
from ..body.collisions.distances import link_distances
from ..body.collisions.geometry import CollisionGeometry, collision_geometry
from ..body.couplings.coordinate_map import check_smooth
from ..body.particles.point_masses import ParticleBody
from ..deformation.deformation import deformation_along
from ..errors import ShapeError, TrajectoryError, unknown_name
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.body_path import route_along
from ..shape_space.closest_approach import distance_text
from ..shape_space.shape_path import ShapePath
from ._ball_chart import BallChart
from ._via_points import ViaPoint, check_follows, check_within, via_points
from .cost_metric import METRIC_COSTS, CostMetric, metric_argument
from .plan_options import RATES_AT_ENDS, Goal, Limits, Waypoint, goal_argument

COSTS = ("kinetic", "rate", "acceleration", "effort", "time")

FARTHEST = 1e3  # [rad or m] from the start, of joints without limits: keeps guesses and solver finite

_MOST_NAMED = 8  # joints in an error
_RIGHT_ANGLE_TOLERANCE = 1e-9  # cosine of momentum and twist axis: rounding of user input


@dataclass(frozen=True, eq=False)
class Reorientation:
    """A reorientation task in the m coordinates that are free: shape = coupling @ coordinates + offset.

    A ball joint that moves has three: the axis of its turn from the start times the tangent of half the angle.

    body : the body that turns
    target : (3, 3) attitude at the end, from the identity at the start; None: `pointing` determines it
    pointing : (2, 3) a unit axis of the base and the inertial direction that it has to have at the end; None: `target`
    link : whose axis it is instead of the base's, where the end is free; None: it is the base's
    windings : (2,) somersault and twist, counted through the motion [rad]; None: not counted
    winding_axes : (3, 3) columns: the somersault axis, the tilt axis, the twist axis of the base
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]
    duration : [s]; for the cost "time" the longest allowed
    start, end : (m,) coordinates; end None: free
    cost : one of `COSTS`, or "metric"
    metric : whose integral the cost is; None: another cost
    lower, upper : (m,) limits of the coordinates [rad or m]
    rate_limit : (m,) limits of their rates [rad/s or m/s], infinite where there are none
    acceleration_limit, jerk_limit : (m,) the same of the second and third derivatives
    effort_measure : (n,) what the efforts of joints are measured by [N m or N], infinite where by nothing
    efforts_limited : whether they stay within that measure
    rates_at_ends : one of `RATES_AT_ENDS`
    coupling, offset : (n, m) and (n,), each joint from the coordinates
    via : what it passes through, in its order
    clearance, geometry : least distance between links [m], and their solids; None: links may touch
    """

    body: Body | ParticleBody
    target: Array | None
    pointing: Array | None
    link: str | None
    windings: Array | None
    winding_axes: Array
    momentum: Array
    duration: float
    start: Array
    end: Array | None
    cost: str
    lower: Array
    upper: Array
    rate_limit: Array
    acceleration_limit: Array
    jerk_limit: Array
    effort_measure: Array
    efforts_limited: bool
    metric: CostMetric | None
    rates_at_ends: str
    coupling: Array
    offset: Array
    via: tuple[ViaPoint, ...] = ()
    clearance: float | None = None
    geometry: CollisionGeometry | None = None

    def shapes(self, coordinates: Array) -> Array:
        """Shape at coordinates: (..., m) -> (..., n)."""
        return coordinates @ self.coupling.T + self.offset

    @property
    def links(self) -> Body:
        """The body, where links or only inertia and momentum are needed of it."""
        return cast("Body", self.body)

    @property
    def dimension(self) -> int:
        """Number m of free coordinates."""
        return self.coupling.shape[1]

    @property
    def equal_points(self) -> int:
        """Number of equal control points at either end: two without a rate, three without acceleration either."""
        if self.rates_at_ends != "zero":
            return 1
        return 3 if self.cost == "acceleration" or np.isfinite(self.jerk_limit).any() else 2

    @property
    def limits_beyond_rates(self) -> bool:
        """True where accelerations, jerks or efforts have limits."""
        return self.efforts_limited or bool(np.isfinite([self.acceleration_limit, self.jerk_limit]).any())

    @property
    def movable(self) -> Mask:
        """Mask (m,) of coordinates that can leave their start."""
        return self.upper > self.lower

    def reach(self, radius: float | Array) -> tuple[Array, Array]:
        """Lower and upper limits of the coordinates, no farther from the start than a radius: (m,) each."""
        return np.maximum(self.lower, self.start - radius), np.minimum(self.upper, self.start + radius)

    def turn_to_goal(self, attitude: Array | None = None, last: Array | None = None) -> Array:
        """Shortest rotation vector from an attitude at the end to the goal: (3,), inertial axes [rad].

        The last coordinates (m,) determine where a link points; by default attitude and coordinates are the start's.
        """
        end = np.eye(3) if attitude is None else attitude
        if self.target is not None:
            return so3.log(self.target @ end.T)
        _, direction = self.pointing_axes()
        return so3.log(so3.between(end @ self.pointed_axis(self.start if last is None else last), direction))

    def goal_error(self, attitude: Array, last: Array | None = None) -> float:
        """Angle from an attitude at the end to the goal, with the last coordinates (m,), see `turn_to_goal` [rad]."""
        return float(np.linalg.norm(self.turn_to_goal(attitude, last)))

    def constrained_directions(self) -> Array:
        """Rotation vectors at the end, inertial axes, that the goal determines: (3, 3), or (2, 3) for an axis."""
        if self.target is not None:
            return np.eye(3)
        _, direction = self.pointing_axes()
        first = so3.perpendicular(direction)
        return np.stack([first, so3.apply(so3.hat(direction), first)])

    def counted_windings(self, attitudes: Array) -> Array:
        """Somersault and twist of densely sampled attitudes (N, 3, 3), unwrapped from the first: (2,).

        R = exp(somersault) exp(tilt) exp(twist) about the three axes; not defined where the tilt is a right angle.
        """
        local = self.winding_axes.T @ attitudes @ self.winding_axes
        somersault = np.unwrap(np.arctan2(-local[:, 1, 2], local[:, 2, 2]))
        twist = np.unwrap(np.arctan2(-local[:, 0, 1], local[:, 0, 0]))
        return np.array([somersault[-1] - somersault[0], twist[-1] - twist[0]])

    def uniform_winding(self, places: Array) -> Array:
        """Quaternions at places of [0, 1] of a steady somersault with a steady twist: (N,) -> (N, 4), continuous."""
        angles = np.zeros(2) if self.windings is None else self.windings
        turns = [
            so3.quat_from_rotation_vector(angle * places[:, None] * axis)
            for angle, axis in zip(angles, (self.winding_axes[:, 0], self.winding_axes[:, 2]))
        ]
        return so3.quat_product(turns[0], turns[1])

    def pointing_axes(self) -> Array:
        """Axis of the base or a link, and its required direction: (2, 3). Only with `pointing`."""
        return np.zeros((2, 3)) if self.pointing is None else self.pointing

    def pointed_axis(self, last: Array) -> Array:
        """Pointed axis in axes of the base, at coordinates (m,): (3,). Only with `pointing`."""
        axis, _ = self.pointing_axes()
        return axis if self.link is None else self.links.link_pose(self.shapes(last), self.link)[:3, :3] @ axis

    def pointed_turn(self, last: Array) -> Array:
        """Turn of the pointed link against the base by each coordinate, at coordinates (m,): (3, m), base axes."""
        if self.link is None:
            return np.zeros((3, self.dimension))
        shapes = np.broadcast_to(self.shapes(last), (self.dimension, self.body.n_shape))
        return self.links.link_angular_velocity(shapes, self.coupling.T, self.link).T


def motion_along(task: Reorientation, path: ShapePath, tolerance: float) -> Motion:
    """Return the motion of a task's body along a path, to a tolerance [rad]. Raises like `reconstruct`."""
    along = deformation_along(task.links, route_along(task.body, path))
    return reconstruct(along, task.momentum, tolerance=tolerance)


def reorientation(
    body: Body | ParticleBody,
    goal: Any,
    *,
    momentum: ArrayLike = 0.0,
    duration: float = 1.0,
    start: ArrayLike | None = None,
    end: Any = None,
    via: Sequence[Waypoint] = (),
    cost: Any = "kinetic",
    rates_at_ends: str = "zero",
    joints: Sequence[str] | None = None,
    symmetric: Mapping[str, tuple[str, float]] | None = None,
    limits: Limits | None = None,
) -> Reorientation:
    """Return the task of the arguments of `plan_reorientation`, for a goal with one member.

    Raises
    ------
    ShapeError, TrajectoryError, UnknownNameError
        For arguments of the wrong shape, ends beyond the limits, or unknown names.
    """
    metric = None
    if not isinstance(cost, str) or cost in METRIC_COSTS[:2]:
        metric = metric_argument(body, cost, "cost", COSTS)
        cost = metric.name
    check_choice(cost, "cost", (*COSTS, "metric") if metric else COSTS)
    check_choice(rates_at_ends, "value of rates_at_ends", RATES_AT_ENDS)
    if not body.n_shape:
        raise ShapeError(f"{body.name} has no joints: nothing can turn it but its momentum")
    check_smooth(body.follows, "plans need", kinks_only=True)
    if body.ball_joints and cost != "kinetic":
        raise ShapeError(
            f"cost={cost!r} depends on the choice of coordinates, and {body.ball_joints[0]} is a ball joint, where it "
            "is arbitrary; use 'kinetic', or three hinges in one point"
        )
    (checked_goal,) = goal_argument(goal).members
    within = Limits() if limits is None else limits
    mu = _momentum(momentum)
    windings, winding_axes = _windings(checked_goal, mu)
    bounds = body.joint_limits if within.joint_limits else np.full((body.n_shape, 2), (-np.inf, np.inf))
    first, last = _end_postures(body, bounds, start, end)
    if rates_at_ends == "periodic" and (last is None or not np.array_equal(first, last)):
        raise TrajectoryError("rates_at_ends='periodic' is for loops: leave end out, or give the shape of the start")
    rates, *further = (
        limits_of_joints(body, getattr(within, name), name, body.rate_limits)
        for name in ("rate_limits", "acceleration_limits", "jerk_limits")
    )
    measure = _effort_measure(body, cost, within)
    if cost == "time" and not np.isfinite(rates).all():
        unstated = ", ".join(np.array(body.joint_names)[~np.isfinite(rates)][:_MOST_NAMED])
        raise TrajectoryError(
            "cost='time' needs rate_limits for every joint: without them the least time is 0; none is given for "
            f"{unstated}; give limits=Limits(rate_limits=...)"
        )
    fixed_joints = _fixed_joints(body, joints)
    coupling, leaders, factors = _coupling(body, symmetric or {}, fixed_joints)
    offset = np.zeros(body.n_shape)
    offset[fixed_joints] = first[fixed_joints]
    for shape, name in ((first, "start"), (last, "end")):
        if shape is not None:
            coupled = coupling @ shape[leaders] + offset
            worst = int(np.argmax(np.abs(coupled - shape)))
            check_follows(body, worst, shape[worst], coupled[worst], name)
    lower, upper = _coordinate_limits(coupling, factors, first[leaders], bounds)
    rate_limit, *further = (_coordinate_rates(coupling, factors, limits) for limits in (rates, *further))
    chart = BallChart.of(body, first, leaders)
    length = positive_argument(duration)
    points = via_points(body, via, None if cost == "time" else length, bounds, coupling, offset, chart)
    start, end = first[leaders], None if last is None else last[leaders]
    if chart is not None:
        coupling, offset = chart.shapes(coupling, offset)
        start, end = chart.coordinates(start, "start"), None if end is None else chart.coordinates(end, "end")
        if any(np.isfinite(limits).any() for limits in further):
            raise ShapeError(
                f"limits of accelerations and jerks: {body.ball_joints[0]} is a ball joint, which has none in its "
                "coordinates; leave them out, or hold it, or make it three hinges in one point"
            )
        lower, upper, rate_limit = chart.limits(lower, upper, rate_limit)
        further = [np.full(len(rate_limit), np.inf) for _ in further]
    pointing, link = _pointed(body, checked_goal, last)
    return Reorientation(
        body=body,
        target=_target(checked_goal, windings, winding_axes),
        pointing=pointing,
        link=link,
        windings=windings,
        winding_axes=winding_axes,
        momentum=mu,
        duration=length,
        start=start,
        end=end,
        cost=cost,
        metric=metric,
        lower=lower,
        upper=upper,
        rate_limit=rate_limit,
        acceleration_limit=further[0],
        jerk_limit=further[1],
        effort_measure=measure,
        efforts_limited=within.effort_limits is not None and bool(np.isfinite(measure).any()),
        rates_at_ends=rates_at_ends,
        coupling=coupling,
        offset=offset,
        via=points,
        clearance=within.clearance,
        geometry=_geometry(body, within, first, last),
    )


def _geometry(body: Body | ParticleBody, limits: Limits, first: Array, last: Array | None) -> CollisionGeometry | None:
    """Return the solids of links that keep a distance, which they have at both ends; None where they may touch."""
    if limits.clearance is None:
        return None
    if isinstance(body, ParticleBody):
        raise ShapeError(f"clearance: {body.name} is a body of particles, which has no solids; leave it out")
    geometry = collision_geometry(body, srdf=limits.srdf)
    for shape, name in ((first, "start"), (last, "end")):
        if shape is None:
            continue
        distances = link_distances(body, shape, geometry=geometry).distance
        worst = int(np.argmin(distances)) if len(distances) else -1
        if worst >= 0 and distances[worst] < limits.clearance:
            how = distance_text(geometry.pairs[worst], float(distances[worst]))
            raise TrajectoryError(
                f"{name}: links {how}, nearer than the clearance of {limits.clearance:g} m: choose another posture, a "
                "smaller distance (--avoid), or leave the pair out (--srdf)"
            )
    return geometry


def _momentum(momentum: ArrayLike) -> Array:
    mu = finite_array(momentum, "momentum", unit="kg m^2/s")
    if mu.shape != (3,) and not (mu.ndim == 0 and mu == 0.0):
        raise ShapeError(f"momentum: (3,) in inertial axes, or 0, is needed, got shape {mu.shape}")
    return np.zeros(3) if mu.ndim == 0 else mu


def _windings(goal: Goal, momentum: Array) -> tuple[Array | None, Array]:
    """Return the angles to be counted, and the axes of somersault, tilt and twist."""
    if not goal.winds:
        return None, np.eye(3)
    counts = np.array([goal.somersaults or 0.0, goal.half_twists or 0.0])
    twist_axis = np.asarray(goal.twist_axis)
    magnitude, length = np.linalg.norm(momentum), np.linalg.norm(twist_axis)
    if magnitude == 0.0 or abs(momentum @ twist_axis) > _RIGHT_ANGLE_TOLERANCE * magnitude * length:
        raise ShapeError(
            "somersaults: a momentum, the axis of the somersault, at right angles to twist_axis is needed, got "
            f"{momentum} and {twist_axis}"
        )
    across, along = momentum / magnitude, twist_axis / length
    return counts * [2.0 * np.pi, np.pi], np.stack([across, np.cross(along, across), along], axis=1)


def _target(goal: Goal, windings: Array | None, winding_axes: Array) -> Array | None:
    """Attitude at the end; None where only an axis is given."""
    if windings is not None:
        return so3.exp(windings[0] * winding_axes[:, 0]) @ so3.exp(windings[1] * winding_axes[:, 2])
    return None if goal.rotation is None else np.asarray(goal.rotation)


def _pointed(body: Body | ParticleBody, goal: Goal, last: Array | None) -> tuple[Array | None, str | None]:
    """Return axis and direction (2, 3), and its link; the axis is the base's where the last shape is given."""
    if goal.pointing is None:
        return None, None
    axis, direction = pair = np.asarray(goal.pointing)
    if goal.link is None:
        return pair, None
    if isinstance(body, ParticleBody):
        raise ShapeError(f"link: {body.name} is a body of particles, which has no links; point an axis of its frame")
    pointed = body.link_pose(body.shape() if last is None else last, goal.link)[:3, :3] @ axis
    return (pair, goal.link) if last is None else (np.stack([pointed, direction]), None)


def _end_postures(
    body: Body | ParticleBody, bounds: Array, start: ArrayLike | None, end: Any
) -> tuple[Array, Array | None]:
    """Return the shapes at both ends, within the bounds (n, 2); None for a free end."""
    first = np.clip(body.shape(), *bounds.T) if start is None else _shape(body, start, "start")
    if isinstance(end, str):
        if end != "free":
            raise unknown_name("end", end, ("free", "a shape"))
        last = None
    else:
        last = first if end is None else _shape(body, end, "end")
    for shape, name in ((first, "start"), (last, "end")):
        if shape is not None:
            for joint, value in enumerate(shape.tolist()):
                check_within(body, joint, value, bounds, name)
    return first, last


def _shape(body: Body | ParticleBody, value: ArrayLike, name: str) -> Array:
    shape = finite_array(value, name)
    if shape.shape != (body.n_shape,):
        raise ShapeError(f"{name}: one coordinate for each of the {body.n_shape} joints, got shape {shape.shape}")
    check_reach(shape, name)
    return shape


def limits_of_joints(body: Body | ParticleBody, given: ArrayLike | str | None, name: str, stated: Array) -> Array:
    """Limit of each joint, infinite where there is none: (n,)."""
    if given is None:
        return np.full(body.n_shape, np.inf)
    if isinstance(given, str):
        return stated
    limits = np.asarray(given)
    if limits.shape not in ((), (body.n_shape,)):
        raise ShapeError(
            f"{name}: one number above 0, or one for each of the {body.n_shape} joints, is needed, "
            f"got {len(limits)} numbers"
        )
    return np.array(np.broadcast_to(limits, body.n_shape))


def _effort_measure(body: Body | ParticleBody, cost: str, limits: Limits) -> Array:
    """Units of efforts, infinite where there are none: (n,)."""
    if isinstance(body, ParticleBody) and (cost == "effort" or not isinstance(limits.effort_limits, str | None)):
        raise ShapeError(f"effort_limits: {body.name} is a body of particles, which has no motors; leave them out")
    measured_by = "body" if cost == "effort" and limits.effort_limits is None else limits.effort_limits
    measure = limits_of_joints(body, measured_by, "effort_limits", body.effort_limits)
    if measured_by is not None and not body.follows.is_linear:
        raise ShapeError(
            f"effort_limits: {body.name} has ball joints, or joints that follow others along curves, whose efforts "
            "plans cannot bound; leave them out, and see joint_torques(plan.motion)"
        )
    if cost == "effort" and not np.isfinite(measure).all():
        unstated = ", ".join(np.array(body.joint_names)[~np.isfinite(measure)][:_MOST_NAMED])
        raise TrajectoryError(
            "cost='effort' needs effort_limits for every joint, as units of efforts; none is given for "
            f"{unstated}; give limits=Limits(effort_limits=...)"
        )
    return measure


def joint_coupling(
    body: Body | ParticleBody, joints: Sequence[str] | None, symmetric: Mapping[str, tuple[str, float]] | None
) -> Array:
    """Matrix from rates of the free joints to those of all: (n, m). Raises UnknownNameError, TrajectoryError."""
    if joints is not None:
        names_argument(joints, "joints", "names of joints")
    if symmetric is not None:
        check_mapping(symmetric, "symmetric", "joint -> (joint that it follows, factor)")
    return _coupling(body, symmetric or {}, _fixed_joints(body, joints))[0]


def _fixed_joints(body: Body | ParticleBody, joints: Sequence[str] | None) -> list[int]:
    moving = set(range(body.n_shape)) if joints is None else set(body.joint_columns(joints))
    return sorted(set(range(body.n_shape)) - moving)


def _coupling(
    body: Body | ParticleBody, symmetric: Mapping[str, tuple[str, float]], fixed_joints: list[int]
) -> tuple[Array, list[int], Array]:
    """Return the matrix from the free joints to all (n, m), the indices of the free ones, and factors (n,)."""
    followers = {
        body.joint_index(name): (body.joint_index(leader), float(factor))
        for name, (leader, factor) in symmetric.items()
    }
    leaders = [joint for joint in range(body.n_shape) if joint not in followers and joint not in fixed_joints]
    coupling, factors = np.zeros((body.n_shape, len(leaders))), np.ones(body.n_shape)
    for column, joint in enumerate(leaders):
        coupling[joint, column] = 1.0
    for joint, (leader, factor) in followers.items():
        if joint in fixed_joints or leader not in leaders or factor == 0.0 or not np.isfinite(factor):
            raise TrajectoryError(
                f"symmetric: joint {body.joint_names[joint]} must be among the joints that move, and follow one of "
                "them that follows no other, by a factor that is not 0"
            )
        coupling[joint, leaders.index(leader)], factors[joint] = factor, factor
    if not leaders:
        raise TrajectoryError("joints: at least one joint must move")
    return coupling, leaders, factors


def _coordinate_limits(coupling: Array, factors: Array, start: Array, bounds: Array) -> tuple[Array, Array]:
    """Lower and upper limits of the coordinates (m,): the tightest of all joints that follow each."""
    lower, upper = start - FARTHEST, start + FARTHEST
    for joint in np.flatnonzero(coupling.any(axis=1)):
        column = int(np.argmax(coupling[joint] != 0.0))
        low, high = np.sort(bounds[joint] / factors[joint])
        lower[column], upper[column] = max(lower[column], low), min(upper[column], high)
    return lower, upper


def _coordinate_rates(coupling: Array, factors: Array, limits: Array) -> Array:
    """Limits of rates of the coordinates, or higher derivatives (m,): the tightest of all joints that follow each."""
    scaled = np.where(coupling != 0.0, (limits / np.abs(factors))[:, None], np.inf)
    return scaled.min(axis=0, initial=np.inf)
