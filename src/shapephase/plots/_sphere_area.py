"""The inside of a closed curve on the sphere, cut into cells of one winding number each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3, sphere
from ..arrays import Array, Integers

_MAX_STRIPS = 1500  # between meridians: curves with many corners are drawn within seconds
_MIN_STRIPS = 120  # three degrees each: chords stay within a line's width of the circles
_MAX_SIDE = 0.05  # [rad] of a cell along a meridian, likewise
_SAME_MERIDIAN = 1e-12  # [rad]
MAX_WINDING = 3  # larger winding numbers have the shade of this one
_SAME_CORNER = 9  # decimals: a side that two cells share differs by rounding


@dataclass(frozen=True, eq=False)
class AreaCells:
    """Small polygons that cover the inside of a curve once.

    polygons : (m_k, 3) corners each, counterclockwise as seen from outside
    windings : (K,) winding number of the curve about each, counterclockwise positive; not zero, at most three
    """

    polygons: list[Array]
    windings: Integers

    @property
    def area(self) -> float:
        """The sum of the cells' areas times their windings [sr]."""
        areas = [float(sphere.triangle_area(p[0], p[1:-1], p[2:]).sum()) for p in self.polygons]
        return float(np.array(areas) @ self.windings)


def enclosed_cells(corners: Array, reference: Array) -> AreaCells:
    """The cells inside a closed polygon of great-circle arcs.

    The strips between the meridians of `reference` through the corners are cut by the arcs that cross them. Starting at
    the point opposite `reference`, where the winding number is zero, each arc adds its sense; so the area is that of
    `sphere.polygon_area`, counted from that point.

    corners : (N, 3) unit vectors, the last joined to the first
    reference : (3,) unit vector whose opposite is not on the curve
    """
    first = so3.perpendicular(reference)
    basis = np.stack([first, np.cross(reference, first)])
    x, y = corners @ basis.T[:, 0], corners @ basis.T[:, 1]
    azimuth = np.arctan2(y, x)
    edges = _strip_edges(azimuth)
    crossings = _crossings(corners, azimuth, edges, reference, basis)
    polygons, windings = [], []
    for strip, (heights, senses) in crossings.items():
        left, right = edges[strip], edges[(strip + 1) % len(edges)]
        sides = [np.cos(a) * basis[0] + np.sin(a) * basis[1] for a in (left, right)]
        outward = np.argsort(-heights.sum(axis=1), kind="stable")
        winding = np.clip(np.cumsum(senses[outward]), -MAX_WINDING, MAX_WINDING)
        # Higher winding numbers are shown alike, so that the arcs between them bound no cell.
        kept = np.flatnonzero(np.diff(winding, prepend=0))
        bounds = np.concatenate([heights[outward][kept], np.zeros((1, 2))])
        for k, layer in enumerate(winding[kept]):
            if layer:
                polygons.append(_cell(reference, sides, bounds[k], bounds[k + 1]))
                windings.append(int(layer))
    return AreaCells(polygons=polygons, windings=np.array(windings, dtype=np.int64))


def outlines(polygons: list[Array]) -> list[Array]:
    """The closed curves around polygons that lie side by side: sides gone along both ways cancel.

    What is on the left of a polygon's sides is on the left of these, so that a hole is gone round the other way.

    polygons : (m_k, d) corners each
    """
    corners = np.concatenate(polygons)
    _, first, place = np.unique(np.round(corners, _SAME_CORNER) + 0.0, axis=0, return_index=True, return_inverse=True)
    starts = place.ravel()
    ends = np.concatenate([np.roll(part, -1) for part in np.split(starts, np.cumsum([len(p) for p in polygons])[:-1])])
    sides, counts = np.unique(starts * len(first) + ends, return_counts=True)
    one, other = sides // len(first), sides % len(first)
    back = np.searchsorted(sides, other * len(first) + one)
    found = np.isin(other * len(first) + one, sides)
    kept = np.where(one == other, 0, counts - np.where(found, counts[np.where(found, back, 0)], 0))
    leaving: dict[int, list[int]] = {}
    for start, end, count in zip(one.tolist(), other.tolist(), kept.tolist(), strict=True):
        if count > 0:
            leaving.setdefault(start, []).extend([end] * count)
    curves = []
    while leaving:
        start = next(iter(leaving))
        curve, corner = [start], _next_corner(leaving, start)
        while corner != start:
            curve.append(corner)
            corner = _next_corner(leaving, corner)
        curves.append(corners[first[curve]])
    return curves


