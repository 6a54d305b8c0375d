"""Methods of reconstruction: steps on a spectral interpolant, and SciPy's DOP853."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from ..arrays import Array
from ..deformation.deformation import Deformation
from ..display import frozen
from ..errors import TrajectoryError
from ..integrator.driven_attitude import DrivenAttitude, dop853_attitude
from ..integrator.many_rotations import rotations_of_each

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
        """Estimate of the largest attitude error: (B,) [rad]."""
        ...

    def rotation(self, t: Array, /) -> Array:
        """S(t): times (N,) -> (B, N, 3, 3)."""
        ...


@frozen
class Dop853Rotation:
    """Attitude relative to the start by SciPy's integrator, for a batch.

    turns : one for each motion of the batch
    times : (K + 1,) ends of the steps of all [s]
    """

    turns: tuple[DrivenAttitude, ...]
    times: Array

    @property
    def error_estimate(self) -> Array:
        """Estimate of the largest attitude error: (B,) [rad]."""
        return np.array([turn.attitude_errors[-1] for turn in self.turns])

    def rotation(self, t: Array) -> Array:
        """S(t): times (N,) -> (B, N, 3, 3)."""
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
