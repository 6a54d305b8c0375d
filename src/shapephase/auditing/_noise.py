"""How much noise the samples of a trajectory have: what is left of them after ever higher differences.

White noise keeps its level from one order of differences to the next, and what is smooth loses digits with each; the
least level that any order leaves is that of the noise.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..arguments import made_by
from ..arrays import Array
from ..display import short_repr
from ..reconstruction.attitude_angles import continuous
from ..shape_space.path_noise import white_noise
from .floating_trajectory import FloatingTrajectory


@made_by("auditing.TrajectoryNoise(attitude=0.002), for example")
@dataclass(frozen=True, kw_only=True)
class TrajectoryNoise:
    """Standard deviations of the samples, each about each axis or of each joint alike.

    Attributes
    ----------
    attitude : of the base [rad]
    position : of its origin [m]
    joints : [rad or m], one for each
    rate : of the base's angular velocity [rad/s]
    velocity : of its origin's [m/s]
    joint_rates : [rad/s or m/s], one for each

    Examples
    --------
    >>> sp.auditing.TrajectoryNoise(attitude=0.002, joints=(0.001,)).position
    0.0
    """

    attitude: float = 0.0
    position: float = 0.0
    joints: tuple[float, ...] = ()
    rate: float = 0.0
    velocity: float = 0.0
    joint_rates: tuple[float, ...] = ()

    __repr__ = short_repr


def estimated_noise(trajectory: FloatingTrajectory) -> TrajectoryNoise:
    """The noise of each kind of samples."""
    return TrajectoryNoise(
        # Half the angle is in the quaternion, across it: three of its four numbers.
        attitude=2.0 * _of_vector(continuous(trajectory.quaternion)),
        position=_of_vector(trajectory.position),
        joints=_of_each(trajectory.shapes),
        rate=_of_vector(trajectory.rate),
        velocity=_of_vector(trajectory.velocity),
        joint_rates=_of_each(trajectory.joint_rates),
    )


def _of_vector(samples: Array | None) -> float:
    return 0.0 if samples is None else float(white_noise(samples[:, None], 3)[0])


def _of_each(samples: Array | None) -> tuple[float, ...]:
    return () if samples is None else tuple(white_noise(samples[:, :, None], 1).tolist())
