"""Methods of reconstruction: steps on a spectral interpolant, the closed form of a rigid body, and SciPy's DOP853."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from ..arrays import Array
from ..deformation.deformation import Deformation
from ..deformation.descriptions import RigidDescription
from ..display import frozen
from ..errors import AccuracyNotReached, TrajectoryError, unknown_name
from ..integrator.driven_attitude import DrivenAttitude, dop853_attitude
from ..integrator.many_rotations import rotations_of_each
from ..rigid_body.euler_top import EulerTop

_ROUNDING = 8.0 * float(np.finfo(float).eps)  # rad for each radian turned: eight operations on an angle
_TURN_OF_A_STEP = 0.3  # rad: quadrature by the step is exact to rounding for turns this short
_MOST_STEPS = 10_000_000  # 3 GB of matrices
_MOST_PIECES = 400_000  # intervals between breaks: some five gigabytes of samples


class Solution(Protocol):
    """Attitude relative to the start, S(t), for a batch.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.eye(3), 1.0), [0.0, 0.0, 0.5])
    >>> print(f"{float(np.max(sp.so3.angle(motion.solution.rotation(np.array([1.0]))))):.9f}")
    0.500000000
    """

    @property
    def times(self) -> Array:
        """(K + 1,) times between which the solution is smooth and turns little [s]."""
        ...

    @property
    def error_estimate(self) -> Array:
        """(B,) [rad]."""
        ...

    def rotation(self, t: Array, /) -> Array:
        """(N,) -> (B, N, 3, 3)."""
        ...


@frozen
class RigidRotation:
    """Attitude relative to the start, S(t), of a batch of free rigid bodies.

    Attributes
    ----------
    tops : one for each motion of the batch
    duration : [s]
    turn : upper bound of the angle that a body turns in it [rad]
    error_estimate : (B,) rounding, magnified near a separatrix [rad]
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
                f"a motion of {self.turn:.3g} rad needs more than {_MOST_STEPS} steps; shorten the motion"
            )
        return np.linspace(0.0, self.duration, 2 + int(self.turn / _TURN_OF_A_STEP))

    def rotation(self, t: Array) -> Array:
        """(N,) -> (B, N, 3, 3)."""
        return np.array([top.attitude(t) for top in self.tops]).reshape(len(self.tops), len(t), 3, 3)


def _by_closed_form(
    deformation: Deformation,
    at_start: Array,
    tolerance: float,
    threads: int | None,  # noqa: ARG001
) -> tuple[Solution, int]:
    """Return closed forms. Raises AccuracyNotReached where rounding, magnified near a separatrix, may be too large."""
    description, duration = deformation.description, deformation.duration
    if not isinstance(description, RigidDescription):
        others = [name for name in METHODS if name != "closed_form"]
        raise unknown_name(f"method for what is not made by `rigid` ({deformation.label})", "closed_form", others)
    tops = tuple(EulerTop(description.tensor, row) for row in at_start)
    turn = max((top.magnitude / top.moments[0] for top in tops), default=0.0) * duration
    estimates = np.array([_rounding(top, duration) for top in tops])
    if estimates.max(initial=0.0) > tolerance:
        worst = int(np.argmax(estimates))
        raise AccuracyNotReached(
            f"the closed form is uncertain by {estimates[worst]:.3g} rad where {tolerance:.3g} was requested: rounding "
            f"over {turn / (2.0 * np.pi):.3g} turns, magnified by {tops[worst].condition:.3g} (large next to the "
            "separatrix); loosen the tolerance or shorten the motion"
        )
    return RigidRotation(tops, duration, turn, estimates), 1


def _rounding(top: EulerTop, duration: float) -> float:
    """Rounding of the angles turned; magnified each half period unless axes were exact [rad]."""
    angles = 1.0 + (top.magnitude / top.moments[0] + top.rate) * duration
    exact = np.count_nonzero(top.axes) == 3
    half_periods = 1.0 + 2.0 * duration / top.period
    return _ROUNDING * (angles if exact or not top.rate else angles + top.condition * half_periods)


@frozen
class Dop853Rotation:
    """Attitude relative to the start by SciPy's integrator, for a batch.

    Attributes
    ----------
    turns : one for each motion of the batch
    times : (K + 1,) ends of the steps of all [s]
    """

    turns: tuple[DrivenAttitude, ...]
    times: Array

    @property
    def error_estimate(self) -> Array:
        """(B,) [rad]."""
        return np.array([turn.attitude_errors[-1] for turn in self.turns])

    def rotation(self, t: Array) -> Array:
        """(N,) -> (B, N, 3, 3)."""
        return np.stack([turn.attitude(t) for turn in self.turns])


def _by_interpolant(
    deformation: Deformation, at_start: Array, tolerance: float, threads: int | None
) -> tuple[Solution, int]:
    sampler = deformation.sampler()
    solution = rotations_of_each(sampler, at_start, tolerance, threads=threads)
    return solution, sampler.evaluations


def _by_dop853(
    deformation: Deformation,
    at_start: Array,
    tolerance: float,
    threads: int | None,  # noqa: ARG001
) -> tuple[Solution, int]:
    sample, breaks, limits = deformation.description.sample, deformation.breaks, deformation.step_limits()
    turns = tuple(dop853_attitude(sample, breaks, start, tolerance, limits) for start in at_start)
    times = np.unique(np.concatenate([breaks, *(turn.times for turn in turns)]))
    return Dop853Rotation(turns, times), sum(turn.evaluations for turn in turns)


Solver = Callable[[Deformation, Array, float, int | None], tuple[Solution, int]]
"""Deformation, body momenta at the start (B, 3), tolerance [rad], threads -> solution, number of evaluations."""
SOLVERS: dict[str, Solver] = {
    "auto": _by_interpolant,
    "spectral": _by_interpolant,
    "closed_form": _by_closed_form,
    "dop853": _by_dop853,
}
METHODS = tuple(SOLVERS)


def check_pieces(deformation: Deformation) -> None:
    """Raise TrajectoryError, before any memory is taken, for a recording that is too long."""
    pieces = (len(deformation.declared_breaks) - 1) // deformation.loops
    if pieces > _MOST_PIECES:
        raise TrajectoryError(
            f"the motion has {pieces} intervals between breaks (a recording has one between samples), the limit is "
            f"{_MOST_PIECES}: read the recording with "
            f"resample={_rounded_down(_MOST_PIECES / deformation.duration):g} or less (--resample), or a part of it "
            "with trim= (--flight)"
        )


def _rounded_down(number: float) -> float:
    """Largest number of two digits that is not above `number`."""
    unit = 10.0 ** (math.floor(math.log10(number)) - 1)
    return math.floor(number / unit) * unit
