"""Tables of columns in files of spreadsheets and databases: Excel's `.xlsx`, and Parquet."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from ....errors import MissingExtraError, ShapePhaseError, TrajectoryError, unknown_name
from ....files import zip_members
from ....warning_filters import quiet
from .._labels import unit_of
from .._recording import Table
from .column_tables import column_table

_MOST_CELLS = 5_000_000
"""Cells of a sheet, empty ones counted: a second for each million."""

_ROW = re.compile(rb"""<(?:\w+:)?row\b[^>]*?\sr=["']([^"']*)["']""")
_PLAIN_ROW = re.compile(rb"[0-9]{1,18}")
_CELL = re.compile(
    rb"""<(?:\w+:)?c\b(?:[^<>]*?\st=["'](\w*)["'])?[^<>]*>\s*"""
    rb"""(?:<(?:\w+:)?f\b[^<]*(?:</(?:\w+:)?f>\s*)?)?<(?:\w+:)?v\b[^<>]*>([^<]*)"""
)
"""The type of a cell and its value, whether or not it has a formula."""
_OTHER_DIGITS = re.compile(rb"_|[^\x00-\x7f]|&#")
"""In what is no number but for Python: `1_0`, and digits of other scripts."""
_SHEETS = re.compile(r"xl/worksheets/[^/]+\.xml")


def read_excel(where: Path, data: bytes, sheet: str | None) -> Table:
    """A sheet of an Excel workbook: a row of names, and rows of numbers; formulas count as they were last computed.

    Parameters
    ----------
    sheet : its name; None: the only one that is not empty

    Raises
    ------
    TrajectoryError, UnknownNameError, MissingExtraError
        For faults, with row and column; for a sheet that is not there; without openpyxl.
    """
    try:
        import openpyxl
    except ImportError:
        raise MissingExtraError("Excel files need openpyxl; install it with: pip install 'shapephase[data]'") from None
    try:
        for name, part in zip_members(data).items():
            if _SHEETS.fullmatch(name):
                _check_rows(part, where)
                _check_numbers(part, where)
        with _silent_openpyxl():
            book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True, keep_links=False)
            sheets = {name: _cells(book[name], where) for name in book.sheetnames if hasattr(book[name], "iter_rows")}
    except ShapePhaseError:
        raise
    except Exception as error:  # a damaged workbook fails inside openpyxl in many ways
        raise _no_workbook(where, error) from None
    return _sheet_table(_chosen_sheet(sheets, where, sheet), where)


def _no_workbook(where: Path, error: Exception) -> TrajectoryError:
    return TrajectoryError(f"{where}: no workbook that can be read ({type(error).__name__}: {error!s:.200})")


def _check_rows(part: bytes, where: Path) -> None:
    """Raise TrajectoryError for rows whose numbers are none or do not ascend, which openpyxl would leave out."""
    before = 0
    for found in _ROW.finditer(part):
        if not _PLAIN_ROW.fullmatch(found[1]):
            raise TrajectoryError(f"{where}: a row has the number {found[1][:40]!r}; the file is damaged, save it anew")
        number = int(found[1])
        if number <= before:
            raise TrajectoryError(f"{where}: row {number} comes after row {before}; the file is damaged, save it anew")
        before = number


def _check_numbers(part: bytes, where: Path) -> None:
    """Raise TrajectoryError for a cell whose number is written as Python alone reads it, and with it openpyxl."""
    for found in _CELL.finditer(part):
        if _OTHER_DIGITS.search(found[2]) and (found[1] or b"n") == b"n":
            text = found[2].decode("utf-8", errors="replace").strip()
            raise TrajectoryError(f"{where}: a cell has the number {text!r:.40}; the file is damaged, save it anew")


@contextlib.contextmanager
def _silent_openpyxl() -> Iterator[None]:
    """What openpyxl warns of are styles and links; dates that are none become cells with a fault.

    One thread at a time: Python's filters belong to the process.
    """
    with quiet(module="openpyxl"):
        yield


