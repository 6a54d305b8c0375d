"""Poinsot's picture of the free rigid body: the inertia ellipsoid rolls on the invariable plane, cones on cones.

Lengths in this picture are angular velocities [rad/s]: the ellipsoid {w : w.I w = 2K}, moved by the attitude, touches
the plane {w : w.mu = 2K} at the angular velocity. The point of contact draws the polhode on the ellipsoid and the
herpolhode on the plane.

Sources: Marsden and Ratiu, section 15.5 and case 2 of 15.8; theory.md H2, H9, I1-I5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .. import elliptic, so3, sphere
from ..arguments import check_object, number_argument, whole_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..letters import value_text
from ._arguments import TWELVE_DIGITS, above_zero
from .euler_top import EulerTop
from .portrait import inverse_difference

_TAIL = 60.0  # argument u of the separatrix: the arc beyond it is shorter than exp(-60) = 1e-26 of the whole


@dataclass(frozen=True)
class Closure:
    """Turns and lobes after which a herpolhode closes.

    A circle has no lobes and closes in one turn, a point has neither. Made by `Poinsot.closure`.
    """

    turns: int
    """Number of turns about mu."""
    lobes: int
    """Waves between the two circles that the herpolhode touches."""
    gap: float
    """Angle between its start and its end [rad]."""

    __repr__ = short_repr


@dataclass(frozen=True)
class Cones:
    """Body cone and space cone of an axisymmetric body; the first rolls on the second, both apices in the centre.

    Made by `cones`.
    """

    body_half_angle: float
    """Half angle of the body cone, about the axis of symmetry on the side of the momentum [rad]."""
    space_half_angle: float
    """Half angle of the space cone, about the momentum [rad]."""
    space_inside_body: bool
    """The space cone lies inside the body cone (oblate), or the two touch from outside (prolate)."""
    precession_rate: float
    """Rate of the axis of symmetry about the momentum, |mu| / I1 [rad/s]."""
    spin_rate: float
    """lambda, of the momentum about the axis of symmetry seen in the body [rad/s]; > 0 oblate, < 0 prolate."""

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class Poinsot:
    """The rolling ellipsoid of a top.

    Times are any real (...) [s]. A steady rotation, and every rotation of a body of three equal moments, is a single
    point of contact: radius, angle and arc length are zero. On the separatrix the herpolhode comes from the foot of
    the normal, touches the outer circle once, and spirals back: the inner radius is 0, the angle per period infinite.

    Raises ShapeError for a top without momentum, which has no invariable plane.

    Examples
    --------
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> poinsot = sp.rigid_body.Poinsot(top)
    >>> np.abs(poinsot.slip(np.linspace(0.0, 5.0, 7))).max().round(9).item()  # it rolls without slipping
    0.0
    """

    top: EulerTop

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Refuse a top at rest, which has no invariable plane."""
        check_object(self.top, "EulerTop", "top")
        if not self.top.magnitude > 0.0:
            raise ShapeError("top: its angular momentum is zero, so there is no invariable plane; give it a momentum")

    @property
    def normal(self) -> Array:
        """Unit normal of the invariable plane, inertial axes: (3,)."""
        return self.top.momentum / self.top.magnitude

    @property
    def distance(self) -> float:
        """From the centre to the invariable plane, 2K/|mu| [rad/s]. Source: Marsden and Ratiu (15.5.1)."""
        return float(self.top.magnitude * np.sum(self._start**2 / self.top.moments))

    @property
    def plane_axes(self) -> Array:
        """Two unit vectors that span the plane, inertial axes, with the normal right-handed: (2, 3).

        The first points from the foot of the normal to the herpolhode at t = 0, or anywhere if that is a point.
        """
        normal = self.normal
        if self._is_point:
            first = so3.perpendicular(normal)
        else:
            # Omega less its part along n is (n x Omega) x n, and `_across` gives n x Omega without loss of digits.
            perpendicular = np.cross(_across(self._start, self.top.moments), self._start)
            # Next to a steady rotation the square of its length would underflow.
            perpendicular /= np.abs(perpendicular).max()
            first = so3.normalised(so3.apply(self.top.attitude(0.0) @ self.top.axes, perpendicular))
        return np.stack([first, np.cross(normal, first)])

    @property
    def semi_axes(self) -> Array:
        """Semi-axes sqrt(2K/I) of the inertia ellipsoid, in the order of the top's moments: (3,) [rad/s]."""
        return np.sqrt(self.distance * self.top.magnitude / self.top.moments)

    def ellipsoid(self, t: ArrayLike) -> Array:
        """R I R^T of the ellipsoid {w : w.(R I R^T) w = 2K} in space: (...) -> (..., 3, 3) [kg m^2]."""
        attitude = self.top.attitude(t)
        return attitude @ self.top.inertia @ so3.transpose(attitude)

    def contact(self, t: ArrayLike, side: int = 1) -> Array:
        """Contact of the plane at right angles to mu with the ellipsoid, by its shape: (...) -> (..., 3) [rad/s].

        The plane on the side of mu (1), the invariable plane, or its mirror image (-1). By Poinsot's theorem the points
        are the angular velocity and its negative. Inertial axes.

        Raises ShapeError if side is not 1 or -1.
        """
        if not isinstance(side, int | np.integer) or side not in (1, -1):
            raise ShapeError(f"side: expected 1 or -1, got {value_text(side)}")
        ellipsoid = self.ellipsoid(t)
        direction = np.linalg.solve(ellipsoid, np.broadcast_to(self.normal, ellipsoid.shape[:-1])[..., None])[..., 0]
        length = np.sqrt(self.distance * self.top.magnitude / np.sum(direction * self.normal, axis=-1, keepdims=True))
        return side * length * direction

    def slip(self, t: ArrayLike) -> Array:
        """Velocity of the ellipsoid's material point in contact, zero to rounding: (...) -> (..., 3) [rad/s^2]."""
        return np.cross(self.herpolhode(t), self.contact(t))

    def polhode(self, t: ArrayLike) -> Array:
        """The point of contact on the ellipsoid, body axes: (...) -> (..., 3) [rad/s]."""
        return self.top.angular_velocity(t)

    def herpolhode(self, t: ArrayLike) -> Array:
        """The point of contact on the plane, inertial axes: (...) -> (..., 3) [rad/s]."""
        return so3.apply(self.top.attitude(t), self.top.angular_velocity(t))

    def herpolhode_radius(self, t: ArrayLike) -> Array:
        """Distance of the herpolhode from the foot of the normal, |Pi x Omega|/|Pi|: (...) -> (...) [rad/s]."""
        times = finite_array(t, "t", unit="s")
        if self._is_point:
            return np.zeros(times.shape)[()]
        return self._radius(self.top.orbit.directions(self.top.rate * times + self.top.orbit.phase))

    def herpolhode_angle(self, t: ArrayLike) -> Array:
        """Angle of the herpolhode about mu from where it is at t = 0, unwrapped: (...) -> (...) [rad].

        The azimuth of the circled axis, an integral of the third kind, and a periodic arctangent.
        Source: theory.md H9; the arctangent is derived from Pi x (Omega x Pi).
        """
        times = finite_array(t, "t", unit="s")
        if self._is_point:
            return np.zeros(times.shape)[()]
        return (self._angle(times) - self._angle(np.zeros(())))[()]

    @property
    def annulus(self) -> tuple[float, float]:
        """Radii of the circles that the herpolhode touches [rad/s]; 0 for the inner one on the separatrix."""
        if self._is_point:
            return 0.0, 0.0
        orbit, moments = self.top.orbit, self.top.moments
        outer = inverse_difference(moments, orbit.other, orbit.circled)
        widest = orbit.magnitude * abs(orbit.amplitudes[orbit.other] * orbit.amplitudes[orbit.circled] * outer)
        share = inverse_difference(moments, 1, orbit.circled) / outer
        return float(widest * np.sqrt(orbit.complement * share)), float(widest)

    @property
    def angle_per_period(self) -> float:
        """Advance of the herpolhode in a period of Pi, two lobes [rad]; the axis that Pi circles advances as much."""
        return 0.0 if self._is_point else self.top.precession_per_period

    @property
    def frequencies(self) -> tuple[float, float]:
        """Frequencies of Pi in the body, 0 without a finite period, and of the mean precession about mu [rad/s].

        Every coordinate of the attitude is a Fourier series in the two. Their ratio, the second by the first, is
        `angle_per_period` / 2 pi. Source: Bonnard et al., section 3.5.
        """
        return self.top.polhode_frequency, self.top.precession_frequency

    def closure(self, tolerance: float = 1e-6, most_lobes: int = 10_000) -> Closure | None:
        """The first time that the herpolhode closes, within an angle [rad]; None if not within that many lobes.

        The numbers of lobes tried, half periods of Pi, are the denominators of the continued fraction of the turns per
        lobe: no smaller number comes nearer. On the separatrix the curve never closes.

        Raises ShapeError if the tolerance is not positive or `most_lobes` is below 1.
        """
        within, most = above_zero(tolerance, "tolerance", "rad"), whole_argument(most_lobes, "most_lobes", 1)
        inner, outer = self.annulus
        if outer == inner:
            return Closure(int(outer > 0.0), 0, 0.0)
        if inner == 0.0:
            return None
        per_lobe = self.angle_per_period / (4.0 * np.pi)
        rest, numerators, denominators = per_lobe, (0, 1), (1, 0)
        while True:
            whole = int(np.floor(rest))
            numerators = numerators[1], whole * numerators[1] + numerators[0]
            denominators = denominators[1], whole * denominators[1] + denominators[0]
            turns, lobes = numerators[1], denominators[1]
            gap = 2.0 * np.pi * abs(lobes * per_lobe - turns)
            if lobes > most:
                return None
            if gap <= within:
                return Closure(turns, lobes, gap)
            rest = 1.0 / (rest - whole)

    def polhode_length(self, start: float, end: float) -> float:
        """Arc length of the polhode between two times [rad/s], the integral of |Omega'|; negative if they descend."""
        return self._length(self._polhode_speed, start, end)

    def herpolhode_length(self, start: float, end: float) -> float:
        """Arc length of the herpolhode [rad/s], from its radius and angle; that of the polhode, as nothing slips."""
        return self._length(self._herpolhode_speed, start, end)

    @property
    def length_per_period(self) -> float:
        """Arc length of either curve in a period of Pi [rad/s]; on the separatrix that of the whole curve."""
        if self._is_point:
            return 0.0
        quarter = min(float(elliptic.complete_k(self.top.complement)), _TAIL)
        half = self._integral(self._polhode_speed, -quarter, quarter)
        return half if self.top.regime == "separatrix" else 2.0 * half

    @property
    def _is_point(self) -> bool:
        return self.top.regime in ("spherical", "steady")

    @property
    def _start(self) -> Array:
        return self.top.orbit.start / self.top.magnitude

    def _angle(self, times: Array) -> Array:
        """Azimuth about mu of the circled axis, and of Omega from there, each up to a constant: (...) [rad]."""
        orbit, moments = self.top.orbit, self.top.moments
        circled, other = orbit.circled, orbit.other
        u = orbit.rate * times + orbit.phase
        sn, cn, dn, _, third = elliptic.jacobi_and_pi_excess(orbit.characteristic, u, orbit.complement)
        # On the separatrix cn = dn, and far out both are zero.
        quotient = np.divide(cn, dn, out=np.ones(np.shape(dn)), where=dn > 0.0)
        across, outer = inverse_difference(moments, other, 1), inverse_difference(moments, other, circled)
        bend = across / outer * orbit.amplitudes[1] / (orbit.amplitudes[other] * orbit.amplitudes[circled])
        # The part of the integral proportional to u is what makes L/I_k into L/I_2.
        azimuth = orbit.magnitude * (times / moments[1] + outer / orbit.rate * third)
        return azimuth - orbit.sense * np.arctan(bend * sn * quotient)

    def _radius(self, direction: Array) -> Array:
        return self.top.magnitude * np.hypot.reduce(_across(direction, self.top.moments), axis=-1)

    def _polhode_speed(self, direction: Array) -> Array:
        return np.linalg.norm(self._acceleration(direction), axis=-1)

    def _herpolhode_speed(self, direction: Array) -> Array:
        """From the rates of radius and angle, Omega.Omega' = r r' and Pi.(Omega x Omega') = |Pi| r^2 angle'."""
        velocity = self.top.magnitude * direction / self.top.moments
        acceleration = self._acceleration(direction)
        radius = self._radius(direction)
        along = np.sum(velocity * acceleration, axis=-1)
        across = np.sum(direction * np.cross(velocity, acceleration), axis=-1)
        return np.divide(np.hypot(along, across), radius, out=np.zeros(radius.shape), where=radius > 0.0)

    def _acceleration(self, direction: Array) -> Array:
        """Omega' along the principal axes, from Euler's equations."""
        return self.top.magnitude**2 * _across(direction, self.top.moments) / self.top.moments

    def _length(self, speed: Callable[[Array], Array], start: float, end: float) -> float:
        first, last = number_argument(start, "start", "s"), number_argument(end, "end", "s")
        if self._is_point:
            return 0.0
        left, right = (float(self.top.rate * t + self.top.orbit.phase) for t in (first, last))
        if self.top.regime == "separatrix":
            return self._integral(speed, *np.clip([left, right], -_TAIL, _TAIL))
        half = 2.0 * float(elliptic.complete_k(self.top.complement))
        whole = float(np.trunc((right - left) / half))
        rest = self._integral(speed, left, right - whole * half)
        return rest if whole == 0.0 else rest + whole * self._integral(speed, -0.5 * half, 0.5 * half)

    def _integral(self, speed: Callable[[Array], Array], left: float, right: float) -> float:
        """The integral of a speed over time between two values of u; panels are halved where it nearly has a kink."""

        def panels(starts: Array, ends: Array) -> Array:
            nodes, weights = sphere.gauss_nodes(starts, ends)
            return np.sum(weights * speed(self.top.orbit.directions(nodes)), axis=-1)

        edges = np.linspace(left, right, max(4, int(np.ceil(2.0 * abs(right - left)))) + 1)
        starts, ends = edges[:-1], edges[1:]
        whole, total = panels(starts, ends), 0.0
        allowed = 1e-14 * abs(whole.sum())
        while len(starts):
            middle = 0.5 * (starts + ends)
            first, second = panels(starts, middle), panels(middle, ends)
            rough = np.abs(first + second - whole) > allowed
            total += float(np.sum((first + second)[~rough]))
            starts, ends = np.append(starts[rough], middle[rough]), np.append(middle[rough], ends[rough])
            whole = np.append(first[rough], second[rough])
        return total / self.top.rate


