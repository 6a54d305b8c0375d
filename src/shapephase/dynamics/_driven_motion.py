"""A motion of an articulated body with its second derivatives, as inverse dynamics needs them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.inverse_dynamics import falling_efforts
from ..errors import WrongObjectError
from ..inertia_tensor import inverse_inertia
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ..shape_space.shape_path import ShapePath


@dataclass(frozen=True, eq=False, kw_only=True)
class Drive:
    """What the joints do at N times, in each of B motions of a batch.

    Attributes
    ----------
    torque : (B, N, n) [N m or N]
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


def body_and_path(motion: Motion | ForcedMotion) -> tuple[Body, ShapePath]:
    """Of a motion of an articulated body, in whatever gauge. Raises WrongObjectError for another."""
    found: Any = motion.deformation.description
    while hasattr(found, "original"):
        found = found.original
    body, path = getattr(found, "body", None), getattr(found, "path", None)
    if not isinstance(body, Body) or not isinstance(path, ShapePath):
        raise WrongObjectError(
            "motion: the torques of joints need a body with joints along a path, made by `articulated`; this is: "
            f"{motion.deformation.label}"
        )
    return body, path


def drive(motion: Motion | ForcedMotion, times: Array, turned: Array | None = None) -> Drive:
    """Inverse dynamics along a motion.

    The base's acceleration is that of the reconstructed motion: from I omega + L_o = Pi and Pi' = Pi x omega follows
    I omega' = Pi x omega - I' omega - L_o'; a torque from outside, which acts on the base, adds to both.

    Parameters
    ----------
    times : (N,)
    turned : (3,) a small turn of all attitudes, base axes, to see what it changes; None: none [rad]
    """
    body, path = body_and_path(motion)
    shapes, rates = path.curve(times)
    accelerations = path.acceleration(times)
    inertia, matrix, inertia_rate, matrix_rate = body.sample_rates(shapes, rates)
    inverse = inverse_inertia(inertia, times)
    internal = so3.apply(matrix, rates)
    internal_rate = so3.apply(matrix_rate, rates) + so3.apply(matrix, accelerations)
    momenta = so3.apply(so3.transpose(motion.deformation.frame(times)), motion.body_momentum(times))
    momenta = momenta.reshape(-1, len(times), 3)
    if turned is not None:
        momenta = so3.apply(so3.transpose(so3.exp(turned)), momenta)
    push = np.zeros((len(times), 3))
    if isinstance(motion, ForcedMotion):
        push = so3.apply(so3.transpose(motion.deformation.frame(times)), motion.torque(times))
    torques, wrenches, energies = [], [], []
    for pi in momenta:
        spins = so3.apply(inverse, pi - internal)
        slopes = so3.apply(inverse, np.cross(pi, spins) + push - so3.apply(inertia_rate, spins) - internal_rate)
        torque, wrench = falling_efforts(body, shapes, rates, accelerations, spins, slopes)
        torques.append(torque)
        wrench[:, 3:] -= push
        wrenches.append(wrench)
        energies.append(body.kinetic_energy(shapes, rates, spins))
    return Drive(torque=np.array(torques), rate=rates, wrench=np.array(wrenches), energy=np.array(energies))
