"""The airborne part of a trajectory: where the centre of mass falls, or, without weight, where it goes straight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from .. import so3
from ..arrays import Array, Integers
from ..body.body import Body
from ..display import short_repr
from ..errors import ShapeError, TrajectoryError
from ..letters import value_text
from ..shape_space.files.flight import flight_choices
from ..shape_space.free_fall import free_fall
from ..shape_space.path_noise import white_noise
from .floating_trajectory import FloatingTrajectory

_GRAVITY = 9.81  # [m/s^2]
_EVEN = 0.3  # of gravity: the ground changes the acceleration of the centre of mass by more
_WINDOWS = 12  # over the whole trajectory, with an acceleration fitted in each
_LEAST_WINDOW = 8  # samples of a window
_FEWEST = 8  # samples of a flight: a dive of 0.3 s at 30 frames a second
_STRAIGHT = 0.5
"""Share of how far the base is off parabolas: the centre of mass of a body that nothing carries is off by less, in most
windows; that of a body that stands or walks goes with its base, or farther."""
_OF_A_SAG = 0.02  # rms off a parabola over its sag, a T^2 / 8: 8 mm where 0.8 m are fallen through on the moon in 1 s
_BY_NOISE = 4.0  # standard deviations of the noise, by which it may be off anyway
_MANY = 5000  # samples; of more, so few a second are looked at that they are about this far apart:
_ENOUGH = 1.0 / 120.0  # [s] A twentieth of the shortest flight that can be told from rest
_CHANCE = 1e-6  # probability with which noise alone ends a flight
_STEEP = np.sqrt(0.5)  # cosine of the largest angle of the ground's push from upwards, with a friction of 1
_TOUCH = 0.01  # of gravity: in a hundredth of a second less changes momenta by less than the usual tolerance
_FEWEST_WINDOWS = 6  # in the middle half, whose largest jump says little of fewer: 24 samples have them
_NUDGE = 1e-5  # [s] by which joints are moved along their rates for the velocity of the centre of mass
_ABRUPT = 2.0  # times the largest jump before
_SHORTEST = 3  # samples of a window: a second difference
_LONGER = 1.5  # ratio of a window's samples to those of the next shorter one
_OVERLAP = 8  # windows begin at every eighth of their length, so that their number grows as that of the samples


@dataclass(frozen=True)
class AirbornePart:
    """Audited samples, and how they were found.

    Attributes
    ----------
    first, past : samples, the last one left out
    how : how they were found, in words
    acceleration : of the centre of mass there, world axes [m/s^2]; None where places are not known

    Examples
    --------
    >>> sp.auditing.AirbornePart(0, 100, "all of it, as asked for").past
    100
    """

    first: int
    past: int
    how: str
    acceleration: tuple[float, float, float] | None = None

    __repr__ = short_repr


def airborne_part(body: Body, trajectory: FloatingTrajectory, flight: str | Sequence[float]) -> AirbornePart:
    """The stretch that is audited.

    Raises
    ------
    ShapeError
        If `flight` is neither "auto" nor "all" nor two times.
    TrajectoryError
        If there is no flight to be found.
    """
    times, centres, speeds = trajectory.times, _centres(body, trajectory), _speeds(body, trajectory)
    if isinstance(flight, str) and flight == "all":
        return _part(times, centres, 0, len(times), "all of it, as given")
    if not isinstance(flight, str) and isinstance(flight, Sequence | np.ndarray) and len(flight) == 2:
        first, last = float(flight[0]), float(flight[1])
        inside = np.flatnonzero((times >= first) & (times <= last))
        if len(inside) < _FEWEST:
            raise TrajectoryError(
                f"{trajectory.name}: {len(inside)} samples from {first:.9g} to {last:.9g} s; an audit needs "
                f"{_FEWEST}, and the trajectory goes from {times[0]:.9g} to {times[-1]:.9g} s: give other times: "
                "flight=(first, last) (--flight FIRST LAST)"
            )
        return _part(times, centres, int(inside[0]), int(inside[-1]) + 1, "between the times given")
    number = flight_choices(flight, None, None).number if isinstance(flight, str) else None
    if not isinstance(flight, str) or (flight != "auto" and number is None):
        raise ShapeError(f"flight: 'auto', 'auto:2', 'all' or two times are needed, got {value_text(flight)}")
    if centres is None:
        return _part(times, None, 0, len(times), "all of it: places are not given, and no fall can be looked for")
    usual = float(np.median(np.diff(times)))
    every = max(1, int(_ENOUGH / usual)) if len(times) > _MANY else 1
    some, base = centres[::every], trajectory.position[::every] if trajectory.position is not None else centres
    at = times[::every]
    if number is None and _falls_whole(at, some):
        return _clear_part(times, centres, speeds, 0, len(times), "all of it: the centre of mass falls")
    found = _accelerations(at, some)
    if np.linalg.norm(found - np.median(found, axis=0), axis=1).max() < _EVEN * _GRAVITY:
        if number is None and np.linalg.norm(np.median(found, axis=0)) > _EVEN * _GRAVITY:
            return _clear_part(times, centres, speeds, 0, len(times), "all of it: the centre of mass falls")
        if number is None and _goes_straight(at, some, base):
            return _clear_part(times, centres, speeds, 0, len(times), "all of it: the centre of mass has no weight")
    try:
        fall = free_fall(at - at[0], some, trajectory.name)
    except TrajectoryError:
        raise TrajectoryError(
            f"{trajectory.name}: nowhere in the air: the centre of mass neither falls freely anywhere, nor goes "
            "straight where the base does not. Are the axes of the base right (base_axes, --base-axes)? If so, and "
            "there is a flight, give its times: flight=(first, last) (--flight FIRST LAST)"
        ) from None
    if number is not None and number > len(fall.all_ends):
        raise TrajectoryError(
            f"{trajectory.name}: there is no flight number {number}, there are {len(fall.all_ends)}; take one of them "
            f"(flight='auto:{len(fall.all_ends)}', --flight auto:{len(fall.all_ends)})"
        )
    first, last = fall.ends if number is None else fall.all_ends[number - 1]
    flights = "; ".join(f"{at[one]:.6g} to {at[other]:.6g} s" for one, other in fall.all_ends)
    others = f", of {len(fall.all_ends)} flights ({flights}; --flight auto:2)" if len(fall.all_ends) > 1 else ""
    past = min(every * last + 1, len(times))
    return _clear_part(times, centres, speeds, every * first, past, f"the centre of mass falls, {fall.up} up{others}")


def _falls_whole(times: Array, centres: Array) -> bool:
    """Whether all samples are near one parabola that sags far: nothing that stands or walks goes so, in any noise."""
    span = float(times[-1] - times[0])
    basis = np.vander((times - times[0]) / span, 3)
    curve, *_ = np.linalg.lstsq(basis, centres, rcond=None)
    off = float(np.sqrt(((centres - basis @ curve) ** 2).sum(axis=1).mean()))
    return off <= _OF_A_SAG * 0.25 * float(np.linalg.norm(curve[0]))


def _goes_straight(times: Array, centres: Array, base: Array) -> bool:
    """Whether a centre of mass stays on parabolas in most windows, while the base leaves them."""
    noise = float(white_noise(centres[:, None], 3)[0])
    off, beside = (_off_parabolas(times, places) for places in (centres, base))
    return bool(np.median(off <= np.maximum(_STRAIGHT * beside, _BY_NOISE * noise)) > 0.5)


def off_parabola(body: Body, trajectory: FloatingTrajectory, part: AirbornePart) -> float:
    """Rms of what the best parabola leaves of the centre of mass in a stretch [m]; 0 where places are unknown."""
    centres = _centres(body, trajectory)
    if centres is None:
        return 0.0
    times = trajectory.times[part.first : part.past]
    basis = np.linalg.qr(((times - times.mean()) / (times[-1] - times[0]))[:, None] ** np.arange(3))[0]
    inside = centres[part.first : part.past]
    return float(np.sqrt(((inside - basis @ (basis.T @ inside)) ** 2).sum(axis=1).mean()))


def _centres(body: Body, trajectory: FloatingTrajectory) -> Array | None:
    if trajectory.position is None:
        return None
    return trajectory.position + so3.apply(trajectory.attitude, body.centre_of_mass(trajectory.shapes))


def _speeds(body: Body, trajectory: FloatingTrajectory) -> Array | None:
    """Velocity of the centre of mass by the given rates, world axes, (N, 3) [m/s]; None without rates."""
    velocity, rate, joint_rates = trajectory.world_velocity, trajectory.base_rate, trajectory.joint_rates
    if velocity is None or rate is None or joint_rates is None:
        return None
    shapes = trajectory.shapes
    behind, ahead = (body.centre_of_mass(shapes + sign * _NUDGE * joint_rates) for sign in (-1.0, 1.0))
    in_base = so3.cross(rate, body.centre_of_mass(shapes)) + (ahead - behind) / (2.0 * _NUDGE)
    return velocity + so3.apply(trajectory.attitude, in_base)


def _clear_part(times: Array, centres: Array, speeds: Array | None, first: int, past: int, how: str) -> AirbornePart:
    """The stretch without what a contact accelerates at its ends, which `how` then names."""
    begin, end = first, past
    every = -(-(past - first) // _MANY)
    # Rates that are given show a contact within a sample, through noise that hides it from places.
    for values, order in ((centres, 2), (speeds, 1)):
        if values is not None:
            at, some = times[first:past], values[first:past]
            end = min(end, first + _every_end(at, some, order, every))
            begin = max(begin, past - _every_end(-at[::-1], some[::-1] * (-1.0) ** order, order, every))
    if end - begin < _FEWEST:
        begin, end = first, past
    if begin > first or end < past:
        how = f"{how.removeprefix('all of it: ')}, less what is held up"
        how += f" before {times[begin]:.6g} s" if begin > first else ""
        how += f" after {times[end - 1]:.6g} s" if end < past else ""
    return _part(times, centres, begin, end, how)


def _every_end(times: Array, values: Array, order: int, every: int) -> int:
    """The end by `_flight_end`, found in one of every so many samples."""
    end = _flight_end(times[::every], values[::every], order)
    return len(times) if every * end >= len(times) else every * max(end - 1, 0) + 1


def _flight_end(times: Array, values: Array, order: int) -> int:
    """The sample before which a contact in the last quarter begins, else the number of samples.

    The flight grows from the middle half of the samples. At each sample the accelerations on windows before and after
    it are compared, for windows of all lengths; the first jump that noise alone brings in all of them with `_CHANCE`
    ends the flight if it is the ground's: `_EVEN` of gravity, or less, but upwards and until the end.

    values : (N, 3) of the centre of mass: with order 2 its places, with order 1 its velocities
    """
    count = len(times)
    quarter, length = count // 4, float(_SHORTEST)
    lengths = []
    while length <= max(count // _WINDOWS, _SHORTEST):
        lengths.append(int(length))
        length = max(_LONGER * length, length + 1.0)
    limit = float(np.sqrt(chi2.isf(_CHANCE / (count * len(lengths)), 3)))
    noise = float(white_noise(values[:, None], 3)[0])
    end = count
    for length in lengths:
        stride = max(1, length // _OVERLAP)
        # The last window ends with the samples.
        starts = np.arange((count - length) % stride, count - length + 1, stride)
        pulls, bars = _window_accelerations(times, values, starts, length, order)
        before = np.searchsorted(starts, starts - length, side="right") - 1
        middle = (starts - length >= quarter) & (starts + length <= count - quarter)
        if middle.sum() < _FEWEST_WINDOWS:
            continue
        jumps = np.where(before >= 0, np.linalg.norm(pulls - pulls[before], axis=1), 0.0)
        # What is smooth jumps from window to window by as much as it did before.
        usual = np.maximum.accumulate(np.where(starts - length >= quarter, jumps, 0.0))[before]
        level = np.maximum(limit * np.sqrt(2.0) * noise * bars, _ABRUPT * np.maximum(usual, jumps[middle].max()))
        touched = jumps > np.maximum(level, _TOUCH * _GRAVITY)
        later = np.flatnonzero(touched & (starts + length > count - quarter) & (starts + length <= end))
        if not len(later):
            continue
        first = int(later[0])
        pull = np.median(pulls[middle], axis=0)
        held = pulls[first:].mean(axis=0) - pull
        size = float(np.linalg.norm(held))
        upwards = -held @ pull > _STEEP * float(np.linalg.norm(pull)) * size > 0.0
        if (
            end < count
            or jumps[later].max() > _EVEN * _GRAVITY
            or (length == _SHORTEST and upwards and size > 0.5 * jumps[first])
        ):
            end = max(int(starts[first]) + 2 - stride, 0)
    return end


def _window_accelerations(
    times: Array, values: Array, starts: Integers, length: int, order: int
) -> tuple[Array, Array]:
    """Accelerations on windows, (W, 3) [m/s^2], and their standard deviations for a unit one of the samples, (W,)."""
    samples = starts[:, None] + np.arange(length)
    since = times[samples] - times[samples].mean(axis=1, keepdims=True)
    power = since**order - (since**order).mean(axis=1, keepdims=True)
    if order > 1:
        power -= since * ((power * since).sum(axis=1) / (since**2).sum(axis=1))[:, None]
    weights = order * power / (power**2).sum(axis=1, keepdims=True)
    return np.einsum("wn,wnc->wc", weights, values[samples]), np.linalg.norm(weights, axis=1)


def _part(times: Array, centres: Array | None, first: int, past: int, how: str) -> AirbornePart:
    if past - first < _FEWEST:
        raise TrajectoryError(
            f"{past - first} samples are in the air; an audit needs {_FEWEST} or more. Give a longer flight, or one "
            "with more samples a second; `shapephase split` fits the momentum of a short one"
        )
    if centres is None:
        return AirbornePart(first, past, how)
    x, y, z = _acceleration(times[first:past], centres[first:past]).tolist()
    return AirbornePart(first, past, how, (x, y, z))


def _acceleration(times: Array, centres: Array) -> Array:
    since = times - times.mean()
    powers = np.stack([np.ones_like(since), since, 0.5 * since**2], axis=1)
    return np.linalg.lstsq(powers, centres, rcond=None)[0][2]


def _accelerations(times: Array, centres: Array) -> Array:
    return np.array([_acceleration(times[part], centres[part]) for part in _windows(len(times))])


def _off_parabolas(times: Array, places: Array) -> Array:
    """Rms of what the best parabola leaves in each window, along the axis where it is most [m]."""
    found = []
    for part in _windows(len(times)):
        since = times[part] - times[part].mean()
        basis = np.linalg.qr(since[:, None] ** np.arange(3))[0]
        left = places[part] - basis @ (basis.T @ places[part])
        found.append(np.sqrt((left**2).mean(axis=0)).max())
    return np.array(found)


def _windows(samples: int) -> list[slice]:
    count = max(_LEAST_WINDOW, samples // _WINDOWS)
    return [slice(k, k + count) for k in range(0, samples - count + 1, count)]
