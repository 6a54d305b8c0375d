"""Recorded joint motions read from files of many kinds, their joints matched by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Unpack

import numpy as np

from ...arguments import made_by
from ...arrays import Array
from ...body.body import Body
from ...body.loading import as_body
from ...display import short_repr
from ...errors import ShapeError, TrajectoryError, unknown_name
from ..shape_path import ShapePath, without_joints
from ._joint_columns import JointChoices, Matched, matched
from ._sample_origins import resampled
from ._sample_steps import evenly_spaced, low_passed, surrounded, warn_of_fast_turns, without_first_pose
from ._segment_poses import SegmentMotion, without_segments
from .closing import Closing, closed_path
from .flight import Flight, in_flight
from .inputs import read_input
from .labels import amounts
from .options import Reading, ReadingOptions, names_by_label, show_options
from .recording import LONGEST_NAME, Recording, Table
from .smoothing import Recorded, Smoothing, check_swings, is_even, prepared_path
from .times import recording_of

_MOST_SHOWN = 200  # columns that an error about an unknown one lists
_MOST_SAMPLES = 2_000_000  # of a resampled path: 16 MB for each joint


@made_by(ShapePath="it is recorded.path")
@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """Recorded joint motion and the path made of it. Made by `read_recorded_motion`.

    Attributes
    ----------
    path : the joints of the body, in its order, but those of `without`; it carries the SHA-256 of the file
    residual : (n,) rms of the samples minus the path [rad or m]; zero where it goes through all of them
    times : (N,) of the samples, from 0 [s]
    base_attitude : (N, 3, 3) recorded attitude of the base, base axes to the recorder's axes, or None
    base_position : (N, 3) recorded position of the base [m], or None
    base_rates : (N, 3) recorded angular velocity of the base, base axes [rad/s], or None
    format : the kind of file
    record : what was read and what was done to it, ready for JSON: the file with its hash, samples and times, columns
        and units of joints, where the others rest, what was left out, smoothed, closed, resampled
    momentum : (3,) about the centre of mass, which a file of `Motion.save` states [kg m^2/s], or None
    smoothing : what smoothing did, with its penalty, degrees of freedom and bias; None: it was not smoothed
    closing : how a cycle was closed, and what that changed; None: it was not
    flight : the free flight that was kept; None: none was requested
    segments : angular momentum from poses of segments beside that of base and joints; None: the file has no such poses
    wheel_speeds : speed of each wheel whose column was given [rad/s], for `articulated(..., rotor_speeds=)`
    """

    path: ShapePath
    residual: Array
    times: Array
    base_attitude: Array | None
    base_position: Array | None
    format: str
    record: Mapping[str, Any]
    momentum: Array | None = None
    smoothing: Smoothing | None = None
    closing: Closing | None = None
    flight: Flight | None = None
    segments: SegmentMotion | None = None
    wheel_speeds: Mapping[str, ShapePath] = field(default_factory=dict)
    base_rates: Array | None = None

    __repr__ = short_repr


@show_options(ReadingOptions)
def read_recorded_motion(file: Any, body: Body | str, **options: Unpack[ReadingOptions]) -> RecordedMotion:
    """Read a recorded motion: the joints, and the base where it was recorded.

    The kind of file follows from its ending:

    - `.csv`, `.tsv`, `.txt`: a header `time,<joint names>` in any order, separated by commas, tabs or semicolons;
      decimal points or decimal commas. Comments behind `#` may stand above it.
    - `.xlsx`: such a table in a sheet of Excel. `.parquet`: such a table, also of pandas.
    - `.mot`, `.sto`: OpenSim; its header gives the unit of turning coordinates. Locked and coupled coordinates that are
      no joints of the body are left out.
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
    - `.npz` of `Motion.save`: joints, base and momentum.
    - `.npz` with `q`: Pinocchio's (N, 7 + n), place, quaternion x y z w, joints, or Drake's, quaternion w x y z, place,
      joints, whichever has quaternions of length one; of a bioMod, or as `Q`, the coordinates of biorbd and bioptim,
      those of the root first. These and `qpos` may be transposed, and columns `q_0`, `q[1]`, ... of a table.
    - `.npz` with `joint_pos`, `body_pos_w`, `body_quat_w`, `body_ang_vel_w` and `fps`: Isaac Lab. Without `joint_names`
      the order is the one in which the links lie and turn as the bodies do.
    - `.json`: DeepMimic's humanoid, for a body with ball joints and hinges of the same names.

    The base in columns: `base_qx,base_qy,base_qz,base_qw` (or `qx` and so on), `base_roll,base_pitch,base_yaw` or
    OpenSim's `pelvis_tilt,pelvis_list,pelvis_rotation`, or modified Rodrigues parameters `sigma_1,sigma_2,sigma_3`,
    shadow sets included; and `base_x,base_y,base_z` or `pelvis_tx,pelvis_ty,pelvis_tz`. Rates of a gyro in base axes:
    `omega_x [rad/s]`, `gyro_x [deg/s]`, `wx` and so on. Beside attitudes they decide whether these are the inverse of
    base axes to the recorder's, and whether they are themselves in the recorder's axes.

    Poses of segments, also in columns `SEGMENT_qx,SEGMENT_qy,SEGMENT_qz,SEGMENT_qw` and `SEGMENT_x,SEGMENT_y,SEGMENT_z`
    of a table, and OpenSim's BodyKinematics: segments are links by their names, ball joints take the turn between them,
    hinges the nearest turn about their axes. Distances between joints are compared with those of the body.

    Units stand in the labels, as `knee [deg]`, `knee (deg)`, `knee_deg`, `boom [mm]`, `Time [ms]`, or in a row of
    units below them. Without, times are in seconds, angles in radians and lengths in metres; values that resemble
    milliseconds, degrees or millimetres raise an error that names the option to set. Angles are taken as written: one
    that jumps by a whole turn is not unwrapped.

    Parameters
    ----------
    file : name of a file, "-" for standard input, a pandas `DataFrame`, a `Dataset` or `DataArray` of xarray, a mapping
        of arrays by name as an NPZ file has them, or (times (N,), array (N, m), names (m,))
    names : name in the file -> name of the joint, also with a unit as `"boom [mm]"`, or "time", or of the link that a
        segment is; None instead leaves the column or segment out; or the name of a file with them, see `read_names`;
        or a sequence of names, one for each column of a table without a header
    degrees : True if turning joints are in degrees, whatever the file states; None: as the file states
    time_unit : of the times: "s", "ms", "us", "ns" or "min"; None: as the file states
    timestep : between samples, for a file without times [s]
    topic : which part of a file with more than one motion: topic of a bag, sheet of a workbook, structure of a `.mat`
    joint_order : of joints in `qpos` or `joint_pos` without names: "mujoco" (depth first, joints of one link as the
        body's URDF lists them; of an MJCF its own), "isaac" (breadth first), "isaac-by-name" (breadth first, joints of
        one link by their names), "body" (`body.joint_names`); None: by `body_pos_w` where the file has it, else
        "mujoco"
    rest : joint -> value [rad or m], or a text as "30deg" or "5 mm", for joints without a column
    rest_missing : True to let all other joints without a column rest at zero, or at their limit next to it
    ignore_extra : True to ignore columns that match no joint
    trim : the first and the last time to be kept, in the file's unit and from its start; smoothing comes before the cut
    resample : the path goes through this many of its own values a second instead, evenly spaced [1/s]
    fill : empty cells and NaN are gaps, and an error; this bridges those of up to so many seconds from the last number
        before to the first one after, a number or a text as "0.1s" or "100ms": joints and places by a cubic spline
        through the other samples, attitudes and ball joints by SciPy's `RotationSpline`. The parts of a quaternion, of
        three angles and of a place have their gaps together; gaps at the start and the end are cut off
    smooth : noise level of the samples, rms, a number [rad or m] or a text as "0.3deg" or "0.3deg,1mm", one for all
        joints or by joint (the others are interpolated); None: the path goes through all samples. See
        `smoothed_path`
    smooth_penalty : instead of the penalties that follow from the noise [s^5]
    lowpass : in place of `smooth`, the cut-off [Hz] of a Butterworth filter of second order run forwards and backwards
        over the whole recording, before a stretch or a flight is cut out of it: joints, places and rotations. Both
        passes together leave 1/sqrt(2) of what swings with the cut-off. Noise is estimated by what is above twice the
        cut-off, as white; error bars hold what passes of it. Samples that are not evenly spaced are put on even times
        by `resample` first
    close : the largest gap between the ends of a cycle that is closed, a number [rad or m] or a text as "3deg" or
        "3deg,5mm"; None: ends that meet to 1e-9 are joined smoothly, others stay apart; False: they are not joined even
        then
    close_by : "smooth", a smoother that runs on from the end to the start (where `smooth` is given, else "drift");
        "drift", the gap is taken off evenly in time
    base_order : of roll, pitch and yaw, or tilt, list and rotation: the axes in the order in which these turn, each
        as the turns before have left it; None: "zyx" (URDF) and "zxy" (OpenSim)
    base_axes : the axes of the base in those whose attitude was recorded: a rotation (3, 3), base axes to those, or a
        text such as "x,-z,y", where the x, y and z axis of the base point to; "estimate" leaves them open, for
        `momentum_from_recording` to find; None: the same axes, but "x,-z,y" for `pelvis_tilt` and so on (OpenSim: x
        forward, y up; URDF: x forward, z up)
    base_inverse : True if recorded attitudes take the recorder's axes to those of the base; None: as the rates beside
        them show, else False
    flight : the free flight that is kept: "auto", the longest stretch on which the centre of mass falls freely;
        "auto:2", the second of all such stretches in time; its first and last time, as the file gives the time; "all";
        "recorded": as "auto" where the attitude of the base is recorded, all of it where its places are not recorded or
        do not fall, no flight where nothing of the base is recorded; None: no flight
    up : the recorder's axis that points up: "x", "y", "z", "-x", "-y" or "-z"; None: that of the format (OpenSim y,
        MuJoCo and ROS z), else x, y or z, whichever has the longest fall
    gravity : by which the body falls in a flight [m/s^2]; None: 9.81; "any": units are not doubted
    calibration : how the axes of segments become those of links: a time, as the file gives it, at which the body
        stands in its zero pose, turned as the joints lie, or as the room where they do not show it; the name of such a
        pose in the file, as "tpose"; "links", these are the axes of the links; None: an MVNX file's own pose, or
        "links" for the body of the file that the segments are from
    length_tolerance : share by which distances between joints may differ from the body's, on average; None: 0.1
    without : joints that the path lacks, whose columns are ignored: wheels that have a momentum or a speed instead
    wheel_speeds : wheel -> its column of speeds in rad/s, deg/s or rpm, the unit in its label, as `rw1 [rpm]`, or
        behind a colon, as "rw1:rpm"; it is filtered and resampled as the joints are, and smoothed where `smooth` has a
        noise for it [rad/s]. Such a wheel is left out of the path, too

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    UnknownNameError
        If a column matches no joint of the body, or the file's ending is unknown.
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
    body = as_body(body)
    how = Reading.of(options, body)
    option, unit = how.given, how.given("time_unit")
    given, step = read_input(file, body, option("topic"), option("timestep"), option("joint_order"), how.names)
    table, names = without_segments(given.table, body, how.segments, unit, step)
    joints = replace(how.joints, names=_names_of_columns(names, how, table))
    stretch = partial(recording_of, table, body.joint_names, joints.names, unit, step)
    recording, motion = without_first_pose(*matched(stretch(how.trim), body, joints), body)
    warn_of_fast_turns(recording, motion, body)
    recording, motion, flight = in_flight(recording, motion, body, how.flight)
    try:
        noise = _noise_levels(option("smooth"), body, joints)
        around = recording, motion, slice(None)
        if (noise.any() or how.cut_off is not None) and (how.trim is not None or flight is not None):
            around = surrounded(
                recording,
                motion,
                lambda: stretch(None),
                lambda part: without_first_pose(*matched(part, body, joints), body),
                joints.fill,
            )
        times, whole, inside = around[0].times, *around[1:]
        even_rate = how.rate if how.cut_off is not None and not is_even(times) else None
        if even_rate is not None:
            times, whole, inside = evenly_spaced(times, whole, inside, even_rate)
        if how.cut_off is not None:
            whole = low_passed(times, whole, how.cut_off)
        motion = whole.kept(np.arange(len(times))[inside])
        samples = Recorded(times, whole.shapes, noise, body.joint_names, inside, how.cut_off)
        wheel_speeds = _speed_paths(replace(samples, shapes=whole.speeds), motion, option("smooth"))
        closing = None
        if how.close is not None:
            path, smoothing, closing = closed_path(
                samples, body, within=how.close, by=option("close_by"), penalty=option("smooth_penalty")
            )
        else:
            loop = option("close") is None and samples.meets
            path, smoothing = prepared_path(samples, periodic=loop, penalty=option("smooth_penalty"))
        check_swings(path, body)
    except (TrajectoryError, ShapeError) as error:
        raise TrajectoryError(f"{table.where}: {error}") from None
    if how.rate is not None and even_rate is None:
        count = max(round(path.duration * how.rate), 2)
        if count > _MOST_SAMPLES:
            raise TrajectoryError(f"{table.where}: resample: {count} samples; up to {_MOST_SAMPLES} are made")
        even = np.linspace(0.0, path.duration, count + 1)
        path = resampled(path, even)
        wheel_speeds = {name: resampled(speed, even) for name, speed in wheel_speeds.items()}
    kept_times = times[inside] - times[inside][0]
    residual = np.zeros(body.n_shape)
    if samples.smoothed or how.rate is not None or closing is not None:
        residual = np.sqrt(np.mean((motion.shapes - path.shape(kept_times)) ** 2, axis=0))
    record = {
        "file": given.name,
        "sha256": given.sha256,
        "samples_in_file": len(table.rows),
        "trim": how.trim,
        **_record(recording, motion),
        "without": list(joints.without),
        "wheel_speeds": {name: column._asdict() for name, column in motion.speed_columns.items()},
        "smooth": dict(zip(body.joint_names, noise.tolist(), strict=True)) if noise.any() else None,
        "lowpass": None if how.cut_off is None else smoothing.filter_record(body.joint_names),
        "smoothing": smoothing.spline_record(body.joint_names) if noise.any() else None,
        "closing": None if closing is None else closing.record,
        "flight": None if flight is None else flight.record,
        "resampled_to_hz": None if how.rate is None else (len(path.breaks) - 1) / path.duration,
    }
    kept = np.array([name not in joints.without for name in body.joint_names], dtype=bool)
    residual, path = residual[kept], without_joints(path, joints.without)
    return RecordedMotion(
        path=replace(path, sha256=given.sha256, record=record),
        residual=residual,
        momentum=table.momentum,
        times=kept_times,
        base_attitude=motion.base.attitude,
        base_position=motion.base.position,
        base_rates=motion.base.rates,
        format=table.format,
        record=record,
        smoothing=smoothing.of_joints(kept) if samples.smoothed else None,
        closing=closing,
        flight=flight,
        segments=table.segments,
        wheel_speeds=wheel_speeds,
    )


