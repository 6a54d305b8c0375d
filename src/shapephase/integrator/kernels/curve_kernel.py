"""The momentum's curve: its integrals over pieces of a motion, and attitudes within steps.

A piece is a step of `step_kernel`'s formula from the identity on: the momentum's direction at its start is then what
rests in space. What is integrated along the way is weighted as the slopes are.
"""

from __future__ import annotations

import numpy as np

from ..machine_code import inline, kernel
from .step_kernel import STAGES, WEIGHTS, combined, normalised, seen_from, spin, step, turned_at


@inline
def _piece(channels, lifted, magnitude, first, slopes, lift_slopes, attitude, lift, sums):
    """Step attitude and lift (4,) along a piece in their place, and add to both integrals.

    channels: (STAGES, 9) times the piece's length; first: (3,) the first corner, body axes at the start
    """
    x, y, z, w = attitude[0], attitude[1], attitude[2], attitude[3]
    a, b, c, d = lift[0], lift[1], lift[2], lift[3]
    n0, n1, n2 = first[0], first[1], first[2]
    for stage in range(STAGES):
        here = channels[stage]
        q0, q1, q2, q3 = combined(slopes, stage, x, y, z, w)
        p0, p1, p2 = seen_from(q0, q1, q2, q3, first[0], first[1], first[2])
        s0, s1, s2 = spin(here, magnitude, p0, p1, p2)
        turned_at(slopes, stage, q0, q1, q2, q3, s0 - here[6], s1 - here[7], s2 - here[8])
        if lifted:
            # The gauge's frame turns at minus the drift: in body axes the first corner does not rest.
            g0, g1, g2, g3 = combined(lift_slopes, stage, a, b, c, d)
            n0, n1, n2 = seen_from(g0, g1, g2, g3, first[0], first[1], first[2])
            turned_at(lift_slopes, stage, g0, g1, g2, g3, -here[6], -here[7], -here[8])
        else:
            s0, s1, s2 = s0 - here[6], s1 - here[7], s2 - here[8]
        along = s0 * p0 + s1 * p1 + s2 * p2
        turn = (along + n0 * s0 + n1 * s1 + n2 * s2) / (1.0 + n0 * p0 + n1 * p1 + n2 * p2)
        sums[0] += WEIGHTS[stage] * along
        sums[1] += WEIGHTS[stage] * (along - turn)
    x, y, z, w = combined(slopes, STAGES, x, y, z, w)
    attitude[0], attitude[1], attitude[2], attitude[3] = normalised(x, y, z, w)
    if lifted:
        a, b, c, d = combined(lift_slopes, STAGES, a, b, c, d)
        lift[0], lift[1], lift[2], lift[3] = normalised(a, b, c, d)


@kernel
def curve_pieces(channels, halves, lifted, magnitudes, directions, integrals, differences):
    """Integrals over M pieces of the curves of B momenta, by two steps each, and how far one step is from that.

    channels, halves: (M, STAGES, 9), (2 M, STAGES, 9) at the stages of a step over each piece, and of two halves
    lifted: whether the gauge is the horizontal one, not the base
    magnitudes, directions: (B,), (B, M, 3) of the momenta, body axes at the start of each piece
    integrals, differences: (B, M, 2) to be filled: of the gauge's omega . Pi/|Pi|, and areas between arc and chord
    """
    for row in range(len(magnitudes)):
        slopes, lift_slopes = np.empty((STAGES, 4)), np.empty((STAGES, 4))
        attitude, lift, whole = np.empty(4), np.empty(4), np.empty(2)
        for piece in range(len(channels)):
            first, sums = directions[row, piece], integrals[row, piece]
            for number in range(3):
                if number < 2:
                    # Before the whole, and before its first half.
                    attitude[:], lift[:] = 0.0, 0.0
                    attitude[3], lift[3] = 1.0, 1.0
                if number == 0:
                    whole[:] = 0.0
                    here, total = channels[piece], whole
                else:
                    here, total = halves[2 * piece + number - 1], sums
                _piece(here, lifted, magnitudes[row], first, slopes, lift_slopes, attitude, lift, total)
            differences[row, piece, 0] = abs(whole[0] - sums[0])
            differences[row, piece, 1] = abs(whole[1] - sums[1])


@kernel
def within_steps(channels, magnitudes, directions, starts, attitudes, along):
    """Attitudes (B, N, 4) after parts of steps, and the integrals (B, N) of omega . Pi/|Pi| along them.

    channels: (N, STAGES, 9) at the stages of the parts, times their lengths
    magnitudes, directions: (B,), (B, 3) of the momenta; starts: (B, N, 4) attitudes where the parts begin
    """
    for row in range(len(magnitudes)):
        slopes = np.empty((STAGES, 4))
        for place in range(len(channels)):
            q, end = starts[row, place], attitudes[row, place]
            x, y, z, w, phase = step(channels[place], magnitudes[row], directions[row], slopes, q[0], q[1], q[2], q[3])
            end[0], end[1], end[2], end[3] = x, y, z, w
            along[row, place] = phase


def warm() -> None:
    """Call the kernels with the least that they take."""
    none, one, north = np.zeros((2, STAGES, 9)), np.ones(1), np.array([[[0.0, 0.0, 1.0]]])
    still = np.array([[[0.0, 0.0, 0.0, 1.0]]])
    curve_pieces(none[:1], none, True, one, north, np.zeros((1, 1, 2)), np.zeros((1, 1, 2)))
    within_steps(none[:1], one, north[0], still, still.copy(), np.zeros((1, 1)))
