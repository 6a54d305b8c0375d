"""How finely a motion must be stepped: for its accuracy, and for the estimates to mean something."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Integers
from .interpolant import Interpolant

# In 60,000 random motions the true error of a step was less than a fourteenth of the formula's own estimate where the
# step spanned at most one degree of the panel that matters, and in most less than a hundredth; with more degrees the
# estimate is worth less in proportion. Nor is the growth of errors known where the body turns by more than half a
# radian in a step (the bound at hand is two or three times as large), nor in the end where it turns by some thirty.
_CAUTION = 0.07
_DEGREES_A_STEP, _DEGREES_A_STEP_AT_REST = 3.0, 2.0
_TURN_A_STEP, _SHORT_TURN_A_STEP, _FAR = 1.0, 0.3, 80.0


class StepRequirements(NamedTuple):
    """What the panels of an interpolant ask of the steps on them.

    Attributes
    ----------
    turn : (P,) a bound of how far the body turns on a panel [rad]
    swing : (P,) how much its rate of turning swings there
    degree : (P,) the last degree that matters there
    whole_turn : the bound for all panels and loops [rad]
    moving : whether there is momentum
    """

    turn: Array
    swing: Array
    degree: Array
    whole_turn: float
    moving: bool

    @classmethod
    def of(cls, interpolant: Interpolant, size: float, tolerance: float) -> StepRequirements:
        """For momenta up to a size [kg m^2/s] and a tolerance [rad]."""
        count, degrees, _ = interpolant.coefficients.shape
        edges = interpolant.edges[: count + 1]
        widths = (edges[1:] - edges[:-1])[:, None]
        rates = np.abs(interpolant.coefficients) @ np.array([size] * 6 + [1.0] * 3) * widths
        powers = _degree_powers(degrees)
        turn, _, swing = (rates @ powers).T
        degree = ((rates > 0.004 * tolerance) * powers[:, 1]).max(axis=1)
        return cls(turn, swing ** (1.0 / 7.0), degree, interpolant.loops * float(turn.sum()), size > 0.0)

    @property
    def far(self) -> bool:
        """Whether the body may turn so far that the growth of errors must be exact."""
        return self.whole_turn > _FAR

    def first_plan(self, tolerance: float) -> Array:
        """Steps per panel, not yet whole, that will probably do: (P,).

        The three numbers were fitted to the steps that 137 motions of twelve bodies needed at three tolerances; in six
        of seven the first plan does.
        """
        return np.maximum(tolerance**-0.1376 * (0.0365 * self.turn + 0.163 * self.swing), 1.0)

    def least_steps(self, *, short: bool = False) -> Array:
        """Steps per panel, not yet whole, without which the estimates would mean nothing: (P,).

        `short`: so many that the growth of errors is known without the steps' derivative however far the body turns.
        """
        degrees = _DEGREES_A_STEP if self.moving else _DEGREES_A_STEP_AT_REST
        turn = _SHORT_TURN_A_STEP if short else _TURN_A_STEP
        if not self.far:
            # What the growth of errors lacks in each step adds up until it is taken from the derivative.
            turn = min(turn, 0.85 / (1.0 + self.whole_turn / _FAR))
        return np.maximum(self.degree / degrees, self.turn / turn)

    def caution(self, steps: Integers) -> float:
        """The part of the formula's own estimate that the error of a step may have."""
        return _CAUTION * max(1.0, float((np.maximum(self.degree, 2.0 * self.turn) / steps).max()))


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


def finer(steps: Integers, sums: Array, room: float) -> Integers:
    """More steps where the sums of local errors on a panel are above their share of the room: (P,)."""
    shares = np.maximum(room * steps / steps.sum(), 0.1 * room / len(steps))
    factor = np.clip((sums / shares) ** 0.125 * 1.05, 1.0, 8.0)
    return np.ceil(steps * factor).astype(int)
