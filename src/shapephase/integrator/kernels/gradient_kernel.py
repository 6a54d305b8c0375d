"""How the angular momentum of a tree of links answers to its joints and to the inertias of its links.

Frames and sums stand in rows of LANES numbers, one lane for each shape, as in `tree_kernel`.
"""

from __future__ import annotations

import numpy as np

from ..machine_code import inline, kernel
from .tree_kernel import FRAME, LANES, NUMBERS, TOTAL, add_link, add_point, centres, place_frames

_PARAMETERS = 10
"""Of a frame: mass, first moment (3), inertia xx yy zz yz xz xy."""


@inline
def _cross(a0, a1, a2, b0, b1, b2):
    return a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0


@inline
def _turned(s, i, x, y, z):
    """A sum's inertia times a vector."""
    xx, yy, zz = s[6 * LANES + i], s[7 * LANES + i], s[8 * LANES + i]
    yz, xz, xy = s[9 * LANES + i], s[10 * LANES + i], s[11 * LANES + i]
    return xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z


@inline
def _from_centre(frame, centre, lanes):
    """Places and velocities of a frame's origin and of what moves with it, from those of the centre of mass of all."""
    for j in range(3):
        for i in range(lanes):
            place, speed = centre[j * LANES + i], centre[(3 + j) * LANES + i]
            frame[(9 + j) * LANES + i] -= place
            frame[(15 + j) * LANES + i] -= speed
            frame[(18 + j) * LANES + i] -= place
            frame[(21 + j) * LANES + i] -= speed


@inline
def _carry(mass, frame, total, lanes):
    """The first six sums of a frame, which `add_link` takes from the base, from the centre of mass."""
    for j in range(6):
        for i in range(lanes):
            total[j * LANES + i] = mass * frame[(18 + j) * LANES + i]


@inline
def _load(numbers, first, count, lanes, out):
    """Numbers (N, m) of eight shapes as rows of lanes; what is beyond the last is zero."""
    for j in range(numbers.shape[1]):
        for i in range(lanes):
            out[j * LANES + i] = numbers[first + i, j] if first + i < count else 0.0


@inline
def _by_rate(s, f, turning, lead, out, lanes):
    """What a unit of a joint's rate adds to the angular momentum."""
    for i in range(lanes):
        z0, z1, z2 = f[2 * LANES + i], f[5 * LANES + i], f[8 * LANES + i]
        o0, o1, o2 = f[9 * LANES + i], f[10 * LANES + i], f[11 * LANES + i]
        p0, p1, p2 = s[i], s[LANES + i], s[2 * LANES + i]
        j0, j1, j2 = _turned(s, i, z0, z1, z2)
        m0, m1, m2 = _cross(z0, z1, z2, o0, o1, o2)
        # Slides along the axis come with the lead.
        m0, m1, m2 = lead * z0 - turning * m0, lead * z1 - turning * m1, lead * z2 - turning * m2
        c0, c1, c2 = _cross(p0, p1, p2, m0, m1, m2)
        out[i], out[LANES + i], out[2 * LANES + i] = turning * j0 + c0, turning * j1 + c1, turning * j2 + c2


@inline
def _by_shape(s, f, turning, lead, rate, w, out, lanes):
    """What a unit of a joint's coordinate adds to it while the body turns at w, as `momentum_gradients` has it."""
    for i in range(lanes):
        w0, w1, w2 = w[i], w[LANES + i], w[2 * LANES + i]
        z0, z1, z2 = f[2 * LANES + i], f[5 * LANES + i], f[8 * LANES + i]
        o0, o1, o2 = f[9 * LANES + i], f[10 * LANES + i], f[11 * LANES + i]
        p0, p1, p2 = s[i], s[LANES + i], s[2 * LANES + i]
        d0, d1, d2 = _cross(w0, w1, w2, p0, p1, p2)
        q0, q1, q2 = s[3 * LANES + i] + d0, s[4 * LANES + i] + d1, s[5 * LANES + i] + d2
        j0, j1, j2 = _turned(s, i, w0, w1, w2)
        h0, h1, h2 = s[12 * LANES + i] + j0, s[13 * LANES + i] + j1, s[14 * LANES + i] + j2
        y0, y1, y2 = _cross(w0 + f[12 * LANES + i], w1 + f[13 * LANES + i], w2 + f[14 * LANES + i], z0, z1, z2)
        d0, d1, d2 = _cross(w0, w1, w2, o0, o1, o2)
        slide = lead * rate[i]
        v0, v1 = f[15 * LANES + i] - slide * z0 + d0, f[16 * LANES + i] - slide * z1 + d1
        v2 = f[17 * LANES + i] - slide * z2 + d2
        a0, a1, a2 = _cross(z0, z1, z2, v0, v1, v2)
        b0, b1, b2 = _cross(y0, y1, y2, o0, o1, o2)
        m0, m1, m2 = (
            lead * y0 - turning * (a0 + b0),
            lead * y1 - turning * (a1 + b1),
            lead * y2 - turning * (a2 + b2),
        )
        c0, c1, c2 = _cross(p0, p1, p2, m0, m1, m2)
        e0, e1, e2 = _cross(z0, z1, z2, o0, o1, o2)
        e0, e1, e2 = lead * z0 - turning * e0, lead * z1 - turning * e1, lead * z2 - turning * e2
        e0, e1, e2 = _cross(e0, e1, e2, q0, q1, q2)
        a0, a1, a2 = _cross(z0, z1, z2, h0, h1, h2)
        j0, j1, j2 = _turned(s, i, y0, y1, y2)
        out[i] = turning * (a0 + j0) + e0 + c0
        out[LANES + i] = turning * (a1 + j1) + e1 + c1
        out[2 * LANES + i] = turning * (a2 + j2) + e2 + c2


