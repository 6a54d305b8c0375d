"""Distances of left-invariant metrics on SO(3), by shooting from many starts at once.

For two equal moments the shortest geodesic is known in closed form. For three different ones the distances of the next
smaller and the next larger axisymmetric metric bound it, and it is searched for: momenta of all directions and several
sizes are led to the attitude by Levenberg-Marquardt steps with the exact differential of the exponential map. The
shortest geodesic among those that arrive is the distance, if none was missed; the search is repeated with starts that
are scaled to it, until it finds nothing shorter.

A way of length L turns by up to L/sqrt(I_1) and L/sqrt(I_2) about the first two axes, and about the third by
L/sqrt(I_3) or, as a loop of the other two turns, by L²/(4 pi sqrt(I_1 I_2)). Its momenta are up to L sqrt(I_i), and
along the third axis up to 2 pi/sqrt((a_1 − a_3)(a_2 − a_3)), with which such a loop closes however short it is. Starts
and steps are scaled by these sizes: without that, short ways along stiff or forbidden directions are missed.

When the largest moment I_3 goes to infinity, the square of the distance falls short of the sub-Riemannian one by the
integral of Pi_3² over the shortest geodesic, in a unit of time, over I_3.

Sources: theory.md section 7, Q6; Podobryaev and Sachkov 2016 for the cut times.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ... import so3, sphere
from ...arguments import check_object, number_argument, whole_argument
from ...arrays import Array
from ...display import short_repr
from ...errors import AccuracyNotReached, ShapeError
from ._arrival_search import Goal, first_arrival
from ._momentum_flow import exponential_derivative, quaternion_flow
from .axisymmetric_cut import AxisymmetricMetric, axisymmetric_metric
from .left_invariant import LeftInvariantMetric

_FEW, _MANY = 48, 384  # directions of a search, and of the last where it finds nothing as short as the upper bound
_STEPS = 60  # of Levenberg and Marquardt; the last few square the error, the others have to reach their basin
_CLOSE = 1e-9  # relative: of residuals of an arrival, where the next step squares them, and of different lengths
MOST_CELLS = 400_000  # of the proof that nothing shorter arrives: some ten seconds of processor time
_ROUNDING = 1e-15  # [rad] of an attitude
_MARGIN = 1e-7  # relative, by which rounding may put a length above its upper bound, or an end past the cut
_FIRST_AXIS_LAST = [1, 2, 0]  # a cyclic order of the axes, so right-handed, with that of the smallest moment as third


@dataclass(frozen=True, eq=False)
class ShortestGeodesic:
    """Shortest geodesic found from the identity to an attitude. Made by `shortest_geodesic`."""

    momentum: Array
    """(3,) with which it arrives at t = 1, body axes [kg m^2/s]."""
    length: float
    """The distance [sqrt(kg) m]."""
    certified: bool
    """Whether it is proven to be the shortest: the metric is axisymmetric, and the end not past the cut. With a width,
    whether nothing is shorter than `length` by more than this part of it."""
    lower_bound: float  #: Distance of an axisymmetric metric below this one [sqrt(kg) m].
    upper_bound: float
    """Distance of one above it. With a width, both bounds are those of `distance_enclosure` [sqrt(kg) m]."""
    residual: float
    """Angle by which the end misses the attitude [rad]."""

    __repr__ = short_repr


def shortest_geodesic(
    metric: LeftInvariantMetric, attitude: ArrayLike, *, width: float | None = None, most_cells: int = MOST_CELLS
) -> ShortestGeodesic:
    """The shortest geodesic from the identity to an attitude (3, 3).

    By left invariance that from R_0 to R_1 is R_0 times the one to R_0^T R_1. At points of the cut locus one of several
    is found. For three different moments nothing proves that none was missed, and where the way turns more than once
    about the axis of the smallest moment, longer than 2 pi sqrt(I_1), many geodesics have nearly equal length: there a
    shorter one may have been. A width asks for the proof (`certified`), that of `distance_enclosure`.

    Source: theory.md Q6.

    Raises AccuracyNotReached if no geodesic arrives that is as short as the upper bound; ShapeError if width is not
    between 0 and 1 or most_cells below 1.

    Examples
    --------
    >>> metric = sp.rigid_body.geodesics.left_invariant_metric([1.0, 1.0, 1.0])
    >>> found = sp.rigid_body.geodesics.shortest_geodesic(metric, sp.so3.exp(np.array([0.3, 0.0, 0.4])))
    >>> print(f"{found.length:.9f}")
    0.500000000
    """
    goal = goal_of(metric, attitude)
    found = found_geodesic(metric, goal)
    if width is None:
        return found
    lower, upper, _ = proven_bounds(
        metric, goal, found, width_argument(width), whole_argument(most_cells, "most_cells", 1)
    )
    return replace(found, lower_bound=lower, upper_bound=upper, certified=upper - lower <= width * upper)


def width_argument(width: float) -> float:
    """A relative width above 0 and below 1. Raises ShapeError for another one."""
    part = number_argument(width, "width")
    if not 0.0 < part < 1.0:
        raise ShapeError(f"width: a part of the distance or time is needed, between 0 and 1, such as 1e-3; got {part}")
    return part


def goal_of(metric: LeftInvariantMetric, attitude: ArrayLike) -> Goal:
    """One attitude (3, 3) in principal axes."""
    check_object(metric, "LeftInvariantMetric", "metric")
    matrix = so3.rotation_argument(attitude, "attitude")
    if matrix.shape != (3, 3):
        raise ShapeError(f"attitude: one rotation (3, 3) is needed, got {matrix.shape}; call it for each of them")
    return Goal(quat=so3.quat_from_matrix(metric.axes.T @ matrix @ metric.axes), on_su2=False)


def found_geodesic(metric: LeftInvariantMetric, goal: Goal) -> ShortestGeodesic:
    """The shortest geodesic of the closed form, or of those that the search finds."""
    lower, upper = axial_bounds(metric, goal)
    closed, order = axial_form(metric)
    momentum, length, residual = np.zeros(3), 0.0, float(np.linalg.norm(goal.vector))
    if residual > _ROUNDING:
        if closed is None:
            momentum = _searched(metric, goal, upper)
        else:
            quat = goal.on_axes(order)
            momentum[order] = (
                closed.shortest_momentum_on_su2(quat)
                if goal.on_su2
                else closed.shortest_momentum(so3.matrix_from_quat(quat))
            )
        length = float(np.sqrt(np.sum(metric.inverse_moments * momentum**2)))
        residual = float(np.linalg.norm(_rotation_errors(metric.inverse_moments, momentum[None], goal)))
    certified = not length
    if length and closed is not None:
        cut = closed.cut_time_on_su2 if goal.on_su2 else closed.cut_time
        certified = bool(cut(momentum[order]) >= 1.0 - _MARGIN)
    return ShortestGeodesic(
        momentum=metric.axes @ momentum,
        length=length,
        certified=certified,
        lower_bound=lower,
        upper_bound=upper,
        residual=residual,
    )


def proven_bounds(
    metric: LeftInvariantMetric, goal: Goal, found: ShortestGeodesic, width: float, most: int
) -> tuple[float, float, int]:
    """Bounds of the distance that differ by the part `width` if `most` cells suffice, and the cells' number."""
    # About a forbidden axis the residual alone counts: the gap of any rounding is a long loop.
    rounding = _ROUNDING * float(np.sqrt(metric.moments[np.isfinite(metric.moments)][-1])) if found.length else 0.0
    upper = found.length + gap(metric, found.residual) + rounding
    if found.certified:
        return max(found.length * (1.0 - _MARGIN * width) - rounding, 0.0), upper, 0
    stop = upper * (1.0 - width * (1.0 - _MARGIN))
    begin = max(found.lower_bound * (1.0 - _CLOSE) - rounding, 0.0)
    if not 0.0 < begin < stop:
        return begin, upper, 0
    search = first_arrival(metric.inverse_moments, goal, begin, stop, most)
    return search.time, upper, search.work


