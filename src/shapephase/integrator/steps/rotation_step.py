"""One explicit eighth-order step of the attitude equation, written once for numbers, arrays and symbols.

With momentum, the unit vector p = Pi/|Pi| is stepped, p' = p x omega with omega = I^-1 Pi - I^-1 L_o (Cabrera 2006,
equation 10), and two integrals along it: the dynamic phase, and the turn about p that is left when the shortest
rotation between the step's ends is taken off. Both need no stages of their own, so a step costs three equations, not
nine. Without momentum the equation is linear, and a step is a rotation that does not depend on where it starts.
The coefficients are those of Dormand and Prince 8(5,3) (Hairer, Norsett and Wanner, Solving ODEs I), as SciPy
holds them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from ...arrays import Array

Scalars = Any  # numbers, arrays or symbols, one for each component
STAGES = 12


@lru_cache(maxsize=1)
def tableau() -> tuple[Array, Array, Array]:
    """A (12, 12), b (12,), c (12,) of the eighth-order formula."""
    from scipy.integrate import DOP853

    return DOP853.A[:STAGES, :STAGES], DOP853.B[:STAGES], DOP853.C[:STAGES]


def momentum_step(
    direction: Scalars, magnitude: Any, channels: Scalars, *, with_dynamic: bool = True
) -> tuple[list[Any], Any, Any]:
    """A step with momentum.

    Parameters
    ----------
    direction : three components of the unit vector Pi/|Pi| at the start of the step; numbers, arrays or symbols
    magnitude : of the momentum [kg m^2/s]
    channels : for each of the 12 stage times the step length times (I^-1: xx yy zz yz xz xy, I^-1 L_o), nine
        entries
    with_dynamic : whether the dynamic phase is wanted; without it the turn takes fewer operations

    Returns
    -------
    direction : at the end of the step, of length one
    turn : angle about the starting direction, to be followed by the shortest rotation between the directions [rad]
    dynamic : the step's dynamic phase, the integral of omega . Pi/|Pi| [rad]; zero if it is not wanted
    """
    a, b, _ = tableau()
    slopes: list[list[Any]] = []
    turns: list[list[Any]] = []
    dynamics: list[list[Any]] = []
    for stage in range(STAGES):
        p = _combination(direction, a[stage, :stage], slopes)
        omega = turn_rate([magnitude * component for component in p], channels[stage])
        slopes.append(_cross(p, omega))
        if b[stage] == 0.0:
            turns.append([0.0])
            dynamics.append([0.0])
            continue
        if with_dynamic:
            along = _dot(p, omega)
            twice = along + _dot(direction, omega)
        else:
            along, twice = 0.0, _dot([d + component for d, component in zip(direction, p, strict=True)], omega)
        turns.append([twice / (1.0 + _dot(direction, p))])
        dynamics.append([along])
    end = unit(_combination(direction, b, slopes))
    (turn,), (dynamic,) = _combination([0.0], b, turns), _combination([0.0], b, dynamics)
    return end, turn, dynamic


def rest_step(half_rates: Scalars) -> list[Any]:
    """A step without momentum: the quaternion of its rotation.

    Parameters
    ----------
    half_rates : for each of the 12 stages half the step length times the rate of turning -I^-1 L_o, three entries
    """
    a, b, _ = tableau()
    slopes: list[list[Any]] = []
    for stage in range(STAGES):
        x, y, z, w = _combination([0.0, 0.0, 0.0, 1.0], a[stage, :stage], slopes)
        p, q, r = half_rates[stage]
        slopes.append([w * p + y * r - z * q, w * q + z * p - x * r, w * r + x * q - y * p, -(x * p + y * q + z * r)])
    return unit(_combination([0.0, 0.0, 0.0, 1.0], b, slopes))


def attitude_step(quat_xyzw: Scalars, momentum: Scalars, channels: Scalars) -> list[Any]:
    """A step of the same formula on the quaternion of S, for a momentum Pi at the start of the motion.

    `channels` as in `momentum_step`.
    """
    a, b, _ = tableau()
    slopes: list[list[Any]] = []
    for stage in range(STAGES):
        q = _combination(quat_xyzw, a[stage, :stage], slopes)
        conjugate = [-q[0], -q[1], -q[2], q[3]]
        seen = product(product(conjugate, [*momentum, 0.0]), q)[:3]
        half = [0.5 * rate for rate in turn_rate(seen, channels[stage])]
        slopes.append(product(q, [*half, 0.0]))
    return unit(_combination(quat_xyzw, b, slopes))


def turned(quat_xyzw: Scalars, start: Scalars, end: Scalars, half_turn: tuple[Any, Any]) -> list[Any]:
    """The attitude after a step: `quat_xyzw`, then the turn about `start`, then the shortest rotation.

    `start` and `end` are the momentum's directions seen from the body, `half_turn` sine and cosine of half the turn.
    """
    sine, cosine = half_turn
    # The product of both turns; the axis of the second is at a right angle to the first.
    vector = [cosine * across + sine * (s + e) for across, s, e in zip(_cross(end, start), start, end, strict=True)]
    return unit(product(quat_xyzw, [*vector, cosine * (1.0 + _dot(start, end))]))


def product(first: Scalars, second: Scalars) -> list[Any]:
    """Product of two quaternions x y z w."""
    a, b, c, d = first
    x, y, z, w = second
    return [
        d * x + a * w + b * z - c * y,
        d * y - a * z + b * w + c * x,
        d * z + a * y - b * x + c * w,
        d * w - a * x - b * y - c * z,
    ]


def turn_rate(momentum: Scalars, channels: Scalars) -> list[Any]:
    """I^-1 Pi - I^-1 L_o from the nine channels."""
    p, q, r = momentum
    xx, yy, zz, yz, xz, xy, *drift = channels
    return [
        xx * p + xy * q + xz * r - drift[0],
        xy * p + yy * q + yz * r - drift[1],
        xz * p + yz * q + zz * r - drift[2],
    ]


def variation(momentum: Scalars, channels: Scalars) -> list[list[Any]]:
    """The matrix M of delta' = M delta for an error delta of the attitude, S exp(hat(delta)).

    M = I^-1 hat(Pi) - hat(omega), scaled as the channels are.
    """
    p, q, r = momentum
    xx, yy, zz, yz, xz, xy, *_ = channels
    a, b, c = turn_rate(momentum, channels)
    return [
        [xy * r - xz * q, xz * p - xx * r + c, xx * q - xy * p - b],
        [yy * r - yz * q - c, yz * p - xy * r, xy * q - yy * p + a],
        [yz * r - zz * q + b, zz * p - xz * r - a, xz * q - yz * p],
    ]


def unit(vector: Scalars) -> list[Any]:
    """A vector scaled to length one."""
    scale = 1.0 / _dot(vector, vector) ** 0.5
    return [component * scale for component in vector]


def _combination(start: Scalars, weights: Array, slopes: list[list[Any]]) -> list[Any]:
    """The start and the weighted slopes, which are summed first: what is small is not rounded as what is large."""
    pairs = [(float(weight), slope) for weight, slope in zip(weights, slopes, strict=False) if weight != 0.0]
    if not pairs:
        return list(start)
    weight, slope = pairs[0]
    total = [weight * s for s in slope]
    for weight, slope in pairs[1:]:
        total = [t + weight * s for t, s in zip(total, slope, strict=True)]
    return [t + s for t, s in zip(start, total, strict=True)]


def _dot(a: Scalars, b: Scalars) -> Any:
    total = a[0] * b[0]
    for x, y in zip(a[1:], b[1:], strict=True):
        total = total + x * y
    return total


def _cross(a: Scalars, b: Scalars) -> list[Any]:
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
