"""Panels on which nothing of a path is hidden, and what they give: series, extremes of joints, times for a table."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, Integers
from ..chebyshev import (
    PiecewiseChebyshev,
    inside,
    nodes_on,
    restriction_matrix,
    values_to_coefficients,
    widest_margin,
)
from ..errors import TrajectoryError
from ..integrator.resolved import ResolvedPath
from .curves import CLOSED, polynomial_pieces
from .interpolation import ball_columns

if TYPE_CHECKING:
    from .shape_path import ShapePath

SAME_TIME = 1e-12  # relative to the duration: nearer times are one
_DEGREE = 16  # of the series on a panel: five times that of a spline's pieces
_ROUNDING = 32.0 * float(np.finfo(float).eps)  # relative to the largest coefficient: the scan's resolution
_RESOLVED = 1e-13  # last coefficients of a resolved series, relative to the largest value
_LAST = 3  # coefficients that show whether a series is resolved
_NARROWEST = 2.0**-16  # relative to the whole: narrower panels are not halved
_PANELS_AT_ONCE = 512  # some ten megabytes
_EXTREME = 1e-14  # error of an extreme, relative to the largest value
_MOST_HALVINGS = 60  # of a panel that may hold an extreme; a parabola needs 24
_INTERVALS = 16  # of a table on each panel, at first
_PLACES = np.arange(1, 4) / 4  # in an interval, where a table's spline is compared
_MOST_PARTS = 16  # of an interval in one round: the error of a long one is not yet of fourth order
_STEEPEST = 20.0  # ratio of neighbouring intervals: from 100 on a reader reports gaps and doubled samples
_MOST_ROUNDS = 48  # intervals at a kink are halved about thirty times
MOST_ROWS = 1_000_000  # of a table made for a path


def panel_edges(path: ShapePath, loops: int = 1) -> Array:
    """Ends of panels of the first loops, in each of which the path swings once at most: (M,), first 0 [s].

    A path known only as a function has the panels of its scan. Raises and warns like `ShapePath.scan`.
    """
    period = path.duration / path.loops
    own = path.breaks[path.breaks < period * (1.0 - SAME_TIME)]
    breaks = np.append(own, period)
    scan = path.scan
    if scan is not None:
        edges = merged(merged(breaks, scan.found_breaks), scan.resolved.left)
    else:
        edges = evenly_divided(breaks, max(1, ceil(path.swings.most or 0.0)))
    if loops == 1:
        return edges
    starts = period * np.arange(loops)
    return np.append((starts[:, None] + edges[:-1]).ravel(), path.duration if loops == path.loops else loops * period)


def turn_of_a_loop(path: ShapePath) -> Array:
    """Whole turns by which a loop of the path ends from where it began: (n,) [rad]."""
    if path.loops == 1:
        return np.zeros(path.n_shape)
    return 2.0 * np.pi * np.round(path.gap / path.loops / (2.0 * np.pi))


def resolved_series(function: Callable[[Array], Array], edges: Array) -> tuple[Array, Array, Array]:
    """Panels and Chebyshev series of a function (N,) -> (N, c) smooth between edges: (P,), (P,), (P, k, c).

    Panels are halved until series follow the function, so edges must leave it no room for swings between the nodes.
    """
    left, right = edges[:-1], edges[1:]
    narrowest = _NARROWEST * (edges[-1] - edges[0])
    done: list[tuple[Array, Array, Array]] = []
    size = 0.0
    while len(left):
        times = nodes_on(*inside(left, right), _DEGREE)
        values = function(times.ravel()).reshape(*times.shape, -1)
        series = values_to_coefficients(_DEGREE) @ values
        size = np.maximum(size, np.abs(values).max(axis=(0, 1), initial=0.0))
        fine = (np.abs(series[:, -_LAST:]).max(axis=1) <= _RESOLVED * size).all(axis=1)
        fine |= right - left <= narrowest
        done.append((left[fine], right[fine], series[fine]))
        left, right = left[~fine], right[~fine]
        middle = 0.5 * (left + right)
        left, right = np.concatenate([left, middle]), np.concatenate([middle, right])
    lefts, rights, series_parts = zip(*done, strict=True)
    return np.concatenate(lefts), np.concatenate(rights), np.concatenate(series_parts)


def joint_extremes(path: ShapePath) -> tuple[Array, Array, Array]:
    """Lowest and highest coordinate and largest rate of each joint over a whole path, to 1e-14: (n,), (n,), (n,).

    Raises and warns like `ShapePath.scan`.
    """
    least = np.full(4 * path.n_shape, -np.inf)
    for values, series in _blocks(path):
        least = np.maximum(least, np.concatenate([values, -values], axis=1).max(axis=0, initial=-np.inf))
        least = _largest(np.concatenate([series, -series], axis=2), least)
    high, fast, low, slow = np.split(least, 4)
    turned = turn_of_a_loop(path) * (path.loops - 1)
    # Zeros are added for their sign.
    return np.minimum(-low, turned - low) + 0.0, np.maximum(high, high + turned) + 0.0, np.maximum(fast, slow) + 0.0


def times_of_fastest(path: ShapePath) -> Array:
    """Nodes of panels at which each joint of the first loop is fastest: (n,) [s]."""
    edges = panel_edges(path)
    times = nodes_on(*inside(edges[:-1], edges[1:]), _DEGREE).ravel()
    return times[np.abs(path.rate(times)).argmax(axis=0)]


def resolved_accelerations(resolved: ResolvedPath, loops: int, times: Array) -> Array:
    """Accelerations by the derivative of the series of the rates, of all loops by the first one: (N, n)."""
    n_shape, edges = resolved.coefficients.shape[2] // 2, resolved.edges
    rates = PiecewiseChebyshev(edges, _continuous(resolved.coefficients[:, :, n_shape:], edges))
    loop = np.minimum(np.floor(times / resolved.duration), loops - 1)
    return rates.derivative()(times - loop * resolved.duration)


def _continuous(series: Array, edges: Array) -> Array:
    """Series (P, k, n) that meet where panels do, as far as rounding keeps them apart, by a change of their slopes.

    What accelerations add up to is then what the rates change by, also where these are large for a short time. At a
    break both sides were sampled at some distance from it, which counts as rounding of times.
    """
    degrees, widths = np.arange(series.shape[1])[:, None], np.diff(edges)[:, None]
    signs = np.where(degrees % 2, -1.0, 1.0)
    starts, ends = (signs * series).sum(axis=1), series.sum(axis=1)
    sizes = np.abs(series)
    slopes = 2.0 / widths * (degrees**2 * sizes).sum(axis=1)
    noise = _ROUNDING * sizes.max(axis=1) + widest_margin(float(edges[-1])) * slopes
    gaps = starts[1:] - ends[:-1]
    gaps = np.where(np.abs(gaps) <= noise[1:] + noise[:-1], gaps, 0.0)
    changed = series.copy()
    none = np.zeros_like(series[:1, 0])
    at_start, at_end = np.concatenate([none, -0.5 * gaps]), np.concatenate([0.5 * gaps, none])
    changed[:, 0] += 0.5 * (at_start + at_end)
    changed[:, 1] += 0.5 * (at_end - at_start)
    return changed


def spline_times(path: ShapePath) -> Array:
    """Times of a table, the cubic spline through which is the path to 1e-9 rad or m, or of its largest value: (N,).

    Raises TrajectoryError if that takes more than a million rows.
    """
    pieces = polynomial_pieces(path.curve)
    times = evenly_divided(panel_edges(path, path.loops), _INTERVALS) if pieces is None else pieces.knots
    for _ in range(_MOST_ROUNDS):
        if len(times) > MOST_ROWS:
            break
        off = _errors(path, times)
        parts = np.clip(np.ceil((2.0 * off / CLOSED) ** 0.25), 2, _MOST_PARTS).astype(np.int64)
        parts[off <= CLOSED] = 1
        if parts.max() == 1:
            return times
        times = _graded(_divided(times, parts))
    raise TrajectoryError(
        f"a table of this path needs more than {MOST_ROWS} rows for the spline through them to be the path to "
        f"{CLOSED:g}; give the times of its rows (times)"
    )


def spline_error(path: ShapePath, times: Array) -> tuple[Array, Array]:
    """Largest difference between a path and the spline through a table of it, and when: (n,) [rad or m], (n,) [s].

    times : (N,) ascending rows of the table; what is before and after them does not count
    """
    known = evenly_divided(panel_edges(path, path.loops), _INTERVALS)
    between = (times[:-1, None] + np.diff(times)[:, None] * _PLACES).ravel()
    looked = np.append(known[(known >= times[0]) & (known <= times[-1])], between)
    off = _differences(path, times, looked)
    worst = np.argmax(off, axis=0)
    return off[worst, np.arange(path.n_shape)], looked[worst]


def evenly_divided(edges: Array, parts: int) -> Array:
    """Ends of intervals (M,) that are each divided into equal parts."""
    return np.append((edges[:-1, None] + np.diff(edges)[:, None] * (np.arange(parts) / parts)).ravel(), edges[-1])


def merged(known: Array, more: Array) -> Array:
    """Times of both, ascending; of those that are nearly the same the known one."""
    if not len(known):
        known, more = more[:1], more[1:]
    if not len(more):
        return known
    near = SAME_TIME * max(float(known[-1]), float(np.max(more)))
    place = np.searchsorted(known, more)
    before, behind = known[np.maximum(place - 1, 0)], known[np.minimum(place, len(known) - 1)]
    new = np.sort(more[(np.abs(more - before) > near) & (np.abs(more - behind) > near)])
    kept = new[np.concatenate([[True], np.diff(new) > near])] if len(new) else new
    return np.sort(np.concatenate([known, kept]))


def _blocks(path: ShapePath) -> Iterator[tuple[Array, Array]]:
    """Values (N, 2 n) and series (P, k, 2 n) of shapes and rates on panels of the first loop, some panels at once."""

    def both(times: Array) -> Array:
        return np.concatenate(path.curve(times), axis=1)

    scan = path.scan
    if scan is not None:
        yield both(panel_edges(path)), scan.resolved.coefficients
        return
    pieces = polynomial_pieces(path.curve)
    edges = panel_edges(path)
    for start in range(0, len(edges) - 1, _PANELS_AT_ONCE):
        some = edges[start : start + _PANELS_AT_ONCE + 1]
        if pieces is None:
            yield both(some), resolved_series(both, some)[2]
        else:
            degree = len(pieces.coefficients) - 1
            times = nodes_on(*inside(some[:-1], some[1:]), degree)
            yield both(some), values_to_coefficients(degree) @ both(times.ravel()).reshape(*times.shape, -1)


def _largest(series: Array, least: Array) -> Array:
    """The largest value of each column of series (P, k, c) on [-1, 1], from values below it (c,): (c,).

    A series is nowhere above its first coefficient and the sizes of the others: panels whose bound is above the largest
    value so far are halved.
    """
    largest = least.copy()
    close = _EXTREME * np.maximum(np.abs(series).sum(axis=1).max(axis=0, initial=0.0), np.abs(least))
    panel, column = np.nonzero(_bounds(series) > largest + close)
    rows = series[panel, :, column]
    halves = [restriction_matrix(series.shape[1], *ends) for ends in ((-1.0, 0.0), (0.0, 1.0))]
    for _ in range(_MOST_HALVINGS):
        if not len(rows):
            break
        rows, column = np.concatenate([rows @ half.T for half in halves]), np.tile(column, 2)
        np.maximum.at(largest, column, rows.sum(axis=1))
        above = _bounds(rows) > (largest + close)[column]
        rows, column = rows[above], column[above]
    return largest


def _bounds(series: Array) -> Array:
    return series[:, 0] + np.abs(series[:, 1:]).sum(axis=1)


def _errors(path: ShapePath, times: Array) -> Array:
    """Largest distance of a table's spline from a path in each interval, relative to its largest value: (N - 1,)."""
    looked = times[:-1, None] + np.diff(times)[:, None] * _PLACES
    off = _differences(path, times, looked.ravel())
    sizes = np.maximum(1.0, np.abs(path.curve(times)[0]).max(axis=0, initial=0.0))
    return (off / sizes).max(axis=1, initial=0.0).reshape(looked.shape).max(axis=1)