def gap(metric: LeftInvariantMetric, residual: float) -> float:
    """Largest distance of attitudes that differ by a small angle."""
    _, middle, largest = metric.moments
    # Across the forbidden axis, and a loop for the turn about it.
    bent = np.sqrt(middle) * (residual + np.sqrt(8.0 * np.pi * residual))
    return float(min(np.sqrt(largest) * residual, bent) if np.isfinite(largest) else bent)


def nearest_attitude(metric: LeftInvariantMetric, attitudes: ArrayLike) -> tuple[int, ShortestGeodesic]:
    """Index of the attitude of a set that is nearest to the identity, and the shortest geodesic there.

    A set may be equivalent attitudes, such as those of a symmetric body, or many samples of a curve of goals.
    Distances of axisymmetric metrics bound those to each from below, so that few of them are searched for.

    Raises ShapeError, AccuracyNotReached like `shortest_geodesic`; if there is no attitude.

    Parameters
    ----------
    metric : of `left_invariant_metric`
    attitudes : (N, 3, 3), one or more

    Examples
    --------
    >>> metric = sp.rigid_body.geodesics.left_invariant_metric([1.0, 2.0, 3.0])
    >>> same = sp.so3.exp(np.array([[0.0, 0.0, 2.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0 - np.pi]]))
    >>> number, found = sp.rigid_body.geodesics.nearest_attitude(metric, same)
    >>> print(number, f"{found.length:.6f}")
    1 1.414214
    """
    check_object(metric, "LeftInvariantMetric", "metric")
    matrices = so3.rotation_argument(attitudes, "attitudes")
    if matrices.ndim != 3 or not len(matrices):
        raise ShapeError(f"attitudes: one or more rotations (N, 3, 3) are needed, got {matrices.shape}")
    lower = np.array([axial_bounds(metric, goal_of(metric, matrix))[0] for matrix in matrices])
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


