"""Warnings of other packages set aside, by one thread at a time: Python's filters belong to the process."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

ONE_THREAD = threading.RLock()
"""Held while filters are changed. A thread that changes them beside another one puts back what that one had set."""


@contextmanager
def quiet(message: str = "", category: type[Warning] = Warning, module: str = "") -> Iterator[None]:
    """Ignore warnings that begin with a message, of a category, from a module; by default all of them."""
    with ONE_THREAD, warnings.catch_warnings():
        warnings.filterwarnings("ignore", message, category, module)
        yield
