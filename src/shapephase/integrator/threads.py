"""Many rows in threads: each computes rows of its own, so that results do not depend on how many there are."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache

_LEAST_FOR_A_THREAD = 64  # rows: some tenths of a millisecond of work
_MOST_AT_ONCE = 8192  # rows in one call: some tenths of a second, after which a run that is watched reports progress


def in_threads(run: Callable[[slice], None], batch: int, threads: int | None = None) -> Iterator[slice]:
    """Compute all rows, some of them in each call, in threads where there are enough; after each call yield its rows.

    Parameters
    ----------
    run : frees the interpreter while it computes
    threads : how many at most; None: one for each processor
    """
    workers = max(1, min(processors() if threads is None else threads, batch // _LEAST_FOR_A_THREAD))
    each = max(1, min(-(-batch // workers), _MOST_AT_ONCE))
    parts = [slice(first, min(first + each, batch)) for first in range(0, max(batch, 1), each)]
    results = map(run, parts) if workers == 1 or len(parts) == 1 else _pool(workers).map(run, parts)
    for rows, _ in zip(parts, results, strict=True):
        yield rows


@lru_cache(maxsize=4)
def _pool(workers: int) -> ThreadPoolExecutor:
    """Threads that wait for the next call: to start them takes as long as a hundred momenta."""
    return ThreadPoolExecutor(workers)


if hasattr(os, "register_at_fork"):
    # A child of this process has none of its threads.
    os.register_at_fork(after_in_child=_pool.cache_clear)


@lru_cache(maxsize=1)
def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
