"""Curves of directions closed by great circles, in machine code."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from ...arrays import Array, Integers
from ._plain import plain


class ClosedCurves(NamedTuple):
    """Of B curves, each closed by the great circle from its end to its start."""

    area: Array  # (B,) of the polygon of the corners, counted from the region opposite the reference [sr]
    closing: Array  # (B,) what the closing arc has of it [sr]
    tilt: Array  # (B, 3, 3) transport along the closing arc, inertial axes
    gap: Array  # (B,) angle between the ends [rad]
    turn: Array  # (B,) about the axis, from the tilt to the turn of the attitude, in (-pi, pi] [rad]


def closed_curves(corners: Array, references: Array, axes: Array, first: Array, last: Array) -> ClosedCurves:
    """Close them.

    Parameters
    ----------
    corners : (B, K + 1, 3) of the curves
    references : (B, 3)
    axes : (B, 3) of the momenta, inertial axes
    first, last : (B, 3, 3) attitudes of the gauge's frame at both ends
    """
    batch = len(corners)
    areas, tilts, gaps, turns = np.empty((2, batch)), np.empty((batch, 3, 3)), np.empty(batch), np.empty(batch)
    arrays = corners, references, axes, first, last
    _kernel().close_curves(*map(plain, arrays), areas, tilts, gaps, turns)
    return ClosedCurves(areas[0], areas[1], tilts, gaps, turns)


def far_references(curves: Array, references: Array) -> Integers:
    """Which of the references (3, R) have their opposites farthest from curves (B, N, 3): (B,)."""
    found = np.empty(len(curves), dtype=np.int64)
    _kernel().far_references(plain(curves), plain(references), found)
    return found


def warm() -> None:
    """Call the kernel with the least that it takes."""
    north, here = np.array([[0.0, 0.0, 1.0]]), np.eye(3)[None]
    closed_curves(np.repeat(north[:, None], 2, axis=1), north, north, here, here)
    far_references(north[None], here[0])


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.closing_kernel", __package__)
