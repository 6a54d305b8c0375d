"""Error bars of what the joints do: torques, rates, power and work, by the noise of recorded joints."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object
from ..arrays import Array, lock_arrays
from ..display import short_repr
from ..errors import ShapeError, WrongObjectError
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ..shape_space.path_noise import path_errors, summed_errors
from ..shape_space.shape_path import ShapePath
from .loads import JointLoads
from .moving_body import BY_JOINTS, drive, needed_body_and_path
from .torques import JointTorques
from .wheels import wheels_of

# Steps of shapes [rad or m], rates and accelerations: torques are quadratic in rates and linear in accelerations.
_STEPS = (1e-5, 1.0, 1.0)
_TIMES_OF_WORK = 201  # even times at which errors of the power are summed: bars need few digits


@dataclass(frozen=True, eq=False)
class TorqueErrors:
    """Standard deviations of what the joints do at N times, to first order. Made by `torque_errors`.

    Attributes
    ----------
    times : (N,) [s]
    torque, rate, power : (N, n) [N m or N], [rad/s or m/s], [W]
    """

    times: Array
    torque: Array
    rate: Array
    power: Array

    __repr__ = short_repr
    __post_init__ = lock_arrays


@dataclass(frozen=True, eq=False)
class LoadErrors:
    """Standard deviations of peaks, each at its time, and of work. Made by `load_errors`.

    Attributes
    ----------
    peak_torque, peak_rate, peak_power : (n,) [N m or N], [rad/s or m/s], [W]
    work : (n,) net, of each joint [J]
    total_work : of all joints [J]
    """

    peak_torque: Array
    peak_rate: Array
    peak_power: Array
    work: Array
    total_work: float

    __repr__ = short_repr
    __post_init__ = lock_arrays


class _Slopes(NamedTuple):
    """Derivatives at N times by shape, rate and acceleration of each column of the path: (N, n_rates, n, 3)."""

    torque: Array
    rate: Array
    power: Array


def torque_errors(torques: JointTorques, joints: ArrayLike | None = None) -> TorqueErrors:
    """Standard deviations of torques, rates and power by the noise of the samples of the joints.

    Attitude and momentum are taken as they are: what the noise turns them by moves a torque far less than what it does
    to the accelerations.

    Parameters
    ----------
    torques : of one motion along a path through samples
    joints : standard deviation of the noise of the samples, as in `path_errors`; None: the one that the recording was
        smoothed for

    Raises
    ------
    ShapeError
        For a batch, and as `path_errors`.
    WrongObjectError
        For a path that is not through samples, see `path_errors`, or a body with wheels.

    Examples
    --------
    >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 41)
    >>> path = sp.ShapePath.spline(times, sp.examples.kane_scher(0.3, 0.5).shape(times), joint_names=cat.joint_names)
    >>> motion = sp.reconstruct(sp.articulated(cat, path), [0.0, 0.0, 0.005])
    >>> found = sp.torque_errors(sp.joint_torques(motion, [0.2]), joints=1e-4)
    >>> bool(np.all(found.power <= 1.0))
    True
    """
    check_object(torques, "JointTorques", "torques")
    return _errors_at(torques.motion, torques.times.ravel(), joints)


def load_errors(motion: Motion | ForcedMotion, loads: JointLoads, joints: ArrayLike | None = None) -> LoadErrors:
    """Standard deviations of peaks, each at its time, and work by the noise of the samples; see `torque_errors`.

    The largest of many values that noise moves is rather too large; its bar does not hold that.

    Examples
    --------
    >>> cat, times = sp.load_body("cat_two_halves"), np.linspace(0.0, 1.0, 41)
    >>> path = sp.ShapePath.spline(times, sp.examples.kane_scher(0.3, 0.5).shape(times), joint_names=cat.joint_names)
    >>> motion = sp.reconstruct(sp.articulated(cat, path), [0.0, 0.0, 0.005])
    >>> found = sp.dynamics.load_errors(motion, sp.joint_torques(motion).loads, joints=1e-4)
    >>> bool(found.total_work < found.work.sum())
    True
    """
    check_object(motion, "Motion", "motion", or_kind="ForcedMotion")
    check_object(loads, "JointLoads", "loads")
    path = _path_of(motion)
    count = len(loads.joint_names)
    own = np.arange(count)
    peak_times = np.concatenate([loads.peak_time, loads.rate_time, loads.power_time])
    times, place = np.unique(peak_times, return_inverse=True)
    errors = _errors_at(motion, times, joints)
    places = place.reshape(3, count)
    peak_errors = [
        values[at, own] for values, at in zip((errors.torque, errors.rate, errors.power), places, strict=True)
    ]
    # Errors of the work: sums of the power over even times, of each joint and of all together.
    even = np.linspace(0.0, motion.duration, _TIMES_OF_WORK)
    weights = np.full(len(even), even[1])
    weights[[0, -1]] *= 0.5
    slopes = weights[:, None, None, None] * _slopes(motion, path, even).power
    both = np.concatenate([slopes, slopes.sum(axis=1, keepdims=True)], axis=1)
    *work, total = summed_errors(path, even, both, joints)
    return LoadErrors(*peak_errors, work=np.array(work), total_work=float(total))


def _path_of(motion: Motion | ForcedMotion) -> ShapePath:
    """Path of a single motion of an articulated body."""
    if motion.batch:
        raise ShapeError(f"error bars are those of one motion, this is a batch of {motion.batch}")
    if wheels_of(motion) is not None:
        raise WrongObjectError("error bars of torques are not known for a body with wheels")
    return needed_body_and_path(motion, BY_JOINTS)[1]


def _errors_at(motion: Motion | ForcedMotion, times: Array, joints: ArrayLike | None) -> TorqueErrors:
    path = _path_of(motion)
    errors, slopes = path_errors(path, times, joints), _slopes(motion, path, times)
    return TorqueErrors(
        times=times, torque=errors.of(slopes.torque), rate=errors.of(slopes.rate), power=errors.of(slopes.power)
    )


def _slopes(motion: Motion | ForcedMotion, path: ShapePath, times: Array) -> _Slopes:
    torques, rates = [], []
    for column in range(path.n_shape):
        for which, step in enumerate(_STEPS):
            moved = np.zeros((3, path.n_shape))
            moved[which, column] = step
            ahead, behind = (drive(motion, times, moved=sign * moved) for sign in (1.0, -1.0))
            torques.append((ahead.torque[0] - behind.torque[0]) / (2.0 * step))
            rates.append((ahead.rate - behind.rate) / (2.0 * step))
    shape = (len(times), -1, path.n_shape, len(_STEPS))
    by_torque, by_rate = (np.stack(columns, axis=-1).reshape(shape) for columns in (torques, rates))
    efforts = drive(motion, times)
    power = efforts.rate[..., None, None] * by_torque + efforts.torque[0][..., None, None] * by_rate
    return _Slopes(by_torque, by_rate, power)
