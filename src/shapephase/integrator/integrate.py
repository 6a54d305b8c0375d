"""From sampled I^-1 and I^-1 L_o to rotations: the one integrator of the library.

The deformation is sampled first (`sampling`), without regard to the rotation; then the attitude equation is
stepped on the interpolant, as finely as the rotation needs. Errors are measured: by steps twice as long, without
momentum half as long, and by steps on series with errors like those they probably have. The linearised equation,
integrated along with it, shows how rounding grows.
"""

from __future__ import annotations

from functools import cached_property
from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np

from ..arguments import LOOSEST_TOLERANCE
from ..arrays import Array, Integers
from ..errors import AccuracyNotReached
from ._error_propagator import exact_propagators, growth_and_rounding, largest_growth, looked_at_closely
from ._last_terms import Perturbed
from ._measured_rounding import measured_rounding
from ._step_control import StepRequirements
from ._step_loop import integrate_steps, integrate_steps_at_rest, stage_channels
from .fast import engine
from .fast.estimate_constants import (
    DENSE_SHARE,
    EXPECTED_GROWTH,
    INFORMATIVE_ERROR,
    LEAST_NOISE,
    LITTLE_ROUNDING,
    MANY_STEPS,
    MOST_EXPECTED_GROWTH,
    MOST_SAMPLING,
    MOST_STEPPING,
    NEGLIGIBLE,
    NOISE_OF_SERIES,
    REFINED,
)
from .fast.rounds import Round, rounds_of_one
from .interpolant import Interpolant
from .sampling import Sampler
from .step_record import StepRecord
from .stepped import SteppedRotation, for_whole_batch

# Steps of one motion: some ten seconds, and a gigabyte of results.
_MOST_STEPS = 4_000_000
# Rounds of refinement; most motions need one.
_MOST_ROUNDS = 12
# Of the tolerance, for what the samplers say of themselves at first; it is ten to a hundred times the truth.
_SAMPLING_SHARE = 0.3
# Amplification that the first plan allows for; what grows more is seen when it is there.
_MOST_FORESEEN = 1e4
# Of the tolerance: with more rounding than this no refinement reaches it.
_MOST_ROUNDING = 0.9
# Times the error of the samples: rounding that the last terms of their series show.
_SHOWN_ROUNDING = 30.0
# How many times it may be overrated before that: the most noise of series that is allowed for, over the least.
_MOST_OVERRATED = NOISE_OF_SERIES / LEAST_NOISE


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


class Refinement(NamedTuple):
    """What earlier rounds found out: how much finer samples and steps must be, and how errors grow."""

    sampling_target: float  # for what the sampler says of itself [rad]
    finer: float = 1.0  # steps, than they were planned at first
    amplified: float | None = None  # errors; None: not known yet

    @classmethod
    def at_first(cls, tolerance: float) -> Refinement:
        """Before the first round."""
        return cls(_SAMPLING_SHARE * tolerance)


class Errors(NamedTuple):
    """What a round of steps came to, for one momentum or for the worst of several [rad]."""

    estimate: float  # of all that follows
    sampling: float
    stepping: float
    rounding: float
    amplification: float
    distance: float  # of the steps from those beside them
    order: float  # by which the error of steps falls
    rounded_up: float  # how many more steps were taken than planned, since they are whole

    @property
    def are_informative(self) -> bool:
        """Whether they show how errors grow; steps that are still far too long do not."""
        return self.distance < INFORMATIVE_ERROR and isfinite(self.amplification)


