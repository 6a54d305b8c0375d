"""The attitude of many momenta stepped three times on the same series, eight momenta side by side.

What is known of a momentum stands in rows of LANES numbers (their numbers below), one lane for each momentum. Steps
are taken in chunks of a few segments, whose channels serve all momenta; a single momentum is the same with one lane.
"""

from __future__ import annotations

import math

import numpy as np

from .jit import inline, kernel, part
from .stage_series import CHANNELS as _CHANNELS
from .stage_series import (
    SEGMENT,
    SIZE,
    basis_of,
    channels_at,
    pairs_before_single,
    room_for_bases,
    shorten_single,
    terms_that_count,
    terms_that_differ,
    with_few_others,
)
from .steps_at_rest import rest_step
from .steps_with_momentum import grown, momentum_step, product
from .trigonometry import cos_sin

LANES = 8
_MAGNITUDE = 0
_START = LANES
"""Rows of the direction at the start of a step; then come those of its end."""
_END = 4 * LANES
_TURN = 7 * LANES
_DYNAMIC = 8 * LANES
_QUATERNION = 9 * LANES
_PROPAGATOR = 13 * LANES
_STATE = 22 * LANES
_RECORD = 9 * LANES
"""Of a step what is kept: direction, turn, dynamic phase and quaternion at its end."""
_STAGES = 12
_FEW_TERMS = 4
"""Up to so many terms of a perturbed series are added one by one."""


@inline
def _step(c, b, s, lanes):
    for i in range(lanes):
        u, v, w, turn, dynamic = momentum_step(
            c, b, s[_MAGNITUDE + i], s[_START + i], s[_START + LANES + i], s[_START + 2 * LANES + i]
        )
        s[_END + i], s[_END + LANES + i], s[_END + 2 * LANES + i] = u, v, w
        s[_TURN + i], s[_DYNAMIC + i] = turn, dynamic


@inline
def _turn(s, lanes):
    """The attitude: turned about the direction at the start, then the shortest way to the one at the end."""
    for i in range(lanes):
        x, y, z = s[_START + i], s[_START + LANES + i], s[_START + 2 * LANES + i]
        u, v, w = s[_END + i], s[_END + LANES + i], s[_END + 2 * LANES + i]
        cosine, sine = cos_sin(0.5 * s[_TURN + i])
        # The axis of the second turn is at a right angle to that of the first.
        b0 = cosine * (v * z - w * y) + sine * (x + u)
        b1 = cosine * (w * x - u * z) + sine * (y + v)
        b2 = cosine * (u * y - v * x) + sine * (z + w)
        b3 = cosine * (1.0 + (x * u + y * v + z * w))
        a0, a1, a2, a3 = product(
            s[_QUATERNION + i], s[_QUATERNION + LANES + i], s[_QUATERNION + 2 * LANES + i],
            s[_QUATERNION + 3 * LANES + i], b0, b1, b2, b3,
        )  # fmt: skip
        scale = 1.0 / math.sqrt(a0 * a0 + a1 * a1 + a2 * a2 + a3 * a3)
        s[_QUATERNION + i], s[_QUATERNION + LANES + i] = a0 * scale, a1 * scale
        s[_QUATERNION + 2 * LANES + i], s[_QUATERNION + 3 * LANES + i] = a2 * scale, a3 * scale


@inline
def _grow(c, b, s, lanes):
    for i in range(lanes):
        x, y = s[_START + i] + s[_END + i], s[_START + LANES + i] + s[_END + LANES + i]
        z = s[_START + 2 * LANES + i] + s[_END + 2 * LANES + i]
        scale = s[_MAGNITUDE + i] / math.sqrt(x * x + y * y + z * z)
        x, y, z = scale * x, scale * y, scale * z
        g = _PROPAGATOR + i
        g0, g1, g2, g3, g4, g5, g6, g7, g8 = grown(
            c, b, x, y, z, s[g], s[g + LANES], s[g + 2 * LANES], s[g + 3 * LANES], s[g + 4 * LANES],
            s[g + 5 * LANES], s[g + 6 * LANES], s[g + 7 * LANES], s[g + 8 * LANES],
        )  # fmt: skip
        s[g], s[g + LANES], s[g + 2 * LANES] = g0, g1, g2
        s[g + 3 * LANES], s[g + 4 * LANES], s[g + 5 * LANES] = g3, g4, g5
        s[g + 6 * LANES], s[g + 7 * LANES], s[g + 8 * LANES] = g6, g7, g8


@part
def _march_lanes(table, lengths, s, lanes, record, grows, done, marks, kept):
    """The steps of a chunk for momenta side by side, from the state s to the next.

    lengths: steps of each segment of the table
    record: of every step, in rows of _RECORD
    grows: whether to step the propagators too; those after `marks` steps of all (`done` before the chunk) go to `kept`
    """
    at = mark = 0
    while mark < len(marks) and marks[mark] <= done:
        mark += 1
    for segment in range(len(lengths)):
        c = table[segment]
        for k in range(lengths[segment]):
            b = np.uint32(k * _STAGES)
            _step(c, b, s, lanes)
            _turn(s, lanes)
            if grows:
                _grow(c, b, s, lanes)
                while mark < len(marks) and marks[mark] == done + at + 1:
                    for i in range(9 * LANES):
                        kept[mark, i] = s[_PROPAGATOR + i]
                    mark += 1
            for i in range(3 * LANES):
                s[_START + i] = s[_END + i]
            for i in range(_RECORD):
                record[at, i] = s[_END + i]
            at += 1


