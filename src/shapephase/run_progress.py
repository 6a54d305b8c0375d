"""What a long run has done so far, told to whoever asked, who may stop it.

A run does not know how much is before it: how many halvings a path takes, how often samples are added, whether a second
round of steps is needed. So every stretch of work fills a part of what is left of its phase, and every phase a part of
what is left of the run: the share grows as long as something is done, and reaches one at the end.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from .errors import RunStopped, WrongObjectError
from .letters import what_came

LOOKING = "looking at the path"
SAMPLING = "sampling the body"
STEPPING = "stepping"
# Of what is left of a run: what a phase takes, by what it usually is.
_PHASES = {LOOKING: 0.2, SAMPLING: 0.5, STEPPING: 0.9}
# Of what is left of a phase: what one stretch takes, since there may be others.
_STRETCH = 0.7
# Of the run: smaller progress is not reported.
_NOTICEABLE = 0.005


@dataclass(frozen=True)
class RunProgress:
    """What a run has done.

    Attributes
    ----------
    share : done so far, from 0 to 1
    phase : "looking at the path", "sampling the body" or "stepping"
    """

    share: float
    phase: str


class _Watcher:
    """Passes on to a callback what has been done."""

    def __init__(self, callback: Callable[[RunProgress], Any]) -> None:
        self._callback = callback
        self._phase, self._phase_end = "", 0.0
        self._share = self._start = self._end = 0.0
        self._total = self._done = 0
        self._last_share = -1.0

    def begin(self, phase: str, total: int) -> None:
        """A stretch of work begins."""
        self._share = max(self._share, self._end)
        is_new = phase != self._phase
        if is_new:
            self._phase, self._phase_end = phase, self._share + _PHASES[phase] * (1.0 - self._share)
        self._start, self._end = self._share, self._share + _STRETCH * (self._phase_end - self._share)
        self._total, self._done = total, 0
        if is_new or self._share >= self._last_share + _NOTICEABLE:
            self._report(self._share)

    def advance(self, count: int) -> None:
        """So much more of it is done."""
        self._done += count
        self._share = self._start + min(1.0, self._done / self._total) * (self._end - self._start)
        if self._share >= self._last_share + _NOTICEABLE:
            self._report(self._share)

    def finish(self) -> None:
        """The run is done: too late to stop it."""
        self._callback(RunProgress(1.0, self._phase))

    def _report(self, share: float) -> None:
        self._last_share = share
        if self._callback(RunProgress(share, self._phase)):
            raise RunStopped(f"stopped on request while {self._phase}, with {100.0 * share:.0f} % done")


_WATCHER: ContextVar[_Watcher | None] = ContextVar("_WATCHER", default=None)


def watched(callback: Callable[[RunProgress], Any] | None) -> contextlib.AbstractContextManager[None]:
    """Pass on to a callback, if there is one, what is done within; something true that it returns stops the run.

    Raises
    ------
    RunStopped
        If the callback asked for it.
    """
    return _UNWATCHED if callback is None else _watched(callback)


_UNWATCHED = contextlib.nullcontext()


@contextlib.contextmanager
def _watched(callback: Callable[[RunProgress], Any]) -> Iterator[None]:
    if not callable(callback) or isinstance(callback, type):
        raise WrongObjectError(f"progress: a function of a RunProgress is needed, got {what_came(callback)}")
    watcher = _Watcher(callback)
    token = _WATCHER.set(watcher)
    try:
        yield
        watcher.finish()
    finally:
        _WATCHER.reset(token)


def begin(phase: str, total: int) -> None:
    """A stretch of work in so many parts begins."""
    watcher = _WATCHER.get()
    if watcher is not None:
        watcher.begin(phase, total)


def advance(count: int) -> None:
    """So many parts more are done."""
    watcher = _WATCHER.get()
    if watcher is not None:
        watcher.advance(count)
