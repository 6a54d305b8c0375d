"""The grouped arguments of `plan_reorientation`: what to reach, within which limits, and how to search."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import number_argument
from ..arrays import Array, finite_array, real_array
from ..display import short_repr
from ..errors import ShapeError, unknown_name
from ..letters import what_came

METHODS = ("collocation", "reduced")
RATES_AT_ENDS = ("zero", "periodic", "free")

# Pieces of the spline: with fewer, not-a-knot ends leave too few control points for a loop.
_LEAST_PIECES = 6
# A plan of three joints takes half a MiB for each piece, and no path needs so many.
_MOST_PIECES = 2000
# The guesses of all starts are kept at once.
_MOST_STARTS = 1000
# What the solver's own counter holds.
_MOST_ITERATIONS = 2**31 - 1


@dataclass(frozen=True, eq=False)
class Goal:
    """The attitude that a plan has to reach, from the identity at its start. Exactly one of three ways to say it.

    Attributes
    ----------
    rotation : (3, 3) attitude at the end
    pointing : an axis of the base and the inertial direction that it has to have at the end, two vectors (3,), kept as
        unit vectors (2, 3); the rotation about that direction is left free
    somersaults, half_twists : how often the body turns about its momentum and, in half turns, about its own
        `twist_axis`, counted through the motion, whole or not; one that is left out is 0. The momentum must be at right
        angles to the twist axis
    twist_axis : (3,) base axes, of any length

    Raises
    ------
    ShapeError
        If nothing, or more than one thing, is given; for a wrong shape, entries that are not finite, a matrix that is
        no rotation, a vector of no length.

    Examples
    --------
    >>> goal = sp.optimal_control.Goal(somersaults=1, half_twists=2)
    >>> goal.somersaults, goal.half_twists
    (1, 2)
    """

    rotation: ArrayLike | None = None
    pointing: ArrayLike | None = None
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
            if rotation.shape != (3, 3):
                raise ShapeError(f"rotation: one rotation (3, 3) is needed, got shape {rotation.shape}")
            self._keep("rotation", rotation)
        if self.pointing is not None:
            self._keep("pointing", _unit_pair(self.pointing))
        axis = finite_array(self.twist_axis, "twist_axis", (3,))
        if axis.ndim != 1 or not axis.any():
            raise ShapeError(
                f"twist_axis: one vector (3,) that is not zero is needed, got {what_came(self.twist_axis)}"
            )
        self._keep("twist_axis", axis)

    def _keep(self, name: str, value: Array) -> None:
        object.__setattr__(self, name, _read_only(value))

    @property
    def winds(self) -> bool:
        """Whether somersaults and twists are counted."""
        return self.somersaults is not None or self.half_twists is not None


@dataclass(frozen=True, eq=False)
class Limits:
    """What the joints of a plan have to stay within.

    Attributes
    ----------
    joint_limits : whether the joints stay within the body's own limits
    rate_limits : the largest rate of every joint, or one for each, (n,) [rad/s or m/s]; "body": those that the body's
        file states, joints of which it states none being as fast as they like; None: no limit

    Raises
    ------
    ShapeError, UnknownNameError
        For rates that are not finite, not above 0, or neither a number nor a vector.

    Examples
    --------
    >>> sp.optimal_control.Limits(rate_limits=3.0).rate_limits.item()
    3.0
    """

    joint_limits: bool = True
    rate_limits: ArrayLike | str | None = "body"

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what is given and keep it as a read-only array."""
        if not isinstance(self.joint_limits, bool | np.bool_):
            raise ShapeError(f"joint_limits: True or False is needed, got {what_came(self.joint_limits)}")
        if self.rate_limits is None:
            return
        if isinstance(self.rate_limits, str):
            if self.rate_limits != "body":
                raise unknown_name(
                    "value of rate_limits", self.rate_limits, ("body", "a number, or one for each joint")
                )
            return
        rates = finite_array(self.rate_limits, "rate_limits", unit="rad/s or m/s")
        if rates.ndim > 1 or np.any(rates <= 0.0):
            raise ShapeError(
                "rate_limits: one number above 0, or one for each of the joints, is needed, got "
                f"{what_came(self.rate_limits)}"
            )
        object.__setattr__(self, "rate_limits", _read_only(rates))


