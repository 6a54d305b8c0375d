"""The stretch of a recording on which the body falls freely: its centre of mass accelerates as gravity alone makes it.

Less what gravity does, the centre of mass then goes along a straight line. Up is one direction for the whole recording:
the one that is given, else that axis of the recorder with the longest fall. No axis points down unless that is given:
what accelerates upwards by g pushes off, or lands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..arrays import Array, Integers, Mask
from ..errors import TrajectoryError

GRAVITY = 9.81  # [m/s^2] on earth within 0.25 %: a millimetre in a second
_MODEL = 0.002  # [m] wander of a centre of mass computed from a body's masses as its shape changes
_CLEAR = 5.0  # noise levels that a body at rest leaves on a window, in contrast to one that falls
_OF_A_PARABOLA = 1.0 / (6.0 * np.sqrt(5.0))  # rms of t^2 about its best line on a window of length 1
_CHANCE = 4.0  # standard deviations of a window's mean square above that of the noise
_BAND = 3.0  # standard deviations of single samples off the line, at the ends of the fall
_CUT = 2.0  # standard deviations: a contact with an acceleration of g stays hidden so long, and is cut
_FEWEST = 6  # samples of a window
_APART = 1.0 / 60.0  # [s] between samples with a recording's own noise, in which a body moves little
_WANDER = 0.01  # [m] sag of the computed centre of mass in mid-flight: segments are not rigid, and not known
_SAME = 0.03  # relative to gravity: a fall that differs by less is searched with it
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")  # directions that may be up
_AT_ONCE = 1024  # windows: bounds memory
_NORMAL_MEDIAN = 0.6745  # median of |x| of a standard normal x


@dataclass(frozen=True)
class FreeFall:
    """A stretch of a recording on which the body falls freely.

    first, last : its samples
    up : the axis of the recorder that points up, as "+y"
    noise : of each coordinate of the centre of mass, by which it was found [m]
    off : how far the centre of mass is from its parabola, rms of a coordinate [m]
    gravity, gravity_bar : how fast it falls, and the standard deviation of that, with 1 cm of wander [m/s^2]
    all_ends : first and last samples of all falls of the recording along that axis, in time
    """

    first: int
    last: int
    up: str
    noise: float
    off: float
    gravity: float
    gravity_bar: float
    all_ends: tuple[tuple[int, int], ...]

    @property
    def ends(self) -> tuple[int, int]:
        """First and last sample."""
        return self.first, self.last

    def every(self, stride: int) -> FreeFall:
        """Return the flight by the samples of a recording of which every so many-th was searched."""
        ends = tuple((stride * first, stride * last) for first, last in self.all_ends)
        return replace(self, first=stride * self.first, last=stride * self.last, all_ends=ends)


class _Windows(NamedTuple):
    """Short stretches, and what the best straight lines leave of the centre of mass and of the square of the time.

    starts, ends : (W,) first and last samples
    squares : (W,) of what is left of the centre of mass, summed [m^2]
    mixed : (W, 3) of that times what is left of the square of the time, summed [m s^2]
    parabola : (W,) of what is left of the square of the time, squared and summed [s^4]
    """

    starts: Integers
    ends: Integers
    squares: Array
    mixed: Array
    parabola: Array

    @property
    def free(self) -> Array:
        """Numbers less those of the lines."""
        return 3.0 * (self.ends - self.starts - 1).astype(np.float64)


def free_fall(times: Array, centres: Array, where: str, *, up: str | None = None, gravity: float = GRAVITY) -> FreeFall:
    """The longest stretch on which a centre of mass falls freely.

    times : (N,) ascending [s]
    centres : (N, 3) of mass, axes of the recorder, one of which is vertical [m]
    where : the file, for messages
    up : the axis that points up, one of UP_AXES; None: x, y or z, whichever has the longest fall
    gravity : [m/s^2]

    Raises TrajectoryError if there is none that is long enough to differ from rest; or, without `up`, if a longer one
    has an axis that points down.
    """
    noise = centre_noise(times, centres)
    if up is not None:
        longest = falls_along(times, centres, up, gravity)
        downwards = None
    else:
        falls = [falls_along(times, centres, axis, gravity) for axis in UP_AXES]
        longest, downwards = (
            max((fall for fall in part if fall is not None), key=lambda fall: lasts(times, fall.ends), default=None)
            for part in (falls[:3], falls[3:])
        )
    if downwards is not None and (longest is None or lasts(times, downwards.ends) > lasts(times, longest.ends)):
        first, last = times[downwards.first], times[downwards.last]
        raise TrajectoryError(
            f"{where}: from {first:.4g} to {last:.4g} s after its start the body accelerates by g along "
            f"{downwards.up[1]}: it pushes off or lands there, or that axis points down. If it does, give up "
            f"(--up {downwards.up}); else give the times of the flight: flight=(first, last) (--flight FIRST LAST)"
        )
    if longest is None:
        raise TrajectoryError(
            f"{where}: nowhere does the centre of mass fall freely for {_shortest(noise, gravity):.2g} s or more (it "
            f"is known to {1e3 * noise:.2g} mm; "
            f"{'x, y or z' if up is None else up} up; {gravity:.4g} m/s^2). Are the axes of the base right "
            "(base_axes, --base-axes)? If so, and there is a flight, give its times: flight=(first, last) "
            "(--flight FIRST LAST)"
        )
    return longest


def centre_noise(times: Array, centres: Array) -> float:
    """Noise of a coordinate of the centre of mass [m].

    Also of samples that are farther apart: those of a tracker may all be off alike, nearest to each other.
    """
    stride = max(round(_APART / float(np.median(np.diff(times)))), 1) if len(times) > 1 else 1
    apart = max(_white_noise(times[::step], centres[::step]) for step in {1, stride})
    return float(np.hypot(apart, _MODEL))


def falls_along(times: Array, centres: Array, up: str, gravity: float) -> FreeFall | None:
    """The longest fall with one axis up; where it is measured to be another than `gravity`, as it is measured."""
    fall = _fall(times, centres, up, gravity)
    if fall is not None and abs(fall.gravity - gravity) > max(_SAME * gravity, fall.gravity_bar):
        as_measured = _fall(times, centres, up, fall.gravity) if fall.gravity > 0.0 else None
        if as_measured is not None and lasts(times, as_measured.ends) > lasts(times, fall.ends):
            return as_measured
    return fall


def _shortest(noise: float, gravity: float) -> float:
    """Shortest fall that differs from rest [s]."""
    return float(np.sqrt(_CLEAR * noise / (0.5 * gravity * _OF_A_PARABOLA)))


def _fall(times: Array, centres: Array, up: str, gravity: float) -> FreeFall | None:
    """The longest stretch on which the centre of mass falls by one acceleration."""
    noise = centre_noise(times, centres)
    window = _shortest(noise, gravity)
    windows = _windows(times, centres, window)
    axis = "xyz".index(up[-1])
    pull = 0.5 * gravity * (-1.0 if up.startswith("-") else 1.0)
    squares = windows.squares + 2.0 * pull * windows.mixed[:, axis] + pull**2 * windows.parabola
    falls = squares <= noise**2 * (windows.free + _CHANCE * np.sqrt(2.0 * windows.free))
    straight = centres.copy()
    straight[:, axis] += pull * (times - times[0]) ** 2
    stretches = _all_ends(times, straight, windows, falls, noise, window, gravity)
    if not stretches:
        return None
    longest = max(stretches, key=lambda ends: lasts(times, ends))
    return _described(times, centres, straight, longest, tuple(stretches), up, noise)


def fall_number(times: Array, centres: Array, fall: FreeFall, number: int) -> FreeFall:
    """Another fall of the same recording, by its number in time from 1 on."""
    straight = centres.copy()
    upwards = -1.0 if fall.up.startswith("-") else 1.0
    straight[:, "xyz".index(fall.up[-1])] += 0.5 * upwards * fall.gravity * (times - times[0]) ** 2
    return _described(times, centres, straight, fall.all_ends[number - 1], fall.all_ends, fall.up, fall.noise)


def _described(
    times: Array,
    centres: Array,
    straight: Array,
    ends: tuple[int, int],
    all_ends: tuple[tuple[int, int], ...],
    up: str,
    noise: float,
) -> FreeFall:
    inside = slice(ends[0], ends[1] + 1)
    sign, axis = ("-" if up.startswith("-") else "+"), "xyz".index(up[-1])
    t = times[inside]
    measured, bar = measured_fall(t, centres[inside], noise)
    off = _off_lines(t[None, :, None], straight[None, inside], np.ones((1, len(t), 1)))
    return FreeFall(
        *ends,
        f"{sign}{up[-1]}",
        noise,
        float(np.sqrt((off**2).sum() / (3.0 * (len(t) - 2.0)))),
        float(-float(f"{sign}1") * measured[axis]),
        bar,
        all_ends,
    )


def measured_fall(times: Array, centres: Array, noise: float) -> tuple[Array, float]:
    """Acceleration of a centre of mass (3,), and its standard deviation with the wander of the centre [m/s^2]."""
    duration = float(times[-1] - times[0])
    powers = np.vander((times - times.mean()) / duration, 3)
    acceleration = 2.0 * np.linalg.lstsq(powers, centres, rcond=None)[0][0] / duration**2
    white = 2.0 * noise * float(np.sqrt(np.linalg.inv(powers.T @ powers)[0, 0])) / duration**2
    return acceleration, float(np.hypot(white, 8.0 * _WANDER / duration**2))


def _white_noise(times: Array, centres: Array) -> float:
    """Noise of a coordinate, by the median distance of four neighbours from every parabola: motion counts little."""
    if len(times) < 4:
        return 0.0
    four = np.stack([times[k : len(times) - 3 + k] for k in range(4)], axis=1)
    apart = four[:, :, None] - four[:, None, :] + np.eye(4)
    weights = 1.0 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    values = np.stack([centres[k : len(times) - 3 + k] for k in range(4)], axis=1)
    return float(np.median(np.abs(np.einsum("nk,nkc->nc", weights, values)))) / _NORMAL_MEDIAN


def _all_ends(
    times: Array, straight: Array, windows: _Windows, falls: Mask, noise: float, window: float, gravity: float
) -> list[tuple[int, int]]:
    """First and last samples of the stretches along which a curve is straight, in time."""
    runs = np.flatnonzero(np.diff(np.concatenate([[False], falls, [False]]).astype(int))).reshape(-1, 2)
    best: list[tuple[int, int]] = []
    for first, past in runs.tolist():
        stretch = _bounded(
            times, straight, int(windows.starts[first]), int(windows.ends[past - 1]), noise, window, gravity
        )
        if stretch is None:
            continue
        if best and stretch[0] <= best[-1][1]:
            # One flight with a doubtful window in it.
            best[-1] = max(best[-1], stretch, key=lambda ends: lasts(times, ends))
        else:
            best.append(stretch)
    return best


def lasts(times: Array, ends: tuple[int, int]) -> float:
    """Time from the first to the last of two samples [s]."""
    return float(times[ends[1]] - times[ends[0]])


def _bounded(
    times: Array, straight: Array, first: int, last: int, noise: float, window: float, gravity: float
) -> tuple[int, int] | None:
    """The stretch with its ends where the line is left, less the time of a hidden contact."""
    cut = float(np.sqrt(2.0 * _CUT * noise / gravity))
    start = _end_of_line(-times[::-1], straight[::-1], len(times) - 1 - first, noise, window)
    ends = (len(times) - 1 - start, _end_of_line(times, straight, last, noise, window))
    low = ends[0] if ends[0] == 0 else int(np.searchsorted(times, times[ends[0]] + cut))
    high = ends[1] if ends[1] == len(times) - 1 else int(np.searchsorted(times, times[ends[1]] - cut, "right")) - 1
    # The windows themselves may have reached beyond both ends.
    return (low, high) if high - low + 1 >= _FEWEST and times[high] - times[low] >= 0.5 * window else None


def _end_of_line(times: Array, straight: Array, last: int, noise: float, window: float) -> int:
    """The last sample on the line that the window before the end has, less its own last third."""
    inner = int(np.searchsorted(times, times[last] - window / 3.0))
    begin = max(int(np.searchsorted(times, times[inner] - window)), 0)
    part = slice(begin, inner + 1)
    middle, mean = times[part].mean(), straight[part].mean(axis=0)
    spread = ((times[part] - middle) ** 2).sum()
    slope = (times[part] - middle) @ (straight[part] - mean) / spread
    after = slice(inner, len(times))
    off = straight[after] - mean - (times[after] - middle)[:, None] * slope
    known = noise * np.sqrt(1.0 + 1.0 / (inner + 1 - begin) + (times[after] - middle) ** 2 / spread)
    left = np.flatnonzero(np.abs(off).max(axis=1) > _BAND * known)
    # One sample outside may be chance, two in a row are the end.
    twice = left[:-1][np.diff(left) == 1]
    return inner + int(twice[0]) - 1 if len(twice) else len(times) - 1


def _windows(times: Array, centres: Array, window: float) -> _Windows:
    starts = np.arange(len(times))
    ends = np.maximum(np.searchsorted(times, times + window), starts + _FEWEST - 1)
    starts, ends = starts[ends < len(times)], ends[ends < len(times)]
    squares, mixed, parabola = np.empty(len(starts)), np.empty((len(starts), 3)), np.empty(len(starts))
    widest = int((ends - starts).max(initial=0)) + 1
    for low in range(0, len(starts), _AT_ONCE):
        part = slice(low, low + _AT_ONCE)
        places = starts[part, None] + np.arange(widest)
        inside = (places <= ends[part, None])[:, :, None].astype(float)
        places = np.minimum(places, len(times) - 1)
        t = times[places] - times[starts[part], None]
        off = _off_lines(t[:, :, None], np.concatenate([centres[places], t[:, :, None] ** 2], axis=2), inside)
        squares[part] = (off[:, :, :3] ** 2).sum(axis=(1, 2))
        mixed[part] = (off[:, :, :3] * off[:, :, 3:]).sum(axis=1)
        parabola[part] = (off[:, :, 3] ** 2).sum(axis=1)
    return _Windows(starts, ends, squares, mixed, parabola)


def _off_lines(t: Array, values: Array, inside: Array) -> Array:
    """Residuals of the best straight lines through values at some of the times: (W, k, 1), (W, k, c), (W, k, 1)."""
    count = inside.sum(axis=1, keepdims=True)
    t = (t - (inside * t).sum(axis=1, keepdims=True) / count) * inside
    values = (values - (inside * values).sum(axis=1, keepdims=True) / count) * inside
    return values - t * ((t * values).sum(axis=1, keepdims=True) / (t * t).sum(axis=1, keepdims=True))
