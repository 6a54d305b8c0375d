"""An articulated body along its motion: second derivatives of joints and base, and the efforts behind them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arguments import check_object
from ..arrays import Array
from ..body.body import Body
from ..body.inverse_dynamics import falling_efforts
from ..errors import WrongObjectError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ..shape_space.shape_path import ShapePath
from .wheels import base_momenta, ungauged, wheels_of, with_free_wheels, with_wheels

BY_JOINTS = "the torques of joints need"  # begins the message for a body without joints


@dataclass(frozen=True, eq=False, kw_only=True)
class MovingBody:
    """Joints and spin of the base at N times, in each of B motions of a batch.

    shapes, rates, accelerations : (N, n) of the joints [rad or m], a second, a second squared
    spins : (B, N, 3) angular velocity of the base, base axes [rad/s]
    spin_rates : (B, N, 3) its rate [rad/s^2]
    push : (N, 3) torque from outside, base axes [N m]
    """

    shapes: Array
    rates: Array
    accelerations: Array
    spins: Array
    spin_rates: Array
    push: Array


@dataclass(frozen=True, eq=False, kw_only=True)
class Drive:
    """Efforts and rates of the joints at N times, in each of B motions of a batch.

    torque : (B, N, n) by the n rates of the body's joints [N m or N]
    rate : (N, n) [rad/s or m/s]
    wrench : (B, N, 6) force on the base and torque about its origin that would be needed from outside [N], [N m]
    energy : (B, N) kinetic, about the centre of mass [J]
    """

    torque: Array
    rate: Array
    wrench: Array
    energy: Array

    @property
    def power(self) -> Array:
        """(B, N, n) [W]."""
        return self.torque * self.rate


def body_and_path(motion: Motion | ForcedMotion) -> tuple[Body, ShapePath] | None:
    """Body and path of a motion of an articulated body, in any gauge; None for another motion.

    Wheels rest in the path; `with_wheels` has their speeds.
    """
    wheels = wheels_of(motion)
    if wheels is not None:
        return wheels.platform, wheels.route
    description = ungauged(motion)
    body, path = getattr(description, "body", None), getattr(description, "path", None)
    return (body, path) if isinstance(body, Body) and isinstance(path, ShapePath) else None


def needed_body_and_path(motion: Motion | ForcedMotion, what: str) -> tuple[Body, ShapePath]:
    """Body and path of a motion. Raises WrongObjectError without them; `what` begins the message: "torques need"."""
    pair = body_and_path(motion)
    if pair is None:
        raise WrongObjectError(
            f"motion: {what} a body with joints along a path, made by `articulated`; this is: "
            f"{motion.deformation.label}"
        )
    return pair


def check_motion(motion: object) -> None:
    """Raise WrongObjectError for anything but a motion."""
    if not isinstance(motion, ForcedMotion):
        check_object(motion, "Motion", "motion")


def moving_body(
    motion: Motion | ForcedMotion,
    body: Body,
    path: ShapePath,
    times: Array,
    turned: Array | None = None,
    moved: Array | None = None,
) -> MovingBody:
    """Motion of joints and base at (N,) times.

    The base's acceleration is that of the reconstructed motion: from I omega + L_o = Pi and Pi' = Pi x omega follows
    I omega' = Pi x omega - I' omega - L_o'; a torque from outside, which acts on the base, adds to both.

    turned : (3,) a small turn of all attitudes, base axes, to see what it changes; None: none [rad]
    moved : (3, n) the same of shapes, rates and accelerations
    """
    shapes, rates = path.curve(times)
    accelerations = path.acceleration(times)
    if moved is not None:
        shapes, rates, accelerations = shapes + moved[0], rates + moved[1], accelerations + moved[2]
    inertia, matrix, inertia_rate, matrix_rate = body.sample_rates(shapes, rates)
    inverse = inverse_inertia(inertia, times)
    momenta = base_momenta(motion, times)
    if turned is not None:
        momenta = so3.apply(so3.transpose(so3.exp(turned)), momenta)
    wheels = wheels_of(motion)
    if wheels is not None:
        rates, accelerations = with_wheels(wheels, times, momenta, rates, accelerations)
    internal = so3.apply(matrix, rates)
    internal_rate = so3.apply(matrix_rate, rates) + so3.apply(matrix, accelerations)
    push = np.zeros((len(times), 3))
    if isinstance(motion, ForcedMotion):
        push = so3.apply(so3.transpose(motion.deformation.frame(times)), motion.torque(times))
    spins = so3.apply(inverse, momenta - internal)
    slopes = so3.apply(inverse, np.cross(momenta, spins) + push - so3.apply(inertia_rate, spins) - internal_rate)
    if wheels is not None:
        joints = shapes, rates, accelerations
        accelerations, slopes = with_free_wheels(wheels, times, joints, (spins, slopes), matrix, inverse)
    return MovingBody(
        shapes=shapes, rates=rates, accelerations=accelerations, spins=spins, spin_rates=slopes, push=push
    )


def drive(
    motion: Motion | ForcedMotion, times: Array, turned: Array | None = None, moved: Array | None = None
) -> Drive:
    """Inverse dynamics along a motion.

    times : (N,)
    turned, moved : small changes of attitudes, and of joints with two derivatives, as in `moving_body`
    """
    body, path = needed_body_and_path(motion, BY_JOINTS)
    moving = moving_body(motion, body, path, times, turned, moved)
    joints, frames = (moving.shapes, moving.rates, moving.accelerations), body.rate_frame(moving.shapes)
    torques, wrenches, energies = [], [], []
    for spins, slopes in zip(moving.spins, moving.spin_rates, strict=True):
        torque, wrench = falling_efforts(body, *joints, spins, slopes)
        # By the rates of ball joints, which are not those of their four numbers.
        torques.append((torque[:, None] @ frames)[:, 0])
        wrench[:, 3:] -= moving.push
        wrenches.append(wrench)
        energies.append(body.kinetic_energy(moving.shapes, moving.rates, spins))
    speeds = body.joint_rates(moving.shapes, moving.rates)
    return Drive(torque=np.array(torques), rate=speeds, wrench=np.array(wrenches), energy=np.array(energies))
