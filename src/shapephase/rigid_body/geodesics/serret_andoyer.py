"""The Serret-Andoyer metric of the free rigid body and its polar form.

In Andoyer's variables x = g, y = l, with p_x = G and p_y = L (see `andoyer_variables`), the energy is that of the
geodesics of a surface,

    H = ((p_x^2 - p_y^2)(A sin^2 y + B cos^2 y) + C p_y^2)/2,  A = 1/I_1 < B = 1/I_2 < C = 1/I_3,

with the metric dx^2/w + dy^2/(C - w), w = A sin^2 y + B cos^2 y. With y = pi/2 - am(alpha phi, k) and theta = x it is
the surface of revolution d phi^2 + m(phi) d theta^2, 1/m = A + (B - A) sn^2(alpha phi, k). Along a geodesic of unit
speed, H = 1/2, and p_theta = G/sqrt(2 E) for a body of energy E, whose time is the arc length over sqrt(2 E). All
lengths and p_theta are in sqrt(kg) m, theta and y in radians.

Its geodesics are in `serret_andoyer_geodesics`.

Source: Bonnard, Cots and Shcherbakova 2013, sections 3.4 to 4.2 and lemma 4.2; theory.md R2 to R5, R10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import elliptic
from ...arguments import moments_argument
from ...arrays import Array, common_shape, finite_array
from ...errors import ShapeError
from .serret_andoyer_constants import constants_of, constants_of_momentum, separatrix_constants
from .serret_andoyer_geodesics import GeodesicFamily


@dataclass(frozen=True, eq=False)
class SerretAndoyerMetric:
    """The metric of three principal moments, see `serret_andoyer_metric`."""

    moments: Array
    """(3,) descending principal moments I_1 > I_2 > I_3 [kg m^2]."""

    @property
    def inverse_moments(self) -> Array:
        """(3,) A < B < C [1/(kg m^2)]."""
        return 1.0 / self.moments

    @property
    def alpha(self) -> float:
        """sqrt(C - A), the rate of the elliptic argument along phi [1/(sqrt(kg) m)]."""
        i1, _, i3 = self.moments
        return float(np.sqrt((i1 - i3) / (i1 * i3)))

    @property
    def modulus(self) -> float:
        """k of the elliptic functions of alpha phi, k^2 = (B - A)/(C - A)."""
        return float(np.sqrt(1.0 - self.complement))

    @property
    def complement(self) -> float:
        """1 - k^2 = (C - B)/(C - A)."""
        i1, i2, i3 = self.moments
        return float(i1 * (i2 - i3) / (i2 * (i1 - i3)))

    @property
    def crest(self) -> float:
        """K/alpha: the parallel phi = +- K/alpha of y = 0, where the potential is largest [sqrt(kg) m]."""
        return float(elliptic.complete_k(self.complement)) / self.alpha

    @property
    def largest_momentum(self) -> float:
        """sqrt(I_1), p_theta of the equator [sqrt(kg) m]."""
        return float(np.sqrt(self.moments[0]))

    def w(self, y: ArrayLike) -> Array:
        """A sin^2 y + B cos^2 y, z/2 of the paper: (...) [rad] -> (...) [1/(kg m^2)].

        Raises
        ------
        ShapeError
            If an argument is not finite; so do all methods.

        Source: Bonnard et al., before (7).
        """
        angle = finite_array(y, "y", unit="rad")
        first, second, _ = self.inverse_moments
        return first * np.sin(angle) ** 2 + second * np.cos(angle) ** 2

    def coefficients(self, y: ArrayLike) -> tuple[Array, Array]:
        """1/w and 1/(C - w), of dx^2 and dy^2: (...) [rad] -> (...), (...) [kg m^2].

        Source: Bonnard et al. (7); the metric of the paper's introduction is half of it (theory.md B-E1).
        """
        i1, i2, i3 = self.moments
        angle = finite_array(y, "y", unit="rad")
        sine, cosine = np.sin(angle) ** 2, np.cos(angle) ** 2
        return 1.0 / self.w(angle), 1.0 / (sine * (i1 - i3) / (i1 * i3) + cosine * (i2 - i3) / (i2 * i3))

    def energy(self, y: ArrayLike, p_x: ArrayLike, p_y: ArrayLike) -> Array:
        """H = (w p_x^2 + (C - w) p_y^2)/2: (...) each -> (...); [J] for p in [kg m^2/s].

        Also outside |p_y| <= p_x, where no rigid body is.
        Source: Bonnard et al. (6).
        """
        angle, first, second = _together(y=y, p_x=p_x, p_y=p_y)
        across, along = self.coefficients(angle)
        return 0.5 * (first**2 / across + second**2 / along)

    def phi_of_y(self, y: ArrayLike) -> Array:
        """The arc length along a meridian from y = pi/2, which falls as y grows: (...) [rad] -> (...) [sqrt(kg) m].

        Source: Bonnard et al., section 4.1; theory.md B-E5.
        """
        return elliptic.incomplete_f(0.5 * np.pi - finite_array(y, "y", unit="rad"), self.complement) / self.alpha

    def y_of_phi(self, phi: ArrayLike) -> Array:
        """pi/2 - am(alpha phi, k), the inverse of `phi_of_y`: (...) [sqrt(kg) m] -> (...) [rad].

        Source: Bonnard et al. (9), continued past sin(y) = 1.
        """
        return 0.5 * np.pi - elliptic.jacobi(self.alpha * finite_array(phi, "phi"), self.complement)[3]

    def m(self, phi: ArrayLike) -> Array:
        """m in d phi^2 + m d theta^2, even and of period 2 K/alpha, from I_1 down to I_2: (...) -> (...) [kg m^2].

        Source: Bonnard et al., proposition 8.
        """
        return 1.0 / self._inverse_m(phi)

    def m_derivatives(self, phi: ArrayLike) -> tuple[Array, Array]:
        """m' and m'' by phi: (...) [sqrt(kg) m] -> (...) [sqrt(kg) m], (...) [1]."""
        sn, cn, dn, _ = self._jacobi(phi)
        first, square = self._rise, self.modulus**2
        slope = 2.0 * self.alpha * first * sn * cn * dn
        bend = 2.0 * self.alpha**2 * first * ((cn * dn) ** 2 - (sn * dn) ** 2 - square * (sn * cn) ** 2)
        value = 1.0 / self._inverse_m(phi)
        return -slope * value**2, (2.0 * slope**2 * value - bend) * value**2

    def potential(self, phi: ArrayLike, p_theta: ArrayLike) -> Array:
        """V = p_theta^2/m, with phi'^2 + V = 1 along a geodesic of unit speed: (...), (...) -> (...).

        Its minimum is A p_theta^2, on the equator, its maximum B p_theta^2, at `crest`.
        Source: Bonnard et al., lemma 4.1.
        """
        place, momentum = _together(phi=phi, p_theta=p_theta)
        return momentum**2 * self._inverse_m(place)

    def gauss_curvature(self, phi: ArrayLike) -> Array:
        """The curvature of the surface at phi: (...) [sqrt(kg) m] -> (...) [1/(kg m^2)].

        (B - A)(C - A)/A on the equator, -(B - A)(C - B)/B at `crest`; see `curvature_range` for what is between.
        Source: Bonnard et al., lemma 4.2.
        """
        first, second, third = self.inverse_moments
        above = self._rise * self._jacobi(phi)[0] ** 2
        w = first + above
        at_equator = first * self._rise * self.alpha**2
        slope = 2.0 * (second * third - first**2)
        return (at_equator - above * (slope - (first + second + third) * above)) / w**2

    @property
    def curvature_range(self) -> tuple[float, float]:
        """The least and the largest Gauss curvature [1/(kg m^2)].

        The largest is (B - A)(C - A)/A, on the equator. The curvature is a convex quadratic of m: its least value is
        -(B - A)(C - B)/B, at `crest`, only if I_2 >= (I_1 + I_3)/2; else it is lower, where m = (I_1 + I_2 + I_3)/3.

        Source: Bonnard et al., lemma 4.2.
        """
        a, b, c = self.inverse_moments.tolist()
        i1, i2, i3 = self.moments.tolist()
        rise, fall, all_ = self._rise, self.complement * self.alpha**2, self.alpha**2
        least = -rise * fall / b
        if i2 < 0.5 * (i1 + i3):
            least = -((b * all_) ** 2 + (c * rise) ** 2 + (a * fall) ** 2) / (6.0 * a * b * c)
        return least, rise * all_ / a

    def geodesics(self, p_theta: ArrayLike) -> GeodesicFamily:
        """The geodesics of unit speed from the equator with these p_theta, |p_theta| <= sqrt(I_1): (...).

        Raises
        ------
        ShapeError
            If a p_theta is beyond `largest_momentum`.

        Source: Bonnard et al., sections 4.2 and 4.3.
        """
        return GeodesicFamily(constants_of(self.moments, p_theta))

    def separatrix(self) -> GeodesicFamily:
        """The geodesic from the equator whose p_theta is sqrt(I_2) without rounding; it tends to `crest`.

        Source: Bonnard et al., proposition 7.
        """
        return GeodesicFamily(separatrix_constants(self.moments))

    def geodesics_of(self, body_momentum: ArrayLike) -> GeodesicFamily:
        """The geodesics of free motions through these momenta, p_theta = |Pi|/sqrt(2 E): (..., 3) [kg m^2/s] -> (...).

        In principal axes, that of the largest moment first. The class is decided by the momenta as they are, so to
        rounding also next to the separatrix.

        Raises
        ------
        ShapeError
            If a momentum is zero.
        """
        momentum = finite_array(body_momentum, "body_momentum", (3,), unit="kg m^2/s")
        if np.any(np.all(momentum == 0.0, axis=-1)):
            raise ShapeError("body_momentum: a zero momentum does not move; give one that is not zero")
        return GeodesicFamily(constants_of_momentum(self.moments, momentum))

    @property
    def _rise(self) -> float:
        """B - A."""
        i1, i2, _ = self.moments
        return float((i1 - i2) / (i1 * i2))

    def _jacobi(self, phi: ArrayLike) -> tuple[Array, Array, Array, Array]:
        return elliptic.jacobi(self.alpha * finite_array(phi, "phi"), self.complement)

    def _inverse_m(self, phi: ArrayLike) -> Array:
        sn, cn, _, _ = self._jacobi(phi)
        first, second, _ = self.inverse_moments
        return first * cn**2 + second * sn**2


def serret_andoyer_metric(moments: ArrayLike) -> SerretAndoyerMetric:
    """The Serret-Andoyer metric of principal moments (3,), I_1 > I_2 > I_3 [kg m^2].

    Raises
    ------
    ShapeError
        If the moments are not positive, or do not descend strictly.
    """
    values = moments_argument(moments)
    if not (values[0] > values[1] > values[2]):
        raise ShapeError(
            f"moments: got {values}; expected I_1 > I_2 > I_3. Sort them; with two equal moments the metric has no "
            "oscillating geodesics or no equator to speak of"
        )
    return SerretAndoyerMetric(values)


def _together(**values: ArrayLike) -> list[Array]:
    """Checked arguments, of shapes that go together."""
    arrays = {name: finite_array(value, name) for name, value in values.items()}
    common_shape(**arrays)
    return list(arrays.values())
