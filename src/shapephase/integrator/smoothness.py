"""Prior knowledge of a function of time, for its sampling."""

from __future__ import annotations

from math import ceil

import numpy as np

from ..arrays import Array, Integers
from ..display import frozen
from .limited_steps import StepLimits
from .resolved import ResolvedPath

_STEPS_OF_A_PANEL = 4.0  # at most five swings above rounding (degree 32): ten evaluations or more for each
_STEPS_OF_A_SWING = 4.0  # per period of the fastest swing
_SAME_TIME = 1e-12  # of the duration: times nearer to each other are one
_MANY_PIECES = 64  # between breaks: each is then short beside the motion, and begins with few samples
_SHARP = 1e-8  # [rad] tolerance below which few pieces begin with degree 32, whose samples contain the others
_TERMS = np.array([5, 10, 21])  # highest degrees of a path for 8, 16 and 32: an inertia swings up to half as fast again
DEGREES = (8, 16, 32)  # of panels, nested; beyond the last a panel is halved


@frozen
class Smoothness:
    """Prior knowledge of a function of time, by which its first panels are chosen.

    Attributes
    ----------
    breaks : (M,) times between which it is smooth, first and last the interval's ends [s]
    oscillations : how often it can swing between two breaks, an upper bound; 0: nothing moves; None: unknown
    loops : the interval is its first part, this many times
    smooth_loop : whether it also goes smoothly from the end of a loop to its start
    resolved : the first loop of what it depends on as series; None: unknown
    checked : whether the function is compared with its series between the nodes

    Examples
    --------
    >>> known = sp.integrator.Smoothness(np.array([0.0, 1.0]), oscillations=2.0)
    >>> known.first_panels(1e-9)[0].tolist()
    [0.0, 0.5, 1.0]
    """

    breaks: Array
    oscillations: float | None = None
    loops: int = 1
    smooth_loop: bool = False
    resolved: ResolvedPath | None = None
    checked: bool = False

    @property
    def period(self) -> float:
        """Duration of one loop [s]."""
        return float(self.breaks[-1]) / self.loops

    @property
    def is_checked(self) -> bool:
        """True where the series are checked between the nodes, since nothing else is known there."""
        return self.checked or (self.oscillations is None and self.resolved is None)

    def first_panels(self, tolerance: float) -> tuple[Array, Integers]:
        """Edges (P + 1,) [s] and degrees (P,) of the panels of the first loop to begin with, for a tolerance [rad]."""
        inner = self.breaks[self.breaks <= self.period * (1.0 - _SAME_TIME)]
        ends = np.append(inner, self.period)
        if self.resolved is not None:
            return self._resolved_panels(self.resolved, ends, tolerance)
        if self.oscillations == 0.0:
            return ends, np.zeros(len(ends) - 1, dtype=np.int64)
        parts = max(1, ceil(self.oscillations or 1.0))
        if self.smooth_loop:
            ends = ends[[0, -1]]
        edges = np.append((ends[:-1, None] + np.diff(ends)[:, None] * (np.arange(parts) / parts)).ravel(), ends[-1])
        first = DEGREES[0] if len(ends) > _MANY_PIECES else DEGREES[1 + (tolerance < _SHARP)]
        return edges, np.full(len(edges) - 1, first)

    def _resolved_panels(self, resolved: ResolvedPath, ends: Array, tolerance: float) -> tuple[Array, Integers]:
        inner = resolved.edges[1:-1]
        near = np.searchsorted(ends, inner).clip(1, len(ends) - 1)
        apart = np.minimum(np.abs(inner - ends[near - 1]), np.abs(inner - ends[near])) > _SAME_TIME * ends[-1]
        edges = np.union1d(ends, inner[apart])
        middle = 0.5 * (edges[:-1] + edges[1:])
        leaf = np.clip(np.searchsorted(resolved.edges, middle) - 1, 0, len(resolved.left) - 1)
        # The errors of all panels add up.
        terms = resolved.terms(tolerance / len(resolved.left))[leaf]
        degrees = np.where(terms == 0, 0, np.array([*DEGREES, DEGREES[-1]])[np.searchsorted(_TERMS, terms)])
        halved = terms > _TERMS[-1]
        return np.union1d(edges, middle[halved]), np.repeat(degrees, 1 + halved)

    @property
    def step_limits(self) -> StepLimits:
        """The longest steps of an integrator that evaluates the function itself: they step over no feature known."""
        if self.resolved is not None:
            limits = StepLimits.even(self.resolved.edges, _STEPS_OF_A_PANEL)
            return limits.repeated(round(self.breaks[-1] / self.resolved.duration))
        if self.oscillations is None:
            return StepLimits.even(self.breaks[[0, -1]], 1.0)
        steps = _STEPS_OF_A_SWING * max(self.oscillations, 0.5)
        if self.smooth_loop:
            return StepLimits.even(self.breaks[[0, -1]], steps * self.loops)
        return StepLimits.even(self.breaks, steps)
