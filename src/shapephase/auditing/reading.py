"""Trajectories with their base from files: MuJoCo's, Pinocchio's and biorbd's arrays, and recordings of any kind."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import so3
from ..arguments import check_file_name, check_object, positive_argument
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.virtual_base import way_names
from ..errors import InputFileNotFoundError, ShapeError, TrajectoryError, UnknownNameError
from ..files import npz_arrays
from ..shape_space.files._recording import MOST_BYTES, Table, file_bytes
from ..shape_space.files.formats.text_tables import read_delimited
from ..shape_space.files.read import RecordedMotion, read_recorded_motion
from ._noise import estimated_noise
from .floating_trajectory import FloatingTrajectory

_NUMBERED = re.compile(r"(qpos|qvel|q|v|Q|Qdot)[_\[ ]?([0-9]{1,6})\]?")
"""Labels of a table such as qpos_0, qpos[0] and qpos0."""
_ROOT = 6
"""Coordinates of biorbd's root: three places, three angles."""
_CAPTURED = ("BVH", "C3D", "MVNX", "OpenSim")
"""Formats in which people are recorded; they say what is in degrees, and how attitudes are written."""
_TEXTS = (".csv", ".tsv", ".txt")


def read_trajectory(
    file: str | os.PathLike[str],
    body: Body,
    *,
    step: float | None = None,
    names: Mapping[str, str | None] | str | os.PathLike[str] | None = None,
    degrees: bool | None = None,
    timestep: float | None = None,
    topic: str | None = None,
    joint_order: str | None = None,
    rest_missing: bool = False,
    ignore_extra: bool = False,
    fill: float | str | None = None,
    lowpass: float | None = None,
    resample: float | None = None,
    base_order: str | None = None,
    base_axes: Any = None,
) -> FloatingTrajectory:
    """A trajectory with its base.

    By the arrays of an NPZ file, or the columns of a table with the same names and numbers (`qpos_0`, `qpos[1]`):

    - `qpos` and, if there, `qvel`: MuJoCo's, joints in the order of `joint_names` where that is given, else in that of
      `joint_order`, else that in which MuJoCo compiles the body's file;
    - `q` and, if there, `v`: Pinocchio's, each joint by one number;
    - `Q` and, if there, `Qdot`: biorbd's, (6 + n, N) or (N, 6 + n), the root first.

    Times are the array or column `time`, or follow from `timestep`, an array of one number or the argument. All other
    files are read as `read_recorded_motion` does, whose arguments the rest are: joints, attitude and place of the base.

    Parameters
    ----------
    step : of the integrator that made it [s]; None: that between samples, or the file's array `timestep`
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
    check_object(body, "Body", "body")
    check_file_name(file, "file")
    where = Path(file)
    suffix = where.suffix.lower()
    if step is not None:
        step = positive_argument(step, "step")
    arrays = _arrays(where, suffix) if suffix in (".npz", *_TEXTS) else {}
    kind = next((kind for kind in ("qpos", "q", "Q") if kind in arrays), None)
    # Places of bodies, and joints that move the base in place of a free one, say what the reader of recordings knows.
    if kind == "qpos" and suffix == ".npz" and ("body_pos_w" in arrays or _has_way(body, arrays)):
        kind = None
    if joint_order is not None and kind in ("q", "Q"):
        raise TrajectoryError(f"{where}: joint_order is for MuJoCo's and Isaac's arrays; {kind} is in the body's order")
    if kind is not None and not (fill is None and lowpass is None and resample is None):
        raise TrajectoryError(
            f"{where}: fill, lowpass and resample are for recordings with names; {kind} is an array of a simulator: "
            "leave them out (--fill, --lowpass, --resample)"
        )
    if kind is not None:
        try:
            return _of_arrays(where, arrays, kind, body, step, timestep, joint_order)
        except (ShapeError, TrajectoryError, UnknownNameError) as error:
            raise _of_file(where, error) from None
    recorded = read_recorded_motion(
        file,
        body,
        fill=fill,
        lowpass=lowpass,
        resample=resample,
        names=names,
        degrees=degrees,
        timestep=timestep,
        topic=topic,
        joint_order=joint_order,
        rest_missing=rest_missing,
        ignore_extra=ignore_extra,
        base_order=base_order,
        base_axes=base_axes,
    )
    if recorded.base_attitude is None:
        raise TrajectoryError(
            f"{where}: the attitude of the base is not there; columns such as base_qx base_qy base_qz base_qw, an "
            "array base_quat_xyzw, or MuJoCo's qpos with its free joint are needed"
        )
    order, as_recorded = recorded.record["joint_order"], None
    if lowpass is not None:
        as_recorded = read_trajectory(
            file,
            body,
            names=names,
            degrees=degrees,
            timestep=timestep,
            topic=topic,
            joint_order=joint_order,
            rest_missing=rest_missing,
            ignore_extra=ignore_extra,
            fill=fill,
            base_order=base_order,
            base_axes=base_axes,
        )
    try:
        return FloatingTrajectory(
            times=recorded.times,
            quaternion=so3.quat_from_matrix(recorded.base_attitude),
            shapes=recorded.path.shape(recorded.times),
            position=recorded.base_position,
            step=step,
            name=where.name,
            joint_order=None if order is None else f"{order['means']}: {', '.join(order['joints'])}",
            certain=_certain(recorded, degrees),
            captured=recorded.format in _CAPTURED,
            noise=None if as_recorded is None else estimated_noise(as_recorded),
        )
    except (ShapeError, TrajectoryError) as error:
        raise _of_file(where, error) from None


def _has_way(body: Body, arrays: Mapping[str, Any]) -> bool:
    """Whether `qpos` begins with the joints by which the body's file moves its base."""
    width = np.shape(arrays["qpos"])[-1] if "joint_names" not in arrays else 0
    return bool(body.base_joints) and width == len(way_names(body.base_joints)) + body.n_shape


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


