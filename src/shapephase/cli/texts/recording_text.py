"""A recording and its processing as text for people and as plain data for programs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import so3
from ...arrays import Array
from ...body.body import Body
from ...errors import TrajectoryError
from ...shape_space.files.base_columns import ESTIMATE
from ...shape_space.files.closing import Closing
from ...shape_space.files.labels import IN_A_SECOND
from ...shape_space.files.read import RecordedMotion
from ...shape_space.files.smoothing import Smoothing
from ...shape_space.free_fall import GRAVITY, free_fall
from ..options import RecordingOptions

if TYPE_CHECKING:
    from ...error_bars.covariance import Uncertainty
    from ...error_bars.recorded_momentum import RecordedMomentum

_MOST_NAMES = 8  # in one line
_MOST_PARTS = 10  # columns of the table of residuals in time
_BAR_DIGITS = 2  # of a bar
_WIDER = 1.1  # over the bars of white noise: a smaller ratio is not printed
_ROUNDING = 1e-12  # [rad or m] from samples to the path through them


def recording_lines(body: Body, recorded: RecordedMotion | None) -> list[str]:
    """Return lines about the processing of a recording, if there was any."""
    if recorded is None:
        return []
    record = recorded.record
    lines = [
        *_unit_lines(record),
        *_column_lines(body, record),
        *_base_lines(record),
        *_segment_lines(record["segments"]),
        *_change_lines(body, record, recorded),
    ]
    return ["", *lines] if lines else []


def recording_data(recorded: RecordedMotion | None) -> dict[str, Any]:
    """Return the processing of a recording for programs, under `recording`."""
    if recorded is None:
        return {}
    record = dict(recorded.record)
    if recorded.closing is not None:
        change = recorded.closing.holonomy_change.tolist()
        record["closing"] = record["closing"] | {"holonomy_change_rotation_vector_rad": change}
    return {"recording": record}


def fit_lines(fitted: RecordedMomentum, errors: Uncertainty) -> list[str]:
    """Return lines about a momentum fitted to a recorded base, and the residuals in time."""
    bars = np.sqrt(np.diag(errors.start)[3:])
    digits = max(_BAR_DIGITS - 1 - math.floor(math.log10(float(bars.min()))), 0) if bars.all() else _BAR_DIGITS
    momentum = ", ".join(f"{v:.{digits}f} ± {bar:.{digits}f}" for v, bar in zip(fitted.momentum, bars, strict=True))
    angles, gyro = np.degrees(fitted.angles), np.degrees(np.linalg.norm(fitted.rate_residuals, axis=1))
    noises = [f"{len(angles)} attitudes with {np.degrees(fitted.noise):.3g} deg"] if len(angles) else []
    noises += [f"{len(gyro)} rates with {np.degrees(fitted.rate_noise):.3g} deg/s"] if len(gyro) else []
    lines = [
        "",
        f"{'momentum, fitted':24}{momentum}   kg m^2/s",
        f"{'to the recorded base':24}{' and '.join(noises)} of noise about each axis{_correlated(fitted)}",
    ]
    if len(gyro):
        lines.append(f"{'  bias of the rates':24}{_bias_text(fitted)}")
    if not fitted.conserved:
        first, last = (", ".join(f"{v:.{digits}f}" for v in fitted.momenta[row]) for row in (0, -1))
        lines.append(f"{'  not constant':24}from {first} to {last}   kg m^2/s; the bars hold it at every time")
    if fitted.axes_covariance.any():
        turned = " ".join(f"{v + 0.0:.4f}" for v in so3.quat_from_matrix(fitted.base_axes))
        off = np.degrees(np.sqrt(np.trace(fitted.axes_covariance)))
        lines.append(
            f"{'its axes, fitted':24}quaternion {turned} (xyzw) from the axes of the body's base, ± {off:.2g} deg"
        )
    off, unit = (angles, "deg") if len(angles) else (gyro, "deg/s")
    worst = int(np.argmax(off))
    lines.append(
        f"{'base as recorded':24}{_rms(off):.3g} {unit} rms from this one, {off[worst]:.3g} {unit} at most, at "
        f"{fitted.times[worst]:.6g} s"
    )
    parts = np.array_split(np.arange(len(off)), min(_MOST_PARTS, len(off)))
    times = "".join(f" {fitted.times[part].mean():7.3g}" for part in parts)
    return [
        *lines,
        f"{'  time [s]':24}{times}",
        f"{f'  off, rms [{unit}]':24}{''.join(f' {_rms(off[part]):7.2g}' for part in parts)}",
    ]


def _bias_text(fitted: RecordedMomentum) -> str:
    """Return the bias of the rates with its bars, or that it is taken for zero."""
    if fitted.bias_covariance is None:
        return "zero, not fitted: these rates do not determine it"
    bars = np.degrees(np.sqrt(np.diag(fitted.bias_covariance)))
    return ", ".join(f"{v:.3g} ± {bar:.2g}" for v, bar in zip(np.degrees(fitted.bias), bars, strict=True)) + "   deg/s"


def fit_data(fitted: RecordedMomentum) -> dict[str, Any]:
    """Return the fit for programs, under `momentum_fit`."""
    found = {
        "momentum_covariance": fitted.momentum_covariance.tolist(),
        "initial_attitude_quat_xyzw": so3.quat_from_matrix(fitted.initial_attitude).tolist(),
        "covariance_of_attitude_and_momentum": fitted.covariance.tolist(),
        "noise_rad": fitted.noise,
        "noise_correlation": fitted.noise_correlation,
        "widening_by_correlation": fitted.widening,
        "conserved": fitted.conserved,
        "momenta_kg_m2_s": fitted.momenta.tolist(),
        "base_axes": fitted.base_axes.tolist(),
        "base_axes_covariance_rad2": fitted.axes_covariance.tolist(),
        "times_s": fitted.times.tolist(),
        "recorded_base_difference_rotation_vector_rad": fitted.residuals.tolist(),
    }
    if len(fitted.rate_residuals):
        bars = None if fitted.bias_covariance is None else fitted.bias_covariance.tolist()
        found |= {"rate_noise_rad_s": fitted.rate_noise, "rate_bias_rad_s": fitted.bias.tolist()}
        found |= {"rate_bias_covariance_rad2_s2": bars, "rate_difference_rad_s": fitted.rate_residuals.tolist()}
    if not len(fitted.angles):
        return {"momentum_fit": found}
    worst = int(np.argmax(fitted.angles))
    return {
        "momentum_fit": found,
        "recorded_base_difference_rad": float(fitted.angles[worst]),
        "recorded_base_difference_time_s": float(fitted.times[worst]),
    }


def _correlated(fitted: RecordedMomentum) -> str:
    """Return the effect of correlated noise on the bars, where it is not small."""
    if fitted.widening < _WIDER:
        return ""
    return f", correlated in time: bars up to {fitted.widening:.2g} times those of white noise"


def _rms(angles: Array) -> float:
    return float(np.sqrt(np.mean(angles**2)))


def _unit_lines(record: Any) -> list[str]:
    """Return a line about units other than those of the library."""
    found = [] if record["time_unit"] == "s" else [f"times in {record['time_unit']}"]
    for unit in ("deg", "mrad", "mm", "cm"):
        count = sum(said == unit for said in record["units"].values())
        if count:
            found.append(f"{count} {'joint' if count == 1 else 'joints'} in {unit}")
    return [f"{'read':24}{', '.join(found)}"] if found else []


def _column_lines(body: Body, record: Any) -> list[str]:
    """Return lines about columns of other names, joints without a column, and ignored columns."""
    lines = []
    if (order := record.get("joint_order")) is not None:
        lines.append(f"{'joints without names':24}{order['means']} ({order['order']}): {', '.join(order['joints'])}")
    renamed = [f"{name} from {column!r}" for name, column in record["columns"].items() if not column.startswith(name)]
    if renamed:
        lines.append(f"{'columns':24}{_listed(renamed)}")
    for wheel, column in record["wheel_speeds"].items():
        lines.append(f"{'speed of a wheel':24}{wheel} from {column['name']!r}, in {column['unit']}")
    if record["at_rest"]:
        held = [f"{name} {_value(body, name, value)}" for name, value in record["at_rest"].items()]
        lines.append(f"{'without a column':24}{_listed(held)}")
    for column, why in list(record["left_out"].items())[:_MOST_NAMES]:
        lines.append(f"{'left out':24}{column}: {why}")
    if len(record["left_out"]) > _MOST_NAMES:
        lines.append(f"{'left out':24}and {len(record['left_out']) - _MOST_NAMES} more columns")
    return lines


def _columns_of(base: Mapping[str, Any], what: str) -> list[str]:
    """Return the columns of an attitude or a position; none where an array has it."""
    found = base.get(what, [])
    return [] if isinstance(found, str) else found


def _base_lines(record: Any) -> list[str]:
    """Return lines about the columns and axes of the base, and the flight that was kept."""
    lines = []
    base = record["base"] or {}
    if "order" in base:
        said = "as given" if base["order_said"] else "the usual order, --base-order changes it"
        lines.append(
            f"{'base':24}{', '.join(base['attitude'])}, turning in the order {' '.join(base['order'])}; {said}"
        )
    elif "inverse" in base or any(not text.startswith("base_") for text in _columns_of(base, "attitude")):
        taken = "the inverse of base axes" if base.get("inverse") else "base axes"
        by_rates = "by the rates" if "rates" in base else "--base-inverse for the inverse"
        said = f"to the recorder's, {'as given' if base.get('inverse_by') == 'as given' else by_rates}"
        names = ", ".join(_columns_of(base, "attitude")) or base["attitude"]
        lines.append(f"{'attitude of the base':24}{names}: {taken} {said}")
    if "rates" in base:
        unit = base["rate_unit"] if base["rate_unit_said"] else f"{base['rate_unit']}, as no unit is stated"
        axes = "the recorder's axes, by the attitudes" if base.get("rate_axes") == "inertial" else "base axes"
        lines.append(f"{'rates of the base':24}{', '.join(base['rates'])}, read in {unit}; in {axes}")
    if any(not text.startswith("base_") for text in _columns_of(base, "position")):
        lines.append(f"{'place of the base':24}{', '.join(_columns_of(base, 'position'))}")
    if "axes" in base and (base["axes_said"] or base["axes"] != "x y z"):
        said = "as given" if base["axes_said"] else "the usual ones of a pelvis, --base-axes changes them"
        lines.append(f"{'axes of the base':24}{base['axes']} of the recorded ones; {said}")
    flight = record["flight"]
    if flight is not None:
        found = ""
        if "up" in flight:
            off = 1e3 * flight["off_parabola_rms_m"]
            found = f", found by the centre of mass: {off:.2g} mm rms from a free fall, {flight['up']} is up"
        ends = f"{flight['first_time']:.9g} to {flight['last_time']:.9g} {record['time_unit']}"
        if len(flight.get("all", ())) > 1:
            lines.append(f"{'flights':24}{_flight_words(flight['all'], record['time_unit'])}")
        lines.append(f"{'flight':24}{record['samples']} of {record['samples_in_file']} samples, {ends}{found}")
    return lines


def _segment_lines(segments: Any) -> list[str]:
    """Return lines about poses of segments, and the momentum by them and by the joints."""
    if segments is None:
        return []
    renamed = [f"{link} from {name!r}" for name, link in segments["links"].items() if link != name]
    lines = [f"{'segments':24}{len(segments['links'])}; {segments['calibration']}"]
    if renamed:
        lines.append(f"{'  links':24}{_listed(renamed)}")
    if segments.get("lengths"):
        worst = max(segments["lengths"], key=lambda each: abs(each["mean_m"] - each["body_m"]))
        unit = f"; in {segments['length_unit']}" if "length_unit" in segments else ""
        lines.append(
            f"{'  lengths':24}farthest off from {worst['from']} to {worst['to']}: {worst['mean_m']:.4f} m on average "
            f"(spread {worst['spread_m']:.2g} m), {worst['body_m']:.4f} m in the body{unit}"
        )
    left = segments.get("hinges_leave_deg", {})
    if left:
        name = max(left, key=lambda each: left[each])
        lines.append(f"{'  off the hinges':24}{left[name]:.2g} deg rms at most, {name}")
    if "momentum_of_chain" in segments:
        said = [f"{_vector(segments['momentum_of_chain'])} of the chain"]
        if "momentum_of_poses" in segments:
            off = segments["momentum_difference_rms"]
            said = [f"{_vector(segments['momentum_of_poses'])} of the segments' own poses", *said]
            said.append(f"{off:.2g} rms apart")
        still = " (joints without a segment at zero)" if segments["at_zero"] else ""
        lines.append(f"{'  mean momentum':24}{', '.join(said)}   kg m^2/s{still}")
    return lines


def _vector(values: list[float]) -> str:
    return "(" + ", ".join(f"{value + 0.0:.4g}" for value in values) + ")"


def _flight_words(flights: Sequence[Sequence[float]], unit: str) -> str:
    listed = "; ".join(f"{number}: {first:.6g} to {last:.6g}" for number, (first, last) in enumerate(flights, 1))
    return f"{listed} {unit} (--flight auto:1 and so on; auto is the longest)"


def flights_in(body: Body, recorded: RecordedMotion, options: RecordingOptions) -> list[list[float]]:
    """Return first and last times of all flights of a recording, in the file's clock."""
    record, times = recorded.record, recorded.times
    base = record["base"] or {}
    if recorded.base_attitude is None or recorded.base_position is None or base.get("axes") == ESTIMATE:
        return []
    shapes = recorded.path.shape(times)
    centres = recorded.base_position + so3.apply(recorded.base_attitude, body.centre_of_mass(shapes))
    try:
        fall = free_fall(times, centres, "", up=options.up, gravity=options.gravity or GRAVITY)
    except TrajectoryError:
        return []
    clock = record["first_time"] + times * IN_A_SECOND[record["time_unit"]]
    return [[float(clock[first]), float(clock[last])] for first, last in fall.all_ends]


