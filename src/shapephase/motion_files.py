"""Recorded and stored joint motions: CSV and NPZ files, joints matched by name."""

from __future__ import annotations

import csv
import io
import os
import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Array, finite_array
from .body import Body
from .errors import InputFileNotFoundError, TrajectoryError, unknown_name
from .files import write_whole
from .shape_path import ShapePath

_SUFFIXES = (".csv", ".npz")
_DEGREES = "_deg"


def read_shape_path(file: str | os.PathLike[str], body: Body) -> ShapePath:
    """Read a joint motion and interpolate it by a C2 spline, periodic where the last sample equals the first.

    A CSV file has the header `time,<joint names>` in any column order; a joint's column may be named with
    `_deg` behind for degrees. An NPZ file has the arrays `time` (N,), `shapes` (N, n) and `joint_names` (n,).
    Time is in seconds and starts at 0 after reading; every joint of the body must be there.

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    UnknownNameError
        If a column is no joint of the body, or the file's ending is unknown.
    TrajectoryError
        If a joint is missing or doubled, times do not ascend, or an entry is no finite number; row and column
        are named.
    """
    where = Path(file)
    if where.suffix.lower() not in _SUFFIXES:
        raise unknown_name("kind of motion file", where.suffix, _SUFFIXES)
    if not where.is_file():
        raise InputFileNotFoundError(f"{where}: there is no such file")
    times, columns = _read_csv(where) if where.suffix.lower() == ".csv" else _read_npz(where)
    shapes = np.empty((len(times), body.n_shape))
    found: dict[int, str] = {}
    for name, values in columns.items():
        joint, factor = _joint_of(name, body, where)
        if joint in found:
            raise TrajectoryError(f"{where}: columns {found[joint]!r} and {name!r} are the same joint; keep one")
        found[joint] = name
        shapes[:, joint] = factor * values
    missing = [name for i, name in enumerate(body.joint_names) if i not in found]
    if missing:
        raise TrajectoryError(
            f"{where}: no column for {', '.join(missing)}; add them (zeros where the joint rests). Joints of "
            f"{body.name}: {', '.join(body.joint_names)}"
        )
    try:
        return ShapePath.spline(times, shapes, joint_names=body.joint_names)
    except TrajectoryError as error:
        raise TrajectoryError(f"{where}: {error}") from None


def write_shape_path(path: ShapePath, file: str | os.PathLike[str], times: ArrayLike | None = None) -> None:
    """Write a joint motion as CSV or NPZ, by the file's ending; what `read_shape_path` reads.

    Parameters
    ----------
    times : (N,) of the samples [s]; None: `path.sample_times`. A spline is read back as it was.

    Raises
    ------
    TrajectoryError
        If the path has no joint names.
    UnknownNameError
        For an unknown ending of the file.
    """
    where = Path(file)
    if where.suffix.lower() not in _SUFFIXES:
        raise unknown_name("kind of motion file", where.suffix, _SUFFIXES)
    if path.joint_names is None:
        raise TrajectoryError("a motion file names its joints, and this path has no joint names; make it with them")
    t = path.sample_times if times is None else finite_array(times, "times", (None,), unit="s")
    shapes = path.shape(t)
    if where.suffix.lower() == ".npz":
        arrays = {"time": t, "shapes": shapes, "joint_names": np.array(path.joint_names)}
        write_whole(where, lambda stream: np.savez(stream, **arrays))
        return
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["time", *path.joint_names])
    writer.writerows([[repr(float(v)) for v in row] for row in np.column_stack([t, shapes])])
    write_whole(where, lambda stream: stream.write(text.getvalue().encode()))


def _joint_of(name: str, body: Body, where: Path) -> tuple[int, float]:
    """The joint of a column and the factor to SI units."""
    if name in body.joint_names:
        return body.joint_names.index(name), 1.0
    plain = name.removesuffix(_DEGREES)
    if plain == name or plain not in body.joint_names:
        raise unknown_name(f"column in {where}; joint of {body.name}", name, body.joint_names)
    joint = body.joint_names.index(plain)
    if body.joint_units[joint] != "rad":
        raise TrajectoryError(f"{where}: column {name!r} is in degrees, but joint {plain} slides and is in metres")
    return joint, np.pi / 180.0


def _read_csv(where: Path) -> tuple[Array, dict[str, Array]]:
    try:
        text = where.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise TrajectoryError(f"{where}: not UTF-8 text, byte {error.start} cannot be read") from None
    rows = [(number, row) for number, row in enumerate(csv.reader(io.StringIO(text)), start=1) if any(row)]
    if not rows:
        raise TrajectoryError(f"{where}: empty; a header `time,<joint names>` and rows of numbers are needed")
    names = [name.strip() for name in rows[0][1]]
    if "time" not in names:
        raise TrajectoryError(f"{where}: the header has no column `time`; it reads {', '.join(names)}")
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise TrajectoryError(f"{where}: column {', '.join(doubled)} stands twice in the header")
    values = np.empty((len(rows) - 1, len(names)))
    for index, (number, row) in enumerate(rows[1:]):
        if len(row) != len(names):
            raise TrajectoryError(f"{where}: row {number} has {len(row)} entries, the header {len(names)}")
        for column, entry in enumerate(row):
            values[index, column] = _number(entry, where, number, names[column])
    columns = dict(zip(names, values.T, strict=True))
    times = columns.pop("time")
    _check_times(times, where, [number for number, _ in rows[1:]])
    return times, columns


def _number(entry: str, where: Path, row: int, column: str) -> float:
    try:
        value = float(entry)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise TrajectoryError(f"{where}: row {row}, column {column!r}: {entry.strip()!r} is no finite number")
    return value


def _read_npz(where: Path) -> tuple[Array, dict[str, Array]]:
    try:
        with np.load(where, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise TrajectoryError(f"{where}: no NPZ file that can be read ({error})") from None
    for name in ("time", "shapes", "joint_names"):
        if name not in arrays:
            raise TrajectoryError(f"{where}: the array {name!r} is missing; there are {', '.join(sorted(arrays))}")
    times = finite_array(arrays["time"], f"{where}: time", (None,), unit="s")
    names = [str(name) for name in np.ravel(arrays["joint_names"])]
    shapes = finite_array(arrays["shapes"], f"{where}: shapes", (len(times), len(names)))
    if len(set(names)) != len(names):
        raise TrajectoryError(f"{where}: a joint name stands twice in {', '.join(names)}")
    _check_times(times, where, list(range(len(times))))
    return times, dict(zip(names, shapes.T, strict=True))


def _check_times(times: Array, where: Path, rows: list[int]) -> None:
    if len(times) < 2:
        raise TrajectoryError(f"{where}: two samples or more are needed, got {len(times)}")
    late = np.flatnonzero(np.diff(times) <= 0.0)
    if len(late):
        i = int(late[0]) + 1
        raise TrajectoryError(
            f"{where}: row {rows[i]}: time {times[i]:.9g} s does not come after {times[i - 1]:.9g} s; sort the rows "
            "and drop repeated times"
        )
