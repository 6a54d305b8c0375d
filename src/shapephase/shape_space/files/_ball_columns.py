"""Columns of a recording that say how ball joints are turned: four of a quaternion, or three angles in their order."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...errors import TrajectoryError
from ..ball_columns import ball_columns, neighbours_signs
from ._gaps import Gaps
from .labels import ANGLES, SI, Label, label
from .recording import Recording, warn

_AXES = "xyz"
_TURN = re.compile(r"(?P<joint>.+)(?:\.r(?P<small>[xyz])|_(?P<large>[XYZ])rotation)", re.DOTALL)
_OFF_UNIT = 0.1  # allowed error of a quaternion's length: splines between unit quaternions are shorter
_ACROSS = 1e-6  # cosine of the angle between orthogonal axes
_JUMP = 0.5 * np.pi  # [rad] per sample of two hinges, while the link turns by less than a third of it
_MOST_ANGLE = 2.0 * np.pi  # [rad] larger angles without a unit are rather in degrees


def with_quaternions(
    recording: Recording, body: Body, names: Mapping[str, str | None], degrees: bool | None, gaps: Gaps
) -> tuple[Recording, dict[str, str]]:
    """The recording with quaternions of ball joints in the place of angles; and which columns each is made of.

    The columns `shoulder.rz`, `shoulder.rx`, `shoulder.ry` of a ball joint, in the order in which they stand, are turns
    about z, x and y, each about its axis as those before have turned it; so are `shoulder_Zrotation` and so on, as
    tables that are made of BVH files name them.

    names : label -> name of the joint, as a caller has said

    Raises TrajectoryError if one of the three is missing, is no angle, or has a unit that can only be guessed.
    """
    table = recording.table
    made: dict[str, str] = {}
    for joint in body.ball_joints:
        found: dict[str, tuple[str, str | None]] = {}
        for text in table.columns:
            target = names.get(text, text)
            parts = Label("", None) if target is None else label(target)
            match = _TURN.fullmatch(parts.name)
            if match is None or match["joint"] != joint or parts.name in body.joint_names:
                continue
            axis = (match["small"] or match["large"]).lower()
            if axis in found:
                both = f"columns {found[axis][0]!r} and {text!r} are both {parts.name}"
                raise TrajectoryError(f"{table.where}: {both}; keep one")
            found[axis] = text, parts.unit
        if not found:
            continue
        lacking = [f"{joint}.r{axis}" for axis in _AXES if axis not in found]
        if lacking:
            raise TrajectoryError(f"{table.where}: ball joint {joint} turns about three axes; add {', '.join(lacking)}")
        taken = [text for text, _ in found.values()]
        gaps.joined(table, taken)
        angles = [_angles(text, gaps.held(table, text), unit, recording, degrees) for text, unit in found.values()]
        turned = gaps.turned(taken, so3.matrix_from_euler(np.stack(angles, axis=-1), "".join(found)))
        columns, said = {text: each for text, each in table.columns.items() if text not in taken}, ", ".join(taken)
        for part, values in zip("xyzw", so3.quat_from_matrix(turned).T, strict=True):
            if f"{joint}.{part}" in columns:
                raise TrajectoryError(
                    f"{table.where}: ball joint {joint} stands twice, as {said} and as {joint}.{part}"
                )
            columns[f"{joint}.{part}"] = values
            made[f"{joint}.{part}"] = said
        table = replace(table, columns=columns)
    return replace(recording, table=table), made


def _angles(text: str, values: Array, said: str | None, recording: Recording, degrees: bool | None) -> Array:
    """A column in rad."""
    table = recording.table
    unit = said or table.units.get(text) or label(text).unit
    if unit is not None and unit != SI and unit not in ANGLES:
        raise TrajectoryError(f"{table.where}: column {text!r} is in {unit}, and a turn is in rad or degrees")
    if unit is not None and unit != SI and degrees is not None and degrees != (unit == "deg"):
        raise TrajectoryError(f"{table.where}: column {text!r} is in {unit}, and degrees={degrees} was given")
    if unit is None:
        given = degrees if degrees is not None else table.degrees
        if given is None:
            raise TrajectoryError(
                f"{table.where}: the header does not say inDegrees=yes or no; add that, or give degrees=True or False "
                "(--degrees, --radians)"
            )
        widest = int(np.argmax(np.abs(values)))
        if degrees is None and not table.by_format and abs(values[widest]) > _MOST_ANGLE:
            raise TrajectoryError(
                f"{recording.place(widest)}: column {text!r} is at {values[widest]:.6g} rad, more than a turn: "
                f"degrees? Name it {text}_deg or give degrees=True (--degrees); for radians, give degrees=False "
                "(--radians)"
            )
        unit = "deg" if given else "rad"
    return values * (1.0 if unit == SI else ANGLES[unit])


def continued_balls(shapes: Array, body: Body, recording: Recording, gaps: Gaps, columns: Mapping[int, str]) -> Array:
    """Shapes (N, n) with the quaternions of ball joints, bridged, in the sign that is nearer to the sample before.

    columns : joint -> label

    Raises TrajectoryError if the length of one is far from one.
    """
    balls = ball_columns(body.joint_names) if body.ball_joints else ()
    for ball, joint in zip(balls, body.ball_joints, strict=True):
        lengths = np.linalg.norm(shapes[:, ball], axis=1)
        worst = int(np.argmax(np.abs(lengths - 1.0)))
        if not abs(lengths[worst] - 1.0) <= _OFF_UNIT:
            raise TrajectoryError(
                f"{recording.place(worst)}: the quaternion x, y, z, w of ball joint {joint} has the length "
                f"{lengths[worst]:.6g}; 1 is needed"
            )
        labels = [columns[column] for column in range(ball.start, ball.stop) if column in columns]
        turns = so3.matrix_from_quat(shapes[:, ball] / lengths[:, None])
        bridged = gaps.turned(labels, turns) if labels else turns
        changed = (bridged != turns).any(axis=(1, 2))
        shapes[changed, ball] = so3.quat_from_matrix(bridged[changed])
    return neighbours_signs(shapes, balls)


@dataclass(frozen=True)
class _HingeTriple:
    """Three hinges in one point about axes at right angles: columns of the shape, and axes (3, 3) as rows at zero."""

    columns: list[int]
    axes: Array

    def turns(self, angles: Array) -> Array:
        """(N, 3) -> (N, 3, 3)."""
        first, second, third = (so3.exp(angles[:, k, None] * self.axes[k]) for k in range(3))
        return first @ second @ third


def continued_hinges(shapes: Array, body: Body, recording: Recording) -> Array:
    """Shapes (N, n) whose triples of hinges in one point go on to the nearest of their angles, where these jump.

    Angles a, b, c about axes at right angles are the same turn as a + pi, pi - b, c + pi and those whole turns apart.
    Programs that write the three angles of a rotation go from one to the other where the first and third axis meet.

    Warns with the first sample at which they do: the hinges then go near that place, where they are far from a
    rotation.
    """
    if len(shapes) < 2:
        return shapes
    for triple in _hinge_triples(body):
        angles = shapes[:, triple.columns]
        turns = triple.turns(angles)
        # Of a change of branch the first and the third go half a turn; a whole turn of one alone is as it is written.
        swift = np.sort(np.abs(np.diff(angles, axis=0)), axis=1)[:, 1]
        jumps = np.flatnonzero((swift > _JUMP) & (so3.angle(so3.transpose(turns[:-1]) @ turns[1:]) < swift / 3.0))
        if not len(jumps):
            continue
        for k in range(1, len(angles)):
            first, second, third = angles[k]
            both = np.array([angles[k], [first + np.pi, np.pi - second, third + np.pi]])
            both += 2.0 * np.pi * np.rint((angles[k - 1] - both) / (2.0 * np.pi))
            angles[k] = both[np.argmin(np.abs(both - angles[k - 1]).max(axis=1))]
        shapes = shapes.copy()
        shapes[:, triple.columns] = angles
        names = ", ".join(body.joint_names[column] for column in triple.columns)
        sample = int(jumps[0]) + 1
        warn(
            f"{recording.place(sample)}: {names} jump, and what they move does not ({len(jumps)} such steps): they go "
            "on to the nearest angles of the same rotation. Between samples, three hinges are a few degrees off a "
            "rotation where their first and third axis meet; a ball joint in their place is not"
        )
    return shapes


def _hinge_triples(body: Body) -> list[_HingeTriple]:
    chain, found, taken = body.chain, [], set()
    for joint in range(len(chain.names) - 2):
        three = range(joint, joint + 3)
        row = all(chain.parents[k + 1] == k + 1 and not chain.places[k + 1].any() for k in three[:2])
        names = [chain.names[k] for k in three]
        if not row or taken & {*three} or not {*names} <= {*body.joint_names} or chain.slides[joint : joint + 3].any():
            continue
        second = chain.turns[joint + 1]
        axes = np.array(
            [chain.axes[joint], second @ chain.axes[joint + 1], second @ chain.turns[joint + 2] @ chain.axes[joint + 2]]
        )
        if np.abs(axes @ axes.T - np.eye(3)).max() < _ACROSS:
            found.append(_HingeTriple([body.joint_index(name) for name in names], axes))
            taken |= {*three}
    return found
