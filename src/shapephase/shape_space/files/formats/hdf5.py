"""Motions in HDF5, of which the newest kind of MATLAB's files is one."""

from __future__ import annotations

import importlib.util
import io
import json
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import MissingExtraError, TrajectoryError
from .._labels import unit_of
from .._recording import Table
from .named_arrays import arrays_table
from .parser_process import parsed

MOST_VALUES = 2**24
"""Values of a file's arrays: an hour of a hundred joints at forty samples a second."""
_MAGIC = b"\x89HDF\r\n\x1a\n"
# Where HDF5 may begin: MATLAB writes 512 bytes of its own before it.
_STARTS = (0, 512)
_MATLAB = b"MATLAB"
_VALUE = 8
"""Bytes of a number; entries of a text may be much longer."""
_MOST_ENTRIES = 10_000
"""Arrays and structures of a file."""
_DEEPEST = 4
"""Structures inside each other that are read."""
_TREE = "tree"
"""The array that says how the others belong together."""


def is_hdf5(data: bytes) -> bool:
    """Whether bytes begin as HDF5."""
    return any(data[start : start + len(_MAGIC)] == _MAGIC for start in _STARTS)


def read_hdf5(where: Path, data: bytes, chosen: str | None) -> Table:
    """An HDF5 file, its arrays as those of a `.mat` file; the attribute `units` of one says its unit.

    The file is parsed in a process of its own: of a damaged one HDF5 may ask for gigabytes.

    Raises
    ------
    TrajectoryError, UnknownNameError, MissingExtraError
        For faults; for a structure that is not there; without h5py.
    """
    kind = "MATLAB 7.3" if data.startswith(_MATLAB) else "HDF5"
    if importlib.util.find_spec("h5py") is None:
        raise MissingExtraError(f"{kind} files need h5py; install it with: pip install 'shapephase[data]'")
    arrays = parsed(where, data, kind, __name__)
    tree = json.loads(str(arrays[_TREE]))
    return arrays_table(str(where), kind, _joined(tree["entries"], arrays), chosen, tree["units"])


def parse(data: bytes) -> dict[str, Any]:
    """What the process that parses does with the bytes of a file: its arrays, and how they belong together."""
    import h5py

    units: dict[str, str] = {}
    arrays: dict[str, Any] = {}
    with h5py.File(io.BytesIO(data), "r") as file:
        values, entries = 0, 0

        def weigh(_: str, item: Any) -> None:
            nonlocal values, entries
            values += (item.nbytes or 0) // _VALUE if isinstance(item, h5py.Dataset) else 0
            entries += 1
            if values > MOST_VALUES or entries > _MOST_ENTRIES:
                raise TrajectoryError(f"more than {MOST_VALUES} values")

        file.visititems(weigh)
        found = _group(file, 0, units, matlab=data.startswith(_MATLAB))
    tree = {"entries": _apart(found, arrays), "units": units}
    return {**arrays, _TREE: np.array(json.dumps(tree))}


def _apart(found: dict[str, Any], arrays: dict[str, Any]) -> dict[str, Any]:
    """What is to be said of entries in JSON; arrays of numbers become a number, and stand in `arrays` by it."""
    said: dict[str, Any] = {}
    for name, value in found.items():
        said[name] = _apart(value, arrays) if isinstance(value, dict) else value
        if isinstance(value, np.ndarray):
            said[name] = len(arrays)
            arrays[f"array_{len(arrays)}"] = value
    return said


def _joined(said: dict[str, Any], arrays: dict[str, Any]) -> dict[str, Any]:
    """The opposite of `_apart`."""
    return {
        name: _joined(value, arrays)
        if isinstance(value, dict)
        else arrays[f"array_{value}"]
        if isinstance(value, int)
        else value
        for name, value in said.items()
    }


def _group(group: Any, depth: int, units: dict[str, str], *, matlab: bool) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name in group:
        # What leads out of the file, or nowhere, is not followed.
        if name.startswith("#") or type(group.get(name, getlink=True)).__name__ != "HardLink":
            continue
        item = group[name]
        if hasattr(item, "keys"):
            found[name] = _group(item, depth + 1, units, matlab=matlab) if depth < _DEEPEST else None
            continue
        said = item.attrs.get("units", item.attrs.get("unit", ""))
        unit = unit_of(said.decode() if isinstance(said, bytes) else str(said))
        if unit is not None:
            units[name] = unit
        found[name] = _dataset(item, group.file, matlab=matlab)
    return found


def _dataset(item: Any, file: Any, *, matlab: bool) -> Any:
    """Numbers as an array, texts as a list, None for anything else; MATLAB's axes are in the opposite order there."""
    value = np.asarray(item[()])
    made_of = item.attrs.get("MATLAB_class", b"")
    if made_of == b"char":
        return [_characters(value)]
    if made_of == b"cell":
        parts = [file[reference] for reference in value.T.ravel()]
        texts = [part.attrs.get("MATLAB_class", b"") == b"char" for part in parts]
        return [_characters(np.asarray(part[()])) for part in parts] if all(texts) else None
    if value.dtype.kind == "O":
        entries = value.ravel().tolist()
        return [entry.decode() for entry in entries] if all(isinstance(entry, bytes) for entry in entries) else None
    if value.dtype.kind == "S":
        return [entry.decode() for entry in value.ravel().tolist()]
    if made_of == b"logical":
        value = value.astype(bool)
    return value.T if matlab else value


def _characters(codes: Any) -> str:
    return "".join(map(chr, codes.T.ravel().tolist())).strip()
