"""The channels at the stages of steps, from Chebyshev series: matrix products whose innermost loop is over stages.

A segment is up to SEGMENT steps of one panel; its channels stand in rows of STRIDE numbers, one row for each channel,
twelve numbers for each step. Row numbers are unsigned: the check for negative ones would keep a loop from becoming
vectors.
"""

from __future__ import annotations

import numpy as np

from .dormand_prince import NODES, STAGES
from .jit import fused, inline, part

CHANNELS = 9
SEGMENT = 16
"""Steps."""
STRIDE = SEGMENT * STAGES
SIZE = CHANNELS * STRIDE
"""Of the channels of a segment."""
_VECTOR = 16
"""Stages are filled up to a multiple of this, so that vectors have no remainder."""
_BASES = 4
"""That are kept, since panels often take as many steps as others: of odd and even numbers, one or two at a time."""
_ROUNDING = 3e-17
"""Of the largest coefficient: the last ones, as long as their sum is below, change nothing."""
_DRIFT = 6
"""The first channel of I^-1 L_o."""


@inline
def rows_of(terms):
    """Of the basis for so many terms: the first and a multiple of four."""
    return 1 + (max(terms, 2) + 2) // 4 * 4


@inline
def room_for_basis(terms):
    """Numbers in the matrix of Chebyshev polynomials at stages of a segment."""
    return rows_of(terms) * STRIDE


@part
def terms_that_count(series):
    """How many terms of a panel's nine series (n * 9) matter."""
    count = len(series) // CHANNELS
    inverse = drift = inverse_tail = drift_tail = 0.0
    for k in range(count):
        for j in range(_DRIFT):
            inverse = max(inverse, abs(series[k * CHANNELS + j]))
        for j in range(_DRIFT, CHANNELS):
            drift = max(drift, abs(series[k * CHANNELS + j]))
    while count > 1:
        for j in range(_DRIFT):
            inverse_tail += abs(series[(count - 1) * CHANNELS + j])
        for j in range(_DRIFT, CHANNELS):
            drift_tail += abs(series[(count - 1) * CHANNELS + j])
        if inverse_tail > _ROUNDING * inverse or drift_tail > _ROUNDING * drift:
            break
        count -= 1
    return count


@part
def basis_between(used, terms, basis):
    """T_0, T_1 ... of so many terms at `used` places in [-1, 1], which stand in the second row; how many are filled."""
    while used % _VECTOR:
        basis[STRIDE + used] = 0.0
        used += 1
    for i in range(used):
        basis[i] = 1.0
    for k in range(2, rows_of(terms)):
        b, b1, b2 = np.uint32(k * STRIDE), np.uint32((k - 1) * STRIDE), np.uint32((k - 2) * STRIDE)
        for i in range(used):
            basis[b + i] = 2.0 * basis[STRIDE + i] * basis[b1 + i] - basis[b2 + i]
    return used


@inline
def pairs_before_single(count):
    """Of an odd number of steps those before the one that is alone, as in `ends_of_pairs`; of an even number all."""
    return (count + 1) // 4 if count % 2 else count // 2


@part
def room_for_bases(terms):
    """For the bases that `basis_of` keeps, and what they are of."""
    return np.empty((_BASES, room_for_basis(terms))), np.zeros((_BASES, 4), np.int64)


@part
def basis_of(first, count, steps, together, terms, bases, kept):
    """The row of `bases` with T_0, T_1 ... at the stages of `count` steps from `first` on, of `steps` on the panel.

    And how many numbers of it are filled.

    together: 1; 2: they are taken two at a time, one of an odd number alone, which `shorten_single` makes half as long
    bases, kept: as `room_for_bases` makes them for so many terms
    """
    row = 2 * (together - 1) + steps % 2
    if kept[row, 0] == steps and kept[row, 1] == first and kept[row, 2] == count:
        return row, kept[row, 3]
    basis, used, k, single = bases[row], 0, 0, 2 * pairs_before_single(count)
    while k < count:
        length = 1 if k == single else together
        for i in range(STAGES):
            basis[STRIDE + used] = 2.0 * (first + k + length * NODES[i]) / steps - 1.0
            used += 1
        k += length
    kept[row, 0], kept[row, 1], kept[row, 2] = steps, first, count
    kept[row, 3] = basis_between(used, terms, basis)
    return row, kept[row, 3]


