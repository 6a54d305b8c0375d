"""Panels one after another: their series, the errors of these, and how finely they are to be stepped."""

from __future__ import annotations

import math

import numpy as np

from ._jit import kernel, part
from .estimate_constants import (
    CONVERGED_TAIL,
    DEGREES_A_RADIAN,
    EPS,
    FEW_TERMS,
    LAST_TERMS,
    LEAST_DEGREE,
    LEAST_OF_FLOOR,
    MISSING_FACTOR,
    MOST_TURN,
    ORDER,
    ROUNDED_TERM,
    ROUNDING,
    SLOWEST_DECAY,
    TINY,
    UNAVERAGED_PHASE,
)

_CHANNELS = 9
_DRIFT = 6
"""The first channel of I^-1 L_o; before it come three diagonal and three other entries of I^-1."""
_OTHERS = 3


@part
def _norm(series, k, which):
    """Of the term k of a panel's series: of I^-1, or of I^-1 L_o."""
    total, k = 0.0, k * _CHANNELS
    if which:
        for j in range(_DRIFT, _CHANNELS):
            total += series[k + j] * series[k + j]
        return math.sqrt(total)
    for j in range(_OTHERS):
        total += series[k + j] * series[k + j]
    for j in range(_OTHERS, _DRIFT):
        total += 2.0 * series[k + j] * series[k + j]
    return math.sqrt(total)


@part
def _transform(values, matrix, rows, room, out):
    """Series (n * 9) through n values by a matrix that stands column after column; room: (9, n)."""
    for j in range(_CHANNELS):
        line = room[j]
        for i in range(rows):
            line[i] = 0.0
        for k in range(rows):
            column, value = matrix[k * rows : (k + 1) * rows], values[k, j]
            for i in range(rows):
                line[i] += column[i] * value
        for i in range(rows):
            out[i * _CHANNELS + j] = line[i]


@part
def _move_ends(values, matrix, rows, shift, out):
    """Values at the ends and the series through them, after these have moved along their slopes."""
    for j in range(_CHANNELS):
        left = right = 0.0
        for k in range(1, rows):
            slope = float(k * k) * out[k * _CHANNELS + j]
            right += slope
            left += slope if k % 2 else -slope
        left, right = -shift * left, shift * right
        values[0, j] += left
        values[rows - 1, j] += right
        last = (rows - 1) * rows
        for i in range(rows):
            out[i * _CHANNELS + j] += matrix[i] * left + matrix[last + i] * right


@part
def _estimate(series, degree, rounding, out):
    """The errors of a panel's series by its tail, as `estimate_spectra` has them."""
    out[2], out[3], out[4] = math.inf, 1.0, 1.0
    for which in range(2):
        if degree == 0:
            out[which], out[5 + which] = 0.0, _norm(series, 0, which)
            out[7 + which] = EPS * out[5 + which]
            continue
        largest = middle = tail = weighted = 0.0
        centre, start = degree // 2, degree - max(2, degree // 10)
        for k in range(degree + 1):
            size = _norm(series, k, which)
            largest = max(largest, size)
            weighted += k * size
            if centre - 1 <= k <= centre + 1:
                middle = max(middle, size)
            if k > start:
                tail = max(tail, size)
        floor = ROUNDING * largest + 4.0 * rounding * weighted
        decay = math.log(max(middle, TINY) / max(tail, TINY)) * (2.0 / degree)
        beyond = 2.0 * tail / math.expm1(max(decay, TINY))
        rounded = tail <= floor
        out[which] = max(min(beyond, (2.0 if rounded else float(degree)) * tail), LEAST_OF_FLOOR * floor)
        if not rounded:
            out[2] = min(out[2], max(decay, 0.0))
            out[4] = 0.0
            if not tail < CONVERGED_TAIL * middle:
                out[3] = 0.0
        out[5 + which], out[7 + which] = largest, floor


@kernel
def times_of_samples(degree, left, right, margin, nodes, places, times):
    """Arguments as of `panels.times_of_samples`; nodes of [-1, 1] and where those of a degree begin; times filled."""
    first = 0
    for panel in range(len(degree)):
        count, here = degree[panel] + 1, nodes[places[degree[panel]] :]
        middle, half = 0.5 * (left[panel] + right[panel]), 0.5 * (right[panel] - left[panel])
        for k in range(count):
            times[first + k] = middle + half * here[k]
        if count > 1:
            times[first] = left[panel] + margin[panel]
            times[first + count - 1] = right[panel] - margin[panel]
        first += count


