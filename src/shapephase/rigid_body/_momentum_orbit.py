"""The curve of a free rigid body's momentum on its sphere, in principal axes and elliptic functions.

In the axes of ascending moments I1 <= I2 <= I3 the momentum Pi circles the axis k, which is 3 where D = L² − 2 E I2 is
positive and 1 where it is negative (L = |Pi|, E the energy; a is the other one of 1 and 3):

    Pi_k = ± A_k dn(u),  Pi_a = ± A_a cn(u),  Pi_2 = ± A_2 sn(u),  u = rate t + u0,

with the complementary parameter m1 proportional to |D|. Near the separatrix everything depends on D, a difference. It
is computed once, in rational arithmetic, so that for moments and momentum given as doubles the results are accurate to
rounding on the separatrix and on both sides of it.

Sources: Jacobi 1850; Marsden and Ratiu, section 15.8, whose I1 >= I2 >= I3 are our I3, I2, I1, corrected
according to theory.md M-E1, M-E2, M-E7.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from .. import elliptic
from ..arguments import moments_argument, vector_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..errors import ShapeError
from ..inertia_tensor import ascending_moments
from ._arguments import axis_index


@dataclass(frozen=True, eq=False, kw_only=True)
class MomentumOrbit:
    """Motion of Pi in the principal axes of a free rigid body. Made by `momentum_orbit`."""

    moments: Array
    """(3,) ascending [kg m^2]."""
    start: Array
    """(3,) Pi at t = 0 [kg m^2/s]."""
    magnitude: float
    """|Pi| [kg m^2/s]."""
    regime: str
    """ "rest", "spherical", "steady", "axisymmetric", "circling" or "separatrix"."""
    circled: int = -1  #: Index k of the axis that Pi circles, 0 or 2; -1 where it stands still and circles nothing.
    other: int = -1
    """Index a of the other one of these two axes, 2 or 0; -1 where Pi stands still and circles nothing."""
    direction: Array
    """(3,) ê, the unit vector along the axis circled, on Pi's side; Pi's own where it circles nothing."""
    amplitudes: Array
    """(3,) signed, of Pi/|Pi|."""
    rate: float = 0.0
    """Rate of u [rad/s]; 0 where Pi circles nothing."""
    complement: float
    """m1 = 1 - k^2 of the elliptic functions."""
    phase: float = 0.0
    """u0, argument of the elliptic functions at t = 0."""
    characteristic: float = 0.0
    """n <= 0 of the integral of the third kind in the azimuth and the attitude, by the moments only."""
    spin: float
    """L/I_2, the steady part of the turn about Pi [rad/s]."""
    excess: float = 0.0
    """2 E/L − L/I_2, by which the turn about Pi differs from it [rad/s]; 0 on the separatrix."""
    precession: float = 0.0
    """(L/I_a − L/I_k)/rate [1]."""
    sense: float = 0.0
    """+1 where k = 3, where Pi goes round ê counterclockwise, −1 where k = 1; 0 where it stands still."""
    condition: float
    """Factor that magnifies a small change of inertia or momentum, see `EulerTop.condition`."""

    __repr__ = short_repr

    def directions(self, u: Array) -> Array:
        """Pi/|Pi|: (...) -> (..., 3)."""
        return self._direction(*elliptic.jacobi(u, self.complement)[:3])

    def directions_and_swing(self, u: Array) -> tuple[Array, Array]:
        """Pi/|Pi|, and the angle psi of `EulerTop` less its steady part spin t: (...) -> (..., 3), (...) [rad]."""
        sn, cn, dn, amplitude, third = elliptic.jacobi_and_pi_excess(self.characteristic, u, self.complement)
        q = np.sqrt(1.0 - self.characteristic)
        # arctan(q tan am), continued along am: the azimuth of Pi round ê, without its sign.
        azimuth = amplitude + np.arctan2((q - 1.0) * sn * cn, cn * cn + q * sn * sn)
        return self._direction(sn, cn, dn), self.precession * third - self.sense * azimuth

    @property
    def third_kind(self) -> float:
        """Gain of psi + sense azimuth in a period in excess of spin t [rad]."""
        return 4.0 * self.precession * float(elliptic.complete_pi_excess(self.characteristic, self.complement))

    def _direction(self, sn: Array, cn: Array, dn: Array) -> Array:
        direction = np.empty((*np.shape(sn), 3))
        if not self.rate:
            direction[...] = self.direction
            return direction
        for index, function in ((self.circled, dn), (self.other, cn), (1, sn)):
            np.multiply(self.amplitudes[index], function, out=direction[..., index])
        return direction


def momentum_orbit(moments: Array, start: Array) -> MomentumOrbit:
    """The orbit of a momentum (3,), in the axes of these ascending moments (3,).

    Components below 1e-140 of the momentum are taken as zero.

    Examples
    --------
    >>> orbit = sp.rigid_body.momentum_orbit(np.array([1.0, 2.0, 3.0]), np.array([0.6, 0.9, 0.5]))
    >>> orbit.regime, orbit.circled
    ('circling', 0)
    """
    magnitude = float(np.linalg.norm(start))
    # Powers of two, so that squares neither overflow nor round.
    momentum_unit, inertia_unit = np.exp2(np.frexp([magnitude or 1.0, moments[2]])[1])
    x = start / momentum_unit
    x = np.where(np.abs(x) < 1e-140, 0.0, x)  # squares of smaller components underflow
    i1, i2, i3 = i = (moments / inertia_unit).tolist()
    if not magnitude or i1 == i3 or not (x[0] or x[2]) or (i1 == i2 and not x[2]) or (i2 == i3 and not x[0]):
        return _stationary_orbit(moments, start, magnitude)
    separation = _separation(i, x)
    k, a = (2, 0) if separation >= 0 else (0, 2)
    ends, inner, outer = i3 - i1, abs(i[k] - i2), abs(i2 - i[a])
    # |L² − 2 E I_a| and |L² − 2 E I_k|: all terms of one sign.
    far = x[1] ** 2 * outer / i2 + x[k] ** 2 * ends / i[k]
    near = x[a] ** 2 * ends / i[a] + x[1] ** 2 * inner / i2
    m1 = min(1.0, float(abs(separation) * Fraction(ends) / (Fraction(far) * Fraction(inner))))
    length = float(np.linalg.norm(x))
    # The change of m1 for a relative change of x in any direction, such as rounding of the axes brings.
    slope = length * (abs(x[2]) * (i3 - i2) / i3 + abs(x[0]) * (i2 - i1) / i1) * ends / (far * inner)
    scale = float(momentum_unit / inertia_unit)
    amplitudes, direction = np.empty(3), np.zeros(3)
    amplitudes[k] = np.copysign(np.sqrt(i[k] * far / ends), x[k])
    amplitudes[a] = np.copysign(np.sqrt(i[a] * near / ends), x[a])
    # The sign follows from Euler's second equation; a product of signs, as that of x[0] and x[2] may underflow.
    amplitudes[1] = np.copysign(np.sqrt(i2 * near / inner), np.copysign(1.0, x[0]) * np.copysign(1.0, x[2]))
    direction[k] = np.copysign(1.0, x[k])
    sine, cosine = (x[1] / amplitudes[1], x[a] / amplitudes[a]) if near else (0.0, 1.0)
    rate = float(np.sqrt(far * inner / (i1 * i2 * i3)))
    axisymmetric = i1 == i2 or i2 == i3
    return MomentumOrbit(
        moments=moments,
        start=start,
        magnitude=magnitude,
        regime="steady" if not near else "axisymmetric" if axisymmetric else "circling" if m1 else "separatrix",
        circled=k,
        other=a,
        direction=direction,
        amplitudes=amplitudes / length,
        rate=rate * scale,
        complement=m1,
        phase=float(elliptic.argument_of(sine, cosine, m1)),
        characteristic=-i[k] * outer / (i[a] * inner),
        spin=magnitude / float(moments[1]),
        excess=-float(separation) / (i2 * length) * scale,
        precession=length * (i[k] - i[a]) / (i[k] * i[a]) / rate,
        sense=1.0 if k == 2 else -1.0,
        condition=i3 / i1 * max(1.0, float(slope) / m1) if m1 else np.inf,
    )


def separatrix_solid_angle(moments: ArrayLike, axis: int) -> float:
    """The area between the two separatrices, on the side of one principal axis [sr]. Source: theory.md section 7.

    Parameters
    ----------
    moments : (3,) in any order, above 0, not all equal [kg m^2]
    axis : 0, 1 or 2, one of these axes, with the smallest or the largest moment

    Raises
    ------
    ShapeError
        If the moments are all equal, or the axis is that of the middle one.

    Examples
    --------
    >>> areas = [sp.rigid_body.separatrix_solid_angle([1.0, 2.0, 3.0], axis) for axis in (0, 2)]
    >>> print(f"{2.0 * sum(areas) / np.pi:.9f} pi")  # both sides of both axes are the sphere
    4.000000000 pi
    """
    values = moments_argument(moments)
    if values.min() == values.max():
        raise ShapeError(f"moments: three that are not all equal are needed, got {values}")
    (low, middle, high), own_moment = ascending_moments(values)[0], values[axis_index(axis)]
    if own_moment not in (low, high):
        raise ShapeError(f"axis: that of the smallest or the largest of the moments {values} is needed, got {axis}")
    circled, other = (low, high) if own_moment == low else (high, low)
    own, opposite = np.sqrt(abs(middle - circled) / circled), np.sqrt(abs(other - middle) / other)
    return 4.0 * float(np.arctan2(own, opposite))


@dataclass(frozen=True, eq=False)
class WeierstrassForm:
    """Squares of a free rigid body's momentum by Weierstrass's function. Made by `weierstrass_form`."""

    moments: Array
    """(3,) principal, by body axis [kg m^2]."""
    roots: Array
    """(3,) e_1, e_2, e_3 by body axis, of sum zero; the least belongs to the middle moment [1/s^2]."""
    invariants: tuple[float, float]
    """g_2 [1/s^4] and g_3 [1/s^6] of y'^2 = 4 y^3 - g_2 y - g_3."""
    half_periods: tuple[float, float]
    """omega, and the size of the imaginary one, omega' = i times it [s]; Pi_i^2 has the period 2 omega."""
    shift: float
    """t_0, real part of the constant in y = P(t + t_0 + omega') [s]."""
    _orbit: MomentumOrbit

    __repr__ = short_repr

    def value(self, t: ArrayLike) -> Array:
        """y(t), between the two lower roots: (...) [s] -> (...) [1/s^2]."""
        times = finite_array(t, "t", unit="s")
        orbit = self._orbit
        middle = orbit.magnitude * orbit.directions(orbit.rate * times + orbit.phase)[..., 1]
        i1, i2, i3 = orbit.moments
        return self.roots.min() + (i2 - i1) * (i3 - i2) / (i1 * i2 * i2 * i3) * middle * middle

    def squares(self, t: ArrayLike) -> Array:
        """Pi_i^2 = (y - e_i)/(a_j a_k), a_i = 1/I_k - 1/I_j: (...) [s] -> (..., 3), body axes [(kg m^2/s)^2]."""
        return (self.value(t)[..., None] - self.roots) / _products(self.moments)


