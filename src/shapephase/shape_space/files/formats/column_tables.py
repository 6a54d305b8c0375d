"""Columns in memory, of numbers, texts or dates, as a table."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ....arrays import Array
from ....errors import TrajectoryError
from ..recording import Table, is_blank, number
from .table_heads import CLOCK, COMMA_NUMBER, DATE, is_value

_MOST_FAULTS = 1000  # entries of a column whose text is kept for messages
_WHOLE = 2**53  # largest exact integer of a double: larger times in nanoseconds stay integers


def column_table(
    where: str,
    kind: str,
    columns: Iterable[tuple[object, Any]],
    *,
    units: Mapping[str, str] | None = None,
    row: str = "row",
    rows: Sequence[int] | None = None,
    comma: bool = False,
) -> Table:
    """Table of columns with labels: an entry that is no number is NaN and a fault; dates become seconds.

    rows : (N,) the numbers of the samples in messages; None: from 0
    """
    numbers: dict[str, Array] = {}
    faults: dict[str, dict[int, str]] = {}
    units = dict(units or {})
    for position, (label, values) in enumerate(columns, start=1):
        if not isinstance(label, str):
            raise TrajectoryError(f"{where}: column {position} has the name {label!r:.40}, and a text is needed")
        name = label.strip()
        if not name:
            raise TrajectoryError(f"{where}: column {position} has no name in the header; write one")
        if name in numbers:
            raise TrajectoryError(f"{where}: column {name:.40} stands twice in the header; give each its own name")
        numbers[name], faults[name], is_date = _numbers(values, comma, f"{where}: column {name!r:.60}")
        if is_date:
            units[name] = "s"
        mixed = next((k for k, text in faults[name].items() if comma and is_value(text)), None)
        if mixed is not None:
            raise TrajectoryError(
                f"{where}: {row} {mixed if rows is None else rows[mixed]}, column {name!r:.60}: "
                f"{faults[name][mixed]!r:.40} has a decimal point, and other entries have decimal commas; write all in "
                "one way, without marks between thousands"
            )
    counts = {len(values) for values in numbers.values()}
    if len(counts) > 1:
        lengths = ", ".join(f"{name} {len(values)}" for name, values in list(numbers.items())[:12])
        raise TrajectoryError(f"{where}: the columns have different lengths: {lengths}; give each one number a sample")
    labels = range(max(counts, default=0)) if rows is None else rows
    return Table(where=where, format=kind, columns=numbers, rows=labels, row=row, units=units, faults=faults)


def _numbers(values: Any, comma: bool, place: str) -> tuple[Array, dict[int, str], bool]:
    """Values as numbers, entries that are none, and True for dates or durations [s]."""
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(np.float64), np.nan) if values.dtype.kind in "fiu" else values.tolist()
    array = np.asarray(values, dtype=object) if isinstance(values, list) else np.asarray(values)
    if array.dtype.kind in "mM":
        return _seconds(array), {}, True
    if array.dtype.kind == "i" and len(array) and np.abs(array.astype(np.float64)).max() > _WHOLE:
        whole: Any = array.astype(np.int64)
        return whole, {}, False
    if array.dtype.kind in "fiu":
        return np.ascontiguousarray(array, dtype=np.float64), {}, False
    if array.dtype.kind == "b":
        return np.full(len(array), np.nan), dict(enumerate(map(str, array[:_MOST_FAULTS].tolist()))), False
    entries = array.tolist()
    dates = _dates(entries, place)
    if dates is not None:
        return dates, {}, True
    numbers, faults = np.empty(len(entries)), {}
    for k, entry in enumerate(entries):
        value = _number(entry, comma)
        numbers[k] = np.nan if value is None else value
        if value is None and len(faults) < _MOST_FAULTS:
            faults[k] = str(entry)[:60]
    return numbers, faults, False


def _number(entry: object, comma: bool) -> float | None:
    """A number, NaN for a gap, None for another text; with decimal commas, a decimal point makes another text."""
    if entry is None or type(entry).__name__ in ("NAType", "NaTType"):
        return np.nan
    if not isinstance(entry, str):
        try:
            return None if isinstance(entry, bool) else float(entry)  # type: ignore[arg-type]
        except (TypeError, ValueError, OverflowError):  # Python's whole numbers may be larger than any double
            return None
    text = entry.strip()
    if is_blank(text):
        return np.nan
    if comma and "," in text:
        text = text.replace(",", ".") if COMMA_NUMBER.fullmatch(text) and text.count(",") == 1 else "no number"
    elif comma and "." in text:
        return None
    try:
        return number(text, "")
    except TrajectoryError:
        return None


def _seconds(times: Any) -> Array:
    """Dates since the first of them, or durations of NumPy [s]."""
    since = times - times[0] if times.dtype.kind == "M" and len(times) else times
    durations = since.astype("timedelta64[ns]")
    return np.where(np.isnat(durations), np.nan, durations / np.timedelta64(1, "s"))


def _dates(entries: Sequence[Any], place: str) -> Array | None:
    """Dates, times of a day or durations of Python, or texts of them [s]; None for other entries."""
    first = next((entry for entry in entries if entry is not None and entry != ""), None)
    if isinstance(first, str) and (DATE.fullmatch(first.strip()) or CLOCK.fullmatch(first.strip())):
        import pandas as pd

        texts = [str(entry).strip().replace(",", ".") for entry in entries]
        try:
            if DATE.fullmatch(first.strip()):
                made = pd.to_datetime(texts, format="ISO8601", utc=True)
            else:
                # Without hours, 12:30.5 is 12 minutes.
                made = pd.to_timedelta([text if text.count(":") == 2 else f"00:{text}" for text in texts])
        except (ValueError, OverflowError) as error:
            raise TrajectoryError(
                f"{place}: {error!s:.120}; write all times as {first.strip()!r:.40}, or in seconds"
            ) from None
        return _seconds(np.asarray(made - made[0]))
    if not entries:
        return None
    if all(isinstance(entry, datetime.timedelta) for entry in entries):
        return np.array([entry.total_seconds() for entry in entries])
    if all(isinstance(entry, datetime.time) for entry in entries):
        entries = [datetime.datetime.combine(datetime.date.min, entry) for entry in entries]
    if all(isinstance(entry, datetime.datetime) for entry in entries):
        try:
            return np.array([(entry - entries[0]).total_seconds() for entry in entries])
        except TypeError:
            return None
    return None