def _next_corner(leaving: dict[int, list[int]], corner: int) -> int:
    """Go along one of the sides that leave a corner, once."""
    following = leaving[corner].pop()
    if not leaving[corner]:
        del leaving[corner]
    return following


def _strip_edges(azimuth: Array) -> Array:
    """Azimuths of the meridians, ascending in (-pi, pi]: those of the corners, or some of them if there are many."""
    own = np.unique(azimuth)
    own = own[np.unique(np.linspace(0, len(own) - 1, min(len(own), _MAX_STRIPS)).astype(int))]
    edges = np.union1d(own, np.linspace(-np.pi, np.pi, _MIN_STRIPS + 1)[1:])
    return edges[np.diff(edges, prepend=-np.inf) > _SAME_MERIDIAN]


def _crossings(
    corners: Array, azimuth: Array, edges: Array, reference: Array, basis: Array
) -> dict[int, tuple[Array, Array]]:
    """For each strip the polar angles at which arcs cross its two sides (M, 2), and their senses (M,)."""
    count = len(edges)
    turn = so3.wrap(np.roll(azimuth, -1) - azimuth)
    cell = np.searchsorted(edges, azimuth, side="right")
    # Full turns are counted in cells, so that an arc across the branch cut of the azimuth is continuous.
    following = np.roll(cell, -1)
    across = np.round((turn - (np.roll(azimuth, -1) - azimuth)) / (2.0 * np.pi)).astype(np.int64)
    steps = following + count * across - cell
    rows = np.repeat(np.arange(len(corners)), np.abs(steps))
    order = np.arange(len(rows)) - np.repeat(np.cumsum(np.abs(steps)) - np.abs(steps), np.abs(steps))
    # An arc that goes up from cell c passes the edges c, c + 1, ...; one that goes down c - 1, c - 2, ...
    passed = np.where(steps[rows] > 0, cell[rows] + order, cell[rows] - 1 - order) % count
    normal = np.cross(corners[rows], np.roll(corners, -1, axis=0)[rows])
    angle = edges[passed][:, None]
    along = np.cos(angle) * basis[0] + np.sin(angle) * basis[1]
    point = np.cross(normal, np.cross(reference, along))
    outwards = np.sum(point * along, axis=-1)
    upwards = point @ reference * np.where(outwards < 0.0, -1.0, 1.0)
    polar = np.arctan2(np.abs(outwards), upwards)
    last, sense = np.roll(passed, 1), np.sign(steps[rows])
    before = np.roll(sense, 1)
    # A strip is crossed if its two sides are passed in one sense; otherwise the curve has turned back inside it.
    whole = (before == sense) & ((passed - last) % count == sense % count)
    strip = np.where(sense > 0, last, passed)
    start = np.roll(polar, 1)
    heights = np.where((sense > 0)[:, None], np.stack([start, polar], axis=-1), np.stack([polar, start], axis=-1))
    found: dict[int, tuple[Array, Array]] = {}
    for s in np.unique(strip[whole]):
        mine = whole & (strip == s)
        found[int(s)] = heights[mine], sense[mine].astype(np.float64)
    return found


def _cell(reference: Array, sides: list[Array], outer: Array, inner: Array) -> Array:
    """The polygon between two meridians and two arcs, with corners along the meridians every few degrees."""
    down, up = (
        np.linspace(a, b, 2 + int(abs(a - b) / _MAX_SIDE)) for a, b in ((inner[0], outer[0]), (outer[1], inner[1]))
    )
    left = np.cos(down)[:, None] * reference + np.sin(down)[:, None] * sides[0]
    right = np.cos(up)[:, None] * reference + np.sin(up)[:, None] * sides[1]
    return np.concatenate([left, right])