def _differences(path: ShapePath, times: Array, looked: Array) -> Array:
    """Distance of a table's spline from a path at times (M,); a quaternion and its negative are one: (M, n)."""
    right, _ = path.curve(looked)
    table = path.spline(times, path.curve(times)[0], joint_names=path.joint_names)
    read, _ = table.curve(looked - times[0])
    for ball in ball_columns(path.joint_names):
        read[:, ball] *= np.where(np.sum(read[:, ball] * right[:, ball], axis=1) < 0.0, -1.0, 1.0)[:, None]
    return np.abs(read - right)


def _graded(times: Array) -> Array:
    """Times, and others between them, so that no interval is more than 20 times as long as one beside it."""
    while True:
        steps = np.diff(times)
        shorter = np.minimum(np.append(steps[1:], np.inf), np.append(np.inf, steps[:-1]))
        parts = np.where(steps > _STEEPEST * shorter, 2, 1)
        if parts.max() == 1:
            return times
        times = _divided(times, parts)


def _divided(times: Array, parts: Integers) -> Array:
    """The ends of intervals that are each divided into equal parts: (N,), (N - 1,) -> (1 + sum of parts,)."""
    place = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    inner = np.repeat(times[:-1], parts) + np.repeat(np.diff(times) / parts, parts) * place
    return np.append(inner, times[-1])
