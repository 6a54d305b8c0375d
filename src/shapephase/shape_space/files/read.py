"""Recorded and stored joint motions: files of many kinds, joints matched by name."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_object
from ...arrays import Array, finite_array
from ...body.body import Body
from ...errors import InputFileNotFoundError, ShapeError, TrajectoryError, unknown_name
from ...files import write_whole
from ..shape_path import ShapePath
from ._joint_columns import matched
from ._motion_arrays import read_arrays
from ._motion_tables import read_delimited, read_opensim
from ._recording import Recording, digest
from ._ros_motion_files import read_bag, read_ros_yaml
from .smoothing import smoothed_path

_WRITTEN = (".csv", ".npz", ".tsv")
_TABLES = {".csv": read_delimited, ".tsv": read_delimited, ".mot": read_opensim, ".sto": read_opensim}
_ARRAYS = (".npz", ".npy")
_YAML = (".yaml", ".yml")
_BAGS = (".bag", ".mcap", ".db3")


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """A joint motion as it was recorded, and the path made of it.

    Attributes
    ----------
    path : the joints of the body, in its order; it carries the SHA-256 of the file
    residual : (n,) rms of the samples minus the path [rad or m]; zero without smoothing
    times : (N,) of the samples, from 0 [s]
    base_attitude : (N, 3, 3) recorded attitude of the base, base axes to the recorder's axes, or None
    base_position : (N, 3) recorded position of the base [m], or None
    format : the kind of file
    """

    path: ShapePath
    residual: Array
    times: Array
    base_attitude: Array | None
    base_position: Array | None
    format: str


def read_recorded_motion(
    file: str | os.PathLike[str],
    body: Body,
    *,
    names: Mapping[str, str | None] | None = None,
    smooth: float | Mapping[str, float] | None = None,
    periodic: bool | None = None,
    degrees: bool | None = None,
    topic: str | None = None,
    timestep: float | None = None,
) -> RecordedMotion:
    """Read a recorded motion: the joints, and the base where it was recorded.

    By the file's ending:

    - `.csv`, `.tsv`: the header `time,<joint names>` in any order, `_deg` behind a name for degrees, separated by
      commas, tabs or semicolons; the base as `qx,qy,qz,qw` and `base_x_m,base_y_m,base_z_m`.
    - `.npz`: `time` (N,), `shapes` (N, n), `joint_names` (n,); the base as `base_quat_xyzw` (N, 4), `base_position`
      (N, 3).
    - `.mot`, `.sto`: OpenSim; its header says whether turning coordinates are in degrees.
    - `.yaml`: ROS, a `JointTrajectory`, also inside a goal, or `JointState` messages one after the other.
    - `.bag`, `.mcap`, `.db3`, a rosbag2 folder: messages of these two types. A trajectory's velocities are not used.
    - `.npz` with `qpos` and `time` or `timestep`, or `.npy` with the argument `timestep`: MuJoCo. With a free joint,
      the first seven columns are x y z and the quaternion w x y z; then one column for each joint, by the array
      `joint_names` or, without it, **in the order of `body.joint_names`**, which a MuJoCo model may not have.

    Every joint of the body must be there; times are in seconds. Angles are taken as written: a joint that turns
    without end is not unwrapped.

    Parameters
    ----------
    names : name in the file -> name of the joint; None instead of a joint leaves the column out
    smooth : noise level of the samples, rms [rad or m], one for all joints or by joint (the others are interpolated);
        None: the path goes through all samples. See `smoothing.smoothed_path`.
    periodic : smooth where the end meets the start; None: when the last sample equals the first to 1e-9
    degrees : whether turning joints are in degrees, above what the file says; None: as the file says
    topic : of a bag with more than one motion
    timestep : of a `qpos` file without times [s]

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    UnknownNameError
        If a column is no joint of the body, or the file's ending is unknown.
    TrajectoryError
        For any other fault of the file; row and column or joint are named.
    MissingExtraError
        For a ROS file without the extra `ros`.

    Warns
    -----
    TrajectoryWarning
        For what can be read and is probably not meant: limits left, gaps, jumps of a whole turn.
    """
    check_object(body, "Body", "body")
    where = Path(file)
    recording = _read(where, body, topic, timestep)
    motion = matched(recording, body, names, degrees)
    try:
        noise = _noise_levels(smooth, body)
        path, residual = smoothed_path(recording.times, motion.shapes, noise, periodic, body.joint_names)
    except (TrajectoryError, ShapeError) as error:
        raise TrajectoryError(f"{where}: {error}") from None
    if smooth is None:
        residual = np.zeros(body.n_shape)
    path = replace(path, sha256=digest(where))
    return RecordedMotion(path, residual, recording.times, motion.base_attitude, motion.base_position, recording.format)


def read_shape_path(
    file: str | os.PathLike[str],
    body: Body,
    *,
    names: Mapping[str, str | None] | None = None,
    smooth: float | Mapping[str, float] | None = None,
    periodic: bool | None = None,
    degrees: bool | None = None,
    topic: str | None = None,
    timestep: float | None = None,
) -> ShapePath:
    """The path of `read_recorded_motion`: a C2 spline, periodic where the last sample equals the first.

    Kinds of file, parameters and errors as there.
    """
    check_object(body, "Body", "body")
    motion = read_recorded_motion(
        file, body, names=names, smooth=smooth, periodic=periodic, degrees=degrees, topic=topic, timestep=timestep
    )
    return motion.path


def write_shape_path(path: ShapePath, file: str | os.PathLike[str], times: ArrayLike | None = None) -> None:
    """Write a joint motion as CSV, TSV or NPZ, by the file's ending; what `read_shape_path` reads.

    Parameters
    ----------
    times : (N,) of the samples [s]; None: `path.sample_times`. A spline is read back as it was.

    Raises
    ------
    TrajectoryError
        If the path has no joint names.
    UnknownNameError
        For an unknown ending of the file.
    """
    check_object(path, "ShapePath", "path")
    where = Path(file)
    suffix = where.suffix.lower()
    if suffix not in _WRITTEN:
        raise unknown_name(f"ending of the motion file {where}:", where.suffix, _WRITTEN)
    if path.joint_names is None:
        raise TrajectoryError("a motion file names its joints, and this path has no joint names; make it with them")
    t = path.sample_times if times is None else finite_array(times, "times", (None,), unit="s")
    shapes = path.shape(t)
    if suffix == ".npz":
        arrays = {"time": t, "shapes": shapes, "joint_names": np.array(path.joint_names)}
        write_whole(where, lambda stream: np.savez(stream, **arrays))
        return
    text = io.StringIO()
    writer = csv.writer(text, delimiter="\t" if suffix == ".tsv" else ",", lineterminator="\n")
    writer.writerow(["time", *path.joint_names])
    writer.writerows([[repr(float(v)) for v in row] for row in np.column_stack([t, shapes])])
    write_whole(where, lambda stream: stream.write(text.getvalue().encode()))


def _read(where: Path, body: Body, topic: str | None, timestep: float | None) -> Recording:
    suffix = where.suffix.lower()
    bag = suffix in _BAGS or os.path.isdir(where)
    if not bag and suffix not in (*_TABLES, *_ARRAYS, *_YAML):
        kinds = (".csv", ".npz", *_TABLES, *_ARRAYS, *_YAML, *_BAGS)
        raise unknown_name(f"ending of the motion file {where}:", where.suffix, dict.fromkeys(kinds))
    if not os.path.exists(where):
        raise InputFileNotFoundError(f"{where}: there is no such file")
    if topic is not None and not bag:
        raise TrajectoryError(f"{where}: topic={topic!r} is for bags; this file has no topics")
    if timestep is not None and suffix not in _ARRAYS:
        raise TrajectoryError(f"{where}: timestep is for MuJoCo's qpos without times; this file has its times")
    if bag:
        return read_bag(where, topic)
    if suffix in _YAML:
        return read_ros_yaml(where)
    return read_arrays(where, body.joint_names, timestep) if suffix in _ARRAYS else _TABLES[suffix](where)


def _noise_levels(smooth: float | Mapping[str, float] | None, body: Body) -> Array:
    """The noise of each joint: (n,) [rad or m]."""
    given = dict.fromkeys(body.joint_names, 0.0)
    if isinstance(smooth, Mapping):
        for name in smooth:
            body.joint_index(name)
        given.update(smooth)
    elif smooth is not None:
        given = dict.fromkeys(body.joint_names, smooth)
    levels = [finite_array(level, f"smooth, joint {name}") for name, level in given.items()]
    for level, name in zip(levels, given, strict=True):
        if level.ndim or level < 0.0:
            raise TrajectoryError(f"smooth, joint {name}: a noise level is a number, zero or above, got {level}")
    return np.array(levels).reshape(body.n_shape)
