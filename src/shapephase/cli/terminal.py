"""What goes to standard output and standard error, and how much of it."""

from __future__ import annotations

import contextlib
import enum
import logging
import os
import sys
import unicodedata
from collections.abc import Iterator, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import TextIO

from ..errors import OutputFileError
from ..files import output_target, size_text

# Controls, marks that change the direction of writing, separators of lines, halves of surrogate pairs, unknown: a
# terminal would obey them, or cannot show them.
_UNPRINTABLE = frozenset({"Cc", "Cf", "Zl", "Zp", "Cs", "Cn"})


class Verbosity(enum.IntEnum):
    """How much is said on standard error."""

    QUIET = 0
    """Errors alone."""
    NORMAL = 1
    """Warnings and what was written, too."""
    VERBOSE = 2
    """What is done, too, and where a fault of ours lies."""


_VERBOSITY: ContextVar[Verbosity] = ContextVar("_VERBOSITY", default=Verbosity.NORMAL)


@contextlib.contextmanager
def spoken(words: Sequence[str]) -> Iterator[None]:
    """What is said on standard error while a command of these words runs: `-q`, `--quiet`, `-v`, `--verbose`."""
    quiet, verbose = {"-q", "--quiet"} & {*words}, {"-v", "--verbose"} & {*words}
    chosen = Verbosity.QUIET if quiet else Verbosity.VERBOSE if verbose else Verbosity.NORMAL
    token = _VERBOSITY.set(chosen)
    log = logging.getLogger("shapephase")
    before = log.level
    if quiet:
        log.setLevel(logging.ERROR)
    try:
        yield
    finally:
        log.setLevel(before)
        _VERBOSITY.reset(token)


def verbosity() -> Verbosity:
    """How much is said now."""
    return _VERBOSITY.get()


def say(line: str, least: Verbosity = Verbosity.NORMAL) -> None:
    """One line on standard error, from a verbosity on. Raises BrokenPipeError if nobody reads it."""
    if verbosity() < least or sys.stderr is None:
        return
    try:
        _write(sys.stderr, printable(line))
    except BrokenPipeError:
        raise
    except (OSError, ValueError):
        # There is nowhere left to say so.
        return


def say_written(path: Path) -> None:
    """What was written, and how large it is."""
    size = "" if output_target(path).is_stream else f" ({size_text(path)})"
    say(f"wrote {path}{size}")


def put(text: str, *, aside: bool = False) -> None:
    """The result of a command on standard output; `aside`, on standard error, where that is taken by a file.

    Raises
    ------
    OutputFileError
        If it cannot be written.
    BrokenPipeError
        If nobody reads it any more.
    """
    stream = sys.stderr if aside else sys.stdout
    if stream is None:
        raise OutputFileError("cannot write standard output: it is closed")
    try:
        _write(stream, "\n".join(map(printable, text.split("\n"))))
    except BrokenPipeError:
        raise
    except OSError as error:
        abandon(stream)
        raise OutputFileError(f"cannot write standard output: {error.strerror or error}") from None


def printable(line: str) -> str:
    """A line with what a terminal would obey, or could not show, written out."""
    if line.isascii() and line.isprintable():
        return line
    return "".join(
        letter.encode("unicode_escape").decode() if unicodedata.category(letter) in _UNPRINTABLE else letter
        for letter in line
    )


def one_line(error: Warning | BaseException | str) -> str:
    """A message in one line."""
    return " ".join(str(error).split())


def abandon(stream: TextIO | None) -> None:
    """Send what is still buffered nowhere, so that Python does not complain of it at its end."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())  # pyright: ignore[reportOptionalMemberAccess]
        os.close(nowhere)


def _write(stream: TextIO, text: str) -> None:
    """Write lines at once; letters that the stream's encoding does not have are written out."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(text.encode(encoding, "backslashreplace").decode(encoding) + "\n")
    stream.flush()
