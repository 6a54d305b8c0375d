"""The rotation without momentum beside a motion with it, and how far both may be off at every time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .. import so3
from ..arrays import Array, Integers, lock_arrays, read_only
from ..display import short_repr
from .stepped import SteppedRotation
from .steps.error_propagator import growth_and_rounding
from .steps.step_loop import largest_angle, quaternions_alone

# Of the motion's error estimate: what the steps of its lift are to err by at most.
_SHARE = 0.1
# [rad] the same where the motion is as good as exact.
_ROUNDING = 1e-14
# Of the distance from twice as many steps, which shows the error of steps but for a part in two hundred.
_SAFETY_FACTOR = 2.0
# Times that the steps of a lift are halved to err no more than that.
_MOST_HALVINGS = 3


@dataclass(frozen=True, eq=False)
class Lift:
    """How the shape alone would turn the frame, on the samples of a motion; where its steps end own steps end.

    Attributes
    ----------
    motion : the attitude beside which it is
    steps : (P,) of its own on each of the interpolant's panels
    quaternions : (1, M + 1, 4) xyzw at their ends
    finer : (1, 2 M + 1, 4) by twice as many
    ends : (K + 1,) which ends of its steps are those of the motion's
    """

    motion: SteppedRotation
    steps: Integers
    quaternions: Array
    finer: Array
    ends: Integers

    __repr__ = short_repr

    __post_init__ = lock_arrays

    @cached_property
    def end(self) -> Array:
        """Where it ends: (3, 3)."""
        return read_only(so3.matrix_from_quat(self.quaternions[0, -1]))

    def at_ends(self, place: Integers | slice) -> Array:
        """At these ends of the motion's steps: (N,) -> (N, 3, 3)."""
        return so3.matrix_from_quat(self.quaternions[0, self.ends[place]])

    @cached_property
    def turns(self) -> Array:
        """As of `error_turns`, at the ends of the motion's steps: (2, 1, K + 1, 3)."""
        motion, ends = self.motion, self.ends
        other = quaternions_alone(motion.interpolant, motion.perturbed.coefficients, self.steps)
        better = np.stack([self.finer[:, 2 * ends], other[:, ends]])
        return read_only(small_turns(self.quaternions[:, ends], better))

    @cached_property
    def rotation(self) -> SteppedRotation:
        """It at all times, and how far it may be off; of a motion without momentum that itself."""
        motion, quaternions = self.motion, self.quaternions
        if _is_at_rest(motion):
            return motion
        stepping, sampling = np.sqrt(np.einsum("sbki,sbki->sbk", self.turns, self.turns).max(axis=-1))
        growth, rounding = growth_and_rounding(np.empty((1, 0, 3, 3)), quaternions, _tolerance(motion))
        nothing = np.zeros((1, quaternions.shape[1] - 1))
        return SteppedRotation(
            interpolant=motion.interpolant,
            momentum=np.zeros((1, 3)),
            steps=self.steps,
            quaternions=quaternions,
            directions=np.empty((1, 0, 3)),
            turns=nothing,
            dynamics=nothing,
            sampling_error=motion.perturbed.hidden + sampling,
            stepping_error=_SAFETY_FACTOR * stepping,
            rounding_error=rounding,
            amplification=growth,
            perturbed=motion.perturbed,
        )


def lift_along(rotation: SteppedRotation) -> Lift:
    """The lift of a motion, in steps that err little beside it; how little is found when it is asked for."""
    interpolant, series = rotation.interpolant, rotation.interpolant.coefficients
    at_rest, times_finer = _is_at_rest(rotation), 1
    quaternions = rotation.quaternions[:1] if at_rest else quaternions_alone(interpolant, series, rotation.steps)
    finer = quaternions_alone(interpolant, series, 2 * rotation.steps)
    tolerance = np.inf if at_rest else _tolerance(rotation)
    for _ in range(_MOST_HALVINGS):
        if _SAFETY_FACTOR * float(largest_angle(quaternions, finer[:, ::2])[0]) <= tolerance:
            break
        times_finer *= 2
        quaternions, finer = finer, quaternions_alone(interpolant, series, 2 * times_finer * rotation.steps)
    ends = times_finer * np.arange(rotation.quaternions.shape[1])
    return Lift(rotation, times_finer * rotation.steps, quaternions, finer, ends)


def _is_at_rest(rotation: SteppedRotation) -> bool:
    return not rotation.directions.shape[1]


def _tolerance(rotation: SteppedRotation) -> float:
    """How far the lift's steps may be off [rad]."""
    return max(_SHARE * float(np.min(rotation.error_estimate)), _ROUNDING)


def error_turns(rotation: SteppedRotation, lift: Lift) -> Array:
    """Small turns from attitudes at the ends of steps to better ones, S exp(hat(turn)), body axes: (2, B, K + 1, 3).

    First to those by twice as many steps, then to those on the perturbed series [rad].
    """
    if _is_at_rest(rotation):
        return np.broadcast_to(lift.turns, (2, len(rotation.momentum), *lift.turns.shape[2:]))
    interpolant, perturbed = rotation.interpolant, rotation.perturbed
    starts = rotation.directions[:, 0], np.linalg.norm(rotation.momentum, axis=-1)
    better = np.empty((2, *rotation.quaternions.shape))
    better[0] = quaternions_alone(interpolant, interpolant.coefficients, 2 * rotation.steps, *starts)[:, ::2]
    better[1] = quaternions_alone(interpolant, perturbed.coefficients, rotation.steps, *starts)
    return small_turns(rotation.quaternions, better)


def small_turns(start: Array, end: Array) -> Array:
    """From quaternions xyzw to others near them: (..., 4), (..., 4) -> (..., 3) [rad]."""
    x, y, z, w = start[..., 0], start[..., 1], start[..., 2], start[..., 3]
    back = np.empty((*start.shape, 4))
    back[..., 0, 0] = back[..., 1, 1] = back[..., 2, 2] = back[..., 3, 3] = w
    back[..., 0, 1], back[..., 1, 0], back[..., 2, 3], back[..., 3, 2] = z, -z, -z, z
    back[..., 0, 2], back[..., 2, 0], back[..., 1, 3], back[..., 3, 1] = -y, y, -y, y
    back[..., 1, 2], back[..., 2, 1], back[..., 0, 3], back[..., 3, 0] = x, -x, -x, x
    between = np.einsum("...ij,...j", back, end)
    # A quaternion and its negative are one attitude.
    return np.copysign(2.0, between[..., 3:]) * between[..., :3]
