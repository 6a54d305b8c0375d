"""Parsers written in C that damaged files crash, or make ask for gigabytes: they run in a process of their own."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .... import errors
from ....child_process import limit_this_process, run_alone
from ....errors import ShapePhaseError, TrajectoryError
from ....files import npz_arrays
from .._recording import MOST_BYTES, Table

_SECONDS = 180
"""Time that parsing may take [s of the clock]; it only ends what waits."""
_MEMORY = 3 * MOST_BYTES
"""Memory that a parser may take beyond its imports [bytes]: the file, what it holds, and both once more."""

_PROCESSOR_SECONDS = 8
"""Processor time of a reader, imports not counted [s]: the largest tables take five."""
_DESCRIPTION = "description"
"""The array of text beside those of numbers."""


def parsed(where: Path, data: bytes, kind: str, module: str) -> dict[str, Any]:
    """The arrays that the function `parse` of a module makes of a file's bytes.

    Raises TrajectoryError where the parser fails, crashes or does not end.
    """
    return _arrays(where, data, kind, f"import {module} as m, {__name__} as p; p.answer(m.parse)", ())


def table_apart(where: Path, data: bytes, kind: str, reader: Callable[..., Table], part: str | None = None) -> Table:
    """The table that a reader makes of a file's bytes, in a process of its own.

    Parameters
    ----------
    reader : a function at the top of a module, of the file's name, its bytes and, where it is given, `part`

    Raises the errors of the reader, and TrajectoryError where it crashes or takes too much time or memory.
    """
    source = f"import {reader.__module__} as m, {__name__} as p; p.answer_with_table(m.{reader.__name__})"
    arrays = _arrays(where, data, kind, source, (str(where), json.dumps(part)))
    described = json.loads(str(arrays[_DESCRIPTION]))
    if "error" in described:
        raise getattr(errors, described["error"])(described["message"])
    columns = {label: arrays[f"column_{k}"] for k, label in enumerate(described["labels"])}
    kept = described.pop("faults").items()
    faults = {label: {int(row): text for row, text in found.items()} for label, found in kept}
    names = ("base_quat_xyzw", "base_position", "times", "clock", "rows")
    others = {name: arrays[name] for name in names if name in arrays}
    others["rows"] = others["rows"].tolist()
    described.pop("labels")
    return Table(columns=columns, faults=faults, **others, **described)


def answer_with_table(reader: Callable[..., Table]) -> None:
    """What that process does: a file comes through standard input, its table goes to standard output."""
    where, part = Path(sys.argv[1]), json.loads(sys.argv[2])
    data = sys.stdin.buffer.read()
    limit_this_process(_MEMORY, _PROCESSOR_SECONDS)
    arrays: dict[str, Any] = {}
    try:
        table = reader(where, data) if part is None else reader(where, data, part)
    except ShapePhaseError as error:
        described: dict[str, Any] = {"error": type(error).__name__, "message": str(error)}
    else:
        described = {name: getattr(table, name) for name in ("where", "format", "row", "by_format", "degrees")}
        described |= {"unread": dict(table.unread), "unnamed": list(table.unnamed)}
        described |= {"labels": list(table.columns), "units": dict(table.units)}
        described["faults"] = {label: dict(found) for label, found in table.faults.items()}
        arrays = {f"column_{k}": values for k, values in enumerate(table.columns.values())}
        arrays["rows"] = np.array(table.rows, dtype=np.int64)
        for name in ("base_quat_xyzw", "base_position", "times", "clock"):
            if getattr(table, name) is not None:
                arrays[name] = getattr(table, name)
    stream = io.BytesIO()
    arrays[_DESCRIPTION] = np.array(json.dumps(described))
    np.savez(stream, **arrays)
    sys.stdout.buffer.write(stream.getvalue())


def _arrays(where: Path, data: bytes, kind: str, source: str, words: tuple[str, ...]) -> dict[str, Any]:
    """What a process prints that runs `source`. Raises TrajectoryError where it fails, crashes or does not end."""
    try:
        child = run_alone(source, words, data, _SECONDS)
    except subprocess.TimeoutExpired:
        raise TrajectoryError(f"{where}: reading it took more than {_SECONDS} s and was stopped") from None
    if child.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        raise TrajectoryError(
            f"{where}: reading it took more than {_PROCESSOR_SECONDS} s of the processor and was stopped; write fewer "
            "samples, or NPZ"
        )
    if child.returncode:
        said = "".join(child.stderr.decode(errors="replace").strip().splitlines()[-1:])
        why = f"the parser crashed on it, signal {-child.returncode}" if child.returncode < 0 else said[:200]
        raise TrajectoryError(f"{where}: no {kind} file that can be read ({why})")
    return npz_arrays(child.stdout, 4 * MOST_BYTES)


def answer(parse: Callable[[bytes], Mapping[str, Any]]) -> None:
    """What the process does: a file comes through standard input, its arrays go to standard output."""
    data = sys.stdin.buffer.read()
    limit_this_process(_MEMORY, _PROCESSOR_SECONDS)
    stream = io.BytesIO()
    np.savez(stream, **parse(data))
    sys.stdout.buffer.write(stream.getvalue())
