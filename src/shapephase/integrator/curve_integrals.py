"""Dynamic phase and area of the momentum's curve, step by step, from derivatives at the ends of the steps.

What is integrated over a step is known there with its derivatives; a rule of the order of the steps' own dense output
needs nothing in between. The attitude enters only by the directions of the momentum, not by the turns that the steps
were composed of, so that what is found here is a check of these.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from .. import so3
from ..arrays import Array, Integers
from ._dense_output import (
    convolved,
    crossed,
    direction_terms,
    hermite_matrix,
    terms_at_ends,
    terms_of_pieces,
    transported,
)
from .fast import engine
from .fast.curves import PiecesOfCurve, curve_pieces
from .fast.estimate_constants import TERMS
from .lift import Lift
from .stepped import SteppedRotation

# Of the error that is estimated by the decay of three rules.
_SAFETY_FACTOR = 12.0
# Pieces at once: their terms, and those of the panels that they are in, take some twenty megabytes.
_MOST_STEPS = 2_000
# Keeps the decay defined where all differences are zero.
_TINY = 1e-300


class CurveIntegrals(NamedTuple):
    """Of the momentum's curve on the sphere of a gauge, for a batch of B motions in M pieces."""

    dynamic: Array  # (B, M) integral of the gauge's omega . Pi/|Pi| over each piece [rad]
    slivers: Array  # (B, M) signed area between each piece's arc and its chord [sr]
    corners: Array  # (B, M + 1, 3) directions at the ends of the pieces, gauge axes
    error: Array  # (B,) estimate of the error of both sums [rad]
    slopes: Array  # (B, M + 1, 3) rates of the directions at the ends of the pieces, in the gauge but body axes [rad/s]
    by_momentum: Array  # (B, M + 1, 3) the part of it that is due to I^-1 Pi
    directions: Array  # (B, M + 1, 3) as the corners, in body axes


def curve_integrals(rotation: SteppedRotation, lift: Lift | None = None, edges: Array | None = None) -> CurveIntegrals:
    """In the base gauge, or in the horizontal one, whose lift has the ends of the steps among its own.

    `edges` (M + 1,) [s], the ends of the steps among them, are the ends of the pieces; None: those of the steps.
    """
    magnitudes = np.linalg.norm(rotation.momentum, axis=-1)
    lengths = np.maximum(np.diff(rotation.times if edges is None else edges), _TINY)
    # The gauge's frame, body axes to gauge axes.
    frames = None
    if edges is None:
        directions = rotation.directions
        if lift is not None:
            frames = lift.at_ends(slice(None))
    else:
        directions = so3.apply(so3.transpose(rotation.rotation(edges)), rotation.directions[:, :1])
        if lift is not None:
            frames = lift.rotation.rotation(edges)[0]
    batch, total = len(magnitudes), len(lengths)
    pieces = PiecesOfCurve.empty(batch, total)
    find = curve_pieces if engine.is_ready() else _curve_pieces
    at_once = max(1, _MOST_STEPS // max(1, batch))
    for first in range(0, total, at_once):
        stop = min(first + at_once, total)
        if edges is not None:
            terms, places = terms_of_pieces(rotation.interpolant, edges[first : stop + 1])
        else:
            which = None if stop - first == total else np.arange(first, stop)
            terms, places = terms_at_ends(rotation.interpolant, rotation.steps, which)
        find(terms, places, first, directions, frames, lengths, magnitudes, _rules(), pieces)
    late, early = pieces.differences
    error = _SAFETY_FACTOR * (late * np.minimum(late / (early + _TINY), 1.0)).sum(axis=0)
    return CurveIntegrals(
        pieces.dynamic, pieces.slivers, pieces.corners, error, pieces.slopes, pieces.by_momentum, directions
    )


def _curve_pieces(
    terms: Array,
    places: Integers,
    first: int,
    directions: Array,
    frames: Array | None,
    lengths: Array,
    magnitudes: Array,
    rules: Array,
    found: PiecesOfCurve,
) -> None:
    """As `fast.curves.curve_pieces`."""
    part = slice(first, first + len(places))
    channels = terms[np.stack([places, places + 1])].transpose(3, 2, 0, 1)
    edges, after = slice(part.start, part.stop + 1), slice(part.start + 1, part.stop + 1)
    found.corners[:, edges] = directions[:, edges] if frames is None else so3.apply(frames[edges], directions[:, edges])
    ends = directions.transpose(2, 0, 1)
    both = np.stack([ends[:, :, part], ends[:, :, after]], axis=2)
    # The piece's first corner, as it is seen from the body at both ends.
    still = np.zeros((3, TERMS, *both.shape[1:]))
    still[:, 0] = both[:, :, :1]
    p, rates = direction_terms(both, magnitudes, channels)
    if frames is not None:
        seen = so3.apply(so3.transpose(frames[after]), found.corners[:, part])
        still[:, 0, :, 1] = seen.transpose(2, 0, 1)
        transported(still, -channels[6:, :, None])
        rates += channels[6:, :, None]
    along = convolved(p, rates)
    turn, cosine = along + convolved(still, rates), convolved(still, p)
    cosine[0] += 1.0
    # The rate of the turn about the first corner, a quotient of series.
    for order in range(TERMS):
        if order:
            turn[order] -= (cosine[1 : order + 1] * turn[:order][::-1]).sum(axis=0)
        turn[order] /= cosine[0]
    integrands = np.stack([along, along - turn])
    by_rule = (rules @ integrands.transpose(3, 1, 0, 2, 4).reshape(2 * TERMS, -1)).reshape(3, 2, *both.shape[1::2])
    found.dynamic[:, part], found.slivers[:, part] = by_rule[0]
    found.differences[:] += np.abs(by_rule[:2] - by_rule[1:]).sum(axis=-1)
    slopes = crossed(ends[:, :, edges], _at_edges(rates[:, 0], lengths[part]))
    found.slopes[:, edges] = found.by_momentum[:, edges] = slopes.transpose(1, 2, 0)
    if frames is None:
        by_drift = crossed(ends[:, :, edges], _at_edges(channels[6:, 0, None], lengths[part]))
        found.by_momentum[:, edges] += by_drift.transpose(1, 2, 0)


def _at_edges(of_pieces: Array, lengths: Array) -> Array:
    """What is known at both ends of pieces, times their lengths, at the edges: (3, B, 2, N), (N,) -> (3, B, N + 1)."""
    rates = of_pieces / lengths
    return np.concatenate([rates[:, :, 0], rates[:, :, 1, -1:]], axis=-1)


@lru_cache(maxsize=1)
def _rules() -> Array:
    """Taylor terms at both ends -> the integral over the step by all of them, and without the last one and two."""
    rules = np.zeros((3, 2, TERMS))
    for left_out, rule in enumerate(rules):
        terms = TERMS - left_out
        powers = np.arange(2 * terms)
        moments = np.where(powers % 2 == 0, 1.0 / (powers + 1.0), 0.0)
        rule[:, :terms] = (moments @ hermite_matrix(terms)).reshape(2, terms)
    return rules.reshape(3, -1)
