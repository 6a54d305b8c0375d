"""Inertia and internal momentum of a tree of links, at many shapes: eight shapes side by side.

Everything is an array of rows of LANES numbers, one for each shape; the rows of a frame are R (9, its axes in those of
the base), p (3, its origin), w (3, its angular velocity), v (3, the velocity of its origin), x and u (3 each, place and
velocity of the centre of mass of what moves with it). The number of lanes is an argument: a loop whose length the
compiler knows is unrolled, and then not turned into vectors.
"""

from __future__ import annotations

import math

import numpy as np

from ..machine_code import inline, kernel

LANES = 8
FRAME = 24  # rows of a frame
TOTAL = 15  # rows of the sums: mass times place (3), mass times velocity (3), inertia (6), momentum (3)
NUMBERS = 22  # of a frame in the body, in the order of `shapephase.body.joint_chain`
_CONDITION = (
    1e10  # product of the traces of I and I^-1, up to 9 cond(I): slower code judges tensors above by eigenvalues
)

MOST_ANGLE = 1e5  # [rad]: up to here the products with the first two parts of pi/2 are exact
_QUARTERS = 2.0 / math.pi
_HALF_PI_1, _HALF_PI_2, _HALF_PI_3 = 1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21


@inline
def cos_sin(x):
    """Cosine and sine to an ulp or so for |x| < MOST_ANGLE, without calls or branches, so that loops become vectors.

    Polynomials of fdlibm (k_cos.c, k_sin.c), and the three parts of pi/2 of its e_rem_pio2.c.
    """
    quarters = np.floor(x * _QUARTERS + 0.5)
    r = ((x - quarters * _HALF_PI_1) - quarters * _HALF_PI_2) - quarters * _HALF_PI_3
    z = r * r
    s = 2.7557313707070068e-06 + z * (-2.5050760253406863e-08 + z * 1.58969099521155e-10)
    s = -0.16666666666666632 + z * (0.00833333333332249 + z * (-0.0001984126982985795 + z * s))
    c = 2.480158728947673e-05 + z * (-2.7557314351390663e-07 + z * (2.087572321298175e-09 - z * 1.1359647557788195e-11))
    c = 0.0416666666666666 + z * (-0.001388888888887411 + z * c)
    s, half = r + r * (z * s), 1.0 - 0.5 * z
    c = half + (((1.0 - half) - 0.5 * z) + z * (z * c))
    quarter = quarters - 4.0 * np.floor(0.25 * quarters)
    odd = quarter == 1.0 or quarter == 3.0
    a, b = s if odd else c, c if odd else s
    return -a if quarter == 1.0 or quarter == 2.0 else a, -b if quarter >= 2.0 else b


