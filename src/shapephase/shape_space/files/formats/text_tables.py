"""Text tables as programs and spreadsheets write them: any separator, with a header or without; read by pandas."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....arrays import Integers
from ....errors import TrajectoryError
from .table_heads import COMMA_NUMBER, COMMENT, HEAD_ROWS, Head, head_of, is_value, nexus_head, numbers

if TYPE_CHECKING:
    import pandas as pd

_DELIMITERS = {",": "commas", "\t": "tabs", ";": "semicolons", "|": "bars"}
BLANKS = " "  # delimiter: any number of blanks
_HEAD_BYTES = 2**18  # beginning of a text, from which its layout follows
_SEPARATOR = re.compile(r"sep=(.)", re.IGNORECASE)  # a spreadsheet's first line that names the separator
_COMMA_ENTRY = rb"\s*([-+]?\d*,\d+(?:,\d+)*(?:[eE][-+]?\d+)?)\s*"
_PLAIN = re.compile(rb'(?:^|[;\t\n"])' + _COMMA_ENTRY + rb'(?=[;\t\n"]|$)')
_QUOTED = re.compile(rb'(?:^|[,\n])\s*"' + _COMMA_ENTRY + rb'"(?=\s*[,\n]|$)')
_POINT = re.compile(rb"\d\.\d")
_THOUSANDS = re.compile(rb"[-+]?[1-9]\d{0,2}(?:,\d{3})+")
_GAPS = ["", "nan", "NaN", "NAN", "-nan", "-NaN"]  # any other word is a fault


def read_text(
    where: Path, data: bytes, *, section: str | None = None, start: int = 0, delimiter: str | None = None
) -> pd.DataFrame:
    """A text table as a frame: columns as they are labelled there, its index the numbers of the lines.

    Columns are separated by commas, tabs, semicolons or blanks; decimal points, or all of them commas. A header may
    stand in the first row, behind `#` or `%`, in several rows as Vicon Nexus writes it, or nowhere; a row of units may
    follow. The frame's `attrs` have the rest of the header.
    """
    text = unix_text(data, where)
    layout = _layout(text, where, section, start, delimiter)
    body = text.split(b"\n", layout.skipped)[-1] if layout.skipped else text
    if section is not None or layout.rate is not None:
        body = body.split(b"\n\n", 1)[0]
    comma = _has_decimal_commas(body, layout, where)
    names, lines = _checked_rows(body, layout, where)
    frame = _parsed(body, names, layout.delimiter, comma=comma)
    frame.index = lines
    # Rows of separators alone are none.
    if frame.iloc[:, 0].isna().any():
        frame = frame.loc[frame.notna().any(axis=1)]
    kind = "TSV" if where.suffix.lower() == ".tsv" else "CSV"
    frame.attrs = {"format": kind, "units": layout.units, "comma": comma, "numbered": layout.numbered}
    if layout.rate is not None:
        frame.attrs["rate"] = layout.rate
    return frame


def unix_text(data: bytes, where: Path) -> bytes:
    """A text in UTF-8 whose lines end as in Unix, also of one in UTF-16 or Latin-1. Raises TrajectoryError."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            data = data.decode("utf-16").encode()
        except UnicodeError as error:
            raise TrajectoryError(f"{where}: no UTF-16 text ({error}); save it as UTF-8") from None
    data = data.removeprefix(b"\xef\xbb\xbf")
    zero = data.find(b"\0")
    if zero >= 0:
        raise TrajectoryError(f"{where}: byte {zero} is NUL, so this is no text; export the table as CSV in UTF-8")
    try:
        data.decode()
    except UnicodeDecodeError:
        data = data.decode("latin-1").encode()
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def _layout(text: bytes, where: Path, section: str | None, start: int, stated: str | None) -> Head:
    """Names, separator and first line, by the beginning of a text."""
    lines = text[:_HEAD_BYTES].decode(errors="replace").split("\n")
    place, comment = start, None
    while place < len(lines):
        separator = _SEPARATOR.fullmatch(lines[place].strip()) if place == start else None
        if separator is not None:
            stated = separator[1]
        elif COMMENT.match(lines[place]):
            comment = lines[place]
        elif lines[place].strip():
            break
        place += 1
    shown = [k for k in range(place, len(lines)) if lines[k].strip()][:HEAD_ROWS]
    if not shown:
        raise TrajectoryError(f"{where}: empty; a header `time,<joint names>` and rows of numbers are needed")
    nexus = nexus_head(text, lines, place, section, str(where))
    if nexus is not None:
        return nexus
    delimiter = stated or _delimiter(lines[place], where)
    rows = [split_line(lines[k], delimiter) for k in shown]
    names = None if comment is None else split_line(COMMENT.sub("", comment, count=1).rstrip('"'), delimiter)
    head = head_of(rows, names, str(where))
    first = shown[head.skipped] if head.skipped < len(shown) else shown[-1] + 1
    return head._replace(skipped=first, delimiter=delimiter)


