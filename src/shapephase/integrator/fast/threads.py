"""Many momenta in threads: each computes rows of its own, so that results do not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

from ...arrays import Array

# Momenta for a thread of its own: some tenths of a millisecond of work.
_LEAST_FOR_A_THREAD = 64
# Momenta in one call: some tenths of a second, after which a run that is watched says so.
_MOST_AT_ONCE = 8192
# Numbers in a page of memory.
_PAGE = 512


def in_threads(
    run: Callable[[slice], None], batch: int, lanes: int, threads: int | None, fresh: Iterable[Array] = ()
) -> Iterator[slice]:
    """Run for all rows, some of them in each call, in threads where there are enough; after each call its rows.

    Parameters
    ----------
    run : frees the interpreter while it computes
    lanes : rows that are computed together
    threads : how many at most; None: one for each processor
    fresh : arrays that nobody has written to yet
    """
    workers = max(1, min(processors() if threads is None else threads, batch // _LEAST_FOR_A_THREAD))
    parts = _parts(batch, lanes, workers)
    if workers == 1 or len(parts) == 1:
        for rows in parts:
            run(rows)
            yield rows
        return
    # Pages of memory are there when they are first written to. Threads that do so at once wait for each other.
    for array in fresh:
        array.reshape(-1)[::_PAGE] = 0.0
    for rows, _ in zip(parts, _pool(workers).map(run, parts), strict=True):
        yield rows


def _parts(batch: int, lanes: int, workers: int) -> list[slice]:
    """The rows for each call, whole groups of lanes: one call for each thread, or as many as show progress."""
    each = min(-(-batch // (workers * lanes)) * lanes, -(-_MOST_AT_ONCE // lanes) * lanes)
    return [slice(first, min(first + each, batch)) for first in range(0, max(batch, 1), each or 1)]


@lru_cache(maxsize=4)
def _pool(workers: int) -> ThreadPoolExecutor:
    """Threads that wait for the next call: to start them takes as long as a hundred momenta."""
    return ThreadPoolExecutor(workers)


if hasattr(os, "register_at_fork"):
    # A child of this process has none of its threads.
    os.register_at_fork(after_in_child=_pool.cache_clear)


@lru_cache(maxsize=1)
def processors() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
