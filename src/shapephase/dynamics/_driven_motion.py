"""What drives a motion of an articulated body, at many times and in many motions at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..body.inverse_dynamics import falling_efforts
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from .moving_body import moving_body, needed_body_and_path

BY_JOINTS = "the torques of joints need"
"""What needs a body with joints, as an error says it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Drive:
    """What the joints do at N times, in each of B motions of a batch.

    Attributes
    ----------
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


def drive(
    motion: Motion | ForcedMotion, times: Array, turned: Array | None = None, moved: Array | None = None
) -> Drive:
    """Inverse dynamics along a motion.

    Parameters
    ----------
    times : (N,)
    turned, moved : small changes of attitudes, and of joints with two derivatives, as in `moving_body`
    """
    body, path = needed_body_and_path(motion, BY_JOINTS)
    moving = moving_body(motion, body, path, times, turned, moved)
    joints, frames = (moving.shapes, moving.rates, moving.accelerations), body.rate_frame(moving.shapes)
    torques, wrenches, energies = [], [], []
    for spins, slopes in zip(moving.spins, moving.spin_rates, strict=True):
        torque, wrench = falling_efforts(body, *joints, spins, slopes)
        # Seen by the rates of ball joints, which their four numbers are not.
        torques.append((torque[:, None] @ frames)[:, 0])
        wrench[:, 3:] -= moving.push
        wrenches.append(wrench)
        energies.append(body.kinetic_energy(moving.shapes, moving.rates, spins))
    speeds = body.joint_rates(moving.shapes, moving.rates)
    return Drive(torque=np.array(torques), rate=speeds, wrench=np.array(wrenches), energy=np.array(energies))
