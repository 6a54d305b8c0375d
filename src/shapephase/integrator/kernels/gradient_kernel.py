"""Derivatives of the angular momentum of a tree of links by its joints and by the inertias of its links.

Frames and sums stand in rows of LANES numbers, one lane for each shape, as in `tree_kernel`.
"""

from __future__ import annotations

import numpy as np

from ..machine_code import inline, kernel
from .tree_kernel import FRAME, LANES, NUMBERS, TOTAL, add_link, add_point, place_frames

_PARAMETERS = 10  # of a frame: mass, first moment (3), inertia xx yy zz yz xz xy


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
def _sum_links(parents, body, mass, frames, sums, centre, lanes):
    """Sums over what hangs on each joint, and the frames, from the centre of mass of all."""
    for j in range(6 * LANES):
        centre[j] = 0.0
    for frame in range(len(frames)):
        for j in range(TOTAL * LANES):
            sums[frame, j] = 0.0
        add_link(body[frame], frames[frame], sums[frame], lanes)
        for j in range(6 * LANES):
            centre[j] += sums[frame, j] / mass
    for frame in range(len(frames)):
        point, f, s = body[frame, 12], frames[frame], sums[frame]
        add_point(point, f, centre, s, lanes)
        _from_centre(f, centre, lanes)
        # Those of place and velocity, which `add_link` takes from the base.
        for j in range(6 * LANES):
            s[j] = point * f[18 * LANES + j]
    for joint in range(len(parents) - 1, -1, -1):
        for j in range(TOTAL * LANES):
            sums[parents[joint], j] += sums[joint + 1, j]


@inline
def _load(vectors, first, out):
    """Vectors (N, S, 3) of eight shapes as rows of lanes, zero beyond the last: (S, 3 LANES)."""
    for which in range(len(out)):
        for j in range(3):
            for i in range(LANES):
                out[which, j * LANES + i] = vectors[first + i, which, j] if first + i < len(vectors) else 0.0


@inline
def _by_rate(s, f, turning, lead, out, lanes):
    """Angular momentum by a unit of a joint's rate."""
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
def _write(rows, column, first, which, joint, out):
    """Products of the rows (N, S, r, 3) of eight shapes with a column."""
    for i in range(LANES):
        if first + i < len(rows):
            own, products = rows[first + i, which], out[first + i, which]
            for k in range(len(own)):
                row = own[k]
                products[k, joint] = row[0] * column[i] + row[1] * column[LANES + i] + row[2] * column[2 * LANES + i]


@kernel
def momentum_gradients(parents, turning, leads, body, mass, shapes, rates, spins, rows, lanes, by_shape, by_rate):
    """Products of rows with derivatives of the angular momentum by the coordinates and by the rates of all joints.

    parents, turning, leads, body, mass: as `LinkRows` has them
    shapes, rates: (N, joints)
    spins, rows: (N, S, 3), (N, S, r, 3)
    lanes: LANES
    by_shape, by_rate: (N, S, r, joints) to be filled
    """
    joints, several = len(parents), spins.shape[1]
    frames, sums = np.empty((joints + 1, FRAME * LANES)), np.empty((joints + 1, TOTAL * LANES))
    rate, cosine, sine, shape = np.empty((joints, LANES)), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    centre, w, column = np.empty(6 * LANES), np.empty((several, 3 * LANES)), np.empty(3 * LANES)
    for first in range(0, len(shapes), LANES):
        place_frames(parents, turning, leads, body, shapes, rates, first, frames, shape, rate, cosine, sine, lanes)
        _sum_links(parents, body, mass, frames, sums, centre, lanes)
        _load(spins, first, w)
        for joint in range(joints):
            s, f, turn, lead = sums[joint + 1], frames[joint + 1], turning[joint], leads[joint]
            for which in range(several):
                _by_shape(s, f, turn, lead, rate[joint], w[which], column, lanes)
                _write(rows, column, first, which, joint, by_shape)
            _by_rate(s, f, turn, lead, column, lanes)
            for which in range(several):
                _write(rows, column, first, which, joint, by_rate)


@inline
def _by_parameters(f, w, a, out, lanes):
    """Terms of the sums by a row for the ten parameters of a frame, the body turning at w: (10 LANES)."""
    for i in range(lanes):
        w0, w1, w2 = w[i], w[LANES + i], w[2 * LANES + i]
        a0, a1, a2 = a[i], a[LANES + i], a[2 * LANES + i]
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
def inertial_sums(parents, turning, leads, body, mass, shapes, rates, spins, rows, lanes, found):
    """Sums over shapes of products of rows with derivatives of the angular momentum by the parameters of frames.

    spins, rows: (N, m, 3) one of each for each product
    found: (m, joints + 1, 10) to be filled; the other arguments as for `momentum_gradients`
    """
    joints, products = len(parents), len(found)
    frames, sums = np.empty((joints + 1, FRAME * LANES)), np.empty((joints + 1, TOTAL * LANES))
    rate, cosine, sine, shape = np.empty((joints, LANES)), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    centre, w, a = np.empty(6 * LANES), np.empty((products, 3 * LANES)), np.empty((products, 3 * LANES))
    out = np.empty(_PARAMETERS * LANES)
    found[:] = 0.0
    for first in range(0, len(shapes), LANES):
        place_frames(parents, turning, leads, body, shapes, rates, first, frames, shape, rate, cosine, sine, lanes)
        _sum_links(parents, body, mass, frames, sums, centre, lanes)
        _load(spins, first, w)
        _load(rows, first, a)
        for frame in range(joints + 1):
            for row in range(products):
                _by_parameters(frames[frame], w[row], a[row], out, lanes)
                for j in range(_PARAMETERS):
                    add = 0.0
                    for i in range(LANES):
                        add += out[j * LANES + i]
                    found[row, frame, j] += add


def warm() -> None:
    """Call each kernel with the least that it takes: one frame, one shape."""
    none, shapes, spins = np.zeros(0), np.zeros((1, 0)), np.zeros((1, 1, 3))
    given = np.zeros(0, dtype=np.uint32), none, none, np.ones((1, NUMBERS)), 1.0, shapes, shapes, spins
    products = np.empty((1, 1, 1, 0))
    momentum_gradients(*given, np.zeros((1, 1, 1, 3)), LANES, products, products.copy())
    inertial_sums(*given, spins, LANES, np.empty((1, 1, _PARAMETERS)))
