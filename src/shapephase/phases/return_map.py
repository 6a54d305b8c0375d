"""The momentum map of a loop of shapes, and the motions whose shape and momentum close together.

Over one loop the direction u = Pi/|Pi| of the body momentum goes from u(0) to u(T): for each magnitude of the momentum
an area-preserving map of the sphere (theory.md section 2). A fixed point of it is an orbit that closes together with
the shape.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object, direction_argument, made_by, magnitude_argument
from ..arrays import Array, Integers
from ..card_pictures import sphere_picture
from ..deformation.deformation import Deformation
from ..display import Card, card_html, card_text, numbers, short_repr
from ..errors import AccuracyNotReached, ShapeError
from ..integrator.many_rotations import GroupedRotations
from ..integrator.stepped import SteppedRotation
from ..letters import value_text
from ..reconstruction.reconstruction import Motion, reconstruct
from ..run_progress import SEARCH_STRETCH, ProgressCallback, watched
from ._fixed_point_search import FAMILY_SPACING, SEARCH_TOLERANCE, search, spaced
from ._loop_map import UP, MomentumLoop, closed_points, ends_of, exact_slopes, tangent_basis

_REACHABLE = (1e-11, 1e-10, 1e-9, 1e-8)  # [rad] tolerances tried in turn; points are then known to ten times as much
_LEFSCHETZ = 2  # sum of the indices of all fixed points of a map of the sphere that deforms to the identity
_STARTS = [10 * 4**k + 2 for k in (2, 3, 4)]  # directions that the searches start from, until the indices add up
_FEWEST_DIRECTIONS = 1000  # with fewer the first search would end before its cells are small
_SAME = 1e-6  # [rad] between equal fixed points: far above the error of Newton's method, far below usual distances
_STABILITIES = ("elliptic", "hyperbolic", "inverse hyperbolic", "parabolic")


@dataclass(frozen=True, eq=False)
class ReturnMap:
    """Directions of the body momentum before and after one loop of shapes, in the deformation's frame.

    Made by `stroboscopic_map`.

    Attributes
    ----------
    magnitude : of the momentum [kg m^2/s]
    start, end : (..., 3) u(0) and u(T), unit vectors
    solution : the motions themselves, with the leading axes made one
    """

    magnitude: float
    start: Array
    end: Array
    solution: SteppedRotation | GroupedRotations

    __repr__ = short_repr

    @property
    def gap(self) -> Array:
        """Angle between start and end: (...) [rad]."""
        return so3.angle_between(self.start, self.end)[()]

    @cached_property
    def derivative(self) -> Array:
        """The linearised map between tangent planes, (..., 2, 2): exact, at one to five milliseconds a direction.

        In the basis e, u x e at the start, e = `so3.perpendicular(u)`, and the same basis carried along the shortest
        great circle at the end. The determinant is 1, since areas are kept.
        """
        start, end = self.start.reshape(-1, 3), self.end.reshape(-1, 3)
        slope, _ = exact_slopes(self.solution, start, end, self.magnitude)
        first = tangent_basis(start)
        carried = so3.apply(so3.between(start, end)[:, None], first)
        return (carried @ slope @ so3.transpose(first)).reshape(*self.start.shape[:-1], 2, 2)

    @cached_property
    def trace(self) -> Array:
        """Trace of the derivative: (...); it does not depend on the basis at the start."""
        return np.trace(self.derivative, axis1=-2, axis2=-1)[()]


@made_by("fixed_points(deformation, magnitude)")
@dataclass(frozen=True, eq=False)
class FixedPoints:
    """Directions of the body momentum that come back to themselves after one loop of shapes. Made by `fixed_points`.

    Attributes
    ----------
    magnitude : of the momentum [kg m^2/s]
    directions : (m, 3) unit vectors, the deformation's frame, ordered by height (to 1e-9) and azimuth
    trace : (m,) of the linearised map
    index : (m,) the sign of 2 - trace, +1 or -1; 0 where it is too near zero to tell
    stability : "elliptic" (|trace| < 2: neighbours circle it), "hyperbolic" (above 2), "inverse hyperbolic" (below
        -2), or "parabolic" (too near 2 or -2 to tell)
    gap : (m,) angle between u(T) and u(0) [rad]
    index_sum : of the indices; 2 for every loop and magnitude when none is missing
    complete : whether the indices sum to 2, none is 0, and the search left no part of the sphere out
    tolerance : of the attitudes by which they were found [rad]
    """

    magnitude: float
    directions: Array
    trace: Array
    index: Integers
    stability: tuple[str, ...]
    gap: Array
    index_sum: int
    complete: bool
    tolerance: float

    __repr__, _repr_html_ = card_text, card_html

    def _card(self) -> Card:
        """Number and stability of the directions, and whether these are all; with the sphere they are on."""
        counts = [f"{self.stability.count(kind)} {kind}" for kind in _STABILITIES if kind in self.stability]
        largest = float(np.max(self.gap, initial=0.0))
        rows = [
            ("momentum", numbers(self.magnitude, "kg m^2/s")),
            ("directions", f"{len(self.directions)}{': ' if counts else ''}{', '.join(counts)}"),
            ("complete", "yes: indices sum to 2" if self.complete else f"perhaps not: indices sum to {self.index_sum}"),
            ("gap", f"{largest:.1e} rad at most"),
            ("tolerance", f"{self.tolerance:.1e} rad"),
        ]
        kinds = [_STABILITIES.index(kind) for kind in self.stability]
        return Card("FixedPoints", rows, sphere_picture(self.directions, kinds, "directions on the sphere"))


def stroboscopic_map(
    deformation: Deformation,
    magnitude: float,
    directions: ArrayLike,
    *,
    tolerance: float = 1e-10,
) -> ReturnMap:
    """The map u(0) -> u(T) of directions of the body momentum over one loop of shapes.

    Source: theory.md section 2.

    Parameters
    ----------
    magnitude : of the angular momentum [kg m^2/s]; for 0 the map is the inverse of what the loop alone turns
    directions : (..., 3), of any length above 0, this deformation's frame
    tolerance : of each attitude [rad]

    Raises
    ------
    OpenPathError
        If the shape does not close.
    ShapeError
        If a direction is zero.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> axes = sp.stroboscopic_map(sp.articulated(cat, loop), 0.005, np.eye(3))
    >>> print(np.linalg.norm(axes.end, axis=-1).round(9))  # still on the sphere
    [1. 1. 1.]
    """
    check_object(deformation, "Deformation", "deformation")
    magnitude = magnitude_argument(magnitude, allow_zero=True)
    start = direction_argument(directions, "directions")
    flat = start.reshape(-1, 3)
    solution = MomentumLoop.of(deformation, tolerance).run_all(magnitude, flat)
    return ReturnMap(magnitude, start, ends_of(solution, flat).reshape(start.shape), solution)


def fixed_points(
    deformation: Deformation,
    magnitude: float,
    *,
    tolerance: float | None = None,
    most_directions: int = 100_000,
    progress: ProgressCallback | None = None,
) -> FixedPoints:
    """Directions of the body momentum that close together with the shape, as many as a search finds.

    The map is evaluated at even directions and halfway between neighbours, 640 together. Triangles in which a fixed
    point cannot be excluded and the map is not yet nearly linear are divided, down to 0.002 rad; from the last ones
    Newton's method starts, with exact derivatives. When the indices do not sum to 2, the search is repeated from four
    and from sixteen times as many directions.

    Every point returned is a fixed point, to its `gap`. That none is missing is likely, not certain: a sum of
    indices other than 2 proves that some are; a sum of 2 does not prove that none is, since two of opposite index may
    hide where the map bends far more than its values around show. `complete` is False, too, where the map stretches
    so much that `most_directions` do not resolve it, and where fixed points fill curves or the sphere (symmetric
    bodies; no holonomy and hardly any momentum): of those come points 0.3 rad apart or more, with index 0.

    Equation :eq:`lefschetz` of the documentation.
    Source: theory.md section 2, B9, D16.

    Parameters
    ----------
    magnitude : of the angular momentum, above 0 [kg m^2/s]
    tolerance : of the attitude [rad]; None: 1e-11, or where errors grow too much along the loop for that, the first of
        1e-10, 1e-9 and 1e-8 that can be met; `FixedPoints.tolerance` says which
    most_directions : 1000 or more at which the map is evaluated, in each of the three searches; about ten seconds
        for 100,000
    progress : as for `reconstruct`

    Raises
    ------
    OpenPathError
        If the shape does not close.
    AccuracyNotReached
        If errors grow so much along the loop that the tolerance cannot be met.
    RunStopped
        If `progress` stopped it.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> points = sp.fixed_points(sp.articulated(cat, loop), 0.005)
    >>> points.index_sum  # Lefschetz's number of the sphere
    2
    """
    check_object(deformation, "Deformation", "deformation")
    magnitude = magnitude_argument(magnitude)
    if not isinstance(most_directions, (int, np.integer)) or most_directions < _FEWEST_DIRECTIONS:
        raise ShapeError(
            f"most_directions: an integer from {_FEWEST_DIRECTIONS} is needed, got {value_text(most_directions)}"
        )
    with watched(progress, SEARCH_STRETCH):
        loop = MomentumLoop.of(deformation, _REACHABLE[0] if tolerance is None else tolerance)
        looser = _REACHABLE[1:] if tolerance is None else ()
        starts, exhausted = search(loop, magnitude, _STARTS[0], most_directions)
        points = _first_reachable(loop, looser, magnitude, starts, exhausted=exhausted)
        for count in _STARTS[1:]:
            if points.index_sum == _LEFSCHETZ or not points.index.all() or exhausted:
                break
            starts, exhausted = search(loop, magnitude, count, most_directions)
            starts = np.concatenate([points.directions, starts])
            points = _first_reachable(loop, looser, magnitude, starts, exhausted=exhausted)
        return points


def _first_reachable(
    loop: MomentumLoop, looser: tuple[float, ...], magnitude: float, starts: Array, *, exhausted: bool
) -> FixedPoints:
    """The fixed points to the loop's tolerance, or to the first of the looser ones that can be met."""
    for goal in looser:
        with contextlib.suppress(AccuracyNotReached):
            return _fixed_points_from(loop, magnitude, starts, exhausted=exhausted)
        loop = replace(loop, goal=goal)
    return _fixed_points_from(loop, magnitude, starts, exhausted=exhausted)


