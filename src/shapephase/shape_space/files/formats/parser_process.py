"""Parsers written in C that damaged files crash, or make ask for gigabytes: they run in a process of their own."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import TrajectoryError
from ....files import npz_arrays
from .._recording import MOST_BYTES

_SECONDS = 20
"""Time that parsing may take [s]; it only ends what would never end."""
_MEMORY = 3 * MOST_BYTES
"""Memory that a parser may take beyond its imports [bytes]: the file, what it holds, and both once more."""


def parsed(where: Path, data: bytes, kind: str, module: str) -> dict[str, Any]:
    """The arrays that the function `parse` of a module makes of a file's bytes.

    Raises TrajectoryError where the parser fails, crashes or does not end.
    """
    # Nothing is to be imported from the current folder.
    path = os.pathsep.join(entry for entry in sys.path if entry)
    command = [sys.executable, "-P", "-c", f"import {module} as m, {__name__} as p; p.answer(m.parse)"]
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "PYTHONPATH": path}
    try:
        child = subprocess.run(command, input=data, capture_output=True, timeout=_SECONDS, env=environment)
    except subprocess.TimeoutExpired:
        raise TrajectoryError(f"{where}: reading it took more than {_SECONDS} s and was stopped") from None
    if child.returncode:
        said = "".join(child.stderr.decode(errors="replace").strip().splitlines()[-1:])
        why = f"the parser crashed on it, signal {-child.returncode}" if child.returncode < 0 else said[:200]
        raise TrajectoryError(f"{where}: no {kind} file that can be read ({why})")
    return npz_arrays(child.stdout, 4 * MOST_BYTES)


def answer(parse: Callable[[bytes], Mapping[str, Any]]) -> None:
    """What the process does: a file comes through standard input, its arrays go to standard output."""
    data = sys.stdin.buffer.read()
    _limit_this_process()
    stream = io.BytesIO()
    np.savez(stream, **parse(data))
    sys.stdout.buffer.write(stream.getvalue())


def _limit_this_process() -> None:
    """No core dump, and not much more memory than what the imports took, where the system can do that."""
    try:
        import resource
    except ImportError:
        return
    try:
        size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    except OSError:
        return
    for kind, limit in ((resource.RLIMIT_CORE, 0), (resource.RLIMIT_AS, size + _MEMORY)):
        with contextlib.suppress(ValueError, OSError):
            resource.setrlimit(kind, (limit, resource.getrlimit(kind)[1]))
