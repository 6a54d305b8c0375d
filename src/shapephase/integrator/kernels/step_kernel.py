"""The attitude equation by the eighth-order formula of Dormand and Prince: the one place that has it.

A quaternion turns at q' = q w / 2, with w = |Pi| I^-1 p - I^-1 L_o in body axes and p = S^T Pi_0/|Pi_0|: the momentum
rests in space, so that its direction follows from the attitude. Coefficients are those of SciPy's DOP853 (Hairer,
Norsett and Wanner, Solving Ordinary Differential Equations I, section II.5).
"""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import DOP853

from ..machine_code import inline, kernel

STAGES = 12
NODES = np.ascontiguousarray(DOP853.C[:STAGES])  # times of the stages [steps]
WEIGHTS = np.ascontiguousarray(DOP853.B[:STAGES])
_TABLEAU = np.vstack([DOP853.A[:STAGES, :STAGES], WEIGHTS])
# The entries that are not zero, row after row; row STAGES is the end of the step.
_VALUES = _TABLEAU[_TABLEAU != 0.0]
_COLUMNS = np.ascontiguousarray(np.nonzero(_TABLEAU)[1])
_STARTS = np.concatenate([[0], np.cumsum(np.count_nonzero(_TABLEAU, axis=1))])
# The states of `attempt`: by steps (0), twice and four times as many, on changed series, and from turned starts.
_OF_FINER, _OF_FINEST, _OF_CHANGED, _OF_TURNED = 1, 2, 3, 4
# The states that advance one after another within a step, and which of their own steps they take.
_STATES = np.array([0, 1, 3, 2, 2, 1, 3, 2, 2, 4, 5, 6])
_NUMBERS = np.array([0, 0, 0, 0, 1, 1, 1, 2, 3, 0, 0, 0])


@inline
def combined(slopes, row, x, y, z, w):
    """A quaternion plus the slopes (STAGES, 4) before it by a row of the tableau."""
    for entry in range(_STARTS[row], _STARTS[row + 1]):
        value, column = _VALUES[entry], _COLUMNS[entry]
        x += value * slopes[column, 0]
        y += value * slopes[column, 1]
        z += value * slopes[column, 2]
        w += value * slopes[column, 3]
    return x, y, z, w


@inline
def seen_from(x, y, z, w, a, b, c):
    """A vector at rest, seen from axes turned by a quaternion that is nearly of length one."""
    scale = 1.0 / (x * x + y * y + z * z + w * w)
    u, v, t = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return (
        a + scale * (y * t - z * v - w * u),
        b + scale * (z * u - x * t - w * v),
        c + scale * (x * v - y * u - w * t),
    )


@inline
def turned_at(slopes, row, x, y, z, w, u, v, t):
    """Keep the slope of a quaternion that turns at a rate in body axes."""
    slopes[row, 0] = 0.5 * (w * u + y * t - z * v)
    slopes[row, 1] = 0.5 * (w * v + z * u - x * t)
    slopes[row, 2] = 0.5 * (w * t + x * v - y * u)
    slopes[row, 3] = -0.5 * (x * u + y * v + z * t)


@inline
def normalised(x, y, z, w):
    """Quaternion scaled to length one."""
    scale = 1.0 / np.sqrt(x * x + y * y + z * z + w * w)
    return scale * x, scale * y, scale * z, scale * w


@inline
def spin(c, magnitude, p0, p1, p2):
    """|Pi| I^-1 p, body axes."""
    return (
        magnitude * (c[0] * p0 + c[5] * p1 + c[4] * p2),
        magnitude * (c[5] * p0 + c[1] * p1 + c[3] * p2),
        magnitude * (c[4] * p0 + c[3] * p1 + c[2] * p2),
    )


