"""What a store holds, in formats of other programs."""

from __future__ import annotations

import itertools
import os
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import check_file_name, check_object
from ..errors import MissingExtraError, UnknownNameError
from ..files import write_whole
from .store import STATUS, StudyStore

_LETTERS = ("error_name", "error_text")


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
        Without xarray, pandas or pyarrow.

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
    place = Path(path)
    ending = place.suffix.lower()
    if ending == ".nc":
        write_whole(place, lambda stream: stream.write(_netcdf(store)))
    elif ending in (".parquet", ".csv"):
        table = study_table(store)
        if ending == ".csv":
            write_whole(place, lambda stream: stream.write(table.to_csv(index=False).encode()))
            return
        try:
            write_whole(place, lambda stream: table.to_parquet(stream, index=False))
        except ImportError:
            raise MissingExtraError("Parquet needs pyarrow; install it with: pip install 'shapephase[data]'") from None
    else:
        raise UnknownNameError(f"{place}: the file's name must end in .nc, .parquet or .csv")


def study_table(store: StudyStore) -> Any:
    """All cases as a table of pandas, one row for each. Raises MissingExtraError without pandas."""
    try:
        from pandas import DataFrame
    except ImportError:
        raise MissingExtraError("a table needs pandas; install it with: pip install pandas") from None
    names = {number: name for name, number in STATUS.items()}
    statuses = store.statuses()
    columns: dict[str, Any] = {"case": np.arange(store.cases), "status": [names[int(one)] for one in statuses]}
    grids = store.attributes["grids"]
    for name in store.attributes["units"]:
        values = store.values(name)
        labels = grids.get(name, [])
        if labels and isinstance(labels[0], str):
            columns[name] = [labels[int(one)] if np.isfinite(one) else "" for one in values]
            continue
        for entry in itertools.product(*map(range, values.shape[1:])):
            columns["_".join([name, *map(str, entry)])] = values[(slice(None), *entry)]
    said = {index: f"{name}: {text}" for index, name, text in store.errors(most=store.cases)}
    columns["error"] = [said.get(index, "") for index in range(store.cases)]
    return DataFrame(columns)


def _netcdf(store: StudyStore) -> bytes:
    found = store.dataset().drop_vars(_LETTERS, errors="ignore")
    found.attrs = {name: value if isinstance(value, str | int) else str(value) for name, value in found.attrs.items()}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "study.nc"
        found.to_netcdf(file, engine="scipy")
        return file.read_bytes()
