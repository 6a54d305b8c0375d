"""Many momenta on one deformation, each with the samples and steps that it would have alone.

Momenta are put into classes by their magnitude, and what a class needs is planned for its ceiling, also for one
momentum alone. Those of a class share samples and steps as long as they need the same. Where the estimate of some is
above the tolerance, they go on with refinements of their own, which are rounded up so that many share them again.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from math import frexp, ldexp
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Integers
from ..errors import AccuracyNotReached
from ._refinement import Refinement, Refinements
from .fast.rounds import STEPS_OF_FINER, STEPS_OF_OTHERS, marks_between
from .integrate import Attempt, Integration, norms
from .interpolant import Interpolant
from .sampling import Sampler, Samplers
from .stepped import SteppedRotation, for_whole_batch, of_rows

# Classes of magnitudes in each factor of two: finer ones are more, coarser ones take more steps than needed.
_CLASSES = 4
# From here on a growth of errors is not told from any larger one.
_MOST_GROWTH = 1e30


class RotationPart(NamedTuple):
    """Some rows of a batch that share samples and steps."""

    rows: Integers
    rotation: SteppedRotation


@dataclass(frozen=True, eq=False)
class GroupedRotations:
    """S(t) for a batch of momenta whose samples and steps differ; in the parts every row is once.

    Attributes
    ----------
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
        """As of `SteppedRotation`: (B,) [rad]."""
        return self._assembled(lambda rotation: rotation.error_estimate)

    @property
    def amplification(self) -> Array:
        """As of `SteppedRotation`: (B,)."""
        return self._assembled(lambda rotation: rotation.amplification)

    @property
    def end(self) -> Array:
        """S at the end of the interval: (B, 3, 3)."""
        return self._assembled(lambda rotation: rotation.end)

    @property
    def momentum_slope(self) -> Array:
        """As of `SteppedRotation`: (B, 3, 3)."""
        return self._assembled(lambda rotation: rotation.momentum_slope)

    def rotation(self, t: Array) -> Array:
        """S(t): (N,) -> (B, N, 3, 3)."""
        return self._assembled(lambda rotation: rotation.rotation(t))

    def dynamic_phase(self, t: Array) -> Array:
        """As of `SteppedRotation`: (N,) -> (B, N) [rad]."""
        return self._assembled(lambda rotation: rotation.dynamic_phase(t))

    def solid_angle(self, t: Array) -> Array:
        """As of `SteppedRotation`: (N,) -> (B, N) [sr]."""
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
    """Momenta that have come to the same refinements."""

    rows: Integers
    best: Array  # (n,) the lowest estimate so far [rad]
    ceiling: float  # of their magnitudes [kg m^2/s]
    history: tuple[Refinement, ...]  # of all rounds, the one to come included
    sampler: Sampler | None  # after the rounds before; None: they have to be gone through again


def rotations_of_each(
    samplers: Samplers, momentum: Array, tolerance: float, *, threads: int | None = None
) -> SteppedRotation | GroupedRotations:
    """Integrate the attitude equation for each momentum as if it were alone.

    Parameters
    ----------
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    tolerance : of every attitude over the whole interval [rad]
    threads : at most, in machine code; None: one for each processor. Results do not depend on it

    Raises
    ------
    AccuracyNotReached
        If an estimate stays above the tolerance; in a batch the message has its row.
    """
    ceilings = rounded_up(norms(momentum), _CLASSES)
    parts: list[RotationPart] = []
    for ceiling in sorted(set(ceilings.tolist())) or (0.0,):
        rows = (ceilings == ceiling).nonzero()[0]
        first = Refinement.at_first(tolerance)
        waiting = [_Group(rows, np.full(max(len(rows), 1), np.inf), ceiling, (first,), None)]
        while waiting:
            found, further = _integrated(samplers, waiting.pop(), momentum, tolerance, threads)
            parts += found
            waiting += further
    if len(parts) == 1:
        return parts[0].rotation
    return GroupedRotations(tuple(parts), samplers.evaluations)


