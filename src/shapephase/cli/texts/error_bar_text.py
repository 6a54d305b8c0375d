"""Error bars of a split as text for people and as plain data for programs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...errors import ShapeError, unknown_name
from ...phases.phase_split import PhaseSplit
from ...plain_data import plain
from ...reconstruction.reconstruction import Motion
from ...shape_space.files.labels import amounts
from ...shape_space.files.read import RecordedMotion
from ..options import ERROR_DEFAULTS, ErrorOptions
from ..wheels import momentum_word, speed_word

if TYPE_CHECKING:
    from ...error_bars.covariance import Uncertainty
    from ...error_bars.recorded_momentum import RecordedMomentum
    from ...phases.whole_turns import TurnCounts

_DIGITS = 2  # of a bar; the number before it ends where the bar does
_NO_BAR = 1e-9  # [of the number, or of its unit] a smaller bar is rounding


def error_bars(
    motion: Motion, options: ErrorOptions, recorded: RecordedMotion | None, fitted: RecordedMomentum | None = None
) -> Uncertainty | None:
    """Return the requested error bars, or None; smoothing noise and a fitted momentum request them, too."""
    given = input_errors(motion, options, recorded, fitted)
    if not given:
        return None
    from ...error_bars.covariance import uncertainty

    return uncertainty(motion, **given)


def input_errors(
    motion: Motion, options: ErrorOptions, recorded: RecordedMotion | None, fitted: RecordedMomentum | None = None
) -> dict[str, Any]:
    """Return the errors of the inputs as `uncertainty` takes them: those stated, of smoothing and of a fit."""
    relative = (options.mass_error, options.centre_error, options.inertia_error)
    smoothing = None if recorded is None else recorded.smoothing
    joints = options.joint_noise if options.joint_noise is not None or smoothing is None else smoothing.noise
    deviations = (joints, *relative, options.momentum_error, options.attitude_error)
    if fitted is None and not options.rotor_error and all(given is None for given in deviations):
        return {}
    from ...error_bars.error_sources import InertiaErrors

    masses, centres, inertias = (given or 0.0 for given in relative)
    return {
        "joints": joints,
        "inertias": InertiaErrors(masses=masses, centres=centres, inertias=inertias) if any(relative) else None,
        "momentum": options.momentum_error,
        "attitude": options.attitude_error,
        "start": fitted,
        "rotors": _rotor_errors(motion, options.rotor_error) if options.rotor_error else None,
    }


def _rotor_errors(motion: Motion, words: tuple[str, ...]) -> dict[str, float]:
    """Return --rotor-error by wheel [kg m^2/s] or [rad/s]. Raises ShapeError, UnknownNameError."""
    description = motion.deformation.description
    kinds = {rotor.joint: rotor.is_momentum for rotor in getattr(description, "rotors", ())}
    errors: dict[str, float] = {}
    for word in words:
        name, _, value = (text.strip() for text in word.partition("="))
        if not (name and value):
            raise ShapeError(f"--rotor-error: JOINT=VALUE is needed, as in --rotor-error rw1=20rpm, got {word!r:.60}")
        if name in errors:
            raise ShapeError(f"--rotor-error: the wheel {name!r:.60} is given twice; keep one value")
        if name not in kinds:
            raise unknown_name("wheel of the motion (--rotor, --rotor-speed)", name, list(kinds))
        known = momentum_word(value, name, "--rotor-error") if kinds[name] else speed_word(value, name, "--rotor-error")
        if known is None:
            raise ShapeError(f"--rotor-error: {name}: a speed is needed, as 2 or 20rpm, got {value!r:.60}")
        errors[name] = known
    return errors


def joint_noise(body: Body, options: ErrorOptions) -> Array | None:
    """Return --joint-noise for each joint (n,) [rad or m], or None."""
    if options.joint_noise is None:
        return None
    levels = amounts(options.joint_noise, "--joint-noise")
    return np.array([levels[unit] for unit in body.joint_units])


def error_bar_lines(
    result: PhaseSplit,
    found: Uncertainty | None,
    recorded: RecordedMotion | None = None,
    options: ErrorOptions = ERROR_DEFAULTS,
    turns: TurnCounts | None = None,
) -> list[str]:
    """Return lines with angles and their bars in degrees.

    Counts of an athlete follow in revolutions. For a recording without a stated noise, the line says which errors the
    bars or the table contain.
    """
    if found is None:
        if recorded is None:
            return []
        return [
            "",
            f"{'± above':24}numerical error only; give --joint-noise (0.3deg) for measurement error",
        ]
    lines = ["", "error bars: one standard deviation due to the inputs, to first order"]
    rotations = [
        ("total rotation", result.total_rotation, found.total_angle),
        ("  shape holonomy" if result.is_loop else "  shape lift (open)", result.holonomy, found.holonomy_angle),
    ]
    if result.has_wheels:
        rotations.append(("  stored wheel momentum", result.wheel_rotation, found.wheel_angle))
    lines += [f"{name:24}{_degrees_with_bar(float(so3.angle(rotation)), bar)}" for name, rotation, bar in rotations]
    if result.has_phase and result.gauge == "horizontal":
        for name, phase, bar in (
            ("Montgomery phase", result.montgomery_phase, found.montgomery_phase),
            ("  dynamic phase", result.dynamic_phase, found.dynamic_phase),
            ("  geometric phase", result.geometric_phase, found.solid_angle),
        ):
            lines.append(f"{name:24}{_degrees_with_bar(float(phase), bar)}")
    elif result.has_phase:
        lines.append("phases: error bars need the horizontal gauge (--gauge horizontal)")
    if turns is not None:
        for name in ("somersaults", "twists"):
            count, bar = getattr(turns, name), getattr(found, name)
            lines += [] if count is None or bar is None else [f"{name:24}{_with_bar(count, bar, 'turns')}"]
    flown = recorded if recorded is not None and recorded.flight is not None else None
    if flown is not None and flown.base_attitude is not None and not (flown.smoothing or options.joint_noise):
        lines.append(f"{'noise of the joints':24}not in the bars; state it, as --joint-noise 0.3deg")
    if found.smoothing_bias:
        lines.append(f"{'smoothing bias':24}at most {found.smoothing_bias:.2g} sigma, in the bars")
    return lines


def error_bar_data(found: Uncertainty | None) -> dict[str, Any]:
    """Return covariances [rad^2] and standard deviations [rad], under `uncertainty`."""
    return {} if found is None else {"uncertainty": plain(found)}


def _degrees_with_bar(angle: float, bar: float) -> str:
    return _with_bar(math.degrees(angle), math.degrees(bar), "deg")


def _with_bar(value: float, bar: float, unit: str) -> str:
    """Return a number and its bar, ending at the same digit, or a sentence where the bar is rounding."""
    if bar < (least := _NO_BAR * max(abs(value), 1.0)):
        return f"{value:16.6f} {unit}, which these errors change by less than {least:.0e}"
    digits = max(_DIGITS - 1 - math.floor(math.log10(bar)), 0)
    return f"{value:16.{digits}f} ± {bar:.{digits}f} {unit}"
