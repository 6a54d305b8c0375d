"""How finely a motion is to be stepped."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import sqrt

import numpy as np

from ...arrays import Array, Integers
from .._spectral_error import spectral_norms
from ..fast import engine
from ..fast.estimate_constants import (
    AIM,
    DEFECT_DEGREES,
    DEFECT_STEPS,
    DEGREES_A_RADIAN,
    DEGREES_A_STEP,
    DISTANCE,
    FAR,
    FEW_STEPS,
    FORESEEN_AT_REST,
    LOOKS_AT_REST,
    MOST_ODD,
    MOST_SHORTENED,
    MOST_TURN,
    NEAR,
    ORDER,
    ROUNDED_DOWN,
    SHORT_TURN_A_STEP,
    SIGNIFICANT,
    TURN_A_STEP,
    VERY_FAR,
)
from ..fast.panels import defects_of_panels, plan_of_steps, sizes_of_terms
from ..interpolant import Interpolant
from .quadrature_defects import Defects, PanelDefects, ones, signed_defects


@dataclass(eq=False)
class StepRequirements:
    """How finely the panels of an interpolant must be stepped.

    Attributes
    ----------
    sizes : (4, P) of each panel a bound of how far the body turns there, the error of a single step but for a factor
        common to all [rad], the last significant degree, and how far the body turns by its momentum alone [rad]
    rates : (P, n) the size of each term of the rate of turning, times the panel's width [rad]
    turns : (P,) how far the body turns on each panel as seen from space, by the bound; zero without momentum [rad]
    whole_turn : the bound for all panels and loops [rad]
    interpolant : with these panels
    moving : whether there may be momentum
    by_kernel : whether machine code finds the rest of it
    """

    sizes: Array
    rates: Array
    turns: Array
    whole_turn: float
    interpolant: Interpolant
    moving: bool
    by_kernel: bool
    _defects: dict[bytes, Defects] = field(default_factory=dict, init=False, repr=False)
    _of_panels: PanelDefects | None = field(default=None, init=False, repr=False)

    @classmethod
    def from_interpolant(cls, interpolant: Interpolant, magnitude: float, tolerance: float) -> StepRequirements:
        """For momenta up to a magnitude [kg m^2/s] and a tolerance [rad]."""
        by_kernel = engine.is_ready()
        find = sizes_of_terms if by_kernel else _sizes_of_terms
        rates, sizes = find(interpolant.coefficients, interpolant.widths, magnitude, SIGNIFICANT * tolerance)
        return cls(
            sizes=sizes,
            rates=rates,
            turns=sizes[0] if magnitude else np.zeros(len(rates)),
            whole_turn=interpolant.loops * sum(sizes[0].tolist()),
            interpolant=interpolant,
            moving=magnitude > 0.0,
            by_kernel=by_kernel,
        )

    @property
    def loops(self) -> int:
        """How often the panels are repeated."""
        return self.interpolant.loops

    @property
    def far(self) -> bool:
        """Whether the body may turn so far that propagators are right only along short steps."""
        return self.whole_turn > FAR

    @property
    def very_far(self) -> bool:
        """Whether it may turn so far that no propagators but exact ones will do."""
        return self.whole_turn > VERY_FAR

    def plan(self, tolerance: float, *, short: bool = False) -> Array:
        """Steps per panel, not yet whole, that will probably suffice: (P,).

        `short`: so many that the propagators are known without the steps' derivative however far the body turns.
        """
        turn_a_step = SHORT_TURN_A_STEP if short else TURN_A_STEP
        if self.by_kernel:
            motion = self.interpolant.coefficients, self.interpolant.widths, self.rates, self.turns, self.sizes
            return plan_of_steps(*motion, self.loops, tolerance, turn_a_step, moving=self.moving)
        turn, swing, degree, _ = self.sizes
        # As many on each panel as make the sum of all the least.
        each = swing ** (1.0 / (ORDER + 1.0))
        common = self.loops * DISTANCE * sqrt(float(each @ each)) / (AIM * tolerance)
        planned = 2.0 * common ** (1.0 / ORDER) * each
        least = np.maximum(np.maximum(degree / DEGREES_A_STEP, turn / turn_a_step), 1.0)
        planned = np.maximum(planned, least)
        looks = 1 if self.moving else LOOKS_AT_REST
        for _ in range(looks if self.loops * sum(planned.tolist()) <= FEW_STEPS else 0):
            steps = self.whole_steps(planned)
            if self.moving:
                found = self.defects(steps)
                excess, order = found.excess(self.loops, tolerance), found.order
                is_near = not excess > 1.0
            else:
                excess, order = self.foreseen_error_at_rest(steps) / (FORESEEN_AT_REST * tolerance), ORDER
                # Fewer steps than the least there are none.
                is_near = excess <= 1.0 and (excess >= NEAR or not (planned > least).any())
            if is_near:
                break
            planned = np.maximum(planned * min(excess ** (1.0 / order), MOST_SHORTENED), least)
        return planned

    def foreseen_error_at_rest(self, steps: Integers) -> float:
        """What so many steps (P,) miss of the rates of turning themselves, as vectors: in these most cancels [rad]."""
        table, series = signed_defects(), self.interpolant.coefficients[:, :DEFECT_DEGREES, 6:]
        counts = np.minimum(steps, DEFECT_STEPS)
        missed = table.take(counts, axis=0)[..., : series.shape[1]] @ series
        of_panels = np.sqrt((missed * missed).sum(axis=2).max(axis=1)) * self.interpolant.widths
        # More steps than the table has miss less by the order of the formula.
        return self.loops * float(of_panels @ (counts / steps) ** ORDER)

    def whole_steps(self, planned: Array) -> Integers:
        """Whole numbers of steps on each panel: (P,) -> (P,).

        With momentum at least two, so that pairs of them show errors, and where they are many even.
        """
        if not self.moving:
            return np.maximum(np.ceil(planned - ROUNDED_DOWN), 1.0).astype(int)
        whole = np.maximum(np.ceil(planned), 2.0).astype(int)
        if max(whole.tolist()) <= MOST_ODD:
            return whole
        return whole + (whole > MOST_ODD) * (whole % 2)

    def defects(self, steps: Integers) -> Defects:
        """What the formula misses in so many steps (P,) and in those beside them."""
        key = steps.tobytes()
        if key not in self._defects:
            taken = steps if self.moving else 2 * steps
            if self.by_kernel:
                self._defects[key] = defects_of_panels(self.rates, self.turns, taken)
            else:
                self._of_panels = self._of_panels or PanelDefects(self.rates, self.turns)
                self._defects[key] = self._of_panels.found(taken)
        return self._defects[key]

    def stepping_error(self, steps: Integers, distance: Array, amplification: Array | float = 1.0) -> Array:
        """Bound of the error of steps (P,) from their distance from those beside them: (B,) -> (B,) [rad].

        `amplification` : as of `Defects.error`
        """
        found = self.defects(steps)
        if not self.moving:
            return found.error_at_rest(distance, self.loops)
        return found.error(distance, self.loops, amplification, self.loops * sum(self.sizes[3].tolist()))


def _sizes_of_terms(coefficients: Array, widths: Array, magnitude: float, least: float) -> tuple[Array, Array]:
    """As `fast.panels.sizes_of_terms`."""
    norms = spectral_norms(coefficients)
    rates = (magnitude * norms[..., 0] + norms[..., 1] if magnitude else norms[..., 1]) * widths[:, None]
    degree, sizes = np.arange(float(rates.shape[1])), np.empty((4, len(rates)))
    turn = sizes[0] = rates @ ones(len(degree))
    sizes[2] = ((rates > least) * degree).max(axis=1)
    if magnitude:
        # More turns than can be stepped are refused, and their powers would overflow.
        sizes[1] = np.vecdot(rates, _powers(degree + (DEGREES_A_RADIAN * np.minimum(turn, MOST_TURN))[:, None]))
        sizes[3] = magnitude * norms[:, 0, 0] * widths
    else:
        # Without momentum a steady turn is exact: the first term counts for nothing.
        sizes[1], sizes[3] = rates @ _powers(degree), 0.0
    return rates, sizes


def _powers(degree: Array) -> Array:
    """To the power ORDER, which is eight: squares take a fifth of the time."""
    square = degree * degree
    square *= square
    square *= square
    return square
