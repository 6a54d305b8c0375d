"""A smooth loop sampled at even times, where its Fourier series converges fastest."""

from __future__ import annotations

from functools import lru_cache, partial
from math import ceil, inf, log, log10, pi
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from .._last_terms import Perturbed
from .._spectral_error import (
    EPS,
    SampledChannels,
    TailEstimate,
    estimate_tail,
    fourier_norms,
    spectral_norms,
    tail_length,
    unaveraged_share,
)
from ..fast import engine
from ..fast.loops import errors_of_loop
from ..interpolant import Interpolant

# Samples of a loop, beyond which panels need fewer.
_MOST_SAMPLES = 768
# Tolerance [rad] from which on, and the samples to begin with for every `_HARMONICS` harmonics of a shape that swings
# no one knows how far: what most bodies need, since a second round costs as much as thirty samples more.
_FIRST_COUNTS = ((1e-8, 64), (1e-11, 96), (0.0, 128))
_HARMONICS = 4
# Else the multiple of this that is next to a sum of samples for any motion, for each harmonic and digit, and for each
# radian of swing and digit: enough for 97 of 100 random loops. (The spectrum of cos(x sin t) ends a few harmonics
# beyond x.)
_UNIT = 16
_SAMPLES_OF_ANY = 20.0
_SAMPLES_A_HARMONIC = 1.03
_SAMPLES_A_RADIAN = 3.2
# Digits of the tolerance, at least: with fewer, samples would be too few for the highest harmonic itself.
_FEWEST_DIGITS = 5.0
# Those that count, less than there are for harmonics and more for the swing.
_DIGITS_OF_HARMONICS = -2.5
_DIGITS_OF_SWING = 1.0
# Samples of the loop on each panel of the interpolant, and the degree of its series: on it even a harmonic that is only
# just resolved is right to a twentieth.
_WIDE = (16, 32)
# The same of motions that take many steps, which are cut to measure on each panel.
_NARROW = (8, 22)
# The body turns by more than so much for each sample there [rad].
_FAR_TURN = 0.1
# Times, as shares of the loop, at which the series is compared with the deformation itself: never nodes, and spread.
_TEST_SHARES = np.mod(0.2137 + 0.6180339887498949 * np.arange(3), 1.0)
# Pi is more than its number by so much; and what counts as a node, in half turns of a loop.
_BEYOND_PI = 1.2246467991473532e-16
_AT_NODE = 1e-14
# The error between the nodes may be this many times what those few times show.
_UNSEEN_BETWEEN = 2.0
# Rounding of a sample may be this many times the floor of the spectrum, where it averages out.
_ROUNDING_OF_TESTS = 4.0
# Of the times, in turns of the loop [rad].
_TIME_ROUNDING = 2.0 * pi * EPS


