"""How the command line ends: one code for each kind of fault."""

from __future__ import annotations

import enum

from ..errors import CompilerError, ModelFileError, ShapePhaseError, TrajectoryError


class ExitCode(enum.IntEnum):
    """What the shell sees."""

    DONE = 0
    USAGE = 2
    MODEL = 3
    TRAJECTORY = 4
    NUMERICS = 5
    STOPPED = 130
    """By Ctrl-C: 128 and the number of the signal, as shells have it."""


def exit_code_of(error: ShapePhaseError) -> ExitCode:
    """The code for an error of the library."""
    if isinstance(error, TrajectoryError):
        return ExitCode.TRAJECTORY
    if isinstance(error, ModelFileError):
        return ExitCode.MODEL
    of_the_caller = ValueError | FileNotFoundError | ImportError | CompilerError
    return ExitCode.USAGE if isinstance(error, of_the_caller) else ExitCode.NUMERICS
