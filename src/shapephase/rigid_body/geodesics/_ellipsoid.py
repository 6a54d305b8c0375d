"""Ellipsoids of revolution, oblate, round and prolate: closed forms of their extremals, periods and caustics.

The meridian is (a cos(psi), b sin(psi)), psi the parametric latitude, epsilon = b/a the *aspect*. In the normal form of
`surface_of_revolution` y = sin(psi), m(0) = a^2 and D = a sqrt(epsilon^2 + (1 - epsilon^2) Y), so that all integrals
along extremals are elliptic; Carlson's forms have no subtraction in them, for any aspect.

Sources: Bonnard, Cots and Shcherbakova 2013, section 2, "Computations on the ellipsoid of revolution"; DLMF 19.25 for
Carlson's forms. theory.md P1-P6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprd, elliprf, elliprj

from ... import elliptic
from ...arguments import number_argument
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from ...roots import ROUNDING, safe_newton
from .._arguments import TWELVE_DIGITS, above_zero
from ._arc_quadrature import Arcs, folded_cosine
from .surface_of_revolution import SurfaceOfRevolution, surface_of_stretch


@dataclass(frozen=True)
class EllipsoidStretch:
    """D(Y) = a sqrt(epsilon^2 + (1 - epsilon^2) Y) and its derivatives. Made by `ellipsoid`."""

    aspect: float
    radius: float

    __repr__ = short_repr

    def __call__(self, square: Array, rest: Array) -> tuple[Array, Array, Array]:
        """Y and 1 - Y, (N,) each -> D, D', D'', (N,) each."""
        flattening = (1.0 - self.aspect) * (1.0 + self.aspect)
        unit = np.sqrt(self.aspect**2 * rest + square)
        return self.radius * unit, 0.5 * self.radius * flattening / unit, -self.radius * flattening**2 / (4.0 * unit**3)

    def arcs(self, p: Array, q: Array, _room: Array, chi: Array) -> Arcs:
        """The integrals along extremals, phases in [-pi/2, pi/2]: (N,) x 4 -> `Arcs`. Source: DLMF 19.25.5, 13, 14."""
        aspect, p = self.aspect, p / self.radius
        sine, cosine = np.sin(chi), folded_cosine(chi)
        sine2, cosine2 = sine * sine, cosine * cosine
        delta = cosine2 + sine2 * (p * p + q / aspect**2)
        pole = np.where(p > 0.0, cosine2 + p * p * sine2, 1.0)
        first = sine * elliprf(cosine2, delta, 1.0)
        cube = sine2 * sine / 3.0
        bend = (1.0 - aspect) * (1.0 + aspect) / aspect * cube * elliprd(cosine2, delta, 1.0)
        longitude = p / aspect * (aspect**2 * first + q * cube * elliprj(cosine2, delta, 1.0, pole))
        over_pole = (p == 0.0) & (np.abs(chi) >= 0.5 * np.pi)
        longitude = np.where(over_pole, np.copysign(0.5 * np.pi, chi), longitude)
        return Arcs(self.radius * (aspect * first + q * bend), longitude, self.radius * bend)


def ellipsoid(aspect: float, equatorial_radius: float = 1.0) -> SurfaceOfRevolution:
    """The ellipsoid of revolution with polar over equatorial axis `aspect`: below 1 oblate, above 1 prolate.

    Source: Bonnard et al., section 2 (F_1, F_2); theory.md P1.
    Raises ShapeError if the aspect is not between 0.001 and 1000, or the radius not positive.

    Examples
    --------
    >>> oblate = sp.rigid_body.geodesics.ellipsoid(0.5)
    >>> oblate.equator, oblate.end
    (1.0, 'pole')
    """
    epsilon, radius = number_argument(aspect, "aspect"), above_zero(equatorial_radius, "equatorial_radius")
    # The closed forms are made of the square, which keeps ten digits beside 1.
    if not 1e-3 <= epsilon <= 1e3:
        raise ShapeError(f"aspect: polar over equatorial axis must be between 0.001 and 1000, got {epsilon:.6g}")
    stretch = EllipsoidStretch(aspect=epsilon, radius=radius)
    return surface_of_stretch(stretch, radius**2, 1.0, "pole", stretch.arcs)


