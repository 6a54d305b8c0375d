"""Start of the program, and Ctrl-C: it imports next to nothing, so that Ctrl-C ends it properly from the first moment.

Compiled modules that Ctrl-C interrupts while they are imported turn its KeyboardInterrupt into an error of their own.
"""

from __future__ import annotations

import signal
import sys
from types import FrameType

_STOPPED = 130  # exit code after Ctrl-C: 128 and the number of the signal
_PRESSED: list[int] = []


def run() -> None:
    """Run the command line; Ctrl-C ends it with one line and exit code 130, also during imports."""
    _PRESSED.clear()
    # Where the shell ignores Ctrl-C, in commands in the background, it stays ignored.
    if signal.getsignal(signal.SIGINT) in (signal.default_int_handler, _stop):
        signal.signal(signal.SIGINT, _stop)
    try:
        from .main import main

        main()
    except KeyboardInterrupt:
        _end()
    except Exception:
        if not was_pressed():
            raise
        _end()


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


def stop_searches_on_ctrl_c() -> None:
    """Start a process that searches for plans: Ctrl-C ends its searches and nothing else."""
    from ..optimal_control.solver_callback import STOP_REQUESTED

    signal.signal(signal.SIGINT, lambda *_: STOP_REQUESTED.set())


def _stop(number: int, _: FrameType | None) -> None:
    _PRESSED.append(number)
    raise KeyboardInterrupt


def _end() -> None:
    forget()
    print("shapephase: stopped", file=sys.stderr)
    raise SystemExit(_STOPPED)
