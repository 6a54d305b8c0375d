"""A smoothing spline of one penalty: a linear map of the samples."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Array

_LEAST = -3.0
"""Of the penalties that are tried, in powers of ten of the mean step cubed: next to nothing is smoothed."""
_MOST = 10.0
"""Of these: 300 samples are smoothed over; rounding goes into the results beyond."""
_STEP = 0.5
"""Between penalties that are tried, in powers of ten: it moves the width of what is smoothed by a third."""
_PROBED = 2**15
"""Numbers in the random vectors that a trace is estimated with; squares of that size are summed exactly."""
_PROBES = 4
"""Random vectors at least: the trace of a long recording is known to a few hundredths by them."""
_FADING = 8.0
"""Distance from an end of what is open in which a penalty fades, in widths that it smooths over."""


@dataclass(frozen=True, eq=False)
class LinearSmoother:
    """f with the least sum of w (y - f)^2 + penalty * integral of f''^2, over periodic or natural cubic splines.

    Natural splines have no curvature at their ends, and motions have. The penalty therefore fades towards the ends,
    with the fourth power of the distance: the width that is smoothed over is the fourth root of penalty times step.

    Attributes
    ----------
    times : (N,) of the samples, ascending from 0 [s]
    periodic : whether first and last sample are measurements of one value, which then weighs twice
    penalty : [s^3]
    fading : distance from the ends of what is open in which the penalty fades [s]

    Notes
    -----
    Source: Reinsch 1967.
    """

    times: Array
    periodic: bool
    penalty: float
    fading: float = 0.0

    @staticmethod
    def of_width(times: Array, periodic: bool, penalty: float) -> LinearSmoother:
        """Fading within eight widths that this penalty smooths over."""
        width = (penalty * times[-1] / (len(times) - 1)) ** 0.25
        return LinearSmoother(times, periodic, penalty, 0.0 if periodic else _FADING * float(width))

    @property
    def count(self) -> int:
        """How many values there are."""
        return len(self.times) - self.periodic

    @property
    def degrees_of_freedom(self) -> float:
        """The trace of the map."""
        probes = self.probes()
        return self.trace(probes, self(probes))

    def __call__(self, values: Array) -> Array:
        """(count, k) -> (count, k)."""
        return values - self._taken_off(values) / self.weights[:, None]

    def transposed(self, gradients: Array) -> Array:
        """From derivatives by smoothed values to those by the values: (count, k) -> (count, k)."""
        return gradients - self._taken_off(gradients / self.weights[:, None])

    @cached_property
    def weights(self) -> Array:
        """(count,)."""
        found = np.ones(self.count)
        if self.periodic:
            found[0] = 2.0
        return found

    def probes(self) -> Array:
        """Vectors p whose sums of p . S p are the trace of S, exactly or nearly: (count, k)."""
        count = self.count
        if count * count <= _PROBED:
            return np.eye(count)
        width = max(_PROBED // count, _PROBES)
        signs = np.random.default_rng(0).choice(np.array([-1.0, 1.0]), size=(count, width))
        return signs / np.sqrt(width)

    @staticmethod
    def trace(probes: Array, images: Array) -> float:
        """Of the map with these images of `probes`."""
        return float((probes * images).sum())

    def _taken_off(self, values: Array) -> Array:
        """penalty K f: (count, k) -> (count, k)."""
        from scipy.sparse import diags_array
        from scipy.sparse.linalg import splu

        differences, gram = _roughness(self.times, self.periodic)
        if self.fading:
            inner = self.times[1:-1]
            share = np.minimum(1.0, np.minimum(inner, self.times[-1] - inner) / self.fading)
            differences = differences @ diags_array((share * (2.0 - share)) ** 2)
        scaled = self.penalty * differences.T @ diags_array(1.0 / self.weights) @ differences
        bends = splu((gram + scaled).tocsc()).solve(differences.T @ values)
        return np.asarray(self.penalty * (differences @ bends), dtype=np.float64)


class Pilot(NamedTuple):
    """The smoother of least expected error, and what it leaves of the samples.

    Attributes
    ----------
    smoother : itself
    motion : (count, n) the samples, smoothed twice: what is surely motion
    taken_off : (count, n) what the second time takes off
    """

    smoother: LinearSmoother
    motion: Array
    taken_off: Array


def pilot(times: Array, periodic: bool, values: Array, noise: Array) -> Pilot:
    """The smoother for which sums of squares of the error, in units of the noise, are least as far as one can tell.

    Parameters
    ----------
    values, noise : (count, n), (n,) [rad or m]

    Notes
    -----
    Source: Mallows 1973 (C_p).
    """
    unit = (times[-1] / (len(times) - 1)) ** 3
    tried: dict[float, tuple[float, LinearSmoother]] = {}

    def risk(power: float) -> float:
        if power not in tried:
            smoother = LinearSmoother.of_width(times, periodic, unit * 10.0**power)
            probes = smoother.probes()
            images = smoother(np.concatenate([values, probes], axis=1))
            off = (values - images[:, : values.shape[1]]) / noise
            freedom = smoother.trace(probes, images[:, values.shape[1] :])
            squares = float((smoother.weights[:, None] * off**2).sum())
            tried[power] = squares + 2.0 * len(noise) * freedom, smoother
        return tried[power][0]

    best = min(np.arange(_LEAST, _MOST + 1.0).tolist(), key=risk)
    best = min((power for power in (best - _STEP, best, best + _STEP) if _LEAST <= power <= _MOST), key=risk)
    smoother = tried[best][1]
    once = smoother(values)
    twice = smoother(once)
    return Pilot(smoother, twice, once - twice)


def _roughness(times: Array, periodic: bool) -> tuple[Any, Any]:
    """Sparse Q and R: R g = Q^T f gives the second derivatives g of the spline through f, whose square's integral is
    g . R g."""
    from scipy.sparse import coo_array

    steps = np.diff(times)
    pieces = len(steps)
    count = pieces if periodic else pieces + 1
    knots = np.arange(pieces) if periodic else np.arange(1, pieces)
    before, after = steps[knots - 1], steps[knots]
    column = np.arange(len(knots))
    entries = np.concatenate([1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after])
    rows = np.concatenate([(knots - 1) % count, knots, (knots + 1) % count])
    differences = coo_array((entries, (rows, np.tile(column, 3))), shape=(count, len(knots))).tocsc()
    pairs = column if periodic else column[:-1]
    beside, shared = (pairs + 1) % len(knots), after[: len(pairs)] / 6.0
    entries = np.concatenate([(before + after) / 3.0, shared, shared])
    places = (np.concatenate([column, pairs, beside]), np.concatenate([column, beside, pairs]))
    return differences, coo_array((entries, places), shape=(len(knots), len(knots))).tocsc()
