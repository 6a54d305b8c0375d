"""The airborne part of a trajectory: where the centre of mass falls, or, without weight, where it goes straight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..display import short_repr
from ..errors import ShapeError, TrajectoryError
from ..letters import what_came
from ..shape_space.files._free_fall import free_fall
from .floating_trajectory import FloatingTrajectory

_GRAVITY = 9.81
"""[m/s^2]"""
_EVEN = 0.3
"""Of gravity: ground that carries a body or lets it go changes the acceleration of its centre of mass by more."""
_WINDOWS = 12
"""Over the whole trajectory, over each of which an acceleration is fitted."""
_LEAST_WINDOW = 8
"""Samples of a window."""


@dataclass(frozen=True)
class AirbornePart:
    """Which samples are audited, and how they were found.

    Attributes
    ----------
    first, past : samples, the last one left out
    how : for people
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
    times, centres = trajectory.times, _centres(body, trajectory)
    if isinstance(flight, str) and flight == "all":
        return _part(times, centres, 0, len(times), "all of it, as given")
    if not isinstance(flight, str) and isinstance(flight, Sequence | np.ndarray) and len(flight) == 2:
        first, last = float(flight[0]), float(flight[1])
        inside = np.flatnonzero((times >= first) & (times <= last))
        if len(inside) < 3 * _LEAST_WINDOW:
            raise TrajectoryError(
                f"{trajectory.name}: {len(inside)} samples from {first:.9g} to {last:.9g} s; an audit needs "
                f"{3 * _LEAST_WINDOW}, and the trajectory goes from {times[0]:.9g} to {times[-1]:.9g} s"
            )
        return _part(times, centres, int(inside[0]), int(inside[-1]) + 1, "between the times given")
    if not isinstance(flight, str) or flight != "auto":
        raise ShapeError(f"flight: 'auto', 'all' or two times are needed, got {what_came(flight)}")
    if centres is None:
        return _part(times, None, 0, len(times), "all of it: places are not given, and no fall can be looked for")
    found = _accelerations(times, centres)
    if np.linalg.norm(found - np.median(found, axis=0), axis=1).max() < _EVEN * _GRAVITY:
        falls = np.linalg.norm(np.median(found, axis=0)) > _EVEN * _GRAVITY
        how = "all of it: the centre of mass falls" if falls else "all of it: the centre of mass has no weight"
        return _part(times, centres, 0, len(times), how)
    fall = free_fall(times - times[0], centres, trajectory.name)
    return _part(times, centres, fall.first, fall.last + 1, f"the centre of mass falls, {fall.up} up")


def _centres(body: Body, trajectory: FloatingTrajectory) -> Array | None:
    if trajectory.position is None:
        return None
    return trajectory.position + so3.apply(trajectory.attitude, body.centre_of_mass(trajectory.shapes))


def _part(times: Array, centres: Array | None, first: int, past: int, how: str) -> AirbornePart:
    if past - first < 3 * _LEAST_WINDOW:
        raise TrajectoryError(f"{past - first} samples are in the air; an audit needs {3 * _LEAST_WINDOW} or more")
    if centres is None:
        return AirbornePart(first, past, how)
    x, y, z = _acceleration(times[first:past], centres[first:past]).tolist()
    return AirbornePart(first, past, how, (x, y, z))


def _acceleration(times: Array, centres: Array) -> Array:
    since = times - times.mean()
    powers = np.stack([np.ones_like(since), since, 0.5 * since**2], axis=1)
    return np.linalg.lstsq(powers, centres, rcond=None)[0][2]


def _accelerations(times: Array, centres: Array) -> Array:
    count = max(_LEAST_WINDOW, len(times) // _WINDOWS)
    starts = range(0, len(times) - count + 1, count)
    return np.array([_acceleration(times[k : k + count], centres[k : k + count]) for k in starts])
