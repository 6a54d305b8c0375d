"""Ctrl-C: an interrupted import, a search that ends early, processes that go on; this imports next to nothing.

Compiled modules that Ctrl-C interrupts while they are imported turn its KeyboardInterrupt into an error of their own.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType
from typing import Any

_PRESSED: list[int] = []


def note_when_pressed() -> None:
    """Note Ctrl-C from now on, and raise KeyboardInterrupt as Python does; where the shell ignores it, it stays so."""
    _PRESSED.clear()
    if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, _stop):
        signal.signal(signal.SIGINT, _stop)


def was_pressed() -> bool:
    """True after Ctrl-C: then an error is no more than how it ended what was going on."""
    return bool(_PRESSED)


def forget() -> None:
    """Make Python forget KeyboardInterrupt that was caught, so that it ends with the given exit code.

    Where one has passed through text that a compiled module had run, `python -m` would end by the signal instead;
    running any text that ends well resets that.
    """
    import ctypes

    ctypes.pythonapi.PyRun_SimpleString(b"")


@contextlib.contextmanager
def handled_by(handler: Any) -> Iterator[None]:
    """Install a handler of Ctrl-C; in other threads than the main one Python delivers none."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def stop_searches() -> None:
    """Start a process that searches for plans: Ctrl-C ends its searches and nothing else."""
    from ..optimal_control.solver_callback import STOP_REQUESTED

    signal.signal(signal.SIGINT, lambda *_: STOP_REQUESTED.set())


def _stop(number: int, _: FrameType | None) -> None:
    _PRESSED.append(number)
    raise KeyboardInterrupt
