"""A trajectory of a body that floats, as a simulator or a recorder has it: base, joints, and their rates if given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_choice, made_by, names_argument, positive_argument
from ..arrays import FARTHEST, Array, finite_array
from ..body.body import Body
from ..body.joint_orders import WORDS
from ..body.loading import as_body
from ..display import frozen, short_repr
from ..errors import ShapeError, TrajectoryError
from ..reconstruction.attitude_angles import continuous
from ..shape_space.files.formats.floating_arrays import MUJOCO_QPOS, PINOCCHIO_Q, FreeJoint, with_free_joint
from ..shape_space.files.recording import Rates
from ..shape_space.path_noise import white_noise

FRAMES = ("world", "base")
_FEWEST = 8  # samples: a flight of 0.3 s at 30 frames a second; fewer say nothing of noise
_LARGEST = 1e12  # m, rad/s or s: no recorder has a clock or a place beyond it
_OF_JOINTS = ("shapes", "joint_rates")  # what is read up to `FARTHEST`, as by a body
_OFF_UNIT = 0.1  # what is no quaternion at all: recordings keep few digits, and an audit has to look at what is wrong


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


@frozen(kw_only=True)
class FloatingTrajectory:
    """Base and joints of a floating body at N times.

    Attributes
    ----------
    times : (N,) ascending [s]
    quaternion : (N, 4) x y z w of the base, base axes to the world's
    shapes : (N, n) joints in the body's order [rad or m]; of a ball joint its quaternion x, y, z, w, with any sign
    position : (N, 3) of the base's origin, world axes [m], or None
    rate : (N, 3) angular velocity of the base [rad/s], or None
    velocity : (N, 3) of the base's origin [m/s], or None
    joint_rates : (N, n) derivatives of the shapes [rad/s or m/s], or None
    rate_axes, velocity_axes : "world" or "base": in which axes these two are
    integrator_step : of the integrator that made it [s]; None: that between samples
    name : label in messages and figures
    joint_order : of arrays without names, in which order their joints were taken, in words; None: they had names
    certain : what the format of its file leaves no doubt about, which is no hypothesis: "units" of the joints, "order"
        of the base's quaternion, "direction" of its attitude
    captured : whether the format is one of motion capture, whose places are known to a centimetre
    noise : of the samples before they were filtered, which no longer show it; None: they show it

    Examples
    --------
    >>> times = np.linspace(0.0, 1.0, 21)
    >>> qpos = np.column_stack([np.zeros((21, 3)), np.ones(21), np.zeros((21, 6))])
    >>> rest = sp.FloatingTrajectory.from_mujoco(sp.load_body("cat_two_halves"), times, qpos)
    >>> rest.quaternion[0].tolist()
    [0.0, 0.0, 0.0, 1.0]
    """

    times: Array
    quaternion: Array
    shapes: Array
    position: Array | None = None
    rate: Array | None = None
    velocity: Array | None = None
    joint_rates: Array | None = None
    rate_axes: str = "base"
    velocity_axes: str = "world"
    integrator_step: float | None = None
    name: str = "trajectory"
    joint_order: str | None = None
    certain: tuple[str, ...] = ()
    captured: bool = False
    noise: TrajectoryNoise | None = None

    def __post_init__(self) -> None:
        """Check the arrays against each other. Raises ShapeError, TrajectoryError, UnknownNameError."""
        where, put = self.name, object.__setattr__
        times = finite_array(self.times, f"{where}: times", (None,), unit="s")
        if len(times) < _FEWEST:
            raise TrajectoryError(f"{where}: {len(times)} samples; an audit needs {_FEWEST} or more")
        if np.any(np.diff(times) <= 0.0):
            late = int(np.argmax(np.diff(times) <= 0.0)) + 1
            raise TrajectoryError(
                f"{where}: sample {late}: time {times[late]:.9g} s does not come after the one before"
            )
        put(self, "times", times)
        shapes = finite_array(self.shapes, f"{where}: shapes", (len(times), None))
        trailing = {"quaternion": 4, "position": 3, "rate": 3, "velocity": 3, "joint_rates": shapes.shape[1]}
        put(self, "shapes", shapes)
        for name, count in trailing.items():
            value = getattr(self, name)
            if value is not None:
                put(self, name, finite_array(value, f"{where}: {name}", (len(times), count)))
        for name in ("times", *trailing, "shapes"):
            _check_size(getattr(self, name), f"{where}: {name}", FARTHEST if name in _OF_JOINTS else _LARGEST)
        check_choice(self.rate_axes, "rate_axes", FRAMES)
        check_choice(self.velocity_axes, "velocity_axes", FRAMES)
        if self.integrator_step is not None:
            positive_argument(self.integrator_step, "integrator_step")
        if (self.rate is None) != (self.joint_rates is None):
            raise ShapeError(f"{where}: the rates of the base and of the joints come together, and one is missing")
        lengths = np.linalg.norm(self.quaternion, axis=1)
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        if abs(lengths[worst] - 1.0) > _OFF_UNIT:
            raise TrajectoryError(f"{where}: sample {worst}: a quaternion of length {lengths[worst]:.6g}, not 1")
        put(self, "quaternion", self.quaternion / lengths[:, None])

    @staticmethod
    def from_mujoco(
        body: Body | str,
        times: ArrayLike,
        qpos: ArrayLike,
        qvel: ArrayLike | None = None,
        *,
        joint_names: Sequence[str] | None = None,
        joint_order: str | None = None,
        integrator_step: float | None = None,
        name: str = "trajectory",
    ) -> FloatingTrajectory:
        """Trajectory of MuJoCo's arrays, free joint first: linear velocity in world axes, angular one in base axes.

        Parameters
        ----------
        times : (N,) [s]
        qpos : (N, 7 + n) place, quaternion w x y z, joints
        qvel : (N, 6 + n), or None
        joint_names : in the order of these arrays; None: in that of `joint_order`
        joint_order : "mujoco", "isaac", "isaac-by-name" or "body", as `read_recorded_motion` has them; None: "mujoco",
            the order in which MuJoCo compiles the body's file
        integrator_step : of the integrator [s]; None: that between samples

        Raises
        ------
        ShapeError, UnknownNameError, TrajectoryError
            For arrays that do not fit each other or the body.

        Examples
        --------
        >>> qpos = np.column_stack([np.zeros((21, 3)), np.ones(21), np.zeros((21, 6))])
        >>> cat = sp.load_body("cat_two_halves")
        >>> sp.FloatingTrajectory.from_mujoco(cat, np.linspace(0.0, 1.0, 21), qpos).shapes.shape
        (21, 3)
        """
        body = as_body(body)
        if joint_order is not None:
            check_choice(joint_order, "joint_order", WORDS)
            if joint_names is not None:
                raise ShapeError("joint_order is for arrays without names, and joint_names are given; leave one out")
        return _of_arrays(
            body,
            times,
            (qpos, qvel),
            ("qpos", "qvel"),
            MUJOCO_QPOS,
            joint_names,
            joint_order,
            integrator_step=integrator_step,
            name=name,
        )

    @staticmethod
    def from_pinocchio(
        body: Body | str,
        times: ArrayLike,
        q: ArrayLike,
        v: ArrayLike | None = None,
        *,
        joint_names: Sequence[str] | None = None,
        integrator_step: float | None = None,
        name: str = "trajectory",
    ) -> FloatingTrajectory:
        """Return a trajectory of Pinocchio's arrays (Crocoddyl): both velocities of the base are in base axes.

        Parameters
        ----------
        times : (N,) [s]
        q : (N, 7 + n) place, quaternion x y z w, joints, each by one number
        v : (N, 6 + n), or None
        joint_names : in the order of these arrays; None: in the body's order
        integrator_step : of the integrator [s]; None: that between samples

        Raises
        ------
        ShapeError, UnknownNameError, TrajectoryError
            For arrays that do not fit each other or the body.

        Examples
        --------
        >>> q = np.column_stack([np.zeros((21, 6)), np.ones(21), np.zeros((21, 3))])
        >>> cat = sp.load_body("cat_two_halves")
        >>> sp.FloatingTrajectory.from_pinocchio(cat, np.linspace(0.0, 1.0, 21), q).quaternion[0].tolist()
        [0.0, 0.0, 0.0, 1.0]
        """
        body = as_body(body)
        return _of_arrays(
            body, times, (q, v), ("q", "v"), PINOCCHIO_Q, joint_names, None, integrator_step=integrator_step, name=name
        )

    @property
    def attitude(self) -> Array:
        """(N, 3, 3) base axes to the world's."""
        return so3.matrix_from_quat(self.quaternion)

    @property
    def base_rate(self) -> Array | None:
        """(N, 3) angular velocity of the base, base axes [rad/s]."""
        if self.rate is None or self.rate_axes == "base":
            return self.rate
        return so3.apply(so3.transpose(self.attitude), self.rate)

    @property
    def world_velocity(self) -> Array | None:
        """(N, 3) of the base's origin, world axes [m/s]."""
        if self.velocity is None or self.velocity_axes == "world":
            return self.velocity
        return so3.apply(self.attitude, self.velocity)

    @property
    def assumed_step(self) -> float:
        """Step of the integrator: as given, else the median between samples [s]."""
        return float(np.median(np.diff(self.times))) if self.integrator_step is None else self.integrator_step

    def part(self, first: int, past: int) -> FloatingTrajectory:
        """Samples from `first` up to `past`, which is left out."""
        return self._cut(slice(first, past))

    def every(self, count: int) -> FloatingTrajectory:
        """The first sample, and one of every so many after it."""
        return self._cut(slice(None, None, count))

    def _cut(self, samples: slice) -> FloatingTrajectory:
        names = ("times", "quaternion", "shapes", "position", "rate", "velocity", "joint_rates")
        return replace(self, **{name: None if (had := getattr(self, name)) is None else had[samples] for name in names})


