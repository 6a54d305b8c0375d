"""What viser prints when its server starts and stops is dropped, and nothing that any other thread prints."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from typing import Any
from weakref import WeakSet

# Threads whose words to rich's console are dropped: of servers of ours, as long as they live.
_SERVER_THREADS: WeakSet[threading.Thread] = WeakSet()
_here = threading.local()
_installing = threading.Lock()
_hook: Any = None


@contextlib.contextmanager
def silenced() -> Iterator[None]:
    """What this thread prints by rich's console is dropped; the streams of the process stay as they are."""
    _install()
    before = getattr(_here, "silent", False)
    _here.silent = True
    try:
        yield
    finally:
        _here.silent = before


def silence_thread_of(server: Any) -> None:
    """Drop also what the thread of a viser server prints, which says so when it ends."""
    thread = getattr(getattr(server, "_websock_server", None), "_server_thread", None)
    if thread is not None:
        _SERVER_THREADS.add(thread)


def _install() -> None:
    """Make rich's console ask before it prints; again, if the user has configured another."""
    global _hook
    import rich
    from rich.console import RenderHook

    class Silence(RenderHook):
        def process_renderables(self, renderables: list[Any]) -> list[Any]:
            silent = getattr(_here, "silent", False) or threading.current_thread() in _SERVER_THREADS
            return [] if silent else renderables

    with _installing:
        console = rich.get_console()
        _hook = _hook or Silence()
        if _hook not in getattr(console, "_render_hooks", ()):
            console.push_render_hook(_hook)
