"""Motions of DeepMimic's humanoid, in JSON."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from ....arrays import Array
from ....errors import TrajectoryError
from ..recording import Table, warn

_JOINTS = (  # in the order of a frame: four numbers w x y z of a ball joint, one of a hinge
    *(("chest", 4), ("neck", 4), ("right_hip", 4), ("right_knee", 1), ("right_ankle", 4), ("right_shoulder", 4)),
    *(("right_elbow", 1), ("left_hip", 4), ("left_knee", 1), ("left_ankle", 4), ("left_shoulder", 4)),
    ("left_elbow", 1),
)
_BASE = 8  # numbers before the joints: duration, place and quaternion w x y z of the base
_WIDTH = _BASE + sum(count for _, count in _JOINTS)
_OFF_UNIT = 0.01  # error of a quaternion's length beyond rounding
_LEAST_LENGTH = 1e-6


def read_deepmimic(where: Path, data: bytes) -> Table:
    """Motion in JSON, `{"Loop": "wrap", "Frames": [[duration, x, y, z, qw, qx, qy, qz, joints...], ...]}`, y upwards.

    Columns are called as DeepMimic's joints are, with `.x`, `.y`, `.z`, `.w` of spherical ones: the body has ball
    joints of these names. Quaternions are made as long as 1, as DeepMimic does it (`cKinTree::PostProcessPose`): its
    own files have some of other lengths.
    """
    try:
        motion = json.loads(data)
        frames = np.array(motion["Frames"], dtype=np.float64)
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise TrajectoryError(
            f"{where}: no motion of DeepMimic ({type(error).__name__}: {error!s:.100}); an object with Frames, lists "
            f"of {_WIDTH} numbers, is needed; write other motions as a table with names in its header"
        ) from None
    if frames.ndim != 2 or frames.shape[1] != _WIDTH or not np.isfinite(frames).all():
        listed = ", ".join(f"{name} {count}" for name, count in _JOINTS)
        raise TrajectoryError(
            f"{where}: Frames has shape {frames.shape}; DeepMimic's humanoid has {_WIDTH} finite numbers: duration, x, "
            f"y, z, quaternion w x y z, {listed}. Write motions of other bodies as a table with names in its header"
        )
    durations = frames[:-1, 0]
    if np.any(durations <= 0.0):
        raise TrajectoryError(f"{where}: frame {int(np.argmax(durations <= 0.0))} lasts {durations.min():g} s; mend it")
    frames = _with_unit_quaternions(frames, where)
    columns: dict[str, Array] = {}
    first = _BASE
    for name, count in _JOINTS:
        labels = [name] if count == 1 else [f"{name}.{part}" for part in "wxyz"]
        columns |= {label: np.ascontiguousarray(frames[:, first + k]) for k, label in enumerate(labels)}
        first += count
    return Table(
        where=str(where),
        format="DeepMimic",
        columns=columns,
        rows=range(len(frames)),
        row="frame",
        times=np.concatenate([[0.0], np.cumsum(durations)]),
        by_format=True,
        base_quat_xyzw=frames[:, [*range(5, _BASE), 4]],
        base_position=frames[:, 1:4],
        up="y",
    )


def _with_unit_quaternions(frames: Array, where: Path) -> Array:
    """Frames (N, 44) whose quaternions have length 1. Warns of the farthest from it; TrajectoryError for zeros."""
    frames, first, worst = frames.copy(), _BASE - 4, (_OFF_UNIT, "")
    for name, count in (("the base", 4), *_JOINTS):
        if count == 4:
            quaternions = frames[:, first : first + count]
            lengths = np.linalg.norm(quaternions, axis=1)
            off = np.abs(lengths - 1.0)
            frame = int(np.argmax(off))
            place = f"{where}: frame {frame}: the quaternion of {name} has the length {lengths[frame]:.4g}"
            if lengths.min() < _LEAST_LENGTH:
                raise TrajectoryError(f"{place}, and another is zero; leave that frame out")
            worst = max(worst, (float(off[frame]), place))
            quaternions /= lengths[:, None]
        first += count
    if worst[1]:
        warn(f"{worst[1]}; all are divided by their lengths, as DeepMimic does")
    return frames
