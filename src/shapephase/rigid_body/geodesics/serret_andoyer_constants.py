"""The constants of the geodesics of the Serret-Andoyer metric: class, rate, moduli and factors, for each p_theta.

`serret_andoyer_geodesics` says what they stand for. Near the separatrix and near the equator everything hangs on
1 - B p^2 and 1 - A p^2, which are small: they are found from p without rounding, or from a momentum as it is.

Source: Bonnard, Cots and Shcherbakova 2013, section 4.3; theory.md R6, B-E8, B-E11.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Array, Integers, Mask, finite_array
from ...errors import ShapeError

EXTENDED, ROTATING, SEPARATRIX, OSCILLATING, EQUATOR = range(5)
_LEAST = 1e-9
"""Below this part of sqrt(I_3) theta is proportional to p to the last digit."""
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class GeodesicConstants:
    """Of geodesics from the equator with given p_theta, (...) each.

    Attributes
    ----------
    moments : (3,) descending
    p_theta : as given
    size : |p|, but no less than the least that makes a difference
    kind : EXTENDED to EQUATOR
    at_equator, at_crest : 1 - A p^2 >= 0 and 1 - B p^2, to all digits
    rate : M
    complement : m1 = 1 - m^2
    modulus : m of oscillating geodesics, to all digits next to the equator; else 1
    characteristic : n <= 0
    drift, third_kind : s and c in theta = s t - c (Pi(n; u) - u/(1 - n)), for p = size
    growth : q in A u + q S(u)
    """

    moments: Array
    p_theta: Array
    size: Array
    kind: Integers
    at_equator: Array
    at_crest: Array
    rate: Array
    complement: Array
    modulus: Array
    characteristic: Array
    drift: Array
    third_kind: Array
    growth: Array

    @property
    def oscillating(self) -> Mask:
        """Whether they return to the equator, which is one of them."""
        return self.kind >= OSCILLATING


def constants_of(moments: Array, p_theta: ArrayLike) -> GeodesicConstants:
    """The geodesics from the equator of descending moments (3,), as `SerretAndoyerMetric.geodesics` says."""
    p = finite_array(p_theta, "p_theta", unit="sqrt(kg) m")
    size = np.maximum(np.abs(p), _LEAST * np.sqrt(moments[2]))
    slope, height, excess = (_below_one(size, moment) for moment in moments)
    # sqrt(I_1) as rounded may be too large by its last digit.
    slope = np.where(np.abs(slope) <= 2.0 * _EPS, np.maximum(slope, 0.0), slope)
    limit = f"the largest is sqrt(I_1) = {np.sqrt(moments[0]):.17g}, the equator's"
    refuse(slope < 0.0, p, "p_theta", limit)
    return _constants(moments, p, size, slope, height, excess)


def constants_of_momentum(moments: Array, body_momentum: Array) -> GeodesicConstants:
    """The geodesics, from the equator, of which free motions with these momenta are a part: (3,), (..., 3).

    The momenta in principal axes of descending moments, not zero; p_theta = |Pi|/sqrt(2 E).
    """
    a, b, c = moment_gaps(moments)
    h1, h2, h3 = np.moveaxis(body_momentum, -1, 0)
    doubled = np.sum(body_momentum**2 / moments, axis=-1)
    size = np.linalg.norm(body_momentum, axis=-1) / np.sqrt(doubled)
    at_equator = (a * h2**2 + c * h3**2) / doubled
    root_3, root_1 = np.sqrt(b) * np.abs(h3), np.sqrt(a) * np.abs(h1)
    at_crest = (root_3 - root_1) * (root_3 + root_1) / doubled
    return _constants(moments, size, size, at_equator, at_crest, -(c * h1**2 + b * h2**2) / doubled)


def separatrix_constants(moments: Array) -> GeodesicConstants:
    """The separatrix, p_theta = sqrt(I_2) without rounding."""
    i1, i2, i3 = moments
    size = np.sqrt(np.asarray(i2))
    slope, excess = np.asarray((i1 - i2) / i1), np.asarray((i3 - i2) / i3)
    return _constants(moments, size, size, slope, np.zeros(()), excess)


def moment_gaps(moments: Array) -> tuple[float, float, float]:
    """B - A, C - B and C - A of descending moments."""
    i1, i2, i3 = moments.tolist()
    return (i1 - i2) / (i1 * i2), (i2 - i3) / (i2 * i3), (i1 - i3) / (i1 * i3)


def refuse(bad: Mask, values: Array, name: str, wanted: str) -> None:
    """Raise `ShapeError` naming the first of the values that is marked bad, and what is wanted."""
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ShapeError(f"{name}: entry {list(where)} is {values[where]:.17g}; {wanted}")


def _constants(moments: Array, p: Array, size: Array, slope: Array, height: Array, excess: Array) -> GeodesicConstants:
    """Of |p| and 1 - A p^2, 1 - B p^2, 1 - C p^2."""
    a, b, c = moment_gaps(moments)
    first, second, third = 1.0 / moments
    inner = np.where(excess > 0.0, EXTENDED, ROTATING)
    outer = np.where(slope > 0.0, OSCILLATING, EQUATOR)
    kind = np.where(height < 0.0, outer, np.where(height > 0.0, inner, SEPARATRIX))
    oscillating, extended = kind >= OSCILLATING, kind == EXTENDED
    square = size * size
    above = np.where(oscillating, -excess, 1.0)
    open_height = np.where(height > 0.0, height, 1.0)
    rate = np.where(oscillating, a * above, np.where(extended, c * height, slope * b))
    small = np.where(oscillating, -c * height / (a * above), c * height / np.where(slope > 0.0, slope * b, 1.0))
    small = np.where(extended, slope * b / (c * open_height), small)
    characteristic = np.where(oscillating, -slope / above, np.where(extended, -square * a / open_height, -a / b))
    rate = np.sqrt(rate)
    weight = np.where(extended, slope / (size * rate), c * size / rate)
    complement = np.clip(small, 0.0, 1.0)
    spread = np.where(oscillating, c / above, np.where(extended, a / open_height, 0.0))
    spread = np.where(oscillating | extended, spread, first * (1.0 - complement) + third * a / b)
    return GeodesicConstants(
        moments=moments,
        p_theta=p,
        rate=rate,
        complement=complement,
        modulus=np.where(oscillating, np.sqrt(slope * b / (a * above)), 1.0),
        characteristic=characteristic,
        size=size,
        at_equator=slope,
        at_crest=height,
        kind=kind,
        drift=np.where(oscillating, 1.0 / size, second * size),
        third_kind=weight,
        growth=spread,
    )


def _below_one(size: Array, moment: float) -> Array:
    """1 - size^2/moment to all digits, the square in two exact parts (Dekker 1971)."""
    unit = 2.0 ** -(np.frexp(moment)[1] // 2)
    x, limit = size * unit, moment * unit * unit
    high = x * 134217729.0
    high = high - (high - x)
    low = x - high
    square = x * x
    rest = ((high * high - square) + 2.0 * high * low) + low * low
    return ((limit - square) - rest) / limit
