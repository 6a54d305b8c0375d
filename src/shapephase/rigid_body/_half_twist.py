"""Flips of a body that spins about its intermediate axis: the half twist (Dzhanibekov) and the tennis racket.

Body axes are principal axes. Moments and momentum are taken as exact, so that times are accurate however near the
separatrix is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import elliprf, elliprj

from ..arrays import Array, common_shape, finite_array
from ..display import short_repr
from ..elliptic import complete_k
from ..errors import ShapeError
from ..inertia_tensor import ascending_moments
from ..roots import bracketed_root, safe_newton
from ._arguments import positive_moments
from ._momentum_orbit import momentum_orbit


@dataclass(frozen=True)
class HalfTwist:
    """Times at which a free rigid body turns over about its intermediate axis. Made by `half_twist`."""

    time: Array
    """(...) from one reversal of the intermediate component of Pi to the next, half the period 4K/rate; infinite where
    it never reverses (steady rotations, the separatrix, a spherical body) [s]."""
    asymptote: Array
    """(...) log(16/complement)/growth_rate, which `time` approaches at the separatrix; infinite on it and where two
    moments are equal [s]."""
    complement: Array
    """(...) m1 = 1 - k^2, 0 on the separatrix."""
    rate: Array
    """(...) argument of the elliptic functions per second; 0 where Pi stands still [rad/s]."""
    growth_rate: Array
    """(...) the positive eigenvalue at the intermediate axis, |Pi| sqrt((I2 - I1)(I3 - I2)/(I1 I3))/I2 [1/s]."""

    __repr__ = short_repr


_FARTHEST = 300.0  # of the logarithm of a tangent: the square of exp(300) is a number


def half_twist(moments: ArrayLike, momentum: ArrayLike) -> HalfTwist:
    """Time between the flips of a free rigid body, from its principal moments and its body momentum.

    Between two flips Pi circles the axis of the largest or of the smallest moment by half a turn, 2K of the elliptic
    functions. The distance from the separatrix is computed without rounding; parts of Pi below 1e-140 count as zero.

    Source: Marsden and Ratiu, section 15.8 and section 15.9 remark 1, whose I1 >= I2 >= I3 are our I3, I2, I1;
    theory.md L4.

    Parameters
    ----------
    moments : (..., 3) principal moments in any order, any positive numbers [kg m^2]
    momentum : (..., 3) Pi along these axes at any one time [kg m^2/s]

    Examples
    --------
    >>> flip = sp.rigid_body.half_twist([1.0, 2.0, 3.0], [0.001, 2.0, 0.0])
    >>> top = sp.EulerTop.principal([1.0, 2.0, 3.0], [0.001, 2.0, 0.0])
    >>> print(f"{flip.time:.6f} s, half of the period {top.period:.6f} s")
    28.731424 s, half of the period 57.462849 s
    """
    inertia, vector = _ordered(moments, momentum)
    rows = [_flip(i, x) for i, x in zip(inertia.reshape(-1, 3), vector.reshape(-1, 3))]
    table = np.array(rows, dtype=float).reshape(*inertia.shape[:-1], 5)
    return HalfTwist(*(column[()] for column in np.moveaxis(table, -1, 0)))


def half_twist_from_tilt(moments: ArrayLike, magnitude: ArrayLike, tilt: ArrayLike, azimuth: ArrayLike) -> HalfTwist:
    """Time between the flips of a body that starts with a small tilt off its intermediate axis.

    Parameters
    ----------
    moments : (..., 3) principal moments in any order [kg m^2]
    magnitude : (...) |Pi| [kg m^2/s]
    tilt : (...) angle between Pi and the intermediate axis at the start [rad]
    azimuth : (...) direction of the tilt, from the axis of the smallest to that of the largest moment [rad]

    Examples
    --------
    >>> flip = sp.rigid_body.half_twist_from_tilt([1.0, 2.0, 3.0], 2.0, 1e-3, 0.0)
    >>> print(f"{flip.time:.4f} s")
    26.3303 s
    """
    inertia, _, _ = ascending_moments(positive_moments(moments))
    norm = finite_array(magnitude, "magnitude", unit="kg m^2/s")
    polar, around = finite_array(tilt, "tilt", unit="rad"), finite_array(azimuth, "azimuth", unit="rad")
    common_shape(magnitude=norm, tilt=polar, azimuth=around)
    norm, polar, around = np.broadcast_arrays(norm, polar, around)
    across = norm * np.sin(polar)
    momentum = np.stack([across * np.cos(around), norm * np.cos(polar), across * np.sin(around)], axis=-1)
    return half_twist(inertia, momentum)


def twist_defect(moments: ArrayLike) -> Array:
    """Tennis-racket effect on the separatrix: the angle eps by which each end of the half twist falls short.

    (..., 3) -> (...) in (0, pi/2) [rad]; 0 where it would be below 1e-308. While the handle of a racket (the axis of
    the smallest moment), tossed about its intermediate axis, goes round the momentum once, the racket twists about the
    handle by pi - 2 eps. With the handle's azimuth phi and the twist psi,
    measured from the middle of the flip, a = I2/I1 - 1 and b = 1 - I2/I3 for ascending moments, motion on the
    separatrix obeys dphi/dpsi = (1 - b cos^2 psi)/sqrt(b cos^2 psi (a + b cos^2 psi)). Half a turn gives, u = cos eps,

        pi = artanh(u sqrt(a)/sqrt(a + b - b u^2))/sqrt(a b) - arcsin(u sqrt(b/(a + b))).

    Source: Van Damme, Mardesic and Sugny 2017; Ashbaugh, Chicone and Cushman 1991; theory.md section 7.
    Raises ShapeError if two moments are equal: there is no intermediate axis.

    Parameters
    ----------
    moments : (..., 3) three different principal moments in any order [kg m^2]

    Examples
    --------
    >>> print(f"{np.degrees(sp.rigid_body.twist_defect([1.0, 2.0, 2.1])):.3f} degrees")
    51.506 degrees
    """
    a, b = _asymmetries(ascending_moments(positive_moments(moments))[0])
    share, scale = b / (a + b), np.sqrt(a * b)
    lower, upper = scale * np.pi, scale * (np.pi + np.arcsin(np.sqrt(share)))

    # The unknown is the value w of the artanh, sinh w = sqrt(a/(a + b)) cot eps: no digits are lost however small eps.
    def newton(w: Array) -> tuple[Array, Array]:
        tangent = np.sqrt(a / (a + b)) * _reciprocal_sinh(w)
        cosine = 1.0 / np.hypot(1.0, tangent)
        sine = tangent * cosine
        # The arcsin is of sqrt(share) cos eps; its sine's complement is free of cancellation in this form.
        complement = np.sqrt(1.0 - share + share * sine * sine)
        value = w - scale * (np.pi + np.arctan2(np.sqrt(share) * cosine, complement))
        slope = 1.0 - scale * np.sqrt(share) * sine * sine * cosine / (complement * np.tanh(w))
        return value, w - value / slope

    w = safe_newton(newton, 0.5 * (lower + upper), lower, upper)
    return np.arctan2(np.sqrt(a) * _reciprocal_sinh(w), np.sqrt(a + b))[()]


def racket_twist(moments: ArrayLike, momentum: ArrayLike) -> Array:
    """Tennis-racket effect off the separatrix: the twist about the handle while the handle goes round once.

    The whole turn of the handle (the axis of the smallest moment) about the momentum is half before and half after
    the middle of the flip, where the momentum has no part along the intermediate axis. The equation
    is that of `twist_defect` with c = (a Pi_1^2 - b Pi_3^2)/|Pi|^2, ascending axes, which is 0 on the separatrix,

        dphi/dpsi = (1 - b cos^2 psi)/sqrt((a + b cos^2 psi)(c + b cos^2 psi)),

    an integral in Carlson's forms. For c > 0 the racket twists on and on; for c < 0 it swings to and fro, and the twist
    is negative at the end of a swing back. On the separatrix it is pi - 2 `twist_defect`: (..., 3) -> (...) [rad].

    Source: Van Damme, Mardesic and Sugny 2017; theory.md section 7.
    Raises ShapeError if two moments are equal, or there is no momentum.

    Parameters
    ----------
    moments : (..., 3) three different principal moments in any order [kg m^2]
    momentum : (..., 3) along these axes at any one time [kg m^2/s]

    Examples
    --------
    >>> twist = sp.rigid_body.racket_twist([1.0, 2.0, 2.1], [0.1, 1.0, 0.0])
    >>> print(f"{np.degrees(twist):.3f} degrees; on the separatrix {180.0 - 2.0 * 51.506:.3f}")
    84.617 degrees; on the separatrix 76.988
    """
    inertia, vector = _ordered(moments, momentum)
    a, b = _asymmetries(inertia)
    length = np.linalg.norm(vector, axis=-1)
    if np.any(length == 0.0):
        raise ShapeError("momentum: a tennis racket needs a momentum")
    c = a * (vector[..., 0] / length) ** 2 - b * (vector[..., 2] / length) ** 2
    twists = [_racket_twist(*row) for row in zip(*(np.ravel(x).tolist() for x in (a, b, c)), strict=True)]
    return np.reshape(twists, c.shape)[()]


def _racket_twist(a: float, b: float, c: float) -> float:
    """Twist of one racket [rad]."""
    # The end of a swing, or a quarter turn, at tan(psi) = exp(-low).
    low = 0.5 * math.log(-c / (b + c)) if c < 0.0 and b + c > 0.0 else -_FARTHEST
    if b + c <= 0.0:
        return 0.0
    quarter = _azimuth(math.exp(2.0 * low) if c < 0.0 else 0.0, a, b, c) if c else math.inf
    swings, rest = divmod(math.pi, 2.0 * quarter) if c else (0.0, math.pi)
    back = rest > quarter
    part = 2.0 * quarter - rest if back else rest
    logarithm = bracketed_root(lambda x: _azimuth(math.exp(2.0 * x), a, b, c) - part, low, _FARTHEST)
    angle = math.atan2(1.0, math.exp(logarithm))
    if c > 0.0:
        return 2.0 * (math.pi * swings + (math.pi - angle if back else angle))
    return 2.0 * (angle if swings % 2.0 == 0.0 else -angle)


def _azimuth(square: float, a: float, b: float, c: float) -> float:
    """The handle's azimuth from the middle to psi, by the square of cot(psi)."""
    x, y, z = square, square + a / (a + b), max(square + c / (b + c), 0.0)
    if not square and not z:
        return math.inf
    root = math.sqrt((a + b) * (b + c))
    return float(((1.0 - b) * elliprf(x, y, z) + b / 3.0 * elliprj(x, y, z, square + 1.0)) / root)


