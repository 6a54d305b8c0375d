"""Attitudes at places within steps: a part of a step is a step, by the same formula on the same series."""

from __future__ import annotations

import math

import numpy as np

from .dormand_prince import NODES, STAGES
from .jit import inline, kernel
from .stage_series import CHANNELS, SEGMENT, SIZE, STRIDE, basis_between, channels_at, room_for_basis, terms_that_count
from .steps_at_rest import rest_step
from .steps_with_momentum import momentum_step, product


@inline
def _part_of_step(c, b, magnitude, u, v, w):
    """The quaternion of a step from a direction on."""
    x, y, z, turn, _ = momentum_step(c, b, magnitude, u, v, w)
    cosine, sine = math.cos(0.5 * turn), math.sin(0.5 * turn)
    return product(
        sine * u, sine * v, sine * w, cosine,
        y * w - z * v, z * u - x * w, x * v - y * u, 1.0 + (u * x + v * y + w * z),
    )  # fmt: skip


@kernel
def rotations_within_steps(widths, series, steps, panels, within, fractions, starts, directions, magnitude, found):
    """Quaternions (N, 4) after parts of steps.

    widths, series, steps: as for `march_momenta`, of one loop
    panels, within: (N,) of each place, ascending: its panel of the first loop, and which of the panel's steps
    fractions: (N,) of the step
    starts: (N, 4) quaternions at the starts of these steps
    directions: (N, 3) of the momentum there; no rows: without momentum
    """
    terms, moving = series.shape[1] // CHANNELS, len(directions) > 0
    basis, scaled = np.empty(room_for_basis(terms)), np.empty((terms + 4) * CHANNELS)
    c, first, count = np.empty(SIZE), 0, len(panels)
    while first < count:
        panel, last = panels[first], first + 1
        while last < count and last - first < SEGMENT and panels[last] == panel:
            last += 1
        for k in range(first, last):
            for i in range(STAGES):
                place = (within[k] + fractions[k] * NODES[i]) / steps[panel]
                basis[STRIDE + (k - first) * STAGES + i] = 2.0 * place - 1.0
        here = terms_that_count(series[panel])
        used = basis_between((last - first) * STAGES, here, basis)
        factor = widths[panel] / steps[panel]
        channels_at(series[panel], here, factor, basis, used, 0 if moving else 6, scaled, c)
        for k in range(first, last):
            at = (k - first) * STAGES
            for j in range(0 if moving else 6, CHANNELS):
                for i in range(STAGES):
                    c[j * STRIDE + at + i] = fractions[k] * c[j * STRIDE + at + i]
            if moving:
                b0, b1, b2, b3 = _part_of_step(
                    c, np.uint32(at), magnitude, directions[k, 0], directions[k, 1], directions[k, 2]
                )
            else:
                b0, b1, b2, b3 = rest_step(c, np.uint32(at))
            x, y, z, w = product(starts[k, 0], starts[k, 1], starts[k, 2], starts[k, 3], b0, b1, b2, b3)
            scale = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
            found[k, 0], found[k, 1], found[k, 2], found[k, 3] = scale * x, scale * y, scale * z, scale * w
        first = last
