"""Dynamic phase and area of the momentum's curve, piece by piece.

Each piece is stepped anew from its start, and once more in two halves, which shows the error. The attitude enters only
by the directions of the momentum, not by the turns that the motion's steps were composed of, so that the sums check
these.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .. import so3
from ..arrays import Array
from .constants import ORDER, STEPPING
from .kernels.curve_kernel import curve_pieces
from .lift import Lift
from .stepped import SteppedRotation
from .stepping import magnitudes_and_directions, part_channels

_AT_ONCE = 8_000  # pieces, whose channels take some twenty megabytes


class CurveIntegrals(NamedTuple):
    """Integrals over the momentum's curve on the sphere of a gauge, for a batch of B motions in M pieces."""

    dynamic: Array  # (B, M) integral of the gauge's omega . Pi/|Pi| over each piece [rad]
    slivers: Array  # (B, M) signed area between each piece's arc and its chord [sr]
    corners: Array  # (B, M + 1, 3) directions at the ends of the pieces, gauge axes
    error: Array  # (B,) estimate of the error of both sums [rad]
    slopes: Array  # (B, M + 1, 3) rates of the directions at the ends of the pieces, in the gauge but body axes [rad/s]
    by_momentum: Array  # (B, M + 1, 3) the part of the rates that is due to I^-1 Pi
    directions: Array  # (B, M + 1, 3) of the corners, in body axes


def curve_integrals(rotation: SteppedRotation, lift: Lift | None = None, edges: Array | None = None) -> CurveIntegrals:
    """Integrals in the base gauge, or in the horizontal one, whose lift has the ends of the steps among its own.

    `edges` (M + 1,) [s], the ends of the steps among them, are the ends of the pieces; None: those of the steps.
    """
    magnitudes, _ = magnitudes_and_directions(rotation.momentum)
    frames = None
    if edges is None:
        edges, directions = rotation.times, rotation.directions
        if lift is not None:
            frames = lift.at_ends(slice(None))
    else:
        directions = so3.apply(so3.transpose(rotation.rotation(edges)), rotation.directions[:, :1])
        if lift is not None:
            frames = lift.rotation.rotation(edges)[0]
    count = len(edges) - 1
    integrals, differences = np.empty((2, len(magnitudes), count, 2))
    starts = np.ascontiguousarray(directions[:, :-1])
    for first in range(0, count, _AT_ONCE):
        part = slice(first, min(first + _AT_ONCE, count))
        ends = edges[part.start : part.stop + 1]
        middles = np.stack([ends[:-1], 0.5 * (ends[:-1] + ends[1:])], axis=-1).ravel()
        sums, apart = np.zeros((2, len(magnitudes), len(ends) - 1, 2))
        curve_pieces(
            part_channels(rotation.interpolant, ends[:-1], np.diff(ends)),
            part_channels(rotation.interpolant, middles, np.repeat(0.5 * np.diff(ends), 2)),
            lift is not None,
            magnitudes,
            starts[:, part].copy(),
            sums,
            apart,
        )
        integrals[:, part], differences[:, part] = sums, apart
    inverse, drift = rotation.interpolant.inverse_and_drift(edges)
    spins = magnitudes[:, None, None] * (directions[:, :, None] * inverse).sum(axis=-1)
    by_momentum = so3.cross(directions, spins)
    slopes = by_momentum if lift is not None else so3.cross(directions, spins - drift)
    return CurveIntegrals(
        dynamic=integrals[..., 0],
        slivers=integrals[..., 1],
        corners=directions if frames is None else so3.apply(frames, directions),
        error=STEPPING * 2.0**-ORDER * differences.sum(axis=(1, 2)),
        slopes=slopes,
        by_momentum=by_momentum,
        directions=directions,
    )
