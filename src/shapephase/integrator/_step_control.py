"""How finely a motion is to be stepped."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..arrays import Array, Integers
from ._spectral_error import spectral_norms
from .fast import engine
from .fast.estimate_constants import (
    AIM,
    CHANCE_DEGREES,
    CHANCE_PARTS,
    DEGREES_A_RADIAN,
    DEGREES_A_STEP,
    DISTANCE,
    MOST_BY_CHANCE,
    MOST_TURN,
    NOT_SMALL,
    ORDER,
    PARTS_OF_DISTANCE,
    SHORT_TURN_A_STEP,
    SIGNIFICANT,
    SPANNED_DEGREES,
    TURN_A_STEP,
)
from .fast.panels import errors_of_steps, plan_of_steps, sizes_of_terms
from .interpolant import Interpolant

_LOGARITHMS = np.log(PARTS_OF_DISTANCE)
# Numbers compared at once.
_MOST_COMPARED = 4_000_000
# [rad] bound of the whole turn (some fifteen radians indeed) from which errors of the propagators have added up to more
# than an estimate can bear.
_FAR = 25.0
# [rad] the same of short steps; they were right to 3 % in turns of half as much, and to 30 % in the double.
_VERY_FAR = 100.0


class StepRequirements(NamedTuple):
    """How finely the panels of an interpolant must be stepped.

    Attributes
    ----------
    sizes : (3, P) of each panel a bound of how far the body turns there, the error of a single step but for a factor
        common to all [rad], and the last significant degree
    rates : (P, n) the size of each term of the rate of turning, times the panel's width [rad]
    whole_turn : the bound for all panels and loops [rad]
    tolerance : of the attitude [rad]
    loops : how often the panels are repeated
    """

    sizes: Array
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
        rates, sizes = find(coefficients, widths, magnitude, least)
        return cls(
            sizes=sizes,
            rates=rates,
            whole_turn=interpolant.loops * float(sizes[0].sum()),
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
        turn_a_step = SHORT_TURN_A_STEP if short else TURN_A_STEP
        if engine.is_ready():
            return plan_of_steps(self.sizes, self.loops, tolerance, turn_a_step)
        turn, swing, degree = self.sizes
        # As many on each panel as make the sum of all the least.
        each = swing ** (1.0 / (ORDER + 1.0))
        common = self.loops * DISTANCE * float(np.sqrt((each * each).sum())) / (AIM * tolerance)
        planned = 2.0 * common ** (1.0 / ORDER) * each
        least = np.maximum(degree / DEGREES_A_STEP, turn / turn_a_step)
        return np.maximum(np.maximum(planned, least), 1.0)

    def stepping_error(self, steps: Integers, distance: Array) -> Array:
        """Bound of the error of steps (P,) from their distance from half as many: (B,) -> (B,) [rad]."""
        if engine.is_ready():
            return errors_of_steps(self.rates, steps, self.tolerance, distance)
        most = _most_degrees(self.rates, steps, NOT_SMALL * distance)
        by_chance = self.tolerance * np.interp(most, CHANCE_DEGREES, CHANCE_PARTS)
        part = np.exp(np.interp(most, SPANNED_DEGREES, _LOGARITHMS))
        return np.maximum(part * distance, np.minimum(by_chance, MOST_BY_CHANCE * distance))


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
    """The most degrees that a step spans of terms above each of some sizes: (P, n), (P,), (B,) -> (B,)."""
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
