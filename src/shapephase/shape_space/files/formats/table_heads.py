"""Heads of tables: names of columns, units, comments, or nothing; and the five rows of Vicon Nexus."""

from __future__ import annotations

import csv
import re
from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from ....errors import TrajectoryError, unknown_name
from ..labels import rate_size, unit_of

COMMENT = re.compile(r'\s*"?(#|%|//)\s*')  # beginning of a comment line
COMMA_NUMBER = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d.*", re.ASCII)
CLOCK = re.compile(r"\d{1,3}:\d\d(:\d\d([.,]\d+)?)?", re.ASCII)
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)
_NO_UNIT_CELLS = ("[]", "()", "-")
_KINDS = ("joints", "model outputs", "segments", "trajectories", "devices", "imus")
HEAD_ROWS = 12  # from which the head of another table follows
_HEAD = 5  # rows of the head: kind, rate, names, axes, units
_FRAMES = ("Frame", "Sub Frame")


class Head(NamedTuple):
    """Content of the first rows of a table.

    names : of the columns; empty where a column has none
    units : name -> unit, of a row of units
    skipped : rows before the first one of numbers; lines, where the delimiter is known
    numbered : True if there are no names, and columns are called by their numbers from 1
    rate : frames a second, where the header states it and no column has times
    """

    names: tuple[str, ...]
    units: dict[str, str]
    skipped: int
    numbered: bool = False
    delimiter: str = ""
    rate: float | None = None


def head_of(rows: Sequence[Sequence[str]], comment: Sequence[str] | None, where: str) -> Head:
    """The head of a table by its first rows.

    comment : the entries of the last line of comment above them, which may be the names
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
    """Labels of columns without names: their numbers from 1."""
    return tuple(str(k + 1) for k in range(count))


def is_value(entry: str) -> bool:
    """True for an entry that is a number, a date or a time of day, no name."""
    return any(kind.fullmatch(entry) for kind in (_NUMBER, COMMA_NUMBER, DATE, CLOCK))


def check_names(names: Sequence[str], where: str) -> None:
    """Raise TrajectoryError for names that stand twice."""
    doubled = [name for name, count in Counter(names).items() if count > 1 and name]
    if doubled:
        shown = ", ".join(f"{name:.40}" for name in doubled[:4])
        raise TrajectoryError(f"{where}: column {shown} stands twice in the header; give each its own name")


def unit_row(names: Sequence[str], entries: Sequence[str]) -> dict[str, str] | None:
    """Name -> unit, where a row has nothing but units, and at least one; else None."""
    cells = [(name, entry.strip()) for name, entry in zip(names, entries) if entry.strip() not in ("", *_NO_UNIT_CELLS)]
    units = {name: unit for name, cell in cells if (unit := _unit(cell.strip("[]() "))) is not None}
    return units if units and len(units) == len(dict(cells)) else None


def _unit(text: str) -> str | None:
    return text if rate_size(text) is not None else unit_of(text)


def _named(names: Sequence[str], skipped: int, rows: Sequence[Sequence[str]], where: str) -> Head:
    check_names(names, where)
    units = unit_row(names, rows[skipped]) if skipped < len(rows) else None
    return Head(tuple(names), units or {}, skipped + (units is not None))


def _counts(row: Sequence[str]) -> bool:
    """True for entries 0, 1, 2 and so on, as pandas numbers columns without names; the first may be empty."""
    own = row if row[0] else row[1:]
    return len(own) > 1 and [*own] == [str(k) for k in range(len(own))]


def nexus_head(text: bytes, lines: list[str], start: int, section: str | None, where: str) -> Head | None:
    """The head of a section, columns `KneeAngles_x` and so on; None for another kind of table."""
    delimiter = "\t" if "\t" in "".join(lines[start : start + _HEAD]) else ","
    if not _begins(lines, start, delimiter):
        if section is not None:
            raise TrajectoryError(
                f"{where}: topic={section!r:.60} is for bags, workbooks, .mat files and tables of several sections; "
                "leave it out"
            )
        return None
    whole = text.decode().split("\n")
    sections = {_kind(whole[k], delimiter): k for k in range(len(whole)) if _begins(whole, k, delimiter)}
    titles = [kind.title() for kind in sections]
    if section is not None and section.lower() not in sections:
        raise unknown_name(f"section of {where}", section, titles)
    if section is None and len(sections) > 1:
        raise TrajectoryError(
            f"{where}: several sections, {', '.join(titles)}; choose one with topic={titles[0]!r} (--topic "
            f"'{titles[0]}')"
        )
    place = sections[section.lower()] if section is not None else start
    rows = [next(csv.reader([whole[place + k]], delimiter=delimiter)) for k in range(_HEAD)]
    width = max(len(row) for row in rows)
    titles, axes, units = ([entry.strip() for entry in row] + [""] * (width - len(row)) for row in rows[2:])
    names: list[str] = []
    title = ""
    for above, axis in zip(titles, axes, strict=True):
        # A name stands above the first of its columns; the subject before a colon is left out.
        title = above.rpartition(":")[2] if above else title
        names.append(axis if axis in _FRAMES or not title else f"{title}_{axis.lower()}" if axis else "")
    check_names(names, where)
    return Head(tuple(names), unit_row(names, units) or {}, place + _HEAD, False, delimiter, float(rows[1][0]))


def _kind(line: str, delimiter: str) -> str:
    return line.split(delimiter)[0].strip().strip('"').lower()


def _begins(lines: list[str], place: int, delimiter: str) -> bool:
    """True where a section begins in a line: its kind, a rate below it, and then the names and `Frame`."""
    if place + _HEAD >= len(lines) or _kind(lines[place], delimiter) not in _KINDS:
        return False
    rate = lines[place + 1].split(delimiter)[0].strip().strip('"')
    return rate.replace(".", "", 1).isdigit() and _FRAMES[0] in lines[place + 3]
