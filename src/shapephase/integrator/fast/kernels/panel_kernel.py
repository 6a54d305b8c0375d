"""Panels one after another: their series, the errors of these, and a round of sampling them."""

from __future__ import annotations

import math

import numpy as np

from ..estimate_constants import (
    AT_ROUNDING,
    CONVERGED_TAIL,
    CONVERGING,
    DECAY,
    DRIFT_NORM,
    EPS,
    FEW_TERMS,
    FLOOR,
    HALF_DEGREE,
    HIGHEST_DEGREE,
    INVERSE,
    INVERSE_NORM,
    LAST_TERMS,
    LEAST_DEGREE,
    LEAST_OF_FLOOR,
    MISSING_FACTOR,
    MOST_MISSING,
    MOST_RAISED,
    ROUNDED_TERM,
    ROUNDING,
    SLOWEST_DECAY,
    TINY,
    UNAVERAGED_PHASE,
)
from .jit import fused, kernel, part

_CHANNELS = 9
_DRIFT = 6
"""The first channel of I^-1 L_o; before it come three diagonal and three other entries of I^-1."""
_OTHERS = 3


@part
def norm_of_term(series, k, which):
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
def _columns(rows):
    """Of a matrix of `panels.halved_matrix`, and numbers in each half of a column, for so many samples."""
    half = (rows + 1) // 2
    return (half + 3) // 4 * 4, (half + 7) // 8 * 8


@fused
def _multiply(matrix, first, columns, width, numbers, line):
    """The numbers of a half of the line by those halves of the columns, four columns at a time."""
    o = np.uint32(first)
    for i in range(width):
        line[o + i] = 0.0
    for k in range(0, columns, 4):
        b0, b1 = np.uint32(2 * k * width + first), np.uint32(2 * (k + 1) * width + first)
        b2, b3 = np.uint32(2 * (k + 2) * width + first), np.uint32(2 * (k + 3) * width + first)
        n0, n1, n2, n3 = numbers[k], numbers[k + 1], numbers[k + 2], numbers[k + 3]
        for i in range(width):
            line[o + i] = (
                line[o + i] + matrix[b0 + i] * n0 + matrix[b1 + i] * n1 + matrix[b2 + i] * n2 + matrix[b3 + i] * n3
            )


