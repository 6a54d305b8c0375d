"""Enclosures of distances, cut times and diameters of left-invariant metrics on SO(3) and SU(2).

For three different moments no theorem says which geodesics are the shortest. A geodesic that arrives bounds the
distance from above. From below it is bounded by a search that excludes all momenta of unit speed up to a time, cell by
cell, with bounds of how far geodesics of a cell part. Along a geodesic the same search shows up to which time no other
one arrives first. The bounds are proven but for rounding, against which they are relaxed without directed rounding.

Sources: docs/theory/geodesics.md; Bonnard, Cots and Shcherbakova 2013 for the question.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import check_object, vector_argument, whole_argument
from ...arrays import Array
from ...display import short_repr
from ...errors import ShapeError
from ._arrival_search import Goal, first_arrival
from ._momentum_flow import quaternion_flow
from ._symmetric_arrivals import all_met
from .axisymmetric_cut import axisymmetric_metric
from .distance import (
    MOST_CELLS,
    arrival_near,
    axial_bounds,
    axial_form,
    found_geodesic,
    gap,
    goal_of,
    proven_bounds,
    width_argument,
)
from .left_invariant import LeftInvariantMetric

_SHORTER = 1e-9  # relative: by less, a length differs from that of the geodesic itself only by rounding


@dataclass(frozen=True, eq=False)
class GeodesicEnclosure:
    """Bounds of a distance, a cut time or a diameter. Made by `distance_enclosure` and the functions beside it."""

    lower: float
    """No geodesic arrives that is shorter than this; or the geodesic is the shortest up to this time."""
    upper: float
    """A geodesic of this length arrives, of a diameter anywhere; or this one is not the shortest after this time."""
    certified: bool
    """Whether `upper` exceeds `lower` by no more than the requested width; else the work did not suffice."""
    momentum: Array
    """(3,) of the geodesic that arrives at t = 1 with the length `upper`, or of a shorter one to the place where the
    given one is at its upper cut time; the given one's where that is a conjugate point; of a diameter the one to the
    far attitude [kg m^2/s]."""
    cells: int
    """Work done, in evaluated cells of momenta."""

    __repr__ = short_repr

    @property
    def width(self) -> float:
        """`upper` less `lower`."""
        return self.upper - self.lower


def distance_enclosure(
    metric: LeftInvariantMetric, attitude: ArrayLike, *, width: float = 1e-3, most_cells: int = MOST_CELLS
) -> GeodesicEnclosure:
    """Bounds of the distance from the identity to an attitude (3, 3), proven but for rounding [sqrt(kg) m].

    Long ways of very different moments, and ends near conjugate points, take most cells.

    Raises ShapeError if the attitude is not one rotation, width not between 0 and 1 or most_cells below 1;
    AccuracyNotReached as `shortest_geodesic`.

    Equations :eq:`cell-deviation`, :eq:`cell-rest`, :eq:`way-left`, :eq:`climb` and :eq:`second-variation` of the
    documentation.

    Parameters
    ----------
    metric : of `left_invariant_metric`
    attitude : (3, 3)
    width : relative to the distance
    most_cells : of work; where they do not suffice the enclosure is wider

    Examples
    --------
    >>> metric = sp.rigid_body.geodesics.left_invariant_metric([1.0, 2.0, 3.0])
    >>> found = sp.rigid_body.geodesics.distance_enclosure(metric, sp.so3.exp(np.array([0.0, 0.5, 0.0])))
    >>> print(found.certified, f"{found.lower:.6f} to {found.upper:.6f}")
    True 0.707107 to 0.707107
    """
    return _distance(metric, goal_of(metric, attitude), width, most_cells)


def distance_enclosure_on_su2(
    metric: LeftInvariantMetric, quat_xyzw: ArrayLike, *, width: float = 1e-3, most_cells: int = MOST_CELLS
) -> GeodesicEnclosure:
    """Bounds of the distance from 1 to a unit quaternion (4,), where −1 is another point [sqrt(kg) m].

    Raises and takes what `distance_enclosure` does.

    Examples
    --------
    >>> metric = sp.rigid_body.geodesics.left_invariant_metric([1.0, 2.0, 3.0])
    >>> found = sp.rigid_body.geodesics.distance_enclosure_on_su2(metric, [0.0, 0.0, 0.0, -1.0])
    >>> print(found.certified, f"{found.upper:.6f} = 2 pi")
    True 6.283185 = 2 pi
    """
    check_object(metric, "LeftInvariantMetric", "metric")
    so3.quat_argument(quat_xyzw, "quat_xyzw")
    quat = so3.normalised(np.asarray(quat_xyzw, dtype=float))
    if quat.shape != (4,):
        raise ShapeError(f"quat_xyzw: one quaternion (4,) is needed, got {quat.shape}; call it for each of them")
    principal = np.append(quat[:3] @ metric.axes, quat[3])
    return _distance(metric, Goal(quat=principal, on_su2=True), width, most_cells)


def cut_time_enclosure(
    metric: LeftInvariantMetric, momentum: ArrayLike, *, width: float = 1e-3, most_cells: int = MOST_CELLS
) -> GeodesicEnclosure:
    """Bounds of the time up to which a geodesic is the shortest on SO(3), proven but for rounding [s].

    From above by its conjugate time, or by a shorter geodesic to where it is. From below by the search for others that
    arrive first, with a neighbourhood of its own momentum in which there is none.

    Raises ShapeError if the momentum is not three numbers, or nothing moves with it, width is not between 0 and 1 or
    most_cells below 1; AccuracyNotReached as `shortest_geodesic` and `LeftInvariantMetric.conjugate_time`.

    Parameters
    ----------
    metric : of `left_invariant_metric`
    momentum : (3,) at the start, body axes [kg m^2/s]
    width : relative to the time
    most_cells : of work; where they do not suffice the enclosure is wider, with a lower bound of 0 in the worst case

    Examples
    --------
    >>> metric = sp.rigid_body.geodesics.left_invariant_metric([1.0, 1.0, 1.0])
    >>> found = sp.rigid_body.geodesics.cut_time_enclosure(metric, [0.0, 0.0, 1.0])
    >>> print(f"{found.upper:.6f} = pi")
    3.141593 = pi
    """
    check_object(metric, "LeftInvariantMetric", "metric")
    given = vector_argument(momentum, "momentum", unit="kg m^2/s")
    part, most = width_argument(width), whole_argument(most_cells, "most_cells", 1)
    start = metric.unit_speed(given) @ metric.axes
    speed = float(metric.speed(given))
    closed, order = axial_form(metric)
    if closed is not None:
        cut = float(closed.cut_time(start[order])) / speed
        return GeodesicEnclosure(
            lower=cut * (1.0 - _SHORTER * part), upper=cut, certified=True, momentum=given, cells=0
        )
    conjugate = float(metric.conjugate_time(metric.axes @ start))
    upper, rival = _first_rival(metric, start, conjugate, part)
    lower, work, missing = 0.0, 0, 0.9 * part
    while lower == 0.0 and missing < 1.0 and work < most:
        time = upper * (1.0 - missing)
        goal = _reached(metric, start, time)
        begin = min(time, axial_bounds(metric, goal)[0]) * (1.0 - _SHORTER)
        # Half of what is left, or a shorter time would have none.
        search = first_arrival(metric.inverse_moments, goal, begin, time, max((most - work) // 2, 1), known=start)
        work += max(search.work, 1)
        lower = time if search.time >= time else 0.0
        missing *= 8.0
    return GeodesicEnclosure(
        lower=lower / speed,
        upper=upper / speed,
        certified=upper - lower <= part * upper,
        momentum=given if rival is None else metric.axes @ rival,
        cells=work,
    )


def diameter_enclosure(
    metric: LeftInvariantMetric, *, width: float = 2e-2, most_cells: int = MOST_CELLS
) -> GeodesicEnclosure:
    """Bounds of the largest distance of two attitudes, proven but for rounding [sqrt(kg) m].

    From below by the distance to half a turn about the axis of the largest moment, whose geodesic is the `momentum`.
    From above by a time before which every geodesic meets another one of its length that is symmetric to it, or by the
    diameters of the two next larger axisymmetric metrics.

    Raises ShapeError if width is not between 0 and 1 or most_cells below 1; AccuracyNotReached as `shortest_geodesic`.

    Equation :eq:`symmetric-arrivals` of the documentation. That no attitude is further than that half turn is no
    theorem for three different moments.

    Parameters
    ----------
    metric : of `left_invariant_metric`
    width : relative to the diameter
    most_cells : of work; where they do not suffice the enclosure is wider

    Examples
    --------
    >>> metric = sp.rigid_body.geodesics.left_invariant_metric([1.0, 2.0, 3.0])
    >>> found = sp.rigid_body.geodesics.diameter_enclosure(metric)
    >>> print(found.certified, f"{found.upper:.6f} = pi sqrt(3)")
    True 5.441398 = pi sqrt(3)
    """
    check_object(metric, "LeftInvariantMetric", "metric")
    part, most = width_argument(width), whole_argument(most_cells, "most_cells", 1)
    farthest = _distance(metric, Goal(quat=np.array([0.0, 0.0, 1.0, 0.0]), on_su2=False), 0.5 * part, (most + 1) // 2)
    upper, work = _axial_diameter(metric), farthest.cells
    time = max(farthest.lower / (1.0 - part * (1.0 - _SHORTER)), farthest.upper * (1.0 + 0.5 * part))
    if time < upper:
        half = 0.5 * time * float(np.sqrt(metric.inverse_moments[2]))
        about_third = found_geodesic(metric, Goal(quat=np.array([0.0, 0.0, np.sin(half), np.cos(half)]), on_su2=False))
        length = about_third.length + gap(metric, about_third.residual)
        met, cells = all_met(metric.inverse_moments, time, length, max(most - work, 0))
        upper, work = time if met else upper, work + cells
    return GeodesicEnclosure(
        lower=farthest.lower,
        upper=upper,
        certified=upper - farthest.lower <= part * upper,
        momentum=farthest.momentum,
        cells=work,
    )


def _axial_diameter(metric: LeftInvariantMetric) -> float:
    """The diameter of the closed form, or the smaller one of two axisymmetric metrics that are nowhere shorter."""
    closed, _ = axial_form(metric)
    if closed is not None:
        return closed.diameter
    smallest, middle, largest = metric.moments.tolist()
    oblate = axisymmetric_metric(middle, largest).diameter
    return min(oblate, axisymmetric_metric(largest, smallest).diameter) if np.isfinite(largest) else oblate


def _distance(metric: LeftInvariantMetric, goal: Goal, width: float, most_cells: int) -> GeodesicEnclosure:
    part, most = width_argument(width), whole_argument(most_cells, "most_cells", 1)
    found = found_geodesic(metric, goal)
    lower, upper, work = proven_bounds(metric, goal, found, part, most)
    certified = upper - lower <= part * upper
    return GeodesicEnclosure(lower=lower, upper=upper, certified=certified, momentum=found.momentum, cells=work)


def _reached(metric: LeftInvariantMetric, start: Array, time: float) -> Goal:
    quat = quaternion_flow(metric.inverse_moments, start[None], np.array([time]))[0]
    return Goal(quat=so3.positive_scalar(quat), on_su2=False)


def _first_rival(
    metric: LeftInvariantMetric, start: Array, conjugate: float, width: float
) -> tuple[float, Array | None]:
    """A time at which another geodesic is shorter, or the conjugate time, and that geodesic's momentum at t = 1.

    A rival is followed backwards to where it is as long; then a search just before shows whether there are others.
    """
    upper, rival = conjugate, None
    while True:
        time = upper * (1.0 - 0.25 * width)
        found = found_geodesic(metric, _reached(metric, start, time))
        if found.length + gap(metric, found.residual) >= time * (1.0 - _SHORTER):
            return upper, rival
        upper, rival, low = time, found.momentum @ metric.axes, 0.0
        while upper - low > 0.1 * width * upper:
            middle = 0.5 * (low + upper)
            other, length, missed = arrival_near(metric, rival * (middle / upper), _reached(metric, start, middle))
            if length + gap(metric, missed) < middle * (1.0 - _SHORTER):
                upper, rival = middle, other
            else:
                low = middle
