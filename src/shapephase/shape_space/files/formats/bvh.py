"""The motion of a BVH file, for the body that was made of its skeleton."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .... import so3
from ....arguments import check_object
from ....arrays import Array
from ....body.body import Body
from ....body.couplings.ball_joints import coordinate_names
from ....body.formats.bvh_text import Bone, BvhFaultError, Skeleton, bvh_skeleton, check_base, check_lengths
from ....errors import TrajectoryError
from ..recording import Table

_WHOLE_TURN = 360.0  # [deg] files wrap angles; hinges go on to the nearest value
_LOAD = "load the body from this file"
_ZERO = 1e-5  # [deg] rounding of an angle of zero with six decimals
_OTHER_AXES = 0.5  # least cosine between a bone's offsets in two files: other persons differ by less than other axes


def read_bvh(where: Path, data: bytes, body: Body) -> Table:
    """Turns of all bones that move mass, and place and attitude of the base.

    Three angles of a bone are a rotation, in any order: a quaternion for the body's ball joint. An angle of a hinge
    that jumps by more than half a turn from one frame to the next is continued by whole turns. Bones that the base
    hangs on move it.
    """
    check_object(body, "Body", "body")
    metre = body.length_unit
    if metre is None:
        raise TrajectoryError(
            f"{where}: a BVH file moves the skeleton of its own, and {body.name} is not from such a file; load the "
            f"body from it, load_body({where.name!r}, length_unit=...), or write a table of joint angles"
        )
    try:
        return _table(where, bvh_skeleton(data), body, metre)
    except BvhFaultError as error:
        raise TrajectoryError(f"{where}: line {error.line}: {error}") from None


def _table(where: Path, skeleton: Skeleton, body: Body, metre: float) -> Table:
    numbers = {bone.name: number for number, bone in enumerate(skeleton.bones)}
    root = body.link_names[0]
    if root not in numbers:
        raise BvhFaultError(f"there is no bone {root!r}, the base of {body.name}; {_LOAD}", skeleton.bones[0].line)
    base = numbers[root]
    check_base(skeleton, base)
    columns: dict[str, Array] = {}
    unread, moving = {}, []
    for number, bone in enumerate(skeleton.bones):
        if number in skeleton.above(base) or not bone.turns:
            continue
        names = [name for name in body.joint_names if name in (*coordinate_names(bone.name), *bone.hinge_names)]
        if not names:
            unread[bone.name] = "a bone without mass"
            continue
        _check_axes(bone, names, skeleton, body, metre)
        moving.append(number)
        if bone.name in body.ball_joints:
            turns = so3.quat_from_matrix(skeleton.turned(number, skeleton.frames)).T
        else:
            turns = np.unwrap(skeleton.frames[:, [column for _, column in bone.turns]], period=_WHOLE_TURN, axis=0).T
        columns |= dict(zip(names, np.ascontiguousarray(turns), strict=True))
    check_lengths(skeleton, moving)
    turned, placed = skeleton.base_motion(base)
    above = skeleton.above(base)[1:]
    angles = [column for number, bone in enumerate(skeleton.bones) if number not in above for _, column in bone.turns]
    return Table(
        where=str(where),
        format="BVH",
        columns=columns,
        rows=skeleton.lines,
        row="line",
        times=skeleton.step * np.arange(len(skeleton.lines), dtype=np.float64),
        by_format=True,
        degrees=True,
        base_quat_xyzw=so3.quat_from_matrix(turned),
        base_position=None if placed is None else metre * placed,
        unread=unread,
        zero_pose=bool(np.all(np.abs(skeleton.frames[:1, angles]) <= _ZERO)),
    )


def _check_axes(bone: Bone, names: list[str], skeleton: Skeleton, body: Body, metre: float) -> None:
    """Raise BvhFaultError where a bone turns about other axes than the body's, or hangs there in another direction."""
    if bone.name not in body.ball_joints and tuple(names) != bone.hinge_names:
        raise BvhFaultError(
            f"bone {bone.name!r} turns by {', '.join(bone.hinge_names)}, and in the body's file by "
            f"{', '.join(names)}; {_LOAD}",
            bone.line,
        )
    assert bone.parent is not None
    parent = skeleton.bones[bone.parent].name
    if parent not in body.link_names:
        raise BvhFaultError(f"bone {bone.name!r} hangs on {parent!r}, which {body.name} has not; {_LOAD}", bone.line)
    ends = [body.link_pose(body.shape(), link)[:3, 3] for link in (parent, bone.name)]
    own, other = bone.offset * metre, ends[1] - ends[0]
    if own @ other < _OTHER_AXES * np.linalg.norm(own) * np.linalg.norm(other):
        raise BvhFaultError(
            f"bone {bone.name!r} is at {_units(own / metre)} of {parent!r}, and in the body's file at "
            f"{_units(other / metre)}: its axes are others; {_LOAD}",
            bone.line,
        )


def _units(place: Array) -> str:
    return " ".join(f"{number:.4g}" for number in place)
