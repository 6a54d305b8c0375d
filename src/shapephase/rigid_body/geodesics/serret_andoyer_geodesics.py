"""Geodesics of the Serret-Andoyer metric in closed real form, their returns to the equator and conjugate points.

Moments ascend, I_1 < I_2 < I_3, a_i = 1/I_i (see `serret_andoyer`), and p = |p_theta|. With u = M t, the sine and
cosine of am(alpha phi, k), Y = sn^2(alpha phi, k) and n <= 0 are, up to a common factor,

    oscillating  I_2 < p^2 <= I_3   m sn(u) : k' dn(u)          n = -(1 - a_3 p^2)/(a_1 p^2 - 1)       f = cn
    rotating     I_1 <= p^2 < I_2   sn(u) : k' cn(u)            n = -(a_2 - a_3)/(a_1 - a_2)           f = dn
    extended     p^2 < I_1          sqrt(m1) sn(u) : k' cn(u)   n = -p^2 (a_2 - a_3)/(1 - a_2 p^2)     f = 1
    separatrix   p^2 = I_2          as rotating, with m = 1

with m1 = 1 - m^2 the complement of each one's own modulus. In all of them
phi' = sqrt(1 - a_3 p^2) f(u)/sqrt(1 - n sn^2),

    theta = s t - c (Pi(n; u) - u/(1 - n)),

s = 1/p or a_2 p, and the derivative of theta by p at constant phi, whose zeros are the conjugate points, is

    (a_3 u + q S(u))/(M (1 - a_3 p^2)),  S = the integral of (sn/f)^2,

with constants c, q >= 0. Everything is real, and no terms cancel except in theta, whose error next to its start is
I_3/I_2 times the rounding of its last digit. 1 - a_2 p^2 and 1 - a_3 p^2, small near the separatrix and near the
equator, are computed from p without cancellation.

Sources: Bonnard, Cots and Shcherbakova 2013, sections 4.3 and 4.4, with the misprints and the case of theory.md B-E6,
B-E7, B-E8, B-E11; theory.md R6 to R13.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprd, hyp2f1

from ... import elliptic
from ...arguments import whole_argument
from ...arrays import Array, Mask, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...roots import safe_newton
from .._arguments import check_entries
from ._serret_andoyer_constants import GeodesicClass, GeodesicConstants, moment_gaps

_NOT_ZERO = 1e-100  # for cn = 0, at a pole of S, where only f S is finite; its square does not underflow


@dataclass(frozen=True, eq=False)
class GeodesicFamily:
    """Geodesics of unit speed from the equator towards phi >= 0, with given p_theta (...).

    Made by `SerretAndoyerMetric.geodesics`. Times broadcast against the axes of p_theta.

    Examples
    --------
    >>> family = sp.rigid_body.geodesics.serret_andoyer_metric([3.0, 2.0, 1.0]).geodesics([1.7, 1.5])
    >>> print(family.period.round(6), family.first_return.round(6))
    [11.363461 17.085156] [3.281675 5.095474]
    """

    constants: GeodesicConstants

    __repr__ = short_repr

    @property
    def p_theta(self) -> Array:
        """Clairaut's constant m theta': (...) [sqrt(kg) m]."""
        return self.constants.p_theta

    @property
    def is_oscillating(self) -> Mask:
        """True where they return to the equator, or stay on it: (...)."""
        return self.constants.oscillating

    @property
    def complement(self) -> Array:
        """m1 = 1 - m^2 of the elliptic functions of M t, to all digits; 0 on the separatrix: (...)."""
        return self.constants.complement

    @property
    def trajectory_class(self) -> str | np.ndarray:
        """The names of the classes, of one geodesic as a string.

        "oscillating" about the equator (the momentum circles the axis of the largest moment, I_3) and its limit, the
        "equator" itself; "rotating" (the momentum circles the axis of the smallest, I_1); "separatrix"; "extended":
        |p_theta| below sqrt(I_1), where there is a geodesic but no rigid body.
        """
        names = np.array([member.name.lower() for member in GeodesicClass])[self.constants.kind]
        return str(names) if names.ndim == 0 else names

    @property
    def period(self) -> Array:
        """T = 4 K/M; infinite on the separatrix: (...) [sqrt(kg) m].

        An oscillating geodesic is back at the equator, upward, after T; on a rotating one phi gains 4 K(k)/alpha.
        Source: theory.md section 4, B-E12.
        """
        return 4.0 * elliptic.complete_k(self.complement) / self.constants.rate

    @property
    def first_return(self) -> Array:
        """R, the gain of theta in T/2, after which an oscillating geodesic is at the equator again: (...) [rad].

        Infinite on the separatrix. On oscillating geodesics decreasing and convex in p (proposition 9: see
        `first_return_slope`); odd in p.
        Source: theory.md R11, in another form.
        """
        half = 2.0 * elliptic.complete_k(self.complement) / self.constants.rate
        third = elliptic.complete_pi_excess(self.constants.characteristic, self.complement)
        return self._turned(self.constants.drift * half - 2.0 * self.constants.third_kind * third)

    @property
    def mean_theta_rate(self) -> Array:
        """2 R/T, the mean of theta'; on the separatrix its limit, a_2 p: (...) [1/(sqrt(kg) m)]."""
        third = elliptic.complete_pi_excess(self.constants.characteristic, self.complement)
        return self._turned(self.constants.drift - 4.0 * self.constants.third_kind * third / self.period)

    @property
    def first_return_slope(self) -> Array:
        """R' = dR/dp of oscillating geodesics, which is T'/(2 p) = dT/d(p^2): (...) [rad/(sqrt(kg) m)].

        A sum of negative terms. Raises ShapeError if a geodesic does not oscillate.
        Equation :eq:`first-return` of the documentation.
        Source: Bonnard et al., lemma 2.8 and proposition 9.
        """
        return self._period_slopes()[0]

    @property
    def first_return_bend(self) -> Array:
        """R'' = d^2 R/dp^2 of oscillating geodesics, p times a sum of positive terms: (...) [rad/(kg m^2)].

        Raises ShapeError if a geodesic does not oscillate. Source: as `first_return_slope`.
        """
        return 2.0 * self.p_theta * self._period_slopes()[1]

    @property
    def action(self) -> Array:
        """The integral of phi' d phi over a period, by 2 pi: (...) [sqrt(kg) m]; from 0 on the equator.

        (T - 2 p R)/(2 pi), as a sum of terms >= 0; also on the separatrix.
        Source: theory.md R15.
        """
        open_ = self.constants.at_crest > 0.0
        rising = np.where(open_, self.constants.at_crest * np.where(open_, self.period, 0.0), 0.0)
        third = elliptic.complete_pi_excess(self.constants.characteristic, self.complement)
        return (rising + 4.0 * self.constants.magnitude * self.constants.third_kind * third) / (2.0 * np.pi)

    @property
    def amplitude(self) -> Array:
        """The largest phi of oscillating geodesics, phi_+: (...) [sqrt(kg) m]; K/alpha on the separatrix.

        Raises ShapeError for rotating geodesics, which have none.
        """
        requirement = "a largest phi needs an oscillating geodesic, |p_theta| >= sqrt(I_2)"
        check_entries(self.constants.kind < GeodesicClass.SEPARATRIX, self.p_theta, "p_theta", requirement)
        _, upper, whole = moment_gaps(self.constants.moments)
        # Y_+ = (1 - a_3 p^2)/((a_2 - a_3) p^2) and 1 - Y_+, up to a common factor.
        sine, cosine = np.sqrt(self.constants.at_equator), np.sqrt(np.maximum(-self.constants.at_crest, 0.0))
        return elliptic.argument_of(sine, cosine, upper / whole) / np.sqrt(whole)

    def phi(self, t: ArrayLike) -> Array:
        """phi along the geodesics: (...) [sqrt(kg) m] -> (...) [sqrt(kg) m].

        Source: Bonnard et al. (16); theory.md R9.
        """
        _, upper, whole = moment_gaps(self.constants.moments)
        turns, sine, cosine = self._tangent(self._arguments(t))
        complement = upper / whole
        rest = elliptic.argument_of(sine, cosine, complement)
        return (2.0 * turns * elliptic.complete_k(complement) + rest) / np.sqrt(whole)

    def y(self, t: ArrayLike) -> Array:
        """Andoyer's y = l, continuous, from pi/2 down: (...) [sqrt(kg) m] -> (...) [rad].

        Source: Bonnard et al. (9).
        """
        turns, sine, cosine = self._tangent(self._arguments(t))
        return 0.5 * np.pi - turns * np.pi - np.arctan2(sine, cosine)

    def p_phi(self, t: ArrayLike) -> Array:
        """phi' = sqrt(1 - p_theta^2/m): (...) [sqrt(kg) m] -> (...), between -1 and 1."""
        sn, cn, dn, _ = elliptic.jacobi(self._arguments(t), self.complement)
        rising = np.sqrt(self.constants.at_equator) * self._denominator(cn, dn)
        return rising / np.sqrt(1.0 - self.constants.characteristic * sn**2)

    def p_y(self, t: ArrayLike) -> Array:
        """Andoyer's p_y = L, from negative values: (...) [sqrt(kg) m] -> (...) [sqrt(kg) m].

        Source: Bonnard et al. (8), with theory.md B-E5 for the sign.
        """
        _, upper, whole = moment_gaps(self.constants.moments)
        _, sine, cosine = self._tangent(self._arguments(t))
        square = (upper * sine**2 + whole * cosine**2) / (sine**2 + cosine**2)
        return -self.p_phi(t) / np.sqrt(square)

    def theta(self, t: ArrayLike) -> Array:
        """theta along the geodesics, unwrapped, 0 at t = 0: (...) [sqrt(kg) m] -> (...) [rad].

        Source: Bonnard et al. (17) to (20) in real form, with theory.md B-E7, B-E8; rotating: theory.md B-E11.
        """
        u = self._arguments(t)
        third = elliptic.jacobi_and_pi_excess(self.constants.characteristic, u, self.complement)[4]
        return self._turned(self.constants.drift * np.asarray(t, dtype=float) - self.constants.third_kind * third)

    def jacobi_field(self, t: ArrayLike) -> Array:
        """The normal Jacobi field J with J(0) = 0, J'(0) = 1, in closed form: (...) [sqrt(kg) m] -> (...).

        J'' + G J = 0 with the Gauss curvature G; its zeros are the points conjugate to t = 0. It is the derivative of
        theta by p at constant phi, times sqrt(I_3 m) phi'(0) phi'(t).
        Source: Bonnard et al., lemma 2.7; theory.md R12, R13.
        """
        u = self._arguments(t)
        sn, cn, dn, _ = elliptic.jacobi(u, self.complement)
        f = self._denominator(cn, dn)
        _, a2, a3 = 1.0 / self.constants.moments
        rising = a3 * u * f + self.constants.second_kind * self._second_kind_integral(u, sn, cn, dn)
        _, sine, cosine = self._tangent(u)
        w = (a3 * cosine**2 + a2 * sine**2) / (sine**2 + cosine**2)
        return rising / (self.constants.rate * np.sqrt(a3 * w * (1.0 - self.constants.characteristic * sn**2)))

    def conjugate_points(self, order: int = 1) -> EquatorialConjugatePoints:
        """The points of oscillating geodesics conjugate to their start on the equator, of an order 1, 2, ...

        The first locus is the curve of these points for sqrt(I_2) < p <= sqrt(I_3), on phi <= 0, and its mirror image
        in the equator, of the geodesics that start downward; it starts with a cusp on the equator at p = sqrt(I_3) and
        tends to phi = -K/alpha, theta infinite, as p falls to sqrt(I_2).

        Source: Bonnard et al., section 4.4; theory.md R12.
        Raises ShapeError if the order is not such a number, or a geodesic does not oscillate: the others have no
        conjugate point (theory.md R13).
        """
        order = whole_argument(order, "order", 1)
        a3 = float(1.0 / self.constants.moments[2])
        level = -order * self._period_slopes()[0] * self.constants.rate * self.constants.at_equator
        v = _argument_of_level(a3, self.constants.second_kind, self.complement, level)
        u = 2.0 * order * elliptic.complete_k(self.complement) + v
        third = elliptic.complete_pi_excess(self.constants.characteristic, self.complement)
        rest = elliptic.jacobi_and_pi_excess(self.constants.characteristic, v, self.complement)[4]
        time = u / self.constants.rate
        theta = self._turned(self.constants.drift * time - self.constants.third_kind * (2.0 * order * third + rest))
        _, sine, cosine = self._tangent(v)
        _, upper, whole = moment_gaps(self.constants.moments)
        distance = elliptic.argument_of(sine, cosine, upper / whole) / np.sqrt(whole)
        return EquatorialConjugatePoints(time=time, phi=np.where(order % 2, -1.0, 1.0) * distance, theta=theta)

    def _turned(self, theta: Array) -> Array:
        """theta of p = `magnitude` made that of p_theta: its sign, and its share where that is tiny."""
        return self.p_theta / self.constants.magnitude * theta

    def _arguments(self, t: ArrayLike) -> Array:
        times = finite_array(t, "t", unit="sqrt(kg) m")
        try:
            return self.constants.rate * times
        except ValueError:
            raise ShapeError(
                f"t {times.shape}: cannot be broadcast with the geodesics {self.p_theta.shape}; add axes"
            ) from None

    def _denominator(self, cn: Array, dn: Array) -> Array:
        """f of the module's table."""
        inner = np.where(self.constants.kind >= GeodesicClass.ROTATING, dn, 1.0)
        return np.where(self.constants.oscillating, cn, inner)

    def _tangent(self, u: Array) -> tuple[Array, Array, Array]:
        """Half turns of am(alpha phi), and up to a common factor the sine and cosine >= 0 of the remainder."""
        sn, cn, dn, amplitude = elliptic.jacobi(u, self.complement)
        _, upper, whole = moment_gaps(self.constants.moments)
        oscillating, extended = self.constants.oscillating, self.constants.kind == GeodesicClass.EXTENDED
        odd, turns = _half_turns(amplitude, cn)
        sine = sn * np.where(extended, np.sqrt(self.complement), self.constants.modulus)
        sine = np.where(oscillating, sine, (1.0 - 2.0 * odd) * sine)
        cosine = np.sqrt(upper / whole) * np.where(oscillating, dn, np.abs(cn))
        return np.where(oscillating, 0.0, turns), sine, cosine

    def _second_kind_integral(self, u: Array, sn: Array, cn: Array, dn: Array) -> Array:
        """f S, for oscillating geodesics continued past the poles of S, where cn = 0.

        Whole half periods of S and the remainder, each finite when multiplied by f.
        """
        amplitude = elliptic.jacobi(u, self.complement)[3]
        odd, turns = _half_turns(amplitude, cn)
        check_entries(dn < _NOT_ZERO, u / self.constants.rate, "t", "there the Jacobi field is beyond 1e100")
        m1, sine, cosine = self.complement, (1.0 - 2.0 * odd) * sn, np.maximum(np.abs(cn), _NOT_ZERO)
        # On the separatrix, m1 = 0, there are no half periods.
        positive_m1 = np.where(m1 > 0.0, m1, 1.0)
        cube = sine**3 / 3.0
        extended_rest = cube * elliprd(cosine**2, dn**2, 1.0)
        regular_rest = dn * cube * elliprd(cosine**2, 1.0, dn**2)
        near_pole_rest = (1.0 - 2.0 * odd) * cosine * cube * elliprd(dn**2, 1.0, cosine**2)
        extended_half = 2.0 * elliprd(0.0, positive_m1, 1.0) / 3.0
        regular_half = 2.0 * dn * elliprd(0.0, 1.0, positive_m1) / 3.0
        near_pole_half = -2.0 * elliptic.complete_e(positive_m1) / positive_m1 * cn
        oscillating, extended = self.constants.oscillating, self.constants.kind == GeodesicClass.EXTENDED
        rest = np.where(oscillating, near_pole_rest, np.where(extended, extended_rest, regular_rest))
        half = np.where(oscillating, near_pole_half, np.where(extended, extended_half, regular_half))
        return rest + turns * half

    def _period_slopes(self) -> tuple[Array, Array]:
        """dT/d(p^2) and d^2 T/d(p^2)^2, the terms of each all of one sign."""
        requirement = "the geodesic must oscillate, sqrt(I_2) < |p_theta| <= sqrt(I_3), the largest moment's"
        check_entries(~self.constants.oscillating, self.p_theta, "p_theta", requirement)
        (lower, upper, _), a1 = moment_gaps(self.constants.moments), 1.0 / self.constants.moments[0]
        # a_1 p^2 - 1.
        excess = self.constants.rate**2 / lower
        m1 = self.complement
        m_slope = -upper * (lower + upper) / (lower * excess**2)
        k, k_slope, k_bend = elliptic.complete_k(m1), elliprd(0.0, 1.0, m1) / 6.0, _second_derivative_of_k(m1)
        fall = a1 / (2.0 * excess)
        first = 4.0 / self.constants.rate * (k_slope * m_slope - k * fall)
        second = 4.0 / self.constants.rate * (k_bend * m_slope**2 - 6.0 * fall * k_slope * m_slope + 3.0 * k * fall**2)
        return first, second


