"""Files with poses of segments, each in axes of its own: tables, OpenSim's BodyKinematics, MVNX of inertial suits."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from .... import so3
from ....arrays import Array
from ....body.formats.bvh_text import BvhFaultError
from ....body.formats.mvnx_text import read_suit
from ....errors import TrajectoryError
from .._labels import LENGTHS, label
from .._recording import SegmentPoses, Table

_QUATERNION = re.compile(r"(?P<segment>.+?)(?:_q|_quat_?|\.q|[./]orientation[./])(?P<part>[xyzw])", re.DOTALL)
_PLACE = re.compile(r"(?P<segment>.+?)(?:_p?|_pos_?|\.p?|[./]position[./])(?P<part>[xyz])", re.DOTALL)
_TPOSE = "tpose"
"""Calibration pose of a suit, arms held out."""
_NPOSE = "npose"
"""The same, arms hanging."""
_ARM = ("UpperArm", "ForeArm", "Hand")
"""Segments of a suit's arm behind their side, from the shoulder on."""
_KINEMATICS = ("X", "Y", "Z", "Ox", "Oy", "Oz")
"""Columns of a body in OpenSim's BodyKinematics, behind its name: centre of mass, and angles about x, y, z as each
turn before has left them."""
_OFF_ROTATION = 1e-3
"""Of S^T S - 1: files have single precision."""
_WHOLE_BODY = "center_of_mass"
"""What BodyKinematics has behind the bodies, without angles."""


def read_mvnx(where: Path, data: bytes) -> Table:
    """The poses of a suit's segments, and its calibration poses; the room's z axis is up.

    Raises
    ------
    TrajectoryError
        For faults, with the line.
    """
    try:
        suit = read_suit(data)
    except BvhFaultError as error:
        raise TrajectoryError(f"{where}: line {error.line}: {error}") from None
    stands = {kind: (poses.turns[0], poses.origins[0]) for kind, poses in suit.stands.items()}
    if _TPOSE in stands and _NPOSE not in stands:
        stands[_NPOSE] = _with_arms_down(suit.segments, *stands[_TPOSE])
    return Table(
        where=str(where),
        format="MVNX",
        columns={},
        rows=suit.motion.lines,
        row="line",
        times=suit.times,
        by_format=True,
        up="z",
        poses=SegmentPoses(
            names=suit.segments,
            turns=suit.motion.turns,
            origins=suit.motion.origins,
            stands=stands,
            of_model="mvnx",
        ),
    )


def _with_arms_down(names: tuple[str, ...], turns: Array, origins: Array) -> tuple[Array, Array]:
    """The N-pose that belongs to a T-pose: arms lowered by a right angle about the pelvis's x axis, which is forward.

    Turns (k, 3, 3) and origins (k, 3). Source: MVN User Manual (Xsens), calibration poses.
    """
    turns, origins = turns.copy(), origins.copy()
    for side, angle in (("Left", -0.5 * np.pi), ("Right", 0.5 * np.pi)):
        arm = [names.index(f"{side}{part}") for part in _ARM if f"{side}{part}" in names]
        if not arm or "Pelvis" not in names:
            continue
        down = so3.exp(angle * turns[names.index("Pelvis")][:, 0])
        shoulder = origins[arm[0]]
        turns[arm], origins[arm] = down @ turns[arm], shoulder + (origins[arm] - shoulder) @ down.T
    return turns, origins


def body_kinematics(table: Table, kind: str) -> Table:
    """The table of an OpenSim file with its columns `BODY_X`, ..., `BODY_Oz` as poses of segments, where it has them.

    kind : first line of the file

    Raises
    ------
    TrajectoryError
        For velocities and accelerations, which have columns of these names, too.
    """
    bodies = [name.removesuffix("_Ox") for name in table.columns if name.endswith("_Ox")]
    labels = {body: [f"{body}_{axis}" for axis in _KINEMATICS] for body in bodies}
    if not bodies or any(name not in table.columns for names in labels.values() for name in names):
        return table
    if not kind.strip().lower().startswith("position"):
        raise TrajectoryError(
            f"{table.where}: line 1: {kind.strip()[:40]!r} of bodies, and positions are needed; give the file that "
            "BodyKinematics writes beside it, ..._pos_global.sto"
        )
    if table.degrees is None:
        raise TrajectoryError(f"{table.where}: the header does not say inDegrees=yes or no; add that line")
    numbers = np.stack([[table.columns[name] for name in names] for names in labels.values()]).transpose(2, 0, 1)
    angles = np.radians(numbers[..., 3:]) if table.degrees else numbers[..., 3:]
    used = {name for names in labels.values() for name in names} | {f"{_WHOLE_BODY}_{axis}" for axis in "XYZ"}
    columns = {name: values for name, values in table.columns.items() if name not in used}
    turns = so3.matrix_from_euler(angles, "xyz")
    poses = SegmentPoses(
        names=tuple(bodies), turns=turns, origins=numbers[..., :3], at_centres=True, of_model="opensim"
    )
    return replace(table, columns=columns, poses=poses, up="y")


