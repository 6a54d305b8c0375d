"""Refinement of results until they no longer change, and the least value of a function."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import TypeVar

import numpy as np

from .arrays import Array
from .chebyshev import inside, nodes_on

Result = TypeVar("Result")
_NODES = 64  # Chebyshev points of a piece, less one: far more than the swings of a motion between two breaks
_MOST_PIECES_FINE = 32  # beyond so many pieces each has fewer points, so that their number stays bounded
_LOWEST = 16  # minima around which the search continues
_ZOOMS = 13  # each divides the interval by four: together by 7e7, where the value no longer changes
_CHUNK = 4096  # times evaluated at once: the arrays of many particles stay small


def settled(
    results: Iterable[Result], difference: Callable[[Result, Result], float], tolerance: float
) -> Result | None:
    """Return the first of ever finer results that differs from its predecessor by at most a tolerance, or None.

    `results` is only computed as far as needed.
    """
    for last, result in pairwise(results):
        if difference(last, result) <= tolerance:
            return result
    return None


def halved(edges: Array, count: int) -> Iterator[Array]:
    """Yield `count` grids: the edges, then with all intervals halved once, twice ..."""
    for _ in range(count):
        yield edges
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[:-1] + edges[1:])]))


def least_over(function: Callable[[Array], Array], breaks: Array) -> tuple[float, float]:
    """Return the least value of a function that is smooth between breaks, and its time.

    Evaluated at up to 65 Chebyshev points of every piece (fewer, but nine at least, where pieces are many); around the
    sixteen lowest of these the search continues to some 1e-9 of the piece. A dip between the points can be missed.

    function : times (N,) -> (N,)
    breaks : (M,) ascending [s]
    """
    left, right = inside(breaks[:-1], breaks[1:])
    count = int(np.clip(_NODES * _MOST_PIECES_FINE // len(left), 8, _NODES))
    times = nodes_on(left, right, count)
    values = _in_chunks(function, times)
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=np.inf)
    piece, node = np.nonzero((values <= padded[:, :-2]) & (values <= padded[:, 2:]))
    lowest = np.argsort(values[piece, node], kind="stable")[:_LOWEST]
    piece, node = piece[lowest], node[lowest]
    low, high = times[piece, np.maximum(node - 1, 0)], times[piece, np.minimum(node + 1, count)]
    best, when = values[piece, node], times[piece, node]
    for _ in range(_ZOOMS):
        points = np.linspace(low, high, 9, axis=1)
        zoomed = _in_chunks(function, points)
        at = np.argmin(zoomed, axis=1)
        row = np.arange(len(at))
        better = zoomed[row, at] < best
        best, when = np.where(better, zoomed[row, at], best), np.where(better, points[row, at], when)
        low, high = points[row, np.maximum(at - 1, 0)], points[row, np.minimum(at + 1, 8)]
    first = int(np.argmin(best))
    return float(best[first]), float(when[first])


def _in_chunks(function: Callable[[Array], Array], times: Array) -> Array:
    flat = times.ravel()
    parts = [function(flat[start : start + _CHUNK]) for start in range(0, len(flat), _CHUNK)]
    return np.concatenate(parts).reshape(times.shape)
