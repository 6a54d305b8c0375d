"""Flight within a recording: the stretch between take-off and landing, found or given."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ... import so3
from ...arguments import positive_argument
from ...arrays import Array
from ...body.body import Body
from ...display import short_repr
from ...errors import ShapeError, TrajectoryError, unknown_name
from ...letters import value_text
from ..fall_units import check_gravity, check_parabola, is_long, slipped_fall
from ..free_fall import GRAVITY, UP_AXES, FreeFall, centre_noise, fall_number, free_fall, lasts
from ._joint_columns import Matched
from .base_columns import ESTIMATE
from .recording import Recording
from .times import part_of, samples_within, trim_argument

AUTO = "auto"  # the flight is found by the fall of the centre of mass
ALL = "all"  # the whole recording is the flight
RECORDED = "recorded"  # as AUTO where the base is recorded, ALL without places or a fall, else no flight
ANY_GRAVITY = "any"  # units of length and time are not checked
_NUMBERED = re.compile(rf"{AUTO}:([1-9]\d{{0,5}})")
_STILL = 1e-12  # rounding of the entries of a constant rotation
_FEWEST = 3  # samples: a fit has six unknowns


@dataclass(frozen=True)
class Flight:
    """Stretch of a recording on which the body is free.

    Attributes
    ----------
    first_time, last_time : as the file gives the time
    by : "auto", "all" or "times": how it was found
    fall : how the centre of mass falls there, where the flight was found by it
    requested : True if the caller requested it; else the recorded base has to show that it is one
    all_times : the first and last times of all flights of the recording, as the file gives them, where it was searched

    Examples
    --------
    >>> sp.shape_space.files.Flight(first_time=12.5, last_time=13.9, by="times").record["last_time"]
    13.9
    """

    first_time: float
    last_time: float
    by: str
    fall: FreeFall | None = None
    requested: bool = True
    all_times: tuple[tuple[float, float], ...] = ()

    __repr__ = short_repr

    @property
    def record(self) -> dict[str, Any]:
        """Times, method and fall, ready for JSON."""
        record = {"first_time": self.first_time, "last_time": self.last_time, "by": self.by}
        if self.fall is not None:
            record |= {"up": self.fall.up, "centre_noise_m": self.fall.noise, "off_parabola_rms_m": self.fall.off}
            record |= {"gravity_m_s2": self.fall.gravity, "gravity_bar_m_s2": self.fall.gravity_bar}
            record |= {"all": [list(ends) for ends in self.all_times]}
        return record


@dataclass(frozen=True)
class FlightChoices:
    """How a flight is found in a recording, checked: options of `read_recorded_motion`.

    number : of the flight in time, from 1 on; None: the longest one
    """

    request: str | tuple[float, float] | None = None
    up: str | None = None
    gravity: float | None = GRAVITY
    number: int | None = None


def flight_choices(flight: str | Sequence[float] | None, up: str | None, gravity: float | str | None) -> FlightChoices:
    """Flight, axis and gravity, checked. Raises ShapeError, UnknownNameError."""
    if up is not None and (not isinstance(up, str) or up not in UP_AXES):
        raise unknown_name("axis", up, UP_AXES)
    expected: float | None = GRAVITY
    if isinstance(gravity, str):
        if gravity != ANY_GRAVITY:
            raise ShapeError(f"gravity: a number of m/s^2, or {ANY_GRAVITY!r}, is needed, got {value_text(gravity)}")
        expected = None
    elif gravity is not None:
        expected = positive_argument(gravity, "gravity", "an acceleration in m/s^2")
    numbered = _NUMBERED.fullmatch(flight) if isinstance(flight, str) else None
    if numbered is not None:
        return FlightChoices(AUTO, up, expected, int(numbered[1]))
    if flight is None or (isinstance(flight, str) and flight in (AUTO, ALL, RECORDED)):
        return FlightChoices(flight, up, expected)
    if isinstance(flight, str) or not isinstance(flight, Sequence | np.ndarray) or len(flight) != 2:
        raise ShapeError(
            f"flight: {AUTO!r}, '{AUTO}:2' (the second), {ALL!r}, {RECORDED!r} or two times are needed, got "
            f"{value_text(flight)}"
        )
    first, last = flight
    return FlightChoices(trim_argument((first, last), "flight"), up, expected)


def turns(attitudes: Array | None) -> bool:
    """True where a base was recorded (N, 3, 3) that turns; files of a fixed base have one attitude in every sample."""
    return attitudes is not None and bool(np.ptp(attitudes, axis=0).max() > _STILL)


def in_flight(
    recording: Recording, motion: Matched, body: Body, choices: FlightChoices
) -> tuple[Recording, Matched, Flight | None]:
    """The part of a recording and of its motion that is the flight; all of them where none is requested."""
    request, where, base = choices.request, recording.table.where, motion.base
    if request is None or (request == RECORDED and not turns(base.attitude)):
        return recording, motion, None
    if base.attitude is None and not (isinstance(request, tuple) or (request == ALL and base.rates is not None)):
        raise TrajectoryError(
            f"{where}: a flight is fitted to the recorded attitude of the base, and there is none; columns such as "
            "base_qx base_qy base_qz base_qw or pelvis_tilt pelvis_list pelvis_rotation are needed. Or give the "
            "momentum instead of a flight: momentum=[0, 0, 0] (--momentum 0 0 0)"
        )
    times, clock, flights, fall = recording.times, recording.clock, (), None
    samples = np.arange(len(times)) if isinstance(request, str) else samples_within(recording.table, request)
    centres = None
    if base.position is not None and base.attitude is not None and (base.record or {}).get("axes") != ESTIMATE:
        centres = base.position + so3.apply(base.attitude, body.centre_of_mass(motion.shapes))
    if request == AUTO or (request == RECORDED and centres is not None):
        fall = _fall(recording, motion, centres, choices)
        if fall is not None and centres is not None:
            flights = tuple((float(clock[first]), float(clock[last])) for first, last in fall.all_ends)
            if choices.number is not None:
                if choices.number > len(flights):
                    known = ", ".join(f"{first:.6g} to {last:.6g}" for first, last in flights)
                    raise TrajectoryError(
                        f"{where}: there is no flight number {choices.number}, there are {len(flights)}: {known} "
                        f"{recording.time_unit}; take one of them (--flight auto:{len(flights)})"
                    )
                fall = fall_number(times, centres, fall, choices.number)
            samples = np.arange(fall.first, fall.last + 1)
    elif centres is not None and choices.gravity is not None and len(samples) >= _FEWEST:
        noise = centre_noise(times, centres)
        check_parabola(times[samples], centres[samples], noise, choices.gravity, where)
    if len(samples) < _FEWEST:
        raise TrajectoryError(
            f"{where}: {len(samples)} samples are in the flight, three or more are needed; the recording goes from "
            f"{recording.first:.9g} to {recording.last:.9g} {recording.time_unit}: flight=(first, last) (--flight "
            "FIRST LAST)"
        )
    part = part_of(recording, samples)
    method = AUTO if fall is not None else ALL if isinstance(request, str) else "times"
    return part, motion.kept(samples), Flight(part.first, part.last, method, fall, request != RECORDED, flights)


def _fall(recording: Recording, motion: Matched, centres: Array | None, choices: FlightChoices) -> FreeFall | None:
    """The fall of a recording; None where there is none and none was requested."""
    where, base, gravity = recording.table.where, motion.base, choices.gravity or GRAVITY
    if base.position is None:
        raise TrajectoryError(
            f"{where}: a flight is found by the fall of the centre of mass, and the position of the base is not "
            "recorded; give its times: flight=(first, last) (--flight FIRST LAST), or flight='all' (--flight all)"
        )
    if centres is None:
        raise TrajectoryError(
            f"{where}: where the centre of mass is, is not known before the axes of the base are; give the times of "
            "the flight: flight=(first, last) (--flight FIRST LAST)"
        )
    times, up = recording.times, choices.up or recording.table.up
    missing, fall = None, None
    try:
        fall = free_fall(times, centres, where, up=up, gravity=gravity)
    except TrajectoryError as error:
        missing = error
    if fall is None or not is_long(fall, times):
        # In wrong units, too, the body may accelerate by g for a moment.
        slipped = slipped_fall(times, base.position, centres - base.position, gravity, up)
        if slipped is not None and (fall is None or lasts(times, slipped.ends) > 2.0 * lasts(times, fall.ends)):
            fall = slipped
    if fall is not None and choices.gravity is not None:
        check_gravity(fall.gravity, fall.gravity_bar, choices.gravity, times, where)
    if fall is None and missing is not None and choices.request == AUTO:
        raise missing
    return fall
