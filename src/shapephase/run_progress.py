"""Progress of a long run, reported to a callback, which may stop the run.

How much work is left is not known in advance: halvings of a path, further samples, a second round of steps. So every
stretch of work fills a part of what is left of its phase, and every phase a part of what is left of the run: the share
grows as long as something is done, and reaches one at the end.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from typing import Any

from .arguments import check_function
from .errors import RunStopped

ProgressCallback = Callable[[float, str], Any]
"""Called with the share that is done, from 0 to 1 and never falling, and with what is being done, in a few words; a
true return stops the run."""

LOOKING = "looking at the path"
SAMPLING = "sampling the body"
STEPPING = "stepping"
_PHASES = {LOOKING: 0.2, SAMPLING: 0.5, STEPPING: 0.9}  # share of the run still left that a phase usually takes
_STRETCH = 0.7  # share of the phase still left that one stretch takes, since there may be others
SEARCH_STRETCH = 0.12  # of searches, which are some dozens of stretches
_NOTICEABLE = 0.005  # share of the run: smaller progress is not reported, so that a run makes 200 reports


def check_progress(progress: object) -> None:
    """Raise WrongObjectError where an argument is not a progress callback."""
    if progress is not None:
        check_function(progress, "progress", "a function of the share done and a text")


class _Watcher:
    """Reports to a callback what has been done."""

    def __init__(self, callback: ProgressCallback, stretch: float) -> None:
        self._callback, self._stretch = callback, stretch
        self._phase, self._phase_end = "", 0.0
        self._share = self._start = self._end = 0.0
        self._total = self._done = 0
        self._last_share = -1.0

    def begin(self, phase: str, total: int) -> None:
        self._share = max(self._share, self._end)
        is_new = phase != self._phase
        if is_new:
            self._phase, self._phase_end = phase, self._share + _PHASES[phase] * (1.0 - self._share)
        self._start, self._end = self._share, self._share + self._stretch * (self._phase_end - self._share)
        self._total, self._done = total, 0
        self._report(always=is_new)

    def advance(self, count: int) -> None:
        self._done += count
        self._share = self._start + min(1.0, self._done / self._total) * (self._end - self._start)
        self._report()

    def finish(self) -> None:
        self._callback(1.0, self._phase)  # too late to stop it

    def _report(self, *, always: bool = False) -> None:
        if not always and self._share < self._last_share + _NOTICEABLE:
            return
        self._last_share = self._share
        if self._callback(self._share, self._phase):
            raise RunStopped(f"stopped on request while {self._phase}, with {100.0 * self._share:.0f} % done")


_WATCHER: ContextVar[_Watcher | None] = ContextVar("_WATCHER", default=None)


@contextlib.contextmanager
def watched(progress: ProgressCallback | None, stretch: float = _STRETCH) -> Iterator[None]:
    """Report to a callback what is done within; None reports nothing.

    stretch : share of the phase still left that one stretch takes

    Raises RunStopped if the callback returned something true.
    """
    check_progress(progress)
    if progress is None:
        yield
        return
    watcher = _Watcher(progress, stretch)
    token = _WATCHER.set(watcher)
    try:
        yield
        watcher.finish()
    finally:
        _WATCHER.reset(token)


def begin(phase: str, total: int) -> None:
    """Begin a stretch of work of so many parts."""
    watcher = _WATCHER.get()
    if watcher is not None:
        watcher.begin(phase, total)


def advance(count: int) -> None:
    """Report that so many parts more are done."""
    watcher = _WATCHER.get()
    if watcher is not None:
        watcher.advance(count)
