"""Arrays by name, as in files of MATLAB and HDF5, as columns of times and joints."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import TrajectoryError, unknown_name
from ....warning_filters import quiet
from ..labels import unit_of
from ..recording import Table
from .column_tables import column_table
from .parser_process import by_library

_MATRICES = ("shapes", "data", "q", "values")
_NAMES = ("joint_names", "names", "colheaders", "labels", "columns", "headers")
_OF_THE_BASE = {  # matrices of the base's motion, and the labels of their columns in a table
    "base_quat_xyzw": ("base_qx", "base_qy", "base_qz", "base_qw"),
    "base_quat_wxyz": ("base_qw", "base_qx", "base_qy", "base_qz"),
    "base_position": ("base_x", "base_y", "base_z"),
}
_FIRST_TURNS = ("_Xrotation", ".rx")  # endings of the names of a ball joint's angles
_DEEPEST = 4  # nested structures that are searched
_MAGIC = b"\x89HDF\r\n\x1a\n"
_STARTS = (0, 512)  # offsets of HDF5: MATLAB writes 512 bytes before it
# Classes of variables that only MATLAB can read.
_OBJECTS = ("opaque", "object", "function", "table", "timetable", "datetime", "duration", "string", "function_handle")


def arrays_table(
    where: str,
    kind: str,
    entries: Mapping[str, Any],
    chosen: str | None,
    units: Mapping[str, str] | None = None,
    *,
    ordered: bool = True,
) -> Table:
    """Table of arrays by name: vectors of one length, or a matrix beside the names of its columns.

    entries : name -> array of numbers, list of texts, or entries of a structure
    ordered : True if entries stand in the order in which they were written
    """
    inside: Mapping[str, Any] = entries
    if chosen is not None:
        groups = {name for name, value in entries.items() if isinstance(value, Mapping)}
        if chosen not in groups:
            raise unknown_name(f"structure in {where}", chosen, sorted(groups))
        inside = entries[chosen]
    for _ in range(_DEEPEST):
        columns, used = _matrix(where, inside)
        turns = [] if columns or ordered else [name for name in inside if name.endswith(_FIRST_TURNS)]
        if turns:
            raise TrajectoryError(
                f"{where}: {kind} keeps no order of names, and {turns[0]!r} is one of three turns in the order of "
                "their columns; write the quaternion in columns .x, .y, .z, .w, or a matrix beside joint_names"
            )
        columns = columns or [
            (name, vector) for name, value in inside.items() if (vector := _vector(where, name, value)) is not None
        ]
        if columns:
            base = _base_columns(where, inside)
            of_base = {label: units[name] for label, name, _ in base if units and name in units}
            read = {*used, *(label for label, _ in columns), *(name for _, name, _ in base)}
            columns += [(label, values) for label, _, values in base]
            table = column_table(where, kind, columns, units={**(units or {}), **of_base}, row="sample")
            unread = {name: value for name, value in inside.items() if name not in read}
            # Matrices as long as the columns, whose columns have no names.
            unnamed = [
                name
                for name in _MATRICES
                if isinstance(value := unread.get(name), np.ndarray)
                and value.ndim > 1
                and len(table.rows) in value.shape
            ]
            described = {name: _described(value) for name, value in unread.items()}
            return replace(table, unread=described, unnamed=unnamed)
        groups = {name: value for name, value in inside.items() if isinstance(value, Mapping)}
        if len(groups) != 1:
            break
        (inside,) = groups.values()
    groups = [name for name, value in inside.items() if isinstance(value, Mapping)]
    if len(groups) > 1:
        raise TrajectoryError(f"{where}: several structures, choose one with topic=: {', '.join(groups[:20])}")
    listed = ", ".join(f"{name}, {_described(value)}" for name, value in list(inside.items())[:12]) or "nothing"
    raise TrajectoryError(
        f"{where}: no motion; vectors of one length, named `time` and as the joints, or a matrix `shapes` beside the "
        f"names of its columns in `joint_names`, are needed; there is {listed}"
    )


def _matrix(where: str, entries: Mapping[str, Any]) -> tuple[list[tuple[object, Any]], tuple[str, ...]]:
    """The columns of a matrix that has names, and of vectors as long as it; and which entries these are."""
    named = next((k for k in _NAMES if isinstance(v := entries.get(k), list) and {*map(type, v)} == {str}), None)
    key = next((key for key in _MATRICES if isinstance(v := entries.get(key), np.ndarray) and v.ndim == 2), None)
    if named is None or key is None:
        return [], ()
    matrix, names = entries[key], entries[named]
    if matrix.shape[1] != len(names):
        raise TrajectoryError(f"{where}: {key} has {matrix.shape[1]} columns, and there are {len(names)} names")
    others = [
        (name, vector)
        for name, value in entries.items()
        if name != key and (vector := _vector(where, name, value)) is not None and len(vector) == len(matrix)
    ]
    return [*others, *((name, matrix[:, k]) for k, name in enumerate(names))], (named, key)


def _base_columns(where: str, entries: Mapping[str, Any]) -> list[tuple[str, str, Any]]:
    """Label, matrix and values of the columns of the base's place and attitude."""
    columns: list[tuple[str, str, Any]] = []
    for name, labels in _OF_THE_BASE.items():
        if name not in entries:
            continue
        value = entries[name]
        if not isinstance(value, np.ndarray) or value.ndim != 2 or value.shape[1] != len(labels):
            raise TrajectoryError(
                f"{where}: {name} is {_described(value)}; a matrix of {len(labels)} columns is needed"
            )
        columns += [(label, name, value[:, k]) for k, label in enumerate(labels)]
    return columns