def closed_orbits(
    deformation: Deformation,
    magnitude: float,
    *,
    tolerance: float | None = None,
    progress: ProgressCallback | None = None,
) -> list[Motion]:
    """Motions (momentum along inertial z) whose body momentum closes in this deformation's gauge with the shape.

    The motions at the `fixed_points`, in their order, the highest first. Every loop and magnitude has at least two
    (theory.md section 2); `fixed_points` reports whether these are all.

    Parameters
    ----------
    magnitude : of the angular momentum, above 0 [kg m^2/s]
    tolerance : of each motion's attitude [rad]; None: as for `fixed_points`; `Motion.tolerance` says which
    progress : of the search, as for `reconstruct`

    Raises
    ------
    OpenPathError
        If the shape does not close.
    RunStopped
        If `progress` stopped it.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> orbits = sp.closed_orbits(sp.horizontal_gauge(sp.articulated(cat, loop)), 0.005)
    >>> len(orbits) >= 2, round(float(sp.split(orbits[0]).momentum_gap), 6)
    (True, 0.0)
    """
    check_object(deformation, "Deformation", "deformation")
    points = fixed_points(deformation, magnitude, tolerance=tolerance, progress=progress)
    # R^T z is the direction of the momentum in the body.
    attitudes = so3.transpose(so3.between(np.broadcast_to(UP, points.directions.shape), points.directions))
    return [reconstruct(deformation, points.magnitude * UP, r, tolerance=points.tolerance) for r in attitudes]


