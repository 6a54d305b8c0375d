"""The momentum's curve and the integrals along it, piece by piece, from Taylor terms at both ends of each piece."""

from __future__ import annotations

import numpy as np

from ..estimate_constants import TERMS
from .jit import kernel, part

_INVERSE = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
"""Where the entries of I^-1 stand among the channels."""
_DRIFT = 6
_CHANNELS = 9


@part
def _next_cross(vectors, rates, order, out):
    """The term after `order` of vectors carried by rates: the sum of their cross products, by the order."""
    x = y = z = 0.0
    for k in range(order + 1):
        a, b, c = vectors[0, k], vectors[1, k], vectors[2, k]
        u, v, w = rates[0, order - k], rates[1, order - k], rates[2, order - k]
        x, y, z = x + (b * w - c * v), y + (c * u - a * w), z + (a * v - b * u)
    out[0, order + 1], out[1, order + 1], out[2, order + 1] = x / (order + 1), y / (order + 1), z / (order + 1)


@part
def _product(a, b, order):
    """The term of a scalar product."""
    total = 0.0
    for k in range(order + 1):
        for i in range(3):
            total += a[i, k] * b[i, order - k]
    return total


@part
def _directions(channels, magnitude, p, rates):
    """The terms of the momentum's direction, whose first ones are given, and of omega."""
    for order in range(TERMS):
        for i in range(3):
            total = 0.0
            for k in range(order + 1):
                for j in range(3):
                    total += channels[_INVERSE[i, j], order - k] * p[j, k]
            rates[i, order] = magnitude * total - channels[_DRIFT + i, order]
        if order + 1 < TERMS:
            _next_cross(p, rates, order, p)


@part
def _cross(a, b, out):
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def curve_pieces(
    channels, first, directions, frames, lengths, magnitudes, rules,
    dynamic, slivers, corners, slopes, by_momentum, differences,
):  # fmt: skip
    """Pieces `first`, `first` + 1, ...; what is in the last line of arguments is filled there, `differences` added to.

    channels: (9, TERMS, 2, N) of N pieces, as `end_channels` gives them
    directions: (B, M + 1, 3) of the momentum at the ends of all pieces, body axes
    frames: (M + 1, 3, 3) of the horizontal gauge there, body axes to gauge axes; without any the gauge is the base
    lengths: (M,) [s]
    magnitudes: (B,)
    rules: (3, 2 TERMS) from Taylor terms at both ends to integrals
    dynamic, slivers: (B, M); corners, slopes, by_momentum: (B, M + 1, 3); differences: (2, 2, B)
    """
    lifted = len(frames) > 0
    p, rates, still, drift = np.empty((3, TERMS)), np.empty((3, TERMS)), np.zeros((3, TERMS)), np.empty((3, TERMS))
    terms, turn, cosine = np.empty((2, 2 * TERMS)), np.empty(TERMS), np.empty(TERMS)
    there, turning, sideways, by_rule = np.empty((_CHANNELS, TERMS)), np.empty(3), np.empty(3), np.empty((3, 2))
    for row in range(len(magnitudes)):
        for piece in range(channels.shape[3]):
            start = first + piece
            for side in range(2):
                at = start + side
                for channel in range(_CHANNELS):
                    for order in range(TERMS):
                        there[channel, order] = channels[channel, order, side, piece]
                for i in range(3):
                    p[i, 0], still[i, 0], corners[row, at, i] = (
                        directions[row, at, i], directions[row, start, i], directions[row, at, i]
                    )  # fmt: skip
                if lifted:
                    for i in range(3):
                        corners[row, at, i] = 0.0
                        for j in range(3):
                            corners[row, at, i] += frames[at, i, j] * p[j, 0]
                _directions(there, magnitudes[row], p, rates)
                if lifted:
                    if side:
                        # The piece's first corner, as it is seen from the body at its end.
                        for i in range(3):
                            still[i, 0] = 0.0
                            for j in range(3):
                                still[i, 0] += frames[at, j, i] * corners[row, start, j]
                    for order in range(TERMS):
                        for i in range(3):
                            drift[i, order] = -there[_DRIFT + i, order]
                            rates[i, order] -= drift[i, order]
                    for order in range(TERMS - 1):
                        _next_cross(still, drift, order, still)
                for i in range(3):
                    turning[i] = rates[i, 0] / lengths[start]
                _cross(p[:, 0], turning, slopes[row, at])
                by_momentum[row, at] = slopes[row, at]
                if not lifted:
                    for i in range(3):
                        turning[i] = there[_DRIFT + i, 0] / lengths[start]
                    _cross(p[:, 0], turning, sideways)
                    by_momentum[row, at] += sideways
                for order in range(TERMS):
                    along = _product(p, rates, order)
                    # The rate of the turn about the first corner, a quotient of series.
                    cosine[order] = _product(still, p, order) + (0.0 if order else 1.0)
                    turn[order] = along + _product(still, rates, order)
                    for k in range(order):
                        turn[order] -= cosine[order - k] * turn[k]
                    turn[order] /= cosine[0]
                    terms[0, side * TERMS + order], terms[1, side * TERMS + order] = along, along - turn[order]
            for which in range(2):
                for rule in range(3):
                    by_rule[rule, which] = 0.0
                    for k in range(2 * TERMS):
                        by_rule[rule, which] += rules[rule, k] * terms[which, k]
                for rule in range(2):
                    differences[rule, which, row] += abs(by_rule[rule, which] - by_rule[rule + 1, which])
            dynamic[row, start], slivers[row, start] = by_rule[0, 0], by_rule[0, 1]
