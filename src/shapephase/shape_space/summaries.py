"""Summaries of a body, and of a joint motion for it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..arrays import Array
from ..body.body import Body
from ..body.couplings.coupling import described
from ..body.loading import as_body
from ..display import frozen
from ..inertia_tensor import principal_axes, triangle_defect
from .body_path import path_gap, users_route_along
from .path_series import joint_extremes, times_of_fastest
from .shape_path import CLOSED, ShapePath

_KINDS = {"rad": "revolute", "m": "prismatic", "1": "ball"}


@frozen
class JointSummary:
    """One joint: its kind ("revolute", "continuous" or "prismatic"), limits (infinite where there are none), unit.

    A ball joint ("ball") has four of them, one for each number. Made by `body_summary`.
    """

    name: str
    kind: str
    lower: float
    upper: float
    unit: str


@frozen
class PartSummary:
    """Rigid part: a link and those that are fixed to it. Made by `body_summary`.

    Attributes
    ----------
    links : their names
    mass : [kg]
    centre_of_mass : (3,) axes of the first link [m]
    principal_moments : (3,) ascending, about the centre of mass [kg m^2]
    """

    links: tuple[str, ...]
    mass: float
    centre_of_mass: Array
    principal_moments: Array


@frozen
class BodySummary:
    """A body at its neutral shape. Made by `body_summary`.

    Attributes
    ----------
    name, sha256 : of the body, and of its file
    mass : [kg]
    centre_of_mass : (3,) from the base origin, base axes [m]
    principal_moments : (3,) ascending [kg m^2]
    principal_axes : (3, 3), columns, base axes
    triangle_defect : by how much the largest moment is above the sum of the others, relative; not above 0 for real mass
    joints : the independent ones, in the order of the shape vector
    followers : of each joint that follows others, in words, how
    links : all of them, by name
    parts : what moves as one, the base first
    """

    name: str
    sha256: str | None
    mass: float
    centre_of_mass: Array
    principal_moments: Array
    principal_axes: Array
    triangle_defect: float
    joints: tuple[JointSummary, ...]
    followers: Mapping[str, str]
    links: tuple[str, ...]
    parts: tuple[PartSummary, ...]


@frozen
class PathSummary:
    """A joint motion for a body. Made by `path_summary`.

    Attributes
    ----------
    duration : [s]
    breaks : how many times, ends included, between which it is smooth
    lowest, highest : (n,) of each joint over the whole path, to 1e-14 of its size [rad or m]
    fastest : (n,) largest rate of each joint, to the same accuracy [rad/s or m/s]
    fastest_at : (n,) when that is in the first loop, to a twentieth of a panel on which the path swings once [s]
    joints_beyond_limits : names of the joints that leave their limits
    joints_beyond_rates : names of the joints that are faster than the rate limits of the body's file
    still_joints : names of the joints that do not move
    gap : (n,) end minus start, without whole turns of continuous joints [rad or m]
    is_loop : True if it closes
    """

    duration: float
    breaks: int
    lowest: Array
    highest: Array
    fastest: Array
    fastest_at: Array
    joints_beyond_limits: tuple[str, ...]
    joints_beyond_rates: tuple[str, ...]
    still_joints: tuple[str, ...]
    gap: Array
    is_loop: bool


def body_summary(body: Body | str) -> BodySummary:
    """Summarise a body at its neutral shape.

    Examples
    --------
    >>> summary = sp.body_summary(sp.load_body("cat"))
    >>> round(summary.mass, 6), len(summary.joints), summary.principal_moments.round(4).tolist()
    (4.0, 23, [0.0119, 0.0799, 0.085])
    """
    body = as_body(body)
    neutral = body.shape()
    inertia = body.locked_inertia(neutral)
    moments, axes = principal_axes(inertia)
    kinds = [
        "continuous" if endless else _KINDS[unit]
        for endless, unit in zip(body.continuous, body.joint_units, strict=True)
    ]
    joints = zip(body.joint_names, kinds, body.joint_limits.tolist(), body.joint_units, strict=True)
    return BodySummary(
        name=body.name,
        sha256=body.sha256,
        mass=body.mass,
        centre_of_mass=body.centre_of_mass(neutral),
        principal_moments=moments,
        principal_axes=axes,
        triangle_defect=float(triangle_defect(inertia)),
        joints=tuple(
            JointSummary(name=name, kind=kind, lower=lower, upper=upper, unit=unit)
            for name, kind, (lower, upper), unit in joints
        ),
        followers={name: described(coupling) for name, coupling in body.couplings.items()},
        links=body.link_names,
        parts=tuple(
            PartSummary(
                links=part.links,
                mass=part.mass,
                centre_of_mass=part.centre,
                principal_moments=principal_axes(part.inertia)[0],
            )
            for part in body.moving_parts
        ),
    )


def path_summary(body: Body | str, path: ShapePath | str) -> PathSummary:
    """Summarise a joint motion for a body.

    Raises
    ------
    TrajectoryError, UnknownNameError
        For a path of other joints.
    NoisyPathError, AccuracyNotReached
        If a path known only as a function is too rough for its extremes to be found (`ShapePath.scan`).

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)
    >>> summary = sp.path_summary(cat, loop)
    >>> summary.duration, summary.is_loop
    (1.0, True)
    """
    body = as_body(body)
    route = users_route_along(body, path)
    lowest, highest, fastest = joint_extremes(route)
    lower, upper = body.joint_limits.T
    # A joint that is driven up to its limit is not beyond it, whatever rounding has done to the samples.
    slack = CLOSED * (1.0 + np.maximum(np.abs(lowest), np.abs(highest)))
    outside = (lowest < lower - slack) | (highest > upper + slack)
    gap = path_gap(body, route)
    names = np.array(body.joint_names)
    return PathSummary(
        duration=route.duration,
        breaks=len(route.breaks),
        lowest=lowest,
        highest=highest,
        fastest=fastest,
        fastest_at=times_of_fastest(route),
        joints_beyond_limits=tuple(names[outside].tolist()),
        joints_beyond_rates=tuple(names[fastest > (1.0 + CLOSED) * body.rate_limits].tolist()),
        still_joints=tuple(names[fastest == 0.0].tolist()),
        gap=gap,
        is_loop=bool(np.all(np.abs(gap) <= CLOSED)),
    )
