"""Motions in MATLAB's `.mat` files."""

from __future__ import annotations

import io
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ....errors import ShapePhaseError, TrajectoryError
from ....warning_filters import ONE_THREAD
from .._recording import Table
from .hdf5 import MOST_VALUES, is_hdf5, read_hdf5
from .named_arrays import arrays_table
from .parser_process import table_apart

_DEEPEST = 4
"""Structures inside each other that are read."""
_SMALL = 2**22
"""Arrays in a file, unpacked [bytes], that are read in this process."""
_PLAIN = (
    "double",
    "single",
    "logical",
    "char",
    *(f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)),
)
"""Classes of arrays whose size SciPy knows before it reads them."""
_COMPRESSED = 15
"""The type of a packed element of a `.mat` file of version 5."""
_MATRIX = 14
"""The type of an element that is an array, of elements of its own."""
_KINDS = frozenset((*range(1, 8), 9, 12, 13, 16, 17, 18))
"""The types of elements of an array of numbers; SciPy looks up one that does not exist beyond the end of its table."""
_HEAD = 128
"""Bytes before the first element there."""


def read_matlab(where: Path, data: bytes, chosen: str | None) -> Table:
    """A `.mat` file: vectors by name, or a matrix with names of its columns, on top or in a structure.

    Objects of MATLAB, tables among them, are not read. What may unpack to any size is parsed in a process of its own.

    Raises
    ------
    TrajectoryError, UnknownNameError, MissingExtraError
        For faults; for a structure that is not there; without h5py, where the file is of version 7.3.
    """
    if is_hdf5(data):
        return read_hdf5(where, data, chosen)
    if _may_be_large(data):
        return table_apart(where, data, "MATLAB", read_arrays_of, chosen)
    return read_arrays_of(where, data, chosen)


def read_arrays_of(where: Path, data: bytes, chosen: str | None = None) -> Table:
    """A `.mat` file up to version 7, here and now. Raises as `read_matlab`."""
    import scipy.io

    try:
        listed = scipy.io.whosmat(io.BytesIO(data))
        values = sum(float(np.prod(shape, dtype=np.float64)) for _, shape, _ in listed)
        if values > MOST_VALUES:
            raise TrajectoryError(f"{where}: {values:.3g} values, up to {MOST_VALUES} are read; write fewer samples")
        unknown = [name for name, _, kind in listed if kind == "unknown"]
        if unknown:
            raise TrajectoryError(f"{where}: {unknown[0]!r} is of a class that does not exist; the file is damaged")
        objects = [name for name, _, kind in listed if kind in ("opaque", "object", "function")]
        readable = [name for name, _, kind in listed if name not in objects]
        loaded = _loaded(data, readable)
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


def _loaded(data: bytes, names: list[str]) -> dict[str, Any]:
    """Some of the variables; what is true or false there, which SciPy alone reads as ones and zeros, is so here."""
    import scipy.io

    with ONE_THREAD, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always", np.exceptions.ComplexWarning)
        typed = scipy.io.loadmat(io.BytesIO(data), variable_names=names, simplify_cells=True, mat_dtype=True)
    if not any(issubclass(warning.category, np.exceptions.ComplexWarning) for warning in raised):
        return typed
    # On the way to these types imaginary parts were dropped.
    return _with_truths(scipy.io.loadmat(io.BytesIO(data), variable_names=names, simplify_cells=True), typed)


def _with_truths(plain: Any, typed: Any) -> Any:
    if isinstance(plain, dict):
        return {name: _with_truths(value, typed[name]) for name, value in plain.items()}
    return typed if np.asarray(typed).dtype.kind == "b" else plain


def _may_be_large(data: bytes) -> bool:
    """Whether arrays may take more memory than a few times the file, or their elements are damaged."""
    import scipy.io

    if len(data) > _SMALL or _unpacks_far(data):
        return True
    try:
        return any(kind not in _PLAIN for _, _, kind in scipy.io.whosmat(io.BytesIO(data)))
    except Exception:  # a damaged file, of which the reader says so
        return False


def _unpacks_far(data: bytes) -> bool:
    """Whether packed elements are large when unpacked, or any are damaged."""
    room = _SMALL
    mark = data[_HEAD - 2 : _HEAD]
    if mark not in (b"IM", b"MI"):
        return False
    order: Literal["big", "little"] = "little" if mark == b"IM" else "big"
    for kind, element in _elements(data, _HEAD, order):
        if kind != _COMPRESSED:
            found = [(kind, element)]
        else:
            try:
                unpacked = zlib.decompressobj().decompress(element, room + 1)
            except zlib.error:
                return True
            room -= len(unpacked)
            found = list(_elements(unpacked, 0, order))
        for whole, parts in found:
            inside = [inner for inner, _ in _elements(parts, 0, order)] if whole == _MATRIX else [whole]
            if room < 0 or not _KINDS.issuperset(inside):
                return True
    return False


def _elements(data: bytes, place: int, order: Literal["big", "little"]) -> Iterator[tuple[int, bytes]]:
    """The elements from a place on: their types, and what is in them."""
    while place + 8 <= len(data):
        kind, size = (int.from_bytes(data[k : k + 4], order) for k in (place, place + 4))
        small = kind >> 16
        if small:
            # Of up to four bytes type and size share a word.
            kind &= 0xFFFF
        yield kind, b"" if small else data[place + 8 : place + 8 + size]
        packed = kind == _COMPRESSED
        place += 8 if small else 8 + (size if packed else -(-size // 8) * 8)


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
