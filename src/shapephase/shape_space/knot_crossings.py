"""Times at which a motion takes joints through the knots of the functions that others follow them by.

There the deformation of a body is less smooth than the path: they are breaks of the path as the body follows it. A path
is taken as Chebyshev series on panels that halve until they follow it; zeros of series are eigenvalues.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import chebyshev

from ..arrays import Array
from ..body.body import Body
from ..body.couplings.ball_joints import BallJoint
from ..body.couplings.coordinate_map import CoordinateMap
from ..body.particles.point_masses import ParticleBody
from ..errors import TrajectoryError
from .curves import CLOSED, Curve, PiecewisePolynomial
from .path_series import merged, panel_edges, resolved_series
from .shape_path import ShapePath

_ROUNDING = 64.0 * np.finfo(float).eps  # relative to a coordinate's size, where it crosses a knot
_NEARLY_REAL = 1e-6  # imaginary part in half panels: rounding leaves the root of a double zero


def with_crossings(body: Body | ParticleBody, route: ShapePath) -> ShapePath:
    """Return a path, its columns in the order of the body's joints, with breaks where the body's motion is less smooth.

    Raises TrajectoryError if a spline goes from a quaternion of a ball joint to one of the other sign.
    """
    if isinstance(body, ParticleBody):
        return route
    follows = body.chain.follows
    for ball in follows.balls:
        _check_signs(ball, route)
    if follows.is_linear:
        return route
    drivers = np.isin(np.array(body.joint_names, dtype=str), follows.drivers)
    if route.loops > 1 and (np.abs(route.gap[drivers]) > CLOSED).any():
        # What follows by a curve is elsewhere in the next loop.
        route = replace(route, breaks=_loop_ends(route), loops=1)
    if follows.is_smooth:
        return route
    crossings = crossing_times(follows, route.curve, panel_edges(route))
    if not len(crossings):
        return route
    known = merged(route.smoothness.breaks, _loop_ends(route))
    starts = route.duration / route.loops * np.arange(route.loops)
    breaks = merged(known, (starts[:, None] + crossings).ravel())
    return replace(route, breaks=breaks)


def _check_signs(ball: BallJoint, route: ShapePath) -> None:
    """Raise TrajectoryError where a spline goes from a quaternion of a ball joint to one of the other sign."""
    if not isinstance(route.curve, PiecewisePolynomial):
        return
    four = route.curve(route.breaks)[0][:, ball.columns]
    across = np.flatnonzero(np.sum(four[1:] * four[:-1], axis=1) < 0.0)
    if len(across):
        raise TrajectoryError(
            f"ball joint {ball.name}: from {route.breaks[across[0]]:.9g} s to {route.breaks[across[0] + 1]:.9g} s its "
            "quaternion goes to the far side: give the path joint_names, by which samples get the signs of their "
            "neighbours, or samples nearer to each other"
        )


def crossing_times(follows: CoordinateMap, curve: Curve, edges: Array) -> Array:
    """Times between the edges, ascending, at which a joint goes through a knot of a function that others follow it by.

    Where a slope jumps at the knot and the joint is slow, the two times just before and behind: between them rounding
    may take it for on either side.

    edges : (M,) times between which the curve is smooth and swings once at most, as `panel_edges` [s]
    """
    found = np.zeros(0)
    for joint, knots, kinked in follows.knotted:

        def followed(times: Array, joint: int = joint) -> tuple[Array, Array]:
            coordinates, rates = follows.with_rates(*curve(times))
            return coordinates[:, joint], rates[:, joint]

        # A joint that follows others itself is smooth between their crossings only.
        found = merged(found, _crossings(followed, merged(edges, found), knots, kinked=kinked))
    return found


def _crossings(followed: Curve, edges: Array, knots: Array, *, kinked: bool) -> Array:
    left, right, panels = resolved_series(lambda times: followed(times)[0], edges)
    series = panels[:, :, 0]
    size = float(np.abs(series).sum(axis=1).max(initial=0.0))
    reach = np.abs(series[:, 1:]).sum(axis=1)
    moving = reach > _ROUNDING * size
    near = moving[:, None] & (np.abs(series[:, :1] - knots) <= reach[:, None] + _ROUNDING * size)
    times, where = [np.zeros(0)], [np.zeros(0)]
    for panel, knot in np.argwhere(near):
        zeros = _zeros(series[panel], float(knots[knot]))
        times.append(0.5 * (left[panel] + right[panel]) + 0.5 * (right[panel] - left[panel]) * zeros)
        where.append(np.full(len(zeros), knots[knot]))
    found, at = np.clip(np.concatenate(times), edges[0], edges[-1]), np.concatenate(where)
    width = float(np.min(right - left))
    values, rates = followed(found)
    step = np.divide(values - at, rates, out=np.zeros_like(found), where=rates != 0.0)
    found = np.where(np.abs(step) <= 1e-6 * width, found - step, found)
    if kinked:
        slack = np.divide(_ROUNDING * size, np.abs(rates), out=np.zeros_like(found), where=rates != 0.0)
        slow = (slack > 32.0 * np.spacing(edges[-1])) & (slack < 1e-6 * width)
        found = np.concatenate([found[~slow], (found - slack)[slow], (found + slack)[slow]])
    return np.sort(found[(found > edges[0]) & (found < edges[-1])])


def _zeros(series: Array, value: float) -> Array:
    """Places in [-1, 1] at which a series has a value."""
    sizes = np.abs(series)
    last = np.flatnonzero(sizes > _ROUNDING * sizes.max())[-1]
    shifted = series[: last + 1].copy()
    shifted[0] -= value
    roots = chebyshev.chebroots(shifted)
    real = roots.real[np.abs(roots.imag) < _NEARLY_REAL]
    return np.clip(real[np.abs(real) < 1.0 + _NEARLY_REAL], -1.0, 1.0)


def _loop_ends(route: ShapePath) -> Array:
    return merged(route.breaks, np.arange(1.0, route.loops) * (route.duration / route.loops))
