"""A dozen valid files that hold one motion, and what other packages read in each."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from support.bodies import joint, link, urdf
from support.motion_writers import states, write_bag, write_delimited, write_opensim, yaml_trajectory

JOINTS = ("hip", "wrist", "boom")
TIMES = 0.125 * np.arange(12)
SHAPES = np.round(np.column_stack([np.sin(TIMES), 0.5 * np.cos(2.0 * TIMES), 0.1 * TIMES]), 6)
COLUMNS = {"time": TIMES} | dict(zip(JOINTS, SHAPES.T, strict=True))
BODY = urdf(
    *(link(name, 1.0 + k, [0.2, 0.3, 0.4]) for k, name in enumerate(("trunk", "arm", "hand", "probe"))),
    joint("hip", "revolute", "trunk", "arm", axis=(0, 1, 0)),
    joint("wrist", "revolute", "arm", "hand", axis=(1, 0, 0)),
    joint("boom", "prismatic", "trunk", "probe"),
)


def _excel(file: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    for row in ([*COLUMNS], *np.column_stack([*COLUMNS.values()]).tolist()):
        book.worksheets[0].append(row)
    book.save(file)


def _parquet(file: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.table(COLUMNS), file)


def _matlab(file: Path) -> None:
    import scipy.io

    # Packed with a checksum: on damaged headers of plain files SciPy crashes Python (1 of 60 bytes).
    scipy.io.savemat(file, COLUMNS, do_compression=True)


def _hdf5(file: Path) -> None:
    import h5py

    with h5py.File(file, "w") as book:
        for name, values in COLUMNS.items():
            book[name] = values


def _c3d(file: Path) -> None:
    import ezc3d

    made = ezc3d.c3d()
    made["parameters"]["POINT"]["RATE"]["value"] = [8]
    made["parameters"]["POINT"]["LABELS"]["value"] = ("A",)
    made["data"]["points"] = np.ones((4, 1, len(TIMES)))
    made.write(str(file))


def _bag(file: Path) -> None:
    write_bag(file, {"/joint_states": states(list(JOINTS), (1e9 * (1.0 + TIMES)).astype(int), SHAPES)}, "rosbag1")


WRITERS: Mapping[str, Callable[[Path], Any]] = {
    "m.csv": lambda file: write_delimited(file, JOINTS, TIMES, SHAPES),
    "m.tsv": lambda file: write_delimited(file, JOINTS, TIMES, SHAPES, "\t"),
    "m.mot": lambda file: write_opensim(file, JOINTS, TIMES, SHAPES, False),
    "m.yaml": lambda file: file.write_text(yaml_trajectory(JOINTS, (1e9 * TIMES).astype(int), SHAPES)),
    "m.npz": lambda file: np.savez(file, time=TIMES, shapes=SHAPES, joint_names=JOINTS),
    "packed.npz": lambda file: np.savez_compressed(file, time=TIMES, shapes=SHAPES, joint_names=JOINTS),
    "m.xlsx": _excel,
    "m.parquet": _parquet,
    "m.mat": _matlab,
    "m.h5": _hdf5,
    "m.c3d": _c3d,
    "m.bag": _bag,
}


def _table(file: Path, delimiter: str) -> dict[str, Any]:
    rows = [row for row in csv.reader(file.read_text("utf-8-sig").splitlines(), delimiter=delimiter) if any(row)]
    names, *numbers = [[cell.strip() for cell in row] for row in rows]
    return dict(zip(names, np.array(numbers, dtype=np.float64).T, strict=True))


def _plain_npz(file: Path) -> dict[str, Any]:
    with np.load(file) as arrays:
        named = zip(arrays["joint_names"].tolist(), arrays["shapes"].T, strict=True)
        return {"time": arrays["time"], **dict(named)}


def _plain_excel(file: Path) -> dict[str, Any]:
    import pandas

    return {name: column.to_numpy() for name, column in pandas.read_excel(file).items()}


def _plain_parquet(file: Path) -> dict[str, Any]:
    import pandas

    return {name: column.to_numpy() for name, column in pandas.read_parquet(file).items()}


def _plain_matlab(file: Path) -> dict[str, Any]:
    import scipy.io

    return {name: np.ravel(values) for name, values in scipy.io.loadmat(file).items() if name in COLUMNS}


def _plain_hdf5(file: Path) -> dict[str, Any]:
    import h5py

    with h5py.File(file) as book:
        return {name: book[name][()] for name in COLUMNS}


def _plain_yaml(file: Path) -> dict[str, Any]:
    import yaml

    said = yaml.load(file.read_text(), yaml.BaseLoader)
    times = [int(p["time_from_start"]["sec"]) + 1e-9 * int(p["time_from_start"]["nanosec"]) for p in said["points"]]
    shapes = np.array([[float(value) for value in point["positions"]] for point in said["points"]])
    return {"time": np.array(times)} | dict(zip(said["joint_names"], shapes.T, strict=True))


READERS: Mapping[str, Callable[[Path], dict[str, Any]]] = {
    ".csv": lambda file: _table(file, ","),
    ".tsv": lambda file: _table(file, "\t"),
    ".yaml": _plain_yaml,
    ".npz": _plain_npz,
    ".xlsx": _plain_excel,
    ".parquet": _plain_parquet,
    ".mat": _plain_matlab,
    ".h5": _plain_hdf5,
}
"""What others read in the same bytes, by ending; of other kinds it is only seen that what is read is finite."""