def flight_lines(flights: list[list[float]], recorded: RecordedMotion) -> list[str]:
    """Return a line about flights."""
    return [f"{'flights':24}{_flight_words(flights, recorded.record['time_unit'])}"] if flights else []


def _levels(body: Body, smoothed: Mapping[str, float]) -> str:
    """Return the noise of turning and of sliding joints."""
    found = []
    for unit in ("rad", "1", "m"):
        own = {name: level for name, level in smoothed.items() if body.joint_units[body.joint_index(name)] == unit}
        levels = sorted((level, name) for name, level in own.items() if level > 0.0)
        if levels:
            ends = dict.fromkeys(_value(body, name, level) for level, name in (levels[0], levels[-1]))
            found.append(" to ".join(ends))
    return " and ".join(found)


def _change_lines(body: Body, record: Any, recorded: RecordedMotion) -> list[str]:
    """Return lines about differences of the path from the samples."""
    lines = _gap_lines(record)
    if record["trim"] is not None and record["flight"] is None:
        lines.append(
            f"{'kept':24}{record['samples']} of {record['samples_in_file']} samples, from {record['first_time']:.9g} "
            f"to {record['last_time']:.9g} {record['time_unit']}"
        )
    if record["smooth"] is not None:
        lines.append(f"{'smoothed':24}for noise of {_levels(body, record['smooth'])}, rms")
    if record["lowpass"] is not None:
        lines += _low_pass_lines(body, record["lowpass"])
    elif recorded.smoothing is not None:
        lines += _smoothing_lines(recorded.smoothing)
    if recorded.closing is not None:
        lines += _closing_lines(recorded.closing)
    if record["resampled_to_hz"] is not None:
        lines.append(f"{'resampled':24}{record['resampled_to_hz']:.6g} samples a second")
    if recorded.residual.max(initial=0.0) > _ROUNDING:
        joint = int(np.argmax(recorded.residual))
        names = recorded.path.joint_names or ()
        off = _value(body, names[joint], recorded.residual[joint])
        lines.append(f"{'largest rms residual':24}{off}, {names[joint]}")
    return lines


