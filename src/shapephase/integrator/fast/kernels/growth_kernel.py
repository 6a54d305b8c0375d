"""How errors grow from one time to a later one, from the error propagators of many momenta."""

from __future__ import annotations

import math

import numpy as np

from ..estimate_constants import EPS, ROUNDING_OF_RADIAN, ROUNDING_OF_START, ROUNDING_OF_STEP
from .jit import kernel, part


@part
def _adjugate(m, out):
    out[0], out[1], out[2] = m[4] * m[8] - m[5] * m[7], m[2] * m[7] - m[1] * m[8], m[1] * m[5] - m[2] * m[4]
    out[3], out[4], out[5] = m[5] * m[6] - m[3] * m[8], m[0] * m[8] - m[2] * m[6], m[2] * m[3] - m[0] * m[5]
    out[6], out[7], out[8] = m[3] * m[7] - m[4] * m[6], m[1] * m[6] - m[0] * m[7], m[0] * m[4] - m[1] * m[3]


@part
def _squares_of_product(a, b):
    total = 0.0
    for i in range(3):
        for j in range(3):
            entry = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j]
            total += entry * entry
    return total


@part
def _largest_growth(matrices, adjugates):
    """By the sum of the squares of the singular values, which are s, 1 and 1/s."""
    largest, total = 1.0, 0.0
    for k in range(len(matrices)):
        _adjugate(matrices[k], adjugates[k])
        for i in range(9):
            total += matrices[k, i]
    for later in range(1, len(matrices)):
        for earlier in range(later):
            largest = max(largest, 0.5 * (_squares_of_product(matrices[later], adjugates[earlier]) - 1.0))
    known = math.isfinite(total) and math.isfinite(largest)
    return math.sqrt(largest + math.sqrt(largest * largest - 1.0)) if known else math.inf


@kernel
def growths_and_rounding(propagators, quaternions, growths, rounding):
    """The largest growth of an error, and the rounding of all steps grown by it: (B, M, 9), (B, K + 1, 4) -> (B,) each.

    Without propagators nothing grows.
    """
    adjugates = np.empty((propagators.shape[1], 9))
    for row in range(len(quaternions)):
        motion, turned = quaternions[row], 0.0
        for k in range(1, len(motion)):
            square = 0.0
            for i in range(4):
                chord = motion[k, i] - motion[k - 1, i]
                square += chord * chord
            turned += 2.0 * math.sqrt(square)
        growths[row] = _largest_growth(propagators[row], adjugates)
        committed = ROUNDING_OF_START + ROUNDING_OF_STEP * math.sqrt(len(motion) - 1.0) + ROUNDING_OF_RADIAN * turned
        rounding[row] = EPS * growths[row] * committed
