"""Columns of a path that are the four numbers of a ball joint, known by their names: where two of them are one turn.

A quaternion and its negative are the same turn, and so is any multiple: samples are given the signs of their
neighbours, so that curves through them go the short way.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array

_PARTS = ("x", "y", "z", "w")  # endings of the four names, behind a dot
_SAME = 1e-9  # difference of two unit quaternions of one rotation


def ball_columns(names: Sequence[str] | None) -> tuple[slice, ...]:
    """Where four names in a row are `joint.x`, `joint.y`, `joint.z` and `joint.w` of one joint."""
    known, balls = list(names or ()), []
    for first in range(len(known) - len(_PARTS) + 1):
        four = known[first : first + len(_PARTS)]
        joint = four[0].removesuffix(".x")
        if joint and tuple(four) == tuple(f"{joint}.{part}" for part in _PARTS):
            balls.append(slice(first, first + len(_PARTS)))
    return tuple(balls)


def neighbours_signs(samples: Array, balls: Sequence[slice]) -> Array:
    """The samples (N, n), quaternions with the sign that is nearer to the one before."""
    return samples * near_signs(samples, balls) if balls else samples


def near_signs(samples: Array, balls: Sequence[slice]) -> Array:
    """By what samples (N, n) are to be multiplied so that each quaternion is near the one before: (N, n), 1 or -1."""
    signs = np.ones_like(samples)
    for ball in balls:
        four = samples[:, ball]
        flips = np.where(np.sum(four[1:] * four[:-1], axis=1) < 0.0, -1.0, 1.0)
        signs[1:, ball] = np.cumprod(flips)[:, None]
    return signs


def factors_between(end: Array, start: Array, balls: Sequence[slice]) -> Array:
    """By what the columns of `start` are to be multiplied to be those of `end`, where these are the same turn: (n,)."""
    factors = np.ones(len(end))
    for ball in balls:
        length = float(start[ball] @ start[ball])
        factor = float(end[ball] @ start[ball]) / length if length else 1.0
        size = float(np.linalg.norm(end[ball]))
        if factor and np.linalg.norm(end[ball] - factor * start[ball]) <= _SAME * size:
            factors[ball] = factor
    return factors