def split_line(line: str, delimiter: str) -> list[str]:
    """The entries of a line, without blanks around them."""
    if delimiter == BLANKS:
        return [entry.strip('"') for entry in line.split()]
    if '"' not in line:
        return [entry.strip() for entry in line.split(delimiter)]
    return [entry.strip() for entry in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def _delimiter(line: str, where: Path) -> str:
    unquoted = re.sub(r'"[^"]*"', "name", line)
    marks = [mark for mark in _DELIMITERS if mark in unquoted.strip(" ")]
    if where.suffix.lower() == ".tsv" and marks != ["\t"]:
        raise TrajectoryError(f"{where}: the columns of a .tsv file are separated by tabs; it begins {line!r:.80}")
    if len(marks) > 1:
        others = [mark for mark in marks if mark != "," and all(map(is_value, split_line(line, mark)))]
        if len(others) == 1:
            return others[0]
        kinds = " and ".join(_DELIMITERS[mark] for mark in marks)
        raise TrajectoryError(
            f"{where}: the header has {kinds}, so it is unclear which separates the columns; use one of them only"
        )
    if marks:
        return marks[0]
    return BLANKS if len(unquoted.split()) > 1 else ","


def _has_decimal_commas(body: bytes, layout: Head, where: Path) -> bool:
    """True where numbers have decimal commas. Raises TrajectoryError where these may be marks of thousands."""
    if (b'"' if layout.delimiter == "," else b",") not in body:
        return False
    if layout.delimiter == BLANKS:
        return any(COMMA_NUMBER.fullmatch(word) for word in body[:_HEAD_BYTES].decode(errors="replace").split())
    entry, head = _QUOTED if layout.delimiter == "," else _PLAIN, body[:_HEAD_BYTES]
    if len(entry.findall(head)) < len(_POINT.findall(head)):
        return False
    doubtful = None
    for match in entry.finditer(body):
        if match[1].count(b",") == 1 and not _THOUSANDS.fullmatch(match[1]):
            return True
        doubtful = doubtful or match
    if doubtful is not None:
        row = layout.skipped + 1 + body.count(b"\n", 0, doubtful.start(1))
        raise TrajectoryError(
            f"{where}: row {row}: {doubtful[1].decode()!r:.40} may have a decimal comma or a mark of thousands, and no "
            "other entry tells which; write numbers with a decimal point, and no marks of thousands"
        )
    return False


def _checked_rows(body: bytes, layout: Head, where: Path) -> tuple[tuple[str, ...], Integers]:
    """Names of all columns, and numbers of the lines that pandas takes as rows.

    Raises TrajectoryError for a row of another length than the header: pandas would fill or shift it.
    """
    delimiter, names, width = layout.delimiter, layout.names, len(layout.names)
    counts, lines = _quoted_counts(body, layout, where) if b'"' in body else _counts(body, delimiter)
    lines += layout.skipped + 1
    if len(counts) and (counts == width + 1).all() and delimiter != BLANKS:
        last = body.rstrip(b"\n").rsplit(b"\n", 1)[-1].rstrip()
        if last.endswith(delimiter.encode()):
            names, width = (*names, ""), width + 1
    if len(counts) > 1 and (counts == width + 1).all():
        # Row names of R and the index of pandas, without a name: the first two rows begin with 0 and 1, or 1 and 2.
        rows = [split_line(line.decode(), delimiter) for line in body.split(b"\n", 4)[:4] if line.strip()]
        if [row[0].strip('"') for row in rows][:2] in (["0", "1"], ["1", "2"]):
            names, width = ("", *names), width + 1
    wrong = np.flatnonzero(counts != width)
    if len(wrong):
        line, count = int(lines[wrong[0]]), int(counts[wrong[0]])
        fault = f"{where}: row {line} has {count} entries, the header {len(layout.names)}"
        entries = body.split(b"\n")[line - layout.skipped - 1].decode(errors="replace").split(delimiter)
        if count == 2 * len(layout.names) and all(entry.strip().lstrip("+-").isdigit() for entry in entries):
            remedy = "decimal commas between commas cannot be told apart, separate the columns by semicolons"
        else:
            remedy = "write one entry for each name, and leave a cell empty where nothing was recorded"
        raise TrajectoryError(f"{fault}; {remedy}")
    return names, lines


def _counts(body: bytes, delimiter: str) -> tuple[Integers, Integers]:
    """Entries of each row of a text without quotes, and its line from 0."""
    rows = body.removesuffix(b"\n").split(b"\n")
    if delimiter == BLANKS:
        counts = np.array([len(row.split()) for row in rows], dtype=np.int64)
    else:
        mark = delimiter.encode()
        counts = np.array([row.count(mark) + 1 for row in rows], dtype=np.int64)
        for k in np.flatnonzero((counts == 1) | (counts != counts[0])).tolist():
            if not rows[k].strip(b" \t"):
                counts[k] = 0
    lines = np.flatnonzero(counts)
    return counts[lines], lines


def _quoted_counts(body: bytes, layout: Head, where: Path) -> tuple[Integers, Integers]:
    """Entries of each row of a text with quotes, in which lines may break, and its line from 0."""
    counts, lines = [], []
    text, mark = io.StringIO(body.decode(), newline=""), layout.delimiter
    reader = csv.reader(text, delimiter=mark, strict=True, skipinitialspace=mark == BLANKS)
    try:
        for entries in reader:
            if entries:
                counts.append(len(entries))
                lines.append(reader.line_num - 1)
    except csv.Error as error:
        raise TrajectoryError(
            f"{where}: row {layout.skipped + reader.line_num}: {error}; close the quotation marks"
        ) from None
    return np.array(counts, dtype=np.int64), np.array(lines, dtype=np.int64)


def _parsed(body: bytes, names: tuple[str, ...], delimiter: str, *, comma: bool) -> pd.DataFrame:
    """The columns as pandas reads them, by their labels: numbers where all entries are, else texts."""
    import pandas as pd

    # From 3.1 on, pandas always reads decimals to the nearest double.
    major, minor = (int(part) for part in pd.__version__.split(".")[:2])
    exact: dict[str, Any] = {} if (major, minor) >= (3, 1) else {"float_precision": "round_trip"}
    frame = pd.read_csv(
        io.BytesIO(body),
        sep=r"\s+" if delimiter == BLANKS else delimiter,
        header=None,
        names=list(numbers(len(names))),
        index_col=False,
        decimal="," if comma else ".",
        keep_default_na=False,
        na_values=_GAPS,
        skipinitialspace=True,
        low_memory=False,
        **exact,
    )
    frame.columns = list(names)
    return frame