def _vector(where: str, name: str, value: Any) -> Any:
    """A vector of two entries or more, also a matrix of one row or column; None for anything else.

    Raises TrajectoryError for complex numbers. Vectors of true and false are kept: a table reports them where used.
    """
    if not isinstance(value, np.ndarray) or value.size < 2 or value.size != max(value.shape, default=0):
        return None
    if value.dtype.kind == "c":
        raise TrajectoryError(f"{where}: {name} holds complex numbers; write its real part alone")
    return value.ravel() if value.dtype.kind in "bfiumM" else None


def _described(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return f"an array {value.shape} of {value.dtype}" if value.size != 1 else "a single value"
    return "a structure" if isinstance(value, Mapping) else "text" if isinstance(value, list) else "of another kind"


def read_hdf5(where: Path, data: bytes, chosen: str | None) -> Table:
    """Motion in an HDF5 file, its arrays as those of a `.mat` file; the attribute `units` of one is its unit."""
    with by_library(where, "HDF5 file", "h5py"):
        import h5py
    entries: dict[str, Any] = {}
    units: dict[str, str] = {}

    def keep(path: str, item: Any) -> None:
        *above, name = path.split("/")
        inside = entries
        for group in above:
            inside = inside[group]
        if isinstance(item, h5py.Group):
            inside[name] = {}
            return
        stated = item.attrs.get("units", item.attrs.get("unit", ""))
        unit = unit_of(stated.decode() if isinstance(stated, bytes) else str(stated))
        if unit is not None:
            units[name] = unit
        is_text = h5py.check_string_dtype(item.dtype) is not None
        value = np.asarray(item.asstr()[()] if is_text else item[()])
        inside[name] = value.ravel().tolist() if is_text else None if value.dtype.kind == "O" else value

    with by_library(where, "HDF5 file", "h5py"), h5py.File(io.BytesIO(data), "r") as file:
        # Every object once, groups before their members; links that lead out of the file are not followed.
        file.visititems(keep)
    return arrays_table(str(where), "HDF5", entries, chosen, units, ordered=False)


def read_matlab(where: Path, data: bytes, chosen: str | None) -> Table:
    """Motion in a `.mat` file: vectors by name, or a matrix with names of its columns, on top or in a structure.

    Objects of MATLAB, tables among them, are not read.
    """
    with by_library(where, "MATLAB file", "pymatreader and h5py", "save it anew with save(file, '-v7')"), quiet():
        import pymatreader

        entries, listed = pymatreader.read_mat(where), pymatreader.whosmat(where)
    classes = {name: kind for name, _, kind in listed}
    objects = [name for name, kind in classes.items() if kind in _OBJECTS]
    if objects and len(objects) == len(classes):
        raise TrajectoryError(
            f"{where}: {', '.join(objects[:5])}: tables and other objects of MATLAB are not read; write the table with "
            "parquetwrite or writetable, or save it as a structure with save(file, '-struct', 's')"
        )
    # HDF5 keeps no order of names, and pymatreader returns them in any.
    unordered = any(data[start : start + len(_MAGIC)] == _MAGIC for start in _STARTS)
    names = sorted(entries) if unordered else list(entries)
    readable = {name: _plain(entries[name], unordered) for name in names if classes.get(name, "opaque") not in _OBJECTS}
    # pymatreader reads what is true or false as ones and zeros.
    for name, value in readable.items():
        if classes[name] == "logical" and isinstance(value, np.ndarray):
            readable[name] = value.astype(bool)
    return arrays_table(str(where), "MATLAB 7.3" if unordered else "MATLAB", readable, chosen, ordered=not unordered)


def _plain(value: Any, unordered: bool) -> Any:
    """A structure as a dictionary, texts as a list, numbers as an array; None for anything else."""
    if isinstance(value, dict):
        return {name: _plain(value[name], unordered) for name in (sorted(value) if unordered else value)}
    entries = value if isinstance(value, list) else [value]
    if entries and all(isinstance(entry, str) for entry in entries):
        return [entry.strip() for entry in entries]
    if isinstance(value, list | None):
        return None
    array = np.asarray(value)
    if array.dtype.kind == "U":
        return [entry.strip() for entry in array.ravel().tolist()]
    return None if array.dtype.kind == "O" else array
