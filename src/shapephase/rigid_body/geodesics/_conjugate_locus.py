"""Conjugate points and cut loci on a surface of revolution.

Between consecutive turning points there is exactly one conjugate point of every order. The functions take any latitude
of the start, all orders, and directions (angles from east to north at the start).

On a smooth sphere of revolution, symmetric in its equator, whose curvature falls all the way from the equator to the
poles (an oblate ellipsoid), the cut locus of a point is an arc of the opposite parallel; where it rises (a prolate
one), an arc of the opposite meridian; on the round sphere the opposite point. The arc's ends are conjugate points.
It is an arc of the opposite parallel also where only the first return falls with p, whatever the curvature does:
extremals of opposite directions meet there, after half a period, and those of smaller p farther on.

Sources: Sinclair and Tanaka 2007, main theorem; Bonnard, Caillau, Sinclair and Tanaka 2009, for first returns; Bonnard,
Cots and Shcherbakova 2013, end of section 2; theory.md O16, P6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_object, number_argument, whole_argument
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...letters import value_text
from ...roots import ROUNDING, safe_newton
from .._arguments import TWELVE_DIGITS
from ._arc_quadrature import Arcs, folded_cosine
from ._extremal import Start, start_of, stretch_at
from .surface_of_revolution import SurfaceOfRevolution

_HIGHEST_ORDER = 1000  # up to here the phase, order times pi, keeps twelve digits between two turning points


@dataclass(frozen=True, eq=False)
class ConjugatePoints:
    """Conjugate points along extremals in directions (...). Made by `conjugate_points`."""

    direction: Array
    """Angle at the start from east to north [rad]."""
    momentum: Array
    """Clairaut's p of the extremal."""
    time: Array
    """Length of the extremal to the conjugate point."""
    latitude: Array
    """phi of the conjugate point."""
    longitude: Array
    """theta gained on the way, not reduced [rad]."""
    height: Array
    """y = sqrt(1 - m/m(0)), of the sign of phi: the sine of the parametric latitude of an ellipsoid."""
    phase: Array
    """chi there, of the extremal mirrored northward [rad]."""

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class ConjugateLocus:
    """Conjugate locus of one order, sampled. Made by `conjugate_locus`."""

    order: int  #: Which conjugate point of each extremal, from 1.
    points: ConjugatePoints
    """In directions (N,), ascending."""
    time_rate: Array
    """(N,) derivative of the conjugate time by the direction."""
    cusp_directions: Array
    """(C,) directions [rad] between which samples the rate changes sign, in the middle: cusps of the locus."""

    __repr__ = short_repr

    @property
    def cusps(self) -> int:
        """Number of cusps; 0 where the locus is a single point."""
        return len(self.cusp_directions)


def conjugate_points(
    surface: SurfaceOfRevolution, direction: ArrayLike, order: int = 1, latitude: float = 0.0
) -> ConjugatePoints:
    """The conjugate points of an order along extremals from a latitude, longitude 0: directions (...) [rad] -> (...).

    Source: Bonnard et al., lemma 2.7 and remark 2, in the form of the module `surface_of_revolution`.
    Raises ShapeError if the order is not in 1..1000 or a direction leads out of the band of oscillating extremals.

    Examples
    --------
    >>> points = sp.rigid_body.geodesics.conjugate_points(sp.rigid_body.geodesics.ellipsoid(1.0), [0.3, 0.9])
    >>> print(points.time.round(9))  # pi on a sphere
    [3.14159265 3.14159265]
    """
    _check(surface, order)
    angle = finite_array(direction, "direction", unit="rad")
    return _points(surface, angle, start_of(surface, angle, latitude), order)[0]


