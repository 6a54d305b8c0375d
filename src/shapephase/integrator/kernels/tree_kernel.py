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
TURN, PLACE, SPIN, SPEED, CENTRE, DRIFT, FRAME = 0, *range(9, 25, 3)  # first rows of R, p, w, v, x, u; all rows
# First rows of the sums of mass times place, mass times velocity, inertia (6) and momentum; all rows.
MOMENT, FLOW, INERTIA, MOMENTUM, TOTAL = 0, 3, 6, 12, 15
NUMBERS = 22  # of a frame in the body, in the order of `shapephase.body.joint_chain`
MASS = 12  # place of the mass among them, behind turn and place; then the centre of mass and the inertia
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
def three(rows, first, stride, i):
    """Lane i of three rows from `first` on."""
    at = first * LANES + i
    return rows[at], rows[at + stride * LANES], rows[at + 2 * stride * LANES]


@inline
def put(rows, first, i, vector):
    """Write lane i of three rows."""
    at = first * LANES + i
    rows[at], rows[at + LANES], rows[at + 2 * LANES] = vector


@inline
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def cross(a, b):
    """Cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def plus(a, b):
    """Sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inline
def add(rows, first, i, vector):
    """Add to lane i of three rows."""
    put(rows, first, i, plus(three(rows, first, 1, i), vector))


@inline
def minus(a, b):
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline
def scaled(factor, a):
    """Vector times a number."""
    return factor * a[0], factor * a[1], factor * a[2]


@inline
def times(tensor, a):
    """Symmetric tensor, xx yy zz and yz xz xy, times a vector."""
    (xx, yy, zz), (yz, xz, xy) = tensor
    return dot((xx, xy, xz), a), dot((xy, yy, yz), a), dot((xz, yz, zz), a)


@inline
def _numbers(body, first):
    """Three numbers of a frame in the body."""
    return body[first], body[first + 1], body[first + 2]


@inline
def _move_row(columns, offset, before, after, row, i, c, s, slid):
    """A row of R after a joint; what it has of the joint's axis, and of the step to the new origin."""
    r = three(before, row, 1, i)
    x, y, z = dot(r, columns[0]), dot(r, columns[1]), dot(r, columns[2])
    put(after, row, i, (x * c + y * s, y * c - x * s, z))
    return z, dot(r, offset) + z * slid


@inline
def _move_frame(body, before, after, turning, lead, cosine, sine, shape, rate, lanes):
    """The frame after a joint from the frame before it."""
    m, offset = (_numbers(body, 0), _numbers(body, 3), _numbers(body, 6)), _numbers(body, PLACE)
    columns = (m[0][0], m[1][0], m[2][0]), (m[0][1], m[1][1], m[2][1]), (m[0][2], m[1][2], m[2][2])
    for i in range(lanes):
        c, s, slid = cosine[i], sine[i], lead * shape[i]
        zx, ax = _move_row(columns, offset, before, after, 0, i, c, s, slid)
        zy, ay = _move_row(columns, offset, before, after, 3, i, c, s, slid)
        zz, az = _move_row(columns, offset, before, after, 6, i, c, s, slid)
        axis, step, spin = (zx, zy, zz), (ax, ay, az), three(before, SPIN, 1, i)
        put(after, PLACE, i, plus(three(before, PLACE, 1, i), step))
        put(after, SPIN, i, plus(spin, scaled(turning * rate[i], axis)))
        # From origin to origin, so that nothing far away is taken off again.
        slide = plus(cross(spin, step), scaled(lead * rate[i], axis))
        put(after, SPEED, i, plus(three(before, SPEED, 1, i), slide))


