"""The Serret-Andoyer metric of the free rigid body and its polar form.

Principal moments ascend, I_1 < I_2 < I_3, and a_i = 1/I_i, so that a_1 > a_2 > a_3. In Andoyer's variables x = g and
y = l, p_x = G and p_y = L, of axes whose third is that of the smallest moment (`SerretAndoyerMetric.andoyer_axes`), the
energy is that of the geodesics of a surface,

    H = ((p_x^2 - p_y^2)(a_3 sin^2 y + a_2 cos^2 y) + a_1 p_y^2)/2,

with the metric dx^2/w + dy^2/(a_1 - w), w = a_3 sin^2 y + a_2 cos^2 y. With y = pi/2 - am(alpha phi, k) and theta = x
it is the surface of revolution d phi^2 + m(phi) d theta^2, 1/m = a_3 + (a_2 - a_3) sn^2(alpha phi, k). Along a geodesic
of unit speed H = 1/2, and p_theta = G/sqrt(2 E) for a body of energy E, whose time is the arc length over sqrt(2 E).
All lengths and p_theta are in sqrt(kg) m, theta and y in radians.

The sign of p_y: phi grows here as y falls, d phi = -dy/sqrt(a_1 - w), so that p_y = -phi'/sqrt(a_1 - w) begins below
zero. The paper has d phi = +dy/sqrt(C - w), hence y = pi/2 + am(alpha phi, k) and p_y of the opposite sign: the
same geodesics, mirrored in the equator (theory.md B-E5).

Moments may be in any order, momenta are in the caller's axes; Bonnard et al. have A < B < C for our a_3, a_2, a_1.

Source: Bonnard, Cots and Shcherbakova 2013, sections 3.4 to 4.2 and lemma 4.2; theory.md R2 to R5, R10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import elliptic
from ...arguments import moments_argument
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...inertia_tensor import ascending_moments
from .._arguments import check_entries, together
from ._serret_andoyer_constants import constants_of, constants_of_momentum, moment_gaps, separatrix_constants
from .serret_andoyer_geodesics import GeodesicFamily


@dataclass(frozen=True, eq=False)
class SerretAndoyerMetric:
    """Metric of three principal moments. Made by `serret_andoyer_metric`."""

    moments: Array
    """(3,) three different principal moments about the caller's axes 1, 2, 3 [kg m^2]."""

    __repr__ = short_repr

    @property
    def inverse_moments(self) -> Array:
        """(3,) 1/I about the caller's axes 1, 2, 3 [1/(kg m^2)]."""
        return 1.0 / self.moments

    @property
    def andoyer_axes(self) -> Array:
        """(3, 3) whose columns are the axes, in the caller's, that Andoyer's variables y and p_y refer to.

        Those of the largest, the middle and the smallest moment, the middle one reversed where this order is
        left-handed: the identity if the moments descend. The body momentum p_y along the third and
        sqrt(G^2 - p_y^2) (sin y, cos y) along the others is that of Bonnard et al., before (5).
        """
        _, order, parity = ascending_moments(self.moments)
        axes = np.eye(3)[:, order[::-1]]
        # Reading three axes backwards is odd.
        axes[:, 1] *= -parity
        return axes

    @property
    def alpha(self) -> float:
        """sqrt(a_1 - a_3), the rate of the elliptic argument along phi [1/(sqrt(kg) m)]."""
        return float(np.sqrt(moment_gaps(self.moments)[2]))

    @property
    def modulus(self) -> float:
        """k of the elliptic functions of alpha phi, k^2 = (a_2 - a_3)/(a_1 - a_3)."""
        return float(np.sqrt(1.0 - self.complement))

    @property
    def complement(self) -> float:
        """1 - k^2 = (a_1 - a_2)/(a_1 - a_3)."""
        i1, i2, i3 = self._ascending
        return float(i3 * (i2 - i1) / (i2 * (i3 - i1)))

    @property
    def crest(self) -> float:
        """K/alpha: the parallel phi = +- K/alpha of y = 0, where the potential is largest [sqrt(kg) m]."""
        return float(elliptic.complete_k(self.complement)) / self.alpha

    @property
    def separatrix_momentum(self) -> float:
        """sqrt(I_2), p_theta of the separatrix, above which geodesics oscillate [sqrt(kg) m]."""
        return float(np.sqrt(self._ascending[1]))

    @property
    def largest_momentum(self) -> float:
        """sqrt(I_3), p_theta of the equator [sqrt(kg) m]."""
        return float(np.sqrt(self._ascending[2]))

    def w(self, y: ArrayLike) -> Array:
        """a_3 sin^2 y + a_2 cos^2 y, z/2 of the paper: (...) [rad] -> (...) [1/(kg m^2)].

        Source: Bonnard et al., before (7).
        """
        angle = finite_array(y, "y", unit="rad")
        _, a2, a3 = self._inverse
        return a3 * np.sin(angle) ** 2 + a2 * np.cos(angle) ** 2

    def coefficients(self, y: ArrayLike) -> tuple[Array, Array]:
        """1/w and 1/(a_1 - w), of dx^2 and dy^2: (...) [rad] -> (...), (...) [kg m^2].

        Source: Bonnard et al. (7); the metric of the paper's introduction is half of it (theory.md B-E1).
        """
        _, upper, whole = moment_gaps(self.moments)
        angle = finite_array(y, "y", unit="rad")
        return 1.0 / self.w(angle), 1.0 / (whole * np.sin(angle) ** 2 + upper * np.cos(angle) ** 2)

    def energy(self, y: ArrayLike, p_x: ArrayLike, p_y: ArrayLike) -> Array:
        """H = (w p_x^2 + (a_1 - w) p_y^2)/2: (...) each -> (...); [J] for p in [kg m^2/s].

        Also for |p_y| > p_x, which no rigid body has.
        Source: Bonnard et al. (6).
        """
        angle, first, second = together(y=y, p_x=p_x, p_y=p_y)
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
        """m in d phi^2 + m d theta^2, even and of period 2 K/alpha, from I_3 down to I_2: (...) -> (...) [kg m^2].

        Source: Bonnard et al., proposition 8.
        """
        return 1.0 / self._inverse_m(phi)

    def m_derivatives(self, phi: ArrayLike) -> tuple[Array, Array]:
        """m' and m'' by phi: (...) [sqrt(kg) m] -> (...) [sqrt(kg) m], (...) [1]."""
        sn, cn, dn, _ = self._jacobi(phi)
        rise, square = self._rise, self.modulus**2
        slope = 2.0 * self.alpha * rise * sn * cn * dn
        bend = 2.0 * self.alpha**2 * rise * ((cn * dn) ** 2 - (sn * dn) ** 2 - square * (sn * cn) ** 2)
        value = 1.0 / self._inverse_m(phi)
        return -slope * value**2, (2.0 * slope**2 * value - bend) * value**2

    def potential(self, phi: ArrayLike, p_theta: ArrayLike) -> Array:
        """V = p_theta^2/m, with phi'^2 + V = 1 along a geodesic of unit speed: (...), (...) -> (...).

        Its minimum is a_3 p_theta^2, on the equator, its maximum a_2 p_theta^2, at `crest`.
        Source: Bonnard et al., lemma 4.1.
        """
        place, momentum = together(phi=phi, p_theta=p_theta)
        return momentum**2 * self._inverse_m(place)

    def gauss_curvature(self, phi: ArrayLike) -> Array:
        """The curvature of the surface at phi: (...) [sqrt(kg) m] -> (...) [1/(kg m^2)].

        (a_2 - a_3)(a_1 - a_3)/a_3 on the equator, -(a_2 - a_3)(a_1 - a_2)/a_2 at `crest`; see `curvature_range` for
        the values between.
        Source: Bonnard et al., lemma 4.2.
        """
        a1, a2, a3 = self._inverse
        above = self._rise * self._jacobi(phi)[0] ** 2
        w = a3 + above
        at_equator = a3 * self._rise * self.alpha**2
        slope = 2.0 * (a2 * a1 - a3**2)
        return (at_equator - above * (slope - (a3 + a2 + a1) * above)) / w**2

    @property
    def curvature_range(self) -> tuple[float, float]:
        """The smallest and the largest Gauss curvature [1/(kg m^2)].

        The largest is (a_2 - a_3)(a_1 - a_3)/a_3, on the equator. The curvature is a convex quadratic of m: its
        smallest value is -(a_2 - a_3)(a_1 - a_2)/a_2, at `crest`, only if I_2 >= (I_1 + I_3)/2; else it is lower, where
        m = (I_1 + I_2 + I_3)/3.

        Source: Bonnard et al., lemma 4.2, of the largest; the smallest is derived from it, which states none.
        """
        a1, a2, a3 = self._inverse.tolist()
        i1, i2, i3 = self._ascending.tolist()
        rise, fall, whole = self._rise, self.complement * self.alpha**2, self.alpha**2
        smallest = -rise * fall / a2
        if i2 < 0.5 * (i3 + i1):
            smallest = -((a2 * whole) ** 2 + (a1 * rise) ** 2 + (a3 * fall) ** 2) / (6.0 * a3 * a2 * a1)
        return smallest, rise * whole / a3

    def geodesics(self, p_theta: ArrayLike) -> GeodesicFamily:
        """The geodesics of unit speed from the equator with these p_theta, |p_theta| <= sqrt(I_3): (...).

        Raises ShapeError if a p_theta is beyond `largest_momentum`.
        """
        return GeodesicFamily(constants=constants_of(self.moments, p_theta))

    def separatrix(self) -> GeodesicFamily:
        """The geodesic from the equator with p_theta = sqrt(I_2), not rounded; it tends to `crest`.

        Source: Bonnard et al., proposition 7.
        """
        return GeodesicFamily(constants=separatrix_constants(self.moments))

    def geodesics_of(self, body_momentum: ArrayLike) -> GeodesicFamily:
        """The geodesics of free motions through these momenta, p_theta = |Pi|/sqrt(2 E): (..., 3) [kg m^2/s] -> (...).

        In the caller's axes. The class follows from the momenta as given, so that it is right to rounding next to the
        separatrix too.

        Raises ShapeError if a momentum is zero.
        """
        momentum = finite_array(body_momentum, "body_momentum", (3,), unit="kg m^2/s")
        zero = np.all(momentum == 0.0, axis=-1)
        check_entries(zero, momentum, "body_momentum", "a zero momentum does not move; give one that is not zero")
        return GeodesicFamily(constants=constants_of_momentum(self.moments, momentum))

    @property
    def _rise(self) -> float:
        return moment_gaps(self.moments)[0]

    @property
    def _ascending(self) -> Array:
        return ascending_moments(self.moments)[0]

    @property
    def _inverse(self) -> Array:
        return 1.0 / self._ascending

    def _jacobi(self, phi: ArrayLike) -> tuple[Array, Array, Array, Array]:
        return elliptic.jacobi(self.alpha * finite_array(phi, "phi"), self.complement)

    def _inverse_m(self, phi: ArrayLike) -> Array:
        sn, cn, _, _ = self._jacobi(phi)
        _, a2, a3 = self._inverse
        return a3 * cn**2 + a2 * sn**2


def serret_andoyer_metric(moments: ArrayLike) -> SerretAndoyerMetric:
    """The Serret-Andoyer metric of three different principal moments.

    Equation :eq:`andoyer-metric` of the documentation.
    Raises ShapeError if the moments are not positive, or two of them are equal.

    Parameters
    ----------
    moments : (3,) about the body axes 1, 2, 3, in any order [kg m^2]

    Examples
    --------
    >>> metric = sp.rigid_body.geodesics.serret_andoyer_metric([3.0, 2.0, 1.0])
    >>> print(f"{metric.geodesics(1.7).first_return:.9f}")
    3.281674528
    """
    values = moments_argument(moments)
    if not np.all(np.diff(np.sort(values)) > 0.0):
        raise ShapeError(
            f"moments: got {values}; three different moments are needed: with two equal ones the metric has no "
            "oscillating geodesics, or its equator is not singled out"
        )
    return SerretAndoyerMetric(moments=values)
