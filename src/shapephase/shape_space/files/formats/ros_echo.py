"""Tables that `ros2 topic echo --csv` and `rostopic echo -p` print: names of joints stand in the rows."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

_STAMP = 3  # columns of a header: seconds, nanoseconds, frame
_NANO = 1_000_000_000
_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_MATRIX = 36  # entries of a covariance
_LISTED = re.compile(r"(?P<stem>(?:.*[./])?)(?P<kind>name|position|velocity|effort)\[?(?P<number>\d+)\]?")
Columns = list[tuple[str, Any]]


def echoed_columns(columns: Columns) -> tuple[Columns, dict[str, str]]:
    """The columns of messages that `ros2 topic echo --csv` prints without a header; and which were left out, and why.

    A `JointState` is stamp, names, positions, velocities and efforts; a `PoseStamped` stamp, place and quaternion; an
    `Odometry` has a second frame, and covariances behind its pose. Anything else stays as it is.
    """
    values = [entries for _, entries in columns]
    if len(values) <= _STAMP or not _is_stamp(values[0], values[1]):
        return columns, {}
    texts = next((k for k in range(2, len(values)) if values[k].dtype.kind in "fiu" and not _empty(values[k])), 2) - 2
    rest = values[2 + texts :]
    time = ("time [ns]", values[0].astype(np.int64) * _NANO + values[1].astype(np.int64))
    if texts > 1 and len(rest) >= texts - 1 and not _is_pose(rest, texts):
        names = [_constant(entries) for entries in values[_STAMP : 2 + texts]]
        if None in names:
            return columns, {}
        joints = [(str(name), entries) for name, entries in zip(names, rest)]
        others = len(rest) - len(joints)
        left = {"velocities and efforts": f"{others} numbers of each message, left out"} if others else {}
        return [time, *joints], left or {"frame_id": "text"}
    if _is_pose(rest, texts):
        pose = [(f"base_{name}", entries) for name, entries in zip(_POSE, rest)]
        others = len(rest) - len(pose)
        left = {"covariance and velocities": f"{others} numbers of each message, left out"} if others else {}
        return [time, *pose], left or {"frame_id": "text"}
    return columns, {}


def listed_names(columns: Columns) -> tuple[Columns, dict[str, str]]:
    """Columns `position3` beside a column `name3` under that name, as `rostopic echo -p` prints a `JointState`."""
    found = {label: match for label, _ in columns if (match := _LISTED.fullmatch(label)) is not None}
    names = {
        (match["stem"], match["number"]): _constant(values)
        for label, values in columns
        if (match := found.get(label)) is not None and match["kind"] == "name" and values.dtype.kind not in "fiub"
    }
    if not names:
        return columns, {}
    made: Columns = []
    left: dict[str, str] = {}
    for label, values in columns:
        match = found.get(label)
        name = None if match is None else names.get((match["stem"], match["number"]))
        if match is None or name is None:
            made.append((label, values))
        elif match["kind"] == "position":
            made.append((name, values))
        elif match["kind"] != "name":
            left[label] = f"{match['kind']} of {name}"
    return made, left


def _is_stamp(seconds: Any, nano: Any) -> bool:
    whole = seconds.dtype.kind in "iu" and nano.dtype.kind in "iu"
    return bool(whole and len(nano) and nano.min() >= 0 and nano.max() < _NANO and (np.diff(seconds) >= 0).all())


def _is_pose(rest: list[Any], texts: int) -> bool:
    """Whether numbers behind the frames are a place and a quaternion of unit length."""
    if texts > 2 or len(rest) not in (len(_POSE), len(_POSE) + _MATRIX, len(_POSE) + 2 * _MATRIX + 6):
        return False
    lengths = np.linalg.norm(np.stack([np.asarray(entries, dtype=np.float64) for entries in rest[3:7]]), axis=0)
    return bool((np.abs(lengths - 1.0) < 1e-3).all())


def _constant(values: Any) -> str | None:
    """The text that stands in all rows, or None."""
    texts = {str(entry).strip() for entry in values}
    return texts.pop() if len(texts) == 1 else None


def _empty(values: Any) -> bool:
    return values.dtype.kind == "f" and bool(np.isnan(values).all())