class EvenSampler:
    """Samples a smooth loop at even times; each new count is two, three or four times the last."""

    def __init__(
        self, channels: SampledChannels, period: float, loops: int, oscillations: float, swing: float | None = None
    ) -> None:
        self._channels, self._period, self._loops = channels, period, loops
        self._oscillations, self._swing = oscillations, swing
        self._values = np.empty((0, 9))
        self._tests = np.empty((0, 9))
        self._panel = _WIDE

    def refine(self, momentum: float, tolerance: float) -> bool:
        """As `Sampler.refine`; False where that would take too many samples."""
        if not len(self._values):
            count = self._first_count(tolerance)
            tests = _TEST_SHARES * self._period if count > 1 else np.empty(0)
            values = self._channels(np.concatenate([self._times(np.arange(count), count), tests]))
            self._tests = values[count:]
            self._take(values[:count])
        while (error := self.error(momentum)) > tolerance and not self._at_rounding:
            count = len(self._values)
            missing = log(error / tolerance) / self._decay if self._decay > 0.0 else inf
            # Twice, three or four times as many samples, whichever is enough for this decay.
            factor = 2 if missing <= 0.55 * count else 3 if missing <= 1.1 * count else 4
            if factor * count > _MOST_SAMPLES:
                return self._decay == inf and not self._has_gaps
            index = np.arange(factor * count)
            fresh = index[index % factor != 0]
            values = np.empty((factor * count, 9))
            values[::factor] = self._values
            values[fresh] = self._channels(self._times(fresh, factor * count))
            self._take(values)
        self._panel = _NARROW if momentum and self._turn(momentum) > _FAR_TURN * len(self._values) else _WIDE
        return True

    def _first_count(self, tolerance: float) -> int:
        if not self._oscillations:
            return 1
        if self._swing is not None:
            digits = max(-log10(tolerance), _FEWEST_DIGITS)
            count = _SAMPLES_OF_ANY + _SAMPLES_A_RADIAN * (digits + _DIGITS_OF_SWING) * self._swing
            count += _SAMPLES_A_HARMONIC * (digits + _DIGITS_OF_HARMONICS) * self._oscillations
            return _UNIT * max(2, ceil(min(count, _MOST_SAMPLES) / _UNIT))
        each = next(count for least, count in _FIRST_COUNTS if tolerance > least)
        return each * max(1, ceil(self._oscillations / _HARMONICS))

    def error(self, momentum: float) -> float:
        """As `Sampler.error`."""
        inverse, drift = self._tails
        converging = inverse.converging and drift.converging
        share = unaveraged_share(converging, pi * len(self._values), self._turn(momentum))
        by_tails = (momentum * inverse.error + drift.error) * share
        return self._loops * 0.5 * self._period * by_tails + self._hidden(momentum)

    def interpolant(self) -> Interpolant:
        """As `Sampler.interpolant`."""
        panels = max(1, len(self._values) // self._panel[0])
        edges = (self._period / panels) * np.arange(panels * self._loops + 1, dtype=np.float64)
        edges[-1] = self._period * self._loops
        # The highest harmonic turns by half of this much from the middle of a panel to its end.
        band = int(0.5 * pi * self._panel[0])
        return Interpolant(edges, _series(self._values, *self._panel), self._loops, self._channels.count, band)

    def perturbed(self, momentum: float) -> Perturbed:
        """As `Sampler.perturbed`: the harmonics that stand for those that are missing, changed by as much."""
        inverse, drift = self._tails
        missing, last = (momentum * inverse.error + drift.error, momentum * inverse.tail + drift.tail)
        # A copy: samples in work arrays are overwritten by the next motion.
        make = partial(_series, self._values.copy(), *self._panel, less=missing / last if last > 0.0 else 0.0)
        return Perturbed(make, self._hidden(momentum))

    def _turn(self, momentum: float) -> float:
        """A bound of how far the body turns in a loop, but for what averages out [rad]."""
        inverse, drift = self._tails
        return self._period * (momentum * inverse.largest + drift.largest)

    def _hidden(self, momentum: float) -> float:
        """What the tails cannot explain is no missing oscillation that averages out [rad]."""
        inverse, drift = self._unexplained
        return self._loops * 0.5 * self._period * (momentum * inverse + drift)

    def _times(self, index: Integers, count: int) -> Array:
        return (self._period / count) * index.astype(np.float64)

    def _take(self, values: Array) -> None:
        self._values = values
        found = (_errors_in_machine_code if engine.is_ready() else _errors)(values, self._tests)
        self._tails = [tail for tail, _ in found]
        self._unexplained = [_unexplained(_UNSEEN_BETWEEN * gap, tail) for tail, gap in found]

    @property
    def _decay(self) -> float:
        return min(tail.decay for tail in self._tails)

    @property
    def _at_rounding(self) -> bool:
        return all(tail.at_rounding for tail in self._tails) and not self._has_gaps

    @property
    def _has_gaps(self) -> bool:
        """Whether the series misses, between the nodes, what its spectrum does not show."""
        return any(self._unexplained)


def _errors(values: Array, tests: Array) -> list[tuple[TailEstimate, float]]:
    """What the spectra of I^-1 and I^-1 L_o tell, and the largest gap at tests (T, 9), of samples (N, 9)."""
    tails = [estimate_tail(norms, _TIME_ROUNDING) for norms in fourier_norms(values)]
    gaps = spectral_norms(_even_to_shares(len(values))[: len(tests)] @ values - tests).max(axis=0, initial=0.0)
    return list(zip(tails, gaps.tolist(), strict=True))


def _errors_in_machine_code(values: Array, tests: Array) -> list[tuple[TailEstimate, float]]:
    """The same."""
    shares = _even_to_shares(len(values))[: len(tests)]
    return [
        (TailEstimate(error, decay, converging > 0.0, at_rounding > 0.0, largest, floor, tail), gap)
        for error, decay, converging, at_rounding, largest, floor, tail, gap in errors_of_loop(
            values, tests, shares, _TIME_ROUNDING
        )
    ]


def _series(values: Array, samples_a_panel: int, degree: int, less: float = 0.0) -> Array:
    """Chebyshev coefficients (P, n, 9) of the Fourier series, with this share of its last terms taken off."""
    count, panels = len(values), max(1, len(values) // samples_a_panel)
    degree = degree if count > 1 else 0
    matrix = _even_to_panel(count, panels, degree, count // 2)
    if less:
        without = _even_to_panel(count, panels, degree, count // 2 - tail_length(count // 2))
        matrix = matrix + less * (without - matrix)
    # Panels differ only in where their samples begin: in two copies of the loop each finds its own contiguous.
    two_loops = np.concatenate([values, values])
    row, number = two_loops.strides
    from_each = np.ndarray((panels, count, 9), buffer=two_loops, strides=(count // panels * row, row, number))
    return matrix @ from_each


def _unexplained(gap: float, tail: TailEstimate) -> float:
    """The part of an error seen between the nodes that neither the tail of the spectrum nor rounding expects."""
    return gap if gap > tail.error + _ROUNDING_OF_TESTS * tail.floor else 0.0


@lru_cache(maxsize=32)
def _even_to_shares(count: int) -> Array:
    """Samples at `count` even times of a period -> values at `_TEST_SHARES` of it: (3, count)."""
    return _periodic_sinc(_TEST_SHARES.astype(np.longdouble), count).astype(np.float64)


def _periodic_sinc(shares: Any, count: int, highest: int | None = None) -> Any:
    """Samples at `count` even times of a period -> values at shares of it: (S,) -> (S, count), in extended precision.

    The sums of cos(k x) for |k| < count/2 and half the last term (count even), or for |k| up to `highest`, over
    `count`, in closed form: added up, they would be off by the rounding of every angle.
    """
    half_turns = np.pi * (shares[:, None] - np.arange(count, dtype=np.longdouble) / count)
    half_turns += _BEYOND_PI * (half_turns / np.pi)
    is_node = np.abs(half_turns) < _AT_NODE
    if highest is None or highest >= count // 2:
        at_node, above = 1.0, np.sin(count * half_turns) * np.cos(half_turns)
    else:
        at_node, above = (2 * highest + 1) / count, np.sin((2 * highest + 1) * half_turns)
    return np.where(is_node, at_node, above / (count * np.sin(np.where(is_node, 1.0, half_turns))))


@lru_cache(maxsize=32)
def _even_to_panel(count: int, panels: int, degree: int, highest: int) -> Array:
    """Samples at `count` even times of a period -> Chebyshev coefficients on the first of even panels.

    (degree + 1, count). Through the Fourier series up to a harmonic, whose last term is halved (count even).
    """
    if count == 1:
        return np.ones((1, 1))
    # As `values_to_coefficients`, in extended precision.
    terms = np.arange(degree + 1, dtype=np.longdouble)
    angles = (np.pi + np.longdouble(_BEYOND_PI)) / degree * terms
    to_coefficients = np.cos((terms[:, None] * terms) % (2 * degree) * (angles[1])) * (2.0 / degree)
    to_coefficients *= np.where(terms % 2 == 0.0, 1.0, -1.0)[:, None]
    to_coefficients[:, [0, -1]] *= 0.5
    to_coefficients[[0, -1], :] *= 0.5
    matrix = to_coefficients @ _periodic_sinc((0.5 - 0.5 * np.cos(angles)) / panels, count, highest)
    # What does not swing is far larger than what does, and loops repeat its rounding: samples that are all alike make a
    # series of one term.
    share = matrix.sum(axis=1) / count
    share[0] -= np.longdouble(1.0) / count
    return (matrix - share[:, None]).astype(np.float64)