def conjugate_points_of_momentum(surface: SurfaceOfRevolution, momentum: ArrayLike, order: int = 1) -> ConjugatePoints:
    """`conjugate_points` of a point on the equator along extremals with Clairaut constants p (...), northward.

    phi_1c and theta_1c of Bonnard et al., section 2.2, for order 1.

    Examples
    --------
    >>> from shapephase.rigid_body import geodesics
    >>> points = geodesics.conjugate_points_of_momentum(geodesics.ellipsoid(0.6), [0.95, 0.6])
    >>> print(np.abs(points.latitude).round(5))
    [0.04656 0.43376]
    """
    _check(surface, order)
    return _points(surface, *_equatorial(surface, momentum), order)[0]


def conjugate_locus(
    surface: SurfaceOfRevolution, directions: int | ArrayLike = 400, order: int = 1, latitude: float = 0.0
) -> ConjugateLocus:
    """The conjugate locus of a point: all conjugate points of an order, and its cusps.

    A cusp is where the conjugate time is extremal as the direction varies; two of them between neighbouring directions
    are missed. Raises ShapeError like `conjugate_points`; or for fewer than 8 directions.

    Parameters
    ----------
    directions : how many (the next multiple of 4), spread evenly over those that lead to oscillating extremals, none
        of them along an axis of symmetry; or (N,) ascending angles [rad]
    order : from 1
    latitude : of the point

    Examples
    --------
    >>> sp.rigid_body.geodesics.conjugate_locus(sp.rigid_body.geodesics.ellipsoid(0.8), 60).cusps
    4
    """
    latitude = number_argument(latitude, "latitude", "rad")
    _check(surface, order)
    if isinstance(directions, int | np.integer):
        if directions < 8:
            raise ShapeError(
                f"directions: 8 or more are needed, two in each quadrant, to see four cusps, got {directions}"
            )
        # The eastward half, none of them along an axis of symmetry.
        half = 2 * ((int(directions) + 3) // 4)
        east = _widest(surface, latitude) * (2.0 * (np.arange(half) + 0.5) / half - 1.0)
        if latitude == 0.0:
            points, rate = _points_and_rate(surface, east[len(east) // 2 :], order, latitude)
            points, rate = _mirrored(points, 0.0, ("latitude", "height")), np.concatenate([-rate[::-1], rate])
        else:
            points, rate = _points_and_rate(surface, east, order, latitude)
        points, rate = _mirrored(points, np.pi, ("momentum", "longitude")), np.concatenate([rate, -rate[::-1]])
        closed = surface.has_smooth_poles
        band = np.repeat([0, 0 if closed else 1], len(east))
    else:
        chosen = finite_array(directions, "directions", (None,), unit="rad")
        if chosen.ndim != 1 or np.any(np.diff(chosen) <= 0.0):
            raise ShapeError("directions: expected how many, or ascending angles (N,)")
        points, rate = _points_and_rate(surface, chosen, order, latitude)
        band, closed = np.zeros(len(rate), dtype=int), False
    signs = np.sign(np.where(np.abs(rate) < 1e-11 * points.time, 0.0, rate))
    moving = np.flatnonzero(signs)
    ahead = np.roll(moving, -1)
    change = (signs[moving] != signs[ahead]) & (band[moving] == band[ahead]) & (closed | (ahead > moving))
    here, there = points.direction[moving[change]], points.direction[ahead[change]]
    there = np.where(there < here, there + 2.0 * np.pi, there)
    return ConjugateLocus(order=int(order), points=points, time_rate=rate, cusp_directions=0.5 * (here + there))


def conjugate_height_rate(surface: SurfaceOfRevolution, momentum: ArrayLike, order: int = 1) -> Array:
    """n R'' + integral of d^2 f/dp^2 from the equator on, which is 0 at cusps of a branch of the locus.

    The second derivative by p of the longitude on the latitude of the conjugate point of order n, of extremals from the
    equator with 0 < p < sqrt(m(0)): (...) -> (...). Where it is not 0 the branch has no cusp, also where R'' < 0.

    Source: Bonnard et al., before proposition 3, which assumes R'' > 0; theory.md B-E9, O13.
    Raises ShapeError if p is that of the equator, where it is infinite, or of no oscillating extremal.

    Examples
    --------
    >>> from shapephase.rigid_body import geodesics
    >>> float(geodesics.conjugate_height_rate(geodesics.ellipsoid(0.8), 0.5)) > 0.0  # one cusp on each axis
    True
    """
    _check(surface, order)
    angle, start = _equatorial(surface, momentum)
    p, q, room = start.momentum, start.q, start.room
    if np.any(q == 0.0):
        raise ShapeError(
            f"momentum: below sqrt(m(0)) = {surface.greatest_momentum:.17g}, at which the rate is infinite"
        )
    points, _, end = _points(surface, angle, start, order)
    xi = points.phase - order * np.pi
    value, slope, _ = stretch_at(surface, q, room, xi)
    second = surface.bend_rate(q, room, xi) + 2.0 * order * _whole_bend_rate(surface, q, room)
    sine, cosine = np.sin(xi), np.cos(xi)
    by_q = slope * sine**3 / cosine - end.bend - q * second
    # At a fixed latitude q sin^2(chi) is fixed, so chi moves with q.
    moving = by_q - value / cosine**2 * np.tan(xi) / (2.0 * q)
    return (-2.0 * p / (surface.equator**2 * q) * moving)[()]


@dataclass(frozen=True)
class CutLocus:
    """Cut locus of the point at a latitude and longitude 0: an arc between two ends. Made by `cut_locus`."""

    kind: str
    """ "parallel", "meridian" or "point"."""
    latitudes: tuple[float, float]
    """phi of the ends, ascending."""
    longitudes: tuple[float, float]
    """theta of the ends, ascending, about pi [rad]."""

    __repr__ = short_repr


def cut_locus(surface: SurfaceOfRevolution, latitude: float = 0.0) -> CutLocus:
    """The cut locus of the point at a latitude, longitude 0.

    Raises ShapeError if the surface is not a smooth sphere whose curvature changes one way from the equator to the
    poles, or whose first return falls with p, or the point is a pole.

    Examples
    --------
    >>> cut = sp.rigid_body.geodesics.cut_locus(sp.rigid_body.geodesics.ellipsoid(0.8))
    >>> print(cut.kind, np.round(np.array(cut.longitudes) / np.pi, 9))
    parallel [0.8 1.2]
    """
    kind = _kind(surface, latitude)
    phi = float(latitude)
    if kind == "point":
        return CutLocus(kind=kind, latitudes=(0.0 - phi, 0.0 - phi), longitudes=(np.pi, np.pi))
    if kind == "parallel":
        end = float(conjugate_points(surface, 0.0, 1, latitude).longitude)
        return CutLocus(kind=kind, latitudes=(0.0 - phi, 0.0 - phi), longitudes=(end, 2.0 * np.pi - end))
    ends = np.sort(conjugate_points(surface, np.array([0.5, -0.5]) * np.pi, 1, latitude).latitude)
    return CutLocus(kind=kind, latitudes=(float(ends[0]), float(ends[1])), longitudes=(np.pi, np.pi))


def cut_time(surface: SurfaceOfRevolution, direction: ArrayLike, latitude: float = 0.0) -> Array:
    """The length up to which extremals from a latitude in directions (...) [rad] are shortest: (...) -> (...).

    Until they meet their mirror image: at the opposite parallel, after half a period, or at the opposite meridian.

    Examples
    --------
    >>> print(f"{sp.rigid_body.geodesics.cut_time(sp.rigid_body.geodesics.ellipsoid(1.0), 0.5):.9f} = pi")
    3.141592654 = pi
    """
    kind = _kind(surface, latitude)
    angle = finite_array(direction, "direction", unit="rad")
    start = start_of(surface, angle, latitude)
    if kind != "meridian":
        return np.asarray(0.5 * surface.period(start.momentum))[()]
    p, q, room, first = (np.ravel(a) for a in (start.momentum, start.q, start.room, start.phase))
    magnitude = np.abs(p)
    begin = surface.trusted_arcs(magnitude, q, room, first)
    # Next to a meridian the longitude jumps at the pole, and the conjugate point is the limit of the meeting points.
    straight = magnitude <= 1e-9 * surface.greatest_momentum

    def step(chi: Array) -> tuple[Array, Array]:
        gained = surface.trusted_arcs(magnitude, q, room, chi).longitude - begin.longitude - np.pi
        square = q * np.sin(chi) ** 2
        value, _, _ = surface.stretch(square, surface.depth - square)
        rate = magnitude / surface.equator * value / np.maximum(1.0 - square, np.finfo(float).tiny)
        return gained, chi - gained / np.maximum(rate, np.finfo(float).tiny)

    chi = safe_newton(step, first + 0.9 * np.pi, first, first + np.pi)
    time = surface.trusted_arcs(magnitude, q, room, chi).time - begin.time
    conjugate = np.ravel(conjugate_points(surface, angle, 1, latitude).time)
    return np.where(straight, conjugate, time).reshape(angle.shape)[()]


def _kind(surface: SurfaceOfRevolution, latitude: float) -> str:
    check_object(surface, "SurfaceOfRevolution", "surface")
    if not surface.has_smooth_poles:
        raise ShapeError(f"a cut locus is known on smooth spheres of revolution; this one ends at a {surface.end}")
    if np.ndim(latitude) != 0 or not abs(float(surface.height(latitude))) < 1.0 - TWELVE_DIGITS:
        raise ShapeError(f"latitude: one number between the poles is needed, got {value_text(latitude)}")
    trend = surface.curvature_trend()
    if trend != "neither":
        return {"decreasing": "parallel", "increasing": "meridian", "constant": "point"}[trend]
    if surface.tameness() == "decreasing":
        return "parallel"
    raise ShapeError(
        "the curvature must fall, or rise, all the way from the equator to the poles, or the first return fall with p; "
        "they do not"
    )


def _equatorial(surface: SurfaceOfRevolution, momentum: ArrayLike) -> tuple[Array, Start]:
    """Directions and starts on the equator, northward, of extremals with these Clairaut constants."""
    p, q, room = surface.parameters(momentum)
    start = Start(momentum=p, q=q, room=room, phase=np.zeros(p.shape), side=np.ones(p.shape))
    return np.asarray(surface.direction_of(p)), start


def _points(surface: SurfaceOfRevolution, angle: Array, start: Start, order: int) -> tuple[ConjugatePoints, Arcs, Arcs]:
    """Conjugate points, and the integrals along the extremals up to the start and up to the conjugate point."""
    p, q, room, first = start.momentum, start.q, start.room, start.phase
    sine0, cosine0 = np.sin(first), folded_cosine(first)
    here = stretch_at(surface, q, room, first)[0]
    begin = surface.trusted_arcs(p, q, room, first)
    quarter = surface.trusted_arcs(p, q, room, np.full(p.shape, 0.5 * np.pi))
    whole = 2.0 * order * quarter.bend

    def step(xi: Array) -> tuple[Array, Array]:
        # Newton's rule in the tangent of xi, in which L is nearly a straight line.
        xi = xi.reshape(p.shape)
        there = stretch_at(surface, q, room, xi)[0]
        bend = surface.trusted_arcs(p, q, room, xi).bend
        level = here * sine0 + cosine0 * q * (bend + whole - begin.bend)
        value = cosine0 * there * np.sin(xi) - np.cos(xi) * level
        return value.ravel(), np.arctan2(level, cosine0 * there).ravel()

    limit = np.full(p.size, 0.5 * np.pi)
    guess = np.arctan2(here * sine0 + cosine0 * q * (whole - begin.bend), cosine0 * here)
    xi = safe_newton(step, np.ravel(guess), -limit, limit, ROUNDING).reshape(p.shape)
    rest = surface.trusted_arcs(p, q, room, xi)
    end = Arcs(*(partial + 2.0 * order * whole for partial, whole in zip(rest, quarter)))
    # The phase is xi and whole half turns, each of which changes the sign of y.
    height = (-1.0) ** order * start.side * np.sqrt(q) * np.sin(xi)
    top = np.sqrt(surface.depth)
    points = ConjugatePoints(
        direction=angle,
        momentum=p,
        time=end.time - begin.time,
        latitude=np.asarray(surface.latitude(np.clip(height, -top, top))),
        longitude=end.longitude - begin.longitude,
        height=height,
        phase=xi + order * np.pi,
    )
    return points, begin, end


def _points_and_rate(
    surface: SurfaceOfRevolution, angle: Array, order: int, latitude: float
) -> tuple[ConjugatePoints, Array]:
    """Conjugate points, and d t_c/d direction from L(chi) = L(chi_0) differentiated."""
    start = start_of(surface, angle, latitude)
    points, begin, end = _points(surface, angle, start, order)
    q, room, first, xi = start.q, start.room, start.phase, points.phase - order * np.pi
    rest = 1.0 - float(surface.height(latitude)) ** 2
    _, slope, _ = stretch_at(surface, q, room, xi)
    here, slope0, _ = stretch_at(surface, q, room, first)
    second0 = surface.bend_rate(q, room, first)
    second = surface.bend_rate(q, room, xi) + 2.0 * order * _whole_bend_rate(surface, q, room)
    sine, cosine, sine0, cosine0 = np.sin(xi), np.cos(xi), np.sin(first), np.cos(first)
    first_rate = -sine0 / cosine0 / (2.0 * np.where(q > 0.0, q, 1.0))
    level_rate = here / cosine0**2 * first_rate + slope0 * sine0**3 / cosine0 - begin.bend - q * second0
    by_q = slope * sine**3 * cosine - cosine**2 * (end.bend + q * second)
    time_rate = 0.5 * (end.bend - begin.bend) + cosine**2 * level_rate - by_q - here * first_rate
    return points, 2.0 * np.sin(angle) * np.cos(angle) * rest * time_rate


def _whole_bend_rate(surface: SurfaceOfRevolution, q: Array, room: Array) -> Array:
    return surface.bend_rate(q, room, np.full(q.shape, 0.5 * np.pi))


def _mirrored(points: ConjugatePoints, turn: float, changing: tuple[str, ...]) -> ConjugatePoints:
    """Conjugate points in ascending directions with their mirror images, in directions `turn` less theirs."""
    images = {name: (-values if name in changing else values)[::-1] for name, values in vars(points).items()}
    images["direction"] = turn - points.direction[::-1]
    pairs = [(images, vars(points)), (vars(points), images)][turn > 0.0]
    return ConjugatePoints(**{name: np.concatenate([pair[name] for pair in pairs]) for name in images})


def _widest(surface: SurfaceOfRevolution, latitude: float) -> float:
    """Largest angle to the parallels of extremals that oscillate, less a margin: there points are infinitely far."""
    if surface.has_smooth_poles:
        return 0.5 * np.pi
    here = float(np.sqrt(surface.metric(latitude)))
    if here <= surface.least_momentum:
        raise ShapeError(f"latitude: {latitude!r} is at the surface's end, from where no extremal oscillates")
    return float(np.arccos(surface.least_momentum / here)) * (1.0 - 1e-6)


def _check(surface: SurfaceOfRevolution, order: int) -> None:
    check_object(surface, "SurfaceOfRevolution", "surface")
    if whole_argument(order, "order", 1) > _HIGHEST_ORDER:
        raise ShapeError(f"order: a whole number from 1 to {_HIGHEST_ORDER} is needed, got {order}")
