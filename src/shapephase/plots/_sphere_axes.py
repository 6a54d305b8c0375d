"""Curves, points and areas on the unit sphere, in flat axes by parallel projection or in three-dimensional ones."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, Mask, finite_array
from ._sphere_area import MAX_WINDING, AreaCells, outlines
from .plot_style import SMALL, add_polygons, finish, finish_below

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_FAR_OPACITY = 0.25  # of curves and points on the far side
_POSITIVE = ("#BFDFF2", "#8CC4E6", "#5BA7D3")  # counterclockwise areas by winding number 1, 2, 3: blue
_NEGATIVE = ("#FBDDB0", "#F3BE73", "#E29C3C")
_HATCH = {True: "#B36A00", False: "#E0BC88"}  # of clockwise areas, on the near side or not
_FAR_SHADE = 0.55  # strength of an area's shade on the far side
_BEHIND = 0.3  # order in depth of background curves, below the others of their side
_TEXT_ROOM = 0.17  # [radii of the sphere] between texts
_VISIBLE_AREA = 5e-3  # [sr] a winding number of less is not in the legend
_AROUND = 1.3  # [radii] half the side of the picture: room for texts beside the sphere
_MARGIN = 0.08  # of the farthest point of a picture in space
_LIMB = -1e-9  # [1] height over the limb's plane: rounding on the limb is on the near side


class ParallelAxes:
    """Space in parallel projection, on flat axes, or on three-dimensional ones in the view they have.

    ax : flat axes, or three-dimensional ones
    view : elevation and azimuth of the eye [degrees], for flat axes
    """

    def __init__(self, ax: Axes, view: tuple[float, float]) -> None:
        self.ax: Any = ax
        self.solid = ax.name == "3d"
        elevation, azimuth = np.radians(
            [self.ax.elev, self.ax.azim] if self.solid else finite_array(view, "view", (2,))
        )
        rise, level = np.sin(elevation), np.cos(elevation)
        self.eye = np.array([level * np.cos(azimuth), level * np.sin(azimuth), rise])
        self.screen = np.array(
            [[-np.sin(azimuth), np.cos(azimuth), 0.0], [-rise * np.cos(azimuth), -rise * np.sin(azimuth), level]]
        )
        self.view = view
        self.named: dict[str, Any] = {}
        if self.solid:
            # Matplotlib would sort collections by their middles; here it is known what covers what.
            self.ax.computed_zorder = False

    def seen(self, points: Array) -> tuple[Array, ...]:
        """Coordinates in the axes: (..., 3) -> two or three (...)."""
        return tuple(np.moveaxis(points if self.solid else points @ self.screen.T, -1, 0))

    def line(self, points: Array, near: Mask, label: str | None, *, depth: float = 3.0, **style: Any) -> None:
        """Draw a curve (N, 3) of which `near` (N,) is seen; the rest is dimmed, and one unit deeper."""
        for piece, front in _pieces(points, near):
            self._draw(piece, front, label, zorder=depth if front else depth - 1.0, **style)

    def fill(self, corners: Array, face: str, edge: str, *, depth: float, hull: bool = False) -> None:
        """Fill a polygon (N, 3), or the outline of a convex body with these corners."""
        look = {"facecolor": face, "edgecolor": edge, "linewidth": 0.8, "alpha": 0.6, "zorder": depth}
        if self.solid:
            # The apex of a cone is the first corner, and its sides are triangles.
            sides = [corners[[0, k, k + 1]] for k in range(1, len(corners) - 1)] if hull else [corners]
            add_polygons(self.ax, sides, **look)
            return
        from matplotlib.patches import Polygon

        flat = corners @ self.screen.T
        self.ax.add_patch(Polygon(_hull(flat) if hull else flat, closed=True, **look))

    def mark(self, point: Array, label: str, **style: Any) -> None:
        """Draw a marker at (3,)."""
        look = {"linestyle": "none", "markeredgecolor": "white", "markeredgewidth": 0.7, "zorder": 6.0}
        (self.named[label],) = self.ax.plot(*self.seen(point[None]), **look, **style)

    def write(self, point: Array, text: str) -> None:
        """Write at (3,)."""
        self.ax.text(*self.seen(point), text, fontsize=SMALL + 1, ha="center", va="center", zorder=7)

    def frame(self, reach: Array, title: str, unit: str) -> None:
        """Set limits around points (N, 3), and the legend below; three-dimensional axes show the unit."""
        named: dict[str, Any] = {"handles": self.named.values(), "labels": self.named.keys(), "title": title}
        if self.solid:
            middle, half = 0.5 * (reach.min(axis=0) + reach.max(axis=0)), 0.5 * float(np.ptp(reach, axis=0).max())
            for name, centre in zip("xyz", middle, strict=True):
                getattr(self.ax, f"set_{name}lim")(centre - half, centre + half)
                getattr(self.ax, f"set_{name}label")(unit, fontsize=SMALL)
                self.ax.tick_params(axis=name, labelsize=SMALL)
            self.ax.set_box_aspect((1.0, 1.0, 1.0))
            finish(self.ax, loc="upper center", bbox_to_anchor=(0.5, -0.06), **named)
        else:
            flat = reach @ self.screen.T
            low, high = flat.min(axis=0), flat.max(axis=0)
            room = _MARGIN * float((high - low).max())
            self.ax.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")
            self.ax.set_axis_off()
            finish_below(self.ax, **named)

    def _draw(self, points: Array, near: bool, label: str | None, **style: Any) -> None:
        from matplotlib.lines import Line2D

        self.ax.plot(*self.seen(points), alpha=1.0 if near else _FAR_OPACITY, **style)
        if label is not None:
            # The legend shows the style of the near side, even if all of the curve is on the far side.
            self.named.setdefault(label, Line2D([], [], alpha=1.0, **style))


class SphereAxes(ParallelAxes):
    """The unit sphere in parallel projection; what is on its far side is dimmed.

    ax, view : as for `ParallelAxes`
    """

    def __init__(self, ax: Axes, view: tuple[float, float]) -> None:
        super().__init__(ax, view)
        around = np.linspace(0.0, 2.0 * np.pi, 181)[:, None]
        limb = np.cos(around) * self.screen[0] + np.sin(around) * self.screen[1]
        self.written: list[Array] = []
        self.ax.plot(*self.seen(limb), color="0.6", linewidth=0.8, zorder=1)

    def curve(self, points: Array, label: str, *, behind: bool = False, **style: Any) -> None:
        """Draw a curve (N, 3), dimmed on the far side; `behind` the others of its side."""
        self.line(points, points @ self.eye >= _LIMB, label, depth=3.0 - _BEHIND * behind, **style)

    def point(self, point: Array, label: str | None, *, behind: bool = False, **style: Any) -> None:
        """Draw a marker at (3,); without a label it is not in the legend."""
        look = {"markersize": 5.5, "markeredgecolor": "white", "markeredgewidth": 0.6, "linestyle": "none"}
        self._draw(
            point[None], bool(point @ self.eye >= _LIMB), label, zorder=5 - _BEHIND * behind, **{**look, **style}
        )

    def arrows(self, points: Array, places: Array, colour: str, *, shaft: float = 0.01) -> None:
        """Draw arrowheads along a curve (N, 3) at some of its points, on the near side of flat axes.

        `shaft` is the length of the arrow, of which only the head is seen [radii of the sphere].
        """
        for k in np.asarray(places, dtype=int):
            if self.solid or points[k] @ self.eye < 0.1:
                continue
            start, end = self.screen @ points[max(k - 1, 0)], self.screen @ points[min(k + 1, len(points) - 1)]
            length = float(np.linalg.norm(end - start))
            if length > 0.0:
                middle, step = self.screen @ points[k], shaft * (end - start) / length
                style = {"arrowstyle": "-|>", "color": colour, "mutation_scale": 9.0, "linewidth": 0.0}
                self.ax.annotate("", middle + step, middle - step, arrowprops=style, zorder=4, annotation_clip=True)

    def area(self, cells: AreaCells) -> None:
        """Fill the area inside a curve, shaded by winding number; negative areas are hatched."""
        for winding in sorted(set(cells.windings.tolist())):
            chosen = [polygon for polygon, w in zip(cells.polygons, cells.windings.tolist()) if w == winding]
            covered = AreaCells(polygons=chosen, windings=np.ones(len(chosen), dtype=np.int64)).area
            shade = min(abs(winding), len(_POSITIVE)) - 1
            colour = (_POSITIVE if winding > 0 else _NEGATIVE)[shade]
            name = f"winding {winding:+d}".replace("-", "−") + (" or more" if abs(winding) == MAX_WINDING else "")
            label = name if covered > _VISIBLE_AREA else None
            for near in (False, True):
                side = 1.0 if near else -1.0
                parts = [part for part in (_clipped(polygon, side * self.eye) for polygon in chosen) if len(part) > 2]
                if parts:
                    self._fill(parts, near, label, colour, winding)

    def keep_free(self, points: Array) -> None:
        """Keep text away from these points: (N, 3)."""
        self.written.extend(points @ self.screen.T)

    def text(self, point: Array, text: str, distance: float, **style: Any) -> None:
        """Write beside a point of the sphere, away from the middle of the picture and from other text."""
        box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.5}
        flat = self.screen @ point
        outward = distance * _outward(flat)
        angles = np.radians([0.0, 50.0, -50.0, 100.0, -100.0, 150.0, -150.0, 180.0])
        turned = np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ np.array([outward, [-outward[1], outward[0]]])
        near = np.array([np.zeros(2) - 10.0, *self.written])
        room = np.linalg.norm(flat + turned[:, None] - near, axis=-1).min(axis=1)
        chosen = flat + turned[np.argmax(np.minimum(room, _TEXT_ROOM))]
        self.written.append(chosen)
        place = point + 1.5 * (chosen - flat) @ self.screen if self.solid else chosen
        look = {"fontsize": SMALL, "ha": "center", "va": "center", "zorder": 6, "bbox": box}
        self.ax.text(*place, text, **{**look, **style})

    def finish(self, name: str, title: str) -> None:
        """Draw frame and legend; `name` labels three-dimensional axes, with {} for the index of the axis."""
        named: dict[str, Any] = {"handles": self.named.values(), "labels": self.named.keys(), "title": title}
        if self.solid:
            for axis, index in zip("xyz", "123"):
                getattr(self.ax, f"set_{axis}label")(name.replace("{}", index), fontsize=SMALL, labelpad=-8.0)
                getattr(self.ax, f"set_{axis}ticks")([-1.0, 1.0])
            self.ax.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0), zlim=(-1.0, 1.0))
            self.ax.set_box_aspect((1.0, 1.0, 1.0))
            finish(self.ax, loc="upper center", bbox_to_anchor=(0.5, -0.06), **named)
        else:
            self.ax.set(xlim=(-_AROUND, _AROUND), ylim=(-_AROUND, _AROUND), aspect="equal")
            self.ax.set_axis_off()
            finish_below(self.ax, **named)

    def _fill(self, parts: list[Array], near: bool, label: str | None, colour: str, winding: int) -> None:
        """Fill all cells of one kind as one path around them, so that it is short and there are no seams."""
        from matplotlib.colors import to_rgb
        from matplotlib.patches import Patch, PathPatch
        from matplotlib.path import Path

        strength = 1.0 if near else _FAR_SHADE
        face = tuple(1.0 - strength * (1.0 - np.array(to_rgb(colour))))
        gid = f"area {winding:+d} {'near' if near else 'far'}"
        depth = 1.5 if near else 1.2
        hatch: dict[str, Any] = {"hatch": "////", "edgecolor": _HATCH[near]} if winding < 0 else {}
        if self.solid:
            look = {"facecolor": face, "edgecolor": face, "linewidth": 0.3, "gid": gid, "zorder": depth}
            add_polygons(self.ax, parts, **look)
            hatch = {}
        else:
            paths = [Path(np.vstack([part, part[:1]]) @ self.screen.T, closed=True) for part in outlines(parts)]
            whole = Path.make_compound_path(*paths)
            # Added as an artist: as a patch, each of its curves would be searched for the limits of the data.
            self.ax.add_artist(PathPatch(whole, facecolor=face, linewidth=0.0, gid=gid, zorder=depth, **hatch))
        if label is not None:
            pattern = {**hatch, "edgecolor": _HATCH[True]} if hatch else {}
            self.named.setdefault(label, Patch(facecolor=colour, linewidth=0.0, **pattern))


def _pieces(points: Array, near: Mask) -> list[tuple[Array, bool]]:
    """A curve cut where it passes to the other side of the sphere; neighbouring pieces share the point of the cut."""
    cuts = np.flatnonzero(near[1:] != near[:-1]) + 1
    edges = [0, *cuts.tolist(), len(points)]
    return [(points[max(a - 1, 0) : b], bool(near[a])) for a, b in pairwise(edges)]


def _clipped(polygon: Array, towards: Array) -> Array:
    """The part of a small polygon on one half of the sphere (Sutherland and Hodgman 1974): (N, 3) -> (M, 3)."""
    height = polygon @ towards
    inside = height >= 0.0
    if inside.all():
        return polygon
    if not inside.any():
        return polygon[:0]
    corners = []
    for k in range(len(polygon)):
        after = (k + 1) % len(polygon)
        if inside[k]:
            corners.append(polygon[k])
        if inside[k] != inside[after]:
            # The great circle crosses the plane in proportion to the heights.
            crossing = height[k] * polygon[after] - height[after] * polygon[k]
            corners.append(crossing * np.sign(height[k]) / np.linalg.norm(crossing))
    return np.array(corners)


def _outward(place: Array) -> Array:
    distance = float(np.linalg.norm(place))
    return place / distance if distance > 0.05 else np.array([0.0, 1.0])


def _hull(points: Array) -> Array:
    """The convex hull of points of a plane, counterclockwise: (N, 2) -> (M, 2)."""
    from scipy.spatial import ConvexHull

    # Joggled, so that points on one line have one, too.
    return points[ConvexHull(points, qhull_options="QJ").vertices]
