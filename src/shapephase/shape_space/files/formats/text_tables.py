"""Text tables of joint motions, as programs and spreadsheets write them: commas, tabs, semicolons, decimal commas."""

from __future__ import annotations

import csv
import io
import re
from array import array
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from ....errors import TrajectoryError
from .._labels import unit_of
from .._recording import Table, check_text, number, plain_numbers

_DELIMITERS = {",": "commas", "\t": "tabs", ";": "semicolons"}
_MOST_LINES = 2_000_000
"""Memory: lines of a table, more than an hour at 500 samples a second."""
_MOST_FAULTS = 1000
"""Entries of a column that are no numbers whose text is kept for messages."""
_COMMA_NUMBER = re.compile(r"[-+]?\d*,\d+(?:,\d+)*(?:[eE][-+]?\d+)?")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:,\d{3})+")


def read_delimited(where: Path, data: bytes) -> Table:
    """A table with a header that names the columns, separated by commas, tabs or semicolons.

    Numbers have a decimal point, or all of them a decimal comma, where columns are separated by something else or
    entries are quoted. A row of units may follow the header, and comments behind `#` come before it.

    Raises
    ------
    TrajectoryError
        For faults, with row and column.
    """
    check_lines(data, where)
    comments = _comments(data)
    delimiter = _delimiter(data, where, comments)
    comma = _has_decimal_commas(data, delimiter, where, comments)
    rows = _rows(data, delimiter, where, comments)
    first = next(rows, None)
    if first is None:
        raise TrajectoryError(f"{where}: empty; a header `time,<joint names>` and rows of numbers are needed")
    names = [name.strip() for name in first[1]]
    kind = "TSV" if where.suffix.lower() == ".tsv" else "CSV"
    return text_table(where, kind, names, rows, comma=comma)


def check_lines(data: bytes, where: Path) -> None:
    """Raise TrajectoryError for what is no text, or has too many lines."""
    check_text(data, where)
    lines = data.count(b"\n") + data.count(b"\r") - data.count(b"\r\n")
    if lines > _MOST_LINES:
        raise TrajectoryError(f"{where}: {lines} lines, up to {_MOST_LINES} are read; write fewer samples, or NPZ")


def text_lines(data: bytes, where: Path) -> Iterator[tuple[int, str]]:
    """The numbered lines of a text. Raises as `check_lines`, at once."""
    check_lines(data, where)
    return _lines(data)


def text_table(
    where: Path,
    kind: str,
    names: list[str],
    rows: Iterable[tuple[int, list[str]]],
    *,
    row: str = "row",
    comma: bool = False,
    by_format: bool = False,
    degrees: bool | None = False,
) -> Table:
    """The table of numbered rows of texts; what is no number is NaN there, and a fault.

    Raises TrajectoryError for rows of another length, and for names that stand twice or are empty.
    """
    _check_header(names, where)
    numbers: list[int] = []
    # Packed doubles: lists of Python's numbers would take five times the file's size.
    values = array("d")
    faults: dict[str, dict[int, str]] = {}
    units: dict[str, str] = {}
    for label, entries in rows:
        if len(entries) != len(names):
            raise _length_error(where, f"{row} {label}", entries, names)
        if not numbers and not units:
            units = _units(names, entries)
            if units:
                continue
        quick = None if comma else plain_numbers(entries)
        if quick is None:
            quick = [
                _number(
                    entry, f"{where}: {row} {label}, column {name!r}", faults.setdefault(name, {}), len(numbers), comma
                )
                for name, entry in zip(names, entries, strict=True)
            ]
        values.extend(quick)
        numbers.append(label)
    table = np.frombuffer(values, dtype=np.float64).reshape(-1, len(names))
    return Table(
        where=str(where),
        format=kind,
        columns={name: np.ascontiguousarray(table[:, i]) for i, name in enumerate(names)},
        rows=numbers,
        row=row,
        by_format=by_format,
        degrees=degrees,
        units=units,
        faults=faults,
    )