def _gap_lines(record: Any) -> list[str]:
    """Return lines about gaps that were filled, and samples cut off at the ends."""
    gaps, unit = record["gaps"] or {"filled": (), "cut": ()}, record["time_unit"]
    filled = [
        f"{_listed(gap['columns'])} from {gap['after']:.9g} to {gap['until']:.9g} {unit} ({gap['seconds']:.4g} s, by a "
        f"{gap['by']})"
        for gap in gaps["filled"]
    ]
    more = f"; and {len(filled) - _MOST_NAMES} more" if len(filled) > _MOST_NAMES else ""
    lines = [f"{'filled':24}{'; '.join(filled[:_MOST_NAMES])}{more}"] if filled else []
    return lines + [
        f"{'cut off':24}{cut['samples']} samples at the {cut['at']}, where {_listed(cut['columns'])} "
        f"{'has' if len(cut['columns']) == 1 else 'have'} no number"
        for cut in gaps["cut"]
    ]


def _low_pass_lines(body: Body, record: Any) -> list[str]:
    """Return lines about the filter: its noise, its ends, and what it may remove of the motion."""
    noise, beyond, by_noise = record["noise"], record["rms_up_to_twice_the_cut_off"], record["of_that_by_noise"]
    twice = f"{record['twice_the_cut_off_hz']:.4g} Hz"
    worst = max(beyond, key=lambda name: beyond[name] - by_noise[name])
    start, end = record["affected_at_ends_s"]
    return [
        f"{'low-pass':24}{record['cut_off_hz']:.6g} Hz, Butterworth of second order forwards and backwards",
        f"{'  noise':24}{_levels(body, noise) or 'none'}, rms, by what is above {twice}, "
        "assumed white; error bars contain what passes the filter",
        f"{'  may be lost':24}{_value(body, worst, beyond[worst])} rms of {worst} up to "
        f"{twice}, {_value(body, worst, by_noise[worst])} of it by noise; "
        "not in the bars",
        f"{'  ends':24}the first {start:.3g} s and the last {end:.3g} s have samples on one side only",
    ]


