"""Labels and units of columns, such as `knee [deg]`: what labels, files and callers state, and what values resemble."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import NamedTuple

import numpy as np

from ...arrays import FARTHEST, Array
from ...body.body import Body
from ...errors import TrajectoryError
from ...letters import value_text
from ..body_path import looks_like
from .recording import Recording, Table, listed, warn

ANGLES = {"rad": 1.0, "deg": float(np.radians(1.0)), "mrad": 1e-3}  # unit -> size [rad]
LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}  # unit -> size [m]
IN_A_SECOND = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9, "min": 1.0 / 60.0}  # division keeps whole ms exact
SI = "SI"  # unit of a column in rad or m, as its joint has it; written by `write_shape_path` where needed
NO_UNIT = "1"  # of a quaternion's numbers
_SPELLINGS = {
    "rad": ("rad", "rads", "radian", "radians"),
    "deg": ("deg", "degs", "degree", "degrees", "°"),
    "mrad": ("mrad", "milliradian", "milliradians"),
    "m": ("m", "metre", "metres", "meter", "meters"),
    "cm": ("cm", "centimetre", "centimetres", "centimeter", "centimeters"),
    "mm": ("mm", "millimetre", "millimetres", "millimeter", "millimeters"),
    "s": ("s", "sec", "secs", "second", "seconds"),
    "ms": ("ms", "msec", "msecs", "millisecond", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
    "min": ("min", "minute", "minutes"),
    SI: ("si",),
    NO_UNIT: ("1",),
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}
_RATE = re.compile(r"(?P<angle>[^\W\d_]+?|°)\s*(?:/\s*s(?:ec)?|[_ .*·]?s(?:ec)?\^?-1|_s)", re.I)
RPM = 2.0 * float(np.pi) / 60.0  # [rad/s]
_OTHER_RATES = {
    "dps": ANGLES["deg"],
    **dict.fromkeys(("rpm", "rev/min", "r/min", "1/min"), RPM),
}  # unit -> size [rad/s]
RATE_UNITS = "rad/s, deg/s, rpm"  # for messages
_BRACKETED = re.compile(r"(?P<name>.*\S)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\))", re.DOTALL)
# Any unit may follow an underscore; only whole words follow a blank or a point.
_SUFFIXED = re.compile(r"(?P<name>.*[^\s_.])(?P<mark>[\s_.]|(?=°))(?P<unit>[^\W\d_]+|°)", re.DOTALL)
_WORDS = {"rad", "deg", "ms"}
_WITH_UNIT = (  # `gyro_x [deg/s]`, `gyro_x_dps`, `gyro_x_rad_s`
    re.compile(r"(?P<name>.*\S)\s*[\[(](?P<unit>[^\[\]()]*)[\])]", re.DOTALL),
    *(re.compile(rf"(?P<name>.+)[_ ](?P<unit>{unit})", re.DOTALL) for unit in (r"[^_ ]+", r"[^_ ]+_[^_ ]+")),
)
_NO_UNITS = ("", "-")  # in the brackets of columns without a unit
_OTHER_UNIT = re.compile(  # units of rates, forces and other quantities beside a posture
    r"(rad|deg|°|m|cm|mm|rev|r)\s*([/ ]\s*(s|min)|s\^?-1|\s*s\^-1)\S*|rpm|n|nm|n\*m|n\.m|a|ma|v|w|°c|degc|pa|bar", re.I
)
_POSITIONS = ("position", "pos", "angle", "value", "q", "qpos")
_COMPANIONS = (  # quantities recorded of a joint beside its position
    *("velocity", "vel", "speed", "dq", "qd", "qvel", "qdot", "rate", "acceleration", "acc", "ddq", "qdd"),
    *("effort", "torque", "tau", "force", "current", "temperature", "command", "cmd", "desired", "target", "reference"),
)
_COUNTERS = (  # columns that count rows, in lower case without marks
    *("frame", "frames", "framenumber", "subframe", "index", "sample", "samples", "seq", "count", "counter", "row"),
)
_QUANTITY = re.compile(r"(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?P<unit>[^\W\d_]*|°)")
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_WHOLE_TURN = 2.0 * np.pi  # [rad] larger angles of base and ball joints without a unit are rather in degrees
_MANY_TURNS = 2.0 * _WHOLE_TURN  # [rad] range of a joint without limits from which its unit must be stated
_HALF_TURN = np.pi  # [rad] per sample: coarser samples do not determine the way between
_FAR_BASE = 50.0  # [m] larger distances without a unit are rather in millimetres
_SLACK = 1e-6  # relative to a limit, at least 1 rad or m: optimisers and printed digits exceed limits by less
_MOST_SHOWN = 8  # joints that a warning lists


class Label(NamedTuple):
    """Name of a column without its unit, and the unit, or None."""

    name: str
    unit: str | None


def label(text: str) -> Label:
    """The parts of a label: `knee [deg]`, `knee (deg)`, `knee_deg`, `knee deg` and `knee°` are the knee in degrees.

    Text in brackets that is no unit belongs to the name.
    """
    bracketed = _BRACKETED.fullmatch(text)
    if bracketed is not None:
        inside = bracketed["square"] if bracketed["square"] is not None else bracketed["round"]
        if inside.strip() in _NO_UNITS:
            return Label(bracketed["name"], None)
        # Without a blank before it, a number in brackets counts: `q[1]` is the second of them.
        unit = None if inside.isdigit() and text[bracketed.end("name")] in "[(" else unit_of(inside)
        return Label(bracketed["name"], unit) if unit is not None else Label(text, None)
    suffixed = _SUFFIXED.fullmatch(text)
    if suffixed is not None:
        unit = unit_of(suffixed["unit"])
        if unit is not None and (suffixed["mark"] == "_" or unit in _WORDS):
            return Label(suffixed["name"], unit)
    return Label(text, None)


def other_unit(text: str) -> str | None:
    """Unit of a rate or a force in brackets behind a name, or None."""
    bracketed = _BRACKETED.fullmatch(text)
    inside = "" if bracketed is None else bracketed["square"] or bracketed["round"] or ""
    return inside if _OTHER_UNIT.fullmatch(inside.strip()) else None


def rate_label(text: str) -> Label:
    """Name and unit of a column of rates: `gyro_x [deg/s]`, `omega_x_rad_s` and `wx dps` have one, others None."""
    for pattern in _WITH_UNIT:
        match = pattern.fullmatch(text)
        if match is not None and rate_size(match["unit"]) is not None:
            return Label(match["name"], match["unit"].strip())
    return Label(text, None)


def speed(text: str, what: str) -> float | None:
    """A speed such as `6000rpm`, `-3 deg/s` or `628` [rad/s]; None for a text that does not begin with a number.

    Raises TrajectoryError for a number with another unit.
    """
    number = _NUMBER.match(text.strip())
    if number is None:
        return None
    behind = text.strip()[number.end() :].strip()
    size = rate_size(behind or "rad/s")
    if size is None:
        raise TrajectoryError(f"{what}: {behind!r:.40} is no unit of speed; these are: {RATE_UNITS}")
    return float(number[0]) * size


def is_counter(text: str) -> bool:
    """True for the name of a column that counts rows, such as `Sub Frame` or `field.header.seq`."""
    return re.sub(r"[\s_#]", "", re.split(r"[./]", text)[-1]).lower() in _COUNTERS


def joint_part(text: str, joints: Collection[str]) -> tuple[str, str] | None:
    """The joint that a longer name ends or begins with, and the quantity, "" for its position; None without a joint.

    `/joint_states/knee/position`, `knee_pos`, `position.knee` and `/states/knee` are the knee; `knee_velocity` is
    recorded beside it.
    """
    for word in (*_POSITIONS, *_COMPANIONS):
        small = text.lower()
        for mark in "/._ ":
            if small.endswith(mark + word):
                stem = text[: -len(word) - 1]
            elif small.startswith(word + mark):
                stem = text[len(word) + 1 :]
            else:
                continue
            joint = _at_the_end(stem, joints)
            if joint is not None:
                return joint, "" if word in _POSITIONS else word
    joint = _at_the_end(text, joints) if "/" in text else None
    return None if joint is None else (joint, "")


def _at_the_end(text: str, joints: Collection[str]) -> str | None:
    """The longest joint that a path ends with, or None."""
    ends = [name for name in joints if text == name or text.endswith(("/" + name, "." + name))]
    return max(ends, key=len, default=None)


def unit_of(text: str) -> str | None:
    """Unit by one of its spellings, or None."""
    return _UNITS.get(text.strip().lower())


def rate_size(text: str) -> float | None:
    """Unit of an angular velocity, such as `deg/s`, `rad_s`, `dps` or `rpm` [rad/s]; None for another text."""
    match = _RATE.fullmatch(text.strip())
    angle = None if match is None else unit_of(match["angle"])
    return _OTHER_RATES.get(text.strip().lower()) if angle is None else ANGLES.get(angle)


def in_square_brackets(text: str) -> str | None:
    """Text in square brackets behind a name, a unit or meant as one; None without brackets."""
    bracketed = _BRACKETED.fullmatch(text)
    return bracketed["square"] if bracketed is not None else None


def time_unit_argument(unit: str | None) -> str | None:
    """Unit of time by one of its spellings. Raises TrajectoryError."""
    if unit is None:
        return None
    known = unit_of(unit) if isinstance(unit, str) else None
    if known not in IN_A_SECOND:
        raise TrajectoryError(f"time_unit: one of {', '.join(IN_A_SECOND)} is needed, got {value_text(unit)}")
    return known


def quantity(value: object, unit: str, what: str) -> float:
    """A number in the unit of a joint, "rad", "m" or none, or a text such as `30deg` or `5 mm`, in SI units."""
    number, stated = _number_and_unit(value, what)
    sizes = ANGLES if unit == "rad" else LENGTHS
    if stated is None:
        return number
    if unit == NO_UNIT:
        raise TrajectoryError(f"{what}: {value!r:.40} is in {stated}, and a quaternion has no unit")
    if stated not in sizes:
        kind = "turns" if unit == "rad" else "slides"
        raise TrajectoryError(
            f"{what}: {value!r:.40} is in {stated}, and the joint {kind}; give it in {', '.join(sizes)}"
        )
    return number * sizes[stated]


def seconds(value: object, what: str) -> float:
    """A number of seconds, or a text with a unit of time such as `0.1s` or `100ms`. Raises TrajectoryError."""
    match = _QUANTITY.fullmatch(value.strip()) if isinstance(value, str) else None
    unit = None if match is None else unit_of(match["unit"] or "s")
    if match is not None and unit in IN_A_SECOND:
        return float(match["number"]) / IN_A_SECOND[unit]
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise TrajectoryError(f"{what}: seconds, as 0.1, '0.1s' or '100ms', are needed, got {value_text(value)}")
    return float(value)


def amounts(value: object, what: str) -> dict[str, float]:
    """Amounts of an angle, a length, and a quaternion, which has half of its turn: {"rad": ..., "m": ..., "1": ...}.

    A number is both angle and length; a text such as `3deg` or `3deg,5mm` names them, and others are zero.
    """
    given: dict[str, float] = {}
    for part in value.split(",") if isinstance(value, str) else [value]:
        number, stated = _number_and_unit(part, what)
        if number < 0.0:
            raise TrajectoryError(f"{what}: zero or more is needed, got {value_text(value)}")
        for kind in ["rad", "m"] if stated is None else ["rad" if stated in ANGLES else "m"]:
            if kind in given:
                raise TrajectoryError(f"{what}: {value!r:.40} says two amounts of one kind")
            given[kind] = number * (1.0 if stated is None else (ANGLES | LENGTHS)[stated])
    angle = given.get("rad", 0.0)
    return {"rad": angle, "m": given.get("m", 0.0), NO_UNIT: 0.5 * angle}


def _number_and_unit(value: object, what: str) -> tuple[float, str | None]:
    stated = None
    if isinstance(value, str):
        match = _QUANTITY.fullmatch(value.strip()) if value.isascii() or "°" in value else None
        stated = unit_of(match["unit"]) if match is not None and match["unit"] else None
        if match is None or (match["unit"] and stated not in ANGLES | LENGTHS):
            units = ", ".join(ANGLES | LENGTHS)
            raise TrajectoryError(
                f"{what}: a number is needed, with one of {units} behind it or none; got {value_text(value)}"
            )
        value = match["number"]
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise TrajectoryError(
            f"{what}: a number or a text such as '30deg' is needed, got {value_text(value)}"
        ) from None
    if not np.isfinite(number):
        raise TrajectoryError(f"{what}: a finite number is needed, got {value_text(value)}")
    return number, stated


def angle_unit(table: Table, text: str, stated: str | None, degrees: bool | None) -> tuple[str, bool]:
    """Unit of a column of angles, and True where its label (`stated`), the file or the caller states it."""
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
                f"to {step:.3g} rad from one {table.row} to the next: {way}{wheel_hint(body, name)}"
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
    also = f"; beyond theirs, too: {listed(others, _MOST_SHOWN)}" if others else ""
    warn(
        f"{recording.place(int(sample))}: joint {body.joint_names[joint]} is at {shapes[sample, joint]:.6g} {unit}, "
        f"outside its limits {lower[joint]:.6g} to {upper[joint]:.6g} {unit} by {beyond[sample, joint]:.3g} {unit} (in "
        f"{count} of {len(shapes)} {row}s){also}; check the file's units and signs (--degrees, --radians, --names)"
    )


def wheel_hint(body: Body, *joints: str) -> str:
    """What to type for the first of some joints that turns without end, as a wheel does; "" without one."""
    name = next((name for name in joints if body.continuous[body.joint_index(name)]), None)
    if name is None:
        return ""
    return (
        f". A wheel has a speed instead, --rotor-speed {name}=COLUMN or {name}=6000rpm, or a momentum, --rotor "
        f"{name}=1.5: leave it out of the path, without=[{name!r}], and give articulated rotor_speeds= or rotors="
    )


def doubtful_turns(values: Array) -> bool:
    """True where angles [rad] of a joint without limits would be taken for degrees if no unit were stated."""
    return bool(np.ptp(values) > _MANY_TURNS or np.abs(np.diff(values)).max(initial=0.0) > _HALF_TURN)


def warn_of_turns(values: Array, name: str, recording: Recording) -> None:
    """Warn where an angle jumps by about 2 pi, within its limits or without any: it is read as written, as a turn."""
    jumps = np.diff(values)
    turns = np.flatnonzero(np.abs(np.abs(jumps) - _WHOLE_TURN) < 0.5 * _HALF_TURN)
    if len(turns):
        i = int(turns[0])
        row, rows = recording.table.row, recording.table.rows
        warn(
            f"{recording.place(i + 1)}: joint {name} jumps by {jumps[i]:.6g} rad from {row} {rows[i]} and is taken to "
            "make this whole turn; where the angles were wrapped to one turn, unwrap them first (numpy.unwrap)"
        )