@inline
def step(channels, magnitude, direction, slopes, x, y, z, w):
    """The quaternion after a step, and the integral of w . p along it.

    channels: (STAGES, 9) at the stages, times the length of the step
    """
    along = 0.0 * x
    a, b, c, d = x, y, z, w
    for stage in range(STAGES + 1):
        a, b, c, d = combined(slopes, stage, x, y, z, w)
        if stage < STAGES:
            here = channels[stage]
            u, v, t = -here[6], -here[7], -here[8]
            if magnitude != 0.0:
                p0, p1, p2 = seen_from(a, b, c, d, direction[0], direction[1], direction[2])
                s0, s1, s2 = spin(here, magnitude, p0, p1, p2)
                u, v, t = u + s0, v + s1, t + s2
                along += WEIGHTS[stage] * (u * p0 + v * p1 + t * p2)
            turned_at(slopes, stage, a, b, c, d, u, v, t)
    a, b, c, d = normalised(a, b, c, d)
    return a, b, c, d, along


@inline
def angle_between(p, q):
    """The angle of small turns between two quaternions (4,) of either sign."""
    near, far = 0.0, 0.0
    for i in range(4):
        less, more = p[i] - q[i], p[i] + q[i]
        near, far = near + less * less, far + more * more
    return 2.0 * math.sqrt(min(near, far))


@kernel
def integrate_steps(channels, loops, magnitudes, directions, first, quaternions):
    """Fill the attitudes (B, K + 1, 4) after the place `first`, where the last steps ended; real or complex.

    channels: (K, STAGES, 9) at the stages of the steps of one loop, times their lengths
    magnitudes, directions: (B,), (B, 3) of the momenta
    """
    for row in range(len(magnitudes)):
        slopes = np.empty((STAGES, 4), quaternions.dtype)
        attitudes, direction, magnitude = quaternions[row], directions[row], magnitudes[row]
        at = first
        for _ in range(loops):
            for k in range(len(channels)):
                here = attitudes[at]
                x, y, z, w, _ = step(channels[k], magnitude, direction, slopes, here[0], here[1], here[2], here[3])
                at += 1
                attitudes[at, 0], attitudes[at, 1], attitudes[at, 2], attitudes[at, 3] = x, y, z, w


@inline
def _mark(state, marked):
    """Keep the attitude by steps, and those from turned starts: (4, 4)."""
    for i in range(4):
        marked[0, i] = state[0, i]
        for axis in range(3):
            marked[axis + 1, i] = state[_OF_TURNED + axis, i]


@inline
def _turn_of_step(q, r, p, s):
    """Turn of a step from one quaternion to the next about the direction p at its start, after the shortest rotation
    that takes the direction s at its end to p."""
    x = q[3] * r[0] - q[0] * r[3] - (q[1] * r[2] - q[2] * r[1])
    y = q[3] * r[1] - q[1] * r[3] - (q[2] * r[0] - q[0] * r[2])
    z = q[3] * r[2] - q[2] * r[3] - (q[0] * r[1] - q[1] * r[0])
    w = q[0] * r[0] + q[1] * r[1] + q[2] * r[2] + q[3] * r[3]
    b0, b1, b2 = s[1] * p[2] - s[2] * p[1], s[2] * p[0] - s[0] * p[2], s[0] * p[1] - s[1] * p[0]
    b3 = 1.0 + s[0] * p[0] + s[1] * p[1] + s[2] * p[2]
    along = (
        b3 * (x * p[0] + y * p[1] + z * p[2])
        - (y * b2 - z * b1) * p[0] - (z * b0 - x * b2) * p[1] - (x * b1 - y * b0) * p[2]
    )  # fmt: skip
    scalar = w * b3 + x * b0 + y * b1 + z * b2
    if scalar < 0.0:
        along, scalar = -along, -scalar
    return 2.0 * math.atan2(along, scalar)