def cones(top: EulerTop) -> Cones:
    """The body cone and the space cone of an axisymmetric body, drawn by Omega about its axis and about mu.

    Two moments that agree to 1e-12 count as equal. For a body that spins about its axis of symmetry both cones have no
    width; for one that spins about an axis across, the body cone is a plane.

    Source: Marsden and Ratiu, 15.8 case 2, whose I1 = I2 are the equal moments and I3 the one about the axis of
    symmetry, with the signs of theory.md M-E6: Omega = Pi/I1 - lambda e.
    Raises ShapeError if no two moments are equal, or all three, or the momentum is zero.

    Examples
    --------
    >>> cones = sp.rigid_body.cones(sp.EulerTop.principal([2.0, 2.0, 1.0], [3.0, 0.0, 4.0]))
    >>> cones.precession_rate, cones.space_inside_body
    (2.5, False)
    """
    check_object(top, "EulerTop", "top")
    moments, magnitude = top.moments, top.magnitude
    close = np.diff(moments) <= TWELVE_DIGITS * moments[1:]
    if close.sum() != 1 or not magnitude > 0.0:
        raise ShapeError(
            f"cones: exactly two equal moments and a momentum are needed, got moments {moments} kg m^2 and momentum "
            f"{magnitude} kg m^2/s; other bodies have a polhode and a herpolhode"
        )
    symmetry, across = (0, 1) if close[1] else (2, 1)
    direction = top.orbit.start / magnitude
    along, sideways = abs(direction[symmetry]), float(np.linalg.norm(np.delete(direction, symmetry)))
    spin = magnitude * along * inverse_difference(moments, across, symmetry)
    return Cones(
        body_half_angle=float(np.arctan2(sideways / moments[across], along / moments[symmetry])),
        space_half_angle=float(np.arctan2(abs(spin) * sideways, magnitude * np.sum(direction**2 / moments))),
        space_inside_body=bool(moments[symmetry] > moments[across]),
        precession_rate=float(magnitude / moments[across]),
        spin_rate=float(spin),
    )


def _across(direction: Array, moments: Array) -> Array:
    """n x I^-1 n along the principal axes, by differences of moments: (..., 3) -> (..., 3)."""
    gaps = np.array([inverse_difference(moments, *pair) for pair in ((2, 1), (0, 2), (1, 0))])
    return gaps * direction[..., [1, 2, 0]] * direction[..., [2, 0, 1]]
