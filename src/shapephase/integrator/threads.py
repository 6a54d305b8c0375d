"""Many rows in threads: each computes rows of its own, so that results do not depend on how many there are."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property, lru_cache
from threading import RLock

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
    count = max(1, min(-(-batch // workers), _MOST_AT_ONCE))
    parts = [slice(first, min(first + count, batch)) for first in range(0, max(batch, 1), count)]
    results = map(run, parts) if workers == 1 or len(parts) == 1 else _pool(workers).map(run, parts)
    for rows, _ in zip(parts, results, strict=True):
        yield rows


@lru_cache(maxsize=4)
def _pool(workers: int) -> ThreadPoolExecutor:
    """Threads that wait for the next call: to start them takes as long as a hundred momenta."""
    return ThreadPoolExecutor(workers)


def _free_after_fork() -> None:
    """Drop the threads that a child of this process does not have, and the locks that they held."""
    _pool.cache_clear()
    if sys.version_info >= (3, 12):
        return
    for name, module in list(sys.modules.items()):
        if name.partition(".")[0] == __name__.partition(".")[0]:
            for kind in list(vars(module).values()):
                for attribute in list(vars(kind).values()) if isinstance(kind, type) else ():
                    if isinstance(attribute, cached_property):
                        # Held while a value is computed, for all objects of the class (bpo-43468).
                        vars(attribute)["lock"] = RLock()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_free_after_fork)


@lru_cache(maxsize=1)
def processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
