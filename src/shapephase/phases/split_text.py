"""A split in words and numbers: the table that is printed, on the command line and by `print(split)`."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING

import numpy as np

from .. import so3
from ..arrays import Array

if TYPE_CHECKING:
    from .phase_split import PhaseSplit

CLOSED_GAP = math.radians(1.0)  # [rad] gap of the momentum above which a result states its closing
DEGREE_DIGITS = 6  # after the point of an angle in degrees, at most: its error may leave fewer
RADIAN_DIGITS = 9  # after the point of an angle in radians, at most
_AXIS_DIGITS = 6  # after the point
_NO_TURN = 1e-12  # [rad] a smaller turn is printed without its axis
_WIDTH = 88  # letters of a line, the width of the table


def split_lines(result: PhaseSplit, heading: str = "", shape_gap: str = "") -> list[str]:
    """The table of a split; angles in degrees first, then in radians, with no more digits than their errors leave.

    heading : the first line; without it what moved, for how long, with which momentum
    shape_gap : how far the shape is from its start in the end, with a unit; without it the number alone
    """
    about = result.about
    if about.momentum.ndim > 1:
        return _batch_lines(result, heading)
    momentum = " ".join(f"{v:g}" for v in about.momentum)
    errors = result.error_estimates
    closing = [_phase_line("    by the closing", result.closing_phase, errors.closing_phase)] if is_open(result) else []
    lines = [
        heading or f"{about.label}: {about.duration:g} s, momentum ({momentum}) kg m^2/s",
        "",
        f"{'':24}{'angle [deg]':>16}{'± [rad]':>11}   axis (inertial)",
        rotation_line("total rotation", result.total_rotation, errors.total_rotation),
        rotation_line(
            "  shape holonomy" if result.is_loop else "  shape lift (open)", result.holonomy, errors.holonomy
        ),
        *_dynamical_lines(result),
        "",
    ]
    if result.has_phase:
        lines += [
            f"{f'seen in the {result.gauge} gauge':30}{'[deg]':>10}{'± [rad]':>11}{'[rad]':>20}",
            _phase_line("Montgomery phase", result.montgomery_phase, errors.montgomery_phase),
            _phase_line("  dynamic phase", result.dynamic_phase, errors.dynamic_phase),
            _phase_line("  geometric phase", result.geometric_phase, errors.geometric_phase),
            *closing,
            rotation_line("tilt of the closing", result.closing_tilt, errors.closing_tilt),
            _phase_line("momentum gap", result.momentum_gap, errors.momentum_gap),
            f"{'residual':24}{result.residual:16.2e} rad   (the phase by its formula, less that of the attitude)",
        ]
    else:
        words = "no angular momentum: the shape alone turns the body, there is no Montgomery phase"
        lines.append("no total angular momentum, no Montgomery phase" if result.has_wheels else words)
    if not result.is_loop:
        gap = shape_gap or f"{result.shape_gap:.6g}, of the joint that ends farthest off (rad or m)"
        lines.append(f"{'shape gap':24}{gap}: the shape does not return, there is no holonomy")
    lines += [
        f"{'error estimate':24}{about.error_estimate:16.2e} rad   (of the attitude, at all times)",
        f"{'evaluations':24}{about.evaluations:16d}       (of the body, each at one time)",
    ]
    return [*lines, *wrapped(closing_text(result)), *wrapped(_wheel_text(result))]


def _dynamical_lines(result: PhaseSplit) -> list[str]:
    """Return lines of what shape does not turn the body by, with wheels in its parts."""
    errors = result.error_estimates
    whole = rotation_line("  dynamical rotation", result.dynamical_rotation, errors.dynamical_rotation)
    if not result.has_wheels:
        return [whole]
    stored = rotation_line("  stored wheel momentum", result.wheel_rotation, errors.wheel_rotation)
    if not result.has_phase:
        return [stored]
    added = rotation_line("  total momentum", result.momentum_rotation, errors.momentum_rotation)
    return [
        stored,
        added,
        rotation_line("  the last two together", result.dynamical_rotation, errors.dynamical_rotation),
    ]


def _wheel_text(result: PhaseSplit) -> str:
    """Return how the turns of a body with wheels compose, and on what each depends; "" without wheels."""
    if not result.has_wheels:
        return ""
    shape = "holonomy" if result.is_loop else "lift"
    return (
        f"The turns follow each other: {shape} of the shape, stored wheel momentum"
        f"{', total momentum' if result.has_phase else ''}. The {shape} is the same at any pace; the turn by stored "
        "wheel momentum grows with the time that the motion takes."
    )


def wrapped(words: str) -> list[str]:
    """Words in lines as wide as the table, below an empty one; none without words."""
    return ["", *textwrap.wrap(words, _WIDTH)] if words else []


def is_open(result: PhaseSplit) -> bool:
    """True where the momentum of one motion ends so far from its start that its closing has to be stated."""
    return bool(result.has_phase) and float(result.momentum_gap) > CLOSED_GAP


def closing_text(result: PhaseSplit) -> str:
    """Closing of the momentum's curve and its part of the phase, as a sentence; "" where the curve closes by itself."""
    if not is_open(result):
        return ""
    gap, added = float(result.momentum_gap), float(result.closing_phase)
    return (
        f"The momentum does not close: a great circle of {degrees_text(gap)} from its end to its start closes it. "
        f"That adds {degrees_text(added, sign=True)} to the geometric phase, and the tilt of the "
        "closing, a turn by the angle of the gap."
    )