def _of_file(where: Path, error: Exception) -> TrajectoryError | UnknownNameError:
    """A fault with the file's name before it."""
    said = str(error)
    if not said.startswith(f"{where}: "):
        said = f"{where}: {said.removeprefix(f'{where.name}: ')}"
    return UnknownNameError(said) if isinstance(error, UnknownNameError) else TrajectoryError(said)


def _arrays(where: Path, suffix: str) -> dict[str, Any]:
    """Of an NPZ file; of a table those whose columns are numbered, and the time."""
    if not where.exists():
        raise InputFileNotFoundError(f"{where}: there is no such file")
    data = file_bytes(where)
    if suffix == ".npz":
        try:
            return npz_arrays(data, 4 * MOST_BYTES)
        except ValueError as error:
            raise TrajectoryError(f"{where}: {error}") from None
    return _of_table(read_delimited(where, data))


def _of_table(table: Table) -> dict[str, Any]:
    found: dict[str, dict[int, Array]] = {}
    for label, values in table.columns.items():
        match = _NUMBERED.fullmatch(label.strip())
        if match:
            table.check_column(label)
            columns = found.setdefault(match[1], {})
            if int(match[2]) in columns:
                raise TrajectoryError(f"{table.where}: two columns are number {int(match[2])} of {match[1]}; keep one")
            columns[int(match[2])] = values
    arrays: dict[str, Any] = {}
    for name, columns in found.items():
        if sorted(columns) != list(range(len(columns))):
            raise TrajectoryError(
                f"{table.where}: columns {name} are numbered {sorted(columns)}; 0, 1, 2, ... is needed"
            )
        arrays[name] = np.stack([columns[k] for k in range(len(columns))], axis=1)
    times = [label for label in table.columns if label.strip() in ("time", "t", "time [s]")]
    if arrays and len(times) > 1:
        raise TrajectoryError(f"{table.where}: columns {' and '.join(map(repr, times))} are both times; keep one")
    if arrays and times:
        table.check_column(times[0])
        arrays["time"] = table.columns[times[0]]
    return arrays


def _of_arrays(
    where: Path,
    arrays: Mapping[str, Any],
    kind: str,
    body: Body,
    step: float | None,
    timestep: float | None,
    order: str | None,
) -> FloatingTrajectory:
    rates = {"qpos": "qvel", "q": "v", "Q": "Qdot"}[kind]
    names = [str(name) for name in np.ravel(arrays["joint_names"])] if "joint_names" in arrays else None
    stored = arrays.get("timestep")
    places = finite_array(arrays[kind], kind, (None, None))
    moving = None if rates not in arrays else finite_array(arrays[rates], rates, (None, None))
    if kind == "Q" and places.shape[0] == _ROOT + body.n_shape and places.shape[1] != places.shape[0]:
        places, moving = places.T, None if moving is None else moving.T
    times = _times(arrays, len(places), timestep)
    if step is None and stored is not None and np.size(stored) == 1:
        step = positive_argument(np.ravel(stored)[0].item(), "timestep")
    if kind == "Q":
        return replace(_of_biorbd(body, times, places, moving, where.name), step=step)
    given: dict[str, Any] = {"joint_names": names, "step": step, "name": where.name}
    if kind == "qpos":
        return FloatingTrajectory.from_mujoco(body, times, places, moving, joint_order=order, **given)
    return FloatingTrajectory.from_pinocchio(body, times, places, moving, **given)


def _times(arrays: Mapping[str, Any], count: int, timestep: float | None) -> Array:
    if "time" in arrays:
        return finite_array(arrays["time"], "time", (count,), unit="s")
    between = timestep if timestep is not None else arrays.get("timestep")
    if between is None or np.size(between) != 1:
        raise TrajectoryError("no times: an array 'time', or one number 'timestep' is needed (--timestep)")
    spacing = positive_argument(np.ravel(between)[0].item(), "timestep")
    return np.arange(count, dtype=np.float64) * spacing


def _of_biorbd(body: Body, times: Array, places: Array, rates: Array | None, name: str) -> FloatingTrajectory:
    """Of biorbd's generalised coordinates: three places, three angles in the order of the body's file, the joints."""
    if places.shape[1] != _ROOT + body.n_shape:
        raise TrajectoryError(
            f"Q has {places.shape[1]} coordinates; three places, three angles and {body.n_shape} joints are needed"
        )
    if rates is not None and rates.shape != places.shape:
        raise ShapeError(f"Qdot: expected shape {places.shape} as that of Q, got {rates.shape}")
    if body.ball_joints:
        raise TrajectoryError(
            f"Q of a model with quaternions is not read ({body.ball_joints[0]} has one); write columns by name, or q "
            "with the quaternion x y z w of each"
        )
    axes = "xyz" if body.base_angles is None else body.base_angles[1]
    angles = places[:, 3:_ROOT]
    rate = np.zeros((len(places), 3))
    if rates is not None:
        for k, axis in enumerate(axes):
            # What was there before is seen from axes that have turned on.
            turn = so3.matrix_from_euler(angles[:, [k]], axis)
            rate = so3.apply(so3.transpose(turn), rate) + rates[:, 3 + k, None] * np.eye(3)["xyz".index(axis)]
    turned = so3.matrix_from_euler(angles, axes)
    given = {} if rates is None else {"rate": rate, "velocity": rates[:, :3], "joint_rates": rates[:, _ROOT:]}
    return FloatingTrajectory(
        times=times,
        position=places[:, :3],
        quaternion=so3.quat_from_matrix(turned),
        shapes=places[:, _ROOT:],
        name=name,
        **given,
    )
