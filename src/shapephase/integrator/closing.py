"""Curves of directions: closed by great circles, and references far from them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from .. import so3, sphere
from ..arrays import Array
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
