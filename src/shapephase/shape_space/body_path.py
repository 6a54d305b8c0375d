"""A shape path as the motion of a particular body: columns in order, closure, samples, doubts about degrees."""

from __future__ import annotations

import warnings
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_object
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.loading import as_body_or_particles
from ..body.particles.point_masses import ParticleBody
from ..errors import OpenPathError, ShapeError, TrajectoryWarning
from ..integrator import machine_code
from ..integrator.link_tree import tree_channels
from ..integrator.sampling import Sampler
from ..offers import offered
from .curves import Fourier, PiecewisePolynomial
from .knot_crossings import with_crossings
from .path_series import evenly_divided, panel_edges
from .shape_path import CLOSED, ShapePath

_FAR_BEYOND = 0.2  # of the width of a joint's limits: noise leaves them by less
_HALF_TURN = np.pi  # [rad] beyond its limits a joint may go by less, to try forbidden postures
_LOOKS = 65  # times of the first loop of a function, at multiples of the golden ratio: no swing repeats them
_LOOKS_OF_A_SWING = 8  # times: a sine is then within 8 % of its largest value


def as_path(value: ShapePath | str, body: Body | ParticleBody | None = None, name: str = "path") -> ShapePath:
    """Return a path that a user gave, itself or by a name that `examples.named_motion` takes.

    Raises like it, and WrongObjectError.
    """
    if isinstance(value, str):
        return offered("named_motion")(value, body)
    check_object(value, "ShapePath", name)
    return value


def in_joint_order(body: Body | ParticleBody, path: ShapePath | str) -> ShapePath:
    """Return the path with its columns in the body's order of joints. Raises like `as_path`, `ShapePath.matched`."""
    body = as_body_or_particles(body)
    return as_path(path, body).matched(body.joint_names, body.name)


def route_along(body: Body | ParticleBody, path: ShapePath | str) -> ShapePath:
    """Return the path in the order of the body's joints, with breaks where the body's motion is less smooth.

    Raises like `in_joint_order` and `with_crossings`.
    """
    return with_crossings(body, in_joint_order(body, path))


def users_route_along(body: Body | ParticleBody, path: ShapePath | str) -> ShapePath:
    """Return `route_along` of a path that a user gave. Warns as `warn_of_degrees`."""
    route = route_along(body, path)
    warn_of_degrees(body, route)
    return route


def one_shape(body: Body | ParticleBody, value: ArrayLike, name: str) -> Array:
    """Return a shape of the body (n,), checked. Raises ShapeError."""
    shape = finite_array(value, name)
    if shape.shape != (body.n_shape,):
        raise ShapeError(
            f"{name}: expected ({body.n_shape},), one entry per joint of {body.name} ({', '.join(body.joint_names)}), "
            f"got shape {shape.shape}"
        )
    return shape


def path_gap(body: Body | ParticleBody, path: ShapePath) -> Array:
    """End of the path minus its start, whole turns of continuous joints taken off: (n,).

    Ball joints count by quaternions of length one, with the sign of the start.
    """
    gap = path.gap
    if not isinstance(body, ParticleBody) and body.chain.follows.balls:
        ends, _ = path.curve(np.array([0.0, path.duration]))
        for ball in body.chain.follows.balls:
            start, end = ball.quaternions(ends)
            # Either sign is the same turn.
            gap[ball.columns] = end * (1.0 if start @ end >= 0.0 else -1.0) - start
    return np.where(body.continuous, so3.wrap(gap), gap)


def check_closed(body: Body | ParticleBody, path: ShapePath) -> None:
    """Raise `OpenPathError` where the path is no loop; continuous joints may end whole turns from their start."""
    gap = path_gap(body, path)
    worst = int(np.argmax(np.abs(gap))) if len(gap) else 0
    if len(gap) and abs(gap[worst]) > CLOSED:
        off = f"{gap[worst]:.6g} {body.joint_units[worst]}".removesuffix(" 1")
        raise OpenPathError(
            f"the holonomy of an open path is undefined: joint {body.joint_names[worst]} ends {off} "
            f"from its start; close the path, or take the end of its horizontal_lift"
        )


