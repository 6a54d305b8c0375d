"""Results computed ever finer until they no longer change."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import TypeVar

import numpy as np

from .arrays import Array

Result = TypeVar("Result")


def settled(
    results: Iterable[Result], difference: Callable[[Result, Result], float], tolerance: float
) -> Result | None:
    """The first of ever finer results that differs from the one before it by at most a tolerance.

    None if there is no such result; `results` is only computed as far as needed.
    """
    for last, result in pairwise(results):
        if difference(last, result) <= tolerance:
            return result
    return None


def halved(edges: Array, count: int) -> Iterator[Array]:
    """Edges, and the same with all intervals halved once, twice ...: `count` of them."""
    for _ in range(count):
        yield edges
        edges = np.sort(np.concatenate([edges, 0.5 * (edges[:-1] + edges[1:])]))
