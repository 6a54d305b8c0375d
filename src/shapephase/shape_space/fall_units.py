"""Errors of units in a recording that a measured fall shows: 9.81 m/s^2 over it, against slips that are usual."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from ..arrays import Array
from ..errors import TrajectoryError, TrajectoryWarning
from .files.labels import LENGTHS
from .free_fall import UP_AXES, FreeFall, falls_along, lasts, measured_fall

_LENGTHS = {**LENGTHS, "in": 0.0254, "ft": 0.3048}  # [m] units mixed up by mistake
# [1/s] usual frame rates.
_RATES = (24, 25, 30, 48, 50, 60, 72, 75, 90, 100, 120, 125, 144, 150, 200, 240, 250, 300, 400, 480, 500, 1000)
_MOST_TIMES = 10.0  # largest error of the frame rate
_MOST_LENGTHS = 40.0  # largest error of lengths
_MOST_SAMPLES = 3000  # searched for a fall by another gravity: bounds the time
_OFF = 0.1  # relative to gravity: a smaller difference may be right
_BARS = 3.0  # standard deviations by which a fall must differ, too
_FITS = 0.04  # relative to gravity: a unit error that fits this well is reported
_LONG = 0.8  # [m] least g t^2 of a fall by another acceleration: ten error bars of wander, 0.29 s on earth
_SEEN = 6.0  # standard deviations from zero of a fall by another acceleration
_AS_LONG = 0.8  # of the longest fall: among such long ones, the best parabola is taken
_PARABOLA = 0.02  # [m] rms off a parabola, beyond the noise, of a motion that is no fall


def check_parabola(times: Array, centres: Array, noise: float, gravity: float, where: str) -> None:
    """Check the gravity of a stretch that is given, where it is a parabola, and bent enough for that to be seen.

    Warns where the centre of mass leaves every parabola: no free flight, or a body of another size.
    """
    if len(times) < 4:
        return
    acceleration, bar = measured_fall(times, centres, noise)
    powers = np.vander(times - times.mean(), 3)
    left = centres - powers @ np.linalg.lstsq(powers, centres, rcond=None)[0]
    size, off = float(np.linalg.norm(acceleration)), float(np.sqrt((left**2).mean()))
    if off >= np.hypot(noise, _PARABOLA):
        warnings.warn(
            f"{where}: within the flight that is given the centre of mass is {off:.2g} m (rms) off every parabola: it "
            "is no free flight, or the body is not as large as the recorded one. Give other times: flight=(first, "
            "last) (--flight FIRST LAST)",
            TrajectoryWarning,
            stacklevel=6,
        )
    # What is not bent has no weight, or is too short to be compared.
    elif size > _BARS * bar:
        check_gravity(size, bar, gravity, times, where)


def slipped_fall(times: Array, positions: Array, arms: Array, gravity: float, up: str | None) -> FreeFall | None:
    """The longest fall by an acceleration that a slip makes of gravity, its samples those of the recording.

    positions (N, 3) of the base, arms (N, 3) from there to the centre of mass, both the recorder's axes [m].
    """
    stride = 1 + len(times) // _MOST_SAMPLES
    seen, rate = times[::stride], 1.0 / float(np.median(np.diff(times)))
    falls: list[tuple[float, float, FreeFall]] = []
    for share, speed, lengths, longer in _trials(rate):
        centres = positions[::stride] + longer * arms[::stride]
        for axis in UP_AXES[:3] if up is None else (up,):
            found = falls_along(seen, centres, axis, gravity * share)
            if found is None:
                continue
            time = lasts(seen, found.ends) / speed
            # In the lengths of the file, too: whatever moves smoothly bends a little, and resembles a slow fall.
            if is_long(found, seen, lengths) and found.gravity > _SEEN * found.gravity_bar:
                falls.append((time, found.off / found.gravity, found))
    if not falls:
        return None
    longest = max(time for time, _, _ in falls)
    _, best = min(((off, fall) for time, off, fall in falls if time > _AS_LONG * longest), key=lambda one: one[0])
    return best.every(stride)


def is_long(fall: FreeFall, times: Array, lengths: float = 1.0) -> bool:
    """True if a fall is bent far more than a centre of mass wanders; lengths are so much off."""
    return fall.gravity / lengths * lasts(times, fall.ends) ** 2 > _LONG


def _trials(rate: float) -> Iterator[tuple[float, float, float, float]]:
    """What slips make of gravity and of times, and by what lengths of the recording and of arms are off."""
    for size in _LENGTHS.values():
        for other in _LENGTHS.values():
            share = size / other
            if size != other and 1.0 / _MOST_LENGTHS < share < _MOST_LENGTHS:
                # Lengths of the body are from the same file, or they are right, and its arms scale with what is not.
                yield share, 1.0, share, 1.0
                yield share, 1.0, share, share
    for known in _RATES:
        speed = known / rate
        if 1.0 / _MOST_TIMES < speed < _MOST_TIMES and abs(speed**2 - 1.0) > _OFF:
            yield 1.0 / speed**2, speed, 1.0, 1.0


def check_gravity(measured: float, bar: float, gravity: float, times: Array, where: str) -> None:
    """Raise TrajectoryError where a fall is not by the gravity that is expected, and name the slips that fit."""
    off = abs(measured - gravity)
    if off <= _OFF * gravity or off <= _BARS * bar:
        return
    slips = list(_slips(measured, bar, gravity, 1.0 / float(np.median(np.diff(times)))))
    named = "; or ".join(slips) if slips else "no usual slip of a unit makes that of it"
    raise TrajectoryError(
        f"{where}: the centre of mass falls with {measured:.3g} ± {bar:.2g} m/s^2, {gravity:.4g} is expected: {named}. "
        "Correct the unit of length (of a BVH file length_unit, --length-unit) or the times; where this is right, give "
        f"gravity={measured:.3g} (--gravity {measured:.3g}); where it is no flight, the times of one: flight=(first, "
        "last) (--flight FIRST LAST), or momentum=[0, 0, 0] (--momentum 0 0 0)"
    )


def _slips(measured: float, bar: float, gravity: float, rate: float) -> Iterator[str]:
    """The slips that make so much of gravity, in words."""
    share, within = measured / gravity, max(_FITS, 2.0 * bar / gravity)
    for read, size in _LENGTHS.items():
        for true, other in _LENGTHS.items():
            if abs(size / other / share - 1.0) < min(within, _OFF):
                yield f"lengths in {true} were read as {read}"
    speed = float(np.sqrt(1.0 / share))
    for known in _RATES:
        if abs(speed * rate / known - 1.0) < 0.5 * min(within, _OFF):
            yield f"{known} frames a second were read as {rate:.4g}"
            return
