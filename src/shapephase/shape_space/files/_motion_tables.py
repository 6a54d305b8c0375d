"""Text tables of joint motions: comma- and tab-separated files, and OpenSim's `.mot` and `.sto`."""

from __future__ import annotations

import csv
import io
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from ...arrays import Array
from ...errors import TrajectoryError
from ._recording import Recording, check_text, file_bytes, number, plain_numbers, times_from_zero

_DELIMITERS = {",": "commas", "\t": "tabs", ";": "semicolons"}
_END = "endheader"
# Lines of an OpenSim header: files have a dozen; more is another kind of file.
_MOST_HEADER_LINES = 1000
# Memory: lines of a table, more than an hour at 500 samples a second.
_MOST_LINES = 2_000_000
# SIMM's older words for what OpenSim calls nRows and nColumns.
_COUNTS = {"nrows": "rows", "datarows": "rows", "ncolumns": "columns", "datacolumns": "columns"}


def read_delimited(where: Path) -> Recording:
    """A table with a header that names `time` and the columns, separated by commas, tabs or semicolons.

    Raises
    ------
    InputFileNotFoundError, TrajectoryError
        For a file that is not there; for faults, with row and column.
    """
    data = _text(where)
    rows = _delimited_rows(data, where)
    first = next(rows, None)
    if first is None:
        raise TrajectoryError(f"{where}: empty; a header `time,<joint names>` and rows of numbers are needed")
    kind = "TSV" if where.suffix.lower() == ".tsv" else "CSV"
    return _recording(where, kind, [name.strip() for name in first[1]], rows, "row", False)


def read_opensim(where: Path) -> Recording:
    """An OpenSim motion or storage file: header lines up to `endheader`, names, numbers.

    `inDegrees` says whether rotational coordinates are in degrees. Of a file of states, `.../<coordinate>/value` is
    the coordinate and `.../<coordinate>/speed` is left out. Raises as `read_delimited`.
    """
    data = _text(where)
    lines = _lines(data)
    header = _opensim_header(lines, where)
    tables = ((line, text.split()) for line, text in lines if text.strip())
    _, names = next(tables, (0, []))
    if not names:
        raise TrajectoryError(f"{where}: no names of columns after `{_END}`")
    found = _recording(where, "OpenSim", names, tables, "line", _in_degrees(header, where))
    _check_counts(header, where, len(found.times), len(names))
    columns: dict[str, Array] = {}
    for name, values in found.columns.items():
        plain = _coordinate(name)
        if plain is None:
            continue
        if plain in columns:
            raise TrajectoryError(f"{where}: two columns are the coordinate {plain}, one is {name!r}; keep one")
        columns[plain] = values
    return Recording(str(where), "OpenSim", found.times, columns, "line", found.rows, found.degrees)


def _text(where: Path) -> bytes:
    data = file_bytes(where)
    check_text(data, where)
    lines = data.count(b"\n") + data.count(b"\r") - data.count(b"\r\n")
    if lines > _MOST_LINES:
        raise TrajectoryError(f"{where}: {lines} lines, up to {_MOST_LINES} are read; write fewer samples, or NPZ")
    return data


def _recording(
    where: Path,
    kind: str,
    names: list[str],
    rows: Iterable[tuple[int, list[str]]],
    row: str,
    degrees: bool | None,
) -> Recording:
    _check_header(names, where)
    numbers: list[int] = []
    # Packed doubles: lists of Python's numbers would take five times the file's size.
    values = array("d")
    for label, entries in rows:
        if len(entries) != len(names):
            raise TrajectoryError(f"{where}: {row} {label} has {len(entries)} entries, the header {len(names)}")
        quick = plain_numbers(entries)
        if quick is None:
            pairs = zip(names, entries, strict=True)
            quick = [number(entry, f"{where}: {row} {label}, column {name!r}") for name, entry in pairs]
        values.extend(quick)
        numbers.append(label)
    table = np.frombuffer(values, dtype=np.float64).reshape(-1, len(names))
    columns = {name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(names)}
    times = times_from_zero(columns.pop("time"), str(where), row, numbers)
    return Recording(str(where), kind, times, columns, row, numbers, degrees)


def _check_header(names: list[str], where: Path) -> None:
    if "time" not in names:
        raise TrajectoryError(f"{where}: the header has no column `time`; it reads {_some(names)}")
    doubled = [name for name, count in Counter(names).items() if count > 1]
    if doubled:
        shown = ", ".join(name[:40] or "without a name" for name in doubled[:5])
        raise TrajectoryError(f"{where}: column {shown} stands twice in the header")
    if "" in names:
        raise TrajectoryError(f"{where}: column {names.index('') + 1} has no name in the header")


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    yield from enumerate(io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig"), start=1)


def _delimited_rows(data: bytes, where: Path) -> Iterator[tuple[int, list[str]]]:
    """Rows that are not blank, each with the number of its last line."""
    delimiter = _delimiter(data, where)
    text = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig", newline="")
    reader = csv.reader(text, delimiter=delimiter, strict=True)
    try:
        for row in reader:
            if any(entry.strip() for entry in row):
                yield reader.line_num, row
    except csv.Error as error:
        raise TrajectoryError(f"{where}: row {reader.line_num}: {error}") from None


def _delimiter(data: bytes, where: Path) -> str:
    header = next((text for _, text in _lines(data) if text.strip()), "")
    found = [mark for mark in _DELIMITERS if mark in header]
    if where.suffix.lower() == ".tsv" and found != ["\t"]:
        raise TrajectoryError(
            f"{where}: the columns of a .tsv file are separated by tabs; the header reads {header!r:.80}"
        )
    if len(found) > 1:
        kinds = " and ".join(_DELIMITERS[mark] for mark in found)
        raise TrajectoryError(
            f"{where}: the header has {kinds}, so it is unclear which separates the columns; use one of them only"
        )
    return found[0] if found else ","


def _opensim_header(lines: Iterator[tuple[int, str]], where: Path) -> dict[str, str]:
    header: dict[str, str] = {}
    for line, text in lines:
        words = text.strip()
        if words.lower() == _END:
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
    raise TrajectoryError(f"{where}: no line `{_END}` closes the header; is this an OpenSim file?")


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
        if not said.isascii() or not said.isdigit() or int(said[:18]) != found:
            raise TrajectoryError(
                f"{where}: the header says {said:.40} {kind}, the table has {found}; the file is cut off or was edited"
            )


def _coordinate(name: str) -> str | None:
    """The coordinate of a column, None for a speed: `/jointset/knee/knee_angle/value` is knee_angle."""
    parts = name.split("/")
    if len(parts) < 3 or parts[-1] not in ("value", "speed"):
        return name
    return parts[-2] if parts[-1] == "value" else None


def _some(names: list[str]) -> str:
    shown = ", ".join(name[:40] for name in names[:12])
    return shown + (" ..." if len(names) > 12 else "")
