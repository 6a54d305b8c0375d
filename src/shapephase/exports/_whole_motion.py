"""A motion at some times for other programs: base, joints, their rates, and accelerations where needed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import times_argument, vector_argument
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.inverse_dynamics import floating_states, floating_velocities
from ..dynamics.moving_body import body_and_path, check_motion, moving_body, needed_body_and_path
from ..dynamics.wheels import base_momenta, wheel_angles, wheel_columns, wheels_of, with_wheels
from ..errors import ShapeError, UnknownNameError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.attitude_angles import continuous
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion

_ROWS = 201  # of a table without given times


@dataclass(frozen=True, eq=False, kw_only=True)
class Fall:
    """Motion of the centre of mass: start + velocity t + gravity t^2 / 2, inertial axes [m], [m/s], [m/s^2]."""

    start: Array
    velocity: Array
    gravity: Array

    @classmethod
    def of(cls, **given: ArrayLike) -> Fall:
        """The fall by a user's vectors, zero where none is given. Raises ShapeError."""
        units = {"start": "m", "velocity": "m/s", "gravity": "m/s^2"}
        return cls(**{name: vector_argument(given.get(name, np.zeros(3)), name, unit=units[name]) for name in units})

    def centre(self, times: Array) -> Array:
        """(N,) -> (N, 3) [m]."""
        return self.start + times[:, None] * self.velocity + 0.5 * times[:, None] ** 2 * self.gravity

    def speed(self, times: Array) -> Array:
        """(N,) -> (N, 3) [m/s]."""
        return self.velocity + times[:, None] * self.gravity


@dataclass(frozen=True, eq=False, kw_only=True)
class WholeMotion:
    """A floating body with joints at N times.

    body : whose joints these are
    times : (N,) [s]
    attitude : (N, 3, 3) base axes to inertial axes
    configurations : (N, nq) of the body's own model of Pinocchio
    velocities : (N, nv) of it: linear and angular of the base, base axes, then the joints
    names : of all k joints, those that follow others included
    joints, rates : (N, k) [rad or m], a second
    shapes, shape_rates : (N, n) of the independent joints; wheels have turned by zero at the start
    wheels : joints that are wheels, left out of the path
    """

    body: Body
    times: Array
    attitude: Array
    configurations: Array
    velocities: Array
    names: tuple[str, ...]
    joints: Array
    rates: Array
    shapes: Array
    shape_rates: Array
    wheels: tuple[str, ...]

    @property
    def position(self) -> Array:
        """(N, 3) of the base origin, inertial axes [m]."""
        return self.configurations[:, :3]

    @property
    def quat_xyzw(self) -> Array:
        """(N, 4) the attitude, without a change of sign from one time to the next."""
        return self.configurations[:, 3:7]

    @property
    def angular_velocity(self) -> Array:
        """(N, 3) of the base, base axes [rad/s]."""
        return self.velocities[:, 3:6]

    @property
    def world_velocity(self) -> Array:
        """(N, 3) of the base origin, inertial axes [m/s]."""
        return so3.apply(self.attitude, self.velocities[:, :3])


def checked_times(motion: Motion | ForcedMotion, times: ArrayLike | None) -> Array:
    """The times of a table of one motion: (N,) [s]; None: 201 even ones. Raises ShapeError, TrajectoryError."""
    check_motion(motion)
    if motion.batch:
        raise ShapeError(f"one motion can be exported, this is a batch of {motion.batch}; reconstruct one of them")
    given = (
        np.linspace(0.0, motion.duration, _ROWS) if times is None else finite_array(times, "times", (None,), unit="s")
    )
    if given.ndim != 1:
        raise ShapeError(f"times: (N,) in one row are needed, got shape {given.shape}")
    return times_argument(given, motion.duration)


def check_ending(file: Path, kind: str, *endings: str) -> None:
    """Raise UnknownNameError where a file's name ends otherwise."""
    if file.suffix.lower() not in endings:
        raise UnknownNameError(f"{file}: the name of {kind} ends in {' or '.join(endings)}")


