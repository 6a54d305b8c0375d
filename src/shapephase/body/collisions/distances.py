"""Signed distances between the links of a body, with their nearest points and derivatives by the joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ...arguments import check_object
from ...arrays import Array, finite_array
from ...display import frozen
from ...errors import ShapeError
from ..body import Body
from ..loading import as_body
from .geometry import CollisionGeometry, Separations, collision_geometry


@frozen
class LinkDistances:
    """Signed distances of P pairs of links at shapes (..., n). Made by `link_distances`.

    Attributes
    ----------
    pairs : names of the links of each pair
    distance : (..., P) negative where solids overlap: the depth [m]
    points : (..., P, 2, 3) nearest points on both links, base axes from the base origin [m]
    slopes : (..., P, n) derivatives of the distance by the shape [m per unit of joint]
    """

    pairs: tuple[tuple[str, str], ...]
    distance: Array
    points: Array
    slopes: Array


def link_distances(body: Body | str, shape: ArrayLike, *, geometry: CollisionGeometry | None = None) -> LinkDistances:
    """Return the signed distances between the links of a body.

    The nearest two solids of two links count, and meshes as their convex hulls.

    Source: Gilbert, Johnson and Keerthi 1988; van den Bergen 2001 for the depth, both as coal has them.

    Parameters
    ----------
    shape : (..., n) [rad or m]
    geometry : solids and pairs; None: `collision_geometry(body)`

    Raises
    ------
    ShapeError
        If the last axis is not the body's n joints, or an entry is not finite.
    NoCollisionGeometryError
        If the body has no shapes.

    Examples
    --------
    >>> body = sp.load_body("astronaut")
    >>> distances = sp.body.link_distances(body, body.shape())
    >>> distances.distance.shape, bool(distances.distance.min() > 0.0)
    ((95,), True)
    """
    body = as_body(body)
    known = collision_geometry(body) if geometry is None else geometry
    check_object(known, "CollisionGeometry", "geometry", call="collision_geometry(body)")
    shapes = finite_array(shape, "shape")
    if shapes.ndim == 0 or shapes.shape[-1] != body.n_shape:
        raise ShapeError(
            f"shape: expected (..., {body.n_shape}), one entry per joint of {body.name}, got shape {shapes.shape}"
        )
    postures = known.postures(shapes.reshape(-1, body.n_shape))
    batch, (pairs, owners) = shapes.shape[:-1], known.members
    count = len(postures.shapes)
    rows, members = np.repeat(np.arange(count), len(pairs)), np.tile(np.arange(len(pairs)), count)
    whole = known.separations(postures, rows, members)
    distances = whole.distances.reshape(count, len(pairs))
    nearest = np.empty((count, len(known.pairs)), dtype=np.int64)
    for number in range(len(known.pairs)):
        own = np.flatnonzero(owners == number)
        nearest[:, number] = own[np.argmin(distances[:, own], axis=1)]
    chosen = (nearest + len(pairs) * np.arange(count)[:, None]).ravel()
    least = Separations(whole.distances[chosen], whole.points[chosen], whole.normals[chosen])
    slopes = known.slopes(postures, rows[chosen], members[chosen], least)
    size = (*batch, len(known.pairs))
    return LinkDistances(
        known.pairs,
        least.distances.reshape(size),
        least.points.reshape(*size, 2, 3),
        slopes.reshape(*size, body.n_shape),
    )
