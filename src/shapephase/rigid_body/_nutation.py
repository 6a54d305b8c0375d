"""The nutation of a Lagrange top in closed form: how its axis rises and falls.

Source: Whittaker, Analytical Dynamics, sections 71-72; Goldstein, Classical Mechanics, section 5.7; theory.md M3.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object
from ..arrays import Array, finite_array
from ..display import short_repr
from ..elliptic import complete_k, incomplete_f, jacobi
from ..errors import ShapeError
from .lagrange_top import LagrangeTop

_UNIT = 1e-6
"""Farthest from 1 that the length of a vertical may be: six digits, as people write them, are enough."""


@dataclass(frozen=True)
class Nutation:
    """The rise and fall of a Lagrange top's axis.

    Attributes
    ----------
    lowest, highest : the range of cos(theta)
    third_root : the root of the cubic above this range, >= 1
    rate : argument of the elliptic functions per second [rad/s]
    complement : m1 = 1 - k^2
    period : 2K/rate; infinite where the axis only approaches the vertical [s]

    Examples
    --------
    >>> top = sp.rigid_body.LagrangeTop(1.0, 0.5, 2.0)
    >>> found = sp.rigid_body.nutation(top, [0.0, 0.3, 3.0], [0.0, 0.6, 0.8])
    >>> print(f"{found.highest:.6f}")
    0.800000
    """

    lowest: float
    highest: float
    third_root: float
    rate: float
    complement: float
    period: float
    _phase: float = field(repr=False)

    __repr__ = short_repr

    def height(self, t: ArrayLike) -> Array:
        """cos(theta) at times t: (...) -> (...)."""
        sn, _, _, _ = jacobi(self.rate * finite_array(t, "t", unit="s") + self._phase, self.complement)
        return self.lowest + (self.highest - self.lowest) * sn * sn


def nutation(top: LagrangeTop, momentum: ArrayLike, gamma: ArrayLike) -> Nutation:
    """The height u = Gamma_3 = cos(theta) of the top's axis in closed form.

    u'^2 is a cubic in u with roots u1 <= u2 <= 1 <= u3; u = u1 + (u2 - u1) sn^2 with k^2 = (u2 - u1)/(u3 - u1).
    Steady precession and the upright spin are double roots. Next to one of them 1 - k^2 has as many digits as the
    initial values determine of the distance from it.

    Parameters
    ----------
    top : with Mgl > 0
    momentum : (3,) body momentum at t = 0 [kg m^2/s]
    gamma : (3,) upward vertical in body axes at t = 0

    Raises
    ------
    ShapeError
        If Mgl is not above 0, or an argument is of a wrong shape or value.

    Examples
    --------
    >>> top = sp.rigid_body.LagrangeTop(1.0, 0.5, 2.0)
    >>> found = sp.rigid_body.nutation(top, [0.0, 0.3, 3.0], [0.0, 0.6, 0.8])
    >>> print(f"{found.lowest:.6f} to {found.highest:.6f} in {found.period:.6f} s")
    0.647308 to 0.800000 in 3.313171 s
    """
    check_object(top, "LagrangeTop", "top")
    if top.mgl <= 0.0:
        raise ShapeError(f"mgl: the nutation needs Mgl > 0, got {top.mgl:.6g} J; turn e3 towards the centre of mass")
    body = finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    up = finite_array(gamma, "gamma", (3,))
    if body.shape != (3,) or up.shape != (3,):
        raise ShapeError(f"momentum (3,) and gamma (3,) are needed, got {body.shape}, {up.shape}")
    length = float(np.linalg.norm(up))
    if abs(length - 1.0) > _UNIT:
        raise ShapeError(f"gamma: the vertical must have length 1, got {length:.6g}")
    return _nutation(top, body, up / length)


def _nutation(top: LagrangeTop, momentum: Array, gamma: Array) -> Nutation:
    """The closed form, from the cubic in w = u - u(0): there the terms of its coefficients do not cancel."""
    i1, height = top.transverse, float(gamma[2])
    beta, spin = 2.0 * top.mgl / i1, float(momentum[2]) / i1
    speed = float(momentum[0] ** 2 + momentum[1] ** 2) / i1**2
    turn = float(momentum[0] * gamma[0] + momentum[1] * gamma[1]) / i1
    across = float(gamma[0] ** 2 + gamma[1] ** 2)
    climb = float(gamma[0] * momentum[1] - gamma[1] * momentum[0]) / i1
    cubic = np.array(
        [
            beta,
            2.0 * beta * height - speed - spin**2,
            2.0 * spin * turn - beta * across - 2.0 * height * speed,
            climb**2,
        ]
    )
    low, high, third = _three_real_roots(cubic)
    low, high = min(low, 0.0), min(max(high, 0.0), 1.0 - height)
    third = max(third, 1.0 - height)
    width = high - low
    rate = float(np.sqrt(0.25 * beta * (third - low)))
    if width == 0.0 or third == low:
        return _without_nutation(height, third, rate)
    complement = (third - high) / (third - low)
    amplitude = np.copysign(np.arctan2(np.sqrt(-low), np.sqrt(high)), climb)
    if complement == 0.0 and abs(amplitude) >= 0.5 * np.pi:
        return _without_nutation(height, third, rate)
    return Nutation(
        lowest=height + low,
        highest=height + high,
        third_root=height + third,
        rate=rate,
        complement=complement,
        period=2.0 * float(complete_k(complement)) / rate,
        _phase=float(incomplete_f(amplitude, complement)),
    )


def _without_nutation(height: float, third: float, rate: float) -> Nutation:
    """The axis stays at its height: steady precession, or the approach to the vertical that rounding cannot resolve."""
    return Nutation(
        lowest=height,
        highest=height,
        third_root=height + third,
        rate=rate,
        complement=1.0,
        period=np.inf,
        _phase=0.0,
    )


def _three_real_roots(cubic: Array) -> tuple[float, float, float]:
    """Ascending roots of a cubic that has three real ones.

    The root farthest from the others is simple and found to rounding; it is divided out from the end that loses no
    digits, so the other two are accurate relative to their own magnitude even where both are tiny.
    """
    lead, second, first, last = cubic.tolist()
    slope, start = np.polyder(cubic), np.sort(np.roots(cubic).real)
    apart = float(start[0] if start[1] - start[0] > start[2] - start[1] else start[2])
    for _ in range(3):
        rise = float(np.polyval(slope, apart))
        apart -= float(np.polyval(cubic, apart)) / rise if rise else 0.0
    if abs(apart) > 0.5 * np.abs(start).max():
        constant = -last / apart
        linear = (constant - first) / apart
    else:
        linear = second + lead * apart
        constant = first + apart * linear
    root = np.sqrt(max(linear * linear - 4.0 * lead * constant, 0.0))
    large = -0.5 * (linear + np.copysign(root, linear))
    low, high, third = sorted((apart, large / lead, constant / large if large else 0.0))
    return float(low), float(high), float(third)
