"""Where the program begins: it imports next to nothing, so that Ctrl-C ends it properly from the first moment."""

from __future__ import annotations

import signal
import sys
from types import FrameType

_STOPPED = 130


def run() -> None:
    """The command line, which Ctrl-C ends with one line and 130, also while it still imports what it needs."""
    pressed: list[int] = []

    def stop(number: int, _: FrameType | None) -> None:
        pressed.append(number)
        raise KeyboardInterrupt

    # Where the shell ignores Ctrl-C, as of commands in the background, it stays ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, stop)
    try:
        from .main import main

        main()
    except KeyboardInterrupt:
        _end()
    except Exception:
        # Compiled modules turn what interrupts their import into errors of their own.
        if not pressed:
            raise
        _end()


def _end() -> None:
    print("shapephase: stopped", file=sys.stderr)
    raise SystemExit(_STOPPED)
