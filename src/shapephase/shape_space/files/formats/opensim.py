"""OpenSim's motion and storage files, as inverse kinematics and simulations write them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from ....arrays import Array
from ....errors import TrajectoryError
from .._recording import Table
from .segment_poses import body_kinematics
from .text_tables import text_lines, text_table

END = "endheader"
"""The line that closes the header."""
# Lines of an OpenSim header: files have a dozen; more is another kind of file.
_MOST_HEADER_LINES = 1000
# SIMM's older words for what OpenSim calls nRows and nColumns.
_COUNTS = {"nrows": "rows", "datarows": "rows", "ncolumns": "columns", "datacolumns": "columns"}


def read_opensim(where: Path, data: bytes) -> Table:
    """An OpenSim motion or storage file: header lines up to `endheader`, names, numbers.

    `inDegrees` says whether rotational coordinates are in degrees. Of a file of states, `.../<coordinate>/value` is
    the coordinate and `.../<coordinate>/speed` is left out.

    Raises
    ------
    TrajectoryError
        For faults, with line and column.
    """
    lines = text_lines(data, where)
    header = _header(lines, where)
    rows = ((line, text.split()) for line, text in lines if text.strip())
    _, names = next(rows, (0, []))
    if not names:
        raise TrajectoryError(f"{where}: no names of columns after `{END}`")
    found = text_table(where, "OpenSim", names, rows, row="line", by_format=True, degrees=_in_degrees(header, where))
    _check_counts(header, where, len(found.rows), len(names))
    columns: dict[str, Array] = {}
    faults = {}
    for name, values in found.columns.items():
        plain = _coordinate(name)
        if plain is None:
            continue
        if plain in columns:
            raise TrajectoryError(f"{where}: two columns are the coordinate {plain}, one is {name!r}; keep one")
        columns[plain] = values
        faults[plain] = found.faults.get(name, {})
    return body_kinematics(replace(found, columns=columns, faults=faults, up="y"), header.get("", ""))


def _header(lines: Iterator[tuple[int, str]], where: Path) -> dict[str, str]:
    header: dict[str, str] = {}
    for line, text in lines:
        words = text.strip()
        header.setdefault("", words)
        if words.lower() == END:
            return header
        if line > _MOST_HEADER_LINES:
            break
        key, mark, value = words.partition("=")
        if not mark:
            key, _, value = words.partition(" ")
        key, value = key.strip().lower(), value.strip()
        known = _COUNTS.get(key, key)
        if known in ("rows", "columns", "indegrees", "datatype") and header.setdefault(known, value) != value:
            raise TrajectoryError(f"{where}: line {line}: {words!r:.60} contradicts {header[known]!r} further up")
    raise TrajectoryError(f"{where}: no line `{END}` closes the header; is this an OpenSim file?")


def _in_degrees(header: dict[str, str], where: Path) -> bool | None:
    if header.get("datatype", "double").lower() != "double":
        raise TrajectoryError(
            f"{where}: DataType={header['datatype']}, and joint motions are DataType=double; export the coordinates"
        )
    said = header.get("indegrees")
    if said is None:
        return None
    if said.lower() not in ("yes", "no"):
        raise TrajectoryError(f"{where}: inDegrees={said!r:.40} in the header; write inDegrees=yes or inDegrees=no")
    return said.lower() == "yes"


def _check_counts(header: dict[str, str], where: Path, rows: int, columns: int) -> None:
    for kind, found in (("rows", rows), ("columns", columns)):
        said = header.get(kind)
        if said is None:
            continue
        if not said.isascii() or not said.isdigit() or (said.lstrip("0") or "0") != str(found):
            raise TrajectoryError(
                f"{where}: the header says {said:.40} {kind}, the table has {found}; the file is cut off or was edited"
            )


def _coordinate(name: str) -> str | None:
    """The coordinate of a column, None for a speed: `/jointset/knee/knee_angle/value` is knee_angle."""
    parts = name.split("/")
    if len(parts) < 3 or parts[-1] not in ("value", "speed"):
        return name
    return parts[-2] if parts[-1] == "value" else None