@show_options(ReadingOptions)
def read_shape_path(file: Any, body: Body | str, **options: Unpack[ReadingOptions]) -> ShapePath:
    """Read a recorded motion as a path: a C2 spline, periodic where the last sample equals the first.

    Kinds of file, keyword arguments and errors are those of `read_recorded_motion`.

    Examples
    --------
    >>> rows = [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.3, 0.0], [2.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.0, 0.0]]
    >>> header = "time,waist_roll,waist_pitch,waist_yaw"
    >>> np.savetxt("bend.csv", rows, delimiter=",", header=header, comments="")
    >>> path = sp.read_shape_path("bend.csv", sp.load_body("cat_two_halves"))
    >>> path.duration, path.joint_names, path.shape(1.0).round(9).tolist()
    (3.0, ('waist_pitch', 'waist_yaw', 'waist_roll'), [0.3, 0.0, 0.0])
    """
    return read_recorded_motion(file, body, **options).path


def _speed_paths(samples: Recorded, motion: Matched, smooth: Any) -> dict[str, ShapePath]:
    """Speeds of wheels as paths of one column: wheel -> path [rad/s]."""
    names = tuple(motion.speed_columns)
    if not names:
        return {}
    levels = smooth if isinstance(smooth, Mapping) else {}
    noise = np.array([amounts(levels.get(name, 0.0), f"smooth, wheel {name}")["rad"] for name in names])
    samples = replace(samples, noise=noise, joint_names=names)
    path, _ = prepared_path(samples, periodic=samples.meets)
    return {name: without_joints(path, {*names} - {name}) for name in names}


