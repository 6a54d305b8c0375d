"""The mechanical connection: how a motion of the joints alone turns a free body."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from . import so3
from .arrays import Array
from .body import Body
from .errors import OpenPathError
from .inertia_tensor import inverse_inertia
from .sampling import Sampler, sampler
from .shape_path import ShapePath
from .stepping import stepped_rotation, tolerance_argument

_CLOSED = 1e-9


def mechanical_connection(body: Body, shape: ArrayLike) -> Array:
    """Rotation rate of the base that cancels the angular momentum of a joint motion.

    A(r) = I(r)^-1 J(r): with zero momentum the base turns at omega = -A(r) rate [rad/s, base axes].

    Parameters
    ----------
    shape : (..., n) joint coordinates [rad or m]

    Returns
    -------
    (..., 3, n) connection, base axes [rad per unit of joint]

    Raises
    ------
    ShapeError
        If the last axis is not the body's n joints, or an entry is not finite.

    Source: Cabrera 2006, sections 2.1 and 2.3.1 (a); theory.md B1.
    """
    return inverse_inertia(body.locked_inertia(shape)) @ body.momentum_matrix(shape)


def curvature(body: Body, shape: ArrayLike) -> Array:
    """Curvature of the mechanical connection, F_ij = d_i A_j - d_j A_i - A_i x A_j.

    A small square of side e in the joints i, j, gone round from i to j, turns the body by exp(-e^2 F_ij).

    Parameters
    ----------
    shape : (..., n) joint coordinates [rad or m]

    Returns
    -------
    (..., n, n, 3) antisymmetric in i, j; base axes [rad per product of the two joints' units]

    Raises as `mechanical_connection`. Source: theory.md B6; numerics.md section 4.
    """
    inverse = inverse_inertia(body.locked_inertia(shape))[..., None, :, :]
    connection = mechanical_connection(body, shape)
    # dA_i = I^-1 (dJ_i - dI_i A), indices (i, axis, j)
    gradient = inverse @ (
        body.momentum_matrix_gradient(shape) - body.inertia_gradient(shape) @ connection[..., None, :, :]
    )
    slopes = np.swapaxes(gradient, -1, -2)
    columns = np.swapaxes(connection, -1, -2)
    bracket = np.cross(columns[..., :, None, :], columns[..., None, :, :])
    return slopes - np.swapaxes(slopes, -2, -3) - bracket


def holonomy(body: Body, path: ShapePath, tolerance: float = 1e-9) -> Array:
    """The rotation of a body with zero angular momentum whose joints go once round a loop.

    Parameters
    ----------
    path : a closed path; a continuous joint may end whole turns from its start
    tolerance : of the rotation, between 1e-13 and 1e-4 [rad]

    Returns
    -------
    (3, 3) attitude at the end for the identity at the start

    Raises
    ------
    OpenPathError
        If the path does not close: then the rotation depends on where the base frame is fixed.

    Source: Cabrera 2006, section 3.1.1 (R_G); theory.md B7.
    """
    goal = tolerance_argument(tolerance)
    route = path.matched(body.joint_names, body.name)
    gap = path_gap(body, route)
    worst = int(np.argmax(np.abs(gap))) if len(gap) else 0
    if len(gap) and abs(gap[worst]) > _CLOSED:
        raise OpenPathError(
            f"the holonomy of an open path is undefined: joint {body.joint_names[worst]} ends {gap[worst]:.6g} from "
            "its start; close the path, or split a reconstructed motion with zero momentum for the lift of an open one"
        )
    lift = stepped_rotation(path_sampler(body, route), np.zeros((1, 3)), goal)
    return lift.end[0]


def path_gap(body: Body, path: ShapePath) -> Array:
    """Where the path ends, seen from where it begins, whole turns of continuous joints taken off: (n,)."""
    gap = path.gap
    return np.where(body.continuous, so3.wrap(gap), gap)


def path_sampler(body: Body, path: ShapePath) -> Sampler:
    """A sampler of the body along a path whose columns are in the body's order."""

    def evaluate(times: Array) -> tuple[Array, Array]:
        return body.sample(*path.curve(times))

    def probe(times: Array) -> Array:
        return np.concatenate(path.curve(times), axis=1)

    return sampler(
        evaluate,
        path.breaks,
        oscillations=path.oscillations,
        loops=path.loops,
        smooth_loop=path.smooth_loop,
        probe=probe,
    )
