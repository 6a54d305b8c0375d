"""Recorded and stored joint motions: files of many kinds, joints matched by name."""

from __future__ import annotations

import csv
import io
import json
import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_choice, check_file_name, check_object, check_text, made_by, positive_argument
from ...arrays import Array, finite_array
from ...body.body import Body
from ...body.joint_orders import WORDS
from ...display import short_repr
from ...errors import ShapeError, TrajectoryError, TrajectoryWarning, unknown_name
from ...files import output_target, write_whole
from ...letters import what_came
from ...provenance import provenance
from ..path_series import spline_error
from ..shape_path import ShapePath
from ._gaps import fill_argument
from ._joint_columns import JointChoices, Matched, matched
from ._sample_origins import resampled
from ._sample_steps import evenly_spaced, low_passed, warn_of_fast_turns, without_first_pose
from ._segment_links import SegmentChoices
from ._segment_poses import SegmentMotion, without_segments
from ._surroundings import surrounded
from ._swings import check_swings
from ._unit_doubts import doubtful_turns
from .base_columns import base_choices
from .closing import Closing, close_argument, closed_path
from .flight import Flight, flight_choices, in_flight
from .inputs import read_input
from .labels import SI, amounts, mapping_argument
from .mapping_files import read_names
from .recording import LONGEST_NAME, Recording, Table
from .smoothing import Recorded, Smoothing, is_even, prepared_path
from .times import doubtful_steps, recording_of, trim_argument

_WRITTEN = (".csv", ".npz", ".tsv")
_MOST_SHOWN = 200
"""Columns that an error about an unknown one lists."""
_FAR_OFF = 1e-3
"""[rad or m] by which a table at times that were given may miss a path between its rows without a warning."""
_MOST_SAMPLES = 2_000_000
"""Memory: samples of a path that is resampled, as lines of a table."""


@made_by(ShapePath="it is recorded.path")
@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """A joint motion as it was recorded, and the path made of it.

    Attributes
    ----------
    path : the joints of the body, in its order; it carries the SHA-256 of the file
    residual : (n,) rms of the samples minus the path [rad or m]; zero where it goes through all of them
    times : (N,) of the samples, from 0 [s]
    base_attitude : (N, 3, 3) recorded attitude of the base, base axes to the recorder's axes, or None
    base_position : (N, 3) recorded position of the base [m], or None
    format : the kind of file
    record : what was read and what was done to it, as JSON can hold it: the file with its hash, samples and times,
        columns and units of joints, where the others rest, what was left out, smoothed, closed, resampled
    smoothing : what smoothing did, with its penalty, degrees of freedom and bias; None: it was not smoothed
    closing : how a cycle was closed, and what that changed; None: it was not
    flight : the free flight that was kept; None: nobody asked for one
    segments : angular momentum from poses of segments beside that of base and joints; None: the file has no such poses

    Examples
    --------
    >>> sp.write_shape_path(sp.examples.cat_righting(), "cat.csv")
    >>> recorded = sp.read_recorded_motion("cat.csv", sp.load_body("cat"))
    >>> print(recorded.format, recorded.times[-1])
    CSV 2.0
    """

    path: ShapePath
    residual: Array
    times: Array
    base_attitude: Array | None
    base_position: Array | None
    format: str
    record: Mapping[str, Any]
    smoothing: Smoothing | None = None
    closing: Closing | None = None
    flight: Flight | None = None
    segments: SegmentMotion | None = None

    __repr__ = short_repr


