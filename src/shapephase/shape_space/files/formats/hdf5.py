"""Motions in HDF5."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import MissingExtraError, TrajectoryError
from ..labels import unit_of
from ..recording import Table
from .named_arrays import arrays_table

_MAGIC = b"\x89HDF\r\n\x1a\n"
_STARTS = (0, 512)  # offsets of HDF5: MATLAB writes 512 bytes before it


def is_hdf5(data: bytes) -> bool:
    """Whether bytes begin as HDF5."""
    return any(data[start : start + len(_MAGIC)] == _MAGIC for start in _STARTS)


def read_hdf5(where: Path, data: bytes, chosen: str | None) -> Table:
    """Motion in an HDF5 file, its arrays as those of a `.mat` file; the attribute `units` of one says its unit.

    Raises TrajectoryError, UnknownNameError, MissingExtraError for faults; for a structure that is not there; without
    h5py.
    """
    try:
        import h5py
    except ImportError:
        raise MissingExtraError("HDF5 files need h5py; install it with: pip install 'shapephase[data]'") from None
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
        said = item.attrs.get("units", item.attrs.get("unit", ""))
        unit = unit_of(said.decode() if isinstance(said, bytes) else str(said))
        if unit is not None:
            units[name] = unit
        is_text = h5py.check_string_dtype(item.dtype) is not None
        value = np.asarray(item.asstr()[()] if is_text else item[()])
        inside[name] = value.ravel().tolist() if is_text else None if value.dtype.kind == "O" else value

    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            # Every object once, groups before their members; links that lead out of the file are not followed.
            file.visititems(keep)
    except Exception as error:  # a damaged file fails inside h5py in many ways
        raise TrajectoryError(
            f"{where}: no HDF5 file that can be read ({type(error).__name__}: {error!s:.200}); write it anew"
        ) from None
    return arrays_table(str(where), "HDF5", entries, chosen, units, ordered=False)
