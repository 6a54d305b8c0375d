"""Parsers written in C that damaged files crash, or make ask for gigabytes: they run in a process of their own."""

from __future__ import annotations

import io
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ....child_process import limit_this_process, run_alone
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
    try:
        child = run_alone(f"import {module} as m, {__name__} as p; p.answer(m.parse)", (), data, _SECONDS)
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
    limit_this_process(_MEMORY)
    stream = io.BytesIO()
    np.savez(stream, **parse(data))
    sys.stdout.buffer.write(stream.getvalue())
