"""Grouped arguments of `plan_reorientation`: goal, waypoints, limits and search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_file_name, check_object, number_argument, positive_argument
from ..arrays import Array, finite_array, real_array
from ..display import short_repr
from ..errors import ShapeError, unknown_name
from ..letters import value_text
from ..shape_space.shape_path import ShapePath

RATES_AT_ENDS = ("zero", "periodic", "free")
LIMIT_UNITS = {
    "rate_limits": ("rad/s or m/s", True),
    "acceleration_limits": ("rad/s^2 or m/s^2", False),
    "jerk_limits": ("rad/s^3 or m/s^3", False),
    "effort_limits": ("N m or N", True),
}  # units of `Limits`, and whether a body's file may state them

_SAME = 1e-7  # difference of entries of equal rotations: rounding of user input
_MOST_ROTATIONS = 120  # of a group: the icosahedron's has 60, larger ones have an axis of revolution instead
_LEAST_PIECES = 6  # of the spline: with fewer, not-a-knot ends leave too few control points for a loop
_MOST_PIECES = 2000  # a plan of three joints takes half a MiB for each
_MOST_STARTS = 1000  # the guesses of all starts are kept at once
_MOST_ITERATIONS = 2**31 - 1  # the solver's own counter


@dataclass(frozen=True, eq=False)
class Goal:
    """Attitude that a plan has to reach from the identity: one of `rotation`, `pointing`, or somersaults and twists.

    Attributes
    ----------
    rotation : (3, 3) attitude at the end; or several (k, 3, 3), of which the cheapest is taken
    pointing : an axis of the base and the inertial direction that it has to have at the end, two vectors (3,), kept as
        unit vectors (2, 3); the rotation about that direction is left free. Or several such pairs (k, 2, 3)
    link : name of the link whose axis is pointed instead of the base's, in axes of its frame at the end
    symmetry : turns, in base axes, that leave the body unchanged, any of which may precede the goal's: an axis (3,),
        for all turns about it; or some rotations (k, 3, 3), kept as the group that they generate
    somersaults, half_twists : turns about the momentum, and half turns about the body's own `twist_axis`, counted
        through the motion, whole or not; None of one: 0. The momentum must be at right angles to the twist axis
    twist_axis : (3,) base axes, of any length

    Raises
    ------
    ShapeError
        If nothing, or more than one thing, is given; for a wrong shape, entries that are not finite, a matrix that is
        no rotation, a vector of no length, more than 120 rotations of a symmetry.

    Examples
    --------
    >>> goal = sp.optimal_control.Goal(somersaults=1, half_twists=2)
    >>> goal.somersaults, goal.half_twists
    (1, 2)
    """

    rotation: ArrayLike | None = None
    pointing: ArrayLike | None = None
    link: str | None = None
    symmetry: ArrayLike | None = None
    somersaults: float | None = None
    half_twists: float | None = None
    twist_axis: ArrayLike = (0.0, 0.0, 1.0)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what is given and keep it as read-only arrays."""
        for name in ("somersaults", "half_twists"):
            if getattr(self, name) is not None:
                number_argument(getattr(self, name), name)
        given = (self.rotation is not None, self.pointing is not None, self.winds)
        if sum(given) > 1:
            raise ShapeError(
                "goal: rotation, pointing, and somersaults with half_twists each determine the attitude at the end; "
                "give one and leave the others None"
            )
        if not any(given):
            raise ShapeError("goal: one of rotation, pointing, or somersaults and half_twists is needed, got none")
        if self.rotation is not None:
            rotation = so3.rotation_argument(self.rotation, "rotation")
            if rotation.ndim not in (2, 3) or not len(rotation):
                raise ShapeError(
                    f"rotation: one rotation (3, 3), or several (k, 3, 3), are needed, got shape {rotation.shape}"
                )
            _keep(self, "rotation", rotation)
        if self.pointing is not None:
            _keep(self, "pointing", _unit_pairs(self.pointing))
        if self.link is not None and (self.pointing is None or not isinstance(self.link, str)):
            raise ShapeError(f"link: the name of the one whose axis `pointing` has, got {value_text(self.link)}")
        if self.symmetry is not None:
            _keep(self, "symmetry", _symmetry_argument(self.symmetry))
            if self.winds or (self.pointing is not None and np.ndim(self.symmetry) == 1):
                raise ShapeError("symmetry: an axis goes with rotation, rotations go with rotation or pointing")
        axis = finite_array(self.twist_axis, "twist_axis", (3,))
        if axis.ndim != 1 or not axis.any():
            raise ShapeError(
                f"twist_axis: one vector (3,) that is not zero is needed, got {value_text(self.twist_axis)}"
            )
        _keep(self, "twist_axis", axis)

    @property
    def winds(self) -> bool:
        """True where somersaults and twists are counted."""
        return self.somersaults is not None or self.half_twists is not None

    @property
    def members(self) -> tuple[Goal, ...]:
        """Alternative goals of one attitude or one axis each."""
        if self.winds:
            return (self,)
        turns = np.eye(3)[None] if self.symmetry is None else np.asarray(self.symmetry)
        if self.rotation is None:
            pairs = np.asarray(self.pointing).reshape(-1, 2, 3)
            return tuple(Goal(pointing=(turn @ axis, d), link=self.link) for axis, d in pairs for turn in turns)
        rotations = np.asarray(self.rotation).reshape(-1, 3, 3)
        if turns.ndim == 1:
            return tuple(Goal(pointing=(turns, rotation @ turns)) for rotation in rotations)
        return tuple(Goal(rotation=rotation) for rotation in _different((rotations[:, None] @ turns).reshape(-1, 3, 3)))


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of the joints of a plan.

    Attributes
    ----------
    joint_limits : whether the joints stay within the body's own limits
    rate_limits : largest rate of every joint, or of each, (n,) [rad/s or m/s]; "body": those stated in the body's file,
        if any; None: no limit
    acceleration_limits, jerk_limits : likewise for the derivatives of the rate, without "body" [rad/s^2 or m/s^2],
        [rad/s^3 or m/s^3]; with jerk limits joints start from rest without acceleration
    effort_limits : likewise for the torque or force of every motor, also of held joints [N m or N]; "body": those of
        the body's file, if any. With cost "effort" they are the units of efforts; None: no limit, units of the file
    clearance : least distance between links [m], see `collision_geometry`; None: they may pass through each other
    srdf : file with pairs of links to which that does not apply

    Raises
    ------
    ShapeError, UnknownNameError
        For limits that are not finite, not above 0, or neither a number nor a vector.

    Examples
    --------
    >>> sp.optimal_control.Limits(rate_limits=3.0).rate_limits.item()
    3.0
    """

    joint_limits: bool = True
    rate_limits: ArrayLike | str | None = "body"
    acceleration_limits: ArrayLike | None = None
    jerk_limits: ArrayLike | None = None
    effort_limits: ArrayLike | str | None = None
    clearance: float | None = None
    srdf: str | Path | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what is given and keep it as read-only arrays."""
        if not isinstance(self.joint_limits, bool | np.bool_):
            raise ShapeError(f"joint_limits: True or False is needed, got {value_text(self.joint_limits)}")
        if self.clearance is not None:
            object.__setattr__(self, "clearance", positive_argument(self.clearance, "clearance", "a distance in m"))
        if self.srdf is not None:
            check_file_name(self.srdf, "srdf")
        for name, (unit, stated) in LIMIT_UNITS.items():
            given, words = getattr(self, name), ("body",) if stated else ()
            if given is None or (isinstance(given, str) and given in words):
                continue
            if isinstance(given, str):
                raise unknown_name(f"value of {name}", given, (*words, "a number, or one for each joint"))
            limits = finite_array(given, name, unit=unit)
            if limits.ndim > 1 or np.any(limits <= 0.0):
                raise ShapeError(
                    f"{name}: one number above 0, or one for each of the joints, is needed, got {value_text(given)}"
                )
            _keep(self, name, limits)


