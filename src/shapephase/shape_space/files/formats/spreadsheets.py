"""Tables of columns in files of spreadsheets and databases: Excel, Parquet, Feather and lines of JSON."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....errors import TrajectoryError, unknown_name
from ....warning_filters import quiet
from ..labels import unit_of
from .parser_process import by_library
from .table_heads import HEAD_ROWS, head_of

if TYPE_CHECKING:
    import pandas as pd

_REMEDY = "save it anew, or as CSV"


def read_excel(where: Path, data: bytes, sheet: str | None) -> pd.DataFrame:
    """Frame of a sheet of an Excel workbook: a row of names, and rows of numbers or of formulas' last results."""
    with by_library(where, "workbook", "openpyxl", _REMEDY), quiet(module="openpyxl"):
        import openpyxl

        book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True, keep_links=False)
        sheets = {name: _cells(book[name]) for name in book.sheetnames if hasattr(book[name], "iter_rows")}
    if sheet is not None and sheet not in sheets:
        raise unknown_name(f"sheet of {where}", sheet, sheets)
    filled = [name for name, rows in sheets.items() if rows]
    if sheet is None and len(filled) > 1:
        raise TrajectoryError(
            f"{where}: several sheets have cells, {', '.join(filled)}; choose one with topic={filled[0]!r} (--topic "
            f"{filled[0]})"
        )
    if not filled:
        raise TrajectoryError(f"{where}: empty; a row `time, <joint names>` and rows of numbers are needed")
    return _sheet_frame(sheets[sheet or filled[0]], where)


def _cells(sheet: Any) -> list[tuple[int, list[Any]]]:
    """Rows of a sheet that are not empty, with their numbers, to their last entry."""
    sheet.reset_dimensions()
    rows = []
    for label, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        width = max((k + 1 for k, entry in enumerate(row) if entry not in (None, "")), default=0)
        if width:
            rows.append((label, list(row[:width])))
    return rows


def _sheet_frame(rows: list[tuple[int, list[Any]]], where: Path) -> pd.DataFrame:
    import pandas as pd

    texts = [["" if entry is None else str(entry).strip() for entry in row] for _, row in rows[:HEAD_ROWS]]
    head = head_of(texts, None, str(where))
    width = len(head.names)
    for label, row in rows[head.skipped :]:
        if len(row) > width:
            raise TrajectoryError(f"{where}: row {label} has an entry in column {len(row)}, which has no name; name it")
    columns = {
        name: [row[k] if k < len(row) else None for _, row in rows[head.skipped :]] for k, name in enumerate(head.names)
    }
    frame = pd.DataFrame(columns, index=[label for label, _ in rows[head.skipped :]], dtype=object)
    frame.attrs = {"format": "Excel", "units": head.units, "numbered": head.numbered}
    return frame


def read_json_lines(where: Path, data: bytes) -> pd.DataFrame:
    """Frame of a log with one JSON object a line, such as `{"time": 0.01, "hip": 0.3}`.

    Names within inner objects stand for themselves where no two are alike, else as `outer.inner`.

    Raises TrajectoryError for faults, with the line.
    """
    import json

    import pandas as pd

    rows, lines = [], []
    for number, line in enumerate(data.splitlines(), start=1):
        if line.strip():
            try:
                rows.append(json.loads(line))
            except ValueError as error:
                raise TrajectoryError(f"{where}:{number}: not a JSON object: {error}") from None
            if not isinstance(rows[-1], dict):
                raise TrajectoryError(f'{where}:{number}: a JSON object is needed, such as {{"time": 0.0}}')
            lines.append(number)
    if not rows:
        raise TrajectoryError(f"{where}: empty; a JSON object a line is needed")
    frame = pd.json_normalize(rows).set_axis(lines)
    inner = [name.rpartition(".")[2] for name in frame.columns]
    frame.columns = inner if len(set(inner)) == len(inner) else frame.columns
    frame.attrs = {"format": "JSON lines"}
    return frame


def read_arrow(where: Path, data: bytes) -> pd.DataFrame:
    """Frame of a Parquet or Feather file; the metadata `unit` or `units` of a column is its unit."""
    kind = where.suffix[1:].title()
    with by_library(where, f"{kind} file", "pyarrow", _REMEDY):
        import pyarrow.feather as feather
        import pyarrow.parquet as parquet

        read: Any = parquet.read_table if kind == "Parquet" else feather.read_table
        table = read(io.BytesIO(data))
        units: dict[str, str] = {}
        for field in table.schema:
            metadata = {key.decode().lower(): text.decode() for key, text in (field.metadata or {}).items()}
            unit = unit_of(metadata.get("units", metadata.get("unit", "")))
            if unit is not None:
                units[field.name.strip()] = unit
        frame = table.to_pandas()
    if frame.index.name is not None or frame.index.dtype.kind in "mM":
        frame = frame.reset_index(names=frame.index.name or "time")
    frame = frame.reset_index(drop=True)
    frame.attrs = {"format": kind, "units": units, "row": "sample"}
    return frame
