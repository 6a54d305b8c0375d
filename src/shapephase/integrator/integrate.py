"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator of the library.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is
stepped on the interpolant, as finely as the rotation needs. Errors are measured: by steps twice as long, without
momentum half as long, and by steps on series with errors like those they probably have. The linearised equation,
integrated along with it, shows how rounding grows.
"""

from __future__ import annotations

from functools import cached_property
from math import inf, isfinite, sqrt
from typing import NamedTuple

import numpy as np

from ..arguments import LOOSEST_TOLERANCE
from ..arrays import Array, Integers
from ..errors import AccuracyNotReached
from ._last_terms import Perturbed
from ._refinement import Errors, Refinement, Refinements
from .fast import engine
from .fast.estimate_constants import (
    EXPECTED_GROWTH,
    LITTLE_ROUNDING,
    MANY_STEPS,
    MOST_EXPECTED_GROWTH,
    NEGLIGIBLE,
)
from .fast.rounds import Round, rounds_of_one
from .fresh_times import compare, fresh_times
from .interpolant import Interpolant
from .sampling import Sampler
from .stepped import SteppedRotation, for_whole_batch
from .steps.error_propagator import exact_propagators, growth_and_rounding, largest_growth, looked_at_closely
from .steps.measured_rounding import measured_rounding, rounding_of_body
from .steps.stage_channels import stage_channels
from .steps.step_control import StepRequirements
from .steps.step_loop import integrate_steps, integrate_steps_at_rest
from .steps.step_record import StepRecord

# Steps of one motion: some ten seconds, and a gigabyte of results.
_MOST_STEPS = 4_000_000
# Amplification that the first plan allows for; what grows more is seen when it is there.
_MOST_FORESEEN = 1e4


def stepped_rotation(sampler: Sampler, momentum: Array, tolerance: float) -> SteppedRotation:
    """Integrate the attitude equation to a tolerance, sampling the deformation as far as that needs.

    Parameters
    ----------
    momentum : (B, 3) body angular momentum at the start [kg m^2/s]
    tolerance : of the attitude over the whole interval [rad]

    Raises
    ------
    AccuracyNotReached
        If the estimate stays above the tolerance.

    Examples
    --------
    >>> def evaluate(t):
    ...     return np.broadcast_to(np.diag([1.0, 2.0, 2.5]), (len(t), 3, 3)), np.zeros((len(t), 3))
    >>> steady = sp.integrator.sampler(evaluate, np.array([0.0, 1.0]))
    >>> solution = sp.integrator.stepped_rotation(steady, np.array([[0.0, 0.0, 5.0]]), 1e-9)
    >>> print(f"{sp.so3.angle(solution.rotation(np.array([1.0]))[0, 0]):.9f}")
    2.000000000
    """
    ceiling = float(norms(momentum).max(initial=0.0))
    return Integration(sampler, momentum, tolerance, ceiling=ceiling).solution()


def norms(momentum: Array) -> Array:
    """Of vectors (B, 3), each the same whatever the others are: (B,)."""
    if len(momentum) == 1:
        x, y, z = momentum[0].tolist()
        return np.array([sqrt(x * x + y * y + z * z)])
    x, y, z = momentum.T
    return np.sqrt(x * x + y * y + z * z)


class Attempt(NamedTuple):
    """One round of steps with its error estimates."""

    rotation: SteppedRotation
    taken: Round

    @property
    def errors(self) -> Errors:
        """Of each momentum."""
        it, taken = self.rotation, self.taken
        parts = it.error_estimate, it.sampling_error, it.stepping_error, it.rounding_error, it.amplification
        return Errors(*parts, taken.distances, order=taken.defects.order, rounded_up=taken.rounded_up)


class Integration:
    """The attitude equation solved in rounds: sample, plan the steps, take them, estimate the error, refine.

    Parameters
    ----------
    ceiling : samples and steps are made for it, and no momentum is larger [kg m^2/s]
    threads : at most, for many momenta; None: one for each processor
    refinement : from earlier rounds
    """

    def __init__(
        self,
        sampler: Sampler,
        momentum: Array,
        tolerance: float,
        *,
        ceiling: float,
        threads: int | None = None,
        refinement: Refinement | None = None,
    ) -> None:
        self._sampler, self._momentum, self._tolerance = sampler, momentum, tolerance
        self._magnitudes = norms(momentum)
        self._largest, self._threads = ceiling, threads
        self._refinement = refinement or Refinement.at_first(tolerance)
        # How errors grow, where only the derivative of the steps shows it: (B, CHECKPOINTS, 3, 3).
        self._propagators: Array | None = None
        # Why the samples are not as dense as they were to be.
        self._too_rough: AccuracyNotReached | None = None

    def solution(self) -> SteppedRotation:
        """The first attempt whose error estimate is within the tolerance for every momentum."""
        number, best = 0, np.array([np.inf])
        while True:
            attempt = self.attempt()
            worst = attempt.errors.worst
            if worst.estimate <= self._tolerance:
                self.compare_with_body()
                return for_whole_batch(attempt.rotation, self._momentum)
            number += 1
            if (lost := self.first_lost(worst, number, best)) is not None:
                raise lost[1]
            best = np.minimum(best, worst.estimate)
            (self._refinement,) = self.refined(worst).each()

    def compare_with_body(self) -> None:
        """Raise AccuracyNotReached where the interpolant is not the deformation at fresh times."""
        interpolant = self._sampler.interpolant()
        times, _ = fresh_times(interpolant)
        body, joined = self._sampler.body_channels(times), self._sampler.joined_panels()
        compare(interpolant, body, joined, self._largest, self._tolerance)

    def first_lost(self, errors: Errors, number: int, best: Array) -> tuple[int, AccuracyNotReached] | None:
        """The first row that more than so many rounds will not help, and its error; None: there is none.

        `best`: the lowest estimates of all rounds before (n,) [rad]
        """
        if self._too_rough is not None:
            return 0, self._too_rough
        lost = errors.are_the_last(self._tolerance, number, best)
        if not np.count_nonzero(lost):
            return None
        row = int(np.argmax(lost))
        return row, self.not_reached(errors, row)

    def not_reached(self, errors: Errors, row: int) -> AccuracyNotReached:
        """The error of a row that no further round will help."""
        estimate, sampling, stepping, rounding, amplification, *_ = (part[row] for part in errors[:6])
        return AccuracyNotReached(
            f"the tolerance {self._tolerance:.3g} rad was not reached: the estimate is {estimate:.3g} rad, of "
            f"which sampling {sampling:.3g}, stepping {stepping:.3g} and rounding {rounding:.3g}, with "
            f"errors amplified {amplification:.3g} times; loosen the tolerance or shorten the motion"
        )

    @cached_property
    def is_long(self) -> bool:
        """Whether it takes exact error propagators, and a plan of steps for each momentum by its own."""
        self._refine()
        requirements = StepRequirements.from_interpolant(self._sampler.interpolant(), self._largest, self._tolerance)
        return self._is_long(requirements, requirements.loops * float(self._planned(requirements).sum()))

    def _refine(self) -> None:
        """Sample as densely as wanted; in a further round samples that cannot be so dense are tried as they are."""
        try:
            self._sampler.refine(self._largest, self._refinement.sampling_target)
        except AccuracyNotReached as error:
            if not isfinite(self._refinement.amplified):
                raise
            self._too_rough = error

    def _is_long(self, requirements: StepRequirements, count: float) -> bool:
        """Count : of the steps planned."""
        return self._largest > 0.0 and (requirements.very_far or count > MANY_STEPS)

    def attempt(self) -> Attempt:
        """Steps as planned, and the error estimates of the result."""
        self._refine()
        interpolant, perturbed = self._sampler.interpolant(), self._sampler.perturbed(self._largest)
        expected = self._sampler.error(self._largest)
        taken = self._rounds_of_one(interpolant, perturbed, expected) or self._round(interpolant, perturbed, expected)
        record = taken.record
        rotation = SteppedRotation(
            interpolant=interpolant,
            momentum=self._momentum,
            steps=taken.steps,
            quaternions=record.quaternions,
            directions=record.directions,
            turns=record.turns,
            dynamics=record.dynamics,
            sampling_error=taken.sampling,
            stepping_error=taken.stepping,
            rounding_error=taken.rounding,
            amplification=taken.amplification,
            perturbed=perturbed,
        )
        return Attempt(rotation, taken)

    def _rounds_of_one(self, interpolant: Interpolant, perturbed: Perturbed, expected: float) -> Round | None:
        """As `_round`, of one momentum in machine code, in as many rounds as steps alone need; None: not with that."""
        alone = len(self._momentum) == 1 and engine.is_ready()
        if not alone or (self._largest == 0.0 and interpolant.loops > 1):
            return None
        # What is below by any growth that is foreseen is not looked at.
        growth = self._refinement.amplified
        if not isfinite(growth):
            growth = MOST_EXPECTED_GROWTH
        counts = growth * expected > NEGLIGIBLE * self._tolerance
        of_last = np.array(self._refinement[1:])
        found = rounds_of_one(
            interpolant,
            perturbed.coefficients if counts and perturbed.differ else None,
            _directions(self._momentum, self._magnitudes) if self._largest else None,
            self._magnitudes,
            ceiling=self._largest,
            tolerance=self._tolerance,
            expected=expected,
            hidden=perturbed.hidden if counts else None,
            refinement=of_last,
        )
        if found is None:
            return None
        self._refinement = Refinement(self._refinement.sampling_target, *of_last.tolist())
        little = LITTLE_ROUNDING * self._tolerance
        record = found.record
        closely = looked_at_closely(found.rounding, record.propagators, record.quaternions, little)
        found.rounding = self._measured_rounding(closely, interpolant, found.steps, record)
        return found

    def _round(self, interpolant: Interpolant, perturbed: Perturbed, expected: float) -> Round:
        """Plan the steps and take them; how errors grow, and whether those of the samples were measured."""
        requirements = StepRequirements.from_interpolant(interpolant, self._largest, self._tolerance)
        growth = self._refinement.amplified
        if not isfinite(growth):
            turn = requirements.whole_turn if self._largest else 0.0
            growth = min(1.0 + EXPECTED_GROWTH * turn, MOST_EXPECTED_GROWTH)
        counts = expected * growth > NEGLIGIBLE * self._tolerance
        steps, rounded_up = self._plan(interpolant, requirements)
        record = self._take_steps(interpolant, perturbed.coefficients if counts and perturbed.differ else None, steps)
        propagators = record.propagators if self._propagators is None else self._propagators
        little = LITTLE_ROUNDING * self._tolerance
        amplification, bound = growth_and_rounding(propagators, record.quaternions, little, self._threads)
        rounding = self._measured_rounding(bound, interpolant, steps, record)
        sampling = amplification * expected
        if counts:
            sampling = np.fmin(sampling, record.truncation + amplification * perturbed.hidden)
        distances = np.where(np.isfinite(record.stepping), record.stepping, np.pi)
        defects = requirements.defects(steps)
        return Round(
            steps=steps,
            record=record,
            distances=distances,
            amplification=amplification,
            sampling=sampling,
            stepping=requirements.stepping_error(steps, distances, amplification),
            rounding=rounding,
            defects=defects,
            rounded_up=rounded_up,
        )

    def _measured_rounding(self, bound: Array, interpolant: Interpolant, steps: Integers, record: StepRecord) -> Array:
        sample = self._sampler.channels
        marches = measured_rounding(bound, interpolant, steps, record, self._magnitudes, self._tolerance, sample)
        return marches + rounding_of_body(interpolant, steps, record, self._magnitudes)

    def _plan(self, interpolant: Interpolant, requirements: StepRequirements) -> tuple[Integers, float]:
        """Steps on each panel (P,), and how many more they are than planned, since they are whole.

        Finds the growth of errors first where the steps themselves will not show it.
        """
        planned = self._planned(requirements)
        total = sum(planned.tolist())
        count = interpolant.loops * total
        if count > _MOST_STEPS:
            raise _too_many_steps(count, requirements.whole_turn, interpolant)
        if self._is_long(requirements, count):
            if self._propagators is None:
                self._propagators = _propagators_by_derivative(interpolant, self._momentum, self._largest)
            # Errors will be amplified: each must be that much smaller.
            growth = largest_growth(self._propagators)
            worst = float(growth.max(where=np.isfinite(growth), initial=1.0))
            planned = self._planned(requirements, amplified=min(worst, _MOST_FORESEEN))
            total = sum(planned.tolist())
        steps = requirements.whole_steps(planned)
        taken = sum(steps.tolist())
        if (count := interpolant.loops * taken) > _MOST_STEPS:
            raise _too_many_steps(count, requirements.whole_turn, interpolant)
        return steps, taken / total

    def _planned(self, requirements: StepRequirements, *, amplified: float | None = None) -> Array:
        """Steps per panel, not yet whole, short enough for the growth of errors unless that is known: (P,)."""
        short = amplified is None and self._largest > 0.0 and requirements.far
        return self._refinement.finer * requirements.plan(self._tolerance / (amplified or 1.0), short=short)

    def _take_steps(self, interpolant: Interpolant, perturbed: Array | None, steps: Integers) -> StepRecord:
        """All steps of all loops and momenta."""
        if not self._magnitudes.any():
            return integrate_steps_at_rest(interpolant, perturbed, steps)
        directions = _directions(self._momentum, self._magnitudes)
        return integrate_steps(
            interpolant,
            perturbed,
            steps,
            directions,
            self._magnitudes,
            with_propagators=self._propagators is None,
            threads=self._threads,
        )

    @property
    def harmless_growth(self) -> float:
        """Of errors, up to which what the samples miss is not looked at."""
        expected = self._sampler.error(self._largest)
        return NEGLIGIBLE * self._tolerance / expected if expected > 0.0 else inf

    def refined(self, errors: Errors) -> Refinements:
        """Finer steps and samples for the next round."""
        return errors.refined(self._refinement, self._tolerance, self._sampler.error(self._largest))


def _too_many_steps(count: float, turn: float, interpolant: Interpolant) -> AccuracyNotReached:
    """The error of a motion that would take more steps than are taken, raised before any memory is."""
    turns = turn / (2.0 * np.pi)
    return AccuracyNotReached(
        f"the body turns up to {turns:.3g} times in {interpolant.edges[-1]:.6g} s, which takes some {count:.3g} steps; "
        f"at most {_MOST_STEPS} are taken, enough for about {turns * _MOST_STEPS / count:.3g} turns: shorten the "
        "motion, or lower the momentum"
    )


def _propagators_by_derivative(interpolant: Interpolant, momentum: Array, largest: float) -> Array:
    """How errors grow along long motions, by the derivative of coarse steps: (B, CHECKPOINTS, 3, 3).

    Propagators that are only nearly right would drift off over many turns; the steps' own derivative does not.
    """
    magnitudes = norms(momentum)
    requirements = StepRequirements.from_interpolant(interpolant, largest, LOOSEST_TOLERANCE)
    steps = requirements.whole_steps(requirements.plan(LOOSEST_TOLERANCE))
    channels, directions = stage_channels(interpolant, steps), _directions(momentum, magnitudes)
    with np.errstate(all="ignore"):
        return exact_propagators(channels, directions, magnitudes, interpolant.loops)


def _directions(momentum: Array, magnitudes: Array) -> Array:
    """Pi/|Pi|; for a motion without momentum in a batch with it any direction shows the rotation."""
    if len(momentum) == 1 or (moving := magnitudes > 0.0).all():
        return momentum / magnitudes[:, None]
    return np.where(moving[:, None], momentum, [0.0, 0.0, 1.0]) / np.where(moving, magnitudes, 1.0)[:, None]
