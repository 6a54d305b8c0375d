"""What a command hands back to be printed, and whether it can write what it was asked to."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputFileNotFoundError, UnknownNameError
from .exit_codes import ExitCode


@dataclass(frozen=True)
class Outcome:
    """The result of a command.

    Attributes
    ----------
    text : for people
    data : for programs, printed with `--json`
    with_verdict : whether a line at the end says that no fault was found, or how many warnings there are
    code : the exit code
    """

    text: str
    data: dict[str, Any]
    with_verdict: bool = False
    code: ExitCode = ExitCode.DONE


def check_writable(out: Path | None, option: str, *endings: str) -> None:
    """Raise UnknownNameError or InputFileNotFoundError for what cannot be written, before anything is computed."""
    if out is None:
        return
    if out.suffix not in endings:
        raise UnknownNameError(f"{option}: the file's name must end in {' or '.join(endings)}, got {str(out)!r}")
    if not out.absolute().parent.is_dir():
        raise InputFileNotFoundError(f"{out.parent}: there is no such folder to write {out.name} to")
