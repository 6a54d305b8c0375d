"""What is known of a function of time before it is sampled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from ..arrays import Array
from ..integrator.limited_steps import StepLimits
from ..integrator.recorded.knot_path import KnotPath
from ..integrator.resolved import ResolvedPath

# A resolved panel has at most five swings above rounding (degree 32): each then has ten evaluations or more.
_STEPS_OF_A_PANEL = 4.0
# Per period of the fastest swing.
_STEPS_OF_A_SWING = 4.0


@dataclass(frozen=True, eq=False)
class Smoothness:
    """What is known of a function of time before it is sampled, by which a way of sampling is chosen.

    Attributes
    ----------
    breaks : (M,) times between which it is smooth, first and last the interval's ends [s]
    oscillations : how often it can swing between two breaks, an upper bound; 0: nothing moves; None: unknown
    loops : the interval is its first part, this many times
    smooth_loop : whether it also goes smoothly from the end of a loop to its start
    sparse : whether harmonics below the highest are missing in a smooth loop
    swing : of a smooth loop, the amplitudes of its harmonics, each times its number, added up [rad]; None: unknown
    probe : a cheap stand-in whose swings are those of the function, times (N,) -> (N, 2 n), shapes and then their
        rates; None: there is none
    resolved : the first loop of what it depends on as series, where that is all there is to know; None: unknown
    checked : whether there is more to know, so that it is compared with its samples between the nodes all the same
    knots : the first loop as polynomials that a body follows, panels of which may span several breaks; None: it is none
    known : what samplers found out of all this, kept for the next motion
    """

    breaks: Array
    oscillations: float | None = None
    loops: int = 1
    smooth_loop: bool = False
    sparse: bool = False
    swing: float | None = None
    probe: Callable[[Array], Array] | None = None
    resolved: ResolvedPath | None = None
    checked: bool = False
    knots: KnotPath | None = None
    known: dict[Any, Any] = field(default_factory=dict, repr=False)

    @property
    def step_limits(self) -> StepLimits:
        """The longest steps of an integrator that evaluates the function itself: they step over no feature known."""
        if self.resolved is not None:
            loops = round(self.breaks[-1] / self.resolved.duration)
            return StepLimits.even(self.resolved.edges, _STEPS_OF_A_PANEL).repeated(loops)
        if self.oscillations is None:
            return StepLimits.even(self.breaks[[0, -1]], 1.0)
        steps = _STEPS_OF_A_SWING * max(self.oscillations, 0.5)
        if self.smooth_loop:
            return StepLimits.even(self.breaks[[0, -1]], steps * self.loops)
        return StepLimits.even(self.breaks, steps)
