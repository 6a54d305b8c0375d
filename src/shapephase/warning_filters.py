"""Warnings of other packages ignored, by one thread at a time: Python's filters belong to the process."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

ONE_THREAD = threading.RLock()
"""Held while filters are changed: otherwise a thread would restore the filters of another."""


@contextmanager
def quiet(message: str = "", category: type[Warning] = Warning, module: str = "") -> Iterator[None]:
    """Ignore warnings that begin with a message, of a category, from a module; by default all of them."""
    with ONE_THREAD, warnings.catch_warnings():
        warnings.filterwarnings("ignore", message, category, module)
        yield
