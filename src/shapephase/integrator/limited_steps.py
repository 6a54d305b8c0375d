"""SciPy's DOP853 with steps limited by what is known of the functions of time, so that none steps over a feature."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array
from ..chebyshev import inside
from ..display import frozen
from ..errors import AccuracyNotReached


@frozen
class StepLimits:
    """The longest steps, interval by interval.

    edges : (P + 1,) ends of the intervals, first 0 [s]
    longest : (P,) a step is no longer within an interval, and reaches no farther into it [s]
    """

    edges: Array
    longest: Array

    @staticmethod
    def even(edges: Array, steps: float) -> StepLimits:
        """Limits by which every interval takes at least this number of steps."""
        return StepLimits(edges, np.diff(edges) / steps)

    def repeated(self, loops: int) -> StepLimits:
        """Limits for this interval repeated `loops` times."""
        starts = self.edges[-1] * np.arange(loops)
        edges = np.append((starts[:, None] + self.edges[:-1]).ravel(), loops * self.edges[-1])
        return StepLimits(edges, np.tile(self.longest, loops))

    def scaled(self, factor: float) -> StepLimits:
        """Limits with all lengths multiplied by a factor."""
        return StepLimits(self.edges, factor * self.longest)

    def combined(self, other: StepLimits) -> StepLimits:
        """The tighter of two limits at every time."""
        edges = np.union1d(self.edges, other.edges)
        middle = 0.5 * (edges[:-1] + edges[1:])
        return StepLimits(edges, np.minimum(self.at(middle), other.at(middle)))

    def at(self, times: Array) -> Array:
        """The longest step of the interval of each time: (N,) -> (N,) [s]."""
        place = np.searchsorted(self.edges, times, side="right") - 1
        return self.longest[np.clip(place, 0, len(self.longest) - 1)]

    def from_each_time(self) -> Callable[[float], float]:
        """The longest step from a time on [s]."""
        starts, longest = self.edges[:-1].tolist(), self.longest.tolist()
        ends = self.edges[:-1] + self.longest
        behind = np.append(np.minimum.accumulate(ends[::-1])[::-1][1:], np.inf).tolist()

        def from_time(t: float) -> float:
            place = max(bisect_right(starts, t) - 1, 0)
            return min(longest[place], behind[place] - t)

        return from_time


@dataclass(frozen=True, eq=False)
class Run:
    """A unit quaternion and other numbers in time, by one dense output between two breaks each.

    breaks : (M,) [s]
    pieces : dense outputs
    times : (K + 1,) ends of the steps [s]
    evaluations : of the slope
    rtol : relative tolerance of a step
    """

    breaks: Array
    pieces: tuple[Callable[[Array], Array], ...]
    times: Array
    evaluations: int
    rtol: float

    def __call__(self, t: Array) -> Array:
        """State at times: (N,) -> (N, 4 + k)."""
        piece = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.pieces) - 1)
        values: Array = np.empty((len(t), len(self.pieces[0](self.breaks[:1])[:, 0])))
        for number in np.unique(piece):
            rows = piece == number
            values[rows] = self.pieces[number](t[rows]).T
        values[:, :4] = so3.normalised(values[:, :4])
        return values


def limited_run(
    slope: Callable[[float, Array], Array],
    breaks: Array,
    start: Array,
    limits: StepLimits,
    rtol: float,
    atol: float,
) -> Run:
    """Integrate by SciPy's DOP853, restarted at the breaks, with steps within limits.

    `slope` is a function of time and state (4 + k,), of which a unit quaternion comes first, smooth between the breaks
    (M,) [s] and evaluated at their inner sides. Raises AccuracyNotReached if the steps become too short.
    """
    from scipy.integrate import DOP853, OdeSolution

    longest = limits.from_each_time()
    state, pieces, times, evaluations = start, [], [breaks[:1]], 0
    for a, b, left, right in zip(breaks[:-1], breaks[1:], *inside(breaks[:-1], breaks[1:]), strict=True):

        def within(t: float, y: Array, left: float = left, right: float = right) -> Array:
            return slope(min(max(t, left), right), y)

        ends, outputs = [a], []
        # SciPy computes the float next to zero, which raises where a caller made underflow an error.
        with np.errstate(under="ignore"):
            solver = DOP853(within, a, state, b, rtol=rtol, atol=atol, max_step=longest(a))
            while solver.status == "running":
                solver.max_step = longest(solver.t)
                message = solver.step()
                if solver.status == "failed":
                    raise AccuracyNotReached(f"DOP853 stopped at t = {solver.t:.9g} s: {message}")
                ends.append(solver.t)
                outputs.append(solver.dense_output())
        pieces.append(OdeSolution(ends, outputs))
        times.append(np.array(ends[1:]))
        evaluations += solver.nfev
        state = solver.y.copy()
        state[:4] = so3.normalised(state[:4])
    return Run(breaks, tuple(pieces), np.concatenate(times), evaluations, rtol)
