"""Columns of a recording that hold the turns of ball joints: four of a quaternion, or three angles in their order."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...errors import TrajectoryError
from ..interpolation import ball_columns, neighbours_signs
from ._gaps import Gaps
from ._unit_doubts import angles_in_rad
from .labels import Label, label
from .recording import Recording, checked_quaternions, warn

_TURN = re.compile(r"(?P<joint>.+)(?:\.r(?P<small>[xyz])|_(?P<large>[XYZ])rotation)", re.DOTALL)
_OFF_UNIT = 0.1  # allowed error of a quaternion's length: splines between unit quaternions are shorter
_ACROSS = 1e-6  # cosine of the angle between orthogonal axes
_JUMP = 0.5 * np.pi  # [rad] per sample of two hinges, while the link turns by less than a third of it


def with_quaternions(
    recording: Recording, body: Body, names: Mapping[str, str | None], degrees: bool | None, gaps: Gaps
) -> tuple[Recording, dict[str, str]]:
    """The recording with quaternions of ball joints in the place of angles, and the columns each is made of.

    The columns `shoulder.rz`, `shoulder.rx`, `shoulder.ry` of a ball joint, in the order in which they stand, are turns
    about z, x and y, each about its axis as those before have turned it; so are `shoulder_Zrotation` and so on, as
    tables that are made of BVH files name them.

    names : label -> name of the joint

    Raises TrajectoryError if one of the three is missing, is no angle, or has a doubtful unit.
    """
    table = recording.table
    sources: dict[str, str] = {}
    for joint in body.ball_joints:
        angles: dict[str, tuple[str, str | None]] = {}
        for text in table.columns:
            target = names.get(text, text)
            parts = Label("", None) if target is None else label(target)
            match = _TURN.fullmatch(parts.name)
            if match is None or match["joint"] != joint or parts.name in body.joint_names:
                continue
            axis = (match["small"] or match["large"]).lower()
            if axis in angles:
                both = f"columns {angles[axis][0]!r} and {text!r} are both {parts.name}"
                raise TrajectoryError(f"{table.where}: {both}; keep one")
            angles[axis] = text, parts.unit or table.units.get(text) or label(text).unit
        if not angles:
            continue
        lacking = [f"{joint}.r{axis}" for axis in "xyz" if axis not in angles]
        if lacking:
            raise TrajectoryError(f"{table.where}: ball joint {joint} turns about three axes; add {', '.join(lacking)}")
        labels = [text for text, _ in angles.values()]
        gaps.joined(table, labels)
        values = [
            angles_in_rad(recording, text, gaps.held(table, text), unit, degrees) for text, unit in angles.values()
        ]
        turns = gaps.turned(labels, so3.matrix_from_euler(np.stack(values, axis=-1), "".join(angles)))
        columns = {text: column for text, column in table.columns.items() if text not in labels}
        for part, column in zip("xyzw", so3.quat_from_matrix(turns).T, strict=True):
            name = f"{joint}.{part}"
            sources[name] = ", ".join(labels)
            if name in columns:
                raise TrajectoryError(
                    f"{table.where}: ball joint {joint} stands twice, as {sources[name]} and as {name}"
                )
            columns[name] = column
        table = replace(table, columns=columns)
    return replace(recording, table=table), sources


def continued_balls(shapes: Array, body: Body, recording: Recording, gaps: Gaps, columns: Mapping[int, str]) -> Array:
    """Shapes (N, n) with the quaternions of ball joints, bridged, in the sign that is nearer to the sample before.

    columns : joint -> label

    Raises TrajectoryError if the length of one is far from one.
    """
    balls = ball_columns(body.joint_names) if body.ball_joints else ()
    for ball, joint in zip(balls, body.ball_joints, strict=True):
        quaternions = checked_quaternions(shapes[:, ball], recording, f"ball joint {joint}", _OFF_UNIT)
        labels = [columns[column] for column in range(ball.start, ball.stop) if column in columns]
        turns = so3.matrix_from_quat(quaternions)
        bridged = gaps.turned(labels, turns) if labels else turns
        changed = (bridged != turns).any(axis=(1, 2))
        shapes[changed, ball] = so3.quat_from_matrix(bridged[changed])
    return neighbours_signs(shapes, balls)


def continued_hinges(shapes: Array, body: Body, recording: Recording) -> Array:
    """Shapes (N, n) whose triples of hinges in one point go on to the nearest of their angles, where these jump.

    Angles a, b, c about axes at right angles are the same turn as a + pi, pi - b, c + pi and those whole turns apart.
    Programs that write the three angles of a rotation go from one to the other where the first and third axis meet.

    Warns of the first such sample: the hinges then go near that place, where they are far from a rotation.
    """
    if len(shapes) < 2:
        return shapes
    for columns, axes in _hinge_triples(body):
        angles = shapes[:, columns]
        first, second, third = (so3.exp(angles[:, k, None] * axes[k]) for k in range(3))
        turns = first @ second @ third
        # At a change of branch the first and the third go half a turn; a whole turn of one alone is as it is written.
        swift = np.sort(np.abs(np.diff(angles, axis=0)), axis=1)[:, 1]
        jumps = np.flatnonzero((swift > _JUMP) & (so3.angle(so3.transpose(turns[:-1]) @ turns[1:]) < swift / 3.0))
        if not len(jumps):
            continue
        for k in range(1, len(angles)):
            a, b, c = angles[k]
            branches = np.array([angles[k], [a + np.pi, np.pi - b, c + np.pi]])
            branches += 2.0 * np.pi * np.rint((angles[k - 1] - branches) / (2.0 * np.pi))
            angles[k] = branches[np.argmin(np.abs(branches - angles[k - 1]).max(axis=1))]
        shapes = shapes.copy()
        shapes[:, columns] = angles
        names = ", ".join(body.joint_names[column] for column in columns)
        warn(
            f"{recording.place(int(jumps[0]) + 1)}: {names} jump, and what they move does not ({len(jumps)} such "
            "steps): they go on to the nearest angles of the same rotation. Between samples, three hinges are a few "
            "degrees off a rotation where their first and third axis meet; a ball joint in their place is not"
        )
    return shapes


def _hinge_triples(body: Body) -> list[tuple[list[int], Array]]:
    """Three hinges in one point about axes at right angles: columns of the shape, and axes (3, 3) as rows at zero."""
    chain, triples, taken = body.chain, [], set()
    for joint in range(len(chain.names) - 2):
        three = range(joint, joint + 3)
        names = [chain.names[k] for k in three]
        one_point = all(chain.parents[k + 1] == k + 1 and not chain.places[k + 1].any() for k in three[:2])
        free = not taken & {*three} and {*names} <= {*body.joint_names} and not chain.slides[joint : joint + 3].any()
        if not one_point or not free:
            continue
        second = chain.turns[joint + 1]
        axes = np.array(
            [chain.axes[joint], second @ chain.axes[joint + 1], second @ chain.turns[joint + 2] @ chain.axes[joint + 2]]
        )
        if np.abs(axes @ axes.T - np.eye(3)).max() < _ACROSS:
            triples.append(([body.joint_index(name) for name in names], axes))
            taken |= {*three}
    return triples