@kernel
def series_of_panels(degree, values, shift, rounding, matrices, places, coefficients, table):
    """Arguments as of `panels.series_of_panels`; the last two, (P, n * 9) and (P, 9), are filled.

    matrices, places: from values to coefficients, column after column, and where those of a degree begin
    """
    room, first = np.empty((_CHANNELS, coefficients.shape[1] // _CHANNELS)), 0
    for panel in range(len(degree)):
        rows, series = degree[panel] + 1, coefficients[panel]
        here, matrix = values[first : first + rows], matrices[places[degree[panel]] :]
        first += rows
        _transform(here, matrix, rows, room, series)
        if shift[panel] != 0.0:
            _move_ends(here, matrix, rows, shift[panel], series)
        for i in range(rows * _CHANNELS, len(series)):
            series[i] = 0.0
        _estimate(series, degree[panel], rounding[panel], table[panel])


@part
def _share(phase, turn):
    return min(1.0, UNAVERAGED_PHASE / max(phase - turn, UNAVERAGED_PHASE))


@kernel
def errors_of_panels(degree, width, table, hidden, momentum, found):
    """Arguments as of `panels.errors_of_panels`; found (3, P) is filled."""
    for panel in range(len(degree)):
        row, wide = table[panel], width[panel]
        phase, turn = 2.0 * degree[panel], momentum * row[5] * wide
        share = _share(phase, turn + wide * row[6])
        error = 0.5 * wide * (momentum * row[0] + row[1]) * (share if row[3] > 0.0 else 1.0)
        of_path = noise = 0.0
        if len(hidden):
            path = hidden[panel]
            of_path = (share * path[0] + path[2]) * turn + share * path[1] + path[3]
            noise = path[4] * (1.0 + turn)
        found[0, panel], found[1, panel], found[2, panel] = max(error, of_path), of_path, noise


@kernel
def change_ends(degree, width, momentum, series):
    """As `perturbed_series`, in the place of the series (P, n * 9)."""
    sizes = np.empty(series.shape[1] // _CHANNELS)
    for panel in range(len(degree)):
        last, here = degree[panel], series[panel]
        if last < LEAST_DEGREE:
            continue
        start = max(1, min(3 * last // 5, last - LEAST_DEGREE))
        largest = late = middle = total = 0.0
        for k in range(len(sizes)):
            size = (momentum * _norm(here, k, 0) + _norm(here, k, 1)) * width[panel]
            largest, total = max(largest, size), total + size
            if last - LAST_TERMS < k <= last:
                late = max(late, size)
            elif start <= k < last - 1:
                middle = max(middle, size)
        middle = max(middle, late)
        decay = min((max(late, TINY) / max(middle, TINY)) ** (1.0 / max(last - 1 - start, 1)), SLOWEST_DECAY)
        fast = 2.0 * total / last
        missing = MISSING_FACTOR * (1.0 + FEW_TERMS / last) * decay / (1.0 - decay) * (1.0 + fast * fast)
        missing = min(missing, MISSING_FACTOR * last)
        if late <= ROUNDED_TERM * largest:
            missing = 1.0
        for i in range((last + 1 - LAST_TERMS) * _CHANNELS, (last + 1) * _CHANNELS):
            here[i] *= 1.0 - missing


@kernel
def sizes_of_terms(series, width, magnitude, least, rates, found):
    """Arguments as of `panels.sizes_of_terms`; the last two are filled."""
    for panel in range(len(width)):
        turn = last = 0.0
        for k in range(rates.shape[1]):
            size = (magnitude * _norm(series[panel], k, 0) + _norm(series[panel], k, 1)) * width[panel]
            rates[panel, k] = size
            turn += size
            if size > least:
                last = float(k)
        # Without momentum a steady turn is exact.
        radians = DEGREES_A_RADIAN * min(turn, MOST_TURN) if magnitude else 0.0
        swing = 0.0
        for k in range(0 if magnitude else 1, rates.shape[1]):
            swing += rates[panel, k] * (k + radians) ** ORDER
        found[0, panel], found[1, panel], found[2, panel] = turn, swing, last


@kernel
def most_degrees(rates, steps, least, most):
    """The most degrees that a step spans of terms above each of some sizes: (P, n), (P,), (B,) -> (B,)."""
    for row in range(len(least)):
        found = 0.0
        for panel in range(len(steps)):
            for k in range(rates.shape[1]):
                if rates[panel, k] > least[row]:
                    found = max(found, k / steps[panel])
        most[row] = found
