"""Joint motions in arrays: NumPy's files, arrays in memory, and tables whose columns are numbered as such arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....arrays import Array, finite_array
from ....body.body import Body
from ....errors import ShapeError, TrajectoryError
from ....files import npy_array, npz_arrays
from ....letters import value_text
from ..labels import SI
from ..recording import OFF_UNIT, Rates, Simulated, Table, warn
from .floating_arrays import FloatingMotion, floating_motion, numbered_columns, places_of, root_width
from .named_arrays import arrays_table
from .nameless_joints import FREE_JOINT, nameless_joints, placed_joints

_NPZ = "NPZ"
_SCALAR_FIRST = [1, 2, 3, 0]  # places of x, y, z, w in a quaternion w x y z
# TUM RGB-D benchmark: pose behind the time, in trajectories of visual odometry
_TUM = ("base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw")
_FREE = ("base_x", "base_y", "base_z", "base_qw", "base_qx", "base_qy", "base_qz")  # MuJoCo's free joint
_STORED = ("time", "shapes", "joint_names", "base_quat_xyzw")  # joints and base of a file of `Motion.save`
_READ = (  # arrays with a meaning
    *("time", "timestep", "fps", "shapes", "qpos", "qvel", "q", "v", "qdot", "Q", "Qdot", "joint_names", "provenance"),
    *("joint_pos", "joint_vel", "body_pos_w", "body_quat_w", "body_ang_vel_w"),
    *("base_quat_xyzw", "base_quat_wxyz", "base_position"),
)


def read_arrays(
    where: Path, data: bytes, body: Body, timestep: float | None, order: str | None
) -> tuple[Table, float | None]:
    """Motion in an NPZ file, as `arrays_motion`; an NPY file is `qpos` alone. Raises TrajectoryError."""
    try:
        arrays = {"qpos": npy_array(data)} if where.suffix.lower() == ".npy" else npz_arrays(data)
    except ValueError as error:
        raise TrajectoryError(f"{where}: {error}") from None
    return arrays_motion(arrays, str(where), body, timestep, order, kind=_NPZ)


def arrays_in_memory(source: Any) -> dict[str, Any]:
    """Arrays by name, of a mapping or of `(times, array, names)`. Raises ShapeError."""
    if isinstance(source, tuple):
        if len(source) != 3:
            raise ShapeError(f"file: (times, array, names) are three, got {len(source)}: {value_text(source)}")
        source = dict(zip(("time", "shapes", "joint_names"), source, strict=True))
    return {str(name): value if isinstance(value, Mapping) else np.asarray(value) for name, value in source.items()}


def arrays_motion(
    arrays: Mapping[str, Any], where: str, body: Body, timestep: float | None, order: str | None, *, kind: str
) -> tuple[Table, float | None]:
    """Motion in arrays by name, and the time step if it is still needed.

    With `qpos`, `q` or `Q` it is a simulator's or an optimiser's (see `floating_motion`), with `joint_pos` Isaac
    Lab's: the base is the first of `body_pos_w` (N, b, 3) and `body_quat_w` (N, b, 4), and unnamed orders, of joints
    and of a quaternion's numbers, are those in which the links lie at `body_pos_w` and turn as `body_ang_vel_w`. With
    `shapes` there are `time` and `joint_names`, too; else vectors by name are the joints. In a file of `Motion.save`
    these stand beside what else it holds, and its momentum.
    """
    momentum = None
    if "spatial_momentum" in arrays:
        if not set(_STORED) <= set(arrays):
            raise TrajectoryError(
                f"{where}: this motion is stored without the path of its joints: it is a batch, no path of a body's "
                "joints, or of an earlier version; store it anew (shapephase split BODY MOTION --out FILE)"
            )
        momentum = _array(arrays["spatial_momentum"], where, "spatial_momentum", (3,), "kg m^2/s")
        arrays = {name: arrays[name] for name in _STORED}
    try:
        both = {"qpos", "q", "Q"} & set(arrays)
        if "shapes" in arrays and both:
            raise TrajectoryError(f"{where}: both 'shapes' and {min(both)!r} are there; keep one")
        if "joint_pos" in arrays and not {"shapes", "qpos"} & set(arrays):
            return _isaac_table(arrays, where, body, timestep, order), None
        # A matrix q with the columns of joint_names and no others, one sample for each time, has names.
        named_shape = np.size(arrays.get("time", ())), np.size(arrays.get("joint_names", ()))
        if "q" in arrays and "joint_names" in arrays and np.shape(arrays["q"]) == named_shape:
            arrays = {"shapes" if name == "q" else name: value for name, value in arrays.items()}
        named = _placed_qpos(arrays, where, body) if order is None else None
        motion = floating_motion(arrays if named is None else {**arrays, **named}, where, body, order)
        if motion is not None:
            times = _times(arrays, motion.title.split()[-1], where, len(motion.joints), timestep)
            return _table(motion, times, where, arrays), None
    except ShapeError as error:
        raise TrajectoryError(str(error)) from None
    entries = {
        name: value.tolist()
        if isinstance(value, np.ndarray) and value.dtype.kind in "UT" and value.ndim == 1
        else value
        for name, value in arrays.items()
    }
    table = arrays_table(where, kind, entries, None)
    # Our own files are in radians and metres; other people's by name may be in degrees.
    return replace(table, by_format=kind == _NPZ and "shapes" in arrays, momentum=momentum), timestep


def of_numbered_columns(table: Table, body: Body, order: str | None) -> Table:
    """The table with base and joints in place of columns such as `qpos_0`, `q[1]`."""
    numbered = numbered_columns(table.columns, table.where)
    taken = [label for labels in numbered.values() for label in labels]
    places = next((numbered[name] for name in ("qpos", "q", "Q") if name in numbered), [])
    fewest = body.n_shape + (0 if "qpos" in numbered else min(FREE_JOINT, root_width(body, "Q") or FREE_JOINT))
    if not places or len(places) < fewest or set(taken) & set(body.joint_names):
        return table
    for label in taken:
        table.check_column(label)
    arrays: dict[str, Any] = {
        name: np.stack([table.columns[label] for label in labels], axis=1) for name, labels in numbered.items()
    }
    # Samples are the rows of a table.
    motion = floating_motion({**arrays, "time": np.arange(len(table.rows))}, table.where, body, order)
    assert motion is not None
    made = _table(motion, np.arange(len(table.rows), dtype=np.float64), table.where, {})
    columns = {label: values for label, values in table.columns.items() if label not in taken}
    return replace(
        table,
        columns=columns | made.columns,
        units=dict(table.units) | dict.fromkeys(made.columns, SI),
        base_quat_xyzw=made.base_quat_xyzw,
        base_position=made.base_position,
        nameless=made.nameless,
        simulated=made.simulated,
        up=made.up,
    )


def _table(motion: FloatingMotion, times: Array, where: str, arrays: Mapping[str, Any]) -> Table:
    step = arrays.get("timestep")
    return Table(
        where=where,
        format=motion.title,
        columns={
            name: np.ascontiguousarray(column) for name, column in zip(motion.names, motion.joints.T, strict=True)
        },
        rows=range(len(times)),
        row="sample",
        times=times,
        by_format=True,
        base_quat_xyzw=motion.quaternion,
        base_position=motion.position,
        up="z" if motion.title.startswith(("MuJoCo", "Isaac")) else None,
        nameless=motion.nameless,
        simulated=Simulated(motion.rates, None if step is None else float(np.ravel(step)[0])),
        unread={
            name: f"an array {array.shape} of {array.dtype}" for name, array in arrays.items() if name not in _READ
        },
    )


def _isaac_table(arrays: Mapping[str, Any], where: str, body: Body, timestep: float | None, order: str | None) -> Table:
    joints = _array(arrays["joint_pos"], where, "joint_pos", (None, None))
    count = len(joints)
    times = _times(arrays, "joint_pos", where, count, timestep)
    quaternions, places, spins = (
        _array(arrays[name], where, name, (count, None, entries)) if name in arrays else None
        for name, entries in (("body_quat_w", 4), ("body_pos_w", 3), ("body_ang_vel_w", 3))
    )
    named = None
    if "joint_names" in arrays:
        stored = arrays["joint_names"]
        if stored.dtype.kind not in "UT" and stored.size:
            raise TrajectoryError(f"{where}: joint_names: text is needed, got an array of {stored.dtype}")
        named = tuple(map(str, np.ravel(stored)))
        if len(set(named)) != len(named):
            raise TrajectoryError(f"{where}: a joint name stands twice in {', '.join(named)}")
    if named is not None and len(named) != joints.shape[1]:
        raise TrajectoryError(
            f"{where}: joint_pos has {joints.shape[1]} columns, and joint_names has {len(named)}; mend 'joint_names'"
        )
    nameless = None
    if quaternions is not None and places is not None:
        first = quaternions[:, 0]
        nameless, which = placed_joints(
            body, joints, places, first, where, order, names=named, spins=spins, times=times, orders=2
        )
        quaternions = first if which else first[:, _SCALAR_FIRST]
    elif quaternions is not None or (named is None and order is None):
        raise TrajectoryError(
            f"{where}: joint_pos does not say the order of joints and quaternions: add 'body_pos_w' and 'body_quat_w', "
            "by which both are found; store shapes, joint_names and base_quat_wxyz instead; or, without a base, say "
            "which it is: joint_order='isaac' (--joint-order isaac)"
        )
    elif named is None:
        nameless = nameless_joints(body, joints.shape[1], f"{where}: joint_pos", order)
    names = named or (nameless.names if nameless else ())
    motion = FloatingMotion(
        "Isaac Lab joint_pos",
        names,
        joints,
        quaternion=quaternions,
        position=None if places is None else places[:, 0],
        nameless=None if named else nameless,
    )
    if spins is not None and "joint_vel" in arrays and set(body.joint_names) <= set(names):
        moving = _array(arrays["joint_vel"], where, "joint_vel", joints.shape, "rad/s")
        motion = motion._replace(rates=Rates(spins[:, 0], moving[:, places_of(names, body)], "world"))
    return _table(motion, times, where, arrays)


def _placed_qpos(arrays: Mapping[str, Any], where: str, body: Body) -> dict[str, Any] | None:
    """Names of the joints of `qpos` by the places of the bodies beside it, where it has none."""
    if "qpos" not in arrays or "body_pos_w" not in arrays or "joint_names" in arrays:
        return None
    values = _array(arrays["qpos"], where, "qpos", (None, None))
    if nameless_joints(body, values.shape[1], f"{where}: qpos", None).free != FREE_JOINT:
        return None
    places = _array(arrays["body_pos_w"], where, "body_pos_w", (len(values), None, 3))
    joints, _ = placed_joints(body, values[:, FREE_JOINT:], places, values[:, 3:FREE_JOINT], where, None, orders=1)
    return {"joint_names": np.array(joints.names), "nameless": joints}


def _times(arrays: Mapping[str, Any], kind: str, where: str, count: int, timestep: float | None) -> Array:
    given = [name for name in ("time", "timestep", "fps") if name in arrays] + ["argument"] * (timestep is not None)
    if given[:2] == ["time", "timestep"]:
        # The step of the integrator, where every so many samples are stored.
        del given[1]
    if len(given) != 1:
        raise TrajectoryError(
            f"{where}: the times of {kind} come from one of the array 'time', the arrays 'timestep' and 'fps' of one "
            f"number and the argument timestep (--step); {'none' if not given else 'more than one'} is there"
        )
    if given == ["time"]:
        times = np.asarray(arrays["time"])
        return _array(times.ravel() if times.size == count else times, where, "time", (count,), "s")
    name, unit = ("fps", "1/s") if given == ["fps"] else ("timestep", "s")
    step = _array(arrays.get(name, timestep), where, name, (), unit)
    if step.size != 1 or step.ravel()[0] <= 0.0:
        raise TrajectoryError(f"{where}: {name}: one number above 0 is needed [{unit}], got {step}")
    number = step.ravel()[0]
    return np.arange(count) / number if name == "fps" else np.arange(count) * number


def _array(value: Any, where: str, name: str, trailing: tuple[int | None, ...], unit: str = "") -> Array:
    if np.asarray(value).dtype.kind == "b":
        raise TrajectoryError(f"{where}: {name}: numbers are needed, got an array of true and false")
    array = finite_array(value, f"{where}: {name}", trailing, unit=unit)
    if trailing and array.ndim != len(trailing):
        raise TrajectoryError(f"{where}: {name}: {len(trailing)} axes are needed, got shape {array.shape}")
    return array


def named_columns(
    table: Table, body: Body, names: Mapping[str, str | None], order: str | None, timestep: float | None
) -> Table:
    """A table whose columns have names, where `names` does not number them.

    A first column that ascends has the times. Behind it are as many columns as joints, in an order of simulators, or
    these behind a free joint, or a place and a quaternion x y z w; with a warning. Columns that `names` numbers keep
    their numbers. Numbers do not show where the scalar part of a free joint's quaternion stands, first (MuJoCo) or last
    (Pinocchio).
    """
    numbered = [label for label in table.columns if label in names]
    if not table.numbered or len(numbered) == len(table.columns):
        return table
    values = list(table.columns.values())
    has_times = timestep is None and len(values[0]) > 1 and bool((np.diff(values[0]) > 0.0).all())
    first = ("time",) if has_times else ()
    rest = values[len(first) :]
    is_pose = len(rest) == FREE_JOINT and bool(
        (np.abs(np.linalg.norm(np.stack(rest[3:]), axis=0) - 1.0) < OFF_UNIT).all()
    )
    joints = None
    try:
        joints = nameless_joints(body, len(rest), f"{table.where}: the table without a header", order)
    except TrajectoryError as error:
        if numbered:
            return table
        if not is_pose:
            header = ",".join(body.joint_names[:2])
            raise TrajectoryError(
                f"{error}. There are {len(values)} columns and no header: write one, `time,{header}...`, or name the "
                f"columns by their numbers: --names 1=time 2={next(iter(body.joint_names), 'base_x')} "
                "(names={'1': 'time', ...})"
            ) from None
    if joints is not None and is_pose:
        raise TrajectoryError(
            f"{table.where}: {len(values)} columns without a header may be {len(rest)} joints, or a place and a "
            "quaternion; write a header, or say which: --names 1=time 2=base_x (names=['time', 'base_x', ...])"
        )
    meant = _TUM if joints is None else (*_FREE[: joints.free], *joints.names)
    if joints is not None and joints.free:
        quaternion = [*table.columns][len(first) + 3 :][:4]
        if any(label not in names for label in quaternion):
            last, scalar_first = (
                " ".join(f"{label}=base_q{part}" for label, part in zip(quaternion, parts))
                for parts in ("xyzw", "wxyz")
            )
            raise TrajectoryError(
                f"{table.where}: no header, and as many columns as a free base and the joints have; columns "
                f"{quaternion[0]} to {quaternion[3]} are a quaternion, x y z w or w x y z. Say which: --names {last} "
                f"or --names {scalar_first} (names={{{quaternion[0]!r}: 'base_qx', ...}})"
            )
    labels = [old if old in names else new for old, new in zip(table.columns, (*first, *meant), strict=True)]
    warn(f"{table.where}: no header; columns are taken for {', '.join(labels)}: a header would say so")
    return replace(
        table,
        columns=dict(zip(labels, values, strict=True)),
        faults={new: table.faults.get(old, {}) for old, new in zip(table.columns, labels)},
        units={},
        numbered=False,
        nameless=joints,
    )
