"""The stretch of a recording on which the body falls freely: its centre of mass accelerates as gravity alone makes it.

Less what gravity does, the centre of mass then goes along a straight line. No direction is taken for the vertical: the
axis of the recorder that gives the longest fall is it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...arrays import Array, Integers, Mask
from ...errors import TrajectoryError

_GRAVITY = 9.81
"""[m/s^2] On earth it differs by a quarter of a per cent, which moves nothing by a millimetre within a second."""
_MODEL = 0.002
"""[m] A centre of mass that is computed from a body's masses wanders by about this much as the body changes shape."""
_CLEAR = 5.0
"""A body at rest leaves this many times the noise on a window: so it is known from one that falls."""
_OF_A_PARABOLA = 1.0 / (6.0 * np.sqrt(5.0))
"""Rms of t^2 about its best straight line on a window of length one."""
_CHANCE = 4.0
"""Standard deviations by which the mean square of a window may exceed that of the noise."""
_BAND = 3.0
"""Standard deviations within which single samples follow the line, at the ends of the fall."""
_CUT = 2.0
"""Standard deviations: for so long a contact that accelerates the body by g may last unseen, and that much is cut."""
_FEWEST = 6
"""Samples of a window."""
_AT_ONCE = 1024
"""Windows: memory."""
_NORMAL_MEDIAN = 0.6745
"""The median of the size of a normal number of standard deviation one."""


@dataclass(frozen=True)
class FreeFall:
    """A stretch of a recording on which the body falls freely.

    Attributes
    ----------
    first, last : its samples
    up : the axis of the recorder that points up, as "+y"
    noise : of each coordinate of the centre of mass, by which it was found [m]
    off : how far the centre of mass is from its parabola, rms of a coordinate [m]
    """

    first: int
    last: int
    up: str
    noise: float
    off: float

    @property
    def ends(self) -> tuple[int, int]:
        """First and last sample."""
        return self.first, self.last


class _Windows(NamedTuple):
    """Short stretches, and what the best straight lines leave of the centre of mass and of the square of the time.

    Attributes
    ----------
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


def free_fall(times: Array, centres: Array, where: str) -> FreeFall:
    """The longest stretch on which a centre of mass falls freely.

    Parameters
    ----------
    times : (N,) ascending [s]
    centres : (N, 3) of mass, axes of the recorder, one of which is vertical [m]
    where : the file, for messages

    Raises
    ------
    TrajectoryError
        If there is none that is long enough to tell it from rest.
    """
    noise = float(np.hypot(_white_noise(times, centres), _MODEL))
    window = float(np.sqrt(_CLEAR * noise / (0.5 * _GRAVITY * _OF_A_PARABOLA)))
    windows = _windows(times, centres, window)
    longest: FreeFall | None = None
    for axis in range(3):
        for sign in (1.0, -1.0):
            pull = 0.5 * sign * _GRAVITY
            squares = windows.squares + 2.0 * pull * windows.mixed[:, axis] + pull**2 * windows.parabola
            falls = squares <= noise**2 * (windows.free + _CHANCE * np.sqrt(2.0 * windows.free))
            straight = centres.copy()
            straight[:, axis] += pull * (times - times[0]) ** 2
            found = _longest(times, straight, windows, falls, noise, window)
            if found is not None and (longest is None or _lasts(times, found) > _lasts(times, longest.ends)):
                inside = slice(found[0], found[1] + 1)
                off = _off_line(times[inside], straight[inside])
                longest = FreeFall(found[0], found[1], f"{'+' if sign > 0 else '-'}{'xyz'[axis]}", noise, off)
    if longest is None:
        raise TrajectoryError(
            f"{where}: nowhere does the centre of mass fall freely for {window:.2g} s or more (it is known to "
            f"{1e3 * noise:.2g} mm). Are the axes of the base right (base_axes, --base-axes)? If so, and there is a "
            "flight, give its times: flight=(first, last) (--flight FIRST LAST)"
        )
    return longest


def _white_noise(times: Array, centres: Array) -> float:
    """Of a coordinate, by how far four neighbours are off every parabola: in the median smooth motion counts little."""
    if len(times) < 4:
        return 0.0
    four = np.stack([times[k : len(times) - 3 + k] for k in range(4)], axis=1)
    apart = four[:, :, None] - four[:, None, :] + np.eye(4)
    weights = 1.0 / apart.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    values = np.stack([centres[k : len(times) - 3 + k] for k in range(4)], axis=1)
    return float(np.median(np.abs(np.einsum("nk,nkc->nc", weights, values)))) / _NORMAL_MEDIAN


def _longest(
    times: Array, straight: Array, windows: _Windows, falls: Mask, noise: float, window: float
) -> tuple[int, int] | None:
    """First and last sample of the longest stretch along which a curve is straight."""
    runs = np.flatnonzero(np.diff(np.concatenate([[False], falls, [False]]).astype(int))).reshape(-1, 2)
    best: tuple[int, int] | None = None
    for first, past in runs.tolist():
        found = _bounded(times, straight, int(windows.starts[first]), int(windows.ends[past - 1]), noise, window)
        if found is not None and (best is None or _lasts(times, found) > _lasts(times, best)):
            best = found
    return best


def _lasts(times: Array, ends: tuple[int, int]) -> float:
    return float(times[ends[1]] - times[ends[0]])


def _bounded(
    times: Array, straight: Array, first: int, last: int, noise: float, window: float
) -> tuple[int, int] | None:
    """The same stretch with its ends where the line is left, less what a contact may last unseen."""
    cut = float(np.sqrt(2.0 * _CUT * noise / _GRAVITY))
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
    """What the best straight lines leave of values at some of the times: (W, k, 1), (W, k, c), (W, k, 1)."""
    count = inside.sum(axis=1, keepdims=True)
    t = (t - (inside * t).sum(axis=1, keepdims=True) / count) * inside
    values = (values - (inside * values).sum(axis=1, keepdims=True) / count) * inside
    return values - t * ((t * values).sum(axis=1, keepdims=True) / (t * t).sum(axis=1, keepdims=True))


def _off_line(times: Array, straight: Array) -> float:
    """Rms of a coordinate about the best straight line [m]."""
    off = _off_lines(times[None, :, None], straight[None], np.ones((1, len(times), 1)))
    return float(np.sqrt((off**2).sum() / (3.0 * (len(times) - 2.0))))
