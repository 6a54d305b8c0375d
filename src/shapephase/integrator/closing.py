"""Curves of directions: closed by great circles, and references far from them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .. import so3, sphere
from ..arrays import Array, Integers
from .fast import closing, engine
from .fast.closing import ClosedCurves


def closed_curves(corners: Array, references: Array, axes: Array, first: Array, last: Array) -> ClosedCurves:
    """As `fast.closing.closed_curves`."""
    find = closing.closed_curves if engine.is_ready() else _closed_curves
    return find(corners, references, axes, first, last)


def far_references(curves: Array) -> Array:
    """`sphere.far_reference` of each of some curves: (B, N, 3) -> (B, 3)."""
    if engine.is_ready():
        return sphere.REFERENCES[closing.far_references(curves, _rows_of_references())]
    return np.array(list(map(sphere.far_reference, curves)))


@lru_cache(maxsize=1)
def _rows_of_references() -> Array:
    """(3, R)."""
    return np.ascontiguousarray(sphere.REFERENCES.T)


def _closed_curves(corners: Array, references: Array, axes: Array, first: Array, last: Array) -> ClosedCurves:
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


def areas_back(references: Array, ends: Array, starts: Array) -> Array:
    """Areas, seen from references, of the great circles from `ends` back to `starts`: (..., 3) each -> (...) [sr]."""
    half = so3.middle(ends, starts)
    return sphere.triangle_area(references, ends, half) + sphere.triangle_area(references, half, starts)


def jumps_between(starts: Array, first: Array, second: Array, grown: Array) -> Integers:
    """By how many spheres a closed area jumps between two corners of its curve: (..., 3) each, (...) -> (...).

    `grown` is what it grows by, the great circles back to `starts` included [sr]. Seen from the start the same triangle
    has no great circles beside it: it grows continuously, so that what differs is a whole number.
    """
    return np.rint((grown - sphere.triangle_area(starts, first, second)) / (4.0 * np.pi)).astype(np.int64)