@dataclass(frozen=True, eq=False)
class Waypoint:
    """Posture that a plan passes through without stopping.

    Attributes
    ----------
    shape : (n,) of all joints [rad or m]; or name -> coordinate of some, the others being free
    time : [s]; None: free, between the waypoints before and after it in the list

    Raises
    ------
    ShapeError, TrajectoryError
        For numbers that are not finite, no joints, a time that is not above 0.

    Examples
    --------
    >>> sp.optimal_control.Waypoint({"waist_pitch": 0.5}, time=0.4).time
    0.4
    """

    shape: ArrayLike | Mapping[str, float]
    time: float | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what is given and keep it as numbers."""
        if isinstance(self.shape, Mapping):
            if not self.shape or not all(isinstance(name, str) for name in self.shape):
                raise ShapeError(f"waypoint: names of joints with their coordinates are needed, got {self.shape}")
            kept = {name: finite_array(value, f"waypoint: {name}", ()).item() for name, value in self.shape.items()}
            object.__setattr__(self, "shape", kept)
        else:
            shape = finite_array(self.shape, "waypoint")
            if shape.ndim != 1 or not len(shape):
                raise ShapeError(
                    f"waypoint: one coordinate for each joint, or names with coordinates, got {value_text(self.shape)}"
                )
            _keep(self, "shape", shape)
        if self.time is not None:
            object.__setattr__(self, "time", positive_argument(self.time, "time of a waypoint"))


@dataclass(frozen=True)
class Search:
    """Effort of the search for a plan: by Gauss collocation of the attitude, a sparse program for IPOPT.

    Attributes
    ----------
    starts : number of local searches from different guesses, up to 1000; the cheapest plan is returned. For up to eight
        free joints, and for up to twelve with several starts, they are the best of more guesses, up to sixteen, by a
        coarse search. For up to eight, two further guesses are tried where none leads to a plan, then a motion of many
        equal strokes; that comes first where two joints cannot turn the body so far in four rounds. 0: the search
        from `guess` alone, as where plans follow a goal that moves
    seed : seed of the random guesses; equal seeds give equal plans
    pieces : pieces of the spline, from six to 2000; None: 160 for up to four free joints and the costs "kinetic" and
        "rate", else 40 for up to eight, 20 for more, and up to four times as many where the path misses the goal; a
        motion of many strokes has six or more for each, at most this number
    iterations : largest number for each start
    time_limit : longest duration of the search [s], checked after each iteration; None: no limit
    guess : path of the joints, at any pace, from which one more search starts; None: none

    Raises
    ------
    ShapeError, WrongObjectError
        For counts that are not whole numbers, too small or too large.

    Examples
    --------
    >>> sp.optimal_control.Search(starts=4).starts
    4
    """

    starts: int = 1
    seed: int = 0
    pieces: int | None = None
    iterations: int = 300
    time_limit: float | None = None
    guess: ShapePath | None = None

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what is given."""
        if self.guess is not None:
            check_object(self.guess, "ShapePath", "guess")
        if self.pieces is not None:
            _check_count(self.pieces, "pieces", _LEAST_PIECES, _MOST_PIECES)
        _check_count(self.starts, "starts", 1 if self.guess is None else 0, _MOST_STARTS)
        _check_count(self.seed, "seed", 0)
        _check_count(self.iterations, "iterations", 1, _MOST_ITERATIONS)
        if self.time_limit is not None:
            positive_argument(self.time_limit, "time_limit")


