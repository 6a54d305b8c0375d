"""Contents of a store in formats of other programs."""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import check_file_name, check_object
from ..errors import MissingExtraError, UnknownNameError
from ..files import write_whole
from ._evaluate import LETTERS, STATUS
from .store import StudyStore


def export_study(store: StudyStore, path: str | os.PathLike[str]) -> None:
    """Write a store to one file: NetCDF (.nc) with the dimensions of its grids, or a table (.parquet, .csv).

    A table has one row for each case, and one column for each number: `final_attitude_0_1` is an entry of a matrix.

    Raises
    ------
    UnknownNameError
        For another ending.
    OutputFileError
        If it cannot be written.
    MissingExtraError
        Without xarray or pyarrow.

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1]}, outputs=("turn",))
    >>> sp.study.export_study(study.run("exported.zarr", workers=0), "exported.csv")
    >>> with open("exported.csv") as file:
    ...     print(file.readline().strip())
    case,status,momentum_z,turn,error
    """
    check_object(store, "StudyStore", "store")
    check_file_name(path, "path")
    ending = Path(path).suffix.lower()
    if ending == ".nc":
        write_whole(path, lambda stream: stream.write(_netcdf(store)))
    elif ending == ".csv":
        write_whole(path, lambda stream: study_table(store).to_csv(stream, index=False))
    elif ending == ".parquet":
        try:
            write_whole(path, lambda stream: study_table(store).to_parquet(stream, index=False))
        except ImportError:
            raise MissingExtraError("Parquet needs pyarrow; install it with: pip install 'shapephase[data]'") from None
    else:
        raise UnknownNameError(f"{path}: the file's name must end in .nc, .parquet or .csv")


def study_table(store: StudyStore) -> Any:
    """Return all cases as a table of pandas, one row for each."""
    from pandas import DataFrame

    columns: dict[str, Any] = {"case": np.arange(store.cases), "status": np.array([*STATUS])[store.statuses()]}
    for name in store.attributes["units"]:
        values, grid = store.values(name), store.attributes["grids"].get(name, [None])
        if isinstance(grid[0], str):
            columns[name] = [grid[int(place)] if np.isfinite(place) else "" for place in values]
            continue
        for entry in itertools.product(*map(range, values.shape[1:])):
            columns["_".join([name, *map(str, entry)])] = values[(slice(None), *entry)]
    errors = {index: f"{name}: {text}" for index, name, text in store.errors(most=store.cases)}
    columns["error"] = [errors.get(index, "") for index in range(store.cases)]
    return DataFrame(columns)


def _netcdf(store: StudyStore) -> bytes:
    data = store.dataset().drop_vars([*LETTERS])
    data.attrs = {name: value if isinstance(value, str | int) else str(value) for name, value in data.attrs.items()}
    return bytes(data.to_netcdf(engine="scipy"))
