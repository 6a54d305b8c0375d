"""Motions in MATLAB's `.mat` files."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import ShapePhaseError, TrajectoryError
from .._recording import Table
from .hdf5 import MOST_VALUES, is_hdf5, read_hdf5
from .named_arrays import arrays_table

_DEEPEST = 4
"""Structures inside each other that are read."""


def read_matlab(where: Path, data: bytes, chosen: str | None) -> Table:
    """A `.mat` file: vectors by name, or a matrix with names of its columns, on top or in a structure.

    Objects of MATLAB, tables among them, are not read.

    Raises
    ------
    TrajectoryError, UnknownNameError, MissingExtraError
        For faults; for a structure that is not there; without h5py, where the file is of version 7.3.
    """
    if is_hdf5(data):
        return read_hdf5(where, data, chosen)
    import scipy.io

    try:
        listed = scipy.io.whosmat(io.BytesIO(data))
        values = sum(float(np.prod(shape, dtype=np.float64)) for _, shape, _ in listed)
        if values > MOST_VALUES:
            raise TrajectoryError(f"{where}: {values:.3g} values, up to {MOST_VALUES} are read; write fewer samples")
        objects = [name for name, _, kind in listed if kind in ("opaque", "object", "function", "unknown")]
        readable = [name for name, _, kind in listed if name not in objects]
        loaded = scipy.io.loadmat(io.BytesIO(data), variable_names=readable, simplify_cells=True)
    except ShapePhaseError:
        raise
    except Exception as error:  # a damaged file fails inside SciPy in many ways
        raise TrajectoryError(
            f"{where}: no MATLAB file that can be read ({type(error).__name__}: {error!s:.200})"
        ) from None
    if objects and not readable:
        raise TrajectoryError(
            f"{where}: {', '.join(objects[:5])}: tables and other objects of MATLAB are not read; write the table with "
            "parquetwrite or writetable, or save it as a structure with save(file, '-struct', 's')"
        )
    entries = {name: _plain(value, 0) for name, value in loaded.items() if not name.startswith("__")}
    return arrays_table(str(where), "MATLAB", entries, chosen)


def _plain(value: Any, depth: int) -> Any:
    """A structure as a dictionary, texts as a list, numbers as an array; None for anything else."""
    if isinstance(value, dict):
        return {name: _plain(entry, depth + 1) for name, entry in value.items()} if depth < _DEEPEST else None
    if isinstance(value, str):
        return [value]
    array = np.asarray(value)
    if array.dtype.kind in "OUS":
        entries = array.ravel().tolist()
        return [entry.strip() for entry in entries] if all(isinstance(entry, str) for entry in entries) else None
    return array
