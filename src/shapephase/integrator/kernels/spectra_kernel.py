"""Error estimates from the series of panels, and series changed by such errors."""

from __future__ import annotations

import math

import numpy as np

from ..constants import BEYOND_LAST_TERMS, CHANGED_LAST_TERMS, EPS, ROUNDED_SAMPLES, SLOWEST_DECAY
from ..machine_code import inline, kernel

COLUMNS = 10  # of the table that `judge` fills, in this order
GOOD, CHANGE, NOISY, BETWEEN, MISSING, ALLOWED, LATE, CONDITION, INVERSE, DRIFT = range(COLUMNS)
_NOISE_STAYS = 0.5  # ratio of last terms to those of the panel's parent: 1 for noise, smaller for anything smooth
_NOISE = 1e-6  # of the largest term: noise is far below
_TINY = 1e-300


@inline
def _sizes(c):
    """|I^-1| by its entries, and |I^-1 L_o|, from the nine channels."""
    inverse = c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + 2.0 * (c[3] * c[3] + c[4] * c[4] + c[5] * c[5])
    return math.sqrt(inverse), math.sqrt(c[6] * c[6] + c[7] * c[7] + c[8] * c[8])


@inline
def _condition(c):
    """A bound of the condition of the inertia, from trace and determinant of I^-1: t^3/4 d; the identity has 7."""
    trace = c[0] + c[1] + c[2]
    determinant = (
        c[0] * (c[1] * c[2] - c[3] * c[3]) - c[5] * (c[5] * c[2] - c[3] * c[4]) + c[4] * (c[5] * c[3] - c[1] * c[4])
    )
    return 0.25 * trace * trace * trace / max(determinant, _TINY)


@kernel
def judge(series, widths, spacing, before, momentum, rate, table):
    """Judge series (P, degree + 1, 9) of one degree, for momenta up to a magnitude; `table` (P, COLUMNS) is filled.

    The two last terms bound those missing beyond them, by the factor by which terms fall from the middle to the end:
    single terms are small by chance, or by a motion's symmetry. Missing terms swing as often over the panel as their
    degree, less the angle by which the body turns in it.

    widths, spacing: (P,) [s] of panels, and of floating-point numbers at their ends
    before: (P,) the last terms, at this degree, of the panel that each is a half of [rad/s]
    rate: that series may be off by [rad/s]
    """
    degree = series.shape[1] - 1
    for panel in range(len(series)):
        c, row, width = series[panel], table[panel], widths[panel]
        largest, turn, slope, middle, late, of_inverse, of_drift = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(degree + 1):
            inverse, drift = _sizes(c[k])
            size = momentum * inverse + drift
            of_inverse, of_drift = of_inverse + inverse, of_drift + drift
            largest, turn, slope = max(largest, size), turn + size, slope + k * size
            if k >= degree - 1:
                late = max(late, size)
            elif k >= degree // 2:
                middle = max(middle, size)
        row[CONDITION], row[INVERSE], row[DRIFT], row[LATE] = _condition(c[0]), of_inverse, of_drift, late
        if degree == 0:
            row[GOOD], row[CHANGE], row[NOISY], row[BETWEEN], row[MISSING] = 1.0, 0.0, 0.0, 0.0, 0.0
            row[ALLOWED] = rate
            continue
        decay = min((max(late, _TINY) / max(middle, late, _TINY)) ** (2.0 / degree), SLOWEST_DECAY)
        rounded = ROUNDED_SAMPLES * EPS * largest + 4.0 * spacing[panel] / width * slope
        noisy = late <= rounded or (late >= _NOISE_STAYS * before[panel] and late <= _NOISE * largest)
        swings = max(degree - width * turn, 1.0)
        beyond = decay / (1.0 - decay)
        missing = late * beyond
        row[GOOD] = 1.0 if noisy or missing <= rate * swings else 0.0
        row[CHANGE] = (
            1.0 if noisy else min(CHANGED_LAST_TERMS * (1.0 + BEYOND_LAST_TERMS / degree) * beyond, 1.0 * degree)
        )
        row[NOISY] = 1.0 if noisy else 0.0
        row[BETWEEN] = (max(missing, late) if noisy else missing) * width / swings
        row[MISSING] = 0.0 if noisy else missing / swings
        row[ALLOWED] = rate * swings + rounded


