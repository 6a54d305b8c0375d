"""Units of columns: what labels, files and callers state, and what values without a unit resemble."""

from __future__ import annotations

import numpy as np

from ...arrays import FARTHEST, Array
from ...body.body import Body
from ...errors import TrajectoryError
from ..unit_doubts import looks_like
from .labels import ANGLES, LENGTHS, NO_UNIT, SI
from .recording import Recording, Table, warn

_WHOLE_TURN = 2.0 * np.pi  # [rad] larger angles of base and ball joints without a unit are rather in degrees
_MANY_TURNS = 2.0 * _WHOLE_TURN  # [rad] range of a joint without limits from which its unit must be stated
_HALF_TURN = np.pi  # [rad] per sample: coarser samples do not determine the way between
_FAR_BASE = 50.0  # [m] larger distances without a unit are rather in millimetres
_SLACK = 1e-6  # relative to a limit, at least 1 rad or m: optimisers and printed digits exceed limits by less
_MOST_SHOWN = 8  # joints that a warning lists


def angle_unit(table: Table, text: str, stated: str | None, degrees: bool | None) -> tuple[str, bool]:
    """Unit of a column of angles, and True where its label, the file or the caller states it. Raises TrajectoryError.

    stated : by the label, or None
    degrees : as the caller states it, or None
    """
    if stated is not None:
        if degrees is not None and degrees != (stated == "deg"):
            spelled = "degrees" if stated == "deg" else stated
            raise TrajectoryError(
                f"{table.where}: column {text!r} is in {spelled} by its name, and degrees={degrees} was given"
            )
        return stated, True
    if degrees is None and table.degrees is None:
        raise TrajectoryError(
            f"{table.where}: the header does not say inDegrees=yes or no; add that, or give degrees=True or False "
            "(--degrees, --radians)"
        )
    in_degrees = table.degrees if degrees is None else degrees
    return "deg" if in_degrees else "rad", degrees is not None or bool(in_degrees)


def angles_in_rad(recording: Recording, text: str, values: Array, stated: str | None, degrees: bool | None) -> Array:
    """Angles (N,) of the base or a ball joint [rad]. Raises TrajectoryError for other units, and doubtful ones."""
    table = recording.table
    if stated not in (None, SI, *ANGLES):
        raise TrajectoryError(f"{table.where}: column {text!r} is in {stated}; {', '.join(ANGLES)} are possible")
    unit, _ = angle_unit(table, text, stated, degrees)
    widest = int(np.argmax(np.abs(values)))
    if stated is None and degrees is None and not table.by_format and abs(values[widest]) > _WHOLE_TURN:
        raise TrajectoryError(
            f"{recording.place(widest)}: column {text!r} is at {values[widest]:.6g} rad, more than a turn: degrees? "
            f"Name it {text}_deg or give degrees=True (--degrees); for radians, give degrees=False (--radians)"
        )
    return values * (1.0 if unit == SI else ANGLES[unit])


def lengths_in_m(recording: Recording, text: str, values: Array, stated: str | None) -> Array:
    """Coordinates (N,) of the base's place [m]. Raises TrajectoryError for other units, and doubtful ones."""
    table = recording.table
    if stated not in (None, SI, *LENGTHS):
        raise TrajectoryError(f"{table.where}: column {text!r} is in {stated}; {', '.join(LENGTHS)} are possible")
    farthest = int(np.argmax(np.abs(values)))
    if stated is None and not table.by_format and abs(values[farthest]) > _FAR_BASE:
        raise TrajectoryError(
            f"{recording.place(farthest)}: column {text!r}: {values[farthest]:.6g} m from the origin, or millimetres? "
            f"Write the unit into the header, as `{text} [mm]` or `{text} [m]`"
        )
    return values * (1.0 if stated in (None, SI) else LENGTHS[stated])


def check_range(recording: Recording, subject: str, values: Array, unit: str) -> None:
    """Raise TrajectoryError where values (N,) are too large to be represented to full accuracy."""
    farthest = int(np.argmax(np.abs(values)))
    if abs(values[farthest]) > FARTHEST:
        raise TrajectoryError(
            f"{recording.place(farthest)}: {subject} is at {values[farthest]:.6g} {unit}; up to {FARTHEST:g} {unit} "
            "can be represented to full accuracy"
        )


