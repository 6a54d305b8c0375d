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

from ...arguments import number_argument
from ...arrays import Array, finite_array
from ...display import short_repr
from ...errors import ShapeError
from .._arguments import above_zero
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
