"""What a plan is asked for: the turn, the ends, the limits and the cost, checked once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import positive_argument
from ..arrays import Array, Mask, check_reach, finite_array
from ..body.body import Body
from ..errors import ShapeError, TrajectoryError, unknown_name

COSTS = ("kinetic", "rate", "acceleration", "time")
# Where a joint has no limit, a plan may still take it so far from its start [rad or m].
_FARTHEST = 1e3
_TIED = 1e-9
_SQUARE = 1e-9


@dataclass(frozen=True, eq=False)
class Reorientation:
    """A task of reorientation, in the m coordinates that are free: shape = ties @ coordinates + offset.

    Attributes
    ----------
    body : who turns
    target : (3, 3) the attitude wanted at the end, from the identity at the start; None: `pointing` says it
    pointing : (2, 3) a unit axis of the base and the inertial direction that it shall have at the end; None: `target`
    windings : (2,) somersault and twist, counted through the motion [rad]; None: not counted
    winding_axes : (3, 3) columns: the somersault axis, the tilt axis, the twist axis of the base
    momentum : (3,) about the centre of mass, inertial axes [kg m^2/s]
    duration : [s]; for the cost "time" the longest allowed
    start, end : (m,) coordinates; end None: free
    cost : one of `COSTS`
    lower, upper : (m,) limits of the coordinates [rad or m]
    rates : (m,) limits of their rates [rad/s or m/s], infinite where there are none
    ties, offset : (n, m) and (n,), each joint from the coordinates
    """

    body: Body
    target: Array | None
    pointing: Array | None
    windings: Array | None
    winding_axes: Array
    momentum: Array
    duration: float
    start: Array
    end: Array | None
    cost: str
    lower: Array
    upper: Array
    rates: Array
    ties: Array
    offset: Array

    def shapes(self, coordinates: Array) -> Array:
        """The shape at coordinates: (..., m) -> (..., n)."""
        return coordinates @ self.ties.T + self.offset

    @property
    def size(self) -> int:
        """m, the number of free coordinates."""
        return self.ties.shape[1]

    @property
    def rest_to_rest(self) -> bool:
        """Whether the joints stand still at both ends: only the cost "acceleration" makes them."""
        return self.cost == "acceleration"

    @property
    def moves(self) -> Mask:
        """(m,) which coordinates can leave their start."""
        return self.upper > self.lower

    def turn(self, attitude: Array | None = None) -> Array:
        """The shortest rotation vector that takes an attitude at the end to the goal: (3,), inertial axes [rad]."""
        end = np.eye(3) if attitude is None else attitude
        if self.target is not None:
            return so3.log(self.target @ end.T)
        axis, direction = self.pointing_axes()
        return so3.log(so3.between(end @ axis, direction))

    def miss(self, attitude: Array) -> float:
        """How far an attitude at the end is from the goal [rad]."""
        return float(np.linalg.norm(self.turn(attitude)))

    def needed(self) -> Array:
        """Which rotation vectors at the end, inertial axes, the goal decides: (3, 3), or (2, 3) for an axis."""
        if self.target is not None:
            return np.eye(3)
        _, direction = self.pointing_axes()
        first = so3.perpendicular(direction)
        return np.stack([first, so3.apply(so3.hat(direction), first)])

    def wound(self, attitudes: Array) -> Array:
        """Somersault and twist of attitudes (N, 3, 3) that follow each other closely, counted on from the first: (2,).

        R = exp(somersault) exp(tilt) exp(twist) about the three axes; not defined where the tilt is a right angle.
        """
        seen = self.winding_axes.T @ attitudes @ self.winding_axes
        somersault = np.unwrap(np.arctan2(-seen[:, 1, 2], seen[:, 2, 2]))
        twist = np.unwrap(np.arctan2(-seen[:, 0, 1], seen[:, 0, 0]))
        return np.array([somersault[-1] - somersault[0], twist[-1] - twist[0]])

    def evenly_wound(self, places: Array) -> Array:
        """Quaternions at places of [0, 1] of an even somersault with an even twist: (N,) -> (N, 4), continuous."""
        angles = np.zeros(2) if self.windings is None else self.windings
        turns = [
            so3.quat_from_rotation_vector(angle * places[:, None] * axis)
            for angle, axis in zip(angles, (self.winding_axes[:, 0], self.winding_axes[:, 2]))
        ]
        return so3.quat_product(turns[0], turns[1])

    def pointing_axes(self) -> Array:
        """The axis of the base and the direction it shall have: (2, 3). Of a task with an axis only."""
        return np.zeros((2, 3)) if self.pointing is None else self.pointing


def reorientation(
    body: Body,
    target: Any,
    *,
    momentum: ArrayLike,
    duration: float,
    start: ArrayLike | None,
    end: Any,
    cost: str,
    joint_limits: bool,
    rate_limits: ArrayLike | None,
    joints: Sequence[str] | None,
    symmetric: Mapping[str, tuple[str, float]] | None,
    somersaults: float | None = None,
    half_twists: float | None = None,
    twist_axis: ArrayLike = (0.0, 0.0, 1.0),
) -> Reorientation:
    """The task of `plan_reorientation`'s arguments, which are explained there.

    Raises
    ------
    ShapeError, TrajectoryError, UnknownNameError
        For arguments of the wrong shape, ends beyond the limits, or unknown names.
    """
    if cost not in COSTS:
        raise unknown_name("cost", cost, COSTS)
    if not body.n_shape:
        raise ShapeError(f"{body.name} has no joints: nothing can turn it but its momentum")
    mu = finite_array(momentum, "momentum", unit="kg m^2/s")
    if mu.shape != (3,) and not (mu.ndim == 0 and mu == 0.0):
        raise ShapeError(f"momentum: (3,) in inertial axes, or 0, is needed, got shape {mu.shape}")
    spatial = np.zeros(3) if mu.ndim == 0 else mu
    windings, axes = _windings(spatial, somersaults, half_twists, twist_axis)
    if windings is None:
        turned, pointing = _goal(target)
    else:
        if target is not None:
            raise ShapeError("target: the somersaults and twists say it; leave it None")
        turned, pointing = so3.exp(windings[0] * axes[:, 0]) @ so3.exp(windings[1] * axes[:, 2]), None
    limits = body.joint_limits if joint_limits else np.full((body.n_shape, 2), (-np.inf, np.inf))
    first = np.clip(np.zeros(body.n_shape), *limits.T) if start is None else _shape(body, start, "start")
    free_end = isinstance(end, str)
    if free_end and end != "free":
        raise unknown_name("end", str(end), ("free", "a shape"))
    last = first if end is None else None if free_end else _shape(body, end, "end")
    for shape, name in ((first, "start"), (last, "end")):
        if shape is not None:
            _check_limits(body, shape, limits, name)
    rates = np.full(body.n_shape, np.inf) if rate_limits is None else _rates(body, rate_limits)
    if cost == "time" and not np.isfinite(rates).all():
        raise TrajectoryError("cost='time' needs rate_limits for every joint: without them there is no least time")
    still = [] if joints is None else sorted(set(range(body.n_shape)) - {body.joint_index(name) for name in joints})
    ties, leaders, factors = _ties(body, symmetric or {}, still)
    offset = np.zeros(body.n_shape)
    offset[still] = first[still]
    for shape, name in ((first, "start"), (last, "end")):
        if shape is not None:
            _check_tied(body, shape, ties @ shape[leaders] + offset, name)
    least, most, pace = first[leaders] - _FARTHEST, first[leaders] + _FARTHEST, np.full(len(leaders), np.inf)
    for joint in np.flatnonzero(ties.any(axis=1)):
        column = int(np.argmax(ties[joint] != 0.0))
        low, high = np.sort(limits[joint] / factors[joint])
        least[column], most[column] = max(least[column], low), min(most[column], high)
        pace[column] = min(pace[column], rates[joint] / abs(factors[joint]))
    return Reorientation(
        body,
        turned,
        pointing,
        windings,
        axes,
        spatial,
        positive_argument(duration),
        first[leaders],
        None if last is None else last[leaders],
        cost,
        least,
        most,
        pace,
        ties,
        offset,
    )


def _check_tied(body: Body, shape: Array, tied: Array, name: str) -> None:
    gap = np.abs(tied - shape)
    worst = int(np.argmax(gap))
    if gap[worst] > _TIED:
        raise TrajectoryError(
            f"{name}: joint {body.joint_names[worst]} at {shape[worst]:.6g} must be at {tied[worst]:.6g}, where "
            "the joints that it is tied to, or its own stillness, put it"
        )


def _windings(
    momentum: Array, somersaults: float | None, half_twists: float | None, twist_axis: ArrayLike
) -> tuple[Array | None, Array]:
    """The angles to be counted, and the axes of somersault, tilt and twist."""
    if somersaults is None and half_twists is None:
        return None, np.eye(3)
    counts = finite_array([somersaults or 0.0, half_twists or 0.0], "somersaults, half_twists", (2,))
    long = finite_array(twist_axis, "twist_axis", (3,))
    sizes = np.linalg.norm(momentum), np.linalg.norm(long)
    if min(sizes) == 0.0 or abs(momentum @ long) > _SQUARE * sizes[0] * sizes[1]:
        raise ShapeError(
            "somersaults: a momentum, the axis of the somersault, at right angles to twist_axis is needed, got "
            f"{momentum} and {long}"
        )
    across, along = momentum / sizes[0], long / sizes[1]
    return counts * [2.0 * np.pi, np.pi], np.stack([across, np.cross(along, across), along], axis=1)


def _goal(target: Any) -> tuple[Array | None, Array | None]:
    """The attitude, or the unit axis and direction, that the target names."""
    goal = finite_array(target, "target")
    if goal.shape == (3, 3):
        return so3.rotation_argument(goal, "target"), None
    if goal.shape == (2, 3):
        sizes = np.linalg.norm(goal, axis=1)
        if np.all(sizes > 0.0):
            return None, goal / sizes[:, None]
    raise ShapeError(
        "target: a rotation (3, 3), or a pair (axis of the base, direction in inertial axes) of vectors that are not "
        f"zero is needed, got shape {goal.shape}"
    )


def _shape(body: Body, value: ArrayLike, name: str) -> Array:
    shape = finite_array(value, name)
    if shape.shape != (body.n_shape,):
        raise ShapeError(f"{name}: one coordinate for each of the {body.n_shape} joints, got shape {shape.shape}")
    check_reach(shape, name)
    return shape


def _check_limits(body: Body, shape: Array, limits: Array, name: str) -> None:
    beyond = np.flatnonzero((shape < limits[:, 0] - 1e-9) | (shape > limits[:, 1] + 1e-9))
    if len(beyond):
        joint = int(beyond[0])
        raise TrajectoryError(
            f"{name}: joint {body.joint_names[joint]} at {shape[joint]:.6g} is beyond its limits "
            f"{limits[joint, 0]:.6g} ... {limits[joint, 1]:.6g}; choose another shape, or joint_limits=False"
        )


def _rates(body: Body, rate_limits: ArrayLike) -> Array:
    rates = finite_array(rate_limits, "rate_limits", unit="rad/s or m/s")
    if rates.shape not in ((), (body.n_shape,)) or np.any(rates <= 0.0):
        raise ShapeError(
            f"rate_limits: one number above 0, or one for each of the {body.n_shape} joints, is needed, "
            f"got {rate_limits!r}"
        )
    return np.array(np.broadcast_to(rates, body.n_shape))


def _ties(body: Body, symmetric: Mapping[str, tuple[str, float]], still: list[int]) -> tuple[Array, list[int], Array]:
    """Each joint from the free ones (n, m), which those are, and each joint's factor (n,)."""
    led = {
        body.joint_index(name): (body.joint_index(leader), float(factor))
        for name, (leader, factor) in symmetric.items()
    }
    leaders = [joint for joint in range(body.n_shape) if joint not in led and joint not in still]
    ties, factors = np.zeros((body.n_shape, len(leaders))), np.ones(body.n_shape)
    for column, joint in enumerate(leaders):
        ties[joint, column] = 1.0
    for joint, (leader, factor) in led.items():
        if joint in still or leader not in leaders or factor == 0.0 or not np.isfinite(factor):
            raise TrajectoryError(
                f"symmetric: joint {body.joint_names[joint]} must be among the joints that move, and follow one of "
                "them that follows no other, by a factor that is not 0"
            )
        ties[joint, leaders.index(leader)], factors[joint] = factor, factor
    if not leaders:
        raise TrajectoryError("joints: at least one joint must move")
    return ties, leaders, factors