@part
def _transform(values, matrix, rows, room, out):
    """Series (n * 9) through n values by a matrix of `panels.halved_matrix`.

    Even polynomials see the sums of values at opposite nodes, odd ones the differences. room: (3, n + 16)
    """
    half, (columns, width) = rows // 2, _columns(rows)
    sums, differences, line = room[0], room[1], room[2]
    for j in range(_CHANNELS):
        for k in range(half):
            a, b = values[k, j], values[rows - 1 - k, j]
            sums[k], differences[k] = a + b, a - b
        for k in range(half, columns):
            sums[k] = differences[k] = 0.0
        if rows % 2:
            sums[half] = values[half, j]
        _multiply(matrix, 0, columns, width, sums, line)
        _multiply(matrix, width, columns, width, differences, line)
        for i in range(rows):
            out[i * _CHANNELS + j] = line[i % 2 * width + i // 2]


@part
def _move_ends(values, matrix, rows, shift, out):
    """Values at the ends and the series through them, after these have moved along their slopes."""
    _, width = _columns(rows)
    for j in range(_CHANNELS):
        left = right = 0.0
        for k in range(1, rows):
            slope = float(k * k) * out[k * _CHANNELS + j]
            right += slope
            left += slope if k % 2 else -slope
        left, right = -shift * left, shift * right
        values[0, j] += left
        values[rows - 1, j] += right
        for i in range(rows):
            change = left - right if i % 2 else left + right
            out[i * _CHANNELS + j] += matrix[i % 2 * width + i // 2] * change


@part
def error_by_tail(largest, middle, tail, weighted, degree, rounding):
    """Of a spectrum's largest, middle and last terms, and of the sum of degrees times terms: as `estimate_tail`.

    Error and decay; whether it converges, whether its tail is rounding; what rounding alone leaves.
    """
    floor = ROUNDING * largest + 4.0 * rounding * weighted
    decay = math.log(max(middle, TINY) / max(tail, TINY)) * (2.0 / degree)
    beyond = 2.0 * tail / math.expm1(max(decay, TINY))
    rounded = tail <= floor
    error = max(min(beyond, (2.0 if rounded else float(degree)) * tail), LEAST_OF_FLOOR * floor)
    converging = rounded or tail < CONVERGED_TAIL * middle
    return error, math.inf if rounded else max(decay, 0.0), converging, rounded, floor


@part
def _estimate(series, degree, rounding, out):
    """The errors of a panel's series by its tail, as `estimate_spectra` has them."""
    out[DECAY], out[CONVERGING], out[AT_ROUNDING] = math.inf, 1.0, 1.0
    for which in range(2):
        if degree == 0:
            out[INVERSE + which], out[INVERSE_NORM + which] = 0.0, norm_of_term(series, 0, which)
            out[FLOOR + which] = EPS * out[INVERSE_NORM + which]
            continue
        largest = middle = tail = weighted = 0.0
        centre, start = degree // 2, degree - max(2, degree // 10)
        for k in range(degree + 1):
            size = norm_of_term(series, k, which)
            largest = max(largest, size)
            weighted += k * size
            if centre - 1 <= k <= centre + 1:
                middle = max(middle, size)
            if k > start:
                tail = max(tail, size)
        error, decay, converging, rounded, floor = error_by_tail(largest, middle, tail, weighted, degree, rounding)
        out[INVERSE + which], out[DECAY] = error, min(out[DECAY], decay)
        if not rounded:
            out[AT_ROUNDING] = 0.0
        if not converging:
            out[CONVERGING] = 0.0
        out[INVERSE_NORM + which], out[FLOOR + which] = largest, floor


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

    matrices, places: from values to coefficients, as `panels.halved_matrix` has them, and where that of a degree begins
    """
    room, first = np.empty((3, coefficients.shape[1] // _CHANNELS + 16)), 0
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
def _factors_of_refining(degree, table, rough, errors, share, factor):
    """As `refining_factors`; the last one is filled."""
    for panel in range(len(degree)):
        factor[panel] = 1
        if not rough[panel]:
            continue
        missing = math.log(max(errors[panel] / share[panel], 1.0)) / table[panel, DECAY]
        # Without any missing degrees, the error was seen between the nodes: the degree is doubled.
        if math.isnan(missing):
            missing = 0.0
        times = max(2, int(min(math.ceil(min(missing / degree[panel], 9.9) + 0.9), float(MOST_RAISED))))
        too_many = missing > MOST_MISSING * degree[panel] or times * degree[panel] > HIGHEST_DEGREE
        factor[panel] = 0 if too_many else times


@part
def _finer_panels(degree, left, right, factor, origin, times, degrees, ends):
    """As `FinerPanels.of`; the last four are filled, ends in two rows."""
    at = 0
    for panel in range(len(degree)):
        halves = 2 if factor[panel] == 0 else 1
        middle = 0.5 * (left[panel] + right[panel])
        for half in range(halves):
            origin[at], times[at] = panel, factor[panel]
            degrees[at] = HALF_DEGREE if factor[panel] == 0 else factor[panel] * degree[panel]
            ends[0, at] = middle if half else left[panel]
            ends[1, at] = middle if halves == 2 and not half else right[panel]
            at += 1


@part
def _times_of_fresh_samples(degree, factor, left, right, margin, nodes, places, times):
    """As `FinerPanels.fresh_times`, nodes as above; times are filled, and counted."""
    at = 0
    for panel in range(len(degree)):
        last, here, each = degree[panel], nodes[places[degree[panel]] :], factor[panel]
        middle, half = 0.5 * (left[panel] + right[panel]), 0.5 * (right[panel] - left[panel])
        for k in range(last + 1):
            if each and k % each == 0:
                continue
            times[at] = middle + half * here[k]
            if last and k == 0:
                times[at] = left[panel] + margin[panel]
            elif last and k == last:
                times[at] = right[panel] - margin[panel]
            at += 1
    return at


@part
def _merged_values(old_degree, old_values, origin, factor, degree, fresh, values):
    """As `FinerPanels.values`; the last one is filled."""
    at = new = first = 0
    panel = 0
    for finer in range(len(degree)):
        while panel < origin[finer]:
            first += old_degree[panel] + 1
            panel += 1
        each = factor[finer]
        for k in range(degree[finer] + 1):
            for j in range(_CHANNELS):
                if each and k % each == 0:
                    values[at, j] = old_values[first + k // each, j]
                else:
                    values[at, j] = fresh[new, j]
            if not (each and k % each == 0):
                new += 1
            at += 1


@part
def _share(phase, turn):
    return min(1.0, UNAVERAGED_PHASE / max(phase - turn, UNAVERAGED_PHASE))


@kernel
def errors_of_panels(degree, width, table, hidden, momentum, found):
    """Arguments as of `panels.errors_of_panels`; found (4, P) is filled."""
    for panel in range(len(degree)):
        row, wide = table[panel], width[panel]
        phase, turn = 2.0 * degree[panel], momentum * row[INVERSE_NORM] * wide
        whole_turn = turn + wide * row[DRIFT_NORM]
        share = _share(phase, whole_turn)
        error = 0.5 * wide * (momentum * row[INVERSE] + row[INVERSE + 1]) * (share if row[CONVERGING] > 0.0 else 1.0)
        of_path = noise = 0.0
        if len(hidden):
            path = hidden[panel]
            of_path = (share * path[0] + path[2]) * turn + share * path[1] + path[3]
            noise = path[4] * (1.0 + turn)
        found[0, panel], found[1, panel], found[2, panel] = max(error, of_path), of_path, noise
        found[3, panel] = whole_turn


@part
def _rounding_of(time, width):
    """Of times up to this one, in units of half a panel."""
    return 2.0 * math.ldexp(1.0, math.frexp(time)[1] - 53) / width


@kernel
def sample_round(
    old_degree, old_values, origin, factor, degree, left, right, fresh, hidden, momentum, tolerance, whole, loops,
    margin, of_width, matrices, places, nodes, node_places,
):  # fmt: skip
    """A round of sampling: the series through all samples, their errors, and what panels to go on with.

    Arguments
    ---------
    old_degree, old_values: (O,), (S, 9) of the panels before
    origin, factor, degree, left, right: (P,) each, what became of them, as of `FinerPanels`
    fresh: (F, 9) what was sampled since
    hidden: (P, 5) of a path that is resolved, else no rows
    whole: duration of all loops [s]
    margin, of_width: how far the ends of panels are moved at most [s], and of their width
    matrices, places: as of `series_of_panels`
    nodes, node_places: as of `times_of_samples`, of all degrees

    Returns values, coefficients, table and errors (4, P) as above; of the panels to go on with, origin, factor, degree,
    ends (2, Q) and the times of fresh samples; no panels: the errors are within the tolerance, or rounding.
    """
    panels, width, rounding, shift = len(degree), right - left, np.empty(len(degree)), np.zeros(len(degree))
    margins = np.empty(panels)
    for panel in range(panels):
        rounding[panel] = _rounding_of(abs(right[panel]), width[panel])
        margins[panel] = min(margin, of_width * width[panel])
        if degree[panel] and not factor[panel]:
            shift[panel] = 2.0 * margins[panel] / width[panel]
    values = np.empty((degree.sum() + panels, _CHANNELS))
    _merged_values(old_degree, old_values, origin, factor, degree, fresh, values)
    coefficients, table = np.empty((panels, (degree.max() + 1) * _CHANNELS)), np.empty((panels, 9))
    series_of_panels(degree, values, shift, rounding, matrices, places, coefficients, table)
    errors = np.empty((4, panels))
    errors_of_panels(degree, width, table, hidden, momentum, errors)
    rough, share, count = np.zeros(panels, np.bool_), np.empty(panels), 0
    for panel in range(panels):
        share[panel] = tolerance / whole * width[panel]
        is_rough = table[panel, AT_ROUNDING] == 0.0 or errors[1, panel] > share[panel]
        rough[panel] = errors[0, panel] > share[panel] and is_rough
        count += rough[panel]
    further = np.empty(panels, np.int64)
    if count == 0 or loops * errors[0].sum() <= tolerance:
        origins = np.empty((3, 0), np.int64)
        return values, coefficients, table, errors, further[:0], origins, np.empty((2, 0)), np.empty(0)
    _factors_of_refining(degree, table, rough, errors[0], share, further)
    count = panels
    for panel in range(panels):
        count += further[panel] == 0
    made, ends = np.empty((3, count), np.int64), np.empty((2, count))
    _finer_panels(degree, left, right, further, made[0], made[1], made[2], ends)
    margins = np.minimum(margin, of_width * (ends[1] - ends[0]))
    times = np.empty(made[2].sum() + count)
    found = _times_of_fresh_samples(made[2], made[1], ends[0], ends[1], margins, nodes, node_places, times)
    return values, coefficients, table, errors, further, made, ends, times[:found]


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
            size = (momentum * norm_of_term(here, k, 0) + norm_of_term(here, k, 1)) * width[panel]
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
def halve_panels(series, matrix, halves):
    """Arguments as of `panels.halves_of_panels`; halves (2 P, m * 9) are filled."""
    terms, kept = series.shape[1] // _CHANNELS, halves.shape[1] // _CHANNELS
    columns, width = (terms // 2 + 3) // 4 * 4, (kept + 7) // 8 * 8
    even, odd, line = np.zeros(columns), np.zeros(columns), np.empty(2 * width)
    for panel in range(len(series)):
        whole, first, second = series[panel], halves[2 * panel], halves[2 * panel + 1]
        for j in range(_CHANNELS):
            for k in range(1, terms):
                if k % 2:
                    odd[k // 2] = whole[k * _CHANNELS + j]
                else:
                    even[k // 2 - 1] = whole[k * _CHANNELS + j]
            _multiply(matrix, 0, columns, width, even, line)
            _multiply(matrix, width, columns, width, odd, line)
            # The mean, far larger than all else, is added at the end: it is rounded once, not with every term.
            mean = whole[j]
            for i in range(kept):
                a, b = line[i], line[width + i]
                second[i * _CHANNELS + j] = mean + (a + b)
                first[i * _CHANNELS + j] = mean + (b - a if i % 2 else a - b)
                mean = 0.0