@kernel
def change(series, degrees, shares, noisy, signs, changed):
    """Fill `changed` (P, n, 9) with series whose last two terms are changed by shares (P,) of themselves.

    Where these terms are noise, the last of them is added to the first, with signs (P,) by chance: all terms have as
    much of it, and the first turns the body most.
    """
    for panel in range(len(series)):
        last = degrees[panel]
        for k in range(series.shape[1]):
            factor = 1.0 - shares[panel] if last >= 2 and last - 1 <= k <= last else 1.0
            for j in range(9):
                changed[panel, k, j] = factor * series[panel, k, j]
        if last >= 2 and noisy[panel] > 0.0:
            for j in range(9):
                changed[panel, 0, j] += signs[panel] * series[panel, last, j]


@kernel
def plan(series, widths, momentum, least, turns, degrees):
    """Fill how far bodies turn on panels (P,) [rad], and the highest terms (P,) that turn them by `least` [rad]."""
    for panel in range(len(series)):
        turn, degree = 0.0, 0.0
        for k in range(series.shape[1]):
            inverse, drift = _sizes(series[panel, k])
            size = (momentum * inverse + drift) * widths[panel]
            turn += size
            if size > least:
                degree = 1.0 * k
        turns[panel], degrees[panel] = turn, degree


@inline
def _turn(p, q, out):
    """Twice the vector of p^-1 q, quaternions (4,) near each other."""
    sign = 2.0 if p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3] >= 0.0 else -2.0
    out[0] = sign * (p[3] * q[0] - q[3] * p[0] - p[1] * q[2] + p[2] * q[1])
    out[1] = sign * (p[3] * q[1] - q[3] * p[1] - p[2] * q[0] + p[0] * q[2])
    out[2] = sign * (p[3] * q[2] - q[3] * p[2] - p[0] * q[1] + p[1] * q[0])


@inline
def _adjugate(m, out):
    out[0, 0], out[0, 1] = m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1], m[0, 2] * m[2, 1] - m[0, 1] * m[2, 2]
    out[0, 2], out[1, 0] = m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1], m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2]
    out[1, 1], out[1, 2] = m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0], m[0, 2] * m[1, 0] - m[0, 0] * m[1, 2]
    out[2, 0], out[2, 1] = m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0], m[0, 1] * m[2, 0] - m[0, 0] * m[2, 1]
    out[2, 2] = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]


@kernel
def growths(marked, turn, largest_growths):
    """Fill the largest growths (B,) of a small turn from one mark to a later one.

    The turns by which an error is known, rows of (3, 3), are propagators P; from one mark to a later one an error grows
    by P_i^-1 P_j, whose determinant is one. With singular values near s, 1 and 1/s, s follows from the sum of the
    squares of its entries; where the middle one is another, it is at most 4 % too low or 41 % too high.

    marked: (B, M, 4, 4) attitudes at marks, then those of starts turned by `turn` about each axis
    """
    marks = marked.shape[1]
    matrices, inverses = np.empty((marks, 3, 3)), np.empty((marks, 3, 3))
    for row in range(len(marked)):
        largest = 1.0
        for later in range(marks):
            for axis in range(3):
                _turn(marked[row, later, 0], marked[row, later, axis + 1], matrices[later, axis])
                for i in range(3):
                    matrices[later, axis, i] /= turn
            _adjugate(matrices[later], inverses[later])
            for earlier in range(later):
                squares = 0.0
                for i in range(3):
                    for j in range(3):
                        entry = 0.0
                        for k in range(3):
                            entry += inverses[earlier, i, k] * matrices[later, k, j]
                        squares += entry * entry
                # No comparison holds for what is not a number.
                largest = max(largest, 0.5 * (squares - 1.0)) if squares < math.inf else math.inf
        largest_growths[row] = (
            math.sqrt(largest + math.sqrt(largest * largest - 1.0)) if largest < math.inf else math.inf
        )


def warm() -> None:
    """Call the kernels with the least that they take."""
    one, series = np.ones(1), np.zeros((1, 9, 9))
    judge(series, one, one, one, 1.0, 1.0, np.zeros((1, COLUMNS)))
    change(series, np.zeros(1, dtype=np.int64), one, one, one, series.copy())
    plan(series, one, 1.0, 1.0, one, one)
    growths(np.ones((1, 1, 4, 4)), 1.0, one)
