"""Recorded angular velocity of the base: its columns, and how recorded attitudes have to be read to agree with it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from ... import so3
from ...arrays import Array
from ...errors import TrajectoryError
from .labels import ANGLES, check_range, rate_label, rate_size
from .recording import Recording

RATE_NAMES = ("base_omega_x", "base_omega_y", "base_omega_z")
_FASTEST = 35.0  # [rad/s] 2,000 deg/s, the range of usual gyros
_WINDOW = 0.3  # [rad] turns that are compared: 0.5 deg of noise at both ends are 4 % of it
_SMALLEST = 0.05  # [rad] shorter turns are noise of attitudes or biases of gyros
_COARSE = 1.0  # [rad] between samples: rates are not integrated across longer turns
_AGREES = 0.25  # median difference of turns, relative to them: biases and noise are less
_ALIKE = 0.01  # relative, too: rounding and coarse samples
_LARGEST_BIAS = 0.035  # [rad/s] 2 deg/s, of an uncalibrated MEMS gyro: a larger constant difference is a fault
_CONTRADICTS = 0.5  # relative, too: more is no noise


class BaseRates(NamedTuple):
    """Columns of rates.

    values : (N, 3) [rad/s]
    columns : their labels
    unit : in which they were read
    stated : True where the file or the caller states the unit
    """

    values: Array
    columns: tuple[str, ...]
    unit: str
    stated: bool


class Reading(NamedTuple):
    """Attitudes (N, 3, 3) and rates (N, 3), in the axes of these attitudes, that agree.

    inverse : True where the recorded attitudes are the inverse of these
    inertial : True where the recorded rates are in inertial axes
    """

    turns: Array
    rates: Array
    inverse: bool = False
    inertial: bool = False


def in_rad_per_s(recording: Recording, columns: Sequence[tuple[str, str | None]], values: Array) -> BaseRates:
    """Rates (N, 3) in the units of their columns, (label, unit), in rad/s. Raises TrajectoryError for doubtful ones."""
    texts, units = tuple(text for text, _ in columns), {unit for _, unit in columns}
    sizes = [None if unit is None else rate_size(unit) for _, unit in columns]
    if len(units) > 1 or (units != {None} and None in sizes):
        raise TrajectoryError(
            f"{recording.table.where}: columns {', '.join(texts)} are rates of the base; give them one unit such as "
            f"rad/s or deg/s: {_names_option(texts, 'deg/s')}"
        )
    check_range(recording, f"the rate of the base in {', '.join(texts)}", np.abs(values).max(axis=1), "rad/s")
    return BaseRates(values * (sizes[0] or 1.0), texts, columns[0][1] or "rad/s", columns[0][1] is not None)


def check_speed(recording: Recording, rates: BaseRates) -> None:
    """Raise TrajectoryError for rates without a unit, and without attitudes beside them, that no gyro measures."""
    fastest = int(np.argmax(np.abs(rates.values).max(axis=1)))
    speed = float(np.abs(rates.values[fastest]).max())
    if not rates.stated and speed > _FASTEST:
        raise TrajectoryError(
            f"{recording.place(fastest)}: columns {', '.join(rates.columns)} reach {speed:.4g} rad/s, beyond the range "
            f"of gyros: deg/s? Give their unit: {_names_option(rates.columns, 'deg/s')}, or [rad/s]"
        )


def agreeing(recording: Recording, turns: Array, rates: BaseRates, inverse: bool | None) -> Reading:
    """Attitudes (N, 3, 3) and rates in the reading in which they agree; errors name what else they may be.

    inverse : True where these attitudes are the inverse of the recorded ones as the caller states, False: they are not;
        None: not stated
    """
    times, where, values = recording.times, recording.table.where, rates.values
    usual = Reading(turns, values)
    if len(turns) < 2 or np.median(_angles(turns, 1)) > _COARSE:
        return usual
    error, off = _mismatch(times, turns, values)
    if error < _ALIKE:
        return usual
    texts = ", ".join(rates.columns)
    readings = {
        (inverted, inertial): Reading(
            attitudes, so3.apply(so3.transpose(attitudes), values) if inertial else values, inverted, inertial
        )
        for inverted, inertial in product((False, True), repeat=2)
        for attitudes in [so3.transpose(turns) if inverted else turns]
    }
    scaled = [
        (_mismatch(times, reading.turns, size * reading.rates)[0], unit, reading)
        for unit, size in (("", 1.0), ("deg/s", ANGLES["deg"]), ("rad/s", 1.0 / ANGLES["deg"]))
        for reading in readings.values()
    ]
    best, unit, reading = min(scaled, key=lambda candidate: candidate[0])
    if error < _AGREES and 2.0 * best > error:
        return usual
    if best < _AGREES and unit:
        raise TrajectoryError(
            f"{where}: {texts} are 57.3 times {'faster' if unit == 'deg/s' else 'slower'} than the attitudes of the "
            f"base turn: they are in {unit}, and were read in {rates.unit}; {_names_option(rates.columns, unit)}"
        )
    if best < _AGREES:
        if reading.inverse and inverse is not None:
            raise TrajectoryError(
                f"{where}: with base_inverse={inverse} the attitudes of the base turn otherwise than {texts}; the "
                f"other way round they agree: base_inverse={not inverse} "
                f"({'leave out ' if inverse else ''}--base-inverse)"
            )
        return reading
    w_first = so3.matrix_from_quat(np.roll(so3.quat_from_matrix(turns), -1, axis=-1))
    both_axes = values, so3.apply(so3.transpose(w_first), values)
    if any(2.0 * _mismatch(times, w_first, rate)[0] < _AGREES for rate in both_axes):
        raise TrajectoryError(
            f"{where}: read as x y z w, the quaternion of the base turns otherwise than {texts} say; read as w x y z "
            "it turns as they say: write its numbers in the order x y z w, or give the columns their names"
        )
    is_bias = np.linalg.norm(off) < _LARGEST_BIAS and _mismatch(times, turns, values + off)[0] < _AGREES
    if error > _CONTRADICTS and not is_bias:
        raise TrajectoryError(
            f"{where}: {texts} contradict the recorded attitudes of the base, in base axes and in inertial ones: the "
            f"turns differ by {100.0 * error:.3g} %. Leave one of both out: --names "
            f"{' '.join(repr(f'{text}=') for text in rates.columns)} (names={{column: None}})"
        )
    return usual


def _names_option(texts: Sequence[str], unit: str) -> str:
    pairs = " ".join(f"'{text}={rate_label(text).name} [{unit}]'" for text in texts)
    return f"--names {pairs} (names={{{texts[0]!r}: '{rate_label(texts[0]).name} [{unit}]', ...}})"


def _angles(turns: Array, stride: int) -> Array:
    return so3.angle(so3.transpose(turns[:-stride]) @ turns[stride:])


def _mismatch(times: Array, turns: Array, rates: Array) -> tuple[float, Array]:
    """Median difference between turns of attitudes and of integrated rates, relative, and as a rate (3,) [rad/s].

    Zero where both turn by less than noise.
    """
    count, stride = len(turns), 1
    while 4 * stride < count and np.median(_angles(turns, stride)) < _WINDOW:
        stride *= 2
    starts = np.arange(0, count - stride, max(stride // 4, 1))
    steps = so3.exp(0.5 * (rates[1:] + rates[:-1]) * np.diff(times)[:, None])
    turned = np.broadcast_to(np.eye(3), (len(starts), 3, 3))
    for step in range(stride):
        turned = turned @ steps[starts + step]
    recorded = so3.transpose(turns[starts]) @ turns[starts + stride]
    size = max(float(np.median(so3.angle(part))) for part in (turned, recorded))
    if size < _SMALLEST:
        return 0.0, np.zeros(3)
    off = so3.log(so3.transpose(turned) @ recorded)
    off_rates = off / (times[starts + stride] - times[starts])[:, None]
    return float(np.median(np.linalg.norm(off, axis=-1))) / size, np.median(off_rates, axis=0)
