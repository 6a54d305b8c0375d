"""Waypoints of a task: their coordinates, their places on a guess, and the equations of a spline through them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import factorial
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, Integers
from ..body.body import Body
from ..body.particles.point_masses import ParticleBody
from ..errors import ShapeError, TrajectoryError
from ._ball_chart import BallChart
from ._spline_basis import SplineBasis
from .plan_options import Waypoint

if TYPE_CHECKING:
    from .task import Reorientation

_TOLERANCE = 1e-9  # [rad or m] of postures against couplings and limits: rounding of degrees or of a file's digits
_EVENNESS = 0.1  # weight of even spacing against nearness: decides where guesses rest or return


@dataclass(frozen=True, eq=False)
class ViaPoint:
    """A waypoint of a task.

    columns, values : (j,) indices and values of the coordinates that it fixes
    place : time as a share of the duration; None: open
    """

    columns: Integers
    values: Array
    place: float | None


def via_points(
    body: Body | ParticleBody,
    via: Sequence[Waypoint],
    duration: float | None,
    bounds: Array,
    coupling: Array,
    offset: Array,
    chart: BallChart | None,
) -> tuple[ViaPoint, ...]:
    """Return waypoints in the coordinates of a task.

    Parameters
    ----------
    duration : [s]; None: it is to be found, and no waypoint has a time
    coupling, offset : (n, m), (n,) shapes from coordinates, before the chart of ball joints

    Raises
    ------
    ShapeError, TrajectoryError, UnknownNameError
        For waypoints that no path within limits and couplings passes at their times.
    """
    points, before = [], 0.0
    for number, waypoint in enumerate(via):
        name = f"via: waypoint {number + 1}"
        if not isinstance(waypoint, Waypoint):
            raise ShapeError(f"{name}: a Waypoint(shape, time=...) is needed, got a {type(waypoint).__name__}")
        if waypoint.time is not None:
            if duration is None:
                raise TrajectoryError(
                    f"{name}: with cost='time' waypoints are passed in their order; leave their times out"
                )
            if not before < waypoint.time < duration:
                raise TrajectoryError(
                    f"{name}: at {waypoint.time:.6g} s it must come after {before:.6g} s, and before the end at "
                    f"{duration:.6g} s"
                )
            before = waypoint.time
        columns, values = _coordinates(body, waypoint, bounds, coupling, offset, name)
        if chart is not None:
            if isinstance(waypoint.shape, Mapping):
                raise ShapeError(f"{name}: a body with ball joints that move needs the coordinates of all joints, (n,)")
            values = chart.coordinates(values, name)
            columns = np.arange(len(values))
        points.append(
            ViaPoint(columns, values, None if waypoint.time is None or duration is None else waypoint.time / duration)
        )
    return tuple(points)


def _coordinates(
    body: Body | ParticleBody, waypoint: Waypoint, bounds: Array, coupling: Array, offset: Array, name: str
) -> tuple[Integers, Array]:
    """Return indices and values of the coordinates that a waypoint fixes."""
    if isinstance(waypoint.shape, Mapping):
        named = {body.joint_index(joint): value for joint, value in waypoint.shape.items()}
    else:
        shape = np.asarray(waypoint.shape)
        if len(shape) != body.n_shape:
            raise ShapeError(f"{name}: one coordinate for each of the {body.n_shape} joints, got {len(shape)} numbers")
        named = dict(enumerate(shape.tolist()))
    known: dict[int, float] = {}
    for joint, value in named.items():
        check_within(body, joint, value, bounds, name)
        moves, column = coupling[joint].any(), int(np.argmax(coupling[joint] != 0.0))
        if moves and column not in known:
            known[column] = (value - offset[joint]) / coupling[joint, column]
        must = coupling[joint, column] * known[column] + offset[joint] if moves else offset[joint]
        check_follows(body, joint, value, must, name)
    if not known:
        raise TrajectoryError(f"{name}: none of its joints moves")
    columns = np.array(sorted(known))
    return columns, np.array([known[column] for column in columns.tolist()])


def check_within(body: Body | ParticleBody, joint: int, value: float, bounds: Array, name: str) -> None:
    """Raise TrajectoryError where a joint of a posture called `name` is beyond its bounds (n, 2)."""
    low, high = bounds[joint]
    if not low - _TOLERANCE <= value <= high + _TOLERANCE:
        raise TrajectoryError(
            f"{name}: joint {body.joint_names[joint]} at {value:.6g} is beyond its limits {low:.6g} ... {high:.6g}; "
            "choose another shape, or joint_limits=False"
        )


def check_follows(body: Body | ParticleBody, joint: int, value: float, must: float, name: str) -> None:
    """Raise TrajectoryError where a joint of a posture called `name` is not where others or the start put it."""
    if abs(must - value) > _TOLERANCE:
        raise TrajectoryError(
            f"{name}: joint {body.joint_names[joint]} at {value:.6g} must be at {must:.6g}, where the joint that it "
            "follows puts it, or where it is held fixed"
        )


def nearest_places(task: Reorientation, curve: Array, places: Array) -> Array:
    """Places where a curve (N, m), sampled at places of [0, 1], is nearest to the waypoints, in their order: (v,)."""
    if not task.via:
        return np.zeros(0)
    even = _even_places(task)
    gaps = np.array([np.sum((curve[:, point.columns] - point.values) ** 2, axis=1) for point in task.via])
    gaps = gaps + _EVENNESS * (gaps.max() + np.finfo(float).tiny) * (places - even[:, None]) ** 2
    for row, point in zip(gaps, task.via, strict=True):
        allowed = np.zeros(len(places), dtype=bool)
        nearest = slice(1, -1) if point.place is None else [1 + int(np.argmin(np.abs(places[1:-1] - point.place)))]
        allowed[nearest] = True
        row[~allowed] = np.inf
    # The least sum of gaps along rising places.
    sums, before = [gaps[0]], []
    for row in gaps[1:]:
        least = np.minimum.accumulate(sums[-1])
        before.append(np.maximum.accumulate(np.where(sums[-1] <= least, np.arange(len(places)), 0)))
        sums.append(row + np.append(np.inf, least[:-1]))
    chosen = [int(np.argmin(sums[-1]))]
    for back in reversed(before):
        chosen.append(int(back[max(chosen[-1] - 1, 0)]))
    nearest_ones = places[chosen[::-1]]
    return np.array(
        [f if point.place is None else point.place for f, point in zip(nearest_ones, task.via, strict=True)]
    )


def bent_through(task: Reorientation, curve: Array, places: Array, at: Array) -> Array:
    """Return a curve (N, m), sampled at places of [0, 1], bent to pass the waypoints `at` their places (v,)."""
    bent = curve.copy()
    for column in range(task.dimension):
        stops, gaps = [0.0], [0.0]
        for point, place in zip(task.via, at, strict=True):
            for known, value in zip(point.columns, point.values, strict=True):
                if known == column:
                    stops.append(float(place))
                    gaps.append(float(value - np.interp(place, places, curve[:, column])))
        last = 0.0 if task.end is not None else gaps[-1]
        bent[:, column] += np.interp(places, [*stops, 1.0], [*gaps, last])
    return bent


def via_rows(task: Reorientation, basis: SplineBasis, at: Array) -> tuple[Array, Array]:
    """Rows on the control points, and their values on a path that passes the waypoints: (j, k, m), (j,)."""
    rows = [np.zeros((0, basis.dimension, task.dimension))]
    for point, weights in zip(task.via, basis.matrix(np.clip(at, 0.0, 1.0)), strict=True):
        block = np.zeros((len(point.columns), basis.dimension, task.dimension))
        block[np.arange(len(point.columns)), :, point.columns] = weights
        rows.append(block)
    return np.concatenate(rows), np.concatenate([np.zeros(0), *(point.values for point in task.via)])


def open_points(task: Reorientation) -> list[int]:
    """Indices of the waypoints without a time."""
    return [number for number, point in enumerate(task.via) if point.place is None]


def symbolic_via_rows(task: Reorientation, basis: SplineBasis, control: Any, opened: Any) -> tuple[Any, Array, Array]:
    """Return `via_rows` and rows of the waypoints' order, with bounds, for MX control points (m k,) and open places.

    The weights of the control points are, on each piece, polynomials of an open place.
    """
    import casadi

    if not task.via:
        return casadi.MX(0, 1), np.zeros(0), np.zeros(0)
    points = casadi.reshape(control, task.dimension, basis.dimension)
    free = open_points(task)
    places: list[Any] = [opened[free.index(k)] if k in free else point.place for k, point in enumerate(task.via)]
    rows = [
        points[point.columns.tolist(), :] @ _weights(basis, place)
        for point, place in zip(task.via, places, strict=True)
    ]
    values = np.concatenate([point.values for point in task.via])
    steps = [places[k + 1] - places[k] for k in range(len(places) - 1) if k in free or k + 1 in free]
    low, high = np.append(values, np.zeros(len(steps))), np.append(values, np.full(len(steps), np.inf))
    return casadi.vertcat(*rows, *steps), low, high


def _weights(basis: SplineBasis, place: Any) -> Any:
    """Weights of the control points at a place, (k,), by the polynomials of its piece."""
    import casadi

    if isinstance(place, float):
        return casadi.DM(basis.matrix(np.array([place]))[0])
    begin = np.unique(basis.knots)[:-1]
    begun, ended = np.append(-np.inf, begin[1:]), np.append(begin[1:], np.inf)
    powers, weights = casadi.logic_and(place >= casadi.DM(begun), place < casadi.DM(ended)), 0.0
    for order in range(4):
        coefficients = basis.matrix(begin, order) / factorial(order)
        weights = weights + casadi.sparsify(casadi.DM(coefficients.T)) @ powers
        powers = powers * (place - casadi.DM(begin))
    return weights


def _even_places(task: Reorientation) -> Array:
    """Places of waypoints by their distance along the way through them, as their times permit: (v,)."""
    now, lengths = task.start.copy(), []
    for point in task.via:
        onward = now.copy()
        onward[point.columns] = point.values
        lengths.append(float(np.linalg.norm(onward - now)))
        now = onward
    lengths.append(float(np.linalg.norm((now if task.end is None else task.end) - now)))
    passed = np.cumsum(lengths)
    # Between two waypoints whose times are known, in proportion.
    known = [(0.0, 0.0)]
    known += [(passed[k], point.place) for k, point in enumerate(task.via) if point.place is not None]
    known += [(max(passed[-1], np.finfo(float).tiny), 1.0)]
    along, places = np.array(known).T
    return np.interp(passed[:-1], along, places)
