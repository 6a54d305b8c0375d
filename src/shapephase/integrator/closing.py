"""Curves of directions: closed by great circles, and references far from them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .. import so3, sphere
from ..arrays import Array, Integers


class ClosedCurves(NamedTuple):
    """Areas and turns of B curves, each closed by the great circle from its end to its start."""

    area: Array  # (B,) of the polygon of the corners, counted from the region opposite the reference [sr]
    closing: Array  # (B,) the closing arc's part of the area [sr]
    tilt: Array  # (B, 3, 3) transport along the closing arc, inertial axes
    gap: Array  # (B,) angle between the ends [rad]
    turn: Array  # (B,) about the axis, from the tilt to the turn of the attitude, in (-pi, pi] [rad]


def closed_curves(corners: Array, references: Array, axes: Array, first: Array, last: Array) -> ClosedCurves:
    """Close curves with corners (B, K + 1, 3), seen from references (B, 3).

    `axes` (B, 3) are those of the momenta, inertial axes; `first` and `last` (B, 3, 3) the gauge's frame at both ends.
    """
    departing, arriving = corners[:, 0], corners[:, -1]
    arcs = sphere.arc_areas(corners, references)
    tilt = first @ so3.between(arriving, departing) @ so3.transpose(first)
    return ClosedCurves(
        area=arcs.sum(axis=1),
        closing=arcs[:, -2:].sum(axis=1),
        tilt=tilt,
        gap=so3.angle_between(departing, arriving),
        turn=so3.angle_about(last @ so3.transpose(first) @ so3.transpose(tilt), axes),
    )


def far_references(curves: Array) -> Array:
    """`sphere.far_reference` of each curve: (B, N, 3) -> (B, 3)."""
    return np.array([sphere.far_reference(curve) for curve in curves]).reshape(-1, 3)


def areas_back(references: Array, ends: Array, starts: Array) -> Array:
    """Areas, seen from references, of the great circles from `ends` back to `starts`: (..., 3) each -> (...) [sr]."""
    half = so3.middle(ends, starts)
    return sphere.triangle_area(references, ends, half) + sphere.triangle_area(references, half, starts)


def jumps_between(starts: Array, first: Array, second: Array, grown: Array) -> Integers:
    """Number of spheres by which a closed area jumps between two corners of its curve: (..., 3) each -> (...).

    `grown` (...) is the growth of the area, the great circles back to `starts` included [sr]. From the start the
    triangle has no great circles beside it and grows continuously: the difference is a whole number.
    """
    return np.rint((grown - sphere.triangle_area(starts, first, second)) / (4.0 * np.pi)).astype(np.int64)
