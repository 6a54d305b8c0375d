"""Result of a command, its exit code, and the check that its files can be written."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import (
    CompilerError,
    ModelFileError,
    OutputFileError,
    PlanNotFound,
    SchedulerLostError,
    ShapePhaseError,
    StudyError,
    TrajectoryError,
    UnknownNameError,
)
from ..files import output_target

FIGURE_ENDINGS = (".svg", ".pdf", ".png")
FIGURE_HEIGHT = 2.8  # [in] of a figure one column wide
_STANDARD_OUTPUT = 1


class ExitCode(enum.IntEnum):
    """Exit code of the program: number and meaning, in the help and in docs/howto/command_line.md."""

    meaning: str

    def __new__(cls, number: int, meaning: str) -> ExitCode:
        """Return a member with its meaning."""
        code = int.__new__(cls, number)
        code._value_, code.meaning = number, meaning
        return code

    DONE = 0, "done"
    INTERNAL = 1, "a bug of shapephase; -v shows where"
    USAGE = 2, "usage: arguments, options, names, missing files"
    MODEL = 3, "the body's file"
    TRAJECTORY = 4, "the motion's file, or a motion that does not fit the body"
    NUMERICS = 5, "numerics: singular inertia, accuracy not reached"
    OUTPUT = 6, "output cannot be written"
    NOT_FOUND = 7, "nothing found; the best try is written"
    STUDY = 8, "a study's file, or a store of another study"
    CLUSTER = 9, "no connection to the cluster; stored cases are kept"
    WRONG = 10, "audit: the trajectory is wrong; the explanation is printed"
    FAILED_CASES = 11, "failed cases in a study; the others are stored"
    UNDECIDED = 12, "audit: the samples cannot tell; a fault beyond the tolerance would not show"
    OUT_OF_TIME = 124, "time limit reached; the best result is written"
    STOPPED = 130, "stopped by Ctrl-C; the best result of plan is written"
    BROKEN_PIPE = 141, "the reader closed the pipe (SIGPIPE)"


# The first of these that fits an error of the library gives the code.
_CODES: tuple[tuple[type[Exception] | tuple[type[Exception], ...], ExitCode], ...] = (
    (OutputFileError, ExitCode.OUTPUT),
    (StudyError, ExitCode.STUDY),
    (SchedulerLostError, ExitCode.CLUSTER),
    (PlanNotFound, ExitCode.NOT_FOUND),
    (TrajectoryError, ExitCode.TRAJECTORY),
    (ModelFileError, ExitCode.MODEL),
    ((ValueError, FileNotFoundError, ImportError, CompilerError), ExitCode.USAGE),
)


def exit_code_of(error: ShapePhaseError) -> ExitCode:
    """Return the code for an error of the library."""
    return next((code for kinds, code in _CODES if isinstance(error, kinds)), ExitCode.NUMERICS)


@dataclass(frozen=True)
class Outcome:
    """The result of a command.

    Attributes
    ----------
    text : for people
    data : for programs, printed with `--json`
    with_verdict : whether a line at the end says OK, or how many warnings there are
    code : the exit code
    made_from : joints and recording, for the provenance
    aside : whether a file takes standard output, so that the text goes to standard error
    """

    text: str
    data: dict[str, Any]
    with_verdict: bool = False
    code: ExitCode = ExitCode.DONE
    aside: bool = False
    made_from: Mapping[str, Any] = field(default_factory=dict)


def check_writable(out: Path | None, option: str, *endings: str) -> bool:
    """Check that a file can be written, before anything is computed; return whether it is standard output.

    A pipe or a device needs no ending, where there is one kind of file only. Raises UnknownNameError,
    InputFileNotFoundError, OutputFileError.
    """
    if out is None:
        return False
    target = output_target(out)
    if out.suffix.lower() not in endings and not (target.is_stream and len(endings) == 1):
        raise UnknownNameError(f"{option}: the file's name must end in {' or '.join(endings)}, got {str(out)!r}")
    return target.descriptor == _STANDARD_OUTPUT
