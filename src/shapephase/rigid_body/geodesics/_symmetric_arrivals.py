"""Search for a time by which every geodesic from the identity has met another one of the same length.

Played backwards and turned by half a turn P about a principal axis, or not at all (P = 1), the geodesic of momentum Pi
up to t is that of momentum −P Pi(t), to the attitude P R(t)^T P. Where that is R(t), two geodesics of one length meet
and neither is the shortest any longer. In the quaternion q of R that is q_0 = 0 for P = 1, and q_i = 0 for the axis i,
unless both are the same one: then Pi_i(t/2) = 0. So it has happened before t if q_0(t) < 0 or Pi_i(t/2) q_i(t) < 0.

Sources: docs/theory/geodesics.md; Podobryaev 2019 for the symmetries.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ... import so3
from ...arrays import Array, Mask
from ._arrival_search import NEAR, cell_ends, largest_axial, momentum_cover
from ._momentum_cover import SLACK, TABLE_COST, Cells, FlowBounds, MomentumCover, coarse_cells
from ._momentum_flow import momentum_flow, quaternion_flow

INSTANTS = 32  # up to the time, at which the signs are taken
_WORTH = 0.05  # of the deviation's bound, below which a value cannot decide once its linear part is exact
_COST = 10  # evaluations of an attitude that a cell takes
_BLOCK = 1000  # cells at once


def all_met(inverse_moments: Array, time: float, about_third: float, most: int) -> tuple[bool, int]:
    """Whether almost all geodesics of unit speed are proven not to be the shortest up to a time, and the work.

    `about_third` is the length of a geodesic to the turn that the uniform rotation about the third axis makes in this
    time: the geodesics near it, which meet no symmetric one soon, are compared with that.
    """
    highest = largest_axial(inverse_moments, time)
    if not np.isfinite(highest) and inverse_moments[2] == 0.0:
        return False, 0
    cover = momentum_cover(inverse_moments, time, highest)
    cells, bounds, rows = coarse_cells(cover, highest, most // TABLE_COST)
    work = rows * TABLE_COST
    if not len(cells):
        return False, work
    # Half turns about the principal axes give the other three quarters.
    cells = cells[: len(bounds.growth)]
    at_pole = (cells.height + cells.half_height > 0.5 * np.pi - SLACK) & (not cover.forbidden)
    while len(cells) and work < most:
        block, cells = cells[:_BLOCK], cells[_BLOCK:]
        work += _COST * len(block)
        met = have_met(cover, bounds, block)
        polar = np.flatnonzero(at_pole[block.ancestor])
        n, _, _ = cover.chart(block.azimuth[polar], block.height[polar])
        apart = np.linalg.norm(n - [0.0, 0.0, cover.elongation], axis=-1) + cover.radius(block[polar])
        straight = bounds.growth[block.ancestor[polar], -1] * apart / np.sqrt(inverse_moments[2])
        met[polar] |= (about_third + straight) * (1.0 + SLACK) < time
        open_cells = block[~met]
        wide, high = cover.widths(open_cells)
        cells = open_cells.halved(wide > high).joined(cells)
    return not len(cells), work


def have_met(cover: MomentumCover, bounds: FlowBounds, cells: Cells) -> Mask:
    """True for cells of which all geodesics have met a symmetric one by one of the instants."""
    a, count = cover.inverse_moments, len(cells)
    times = cover.duration * np.arange(1, INSTANTS + 1) / INSTANTS
    instants, ancestors = np.tile(times, count), np.repeat(cells.ancestor, INSTANTS)
    radius = np.repeat(cover.radius(cells), INSTANTS)
    starts = np.repeat(cover.chart(cells.azimuth, cells.height)[0] * cover.units, INSTANTS, axis=0)
    quats = quaternion_flow(a, starts, instants)
    midway = momentum_flow(a, starts, 0.5 * instants)[0][:, :2]
    moved = bounds.momentum_growth(ancestors, 0.5 * instants) * radius
    known = np.abs(midway) > cover.units[:2] * moved[:, None] + SLACK
    components = [3, 0, 1]
    signs = np.concatenate([np.ones((len(starts), 1)), np.where(known, np.sign(midway), 0.0)], axis=-1)
    angle = bounds.at(ancestors, instants)[0] * radius
    shares = (-signs * quats[:, components] / (0.5 * angle[:, None])).reshape(count, INSTANTS, 3)
    met = np.zeros(count, dtype=bool)
    for column, component in enumerate(components):
        best = np.argmax(shares[..., column], axis=1)
        rows = np.flatnonzero(~met & (shares[np.arange(count), best, column] > _WORTH))
        chosen = rows * INSTANTS + best[rows]
        block = replace(cells[rows], time=instants[chosen])
        ends = cell_ends(cover, bounds, block)
        slope = so3.quat_product(ends.quats[:, None], np.eye(4)[:3])[..., component]
        spread = sum(np.abs(np.sum(slope * side, axis=-1)) for side in ends.sides) + ends.rest
        spread += np.linalg.norm(ends.fields, axis=(-2, -1)) * ends.bend
        # A quaternion's turn by y is y/2 but for |y|²/8.
        change = 0.5 * spread + 0.125 * ends.angle**2
        value = -signs[chosen, column] * ends.quats[:, component]
        met[rows] = (ends.angle < NEAR) & (value > change + SLACK)
    return met
