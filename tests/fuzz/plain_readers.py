"""Plain readers of motion files, which share nothing with those of the library: what an accepted file says.

They know only what good files look like, and are strict about it: a table of labels and finite numbers.
"""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_UNIT_WORDS = re.compile(r"[\s\[\]()°]*[^\W\d_]*[\s\[\]()°]*")

CLOCK = "\0time"
"""The label of times that are no column of the file."""
IN_MUJOCOS_ORDER = ("\0first", "\0second", "\0third")
"""The labels of joints without names."""
Columns = dict[str, list[float]]


class NotPlain(Exception):
    """A file that a plain reader does not take: an accepted one should not be like this."""


class NotKnown(Exception):
    """A file of a kind that the plain reader knows nothing of."""


def strict_number(text: str) -> float:
    """A number by the grammar of decimal numbers alone, with any blanks around it."""
    stripped = text.strip()
    if not NUMBER.fullmatch(stripped):
        raise NotPlain(f"{text[:40]!r} is no number")
    value = float(stripped)
    if not np.isfinite(value):
        raise NotPlain(f"{text[:40]!r} is not finite")
    return value


def _split(text: str, mark: str) -> list[list[str]]:
    """The rows of a delimited text, letter by letter: quotes enclose marks and line ends, two of them are one."""
    rows: list[list[str]] = [[""]]
    inside = False
    k = 0
    while k < len(text):
        letter = text[k]
        if inside:
            if letter == '"' and text[k + 1 : k + 2] == '"':
                rows[-1][-1] += '"'
                k += 1
            elif letter == '"':
                inside = False
            else:
                rows[-1][-1] += letter
        elif letter == '"' and not rows[-1][-1]:
            inside = True
        elif letter == mark:
            rows[-1].append("")
        elif letter in "\r\n":
            rows.append([""])
        else:
            rows[-1][-1] += letter
        k += 1
    if inside:
        raise NotPlain("a quote is not closed")
    return [row for row in rows if any(entry.strip() for entry in row)]


def delimited(data: bytes) -> Columns:
    text = data.decode("utf-8-sig")
    first = next((line for line in re.split(r"[\r\n]", text) if line.strip()), "")
    marks = [mark for mark in ",;\t" if mark in re.sub(r'"[^"]*"', "", first)]
    if len(marks) > 1:
        raise NotPlain("two kinds of marks in the header")
    header, *rows = _split(text, marks[0] if marks else ",")
    names = [name.strip() for name in header]
    if len(set(names)) != len(names) or not all(names):
        raise NotPlain("names that stand twice, or none")
    if any(len(row) != len(names) for row in rows):
        raise NotPlain("rows of several lengths")
    if rows and all(_UNIT_WORDS.fullmatch(entry) for entry in rows[0]):
        rows = rows[1:]
    columns: Columns = {}
    for place, name in enumerate(names):
        columns[name] = [_maybe(row[place]) for row in rows]
    commas = [entry for row in rows for entry in row if "," in entry]
    if commas and all(re.fullmatch(r"\s*[-+]?[1-9]\d{0,2}(,\d{3})+\s*", entry) for entry in commas):
        raise NotPlain("commas that may be marks of thousands")
    if commas and any("." in entry and NUMBER.fullmatch(entry.strip()) for row in rows for entry in row):
        raise NotPlain("points and commas")
    return columns


def _maybe(entry: str) -> float:
    """A number, NaN for what is none: such a column may be left out."""
    if entry.count(",") == 1 and "." not in entry:
        entry = entry.replace(",", ".")
    try:
        return strict_number(entry)
    except NotPlain:
        return np.nan