def path_sampler(body: Body | ParticleBody, path: ShapePath) -> Sampler:
    """A sampler of the body along a path whose columns are in the body's order."""

    def evaluate(times: Array) -> tuple[Array, Array]:
        return body.sample(*path.curve(times))

    return Sampler(evaluate, path.smoothness, partial(channels_along, body, path))


def channels_along(body: Body | ParticleBody, path: ShapePath, times: Array) -> Array | None:
    """`channels_at` along a path: (N,) -> (N, 9)."""
    return channels_at(body, *path.curve(times))


def channels_at(body: Body | ParticleBody, shapes: Array, rates: Array) -> Array | None:
    """I^-1 (xx yy zz yz xz xy) and I^-1 L_o at shapes and rates, in machine code: (N, n), (N, n) -> (N, 9).

    None where a tensor is nearly singular or a number is not finite; without machine code or rows; for ball joints.
    """
    if isinstance(body, ParticleBody) or not body.chain.has_rows or not machine_code.is_used():
        return None
    return tree_channels(body.chain.rows, shapes, rates)


def looks_like(values: Array, factor: float, lower: float, upper: float) -> bool:
    """True if values are far beyond limits, and within them in a unit of this size, in SI units: (N,) [rad or m]."""
    room = _FAR_BEYOND * (upper - lower)
    lowest, highest = float(values.min()), float(values.max())
    far = lowest < lower - room or highest > upper + room
    return far and factor * lowest >= lower - room and factor * highest <= upper + room


def warn_of_degrees(body: Body | ParticleBody, path: ShapePath) -> None:
    """Warn where the angles of a path, its columns in the order of the body's joints, resemble degrees.

    Warns if a joint goes more than half a turn beyond its limits, and in degrees all would stay within theirs. The
    unit of a recording is checked when it is read.
    """
    if path.record is not None or _farthest(path) <= _HALF_TURN:
        return
    times = _looked_at(path)
    shapes, _ = path.curve(times)
    limited = np.isfinite(body.joint_limits).all(axis=1) & (np.array(body.joint_units) == "rad")
    beyond = np.maximum(body.joint_limits[:, 0] - shapes, shapes - body.joint_limits[:, 1])
    far = [k for k in np.flatnonzero(limited) if beyond[:, k].max() > _HALF_TURN]
    if not far or not all(looks_like(shapes[:, k], np.radians(1.0), *body.joint_limits[k]) for k in far):
        return
    worst = max(far, key=lambda k: float(beyond[:, k].max()))
    row = int(np.argmax(beyond[:, worst]))
    lower, upper = body.joint_limits[worst]
    warnings.warn(
        f"joint {body.joint_names[worst]} of {body.name} is at {shapes[row, worst]:.6g} rad at {times[row]:.6g} s, far "
        f"beyond its limits {lower:.4g} to {upper:.4g} rad, and within them in degrees: are the angles of this path in "
        "degrees? A ShapePath is in radians: np.radians(angles) makes them. If radians are meant, nothing is wrong",
        TrajectoryWarning,
        stacklevel=4,
    )


def _farthest(path: ShapePath) -> float:
    """A bound of the joint coordinates, without looking at a spline or a series in time [rad or m]."""
    if isinstance(path.curve, Fourier):
        curve = path.curve
        sizes = np.abs(curve.mean) + np.abs(curve.cosines).sum(axis=1) + np.abs(curve.sines).sum(axis=1)
    elif isinstance(path.curve, PiecewisePolynomial):
        sizes = np.abs(path.curve.coefficients[0])
    else:
        sizes = np.abs(path.curve(_looked_at(path))[0])
    return float(sizes.max(initial=0.0))


def _looked_at(path: ShapePath) -> Array:
    if isinstance(path.curve, PiecewisePolynomial):
        return path.breaks
    if path.swings.most is not None:
        return evenly_divided(panel_edges(path), _LOOKS_OF_A_SWING)
    return path.duration / path.loops * np.mod(0.6180339887498949 * np.arange(_LOOKS), 1.0)