@dataclass(frozen=True, eq=False)
class EquatorialConjugatePoints:
    """Points conjugate to a start on the equator. Made by `GeodesicFamily.conjugate_points`."""

    time: Array
    """(...) arc length from the start [sqrt(kg) m]."""
    phi: Array
    """(...) [sqrt(kg) m]; of a geodesic that starts upward. Its mirror image is conjugate too."""
    theta: Array
    """(...) from the start [rad]."""

    __repr__ = short_repr


def _half_turns(amplitude: Array, cosine: Array) -> tuple[Array, Array]:
    """1 where the number of half turns of an amplitude is odd, else 0, and this number; the cosine decides rounding."""
    odd = np.where(cosine < 0.0, 1.0, 0.0)
    return odd, 2.0 * np.rint(0.5 * (amplitude / np.pi - odd)) + odd


def _second_derivative_of_k(m1: Array) -> Array:
    """d^2 K/dm^2 by the hypergeometric series for m up to 1/2, else by Legendre's equation, which divides by m."""
    m = 1.0 - m1
    by_series = m <= 0.5
    series = 9.0 * np.pi / 64.0 * hyp2f1(2.5, 2.5, 3.0, np.minimum(m, 0.5))
    large = np.maximum(m, 0.5)
    small = np.where(by_series, 1.0 - large, m1)
    equation = (elliptic.complete_k(small) / 4.0 - (small - large) * elliprd(0.0, 1.0, small) / 6.0) / (large * small)
    return np.where(by_series, series, equation)


def _argument_of_level(a3: float, second_kind: Array, m1: Array, level: Array) -> Array:
    """The v in [0, K) where a_3 v + second_kind S(v) = level >= 0, S the integral of (sn/cn)^2.

    The left side is convex and grows without bound towards K, so Newton's steps come down to the root from above.
    """
    quarter = elliptic.complete_k(m1)
    shape = np.shape(level)
    m1, second_kind, level, quarter = (np.broadcast_to(a, shape).ravel() for a in (m1, second_kind, level, quarter))

    def step(v: Array) -> tuple[Array, Array]:
        sn, cn, dn, _ = elliptic.jacobi(v, m1)
        cn = np.maximum(np.abs(cn), _NOT_ZERO)
        excess = a3 * v + second_kind * sn**3 / 3.0 * elliprd(dn**2, 1.0, cn**2) - level
        return excess, v - excess / (a3 + second_kind * (sn / cn) ** 2)

    high = np.minimum(quarter, level / a3)
    # Not from the pole K itself, whose neighbourhood Newton's steps leave slowly.
    return safe_newton(step, np.minimum(high, 0.9 * quarter), np.zeros(level.shape), high).reshape(shape)
