"""Columns of a recording matched to the joints of a body by name, in SI units; what is doubtful is warned of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ... import so3
from ...arrays import FARTHEST, Array
from ...body.body import Body
from ...errors import TrajectoryError, UnknownColumnError, unknown_name
from ._recording import Recording, warn

_DEGREES = "_deg"
_LONGEST_NAME = 256
"""Characters of a column's name, as of a joint's name in a body's file."""
_MOST_SHOWN = 200
"""Columns that an error about an unknown one lists."""
_QUATERNIONS = (("qx", "qy", "qz", "qw"), ("base_qx", "base_qy", "base_qz", "base_qw"))
_POSITION = ("base_x_m", "base_y_m", "base_z_m")
# In the tables that `Motion.write_csv` writes; they follow from the rest.
_FOLLOWING = ("omega_x_rad_s", "omega_y_rad_s", "omega_z_rad_s")
_BASE = {*_QUATERNIONS[0], *_QUATERNIONS[1], *_POSITION, *_FOLLOWING}


class Matched(NamedTuple):
    """Shapes (N, n) [rad or m] in the body's order; attitude (N, 3, 3) and position (N, 3) [m] of the base or None."""

    shapes: Array
    base_attitude: Array | None
    base_position: Array | None


def matched(recording: Recording, body: Body, names: Mapping[str, str | None] | None, degrees: bool | None) -> Matched:
    """The shapes of a body that a recording holds.

    Parameters
    ----------
    names : name in the file -> name of the joint, or None for a column to be left out
    degrees : whether turning joints are in degrees; None: as the file says. A sliding joint is in metres always, a
        column `<joint>_deg` in degrees.

    Raises
    ------
    UnknownNameError
        If a column is no joint of the body.
    TrajectoryError
        If a joint is missing or doubled, a value is no possible coordinate, a limited joint turns so far that its
        angles look like degrees, or a quaternion is not of unit length.

    Warns
    -----
    TrajectoryWarning
        Where a joint leaves its limits, or jumps by about a whole turn from one sample to the next.
    """
    for name in recording.columns:
        if len(name) > _LONGEST_NAME:
            raise TrajectoryError(f"{recording.where}: a column's name has {len(name)} characters: {name[:40]!r}...")
    for name in names or ():
        if name not in recording.columns:
            raise unknown_name(f"column of {recording.where} in names", name, list(recording.columns)[:_MOST_SHOWN])
    shapes = np.empty((len(recording.times), body.n_shape))
    found: dict[int, str] = {}
    base: dict[str, Array] = {}
    for name, values in recording.columns.items():
        target = names.get(name, name) if names else name
        if target is None:
            continue
        if target in _BASE and target not in body.joint_names:
            base[target] = values
            continue
        joint, factor = _joint_of(name, target, body, recording, degrees)
        if joint in found:
            raise TrajectoryError(
                f"{recording.where}: columns {found[joint]!r} and {name!r} are the same joint; keep one"
            )
        found[joint] = name
        shapes[:, joint] = factor * values
    missing = [name for i, name in enumerate(body.joint_names) if i not in found]
    if missing:
        raise TrajectoryError(
            f"{recording.where}: no column for {', '.join(missing)}; add them (zeros where the joint rests). Joints of "
            f"{body.name}: {', '.join(body.joint_names)}"
        )
    for joint in range(body.n_shape):
        _check_joint(shapes[:, joint], joint, body, recording, degrees)
    attitude, position = _base(base, recording)
    return Matched(shapes, attitude, position)


def _joint_of(name: str, target: str, body: Body, recording: Recording, degrees: bool | None) -> tuple[int, float]:
    """The joint of a column and the factor to SI units."""
    plain = target if target in body.joint_names else target.removesuffix(_DEGREES)
    if plain not in body.joint_names:
        raise unknown_name(
            f"column in {recording.where}; joint of {body.name}", target, body.joint_names, UnknownColumnError
        )
    joint = body.joint_names.index(plain)
    # A column keeps its unit when it is given another name.
    by_name = plain != target or (name != target and name.endswith(_DEGREES))
    if body.joint_units[joint] != "rad":
        if by_name:
            raise TrajectoryError(
                f"{recording.where}: column {name!r} is in degrees, but joint {plain} slides and is in metres"
            )
        return joint, 1.0
    if by_name and degrees is False:
        raise TrajectoryError(
            f"{recording.where}: column {name!r} is in degrees by its name, and degrees=False was given"
        )
    in_degrees = recording.degrees if degrees is None else degrees
    if in_degrees is None and not by_name:
        raise TrajectoryError(
            f"{recording.where}: the header does not say inDegrees=yes or no; add that, or give degrees=True or False"
        )
    return joint, np.pi / 180.0 if by_name or in_degrees else 1.0