@part
def shorten_single(count, out):
    """Of `count` steps that were taken two at a time the one that is alone, if there is one, made half as long."""
    if count % 2:
        for j in range(CHANNELS):
            o = np.uint32(j * STRIDE + pairs_before_single(count) * STAGES)
            for i in range(STAGES):
                out[o + i] = 0.5 * out[o + i]


@fused
def channels_at(series, terms, factor, basis, used, first_channel, scaled, out):
    """Series (n * 9) times a factor at the stages of a segment; the channels from `first_channel` on, one of 0, 3, 6.

    scaled: room for (terms + 4) * 9
    """
    for k in range(terms * CHANNELS):
        scaled[k] = factor * series[k]
    # Four terms at a time after the first.
    rows = rows_of(terms)
    for k in range(terms * CHANNELS, rows * CHANNELS):
        scaled[k] = 0.0
    for j in range(first_channel, CHANNELS, 3):
        o0, o1, o2 = np.uint32(j * STRIDE), np.uint32((j + 1) * STRIDE), np.uint32((j + 2) * STRIDE)
        a0, a1, a2 = scaled[j], scaled[j + 1], scaled[j + 2]
        for i in range(used):
            out[o0 + i], out[o1 + i], out[o2 + i] = a0, a1, a2
        for k in range(1, rows, 4):
            b0, b1 = np.uint32(k * STRIDE), np.uint32((k + 1) * STRIDE)
            b2, b3 = np.uint32((k + 2) * STRIDE), np.uint32((k + 3) * STRIDE)
            c = scaled[k * CHANNELS + j :]
            c00, c01, c02 = c[0], c[1], c[2]
            c10, c11, c12 = c[CHANNELS], c[CHANNELS + 1], c[CHANNELS + 2]
            c20, c21, c22 = c[2 * CHANNELS], c[2 * CHANNELS + 1], c[2 * CHANNELS + 2]
            c30, c31, c32 = c[3 * CHANNELS], c[3 * CHANNELS + 1], c[3 * CHANNELS + 2]
            for i in range(used):
                t0, t1, t2, t3 = basis[b0 + i], basis[b1 + i], basis[b2 + i], basis[b3 + i]
                out[o0 + i] = out[o0 + i] + c00 * t0 + c10 * t1 + c20 * t2 + c30 * t3
                out[o1 + i] = out[o1 + i] + c01 * t0 + c11 * t1 + c21 * t2 + c31 * t3
                out[o2 + i] = out[o2 + i] + c02 * t0 + c12 * t1 + c22 * t2 + c32 * t3


@part
def terms_that_differ(series, other):
    """In how many terms two panels' nine series differ."""
    count = 0
    for k in range(0, len(series), CHANNELS):
        for j in range(CHANNELS):
            if series[k + j] != other[k + j]:
                count += 1
                break
    return count


@part
def with_few_others(series, other, terms, factor, basis, used, first_channel, whole, out):
    """As `channels_at` for series that differ in a few terms from those whose channels are `whole`."""
    for j in range(first_channel, CHANNELS):
        o = np.uint32(j * STRIDE)
        for i in range(used):
            out[o + i] = whole[o + i]
        for k in range(terms):
            change = factor * (other[k * CHANNELS + j] - series[k * CHANNELS + j])
            if change != 0.0:
                b = np.uint32(k * STRIDE)
                for i in range(used):
                    out[o + i] = out[o + i] + change * basis[b + i]
