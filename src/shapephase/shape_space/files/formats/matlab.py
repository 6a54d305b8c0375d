"""Motions in MATLAB's `.mat` files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ....errors import MissingExtraError, TrajectoryError
from ....warning_filters import quiet
from ..recording import Table
from .hdf5 import is_hdf5
from .named_arrays import arrays_table

# Classes of variables that only MATLAB can read.
_OBJECTS = ("opaque", "object", "function", "table", "timetable", "datetime", "duration", "string", "function_handle")


def read_matlab(where: Path, data: bytes, chosen: str | None) -> Table:
    """Motion in a `.mat` file: vectors by name, or a matrix with names of its columns, on top or in a structure.

    Objects of MATLAB, tables among them, are not read.

    Raises TrajectoryError, UnknownNameError, MissingExtraError for faults; for a structure that is not there; without
    pymatreader or h5py.
    """
    try:
        import pymatreader

        with quiet():
            entries, listed = pymatreader.read_mat(where), pymatreader.whosmat(where)
    except ImportError:
        raise MissingExtraError(
            "MATLAB files need pymatreader and h5py; install them with: pip install 'shapephase[data]'"
        ) from None
    except Exception as error:  # a damaged file fails inside SciPy and h5py in many ways
        raise TrajectoryError(
            f"{where}: no MATLAB file that can be read ({type(error).__name__}: {error!s:.200}); save it anew with "
            "save(file, '-v7')"
        ) from None
    classes = {name: kind for name, _, kind in listed}
    objects = [name for name, kind in classes.items() if kind in _OBJECTS]
    if objects and len(objects) == len(classes):
        raise TrajectoryError(
            f"{where}: {', '.join(objects[:5])}: tables and other objects of MATLAB are not read; write the table with "
            "parquetwrite or writetable, or save it as a structure with save(file, '-struct', 's')"
        )
    # HDF5 keeps no order of names, and pymatreader returns them in any.
    unordered = is_hdf5(data)
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
