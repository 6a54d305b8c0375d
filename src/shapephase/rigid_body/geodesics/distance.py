"""Distances of left-invariant metrics on SO(3), by shooting from many starts at once.

Every shortest geodesic ends at or before its first conjugate point. So the starts are momenta in all directions, cut at
fractions of their own conjugate times or of the largest distance possible, and each is led to the attitude by steps of
Levenberg and Marquardt with the exact differential of the exponential map. What is shortest among those that arrive is
the distance, if none was missed. For two equal moments the cut time is known and says so; for three different ones the
distances of the axisymmetric metrics next below and next above hold it between two bounds.

As a moment I_1 goes to infinity, the square of the distance falls short of the sub-Riemannian one by the integral of
Pi_1² over the shortest geodesic, in a unit of time, over I_1.

Sources: theory.md section 7, Q6; Podobryaev and Sachkov 2016 for the cut times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arrays import Array
from ...errors import AccuracyNotReached, ShapeError
from ._momentum_flow import attitude_flow, exponential_derivative
from .axisymmetric_cut import AxisymmetricMetric, axisymmetric_metric
from .left_invariant import LeftInvariantMetric

_FRACTIONS = (0.25, 0.5, 0.75, 0.95)
_ROUNDS = (48, 384)
_STEPS = 60
_CLOSE = 1e-9
_MARGIN = 1e-7
_ONWARD = [1, 2, 0]


@dataclass(frozen=True, eq=False)
class ShortestGeodesic:
    """The shortest geodesic found from the identity to an attitude, see `shortest_geodesic`.

    Attributes
    ----------
    momentum : (3,) with which it arrives at t = 1, body axes [kg m^2/s]
    length : the distance
    certified : whether it is proven to be the shortest: the metric is axisymmetric, and the end not past the cut
    lower_bound, upper_bound : distances of axisymmetric metrics below and above this one
    residual : angle by which the end misses the attitude [rad]
    """

    momentum: Array
    length: float
    certified: bool
    lower_bound: float
    upper_bound: float
    residual: float


def shortest_geodesic(metric: LeftInvariantMetric, attitude: ArrayLike) -> ShortestGeodesic:
    """The shortest geodesic from the identity to an attitude (3, 3).

    By left invariance that from R_0 to R_1 is R_0 times the one to R_0^T R_1. At points of the cut locus one of several
    is found; where the point is also conjugate, as turns about the forbidden axis are, to about 1e-9.

    Raises
    ------
    ShapeError
        If the attitude is no rotation (3, 3).
    AccuracyNotReached
        If no geodesic arrives that is as short as the upper bound says.

    Source: theory.md Q6.
    """
    matrix = so3.rotation_argument(attitude, "attitude")
    if matrix.shape != (3, 3):
        raise ShapeError(f"attitude: one rotation (3, 3) is needed, got {matrix.shape}; ask for each of them")
    target = metric.axes.T @ matrix @ metric.axes
    lower, upper = _bounds(metric, target)
    momentum, length, residual = np.zeros(3), 0.0, float(so3.angle(target))
    for count in _ROUNDS if residual > 1e-15 else ():
        momentum, length, residual = _shortest_arrival(metric, target, count, upper)
        if length <= upper * (1.0 + _MARGIN) + _CLOSE:
            break
    else:
        if length:
            raise AccuracyNotReached(
                f"distance: the shortest geodesic found has the length {length:.9g} and misses the attitude by "
                f"{residual:.3g} rad, but the distance is at most {upper:.9g}; try an attitude nearby"
            )
    return ShortestGeodesic(
        momentum=metric.axes @ momentum,
        length=length,
        certified=not length or _before_cut(metric, momentum),
        lower_bound=lower,
        upper_bound=upper,
        residual=residual,
    )


def _shortest_arrival(
    metric: LeftInvariantMetric, target: Array, count: int, upper: float
) -> tuple[Array, float, float]:
    """The shortest of those that arrive from so many directions; infinitely long if there is none."""
    inverse = metric.inverse_moments
    momenta, residuals = _arrivals(inverse, _starts(metric, count, upper), target)
    lengths = np.where(residuals < _CLOSE, np.sqrt(np.sum(inverse * momenta**2, axis=-1)), np.inf)
    best = int(np.argmin(lengths))
    return momenta[best], float(lengths[best]), float(residuals[best])


def _starts(metric: LeftInvariantMetric, count: int, upper: float) -> Array:
    """Momenta in principal axes, in all directions and at all times before the conjugate one and the upper bound.

    Denser round the axis of the largest moment: of the geodesics from there, more reach any one distance.
    """
    number = np.arange(count) + 0.5
    tilt, turn = np.pi * number / count, np.pi * (1.0 + np.sqrt(5.0)) * number
    momenta = np.stack([np.cos(tilt), np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn)], axis=-1)
    in_body = momenta @ metric.axes.T
    latest = np.minimum(metric.conjugate_time(in_body), 1.05 * upper / metric.speed(in_body))
    return np.concatenate([(fraction * latest)[:, None] * momenta for fraction in _FRACTIONS])


def _arrivals(inverse_moments: Array, momenta: Array, target: Array) -> tuple[Array, Array]:
    """Where the steps lead, every start by itself: momenta, and by what angle they miss the target."""
    times = np.ones(len(momenta))
    momenta = momenta.copy()
    # No shortest geodesic has more momentum than takes it to its conjugate point.
    largest = 1.5 * float(np.linalg.norm(momenta, axis=-1).max())
    misses = _missing(inverse_moments, momenta, target)
    sizes = np.linalg.norm(misses, axis=-1)
    damping = np.full(len(momenta), 1e-2)
    rows = np.arange(len(momenta))
    derivative = exponential_derivative(inverse_moments, momenta, times)
    for _ in range(_STEPS):
        z = derivative[rows]
        normal = so3.transpose(z) @ z
        scale = np.trace(normal, axis1=-2, axis2=-1) / 3.0
        normal += (damping[rows] * scale)[:, None, None] * np.eye(3)
        step = np.linalg.solve(normal, so3.transpose(z) @ misses[rows][..., None])[..., 0]
        trial = momenta[rows] + step
        length = np.linalg.norm(trial, axis=-1, keepdims=True)
        trial *= np.minimum(1.0, largest / np.maximum(length, largest))
        miss = _missing(inverse_moments, trial, target)
        size = np.linalg.norm(miss, axis=-1)
        better = size < sizes[rows]
        taken = rows[better]
        momenta[taken], misses[taken], sizes[taken] = trial[better], miss[better], size[better]
        derivative[taken] = exponential_derivative(inverse_moments, momenta[taken], times[taken])
        damping[rows] = np.clip(np.where(better, 0.1 * damping[rows], 10.0 * damping[rows]), 1e-16, 1e6)
        rows = rows[(sizes[rows] > 1e-15) & (damping[rows] < 1e5)]
        if not rows.size:
            break
    return momenta, sizes


def _missing(inverse_moments: Array, momenta: Array, target: Array) -> Array:
    reached = attitude_flow(inverse_moments, momenta, np.ones(len(momenta)))
    return so3.log(so3.transpose(reached) @ target)


def _before_cut(metric: LeftInvariantMetric, momentum: Array) -> bool:
    """Whether an arrival at t = 1 is proven to be the shortest."""
    first, middle, last = metric.moments
    if first == middle:
        return bool(axisymmetric_metric(first, last).cut_time(momentum) >= 1.0 - _MARGIN)
    if middle == last:
        return bool(axisymmetric_metric(middle, first).cut_time(momentum[_ONWARD]) >= 1.0 - _MARGIN)
    return False


def _bounds(metric: LeftInvariantMetric, target: Array) -> tuple[float, float]:
    """Distances of axisymmetric metrics that are nowhere longer, and nowhere shorter."""
    first, middle, last = metric.moments.tolist()
    about_last = [axisymmetric_metric(moment, last) for moment in (middle, first) if np.isfinite(moment)]
    about_first = [axisymmetric_metric(moment, first) for moment in (last, middle)]
    turned = target[np.ix_(_ONWARD, _ONWARD)]

    def of(which: AxisymmetricMetric, attitude: Array) -> float:
        return float(which.distance(attitude))

    lower = max(of(about_last[0], target), of(about_first[0], turned))
    upper = of(about_first[1], turned)
    return lower, min(upper, of(about_last[1], target)) if len(about_last) > 1 else upper
