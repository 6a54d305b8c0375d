"""The rotation of a rigid deformation in closed form, in the place of an integrator's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..errors import AccuracyNotReached
from ..rigid_body.euler_top import EulerTop

_ROUNDING = 8.0 * float(np.finfo(float).eps)
_TURN_OF_A_STEP = 0.3
_MOST_STEPS = 10_000_000


@dataclass(frozen=True, eq=False)
class RigidRotation:
    """S(t), the attitude relative to the start, of a batch of free rigid bodies.

    Attributes
    ----------
    tops : one for each motion of the batch
    duration : [s]
    turn : the most that a body may turn in it [rad]
    error_estimate : (B,) rounding, and what it grows to near a separatrix [rad]
    """

    tops: tuple[EulerTop, ...]
    duration: float
    turn: float
    error_estimate: Array

    @property
    def times(self) -> Array:
        """(K + 1,) between which no body turns by more than 0.3 rad [s]. Raises AccuracyNotReached for 1e7 or more."""
        if self.turn > _MOST_STEPS * _TURN_OF_A_STEP:
            raise AccuracyNotReached(
                f"{self.turn:.3g} rad in one motion are too many to be followed step by step; shorten the motion"
            )
        return np.linspace(0.0, self.duration, 2 + int(self.turn / _TURN_OF_A_STEP))

    def rotation(self, t: Array) -> Array:
        """(N,) -> (B, N, 3, 3)."""
        return np.array([top.attitude(t) for top in self.tops]).reshape(len(self.tops), len(t), 3, 3)


def rigid_rotation(inertia: Array, momentum: Array, duration: float, tolerance: float) -> RigidRotation:
    """The rotations of a rigid body from these body momenta at the start, (B, 3).

    Raises
    ------
    AccuracyNotReached
        If rounding alone, magnified near a separatrix or over many turns, may exceed the tolerance.
    """
    tops = tuple(EulerTop(inertia, one) for one in momentum)
    turn = max((top.magnitude / top.moments[0] for top in tops), default=0.0) * duration
    estimates = np.array([_rounding(top, duration) for top in tops])
    if estimates.max(initial=0.0) > tolerance:
        worst = int(np.argmax(estimates))
        raise AccuracyNotReached(
            f"the closed form is uncertain by {estimates[worst]:.3g} rad where {tolerance:.3g} was asked: rounding "
            f"over {turn / (2.0 * np.pi):.3g} turns, magnified by {tops[worst].condition:.3g} (large next to the "
            "separatrix); loosen the tolerance or shorten the motion"
        )
    return RigidRotation(tops, duration, turn, estimates)


def _rounding(top: EulerTop, duration: float) -> float:
    """Rounding of the angles turned and, unless moments and momentum came as they are, as each half turn magnifies."""
    angles = 1.0 + (top.magnitude / top.moments[0] + top.rate) * duration
    exact = np.count_nonzero(top.axes) == 3
    half_periods = 1.0 + 2.0 * duration / top.period
    return _ROUNDING * (angles if exact or not top.rate else angles + top.condition * half_periods)