def weierstrass_form(moments: ArrayLike, momentum: ArrayLike) -> WeierstrassForm:
    """The polhode by Weierstrass's elliptic function P, for any order of the moments.

    With Pi_i' = a_i Pi_j Pi_k all three Pi_i^2 change in step: Pi_i^2 = (y - e_i)/(a_j a_k) with one y, and the product
    of Euler's equations is y'^2 = 4 (y - e_1)(y - e_2)(y - e_3).

    Source: Bonnard, Cots and Shcherbakova 2013, section 3.5; Lawden 1989; theory.md H14.
    Raises ShapeError if two moments are equal, or the momentum stands still or is on the separatrix, where P has no
    period.

    Parameters
    ----------
    moments : (3,) three different principal moments by body axis [kg m^2]
    momentum : (3,) Pi at t = 0, body axes, along none of them and not on the separatrix [kg m^2/s]

    Examples
    --------
    >>> form = sp.rigid_body.weierstrass_form([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.6, 0.9, 0.5])
    >>> print(f"{top.period / form.half_periods[0]:.9f}")  # Pi itself has twice the period of its squares
    4.000000000
    """
    values, start = moments_argument(moments), vector_argument(momentum, "momentum", unit="kg m^2/s")
    if len(set(values.tolist())) < 3:
        raise ShapeError(f"moments: three different ones are needed, got {values}")
    ascending, order, parity = ascending_moments(values)
    # All three components change sign with an odd order: a proper turn, and the squares stay.
    orbit = momentum_orbit(ascending, parity * start[order])
    if not orbit.rate or not orbit.complement or orbit.regime == "steady":
        raise ShapeError(
            f"momentum: {start} stands still in the body or is on the separatrix; P has no real period there"
        )
    parts = _products(values) * start**2
    roots = parts.mean() - parts
    quarters = elliptic.complete_k(orbit.complement), elliptic.complete_k(1.0 - orbit.complement)
    return WeierstrassForm(
        moments=values,
        roots=roots,
        invariants=(2.0 * float(roots @ roots), 4.0 * float(np.prod(roots))),
        half_periods=(float(quarters[0]) / orbit.rate, float(quarters[1]) / orbit.rate),
        shift=orbit.phase / orbit.rate,
        _orbit=orbit,
    )