def read_recorded_motion(
    file: Any,
    body: Body,
    *,
    names: Mapping[str, str | None] | Sequence[str] | str | os.PathLike[str] | None = None,
    degrees: bool | None = None,
    time_unit: str | None = None,
    timestep: float | None = None,
    topic: str | None = None,
    joint_order: str | None = None,
    rest: Mapping[str, float | str] | None = None,
    rest_missing: bool = False,
    ignore_extra: bool = False,
    trim: tuple[float, float] | None = None,
    resample: float | None = None,
    fill: float | str | None = None,
    smooth: float | str | Mapping[str, float | str] | None = None,
    smooth_penalty: float | None = None,
    lowpass: float | None = None,
    close: float | str | bool | None = None,
    close_by: str | None = None,
    base_order: str | None = None,
    base_axes: ArrayLike | str | None = None,
    flight: str | Sequence[float] | None = None,
    up: str | None = None,
    gravity: float | str | None = None,
    calibration: float | str | None = None,
    length_tolerance: float | None = None,
) -> RecordedMotion:
    """Read a recorded motion: the joints, and the base where it was recorded.

    By the file's ending:

    - `.csv`, `.tsv`, `.txt`: a header `time,<joint names>` in any order, separated by commas, tabs or semicolons;
      decimal points or decimal commas. Comments behind `#` may stand above it.
    - `.xlsx`: such a table in a sheet of Excel. `.parquet`: such a table, also of pandas.
    - `.mot`, `.sto`: OpenSim; its header says whether turning coordinates are in degrees. Locked coordinates and
      coupled ones that are no joints of the body are left out.
    - `.mat`, `.h5`: vectors `time` and one for each joint, or a matrix `shapes` beside `joint_names`; on top or in a
      structure.
    - `.bvh`: the bones' turns, for the body that `load_body` makes of such a file. A first frame with all angles at
      zero, from which a joint goes over five times as far as in any step of the next second, is left out.
    - `.c3d`: the angles that a model computed, `LKneeAngles_x` and so on, or poses of segments in its group ROTATION;
      no markers.
    - `.mvnx`: the poses of a suit's segments.
    - `.npz`: `time` (N,), `shapes` (N, n), `joint_names` (n,); the base as `base_quat_xyzw` (N, 4), `base_position`
      (N, 3).
    - `.yaml`: ROS, a `JointTrajectory`, also inside a goal, or `JointState` messages one after the other.
    - `.bag`, `.mcap`, `.db3`, a rosbag2 folder: messages of these two types. A trajectory's velocities are not used.
    - `.npz` with `qpos` and `time` or `timestep`, or `.npy` with the argument `timestep`: MuJoCo. With a free joint,
      the first seven columns are x y z and the quaternion w x y z; then one column for each joint, by the array
      `joint_names` or, without it, in the order in which MuJoCo compiles the body's file, or the one of `joint_order`.
    - `.npz` with `q`: Pinocchio's (N, 7 + n), place, quaternion x y z w, joints, or Drake's, quaternion w x y z, place,
      joints, whichever has quaternions of length one; of a bioMod, or as `Q`, the coordinates of biorbd and bioptim,
      those of the root first. These and `qpos` may be transposed, and columns `q_0`, `q[1]`, ... of a table.
    - `.npz` with `joint_pos`, `body_pos_w`, `body_quat_w`, `body_ang_vel_w` and `fps`: Isaac Lab. Without `joint_names`
      the order is the one in which the links lie and turn as the bodies do.
    - `.json`: DeepMimic's humanoid, for a body with ball joints and hinges of the same names.

    The base in columns: `base_qx,base_qy,base_qz,base_qw` (or `qx` and so on), `base_roll,base_pitch,base_yaw` or
    OpenSim's `pelvis_tilt,pelvis_list,pelvis_rotation`; and `base_x,base_y,base_z` or `pelvis_tx,pelvis_ty,pelvis_tz`.

    Poses of segments, also in columns `SEGMENT_qx,SEGMENT_qy,SEGMENT_qz,SEGMENT_qw` and `SEGMENT_x,SEGMENT_y,SEGMENT_z`
    of a table, and OpenSim's BodyKinematics: segments are links by their names, ball joints take the turn between them,
    hinges the nearest turn about their axes. Distances between joints are compared with those of the body.

    Units stand in the labels, as `knee [deg]`, `knee (deg)`, `knee_deg`, `boom [mm]`, `Time [ms]`, or in a row of
    units below them. Without, times are in seconds, angles in radians and lengths in metres; where they look like
    milliseconds, degrees or millimetres, this is an error that says how to tell. Angles are taken as written: a
    joint that turns without end is not unwrapped.

    Parameters
    ----------
    file : name of a file, "-" for standard input, a pandas `DataFrame`, a `Dataset` or `DataArray` of xarray, a mapping
        of arrays by name as an NPZ file has them, or (times (N,), array (N, m), names (m,))
    names : name in the file -> name of the joint, also with a unit as `"boom [mm]"`, or "time", or of the link that a
        segment is; None instead leaves the column or segment out; or the name of a file with them, see `read_names`;
        or a sequence of names, one for each column of a table without a header
    degrees : whether turning joints are in degrees, above what the file says; None: as the file says
    time_unit : of the times: "s", "ms", "us", "ns" or "min"; None: as the file says
    timestep : between samples, for a file without times [s]
    topic : which part of a file with more than one motion: topic of a bag, sheet of a workbook, structure of a `.mat`
    joint_order : of joints in `qpos` or `joint_pos` without names: "mujoco" (depth first, joints of one link as the
        body's URDF lists them; of an MJCF its own), "isaac" (breadth first), "isaac-by-name" (the same, joints of one
        link by their names), "body" (`body.joint_names`); None: by `body_pos_w` where the file has it, else "mujoco"
    rest : joint -> value [rad or m], or a text as "30deg" or "5 mm", for joints without a column
    rest_missing : whether all other joints without a column rest at zero, or at their limit next to it
    ignore_extra : whether columns that are no joints are left out
    trim : the first and the last time to be kept, as the file tells the time (its unit, its start); what is smoothed is
        smoothed before it is cut
    resample : the path goes through this many of its own values a second instead, evenly spaced [1/s]
    fill : empty cells and NaN are gaps, and an error; this bridges those of up to so many seconds from the last number
        before to the first one after, a number or a text as "0.1s" or "100ms": joints and places by a cubic spline
        through the other samples, attitudes and ball joints by SciPy's `RotationSpline`. The parts of a quaternion, of
        three angles and of a place have their gaps together; gaps at the start and the end are cut off
    smooth : noise level of the samples, rms, a number [rad or m] or a text as "0.3deg" or "0.3deg,1mm", one for all
        joints or by joint (the others are interpolated); None: the path goes through all samples. See
        `smoothing.smoothed_path`.
    smooth_penalty : instead of the penalties that follow from the noise [s^5]
    lowpass : in place of `smooth`, the cut-off [Hz] of a Butterworth filter of second order run forwards and backwards
        over the whole recording, before a stretch or a flight is cut out of it: joints, places and rotations. Both
        passes together leave 1/sqrt(2) of what swings with the cut-off. Noise is estimated by what is above twice the
        cut-off, as white; error bars hold what passes of it. Samples that are not evenly spaced are put on even times
        by `resample` first
    close : the largest gap between the ends of a cycle that is closed, a number [rad or m] or a text as "3deg" or
        "3deg,5mm"; None: what meets to 1e-9 runs smoothly from its end to its start, else the ends stay apart; False:
        they are not joined even then
    close_by : "smooth", a smoother that runs on from the end to the start (where `smooth` is given, else "drift");
        "drift", the gap is taken off evenly in time; "geodesic", the shortest way back in the metric of the kinetic
        energy is put at the end
    base_order : of roll, pitch and yaw, or tilt, list and rotation: the axes in the order in which these turn, each
        as the turns before have left it; None: "zyx" (URDF) and "zxy" (OpenSim)
    base_axes : the axes of the base in those whose attitude was recorded: a rotation (3, 3), base axes to those, or a
        text such as "x,-z,y", where the x, y and z axis of the base point to; "estimate" leaves them open, for
        `momentum_from_recording` to find; None: the same axes, but "x,-z,y" for `pelvis_tilt` and so on (OpenSim: x
        forward, y up; URDF: x forward, z up)
    flight : what is kept is a free flight: "auto", the longest stretch on which the centre of mass falls freely;
        "auto:2", the second of all such stretches in time; its first and last time, as the file tells the time; "all";
        "recorded": as "auto" where the attitude of the base is recorded, all of it where its places are not recorded or
        do not fall, and what is kept may be anything where nothing of the base is recorded; None: what is kept may be
        anything
    up : the recorder's axis that points up: "x", "y", "z", "-x", "-y" or "-z"; None: that of the format (OpenSim y,
        MuJoCo and ROS z), else x, y or z, whichever has the longest fall
    gravity : by which the body falls in a flight [m/s^2]; None: 9.81; "any": units are not doubted
    calibration : how the axes of segments become those of links: a time, as the file tells it, at which the body
        stands in its zero pose, turned as the joints lie, or as the room where they do not tell it; the name of such a
        pose in the file, as "tpose"; "links", these are the axes of the links; None: an MVNX file's own pose, or
        "links" for the body of the file that the segments are from
    length_tolerance : share by which distances between joints may differ from the body's, on average; None: 0.1

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    UnknownNameError
        If a column is no joint of the body, or the file's ending is unknown.
    TrajectoryError
        For any other fault of the file; row and column or joint are named. For a unit that can only be guessed; for a
        flight that falls by another acceleration than gravity, by more than a tenth of it and three error bars of its
        own (with 1 cm of wander of the centre of mass), with the slips of units of length or frame rates that fit.
    MissingExtraError
        For ROS, `.xlsx`, `.parquet`, `.c3d`, MATLAB, HDF5 without the extra `data`.

    Warns
    -----
    TrajectoryWarning
        For what can be read and is probably not meant: limits left, gaps, jumps of a whole turn, a first sample that is
        far from the second, ball joints that turn by over a third of a turn from one sample to the next.

    Examples
    --------
    >>> sp.write_shape_path(sp.examples.cat_righting(), "cat.csv")
    >>> recorded = sp.read_recorded_motion("cat.csv", sp.load_body("cat"))
    >>> print(recorded.path.duration, recorded.residual.max())
    2.0 0.0
    """
    check_object(body, "Body", "body")
    kept, flying = trim_argument(trim), flight_choices(flight, up, gravity)
    base = base_choices(base_order, base_axes)
    within = close_argument(close)
    rate = None if resample is None else positive_argument(resample, "resample", "a number of samples a second")
    if joint_order is not None:
        check_choice(joint_order, "joint_order", WORDS)
    cut_off = None if lowpass is None else positive_argument(lowpass, "lowpass", "a frequency in Hz")
    if cut_off is not None and not (smooth is None and smooth_penalty is None):
        raise TrajectoryError(
            "lowpass and smooth are two ways to do one thing; leave one of them out (lowpass, --lowpass; smooth, "
            "--smooth; smooth_penalty, --smooth-penalty)"
        )
    said = _names_argument(names)
    given, step = read_input(file, body, topic, timestep, joint_order, said)
    segments = SegmentChoices(names=said or {}, calibration=calibration, length_tolerance=length_tolerance)
    table, said = without_segments(given.table, body, segments, time_unit, step)
    if joint_order is not None and table.nameless is None:
        raise TrajectoryError(
            f"{table.where}: joint_order is for arrays without names; columns here have names: leave it "
            "out (--joint-order)"
        )
    if isinstance(names, Sequence) and not isinstance(names, str) and said and not set(said) & set(table.columns):
        listed = ", ".join(list(table.columns)[:_MOST_SHOWN])
        raise TrajectoryError(
            f"{table.where}: a list of names is for a table without a header, and this one reads {listed}; give a "
            "mapping: names={column: joint} (--names COLUMN=JOINT)"
        )
    mapping = _mapping(said, table)
    recording = recording_of(table, body.joint_names, mapping, time_unit, step, kept)
    choices = JointChoices(
        names=mapping,
        base=base,
        degrees=degrees,
        rest=rest,
        rest_missing=rest_missing,
        ignore_extra=ignore_extra,
        fill=fill_argument(fill),
    )
    recording, motion = matched(recording, body, choices)
    recording, motion = without_first_pose(recording, motion, body)
    warn_of_fast_turns(recording, motion, body)
    recording, motion, free = in_flight(recording, motion, body, flying)
    try:
        noise = _noise_levels(smooth, body)
        part, around, inside = recording, motion, slice(None)
        if (noise.any() or cut_off is not None) and (kept is not None or free is not None):
            part, around, inside = surrounded(
                recording,
                motion,
                lambda: recording_of(table, body.joint_names, mapping, time_unit, step, None),
                lambda some: without_first_pose(*matched(some, body, choices), body),
                choices.fill,
            )
        at, uneven = part.times, cut_off is not None and not is_even(part.times)
        if cut_off is not None:
            if rate is not None and uneven:
                at, around, inside = evenly_spaced(at, around, inside, rate)
            around = low_passed(at, around, cut_off)
        motion, times = around.kept(np.arange(len(at))[inside]), at[inside] - at[inside][0]
        samples = Recorded(at, around.shapes, noise, body.joint_names, inside, cut_off)
        path, smoothing, closing = _path(samples, body, within, close_by, loop=close is None, penalty=smooth_penalty)
        check_swings(path, body)
    except (TrajectoryError, ShapeError) as error:
        raise TrajectoryError(f"{table.where}: {error}") from None
    if rate is not None and not uneven:
        path = _resampled(path, rate, table.where)
    residual = np.zeros(body.n_shape)
    if samples.smoothed or rate is not None or closing is not None:
        residual = np.sqrt(np.mean((motion.shapes - path.shape(times)) ** 2, axis=0))
    record = {
        "file": given.name,
        "sha256": given.sha256,
        "samples_in_file": len(table.rows),
        "trim": kept,
        **_record(recording, motion),
        "smooth": dict(zip(body.joint_names, noise.tolist(), strict=True)) if noise.any() else None,
        "lowpass": None if cut_off is None else _low_pass_record(smoothing, body),
        "smoothing": _smoothing_record(smoothing, body) if noise.any() else None,
        "closing": None if closing is None else _closing_record(closing, body),
        "flight": None if free is None else free.record,
        "resampled_to_hz": None if rate is None else (len(path.breaks) - 1) / path.duration,
    }
    path = replace(path, sha256=given.sha256, record=record)
    return RecordedMotion(
        path=path,
        residual=residual,
        times=times,
        base_attitude=motion.base.attitude,
        base_position=motion.base.position,
        format=table.format,
        record=record,
        smoothing=smoothing if samples.smoothed else None,
        closing=closing,
        flight=free,
        segments=table.segments,
    )