def goal_argument(value: Any) -> Goal:
    """Return a user's goal, a `Goal` or rotations. Raises ShapeError."""
    if isinstance(value, Goal):
        return value
    if value is not None and real_array(value, "goal").shape == (2, 3):
        raise ShapeError(
            "goal: a rotation (3, 3) or a Goal is needed; to point an axis, give Goal(pointing=(axis, direction))"
        )
    return Goal(rotation=value)


def _unit_pairs(pointing: ArrayLike) -> Array:
    pairs = finite_array(pointing, "pointing")
    lengths = np.linalg.norm(pairs, axis=-1)
    if pairs.ndim not in (2, 3) or pairs.shape[-2:] != (2, 3) or not pairs.size or not np.all(lengths > 0.0):
        raise ShapeError(
            "pointing: an axis of the base and a direction in inertial axes, two vectors (3,) that are not zero, are "
            f"needed, or several such pairs (k, 2, 3), got {value_text(pointing)}"
        )
    return pairs / lengths[..., None]


def _check_count(value: Any, name: str, least: int, most: int | None = None) -> None:
    if not isinstance(value, int | np.integer) or value < least:
        raise ShapeError(f"{name}: a whole number, {least} or more, is needed, got {value_text(value)}")
    if most is not None and value > most:
        raise ShapeError(f"{name}: a whole number, up to {most}, is needed, got {value_text(value)}")


def _keep(options: object, name: str, array: Array) -> None:
    """Store a copy of an array that cannot be changed."""
    kept = array.copy()
    kept.flags.writeable = False
    object.__setattr__(options, name, kept)


def _symmetry_argument(value: ArrayLike) -> Array:
    """Return a unit axis (3,), or the group (k, 3, 3) that rotations generate, the identity first.

    Raises ShapeError.
    """
    array = finite_array(value, "symmetry")
    if array.shape == (3,) and array.any():
        return so3.normalised(array)
    if array.ndim not in (2, 3) or array.shape[-2:] != (3, 3) or not len(array):
        raise ShapeError(
            "symmetry: an axis (3,) that is not zero, or rotations of the body, (3, 3) or (k, 3, 3), are needed, got "
            f"{value_text(value)}"
        )
    return _group(so3.rotation_argument(array, "symmetry").reshape(-1, 3, 3))


def _different(rotations: Array) -> Array:
    """Rotations (k, 3, 3) without repetitions, in their order."""
    kept: list[Array] = []
    for rotation in rotations:
        if not _among(kept, rotation):
            kept.append(rotation)
    return np.array(kept)


def _group(generators: Array) -> Array:
    """Group of all products of rotations."""
    group = [np.eye(3)]
    # The list grows during the loop.
    for rotation in group:
        for product in rotation @ generators:
            if not _among(group, product):
                group.append(product)
        if len(group) > _MOST_ROTATIONS:
            raise ShapeError(
                f"symmetry: the rotations make a group of more than {_MOST_ROTATIONS}; for a body of revolution give "
                "its axis, (3,)"
            )
    return np.array(group)


def _among(rotations: list[Array], rotation: Array) -> bool:
    return bool(rotations) and bool(np.any(np.abs(np.array(rotations) - rotation).max(axis=(1, 2)) < _SAME))
