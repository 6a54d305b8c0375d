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

_STANDARD_OUTPUT = 1


class ExitCode(enum.IntEnum):
    """What the shell receives."""

    DONE = 0
    INTERNAL = 1
    USAGE = 2
    MODEL = 3
    TRAJECTORY = 4
    NUMERICS = 5
    OUTPUT = 6
    NOT_FOUND = 7
    STUDY = 8
    CLUSTER = 9
    WRONG = 10
    FAILED_CASES = 11
    OUT_OF_TIME = 124
    """As the command `timeout` ends."""
    STOPPED = 130
    """By Ctrl-C: 128 and the number of the signal, as shells have it."""
    BROKEN_PIPE = 141
    """128 and the number of SIGPIPE."""


MEANINGS = {
    ExitCode.DONE: "done",
    ExitCode.INTERNAL: "a bug of shapephase; -v shows where",
    ExitCode.USAGE: "usage: arguments, options, names, missing files",
    ExitCode.MODEL: "the body's file",
    ExitCode.TRAJECTORY: "the motion's file, or a motion that does not fit the body",
    ExitCode.NUMERICS: "numerics: singular inertia, accuracy not reached",
    ExitCode.OUTPUT: "output cannot be written",
    ExitCode.NOT_FOUND: "nothing found; the best try is written",
    ExitCode.STUDY: "a study's file, or a store of another study",
    ExitCode.CLUSTER: "no connection to the cluster; stored cases are kept",
    ExitCode.WRONG: "audit: the trajectory is wrong; the explanation is printed",
    ExitCode.FAILED_CASES: "failed cases in a study; the others are stored",
    ExitCode.OUT_OF_TIME: "time limit reached; the best result is written",
    ExitCode.STOPPED: "stopped by Ctrl-C; the best result of plan is written",
    ExitCode.BROKEN_PIPE: "the reader closed the pipe (SIGPIPE)",
}
"""One line for each code, in the help and in docs/howto/command_line.md."""


def exit_code_list() -> str:
    """Return the codes and their meanings as a list in Markdown."""
    return "\n".join(f"- {code.value}: {meaning}" for code, meaning in MEANINGS.items())


def exit_code_of(error: ShapePhaseError) -> ExitCode:
    """Return the code for an error of the library."""
    if isinstance(error, OutputFileError):
        return ExitCode.OUTPUT
    if isinstance(error, StudyError):
        return ExitCode.STUDY
    if isinstance(error, SchedulerLostError):
        return ExitCode.CLUSTER
    if isinstance(error, PlanNotFound):
        return ExitCode.NOT_FOUND
    if isinstance(error, TrajectoryError):
        return ExitCode.TRAJECTORY
    if isinstance(error, ModelFileError):
        return ExitCode.MODEL
    of_the_caller = ValueError | FileNotFoundError | ImportError | CompilerError
    return ExitCode.USAGE if isinstance(error, of_the_caller) else ExitCode.NUMERICS


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
