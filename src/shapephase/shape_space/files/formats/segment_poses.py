"""Poses of segments, each in axes of its own, in tables, OpenSim's BodyKinematics and MVNX of inertial suits."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from .... import so3
from ....arrays import Array
from ....body.body import Body
from ....body.formats.bvh_text import BvhFaultError
from ....body.formats.mvnx_text import read_suit
from ....errors import TrajectoryError
from .._segment_links import known_links
from ..labels import LENGTHS, SI, label
from ..recording import NEARLY_UNIT, SegmentPoses, Table

_QUATERNION = re.compile(r"(?P<segment>.+?)(?:_q|_quat_?|\.q|[./]orientation[./])(?P<part>[xyzw])", re.DOTALL)
_PLACE = re.compile(r"(?P<segment>.+?)(?:_[pt]?|_pos_?|\.p?|[./]position[./])(?P<part>[xyz])", re.DOTALL)
_TPOSE = "tpose"  # calibration pose of a suit, arms held out
_NPOSE = "npose"  # calibration pose with hanging arms
_ARM = ("UpperArm", "ForeArm", "Hand")  # names behind the side, from the shoulder on
_KINEMATICS = ("X", "Y", "Z", "Ox", "Oy", "Oz")  # BodyKinematics: centre of mass, intrinsic angles x y z
_OFF_ROTATION = 1e-3  # largest entry of S^T S - 1: files have single precision
_FEWEST = 2  # segments of a table: one alone is the base
_WHOLE_BODY = "center_of_mass"  # BodyKinematics' last columns, without angles


def read_mvnx(where: Path, data: bytes) -> Table:
    """The poses of a suit's segments, and its calibration poses; the room's z axis is up."""
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
    """
    bodies = [name.removesuffix("_Ox") for name in table.columns if name.endswith("_Ox")]
    labels = {body: [f"{body}_{axis}" for axis in _KINEMATICS] for body in bodies}
    if not bodies or any(name not in table.columns for names in labels.values() for name in names):
        return table
    if "pos" not in kind.lower() and "_pos" not in Path(table.where).name.lower():
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

    metre : size of the unit of lengths [m]; None: unknown
    """
    turns, origins = matrices[:3, :3].transpose(3, 2, 0, 1).copy(), matrices[:3, 3].transpose(2, 1, 0)
    off = np.abs(so3.transpose(turns) @ turns - np.eye(3)).max(axis=(2, 3))
    seen = off < _OFF_ROTATION
    turns[~seen] = np.nan
    turns[seen] = so3.orthonormalised(turns[seen])
    origins = np.where(seen[..., None], origins, np.nan) * (1.0 if metre is None else metre)
    return SegmentPoses(names=names, turns=turns, origins=origins, in_metres=metre is not None)


def pose_columns(table: Table, names: Mapping[str, str | None], body: Body) -> Table:
    """The table with its columns `SEGMENT_qw`, `_qx`, `_qy`, `_qz` and `_x`, `_y`, `_z` as poses of segments.

    One segment alone is the base, and stays as it is; so do, beside columns of joints, quaternions that are not of two
    links.
    """
    parts: dict[str, dict[str, str]] = {}
    places: dict[str, dict[str, str]] = {}
    for text in table.columns:
        if names.get(text, text) is None:
            continue
        for pattern, by_segment in ((_QUATERNION, parts), (_PLACE, places)):
            match = pattern.fullmatch(label(text).name)
            if match is not None:
                by_segment.setdefault(match["segment"], {})[match["part"]] = text
                break
    segments = [segment for segment, by_segment in parts.items() if len(by_segment) == len("xyzw")]
    links = {*known_links(body, segments), *(names.keys() & set(segments))}
    of_joints = any(label(text).name in body.joint_names for text in table.columns)
    if len(segments) < _FEWEST or (of_joints and len(links) < _FEWEST):
        return table
    placed = [segment for segment in segments if len(places.get(segment, {})) == len("xyz")]
    for segment in segments:
        if placed and segment not in placed and names.get(segment, segment) is not None:
            raise TrajectoryError(
                f"{table.where}: segment {segment!r} has no columns {segment}_x, {segment}_y, {segment}_z, and others "
                f"have places; add them, or leave the segment out with names={{{segment!r}: None}} (--names {segment}=)"
            )
    used = {text for segment in segments for each in (parts, places) for text in each.get(segment, {}).values()}
    for text in used:
        if any(cell.strip().lower() not in ("", "nan") for cell in table.faults.get(text, {}).values()):
            table.check_column(text)
    numbers = np.stack([[table.columns[parts[name][part]] for name in segments] for part in "xyzw"], axis=-1)
    numbers = numbers.transpose(1, 0, 2)
    lengths = np.linalg.norm(numbers, axis=-1)
    wrong = np.argwhere(np.abs(lengths - 1.0) > NEARLY_UNIT)
    if len(wrong):
        row, segment = wrong[0]
        raise TrajectoryError(
            f"{table.where}: {table.row} {table.rows[row]}: the quaternion of {segments[segment]!r} has the length "
            f"{lengths[row, segment]:.6g}, and 1 is needed; correct it, or leave the segment out (--names "
            f"{segments[segment]}=)"
        )
    turns = np.full((*lengths.shape, 3, 3), np.nan)
    known = np.isfinite(lengths)
    turns[known] = so3.matrix_from_quat(so3.normalised(numbers[known]))
    origins = np.full((len(table.rows), len(segments), 3), np.nan)
    for k, segment in enumerate(segments if placed else ()):
        for axis, text in places.get(segment, {}).items():
            unit = table.units.get(text) or label(text).unit or "m"
            if unit not in LENGTHS and unit != SI:
                raise TrajectoryError(
                    f"{table.where}: column {text!r} is in {unit}, and a place is in {', '.join(LENGTHS)}; leave it "
                    f"out with names={{{text!r}: None}} (--names {text}=), or write its unit"
                )
            origins[:, k, "xyz".index(axis)] = LENGTHS.get(unit, 1.0) * table.columns[text]
    poses = SegmentPoses(names=tuple(segments), turns=turns, origins=origins if placed else None)
    columns = {text: values for text, values in table.columns.items() if text not in used}
    return replace(table, columns=columns, poses=poses)
