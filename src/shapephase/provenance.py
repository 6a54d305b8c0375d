"""Where a result comes from: when, by which versions and which command line it was computed, and of what."""

from __future__ import annotations

import datetime
import os
import platform
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from . import __version__

_COMMAND: ContextVar[str | None] = ContextVar("command line", default=None)
_PACKAGES = ("numpy", "scipy", "pin")
"""That a result stands on."""
_EPOCH = "SOURCE_DATE_EPOCH"
"""Variable of the environment with the date that is to be said, in seconds since 1970: for files that do not change."""


@contextmanager
def command_line(words: Sequence[str]) -> Iterator[None]:
    """What is computed inside is the result of this command line, without the program's name."""
    token = _COMMAND.set(shlex.join(["shapephase", *words]))
    try:
        yield
    finally:
        _COMMAND.reset(token)


def provenance(made_from: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Where a result comes from, as JSON can hold it.

    Parameters
    ----------
    made_from : the body and its joints, the recording and what was done to it, files with their SHA-256

    Returns
    -------
    `date` (UTC), `command` (None in Python), `versions`, and what was given
    """
    return {
        "date": _date(),
        "command": _COMMAND.get(),
        "versions": {
            "shapephase": __version__,
            **{name: _version(name) for name in _PACKAGES},
            "python": platform.python_version(),
        },
        **({} if made_from is None else made_from),
    }


def _version(name: str) -> str | None:
    """Of an installed package; None where it was installed under another name."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _date() -> str:
    said = os.environ.get(_EPOCH, "")
    now = datetime.datetime.now(datetime.UTC)
    if said.isascii() and said.isdigit() and len(said) < 12:
        now = datetime.datetime.fromtimestamp(int(said), datetime.UTC)
    return now.isoformat(timespec="seconds")