@inline
def add_link(body, frame, total, lanes):
    """Place and velocity of a link's centre of mass, and what it adds to the sums whatever the centre of the whole."""
    mass, centre = body[MASS], _numbers(body, MASS + 1)
    (j0, j1, j2), (j3, j4, j5) = _numbers(body, MASS + 4), _numbers(body, NUMBERS - 3)
    first, second, third = (j0, j5, j4), (j5, j1, j3), (j4, j3, j2)
    for i in range(lanes):
        r, s, t = three(frame, 0, 1, i), three(frame, 3, 1, i), three(frame, 6, 1, i)
        w, d = three(frame, SPIN, 1, i), (dot(r, centre), dot(s, centre), dot(t, centre))
        x, y, z = plus(three(frame, PLACE, 1, i), d)
        u, v, q = plus(three(frame, SPEED, 1, i), cross(w, d))
        put(frame, CENTRE, i, (x, y, z))
        put(frame, DRIFT, i, (u, v, q))
        add(total, MOMENT, i, (mass * x, mass * y, mass * z))
        add(total, FLOW, i, (mass * u, mass * v, mass * q))
        a = dot(r, first), dot(r, second), dot(r, third)
        b = dot(s, first), dot(s, second), dot(s, third)
        c = dot(t, first), dot(t, second), dot(t, third)
        xx, yy, zz, yz, xz, xy = dot(a, r), dot(b, s), dot(c, t), dot(b, t), dot(a, t), dot(a, s)
        add(total, INERTIA, i, (xx, yy, zz))
        add(total, INERTIA + 3, i, (yz, xz, xy))
        add(total, MOMENTUM, i, times(((xx, yy, zz), (yz, xz, xy)), w))


@inline
def add_point(mass, frame, centre, total, lanes):
    """Terms of the sums by a link's mass as a point, seen from the centre of mass of the whole, which moves."""
    for i in range(lanes):
        x, y, z = minus(three(frame, CENTRE, 1, i), three(centre, MOMENT, 1, i))
        speed = scaled(mass, minus(three(frame, DRIFT, 1, i), three(centre, FLOW, 1, i)))
        mx, my, mz = mass * x, mass * y, mass * z
        add(total, INERTIA, i, (my * y + mz * z, mx * x + mz * z, mx * x + my * y))
        add(total, INERTIA + 3, i, (-(my * z), -(mx * z), -(mx * y)))
        add(total, MOMENTUM, i, cross((x, y, z), speed))


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
    xx, yy, zz = three(total, INERTIA, 1, lane)
    yz, xz, xy = three(total, INERTIA + 3, 1, lane)
    u, v, w = three(total, MOMENTUM, 1, lane)
    fine = True
    if inverted:
        xx, yy, zz, yz, xz, xy, condition = _inverse(xx, yy, zz, yz, xz, xy)
        u, v, w = times(((xx, yy, zz), (yz, xz, xy)), (u, v, w))
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
            frames[0, j * LANES + i] = 1.0 if j < PLACE and j % 4 == 0 else 0.0
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
def sample_tree(parents, turning, leads, body, mass, shapes, rates, inverted, lanes, values):
    """I^-1 and I^-1 L_o, or I and L_o, about the centre of mass, base axes; return whether all rows are reliable.

    parents, turning, leads, body, mass: as `LinkRows` has them
    shapes, rates: (N, joints) of all joints
    inverted: whether I^-1 and I^-1 L_o are wanted, not I and L_o
    lanes: LANES
    values: (N, 9) to be filled: xx yy zz yz xz xy, and three of the momentum
    """
    joints, count, reliable = len(parents), len(shapes), True
    frames, total, centre = np.empty((joints + 1, FRAME * LANES)), np.empty(TOTAL * LANES), np.empty(INERTIA * LANES)
    rate, cosine, sine, shape = np.empty((joints, LANES)), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for first in range(0, count, LANES):
        place_frames(parents, turning, leads, body, shapes, rates, first, frames, shape, rate, cosine, sine, lanes)
        for j in range(TOTAL * LANES):
            total[j] = 0.0
        for frame in range(joints + 1):
            add_link(body[frame], frames[frame], total, lanes)
        for j in range(INERTIA * LANES):
            centre[j] = total[j] / mass
        for frame in range(joints + 1):
            add_point(body[frame, MASS], frames[frame], centre, total, lanes)
        for i in range(LANES):
            if first + i < count:
                fine = _write(total, i, inverted, values[first + i])
                reliable = reliable and fine
    return reliable


def warm() -> None:
    """Call the kernel with the least that it takes: one frame, one shape."""
    none, shapes, parents = np.zeros(0), np.zeros((1, 0)), np.zeros(0, dtype=np.uint32)
    sample_tree(parents, none, none, np.ones((1, NUMBERS)), 1.0, shapes, shapes, True, LANES, np.empty((1, 9)))
