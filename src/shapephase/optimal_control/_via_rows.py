"""Waypoints of a plan: where on a guess they come, and the equations that a spline through them obeys."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ._spline_basis import SplineBasis

if TYPE_CHECKING:
    from .task import Reorientation

# How much further than the nearest posture of a guess a waypoint may be from where it comes by its distance along the
# way, relative to the size of the way: decides where guesses rest or come by more than once.
_EVENNESS = 0.1


def nearest_places(task: Reorientation, curve: Array, places: Array) -> Array:
    """Where a curve (N, m), seen at places of [0, 1], comes nearest to the waypoints, in their order: (v,)."""
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
    found = places[chosen[::-1]]
    return np.array([f if point.place is None else point.place for f, point in zip(found, task.via, strict=True)])


def bent_through(task: Reorientation, curve: Array, places: Array, at: Array) -> Array:
    """A curve (N, m), seen at places of [0, 1], bent so that it passes the waypoints `at` theirs (v,)."""
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
    """What is linear in the control points, and what it is on a path that passes the waypoints: (j, k, m), (j,)."""
    rows = [np.zeros((0, basis.dimension, task.dimension))]
    for point, weights in zip(task.via, basis.matrix(np.clip(at, 0.0, 1.0)), strict=True):
        block = np.zeros((len(point.columns), basis.dimension, task.dimension))
        block[np.arange(len(point.columns)), :, point.columns] = weights
        rows.append(block)
    return np.concatenate(rows), np.concatenate([np.zeros(0), *(point.values for point in task.via)])


def open_points(task: Reorientation) -> list[int]:
    """Which waypoints have no time of their own."""
    return [number for number, point in enumerate(task.via) if point.place is None]


def symbolic_via_rows(task: Reorientation, basis: SplineBasis, control: Any, opened: Any) -> tuple[Any, Array, Array]:
    """The same rows, and those of the waypoints' order, with bounds; of MX control points (m k,) and open places.

    A place that is open moves the weights of the control points: on each piece they are polynomials of it.
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
    """Of the control points at a place, (k,), by the polynomials of the piece that it is on."""
    import casadi

    if isinstance(place, float):
        return casadi.DM(basis.matrix(np.array([place]))[0])
    begin = np.unique(basis.knots)[:-1]
    begun, ended = np.append(-np.inf, begin[1:]), np.append(begin[1:], np.inf)
    powers, weights = casadi.logic_and(place >= casadi.DM(begun), place < casadi.DM(ended)), 0.0
    for order, factorial in enumerate((1.0, 1.0, 2.0, 6.0)):
        coefficients = basis.matrix(begin, order) / factorial
        weights = weights + casadi.sparsify(casadi.DM(coefficients.T)) @ powers
        powers = powers * (place - casadi.DM(begin))
    return weights


def _even_places(task: Reorientation) -> Array:
    """Of waypoints by their distance along the way through them, as their times permit: (v,)."""
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
