"""The constants of the geodesics of the Serret-Andoyer metric: class, rate, moduli and factors, for each p_theta.

`serret_andoyer_geodesics` defines them. Near the separatrix and near the equator everything depends on 1 - a_2 p^2 and
1 - a_3 p^2, which are small there: they are computed from p, or from a momentum, without cancellation. The functions
take the moments in any order.

Source: Bonnard, Cots and Shcherbakova 2013, section 4.3; theory.md R6, B-E8, B-E11.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Array, Integers, Mask, finite_array
from ...display import short_repr
from ...inertia_tensor import ascending_moments
from .._arguments import check_entries


class GeodesicClass(IntEnum):
    """The classes of geodesics, in order of growing |p_theta|.

    Examples
    --------
    >>> [kind.name for kind in sp.rigid_body.geodesics.GeodesicClass]
    ['EXTENDED', 'ROTATING', 'SEPARATRIX', 'OSCILLATING', 'EQUATOR']
    """

    EXTENDED = 0
    """p^2 < I_1: a geodesic, but of no rigid body."""
    ROTATING = 1
    """I_1 <= p^2 < I_2: the momentum circles the axis of the smallest moment."""
    SEPARATRIX = 2
    """p^2 = I_2."""
    OSCILLATING = 3
    """I_2 < p^2 < I_3: the momentum circles the axis of the largest moment."""
    EQUATOR = 4
    """p^2 = I_3, the limit of oscillating geodesics."""


_LEAST_MOMENTUM = 1e-9  # of sqrt(I_1): below, theta is proportional to p up to p^2/I_1, less than rounding


@dataclass(frozen=True, eq=False)
class GeodesicConstants:
    """Constants of geodesics from the equator with given p_theta, (...) each but the moments.

    Made by `SerretAndoyerMetric.geodesics`.
    """

    moments: Array
    """(3,) ascending [kg m^2]."""
    p_theta: Array
    """Clairaut's constant [sqrt(kg) m]."""
    magnitude: Array
    """p = |p_theta|, but at least 1e-9 sqrt(I_1), below which nothing changes but in proportion [sqrt(kg) m]."""
    kind: Integers
    """`GeodesicClass`."""
    at_equator: Array
    """1 - a_3 p^2 >= 0, to all digits."""
    at_crest: Array
    """1 - a_2 p^2, to all digits."""
    rate: Array
    """M [1/(sqrt(kg) m)]."""
    complement: Array
    """m1 = 1 - m^2."""
    modulus: Array
    """m of oscillating geodesics, to all digits next to the equator; 1 of the others."""
    characteristic: Array
    """n <= 0."""
    drift: Array
    """s in theta = s t - c (Pi(n; u) - u/(1 - n)), for p = `magnitude`."""
    third_kind: Array
    """c, the factor of the integral of the third kind."""
    second_kind: Array
    """q in a_3 u + q S(u), the factor of the integral S of the second kind."""

    __repr__ = short_repr

    @property
    def oscillating(self) -> Mask:
        """True where they return to the equator; the equator itself counts as one of them."""
        return self.kind >= GeodesicClass.OSCILLATING


def constants_of(moments: Array, p_theta: ArrayLike) -> GeodesicConstants:
    """The geodesics from the equator of three different moments (3,), see `SerretAndoyerMetric.geodesics`."""
    ascending, _, _ = ascending_moments(moments)
    p = finite_array(p_theta, "p_theta", unit="sqrt(kg) m")
    magnitude = np.maximum(np.abs(p), _LEAST_MOMENTUM * np.sqrt(ascending[0]))
    at_edge, at_crest, at_equator = (_one_minus_square(magnitude, moment) for moment in ascending)
    # sqrt(I_3), rounded to the nearest float, may be too large by its last digit.
    at_equator = np.where(np.abs(at_equator) <= 2.0 * np.finfo(float).eps, np.maximum(at_equator, 0.0), at_equator)
    limit = f"the largest is the equator's, the root of the largest moment, {np.sqrt(ascending[2]):.17g}"
    check_entries(at_equator < 0.0, p, "p_theta", limit)
    return _constants(ascending, p, magnitude, at_equator, at_crest, at_edge)


