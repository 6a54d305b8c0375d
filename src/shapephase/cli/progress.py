"""Progress bar of commands that take more than two seconds, on a terminal only."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .terminal import Verbosity, say, verbosity

_PATIENCE = 2.0  # [s] shorter work shows no progress bar


class Steps:
    """Steps of a command, one after the other.

    Parameters
    ----------
    total : number of steps
    display : a `rich.progress.Progress`; None: nothing is shown
    """

    def __init__(self, total: int, display: Any = None) -> None:
        self._display = display
        self._begun = 0
        self._task = None if display is None else display.add_task("", total=total)

    def begin(self, what: str) -> None:
        """Begin the next step, described by `what`."""
        say(f"shapephase: {what}", Verbosity.VERBOSE)
        if self._display is None:
            return
        self._begun += 1
        self._display.update(self._task, description=what, completed=self._begun - 1)

    def watch(self, share: float, text: str) -> None:
        """Progress callback of the run in this step: move the bar within the step and show the text."""
        if self._display is not None:
            self._display.update(self._task, description=text or None, completed=self._begun - 1 + share)

    def say(self, what: str) -> None:
        """Change the description of this step."""
        if self._display is not None:
            self._display.update(self._task, description=what)


@contextmanager
def steps(total: int) -> Iterator[Steps]:
    """Yield steps that are shown on a terminal once two seconds have passed."""
    if sys.stderr is None or not sys.stderr.isatty() or verbosity() is not Verbosity.NORMAL:
        yield Steps(total)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(bar_width=24), TextColumn("{task.description}"), TimeElapsedColumn())
    display = Progress(*columns, console=Console(stderr=True), transient=True)
    timer = threading.Timer(_PATIENCE, display.start)
    timer.daemon = True
    timer.start()
    try:
        yield Steps(total, display)
    finally:
        timer.cancel()
        timer.join()
        display.stop()
