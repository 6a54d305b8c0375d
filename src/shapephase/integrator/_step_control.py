"""How finely a motion is to be stepped."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Array, Integers
from ._spectral_error import spectral_norms
from .fast import engine
from .fast.estimate_constants import DEGREES_A_RADIAN, MOST_TURN, ORDER, SIGNIFICANT
from .fast.panels import most_degrees, sizes_of_terms
from .interpolant import Interpolant

# Significant Chebyshev degrees of a panel that one step may span, so that half as many steps still see all of them.
_DEGREES_A_STEP = 2.4
# The error of the steps, as a part of their distance from half as many. An eighth-order formula would allow 1/255; that
# is the median of 1,200 random motions, half of them with bumps and ramps that hide. It is less sure the more degrees
# a step spans of terms that are not small against the distance.
_NOT_SMALL = 0.02
_DEGREES = np.array([1.6, 1.9, 2.4, 3.0, 3.5, 5.0])
_LOGARITHMS = np.log([1.0 / 80.0, 1.0 / 40.0, 1.0 / 12.0, 1.0 / 6.0, 1.0 / 4.0, 1.0])
# The distance of steps that span so many degrees may be small by chance: then the error is at least a part of the
# tolerance, as far as the distance allows.
_CHANCE_DEGREES = np.array([1.6, 2.4])
_CHANCE_PARTS = np.array([0.0, 0.005])
# Of the distance: more error than that was never hidden by chance.
_MOST_BY_CHANCE = 0.25
# Numbers compared at once.
_MOST_COMPARED = 4_000_000
# [rad] bound of the turn in one step; it is up to twice the turn itself.
_TURN_A_STEP = 2.0
# [rad] the same where the propagator of a step must be right over a long motion without the steps' derivative.
_SHORT_TURN_A_STEP = 0.6
# [rad] bound of the whole turn (some fifteen radians indeed) from which errors of the propagators have added up to more
# than an estimate can bear.
_FAR = 25.0
# [rad] the same of short steps; they were right to 3 % in turns of half as much, and to 30 % in the double.
_VERY_FAR = 100.0
# The distance between so many steps and half as many: this times the root of the sum of the panels' squared errors,
# each the sum of its terms times the eighth power of their degree over half the steps. Three of four random motions
# need no more.
_DISTANCE = 10.0**-8.1
# Of the tolerance: the distance that is planned for; its part that counts is far smaller, and so is the usual one.
_AIM = 40.0


class StepRequirements(NamedTuple):
    """How finely the panels of an interpolant must be stepped.

    Attributes
    ----------
    turn : (P,) a bound of how far the body turns on a panel [rad]
    swing : (P,) the error of a single step of each panel, but for a factor common to all [rad]
    degree : (P,) the last significant degree there
    rates : (P, n) the size of each term of the rate of turning, times the panel's width [rad]
    whole_turn : the bound for all panels and loops [rad]
    tolerance : of the attitude [rad]
    loops : how often the panels are repeated
    """

    turn: Array
    swing: Array
    degree: Array
    rates: Array
    whole_turn: float
    tolerance: float
    loops: int

    @classmethod
    def from_interpolant(cls, interpolant: Interpolant, magnitude: float, tolerance: float) -> StepRequirements:
        """For momenta up to a magnitude [kg m^2/s] and a tolerance [rad]."""
        coefficients, edges = interpolant.coefficients, interpolant.edges
        widths, least = np.diff(edges[: len(coefficients) + 1]), SIGNIFICANT * tolerance
        find = sizes_of_terms if engine.is_ready() else _sizes_of_terms
        rates, (turn, swing, degree) = find(coefficients, widths, magnitude, least)
        return cls(
            turn=turn,
            swing=swing,
            degree=degree,
            rates=rates,
            whole_turn=interpolant.loops * float(turn.sum()),
            tolerance=tolerance,
            loops=interpolant.loops,
        )

    @property
    def far(self) -> bool:
        """Whether the body may turn so far that propagators are right only along short steps."""
        return self.whole_turn > _FAR

    @property
    def very_far(self) -> bool:
        """Whether it may turn so far that no propagators but exact ones will do."""
        return self.whole_turn > _VERY_FAR

    def plan(self, tolerance: float, *, short: bool = False) -> Array:
        """Steps per panel, not yet whole, that will probably suffice: (P,).

        `short`: so many that the propagators are known without the steps' derivative however far the body turns.
        """
        # As many on each panel as make the sum of all the least.
        each = self.swing ** (1.0 / (ORDER + 1.0))
        common = self.loops * _DISTANCE * float(np.sqrt((each * each).sum())) / (_AIM * tolerance)
        planned = 2.0 * common ** (1.0 / ORDER) * each
        turn = _SHORT_TURN_A_STEP if short else _TURN_A_STEP
        least = np.maximum(self.degree / _DEGREES_A_STEP, self.turn / turn)
        return np.maximum(np.maximum(planned, least), 1.0)

    def stepping_error(self, steps: Integers, distance: Array) -> Array:
        """Bound of the error of steps (P,) from their distance from half as many: (B,) -> (B,) [rad]."""
        least = _NOT_SMALL * distance
        most = (most_degrees if engine.is_ready() else _most_degrees)(self.rates, steps, least)
        by_chance = self.tolerance * np.interp(most, _CHANCE_DEGREES, _CHANCE_PARTS)
        part = np.exp(np.interp(most, _DEGREES, _LOGARITHMS))
        return np.maximum(part * distance, np.minimum(by_chance, _MOST_BY_CHANCE * distance))


def _sizes_of_terms(coefficients: Array, widths: Array, magnitude: float, least: float) -> tuple[Array, Array]:
    """As `fast.panels.sizes_of_terms`."""
    rates = (spectral_norms(coefficients) @ np.array([magnitude, 1.0])) * widths[:, None]
    degree, turn = np.arange(float(rates.shape[1])), rates.sum(axis=1)
    last = ((rates > least) * degree).max(axis=1)
    swinging = rates
    if not magnitude:
        # Without momentum a steady turn is exact.
        swinging = rates.copy()
        swinging[:, 0] = 0.0
    # More turns than can be stepped are refused, and their powers would overflow.
    seen = degree + (DEGREES_A_RADIAN * np.minimum(turn, MOST_TURN))[:, None] if magnitude else degree
    return rates, np.stack([turn, (swinging * seen**ORDER).sum(axis=1), last])


def _most_degrees(rates: Array, steps: Integers, least: Array) -> Array:
    """As `fast.panels.most_degrees`."""
    spanned = np.arange(rates.shape[1]) / steps[:, None]
    most = np.empty(len(least))
    at_once = max(1, _MOST_COMPARED // spanned.size)
    for first in range(0, len(least), at_once):
        part = slice(first, first + at_once)
        most[part] = ((rates > least[part, None, None]) * spanned).max(axis=(1, 2), initial=0.0)
    return most


def even_steps(planned: Array, subdivide: Integers | int) -> Integers:
    """Whole numbers of steps on each panel that are even, and multiples of `subdivide`: (P,) -> (P,)."""
    least = np.lcm(subdivide, 2)
    return least * np.ceil(planned / least).astype(int)
