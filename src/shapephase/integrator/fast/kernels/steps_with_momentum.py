"""One step of the momentum's direction with its turn and dynamic phase, and of how a small turn of the start grows.

The formulas are those of `shapephase.integrator.steps.rotation_step`, for the numbers of one lane: all is a local
variable, so that a loop over lanes around it becomes vectors. Channels stand as `_stage_series` has them.
"""

from __future__ import annotations

import math

from .dormand_prince import (
    sum_1,
    sum_2,
    sum_3,
    sum_4,
    sum_5,
    sum_6,
    sum_7,
    sum_8,
    sum_9,
    sum_10,
    sum_11,
    sum_b,
)
from .jit import inline
from .stage_series import STRIDE

_INNER_STAGES = 5, 8
"""At 1/3 and 0.65 of a step: the mean of their variations stands for that of the whole step."""


@inline
def _rate(c, i, magnitude, p0, p1, p2, d0, d1, d2):
    """Rate of the direction at p, of the dynamic phase and of the turn from d, at stage i."""
    w0 = magnitude * (c[i] * p0 + c[5 * STRIDE + i] * p1 + c[4 * STRIDE + i] * p2) - c[6 * STRIDE + i]
    w1 = magnitude * (c[5 * STRIDE + i] * p0 + c[STRIDE + i] * p1 + c[3 * STRIDE + i] * p2) - c[7 * STRIDE + i]
    w2 = magnitude * (c[4 * STRIDE + i] * p0 + c[3 * STRIDE + i] * p1 + c[2 * STRIDE + i] * p2) - c[8 * STRIDE + i]
    y = p0 * w0 + p1 * w1 + p2 * w2
    t = (y + d0 * w0 + d1 * w1 + d2 * w2) / (1.0 + d0 * p0 + d1 * p1 + d2 * p2)
    return p1 * w2 - p2 * w1, p2 * w0 - p0 * w2, p0 * w1 - p1 * w0, y, t


@inline
def unscaled_step(c, b, magnitude, u, v, w):
    """The direction (u, v, w) after a step whose channels begin at c[b], its turn and its dynamic phase.

    The direction's length is one but for the error of the step. Numbers may be complex.
    """
    x0, y0, z0, g0, t0 = _rate(c, b, magnitude, u, v, w, u, v, w)
    p, q, r = u + sum_1(x0), v + sum_1(y0), w + sum_1(z0)
    x1, y1, z1, _, _ = _rate(c, b + 1, magnitude, p, q, r, u, v, w)
    p, q, r = u + sum_2(x0, x1), v + sum_2(y0, y1), w + sum_2(z0, z1)
    x2, y2, z2, _, _ = _rate(c, b + 2, magnitude, p, q, r, u, v, w)
    p, q, r = u + sum_3(x0, x2), v + sum_3(y0, y2), w + sum_3(z0, z2)
    x3, y3, z3, _, _ = _rate(c, b + 3, magnitude, p, q, r, u, v, w)
    p, q, r = u + sum_4(x0, x2, x3), v + sum_4(y0, y2, y3), w + sum_4(z0, z2, z3)
    x4, y4, z4, _, _ = _rate(c, b + 4, magnitude, p, q, r, u, v, w)
    p, q, r = u + sum_5(x0, x3, x4), v + sum_5(y0, y3, y4), w + sum_5(z0, z3, z4)
    x5, y5, z5, g5, t5 = _rate(c, b + 5, magnitude, p, q, r, u, v, w)
    p, q, r = u + sum_6(x0, x3, x4, x5), v + sum_6(y0, y3, y4, y5), w + sum_6(z0, z3, z4, z5)
    x6, y6, z6, g6, t6 = _rate(c, b + 6, magnitude, p, q, r, u, v, w)
    p, q, r = u + sum_7(x0, x3, x4, x5, x6), v + sum_7(y0, y3, y4, y5, y6), w + sum_7(z0, z3, z4, z5, z6)
    x7, y7, z7, g7, t7 = _rate(c, b + 7, magnitude, p, q, r, u, v, w)
    p, q, r = u + sum_8(x0, x3, x4, x5, x6, x7), v + sum_8(y0, y3, y4, y5, y6, y7), w + sum_8(z0, z3, z4, z5, z6, z7)
    x8, y8, z8, g8, t8 = _rate(c, b + 8, magnitude, p, q, r, u, v, w)
    p = u + sum_9(x0, x3, x4, x5, x6, x7, x8)
    q = v + sum_9(y0, y3, y4, y5, y6, y7, y8)
    r = w + sum_9(z0, z3, z4, z5, z6, z7, z8)
    x9, y9, z9, g9, t9 = _rate(c, b + 9, magnitude, p, q, r, u, v, w)
    p = u + sum_10(x0, x3, x4, x5, x6, x7, x8, x9)
    q = v + sum_10(y0, y3, y4, y5, y6, y7, y8, y9)
    r = w + sum_10(z0, z3, z4, z5, z6, z7, z8, z9)
    x10, y10, z10, g10, t10 = _rate(c, b + 10, magnitude, p, q, r, u, v, w)
    p = u + sum_11(x0, x3, x4, x5, x6, x7, x8, x9, x10)
    q = v + sum_11(y0, y3, y4, y5, y6, y7, y8, y9, y10)
    r = w + sum_11(z0, z3, z4, z5, z6, z7, z8, z9, z10)
    x11, y11, z11, g11, t11 = _rate(c, b + 11, magnitude, p, q, r, u, v, w)
    p = u + sum_b(x0, x5, x6, x7, x8, x9, x10, x11)
    q = v + sum_b(y0, y5, y6, y7, y8, y9, y10, y11)
    r = w + sum_b(z0, z5, z6, z7, z8, z9, z10, z11)
    turn, dynamic = sum_b(t0, t5, t6, t7, t8, t9, t10, t11), sum_b(g0, g5, g6, g7, g8, g9, g10, g11)
    return p, q, r, turn, dynamic