@inline
def _move_frame(body, before, after, turning, lead, cosine, sine, shape, rate, lanes):
    """The frame after a joint from the frame before it."""
    m0, m1, m2, m3, m4, m5, m6, m7, m8 = body[0], body[1], body[2], body[3], body[4], body[5], body[6], body[7], body[8]
    o0, o1, o2 = body[9], body[10], body[11]
    for i in range(lanes):
        c, s, slid = cosine[i], sine[i], lead * shape[i]
        r0, r1, r2 = before[i], before[LANES + i], before[2 * LANES + i]
        x, y, zx = r0 * m0 + r1 * m3 + r2 * m6, r0 * m1 + r1 * m4 + r2 * m7, r0 * m2 + r1 * m5 + r2 * m8
        ax = r0 * o0 + r1 * o1 + r2 * o2 + zx * slid
        after[i], after[LANES + i], after[2 * LANES + i] = x * c + y * s, y * c - x * s, zx
        r0, r1, r2 = before[3 * LANES + i], before[4 * LANES + i], before[5 * LANES + i]
        x, y, zy = r0 * m0 + r1 * m3 + r2 * m6, r0 * m1 + r1 * m4 + r2 * m7, r0 * m2 + r1 * m5 + r2 * m8
        ay = r0 * o0 + r1 * o1 + r2 * o2 + zy * slid
        after[3 * LANES + i], after[4 * LANES + i], after[5 * LANES + i] = x * c + y * s, y * c - x * s, zy
        r0, r1, r2 = before[6 * LANES + i], before[7 * LANES + i], before[8 * LANES + i]
        x, y, zz = r0 * m0 + r1 * m3 + r2 * m6, r0 * m1 + r1 * m4 + r2 * m7, r0 * m2 + r1 * m5 + r2 * m8
        az = r0 * o0 + r1 * o1 + r2 * o2 + zz * slid
        after[6 * LANES + i], after[7 * LANES + i], after[8 * LANES + i] = x * c + y * s, y * c - x * s, zz
        spin, slide = turning * rate[i], lead * rate[i]
        w0, w1, w2 = before[12 * LANES + i], before[13 * LANES + i], before[14 * LANES + i]
        after[9 * LANES + i] = before[9 * LANES + i] + ax
        after[10 * LANES + i] = before[10 * LANES + i] + ay
        after[11 * LANES + i] = before[11 * LANES + i] + az
        after[12 * LANES + i] = w0 + zx * spin
        after[13 * LANES + i] = w1 + zy * spin
        after[14 * LANES + i] = w2 + zz * spin
        # From origin to origin, so that nothing far away is taken off again.
        after[15 * LANES + i] = before[15 * LANES + i] + ((w1 * az - w2 * ay) + zx * slide)
        after[16 * LANES + i] = before[16 * LANES + i] + ((w2 * ax - w0 * az) + zy * slide)
        after[17 * LANES + i] = before[17 * LANES + i] + ((w0 * ay - w1 * ax) + zz * slide)


@inline
def add_link(body, frame, total, lanes):
    """Place and velocity of a link's centre of mass, and what it adds to the sums whatever the centre of the whole."""
    mass, c0, c1, c2 = body[12], body[13], body[14], body[15]
    j0, j1, j2, j3, j4, j5 = body[16], body[17], body[18], body[19], body[20], body[21]
    for i in range(lanes):
        r0, r1, r2 = frame[i], frame[LANES + i], frame[2 * LANES + i]
        r3, r4, r5 = frame[3 * LANES + i], frame[4 * LANES + i], frame[5 * LANES + i]
        r6, r7, r8 = frame[6 * LANES + i], frame[7 * LANES + i], frame[8 * LANES + i]
        w0, w1, w2 = frame[12 * LANES + i], frame[13 * LANES + i], frame[14 * LANES + i]
        d0, d1, d2 = r0 * c0 + r1 * c1 + r2 * c2, r3 * c0 + r4 * c1 + r5 * c2, r6 * c0 + r7 * c1 + r8 * c2
        x, y, z = frame[9 * LANES + i] + d0, frame[10 * LANES + i] + d1, frame[11 * LANES + i] + d2
        u = frame[15 * LANES + i] + (w1 * d2 - w2 * d1)
        v = frame[16 * LANES + i] + (w2 * d0 - w0 * d2)
        w = frame[17 * LANES + i] + (w0 * d1 - w1 * d0)
        frame[18 * LANES + i], frame[19 * LANES + i], frame[20 * LANES + i] = x, y, z
        frame[21 * LANES + i], frame[22 * LANES + i], frame[23 * LANES + i] = u, v, w
        total[i] += mass * x
        total[LANES + i] += mass * y
        total[2 * LANES + i] += mass * z
        total[3 * LANES + i] += mass * u
        total[4 * LANES + i] += mass * v
        total[5 * LANES + i] += mass * w
        a0, a1, a2 = r0 * j0 + r1 * j5 + r2 * j4, r0 * j5 + r1 * j1 + r2 * j3, r0 * j4 + r1 * j3 + r2 * j2
        a3, a4, a5 = r3 * j0 + r4 * j5 + r5 * j4, r3 * j5 + r4 * j1 + r5 * j3, r3 * j4 + r4 * j3 + r5 * j2
        a6, a7, a8 = r6 * j0 + r7 * j5 + r8 * j4, r6 * j5 + r7 * j1 + r8 * j3, r6 * j4 + r7 * j3 + r8 * j2
        xx, yy, zz = a0 * r0 + a1 * r1 + a2 * r2, a3 * r3 + a4 * r4 + a5 * r5, a6 * r6 + a7 * r7 + a8 * r8
        yz, xz, xy = a3 * r6 + a4 * r7 + a5 * r8, a0 * r6 + a1 * r7 + a2 * r8, a0 * r3 + a1 * r4 + a2 * r5
        total[6 * LANES + i] += xx
        total[7 * LANES + i] += yy
        total[8 * LANES + i] += zz
        total[9 * LANES + i] += yz
        total[10 * LANES + i] += xz
        total[11 * LANES + i] += xy
        total[12 * LANES + i] += xx * w0 + xy * w1 + xz * w2
        total[13 * LANES + i] += xy * w0 + yy * w1 + yz * w2
        total[14 * LANES + i] += xz * w0 + yz * w1 + zz * w2


