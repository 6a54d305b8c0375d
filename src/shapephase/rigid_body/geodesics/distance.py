"""Distances of left-invariant metrics on SO(3), by shooting from many starts at once.

Every shortest geodesic ends at or before its first conjugate point. So the starts are momenta in all directions, scaled
to fractions of their conjugate times or of the largest distance possible, and each is led to the attitude by
Levenberg-Marquardt steps with the exact differential of the exponential map. The shortest geodesic among those that
arrive is the distance, if none was missed. For two equal moments the known cut time decides whether one was; for three
different ones the distances of the next smaller and the next larger axisymmetric metric bound it.

As the largest moment I_3 goes to infinity, the square of the distance falls short of the sub-Riemannian one by the
integral of Pi_3² over the shortest geodesic, in a unit of time, over I_3.

Sources: theory.md section 7, Q6; Podobryaev and Sachkov 2016 for the cut times.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import check_object
from ...arrays import Array
from ...display import short_repr
from ...errors import AccuracyNotReached, ShapeError
from ._momentum_flow import attitude_flow, exponential_derivative
from .axisymmetric_cut import axisymmetric_metric
from .left_invariant import LeftInvariantMetric

_FRACTIONS = (0.25, 0.5, 0.75, 0.95)
"""Where along each direction the starts are, in parts of the way to its conjugate point, which stays excluded."""
_ROUNDS = (48, 384)
"""Directions of the first search, and of the second where that finds nothing as short as the upper bound."""
_STEPS = 60
"""Levenberg-Marquardt steps; Newton's last few square the error, the others only have to reach their basin."""
_CLOSE = 1e-9
"""[rad] Arrived: what the next step would leave is rounding. At conjugate points the error shrinks no further."""
_ROUNDING = 1e-15
"""[rad] An attitude is no better known."""
_MARGIN = 1e-7
"""By so much, in parts, a length may be above its upper bound, or an end past the cut, for rounding."""
_FIRST_DAMPING = 1e-2
"""Of the mean square of the differential: near Newton's step, but bounded where the differential is singular."""
_LEAST_DAMPING = 1e-16
_LARGEST_DAMPING = 1e6
_HOPELESS_DAMPING = 1e5
"""Above it a start is given up: ten steps in a row, each a tenth of the last, did not come closer."""
_FIRST_AXIS_LAST = [1, 2, 0]
"""A cyclic order of the axes, so right-handed, with that of the smallest moment as third."""


@dataclass(frozen=True, eq=False)
class ShortestGeodesic:
    """The shortest geodesic found from the identity to an attitude, see `shortest_geodesic`.

    Attributes
    ----------
    momentum : (3,) with which it arrives at t = 1, body axes [kg m^2/s]
    length : the distance [sqrt(kg) m]
    certified : whether it is proven to be the shortest: the metric is axisymmetric, and the end not past the cut
    lower_bound, upper_bound : distances of axisymmetric metrics below and above this one [sqrt(kg) m]
    residual : angle by which the end misses the attitude [rad]

    Examples
    --------
    >>> from shapephase.rigid_body import geodesics
    >>> metric = geodesics.left_invariant_metric([1.0, 1.0, 1.0])
    >>> found = geodesics.shortest_geodesic(metric, sp.so3.exp(np.array([0.3, 0.0, 0.4])))
    >>> print(found.momentum.round(6))
    [0.3 0.  0.4]
    """

    momentum: Array
    length: float
    certified: bool
    lower_bound: float
    upper_bound: float
    residual: float

    __repr__ = short_repr


