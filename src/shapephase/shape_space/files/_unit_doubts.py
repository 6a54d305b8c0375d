"""Angles and lengths of which nobody has said the unit: where they look like degrees or millimetres, one is asked."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...body.body import Body
from ...errors import TrajectoryError
from ..unit_doubts import looks_like
from ._labels import ANGLES, LENGTHS, NO_UNIT
from ._recording import Recording, warn

_WHOLE_TURN = 2.0 * np.pi
_MANY_TURNS = 2.0 * _WHOLE_TURN
"""Range of a joint without limits [rad] from which on one asks; wheels turn on, but who counts their turns says so."""
_HALF_TURN = np.pi
"""From one sample to the next [rad]: a recording that is so coarse tells nothing about the way between."""
_SLACK = 1e-9


def check_unit(values: Array, joint: int, body: Body, recording: Recording) -> None:
    """Raise TrajectoryError where the unit of a joint's column is not known, and values look like another one.

    That is so for angles like degrees, or lengths like millimetres: in radians or metres they would be far beyond the
    limits and in the other unit within, or a joint without limits would turn too far.

    Parameters
    ----------
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


def warn_of_values(values: Array, joint: int, body: Body, recording: Recording) -> None:
    """Issue a TrajectoryWarning where a joint leaves its limits, or jumps by a whole turn: (N,) [rad or m]."""
    name, unit = body.joint_names[joint], body.joint_units[joint]
    lower, upper = body.joint_limits[joint]
    beyond = np.maximum(lower - values, values - upper)
    worst = int(np.argmax(beyond))
    if beyond[worst] > _SLACK * max(1.0, abs(values[worst])):
        count = int(np.count_nonzero(beyond > 0.0))
        warn(
            f"{recording.place(worst)}: joint {name} is at {values[worst]:.6g} {unit}, outside its limits {lower:.6g} "
            f"to {upper:.6g} {unit} (in {count} of {len(values)} {recording.table.row}s); check the file's units and "
            "signs"
        )
    if body.continuous[joint]:
        _check_turns(values, name, recording)


def doubtful_turns(values: Array) -> bool:
    """Whether angles [rad] of a joint without limits would be taken for degrees where nobody says the unit."""
    return bool(np.ptp(values) > _MANY_TURNS or np.abs(np.diff(values)).max(initial=0.0) > _HALF_TURN)


def _check_turns(values: Array, name: str, recording: Recording) -> None:
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