class Attempt(NamedTuple):
    """One round of steps with its error estimates."""

    rotation: SteppedRotation
    taken: Round

    @property
    def _errors(self) -> list[Array]:
        it = self.rotation
        parts = [it.sampling_error, it.stepping_error, it.rounding_error, it.amplification]
        return [it.error_estimate, *parts, self.taken.distances]

    @property
    def _of_all(self) -> dict[str, float]:
        return {"order": self.taken.defects.order, "rounded_up": self.taken.rounded_up}

    @property
    def worst(self) -> Errors:
        """The largest of all momenta."""
        return Errors(*(float(part.max(initial=0.0)) for part in self._errors), **self._of_all)

    def errors(self, rows: Integers) -> list[Errors]:
        """Of some momenta."""
        each = zip(*(part[rows].tolist() for part in self._errors), strict=True)
        return [Errors(*row, **self._of_all) for row in each]


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
        number, best = 0, np.inf
        while True:
            attempt = self.attempt()
            worst = attempt.worst
            if worst.estimate <= self._tolerance:
                return for_whole_batch(attempt.rotation, self._momentum)
            number += 1
            self.check_progress(worst, number, best)
            best = min(best, worst.estimate)
            self._refinement = self.refined(worst)

    def check_progress(self, errors: Errors, number: int, best: float) -> None:
        """Raise AccuracyNotReached after so many rounds, of which the best had this estimate, if more will not help."""
        if self._too_rough is not None:
            raise self._too_rough
        # Finer steps and samples that bring nothing: what is left is rounding. At first they may still be too long to.
        stuck = number > 4 and errors.estimate > 0.9 * best
        # Or rounding alone takes up the tolerance, by samples so dense that they show it.
        hopeless = errors.rounding > max(_MOST_ROUNDING * self._tolerance, errors.sampling) and (
            errors.rounding > _SHOWN_ROUNDING * errors.sampling or errors.rounding > _MOST_OVERRATED * self._tolerance
        )
        if number == _MOST_ROUNDS or (errors.are_informative and (stuck or hopeless)):
            raise _not_reached(self._tolerance, errors)

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
            if self._refinement.amplified is None:
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
        growth = self._refinement.amplified or MOST_EXPECTED_GROWTH
        counts = growth * expected > NEGLIGIBLE * self._tolerance
        of_last = np.array([self._refinement.finer, self._refinement.amplified or np.inf])
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
        finer, amplified = of_last.tolist()
        self._refinement = Refinement(
            self._refinement.sampling_target, finer, amplified if isfinite(amplified) else None
        )
        little = LITTLE_ROUNDING * self._tolerance
        record = found.record
        closely = looked_at_closely(found.rounding, record.propagators, record.quaternions, little)
        found.rounding = self._measured_rounding(closely, interpolant, found.steps, record)
        return found

    def _round(self, interpolant: Interpolant, perturbed: Perturbed, expected: float) -> Round:
        """Plan the steps and take them; how errors grow, and whether those of the samples were measured."""
        requirements = StepRequirements.from_interpolant(interpolant, self._largest, self._tolerance)
        growth = self._refinement.amplified
        if growth is None:
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
        return measured_rounding(bound, interpolant, steps, record, self._magnitudes, self._tolerance)

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

    def refined(self, errors: Errors) -> Refinement:
        """Finer steps and samples for the next round."""
        target, finer, growth = self._refinement
        # What the polynomials between the ends of steps may add is not theirs to take.
        room = max(self._tolerance / (1.0 + DENSE_SHARE) - errors.rounding, 0.1 * self._tolerance)
        if errors.stepping > MOST_STEPPING * room:
            shorter = (errors.stepping / (REFINED * room)) ** (1.0 / errors.order)
            # So much finer that steps are more, too.
            finer *= min(max(shorter, 1.1, 1.02 * errors.rounded_up), 4.0)
        if errors.are_informative:
            growth = errors.amplification
            if errors.sampling > MOST_SAMPLING * room:
                target = min(target, self._sampler.error(self._largest) * REFINED * room / errors.sampling)
        return Refinement(target, finer, growth)


def _too_many_steps(count: float, turn: float, interpolant: Interpolant) -> AccuracyNotReached:
    """The error of a motion that would take more steps than are taken, raised before any memory is."""
    turns = turn / (2.0 * np.pi)
    return AccuracyNotReached(
        f"the body turns up to {turns:.3g} times in {interpolant.edges[-1]:.6g} s, which takes some {count:.3g} steps; "
        f"at most {_MOST_STEPS} are taken, enough for about {turns * _MOST_STEPS / count:.3g} turns: shorten the "
        "motion, or lower the momentum"
    )


def _not_reached(tolerance: float, last: Errors) -> AccuracyNotReached:
    return AccuracyNotReached(
        f"the tolerance {tolerance:.3g} rad was not reached: the estimate is {last.estimate:.3g} rad, of "
        f"which sampling {last.sampling:.3g}, stepping {last.stepping:.3g} and rounding {last.rounding:.3g}, with "
        f"errors amplified {last.amplification:.3g} times; loosen the tolerance or shorten the motion"
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