def _fixed_points_from(loop: MomentumLoop, magnitude: float, starts: Array, *, exhausted: bool) -> FixedPoints:
    """The fixed points that Newton's method reaches from these starts, with their stability."""
    roughly = closed_points(loop, magnitude, starts, max(SEARCH_TOLERANCE, loop.goal), 1e-5)
    near = roughly.points[(roughly.step < 1e-3) | (roughly.gap < 1e-4)]
    closed = closed_points(loop, magnitude, near[spaced(near, 30.0 * _SAME)], loop.goal, 1e-12)
    vague = np.abs(closed.excess) <= closed.doubt
    closed = closed[(closed.gap < loop.accepted) & ((closed.step < _SAME) | vague)]
    x, y, z = closed.points.T
    closed = closed[np.lexsort([np.arctan2(y, x), -np.round(z, 9)])]
    vague = np.abs(closed.excess) <= closed.doubt
    single, family = np.flatnonzero(~vague), np.flatnonzero(vague)
    single = single[spaced(closed.points[single], _SAME)]
    family = family[spaced(closed.points[family], FAMILY_SPACING)]
    closed = closed[np.sort(np.concatenate([single, family]))]
    excess, doubt = closed.excess, closed.doubt
    index = np.where(np.abs(excess) <= doubt, 0, np.sign(excess)).astype(np.int64)
    total = int(index.sum())
    return FixedPoints(
        magnitude=magnitude,
        directions=closed.points,
        trace=2.0 - excess,
        index=index,
        stability=tuple(_kind(e, d) for e, d in zip(excess, doubt, strict=True)),
        gap=closed.gap,
        index_sum=total,
        complete=total == _LEFSCHETZ and bool(index.all()) and not exhausted,
        tolerance=loop.goal,
    )


def _kind(excess: float, doubt: float) -> str:
    if min(abs(excess), abs(excess - 4.0)) <= doubt:
        return "parabolic"
    if excess < 0.0:
        return "hyperbolic"
    return "elliptic" if excess < 4.0 else "inverse hyperbolic"
