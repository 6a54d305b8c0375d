"""OpenSim's motion and storage files, as inverse kinematics and simulations write them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ....arrays import Array
from ....errors import TrajectoryError
from ..recording import Table
from .frames import file_table
from .segment_poses import body_kinematics
from .text_tables import BLANKS, read_text, unix_text

END = "endheader"  # line that closes the header
_HEADER_BYTES = 2**16  # searched for the header, which has a dozen lines
# SIMM's older words for OpenSim's nRows and nColumns.
_COUNTS = {"nrows": "rows", "datarows": "rows", "ncolumns": "columns", "datacolumns": "columns"}
# First lines of results that are no coordinates, though their columns may have the names of coordinates.
_OTHERS = ("speeds", "accelerations", "positionerrors", "actuatorforces", "actuatorpowers", "controls")
_OF_MUSCLES = (".activation", ".fiber_length")  # states before OpenSim 4
_SPREADSHEET = ",;"  # separators that a spreadsheet adds, behind header lines too


def has_header(data: bytes) -> bool:
    """True where a line closes a header of OpenSim."""
    return any(_plain(line).lower() == END for line in data[:_HEADER_BYTES].decode(errors="replace").splitlines())


def read_opensim(where: Path, data: bytes) -> Table:
    """Motion in an OpenSim motion or storage file: header lines up to `endheader`, names, numbers.

    `inDegrees` is the unit of rotational coordinates. In a file of states, `.../<coordinate>/value` is the coordinate,
    before OpenSim 4 its bare name; speeds (`.../speed`, `<coordinate>_u`) and states of muscles are left out. A
    spreadsheet puts commas between columns when it saves the file.
    """
    text = unix_text(data, where)
    lines = text[:_HEADER_BYTES].decode(errors="replace").split("\n")
    end = next((k for k, line in enumerate(lines) if _plain(line).lower() == END), None)
    if end is None:
        raise TrajectoryError(f"{where}: no line `{END}` closes the header; if it is no OpenSim file, name it .csv")
    header = _header(lines[:end], where)
    title = header.get("", "")
    if title.lower().endswith(_OTHERS):
        raise TrajectoryError(
            f"{where}: line 1: {title!r:.40}, and coordinates are needed; give the file with the motion, as "
            "..._Kinematics_q.sto or the .mot file of inverse kinematics"
        )
    mark = next((mark for mark in _SPREADSHEET if lines[end].rstrip().endswith(mark)), BLANKS)
    try:
        frame = read_text(where, text, start=end + 1, delimiter=mark)
    except TrajectoryError as error:
        raise TrajectoryError(str(error).replace(": row ", ": line ", 1)) from None
    frame.attrs |= {"format": "OpenSim", "row": "line"}
    in_degrees = header.get("indegrees", "").lower()
    degrees = {"": None, "yes": True, "no": False}[in_degrees]
    table = replace(file_table(frame, str(where)), by_format=True, degrees=degrees)
    for kind, count in (("rows", len(table.rows)), ("columns", len(frame.columns))):
        stated = header.get(kind, str(count))
        if not stated.isascii() or not stated.isdigit() or (stated.lstrip("0") or "0") != str(count):
            raise TrajectoryError(
                f"{where}: the header says {stated:.40} {kind}, the table has {count}; the file is cut off or was "
                "edited: write it anew, or correct the header"
            )
    columns: dict[str, Array] = {}
    faults = {}
    for name, values in table.columns.items():
        parts = name.split("/")
        is_state, older = len(parts) > 2, name.removesuffix("_u")
        if (is_state and parts[-1] != "value") or name.endswith(_OF_MUSCLES) or (older != name and older in columns):
            continue
        coordinate = parts[-2] if is_state else name
        if coordinate in columns:
            raise TrajectoryError(f"{where}: two columns are the coordinate {coordinate}, one is {name!r}; keep one")
        columns[coordinate] = values
        faults[coordinate] = table.faults.get(name, {})
    return body_kinematics(replace(table, columns=columns, faults=faults, up="y"), title)


def _plain(line: str) -> str:
    return line.strip().strip(_SPREADSHEET + '"').strip()


def _header(lines: list[str], where: Path) -> dict[str, str]:
    """Entries of the header in lower case, and its first line under the empty name. Raises TrajectoryError."""
    header: dict[str, str] = {}
    for line, text in enumerate(map(_plain, lines), start=1):
        header.setdefault("", text)
        key, mark, value = text.partition("=")
        if not mark:
            key, _, value = text.partition(" ")
        key, value = key.strip().lower(), value.strip()
        known = _COUNTS.get(key, key)
        if known in ("rows", "columns", "indegrees", "datatype") and header.setdefault(known, value) != value:
            raise TrajectoryError(
                f"{where}: line {line}: {text!r:.60} contradicts {header[known]!r} further up; keep one"
            )
    if header.get("datatype", "double").lower() != "double":
        raise TrajectoryError(
            f"{where}: DataType={header['datatype']}, and joint motions are DataType=double; export the coordinates"
        )
    if header.get("indegrees", "no").lower() not in ("yes", "no"):
        raise TrajectoryError(
            f"{where}: inDegrees={header['indegrees']!r:.40} in the header; write inDegrees=yes or inDegrees=no"
        )
    return header
