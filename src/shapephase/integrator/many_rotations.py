"""Many momenta on one deformation, each with the samples and steps that it would have alone.

Momenta are put into classes by their magnitude, and what a class needs is planned for its ceiling, also for one
momentum alone. Those of a class share samples and steps as long as they need the same. Where the estimate of some is
above the tolerance, they go on with refinements of their own, which are rounded up so that many share them again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .. import run_progress
from ..arrays import Array, Integers
from ..errors import AccuracyNotReached, SingularInertiaError
from .integrate import Progress, Refinement, one_round
from .interpolant import Interpolant
from .sampling import Sampler
from .stepped import SteppedRotation, for_whole_batch, of_rows
from .stepping import magnitudes_and_directions

_MOST_KEPT = 1_000_000_000  # numbers of the series of a family: eight gigabytes
CLASSES = 4  # of magnitudes in each factor of two: finer ones are more, coarser ones take more steps than needed


class RotationPart(NamedTuple):
    """Some rows of a batch that share samples and steps."""

    rows: Integers
    rotation: SteppedRotation


@dataclass(frozen=True, eq=False)
class GroupedRotations:
    """S(t) for a batch of momenta whose samples and steps differ; in the parts every row is once.

    parts : ordered by the largest momentum, which comes last
    evaluations : how many times the deformation was evaluated
    """

    parts: tuple[RotationPart, ...]
    evaluations: int

    @property
    def count(self) -> int:
        """B, the number of rows."""
        return sum(len(part.rows) for part in self.parts)

    @property
    def finest(self) -> SteppedRotation:
        """The part of the largest momentum."""
        return self.parts[-1].rotation

    @property
    def interpolant(self) -> Interpolant:
        """The deformation as it was sampled for the largest momentum."""
        return self.finest.interpolant

    @property
    def times(self) -> Array:
        """The ends of all steps: (K + 1,) [s]."""
        return np.unique(np.concatenate([part.rotation.times for part in self.parts]))

    @property
    def error_estimate(self) -> Array:
        """Estimates of the largest attitude errors: (B,) [rad]."""
        return self._assembled(lambda rotation: rotation.error_estimate)

    @property
    def amplification(self) -> Array:
        """Largest growths of an attitude error from one time to a later one: (B,)."""
        return self._assembled(lambda rotation: rotation.amplification)

    @property
    def end(self) -> Array:
        """S at the end of the interval: (B, 3, 3)."""
        return self._assembled(lambda rotation: rotation.end)

    @property
    def momentum_slope(self) -> Array:
        """`SteppedRotation.momentum_slope` of all rows: (B, 3, 3)."""
        return self._assembled(lambda rotation: rotation.momentum_slope)

    def rotation(self, t: Array) -> Array:
        """S(t): (N,) -> (B, N, 3, 3)."""
        return self._assembled(lambda rotation: rotation.rotation(t))

    def dynamic_phase(self, t: Array) -> Array:
        """`SteppedRotation.dynamic_phase` of all rows: (N,) -> (B, N) [rad]."""
        return self._assembled(lambda rotation: rotation.dynamic_phase(t))

    def solid_angle(self, t: Array) -> Array:
        """`SteppedRotation.solid_angle` of all rows: (N,) -> (B, N) [sr]."""
        return self._assembled(lambda rotation: rotation.solid_angle(t))

    def _assembled(self, of_part: Callable[[SteppedRotation], Array]) -> Array:
        return assembled([(part.rows, of_part(part.rotation)) for part in self.parts])


def assembled(parts: list[tuple[Integers, Array]]) -> Array:
    """The rows of parts in one array: (n, ...) each -> (B, ...)."""
    first = parts[0][1]
    whole = np.empty((sum(len(rows) for rows, _ in parts), *first.shape[1:]), dtype=first.dtype)
    for rows, values in parts:
        whole[rows] = values
    return whole


class _Group(NamedTuple):
    """Momenta of one class that need the same refinement."""

    rows: Integers
    ceiling: float  # of their magnitudes [kg m^2/s]
    refinement: Refinement
    progress: tuple[Progress, ...]  # of each row


def rotations_of_each(
    sampler: Sampler, momentum: Array, tolerance: float, *, threads: int | None = None
) -> SteppedRotation | GroupedRotations:
    """Integrate the attitude equation for each momentum (B, 3) [kg m^2/s] as if it were alone, to a tolerance [rad].

    Machine code uses so many threads at most; None: one for each processor. Results do not depend on it. Raises
    AccuracyNotReached if an estimate stays above the tolerance; in a batch the message has its row.
    """
    magnitudes, _ = magnitudes_and_directions(momentum)
    ceilings = rounded_up(magnitudes, CLASSES)
    parts: list[RotationPart] = []
    for ceiling in sorted(set(ceilings.tolist())) or (0.0,):
        rows = (ceilings == ceiling).nonzero()[0]
        first = Progress()
        waiting = [_Group(rows, ceiling, first.refinement, (first,) * max(len(rows), 1))]
        while waiting:
            finished, further = _integrated(sampler, waiting.pop(), momentum, tolerance, threads)
            parts += finished
            waiting += further
    if len(parts) == 1:
        return parts[0].rotation
    return GroupedRotations(tuple(parts), sampler.evaluations)


def rotations_of_variants(
    samplers: Iterable[Sampler], momentum: Array, tolerance: float
) -> tuple[SteppedRotation, ...]:
    """Integrate the attitude equation of N deformations for one momentum (N, 3) [kg m^2/s] each, to a tolerance [rad].

    Raises AccuracyNotReached and SingularInertiaError where one deformation alone would; the message has its number.
    """
    count, rotations = len(momentum), []
    run_progress.begin(run_progress.STEPPING, max(count, 1))
    for row, sampler in enumerate(samplers):
        try:
            rotation = rotations_of_each(sampler, momentum[row : row + 1], tolerance)
        except (AccuracyNotReached, SingularInertiaError) as error:
            raise type(error)(f"body {row} of {count}: {error}") from error
        assert isinstance(rotation, SteppedRotation)
        rotations.append(rotation)
        if count * rotation.interpolant.coefficients.size > _MOST_KEPT:
            raise AccuracyNotReached(
                f"{count} motions on some {len(rotation.interpolant.coefficients)} panels each take too much memory; "
                "take slices of the family"
            )
        run_progress.advance(1)
    return tuple(rotations)


def _integrated(
    sampler: Sampler, group: _Group, momentum: Array, tolerance: float, threads: int | None
) -> tuple[list[RotationPart], list[_Group]]:
    """One round for a group: rows that are within the tolerance, and groups that need another round."""
    rows, starts = group.rows, momentum[group.rows]
    try:
        # Without momentum all turn alike.
        different = starts if group.ceiling else np.zeros((1, 3))
        rotation, level = one_round(sampler, different, tolerance, group.ceiling, group.refinement, threads)
    except AccuracyNotReached as error:
        raise _of_row(error, rows[:1], len(momentum)) from error
    done = rotation.error_estimate <= tolerance
    if done.all():
        return [RotationPart(rows, for_whole_batch(rotation, starts))], []
    together: dict[Refinement, list[tuple[int, Progress]]] = {}
    for place in np.flatnonzero(~done).tolist():
        try:
            progress = group.progress[place].after(rotation, place, tolerance, level)
        except AccuracyNotReached as error:
            raise _of_row(error, rows[place : place + 1], len(momentum)) from error
        together.setdefault(progress.refinement, []).append((place, progress))
    further = [
        group._replace(
            rows=rows[[place for place, _ in members]] if group.ceiling else rows,
            refinement=refinement,
            progress=tuple(progress for _, progress in members),
        )
        for refinement, members in together.items()
    ]
    passed = np.flatnonzero(done)
    return [RotationPart(rows[passed], of_rows(rotation, passed))] if len(passed) else [], further


def rounded_up(numbers: Array, steps: int) -> Array:
    """Numbers rounded up to the next of `steps` geometric steps in each factor of two; zero stays zero."""
    mantissa, exponent = np.frexp(numbers)
    marks = 2.0 ** (np.arange(-steps, 1) / steps)
    return np.where(numbers == 0.0, 0.0, np.ldexp(marks[np.searchsorted(marks, mantissa)], exponent))


def _of_row(error: AccuracyNotReached, row: Integers, count: int) -> AccuracyNotReached:
    """The error with the row (1,) of the momentum in its message, if there are several."""
    return error if count <= 1 else AccuracyNotReached(f"momentum {row[0]} of {count}: {error}")