def axial_form(metric: LeftInvariantMetric) -> tuple[AxisymmetricMetric | None, list[int]]:
    """The closed form of a metric with two equal moments, else None, and the axes with that of symmetry as third."""
    smallest, middle, largest = metric.moments.tolist()
    if smallest == middle:
        return axisymmetric_metric(middle, largest), [0, 1, 2]
    return axisymmetric_metric(largest, smallest) if middle == largest else None, _FIRST_AXIS_LAST


def _searched(metric: LeftInvariantMetric, goal: Goal, upper: float) -> Array:
    """The momentum of the shortest geodesic that arrives, for three different moments. Raises AccuracyNotReached."""
    first, middle, largest = metric.moments.tolist()
    # Near the identity the metric is, in scaled turns, that of two equal moments.
    mean = np.sqrt(first * middle)
    scaled = goal.vector * np.sqrt([first / mean, middle / mean, 1.0])
    near = float(np.linalg.norm(scaled)) < 0.5 * np.pi
    expected = float(axisymmetric_metric(mean, largest).distance(so3.exp(scaled))) if near else upper
    best = _shortest_arrival(metric, goal, _FEW, min(expected, upper))
    # Starts are scaled to the last length; the second search rarely finds anything shorter.
    for _ in range(4):
        other = _shortest_arrival(metric, goal, _FEW, min(best[1], upper))
        improved = other[1] < best[1] * (1.0 - _CLOSE)
        best = other if other[1] < best[1] else best
        if not improved:
            break
    most = upper * (1.0 + _MARGIN + _ROUNDING / _reach(metric, upper).min())
    if best[1] > most:
        best = min(best, _shortest_arrival(metric, goal, _MANY, upper), key=lambda arrival: arrival[1])
    if best[1] > most:
        raise AccuracyNotReached(
            f"distance: the shortest geodesic found has the length {best[1]:.9g}, but the distance is at most "
            f"{upper:.9g}; try an attitude nearby"
        )
    # To rounding: the shortest of many arrivals is one that stops a little short.
    start = best[0] / _largest_momenta(metric, best[1])
    return _arrivals(metric, start[None], goal, best[1], missed=0.0)[0][0]


def _shortest_arrival(metric: LeftInvariantMetric, goal: Goal, count: int, length: float) -> tuple[Array, float]:
    """The shortest of those that arrive from `count` directions at lengths like this; infinite if there is none."""
    momenta, residuals = _arrivals(metric, _starts(count), goal, length)
    close = _CLOSE + _ROUNDING / _reach(metric, length).min()
    lengths = np.where(residuals < close, np.sqrt(np.sum(metric.inverse_moments * momenta**2, axis=-1)), np.inf)
    best = int(np.argmin(lengths))
    return momenta[best], float(lengths[best])


def arrival_near(metric: LeftInvariantMetric, start: Array, goal: Goal) -> tuple[Array, float, float]:
    """The momentum that the steps reach from one, its length, and by which angle it misses the goal."""
    length = float(np.sqrt(np.sum(metric.inverse_moments * start**2)))
    momenta, _ = _arrivals(metric, (start / _largest_momenta(metric, length))[None], goal, length)
    missed = float(np.linalg.norm(_rotation_errors(metric.inverse_moments, momenta, goal)))
    return momenta[0], float(np.sqrt(np.sum(metric.inverse_moments * momenta[0] ** 2))), missed


def _starts(count: int) -> Array:
    """Momenta in units of the largest along each axis: all directions, up to sqrt(2), where a loop closes."""
    directions = sphere.fibonacci_directions(count)
    return np.concatenate([fraction * directions for fraction in np.sqrt(2.0) / 4.0 * np.array([1, 2, 3, 4])])


def _reach(metric: LeftInvariantMetric, length: float) -> Array:
    """Largest turns about the principal axes by ways of this length: (3,) [rad]."""
    first, middle, _ = metric.moments
    straight = length * np.sqrt(metric.inverse_moments)
    straight[2] = max(straight[2], length * length / (4.0 * np.pi * np.sqrt(first * middle)))
    return np.minimum(straight, np.pi)


def _largest_momenta(metric: LeftInvariantMetric, length: float) -> Array:
    """Along each principal axis, of shortest ways of this length in a unit of time: (3,) [kg m^2/s]."""
    first, middle, third = metric.inverse_moments
    # A way that turns further than half round the first axis comes to itself with more momentum than a small loop.
    loop = 2.0 * np.pi / np.sqrt((first - third) * (middle - third)) * max(1.0, length * np.sqrt(first) / np.pi)
    return np.append(length * np.sqrt(metric.moments[:2]), min(length * np.sqrt(metric.moments[2]), loop))


