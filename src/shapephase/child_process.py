"""Processes of their own for parsers that damaged files crash, hang, or make ask for gigabytes; with limits."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path


def run_alone(source: str, words: tuple[str, ...], data: bytes, seconds: float) -> subprocess.CompletedProcess[bytes]:
    """Run Python's `source` in a process of its own, with `words` as its arguments and `data` as standard input.

    Raises subprocess.TimeoutExpired, after the process was stopped, if it takes longer than `seconds`.
    """
    # Nothing is to be imported from the current folder.
    path = os.pathsep.join(entry for entry in sys.path if entry)
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONPATH": path}
    command = [sys.executable, "-P", "-c", source, *words]
    return subprocess.run(command, input=data, capture_output=True, timeout=seconds, env=environment)


def limit_this_process(memory: int) -> None:
    """No core dump, and only so much more memory [bytes] than is mapped now, where the system can do that."""
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
