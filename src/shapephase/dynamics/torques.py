"""The torques and forces that the joints of a free body need for its motion."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import times_argument
from ..arrays import Array, lock_arrays
from ..display import short_repr
from ..errors import MissingExtraError, ShapeError, WrongObjectError
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.motion_record import write_table
from ..reconstruction.reconstruction import Motion
from .loads import JointLoads, joint_loads
from .moving_body import BY_JOINTS, check_motion, drive, needed_body_and_path

_ROWS = 201  # of a table without given times
_UNITS = {"rad": "N_m", "m": "N"}  # of efforts, in names of columns


@dataclass(frozen=True, eq=False)
class JointTorques:
    """Efforts of the joints at some times; results are batch + t.shape + (n,), joints in the order of the body's.

    Made by `joint_torques`.

    Attributes
    ----------
    motion : which they drive
    times : (...) [s]
    joint_names, joint_units : "rad" for a torque in N m, "m" for a force in N; a ball joint has three, about its axes
    mass : of the body [kg]
    torque : that the motor of each joint exerts, followers included [N m or N]
    rate : t.shape + (n,) of the joints [rad/s or m/s]
    power : torque times rate [W]
    base_wrench : batch + t.shape + (6,) force on the base and torque about its origin that the motion would need from
        outside, base axes [N], [N m]. A free body has none: what is left is rounding
    loads : over the whole motion: peaks, work, limits
    """

    motion: Motion | ForcedMotion = field(repr=False)
    times: Array
    joint_names: tuple[str, ...]
    joint_units: tuple[str, ...]
    mass: float
    torque: Array
    rate: Array
    power: Array
    base_wrench: Array

    __repr__ = short_repr
    __post_init__ = lock_arrays

    @cached_property
    def loads(self) -> JointLoads:
        """Peaks, work and limits over the whole motion, whatever the times; computed when first needed."""
        return joint_loads(self.motion)

    @cached_property
    def error_estimate(self) -> Array:
        """Error of the torques by the error of the attitudes: batch + t.shape + (n,) [N m or N].

        To first order, for an attitude that is off by the motion's `error_estimate` about the worst axis.
        """
        step = 1e-3
        slopes = []
        for axis in np.eye(3):
            ahead, behind = (drive(self.motion, self.times.ravel(), sign * step * axis) for sign in (1.0, -1.0))
            slopes.append((ahead.torque - behind.torque) / (2.0 * step))
        size = np.sqrt(np.sum(np.square(slopes), axis=0))
        off = np.reshape(self.motion.error_estimate, (-1, 1, 1))
        return (size * off).reshape(self.torque.shape)

    @property
    def torque_per_mass(self) -> Array:
        """Torque per mass of the body, the figure that biomechanics compares [N m/kg or N/kg]."""
        return self.torque / self.mass

    def write_csv(self, path: str | os.PathLike[str]) -> None:
        """Write a time series: of each joint the torque (or force), the rate and the power.

        Raises
        ------
        ShapeError
            If the motion is a batch, or the times are not in one row.
        """
        write_table(path, self._columns())

    def to_dataframe(self) -> Any:
        """The time series of `write_csv` as a table of pandas.

        Raises
        ------
        ShapeError
            If the motion is a batch, or the times are not in one row.
        MissingExtraError
            Without pandas.
        """
        try:
            from pandas import DataFrame
        except ImportError:
            raise MissingExtraError("a table needs pandas; install it with: pip install pandas") from None
        return DataFrame(self._columns())

    def _columns(self) -> dict[str, Array]:
        if self.torque.ndim != 2:
            raise ShapeError(f"a table holds one motion at (N,) times, these are {self.torque.shape[:-1]}")
        columns = {"time": self.times}
        for k, (name, unit) in enumerate(zip(self.joint_names, self.joint_units, strict=True)):
            columns[f"{name}_{'torque' if unit == 'rad' else 'force'}_{_UNITS[unit]}"] = self.torque[:, k]
            columns[f"{name}_rate_{unit}_s"] = self.rate[:, k]
            columns[f"{name}_power_W"] = self.power[:, k]
        return columns


def joint_torques(motion: Motion | ForcedMotion, t: ArrayLike | None = None) -> JointTorques:
    """The torques and forces that the joints of a free body need for a motion: inverse dynamics.

    The body floats, or falls: gravity, which moves all its parts alike, loads no joint. Followers load the joint that
    they follow by the work they do. Armatures, friction and the inertia of motors are not in it.

    At a break of the path, where the acceleration jumps, the torque is the one that follows.
    Equations :eq:`inverse-dynamics` and :eq:`base-acceleration` of the documentation.
    Source: Featherstone 2008, Rigid Body Dynamics Algorithms, section 5.3; theory.md A6.

    Parameters
    ----------
    motion : of an articulated body, in any gauge; a torque from outside acts on the base
    t : times (...) [s]; None: 201 even times

    Returns
    -------
    torques, power, and by `loads` the peaks and the work over the whole motion

    Raises
    ------
    WrongObjectError
        If the body has no joints, or none along a path: made of particles or functions, or read from a file of
        `Motion.save`.
    TrajectoryError
        For times outside of the motion.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> found = sp.joint_torques(sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]))
    >>> print(float(found.loads.energy_defect) < 1e-9)  # work of the joints against the change of energy
    True
    """
    check_motion(motion)
    body, _ = needed_body_and_path(motion, BY_JOINTS)
    if not body.n_shape:
        raise WrongObjectError(f"{body.name} has no joints, and so no torques of joints; `split` analyses its turn")
    given = np.linspace(0.0, motion.duration, _ROWS) if t is None else t
    times = times_argument(given, motion.duration)
    efforts = drive(motion, times.ravel())
    whole = (*motion.batch, *times.shape)
    return JointTorques(
        motion=motion,
        times=times,
        joint_names=body.rate_names,
        joint_units=body.rate_units,
        mass=body.mass,
        torque=efforts.torque.reshape(*whole, body.n_rates),
        rate=efforts.rate.reshape(*times.shape, body.n_rates),
        power=efforts.power.reshape(*whole, body.n_rates),
        base_wrench=efforts.wrench.reshape(*whole, 6),
    )
