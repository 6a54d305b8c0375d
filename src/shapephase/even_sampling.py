"""A smooth loop sampled at even times, where its Fourier series converges fastest."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .arrays import Array, Integers
from .interpolant import Interpolant, unit_nodes, values_to_coefficients
from .spectrum import EPS, Channels, judged, spectral_sizes

_FIRST_HARMONICS, _LAST_EVEN = 4, 768
_EVEN_A_PANEL, _PANEL_DEGREE = 16, 32


class EvenSampler:
    """Samples a smooth loop at even times; each new count is two, three or four times the last."""

    def __init__(self, asked: Channels, period: float, loops: int, oscillations: float) -> None:
        self._asked, self._period, self._loops = asked, period, loops
        count = 8 * _FIRST_HARMONICS * max(1, int(np.ceil(oscillations / _FIRST_HARMONICS))) if oscillations else 1
        self._values = asked(self._times(np.arange(count), count))
        self._judge()

    def refine(self, momentum: float, tolerance: float) -> bool:
        """As `Sampler.refine`; False where that would take too many samples."""
        while (error := self.error(momentum)) > tolerance and not self._judgement.at_rounding[0]:
            count = len(self._values)
            decay = float(self._judgement.decay[0])
            missing = np.log(error / tolerance) / decay if decay > 0.0 else np.inf
            # Twice, three or four times as many samples, whichever is enough for this decay.
            factor = 2 if missing <= 0.55 * count else 3 if missing <= 1.1 * count else 4
            if factor * count > _LAST_EVEN:
                return False
            index = np.arange(factor * count)
            fresh = index[index % factor != 0]
            values = np.empty((factor * count, 9))
            values[::factor] = self._values
            values[fresh] = self._asked(self._times(fresh, factor * count))
            self._values = values
            self._judge()
        return True

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        phase = np.pi * len(self._values)
        return self._loops * float(self._judgement.error(momentum, np.array([self._period]), phase)[0])

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        count = len(self._values)
        panels = max(1, count // _EVEN_A_PANEL)
        degree = _PANEL_DEGREE if count > 1 else 0
        coefficients = _even_to_panels(count, panels, degree) @ self._values
        edges = np.linspace(0.0, self._period * self._loops, panels * self._loops + 1)
        return Interpolant(edges, coefficients, self._loops, self._asked.count)

    def _times(self, index: Integers, count: int) -> Array:
        return (self._period / count) * index.astype(np.float64)

    def _judge(self) -> None:
        count = len(self._values)
        spectrum = np.fft.rfft(self._values, axis=0) * (2.0 / count)
        self._judgement = judged(spectral_sizes(spectrum)[None], count // 2, 2.0 * np.pi * EPS)


@lru_cache(maxsize=32)
def _even_to_panels(count: int, panels: int, degree: int) -> Array:
    """Samples at `count` even times of a period -> Chebyshev coefficients on even panels: (panels, degree + 1, count).

    Through the Fourier series, whose highest term is halved (count even).
    """
    if count == 1:
        return np.ones((1, 1, 1))
    phase = (2.0 * np.pi / panels) * (np.arange(panels)[:, None] + 0.5 + 0.5 * unit_nodes(degree)).ravel()
    angle = phase[:, None] - 2.0 * np.pi / count * np.arange(count)
    half = count // 2
    # The periodic sinc, sum of cos(k angle) for |k| < half plus half the last term.
    kernel = np.ones_like(angle)
    for k in range(1, half):
        kernel += 2.0 * np.cos(k * angle)
    kernel = (kernel + np.cos(half * angle)) / count
    return values_to_coefficients(degree) @ kernel.reshape(panels, degree + 1, count)
