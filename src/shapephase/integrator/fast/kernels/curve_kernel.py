"""The momentum's curve and the integrals along it, piece by piece, from Taylor terms at both ends of each piece.

What is computed of one end of a piece stands in local variables, vectors as three numbers and series term after term,
so that a loop over pieces around it becomes vectors. What goes in and out stands in rows of LANES numbers, one for each
of some pieces side by side.
"""

from __future__ import annotations

import numpy as np

from ..estimate_constants import TERMS
from .jit import inline, kernel, part
from .vectors import cross, dot, plus

LANES = 32
_DIRECTION = 0
"""Rows of the direction at an end, of the piece's first corner as it is seen from the body there, then of its terms."""
_STILL = 3 * LANES
_CHANNELS = 6 * LANES
"""Rows of the nine channels, TERMS each."""
_DRIFT = 6
_RATES = (6 + 9 * TERMS) * LANES
"""Rows of what is found: the rate of turning, the terms of the rate along the direction, and of this less the turn."""
_ALONG = _RATES + 3 * LANES
_APART = _ALONG + TERMS * LANES
_ROWS = _APART // LANES + TERMS


@inline
def _plus_3(a, b, c):
    return plus(plus(a, b), c)


@inline
def _plus_4(a, b, c, d):
    return plus(_plus_3(a, b, c), d)


@inline
def _over(a, number):
    return a[0] / number, a[1] / number, a[2] / number


@inline
def _vector(s, row, i):
    return s[row + i], s[row + LANES + i], s[row + 2 * LANES + i]


@inline
def _channel(s, number, order, i):
    return s[_CHANNELS + (number * TERMS + order) * LANES + i]


@inline
def _drift(s, order, i):
    return _channel(s, _DRIFT, order, i), _channel(s, _DRIFT + 1, order, i), _channel(s, _DRIFT + 2, order, i)


@inline
def _turned(s, order, i, a):
    """A vector times the term of I^-1."""
    xx, yy, zz = _channel(s, 0, order, i), _channel(s, 1, order, i), _channel(s, 2, order, i)
    yz, xz, xy = _channel(s, 3, order, i), _channel(s, 4, order, i), _channel(s, 5, order, i)
    x, y, z = a
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@inline
def _rate(s, order, i, magnitude, turned):
    """The term of omega = I^-1 Pi - I^-1 L_o."""
    d, (x, y, z) = _drift(s, order, i), turned
    return magnitude * x - d[0], magnitude * y - d[1], magnitude * z - d[2]


@inline
def _carried_2(v, r):
    """The term of this order of vectors carried by rates, from all terms of both before it."""
    return _over(plus(cross(v[0], r[1]), cross(v[1], r[0])), 2.0)


@inline
def _carried_3(v, r):
    return _over(_plus_3(cross(v[0], r[2]), cross(v[1], r[1]), cross(v[2], r[0])), 3.0)


@inline
def _carried_4(v, r):
    return _over(_plus_4(cross(v[0], r[3]), cross(v[1], r[2]), cross(v[2], r[1]), cross(v[3], r[0])), 4.0)


@inline
def _carried_5(v, r):
    first = _plus_3(cross(v[0], r[4]), cross(v[1], r[3]), cross(v[2], r[2]))
    return _over(_plus_3(first, cross(v[3], r[1]), cross(v[4], r[0])), 5.0)


@inline
def _direction_terms(s, i, magnitude):
    """The terms of the momentum's direction and of omega."""
    p0 = _vector(s, _DIRECTION, i)
    r0 = _rate(s, 0, i, magnitude, _turned(s, 0, i, p0))
    p1 = cross(p0, r0)
    r1 = _rate(s, 1, i, magnitude, plus(_turned(s, 1, i, p0), _turned(s, 0, i, p1)))
    p2 = _carried_2((p0, p1), (r0, r1))
    turned = _plus_3(_turned(s, 2, i, p0), _turned(s, 1, i, p1), _turned(s, 0, i, p2))
    r2 = _rate(s, 2, i, magnitude, turned)
    p3 = _carried_3((p0, p1, p2), (r0, r1, r2))
    turned = _plus_3(_turned(s, 3, i, p0), _turned(s, 2, i, p1), _turned(s, 1, i, p2))
    r3 = _rate(s, 3, i, magnitude, plus(turned, _turned(s, 0, i, p3)))
    p4 = _carried_4((p0, p1, p2, p3), (r0, r1, r2, r3))
    turned = _plus_3(_turned(s, 4, i, p0), _turned(s, 3, i, p1), _turned(s, 2, i, p2))
    r4 = _rate(s, 4, i, magnitude, _plus_3(turned, _turned(s, 1, i, p3), _turned(s, 0, i, p4)))
    p5 = _carried_5((p0, p1, p2, p3, p4), (r0, r1, r2, r3, r4))
    turned = _plus_3(_turned(s, 5, i, p0), _turned(s, 4, i, p1), _turned(s, 3, i, p2))
    turned = _plus_4(turned, _turned(s, 2, i, p3), _turned(s, 1, i, p4), _turned(s, 0, i, p5))
    return (p0, p1, p2, p3, p4, p5), (r0, r1, r2, r3, r4, _rate(s, 5, i, magnitude, turned))