def opensim(data: bytes) -> Columns:
    lines = re.split(r"\r\n|\r|\n", data.decode("utf-8-sig"))
    end = next(k for k, line in enumerate(lines) if line.strip().lower() == "endheader")
    rows = [line.split() for line in lines[end + 1 :] if line.strip()]
    names, rows = rows[0], rows[1:]
    if any(len(row) != len(names) for row in rows):
        raise NotPlain("rows of several lengths")
    for line in lines[:end]:
        said = re.fullmatch(r"\s*(nrows|datarows|ncolumns|datacolumns)\s*[= ]\s*(\S+)\s*", line.lower())
        if said and int(said[2]) != (len(rows) if "rows" in said[1] else len(names)):
            raise NotPlain(f"the header says {line!r}")
    if rows and all(_UNIT_WORDS.fullmatch(entry) for entry in rows[0]):
        rows = rows[1:]
    columns: Columns = {}
    for place, name in enumerate(names):
        parts = name.split("/")
        if len(parts) >= 3 and parts[-1] in ("value", "speed"):
            if parts[-1] == "speed":
                continue
            name = parts[-2]
        columns[name] = [_maybe(row[place]) for row in rows]
    return columns


def ros_yaml(data: bytes) -> Columns:
    import yaml

    documents = [document for document in yaml.load_all(data.decode("utf-8-sig"), Loader=yaml.BaseLoader) if document]
    rows: dict[float, dict[str, float]] = {}
    for document in documents:
        while isinstance(document, dict) and not {"points", "position"} & set(document):
            document = next(
                value for key, value in document.items() if key in ("goal", "request", "trajectory", "joint_trajectory")
            )
        stamp = (
            _seconds((document.get("header") or {}).get("stamp", 0.0))
            if isinstance(document.get("header"), dict)
            else 0.0
        )
        if "points" in document:
            for point in document["points"]:
                start = _seconds(point["time_from_start"])
                if start < 0.0:
                    raise NotPlain("a time before the start")
                time = start + (stamp if len(documents) > 1 else 0.0)
                _put(rows, time, document["joint_names"], point["positions"])
        else:
            _put(rows, stamp, document["name"], document["position"])
    names = {str(name) for row in rows.values() for name in row}
    if any(set(row) != names for row in rows.values()):
        raise NotPlain("rows of several joints")
    return {CLOCK: list(rows)} | {name: [row[name] for row in rows.values()] for name in names}


def _put(rows: dict[float, dict[str, float]], time: float, names: list, values: list) -> None:
    if len(names) != len(values):
        raise NotPlain("names and values differ in number")
    row = rows.setdefault(time, {})
    for name, value in zip(names, values, strict=True):
        if str(name) in row:
            raise NotPlain(f"{name} stands twice")
        row[str(name)] = strict_number(value)


def _seconds(stamp: object) -> float:
    if isinstance(stamp, dict):
        whole = stamp.get("sec", stamp.get("secs", 0))
        part = stamp.get("nanosec", stamp.get("nsecs", stamp.get("nsec", 0)))
        return int(whole) + int(part) * 1e-9
    return strict_number(str(stamp))


def npz(data: bytes) -> Columns:
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        if "qpos" in arrays:
            return _qpos(np.asarray(arrays["qpos"]), dict(arrays))
        names, shapes = [str(name) for name in np.ravel(arrays["joint_names"])], np.asarray(arrays["shapes"])
        return {CLOCK: list(arrays["time"])} | {name: list(shapes[:, k]) for k, name in enumerate(names)}


def _qpos(qpos: np.ndarray, arrays: dict) -> Columns:
    if "joint_names" in arrays:
        raise NotKnown
    times = arrays.get("time", np.arange(len(qpos)) * np.ravel(arrays.get("timestep", [np.nan]))[0])
    if not np.isfinite(np.asarray(times, dtype=float)).all():
        raise NotKnown
    return {CLOCK: list(times)} | dict(zip(IN_MUJOCOS_ORDER, qpos[:, -3:].T.tolist(), strict=True))


def _of_arrays(entries: dict) -> Columns:
    """Vectors by name, or a matrix with names."""
    if "shapes" in entries and "joint_names" in entries:
        names = [str(name).strip() for name in np.ravel(entries["joint_names"])]
        shapes = np.asarray(entries["shapes"])
        if shapes.shape != (np.size(entries["time"]), len(names)):
            raise NotKnown
        found = {name: list(shapes[:, k]) for k, name in enumerate(names)}
        return found | {"time": list(np.ravel(entries["time"]))}
    return {name: list(np.ravel(value)) for name, value in entries.items() if np.asarray(value).size > 1}


