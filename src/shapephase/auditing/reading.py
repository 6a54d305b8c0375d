"""Trajectories with their base from files: arrays of simulators and optimisers, and recordings of any kind."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Unpack

import numpy as np

from .. import so3
from ..arguments import check_choice, check_file_name, positive_argument
from ..body.body import Body
from ..body.joint_orders import WORDS
from ..body.loading import as_body
from ..errors import ShapeError, TrajectoryError
from ..shape_space.files.inputs import read_input
from ..shape_space.files.options import TrajectoryOptions, check_options, show_options
from ..shape_space.files.read import RecordedMotion, read_recorded_motion
from ..shape_space.files.times import recording_of
from .floating_trajectory import FloatingTrajectory, estimated_noise, rates_by_name

_CAPTURED = ("BVH", "C3D", "MVNX", "OpenSim")
"""Formats in which people are recorded; they say what is in degrees, and how attitudes are written."""


class StepOptions(TrajectoryOptions, total=False):
    """Keyword arguments of `read_trajectory`."""

    integrator_step: float | None


@show_options(StepOptions)
def read_trajectory(
    file: str | os.PathLike[str], body: Body | str, **options: Unpack[StepOptions]
) -> FloatingTrajectory:
    """Return a trajectory with its base.

    Files are read as `read_recorded_motion` does, whose arguments the rest are. Where they hold arrays of a whole
    body, `qpos` and `qvel`, `q` and `v`, `Q` and `Qdot`, `q` and `qdot`, or Isaac Lab's, the coordinates are taken as
    they stand there, in whatever order they may be wrong in, with the rates beside them.

    Parameters
    ----------
    integrator_step : of the integrator that made it [s]; None: that between samples, or the file's array `timestep`
    joint_order : of arrays without names, as `read_recorded_motion` has it
    fill, lowpass, resample : of recordings, as `read_recorded_motion` has them; the noise of what is filtered is that
        before the filter: slow changes, which an audit looks for, keep theirs

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    TrajectoryError, ShapeError, UnknownNameError
        For faults of the file, and for one that does not say where the base is.

    Examples
    --------
    >>> qpos = np.column_stack([np.zeros((21, 3)), np.ones(21), np.zeros((21, 6))])
    >>> np.savez("rest.npz", time=np.linspace(0.0, 1.0, 21), qpos=qpos)
    >>> sp.read_trajectory("rest.npz", sp.load_body("cat_two_halves")).shapes.shape
    (21, 3)
    """
    body = as_body(body)
    check_file_name(file, "file")
    where = Path(file)
    check_options(options, StepOptions, "read_trajectory")
    step = options.pop("integrator_step", None)
    if step is not None:
        step = positive_argument(step, "integrator_step")
    names, joint_order, degrees = options.get("names"), options.get("joint_order"), options.get("degrees")
    if joint_order is not None:
        check_choice(joint_order, "joint_order", WORDS)
    given, timestep = read_input(
        file,
        body,
        options.get("topic"),
        options.get("timestep"),
        joint_order,
        names if isinstance(names, Mapping) else None,
    )
    table = given.table
    order = None if table.nameless is None else f"{table.nameless.title}: {', '.join(table.nameless.names)}"
    try:
        whole = table.simulated is not None and set(body.joint_names) <= set(table.columns)
        plain = all(options.get(name) is None for name in ("fill", "lowpass", "resample", "names"))
        if whole and plain and table.simulated is not None and table.base_quat_xyzw is not None:
            times = table.times
            if times is None:
                recording = recording_of(table, body.joint_names, {}, None, timestep, None)
                times = recording.times + (recording.first if recording.time_unit == "s" else 0.0)
            joints = [table.columns[joint] for joint in body.joint_names]
            return FloatingTrajectory(
                times=times,
                quaternion=table.base_quat_xyzw,
                shapes=np.stack(joints, axis=1) if joints else np.zeros((len(times), 0)),
                position=table.base_position,
                integrator_step=table.simulated.step if step is None else step,
                name=where.name,
                joint_order=order,
                **rates_by_name(table.simulated.rates),
            )
        options["timestep"], options["topic"] = timestep, None
        recorded = read_recorded_motion(given, body, **options)
        trajectory = _of_recording(recorded, where, step, order, degrees)
        if options.get("lowpass") is None:
            return trajectory
        # What the filter has taken away is in the recording before it alone.
        options["lowpass"] = options["resample"] = None
        unfiltered = _of_recording(read_recorded_motion(given, body, **options), where, step, order, degrees)
        return replace(trajectory, noise=estimated_noise(unfiltered))
    except (ShapeError, TrajectoryError) as error:
        raise _of_file(where, error) from None


def _of_recording(
    recorded: RecordedMotion, where: Path, step: float | None, order: str | None, degrees: bool | None
) -> FloatingTrajectory:
    if recorded.base_attitude is None:
        raise TrajectoryError(
            f"{where}: the attitude of the base is not there; columns such as base_qx base_qy base_qz base_qw, an "
            "array base_quat_xyzw, or MuJoCo's qpos with its free joint are needed"
        )
    return FloatingTrajectory(
        times=recorded.times,
        quaternion=so3.quat_from_matrix(recorded.base_attitude),
        shapes=recorded.path.shape(recorded.times),
        position=recorded.base_position,
        integrator_step=step,
        name=where.name,
        joint_order=order,
        certain=_certain(recorded, degrees),
        captured=recorded.format in _CAPTURED,
    )


def _certain(recorded: RecordedMotion, degrees: bool | None) -> tuple[str, ...]:
    """What is no hypothesis: said by the format, by labels or by the caller."""
    found = []
    units = set(recorded.record["units"].values())
    if recorded.format in _CAPTURED or degrees is not None or "rad" not in units:
        found.append("units")
    base = recorded.record["base"] or {}
    # Three angles have no order of four numbers.
    if recorded.format in _CAPTURED or "order" in base:
        found.append("order")
    if recorded.format in _CAPTURED:
        found.append("direction")
    return tuple(found)


def _of_file(where: Path, error: Exception) -> TrajectoryError:
    """A fault with the file's name before it."""
    said = str(error)
    return TrajectoryError(said if str(where) in said else f"{where}: {said.removeprefix(f'{where.name}: ')}")