@inline
def _still_terms(s, i):
    """Those of a vector that rests while the axes it is seen in turn at minus the drift."""
    m0, m1, m2 = _over(_drift(s, 0, i), -1.0), _over(_drift(s, 1, i), -1.0), _over(_drift(s, 2, i), -1.0)
    m3, m4 = _over(_drift(s, 3, i), -1.0), _over(_drift(s, 4, i), -1.0)
    v0 = _vector(s, _STILL, i)
    v1 = cross(v0, m0)
    v2 = _carried_2((v0, v1), (m0, m1))
    v3 = _carried_3((v0, v1, v2), (m0, m1, m2))
    v4 = _carried_4((v0, v1, v2, v3), (m0, m1, m2, m3))
    return v0, v1, v2, v3, v4, _carried_5((v0, v1, v2, v3, v4), (m0, m1, m2, m3, m4))


@inline
def _product(a, b):
    """The terms of a scalar product from those of its factors."""
    return (
        dot(a[0], b[0]),
        dot(a[0], b[1]) + dot(a[1], b[0]),
        dot(a[0], b[2]) + dot(a[1], b[1]) + dot(a[2], b[0]),
        dot(a[0], b[3]) + dot(a[1], b[2]) + dot(a[2], b[1]) + dot(a[3], b[0]),
        dot(a[0], b[4]) + dot(a[1], b[3]) + dot(a[2], b[2]) + dot(a[3], b[1]) + dot(a[4], b[0]),
        dot(a[0], b[5]) + dot(a[1], b[4]) + dot(a[2], b[3]) + dot(a[3], b[2]) + dot(a[4], b[1]) + dot(a[5], b[0]),
    )


@inline
def _quotient(a, b):
    """The terms of a quotient of series."""
    q0 = a[0] / b[0]
    q1 = (a[1] - b[1] * q0) / b[0]
    q2 = (a[2] - b[2] * q0 - b[1] * q1) / b[0]
    q3 = (a[3] - b[3] * q0 - b[2] * q1 - b[1] * q2) / b[0]
    q4 = (a[4] - b[4] * q0 - b[3] * q1 - b[2] * q2 - b[1] * q3) / b[0]
    q5 = (a[5] - b[5] * q0 - b[4] * q1 - b[3] * q2 - b[2] * q3 - b[1] * q4) / b[0]
    return q0, q1, q2, q3, q4, q5


@inline
def _seen_from_lift(s, i, r):
    """The terms of omega without the part by which the horizontal frame turns."""
    return (
        plus(r[0], _drift(s, 0, i)), plus(r[1], _drift(s, 1, i)), plus(r[2], _drift(s, 2, i)),
        plus(r[3], _drift(s, 3, i)), plus(r[4], _drift(s, 4, i)), plus(r[5], _drift(s, 5, i)),
    )  # fmt: skip


@inline
def _keep(s, i, p, rates, cosine, product):
    """What is integrated: the rate along the direction, and the turn about the piece's first corner."""
    s[_RATES + i], s[_RATES + LANES + i], s[_RATES + 2 * LANES + i] = rates[0]
    along = _product(p, rates)
    a0, a1, a2, a3, a4, a5 = along
    c0, c1, c2, c3, c4, c5 = cosine
    b0, b1, b2, b3, b4, b5 = product
    turn = _quotient((a0 + b0, a1 + b1, a2 + b2, a3 + b3, a4 + b4, a5 + b5), (1.0 + c0, c1, c2, c3, c4, c5))
    for order in range(TERMS):
        s[_ALONG + order * LANES + i], s[_APART + order * LANES + i] = along[order], along[order] - turn[order]


@part
def _in_lift(s, lanes, magnitude):
    for i in range(lanes):
        p, omega = _direction_terms(s, i, magnitude)
        still, rates = _still_terms(s, i), _seen_from_lift(s, i, omega)
        _keep(s, i, p, rates, _product(still, p), _product(still, rates))


