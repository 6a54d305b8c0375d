"""The nutation of a Lagrange top in closed form: how its axis rises and falls, and goes round the vertical meanwhile.

With u = cos(theta) and the momenta along the vertical and the axis, the azimuth of the axis grows by

    phi' = (p_phi - p_psi u)/(I_1 (1 - u²)) = (p_phi - p_psi)/(2 I_1 (1 - u)) + (p_phi + p_psi)/(2 I_1 (1 + u)),

both parts of which are Legendre integrals of the third kind in t.

Source: Whittaker, Analytical Dynamics, sections 71-72; Goldstein, Classical Mechanics, section 5.7; theory.md M3.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object, vector_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ..elliptic import complete_k, complete_pi, incomplete_f, incomplete_pi, jacobi
from ..errors import ShapeError
from ._arguments import unit_vectors
from .lagrange_top import LagrangeTop


@dataclass(frozen=True, kw_only=True)
class Nutation:
    """Rise and fall of a Lagrange top's axis. Made by `nutation`."""

    lowest: float  #: Least cos(theta).
    highest: float
    """Largest cos(theta)."""
    third_root: float
    """The root of the cubic above this range, >= 1."""
    rate: float
    """Argument of the elliptic functions per second [rad/s]."""
    complement: float = 1.0
    """m1 = 1 - k^2."""
    period: float = np.inf
    """2K/rate; infinite where the axis only approaches the vertical [s]."""
    _phase: float = field(default=0.0, repr=False)
    _turns: tuple[float, float] = field(repr=False)
    _rooms: tuple[float, float] = field(repr=False)

    __repr__ = short_repr

    def height(self, t: ArrayLike) -> Array:
        """cos(theta) at times t: (...) -> (...)."""
        sn, _, _, _ = jacobi(self.rate * finite_array(t, "t", unit="s") + self._phase, self.complement)
        return self.lowest + (self.highest - self.lowest) * sn * sn

    def precession(self, t: ArrayLike) -> Array:
        """The angle by which the axis has gone round the vertical since t = 0: times (...) -> (...) [rad].

        Counted through the motion, positive counter-clockwise seen from above. Half a turn by which the azimuth jumps
        where the axis goes through the vertical itself is not counted; very near to it digits are lost.

        Source: Whittaker, section 72; theory.md M3.
        """
        times = finite_array(t, "t", unit="s")
        if self.lowest == self.highest:
            return (times * sum(rate / room for rate, room in zip(self._turns, self._rooms) if rate))[()]
        amplitudes = jacobi(self.rate * np.stack([np.zeros_like(times), times]) + self._phase, self.complement)[3]
        swept = np.zeros_like(times)
        for n, factor in _integrals(self):
            start, end = incomplete_pi(n, amplitudes, self.complement)
            swept += factor * (end - start)
        return swept[()]

    @property
    def precession_per_period(self) -> float:
        """Turn of the axis about the vertical in a period, as `precession` counts [rad].

        Infinite where there is no finite period, and the axis goes round.
        """
        if np.isfinite(self.period):
            return float(sum(2.0 * factor * complete_pi(n, self.complement) for n, factor in _integrals(self)))
        return float(self.precession(1.0)) * np.inf if self.precession(1.0) else 0.0


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
        If Mgl is not above 0.

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
    body = vector_argument(momentum, "momentum", unit="kg m^2/s")
    up = unit_vectors(vector_argument(gamma, "gamma"), "gamma")
    # The cubic in w = u - u(0): there the terms of its coefficients do not cancel.
    i1, height = top.transverse, float(up[2])
    turns = _turns(top, body, up)
    beta, spin = 2.0 * top.mgl / i1, float(body[2]) / i1
    speed = float(body[0] ** 2 + body[1] ** 2) / i1**2
    turn = float(body[0] * up[0] + body[1] * up[1]) / i1
    across = float(up[0] ** 2 + up[1] ** 2)
    climb = float(up[0] * body[1] - up[1] * body[0]) / i1
    second, first = 2.0 * beta * height - speed - spin**2, 2.0 * spin * turn - beta * across - 2.0 * height * speed
    cubic = np.array([beta, second, first, climb**2])
    low, high, third = _three_real_roots(cubic)
    low, high = min(low, 0.0), min(max(high, 0.0), 1.0 - height)
    third = max(third, 1.0 - height)
    width = high - low
    rate = float(np.sqrt(beta * (third - low) / 4.0))
    if width == 0.0 or third == low:
        return _without_nutation(height, third, rate, turns)
    complement = (third - high) / (third - low)
    # 1 + u_1: by the cubic at u = -1, where that keeps digits which the root does not have.
    lowest, slope = height + low, beta * (1.0 + height + high)
    below = 4.0 * turns[1] ** 2 / (slope * (1.0 + height + third)) if lowest < -0.5 else 1.0 + lowest
    amplitude = np.copysign(np.arctan2(np.sqrt(-low), np.sqrt(high)), climb)
    if complement == 0.0 and abs(amplitude) >= 0.5 * np.pi:
        return _without_nutation(height, third, rate, turns)
    return Nutation(
        lowest=lowest,
        highest=height + high,
        third_root=height + third,
        rate=rate,
        complement=complement,
        period=2.0 * float(complete_k(complement)) / rate,
        _phase=float(incomplete_f(amplitude, complement)),
        _turns=turns,
        _rooms=(1.0 - lowest, below),
    )


def _turns(top: LagrangeTop, momentum: Array, gamma: Array) -> tuple[float, float]:
    """(p_phi -+ p_psi)/(2 I_1), the numerators of the azimuth's rate, without loss next to the vertical."""
    level = float(momentum[0] * gamma[0] + momentum[1] * gamma[1])
    across, height = float(gamma[0] ** 2 + gamma[1] ** 2), float(gamma[2])
    near = across / (1.0 + abs(height))
    above, below = (near, 2.0 - near) if height >= 0.0 else (2.0 - near, near)
    minus, plus = level - float(momentum[2]) * above, level + float(momentum[2]) * below
    return minus / (2.0 * top.transverse), plus / (2.0 * top.transverse)


def _integrals(nutation: Nutation) -> list[tuple[float, float]]:
    """Characteristic and factor of the integrals of the third kind whose sum is the azimuth."""
    width = nutation.highest - nutation.lowest
    (minus, plus), (above, below) = nutation._turns, nutation._rooms
    parts = []
    if minus:
        parts.append((min(width / above, float(np.nextafter(1.0, 0.0))), minus / (above * nutation.rate)))
    if plus:
        parts.append((-width / below, plus / (below * nutation.rate)))
    return parts


def _without_nutation(height: float, third: float, rate: float, turns: tuple[float, float]) -> Nutation:
    """The axis stays at its height: steady precession, or the approach to the vertical that rounding cannot resolve."""
    return Nutation(
        lowest=height,
        highest=height,
        third_root=height + third,
        rate=rate,
        _turns=turns,
        _rooms=(1.0 - height, 1.0 + height),
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
