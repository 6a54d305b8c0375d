"""Joint motions in NumPy's files: our own NPZ, and MuJoCo's `qpos` as NPY or NPZ."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....arguments import check_object
from ....arrays import Array, finite_array
from ....body.body import Body
from ....errors import ShapeError, TrajectoryError
from ....files import npy_array, npz_arrays
from .._nameless_joints import FREE_JOINT, NamelessJoints, attitudes_of, nameless_joints, placed_joints
from .._recording import Table

# Where the entries x, y, z, w stand in a quaternion that begins with its scalar part.
_SCALAR_FIRST = [1, 2, 3, 0]
_READ = (
    *("time", "timestep", "fps", "shapes", "qpos", "joint_pos", "body_pos_w", "body_quat_w", "joint_names"),
    *("base_quat_xyzw", "base_quat_wxyz", "base_position", "provenance"),
)
"""The arrays of a file that have a meaning."""


def read_arrays(where: Path, data: bytes, body: Body, timestep: float | None, order: str | None) -> Table:
    """An NPZ file with `shapes`, `time`, `joint_names`, or with a simulator's arrays; an NPY file is `qpos` alone.

    Of MuJoCo's `qpos` (N, 7 + n), the first seven columns are the free joint, x y z and the quaternion w x y z; (N, n)
    is without a free joint, or with the joints by which the body's file moves its base. Of Isaac Lab's `joint_pos`
    (N, n) the base is the first of `body_pos_w` (N, b, 3) and `body_quat_w` (N, b, 4). The joints are the array
    `joint_names` where there is one; else those of an order that is asked for, or that lets the links lie at
    `body_pos_w`; else, of `qpos`, those of MuJoCo's order. Times are the array `time`, or follow from `timestep`, an
    array of one number or the argument, or from `fps`.

    Parameters
    ----------
    timestep : [s], for a file without times
    order : of joints without names, one of `WORDS` of `body.joint_orders`, or None

    Raises
    ------
    TrajectoryError
        For faults, with the array and the entry.
    """
    check_object(body, "Body", "body")
    arrays = {"qpos": _loaded(data, where)} if where.suffix.lower() == ".npy" else _members(data, where)
    try:
        if "qpos" in arrays or ("joint_pos" in arrays and "shapes" not in arrays):
            return _simulated(arrays, where, body, timestep, order)
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


def _simulated(arrays: dict[str, Any], where: Path, body: Body, timestep: float | None, order: str | None) -> Table:
    """MuJoCo's `qpos`, or Isaac Lab's `joint_pos`."""
    if "shapes" in arrays:
        raise TrajectoryError(f"{where}: both 'shapes' and 'qpos' are there; keep one")
    kind = "qpos" if "qpos" in arrays else "joint_pos"
    values = _array(arrays[kind], where, kind, (None, None))
    times = _simulated_times(arrays, kind, where, len(values), timestep)
    quaternions, positions = _first_body(arrays, where, len(values))
    named, found = arrays.get("joint_names"), None
    if named is not None:
        names = _names(named, where)
        free = values.shape[1] - len(names)
        if free not in (0, FREE_JOINT):
            raise TrajectoryError(
                f"{where}: {kind} has {values.shape[1]} columns; with {len(names)} joints ({', '.join(names)}) it has "
                f"{len(names) + FREE_JOINT}, or {len(names)} without the free joint"
            )
        found = None
    elif kind == "joint_pos" and (order is None or quaternions is not None):
        found, quaternions = _placed(arrays, values, quaternions, where, body, order)
        names, free = list(found.names), 0
    else:
        found = nameless_joints(body, values.shape[1], f"{where}: {kind}", order)
        names, free = list(found.names), found.free
        if order is None and free and "body_pos_w" in arrays:
            found, _ = _placed(arrays, values[:, free:], values[:, 3:FREE_JOINT], where, body, None)
            names = list(found.names)
    if free:
        quaternions, positions = values[:, 3:FREE_JOINT][:, _SCALAR_FIRST], values[:, :3]
    kind = "MuJoCo qpos" if kind == "qpos" else "Isaac Lab joint_pos"
    table = _table(where, kind, times, values[:, free:], names, quaternions, positions, arrays)
    return replace(table, nameless=found, up="z")


def _first_body(arrays: dict[str, Any], where: Path, count: int) -> tuple[Array | None, Array | None]:
    """Quaternion, with its numbers as they stand there, and place of the first body; None where the file has none."""
    found: list[Array | None] = []
    for name, entries in (("body_quat_w", 4), ("body_pos_w", 3)):
        there = name in arrays
        found.append(_array(arrays[name], where, name, (count, None, entries))[:, 0] if there else None)
    return found[0], found[1]


def _placed(
    arrays: dict[str, Any], joints: Array, quaternions: Array | None, where: Path, body: Body, order: str | None
) -> tuple[NamelessJoints, Array]:
    """Joints by where the file has the bodies, and the quaternions of the base, x y z w."""
    if "body_pos_w" not in arrays or quaternions is None:
        raise TrajectoryError(
            f"{where}: joint_pos has no names: add an array 'joint_names', or 'body_pos_w' and 'body_quat_w', by which "
            "the order is found; or say which it is: joint_order='isaac' (--joint-order isaac)"
        )
    places = _array(arrays["body_pos_w"], where, "body_pos_w", (len(joints), None, 3))
    attitudes = attitudes_of(quaternions, str(where))
    # MuJoCo's quaternions begin with w; Isaac's have done so, and do no longer.
    found, which = placed_joints(body, joints, places, attitudes[: 1 if "qpos" in arrays else 2], str(where), order)
    return found, quaternions if which else quaternions[:, _SCALAR_FIRST]


def _simulated_times(arrays: dict[str, Any], kind: str, where: Path, count: int, timestep: float | None) -> Array:
    given = [name for name in ("time", "timestep", "fps") if name in arrays] + ["argument"] * (timestep is not None)
    if len(given) != 1:
        raise TrajectoryError(
            f"{where}: the times of {kind} come from one of the array 'time', the arrays 'timestep' and 'fps' of one "
            f"number and the argument timestep; {'none' if not given else 'more than one'} is there"
        )
    if given == ["time"]:
        return _array(arrays["time"], where, "time", (count,), "s")
    name, unit = ("fps", "1/s") if given == ["fps"] else ("timestep", "s")
    step = _array(arrays.get(name, timestep), where, name, (), unit)
    if step.size != 1 or step.ravel()[0] <= 0.0:
        raise TrajectoryError(f"{where}: {name}: one number above 0 is needed [{unit}], got {step}")
    number = step.ravel()[0]
    return np.arange(count) / number if name == "fps" else np.arange(count) * number


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
        return npz_arrays(data)
    except ValueError as error:
        raise TrajectoryError(f"{where}: {error}") from None


def _loaded(data: bytes, where: Path) -> Any:
    try:
        return npy_array(data)
    except ValueError as error:
        raise TrajectoryError(f"{where}: {error}") from None