@inline
def _products(rows, at, each, column, out, lanes):
    """Of `each` rows from `at` on with a column."""
    for k in range(each):
        r = (at + k) * 3 * LANES
        for i in range(lanes):
            out[k * LANES + i] = (
                rows[r + i] * column[i]
                + rows[r + LANES + i] * column[LANES + i]
                + rows[r + 2 * LANES + i] * column[2 * LANES + i]
            )


@inline
def _add_times(factor, numbers, out):
    for j in range(len(numbers)):
        out[j] += factor * numbers[j]


@kernel
def momentum_gradients(
    parents, turning, leads, body, mass, shapes, rates, spins, rows, several, lanes, pieces, powers, slopes, found
):
    """Sums over shapes of products of rows with how the angular momentum answers to polynomials of all joints.

    parents, turning, leads, body, mass: as `LinkRows` has them, the body's rows one after another
    shapes, rates: (N, joints)
    spins: (N, S * 3)
    rows: (N, S * r * 3)
    several: S
    lanes: LANES
    pieces, powers, slopes: (N,), (N, order), (N, order) the piece of the path that each shape is in, and by what its
        coordinates and their rates grow with the coefficients of the piece
    found: (order, pieces, S * r * joints) to be filled
    """
    joints, count = len(parents), len(shapes)
    each = rows.shape[1] // (3 * several)
    frames, sums = np.zeros((joints + 1, FRAME * LANES)), np.empty((joints + 1, TOTAL * LANES))
    total, centre = np.empty(TOTAL * LANES), np.empty(6 * LANES)
    rate, cosine, sine, column = np.empty((joints, LANES)), np.empty(LANES), np.empty(LANES), np.empty(3 * LANES)
    w, a, out = np.empty(several * 3 * LANES), np.empty(several * each * 3 * LANES), np.empty(each * LANES)
    shape, by_shapes, by_rates = np.empty(LANES), np.empty((LANES, found.shape[2])), np.empty((LANES, found.shape[2]))
    for i in range(LANES):
        frames[0, i] = frames[0, 4 * LANES + i] = frames[0, 8 * LANES + i] = 1.0
    found[:] = 0.0
    for first in range(0, count, LANES):
        for j in range(9, FRAME):
            for i in range(LANES):
                frames[0, j * LANES + i] = 0.0
        place_frames(parents, turning, leads, body, shapes, rates, first, frames, shape, rate, cosine, sine, lanes)
        total[:] = 0.0
        for frame in range(joints + 1):
            sums[frame] = 0.0
            add_link(body[frame * NUMBERS : (frame + 1) * NUMBERS], frames[frame], sums[frame], lanes)
            for j in range(6 * LANES):
                total[j] += sums[frame, j]
        centres(total, mass, centre, lanes)
        for frame in range(joints + 1):
            add_point(body[frame * NUMBERS + 12], frames[frame], centre, sums[frame], lanes)
            _from_centre(frames[frame], centre, lanes)
            _carry(body[frame * NUMBERS + 12], frames[frame], sums[frame], lanes)
        for joint in range(joints - 1, -1, -1):
            for j in range(TOTAL * LANES):
                sums[parents[joint], j] += sums[joint + 1, j]
        _load(spins, first, count, lanes, w)
        _load(rows, first, count, lanes, a)
        for joint in range(joints):
            s, f = sums[joint + 1], frames[joint + 1]
            for which in range(several):
                _by_shape(s, f, turning[joint], leads[joint], rate[joint], w[which * 3 * LANES :], column, lanes)
                _products(a, which * each, each, column, out, lanes)
                for k in range(each):
                    for i in range(lanes):
                        by_shapes[i, (which * each + k) * joints + joint] = out[k * LANES + i]
            _by_rate(s, f, turning[joint], leads[joint], column, lanes)
            for which in range(several):
                _products(a, which * each, each, column, out, lanes)
                for k in range(each):
                    for i in range(lanes):
                        by_rates[i, (which * each + k) * joints + joint] = out[k * LANES + i]
        for i in range(min(LANES, count - first)):
            at = first + i
            for power in range(len(found)):
                _add_times(powers[at, power], by_shapes[i], found[power, pieces[at]])
                if power:
                    _add_times(slopes[at, power], by_rates[i], found[power, pieces[at]])