@inline
def add_point(mass, frame, centre, total, lanes):
    """Terms of the sums by a link's mass as a point, seen from the centre of mass of the whole, which moves."""
    for i in range(lanes):
        x, y = frame[18 * LANES + i] - centre[i], frame[19 * LANES + i] - centre[LANES + i]
        z = frame[20 * LANES + i] - centre[2 * LANES + i]
        u = mass * (frame[21 * LANES + i] - centre[3 * LANES + i])
        v = mass * (frame[22 * LANES + i] - centre[4 * LANES + i])
        w = mass * (frame[23 * LANES + i] - centre[5 * LANES + i])
        mx, my, mz = mass * x, mass * y, mass * z
        total[6 * LANES + i] += my * y + mz * z
        total[7 * LANES + i] += mx * x + mz * z
        total[8 * LANES + i] += mx * x + my * y
        total[9 * LANES + i] -= my * z
        total[10 * LANES + i] -= mx * z
        total[11 * LANES + i] -= mx * y
        total[12 * LANES + i] += y * w - z * v
        total[13 * LANES + i] += z * u - x * w
        total[14 * LANES + i] += x * v - y * u


@inline
def _inverse(xx, yy, zz, yz, xz, xy):
    """I^-1 by square-root-free Cholesky, backward stable; a condition number, NaN or negative where there is none."""
    a, b = xy / xx, xz / xx
    d1, t = yy - a * xy, yz - b * xy
    c = t / d1
    d2 = zz - b * xz - c * t
    e0, e1, e2, f = 1.0 / xx, 1.0 / d1, 1.0 / d2, a * c - b
    i0, i1, i2 = e0 + a * a * e1 + f * f * e2, e1 + c * c * e2, e2
    condition = (xx + yy + zz) * (i0 + i1 + i2) if xx > 0.0 and d1 > 0.0 and d2 > 0.0 else -1.0
    return i0, i1, i2, -c * e2, f * e2, -a * e1 - f * c * e2, condition


@inline
def _write(total, lane, inverted, out):
    """Write a row of results; return whether it is reliable."""
    xx, yy, zz = total[6 * LANES + lane], total[7 * LANES + lane], total[8 * LANES + lane]
    yz, xz, xy = total[9 * LANES + lane], total[10 * LANES + lane], total[11 * LANES + lane]
    u, v, w = total[12 * LANES + lane], total[13 * LANES + lane], total[14 * LANES + lane]
    fine = True
    if inverted:
        xx, yy, zz, yz, xz, xy, condition = _inverse(xx, yy, zz, yz, xz, xy)
        u, v, w = xx * u + xy * v + xz * w, xy * u + yy * v + yz * w, xz * u + yz * v + zz * w
        fine = condition > 0.0 and condition < _CONDITION
    out[0], out[1], out[2], out[3], out[4], out[5], out[6], out[7], out[8] = xx, yy, zz, yz, xz, xy, u, v, w
    return fine and math.isfinite(xx + yy + zz + u + v + w)