def constants_of_momentum(moments: Array, body_momentum: Array) -> GeodesicConstants:
    """The geodesics, from the equator, of which free motions with these momenta are a part: (3,), (..., 3).

    The moments are those about the body axes 1, 2, 3, the momenta not zero; p_theta = |Pi|/sqrt(2 E).
    """
    ascending, order, _ = ascending_moments(moments)
    lower, upper, whole = moment_gaps(moments)
    pi1, pi2, pi3 = np.moveaxis(body_momentum[..., order], -1, 0)
    doubled = np.sum(body_momentum**2 / moments, axis=-1)
    magnitude = np.linalg.norm(body_momentum, axis=-1) / np.sqrt(doubled)
    at_equator = (lower * pi2**2 + whole * pi1**2) / doubled
    root_1, root_3 = np.sqrt(upper) * np.abs(pi1), np.sqrt(lower) * np.abs(pi3)
    at_crest = (root_1 - root_3) * (root_1 + root_3) / doubled
    at_edge = -(whole * pi3**2 + upper * pi2**2) / doubled
    return _constants(ascending, magnitude, magnitude, at_equator, at_crest, at_edge)


def separatrix_constants(moments: Array) -> GeodesicConstants:
    """The separatrix, p_theta = sqrt(I_2) without rounding."""
    ascending, _, _ = ascending_moments(moments)
    i1, i2, i3 = ascending
    magnitude = np.sqrt(np.asarray(i2))
    at_equator, at_edge = np.asarray((i3 - i2) / i3), np.asarray((i1 - i2) / i1)
    return _constants(ascending, magnitude, magnitude, at_equator, np.zeros(()), at_edge)


def moment_gaps(moments: Array) -> tuple[float, float, float]:
    """a_2 - a_3, a_1 - a_2 and a_1 - a_3 of the inverse moments a_i = 1/I_i, I_1 < I_2 < I_3: (3,) in any order.

    B - A, C - B and C - A of Bonnard et al.
    """
    i1, i2, i3 = ascending_moments(moments)[0].tolist()
    return (i3 - i2) / (i3 * i2), (i2 - i1) / (i2 * i1), (i3 - i1) / (i3 * i1)


def _constants(
    moments: Array, p: Array, magnitude: Array, at_equator: Array, at_crest: Array, at_edge: Array
) -> GeodesicConstants:
    """Constants by ascending moments, |p|, 1 - a_3 p^2, 1 - a_2 p^2 and 1 - a_1 p^2."""
    lower, upper, whole = moment_gaps(moments)
    a1, a2, a3 = 1.0 / moments
    inner = np.where(at_edge > 0.0, GeodesicClass.EXTENDED, GeodesicClass.ROTATING)
    outer = np.where(at_equator > 0.0, GeodesicClass.OSCILLATING, GeodesicClass.EQUATOR)
    kind = np.where(at_crest < 0.0, outer, np.where(at_crest > 0.0, inner, GeodesicClass.SEPARATRIX))
    oscillating, extended = kind >= GeodesicClass.OSCILLATING, kind == GeodesicClass.EXTENDED
    square = magnitude * magnitude
    # The values 1.0 stand where a class does not use the number, so that nothing is divided by zero.
    above = np.where(oscillating, -at_edge, 1.0)
    positive_crest = np.where(at_crest > 0.0, at_crest, 1.0)
    rate = np.sqrt(np.where(oscillating, lower * above, np.where(extended, whole * at_crest, at_equator * upper)))
    complement = np.where(
        oscillating,
        -whole * at_crest / (lower * above),
        whole * at_crest / np.where(at_equator > 0.0, at_equator * upper, 1.0),
    )
    complement = np.where(extended, at_equator * upper / (whole * positive_crest), complement)
    complement = np.clip(complement, 0.0, 1.0)
    characteristic = np.where(
        oscillating, -at_equator / above, np.where(extended, -square * lower / positive_crest, -lower / upper)
    )
    second_kind = np.where(oscillating, whole / above, np.where(extended, lower / positive_crest, 0.0))
    second_kind = np.where(oscillating | extended, second_kind, a3 * (1.0 - complement) + a1 * lower / upper)
    return GeodesicConstants(
        moments=moments,
        p_theta=p,
        magnitude=magnitude,
        kind=kind,
        at_equator=at_equator,
        at_crest=at_crest,
        rate=rate,
        complement=complement,
        modulus=np.where(oscillating, np.sqrt(at_equator * upper / (lower * above)), 1.0),
        characteristic=characteristic,
        drift=np.where(oscillating, 1.0 / magnitude, a2 * magnitude),
        third_kind=np.where(extended, at_equator / (magnitude * rate), whole * magnitude / rate),
        second_kind=second_kind,
    )


def _one_minus_square(magnitude: Array, moment: float) -> Array:
    """1 - magnitude^2/moment to all digits, the square in two exact parts (Dekker 1971)."""
    unit = 2.0 ** -(np.frexp(moment)[1] // 2)
    x, limit = magnitude * unit, moment * unit * unit
    high = x * (2.0**27 + 1.0)
    high = high - (high - x)
    low = x - high
    square = x * x
    rest = ((high * high - square) + 2.0 * high * low) + low * low
    return ((limit - square) - rest) / limit
