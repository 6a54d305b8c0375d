"""The search of `shapephase plan`: its options, its processes, and how Ctrl-C ends it."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ...errors import ShapeError
from ..ctrl_c import handled_by, stop_searches
from ..options import option, rare
from ..progress import Steps

if TYPE_CHECKING:
    from ...optimal_control.plan_options import Search


@Parameter(name="*")
@dataclass(frozen=True)
class SearchOptions:
    """How a plan is searched for."""

    starts: Annotated[int, option()] = 1
    """Searches from different guesses; the cheapest plan is kept. For example `--starts 4`."""
    workers: Annotated[int | None, option()] = None
    """Processes that search in parallel; default: 1. For example `--workers 4`."""
    time_limit: Annotated[float | None, option()] = None
    """Longest search, in s; the best result is written. For example `--time-limit 60`."""
    seed: Annotated[int, rare()] = 0
    """Seed of the random guesses; for example `--seed 7`."""
    pieces: Annotated[int | None, rare()] = None
    """Pieces of the motion's spline, six or more; default: 20 to 160, by the number of joints. For example
    `--pieces 12`."""
    iterations: Annotated[int, rare()] = 300
    """Most iterations of the solver for each start; for example `--iterations 1000`."""

    def search(self) -> Search:
        """Return the search's settings. Raises ShapeError."""
        from ...optimal_control.plan_options import Search

        if self.workers is not None and self.workers < 1:
            raise ShapeError(f"--workers: a whole number above 0 is needed, got {self.workers}")
        if self.time_limit is not None and not 0.0 < self.time_limit < math.inf:
            raise ShapeError(f"--time-limit: a time in s above 0 is needed, got {self.time_limit:g}")
        return Search(
            starts=self.starts,
            seed=self.seed,
            pieces=self.pieces,
            iterations=self.iterations,
            time_limit=self.time_limit,
        )


class InterruptibleSearch:
    """A search on the terminal, which Ctrl-C ends after the iteration in progress.

    Attributes
    ----------
    reported : whether there will be a result to keep: an iteration has been reported, or other processes search
    stopped : whether Ctrl-C has been pressed since
    processes : ids of the processes that search in parallel
    """

    def __init__(self, work: Steps, time_limit: float | None, *, in_parallel: bool = False) -> None:
        self._work = work
        self._end = math.inf if time_limit is None else time.monotonic() + time_limit
        self.reported, self.stopped = in_parallel, False
        self.processes: list[int] = []

    def report(self, share: float, text: str) -> bool:
        """Show the progress of the search; return whether to stop it."""
        left = "" if self._end == math.inf else f", {max(self._end - time.monotonic(), 0.0):.0f} s left"
        self._work.watch(share, f"{text}{left}")
        self.reported = True
        return self.stopped

    def end_processes(self) -> None:
        """Send Ctrl-C to the processes that search in parallel."""
        for process in self.processes:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGINT)

    def interrupted(self, *_: Any) -> None:
        """Handle Ctrl-C: the search ends after this iteration; pressed again, at once."""
        if self.stopped or not self.reported:
            raise KeyboardInterrupt
        self.stopped = True
        self.end_processes()
        self._work.say("stopping, to keep the best result (Ctrl-C again discards it)")


@contextmanager
def running_search(options: SearchOptions, work: Steps) -> Iterator[tuple[InterruptibleSearch, Executor | None]]:
    """Yield a search that Ctrl-C stops, and its processes if it has several."""
    workers = options.workers if options.workers is not None and options.workers > 1 else None
    search = InterruptibleSearch(work, options.time_limit, in_parallel=workers is not None)
    with handled_by(search.interrupted), _executor(workers, search) as executor:
        yield search, executor


@contextmanager
def _executor(workers: int | None, search: InterruptibleSearch) -> Iterator[Executor | None]:
    """Yield processes that search in parallel; None where one is enough."""
    if workers is None:
        yield None
        return
    # A process that was forked beside threads of the solver may hang.
    spawned = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=spawned, initializer=stop_searches) as processes:
        # They ignore Ctrl-C until their own handler is installed.
        with handled_by(signal.SIG_IGN):
            processes.submit(int)
        search.processes = [child.pid for child in multiprocessing.active_children() if child.pid is not None]
        try:
            if search.stopped:
                search.end_processes()
            yield processes
        finally:
            search.end_processes()
            processes.shutdown(cancel_futures=True)