def _reciprocal_sinh(w: Array) -> Array:
    """1/sinh w, without overflow."""
    return 2.0 * np.exp(-w) / -np.expm1(-2.0 * w)


def _flip(moments: Array, momentum: Array) -> tuple[float, float, float, float, float]:
    """Time, asymptote, complement, rate and growth rate of one top, moments ascending."""
    low, middle, high = moments.tolist()
    orbit = momentum_orbit(moments, momentum)
    growth = orbit.magnitude * math.sqrt((middle - low) / low * ((high - middle) / high)) / middle
    m1, rate = orbit.complement, orbit.rate
    asymptote = math.log(16.0 / m1) / growth if m1 and growth else math.inf
    turns_over = rate > 0.0 and orbit.regime != "steady"
    return 2.0 * float(complete_k(m1)) / rate if turns_over else math.inf, asymptote, m1, rate, growth


def _ordered(moments: ArrayLike, momentum: ArrayLike) -> tuple[Array, Array]:
    """Ascending moments and the momentum along their axes, whose handedness makes no difference to times."""
    inertia, vector = positive_moments(moments), finite_array(momentum, "momentum", (3,), unit="kg m^2/s")
    shape = common_shape(moments=inertia, momentum=vector)
    inertia, order, _ = ascending_moments(np.broadcast_to(inertia, shape))
    return inertia, np.take_along_axis(np.broadcast_to(vector, shape), order, -1)


def _asymmetries(ascending: Array) -> tuple[Array, Array]:
    """I2/I1 - 1 and 1 - I2/I3 of ascending moments, which must be different."""
    low, middle, high = np.moveaxis(ascending, -1, 0)
    if np.any((low == middle) | (middle == high)):
        raise ShapeError("moments: two are equal; a tennis racket needs three different principal moments")
    return (middle - low) / low, (high - middle) / high
