"""What the spectrum of a loop at even times tells of the samples' error, in one call."""

from __future__ import annotations

import math

import numpy as np

from ..estimate_constants import EPS
from .jit import kernel, part
from .panel_kernel import error_by_tail, norm_of_term


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
    error, decay, converging, _, floor = error_by_tail(largest, middle, tail, swinging, degree, time_rounding)
    found[0], found[1], found[2] = error, decay, 1.0 if converging else 0.0
    # More samples of a loop cost little, and only they show what is truly rounding.
    found[3] = 1.0 if tail <= 0.05 * floor else 0.0
    found[4], found[5], found[6] = largest, floor, tail


@kernel
def errors_of_loop(spectrum, values, tests, shares, time_rounding, found):
    """Of even samples `values` (N, 9), N even or one, by their discrete Fourier transform (N // 2 + 1, 18).

    tests: (T, 9) seen at other times
    shares: (T, N) from the samples to these
    found: (2, 8) of I^-1 and of I^-1 L_o: the fields of `TailEstimate`, and the largest gap at a test
    """
    norms, scale = np.empty((2, len(spectrum))), 2.0 / len(values)
    for kind in range(2):
        for k in range(len(spectrum)):
            real, imaginary = norm_of_term(spectrum[k], 0, kind), norm_of_term(spectrum[k], 1, kind)
            norms[kind, k] = scale * math.sqrt(real * real + imaginary * imaginary)
        _tail(norms[kind], time_rounding, found[kind])
        found[kind, 7] = 0.0
    gap = np.empty(9)
    for test in range(len(tests)):
        for i in range(9):
            gap[i] = -tests[test, i]
        for k in range(len(values)):
            for i in range(9):
                gap[i] += shares[test, k] * values[k, i]
        for kind in range(2):
            found[kind, 7] = max(found[kind, 7], norm_of_term(gap, 0, kind))
