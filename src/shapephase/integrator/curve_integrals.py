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
from ..arrays import Array
from ._dense_output import TERMS, convolved, direction_terms, end_channels, hermite_matrix, transported
from .stepped import SteppedRotation

# Of the error that is estimated by the decay of three rules.
_SAFETY_FACTOR = 2.0
# Steps at once: their terms take twenty megabytes.
_MOST_STEPS = 10_000
# Keeps the decay defined where all differences are zero.
_TINY = 1e-300


class CurveIntegrals(NamedTuple):
    """Of the momentum's curve on the sphere of a gauge, for a batch of B motions of K steps."""

    dynamic: Array  # (B, K) integral of the gauge's omega . Pi/|Pi| over each step [rad]
    slivers: Array  # (B, K) signed area between each step's arc and its chord [sr]
    corners: Array  # (B, K + 1, 3) directions at the ends of the steps, gauge axes
    error: Array  # (B,) estimate of the error of both sums [rad]


def curve_integrals(rotation: SteppedRotation, lift: SteppedRotation | None = None) -> CurveIntegrals:
    """In the base gauge, or in the horizontal one, whose lift has the ends of the steps among its own."""
    batch, total = rotation.turns.shape
    magnitude = np.linalg.norm(rotation.momentum, axis=-1)
    ends = np.moveaxis(rotation.directions, -1, 0)
    # The gauge's frame at the step ends, body axes to gauge axes.
    frames = None
    if lift is not None:
        finer = np.tile(np.repeat(lift.steps // rotation.steps, rotation.steps), rotation.interpolant.loops)
        frames = so3.matrix_from_quat(lift.quaternions[0, np.append(0, np.cumsum(finer))])
    corners = rotation.directions if frames is None else so3.apply(frames, rotation.directions)
    dynamic, slivers = np.empty((batch, total)), np.empty((batch, total))
    differences = np.zeros((2, 2, batch))
    at_once = max(1, _MOST_STEPS // max(1, batch))
    for first in range(0, total, at_once):
        part = slice(first, min(first + at_once, total))
        after = slice(part.start + 1, part.stop + 1)
        channels, _ = end_channels(rotation.interpolant, rotation.steps, np.arange(part.start, part.stop))
        directions = np.stack([ends[:, :, part], ends[:, :, after]], axis=2)
        p, rates = direction_terms(directions, magnitude, channels)
        # The step's first corner, as it is seen from the body at both ends.
        still = np.zeros((3, TERMS, *directions.shape[1:]))
        of_frame = np.zeros((TERMS, *directions.shape[1:]))
        if frames is None:
            still[:, 0] = directions[:, :, :1]
        else:
            carried = so3.apply(so3.transpose(frames[after]), corners[:, part])
            still[:, 0] = np.stack([directions[:, :, 0], np.moveaxis(carried, -1, 0)], axis=2)
            drift = channels[6:, :, None]
            transported(still, -drift)
            rates = rates + drift
            of_frame = convolved(p, np.broadcast_to(drift, p.shape))
        along = convolved(p, rates)
        both, cosine = along + convolved(still, rates), convolved(still, p)
        cosine[0] += 1.0
        # The rate of the turn about the first corner, a quotient of series.
        turn = np.empty_like(both)
        for order in range(TERMS):
            known = (cosine[1 : order + 1] * turn[:order][::-1]).sum(axis=0) if order else 0.0
            turn[order] = (both[order] - known) / cosine[0]
        integrands = np.stack([of_frame, along - turn])
        by_rule = _rules() @ integrands.transpose(3, 1, 0, 2, 4).reshape(2 * TERMS, -1)
        by_rule = by_rule.reshape(3, 2, batch, integrands.shape[-1])
        dynamic[:, part] = rotation.dynamics[:, part] + by_rule[0, 0]
        slivers[:, part] = by_rule[0, 1]
        differences += np.abs(by_rule[:2] - by_rule[1:]).sum(axis=-1)
    late, early = differences
    error = _SAFETY_FACTOR * (late * np.minimum(late / (early + _TINY), 1.0)).sum(axis=0)
    return CurveIntegrals(dynamic, slivers, corners, error)


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
