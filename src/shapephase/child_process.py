"""Python in a process of its own, for parsers that crash, hang or ask for gigabytes on damaged files; with limits."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, cast

_ONE_THREAD = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"), "1")


def start_python(
    source: str, words: tuple[str, ...] = (), *, folder: bool = False, **options: Any
) -> subprocess.Popen[bytes]:
    """Start Python's `source` in a process that imports from where this one does and whose BLAS has one thread.

    Parameters
    ----------
    words : its arguments
    folder : whether it imports from the current folder, too, where functions of a user may be
    options : further arguments of `subprocess.Popen`
    """
    path = os.pathsep.join(entry or os.getcwd() for entry in sys.path if entry or folder)
    environment = {**os.environ, **_ONE_THREAD, "PYTHONPATH": path}
    command = [sys.executable, "-P", "-c", source, *words]
    return cast("subprocess.Popen[bytes]", subprocess.Popen(command, env=environment, **options))


def run_alone(source: str, words: tuple[str, ...], data: bytes, seconds: float) -> subprocess.CompletedProcess[bytes]:
    """Run Python's `source` in a process of its own, with `words` as its arguments and `data` as standard input.

    Raises subprocess.TimeoutExpired, after the process was stopped, if it takes longer than `seconds`.
    """
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    with start_python(source, words, **pipes) as process:
        try:
            output, errors = process.communicate(data, timeout=seconds)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(process.args, process.returncode, output, errors)


def limit_this_process(memory: int) -> None:
    """Forbid core dumps and more memory [bytes] than is mapped now and `memory`, where the system can do that."""
    try:
        import resource
    except ImportError:
        return
    limits = {resource.RLIMIT_CORE: 0}
    # Without /proc it is not known what is mapped, and a limit below that would refuse everything.
    with contextlib.suppress(OSError):
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limits[resource.RLIMIT_AS] = pages * resource.getpagesize() + memory
    for kind, limit in limits.items():
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(kind, (limit, resource.getrlimit(kind)[1]))
