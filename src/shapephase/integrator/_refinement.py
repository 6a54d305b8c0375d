"""What a round of steps came to for each momentum, and what the next round has to do better."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Integers, Mask
from .fast.estimate_constants import (
    DENSE_SHARE,
    INFORMATIVE_ERROR,
    MOST_SAMPLING,
    MOST_STEPPING,
    REFINED,
)

# Rounds of refinement; most motions need one.
_MOST_ROUNDS = 12
# Of the tolerance, for what the samplers say of themselves at first; it is ten to a hundred times the truth.
_SAMPLING_SHARE = 0.3
# Of the tolerance: with more rounding than this no refinement reaches it.
_MOST_ROUNDING = 0.9
# Times the error of the samples: rounding that the last terms of their series show.
_SHOWN_ROUNDING = 30.0
# How many times it may be overrated before that, by what samples that are too few miss.
_MOST_OVERRATED = 8.0


class Refinement(NamedTuple):
    """What earlier rounds found out: how much finer samples and steps must be, and how errors grow."""

    sampling_target: float  # for what the sampler says of itself [rad]
    finer: float = 1.0  # steps, than they were planned at first
    amplified: float = inf  # errors; infinite: not known yet

    @classmethod
    def at_first(cls, tolerance: float) -> Refinement:
        """Before the first round."""
        return cls(_SAMPLING_SHARE * tolerance)


class Refinements(NamedTuple):
    """The same for each of some momenta: (n,) each."""

    sampling_target: Array
    finer: Array
    amplified: Array

    def each(self) -> list[Refinement]:
        """One by one."""
        return [Refinement(*one) for one in zip(*(part.tolist() for part in self), strict=True)]


class Errors(NamedTuple):
    """What a round of steps came to, for each of some momenta: (n,) [rad]."""

    estimate: Array  # of all that follows
    sampling: Array
    stepping: Array
    rounding: Array
    amplification: Array
    distance: Array  # of the steps from those beside them
    order: float  # by which the error of steps falls
    rounded_up: float  # how many more steps were taken than planned, since they are whole

    @property
    def are_informative(self) -> Mask:
        """Whether they show how errors grow; steps that are still far too long do not."""
        return (self.distance < INFORMATIVE_ERROR) & np.isfinite(self.amplification)

    @property
    def worst(self) -> Errors:
        """The largest of each: (1,)."""
        return self._replace(**{name: part.max(initial=0.0, keepdims=True) for name, part in self._of_momenta})

    def of(self, rows: Integers) -> Errors:
        """Of some of the momenta."""
        return self._replace(**{name: part[rows] for name, part in self._of_momenta})

    @property
    def _of_momenta(self) -> list[tuple[str, Array]]:
        """All but the last two, with their names."""
        return list(zip(self._fields, self[:6], strict=False))

    def are_the_last(self, tolerance: float, number: int, best: Array) -> Mask:
        """Whether more than so many rounds, of which the best had estimates (n,), will not help: (n,)."""
        if number == _MOST_ROUNDS:
            return np.ones(len(best), dtype=bool)
        # Finer steps and samples that bring nothing: what is left is rounding. At first they may still be too long to.
        stuck = (self.estimate > 0.9 * best) & (number > 4)
        # Or rounding alone takes up the tolerance, by samples so dense that they show it.
        shown = (self.rounding > _SHOWN_ROUNDING * self.sampling) | (self.rounding > _MOST_OVERRATED * tolerance)
        hopeless = (self.rounding > np.maximum(_MOST_ROUNDING * tolerance, self.sampling)) & shown
        return self.are_informative & (stuck | hopeless)

    def refined(self, last: Refinement, tolerance: float, expected: float) -> Refinements:
        """Finer steps and samples for the next round, which the samplers say are off by `expected` now [rad]."""
        # What the polynomials between the ends of steps may add is not theirs to take.
        room = np.maximum(tolerance / (1.0 + DENSE_SHARE) - self.rounding, 0.1 * tolerance)
        excess, power = (self.stepping / (REFINED * room)).tolist(), 1.0 / self.order
        # Powers of numbers: those of arrays differ in the last digit from one processor to the other.
        shorter = np.array([one**power for one in excess])
        # So much finer that steps are more, too.
        shorter = np.minimum(np.maximum(shorter, max(1.1, 1.02 * self.rounded_up)), 4.0)
        known = self.are_informative
        coarse = known & (self.sampling > MOST_SAMPLING * room)
        lower = expected * REFINED * room / np.where(coarse, self.sampling, 1.0)
        return Refinements(
            np.where(coarse, np.minimum(last.sampling_target, lower), last.sampling_target),
            np.where(self.stepping > MOST_STEPPING * room, last.finer * shorter, last.finer),
            np.where(known, self.amplification, last.amplified),
        )
