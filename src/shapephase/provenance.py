"""Provenance of a result: date, versions, command line and inputs."""

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
_PACKAGES = ("numpy", "scipy", "pin")  # that determine a result
_EPOCH = "SOURCE_DATE_EPOCH"  # environment variable with the date [s since 1970], for reproducible files


@contextmanager
def command_line(words: Sequence[str]) -> Iterator[None]:
    """Record a command line, without the program's name, for results computed inside."""
    token = _COMMAND.set(shlex.join(["shapephase", *words]))
    try:
        yield
    finally:
        _COMMAND.reset(token)


def provenance(made_from: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the provenance of a result, as JSON can hold it.

    Parameters
    ----------
    made_from : the body and its joints, the recording and its processing, files with their SHA-256

    Returns
    -------
    `date` (UTC), `command` (None in Python), `versions`, and `made_from`
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
    """Version of an installed package; None where it is not known under this name."""
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _date() -> str:
    seconds = os.environ.get(_EPOCH, "")
    now = datetime.datetime.now(datetime.UTC)
    if seconds.isascii() and seconds.isdigit() and len(seconds) < 12:
        now = datetime.datetime.fromtimestamp(int(seconds), datetime.UTC)
    return now.isoformat(timespec="seconds")