def metric_coefficients(aspect: float, colatitude: ArrayLike) -> tuple[Array, Array]:
    """F_1 = cos^2 + epsilon^2 sin^2 and F_2 = sin^2 of the parametric colatitude, unit equator: (...) -> (...), (...).

    Examples
    --------
    >>> tuple(float(value) for value in sp.rigid_body.geodesics.metric_coefficients(0.5, np.pi / 2.0))
    (0.25, 1.0)
    """
    phi = finite_array(colatitude, "colatitude", unit="rad")
    sine2 = np.sin(phi) ** 2
    return np.cos(phi) ** 2 + number_argument(aspect, "aspect") ** 2 * sine2, sine2


def meridian_length(aspect: float, colatitude: ArrayLike) -> Array:
    """Phi, the length of the meridian from the pole to a parametric colatitude, unit equator: (...) [rad] -> (...).

    E(phi, k) with k^2 = 1 - epsilon^2; for a prolate ellipsoid, k^2 < 0, by the complementary amplitude.
    Source: Bonnard et al., section 2; theory.md P1, P4.

    Examples
    --------
    >>> print(f"{sp.rigid_body.geodesics.meridian_length(1.0, np.pi / 2.0):.9f} = pi/2")  # of a sphere
    1.570796327 = pi/2
    """
    epsilon = number_argument(aspect, "aspect")
    phi = finite_array(colatitude, "colatitude", unit="rad")
    if epsilon <= 1.0:
        return elliptic.incomplete_e(phi, epsilon**2)
    m1 = 1.0 / epsilon**2
    return epsilon * (elliptic.complete_e(m1) - elliptic.incomplete_e(0.5 * np.pi - phi, m1))


def ellipsoid_period(aspect: float, momentum: ArrayLike) -> Array:
    """T(p) = 4 alpha E(m) of an ellipsoid with unit equator: (...) -> (...).

    Here alpha^2 = epsilon^2 + (1 - p^2)(1 - epsilon^2), and the complementary parameter is epsilon^2/alpha^2. For a
    prolate ellipsoid, where m^2 < 0, it is T = 4 epsilon E with the complementary parameter alpha^2/epsilon^2.

    Source: Bonnard et al., section 2; theory.md P2.

    Raises
    ------
    ShapeError
        If a momentum is larger than 1 in absolute value.

    Examples
    --------
    >>> print(f"{sp.rigid_body.geodesics.ellipsoid_period(1.0, 0.5):.9f} = 2 pi")  # of a sphere
    6.283185307 = 2 pi
    """
    epsilon = number_argument(aspect, "aspect")
    p = finite_array(momentum, "momentum")
    if np.any(np.abs(p) > 1.0):
        raise ShapeError("momentum: on a unit equator the absolute value of Clairaut's constant is at most 1")
    alpha2 = epsilon**2 * p * p + (1.0 - p) * (1.0 + p)
    if epsilon <= 1.0:
        return 4.0 * np.sqrt(alpha2) * elliptic.complete_e(np.minimum(epsilon**2 / alpha2, 1.0))
    return 4.0 * epsilon * elliptic.complete_e(np.minimum(alpha2 / epsilon**2, 1.0))


def astroid(aspect: float, direction: ArrayLike) -> tuple[Array, Array]:
    """Parametric latitude and longitude of a nearly round ellipsoid's caustic: (...) -> (...), (...).

    (-pi f sin^3, pi - pi f cos^3) of the direction at the start, east to north [rad], with f = 1 - epsilon: an astroid
    with its centre opposite to the start on the equator. It is the limit of `conjugate_locus` as f -> 0.

    Source: the formulae of `surface_of_revolution` to first order in f; theory.md P3.

    Examples
    --------
    >>> latitude, longitude = sp.rigid_body.geodesics.astroid(0.999, 0.0)
    >>> print(f"{abs(latitude):.6f} {np.pi - longitude:.6f}")
    0.000000 0.003142
    """
    angle = finite_array(direction, "direction", unit="rad")
    radius = np.pi * (1.0 - number_argument(aspect, "aspect"))
    return -radius * np.sin(angle) ** 3, np.pi - radius * np.cos(angle) ** 3


