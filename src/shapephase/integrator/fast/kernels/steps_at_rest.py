"""One step without momentum, where the equation of the quaternion is linear and a step does not depend on its start."""

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


@inline
def _rate(c, i, x, y, z, w):
    p, q, r = -0.5 * c[6 * STRIDE + i], -0.5 * c[7 * STRIDE + i], -0.5 * c[8 * STRIDE + i]
    return w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p, -(x * p + y * q + z * r)


@inline
def rest_step(c, b):
    """The quaternion of a step whose channels begin at c[b]."""
    x0, y0, z0, w0 = _rate(c, b, 0.0, 0.0, 0.0, 1.0)
    p, q, r, s = sum_1(x0), sum_1(y0), sum_1(z0), 1.0 + sum_1(w0)
    x1, y1, z1, w1 = _rate(c, b + 1, p, q, r, s)
    p, q, r, s = sum_2(x0, x1), sum_2(y0, y1), sum_2(z0, z1), 1.0 + sum_2(w0, w1)
    x2, y2, z2, w2 = _rate(c, b + 2, p, q, r, s)
    p, q, r, s = sum_3(x0, x2), sum_3(y0, y2), sum_3(z0, z2), 1.0 + sum_3(w0, w2)
    x3, y3, z3, w3 = _rate(c, b + 3, p, q, r, s)
    p, q, r, s = sum_4(x0, x2, x3), sum_4(y0, y2, y3), sum_4(z0, z2, z3), 1.0 + sum_4(w0, w2, w3)
    x4, y4, z4, w4 = _rate(c, b + 4, p, q, r, s)
    p, q, r, s = sum_5(x0, x3, x4), sum_5(y0, y3, y4), sum_5(z0, z3, z4), 1.0 + sum_5(w0, w3, w4)
    x5, y5, z5, w5 = _rate(c, b + 5, p, q, r, s)
    p, q, r, s = sum_6(x0, x3, x4, x5), sum_6(y0, y3, y4, y5), sum_6(z0, z3, z4, z5), 1.0 + sum_6(w0, w3, w4, w5)
    x6, y6, z6, w6 = _rate(c, b + 6, p, q, r, s)
    p, q = sum_7(x0, x3, x4, x5, x6), sum_7(y0, y3, y4, y5, y6)
    r, s = sum_7(z0, z3, z4, z5, z6), 1.0 + sum_7(w0, w3, w4, w5, w6)
    x7, y7, z7, w7 = _rate(c, b + 7, p, q, r, s)
    p, q = sum_8(x0, x3, x4, x5, x6, x7), sum_8(y0, y3, y4, y5, y6, y7)
    r, s = sum_8(z0, z3, z4, z5, z6, z7), 1.0 + sum_8(w0, w3, w4, w5, w6, w7)
    x8, y8, z8, w8 = _rate(c, b + 8, p, q, r, s)
    p, q = sum_9(x0, x3, x4, x5, x6, x7, x8), sum_9(y0, y3, y4, y5, y6, y7, y8)
    r, s = sum_9(z0, z3, z4, z5, z6, z7, z8), 1.0 + sum_9(w0, w3, w4, w5, w6, w7, w8)
    x9, y9, z9, w9 = _rate(c, b + 9, p, q, r, s)
    p, q = sum_10(x0, x3, x4, x5, x6, x7, x8, x9), sum_10(y0, y3, y4, y5, y6, y7, y8, y9)
    r, s = sum_10(z0, z3, z4, z5, z6, z7, z8, z9), 1.0 + sum_10(w0, w3, w4, w5, w6, w7, w8, w9)
    x10, y10, z10, w10 = _rate(c, b + 10, p, q, r, s)
    p, q = sum_11(x0, x3, x4, x5, x6, x7, x8, x9, x10), sum_11(y0, y3, y4, y5, y6, y7, y8, y9, y10)
    r, s = sum_11(z0, z3, z4, z5, z6, z7, z8, z9, z10), 1.0 + sum_11(w0, w3, w4, w5, w6, w7, w8, w9, w10)
    x11, y11, z11, w11 = _rate(c, b + 11, p, q, r, s)
    p, q = sum_b(x0, x5, x6, x7, x8, x9, x10, x11), sum_b(y0, y5, y6, y7, y8, y9, y10, y11)
    r, s = sum_b(z0, z5, z6, z7, z8, z9, z10, z11), 1.0 + sum_b(w0, w5, w6, w7, w8, w9, w10, w11)
    scale = 1.0 / math.sqrt(p * p + q * q + r * r + s * s)
    return p * scale, q * scale, r * scale, s * scale
