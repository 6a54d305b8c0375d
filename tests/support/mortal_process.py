"""A command that ends with the process that started it, also where that one is killed: nothing of a test stays behind.

Run as a script, with the id of the process that starts it, this becomes the command.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

# Of Linux, <sys/prctl.h>: the signal that comes when the thread ends that started this process.
_PR_SET_PDEATHSIG = 1


def started(
    command: Sequence[str], folder: Path, environment: Mapping[str, str], **streams: Any
) -> subprocess.Popen[Any]:
    """The command as a process."""
    words = [sys.executable, __file__, str(os.getpid()), *command]
    return subprocess.Popen(words, cwd=folder, env=dict(environment), **streams)


def _become(parent: int, command: Sequence[str]) -> None:
    """Other systems than Linux have no such signal."""
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    # It may have ended in between.
    if os.getppid() == parent:
        os.execv(command[0], command)


if __name__ == "__main__":
    _become(int(sys.argv[1]), sys.argv[2:])