def latitude_of_geodetic(aspect: float, geodetic: ArrayLike, equatorial_radius: float = 1.0) -> Array:
    """phi, the length of the meridian from the equator, of geodetic latitudes: (...) [rad] -> (...).

    The geodetic latitude is the angle of the normal above the equator, as on maps; tan(psi) = epsilon tan(geodetic)
    gives the parametric one. With the radius in metres, phi is in metres, too.

    Parameters
    ----------
    aspect, equatorial_radius : as for `ellipsoid`
    geodetic : (...) from -pi/2 to pi/2 [rad]

    Raises
    ------
    ShapeError
        If a latitude is beyond a pole.

    Examples
    --------
    >>> north = sp.rigid_body.geodesics.latitude_of_geodetic(1.0 - 1.0 / 298.257223563, np.radians(45.0), 6378137.0)
    >>> print(f"{north:.3f} m from the equator of the Earth")
    4984944.378 m from the equator of the Earth
    """
    epsilon, radius = number_argument(aspect, "aspect"), number_argument(equatorial_radius, "equatorial_radius")
    angle = finite_array(geodetic, "geodetic", unit="rad")
    if np.any(np.abs(angle) > 0.5 * np.pi * (1.0 + TWELVE_DIGITS)):
        raise ShapeError("geodetic: latitudes are between -pi/2 and pi/2 rad")
    bounded = np.clip(angle, -0.5 * np.pi, 0.5 * np.pi)
    parametric = np.arctan2(epsilon * np.sin(bounded), np.cos(bounded))
    return radius * _from_equator(epsilon, parametric)


def geodetic_latitude(aspect: float, latitude: ArrayLike, equatorial_radius: float = 1.0) -> Array:
    """The geodetic latitude of phi, the inverse of `latitude_of_geodetic`: (...) -> (...) [rad].

    Raises
    ------
    ShapeError
        If a latitude is beyond a pole.

    Examples
    --------
    >>> from shapephase.rigid_body import geodesics
    >>> print(f"{np.degrees(geodesics.geodetic_latitude(0.5, geodesics.latitude_of_geodetic(0.5, 0.7))):.6f}")
    40.107046
    """
    epsilon, radius = number_argument(aspect, "aspect"), number_argument(equatorial_radius, "equatorial_radius")
    phi = finite_array(latitude, "latitude") / radius
    quarter = float(_from_equator(epsilon, np.asarray(0.5 * np.pi)))
    if np.any(np.abs(phi) > quarter * (1.0 + TWELVE_DIGITS)):
        raise ShapeError(f"latitude: the poles are at {quarter * radius:.17g}")
    distance = np.minimum(np.abs(phi), quarter).ravel()

    def step(angle: Array) -> tuple[Array, Array]:
        gap = _from_equator(epsilon, angle) - distance
        return gap, angle - gap / np.hypot(epsilon * np.cos(angle), np.sin(angle))

    low, high = np.zeros_like(distance), np.full_like(distance, 0.5 * np.pi)
    parametric = safe_newton(step, 0.5 * np.pi * distance / quarter, low, high, ROUNDING)
    geodetic = np.arctan2(np.sin(parametric), epsilon * np.cos(parametric)).reshape(phi.shape)
    return np.copysign(geodetic, phi)[()]


def _from_equator(aspect: float, parametric: Array) -> Array:
    """The meridian from the equator to a parametric latitude, unit equator: (...) -> (...)."""
    if aspect >= 1.0:
        return aspect * elliptic.incomplete_e(parametric, 1.0 / aspect**2)
    # E(psi) with the parameter 1 - 1/epsilon^2, below 0: both terms have one sign (DLMF 19.25.9).
    sine, square = np.sin(parametric), np.cos(parametric) ** 2
    second = square + (sine / aspect) ** 2
    bent = (1.0 - aspect) * (1.0 + aspect) / (3.0 * aspect**2) * sine**3 * elliprd(square, second, 1.0)
    return aspect * (sine * elliprf(square, second, 1.0) + bent)
