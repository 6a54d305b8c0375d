"""The several head rows of tables that Vicon Nexus exports: kind, rate, names, axes, units."""

from __future__ import annotations

import csv
from typing import NamedTuple

from ....errors import TrajectoryError, unknown_name
from .table_heads import check_names, unit_row

_KINDS = ("joints", "model outputs", "segments", "trajectories", "devices", "imus")
_HEAD = 5  # rows of the head: kind, rate, names, axes, units
_FRAMES = ("Frame", "Sub Frame")


class NexusHead(NamedTuple):
    """The head of a section.

    Attributes
    ----------
    names : of the columns, `KneeAngles_x` of the subject's `KneeAngles` and its axis X
    units : name -> unit
    rate : frames a second
    first : the line of the first frame, from 0
    delimiter : between columns
    """

    names: tuple[str, ...]
    units: dict[str, str]
    rate: float
    first: int
    delimiter: str


def nexus_head(text: bytes, lines: list[str], start: int, section: str | None, where: str) -> NexusHead | None:
    """The head of a section, or None for another kind of table.

    Raises TrajectoryError, UnknownNameError: if there are several sections and none is chosen, or it is not there.
    """
    delimiter = "\t" if "\t" in "".join(lines[start : start + _HEAD]) else ","
    if not _begins(lines, start, delimiter):
        if section is not None:
            raise TrajectoryError(
                f"{where}: topic={section!r:.60} is for bags, workbooks, .mat files and tables of several sections; "
                "leave it out"
            )
        return None
    whole = text.decode().split("\n")
    found = {_kind(whole[k], delimiter): k for k in range(len(whole)) if _begins(whole, k, delimiter)}
    if section is not None and section.lower() not in found:
        raise unknown_name(f"section of {where}", section, [kind.title() for kind in found])
    if section is None and len(found) > 1:
        listed = ", ".join(kind.title() for kind in found)
        one = next(iter(found)).title()
        raise TrajectoryError(f"{where}: several sections, {listed}; choose one with topic={one!r} (--topic '{one}')")
    place = found[section.lower()] if section is not None else start
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
    return NexusHead(tuple(names), unit_row(names, units) or {}, float(rows[1][0]), place + _HEAD, delimiter)


def _kind(line: str, delimiter: str) -> str:
    return line.split(delimiter)[0].strip().strip('"').lower()


def _begins(lines: list[str], place: int, delimiter: str) -> bool:
    """Whether a section begins in a line: its kind, a rate below it, and then the names and `Frame`."""
    if place + _HEAD >= len(lines) or _kind(lines[place], delimiter) not in _KINDS:
        return False
    rate = lines[place + 1].split(delimiter)[0].strip().strip('"')
    return rate.replace(".", "", 1).isdigit() and _FRAMES[0] in lines[place + 3]