@inline
def _add_by_parameters(f, w, rows, at, out, lanes):
    """What a row adds to the sums by the ten parameters of a frame, the body turning at w: (10 LANES)."""
    for i in range(lanes):
        w0, w1, w2 = w[i], w[LANES + i], w[2 * LANES + i]
        a0, a1, a2 = rows[at + i], rows[at + LANES + i], rows[at + 2 * LANES + i]
        x0, x1, x2 = f[18 * LANES + i], f[19 * LANES + i], f[20 * LANES + i]
        d0, d1, d2 = _cross(w0, w1, w2, x0, x1, x2)
        v0, v1, v2 = f[21 * LANES + i] + d0, f[22 * LANES + i] + d1, f[23 * LANES + i] + d2
        w0, w1, w2 = w0 + f[12 * LANES + i], w1 + f[13 * LANES + i], w2 + f[14 * LANES + i]
        b0, b1, b2 = _cross(a0, a1, a2, x0, x1, x2)
        c0, c1, c2 = _cross(v0, v1, v2, a0, a1, a2)
        d0, d1, d2 = _cross(b0, b1, b2, w0, w1, w2)
        c0, c1, c2 = c0 + d0, c1 + d1, c2 + d2
        r0, r1, r2 = f[i], f[LANES + i], f[2 * LANES + i]
        r3, r4, r5 = f[3 * LANES + i], f[4 * LANES + i], f[5 * LANES + i]
        r6, r7, r8 = f[6 * LANES + i], f[7 * LANES + i], f[8 * LANES + i]
        out[i] = b0 * v0 + b1 * v1 + b2 * v2
        out[LANES + i] = r0 * c0 + r3 * c1 + r6 * c2
        out[2 * LANES + i] = r1 * c0 + r4 * c1 + r7 * c2
        out[3 * LANES + i] = r2 * c0 + r5 * c1 + r8 * c2
        a0, a1, a2 = r0 * a0 + r3 * a1 + r6 * a2, r1 * a0 + r4 * a1 + r7 * a2, r2 * a0 + r5 * a1 + r8 * a2
        w0, w1, w2 = r0 * w0 + r3 * w1 + r6 * w2, r1 * w0 + r4 * w1 + r7 * w2, r2 * w0 + r5 * w1 + r8 * w2
        out[4 * LANES + i], out[5 * LANES + i], out[6 * LANES + i] = a0 * w0, a1 * w1, a2 * w2
        out[7 * LANES + i] = a1 * w2 + a2 * w1
        out[8 * LANES + i] = a0 * w2 + a2 * w0
        out[9 * LANES + i] = a0 * w1 + a1 * w0


@kernel
def inertial_sums(parents, turning, leads, body, mass, shapes, rates, spins, rows, several, lanes, found):
    """Sums over shapes of products of rows with how the angular momentum answers to the parameters of frames.

    found: (S * r, joints + 1, 10) to be filled; the other arguments as for `momentum_gradients`
    """
    joints, count = len(parents), len(shapes)
    each = len(found) // several
    frames, total, centre = np.zeros((joints + 1, FRAME * LANES)), np.empty(TOTAL * LANES), np.empty(6 * LANES)
    rate, cosine, sine, shape = np.empty((joints, LANES)), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    w, a, out = np.empty(several * 3 * LANES), np.empty(several * each * 3 * LANES), np.empty(_PARAMETERS * LANES)
    for i in range(LANES):
        frames[0, i] = frames[0, 4 * LANES + i] = frames[0, 8 * LANES + i] = 1.0
    found[:] = 0.0
    for first in range(0, count, LANES):
        for j in range(9, FRAME):
            for i in range(LANES):
                frames[0, j * LANES + i] = 0.0
        place_frames(parents, turning, leads, body, shapes, rates, first, frames, shape, rate, cosine, sine, lanes)
        total[:] = 0.0
        for frame in range(joints + 1):
            add_link(body[frame * NUMBERS : (frame + 1) * NUMBERS], frames[frame], total, lanes)
        centres(total, mass, centre, lanes)
        _load(spins, first, count, lanes, w)
        _load(rows, first, count, lanes, a)
        for frame in range(joints + 1):
            f = frames[frame]
            _from_centre(f, centre, lanes)
            for row in range(several * each):
                _add_by_parameters(f, w[row // each * 3 * LANES :], a, row * 3 * LANES, out, lanes)
                for j in range(_PARAMETERS):
                    add = 0.0
                    for i in range(LANES):
                        add += out[j * LANES + i]
                    found[row, frame, j] += add


def warm() -> None:
    """Call each kernel with the least that it takes: one frame, one shape."""
    none, shapes, vectors = np.zeros(0), np.zeros((1, 0)), np.zeros((1, 3))
    parents, body, factors = np.zeros(0, dtype=np.uint32), np.ones(NUMBERS), np.ones((1, 1))
    given = (parents, none, none, body, 1.0, shapes, shapes, vectors, vectors, 1, LANES)
    momentum_gradients(*given, np.zeros(1, dtype=np.int64), factors, factors, np.empty((1, 1, 0)))
    inertial_sums(*given, np.empty((1, 1, _PARAMETERS)))
