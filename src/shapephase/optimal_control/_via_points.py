"""Waypoints in the coordinates of a task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Integers
from ..body.body import Body
from ..errors import ShapeError, TrajectoryError
from ._ball_chart import BallChart
from .waypoints import Waypoint

# By how much a waypoint may break a coupling, or be beyond a limit [rad or m]: rounding of what the user computed.
_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False)
class ViaPoint:
    """A waypoint of a task.

    Attributes
    ----------
    columns, values : (j,) which of its coordinates are told, and what they are there
    place : the time as a share of the duration; None: open
    """

    columns: Integers
    values: Array
    place: float | None


def via_points(
    body: Body,
    via: Sequence[Waypoint],
    duration: float | None,
    bounds: Array,
    coupling: Array,
    offset: Array,
    chart: BallChart | None,
) -> tuple[ViaPoint, ...]:
    """Of waypoints, by what makes shapes of coordinates (n, m), (n,), without and with ball joints' own.

    duration : None: it is to be found, and no waypoint has a time

    Raises
    ------
    ShapeError, TrajectoryError, UnknownNameError
        For waypoints that no path within limits and couplings passes at their times.
    """
    found, before = [], 0.0
    for number, waypoint in enumerate(via):
        name = f"via: waypoint {number + 1}"
        if not isinstance(waypoint, Waypoint):
            raise ShapeError(f"{name}: a Waypoint(shape, time=...) is needed, got a {type(waypoint).__name__}")
        if waypoint.time is not None:
            if duration is None:
                raise TrajectoryError(
                    f"{name}: with cost='time' waypoints are passed in their order; leave their times out"
                )
            if not before < waypoint.time < duration:
                raise TrajectoryError(
                    f"{name}: at {waypoint.time:.6g} s it must come after {before:.6g} s, and before the end at "
                    f"{duration:.6g} s"
                )
            before = waypoint.time
        columns, values = _coordinates(body, waypoint, bounds, coupling, offset, name)
        if chart is not None:
            if isinstance(waypoint.shape, Mapping):
                raise ShapeError(f"{name}: a body with ball joints that move needs the coordinates of all joints, (n,)")
            values = chart.coordinates(values, name)
            columns = np.arange(len(values))
        found.append(
            ViaPoint(columns, values, None if waypoint.time is None or duration is None else waypoint.time / duration)
        )
    return tuple(found)


def _coordinates(
    body: Body, waypoint: Waypoint, bounds: Array, coupling: Array, offset: Array, name: str
) -> tuple[Integers, Array]:
    """Which coordinates a waypoint tells, and what they are."""
    if isinstance(waypoint.shape, Mapping):
        named = {body.joint_index(joint): value for joint, value in waypoint.shape.items()}
    else:
        shape = np.asarray(waypoint.shape)
        if len(shape) != body.n_shape:
            raise ShapeError(f"{name}: one coordinate for each of the {body.n_shape} joints, got {len(shape)} numbers")
        named = dict(enumerate(shape.tolist()))
    known: dict[int, float] = {}
    for joint, value in named.items():
        if not bounds[joint, 0] - _TOLERANCE <= value <= bounds[joint, 1] + _TOLERANCE:
            raise TrajectoryError(
                f"{name}: joint {body.joint_names[joint]} at {value:.6g} is beyond its limits "
                f"{bounds[joint, 0]:.6g} ... {bounds[joint, 1]:.6g}"
            )
        moves, column = coupling[joint].any(), int(np.argmax(coupling[joint] != 0.0))
        if moves and column not in known:
            known[column] = (value - offset[joint]) / coupling[joint, column]
        must = coupling[joint, column] * known[column] + offset[joint] if moves else offset[joint]
        if abs(must - value) > _TOLERANCE:
            raise TrajectoryError(
                f"{name}: joint {body.joint_names[joint]} at {value:.6g} must be at {must:.6g}, where the joint that "
                "it follows puts it, or where it is held fixed"
            )
    if not known:
        raise TrajectoryError(f"{name}: none of its joints moves")
    columns = np.array(sorted(known))
    return columns, np.array([known[column] for column in columns.tolist()])