def read_shape_path(
    file: Any,
    body: Body,
    *,
    names: Mapping[str, str | None] | Sequence[str] | str | os.PathLike[str] | None = None,
    degrees: bool | None = None,
    time_unit: str | None = None,
    timestep: float | None = None,
    topic: str | None = None,
    joint_order: str | None = None,
    rest: Mapping[str, float | str] | None = None,
    rest_missing: bool = False,
    ignore_extra: bool = False,
    trim: tuple[float, float] | None = None,
    resample: float | None = None,
    fill: float | str | None = None,
    smooth: float | str | Mapping[str, float | str] | None = None,
    smooth_penalty: float | None = None,
    lowpass: float | None = None,
    close: float | str | bool | None = None,
    close_by: str | None = None,
    base_order: str | None = None,
    base_axes: ArrayLike | str | None = None,
    flight: str | Sequence[float] | None = None,
    up: str | None = None,
    gravity: float | str | None = None,
    calibration: float | str | None = None,
    length_tolerance: float | None = None,
) -> ShapePath:
    """The path of `read_recorded_motion`: a C2 spline, periodic where the last sample equals the first.

    Kinds of file, parameters and errors as there.

    Examples
    --------
    >>> rows = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.3, 0.0], [2.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0]]
    >>> header = "time,waist_roll,waist_pitch,waist_yaw"
    >>> np.savetxt("bend.csv", rows, delimiter=",", header=header, comments="")
    >>> path = sp.read_shape_path("bend.csv", sp.load_body("cat_two_halves"))
    >>> path.duration, path.joint_names, path.shape(1.0).round(9).tolist()
    (3.0, ('waist_pitch', 'waist_yaw', 'waist_roll'), [0.3, 0.0, 0.0])
    """
    return read_recorded_motion(
        file,
        body,
        names=names,
        degrees=degrees,
        time_unit=time_unit,
        timestep=timestep,
        topic=topic,
        joint_order=joint_order,
        rest=rest,
        rest_missing=rest_missing,
        ignore_extra=ignore_extra,
        trim=trim,
        resample=resample,
        fill=fill,
        smooth=smooth,
        smooth_penalty=smooth_penalty,
        lowpass=lowpass,
        close=close,
        close_by=close_by,
        base_order=base_order,
        base_axes=base_axes,
        flight=flight,
        up=up,
        gravity=gravity,
        calibration=calibration,
        length_tolerance=length_tolerance,
    ).path


