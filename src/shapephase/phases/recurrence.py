"""When the body momentum of a motion comes back to its start.

For shapes that close, `return_map` finds the motions that close with them; here is one motion of any body, rigid ones
included. The curve is that of u = Pi/|Pi| on the unit sphere, with u' = u x omega.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arguments import check_object
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import AccuracyNotReached, ShapeError
from ..integrator.interpolant import Interpolant
from ..letters import value_text
from ..reconstruction.reconstruction import Motion

_LONGEST = 0.05  # [rad] length of a piece of the curve: no return of a smooth curve is within one
_BENT = 0.3  # [rad] turn of a piece
_TOO_SHORT = 1e-6  # [rad] shorter pieces are not divided for their bend: near a cusp the heading turns at once
_MOST_PIECES = 500_000  # for memory: a curve with more is refused


@dataclass(frozen=True, eq=False)
class Returns:
    """When the momentum's direction is nearest its start again. Made by `momentum_returns`.

    Attributes
    ----------
    times : (n,) ascending, above 0 [s]
    gaps : (n,) angle to the start then [rad]
    """

    times: Array
    gaps: Array

    __repr__ = short_repr


def momentum_returns(motion: Motion, gap: float = 0.1) -> Returns:
    """The times at which the direction of the body momentum is nearest its start, when it comes back that far.

    The local minima of the angle to the start, below `gap`, to rounding (of a motion known to its error estimate);
    the end of the motion counts when the direction is still coming nearer there. For a rigid body the first minimum
    of no angle is the period. Minima not deeper than the motion's error are none, so a steady turn has no returns;
    dips of less than about a thousandth of a radian in a smooth approach may be passed over.

    Source: theory.md section 6 and D12.

    Parameters
    ----------
    gap : above 0, up to pi [rad]

    Raises
    ------
    ShapeError
        If the motion is a batch or has no momentum.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 2.5 * top.period), [0.6, 0.9, 0.5])
    >>> (sp.momentum_returns(motion).times / top.period).round(6).tolist()
    [1.0, 2.0]
    """
    check_object(motion, "Motion", "motion")
    largest = finite_array(gap, "gap", unit="rad")
    if largest.ndim or not 0.0 < largest <= np.pi:
        raise ShapeError(f"gap: an angle above 0, up to pi [rad] is needed, got {value_text(gap)}")
    curve = _Curve.of(motion)
    times = _resolved(curve, motion)
    directions, rates = curve.at(times)
    start = directions[0]
    nearing = rates @ start
    away = so3.angle_between(directions, start)
    begins = np.flatnonzero((nearing[1:-1] > 0.0) & (nearing[2:] <= 0.0)) + 1
    low, high = times[begins], times[begins + 1]
    for _ in range(60):
        middle = 0.5 * (low + high)
        still = curve.at(middle)[1] @ start > 0.0
        low, high = np.where(still, middle, low), np.where(still, high, middle)
    nearest, ends = 0.5 * (low + high), begins
    if nearing[-1] > 0.0:
        nearest, ends = np.append(nearest, times[-1]), np.append(ends, len(times) - 1)
    gaps = so3.angle_between(curve.at(nearest)[0], start)
    noise = 1e-12 + 10.0 * float(motion.error_estimate)
    chosen, last = [], 0
    for row, end in enumerate(ends):
        if away[last : end + 1].max() - gaps[row] > noise:
            last = end + 1
            if gaps[row] < largest:
                chosen.append(row)
    return Returns(nearest[chosen], gaps[chosen])


@dataclass(frozen=True)
class _Curve:
    """u(t) and u'(t) of one motion."""

    motion: Motion
    interpolant: Interpolant
    start: Array
    magnitude: float

    @classmethod
    def of(cls, motion: Motion) -> _Curve:
        if motion.batch:
            raise ShapeError(f"one motion is needed, this is a batch of {motion.batch}; reconstruct one of them")
        magnitude = float(np.linalg.norm(motion.momentum))
        if magnitude == 0.0:
            raise ShapeError("a motion without angular momentum has no momentum curve: its direction is undefined")
        return cls(motion, motion.interpolant, motion.initial_attitude.T @ (motion.momentum / magnitude), magnitude)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Directions and their rates: (N,) -> (N, 3), (N, 3)."""
        directions = so3.apply(so3.transpose(self.motion.solution.rotation(times)[0]), self.start)
        inverse, drift = self.interpolant.inverse_and_drift(times)
        return directions, np.cross(directions, so3.apply(inverse, self.magnitude * directions) - drift)


def _resolved(curve: _Curve, motion: Motion) -> Array:
    """Times between which the curve is short and bends little: (K + 1,)."""
    times = motion.solution.times
    times = np.unique(np.concatenate([times, 0.5 * (times[1:] + times[:-1])]))
    directions, rates = curve.at(times)
    shortest = 1e-9 * motion.duration
    while True:
        chord = np.linalg.norm(np.diff(directions, axis=0), axis=-1)
        rough = (chord > _LONGEST) | ((so3.angle_between(rates[:-1], rates[1:]) > _BENT) & (chord > _TOO_SHORT))
        rough &= np.diff(times) > shortest
        if not rough.any():
            return times
        if len(times) + rough.sum() > _MOST_PIECES:
            raise AccuracyNotReached(
                f"the momentum curve needs more than {_MOST_PIECES} pieces (it is rough near t = "
                f"{times[:-1][rough][0]:.9g} s); look at a shorter part of the motion"
            )
        halves = 0.5 * (times[1:] + times[:-1])[rough]
        more, more_rates = curve.at(halves)
        order = np.argsort(np.concatenate([times, halves]))
        times = np.concatenate([times, halves])[order]
        directions = np.concatenate([directions, more])[order]
        rates = np.concatenate([rates, more_rates])[order]
