"""Standard output and standard error of the commands, and the verbosity."""

from __future__ import annotations

import contextlib
import enum
import logging
import os
import sys
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import TextIO

from ..errors import OutputFileError
from ..files import output_target, size_text

# Controls, marks that change the direction of writing, separators of lines, halves of surrogate pairs, unknown: a
# terminal would obey them, or cannot show them.
_UNPRINTABLE = frozenset({"Cc", "Cf", "Zl", "Zp", "Cs", "Cn"})


class Verbosity(enum.IntEnum):
    """Amount of text on standard error."""

    QUIET = 0
    """Errors."""
    NORMAL = 1
    """Errors, warnings, files written."""
    VERBOSE = 2
    """Also each step, and tracebacks of bugs."""


_VERBOSITY: ContextVar[Verbosity] = ContextVar("_VERBOSITY", default=Verbosity.NORMAL)


@contextlib.contextmanager
def verbosity_from(words: Sequence[str]) -> Iterator[None]:
    """Set the verbosity by `-q`, `--quiet`, `-v` or `--verbose` among the words while a command runs."""
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
    """Return the verbosity of the running command."""
    return _VERBOSITY.get()


def say(line: str, least: Verbosity = Verbosity.NORMAL) -> None:
    """Print one line on standard error, from a verbosity on. Raises BrokenPipeError if the reader closed the pipe."""
    if verbosity() < least or sys.stderr is None:
        return
    try:
        _write(sys.stderr, printable(line))
    except BrokenPipeError:
        raise
    except (OSError, ValueError):
        return  # no stream is left to report it


def write_file(path: Path | None, write: Callable[[Path], object]) -> None:
    """Write a file, where one is wanted, and report it with its size."""
    if path is not None:
        write(path)
        say_written(path)


def say_written(path: Path) -> None:
    """Report a file that was written, and its size."""
    size = "" if output_target(path).is_stream else f" ({size_text(path)})"
    say(f"wrote {path}{size}")


def put(text: str, *, aside: bool = False) -> None:
    """Print the result of a command on standard output, or `aside` on standard error where a file takes that.

    Raises
    ------
    OutputFileError
        If it cannot be written.
    BrokenPipeError
        If the reader closed the pipe.
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
    """Return a line with escapes for characters that a terminal would obey or cannot show."""
    if line.isascii() and line.isprintable():
        return line
    return "".join(
        letter.encode("unicode_escape").decode() if unicodedata.category(letter) in _UNPRINTABLE else letter
        for letter in line
    )


def one_line(error: Warning | BaseException | str) -> str:
    """Return a message as one line."""
    return " ".join(str(error).split())


def abandon(stream: TextIO | None) -> None:
    """Discard what is still buffered, so that Python reports no error at exit."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())  # pyright: ignore[reportOptionalMemberAccess]
        os.close(nowhere)


def _write(stream: TextIO, text: str) -> None:
    """Write a line at once, with escapes for characters that the stream's encoding does not have."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(text.encode(encoding, "backslashreplace").decode(encoding) + "\n")
    stream.flush()
