"""Euler's equations for inverse moments, zero included: momentum, attitude and their derivatives, batched.

In principal axes of ascending moments, so of descending inverse moments a_1 >= a_2 >= a_3, and with
delta = (a_3 − a_2, a_1 − a_3, a_2 − a_1) the addition theorem of Jacobi's functions makes the flow a rational map of
the initial momentum,

    Pi_1(t) = (Pi_1 c + delta_1 Pi_2 Pi_3 S d)/D,   Pi_2(t) = (Pi_2 c d + delta_2 Pi_3 Pi_1 S)/D,
    Pi_3(t) = (Pi_3 d + delta_3 Pi_1 Pi_2 S c)/D,   D = 1 − delta_1 delta_3 Pi_2² S²,

where S' = c d, c² = 1 − P S², d² = 1 − Q S², and P, Q are quadratic in Pi and conserved. It contains neither phase nor
modulus, so it has a derivative in closed form that holds in every case: at rest, along any axis, on the separatrix,
for equal moments, and for a_3 = 0, the sub-Riemannian metrics.

The attitude is that of `EulerTop`, which takes finite moments, one body at a time. It depends on the differences of the
a_i only, except for a uniform turn about the momentum: a_i + c in place of a_i turns R by c t about Pi, in inertial
axes.

Sources: theory.md D17, H3-H6, Q2, Q3; Carlson's form of the derivative, DLMF 19.25 and 19.29.
"""

from __future__ import annotations

import numpy as np
from scipy.special import elliprd

from ... import elliptic, so3
from ...arrays import Array
from ...errors import ShapeError

_MOST_STEPS = 20_000  # limit of the time of one call; rounding grows with the steps, too


def momentum_flow(inverse_moments: Array, start: Array, times: Array) -> tuple[Array, Array]:
    """Pi(t) and its derivative by Pi(0): (3,) descending, (N, 3), (N,) -> (N, 3), (N, 3, 3).

    In equal steps short enough that none is near a zero of c or d; errors grow as the flow itself does.

    Raises ShapeError for times so long that there would be more than 20,000 steps, each of a sixth of a period or more.
    """
    p, q = _conserved(inverse_moments, start)
    # A quarter period is at least pi/2 in units of 1/sqrt(max(P, Q)): no step of one unit nears a zero of c or d.
    longest = float((np.sqrt(np.maximum(p, q)) * np.abs(times)).max(initial=0.0))
    if longest > _MOST_STEPS:
        raise ShapeError(
            f"t: in {np.abs(times).max():.6g} s the momentum goes round its curve about {longest / (2.0 * np.pi):.3g} "
            "times, too far for a derivative; make the time shorter"
        )
    count = max(1, int(np.ceil(longest)))
    functions = _step_functions(inverse_moments, start, p, q, times / count)
    momentum, jacobian = start, np.broadcast_to(np.eye(3), (*start.shape, 3))
    for _ in range(count):
        momentum, step = _addition(inverse_moments, momentum, *functions)
        jacobian = step @ jacobian
    return momentum, jacobian


def attitude_flow(inverse_moments: Array, start: Array, times: Array) -> Array:
    """R(t) with R(0) the identity, body axes to inertial axes: (3,) descending, (N, 3), (N,) -> (N, 3, 3)."""
    return so3.matrix_from_quat(quaternion_flow(inverse_moments, start, times))


def quaternion_flow(inverse_moments: Array, start: Array, times: Array) -> Array:
    """R(t) in unit quaternions xyzw, continued along t from 1: (3,) descending, (N, 3), (N,) -> (N, 4)."""
    p, q = _conserved(inverse_moments, start)
    # At rest, along an axis, or for three equal moments the body turns uniformly.
    uniform = (np.maximum(p, q) == 0.0) | ((start[:, 0] == 0.0) & (start[:, 2] == 0.0))
    quats = so3.quat_from_rotation_vector(times[:, None] * inverse_moments * start)
    if not uniform.all():
        quats[~uniform] = _quaternion(inverse_moments, start[~uniform], times[~uniform], p[~uniform], q[~uniform])
    return quats