def degrees_text(angle: float, *, sign: bool = False) -> str:
    """An angle in degrees and in radians."""
    return f"{math.degrees(angle):{'+' if sign else ''}.4f} deg ({angle:{'+' if sign else ''}.6f} rad)"


def digits_left(error: float, most: int) -> int:
    """Digits after the point that an error leaves to a number, `most` at most: the last is below its half.

    An error of 3e-4 gives four, an error above one none.
    """
    if not error > 0.0:
        return most
    return int(np.clip(1 - math.ceil(math.log10(error)), 0, most)) if math.isfinite(error) else 0


def _aligned(value: float, error: float, most: int) -> str:
    """A number with the digits that its error leaves, and spaces instead of the others."""
    digits = digits_left(error, most)
    return f"{value:.{digits}f}" + " " * (most - digits + (digits == 0))


def rotation_line(name: str, rotation: Array, error: Array | None = None) -> str:
    """Angle and axis of a rotation, with the angle by which it may be off [rad] where that is known.

    The axis has no more digits than the error leaves it: it is the less certain the smaller the angle.
    """
    vector = so3.log(rotation)
    turn = float(np.linalg.norm(vector))
    digits, column = _AXIS_DIGITS, ""
    if error is not None:
        column = f"{float(error):11.1e}"
        digits = int(np.clip(-np.log10(float(error) / max(2.0 * math.sin(0.5 * turn), 1e-300) + 1e-300), 0, digits))
    axis = ""
    if turn >= _NO_TURN and digits:
        axis = "   (" + " ".join(f"{v + 0.0:9.{digits}f}" for v in np.round(vector / turn, digits)) + ")"
    angle = _aligned(math.degrees(turn), 0.0 if error is None else math.degrees(float(error)), DEGREE_DIGITS)
    return f"{name:24}{angle:>16}{column}{axis}"


def _phase_line(name: str, phase: Array, error: Array) -> str:
    in_degrees = _aligned(math.degrees(phase), math.degrees(float(error)), DEGREE_DIGITS)
    return f"{name:24}{in_degrees:>16}{float(error):11.1e}{_aligned(float(phase), float(error), RADIAN_DIGITS):>20}"


def _batch_lines(result: PhaseSplit, heading: str) -> list[str]:
    """Return lines with the least, the median and the largest of each number of a batch."""
    about = result.about
    shape = about.momentum.shape[:-1]
    rows = {
        "total rotation": so3.angle(result.total_rotation),
        "shape holonomy": so3.angle(result.holonomy),
        **({"stored wheel momentum": so3.angle(result.wheel_rotation)} if result.has_wheels else {}),
        "Montgomery phase": result.montgomery_phase,
        "dynamic phase": result.dynamic_phase,
        "geometric phase": result.geometric_phase,
        "momentum gap": result.momentum_gap,
    }
    lines = [
        heading or f"{about.label}: {about.duration:g} s, {math.prod(shape)} motions, a batch {shape}",
        "",
        f"{f'{result.gauge} gauge, [deg]':24}{'least':>16}{'middle':>16}{'largest':>16}",
    ]
    for name, values in rows.items():
        if values.size:
            spread = np.degrees([values.min(), np.median(values), values.max()])
            lines.append(f"{name:24}" + "".join(f"{angle:16.6f}" for angle in spread))
    return lines