def matrix_poses(names: tuple[str, ...], matrices: Array, metre: float | None) -> SegmentPoses:
    """Poses as 4 x 4 matrices (4, 4, k, N); where a segment was not seen, they are no rotations.

    metre : size of the unit of lengths [m]; None: the file does not say it
    """
    turns, origins = matrices[:3, :3].transpose(3, 2, 0, 1).copy(), matrices[:3, 3].transpose(2, 1, 0)
    off = np.abs(so3.transpose(turns) @ turns - np.eye(3)).max(axis=(2, 3))
    seen = off < _OFF_ROTATION
    turns[~seen] = np.nan
    turns[seen] = so3.orthonormalised(turns[seen])
    origins = np.where(seen[..., None], origins, np.nan) * (1.0 if metre is None else metre)
    return SegmentPoses(names=names, turns=turns, origins=origins, in_metres=metre is not None)


def pose_columns(table: Table, names: Mapping[str, str | None]) -> Table:
    """The table with its columns `SEGMENT_qw`, `_qx`, `_qy`, `_qz` and `_x`, `_y`, `_z` as poses of segments.

    One segment alone is the base, and stays as it is.
    """
    parts: dict[str, dict[str, str]] = {}
    places: dict[str, dict[str, str]] = {}
    for text in table.columns:
        if names.get(text, text) is None:
            continue
        for pattern, found in ((_QUATERNION, parts), (_PLACE, places)):
            match = pattern.fullmatch(label(text).name)
            if match is not None:
                found.setdefault(match["segment"], {})[match["part"]] = text
                break
    whole = [segment for segment, found in parts.items() if len(found) == len("xyzw")]
    if len(whole) < 2:
        return table
    placed = [segment for segment in whole if len(places.get(segment, {})) == len("xyz")]
    if placed and len(placed) < len(whole):
        lacking = next(segment for segment in whole if segment not in placed)
        raise TrajectoryError(
            f"{table.where}: segment {lacking!r} has no columns {lacking}_x, {lacking}_y, {lacking}_z, and others have "
            f"places; add them, or leave the segment out with names={{{lacking!r}: None}} (--names {lacking}=)"
        )
    numbers = np.stack([[table.columns[parts[segment][part]] for part in "xyzw"] for segment in whole]).transpose(
        2, 0, 1
    )
    lengths = np.linalg.norm(numbers, axis=-1)
    off = np.abs(lengths - 1.0) > 0.1
    if off.any():
        row, segment = np.argwhere(off)[0]
        raise TrajectoryError(
            f"{table.where}: {table.row} {table.rows[row]}: the quaternion of {whole[segment]!r} has the length "
            f"{lengths[row, segment]:.6g}; 1 is needed, in the order of the labels"
        )
    turns = np.full((*lengths.shape, 3, 3), np.nan)
    there = np.isfinite(lengths)
    turns[there] = so3.matrix_from_quat(so3.normalised(numbers[there]))
    origins = None
    if placed:
        units = {
            text: table.units.get(text) or label(text).unit or "m"
            for found in places.values()
            for text in found.values()
        }
        origins = np.stack(
            [[LENGTHS[units[places[s][axis]]] * table.columns[places[s][axis]] for axis in "xyz"] for s in whole]
        ).transpose(2, 0, 1)
    used = {text for segment in whole for found in (parts, places) for text in found.get(segment, {}).values()}
    columns = {text: values for text, values in table.columns.items() if text not in used}
    poses = SegmentPoses(names=tuple(whole), turns=turns, origins=origins)
    return replace(table, columns=columns, poses=poses)
