"""The flight within a recording: the stretch between take-off and landing, found or given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import so3
from ...body.body import Body
from ...display import short_repr
from ...errors import ShapeError, TrajectoryError
from ...letters import what_came
from ._base_columns import ESTIMATE
from ._free_fall import FreeFall, free_fall
from ._joint_columns import Matched
from ._recording import Recording
from ._times import part_of, samples_within, trim_argument

AUTO = "auto"
"""Instead of two times: the flight is found by the fall of the centre of mass."""
ALL = "all"
"""Instead of two times: the body is free all the time."""
# Of a flight, to which six numbers are fitted.
_FEWEST = 3


@dataclass(frozen=True)
class Flight:
    """A stretch of a recording on which the body is free.

    Attributes
    ----------
    first_time, last_time : as the file tells the time
    by : "auto", "all" or "times": how it was found
    fall : how the centre of mass falls there, where the flight was found by it

    Examples
    --------
    >>> sp.shape_space.files.Flight(first_time=12.5, last_time=13.9, by="times").record["last_time"]
    13.9
    """

    first_time: float
    last_time: float
    by: str
    fall: FreeFall | None = None

    __repr__ = short_repr

    @property
    def record(self) -> dict[str, Any]:
        """The same as JSON can hold it."""
        found = {"first_time": self.first_time, "last_time": self.last_time, "by": self.by}
        if self.fall is not None:
            found |= {"up": self.fall.up, "centre_noise_m": self.fall.noise, "off_parabola_rms_m": self.fall.off}
        return found


def flight_argument(flight: str | Sequence[float] | None) -> str | tuple[float, float] | None:
    """A user's flight. Raises ShapeError."""
    if flight is None or (isinstance(flight, str) and flight in (AUTO, ALL)):
        return flight
    if isinstance(flight, str) or not isinstance(flight, Sequence | np.ndarray) or len(flight) != 2:
        raise ShapeError(f"flight: {AUTO!r}, {ALL!r} or two times are needed, got {what_came(flight)}")
    first, last = flight
    return trim_argument((first, last), "flight")


def in_flight(
    recording: Recording, motion: Matched, body: Body, said: str | tuple[float, float] | None
) -> tuple[Recording, Matched, Flight | None]:
    """The part of a recording and of its motion that is the flight; all of them where nobody asks for one.

    Raises
    ------
    TrajectoryError
        If the attitude of the base was not recorded, or, where the flight is to be found, its position; if none is
        found, or less than three samples are in it.
    """
    if said is None:
        return recording, motion, None
    where, base = recording.table.where, motion.base
    if base.attitude is None:
        raise TrajectoryError(
            f"{where}: a flight is fitted to the recorded attitude of the base, and there is none; columns such as "
            "base_qx base_qy base_qz base_qw or pelvis_tilt pelvis_list pelvis_rotation are needed"
        )
    fall = None
    if said == AUTO:
        fall = _fall(recording, motion, body)
        samples = np.arange(fall.first, fall.last + 1)
    elif isinstance(said, tuple):
        samples = samples_within(recording, said)
    else:
        samples = np.arange(len(recording.times))
    if len(samples) < _FEWEST:
        raise TrajectoryError(
            f"{where}: {len(samples)} samples are in the flight, three or more are needed; the recording goes from "
            f"{recording.first:.9g} to {recording.last:.9g} {recording.time_unit}"
        )
    by = "times" if isinstance(said, tuple) else said
    part = part_of(recording, samples)
    return part, motion.kept(samples), Flight(part.first, part.last, by, fall)


def _fall(recording: Recording, motion: Matched, body: Body) -> FreeFall:
    where, base = recording.table.where, motion.base
    if base.position is None or base.attitude is None:
        raise TrajectoryError(
            f"{where}: a flight is found by the fall of the centre of mass, and the position of the base is not "
            "recorded; give its times: flight=(first, last) (--flight FIRST LAST), or flight='all' (--flight all)"
        )
    if base.record is not None and base.record["axes"] == ESTIMATE:
        raise TrajectoryError(
            f"{where}: where the centre of mass is, is not known before the axes of the base are; give the times of "
            "the flight: flight=(first, last) (--flight FIRST LAST)"
        )
    centres = base.position + so3.apply(base.attitude, body.centre_of_mass(motion.shapes))
    return free_fall(recording.times, centres, where)