@dataclass(frozen=True)
class Search:
    """How a plan is searched for.

    Attributes
    ----------
    method : "collocation", the attitude by Gauss collocation, the whole a sparse program with exact second derivatives
        for IPOPT; or "reduced", the path's coefficients alone, with the exact derivative of the integrator's attitude
        (not for the cost "time"). On equal splines both come to the same costs within 1.5 %, of the cat in 14 and 11 s;
        the first leaves a KKT residual of 1e-9, the second of some 1e-6, and for the astronaut it may need more than
        300 iterations: so the first is the default
    starts : local searches from different guesses, of which the cheapest plan is returned; up to 1000. For up to eight
        free joints, and for up to twelve with several starts, they are the best of more guesses, up to sixteen, by a
        coarse search. Where none leads to a plan of up to eight, two further guesses are tried, and then a motion of
        many equal strokes; at once where two joints cannot turn the body so far in four rounds
    seed : of the random guesses; the same seed gives the same plan
    pieces : of the spline, from six to 2000; None: 160 for up to four free joints and the costs "kinetic" and "rate",
        else 40 for up to eight, 20 for more, and up to four times as many where the path that was found misses the
        goal; of many strokes as many as they need, six or more for each, but no more than these
    iterations : the most that the solver may take for each start

    Raises
    ------
    UnknownNameError
        For another method.
    ShapeError
        For counts that are not whole numbers, too small or too large.

    Examples
    --------
    >>> sp.optimal_control.Search(starts=4).starts
    4
    """

    method: str = "collocation"
    starts: int = 1
    seed: int = 0
    pieces: int | None = None
    iterations: int = 300

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what is given."""
        if not isinstance(self.method, str) or self.method not in METHODS:
            raise unknown_name("method", self.method, METHODS)
        if self.pieces is not None:
            _check_count(self.pieces, "pieces", _LEAST_PIECES, _MOST_PIECES)
        _check_count(self.starts, "starts", 1, _MOST_STARTS)
        _check_count(self.seed, "seed", 0)
        _check_count(self.iterations, "iterations", 1, _MOST_ITERATIONS)


def goal_argument(value: Any) -> Goal:
    """A user's goal: a `Goal` as it is, or a rotation (3, 3). Raises ShapeError."""
    if isinstance(value, Goal):
        return value
    if value is not None and real_array(value, "goal").shape == (2, 3):
        raise ShapeError(
            "goal: a rotation (3, 3) or a Goal is needed; to point an axis, give Goal(pointing=(axis, direction))"
        )
    return Goal(rotation=value)


def _unit_pair(pointing: ArrayLike) -> Array:
    pair = finite_array(pointing, "pointing")
    lengths = np.linalg.norm(pair, axis=-1)
    if pair.shape != (2, 3) or not np.all(lengths > 0.0):
        raise ShapeError(
            "pointing: an axis of the base and a direction in inertial axes, two vectors (3,) that are not zero, are "
            f"needed, got {what_came(pointing)}"
        )
    return pair / lengths[:, None]


def _check_count(value: Any, name: str, least: int, most: int | None = None) -> None:
    if not isinstance(value, int | np.integer) or value < least:
        raise ShapeError(f"{name}: a whole number, {least} or more, is needed, got {what_came(value)}")
    if most is not None and value > most:
        raise ShapeError(f"{name}: a whole number, up to {most}, is needed, got {what_came(value)}")


def _read_only(array: Array) -> Array:
    kept = array.copy()
    kept.flags.writeable = False
    return kept
