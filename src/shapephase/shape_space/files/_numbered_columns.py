"""Tables without a header: which column is which, by how many there are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...arrays import Array
from ...body.body import Body
from ...errors import TrajectoryError
from .nameless_joints import FREE_JOINT, nameless_joints
from .recording import Table, warn

# TUM RGB-D benchmark: pose behind the time, in trajectories of visual odometry
_TUM = ("base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw")
_FREE = ("base_x", "base_y", "base_z", "base_qw", "base_qx", "base_qy", "base_qz")  # MuJoCo's free joint
_OFF_UNIT = 1e-3


def named_columns(
    table: Table, body: Body, names: Mapping[str, str | None], order: str | None, timestep: float | None
) -> Table:
    """A table whose columns have names, where `names` does not number them.

    A first column that ascends has the times. Behind it are as many columns as joints, in an order of simulators, or
    these behind a free joint, or a place and a quaternion x y z w; this is said. Columns that `names` numbers keep
    their numbers. Where the scalar part of a free joint's quaternion stands, first as MuJoCo has it or last as
    Pinocchio has it, numbers do not show.

    Raises TrajectoryError if the number of columns fits nothing, or fits two of these; for a free joint whose
    quaternion `names` does not number.
    """
    given = [label for label in table.columns if label in names]
    if not table.numbered or len(given) == len(table.columns):
        return table
    values = list(table.columns.values())
    has_times = timestep is None and len(values[0]) > 1 and bool((np.diff(values[0]) > 0.0).all())
    first = ("time",) if has_times else ()
    rest = values[len(first) :]
    found, meant = None, None
    try:
        found = nameless_joints(body, len(rest), f"{table.where}: the table without a header", order)
    except TrajectoryError as error:
        if given:
            return table
        if not _is_pose(rest):
            raise TrajectoryError(_ways(body, len(values), str(error))) from None
    if _is_pose(rest):
        if found is not None:
            raise TrajectoryError(
                f"{table.where}: {len(values)} columns without a header may be {len(rest)} joints, or a place and a "
                "quaternion; write a header, or say which: --names 1=time 2=base_x (names=['time', 'base_x', ...])"
            )
        meant = _TUM
    elif found is not None:
        meant = (*_FREE[: found.free], *found.names)
        if found.free:
            _check_quaternion([*table.columns][len(first) + 3 :][:4], names, table.where)
    assert meant is not None
    labels = (old if old in names else new for old, new in zip(table.columns, (*first, *meant), strict=True))
    columns = dict(zip(labels, values, strict=True))
    warn(f"{table.where}: no header; columns are taken for {', '.join(columns)}: a header would say so")
    faults = {new: table.faults.get(old, {}) for old, new in zip(table.columns, columns)}
    return replace(table, columns=columns, faults=faults, units={}, numbered=False, nameless=found)


def _check_quaternion(labels: Sequence[str], names: Mapping[str, str | None], where: str) -> None:
    if any(label not in names for label in labels):
        scalar_last, scalar_first = (
            " ".join(f"{label}=base_q{part}" for label, part in zip(labels, parts)) for parts in ("xyzw", "wxyz")
        )
        raise TrajectoryError(
            f"{where}: no header, and as many columns as a free base and the joints have; columns {labels[0]} to "
            f"{labels[3]} are a quaternion, x y z w or w x y z. Say which: --names {scalar_last} or --names "
            f"{scalar_first} (names={{{labels[0]!r}: 'base_qx', ...}})"
        )


def _is_pose(values: list[Array]) -> bool:
    if len(values) != FREE_JOINT:
        return False
    return bool((np.abs(np.linalg.norm(np.stack(values[3:]), axis=0) - 1.0) < _OFF_UNIT).all())


def _ways(body: Body, count: int, why: str) -> str:
    joints = ",".join(body.joint_names[:2])
    return (
        f"{why}. There are {count} columns and no header: write one, `time,{joints}...`, or name the columns by their "
        f"numbers: --names 1=time 2={next(iter(body.joint_names), 'base_x')} (names={{'1': 'time', ...}})"
    )
