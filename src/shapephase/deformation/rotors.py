"""Wheels that are symmetric about their axles: by their momentum, which stays, or by a speed that motors hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_mapping, check_object, number_argument
from ..arrays import Array, finite_array, lock_arrays
from ..body.body import Body
from ..display import short_repr
from ..errors import ShapeError, TrajectoryError, unknown_name
from ..integrator.smoothness import Smoothness
from ..letters import value_text
from ..shape_space.curves import Reordered, Swings, Widened, most_swings
from ..shape_space.path_series import joint_extremes
from ..shape_space.scan.function_scan import FunctionScan, ScannedFunction, path_function, side_by_side
from ..shape_space.scan.scanning import scanned
from ..shape_space.shape_path import ShapePath
from ._scanned_functions import least_moment, momentum_alone
from .descriptions import UngaugedDescription

RotorValue = ArrayLike | ShapePath | tuple[ArrayLike, ArrayLike]

_SAME_TIME = 1e-9  # of the duration: nearer times are one, as two files with ten digits write it
_ROUND = 1e-6  # of a wheel's inertia, and of its radius of gyration: the digits of a wheel in a file


@dataclass(frozen=True, eq=False, kw_only=True)
class Rotor:
    """A wheel on its axle.

    joint, link : names of the axle and of the wheel
    inertia : J about the axle [kg m^2]
    axle : (3,) unit vector in the axes of the link
    value : the momentum p = J (a . omega_link + spin), or the spin itself [kg m^2/s] or [rad/s]; a number, or its
        path in time
    is_momentum : True for the momentum
    """

    joint: str
    link: str
    inertia: float
    axle: Array
    value: float | ShapePath
    is_momentum: bool

    __repr__ = short_repr
    __post_init__ = lock_arrays

    def at(self, times: Array) -> tuple[Array, Array]:
        """Values and their rates: (N,) -> (N,), (N,)."""
        if not isinstance(self.value, ShapePath):
            return np.full(len(times), self.value), np.zeros(len(times))
        values, rates = self.value.curve(times)
        return values[:, 0], rates[:, 0]

    @property
    def record(self) -> dict[str, Any]:
        """Value in SI units, its least and largest where it is given in time, ready for JSON."""
        kind = "momentum_kg_m2_s" if self.is_momentum else "speed_rad_s"
        if not isinstance(self.value, ShapePath):
            return {kind: self.value, "inertia_kg_m2": self.inertia}
        least, largest, _ = joint_extremes(self.value)
        return {kind: [float(least[0]), float(largest[0])], "in_time": True, "inertia_kg_m2": self.inertia}

    def stored(self, times: Array) -> Array:
        """Momentum along the axle that no rate of the shape carries, p or J spin: (N,) -> (N,) [kg m^2/s]."""
        return self.at(times)[0] * (1.0 if self.is_momentum else self.inertia)


@dataclass(frozen=True, eq=False)
class RotorDescription(UngaugedDescription):
    """A body whose joints follow a path while wheels spin; the angles of wheels do not matter, and rest at zero.

    A wheel's momentum p = J (a . (omega + Omega) + spin) stays, where no motor turns it: a is its axle, Omega how its
    carrier turns as seen from the base. Then Pi = (I - J a a^T) omega + L_o + (p - J a . Omega) a, where L_o is that of
    the other joints (Routh's reduction). With a given spin it is Pi = I omega + L_o + J spin a. Both hold as well where
    a motor changes p or the spin in a known way.
    """

    platform: Body
    route: ShapePath
    rotors: tuple[Rotor, ...]

    __repr__ = short_repr

    @property
    def driven_path(self) -> ShapePath:
        """Path of the joints that are not wheels."""
        wheels, joints = {rotor.joint for rotor in self.rotors}, self.platform.joint_names
        columns = np.array([column for column, name in enumerate(joints) if name not in wheels], dtype=int)
        wide = self.route.curve
        curve = wide.curve if isinstance(wide, Widened) else Reordered(wide, columns)
        names = tuple(joints[column] for column in columns)
        return replace(self.route, curve=curve, n_shape=len(names), joint_names=names)

    def sample(self, times: Array) -> tuple[Array, Array]:
        shapes, rates = self.route.curve(times)
        inertia, internal = self.platform.sample(shapes, rates)
        for rotor in self.rotors:
            axle, turning = self._axle(rotor, shapes, rates)
            along = rotor.stored(times)
            if rotor.is_momentum:
                inertia = inertia - rotor.inertia * axle[:, :, None] * axle[:, None, :]
                along = along - rotor.inertia * np.sum(axle * turning, axis=-1)
            internal = internal + along[:, None] * axle
        return inertia, internal

    def inertia_rate(self, times: Array) -> Array:
        shapes, rates = self.route.curve(times)
        rate = self.platform.inertia_rate(shapes, rates)
        for rotor in self.rotors:
            if rotor.is_momentum:
                axle, turning = self._axle(rotor, shapes, rates)
                product = np.cross(turning, axle)[:, :, None] * axle[:, None, :]
                rate = rate - rotor.inertia * (product + so3.transpose(product))
        return rate

    def stored_momentum(self, times: Array) -> Array | None:
        """See `Description`: p a of each wheel that keeps its momentum, J s a at a held speed."""
        held = [
            rotor.stored(times)[:, None] * self._axle(rotor, *self.route.curve(times))[0]
            for rotor in self.rotors
            if rotor.value != 0.0
        ]
        return np.sum(held, axis=0) if held else None

    def spins(self, times: Array, omega: Array) -> Array:
        """Speeds of the wheels on their axles, the base turning at omega (..., N, 3): -> (..., N, wheels) [rad/s]."""
        shapes, rates = self.route.curve(times)
        speeds = []
        for rotor in self.rotors:
            axle, turning = self._axle(rotor, shapes, rates)
            value = rotor.at(times)[0]
            free = value / rotor.inertia - np.sum(axle * (omega + turning), axis=-1)
            speeds.append(free if rotor.is_momentum else np.broadcast_to(value, free.shape))
        return np.stack(speeds, axis=-1)

    def centre_of_mass(self, times: Array) -> Array:
        return self.platform.centre_of_mass(self.route.curve(times)[0])

    def correlation(self, times: Array, reference: float) -> tuple[Array, Array]:
        still = self.route.curve(np.array([reference]))[0][0]
        return self.platform.mass_correlation(*self.route.curve(times), still)

    def kinetic_energy(self, times: Array, turning: Array) -> Array:
        """See `Description`, that of the wheels included."""
        shapes, rates = self.route.curve(times)
        whole = np.broadcast_to(rates, (*turning.shape[:-1], rates.shape[-1])).copy()
        columns = [self.platform.joint_index(rotor.joint) for rotor in self.rotors]
        whole[..., columns] = self.spins(times, turning)
        return self.platform.kinetic_energy(np.broadcast_to(shapes, whole.shape), whole, turning)

    @cached_property
    def timed(self) -> list[ShapePath]:
        """Paths of the values that are given in time."""
        return [rotor.value for rotor in self.rotors if isinstance(rotor.value, ShapePath)]

    @property
    def loops(self) -> int:
        """Equal parts of the motion, joints and wheels alike."""
        return self.route.loops if {path.loops for path in self.timed} <= {self.route.loops} else 1

    @cached_property
    def breaks(self) -> Array:
        """Declared breaks of the path and of the values of wheels, those nearer than rounding as one [s]."""
        breaks = self.route.breaks
        for path in self.timed:
            near = np.searchsorted(breaks, path.breaks).clip(1, len(breaks) - 1)
            apart = np.minimum(np.abs(breaks[near] - path.breaks), np.abs(path.breaks - breaks[near - 1]))
            breaks = np.union1d(breaks, path.breaks[apart > _SAME_TIME * breaks[-1]])
        return breaks

    @cached_property
    def swings(self) -> Swings:
        """Those of joints and wheels together, on one of the `loops`."""
        paths = [self.route, *self.timed]
        counts = [path.swings.most and path.swings.most * path.loops / self.loops for path in paths]
        return Swings(most_swings(counts), all(path.swings.smooth_loop for path in paths))

    @property
    def scan(self) -> FunctionScan | None:
        return self._scan if self.timed else self.route.scan

    @cached_property
    def _scan(self) -> FunctionScan | None:
        if self.swings.most is not None:
            return None
        return scanned(self.depends_on(), self.breaks[self.breaks <= self.breaks[-1] / self.loops * (1.0 + _SAME_TIME)])

    def depends_on(self) -> ScannedFunction:
        """See `Description`: the joints, and the momentum of wheels by the turn that it is worth."""
        joints = path_function(self.route.curve, self.route.n_shape, self.route.joint_names)
        if not self.timed:
            return joints
        wheels = [
            momentum_alone(rotor.stored, lambda times: least_moment(self.sample(times)[0]), rotor.joint)
            for rotor in self.rotors
        ]
        return side_by_side([joints, *wheels], "the path with its wheels")

    def link_frames(self, times: Array, link: str) -> tuple[Array, Array]:
        shapes, rates = self.route.curve(times)
        return self.platform.link_pose(shapes, link)[:, :3, :3], self.platform.link_angular_velocity(
            shapes, rates, link
        )

    def smoothness(self, breaks: Array) -> Smoothness:
        if not self.timed:
            return self.route.smoothness
        scan = self.scan
        return Smoothness(
            breaks=breaks,
            oscillations=self.swings.most,
            loops=self.loops,
            smooth_loop=self.swings.smooth_loop and len(self.breaks) == 2,
            resolved=None if scan is None else scan.resolved,
        )

    def _axle(self, rotor: Rotor, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """The axle, and how its carrier turns as seen from the base: (N, 3), (N, 3), base axes."""
        axle = self.platform.link_pose(shapes, rotor.link)[:, :3, :3] @ rotor.axle
        return axle, self.platform.link_angular_velocity(shapes, rates, rotor.link)


def mapping_of_joints(value: Any, name: str) -> Mapping[str, Any]:
    """Return a user's mapping from joints to numbers or curves; None: an empty one. Raises ShapeError."""
    if value is None:
        return {}
    check_mapping(value, name, "joint -> number, or (times, values)")
    return value


def rotors_argument(
    body: Body, momenta: Mapping[str, Any], speeds: Mapping[str, Any], duration: float
) -> tuple[Rotor, ...]:
    """Return wheels by the names of their axles.

    Raises UnknownNameError, ShapeError for a wheel that is not symmetric, TrajectoryError for a value in time that
    lasts longer or less than the path.
    """
    check_object(body, "Body", "body")
    rotors = []
    for name, given, unit in (("rotors", momenta, "kg m^2/s"), ("rotor_speeds", speeds, "rad/s")):
        for joint, value in given.items():
            if name == "rotor_speeds" and joint in momenta:
                raise ShapeError(f"rotor_speeds: {joint} is among the rotors, too; say one of both")
            known = _value_in_time(value, f"{name}, {joint}", unit, duration)
            rotors.append(_rotor(body, joint, known, name == "rotors"))
    return tuple(rotors)


def _value_in_time(value: Any, name: str, unit: str, duration: float) -> float | ShapePath:
    """Return a number, or the path of a value in time that lasts as long as the joints' path."""
    if isinstance(value, tuple | list) and len(value) == 2 and np.ndim(value[0]) == 1:
        try:
            times, values = finite_array(value[0], "times", unit="s"), finite_array(value[1], "values", unit=unit)
            if values.shape != times.shape:
                raise ShapeError(f"as many values as times are needed, got {values.shape} for {times.shape}")
            value = ShapePath.spline(times, values[:, None])
        except (ShapeError, TrajectoryError) as error:
            raise type(error)(f"{name}: {error}") from None
    if not isinstance(value, ShapePath):
        if not isinstance(value, int | float | np.number) and np.ndim(value):
            raise ShapeError(
                f"{name}: a number [{unit}], a pair of times and values (K,), or a ShapePath of one column is needed, "
                f"got {value_text(value)}"
            )
        return number_argument(value, name, unit)
    if value.n_shape != 1:
        raise ShapeError(f"{name}: a path of one column [{unit}] is needed, got one of {value.n_shape} columns")
    if abs(value.duration - duration) > _SAME_TIME * duration:
        raise TrajectoryError(
            f"{name}: its values last {value.duration:.9g} s, the path {duration:.9g} s; give them for the same time"
        )
    return value if value.duration == duration else value.stretched(duration / value.duration)


def _rotor(body: Body, joint: str, value: float | ShapePath, is_momentum: bool) -> Rotor:
    if joint not in body.joint_names:
        raise unknown_name(f"joint of {body.name}", joint, body.joint_names)
    chain = body.chain
    place = chain.names.index(joint)
    frame, axle = place + 1, chain.axes[place]
    if body.joint_units[body.joint_index(joint)] != "rad" or frame in chain.parents:
        raise ShapeError(
            f"rotors: {joint} must turn a wheel and nothing that hangs on it; it slides, or has joints below"
        )
    tensor, centre = chain.inertias[frame], chain.centres[frame]
    about = float(axle @ tensor @ axle)
    across = float(np.trace(tensor) - about) / 2.0
    symmetric = across * np.eye(3) + (about - across) * np.outer(axle, axle)
    uneven = float(np.abs(tensor - symmetric).max()) / about if about > 0.0 else np.inf
    arm = float(np.linalg.norm(np.cross(axle, centre)))
    off = arm * np.sqrt(chain.masses[frame] / about) if about > 0.0 else np.inf
    if max(uneven, off) > _ROUND:
        raise ShapeError(
            f"rotors: what {joint} turns is not symmetric about its axle (its inertia by {uneven:.3g} of the moment "
            f"about it, its centre of mass by {off:.3g} radii of gyration); give its angle by the path"
        )
    column = body.momentum_matrix(body.shape())[:, body.joint_index(joint)]
    if abs(float(np.linalg.norm(column)) - about) > _ROUND * about:
        raise ShapeError(f"rotors: another joint follows {joint}; give its angle by the path")
    link = next(name for name, (number, _) in chain.link_frames.items() if number == frame)
    axle = body.link_pose(body.shape(), link)[:3, :3].T @ column / about
    return Rotor(joint=joint, link=link, inertia=about, axle=axle, value=value, is_momentum=is_momentum)


def widened_path(body: Body, path: ShapePath, left_out: tuple[str, ...]) -> ShapePath:
    """A path of the other joints with columns for all, those left out at zero. Raises like `ShapePath.matched`."""
    check_object(body, "Body", "body")
    check_object(path, "ShapePath", "path")
    others = [name for name in body.joint_names if name not in left_out]
    twice = [name for name in left_out if name in (path.joint_names or ())]
    if twice:
        raise TrajectoryError(
            f"the path has {', '.join(twice)}, which a wheel or a free hinge gives here; leave it out of the path: "
            f"read_shape_path(..., without={twice})"
        )
    if path.joint_names is None and path.n_shape != len(others):
        raise TrajectoryError(
            f"the path has {path.n_shape} joints, {body.name} without {', '.join(left_out)} has {len(others)}: "
            f"{', '.join(others)}"
        )
    ordered = path.matched(others, f"{body.name} without {', '.join(left_out)}")
    columns = np.array([body.joint_index(name) for name in others], dtype=int)
    curve = Widened(ordered.curve, columns, body.n_shape)
    return replace(ordered, curve=curve, n_shape=body.n_shape, joint_names=body.joint_names)