def exponential_fields(inverse_moments: Array, start: Array, times: Array, attitude: Array, slope: Array) -> Array:
    """Y with delta R = hat(Y delta Pi) R, the derivative of R(t) by Pi(0) in inertial axes: -> (N, 3, 3).

    With the attitude and the derivative of the momentum's flow, `slope`, everything is in closed form:
    R delta Pi(t) = delta Pi + Pi x y gives the part of y across Pi, Gauss's lemma y.Pi = t u.delta Pi the one along it,

        Y = (t Pi u^T − hat(Pi)(R dPi(t)/dPi − 1))/|Pi|².

    For turns below 0.02 rad the difference would lose two digits, and Y is the integral of R a dPi(t)/dPi, for which
    Gauss's rule of six nodes is right to rounding.
    """
    magnitude = np.linalg.norm(start, axis=-1)
    small = magnitude * np.abs(times) * inverse_moments[0] < 0.02
    fields = np.empty((*start.shape, 3))
    if small.any():
        fields[small] = _small_fields(inverse_moments, start[small], times[small])
    large = ~small
    if large.any():
        unit = start[large] / magnitude[large, None]
        change = attitude[large] @ slope[large] - np.eye(3)
        along = times[large, None, None] * _outer(unit, inverse_moments * start[large])
        fields[large] = (along - so3.hat(unit) @ change) / magnitude[large, None, None]
    return fields


def exponential_derivative(inverse_moments: Array, start: Array, times: Array) -> Array:
    """Z with delta R = R hat(Z delta Pi), body axes: (3,) descending, (N, 3), (N,) -> (N, 3, 3)."""
    attitude = attitude_flow(inverse_moments, start, times)
    slope = momentum_flow(inverse_moments, start, times)[1]
    return so3.transpose(attitude) @ exponential_fields(inverse_moments, start, times, attitude, slope)


def _small_fields(inverse_moments: Array, start: Array, times: Array) -> Array:
    fields = np.zeros((*start.shape, 3))
    for node, weight in zip(*np.polynomial.legendre.leggauss(6)):
        instants = 0.5 * (1.0 + node) * times
        rates = inverse_moments[:, None] * momentum_flow(inverse_moments, start, instants)[1]
        fields += (0.5 * weight * times)[:, None, None] * (attitude_flow(inverse_moments, start, instants) @ rates)
    return fields


def differences(inverse_moments: Array) -> Array:
    """delta_i = a_k − a_j, i j k in cyclic order, of Pi_i' = delta_i Pi_j Pi_k: (3,) -> (3,).

    Only the second is above 0 for descending a_i.
    """
    a = inverse_moments
    return np.array([a[2] - a[1], a[0] - a[2], a[1] - a[0]])


def _conserved(inverse_moments: Array, momentum: Array) -> tuple[Array, Array]:
    """P and Q, both 0 or more."""
    d1, d2, d3 = differences(inverse_moments)
    x, y, z = (momentum**2).T
    return d1 * (d3 * y - d2 * z), d3 * (d1 * y - d2 * x)


def _separation(inverse_moments: Array, momentum: Array) -> Array:
    """P − Q, to all digits."""
    d1, d2, d3 = differences(inverse_moments)
    third, first = np.sqrt(-d1) * momentum[:, 2], np.sqrt(-d3) * momentum[:, 0]
    return d2 * (third - first) * (third + first)


