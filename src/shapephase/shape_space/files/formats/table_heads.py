"""What stands above the numbers of a table: names of columns, units, comments; or nothing."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from ....errors import TrajectoryError
from ..labels import unit_of

COMMENT = re.compile(r'\s*"?(#|%|//)\s*')  # beginning of a comment line
COMMA_NUMBER = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d.*", re.ASCII)
CLOCK = re.compile(r"\d{1,3}:\d\d(:\d\d([.,]\d+)?)?", re.ASCII)
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)
_NO_UNIT_CELLS = ("[]", "()", "-")


class Head(NamedTuple):
    """What the first rows of a table say.

    Attributes
    ----------
    names : of the columns; empty where a column has none
    units : name -> unit, of a row of units
    skipped : rows before the first one of numbers
    numbered : whether no names are there, and columns are called by their numbers from 1
    """

    names: tuple[str, ...]
    units: dict[str, str]
    skipped: int
    numbered: bool = False


def head_of(rows: Sequence[Sequence[str]], comment: Sequence[str] | None, where: str) -> Head:
    """The head of a table by its first rows.

    rows : the first rows that are not empty, comments above them left out
    comment : the entries of the last line of comment above them, which may be the names

    Raises TrajectoryError if the first row may be numbers of columns or a sample; for names that stand twice.
    """
    first, second = rows[0], rows[1] if len(rows) > 1 else ()
    kinds = [is_value(entry) for entry in first if entry]
    if not any(kinds):
        return _named(first, 1, rows, where)
    if comment is not None and len(comment) == len(first) and not any(map(is_value, filter(None, comment))):
        return _named(comment, 0, rows, where)
    if all(kinds) and _counts(first) and second:
        if _counts(second) or all(entry.lstrip("+-").isdigit() for entry in second):
            raise TrajectoryError(
                f"{where}: the first row, {', '.join(first[:6])}, may be numbers of columns or a sample; write a row "
                "of names above it, `time` and those of the joints"
            )
        return Head(("", *map(str, range(1, len(first)))) if not first[0] else numbers(len(first)), {}, 1, True)
    if all(kinds) or (len(first) == len(second) and [*map(is_value, first)] == [*map(is_value, second)]):
        return Head(numbers(len(first)), {}, 0, True)
    return _named(first, 1, rows, where)


def numbers(count: int) -> tuple[str, ...]:
    """What columns without names are called."""
    return tuple(str(k + 1) for k in range(count))


def is_value(entry: str) -> bool:
    """Whether an entry is a number, a date or a time of day, no name."""
    return any(kind.fullmatch(entry) for kind in (_NUMBER, COMMA_NUMBER, DATE, CLOCK))


def check_names(names: Sequence[str], where: str) -> None:
    """Raise TrajectoryError for names that stand twice."""
    doubled = [name for name, count in Counter(names).items() if count > 1 and name]
    if doubled:
        shown = ", ".join(name[:40] for name in doubled[:5])
        raise TrajectoryError(f"{where}: column {shown} stands twice in the header; give each its own name")


def unit_row(names: Sequence[str], entries: Sequence[str]) -> dict[str, str] | None:
    """Name -> unit, where a row has nothing but units, and at least one; else None."""
    said = [(name, entry.strip()) for name, entry in zip(names, entries) if entry.strip()]
    found = {name: unit_of(entry.strip("[]() ")) for name, entry in said if entry not in _NO_UNIT_CELLS}
    if not found or None in found.values():
        return None
    return {name: unit for name, unit in found.items() if unit is not None}


def _named(names: Sequence[str], skipped: int, rows: Sequence[Sequence[str]], where: str) -> Head:
    check_names(names, where)
    units = unit_row(names, rows[skipped]) if skipped < len(rows) else None
    return Head(tuple(names), units or {}, skipped + (units is not None))


def _counts(row: Sequence[str]) -> bool:
    """Whether entries are 0, 1, 2 and so on, as pandas numbers columns without names; the first may be empty."""
    own = row if row[0] else row[1:]
    return len(own) > 1 and [*own] == [str(k) for k in range(len(own))]
