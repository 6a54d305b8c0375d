"""What the spectrum of a loop at even times tells of the samples' error, in one call."""

from __future__ import annotations

import math

import numpy as np

from ..estimate_constants import CONVERGED_TAIL, EPS, LEAST_OF_FLOOR, ROUNDING
from .jit import kernel, part


@part
def _tail(norms, time_rounding, found):
    """As `estimate_tail`: its seven fields in their order."""
    degree = len(norms) - 1
    largest = swinging = 0.0
    for k in range(degree + 1):
        largest = max(largest, norms[k])
        swinging += norms[k] * k
    if degree == 0:
        found[0], found[1], found[2], found[3] = 0.0, math.inf, 1.0, 1.0
        found[4], found[5], found[6] = largest, EPS * largest, 0.0
        return
    tail = middle = 0.0
    for k in range(degree + 1 - max(2, degree // 10), degree + 1):
        tail = max(tail, norms[k])
    for k in range(degree // 2 - 1, degree // 2 + 2):
        middle = max(middle, norms[k])
    floor = ROUNDING * largest + 4.0 * time_rounding * swinging
    decay = math.log(middle / tail) * 2.0 / degree if middle > tail and tail > 0.0 else 0.0
    beyond = 2.0 * tail / math.expm1(decay) if decay > 0.0 else math.inf
    at_floor = tail <= floor
    found[0] = max(min(beyond, (2.0 if at_floor else degree) * tail), LEAST_OF_FLOOR * floor)
    found[1] = math.inf if at_floor else decay
    found[2] = 1.0 if at_floor or tail < CONVERGED_TAIL * middle else 0.0
    found[3] = 1.0 if tail <= 0.05 * floor else 0.0
    found[4], found[5], found[6] = largest, floor, tail


@part
def _norms(row, pairs):
    """Of I^-1 and I^-1 L_o, of nine channels, each of `pairs` numbers one after another."""
    inverse = drift = 0.0
    for i in range(6 * pairs):
        inverse += (1.0 if i < 3 * pairs else 2.0) * row[i] * row[i]
    for i in range(6 * pairs, 9 * pairs):
        drift += row[i] * row[i]
    return math.sqrt(inverse), math.sqrt(drift)


@kernel
def errors_of_loop(spectrum, values, tests, shares, time_rounding, found):
    """Of even samples `values` (N, 9), N even or one, by their discrete Fourier transform (N // 2 + 1, 18).

    tests: (T, 9) seen at other times
    shares: (T, N) from the samples to these
    found: (2, 8) of I^-1 and of I^-1 L_o: the fields of `TailEstimate`, and the largest gap at a test
    """
    norms, scale = np.empty((2, len(spectrum))), 2.0 / len(values)
    for k in range(len(spectrum)):
        inverse, drift = _norms(spectrum[k], 2)
        norms[0, k], norms[1, k] = scale * inverse, scale * drift
    for kind in range(2):
        _tail(norms[kind], time_rounding, found[kind])
        found[kind, 7] = 0.0
    gap = np.empty(9)
    for test in range(len(tests)):
        for i in range(9):
            gap[i] = -tests[test, i]
        for k in range(len(values)):
            for i in range(9):
                gap[i] += shares[test, k] * values[k, i]
        inverse, drift = _norms(gap, 1)
        found[0, 7], found[1, 7] = max(found[0, 7], inverse), max(found[1, 7], drift)
