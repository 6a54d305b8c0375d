"""Start of the program: it imports next to nothing, so that Ctrl-C ends it properly from the first moment."""

from __future__ import annotations

import sys

from .ctrl_c import forget, note_when_pressed, was_pressed

_STOPPED = 130  # exit code after Ctrl-C: 128 and the number of the signal


def run() -> None:
    """Run the command line; Ctrl-C ends it with one line and exit code 130, also during imports."""
    note_when_pressed()
    try:
        from .main import main

        main()
    except (KeyboardInterrupt, Exception) as error:
        if not isinstance(error, KeyboardInterrupt) and not was_pressed():
            raise
        forget()
        print("shapephase: stopped", file=sys.stderr)
        raise SystemExit(_STOPPED) from None