def write_shape_path(
    path: ShapePath, file: str | os.PathLike[str], times: ArrayLike | None = None, *, comment: str | None = None
) -> None:
    """Write a joint motion as CSV, TSV or NPZ, by the file's ending; what `read_shape_path` reads.

    A pipe or a device without such an ending gets CSV.

    Parameters
    ----------
    times : (N,) of the samples, ascending [s]; None: `path.sample_times`, so that what is read back is the path to 1e-9
        rad or m (of its largest value where that is above 1), a spline as it was
    comment : what stands above the table, each of its lines behind `#`; in NPZ, in the provenance

    Labels of a table say a unit, `[s]` or `[SI]` (rad or m), where `read_shape_path` would ask for it: of times more
    than a second apart, and of joints that turn more than two times.

    Raises
    ------
    TrajectoryError
        If the path has no joint names, times do not ascend, or a table of the path takes more than a million rows.
    UnknownNameError
        For an unknown ending of the file.

    Warns
    -----
    TrajectoryWarning
        If the times given are so few that what is read back is more than 0.001 rad or m from the path.

    Examples
    --------
    >>> sp.write_shape_path(sp.examples.cat_righting(), "cat.csv")
    >>> print(sp.read_shape_path("cat.csv", sp.load_body("cat")).duration)
    2.0
    """
    check_object(path, "ShapePath", "path")
    check_file_name(file, "file")
    where = Path(file)
    suffix = where.suffix.lower()
    if suffix not in _WRITTEN and not output_target(where).is_stream:
        raise unknown_name(f"ending of the motion file {where}:", where.suffix, _WRITTEN)
    if comment is not None:
        check_text(comment, "comment", "a text")
    if path.joint_names is None:
        raise TrajectoryError("a motion file names its joints, and this path has no joint names; make it with them")
    if times is None:
        t = path.sample_times
    else:
        t = finite_array(times, "times", (None,), unit="s")
        _check_rows(path, t)
    shapes = path.shape(t)
    if suffix == ".npz":
        made_from = {"joints": list(path.joint_names), "recording": None if path.record is None else dict(path.record)}
        if comment is not None:
            made_from["comment"] = comment
        arrays = {
            "time": t,
            "shapes": shapes,
            "joint_names": np.array(path.joint_names),
            "provenance": np.array(json.dumps(provenance(made_from))),
        }
        write_whole(where, lambda stream: np.savez(stream, **arrays))
        return
    text = io.StringIO()
    text.writelines(f"# {line}\n" for line in (comment or "").splitlines())
    writer = csv.writer(text, delimiter="\t" if suffix == ".tsv" else ",", lineterminator="\n")
    turning = np.abs(shapes).max(axis=0) > 2.0 * np.pi
    labels = [
        f"{name} [{SI}]" if turning[k] or doubtful_turns(shapes[:, k]) else name
        for k, name in enumerate(path.joint_names)
    ]
    writer.writerow(["time [s]" if len(t) > 1 and doubtful_steps(t) else "time", *labels])
    writer.writerows([[repr(float(v)) for v in row] for row in np.column_stack([t, shapes])])
    write_whole(where, lambda stream: stream.write(text.getvalue().encode()))