def whole_motion(motion: Motion | ForcedMotion, times: Array, fall: Fall) -> WholeMotion:
    """Base and joints at (N,) times, in whatever gauge the motion is: seen from the base of its body.

    Raises WrongObjectError if the body has no joints along a path.
    """
    body, _ = needed_body_and_path(motion, "this export needs")
    shapes, rates, spins = _joints_and_spins(motion, times)
    wheels = wheels_of(motion)
    if wheels is not None:
        shapes = shapes.copy()
        shapes[:, wheel_columns(wheels)] = wheel_angles(motion, wheels, times)
    configurations, velocities = floating_velocities(body, shapes, rates, spins)
    attitude = base_attitude(motion, times)
    configurations[:, :3] = fall.centre(times) - so3.apply(attitude, body.centre_of_mass(shapes))
    configurations[:, 3:7] = continued_quaternions(attitude)
    velocities[:, :3] += so3.apply(so3.transpose(attitude), fall.speed(times))
    joints, joint_rates = body.chain.follows.with_rates(shapes, rates)
    return WholeMotion(
        body=body,
        times=times,
        attitude=attitude,
        configurations=configurations,
        velocities=velocities,
        names=body.chain.follows.names,
        joints=joints,
        rates=joint_rates,
        shapes=shapes,
        shape_rates=rates,
        wheels=() if wheels is None else tuple(rotor.joint for rotor in wheels.rotors),
    )


def whole_accelerations(motion: Motion | ForcedMotion, whole: WholeMotion, fall: Fall) -> tuple[Array, Array]:
    """The derivatives of its velocities, (N, nv), and of the rates of its joints, (N, k).

    Raises ShapeError if joints follow others with kinks.
    """
    body, path = needed_body_and_path(motion, "this export needs")
    moving = moving_body(motion, body, path, whole.times)
    shapes, rates, spins = whole.shapes, moving.rates, moving.spins[0]
    accelerations = floating_states(body, shapes, rates, moving.accelerations, spins, moving.spin_rates[0])[2]
    backwards = so3.transpose(whole.attitude)
    speed = so3.apply(backwards, fall.speed(whole.times))
    accelerations[:, :3] += so3.apply(backwards, np.broadcast_to(fall.gravity, speed.shape)) - np.cross(spins, speed)
    follows = body.chain.follows
    slopes = follows.with_rates(shapes, moving.accelerations)[1]
    if not follows.is_linear:
        slopes = slopes + (follows.slope_rates(shapes, rates) @ rates[..., None])[..., 0]
    return accelerations, slopes


def _joints_and_spins(motion: Motion | ForcedMotion, times: Array) -> tuple[Array, Array, Array]:
    """Shapes and rates, those of wheels included, and the base's angular velocity in its axes: (N, n), (N, n), (N, 3).

    Wheels are at angle zero.
    """
    body, path = needed_body_and_path(motion, "this export needs")
    (shapes, rates), momenta, wheels = path.curve(times), base_momenta(motion, times), wheels_of(motion)
    if wheels is not None:
        rates, _ = with_wheels(wheels, times, momenta, rates, np.zeros_like(rates))
    inertia, internal = body.sample(shapes, rates)
    return shapes, rates, so3.apply(inverse_inertia(inertia, times), momenta[0] - internal)


def base_attitude(motion: Motion | ForcedMotion, times: Array) -> Array:
    """Attitude of the base of the body, in whatever gauge the motion is: (N,) -> (N, 3, 3)."""
    turned = motion.attitude(times)
    return turned if body_and_path(motion) is None else turned @ motion.deformation.frame(times)


def base_rate(motion: Motion | ForcedMotion, times: Array) -> Array:
    """Angular velocity of the base of the body, base axes, in whatever gauge the motion is: (N,) -> (N, 3) [rad/s]."""
    return motion.angular_velocity(times) if body_and_path(motion) is None else _joints_and_spins(motion, times)[2]


def continued_quaternions(attitudes: Array) -> Array:
    """Quaternions x y z w of attitudes that follow each other, of one sign throughout: (N, 3, 3) -> (N, 4)."""
    return continuous(so3.quat_from_matrix(attitudes))