@inline
def place_frames(parents, turning, leads, body, shapes, rates, first, frames, shape, rate, cosine, sine, lanes):
    """All frames at eight shapes from `first` on, the last repeated, with the base's at rest.

    body: (k + 1, NUMBERS) the rows of the tree
    shape, rate, cosine, sine: room for LANES numbers, of the rates for each joint
    """
    last = len(shapes) - 1
    for j in range(FRAME):
        for i in range(LANES):
            frames[0, j * LANES + i] = 1.0 if j == 0 or j == 4 or j == 8 else 0.0
    for joint in range(len(parents)):
        near = True
        for i in range(LANES):
            row = first + i if first + i < last else last
            shape[i], rate[joint, i], cosine[i], sine[i] = shapes[row, joint], rates[row, joint], 1.0, 0.0
            near = near and abs(shape[i]) < MOST_ANGLE
        if turning[joint] != 0.0:
            for i in range(lanes):
                cosine[i], sine[i] = cos_sin(shape[i])
            if not near:
                for i in range(LANES):
                    if MOST_ANGLE <= abs(shape[i]) < math.inf:
                        cosine[i], sine[i] = math.cos(shape[i]), math.sin(shape[i])
        before, after = frames[parents[joint]], frames[joint + 1]
        _move_frame(
            body[joint + 1], before, after, turning[joint], leads[joint], cosine, sine, shape, rate[joint], lanes
        )


@kernel
def sample_trees(parents, turning, leads, rows, masses, shapes, rates, inverted, lanes, values, reliable):
    """I^-1 and I^-1 L_o, or I and L_o, of trees that differ in their masses, about the centre of mass, base axes.

    parents, turning, leads: as `LinkRows` has them
    rows: (V, k + 1, NUMBERS) of each tree, their geometry the same
    masses: (V,) of each tree
    shapes, rates: (N, joints) of all joints
    inverted: whether I^-1 and I^-1 L_o are wanted, not I and L_o
    lanes: LANES
    values: (V, N, 9) to be filled: xx yy zz yz xz xy, and three of the momentum
    reliable: (V,) to be filled: whether all rows of a tree are reliable
    """
    joints, count = len(parents), len(shapes)
    frames, total, centre = np.empty((joints + 1, FRAME * LANES)), np.empty(TOTAL * LANES), np.empty(6 * LANES)
    rate, cosine, sine, shape = np.empty((joints, LANES)), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for tree in range(len(rows)):
        reliable[tree] = True
    for first in range(0, count, LANES):
        place_frames(parents, turning, leads, rows[0], shapes, rates, first, frames, shape, rate, cosine, sine, lanes)
        for tree in range(len(rows)):
            for j in range(TOTAL * LANES):
                total[j] = 0.0
            for frame in range(joints + 1):
                add_link(rows[tree, frame], frames[frame], total, lanes)
            for j in range(6 * LANES):
                centre[j] = total[j] / masses[tree]
            for frame in range(joints + 1):
                add_point(rows[tree, frame, 12], frames[frame], centre, total, lanes)
            for i in range(LANES):
                if first + i < count:
                    fine = _write(total, i, inverted, values[tree, first + i])
                    reliable[tree] = reliable[tree] and fine


def warm() -> None:
    """Call each kernel with the least that it takes: one frame, one shape."""
    none, shapes = np.zeros(0), np.zeros((1, 0))
    values, reliable = np.empty((1, 1, 9)), np.empty(1, dtype=np.bool_)
    parents, rows, masses = np.zeros(0, dtype=np.uint32), np.ones((1, 1, NUMBERS)), np.ones(1)
    sample_trees(parents, none, none, rows, masses, shapes, shapes, True, LANES, values, reliable)