@kernel
def attempt(
    channels, changed, counts, loops, magnitudes, directions, marks, first,
    states, quaternions, seen, turns, dynamics, measured, marked,
):  # fmt: skip
    """Steps, twice and four times as many, all side by side, of some momenta; the last line of arguments is filled.

    channels: (7 K, STAGES, 9) at the stages of the steps of one loop, of each panel first its own, then twice and four
        times as many, times their lengths
    changed: (2 K, STAGES, 9) of twice as many steps, on series with errors like those they probably have
    counts: (P,) steps of each panel
    magnitudes, directions: (B,), (B, 3) of the momenta
    marks: (M,) numbers of steps after which turned starts are compared, ascending
    first: which step of all loops the next one is
    states: (B, 7, 4) attitudes so far by steps, twice, four times as many, on changed series, and from turned starts;
        at `marks` the last three say how errors grow
    quaternions, seen, turns, dynamics: (B, 4 N + 1, 4), (B, 4 N + 1, 3), (B, 4 N), (B, 4 N) of all four times as many
    measured: (B, 4) largest angles between steps and twice as many, these and four times as many, these and those on
        changed series; and the sum of all angles turned
    marked: (B, M, 4, 4) attitudes at marks, then those from turned starts
    """
    for row in range(len(magnitudes)):
        slopes = np.empty((STAGES, 4))
        magnitude, direction, state = magnitudes[row], directions[row], states[row]
        finest, largest, sight = quaternions[row], measured[row], seen[row]
        done, mark, jobs = first, 0, len(_STATES) if len(marks) > 0 else len(_STATES) - 3
        while mark < len(marks) and marks[mark] <= done:
            if marks[mark] == done:
                _mark(state, marked[row, mark])
            mark += 1
        for _ in range(loops):
            start = 0
            for panel in range(len(counts)):
                count = counts[panel]
                for k in range(count):
                    for job in range(jobs):
                        which, number = _STATES[job], _NUMBERS[job]
                        s = state[which]
                        if which == _OF_CHANGED:
                            here = changed[2 * (start + k) + number]
                        elif which == _OF_FINEST:
                            here = channels[7 * start + 3 * count + 4 * k + number]
                        elif which == _OF_FINER:
                            here = channels[7 * start + count + 2 * k + number]
                        else:
                            here = channels[7 * start + k]
                        x, y, z, w, along = step(here, magnitude, direction, slopes, s[0], s[1], s[2], s[3])
                        s[0], s[1], s[2], s[3] = x, y, z, w
                        if which == _OF_CHANGED:
                            largest[2] = max(largest[2], angle_between(state[_OF_FINER], s))
                        if which == _OF_FINEST:
                            at = 4 * done + number
                            finest[at + 1, 0], finest[at + 1, 1], finest[at + 1, 2], finest[at + 1, 3] = x, y, z, w
                            largest[3] += angle_between(finest[at], s)
                            dynamics[row, at] = along
                            if magnitude != 0.0:
                                p0, p1, p2 = seen_from(x, y, z, w, direction[0], direction[1], direction[2])
                                sight[at + 1, 0], sight[at + 1, 1], sight[at + 1, 2] = p0, p1, p2
                                turns[row, at] = _turn_of_step(finest[at], s, sight[at], sight[at + 1])
                            if number % 2 == 1:
                                largest[1] = max(largest[1], angle_between(state[_OF_FINER], s))
                    largest[0] = max(largest[0], angle_between(state[0], state[_OF_FINER]))
                    done += 1
                    if mark < len(marks) and marks[mark] == done:
                        _mark(state, marked[row, mark])
                        mark += 1
                start += count


def warm() -> None:
    """Call the kernels with the least that they take."""
    none, one, north = np.zeros((4, STAGES, 9)), np.ones(1), np.array([[0.0, 0.0, 1.0]])
    still = np.array([[[0.0, 0.0, 0.0, 1.0]] * 5])
    integrate_steps(none, 1, one, north, 0, still)
    integrate_steps(none, 1, one, north + 0j, 0, still + 0j)
    counts, marks = np.ones(1, dtype=np.int64), np.zeros(1, dtype=np.int64)
    attempt(
        np.zeros((7, STAGES, 9)), none[:2], counts, 1, one, north, marks, 0, still[:, [0] * 7].copy(),
        still, np.zeros((1, 5, 3)), np.zeros((1, 4)), np.zeros((1, 4)), np.zeros((1, 4)), np.zeros((1, 1, 4, 4)),
    )  # fmt: skip