@inline
def momentum_step(c, b, magnitude, u, v, w):
    """The same with a direction of length one."""
    p, q, r, turn, dynamic = unscaled_step(c, b, magnitude, u, v, w)
    scale = 1.0 / math.sqrt(p * p + q * q + r * r)
    return p * scale, q * scale, r * scale, turn, dynamic


@inline
def product(a0, a1, a2, a3, b0, b1, b2, b3):
    """Of quaternions, the scalar last."""
    return (
        a3 * b0 + a0 * b3 + a1 * b2 - a2 * b1,
        a3 * b1 - a0 * b2 + a1 * b3 + a2 * b0,
        a3 * b2 + a0 * b1 - a1 * b0 + a2 * b3,
        a3 * b3 - a0 * b0 - a1 * b1 - a2 * b2,
    )


@inline
def _times(a0, a1, a2, a3, a4, a5, a6, a7, a8, b0, b1, b2, b3, b4, b5, b6, b7, b8):
    """Of 3 x 3 matrices."""
    return (
        a0 * b0 + a1 * b3 + a2 * b6, a0 * b1 + a1 * b4 + a2 * b7, a0 * b2 + a1 * b5 + a2 * b8,
        a3 * b0 + a4 * b3 + a5 * b6, a3 * b1 + a4 * b4 + a5 * b7, a3 * b2 + a4 * b5 + a5 * b8,
        a6 * b0 + a7 * b3 + a8 * b6, a6 * b1 + a7 * b4 + a8 * b7, a6 * b2 + a7 * b5 + a8 * b8,
    )  # fmt: skip


@inline
def grown(c, b, x, y, z, g0, g1, g2, g3, g4, g5, g6, g7, g8):
    """An error propagator after a step, by the Cayley transform of the variation at its middle, once for each half.

    (x, y, z): the momentum in the middle, seen from the body
    """
    i, j = b + _INNER_STAGES[0], b + _INNER_STAGES[1]
    xx, yy = 0.5 * (c[i] + c[j]), 0.5 * (c[STRIDE + i] + c[STRIDE + j])
    zz, yz = 0.5 * (c[2 * STRIDE + i] + c[2 * STRIDE + j]), 0.5 * (c[3 * STRIDE + i] + c[3 * STRIDE + j])
    xz, xy = 0.5 * (c[4 * STRIDE + i] + c[4 * STRIDE + j]), 0.5 * (c[5 * STRIDE + i] + c[5 * STRIDE + j])
    w0 = xx * x + xy * y + xz * z - 0.5 * (c[6 * STRIDE + i] + c[6 * STRIDE + j])
    w1 = xy * x + yy * y + yz * z - 0.5 * (c[7 * STRIDE + i] + c[7 * STRIDE + j])
    w2 = xz * x + yz * y + zz * z - 0.5 * (c[8 * STRIDE + i] + c[8 * STRIDE + j])
    m0, m1, m2 = 0.25 * (xy * z - xz * y), 0.25 * (xz * x - xx * z + w2), 0.25 * (xx * y - xy * x - w1)
    m3, m4, m5 = 0.25 * (yy * z - yz * y - w2), 0.25 * (yz * x - xy * z), 0.25 * (xy * y - yy * x + w0)
    m6, m7, m8 = 0.25 * (yz * z - zz * y + w1), 0.25 * (zz * x - xz * z - w0), 0.25 * (xz * y - yz * x)
    a0, a4, a8 = 1.0 - m0, 1.0 - m4, 1.0 - m8
    # The adjugate of one minus a quarter of the variation.
    f0, f1, f2 = a4 * a8 - m5 * m7, m2 * m7 + m1 * a8, m1 * m5 + m2 * a4
    f3, f4, f5 = m5 * m6 + m3 * a8, a0 * a8 - m2 * m6, m2 * m3 + a0 * m5
    f6, f7, f8 = m3 * m7 + a4 * m6, m1 * m6 + a0 * m7, a0 * a4 - m1 * m3
    twice = 2.0 / (a0 * f0 - m1 * f3 - m2 * f6)
    # Of a matrix M the Cayley transform is 2 / (1 - M) - 1.
    h0, h1, h2 = twice * f0 - 1.0, twice * f1, twice * f2
    h3, h4, h5 = twice * f3, twice * f4 - 1.0, twice * f5
    h6, h7, h8 = twice * f6, twice * f7, twice * f8 - 1.0
    g0, g1, g2, g3, g4, g5, g6, g7, g8 = _times(h0, h1, h2, h3, h4, h5, h6, h7, h8, g0, g1, g2, g3, g4, g5, g6, g7, g8)
    return _times(h0, h1, h2, h3, h4, h5, h6, h7, h8, g0, g1, g2, g3, g4, g5, g6, g7, g8)