def _check_rows(path: ShapePath, times: Array) -> None:
    """Warn where the spline through rows at these times is far from the path. Raises TrajectoryError as `spline`."""
    off, when = spline_error(path, times)
    worst = int(np.argmax(off))
    if off[worst] > _FAR_OFF:
        name = path.joint_names[worst] if path.joint_names else worst
        warnings.warn(
            f"{len(times)} rows do not describe this path: read back, joint {name} is {off[worst]:.3g} rad or m off at "
            f"{when[worst]:.6g} s. Leave times out for as many rows as it needs, or give more of them",
            TrajectoryWarning,
            stacklevel=3,
        )


def _names_argument(names: Any) -> Mapping[str, str | None] | None:
    """What a caller says of names, with files read, and a sequence of names as those of columns by their numbers."""
    if isinstance(names, str | os.PathLike):
        return read_names(names)
    if isinstance(names, list | tuple):
        return {str(number): name for number, name in enumerate(names, start=1)}
    if names is not None and not isinstance(names, Mapping):
        raise ShapeError(f"names: a mapping, name in the file -> joint, is needed, got {what_came(names)}")
    return names


def _mapping(names: Mapping[str, str | None] | None, table: Table) -> dict[str, str | None]:
    """A user's mapping by the labels of a table. Raises UnknownNameError for a column that is not there."""
    labels = [text for text in (*table.columns, *table.unread) if len(text) <= LONGEST_NAME]
    try:
        return mapping_argument(names, labels)
    except KeyError as error:
        raise unknown_name(f"column of {table.where} in names", error.args[0], labels[:_MOST_SHOWN]) from None


