"""Derivatives of the angular momentum of a tree of links by its joints and by the inertias of its links.

Frames and sums stand in rows of LANES numbers, one lane for each shape, as in `tree_kernel`.
"""

from __future__ import annotations

import numpy as np

from ..machine_code import inline, kernel
from .tree_kernel import (
    CENTRE,
    DRIFT,
    FLOW,
    FRAME,
    INERTIA,
    LANES,
    MASS,
    MOMENT,
    MOMENTUM,
    NUMBERS,
    PLACE,
    SPEED,
    SPIN,
    TOTAL,
    add_link,
    add_point,
    cross,
    dot,
    minus,
    place_frames,
    plus,
    put,
    scaled,
    three,
    times,
)

_PARAMETERS = 10  # of a frame: mass, first moment (3), inertia xx yy zz yz xz xy


@inline
def _sum_links(parents, body, mass, frames, sums, centre, lanes):
    """Sums over what hangs on each joint, and the frames, from the centre of mass of all."""
    for j in range(INERTIA * LANES):
        centre[j] = 0.0
    for frame in range(len(frames)):
        for j in range(TOTAL * LANES):
            sums[frame, j] = 0.0
        add_link(body[frame], frames[frame], sums[frame], lanes)
        for j in range(INERTIA * LANES):
            centre[j] += sums[frame, j] / mass
    for frame in range(len(frames)):
        point, f, s = body[frame, MASS], frames[frame], sums[frame]
        add_point(point, f, centre, s, lanes)
        # Places and velocities, of the frame's origin and of what moves with it, from the centre of mass of all.
        for j in range(3 * LANES):
            place, speed = centre[j], centre[FLOW * LANES + j]
            f[PLACE * LANES + j] -= place
            f[SPEED * LANES + j] -= speed
            f[CENTRE * LANES + j] -= place
            f[DRIFT * LANES + j] -= speed
        # Those of place and velocity, which `add_link` takes from the base.
        for j in range(INERTIA * LANES):
            s[j] = point * f[CENTRE * LANES + j]
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
        z = three(f, 2, 3, i)
        # Slides along the axis come with the lead.
        arm = minus(scaled(lead, z), scaled(turning, cross(z, three(f, PLACE, 1, i))))
        turned = times((three(s, INERTIA, 1, i), three(s, INERTIA + 3, 1, i)), z)
        put(out, 0, i, plus(scaled(turning, turned), cross(three(s, MOMENT, 1, i), arm)))


@inline
def _by_shape(s, f, turning, lead, rate, spins, out, lanes):
    """What a unit of a joint's coordinate adds to it while the body turns at w, as `momentum_gradients` has it."""
    for i in range(lanes):
        w, z, o, p = three(spins, 0, 1, i), three(f, 2, 3, i), three(f, PLACE, 1, i), three(s, MOMENT, 1, i)
        inertia = three(s, INERTIA, 1, i), three(s, INERTIA + 3, 1, i)
        q = plus(three(s, FLOW, 1, i), cross(w, p))
        h = plus(three(s, MOMENTUM, 1, i), times(inertia, w))
        y = cross(plus(w, three(f, SPIN, 1, i)), z)
        v = plus(minus(three(f, SPEED, 1, i), scaled(lead * rate[i], z)), cross(w, o))
        moved = minus(scaled(lead, y), scaled(turning, plus(cross(z, v), cross(y, o))))
        arm = minus(scaled(lead, z), scaled(turning, cross(z, o)))
        turned = scaled(turning, plus(cross(z, h), times(inertia, y)))
        put(out, 0, i, plus(plus(turned, cross(arm, q)), cross(p, moved)))


@inline
def _write(rows, column, first, which, joint, out):
    """Products of the rows (N, S, r, 3) of eight shapes with a column."""
    for i in range(LANES):
        if first + i < len(rows):
            own, products = rows[first + i, which], out[first + i, which]
            for k in range(len(own)):
                row = own[k]
                products[k, joint] = dot(row, three(column, 0, 1, i))


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
    centre, w, column = np.empty(INERTIA * LANES), np.empty((several, 3 * LANES)), np.empty(3 * LANES)
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
def _by_parameters(f, spins, rows, out, lanes):
    """Terms of the sums by a row for the ten parameters of a frame, the body turning at w: (10 LANES)."""
    for i in range(lanes):
        w, a, x = three(spins, 0, 1, i), three(rows, 0, 1, i), three(f, CENTRE, 1, i)
        v = plus(three(f, DRIFT, 1, i), cross(w, x))
        w, b = plus(w, three(f, SPIN, 1, i)), cross(a, x)
        c = plus(cross(v, a), cross(b, w))
        r, s, t = three(f, 0, 3, i), three(f, 1, 3, i), three(f, 2, 3, i)
        a, w = (dot(r, a), dot(s, a), dot(t, a)), (dot(r, w), dot(s, w), dot(t, w))
        out[i] = dot(b, v)
        put(out, 1, i, (dot(r, c), dot(s, c), dot(t, c)))
        put(out, 4, i, (a[0] * w[0], a[1] * w[1], a[2] * w[2]))
        put(out, 7, i, (a[1] * w[2] + a[2] * w[1], a[0] * w[2] + a[2] * w[0], a[0] * w[1] + a[1] * w[0]))


@kernel
def inertial_sums(parents, turning, leads, body, mass, shapes, rates, spins, rows, lanes, found):
    """Sums over shapes of products of rows with derivatives of the angular momentum by the parameters of frames.

    spins, rows: (N, m, 3) one of each for each product
    found: (m, joints + 1, 10) to be filled; the other arguments as for `momentum_gradients`
    """
    joints, products = len(parents), len(found)
    frames, sums = np.empty((joints + 1, FRAME * LANES)), np.empty((joints + 1, TOTAL * LANES))
    rate, cosine, sine, shape = np.empty((joints, LANES)), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    centre, w, a = np.empty(INERTIA * LANES), np.empty((products, 3 * LANES)), np.empty((products, 3 * LANES))
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
