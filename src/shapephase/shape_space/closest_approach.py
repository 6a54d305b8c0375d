"""Closest approach of each pair of links along a whole path: between samples no dip is missed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import check_object
from ..arrays import Array, Integers, Mask
from ..body.body import Body
from ..body.collisions.geometry import CollisionGeometry, Postures, collision_geometry
from ..body.loading import as_body
from ..chebyshev import inside, nodes_on, values_to_coefficients
from ..display import frozen, short_repr
from ..errors import ShapeError
from ..letters import value_text
from .body_path import users_route_along
from .path_series import panel_edges
from .shape_path import ShapePath

_RESOLUTION = 1e-4  # [m] by which a least distance may be overestimated before it is polished
_RELATIVE_RESOLUTION = 1e-2  # of the distance, the same for links far apart
_DEGREE = 8  # of the series that bounds rates on an interval: above that of all splines
_AT_ONCE = 256  # intervals: 10 MB for a humanoid
_SHARPEST = 1e-9  # share of the duration to which a time is polished


@dataclass(frozen=True)
class ClosestApproach:
    """Least distance of two links along a path. Made by `clearance`.

    Attributes
    ----------
    links : their names
    time : [s]
    distance : negative where they overlap: the depth [m]
    """

    links: tuple[str, str]
    time: float
    distance: float

    __repr__ = short_repr

    @property
    def text(self) -> str:
        """The links, how near they come, and when."""
        return f"{distance_text(self.links, self.distance)} at {self.time:.6g} s"


@frozen
class Clearance:
    """Least distances of pairs of links along a path. Made by `clearance`.

    Attributes
    ----------
    approaches : those below the given distance, the nearest first
    geometry : solids, pairs that were compared and pairs that were left out
    """

    approaches: tuple[ClosestApproach, ...]
    geometry: CollisionGeometry


def clearance(
    body: Body | str, path: ShapePath | str, *, below: float = np.inf, geometry: CollisionGeometry | None = None
) -> Clearance:
    """Return how near each pair of links comes along a path, and when.

    Parameters
    ----------
    below : distance [m]; only pairs that come nearer are listed: far fewer times are looked at
    geometry : solids and pairs; None: `collision_geometry(body)`

    Raises
    ------
    NoCollisionGeometryError
        If the body has no shapes.
    TrajectoryError, UnknownNameError
        If the path does not fit the body.
    ShapeError
        If `below` is not a number.

    Notes
    -----
    A distance changes no faster than L = the sum over the joints between two links of |rate| times the farthest reach
    of a link about the joint's axis. An interval of length h whose distance in the middle is d has none below d - L h/2
    (conservative advancement, Mirtich 1996); others are halved until that is within 0.1 mm, or 1 %, of the least,
    whose time is then found to nine digits.

    Examples
    --------
    >>> cat = sp.load_body("cat")
    >>> path = sp.ShapePath.waypoints([0.0, 1.0], [cat.shape(), cat.shape({"rear_left_hip_pitch": -1.5})])
    >>> nearest = sp.clearance(cat, path, below=0.01).approaches[0]
    >>> nearest.links, round(nearest.distance, 4)
    (('trunk_rear', 'rear_left_lower_leg'), -0.0223)
    """
    body = as_body(body)
    if not isinstance(below, int | float | np.number) or np.isnan(below):
        raise ShapeError(f"below: a distance in m is needed, got {value_text(below)}")
    route = users_route_along(body, path)
    known = collision_geometry(body) if geometry is None else geometry
    check_object(known, "CollisionGeometry", "geometry", call="collision_geometry(body)")
    search = _Search(known, route, float(below))
    edges = panel_edges(route)
    left, right = edges[:-1], edges[1:]
    undecided = np.ones((len(left), len(known.members[0])), dtype=bool)
    while len(left):
        parts = [
            search.narrowed(left[k : k + _AT_ONCE], right[k : k + _AT_ONCE], undecided[k : k + _AT_ONCE])
            for k in range(0, len(left), _AT_ONCE)
        ]
        undecided = np.concatenate(parts)
        divided = undecided.any(axis=1)
        left, right, undecided = left[divided], right[divided], undecided[divided]
        middle = 0.5 * (left + right)
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
        undecided = np.concatenate([undecided, undecided])
    approaches = [search.approach(pair) for pair in np.flatnonzero(search.least < below).tolist()]
    return Clearance(tuple(sorted(approaches, key=lambda approach: approach.distance)), known)


def distance_text(links: tuple[str, str], distance: float) -> str:
    """Return the names of links and how far they are apart, or how deep they overlap."""
    how = f"overlap by {-distance:.6g} m" if distance < 0.0 else f"are {distance:.6g} m apart"
    return f"{links[0]} and {links[1]} {how}"


class _Search:
    """Least distance of each pair of links so far, its time and its solids.

    least, when, nearest : (P,) [m], [s], and the pair of solids
    widths : (P,) of the interval with that time in the middle [s]
    """

    def __init__(self, geometry: CollisionGeometry, route: ShapePath, below: float) -> None:
        self._geometry, self._route, self._below = geometry, route, below
        self._reaches: Array | None = None
        count = len(geometry.pairs)
        self.least, self.when, self.widths = np.full(count, np.inf), np.zeros(count), np.zeros(count)
        self.nearest = np.zeros(count, dtype=np.int64)

    def narrowed(self, left: Array, right: Array, undecided: Mask) -> Mask:
        """Return which pairs of solids (I, K) may still come nearer within intervals than is known."""
        geometry, (_, owners) = self._geometry, self._geometry.members
        middle = 0.5 * (left + right)
        slack = 0.5 * (right - left)[:, None] * self._speeds(left, right)
        postures = geometry.postures(self._route.curve(middle)[0])
        floors = geometry.least_gaps(postures) - slack
        rows, members = np.nonzero(undecided & (floors < self._goals()[owners]))
        distances = self._measured(postures, left, right, rows, members)
        floors[rows, members] = distances - slack[rows, members]
        return undecided & (floors < self._goals()[owners])

    def approach(self, pair: int) -> ClosestApproach:
        """Return the closest approach of a pair, its time polished."""
        from scipy.optimize import minimize_scalar

        period, member = self._route.duration / self._route.loops, self.nearest[[pair]]
        rows = np.zeros(1, dtype=np.int64)

        def distance(time: float) -> float:
            postures = self._geometry.postures(self._route.curve(np.array([time]))[0])
            return float(self._geometry.separations(postures, rows, member).distances[0])

        when, width = float(self.when[pair]), float(self.widths[pair])
        bounds = max(when - width, 0.0), min(when + width, period)
        options = {"xatol": _SHARPEST * period}
        polished: Any = minimize_scalar(distance, bounds=bounds, method="bounded", options=options)
        # Paths often come nearest where they begin or end, which a bounded search leaves out.
        time, least = min(
            [(when, float(self.least[pair])), (float(polished.x), float(polished.fun))]
            + [(bound, distance(bound)) for bound in bounds],
            key=lambda entry: entry[1],
        )
        return ClosestApproach(self._geometry.pairs[pair], time, least)

    def _goals(self) -> Array:
        """Distances of pairs below which a further one counts: (P,)."""
        known = np.minimum(self.least, self._below)
        step = np.maximum(
            _RESOLUTION, _RELATIVE_RESOLUTION * np.abs(known), where=known < np.inf, out=np.zeros_like(known)
        )
        return known - step

    def _measured(self, postures: Postures, left: Array, right: Array, rows: Integers, members: Integers) -> Array:
        """Return distances of pairs of solids in postures in the middle of intervals, and keep the least: (M,)."""
        distances = self._geometry.separations(postures, rows, members).distances
        pairs = self._geometry.members[1][members]
        order = np.argsort(-distances, kind="stable")
        # Where a pair stands several times, the last and smallest distance stays.
        best = np.full(len(self.least), -1)
        best[pairs[order]] = order
        chosen = best[best >= 0]
        chosen = chosen[distances[chosen] < self.least[pairs[chosen]]]
        updated, interval = pairs[chosen], rows[chosen]
        self.least[updated], self.nearest[updated] = distances[chosen], members[chosen]
        self.when[updated] = 0.5 * (left + right)[interval]
        self.widths[updated] = (right - left)[interval]
        return distances

    def _speeds(self, left: Array, right: Array) -> Array:
        """Bounds of how fast the distances of solids change within intervals: (I, K) [m/s]."""
        times = nodes_on(*inside(left, right), _DEGREE)
        pair = self._geometry.chain.follows.with_rates(*self._route.curve(times.ravel()))
        series = (values_to_coefficients(_DEGREE) @ values.reshape(*times.shape, -1) for values in pair)
        # A Chebyshev series is nowhere larger than the sum of its coefficients.
        farthest, fastest = (np.abs(coefficients).sum(axis=1) for coefficients in series)
        if self._reaches is None:
            self._reaches = reaches(self._geometry, farthest.max(axis=0))
        return fastest @ self._reaches


def reaches(geometry: CollisionGeometry, farthest: Array) -> Array:
    """How much a distance changes at most by each joint of the chain: (k, K) [m per unit of joint].

    farthest : (k,) largest coordinates of the joints, which lengthen the reach of those that slide [rad or m]
    """
    chain, frames = geometry.chain, geometry.frames
    links, slides = np.linalg.norm(chain.places, axis=1), np.linalg.norm(chain.slides, axis=1)
    turning = np.linalg.norm(chain.axes, axis=1)
    levers = np.zeros((len(chain.parents), len(frames)))
    for solid, frame in enumerate(frames.tolist()):
        length = geometry.extents[solid]
        while frame:
            joint = frame - 1
            levers[joint, solid] = length
            length += links[joint] + slides[joint] * farthest[joint]
            frame = chain.parents[joint]
    first, second = geometry.members[0].T
    apart = chain.hanging[:, frames[first]] != chain.hanging[:, frames[second]]
    # Each joint between two solids carries one of them, and the other's lever about it is zero.
    lever = np.maximum(levers[:, first], levers[:, second])
    return apart * (slides[:, None] + turning[:, None] * lever)