def _cells(sheet: Any, where: Path) -> list[tuple[int, list[Any]]]:
    """The rows of a sheet that are not empty, with their numbers."""
    sheet.reset_dimensions()
    found, count = [], 0
    for label, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        # Rows between far cells are empty, and counted.
        count += len(row) + 1
        if count > _MOST_CELLS:
            raise TrajectoryError(f"{where}: more than {_MOST_CELLS} cells; use CSV, NPZ or Parquet for that much")
        if any(entry is not None and entry != "" for entry in row):
            found.append((label, list(row)))
    return found


def _chosen_sheet(sheets: dict[str, list], where: Path, sheet: str | None) -> list[tuple[int, list[Any]]]:
    if sheet is not None:
        if sheet not in sheets:
            raise unknown_name(f"sheet of {where}", sheet, sheets)
        return sheets[sheet]
    filled = [name for name, rows in sheets.items() if rows]
    if len(filled) > 1:
        raise TrajectoryError(f"{where}: several sheets have cells, choose one with topic=: {', '.join(filled)}")
    return sheets[filled[0]] if filled else []


def _sheet_table(rows: list[tuple[int, list[Any]]], where: Path) -> Table:
    if not rows:
        raise TrajectoryError(f"{where}: empty; a row `time, <joint names>` and rows of numbers are needed")
    _, header = rows[0]
    while header and header[-1] in (None, ""):
        header.pop()
    width = len(header)
    for label, row in rows[1:]:
        if any(entry not in (None, "") for entry in row[width:]):
            raise TrajectoryError(f"{where}: row {label} has an entry in column {width + 1}, which has no name")
    body = rows[1:]
    units: dict[str, str] = {}
    if body and _is_units(body[0][1][:width]):
        said = (unit_of(str(entry).strip("[]() ")) for entry in body[0][1])
        units = {str(name).strip(): unit for name, unit in zip(header, said) if unit is not None}
        body = body[1:]
    filled = [(row + [None] * width)[:width] for _, row in body]
    names = ["" if name is None else name for name in header]
    columns = zip(names, map(list, zip(*filled, strict=True)) if filled else [[] for _ in header], strict=True)
    table = column_table(str(where), "Excel", columns, units=units)
    return replace(table, rows=[label for label, _ in body])


def _is_units(row: list[Any]) -> bool:
    said = [str(entry) for entry in row if entry not in (None, "")]
    return bool(said) and all(unit_of(text.strip("[]() ")) is not None for text in said)


def read_parquet(where: Path, data: bytes) -> Table:
    """A Parquet file of numbers and times; the metadata `unit` or `units` of a column says its unit.

    Raises
    ------
    TrajectoryError, MissingExtraError
        For faults, with row and column; without pyarrow.
    """
    try:
        import pyarrow.parquet as parquet
    except ImportError:
        raise MissingExtraError("Parquet files need pyarrow; install it with: pip install 'shapephase[data]'") from None
    try:
        file = parquet.ParquetFile(io.BytesIO(data))
        read = file.read(use_threads=False)
        units: dict[str, str] = {}
        columns = []
        for field, column in zip(read.schema, read.columns, strict=True):
            said = {key.decode().lower(): text.decode() for key, text in (field.metadata or {}).items()}
            unit = unit_of(said.get("units", said.get("unit", "")))
            if unit is not None:
                units[field.name.strip()] = unit
            columns.append((field.name, column.to_numpy()))
    except ShapePhaseError:
        raise
    except Exception as error:  # a damaged file fails inside pyarrow in many ways
        raise _no_parquet(where, error) from None
    return column_table(str(where), "Parquet", columns, units=units, row="sample")


def _no_parquet(where: Path, error: Exception) -> TrajectoryError:
    return TrajectoryError(f"{where}: no Parquet file that can be read ({type(error).__name__}: {error!s:.200})")
