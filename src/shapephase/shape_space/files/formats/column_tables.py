"""Columns in memory, of numbers, texts or dates, as a table: what spreadsheets, data frames and arrays come to."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ....arrays import Array
from ....errors import TrajectoryError
from .._recording import Table, number

_NANO = 1e9
"""Nanoseconds in a second."""
_MOST_FAULTS = 1000
"""Entries of a column that are no numbers whose text is kept for messages."""
_DAY = datetime.date(2000, 1, 1)
"""Any day, for times of a day."""


def column_table(
    where: str,
    kind: str,
    columns: Iterable[tuple[object, Any]],
    *,
    units: Mapping[str, str] | None = None,
    row: str = "row",
    first_row: int = 0,
) -> Table:
    """The table of columns that have labels: what is no number is NaN there, and a fault; dates become seconds.

    Parameters
    ----------
    columns : label and values (N,)
    units : label -> unit, where it is said beside the label
    first_row : the number of the first sample in messages

    Raises
    ------
    TrajectoryError
        For labels that are no texts, empty or doubled, and columns of several lengths.
    """
    found: dict[str, Array] = {}
    faults: dict[str, dict[int, str]] = {}
    said = dict(units or {})
    for position, (label, values) in enumerate(columns, start=1):
        if not isinstance(label, str):
            raise TrajectoryError(f"{where}: column {position} has the name {label!r:.40}, and a text is needed")
        name = label.strip()
        if not name:
            raise TrajectoryError(f"{where}: column {position} has no name in the header")
        if name in found:
            raise TrajectoryError(f"{where}: column {name[:40]} stands twice in the header")
        found[name], faults[name], is_date = _numbers(values)
        if is_date:
            said[name] = "s"
    counts = {len(values) for values in found.values()}
    if len(counts) > 1:
        listed = ", ".join(f"{name} {len(values)}" for name, values in list(found.items())[:12])
        raise TrajectoryError(f"{where}: the columns have different lengths: {listed}")
    rows = range(first_row, first_row + max(counts, default=0))
    return Table(where=where, format=kind, columns=found, rows=rows, row=row, units=said, faults=faults)


def _numbers(values: Any) -> tuple[Array, dict[int, str], bool]:
    """Values as numbers, what is none of them, and whether they are dates or durations [s]."""
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(np.float64), np.nan) if values.dtype.kind in "fiu" else values.tolist()
    array = np.asarray(values, dtype=object) if isinstance(values, list) else np.asarray(values)
    if array.dtype.kind in "mM":
        return _seconds(array), {}, True
    if array.dtype.kind in "fiu":
        return np.ascontiguousarray(array, dtype=np.float64), {}, False
    if array.dtype.kind == "b":
        return np.full(len(array), np.nan), dict(enumerate(map(str, array[:_MOST_FAULTS].tolist()))), False
    entries = array.tolist()
    dates = _dates(entries)
    if dates is not None:
        return dates, {}, True
    found, faults = np.empty(len(entries)), {}
    for k, entry in enumerate(entries):
        try:
            found[k] = float(entry) if isinstance(entry, int | float) and not isinstance(entry, bool) else _text(entry)
        except (TrajectoryError, OverflowError):  # Python's whole numbers may be larger than any double
            found[k] = np.nan
            if len(faults) < _MOST_FAULTS:
                faults[k] = "" if entry is None else str(entry)[:60]
    return found, faults, False


def _text(entry: object) -> float:
    return number(entry if isinstance(entry, str) else "", "")


def _seconds(times: Any) -> Array:
    """Dates or durations of NumPy as seconds: dates since the first of them."""
    since = times - times[0] if times.dtype.kind == "M" and len(times) else times
    durations = since.astype("timedelta64[ns]")
    seconds = durations.astype(np.int64) / _NANO
    return np.where(np.isnat(durations), np.nan, seconds)


def _dates(entries: Sequence[Any]) -> Array | None:
    """Dates, times of a day or durations of Python as seconds; None where they are something else."""
    if not entries:
        return None
    if all(isinstance(entry, datetime.timedelta) for entry in entries):
        return np.array([entry.total_seconds() for entry in entries])
    if all(isinstance(entry, datetime.time) for entry in entries):
        entries = [datetime.datetime.combine(_DAY, entry) for entry in entries]
    if all(isinstance(entry, datetime.datetime) for entry in entries):
        try:
            return np.array([(entry - entries[0]).total_seconds() for entry in entries])
        except TypeError:
            return None
    return None