def check_unit(values: Array, joint: int, body: Body, recording: Recording) -> None:
    """Raise TrajectoryError where the unit of a joint's column is not known, and values resemble another one.

    That is so for angles like degrees, or lengths like millimetres: in radians or metres they would be far beyond the
    limits and in the other unit within, or a joint without limits would turn too far.

    values : (N,) [rad or m], if these are the units
    """
    name, unit, table = body.joint_names[joint], body.joint_units[joint], recording.table
    if unit == NO_UNIT:
        return
    lower, upper = body.joint_limits[joint]
    outside = values.min() < lower or values.max() > upper
    limited = bool(np.isfinite([lower, upper]).all())
    largest = int(np.argmax(np.abs(values)))
    at, limits = float(values[largest]), f"its limits are {lower:.4g} and {upper:.4g} {unit}"
    if unit == "rad":
        way = (
            f"degrees? Name the column {name}_deg or give degrees=True (--degrees); for radians, give degrees=False "
            "(--radians)"
        )
        if limited and outside and abs(at) > _WHOLE_TURN:
            raise TrajectoryError(f"{recording.place(largest)}: joint {name} is at {at:.6g} rad, {limits}: {way}")
        if table.by_format:
            return
        if limited and looks_like(values, ANGLES["deg"], lower, upper):
            raise TrajectoryError(
                f"{recording.place(largest)}: joint {name} is at {at:.6g} rad, far beyond its limits, and within them "
                f"in degrees; {limits}: {way}, and see to the signs"
            )
        if not limited and doubtful_turns(values):
            turns, step = np.ptp(values) / _WHOLE_TURN, np.abs(np.diff(values)).max()
            raise TrajectoryError(
                f"{recording.place(largest)}: joint {name} is at {at:.6g} rad; it would turn {turns:.3g} times, and up "
                f"to {step:.3g} rad from one {table.row} to the next: {way}"
            )
    elif not table.by_format and limited and looks_like(values, LENGTHS["mm"], lower, upper):
        raise TrajectoryError(
            f"{recording.place(largest)}: joint {name} is at {at:.6g} m, {limits}, and within them in millimetres; "
            f"write the unit into the header, as `{name} [mm]` or `{name} [m]`, or give names={{column: '{name} [mm]'}}"
        )


def warn_of_limits(shapes: Array, body: Body, recording: Recording) -> None:
    """Issue one TrajectoryWarning for the joints that leave their limits: (N, n) [rad or m]."""
    lower, upper = body.joint_limits.T
    beyond = np.maximum(lower - shapes, shapes - upper)
    # Infinite limits are never left.
    nearest = np.where(lower - shapes > shapes - upper, lower, upper)
    size = np.maximum(1.0, np.abs(np.where(np.isfinite(nearest), nearest, 0.0)))
    excess = beyond / size
    left = np.flatnonzero(excess.max(axis=0, initial=0.0) > _SLACK)
    if not len(left):
        return
    sample, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    count, row, unit = int(np.count_nonzero(excess[:, joint] > _SLACK)), recording.table.row, body.joint_units[joint]
    others = [body.joint_names[k] for k in left if k != joint]
    more = f" and {len(others) - _MOST_SHOWN} more" if len(others) > _MOST_SHOWN else ""
    also = f"; beyond theirs, too: {', '.join(others[:_MOST_SHOWN])}{more}" if others else ""
    warn(
        f"{recording.place(int(sample))}: joint {body.joint_names[joint]} is at {shapes[sample, joint]:.6g} {unit}, "
        f"outside its limits {lower[joint]:.6g} to {upper[joint]:.6g} {unit} by {beyond[sample, joint]:.3g} {unit} (in "
        f"{count} of {len(shapes)} {row}s){also}; check the file's units and signs (--degrees, --radians, --names)"
    )


def doubtful_turns(values: Array) -> bool:
    """True where angles [rad] of a joint without limits would be taken for degrees if no unit were stated."""
    return bool(np.ptp(values) > _MANY_TURNS or np.abs(np.diff(values)).max(initial=0.0) > _HALF_TURN)


def warn_of_turns(values: Array, name: str, recording: Recording) -> None:
    """Warn where a joint that turns without end jumps by about 2 pi: it is read as written, as a turn."""
    jumps = np.diff(values)
    turns = np.flatnonzero((np.abs(jumps) > 1.5 * np.pi) & (np.abs(jumps) < 2.5 * np.pi))
    if len(turns):
        i = int(turns[0])
        row, rows = recording.table.row, recording.table.rows
        warn(
            f"{recording.place(i + 1)}: joint {name} jumps by {jumps[i]:.6g} rad from {row} {rows[i]} and is taken to "
            "make this whole turn; where the angles were wrapped to one turn, unwrap them first (numpy.unwrap)"
        )