@part
def _apart(count, ends, a, b, lane, worst):
    """The largest square of a distance of quaternions, of rows of a from `count` of b; NaN stays NaN."""
    for k in range(count):
        minus = plus = 0.0
        for i in range(5, 9):
            x, y = a[ends[k], i * LANES + lane], b[k, i * LANES + lane]
            minus += (x - y) * (x - y)
            plus += (x + y) * (x + y)
        # A quaternion and its negative are one attitude.
        square = min(minus, plus)
        if not square <= worst:
            worst = square
    return worst


@part
def _find_ends(lengths, ends):
    """The last steps of all pairs of a chunk, of segments with so many steps; how many pairs there are."""
    first = count = 0
    for segment in range(len(lengths)):
        before = pairs_before_single(lengths[segment])
        for pair in range((lengths[segment] + 1) // 2):
            ends[count] = first + 2 * pair + (1 if pair < before else 0)
            count += 1
        first += lengths[segment]
    return count


@part
def _begin(states, directions, magnitudes, lanes):
    """The state of all three marches of groups of momenta; lanes without one repeat the last."""
    for group in range(len(states)):
        for i in range(LANES):
            row = min(group * lanes + min(i, lanes - 1), len(magnitudes) - 1)
            for which in range(3):
                s = states[group, which]
                for j in range(9, 22):
                    s[j * LANES + i] = 1.0 if j in (12, 13, 17, 21) else 0.0
                s[_MAGNITUDE + i] = magnitudes[row]
                for j in range(3):
                    s[_START + j * LANES + i] = directions[row, j]


@part
def _tabulate(
    first, last, panels, starts, widths, series, perturbed, steps, bases, of_bases, scaled, tables, lengths
):  # fmt: skip
    """The channels of segments `first` to `last`: of the steps, of pairs of them, of these on perturbed series."""
    most_terms = series.shape[1] // _CHANNELS
    for segment in range(first, last):
        panel, place = panels[segment], segment - first
        count = min(SEGMENT, steps[panel] - starts[segment])
        lengths[0, place], lengths[1, place] = count, (count + 1) // 2
        c, factor = series[panel], widths[panel] / steps[panel]
        terms = terms_that_count(c)
        few = True
        if len(perturbed):
            few = terms_that_differ(c, perturbed[panel]) <= _FEW_TERMS
            terms = max(terms, terms_that_count(perturbed[panel]))
        row, used = basis_of(starts[segment], count, steps[panel], 1, most_terms, bases, of_bases)
        channels_at(c, terms, factor, bases[row], used, 0, scaled, tables[0, place])
        row, used = basis_of(starts[segment], count, steps[panel], 2, most_terms, bases, of_bases)
        basis = bases[row]
        channels_at(c, terms, 2.0 * factor, basis, used, 0, scaled, tables[1, place])
        if len(perturbed):
            other, out = perturbed[panel], tables[2, place]
            if few:
                with_few_others(c, other, terms, 2.0 * factor, basis, used, 0, tables[1, place], out)
            else:
                channels_at(other, terms, 2.0 * factor, basis, used, 0, scaled, out)
            shorten_single(count, out)
        shorten_single(count, tables[1, place])


@part
def _segments(steps, panels, starts):
    """Panel and first step of every segment; how many there are."""
    count = 0
    for panel in range(len(steps)):
        for start in range(0, steps[panel], SEGMENT):
            if len(panels):
                panels[count], starts[count] = panel, start
            count += 1
    return count


@kernel
def march_momenta(
    widths, series, perturbed, steps, loops, directions, magnitudes, marks, lanes, most_segments,
    quaternions, ends, turns, dynamics, propagators, stepping, truncation,
):  # fmt: skip
    """All steps of all loops, pairs of them, and these on perturbed series; what is after `most_segments` is filled.

    widths: (P,) [s]
    series, perturbed: (P, n * 9) times one second; no rows of the latter: not marched on
    steps: (P,) at least two; odd numbers are no larger than a segment
    marks: after how many steps propagators are kept, (M,)
    lanes: 1 or LANES
    most_segments: of a chunk
    quaternions, ends, turns, dynamics: (B, K + 1, 4), (B, K + 1, 3), (B, K), (B, K)
    propagators: (B, M, 9) or (B, 0, 9)
    stepping, truncation: (B,) largest angles between the marches
    """
    rows, total = len(magnitudes), _segments(steps, np.empty(0, np.int64), np.empty(0, np.int64))
    panels, starts = np.empty(total, np.int64), np.empty(total, np.int64)
    _segments(steps, panels, starts)
    room = min(total, most_segments)
    terms, grows, perturbs = series.shape[1] // _CHANNELS, propagators.shape[1] > 0, len(perturbed) > 0
    (bases, of_bases), scaled = room_for_bases(terms), np.empty((terms + 4) * _CHANNELS)
    tables, lengths = np.empty((3, room, SIZE)), np.empty((2, room), np.int64)
    record = np.empty((room * SEGMENT, _RECORD))
    in_pairs, cut = np.empty((room * SEGMENT // 2, _RECORD)), np.empty((room * SEGMENT // 2, _RECORD))
    ends_of_pairs, each = np.empty(room * SEGMENT // 2, np.int64), np.arange(room * SEGMENT // 2)
    kept, none = np.empty((len(marks), 9 * LANES)), np.empty(0, np.int64)
    states = np.empty(((rows + lanes - 1) // lanes, 3, _STATE))
    _begin(states, directions, magnitudes, lanes)
    for row in range(rows):
        quaternions[row, 0, 0] = quaternions[row, 0, 1] = quaternions[row, 0, 2] = 0.0
        quaternions[row, 0, 3] = 1.0
        for i in range(3):
            ends[row, 0, i] = directions[row, i]
        for mark in range(propagators.shape[1]):
            for i in range(9):
                propagators[row, mark, i] = 1.0 if i % 4 == 0 else 0.0
        stepping[row] = truncation[row] = 0.0
    done = 0
    for loop in range(loops):
        for first in range(0, total, room):
            last = min(first + room, total)
            if loop == 0 or total > room:
                _tabulate(
                    first, last, panels, starts, widths, series, perturbed, steps, bases, of_bases, scaled, tables,
                    lengths,
                )  # fmt: skip
            counts, pairs = lengths[0, : last - first], lengths[1, : last - first]
            found = _find_ends(counts, ends_of_pairs)
            count = 0
            for segment in range(last - first):
                count += counts[segment]
            for group in range(len(states)):
                state = states[group]
                _march_lanes(tables[0], counts, state[0], lanes, record, grows, done, marks, kept)
                _march_lanes(tables[1], pairs, state[1], lanes, in_pairs, False, 0, none, kept)
                if perturbs:
                    _march_lanes(tables[2], pairs, state[2], lanes, cut, False, 0, none, kept)
                for lane in range(min(lanes, rows - group * lanes)):
                    row = group * lanes + lane
                    stepping[row] = _apart(found, ends_of_pairs, record, in_pairs, lane, stepping[row])
                    if perturbs:
                        truncation[row] = _apart(found, each, in_pairs, cut, lane, truncation[row])
                    for k in range(count):
                        for i in range(3):
                            ends[row, done + k + 1, i] = record[k, i * LANES + lane]
                        turns[row, done + k] = record[k, 3 * LANES + lane]
                        dynamics[row, done + k] = record[k, 4 * LANES + lane]
                        for i in range(4):
                            quaternions[row, done + k + 1, i] = record[k, (5 + i) * LANES + lane]
                    for mark in range(propagators.shape[1]):
                        if done < marks[mark] <= done + count:
                            for i in range(9):
                                propagators[row, mark, i] = kept[mark, i * LANES + lane]
            done += count
    for row in range(rows):
        stepping[row], truncation[row] = 2.0 * math.sqrt(stepping[row]), 2.0 * math.sqrt(truncation[row])


@inline
def _turn_on(c, count, at, quaternions):
    """The steps of a segment without momentum, from quaternions[at] on."""
    x, y, z, w = quaternions[at, 0], quaternions[at, 1], quaternions[at, 2], quaternions[at, 3]
    for k in range(count):
        b0, b1, b2, b3 = rest_step(c, np.uint32(k * _STAGES))
        x, y, z, w = product(x, y, z, w, b0, b1, b2, b3)
        scale = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
        x, y, z, w = x * scale, y * scale, z * scale, w * scale
        at += 1
        quaternions[at, 0], quaternions[at, 1], quaternions[at, 2], quaternions[at, 3] = x, y, z, w


@kernel
def march_at_rest(widths, series, steps, quaternions):
    """The quaternions (K + 1, 4) after all steps of one loop without momentum; the other arguments as above."""
    terms = series.shape[1] // _CHANNELS
    (bases, of_bases), scaled = room_for_bases(terms), np.empty((terms + 4) * _CHANNELS)
    c, at = np.empty(SIZE), 0
    quaternions[0, 0] = quaternions[0, 1] = quaternions[0, 2] = 0.0
    quaternions[0, 3] = 1.0
    for panel in range(len(steps)):
        count, factor = terms_that_count(series[panel]), widths[panel] / steps[panel]
        for start in range(0, steps[panel], SEGMENT):
            here = min(SEGMENT, steps[panel] - start)
            row, used = basis_of(start, here, steps[panel], 1, terms, bases, of_bases)
            channels_at(series[panel], count, factor, bases[row], used, 6, scaled, c)
            _turn_on(c, here, at, quaternions)
            at += here
