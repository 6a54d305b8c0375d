"""What a command hands back to be printed, and whether it can write what it was asked to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import UnknownNameError
from ..files import output_target
from .exit_codes import ExitCode

_STANDARD_OUTPUT = 1


@dataclass(frozen=True)
class Outcome:
    """The result of a command.

    Attributes
    ----------
    text : for people
    data : for programs, printed with `--json`
    with_verdict : whether a line at the end says that no fault was found, or how many warnings there are
    code : the exit code
    made_from : the body and the recording that it is about, for its provenance
    aside : whether standard output was taken by a file, so that the text goes to standard error
    """

    text: str
    data: dict[str, Any]
    with_verdict: bool = False
    code: ExitCode = ExitCode.DONE
    aside: bool = False
    made_from: Mapping[str, Any] = field(default_factory=dict)


def check_writable(out: Path | None, option: str, *endings: str) -> bool:
    """Look whether a file can be written, before anything is computed; returns whether it is standard output.

    A pipe or a device needs no ending, where there is one kind of file only. Raises UnknownNameError,
    InputFileNotFoundError, OutputFileError.
    """
    if out is None:
        return False
    target = output_target(out)
    if out.suffix.lower() not in endings and not (target.is_stream and len(endings) == 1):
        raise UnknownNameError(f"{option}: the file's name must end in {' or '.join(endings)}, got {str(out)!r}")
    return target.descriptor == _STANDARD_OUTPUT
