"""How finely a motion must be stepped: for its accuracy, and for the estimates to mean something."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Integers
from .interpolant import Interpolant

# Of the formula's own estimate: in 60,000 random motions the true error of a step was less than a fourteenth of it
# where the step spanned at most one significant degree of its panel, and mostly less than a hundredth; with more
# degrees the estimate is less reliable in proportion.
_SAFETY_FACTOR = 0.07
# Significant Chebyshev degrees of a panel that one step may span before the estimate is unreliable.
_DEGREES_A_STEP = 3.0
# The same without momentum: the errors of long steps at rest are estimated less well.
_DEGREES_A_STEP_AT_REST = 2.0
# [rad] bound of the turn in one step; it is two or three times the turn itself, and beyond half a radian of that the
# propagator of a step is not known.
_TURN_A_STEP = 1.0
# [rad] the same where the propagator of a step must be right over a long motion without the steps' derivative.
_SHORT_TURN_A_STEP = 0.3
# [rad] bound of the whole turn (some thirty radians indeed) from which errors of the propagators have added up to more
# than an estimate can bear.
_FAR = 80.0
# A coefficient of I^-1 Pi or of I^-1 L_o, times the panel's width, is significant above this part of the tolerance.
_SIGNIFICANT = 0.004


class StepRequirements(NamedTuple):
    """How finely the panels of an interpolant must be stepped.

    Attributes
    ----------
    turn : (P,) a bound of how far the body turns on a panel [rad]
    swing : (P,) how much its rate of turning varies there
    degree : (P,) the last significant degree there
    whole_turn : the bound for all panels and loops [rad]
    moving : whether there is momentum
    """

    turn: Array
    swing: Array
    degree: Array
    whole_turn: float
    moving: bool

    @classmethod
    def from_interpolant(cls, interpolant: Interpolant, magnitude: float, tolerance: float) -> StepRequirements:
        """For momenta up to a magnitude [kg m^2/s] and a tolerance [rad]."""
        count, degrees, _ = interpolant.coefficients.shape
        edges = interpolant.edges[: count + 1]
        widths = (edges[1:] - edges[:-1])[:, None]
        rates = np.abs(interpolant.coefficients) @ np.array([magnitude] * 6 + [1.0] * 3) * widths
        powers = _degree_powers(degrees)
        turn, _, swing = (rates @ powers).T
        degree = ((rates > _SIGNIFICANT * tolerance) * powers[:, 1]).max(axis=1)
        return cls(turn, swing ** (1.0 / 7.0), degree, interpolant.loops * float(turn.sum()), magnitude > 0.0)

    @property
    def far(self) -> bool:
        """Whether the body may turn so far that the error propagators must be exact."""
        return self.whole_turn > _FAR

    def first_plan(self, tolerance: float) -> Array:
        """Steps per panel, not yet whole, that will probably suffice: (P,).

        The three numbers were fitted to the steps that 137 motions of twelve bodies needed at three tolerances; for six
        out of seven the first plan suffices.
        """
        return np.maximum(tolerance**-0.1376 * (0.0365 * self.turn + 0.163 * self.swing), 1.0)

    def least_steps(self, *, short: bool = False) -> Array:
        """Steps per panel, not yet whole, below which the estimates would be meaningless: (P,).

        `short`: so many that the propagators are known without the steps' derivative however far the body turns.
        """
        degrees = _DEGREES_A_STEP if self.moving else _DEGREES_A_STEP_AT_REST
        turn = _SHORT_TURN_A_STEP if short else _TURN_A_STEP
        if not self.far:
            # The propagators' errors of the steps add up, until they are taken from the derivative.
            turn = min(turn, 0.85 / (1.0 + self.whole_turn / _FAR))
        return np.maximum(self.degree / degrees, self.turn / turn)

    def safety_factor(self, steps: Integers) -> float:
        """Factor from the formula's own estimate to a bound of a step's error."""
        return _SAFETY_FACTOR * max(1.0, float((np.maximum(self.degree, 2.0 * self.turn) / steps).max()))


@lru_cache(maxsize=64)
def _degree_powers(degrees: int) -> Array:
    """(n, 3): ones, the degrees and their sixth powers."""
    return np.arange(degrees, dtype=np.float64)[:, None] ** np.array([0.0, 1.0, 6.0])


def carried_over(interpolant: Interpolant, old_edges: Array, old_steps: Integers) -> Array:
    """A plan carried over to an interpolant whose panels may have been bisected since, not yet whole: (P,)."""
    edges = interpolant.edges[: len(interpolant.coefficients) + 1]
    widths = np.diff(edges)
    middle = 0.5 * (edges[:-1] + edges[1:])
    old = np.clip(np.searchsorted(old_edges, middle) - 1, 0, len(old_steps) - 1)
    return np.maximum(1.0, old_steps[old] * widths / np.diff(old_edges)[old] - 1e-9)


def finer(steps: Integers, sums: Array, budget: float) -> Integers:
    """More steps where the sums of local errors on a panel are above their share of the error budget [rad]: (P,)."""
    shares = np.maximum(budget * steps / steps.sum(), 0.1 * budget / len(steps))
    factor = np.clip((sums / shares) ** 0.125 * 1.05, 1.0, 8.0)
    return np.ceil(steps * factor).astype(int)