def _check_joint(values: Array, joint: int, body: Body, recording: Recording, degrees: bool | None) -> None:
    name, unit = body.joint_names[joint], body.joint_units[joint]
    lower, upper = body.joint_limits[joint]
    largest = int(np.argmax(np.abs(values)))
    if abs(values[largest]) > FARTHEST:
        raise TrajectoryError(
            f"{recording.place(largest)}: joint {name} is at {values[largest]:.6g} {unit}; up to {FARTHEST:g} {unit} "
            "can be represented to full accuracy"
        )
    beyond = np.maximum(lower - values, values - upper)
    worst = int(np.argmax(beyond))
    outside = beyond[worst] > 1e-9 * max(1.0, abs(values[worst]))
    limited = unit == "rad" and np.isfinite([lower, upper]).all()
    if outside and limited and degrees is None and abs(values[largest]) > 4.0 * np.pi:
        raise TrajectoryError(
            f"{recording.place(largest)}: joint {name} is at {values[largest]:.6g} rad, its limits are {lower:.4g} and "
            f"{upper:.4g} rad: degrees? Name the column {name}{_DEGREES} or give degrees=True; for radians, give "
            "degrees=False"
        )
    if outside:
        count = int(np.count_nonzero(beyond > 0.0))
        warn(
            f"{recording.place(worst)}: joint {name} is at {values[worst]:.6g} {unit}, outside its limits {lower:.6g} "
            f"to {upper:.6g} {unit} (in {count} of {len(values)} {recording.row}s); check the file's units and signs"
        )
    if body.continuous[joint]:
        _check_turns(values, name, recording)


def _check_turns(values: Array, name: str, recording: Recording) -> None:
    """Warn where a joint that turns without end jumps by about 2 pi: it is read as written, as a turn."""
    jumps = np.diff(values)
    turns = np.flatnonzero((np.abs(jumps) > 1.5 * np.pi) & (np.abs(jumps) < 2.5 * np.pi))
    if len(turns):
        i = int(turns[0])
        warn(
            f"{recording.place(i + 1)}: joint {name} jumps by {jumps[i]:.6g} rad from {recording.row} "
            f"{recording.rows[i]} and is taken to make this whole turn; where the angles were wrapped to one turn, "
            "unwrap them first (numpy.unwrap)"
        )


def _base(columns: dict[str, Array], recording: Recording) -> tuple[Array | None, Array | None]:
    quaternions, positions = recording.base_quat_xyzw, recording.base_position
    for group in (*_QUATERNIONS, _POSITION):
        there = [name for name in group if name in columns]
        if not there:
            continue
        if len(there) < len(group):
            lacking = ", ".join(name for name in group if name not in columns)
            raise TrajectoryError(
                f"{recording.where}: base motion with {', '.join(there)}, without {lacking}; add it or leave them out"
            )
        values = np.stack([columns[name] for name in group], axis=-1)
        if group is _POSITION:
            positions = values
        elif quaternions is not None:
            raise TrajectoryError(f"{recording.where}: the attitude of the base stands twice, as qx and as base_qx")
        else:
            quaternions = values
    attitude = None if quaternions is None else _attitude(quaternions, recording)
    return attitude, positions


def _attitude(quaternions: Array, recording: Recording) -> Array:
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(quaternions, axis=-1)
    off = np.abs(norms - 1.0)
    worst = int(np.argmax(off))
    if not off[worst] <= 1e-3:
        raise TrajectoryError(
            f"{recording.place(worst)}: the quaternion x y z w of the base has the norm {norms[worst]:.6g}; 1 is needed"
        )
    return so3.matrix_from_quat(quaternions / norms[:, None])