def _products(moments: Array) -> Array:
    """a_j a_k by body axis, a_i = 1/I_k - 1/I_j: (3,) -> (3,)."""
    rates = (np.roll(moments, -1) - np.roll(moments, -2)) / (np.roll(moments, -1) * np.roll(moments, -2))
    return np.roll(rates, -1) * np.roll(rates, -2)


def _stationary_orbit(moments: Array, start: Array, magnitude: float) -> MomentumOrbit:
    """Pi is constant in the body, which turns about it, and circles nothing."""
    direction = start / magnitude if magnitude else np.zeros(3)
    unstable = bool(magnitude) and bool(moments[0] < moments[1] < moments[2])
    return MomentumOrbit(
        moments=moments,
        start=start,
        magnitude=magnitude,
        regime="rest" if not magnitude else "spherical" if moments[0] == moments[2] else "steady",
        direction=direction,
        amplitudes=direction,
        complement=0.0 if unstable else 1.0,
        spin=float(np.sum(direction**2 / moments)) * magnitude,
        condition=np.inf if unstable else float(moments[2] / moments[0]),
    )


def _separation(moments: list[float], x: Array) -> Fraction:
    """L² − 2 E I2 without rounding: the sign decides which axis is circled; 0 on the separatrix."""
    i1, i2, i3 = map(Fraction, moments)
    return Fraction(float(x[2])) ** 2 * (i3 - i2) / i3 - Fraction(float(x[0])) ** 2 * (i2 - i1) / i1
