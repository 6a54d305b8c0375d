"""Joint motions in NumPy's files: our own NPZ, and MuJoCo's `qpos` as NPY or NPZ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....arrays import Array, finite_array
from ....errors import ShapeError, TrajectoryError
from ....files import npy_array, npz_arrays
from .._recording import MOST_BYTES, Table

# Entries of a free joint in MuJoCo's qpos: a position and a quaternion.
_FREE_JOINT = 7
# Where the entries x, y, z, w stand in a quaternion that begins with its scalar part.
_SCALAR_FIRST = [1, 2, 3, 0]
_READ = (
    *("time", "timestep", "shapes", "qpos", "joint_names", "base_quat_xyzw", "base_quat_wxyz", "base_position"),
    "provenance",
)
"""The arrays of a file that have a meaning."""


def read_arrays(where: Path, data: bytes, joint_names: Sequence[str], timestep: float | None) -> Table:
    """An NPZ file with `shapes`, `time`, `joint_names`, or with MuJoCo's `qpos`; an NPY file is `qpos` alone.

    Of `qpos` (N, 7 + n), the first seven columns are the free joint, x y z and the quaternion w x y z, MuJoCo's
    order; (N, n) is without a free joint. The joints are the array `joint_names` where there is one, else the n
    joints of the body in the body's order: MuJoCo may order a model's joints otherwise, so store their names.
    Times are the array `time`, or follow from `timestep`, an array of one number or the argument.

    Parameters
    ----------
    joint_names : of the body
    timestep : [s], for a file without times

    Raises
    ------
    TrajectoryError
        For faults, with the array and the entry.
    """
    arrays = {"qpos": _loaded(data, where)} if where.suffix.lower() == ".npy" else _members(data, where)
    try:
        if "qpos" in arrays:
            return _mujoco(arrays, where, joint_names, timestep)
        if timestep is not None:
            raise TrajectoryError(f"{where}: timestep is for qpos without times; this file has its times")
        return _shapes(arrays, where)
    except ShapeError as error:
        raise TrajectoryError(str(error)) from None


def _shapes(arrays: dict[str, Any], where: Path) -> Table:
    for name in ("time", "shapes", "joint_names"):
        if name not in arrays:
            raise TrajectoryError(f"{where}: the array {name!r} is missing; there are {', '.join(sorted(arrays))}")
    names = _names(arrays["joint_names"], where)
    times = _array(arrays["time"], where, "time", (None,), "s")
    shapes = _array(arrays["shapes"], where, "shapes", (len(times), len(names)))
    quaternions, positions = _quaternions(arrays, where, len(times)), arrays.get("base_position")
    if positions is not None:
        positions = _array(positions, where, "base_position", (len(times), 3), "m")
    return _table(where, "NPZ", times, shapes, names, quaternions, positions, arrays)


def _quaternions(arrays: dict[str, Any], where: Path, count: int) -> Array | None:
    """Of the base, x y z w, by the array whose name says its order."""
    there = [name for name in ("base_quat_xyzw", "base_quat_wxyz") if name in arrays]
    if len(there) > 1:
        raise TrajectoryError(f"{where}: both {there[0]!r} and {there[1]!r} are there; keep one")
    if not there:
        return None
    found = _array(arrays[there[0]], where, there[0], (count, 4))
    return found if there[0] == "base_quat_xyzw" else found[:, _SCALAR_FIRST]


def _mujoco(arrays: dict[str, Any], where: Path, joint_names: Sequence[str], timestep: float | None) -> Table:
    if "shapes" in arrays:
        raise TrajectoryError(f"{where}: both 'shapes' and 'qpos' are there; keep one")
    qpos = _array(arrays["qpos"], where, "qpos", (None, None))
    names = _names(arrays["joint_names"], where) if "joint_names" in arrays else list(joint_names)
    free, n = qpos.shape[1] - len(names), len(names)
    if free not in (0, _FREE_JOINT):
        raise TrajectoryError(
            f"{where}: qpos has {qpos.shape[1]} columns; with {n} joints ({', '.join(names)}) it has "
            f"{n + _FREE_JOINT}, or {n} without the free joint. Joints that follow others are left out"
        )
    times = _mujoco_times(arrays, where, len(qpos), timestep)
    quaternions = qpos[:, 3:_FREE_JOINT][:, _SCALAR_FIRST] if free else None
    positions = qpos[:, :3] if free else None
    table = _table(where, "MuJoCo qpos", times, qpos[:, free:], names, quaternions, positions, arrays)
    return replace(table, up="z")


def _mujoco_times(arrays: dict[str, Any], where: Path, count: int, timestep: float | None) -> Array:
    given = [name for name in ("time", "timestep") if name in arrays] + ["argument"] * (timestep is not None)
    if len(given) != 1:
        raise TrajectoryError(
            f"{where}: the times of qpos come from one of the array 'time', the array 'timestep' and the argument "
            f"timestep; {'none' if not given else 'more than one'} is there"
        )
    if given == ["time"]:
        return _array(arrays["time"], where, "time", (count,), "s")
    step = _array(arrays.get("timestep", timestep), where, "timestep", (), "s")
    if step.size != 1 or step.ravel()[0] <= 0.0:
        raise TrajectoryError(f"{where}: timestep: one number above 0 is needed [s], got {step}")
    return np.arange(count) * step.ravel()[0]


def _table(
    where: Path,
    kind: str,
    times: Array,
    shapes: Array,
    names: list[str],
    quaternions: Array | None,
    positions: Array | None,
    arrays: dict[str, Any],
) -> Table:
    return Table(
        where=str(where),
        format=kind,
        columns={name: np.ascontiguousarray(column) for name, column in zip(names, shapes.T, strict=True)},
        rows=range(len(times)),
        row="sample",
        times=times,
        by_format=True,
        base_quat_xyzw=quaternions,
        base_position=positions,
        unread={
            name: f"an array {found.shape} of {found.dtype}" for name, found in arrays.items() if name not in _READ
        },
    )


def _array(value: Any, where: Path, name: str, trailing: tuple[int | None, ...], unit: str = "") -> Array:
    if np.asarray(value).dtype.kind == "b":
        raise TrajectoryError(f"{where}: {name}: numbers are needed, got an array of true and false")
    array = finite_array(value, f"{where}: {name}", trailing, unit=unit)
    if trailing and array.ndim != len(trailing):
        raise TrajectoryError(f"{where}: {name}: {len(trailing)} axes are needed, got shape {array.shape}")
    return array


def _names(stored: Any, where: Path) -> list[str]:
    if stored.dtype.kind not in "UT" and stored.size:
        raise TrajectoryError(f"{where}: joint_names: text is needed, got an array of {stored.dtype}")
    names = [str(name) for name in np.ravel(stored)]
    if len(set(names)) != len(names):
        raise TrajectoryError(f"{where}: a joint name stands twice in {', '.join(names)}")
    return names


def _members(data: bytes, where: Path) -> dict[str, Any]:
    try:
        return npz_arrays(data, 4 * MOST_BYTES)
    except ValueError as error:
        raise TrajectoryError(f"{where}: {error}") from None


def _loaded(data: bytes, where: Path) -> Any:
    try:
        return npy_array(data)
    except ValueError as error:
        raise TrajectoryError(f"{where}: {error}") from None
