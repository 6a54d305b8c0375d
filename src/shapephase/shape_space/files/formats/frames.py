"""Motions that are in memory as tables of pandas or xarray; neither is imported here."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....errors import TrajectoryError
from .._labels import unit_of
from .._recording import Table
from .column_tables import column_table

_PANDAS = ("DataFrame",)
_XARRAY = ("Dataset", "DataArray")


def is_frame(value: object) -> bool:
    """Whether this is a table of pandas or xarray."""
    return _is(value, "pandas", _PANDAS) or _is(value, "xarray", _XARRAY)


def read_frame(frame: Any) -> Table:
    """A `DataFrame`, whose index may hold the times, or a `Dataset` or `DataArray` along one dimension of time.

    Attributes `units` of variables of xarray say their units. Of an array in two dimensions, the coordinate of the
    second names the joints.

    Raises
    ------
    TrajectoryError
        For faults, with column and row.
    """
    return _of_pandas(frame) if _is(frame, "pandas", _PANDAS) else _of_xarray(frame)


def _is(value: object, package: str, kinds: tuple[str, ...]) -> bool:
    return any(
        parent.__name__ in kinds and parent.__module__.split(".")[0] == package for parent in type(value).__mro__
    )


def _of_pandas(frame: Any) -> Table:
    columns = [(label, frame.iloc[:, k].to_numpy()) for k, label in enumerate(frame.columns)]
    index = frame.index
    values = index.to_numpy() if index.nlevels == 1 else None
    if values is not None and index.name is not None:
        columns.insert(0, (str(index.name), values))
    elif values is not None and values.dtype.kind in "mM":
        columns.insert(0, ("time", values))
    return column_table("the DataFrame", "pandas", columns)


def _of_xarray(data: Any) -> Table:
    where = f"the {type(data).__name__}"
    arrays = dict(data.data_vars) if type(data).__name__ == "Dataset" else {str(data.name or "data"): data}
    dimensions = {array.dims[0] for array in arrays.values() if array.dims}
    if len(dimensions) != 1 or any(array.ndim not in (1, 2) for array in arrays.values()):
        listed = ", ".join(f"{name} {array.dims}" for name, array in arrays.items())
        raise TrajectoryError(
            f"{where}: variables along one dimension, the time, or along it and the joints, are needed; there are "
            f"{listed}"
        )
    (dimension,) = dimensions
    columns: list[tuple[object, Any]] = []
    units: dict[str, str] = {}
    if dimension in data.coords:
        columns.append((str(dimension), data.coords[dimension].to_numpy()))
        _note_unit(units, str(dimension), data.coords[dimension].attrs)
    for name, array in arrays.items():
        if array.ndim == 1:
            columns.append((str(name), array.to_numpy()))
            _note_unit(units, str(name), array.attrs)
            continue
        second = array.dims[1]
        if second not in array.coords:
            raise TrajectoryError(
                f"{where}: the dimension {second!r} of {name} has no coordinate that names the joints"
            )
        for k, joint in enumerate(array.coords[second].to_numpy().tolist()):
            columns.append((joint, np.asarray(array[:, k])))
            _note_unit(units, str(joint), array.attrs)
    return column_table(where, "xarray", columns, units=units, row="sample")


def _note_unit(units: dict[str, str], name: str, attributes: Any) -> None:
    # Of times as climate data have them, the unit stands before the day that they count from.
    said = str(attributes.get("units", "")).split(" since ")[0]
    unit = unit_of(said)
    if unit is not None:
        units[name] = unit