def _path(
    samples: Recorded,
    body: Body,
    within: float | str | None,
    close_by: str | None,
    *,
    loop: bool,
    penalty: float | None,
) -> tuple[ShapePath, Smoothing, Closing | None]:
    """The path through samples or near them, and how it was closed; `loop`: what meets anyway runs on smoothly."""
    if within is not None:
        return closed_path(samples, body, within=within, by=close_by, penalty=penalty)
    if close_by is not None:
        raise TrajectoryError(
            f"close_by={what_came(close_by)}: how large a gap is to be closed? Give close, as 0.05 or '3deg'"
        )
    path, smoothing = prepared_path(samples, periodic=loop and samples.meets, penalty=penalty)
    return path, smoothing, None


def _smoothing_record(smoothing: Smoothing, body: Body) -> dict[str, Any]:
    """What smoothing did, as JSON can hold it."""
    rms = np.sqrt(np.mean(smoothing.bias**2, axis=0))
    return {
        "penalty_s5": dict(zip(body.joint_names, smoothing.penalty.tolist(), strict=True)),
        "degrees_of_freedom": dict(zip(body.joint_names, smoothing.degrees_of_freedom.tolist(), strict=True)),
        "bias_rms": dict(zip(body.joint_names, rms.tolist(), strict=True)),
        "bias_in_bars": smoothing.bias_in_bars,
    }


