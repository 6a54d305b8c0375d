"""A progress bar for what takes more than two seconds, on a terminal only."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from .terminal import Verbosity, say, verbosity

_PATIENCE = 2.0  # [s] shorter work shows no progress bar


class Steps:
    """The steps of a longer work, one after the other.

    Parameters
    ----------
    total : how many there are
    display : what shows them (a `rich.progress.Progress`), or None: nothing is shown
    """

    def __init__(self, total: int, display: Any = None) -> None:
        self._display = display
        self._begun = 0
        self._task = None if display is None else display.add_task("", total=total)

    def begin(self, what: str) -> None:
        """The next step begins, and the one before is done; `what` it does is shown."""
        say(f"shapephase: {what}", Verbosity.VERBOSE)
        if self._display is None:
            return
        self._begun += 1
        self._display.update(self._task, description=what, completed=self._begun - 1)

    def watch(self, share: float, text: str) -> None:
        """Progress callback of the run that is the step under way: moves the bar within the step and shows the text."""
        if self._display is not None:
            self._display.update(self._task, description=text or None, completed=self._begun - 1 + share)

    def say(self, what: str) -> None:
        """Other words for the step under way."""
        if self._display is not None:
            self._display.update(self._task, description=what)


@contextmanager
def steps(total: int) -> Iterator[Steps]:
    """Show `total` steps on standard error once two seconds have passed; in a pipe or a file nothing is written."""
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