def _integrated(
    samplers: Samplers, group: _Group, momentum: Array, tolerance: float, threads: int | None
) -> tuple[list[RotationPart], list[_Group]]:
    """One round for a group: the rows that are within the tolerance now, and those that have to go on."""
    rows, starts = group.rows, momentum[group.rows]
    sampler = group.sampler or _after(samplers, group)
    integration = Integration(
        sampler,
        starts if group.ceiling else starts[:1],
        tolerance,
        ceiling=group.ceiling,
        threads=threads,
        refinement=group.history[-1],
    )
    try:
        if len(rows) > 1 and integration.is_long:
            # Each by the growth of its own errors.
            return [], [group._replace(rows=rows[k : k + 1], best=group.best[k : k + 1]) for k in range(len(rows))]
        attempt = integration.attempt()
        estimates = attempt.rotation.error_estimate
        done = estimates <= tolerance
        if done.any():
            integration.compare_with_body()
    except AccuracyNotReached as error:
        raise _of_row(error, rows[:1], len(momentum)) from error
    if np.count_nonzero(done) == len(done):
        return [RotationPart(rows, for_whole_batch(attempt.rotation, starts))], []
    failed, found = np.flatnonzero(~done), []
    if len(failed) < len(estimates):
        passed = np.flatnonzero(done)
        found.append(RotationPart(rows[passed], of_rows(attempt.rotation, passed, threads)))
    return found, list(_further(group, integration, sampler, attempt, failed, len(momentum)))


def _further(
    group: _Group, integration: Integration, sampler: Sampler, attempt: Attempt, failed: Integers, count: int
) -> Iterator[_Group]:
    """Rows that failed, by the refinements that they need."""
    at_rest, errors, best = not group.ceiling, attempt.errors.of(failed), group.best[failed]
    if (lost := integration.first_lost(errors, len(group.history), best)) is not None:
        place, error = lost
        raise _of_row(error, group.rows[failed[place : place + 1]], count)
    together: dict[Refinement, list[int]] = {}
    refinements = _rounded(integration.refined(errors), group.history[-1], integration.harmless_growth)
    for place, refinement in enumerate(refinements.each()):
        if refinement == group.history[-1]:
            # The next round would be the same.
            raise _of_row(integration.not_reached(errors, place), group.rows[failed[place : place + 1]], count)
        together.setdefault(refinement, []).append(place)
    best = np.minimum(best, errors.estimate)
    for refinement, members in together.items():
        rows = group.rows if at_rest else group.rows[failed[members]]
        estimates = np.full(max(len(rows), 1), best[0]) if at_rest else best[members]
        history = (*group.history, refinement)
        # Where all go on together the sampler goes with them.
        yield _Group(rows, estimates, group.ceiling, history, sampler if len(together) == 1 else None)


def _after(samplers: Samplers, group: _Group) -> Sampler:
    """A sampler after the rounds of a group but the one to come."""
    sampler = samplers.fresh()
    for refinement in group.history[:-1]:
        sampler.refine(group.ceiling, refinement.sampling_target)
    return sampler


def _rounded(refinements: Refinements, last: Refinement, harmless: float) -> Refinements:
    """What is stricter than in the last round is made stricter by little more, so that many are the same.

    `harmless` : growth of errors up to which samples as they are will do: there one is as good as another
    """
    target, finer, amplified = refinements
    same = target == last.sampling_target
    grown = rounded_up(np.minimum(amplified, _MOST_GROWTH), STEPS_OF_OTHERS)
    grown[same & (grown <= harmless)] = 1.0
    return Refinements(
        np.where(same, target, 1.0 / rounded_up(1.0 / target, STEPS_OF_OTHERS)),
        rounded_up(finer, STEPS_OF_FINER),
        np.where(np.isinf(amplified), np.inf, grown),
    )


def _up(number: float, steps: int) -> float:
    """As `rounded_up`, of one number."""
    mantissa, exponent = frexp(number)
    marks = _listed_marks(steps)
    return ldexp(marks[bisect_left(marks, mantissa)], exponent)


@lru_cache(maxsize=4)
def _listed_marks(steps: int) -> list[float]:
    return marks_between(steps).tolist()


def rounded_up(numbers: Array, steps: int) -> Array:
    """To the next of `steps` geometric steps in each factor of two, exactly alike for equal numbers; zero is zero."""
    if len(numbers) == 1:
        return np.array([_up(float(numbers[0]), steps) if numbers[0] else 0.0])
    mantissa, exponent = np.frexp(numbers)
    marks = marks_between(steps)
    return np.where(numbers == 0.0, 0.0, np.ldexp(marks[np.searchsorted(marks, mantissa) % len(marks)], exponent))


def _of_row(error: AccuracyNotReached, row: Integers, count: int) -> AccuracyNotReached:
    """`row` : the row in an array, or none."""
    return error if count <= 1 else AccuracyNotReached(f"momentum {row[0]} of {count}: {error}")