def _low_pass_record(smoothing: Smoothing, body: Body) -> dict[str, Any]:
    """The filter, what it leaves of the noise and what it takes off the motion, as JSON can hold it."""
    chosen, in_band, by_noise = smoothing.low_pass, smoothing.in_band, smoothing.noise_in_band
    assert chosen is not None
    assert in_band is not None
    assert by_noise is not None
    return {
        "cut_off_hz": chosen.cut_off,
        "filter": "Butterworth, second order, forwards and backwards",
        "rate_hz": chosen.rate,
        "noise": dict(zip(body.joint_names, smoothing.noise.tolist(), strict=True)),
        "twice_the_cut_off_hz": chosen.twice.cut_off,
        "rms_up_to_twice_the_cut_off": dict(zip(body.joint_names, in_band.tolist(), strict=True)),
        "of_that_by_noise": dict(zip(body.joint_names, by_noise.tolist(), strict=True)),
        "affected_at_ends_s": list(smoothing.ends),
    }


def _closing_record(closing: Closing, body: Body) -> dict[str, Any]:
    """How a cycle was closed, as JSON can hold it."""
    return {
        "by": closing.by,
        "gap": dict(zip(body.joint_names, closing.gap.tolist(), strict=True)),
        "seconds_added": closing.seconds_added,
    }


def _record(recording: Recording, motion: Matched) -> dict[str, Any]:
    """What was read, as JSON can hold it."""
    return {
        "format": recording.table.format,
        "samples": len(recording.times),
        "first_time": recording.first,
        "last_time": recording.last,
        "time_unit": recording.time_unit,
        "columns": motion.columns,
        "units": motion.units,
        "at_rest": motion.at_rest,
        "left_out": motion.left_out,
        "base": motion.base.record,
        "gaps": motion.gaps,
        "segments": _segment_record(recording.table),
        "joint_order": None if recording.table.nameless is None else recording.table.nameless.record,
    }


def _segment_record(table: Table) -> dict[str, Any] | None:
    """What was found on the way from poses of segments to joints, with the momentum between the first and last time."""
    times = table.times
    if table.segments is None or times is None:
        return None
    return table.segments.within(float(times[0]), float(times[-1]))


def _resampled(path: ShapePath, rate: float, where: str) -> ShapePath:
    """The spline through evenly spaced values of a path, about so many a second."""
    count = max(round(path.duration * rate), 2)
    if count > _MOST_SAMPLES:
        raise TrajectoryError(f"{where}: resample: {count} samples; up to {_MOST_SAMPLES} are made")
    return resampled(path, np.linspace(0.0, path.duration, count + 1), path.joint_names)


def _noise_levels(smooth: float | str | Mapping[str, float | str] | None, body: Body) -> Array:
    """The noise of each joint: (n,) [rad or m]."""
    given: dict[str, float | str] = dict.fromkeys(body.joint_names, 0.0)
    if isinstance(smooth, Mapping):
        for name in smooth:
            body.joint_index(name)
        given.update(smooth)
    elif smooth is not None:
        given = dict.fromkeys(body.joint_names, smooth)
    units = zip(given.items(), body.joint_units, strict=True)
    return np.array([amounts(level, f"smooth, joint {name}")[unit] for (name, level), unit in units])
