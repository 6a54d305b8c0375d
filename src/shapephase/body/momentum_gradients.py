"""Derivatives of a body's angular momentum by its shape and rates, for all joints at once and without Pinocchio.

Links that hang on a joint move with it together: sums over them are products with a fixed matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import so3
from ..arrays import Array
from ..inertia_tensor import SIX_OF_FULL
from .joint_chain import JointChain
from .link_motions import LinkMotions, components, cross

_STOPS = (3, 6, 9)  # rows of `_link_sums` at which mass times velocity, angular momentum and inertia begin


def by_shape_and_rate(
    chain: JointChain, links: LinkMotions, shapes: Array, rates: Array, spins: Array, rows: Array
) -> tuple[Array, Array]:
    """Products of row . d(I w + J rate) by the shape, while w and the rates stay, and by the rates.

    With z a joint's axis, o a point of it that moves at v_o; p, q, h and J the sums of m x, m v, of angular momentum
    and of inertia over what hangs on it, about the centre of mass of all; in a body that turns at w. A unit of turn
    adds z x h - (z x o) x q + J y - p x (z x v_o + y x o), where y is the velocity of z; a unit of slide along s adds
    s x q + p x y, where y is that of s.

    links : of the chain at N shapes and rates
    shapes, rates : (N, n)
    spins : (N, S, 3) w, several for each shape
    rows : (N, S, r, 3)

    Returns (N, S r, n) each, by shapes and by rates
    """
    sums, at = (
        _carried(chain, _link_sums(chain, links)),
        _joint_axes(chain, links, chain.follows.with_rates(shapes, rates)[1]),
    )
    count, several, count_of_rows, _ = rows.shape
    arms = cross(at.axes, at.origins)
    by_rate = _turned(sums.inertia, at.axes) + cross(sums.moment, at.slides - arms)
    by_shape = np.empty((count, several, count_of_rows, by_rate.shape[-1]))
    for which in range(several):
        spin = spins[:, which].T[:, :, None]
        drift = sums.drift + cross(spin, sums.moment)
        momentum = sums.momentum + _turned(sums.inertia, spin)
        whole = spin + at.spins
        swung = cross(whole, at.axes)
        point = cross(at.axes, at.speeds + cross(spin, at.origins)) + cross(swung, at.origins)
        columns = cross(at.axes, momentum) + _turned(sums.inertia, swung)
        columns += cross(at.slides - arms, drift) + cross(sums.moment, cross(whole, at.slides) - point)
        np.matmul(rows[:, which], np.moveaxis(columns, 0, 1), out=by_shape[:, which])
    by_rates = rows.reshape(count, -1, 3) @ np.moveaxis(by_rate, 0, 1)
    return _by_independent(chain, by_shape.reshape(count, several * count_of_rows, -1), by_rates, shapes, rates)


def _by_independent(
    chain: JointChain, by_shape: Array, by_rate: Array, shapes: Array, rates: Array
) -> tuple[Array, Array]:
    """Derivatives by the shape and its rate from those by coordinates and rates of all joints: (N, m, k), (N, m, k)
    -> (N, m, n), (N, m, n)."""
    follows = chain.follows
    folded = follows.folded(by_shape, shapes)
    if not follows.is_linear:
        folded = folded + by_rate @ follows.slope_rates(shapes, rates)
    return folded, follows.folded(by_rate, shapes)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Over what hangs on each joint, about the centre of mass of all, the base at rest; components first.

    moment, drift : (3, N, k) of mass times place, and times velocity
    inertia : (6, N, k) xx yy zz yz xz xy
    momentum : (3, N, k) angular
    """

    moment: Array
    drift: Array
    inertia: Array
    momentum: Array


@dataclass(frozen=True, eq=False)
class _Axes:
    """Axes of the joints, in axes of the base and about the centre of mass of all; components first, (3, N, k).

    axes, slides : unit vectors, zero of a joint that does not turn, or does not slide
    origins, speeds : a point of each axis, and its velocity as part of what the joint hangs on
    spins : angular velocity of what turns with the joint
    """

    axes: Array
    slides: Array
    origins: Array
    speeds: Array
    spins: Array


def _link_sums(chain: JointChain, links: LinkMotions) -> Array:
    """Sums that each frame adds: (15, N, k + 1), in the order of mass times place, mass times velocity, angular
    momentum and inertia."""
    places, speeds, spins = (components(vectors) for vectors in (links.places, links.speeds, links.spins))
    own = components((links.turns @ chain.inertias @ so3.transpose(links.turns)).reshape(*places.shape[1:], 9))
    own = own[SIX_OF_FULL]
    moment = chain.masses * places
    squares, angular = moment * places, cross(moment, speeds) + _turned(own, spins)
    diagonal, products = own[:3] + squares.sum(axis=0) - squares, own[3:] - moment[[1, 0, 0]] * places[[2, 2, 1]]
    return np.concatenate([moment, chain.masses * speeds, angular, diagonal, products])


def _carried(chain: JointChain, each: Array) -> _Sums:
    moment, drift, momentum, inertia = np.split(each @ chain.hanging.T, _STOPS)
    return _Sums(moment=moment, drift=drift, momentum=momentum, inertia=inertia)


def _joint_axes(chain: JointChain, links: LinkMotions, rates: Array) -> _Axes:
    """rates: (N, k) of all joints."""
    turns = links.turns[:, 1:]
    axes, slides, levers = (
        components(so3.apply(turns, vectors)) for vectors in (chain.axes, chain.slides, chain.centres[1:])
    )
    spins, places, speeds = (components(vectors[:, 1:]) for vectors in (links.spins, links.places, links.speeds))
    return _Axes(axes, slides, places - levers, speeds - cross(spins, levers) - slides * rates, spins)


def _turned(tensor: Array, vector: Array) -> Array:
    """A symmetric tensor (6, ...) times a vector (3, ...)."""
    (xx, yy, zz, yz, xz, xy), (x, y, z) = tensor, vector
    return np.stack([xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z])
