"""A shape path as the motion of a particular body: where it closes, and how the integrator samples it."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..errors import OpenPathError
from ..integrator.fast.tree import tree_channels
from ..integrator.sampling import Sampler, Samplers
from .shape_path import CLOSED, ShapePath


def path_gap(body: Body, path: ShapePath) -> Array:
    """Where the path ends, seen from where it begins, whole turns of continuous joints taken off: (n,)."""
    gap = path.gap
    return np.where(body.continuous, so3.wrap(gap), gap)


def check_closed(body: Body, path: ShapePath) -> None:
    """Raise `OpenPathError` where the path is no loop; continuous joints may end whole turns from their start."""
    gap = path_gap(body, path)
    worst = int(np.argmax(np.abs(gap))) if len(gap) else 0
    if len(gap) and abs(gap[worst]) > CLOSED:
        raise OpenPathError(
            f"the holonomy of an open path is undefined: joint {body.joint_names[worst]} ends {gap[worst]:.6g} from "
            "its start; close the path, or take the end of its horizontal_lift"
        )


def path_sampler(body: Body, path: ShapePath) -> Sampler:
    """A sampler of the body along a path whose columns are in the body's order."""
    return path_samplers(body, path).fresh()


def path_samplers(body: Body, path: ShapePath) -> Samplers:
    """The same, as many as are needed."""

    def evaluate(times: Array) -> tuple[Array, Array]:
        return body.sample(*path.curve(times))

    def directly(times: Array) -> Array | None:
        return channels_along(body, path, times)

    return Samplers(evaluate, **vars(path.smoothness), directly=directly)


def channels_along(body: Body, path: ShapePath, times: Array) -> Array | None:
    """I^-1 (xx yy zz yz xz xy) and I^-1 L_o along a path, in machine code: (N,) -> (N, 9).

    None where a tensor is nearly singular or a number is not finite.
    """
    return tree_channels(body.chain.rows, *path.curve(times))
