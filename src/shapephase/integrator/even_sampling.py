"""A smooth loop sampled at even times, where its Fourier series converges fastest."""

from __future__ import annotations

from functools import lru_cache
from math import ceil, inf, log, pi

import numpy as np

from ..arrays import Array, Integers
from .interpolant import Interpolant, unit_nodes, values_to_coefficients
from .spectral_error import EPS, Channels, Tail, averaged, fourier_sizes

_LAST_EVEN = 768
# Samples to begin with for every four harmonics, by tolerance: what most bodies need, since a second helping costs as
# much as thirty samples more.
_HARMONICS = 4
_FIRST_COUNTS = ((1e-8, 64), (1e-11, 96), (0.0, 128))
_EVEN_A_PANEL, _PANEL_DEGREE = 16, 32


class EvenSampler:
    """Samples a smooth loop at even times; each new count is two, three or four times the last."""

    def __init__(self, asked: Channels, period: float, loops: int, oscillations: float) -> None:
        self._asked, self._period, self._loops, self._oscillations = asked, period, loops, oscillations
        self._values = np.empty((0, 9))

    def refine(self, momentum: float, tolerance: float) -> bool:
        """As `Sampler.refine`; False where that would take too many samples."""
        if not len(self._values):
            count = self._first_count(tolerance)
            self._judge(self._asked(self._times(np.arange(count), count)))
        while (error := self.error(momentum)) > tolerance and not self._at_rounding:
            count = len(self._values)
            missing = log(error / tolerance) / self._decay if self._decay > 0.0 else inf
            # Twice, three or four times as many samples, whichever is enough for this decay.
            factor = 2 if missing <= 0.55 * count else 3 if missing <= 1.1 * count else 4
            if factor * count > _LAST_EVEN:
                return self._decay == inf
            index = np.arange(factor * count)
            fresh = index[index % factor != 0]
            values = np.empty((factor * count, 9))
            values[::factor] = self._values
            values[fresh] = self._asked(self._times(fresh, factor * count))
            self._judge(values)
        return True

    def _first_count(self, tolerance: float) -> int:
        if not self._oscillations:
            return 1
        each = next(count for least, count in _FIRST_COUNTS if tolerance > least)
        return each * max(1, ceil(self._oscillations / _HARMONICS))

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        inverse, drift = self._tails
        turn = self._period * (momentum * inverse.top + drift.top)
        share = averaged(inverse.converging and drift.converging, pi * len(self._values), turn)
        return self._loops * 0.5 * self._period * (momentum * inverse.error + drift.error) * share

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        count = len(self._values)
        panels = max(1, count // _EVEN_A_PANEL)
        degree = _PANEL_DEGREE if count > 1 else 0
        # Panels differ only in where their samples begin: twice round, each finds its own in one piece.
        twice = np.concatenate([self._values, self._values])
        row, number = twice.strides
        begun = np.ndarray((panels, count, 9), buffer=twice, strides=(count // panels * row, row, number))
        edges = (self._period / panels) * np.arange(panels * self._loops + 1, dtype=np.float64)
        edges[-1] = self._period * self._loops
        return Interpolant(edges, _even_to_panel(count, panels, degree) @ begun, self._loops, self._asked.count)

    def _times(self, index: Integers, count: int) -> Array:
        return (self._period / count) * index.astype(np.float64)

    def _judge(self, values: Array) -> None:
        self._values = values
        self._tails = [Tail.of(sizes, 2.0 * pi * EPS) for sizes in fourier_sizes(values)]

    @property
    def _decay(self) -> float:
        return min(tail.decay for tail in self._tails)

    @property
    def _at_rounding(self) -> bool:
        return all(tail.at_rounding for tail in self._tails)


@lru_cache(maxsize=32)
def _even_to_panel(count: int, panels: int, degree: int) -> Array:
    """Samples at `count` even times of a period -> Chebyshev coefficients on the first of even panels.

    (degree + 1, count). Through the Fourier series, whose highest term is halved (count even).
    """
    if count == 1:
        return np.ones((1, 1))
    phase = (2.0 * np.pi / panels) * (0.5 + 0.5 * unit_nodes(degree))
    angle = phase[:, None] - 2.0 * np.pi / count * np.arange(count)
    half = count // 2
    # The periodic sinc, sum of cos(k angle) for |k| < half plus half the last term.
    kernel = np.ones_like(angle)
    for k in range(1, half):
        kernel += 2.0 * np.cos(k * angle)
    kernel = (kernel + np.cos(half * angle)) / count
    return values_to_coefficients(degree) @ kernel
