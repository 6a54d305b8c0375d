"""What there is to know of a body, and of a joint motion for it, before anything is computed with them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..inertia_tensor import principal_axes, triangle_defect
from .body_path import path_gap
from .shape_path import CLOSED, ShapePath

_SAMPLES = 401


@dataclass(frozen=True, eq=False)
class JointCard:
    """One joint: its kind ("revolute", "continuous" or "prismatic"), limits (infinite where there are none), unit."""

    name: str
    kind: str
    lower: float
    upper: float
    unit: str


@dataclass(frozen=True, eq=False)
class BodySummary:
    """A body at its neutral shape.

    Attributes
    ----------
    name, sha256 : of the body, and of its file
    mass : [kg]
    centre_of_mass : (3,) from the base origin, base axes [m]
    principal_moments : (3,) ascending [kg m^2]
    principal_axes : (3, 3), columns, base axes
    triangle_defect : by how much the largest moment is above the sum of the others, relative; not above 0 for real mass
    joints : the independent ones, in the order of the shape vector
    links : all of them, by name
    """

    name: str
    sha256: str | None
    mass: float
    centre_of_mass: Array
    principal_moments: Array
    principal_axes: Array
    triangle_defect: float
    joints: tuple[JointCard, ...]
    links: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class PathSummary:
    """A joint motion for a body.

    Attributes
    ----------
    duration : [s]
    breaks : how many times, ends included, between which it is smooth
    lowest, highest : (n,) of each joint, at 401 times and the breaks [rad or m]
    fastest : (n,) largest rate of each joint there [rad/s or m/s]
    beyond : names of the joints that leave their limits
    resting : names of the joints that do not move
    gap : (n,) where it ends, from where it begins, whole turns of continuous joints taken off
    is_loop : whether it closes
    """

    duration: float
    breaks: int
    lowest: Array
    highest: Array
    fastest: Array
    beyond: tuple[str, ...]
    resting: tuple[str, ...]
    gap: Array
    is_loop: bool


def body_summary(body: Body) -> BodySummary:
    """The card of a body."""
    neutral = body.shape()
    inertia = body.locked_inertia(neutral)
    moments, axes = principal_axes(inertia)
    kinds = [
        "continuous" if endless else "prismatic" if unit == "m" else "revolute"
        for endless, unit in zip(body.continuous, body.joint_units, strict=True)
    ]
    joints = zip(body.joint_names, kinds, body.joint_limits.tolist(), body.joint_units, strict=True)
    return BodySummary(
        body.name,
        body.sha256,
        body.mass,
        body.centre_of_mass(neutral),
        moments,
        axes,
        float(triangle_defect(inertia)),
        tuple(JointCard(name, kind, lower, upper, unit) for name, kind, (lower, upper), unit in joints),
        body.link_names,
    )


def path_summary(body: Body, path: ShapePath) -> PathSummary:
    """The card of a joint motion. Raises TrajectoryError, UnknownNameError for joints of another body."""
    route = path.matched(body.joint_names, body.name)
    times = np.union1d(np.linspace(0.0, route.duration, _SAMPLES), route.breaks)
    shapes, rates = route.curve(times)
    lowest, highest, fastest = shapes.min(axis=0), shapes.max(axis=0), np.abs(rates).max(axis=0)
    lower, upper = body.joint_limits.T
    slack = CLOSED * (1.0 + np.abs(shapes).max(axis=0))
    beyond = (lowest < lower - slack) | (highest > upper + slack)
    gap = path_gap(body, route)
    return PathSummary(
        route.duration,
        len(route.breaks),
        lowest,
        highest,
        fastest,
        tuple(np.array(body.joint_names)[beyond].tolist()),
        tuple(np.array(body.joint_names)[fastest == 0.0].tolist()),
        gap,
        bool(np.all(np.abs(gap) <= CLOSED)),
    )