def _arrivals(
    metric: LeftInvariantMetric, starts: Array, goal: Goal, length: float, missed: float = _ROUNDING
) -> tuple[Array, Array]:
    """Momenta that the steps reach from every start, and the errors of their ends relative to `_reach`.

    Steps end where an attitude is missed by no more than `missed` [rad].
    """
    inverse_moments, units = metric.inverse_moments, _largest_momenta(metric, length)
    weights = 1.0 / _reach(metric, length)
    times, momenta = np.ones(len(starts)), starts * units
    # Half as much again as the longest start is room for steps.
    largest = 1.5 * float(np.linalg.norm(starts, axis=-1).max())
    errors = _rotation_errors(inverse_moments, momenta, goal) * weights
    sizes = np.linalg.norm(errors, axis=-1)
    # Relative to the mean square of the differential: near Newton's step, but bounded where that is singular. Above 1e5
    # a start is given up: several steps in a row, each a tenth of the last, did not come closer.
    damping = np.full(len(momenta), 1e-2)
    rows = np.arange(len(momenta))
    derivative = exponential_derivative(inverse_moments, momenta, times)
    for _ in range(_STEPS):
        z = weights[:, None] * derivative[rows] * units
        normal = so3.transpose(z) @ z
        scale = np.trace(normal, axis1=-2, axis2=-1) / 3.0
        normal += (damping[rows] * scale)[:, None, None] * np.eye(3)
        step = np.linalg.solve(normal, so3.transpose(z) @ errors[rows][..., None])[..., 0]
        trial = _bent_step(momenta[rows] / units, step)
        norms = np.linalg.norm(trial, axis=-1, keepdims=True)
        trial *= units * np.minimum(1.0, largest / np.maximum(norms, largest))
        error = _rotation_errors(inverse_moments, trial, goal) * weights
        apart = np.linalg.norm(error, axis=-1)
        better = apart < sizes[rows]
        taken = rows[better]
        momenta[taken], errors[taken], sizes[taken] = trial[better], error[better], apart[better]
        derivative[taken] = exponential_derivative(inverse_moments, momenta[taken], times[taken])
        changed = np.where(better, 0.1 * damping[rows], 10.0 * damping[rows])
        damping[rows] = np.maximum(changed, np.finfo(float).eps)
        rows = rows[(sizes[rows] > missed * weights.max()) & (damping[rows] < 1e5)]
        if not rows.size:
            break
    return momenta, sizes


def _bent_step(start: Array, step: Array) -> Array:
    """Ends of steps that turn about the third axis instead of going straight across: (N, 3), (N, 3) -> (N, 3).

    Loops that begin in different directions of the first two axes end almost together, so that the errors have a valley
    round a circle, along which straight steps would have to be tiny.
    """
    flat = start[:, :2]
    radius = np.linalg.norm(flat, axis=-1)
    safe = np.where(radius > 0.0, radius, 1.0)
    out = flat / safe[:, None]
    across = np.stack([-out[:, 1], out[:, 0]], axis=-1)
    along, aside = np.sum(step[:, :2] * out, axis=-1), np.sum(step[:, :2] * across, axis=-1)
    angle = aside / safe
    bent = (radius + along)[:, None] * (np.cos(angle)[:, None] * out + np.sin(angle)[:, None] * across)
    short = (np.abs(aside) < radius)[:, None]
    return np.concatenate([np.where(short, bent, flat + step[:, :2]), start[:, 2:] + step[:, 2:]], axis=-1)


def _rotation_errors(inverse_moments: Array, momenta: Array, goal: Goal) -> Array:
    """Rotation vectors from where the momenta lead in a unit of time to the target."""
    return goal.errors(quaternion_flow(inverse_moments, momenta, np.ones(len(momenta))))


def axial_bounds(metric: LeftInvariantMetric, goal: Goal) -> tuple[float, float]:
    """Distances of axisymmetric metrics that are nowhere longer, and nowhere shorter."""
    smallest, middle, largest = metric.moments.tolist()

    def distance(equatorial: float, axial: float, order: list[int]) -> float:
        closed, quat = axisymmetric_metric(equatorial, axial), goal.on_axes(order)
        return float(closed.distance_on_su2(quat) if goal.on_su2 else closed.distance(so3.matrix_from_quat(quat)))

    about_largest = [0, 1, 2]
    lower = max(distance(middle, smallest, _FIRST_AXIS_LAST), distance(smallest, largest, about_largest))
    upper = distance(middle, largest, about_largest)
    return lower, min(upper, distance(largest, smallest, _FIRST_AXIS_LAST)) if np.isfinite(largest) else upper
