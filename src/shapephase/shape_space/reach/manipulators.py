"""Arms on a free base: how a hand moves while the base turns back, and which rates leave the base still."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ... import so3
from ...arguments import check_flag, vector_argument
from ...arrays import Array, finite_array
from ...body.body import Body
from ...body.link_motions import link_motions
from ...body.loading import as_body
from ...errors import unknown_name
from ..connection import mechanical_connection

_NULL = 1e-12  # rounding of singular values, relative to the largest


def generalised_jacobian(
    body: Body | str, shape: ArrayLike, link: str, point: ArrayLike = (0.0, 0.0, 0.0), *, fixed_base: bool = False
) -> Array:
    """Velocity of a point of a link per joint rate, for a body without momentum that turns back meanwhile.

    With the base at rest it is the usual Jacobian [Jv; Jw]. The base turns at -A(r) rate, A the mechanical connection,
    about the centre of mass, which stays: [Jv + hat(p) A; Jw - A], p from the centre of mass.

    Source: Umetani and Yoshida 1989; theory.md B1.

    Parameters
    ----------
    shape : (..., n) [rad or m]
    link : by name
    point : (3,) in the link's axes [m]
    fixed_base : the Jacobian with the base at rest, of a point seen from the base

    Returns
    -------
    (..., 6, n) velocity of the point, then angular velocity of the link; base axes [m/s, rad/s per unit rate]

    Raises
    ------
    UnknownNameError, ShapeError
        If there is no such link, or arrays have other shapes.

    Examples
    --------
    >>> arm = sp.load_body("satellite")
    >>> matrix = sp.generalised_jacobian(arm, arm.shape(), arm.link_names[-1])
    >>> matrix.shape
    (6, 10)
    """
    body = as_body(body)
    check_flag(fixed_base, "fixed_base")
    connection = mechanical_connection(body, shape)
    r = finite_array(shape, "shape")
    if not isinstance(link, str) or link not in body.chain.link_frames:
        raise unknown_name(f"link of {body.name}", link, tuple(body.chain.link_frames))
    frame, pose = body.chain.link_frames[link]
    rows = r.reshape(-1, body.n_shape)
    count = body.n_shape
    motions = link_motions(body.chain, np.repeat(rows, count, axis=0), np.tile(np.eye(count), (len(rows), 1)))
    offset = pose[:3, :3] @ vector_argument(point, "point", unit="m") + pose[:3, 3] - body.chain.centres[frame]
    lever = so3.apply(motions.turns[:, frame], offset)
    place = (motions.places[:, frame] + lever).reshape(len(rows), count, 3)
    spin = motions.spins[:, frame]
    speed = motions.speeds[:, frame] + so3.cross(spin, lever)
    if fixed_base:
        # Speeds are from the centre of mass; the base's own are the other part of the difference.
        start = so3.apply(motions.turns[:, 0], -body.chain.centres[0])
        speed = speed - motions.speeds[:, 0] - so3.cross(motions.spins[:, 0], start)
    linear, angular = (np.swapaxes(one.reshape(len(rows), count, 3), 1, 2) for one in (speed, spin))
    if not fixed_base:
        turning = connection.reshape(len(rows), 3, count)
        linear, angular = linear + so3.hat(place[:, 0]) @ turning, angular - turning
    return np.concatenate([linear, angular], axis=1).reshape(*r.shape[:-1], 6, count)


def reaction_null_space(body: Body | str, shape: ArrayLike) -> Array:
    """Joint rates that do not turn the base of a body without momentum: an orthonormal basis, (n,) -> (n, k).

    Those whose angular momentum J rate vanishes: k = n - 3, or more where the joints cannot turn it about every axis.

    Raises like `Body.locked_inertia`. Source: Nenchev, Umetani and Yoshida 1992; theory.md A7.

    Examples
    --------
    >>> arm = sp.load_body("satellite")
    >>> quiet = sp.reaction_null_space(arm, np.full(10, 0.3))
    >>> quiet.shape, bool(np.abs(arm.momentum_matrix(np.full(10, 0.3)) @ quiet).max() < 1e-12)
    ((10, 7), True)
    """
    body = as_body(body)
    _, values, right = np.linalg.svd(body.momentum_matrix(shape))
    rank = int(np.sum(values > _NULL * values.max(initial=0.0)))
    return np.swapaxes(right, -1, -2)[:, rank:]


def dynamic_manipulability(
    body: Body | str,
    shape: ArrayLike,
    link: str,
    point: ArrayLike = (0.0, 0.0, 0.0),
    directions: ArrayLike | None = None,
) -> Array:
    """Singular values of the generalised Jacobian, descending: 0 at a dynamic singularity, (..., n) -> (..., k).

    There the hand cannot move in some direction, whatever the joints do, though the arm itself may; unlike singular
    shapes of an arm on the ground, they depend on masses.

    Raises like `generalised_jacobian`. Source: Papadopoulos and Dubowsky 1993.

    Parameters
    ----------
    directions : (k, 6) rows of the hand's velocity that count, such as `numpy.eye(6)[:2]` in a plane; None: all

    Examples
    --------
    >>> arm = sp.load_body("satellite")
    >>> values = sp.dynamic_manipulability(arm, arm.shape(), arm.link_names[-1])
    >>> values.shape
    (6,)
    """
    matrix = generalised_jacobian(body, shape, link, point)
    if directions is not None:
        matrix = finite_array(directions, "directions", (None, 6)) @ matrix
    return np.asarray(np.linalg.svd(matrix, compute_uv=False), dtype=np.float64)