def _smoothing_lines(smoothing: Smoothing) -> list[str]:
    """Return lines about the smoothing and its bias."""
    own = smoothing.penalty > 0.0
    if not own.any():
        return []
    penalties, free = smoothing.penalty[own], smoothing.degrees_of_freedom[own]
    return [
        f"{'  penalty':24}{_span(penalties)} s^5; {_span(free)} degrees of freedom are left to a joint",
        f"{'  bias':24}at most {smoothing.bias_in_bars:.2g} of the remaining noise, rms; in the error bars",
    ]


def _span(values: Array) -> str:
    ends = dict.fromkeys(f"{value:.3g}" for value in (values.min(), values.max()))
    return " to ".join(ends)


def _closing_lines(closing: Closing) -> list[str]:
    """Return lines about a gap that was closed, and its effect."""
    joint = int(np.argmax(np.abs(closing.gap)))
    names = closing.body.joint_names
    change = float(np.degrees(np.linalg.norm(closing.holonomy_change)))
    way = {"smooth": "by a periodic smoother", "drift": "by the drift"}[closing.by]
    return [
        f"{'closed':24}{way}; {names[joint]} ended {_value(closing.body, names[joint], closing.gap[joint])} off",
        f"{'change of the holonomy':24}{change:.4g} deg",
    ]


def _value(body: Body, name: str, value: float) -> str:
    """Return a joint coordinate in degrees or metres."""
    turns = body.joint_units[body.joint_index(name)] == "rad"
    if turns:
        return f"{np.degrees(value) + 0.0:.4g} deg"
    return f"{value:.4g} {body.joint_units[body.joint_index(name)]}".removesuffix(" 1")


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _MOST_NAMES} more" if len(names) > _MOST_NAMES else ""
    return ", ".join(names[:_MOST_NAMES]) + more