def shortest_geodesic(metric: LeftInvariantMetric, attitude: ArrayLike) -> ShortestGeodesic:
    """The shortest geodesic from the identity to an attitude (3, 3).

    By left invariance that from R_0 to R_1 is R_0 times the one to R_0^T R_1. At points of the cut locus one of several
    is found; where the point is also conjugate, as turns about the forbidden axis are, it is right to about 1e-9.

    Raises
    ------
    ShapeError
        If the attitude is no rotation (3, 3).
    AccuracyNotReached
        If no geodesic arrives that is as short as the upper bound says.

    Notes
    -----
    Source: theory.md Q6.

    Examples
    --------
    >>> from shapephase.rigid_body import geodesics
    >>> metric = geodesics.left_invariant_metric([1.0, 1.0, 1.0])
    >>> found = geodesics.shortest_geodesic(metric, sp.so3.exp(np.array([0.3, 0.0, 0.4])))
    >>> print(f"{found.length:.9f}")
    0.500000000
    """
    check_object(metric, "LeftInvariantMetric", "metric")
    matrix = so3.rotation_argument(attitude, "attitude")
    if matrix.shape != (3, 3):
        raise ShapeError(f"attitude: one rotation (3, 3) is needed, got {matrix.shape}; call it for each of them")
    target = metric.axes.T @ matrix @ metric.axes
    lower, upper = _bounds(metric, target)
    momentum, length, residual = np.zeros(3), 0.0, float(so3.angle(target))
    for count in _ROUNDS if residual > _ROUNDING else ():
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


def nearest_attitude(metric: LeftInvariantMetric, attitudes: ArrayLike) -> tuple[int, ShortestGeodesic]:
    """The attitude of a set that is nearest to the identity, and the shortest geodesic there: the distance to the set.

    A set may be attitudes that look the same, such as those of a symmetric body, or many samples of a curve of goals.
    Distances of axisymmetric metrics bound those to each from below, so that few of them are searched for.

    Parameters
    ----------
    metric : of `left_invariant_metric`
    attitudes : (N, 3, 3), one or more

    Returns
    -------
    its number in the set, and its `ShortestGeodesic`

    Raises
    ------
    ShapeError, AccuracyNotReached
        As `shortest_geodesic`; if there is no attitude.

    Examples
    --------
    >>> from shapephase.rigid_body import geodesics
    >>> metric = geodesics.left_invariant_metric([1.0, 2.0, 3.0])
    >>> same = sp.so3.exp(np.array([[0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0 - np.pi]]))
    >>> number, found = geodesics.nearest_attitude(metric, same)
    >>> print(number, f"{found.length:.6f}")
    1 1.414214
    """
    check_object(metric, "LeftInvariantMetric", "metric")
    matrices = so3.rotation_argument(attitudes, "attitudes")
    if matrices.ndim != 3 or not len(matrices):
        raise ShapeError(f"attitudes: one or more rotations (N, 3, 3) are needed, got {matrices.shape}")
    lower = np.array([_bounds(metric, metric.axes.T @ matrix @ metric.axes)[0] for matrix in matrices])
    order = np.argsort(lower, kind="stable")
    best = int(order[0])
    nearest = shortest_geodesic(metric, matrices[best])
    for number in order[1:]:
        if lower[number] >= nearest.length:
            break
        other = shortest_geodesic(metric, matrices[number])
        if other.length < nearest.length:
            best, nearest = int(number), other
    return best, nearest


def _shortest_arrival(
    metric: LeftInvariantMetric, target: Array, count: int, upper: float
) -> tuple[Array, float, float]:
    """The shortest of those that arrive from `count` directions; of infinite length if there is none."""
    inverse = metric.inverse_moments
    momenta, residuals = _arrivals(inverse, _starts(metric, count, upper), target)
    lengths = np.where(residuals < _CLOSE, np.sqrt(np.sum(inverse * momenta**2, axis=-1)), np.inf)
    best = int(np.argmin(lengths))
    return momenta[best], float(lengths[best]), float(residuals[best])


def _starts(metric: LeftInvariantMetric, count: int, upper: float) -> Array:
    """Momenta in principal axes, in all directions and at times before the conjugate one and the upper bound.

    Denser round the axis of the largest moment: more of the geodesics along it reach a given distance.
    """
    number = np.arange(count) + 0.5
    tilt, turn = np.pi * number / count, np.pi * (1.0 + np.sqrt(5.0)) * number
    momenta = np.stack([np.sin(tilt) * np.sin(turn), -np.sin(tilt) * np.cos(turn), np.cos(tilt)], axis=-1)
    in_body = momenta @ metric.axes.T
    latest = np.minimum(metric.conjugate_time(in_body), 1.05 * upper / metric.speed(in_body))
    return np.concatenate([(fraction * latest)[:, None] * momenta for fraction in _FRACTIONS])


