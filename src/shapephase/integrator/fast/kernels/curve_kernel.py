"""Integrals along the momentum's curve, step by step, from Taylor terms at both ends of each step."""

from __future__ import annotations

import numpy as np

from ..estimate_constants import TERMS
from .jit import kernel, part

_INVERSE = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
"""Where the entries of I^-1 stand among the channels."""
_DRIFT = 6


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
def _directions(channels, side, step, magnitude, p, rates):
    """The terms of the momentum's direction, whose first ones are given, and of omega."""
    for order in range(TERMS):
        for i in range(3):
            total = 0.0
            for k in range(order + 1):
                for j in range(3):
                    total += channels[_INVERSE[i, j], order - k, side, step] * p[j, k]
            rates[i, order] = magnitude * total - channels[_DRIFT + i, order, side, step]
        if order + 1 < TERMS:
            _next_cross(p, rates, order, p)


@kernel
def curve_terms(channels, directions, corners, magnitudes, lifted, rules, integrals, first_rates):
    """The last two arguments are filled.

    channels: (9, TERMS, 2, M) of the steps, as `end_channels` gives them
    directions, corners: (3, B, 2, M) of the momentum at both ends; of the first one as it is seen from both ends
    magnitudes: (B,)
    lifted: whether the gauge is the horizontal one, else the base
    rules: (3, 2 TERMS) from Taylor terms at both ends to integrals
    integrals: (3, 2, B, M) of the dynamic phase and of the sliver, by each rule
    first_rates: (3, B, 2, M) of the gauge's omega at both ends
    """
    p, rates, still, drift = np.empty((3, TERMS)), np.empty((3, TERMS)), np.zeros((3, TERMS)), np.empty((3, TERMS))
    terms, turn, cosine = np.empty((2, 2 * TERMS)), np.empty(TERMS), np.empty(TERMS)
    for row in range(len(magnitudes)):
        for step in range(channels.shape[3]):
            for side in range(2):
                for i in range(3):
                    p[i, 0], still[i, 0] = directions[i, row, side, step], corners[i, row, side, step]
                _directions(channels, side, step, magnitudes[row], p, rates)
                if lifted:
                    for order in range(TERMS):
                        for i in range(3):
                            drift[i, order] = -channels[_DRIFT + i, order, side, step]
                            rates[i, order] -= drift[i, order]
                    for order in range(TERMS - 1):
                        _next_cross(still, drift, order, still)
                for i in range(3):
                    first_rates[i, row, side, step] = rates[i, 0]
                for order in range(TERMS):
                    along = _product(p, rates, order)
                    # The rate of the turn about the first corner, a quotient of series.
                    cosine[order] = _product(still, p, order) + (0.0 if order else 1.0)
                    turn[order] = along + _product(still, rates, order)
                    for k in range(order):
                        turn[order] -= cosine[order - k] * turn[k]
                    turn[order] /= cosine[0]
                    terms[0, side * TERMS + order], terms[1, side * TERMS + order] = along, along - turn[order]
            for rule in range(3):
                for which in range(2):
                    total = 0.0
                    for k in range(2 * TERMS):
                        total += rules[rule, k] * terms[which, k]
                    integrals[rule, which, row, step] = total
