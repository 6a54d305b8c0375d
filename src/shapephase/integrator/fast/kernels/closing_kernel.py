"""What the great circle from the end of a curve of directions to its start makes of it, and a reference far from it.

Vectors are tuples of three numbers, quaternions xyzw of four; the formulas are those of `so3` and `sphere`.
"""

from __future__ import annotations

import math

import numpy as np

from ....so3 import FAR_FROM_OPPOSITE, OPPOSITE
from .jit import kernel, part
from .vectors import cross, dot, plus


@part
def _vector(array):
    return array[0], array[1], array[2]


@part
def _unit(a):
    length = math.sqrt(dot(a, a))
    return a[0] / length, a[1] / length, a[2] / length


@part
def _unit_quaternion(vector, scalar):
    length = math.sqrt(dot(vector, vector) + scalar * scalar)
    return vector[0] / length, vector[1] / length, vector[2] / length, scalar / length


@part
def _triangle(reference, start, end):
    volume = dot(reference, cross(start, end))
    return 2.0 * math.atan2(volume, 1.0 + dot(start, end) + dot(reference, start) + dot(reference, end))


@part
def _perpendicular(a):
    x, y, z = abs(a[0]), abs(a[1]), abs(a[2])
    if x <= y and x <= z:
        return _unit(cross(a, (1.0, 0.0, 0.0)))
    return _unit(cross(a, (0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0)))


@part
def _middle(start, end):
    total = plus(start, end)
    return _perpendicular(start) if math.sqrt(dot(total, total)) < OPPOSITE else _unit(total)


@part
def _short_turn(start, end):
    half = _unit(plus(start, end))
    return _unit_quaternion(cross(start, half), dot(start, half))


@part
def _between(start, end):
    scalar = 1.0 + dot(start, end)
    if scalar > FAR_FROM_OPPOSITE:
        return _unit_quaternion(cross(start, end), scalar)
    half = _middle(start, end)
    a, b, c, d = _short_turn(half, end)
    x, y, z, w = _short_turn(start, half)
    return (
        d * x + a * w + b * z - c * y,
        d * y - a * z + b * w + c * x,
        d * z + a * y - b * x + c * w,
        d * w - a * x - b * y - c * z,
    )


@part
def _matrix(quaternion):
    x, y, z, w = quaternion
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )


@part
def _times_transposed(a, b):
    """A product of matrices, the second one transposed."""
    return (
        (dot(a[0], b[0]), dot(a[0], b[1]), dot(a[0], b[2])),
        (dot(a[1], b[0]), dot(a[1], b[1]), dot(a[1], b[2])),
        (dot(a[2], b[0]), dot(a[2], b[1]), dot(a[2], b[2])),
    )


@part
def _rows(matrix):
    return _vector(matrix[0]), _vector(matrix[1]), _vector(matrix[2])


@part
def _angle_about(m, axis):
    """Of the turn about an axis that is nearest to a rotation, in (-pi, pi]; by the largest component (Shepperd)."""
    (a, b, c), (d, e, f), (g, h, i) = m
    trace = a + e + i
    largest = max(a, e, i, trace)
    if a == largest:
        vector, scalar = (1.0 + 2.0 * a - trace, b + d, c + g), h - f
    elif e == largest:
        vector, scalar = (b + d, 1.0 + 2.0 * e - trace, f + h), c - g
    elif i == largest:
        vector, scalar = (c + g, f + h, 1.0 + 2.0 * i - trace), d - b
    else:
        vector, scalar = (h - f, c - g, d - b), 1.0 + trace
    twist = dot(vector, axis)
    angle = 2.0 * math.atan2(-twist, -scalar) if scalar < 0.0 else 2.0 * math.atan2(twist, scalar)
    return math.pi if angle <= -math.pi else angle


@kernel
def close_curves(corners, references, axes, first, last, areas, tilts, gaps, turns):
    """The last four arguments are filled.

    corners: (B, K + 1, 3) of curves on their sphere
    references: (B, 3) opposite which no area is counted
    axes: (B, 3) of the momenta, inertial axes
    first, last: (B, 3, 3) attitudes of the gauge's frame at both ends
    areas: (2, B) of the closed polygon, and what the closing arc has of it
    tilts: (B, 3, 3) transport along the closing arc, inertial axes
    gaps: (B,) between the ends
    turns: (B,) about the axes, from the tilt to the turn of the attitude
    """
    for row in range(len(corners)):
        curve, reference = corners[row], _vector(references[row])
        start, end = _vector(curve[0]), _vector(curve[len(curve) - 1])
        half, whole = _middle(end, start), 0.0
        for k in range(1, len(curve)):
            whole += _triangle(reference, _vector(curve[k - 1]), _vector(curve[k]))
        areas[1, row] = _triangle(reference, end, half) + _triangle(reference, half, start)
        areas[0, row] = whole + areas[1, row]
        across, along = plus(start, (-end[0], -end[1], -end[2])), plus(start, end)
        gaps[row] = 2.0 * math.atan2(math.sqrt(dot(across, across)), math.sqrt(dot(along, along)))
        x, y, z, w = _between(end, start)
        there, back = _rows(first[row]), _matrix((-x, -y, -z, w))
        tilt = _times_transposed(_times_transposed(there, back), there)
        for i in range(3):
            for j in range(3):
                tilts[row, i, j] = tilt[i][j]
        whole_turn = _times_transposed(_rows(last[row]), there)
        turns[row] = _angle_about(_times_transposed(whole_turn, tilt), _vector(axes[row]))


@kernel
def far_references(curves, references, found):
    """Rows of `references` (3, R) whose opposites are farthest from curves (B, N, 3): (B,)."""
    for row in range(len(curves)):
        curve, best, near = curves[row], -np.inf, 0
        for candidate in range(references.shape[1]):
            x, y, z = references[0, candidate], references[1, candidate], references[2, candidate]
            # What came too near to the last one most likely does to this one.
            least = curve[near, 0] * x + curve[near, 1] * y + curve[near, 2] * z
            if least <= best:
                continue
            for k in range(len(curve)):
                along = curve[k, 0] * x + curve[k, 1] * y + curve[k, 2] * z
                if along < least:
                    least, near = along, k
                    if least <= best:
                        break
            if least > best:
                best, found[row] = least, candidate