@part
def _in_base(s, lanes, magnitude):
    for i in range(lanes):
        p, rates = _direction_terms(s, i, magnitude)
        still = _vector(s, _STILL, i)
        cosine = (
            dot(still, p[0]), dot(still, p[1]), dot(still, p[2]),
            dot(still, p[3]), dot(still, p[4]), dot(still, p[5]),
        )  # fmt: skip
        product = (
            dot(still, rates[0]), dot(still, rates[1]), dot(still, rates[2]),
            dot(still, rates[3]), dot(still, rates[4]), dot(still, rates[5]),
        )  # fmt: skip
        _keep(s, i, p, rates, cosine, product)


@part
def _begin(terms, places, side, block, directions, frames, start, lanes, corners, s):
    """What goes in, of one end of some pieces; and the corners there."""
    lifted = len(frames) > 0
    for i in range(lanes):
        place = places[block + i] + side
        for order in range(TERMS):
            for channel in range(9):
                s[_CHANNELS + (channel * TERMS + order) * LANES + i] = terms[place, order, channel]
    for i in range(lanes):
        here, at = start + i, start + i + side
        x, y, z = directions[at, 0], directions[at, 1], directions[at, 2]
        s[_DIRECTION + i], s[_DIRECTION + LANES + i], s[_DIRECTION + 2 * LANES + i] = x, y, z
        for j in range(3):
            if lifted:
                corners[at, j] = frames[at, j, 0] * x + frames[at, j, 1] * y + frames[at, j, 2] * z
            else:
                corners[at, j] = directions[at, j]
            s[_STILL + j * LANES + i] = directions[here, j]
        if lifted and side:
            for j in range(3):
                s[_STILL + j * LANES + i] = (
                    frames[at, 0, j] * corners[here, 0]
                    + frames[at, 1, j] * corners[here, 1]
                    + frames[at, 2, j] * corners[here, 2]
                )


@part
def _end(directions, side, start, lanes, lengths, lifted, s, slopes, by_momentum):
    """The slopes at one end of some pieces; where one ends those at the start of the next count."""
    for i in range(lanes - 1 if side else 0, lanes):
        at, length = start + i + side, lengths[start + i]
        direction = directions[at, 0], directions[at, 1], directions[at, 2]
        slope = cross(direction, _over(_vector(s, _RATES, i), length))
        slopes[at, 0], slopes[at, 1], slopes[at, 2] = slope
        if not lifted:
            slope = plus(slope, cross(direction, _over(_drift(s, 0, i), length)))
        by_momentum[at, 0], by_momentum[at, 1], by_momentum[at, 2] = slope


@kernel
def curve_pieces(
    terms, places, first, directions, frames, lengths, magnitudes, rules,
    dynamic, slivers, corners, slopes, by_momentum, differences,
):  # fmt: skip
    """Pieces `first`, `first` + 1, ...; what is in the last line of arguments is filled there, `differences` added to.

    terms: (Q, TERMS, 9) of the channels at the ends of pieces
    places: (N,) where the start of each piece stands among them, which its end follows
    directions: (B, M + 1, 3) of the momentum at the ends of all pieces, body axes
    frames: (M + 1, 3, 3) of the horizontal gauge there, body axes to gauge axes; without any the gauge is the base
    lengths: (M,) [s]
    magnitudes: (B,)
    rules: (3, 2 TERMS) from Taylor terms at both ends to integrals
    dynamic, slivers: (B, M); corners, slopes, by_momentum: (B, M + 1, 3); differences: (2, 2, B)
    """
    lifted, count = len(frames) > 0, len(places)
    s, found = np.empty(_ROWS * LANES), np.empty((2, 3, LANES))
    for row in range(len(magnitudes)):
        for block in range(0, count, LANES):
            lanes, start = min(LANES, count - block), first + block
            found[:] = 0.0
            for side in range(2):
                _begin(terms, places, side, block, directions[row], frames, start, lanes, corners[row], s)
                if lifted:
                    _in_lift(s, lanes, magnitudes[row])
                else:
                    _in_base(s, lanes, magnitudes[row])
                _end(directions[row], side, start, lanes, lengths, lifted, s, slopes[row], by_momentum[row])
                for order in range(TERMS):
                    for rule in range(3):
                        weight = rules[rule, side * TERMS + order]
                        for i in range(lanes):
                            found[0, rule, i] += weight * s[_ALONG + order * LANES + i]
                            found[1, rule, i] += weight * s[_APART + order * LANES + i]
            for which in range(2):
                for rule in range(2):
                    for i in range(lanes):
                        differences[rule, which, row] += abs(found[which, rule, i] - found[which, rule + 1, i])
            for i in range(lanes):
                dynamic[row, start + i], slivers[row, start + i] = found[0, 0, i], found[1, 0, i]