def _step_functions(
    inverse_moments: Array, start: Array, p: Array, q: Array, times: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """S, c, d and the derivatives of S by P and Q."""
    largest = np.maximum(p, q)
    rate = np.sqrt(np.where(largest > 0.0, largest, 1.0))
    separation = _separation(inverse_moments, start)
    complement = np.minimum(np.abs(separation) / rate**2, 1.0)
    sn, cn, dn, _ = elliptic.jacobi(rate * times, complement)
    s = np.where(largest > 0.0, sn / rate, times)
    third = separation >= 0.0
    c = np.where(largest > 0.0, np.where(third, cn, dn), 1.0)
    d = np.where(largest > 0.0, np.where(third, dn, cn), 1.0)
    slope = -c * d * s**3 / 6.0
    return s, c, d, slope * elliprd(d * d, 1.0, c * c), slope * elliprd(c * c, 1.0, d * d)


def _addition(
    inverse_moments: Array, momentum: Array, s: Array, c: Array, d: Array, s_p: Array, s_q: Array
) -> tuple[Array, Array]:
    """One step of the rational map and its derivative."""
    d1, d2, d3 = differences(inverse_moments)
    x, y, z = momentum.T
    p, q = _conserved(inverse_moments, momentum)
    zero = np.zeros_like(x)
    grad_p = 2.0 * d1 * np.stack([zero, d3 * y, -d2 * z], axis=-1)
    grad_q = 2.0 * d3 * np.stack([-d2 * x, d1 * y, zero], axis=-1)
    grad_s = s_p[:, None] * grad_p + s_q[:, None] * grad_q
    grad_c = -((s * s)[:, None] * grad_p + (2.0 * p * s)[:, None] * grad_s) / (2.0 * c)[:, None]
    grad_d = -((s * s)[:, None] * grad_q + (2.0 * q * s)[:, None] * grad_s) / (2.0 * d)[:, None]
    denominator = 1.0 - d1 * d3 * (y * s) ** 2
    end = np.stack([x * c + d1 * y * z * s * d, y * c * d + d2 * z * x * s, z * d + d3 * x * y * s * c], axis=-1)
    end /= denominator[:, None]
    explicit = np.stack(
        [c, d1 * z * s * d, d1 * y * s * d, d2 * z * s, c * d, d2 * x * s, d3 * y * s * c, d3 * x * s * c, d], axis=-1
    ).reshape(-1, 3, 3)
    by_s = np.stack([d1 * y * z * d, d2 * z * x, d3 * x * y * c], axis=-1)
    by_c = np.stack([x, y * d, d3 * x * y * s], axis=-1)
    by_d = np.stack([d1 * y * z * s, y * c, z], axis=-1)
    grad_denominator = (
        -2.0 * d1 * d3 * ((y * s * s)[:, None] * np.array([0.0, 1.0, 0.0]) + (y * y * s)[:, None] * grad_s)
    )
    jacobian = (
        explicit + _outer(by_s, grad_s) + _outer(by_c, grad_c) + _outer(by_d, grad_d) - _outer(end, grad_denominator)
    )
    return end, jacobian / denominator[:, None, None]


def _quaternion(inverse_moments: Array, start: Array, times: Array, p: Array, q: Array) -> Array:
    """The attitude of momenta that circle an axis, as in `EulerTop`."""
    d1, d2, d3 = differences(inverse_moments)
    # Next to the axis of the middle moment P and Q are equal when rounded, and their difference is not.
    separation = _separation(inverse_moments, start)
    third = separation >= 0.0
    sense = np.where(third, 1.0, -1.0)
    rate = np.sqrt(np.maximum(p, q))
    complement = np.minimum(np.abs(separation) / rate**2, 1.0)
    inner, outer = np.where(third, d1, d3), np.where(third, d3, d1)
    circled, other = np.where(third, 2, 0), np.where(third, 0, 2)
    rows = np.arange(len(start))
    # The amplitudes of the momentum's components: -Q/delta_3 and -P/delta_1 without the division.
    x, y, z = start.T
    near = np.where(third, d2 * x * x - d1 * y * y, d2 * z * z - d3 * y * y)
    side = np.copysign(np.sqrt(near / d2), start[rows, other])
    middle = np.copysign(np.sqrt(near / -inner), np.copysign(1.0, x) * np.copysign(1.0, z))
    moving = near > 0.0
    sine = np.where(moving, y / np.where(moving, middle, 1.0), 0.0)
    cosine = np.where(moving, start[rows, other] / np.where(moving, side, 1.0), 1.0)
    phase = elliptic.argument_of(sine, cosine, complement)
    magnitude = np.linalg.norm(start, axis=-1)
    characteristic = -outer / inner
    root = np.sqrt(1.0 - characteristic)
    axis = np.zeros((len(start), 3))
    axis[rows, circled] = np.copysign(1.0, start[rows, circled])
    top = np.sqrt(np.where(third, d2 * z * z - d3 * y * y, d2 * x * x - d1 * y * y) / d2)

    def onto_axis(u: Array) -> tuple[Array, Array]:
        """The turn of the momentum's direction onto the axis, and the swing about it."""
        sn, cn, dn, amplitude, kind = elliptic.jacobi_and_pi_excess(characteristic, u, complement)
        azimuth = amplitude + np.arctan2((root - 1.0) * sn * cn, cn * cn + root * sn * sn)
        direction = np.empty((len(start), 3))
        direction[rows, circled] = axis[rows, circled] * top * dn
        direction[rows, other] = side * cn
        direction[:, 1] = middle * sn
        direction = so3.normalised(direction)
        scalar = 1.0 + np.sum(direction * axis, axis=-1, keepdims=True)
        turn = so3.normalised(np.concatenate([np.cross(direction, axis), scalar], axis=-1))
        return turn, sense * (d2 * magnitude / rate * kind - azimuth)

    before, first = onto_axis(phase)
    after, last = onto_axis(rate * times + phase)
    half = 0.5 * (magnitude * inverse_moments[1] * times + last - first)
    about = np.concatenate([np.sin(half)[:, None] * axis, np.cos(half)[:, None]], axis=-1)
    return so3.quat_product(so3.quat_product(so3.quat_inverse(before), about), after)


def _outer(column: Array, row: Array) -> Array:
    return column[:, :, None] * row[:, None, :]