def _names_of_columns(names: Mapping[str, str | None], how: Reading, table: Table) -> dict[str, str | None]:
    """Label of a column -> joint, or None. Raises TrajectoryError; UnknownNameError for an unknown column."""
    if how.given("joint_order") is not None and table.nameless is None:
        raise TrajectoryError(
            f"{table.where}: joint_order is for arrays without names; columns here have names: leave it "
            "out (--joint-order)"
        )
    if how.listed and names and not set(names) & set(table.columns):
        raise TrajectoryError(
            f"{table.where}: a list of names is for a table without a header, and this one reads "
            f"{', '.join(list(table.columns)[:_MOST_SHOWN])}; give a mapping: names={{column: joint}} (--names "
            "COLUMN=JOINT)"
        )
    labels = [text for text in (*table.columns, *table.unread) if len(text) <= LONGEST_NAME]
    try:
        return names_by_label(names, labels)
    except KeyError as error:
        raise unknown_name(f"column of {table.where} in names", error.args[0], labels[:_MOST_SHOWN]) from None


def _record(recording: Recording, motion: Matched) -> dict[str, Any]:
    """Content of the recording and its columns, ready for JSON."""
    table = recording.table
    ends = None if table.times is None else table.times[[0, -1]].tolist()
    return {
        "format": table.format,
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
        "segments": None if table.segments is None or ends is None else table.segments.within(*ends),
        "joint_order": None if table.nameless is None else table.nameless.record,
    }


def _noise_levels(smooth: float | str | Mapping[str, float | str] | None, body: Body, choices: JointChoices) -> Array:
    """The noise of each joint: (n,) [rad or m]."""
    level = 0.0 if smooth is None else smooth
    by_joint = level if isinstance(level, Mapping) else dict.fromkeys(body.joint_names, level)
    for name in by_joint:
        if name not in choices.wheel_speeds:
            body.joint_index(name)
    by_joint = {name: value for name, value in by_joint.items() if name not in choices.without}
    units = zip(body.joint_names, body.joint_units, strict=True)
    return np.array([amounts(by_joint.get(name, 0.0), f"smooth, joint {name}")[unit] for name, unit in units])
