"""The motion of a BVH file, for the body that was made of its skeleton."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....arguments import check_object
from ....body.body import Body
from ....body.formats.bvh import column_names
from ....body.formats.bvh_text import BvhFaultError, Skeleton, bvh_skeleton
from ....errors import TrajectoryError
from .._recording import Table

_WHOLE_TURN = 360.0
"""[degrees] Files wrap angles; a channel goes on by what is nearest."""


def read_bvh(where: Path, data: bytes, body: Body) -> Table:
    """Angles of all bones that move mass, in degrees, and place and angles of the root.

    An angle that jumps by more than half a turn from one frame to the next is continued by whole turns.

    Raises
    ------
    TrajectoryError
        For faults, with the line; for a body that is not from a BVH file; where bones turn in another order than
        those of the body.
    """
    check_object(body, "Body", "body")
    metre = body.length_unit
    if metre is None:
        raise TrajectoryError(
            f"{where}: a BVH file moves the skeleton of its own, and {body.name} is not from such a file; load the "
            f"body from it, load_body({where.name!r}, length_unit=...), or write a table of joint angles"
        )
    try:
        skeleton = bvh_skeleton(data)
    except BvhFaultError as error:
        raise TrajectoryError(f"{where}: line {error.line}: {error}") from None
    columns, unread = {}, {}
    for bone in skeleton.bones:
        for name, channel, column in zip(column_names(bone), bone.channels, bone.columns(bone.channels), strict=True):
            values = np.ascontiguousarray(skeleton.frames[:, column])
            if channel not in bone.turns and bone.parent is not None:
                unread[name] = "the place of a bone, which is its OFFSET"
            elif channel not in bone.turns:
                columns[name] = metre * values
            elif bone.parent is not None and bone.name in body.link_names and name not in body.joint_names:
                unread[name] = "a turn of a bone without mass"
            else:
                columns[name] = np.unwrap(values, period=_WHOLE_TURN)
    _check_order(skeleton, body, where)
    return Table(
        where=str(where),
        format="BVH",
        columns=columns,
        rows=skeleton.lines,
        row="line",
        times=skeleton.step * np.arange(len(skeleton.lines), dtype=np.float64),
        by_format=True,
        degrees=True,
        unread=unread,
    )


def _check_order(skeleton: Skeleton, body: Body, where: Path) -> None:
    """Raise TrajectoryError where bones turn about their axes in another order than those of the body."""
    chain = (*(body.base_angles[0] if body.base_angles else ()), *body.joint_names)
    for bone in skeleton.bones:
        names = [name for name in column_names(bone) if name in chain]
        ordered = sorted(names, key=chain.index)
        if names != ordered:
            raise TrajectoryError(
                f"{where}: line {bone.line}: bone {bone.name!r} turns in the order {', '.join(names)}, and in that of "
                f"the body's file: {', '.join(ordered)}; load the body from this file"
            )
