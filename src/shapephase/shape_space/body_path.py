"""A shape path as the motion of a particular body: where it closes, and how the integrator samples it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.particles.point_masses import ParticleBody
from ..errors import OpenPathError
from ..integrator.fast.tree import tree_channels
from ..integrator.recorded.knot_path import KnotPath, Slopes
from ..integrator.sampling import Sampler, Samplers
from .curves import PiecewisePolynomial, many_pieces
from .knot_crossings import at_knots
from .shape_path import CLOSED, ShapePath

# [rad or m] the joint that moves farthest goes between times at which the slopes of a body's channels are computed.
_WAY_BETWEEN_SLOPES = 0.25
_LEAST_SLOPES = 9
_MOST_SLOPES = 8192
# Of those times, one in so many for how the slopes change, which costs more and matters less.
_SLOPES_FOR_A_CHANGE = 16
_LEAST_CHANGES = 3
# Entries xx yy zz yz xz xy of a matrix row by row.
_VOIGT = [0, 4, 8, 5, 2, 1]


def path_gap(body: Body | ParticleBody, path: ShapePath) -> Array:
    """Where the path ends, seen from where it begins, whole turns of continuous joints taken off: (n,).

    Of a ball joint by quaternions of length one, whose sign is that of the start.
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
    return path_samplers(body, path).fresh()


def path_samplers(body: Body | ParticleBody, path: ShapePath) -> Samplers:
    """The same, as many as are needed."""

    def evaluate(times: Array) -> tuple[Array, Array]:
        return body.sample(*path.at_samples(times))

    def directly(times: Array) -> Array | None:
        return channels_at(body, *path.at_samples(times))

    smoothness = replace(path.smoothness, knots=recorded_path(body, path))
    return Samplers(evaluate, **vars(smoothness), directly=directly)


def channels_along(body: Body | ParticleBody, path: ShapePath, times: Array) -> Array | None:
    """I^-1 (xx yy zz yz xz xy) and I^-1 L_o along a path, in machine code: (N,) -> (N, 9).

    None where a tensor is nearly singular or a number is not finite.
    """
    return channels_at(body, *path.at_samples(times))


def channels_at(body: Body | ParticleBody, shapes: Array, rates: Array) -> Array | None:
    """The same at shapes and rates (N, n); None for particles, too, which have no links, and for ball joints."""
    if isinstance(body, ParticleBody) or not body.chain.has_rows:
        return None
    return tree_channels(body.chain.rows, shapes, rates)


def recorded_path(body: Body | ParticleBody, path: ShapePath) -> KnotPath | None:
    """A recorded path, whose columns are in the body's order, with how the body follows it; None: it is none."""
    if not path.n_shape:
        return None
    pieces, follows = recorded_pieces(path), None if isinstance(body, ParticleBody) else body.chain.follows
    # Just at a knot where a slope jumps, rounding decides on which side a joint is.
    if pieces is None or (follows is not None and follows.has_kinks):
        return None
    corners = np.zeros(0, dtype=np.int64)
    if follows is not None and not follows.is_smooth:
        corners = np.flatnonzero(at_knots(follows, path.curve, pieces.knots))
    return KnotPath(
        knots=pieces.knots,
        coefficients=pieces.coefficients,
        slopes=partial(_slopes, body, pieces),
        follow=body.sample,
        directly=partial(channels_at, body),
        corners=corners,
    )


def recorded_pieces(path: ShapePath) -> PiecewisePolynomial | None:
    """The first loop of a path as polynomials between its breaks, where these are many; else None."""
    return many_pieces(path.curve, path.breaks[path.breaks <= path.duration / path.loops * (1.0 + 1e-12)])


def _slopes(body: Body | ParticleBody, pieces: PiecewisePolynomial) -> Slopes:
    """How a body's channels follow its joints, at times between which these move little."""
    shapes = pieces.coefficients[0]
    ends = np.concatenate([shapes, pieces(pieces.knots[-1:])[0]])
    way = np.append(0.0, np.cumsum(np.abs(np.diff(ends, axis=0)).max(axis=1, initial=0.0)))
    # What rests moves on a little nevertheless, so that times ascend.
    way += 1e-3 * (1.0 + way[-1]) * pieces.knots / pieces.knots[-1]
    count = int(np.clip(np.ceil(way[-1] / _WAY_BETWEEN_SLOPES), _LEAST_SLOPES, _MOST_SLOPES))
    times, few = (
        np.interp((np.arange(n) + 0.5) / n * way[-1], way, pieces.knots)
        for n in (count, max(count // _SLOPES_FOR_A_CHANGE, _LEAST_CHANGES))
    )
    there, rarely = pieces(times)[0], pieces(few)[0]
    inverse, matrix = np.linalg.inv(body.locked_inertia(rarely)), body.momentum_matrix(rarely)
    changes = body.angular_map_gradient(rarely)
    of_inverse = -inverse[:, None] @ changes[..., :3] @ inverse[:, None]
    entries = of_inverse.reshape(*of_inverse.shape[:2], 9)[:, :, _VOIGT] * np.sqrt([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
    return Slopes(
        times=times,
        drift=np.asarray(np.linalg.solve(body.locked_inertia(there), body.momentum_matrix(there)), dtype=np.float64),
        change_times=few,
        drift_changes=inverse[:, None] @ changes[..., 3:] + of_inverse @ matrix[:, None],
        inverse_changes=np.swapaxes(entries, 1, 2),
        inverse_norm=float(np.linalg.norm(inverse, axis=(1, 2)).max()),
    )
