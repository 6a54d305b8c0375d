"""A shape path as the motion of a particular body: its columns in order, where it closes, how it is sampled."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arguments import check_object
from ..arrays import Array, Integers, Mask
from ..body.body import Body
from ..body.family import BodyFamily
from ..body.particles.point_masses import ParticleBody
from ..errors import OpenPathError
from ..integrator import machine_code
from ..integrator.families import many_inverted
from ..integrator.link_tree import tree_channels, trees_channels
from ..integrator.sampling import Sampler
from .knot_crossings import with_crossings
from .shape_path import CLOSED, ShapePath
from .unit_doubts import warn_of_degrees


def in_joint_order(body: Body | ParticleBody, path: ShapePath) -> ShapePath:
    """Return the path with its columns in the order of the body's joints. Raises as `ShapePath.matched`."""
    check_object(body, "Body", "body", or_kind="ParticleBody")
    check_object(path, "ShapePath", "path")
    return path.matched(body.joint_names, body.name)


def route_along(body: Body | ParticleBody, path: ShapePath) -> ShapePath:
    """Return the path in the order of the body's joints, with breaks where the body's motion is less smooth.

    Raises as `in_joint_order` and `with_crossings`.
    """
    return with_crossings(body, in_joint_order(body, path))


def users_route_along(body: Body | ParticleBody, path: ShapePath) -> ShapePath:
    """Return the same of a path that a user gave. Warns as `warn_of_degrees`."""
    route = route_along(body, path)
    warn_of_degrees(body, route)
    return route


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
        return body.sample(*path.at_samples(times))

    def directly(times: Array) -> Array | None:
        return channels_at(body, *path.at_samples(times))

    return Sampler(evaluate, path.smoothness, directly)


def channels_along(body: Body | ParticleBody, path: ShapePath, times: Array) -> Array | None:
    """I^-1 (xx yy zz yz xz xy) and I^-1 L_o along a path, in machine code: (N,) -> (N, 9).

    None where a tensor is nearly singular or a number is not finite.
    """
    return channels_at(body, *path.at_samples(times))


def channels_at(body: Body | ParticleBody, shapes: Array, rates: Array) -> Array | None:
    """Channels at shapes and rates (N, n); None without machine code, links or rows, and for ball joints."""
    if isinstance(body, ParticleBody) or not body.chain.has_rows or not machine_code.is_used():
        return None
    return tree_channels(body.chain.rows, shapes, rates)


class FamilyVariants:
    """The bodies of a family along one path with columns in their order, planned by the one they were made from."""

    def __init__(self, family: BodyFamily, path: ShapePath) -> None:
        self._family, self._path = family, path
        self.model = path_sampler(family.body, path)

    def __len__(self) -> int:
        """Number of bodies."""
        return len(self._family)

    def channels(self, rows: Integers, times: Array) -> tuple[Array, Mask]:
        """I^-1 and I^-1 L_o of some at times, and which can be relied on: (V,), (S,) -> (V, S, 9), (V,)."""
        shapes, rates = self._path.at_samples(times)
        if machine_code.is_used() and self._family.body.chain.has_rows:
            masses = self._family.mass[rows]
            return trees_channels(self._family.body.chain.rows, self._family.rows[rows], masses, shapes, rates)
        return many_inverted(*self._family.some(rows).sample(shapes, rates), times)

    def alone(self, row: int) -> Sampler:
        """Sampler of one of them."""
        return path_sampler(self._family[row], self._path)