def _arrivals(inverse_moments: Array, momenta: Array, target: Array) -> tuple[Array, Array]:
    """Where the steps lead from every start: momenta, and the angle between their ends and the target [rad]."""
    times = np.ones(len(momenta))
    momenta = momenta.copy()
    # No shortest geodesic has more momentum than takes it to its conjugate point; half as much again is room for steps.
    largest = 1.5 * float(np.linalg.norm(momenta, axis=-1).max())
    errors = _rotation_errors(inverse_moments, momenta, target)
    angles = np.linalg.norm(errors, axis=-1)
    damping = np.full(len(momenta), _FIRST_DAMPING)
    rows = np.arange(len(momenta))
    derivative = exponential_derivative(inverse_moments, momenta, times)
    for _ in range(_STEPS):
        z = derivative[rows]
        normal = so3.transpose(z) @ z
        scale = np.trace(normal, axis1=-2, axis2=-1) / 3.0
        normal += (damping[rows] * scale)[:, None, None] * np.eye(3)
        step = np.linalg.solve(normal, so3.transpose(z) @ errors[rows][..., None])[..., 0]
        trial = momenta[rows] + step
        length = np.linalg.norm(trial, axis=-1, keepdims=True)
        trial *= np.minimum(1.0, largest / np.maximum(length, largest))
        error = _rotation_errors(inverse_moments, trial, target)
        angle = np.linalg.norm(error, axis=-1)
        better = angle < angles[rows]
        taken = rows[better]
        momenta[taken], errors[taken], angles[taken] = trial[better], error[better], angle[better]
        derivative[taken] = exponential_derivative(inverse_moments, momenta[taken], times[taken])
        changed = np.where(better, 0.1 * damping[rows], 10.0 * damping[rows])
        damping[rows] = np.clip(changed, _LEAST_DAMPING, _LARGEST_DAMPING)
        rows = rows[(angles[rows] > _ROUNDING) & (damping[rows] < _HOPELESS_DAMPING)]
        if not rows.size:
            break
    return momenta, angles


def _rotation_errors(inverse_moments: Array, momenta: Array, target: Array) -> Array:
    """Rotation vectors from where the momenta lead in a unit of time to the target."""
    reached = attitude_flow(inverse_moments, momenta, np.ones(len(momenta)))
    return so3.log(so3.transpose(reached) @ target)


def _before_cut(metric: LeftInvariantMetric, momentum: Array) -> bool:
    """Whether an arrival at t = 1 is proven to be the shortest."""
    smallest, middle, largest = metric.moments
    if middle == largest:
        symmetric = axisymmetric_metric(largest, smallest)
        return bool(symmetric.cut_time(momentum[_FIRST_AXIS_LAST]) >= 1.0 - _MARGIN)
    if smallest == middle:
        return bool(axisymmetric_metric(middle, largest).cut_time(momentum) >= 1.0 - _MARGIN)
    return False


def _bounds(metric: LeftInvariantMetric, target: Array) -> tuple[float, float]:
    """Distances of axisymmetric metrics that are nowhere longer, and nowhere shorter."""
    smallest, middle, largest = metric.moments.tolist()
    turned = target[np.ix_(_FIRST_AXIS_LAST, _FIRST_AXIS_LAST)]

    def about_smallest(moment: float) -> float:
        return float(axisymmetric_metric(moment, smallest).distance(turned))

    def about_largest(moment: float) -> float:
        return float(axisymmetric_metric(moment, largest).distance(target))

    lower, upper = max(about_smallest(middle), about_largest(smallest)), about_largest(middle)
    return lower, min(upper, about_smallest(largest)) if np.isfinite(largest) else upper
