"""One explicit eighth-order step of the attitude equation, written once for numbers, arrays and symbols.

The attitude is carried as the quaternion of a frame that shares the momentum's direction as its z axis, so that
Pi is the momentum's size times the third row of the rotation matrix: R' = R hat(omega),
omega = I^-1 Pi - I^-1 L_o (Cabrera 2006, equation 10). The coefficients are those of Dormand and Prince 8(5,3)
(Hairer, Norsett and Wanner, Solving ODEs I), as SciPy holds them.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from .arrays import Array

Scalars = Any  # numbers, arrays or symbols, one for each component
STAGES = 12


@lru_cache(maxsize=1)
def tableau() -> tuple[Array, Array, Array]:
    """A (12, 12), b (12,), c (12,) of the eighth-order formula."""
    from scipy.integrate import DOP853

    return DOP853.A[:STAGES, :STAGES], DOP853.B[:STAGES], DOP853.C[:STAGES]


@lru_cache(maxsize=1)
def fifth_order_difference() -> Array:
    """Weights (12,) of the difference to the fifth-order formula on the same stages."""
    from scipy.integrate import DOP853

    return DOP853.E5[:STAGES]


def step(quat_xyzw: Scalars, size: Any | None, channels: Scalars) -> list[Any]:
    """The quaternion after one step, normalised. Parameters as `judged_step`."""
    a, b, _ = tableau()
    return _normalised(_combination(quat_xyzw, b, _slopes(quat_xyzw, size, channels, a)))


def judged_step(quat_xyzw: Scalars, size: Any | None, channels: Scalars) -> tuple[list[Any], Any]:
    """The quaternion after one step, normalised, and the square of its distance to a fifth-order step.

    Parameters
    ----------
    quat_xyzw : four components at the start of the step; numbers, arrays or symbols
    size : of the momentum [kg m^2/s], or None where it is zero
    channels : for each of the 12 stage times half the step length times (I^-1: xx yy zz yz xz xy, I^-1 L_o), nine
        entries; without momentum just the last three
    """
    a, b, _ = tableau()
    slopes = _slopes(quat_xyzw, size, channels, a)
    x, y, z, w = _combination([0.0] * 4, fifth_order_difference(), slopes)
    return _normalised(_combination(quat_xyzw, b, slopes)), x * x + y * y + z * z + w * w


def _slopes(quat_xyzw: Scalars, size: Any | None, channels: Scalars, a: Array) -> list[list[Any]]:
    slopes: list[list[Any]] = []
    for stage in range(STAGES):
        inner = _combination(quat_xyzw, a[stage, :stage], slopes)
        slopes.append(_slope(inner, size, channels[stage]))
    return slopes


def _normalised(quat_xyzw: Scalars) -> list[Any]:
    x, y, z, w = quat_xyzw
    scale = 1.0 / (x * x + y * y + z * z + w * w) ** 0.5
    return [x * scale, y * scale, z * scale, w * scale]


def body_momentum(quat_xyzw: Scalars, size: Any) -> list[Any]:
    """R^T (0, 0, size) for the unit quaternion of R."""
    x, y, z, w = quat_xyzw
    double = 2.0 * size
    return [double * (x * z - y * w), double * (y * z + x * w), double * (w * w + z * z) - size]


def turn_rate(momentum: Scalars, channels: Scalars) -> list[Any]:
    """I^-1 Pi - I^-1 L_o from the nine channels."""
    p, q, r = momentum
    xx, yy, zz, yz, xz, xy, *drift = channels
    return [
        xx * p + xy * q + xz * r - drift[0],
        xy * p + yy * q + yz * r - drift[1],
        xz * p + yz * q + zz * r - drift[2],
    ]


def _slope(quat_xyzw: Scalars, size: Any | None, channels: Scalars) -> list[Any]:
    x, y, z, w = quat_xyzw
    if size is None:
        a, b, c = (-drift for drift in channels)
    else:
        a, b, c = turn_rate(body_momentum(quat_xyzw, size), channels)
    return [w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -(x * a + y * b + z * c)]


def _combination(start: Scalars, weights: Array, slopes: list[list[Any]]) -> list[Any]:
    total = list(start)
    for weight, slope in zip(weights, slopes, strict=True):
        if weight != 0.0:
            total = [t + float(weight) * s for t, s in zip(total, slope, strict=True)]
    return total


def relative_angle(first: Scalars, second: Scalars) -> Any:
    """The angle between two nearby rotations given as unit quaternions, to first order [rad]."""
    a, b, c, d = first
    x, y, z, w = second
    u = d * x - a * w - b * z + c * y
    v = d * y - b * w - c * x + a * z
    s = d * z - c * w - a * y + b * x
    return 2.0 * (u * u + v * v + s * s) ** 0.5


def variation(momentum: Scalars, channels: Scalars) -> list[list[Any]]:
    """The matrix M of delta' = M delta for an error delta of the attitude, S exp(hat(delta)).

    M = I^-1 hat(Pi) - hat(omega), scaled as the channels are (numerics.md section 1).
    """
    p, q, r = momentum
    xx, yy, zz, yz, xz, xy, *_ = channels
    a, b, c = turn_rate(momentum, channels)
    return [
        [xy * r - xz * q, xz * p - xx * r + c, xx * q - xy * p - b],
        [yy * r - yz * q - c, yz * p - xy * r, xy * q - yy * p + a],
        [yz * r - zz * q + b, zz * p - xz * r - a, xz * q - yz * p],
    ]


def steps_in_numpy(quat_xyzw: Array, size: Array | None, channels: Array) -> Array:
    """`step` on arrays: quaternions (..., 4), sizes (...), channels (..., 12, 9 or 3) -> (..., 4)."""
    return np.stack(np.broadcast_arrays(*step(*_parts(quat_xyzw, channels, size))), axis=-1)


def judged_steps_in_numpy(quat_xyzw: Array, size: Array | None, channels: Array) -> tuple[Array, Array]:
    """`judged_step` on arrays: as `steps_in_numpy`, and the squared distances (...)."""
    quaternion, square = judged_step(*_parts(quat_xyzw, channels, size))
    return np.stack(np.broadcast_arrays(*quaternion), axis=-1), square


def _parts(quat_xyzw: Array, channels: Array, size: Array | None) -> tuple[Scalars, Array | None, Scalars]:
    stages = [[channels[..., s, i] for i in range(channels.shape[-1])] for s in range(STAGES)]
    return [quat_xyzw[..., i] for i in range(4)], size, stages
