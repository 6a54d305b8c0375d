"""Surfaces of revolution d phi^2 + m(phi) d theta^2 that are symmetric about their equator, and their extremals.

Every metric taken here has its equator at phi = 0, m(-phi) = m(phi), and m falling from there to phi = `reach`. With

    y^2 = Y = 1 - m(phi)/m(0),  y of the sign of phi,        D(Y) = (d phi/dy) sqrt(1 - Y)

it is described by the one smooth function D, the *stretch* (D = 1 on the unit sphere, where y is the sine of the
latitude). Along an extremal with Clairaut's constant p, parametrised by arc length t, the *phase* chi is defined by

    y = sqrt(q) sin(chi),   q = 1 - p^2/m(0),

and grows by pi from one crossing of the equator to the next. Nothing is singular in it, turning points included:

    dt = D(Y) d chi,   d theta = (p/m(0)) D(Y)/(1 - Y) d chi,   d bend = 2 D'(Y) sin^2(chi) d chi,

the period is T = 4 t(pi/2), the first return R = 2 theta(pi/2), R' = -(2/m(0)) bend(pi/2) = T'/(2p), and the Jacobi
field normal to the extremal, 0 at the phase chi_0 with slope 1, is

    j(chi) = cos(chi) cos(chi_0) (L(chi) - L(chi_0)),   L = D(Y) tan(chi) - q bend(chi),   dL/dchi = D/cos^2(chi).

So L rises from minus to plus infinity between two turning points: there is exactly one conjugate point of every order
between consecutive ones. The Gauss curvature is (D - 2 Y D')/D^3.

Sources: Bonnard, Cots and Shcherbakova 2013, section 2 (the statements); Besse 1978, chapter 4 (the normal form, due
to Darboux); the formulas in chi follow by integrating theirs by parts. theory.md O1-O16.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_function, made_by, number_argument
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import AccuracyNotReached, ShapeError
from ...letters import value_text
from ...roots import ROUNDING, safe_newton
from .._arguments import FEW_ULPS, TWELVE_DIGITS, above_zero, check_entries
from ._arc_quadrature import Arcs, Stretch, folded_cosine, graded_rule, quadrature, settled_splits

ClosedArcs = Callable[[Array, Array, Array, Array], Arcs]  # p >= 0, q, depth - q, phases in [-pi/2, pi/2], all (N,)

NEAREST = 1e-60  # least depth - Y: at a parallel the stretch is infinite, and the curvature has reached its limit
_TABLE_ERROR = 1e-9  # relative error of tabulated metrics: of the slope at a smooth pole, of p next to a separatrix
_PHASES = np.linspace(0.0, np.pi, 66)  # at which the trends of the first return and of the curvature are sampled


@made_by("geodesics.spheroid(...) or surface_of_metric(...)")
@dataclass(frozen=True, eq=False)
class SurfaceOfRevolution:
    """A surface d phi^2 + m(phi) d theta^2 by its stretch; made by `surface_of_stretch` and the functions that call it.

    Lengths are in the unit of phi. Extremals oscillate about the equator if the absolute value of their Clairaut
    constant p is between `least_momentum` and `greatest_momentum`; these are covered, and the meridians p = 0 over
    smooth poles.
    Results are right to a few units of rounding, magnified by 1/(p/`least_momentum` - 1) before a parallel.

    Examples
    --------
    >>> sphere = sp.rigid_body.geodesics.ellipsoid(1.0)
    >>> sphere.equator, sphere.depth, sphere.end
    (1.0, 1.0, 'pole')
    """

    equator: float
    """m(0) > 0."""
    depth: float
    """Y at the reach, 1 - m(reach)/m(0), in (0, 1]."""
    end: str
    """At the reach: a "pole" (m = 0), a "parallel" (m' = 0), where a separatrix ends, or a "boundary" of the chart."""
    stretch: Stretch
    """Y and depth - Y, (N,) each -> D, D', D'' (N,) each."""
    closed_arcs: ClosedArcs | None
    """The integrals along extremals in closed form, where known."""
    splits: int
    """How fine the panels of the quadrature are."""

    __repr__ = short_repr

    @property
    def greatest_momentum(self) -> float:
        """sqrt(m(0)), p of the equator."""
        return float(np.sqrt(self.equator))

    @property
    def least_momentum(self) -> float:
        """sqrt(m(reach)); below it extremals leave the chart, or pass the parallel at its end."""
        return float(np.sqrt(self.equator * (1.0 - self.depth)))

    @property
    def reach(self) -> float:
        """The largest latitude phi."""
        return float(self.latitude(np.sqrt(self.depth)))

    @property
    def has_smooth_poles(self) -> bool:
        """True if it closes to a smooth sphere: sqrt(m) has the slope 1 at its poles, which are not tips of cones."""
        if self.end != "pole":
            return False
        stretch, _, _ = self.stretch(np.ones(1), np.zeros(1))
        return bool(abs(stretch[0] / self.greatest_momentum - 1.0) < _TABLE_ERROR)

    def height(self, latitude: ArrayLike) -> Array:
        """y of latitudes phi: (...) -> (...). Raises ShapeError beyond the reach."""
        phi = finite_array(latitude, "latitude")
        reach = self.reach
        beyond = np.abs(phi) > reach * (1.0 + TWELVE_DIGITS)
        check_entries(beyond, phi, "latitude", f"the surface reaches to {reach:.17g}")
        distance = np.minimum(np.abs(phi), reach).ravel()
        top = np.sqrt(self.depth)

        def step(angle: Array) -> tuple[Array, Array]:
            value, slope = self._meridian(angle)
            return value - distance, angle - (value - distance) / slope

        low, high = np.zeros_like(distance), np.full_like(distance, 0.5 * np.pi)
        angle = safe_newton(step, 0.5 * np.pi * distance / reach, low, high, ROUNDING)
        return np.copysign(top * np.sin(angle).reshape(phi.shape), phi)[()]

    def latitude(self, height: ArrayLike) -> Array:
        """phi of y in [-sqrt(depth), sqrt(depth)], the arc length along a meridian: (...) -> (...)."""
        y = finite_array(height, "height")
        top = np.sqrt(self.depth)
        check_entries(np.abs(y) > top * (1.0 + FEW_ULPS), y, "height", f"the surface reaches to {top:.17g}")
        value, _ = self._meridian(np.arcsin(np.clip(np.abs(y) / top, 0.0, 1.0)).ravel())
        return np.copysign(value.reshape(y.shape), y)[()]

    def metric(self, latitude: ArrayLike) -> Array:
        """m, the square of the distance from the axis: (...) -> (...)."""
        return self.equator * (1.0 - self.height(latitude) ** 2)

    def curvature(self, latitude: ArrayLike) -> Array:
        """Gauss curvature G = -(sqrt m)''/sqrt m at latitudes phi: (...) -> (...). Source: Bonnard et al., (A3)."""
        return self.curvature_at_height(self.height(latitude))

    def curvature_at_height(self, height: ArrayLike) -> Array:
        """Gauss curvature (D - 2 Y D')/D^3 at y: (...) -> (...)."""
        y = finite_array(height, "height")
        square = np.minimum(y * y, self.depth).ravel()
        value, slope, _ = self.stretch(square, np.maximum(self.depth - square, NEAREST))
        return ((value - 2.0 * square * slope) / value**3).reshape(y.shape)[()]

    def potential(self, latitude: ArrayLike, momentum: ArrayLike) -> Array:
        """V = p^2/m(phi), with (d phi/dt)^2 + V = 1: (...), (...) -> (...). Source: Bonnard et al., remark 1."""
        return finite_array(momentum, "momentum") ** 2 / self.metric(latitude)

    def momentum_of(self, direction: ArrayLike, latitude: ArrayLike = 0.0) -> Array:
        """p = sqrt(m) cos(direction) of extremals that start at this angle from east to north: (...) [rad] -> (...)."""
        return np.sqrt(self.metric(latitude)) * np.cos(finite_array(direction, "direction", unit="rad"))

    def direction_of(self, momentum: ArrayLike) -> Array:
        """The angle in [0, pi] at which an extremal with this p crosses the equator northward: (...) -> (...) [rad]."""
        p, q, _ = self.parameters(momentum)
        return np.arctan2(np.sqrt(q), p / self.greatest_momentum)[()]

    def parameters(self, momentum: ArrayLike) -> tuple[Array, Array, Array]:
        """p, q = 1 - p^2/m(0) and depth - q of extremals that oscillate: (...) -> (...) each.

        Raises ShapeError if the extremal with this p does not oscillate about the equator within the chart.
        """
        p = finite_array(momentum, "momentum")
        top, low = self.greatest_momentum, self.least_momentum
        magnitude = np.abs(p)
        # sqrt(m(0)) as rounded by a caller may be too large by its last digit.
        check_entries(magnitude > top * (1.0 + FEW_ULPS), p, "momentum", f"|p| is at most sqrt(m(0)) = {top:.17g}")
        magnitude = np.minimum(magnitude, top)
        if self.end == "pole":
            over_tip = (magnitude == 0.0) & (not self.has_smooth_poles)
            check_entries(over_tip, p, "momentum", "no extremal passes a cone's tip")
        else:
            least = low * (1.0 + _TABLE_ERROR) if self.end == "parallel" else low
            requirement = f"extremals oscillate above {low:.17g}, the p of the {self.end}"
            check_entries(magnitude < least, p, "momentum", requirement)
        q = (top - magnitude) * (top + magnitude) / self.equator
        return p, q, (magnitude - low) * (magnitude + low) / self.equator

    def arcs(self, momentum: ArrayLike, phase: ArrayLike) -> Arcs:
        """Time, longitude and bend from the equator to a phase: (...), (...) [rad] -> `Arcs`.

        Any real phase. At p = 0 the longitude is the limit from p > 0, half a turn for every pole that is passed.
        """
        p, q, room = self.parameters(momentum)
        chi = finite_array(phase, "phase", unit="rad")
        p, q, room, chi = np.broadcast_arrays(p, q, room, chi)
        return self.trusted_arcs(p, q, room, chi)

    def trusted_arcs(self, p: Array, q: Array, room: Array, chi: Array) -> Arcs:
        """`arcs` by p, q and depth - q, all of one shape; not checked."""
        turns = np.rint(chi / np.pi)
        rest = self._folded(p, q, room, chi - turns * np.pi)
        if not turns.any():
            return rest
        quarter = self._folded(p, q, room, np.full(chi.shape, 0.5 * np.pi))
        return Arcs(*(part + 2.0 * turns * whole for part, whole in zip(rest, quarter)))

    def _folded(self, p: Array, q: Array, room: Array, chi: Array) -> Arcs:
        flat = [np.ravel(a) for a in (np.abs(p), q, room, chi)]
        arcs = self.closed_arcs(*flat) if self.closed_arcs is not None else self._by_quadrature(*flat)
        time, longitude, bend = (part.reshape(np.shape(chi)) for part in arcs)
        return Arcs(time, np.where(np.signbit(p), -longitude, longitude), bend)

    def _by_quadrature(self, p: Array, q: Array, room: Array, chi: Array) -> Arcs:
        time, angle, bend, _ = quadrature(self.stretch, self.depth, self.end, q, room, chi, self.splits)
        greatest = self.greatest_momentum
        if self.end == "pole":
            tip, _, _ = self.stretch(np.ones(1), np.zeros(1))
            peak = tip[0] * np.arctan2(p / greatest * np.sin(chi), folded_cosine(chi))
        else:
            peak = np.zeros(())
        return Arcs(time, (peak + p / greatest * angle) / greatest, bend)

    def _meridian(self, angle: Array) -> tuple[Array, Array]:
        """phi where y = sqrt(depth) sin(angle), angles (N,) in [0, pi/2], and its derivative by the angle."""
        rate = self._meridian_rate(angle)
        if self.end == "pole":
            zero = np.zeros_like(angle)
            return self.trusted_arcs(zero, zero + 1.0, zero, angle).time, rate
        fraction, weight = graded_rule(self.splits)
        return angle * (self._meridian_rate(angle[:, None] * fraction) @ weight), rate

    def _meridian_rate(self, angle: Array) -> Array:
        sine, cosine = np.sin(angle).ravel(), np.maximum(folded_cosine(angle), 1e-8).ravel()
        rest = self.depth * cosine * cosine
        value, _, _ = self.stretch(self.depth * sine * sine, rest)
        rate = np.sqrt(self.depth) * value * cosine / np.sqrt((1.0 - self.depth) + rest)
        return rate.reshape(angle.shape)

    def period(self, momentum: ArrayLike) -> Array:
        """T(p), the length of an extremal until it comes back to its latitude and direction: (...) -> (...).

        Source: Bonnard et al., definition 2.4.
        """
        return 4.0 * self.arcs(momentum, 0.5 * np.pi).time[()]

    def first_return(self, momentum: ArrayLike) -> Array:
        """R(p), the longitude gained from one crossing of the equator to the next: (...) -> (...) [rad].

        Odd in p. Source: Bonnard et al., definition 2.4.
        """
        return 2.0 * self.arcs(momentum, 0.5 * np.pi).longitude[()]

    def first_return_rate(self, momentum: ArrayLike) -> Array:
        """R'(p), even in p: (...) -> (...). Source: Bonnard et al., lemma 2.8."""
        return -2.0 / self.equator * self.arcs(momentum, 0.5 * np.pi).bend[()]

    def first_return_second_rate(self, momentum: ArrayLike) -> Array:
        """R''(p): (...) -> (...)."""
        p, q, room = self.parameters(momentum)
        return (4.0 * p / self.equator**2 * self.bend_rate(q, room, np.full(p.shape, 0.5 * np.pi)))[()]

    def period_rate(self, momentum: ArrayLike) -> Array:
        """T'(p) = 2 p R'(p): (...) -> (...). Source: Bonnard et al., lemma 2.8."""
        return 2.0 * finite_array(momentum, "momentum") * self.first_return_rate(momentum)

    def period_second_rate(self, momentum: ArrayLike) -> Array:
        """T''(p) = 2 R'(p) + 2 p R''(p): (...) -> (...)."""
        p = finite_array(momentum, "momentum")
        return 2.0 * self.first_return_rate(p) + 2.0 * p * self.first_return_second_rate(p)

    def bend_rate(self, q: Array, room: Array, chi: Array) -> Array:
        """2 integral D'' sin^4, d bend/dq at a fixed phase in [-pi/2, pi/2]: q, depth - q, chi (...) -> (...)."""
        flat = np.ravel(q), np.ravel(room), np.ravel(chi)
        return quadrature(self.stretch, self.depth, self.end, *flat, self.splits)[3].reshape(np.shape(chi))

    def tameness(self) -> str:
        """Trend of the first return with p > 0: "decreasing" (tame), "increasing", "constant" or "neither".

        By its derivative at 64 values of p. Tame extremals, as the paper calls them, have no conjugate point before
        they return to the equator.
        Source: Bonnard et al., definition 2.5 and proposition 2.
        """
        square = 0.5 - 0.5 * np.cos(_PHASES[1:-1])
        rate = self.first_return_rate(np.sqrt(self.equator * (1.0 - self.depth * square)))
        return _trend(rate, 1e-11 * self.reach / self.equator)

    def is_greatest_curvature_on_equator(self) -> bool:
        """Assumption (A3): the Gauss curvature is positive on the equator and nowhere greater (65 latitudes)."""
        curvature = self.curvature_at_height(self._sampled_heights())
        return bool(curvature[0] > 0.0 and (curvature[1:] < curvature[0]).all())

    def curvature_trend(self) -> str:
        """Trend of the curvature from the equator to the reach: "decreasing", "increasing", "constant" or "neither"."""
        curvature = self.curvature_at_height(self._sampled_heights())
        if np.ptp(curvature) <= 1e-10 * np.abs(curvature).max():
            return "constant"
        return _trend(np.diff(curvature), 0.0)

    def _sampled_heights(self) -> Array:
        return np.sqrt(self.depth * (0.5 - 0.5 * np.cos(_PHASES[:-1])))


def _trend(rates: Array, rounding: float) -> str:
    """Trend of a function by its rates: "constant", "decreasing", "increasing" or "neither"."""
    if np.abs(rates).max() <= rounding:
        return "constant"
    return "decreasing" if rates.max() < 0.0 else "increasing" if rates.min() > 0.0 else "neither"


def surface_of_stretch(
    stretch: Stretch, equator: float, depth: float, end: str = "pole", closed_arcs: ClosedArcs | None = None
) -> SurfaceOfRevolution:
    """A surface by its stretch D(Y) = (d phi/dy) sqrt(1 - Y) with y^2 = Y = 1 - m(phi)/m(0); D = 1 on the unit sphere.

    Parameters
    ----------
    stretch : Y and depth - Y, (N,) each -> D, D', D'' (N,) each, D > 0; smooth for 0 <= Y < depth, and up to depth
        unless `end` is "parallel", where sqrt(depth - Y) D is
    equator : m(0)
    depth : Y at the reach; 1 for a pole
    end : "pole", "parallel" or "boundary"
    closed_arcs : the integrals along extremals in closed form, where known

    Raises
    ------
    ShapeError
        If `end` and `depth` do not belong to each other, or D is not positive.
    AccuracyNotReached
        If D is too rough for the quadrature to settle.

    Examples
    --------
    >>> from shapephase.rigid_body import geodesics
    >>> sphere = geodesics.surface_of_stretch(geodesics.EllipsoidStretch(1.0, 1.0), 1.0, 1.0)
    >>> print(f"{geodesics.cut_time(sphere, 0.5):.9f} = pi")
    3.141592654 = pi
    """
    check_function(stretch, "stretch", "a function of arrays")
    if closed_arcs is not None:
        check_function(closed_arcs, "closed_arcs", "a function of arrays")
    equator = above_zero(equator, "equator")
    depth = number_argument(depth, "depth")
    if not isinstance(end, str) or end not in ("pole", "parallel", "boundary"):
        raise ShapeError(f"end: expected one of pole, parallel, boundary, got {value_text(end)}")
    if not (0.0 < depth <= 1.0) or (end == "pole") != (depth == 1.0):
        raise ShapeError(
            f"depth: 1 - m(reach)/m(0) must be in (0, 1), and 1 for a pole; got {value_text(depth)} for a {end}"
        )
    square = depth * np.linspace(0.0, 0.999, 33)
    value, _, _ = stretch(square, depth - square)
    if not (np.isfinite(value).all() and (value > 0.0).all()):
        raise ShapeError("stretch: D(Y) must be positive and finite for 0 <= Y < depth")
    splits = settled_splits(stretch, depth, end)
    if splits is None:
        raise AccuracyNotReached("the metric is too rough: its integrals along extremals do not settle")
    surface = SurfaceOfRevolution(equator, depth, end, stretch, closed_arcs, splits)
    finer = replace(surface, splits=splits + 1)
    return surface if abs(surface.reach - finer.reach) <= 1e-13 * finer.reach else finer
