"""The rotation by the shape alone beside a motion, and the error estimates of both at every time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from .. import so3
from ..arrays import Array, Integers, read_only
from ..chebyshev import inside, nodes_on, values_to_coefficients
from ..display import frozen
from .integrate import committed_rounding
from .interpolant import Interpolant
from .samples import Perturbed
from .stepped import SteppedRotation
from .stepping import largest_angle, small_turns, stepped_quaternions

_SHARE = 0.1  # of the motion's error estimate: error allowed for the steps of its lift
_ROUNDING = 1e-14  # [rad] that error where the motion is as good as exact
_SAFETY_FACTOR = 2.0  # times the distance from twice as many steps, which is their error to 1/255
_MOST_HALVINGS = 3  # of the steps of a lift


@frozen
class Lift:
    """Rotation of the frame by the shape alone, on the samples of a motion, whose steps end where some of its own end.

    motion : the attitude by shape and momentum
    interpolant : the motion's own, or that without the drift by the momentum of wheels
    perturbed : the interpolant's series with their probable errors
    steps : (P,) of the lift, on each of the interpolant's panels
    quaternions : (1, M + 1, 4) xyzw at their ends
    finer : (1, 2 M + 1, 4) by twice as many
    ends : (K + 1,) which ends of its steps are those of the motion's
    """

    motion: SteppedRotation
    interpolant: Interpolant
    perturbed: Perturbed
    steps: Integers
    quaternions: Array
    finer: Array
    ends: Integers

    @cached_property
    def end(self) -> Array:
        """Rotation at the end: (3, 3)."""
        return read_only(so3.matrix_from_quat(self.quaternions[0, -1]))

    def at_ends(self, place: Integers | slice) -> Array:
        """Rotations at these ends of the motion's steps: (N,) -> (N, 3, 3)."""
        return so3.matrix_from_quat(self.quaternions[0, self.ends[place]])

    @cached_property
    def turns(self) -> Array:
        """The lift's `error_turns`, at the ends of the motion's steps: (2, 1, K + 1, 3)."""
        ends = self.ends
        other = _alone(self.interpolant, self.perturbed.coefficients, self.steps)
        better = np.stack([self.finer[:, 2 * ends], other[:, ends]])
        return read_only(small_turns(self.quaternions[:, ends], better))

    @cached_property
    def rotation(self) -> SteppedRotation:
        """The lift at all times, with error estimates; the motion itself where it has no momentum."""
        motion, quaternions = self.motion, self.quaternions
        if _is_at_rest(motion) and self.is_without_wheels:
            return motion
        stepping, sampling = np.sqrt(np.einsum("sbki,sbki->sbk", self.turns, self.turns).max(axis=-1))
        nothing = np.zeros((1, quaternions.shape[1] - 1))
        return SteppedRotation(
            interpolant=self.interpolant,
            momentum=np.zeros((1, 3)),
            steps=self.steps,
            quaternions=quaternions,
            directions=np.empty((1, 0, 3)),
            turns=nothing,
            dynamics=nothing,
            sampling_error=self.perturbed.hidden + sampling,
            stepping_error=_SAFETY_FACTOR * stepping,
            rounding_error=committed_rounding(quaternions),
            amplification=np.ones(1),
            perturbed=self.perturbed,
        )

    @property
    def is_without_wheels(self) -> bool:
        """True where all of the motion's drift is that of the shape."""
        return self.interpolant is self.motion.interpolant

    def drift_of_wheels(self, times: Array) -> Array:
        """I^-1 h, with h the momentum that wheels store: (N,) -> (N, 3), body axes [rad/s]."""
        if self.is_without_wheels:
            return np.zeros((len(times), 3))
        return self.motion.interpolant.inverse_and_drift(times)[1] - self.interpolant.inverse_and_drift(times)[1]


def lift_along(rotation: SteppedRotation, wheels: Callable[[Array], Array] | None = None) -> Lift:
    """The lift of a motion, in steps with small errors beside the motion's.

    `wheels` : the momentum that wheels store, (N,) [s] -> (N, 3) [kg m^2/s], which is no part of the shape's drift
    """
    interpolant, perturbed = rotation.interpolant, rotation.perturbed
    if wheels is not None:
        by_wheels = _drift_by(wheels, interpolant)
        interpolant = replace(interpolant, coefficients=_less(interpolant.coefficients, by_wheels))
        perturbed = Perturbed(_less(perturbed.coefficients, by_wheels), perturbed.hidden)
    series = interpolant.coefficients
    is_motion, times_finer = _is_at_rest(rotation) and wheels is None, 1
    quaternions = rotation.quaternions[:1] if is_motion else _alone(interpolant, series, rotation.steps)
    finer = _alone(interpolant, series, 2 * rotation.steps)
    tolerance = np.inf if is_motion else max(_SHARE * float(np.min(rotation.error_estimate)), _ROUNDING)
    for _ in range(_MOST_HALVINGS):
        if _SAFETY_FACTOR * float(largest_angle(quaternions, finer[:, ::2])[0]) <= tolerance:
            break
        times_finer *= 2
        quaternions, finer = finer, _alone(interpolant, series, 2 * times_finer * rotation.steps)
    ends = times_finer * np.arange(rotation.quaternions.shape[1])
    return Lift(rotation, interpolant, perturbed, times_finer * rotation.steps, quaternions, finer, ends)


def _alone(interpolant: Interpolant, series: Array, steps: Integers) -> Array:
    """Attitudes by the shape alone: (1, K + 1, 4)."""
    return stepped_quaternions(interpolant, series, steps, np.zeros((1, 3)))


def _drift_by(wheels: Callable[[Array], Array], interpolant: Interpolant) -> Array:
    """Coefficients of I^-1 h on the panels of the first loop: (P, n, 3)."""
    panels, count = interpolant.coefficients.shape[:2]
    left, right = interpolant.edges[:panels], interpolant.edges[1 : panels + 1]
    first, last = inside(left, right)
    # Twice as many degrees: what the product of two series has beyond them is cut off, not folded back.
    times = np.clip(nodes_on(left, right, 2 * count), first[:, None], last[:, None])
    inverse, _ = interpolant.inverse_and_drift(times.ravel())
    values = so3.apply(inverse, wheels(times.ravel())).reshape(*times.shape, 3)
    return (values_to_coefficients(2 * count) @ values)[:, :count]


def _less(coefficients: Array, drift: Array) -> Array:
    """The nine channels without a part of the drift: (P, n, 9), (P, n, 3) -> (P, n, 9)."""
    remaining = coefficients.copy()
    remaining[:, :, 6:] -= drift
    return remaining


def _is_at_rest(rotation: SteppedRotation) -> bool:
    return not rotation.directions.shape[1]


def error_turns(rotation: SteppedRotation, lift: Lift) -> Array:
    """Small turns from attitudes at the ends of steps to better ones, S exp(hat(turn)), body axes: (2, B, K + 1, 3).

    First to those by twice as many steps, then to those on the perturbed series [rad].
    """
    if _is_at_rest(rotation):
        return np.broadcast_to(lift.turns, (2, len(rotation.momentum), *lift.turns.shape[2:]))
    interpolant, perturbed = rotation.interpolant, rotation.perturbed
    finer = stepped_quaternions(interpolant, interpolant.coefficients, 2 * rotation.steps, rotation.momentum)
    other = stepped_quaternions(interpolant, perturbed.coefficients, rotation.steps, rotation.momentum)
    return small_turns(rotation.quaternions, np.stack([finer[:, ::2], other]))
