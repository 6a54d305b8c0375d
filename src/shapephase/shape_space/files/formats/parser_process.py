"""Other libraries: their faults as ours, and a parser in C++ that aborts Python in a process of its own."""

from __future__ import annotations

import io
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ....child_process import limit_this_process, run_alone
from ....errors import MissingExtraError, ShapePhaseError, TrajectoryError

_SECONDS = 30  # [s] imports and file: the largest take five, damaged ones forever
_MEMORY = 2**30  # [bytes] beyond the imports: damaged headers make ezc3d request any amount


@contextmanager
def by_library(where: Path, kind: str, packages: str, remedy: str = "export it anew") -> Iterator[None]:
    """Context in which packages read a file of some kind: what they raise becomes an error of ours with the remedy."""
    try:
        yield
    except ImportError:
        message = f"{kind}s need {packages}; install with: pip install 'shapephase[data]'"
        raise MissingExtraError(message) from None
    except ShapePhaseError:
        raise
    except Exception as error:  # a damaged file fails inside other libraries in many ways
        message = f"{where}: no {kind} that can be read ({type(error).__name__}: {error!s:.200}); {remedy}"
        raise TrajectoryError(message) from None


def parsed(where: Path, data: bytes, kind: str, module: str) -> dict[str, Any]:
    """Arrays that the function `parse` of a module makes of a file's bytes."""
    source = f"import {module} as m, {__name__} as p; p.print_arrays(m.parse)"
    try:
        child = run_alone(source, (), data, _SECONDS)
    except subprocess.TimeoutExpired:
        raise TrajectoryError(
            f"{where}: reading it took more than {_SECONDS} s and was stopped; export it anew"
        ) from None
    if child.returncode:
        message = "".join(child.stderr.decode(errors="replace").strip().splitlines()[-1:])
        why = f"the parser crashed on it, signal {-child.returncode}" if child.returncode < 0 else message[:200]
        raise TrajectoryError(f"{where}: no {kind} file that can be read ({why}); export it anew")
    with np.load(io.BytesIO(child.stdout)) as arrays:
        return dict(arrays)


def print_arrays(parse: Callable[[bytes], Mapping[str, Any]]) -> None:
    """Parse the file that comes through standard input, and print its arrays."""
    data, stream = sys.stdin.buffer.read(), io.BytesIO()
    limit_this_process(_MEMORY)
    np.savez(stream, **parse(data))
    sys.stdout.buffer.write(stream.getvalue())
