"""Whether Ctrl-C was pressed, also where its exception was lost on the way.

Compiled modules that Ctrl-C interrupts while they are imported turn its KeyboardInterrupt into an error of their own.
"""

from __future__ import annotations

import signal
from types import FrameType

_PRESSED: list[int] = []


def listen() -> None:
    """Note Ctrl-C from now on, which still raises KeyboardInterrupt."""
    _PRESSED.clear()
    # Where the shell ignores Ctrl-C, as of commands in the background, it stays ignored.
    if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, _stop):
        signal.signal(signal.SIGINT, _stop)


def was_pressed() -> bool:
    """Whether Ctrl-C was pressed since `listen`: then an error is no more than how it ended what was going on."""
    return bool(_PRESSED)


def forget() -> None:
    """Make Python forget KeyboardInterrupt that was caught, so that it ends with the code that it is given.

    Where one has passed through text that a compiled module had run, `python -m` would end by the signal instead;
    running any text that ends well resets that.
    """
    import ctypes

    ctypes.pythonapi.PyRun_SimpleString(b"")


def stop_searches_on_ctrl_c() -> None:
    """Start function of a process that searches for plans: Ctrl-C ends its searches and nothing else."""
    from ..optimal_control.solver_callback import STOP_REQUESTED

    signal.signal(signal.SIGINT, lambda *_: STOP_REQUESTED.set())


def _stop(number: int, _: FrameType | None) -> None:
    _PRESSED.append(number)
    raise KeyboardInterrupt