def _number(entry: str, place: str, faults: dict[int, str], sample: int, comma: bool) -> float:
    """A number, or NaN with its text among the faults."""
    text = entry.strip()
    if comma and "," in text and "." not in text and _COMMA_NUMBER.fullmatch(text) and text.count(",") == 1:
        text = text.replace(",", ".")
    elif comma and "." in text and re.fullmatch(r"[-+\d.,eE]+", text):
        raise TrajectoryError(
            f"{place}: {entry.strip()!r:.40} has a decimal point, and other entries have decimal commas; write all "
            "in one way, without marks between thousands"
        )
    try:
        return number(text, place)
    except TrajectoryError:
        if len(faults) < _MOST_FAULTS:
            faults[sample] = entry[:60]
        return np.nan


def _units(names: list[str], entries: list[str]) -> dict[str, str]:
    """Name -> unit, where a row has nothing but units, and at least one."""
    found = {
        name: unit_of(entry.strip().strip("[]()")) for name, entry in zip(names, entries, strict=True) if entry.strip()
    }
    return {name: unit for name, unit in found.items() if unit is not None} if all(found.values()) else {}


def _length_error(where: Path, place: str, entries: list[str], names: list[str]) -> TrajectoryError:
    said = f"{where}: {place} has {len(entries)} entries, the header {len(names)}"
    if len(entries) == 2 * len(names) and all(entry.strip().lstrip("+-").isdigit() for entry in entries):
        said += "; decimal commas between commas cannot be told apart, separate the columns by semicolons"
    return TrajectoryError(said)


def _check_header(names: list[str], where: Path) -> None:
    doubled = [name for name, count in Counter(names).items() if count > 1]
    if doubled:
        shown = ", ".join(name[:40] or "without a name" for name in doubled[:5])
        raise TrajectoryError(f"{where}: column {shown} stands twice in the header")
    if "" in names:
        raise TrajectoryError(f"{where}: column {names.index('') + 1} has no name in the header")


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    yield from enumerate(io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig"), start=1)


def _comments(data: bytes) -> int:
    """How many lines at the top begin with `#`; none where the last of them is the header, with numbers below it."""
    count = 0
    for _, line in _lines(data):
        if not line.startswith("#"):
            return 0 if plain_numbers(re.split("[,;\t]", line.strip())) else count
        count += 1
    return count


def _rows(data: bytes, delimiter: str, where: Path, comments: int) -> Iterator[tuple[int, list[str]]]:
    """Rows below the comments that are not blank, each with the number of its last line."""
    text = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig", newline="")
    for _ in range(comments):
        text.readline()
    reader = csv.reader(text, delimiter=delimiter, strict=True)
    try:
        for row in reader:
            if any(entry.strip() for entry in row):
                yield comments + reader.line_num, row
    except csv.Error as error:
        raise TrajectoryError(f"{where}: row {comments + reader.line_num}: {error}") from None


def _delimiter(data: bytes, where: Path, comments: int) -> str:
    header = next((text for number, text in _lines(data) if number > comments and text.strip()), "")
    unquoted = re.sub(r'"[^"]*"', "", header)
    found = [mark for mark in _DELIMITERS if mark in unquoted]
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


def _has_decimal_commas(data: bytes, delimiter: str, where: Path, comments: int) -> bool:
    """Whether numbers have decimal commas. Raises TrajectoryError where these may as well be marks of thousands."""
    if (b'"' if delimiter == "," else b",") not in data:
        return False
    rows = _rows(data, delimiter, where, comments)
    next(rows, None)
    doubtful = None
    for label, entries in rows:
        for entry in entries:
            text = entry.strip()
            if "," not in text or not _COMMA_NUMBER.fullmatch(text):
                continue
            if text.count(",") == 1 and not _THOUSANDS.fullmatch(text):
                return True
            doubtful = doubtful or (label, text)
    if doubtful is not None:
        raise TrajectoryError(
            f"{where}: row {doubtful[0]}: {doubtful[1]!r:.40} may have a decimal comma or a mark of thousands, and no "
            "other entry tells which; write numbers with a decimal point, and no marks of thousands"
        )
    return False
