"""How much work a call is, counted in pieces of work of known size: seconds would depend on the machine and the day."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

MOST_LOADS = 100.0
"""The most reference loads that reading any file may take; the largest files we accept take about twenty."""


class TooMuchWork(AssertionError):
    """More reference loads than `MOST_LOADS`."""


class Effort:
    """The processor time of some work in multiples of that of the reference load, measured in the same process."""

    def __init__(self) -> None:
        self._reference = _reference_seconds()

    @contextmanager
    def limited(self) -> Iterator[None]:
        """What is done inside takes at most `MOST_LOADS`, or TooMuchWork is raised."""
        start = time.process_time()
        try:
            yield
        finally:
            seconds = time.process_time() - start
        if seconds > MOST_LOADS * self._reference:
            # The machine may have become slower since the reference was measured.
            self._reference = max(self._reference, _reference_seconds())
        if seconds > MOST_LOADS * self._reference:
            raise TooMuchWork(f"{seconds / self._reference:.0f} reference loads; {MOST_LOADS:.0f} are allowed")


def _reference_seconds() -> float:
    """Parse 250,000 numbers: interpreter, allocator and memory are used as readers of files use them."""
    start = time.process_time()
    for word in ("0.125 " * 250_000).split():
        float(word)
    return time.process_time() - start