def matlab(data: bytes) -> Columns:
    import scipy.io

    entries = {k: v for k, v in scipy.io.loadmat(io.BytesIO(data), squeeze_me=True).items() if not k.startswith("__")}
    if "time" not in entries or any(np.asarray(value).dtype.kind not in "fiuUO" for value in entries.values()):
        raise NotKnown
    return _of_arrays(entries)


def hdf5(data: bytes) -> Columns:
    import h5py

    with h5py.File(io.BytesIO(data), "r") as file:
        if "time" not in file or any(not isinstance(file[name], h5py.Dataset) for name in file):
            raise NotKnown
        return _of_arrays(
            {
                name: [t.decode() for t in file[name][()]] if file[name].dtype.kind in "OS" else file[name][()]
                for name in file
            }
        )


_SHEET = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"


def excel(data: bytes) -> Columns:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        root = ElementTree.fromstring(archive.read("xl/worksheets/sheet1.xml"))
    rows = []
    for row in root.iter(f"{_SHEET}row"):
        cells: dict[str, object] = {}
        for cell in row.iter(f"{_SHEET}c"):
            place, kind = cell.get("r"), cell.get("t", "n")
            if place is None or cell.get("s") or kind not in ("n", "inlineStr"):
                raise NotKnown
            text = "".join(cell.itertext())
            cells[place.rstrip("0123456789")] = text if kind == "inlineStr" else _maybe(text) if text else None
        if any(value not in (None, "") for value in cells.values()):
            rows.append(cells)
    header, *rest = rows
    if rest and all(isinstance(value, str) or value is None for value in rest[0].values()):
        rest = rest[1:]
    return {str(name).strip(): [_cell(row.get(place)) for row in rest] for place, name in header.items()}


def _cell(value: object) -> float:
    return value if isinstance(value, float) else np.nan if value is None else _maybe(str(value))


def parquet(data: bytes) -> Columns:
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(io.BytesIO(data), use_threads=False)
    found: Columns = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        values = column.to_pylist()
        if any(isinstance(value, bool) or not isinstance(value, int | float | str | None) for value in values):
            continue
        found[name.strip()] = [_cell(float(v) if isinstance(v, int) else v) for v in values]
    return found


def c3d(data: bytes) -> Columns:
    """The coordinates of the first point, as floating-point numbers of an Intel file."""
    words = np.frombuffer(data[:512], dtype="<u2")
    scale = float(np.frombuffer(data[12:16], dtype="<f4")[0])
    points, analog, first, last, start = (int(words[k]) for k in (1, 2, 3, 4, 8))
    place = (data[0] - 1) * 512
    if data[place + 3] != 84 or scale >= 0.0:
        raise NotKnown
    frames, width = last - first + 1, 4 * points + analog
    values = np.frombuffer(data, dtype="<f4", count=frames * width, offset=(start - 1) * 512).reshape(frames, width)
    return {f"Hip_{axis}": values[:, k].astype(float).tolist() for k, axis in enumerate("xyz")}


READERS: dict[str, Callable[[bytes], Columns]] = {
    ".csv": delimited,
    ".tsv": delimited,
    ".txt": delimited,
    ".mot": opensim,
    ".sto": opensim,
    ".yaml": ros_yaml,
    ".npz": npz,
    ".mat": matlab,
    ".h5": hdf5,
    ".xlsx": excel,
    ".parquet": parquet,
    ".c3d": c3d,
}


def plain_columns(file: Path, joint_names: Sequence[str]) -> Columns | None:
    """What a file says, in the units that stand there. None where nothing is known of it.

    Raises NotPlain for what no strict reader should take.
    """
    reader = READERS.get(file.suffix)
    if reader is None:
        return None
    try:
        found = reader(file.read_bytes())
    except NotKnown:
        return None
    # MuJoCo's qpos has no names: its columns are in the order of the body's file.
    own = dict(zip(IN_MUJOCOS_ORDER, joint_names, strict=False))
    return {own.get(name, name): values for name, values in found.items()}
