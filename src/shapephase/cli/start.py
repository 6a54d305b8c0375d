"""Where the program begins: it imports next to nothing, so that Ctrl-C ends it properly from the first moment."""

from __future__ import annotations

import sys

from . import ctrl_c

_STOPPED = 130


def run() -> None:
    """The command line, which Ctrl-C ends with one line and 130, also while it still imports what it needs."""
    ctrl_c.listen()
    try:
        from .main import main

        main()
    except KeyboardInterrupt:
        _end()
    except Exception:
        if not ctrl_c.was_pressed():
            raise
        _end()


def _end() -> None:
    ctrl_c.forget()
    print("shapephase: stopped", file=sys.stderr)
    raise SystemExit(_STOPPED)
