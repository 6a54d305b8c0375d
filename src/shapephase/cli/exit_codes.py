"""How the command line ends: one code for each kind of fault."""

from __future__ import annotations

import enum

from ..errors import (
    CompilerError,
    ModelFileError,
    OutputFileError,
    PlanNotFound,
    SchedulerLostError,
    ShapePhaseError,
    StudyError,
    TrajectoryError,
)


class ExitCode(enum.IntEnum):
    """What the shell sees."""

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
    """128 and the number of SIGPIPE: what reads the output wants no more of it."""


MEANINGS = {
    ExitCode.DONE: "done",
    ExitCode.INTERNAL: "a fault of shapephase itself; -v shows where",
    ExitCode.USAGE: "usage: arguments, options, names, files that are not there",
    ExitCode.MODEL: "the body's file",
    ExitCode.TRAJECTORY: "the motion's file, or a motion that does not fit",
    ExitCode.NUMERICS: "numerics: singular inertia, accuracy not reached",
    ExitCode.OUTPUT: "output that cannot be written",
    ExitCode.NOT_FOUND: "a search that found nothing; the best try is written",
    ExitCode.STUDY: "a study's file, or the store of another study",
    ExitCode.CLUSTER: "a cluster that cannot be reached, or not any more; what is stored is kept",
    ExitCode.WRONG: "an audit that found a trajectory wrong; what explains it is written",
    ExitCode.FAILED_CASES: "a study with failed cases; the others are stored",
    ExitCode.OUT_OF_TIME: "a search that its time limit ended; the best so far is written",
    ExitCode.STOPPED: "stopped by Ctrl-C; of plan, the best so far is written",
    ExitCode.BROKEN_PIPE: "what reads the output wants no more of it",
}
"""One line for each code, in the help and in docs/howto/command_line.md."""


def exit_code_list() -> str:
    """The codes and their meanings, as a list in Markdown."""
    return "\n".join(f"- {code.value}: {meaning}" for code, meaning in MEANINGS.items())


def exit_code_of(error: ShapePhaseError) -> ExitCode:
    """The code for an error of the library."""
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