def _check_size(values: Array | None, what: str, most: float) -> None:
    """Raise TrajectoryError for numbers whose squares are none, or that have no digits left."""
    if values is not None and np.abs(values).max(initial=0.0) > most:
        sample = int(np.argmax(np.abs(values).reshape(len(values), -1).max(axis=1)))
        raise TrajectoryError(
            f"{what}: sample {sample} has {np.abs(values[sample]).max():.6g}; up to {most:g} is read; in which "
            "unit is it? Lengths are in m, angles in rad, times in s: convert millimetres, feet or degrees"
        )


def rates_by_name(rates: Rates | None) -> dict[str, Any]:
    """The fields of a trajectory that rates are."""
    if rates is None:
        return {}
    return {
        "rate": rates.base,
        "velocity": rates.velocity,
        "joint_rates": rates.joints,
        "rate_axes": rates.base_axes,
        "velocity_axes": rates.velocity_axes,
    }


def _of_arrays(
    body: Body,
    times: ArrayLike,
    arrays: tuple[ArrayLike, ArrayLike | None],
    labels: tuple[str, str],
    layout: FreeJoint,
    joint_names: Sequence[str] | None,
    order: str | None,
    *,
    integrator_step: float | None,
    name: str,
) -> FloatingTrajectory:
    """The trajectory in arrays of coordinates and of rates with a free joint."""
    names = None if joint_names is None else names_argument(joint_names, "joint_names", "names of joints")
    places = finite_array(arrays[0], labels[0], (None, None))
    motion = with_free_joint(layout, places, arrays[1], body, names=names, order=order, labels=labels, where=name)
    if motion.quaternion is None:
        raise ShapeError(f"{labels[0]}: {places.shape[1]} columns are the joints alone; the base stands before them")
    nameless = motion.nameless if layout is MUJOCO_QPOS else None
    return FloatingTrajectory(
        times=finite_array(times, "times", (None,), unit="s"),
        position=motion.position,
        quaternion=motion.quaternion,
        shapes=motion.shapes(body),
        integrator_step=integrator_step,
        name=name,
        joint_order=None if nameless is None else f"{nameless.title}: {', '.join(nameless.names)}",
        **rates_by_name(motion.rates),
    )


def estimated_noise(trajectory: FloatingTrajectory) -> TrajectoryNoise:
    """The noise of each kind of samples, as ever higher differences leave it (`white_noise`)."""
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
