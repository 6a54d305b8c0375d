"""A tree of links: inertia and angular momentum at many shapes, and derivatives of the momentum."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ..arrays import Array, Mask
from ..inertia_tensor import FULL_FROM_SIX
from .kernels import gradient_kernel, tree_kernel
from .kernels.tree_kernel import LANES
from .machine_code import plain


class LinkRows(Protocol):
    """A tree of links as plain numbers: `shapephase.body.joint_chain` defines them."""

    @property
    def parents(self) -> Any:
        """(k,) unsigned."""
        ...

    @property
    def turning(self) -> Array:
        """(k,)."""
        ...

    @property
    def leads(self) -> Array:
        """(k,)."""
        ...

    @property
    def rows(self) -> Array:
        """(k + 1, 22)."""
        ...

    @property
    def mass(self) -> float:
        """[kg]."""
        ...

    def coordinates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """Coordinates and rates of all joints: (N, n), (N, n) -> (N, k), (N, k)."""
        ...


def tree_channels(tree: LinkRows, shapes: Array, rates: Array) -> Array | None:
    """I^-1 (xx yy zz yz xz xy) and I^-1 L_o of a tree of links: (N, n), (N, n) -> (N, 9).

    None where a tensor is nearly singular or a number is not finite: slower code finds what is wrong.
    """
    values, reliable = _sampled(tree, tree.rows[None], np.array([tree.mass]), shapes, rates, inverted=True)
    return values[0] if reliable[0] else None


def tree_inertia_and_momentum(tree: LinkRows, shapes: Array, rates: Array) -> tuple[Array, Array]:
    """I and L_o about the centre of mass, axes of the base: (N, n), (N, n) -> (N, 3, 3), (N, 3)."""
    (values,), _ = _sampled(tree, tree.rows[None], np.array([tree.mass]), shapes, rates, inverted=False)
    return values[:, FULL_FROM_SIX], values[:, 6:]


def trees_channels(tree: LinkRows, rows: Array, masses: Array, shapes: Array, rates: Array) -> tuple[Array, Mask]:
    """`tree_channels` of trees that differ in their masses, each as if alone, and which are reliable: (V, N, 9), (V,).

    `rows` (V, k + 1, 22) and `masses` (V,) are those of each tree, as in `LinkRows`.
    """
    return _sampled(tree, rows, masses, shapes, rates, inverted=True)


def _sampled(
    tree: LinkRows, rows: Array, masses: Array, shapes: Array, rates: Array, *, inverted: bool
) -> tuple[Array, Mask]:
    values, reliable = np.empty((len(rows), len(shapes), 9)), np.empty(len(rows), dtype=np.bool_)
    coordinates, speeds = tree.coordinates(shapes, rates)
    tree_kernel.sample_trees(
        tree.parents, tree.turning, tree.leads, plain(rows), plain(masses), plain(coordinates),
        plain(speeds), inverted, LANES, values, reliable,
    )  # fmt: skip
    return values, reliable


def momentum_gradients(tree: LinkRows, shapes: Array, rates: Array, spins: Array, rows: Array) -> tuple[Array, Array]:
    """Products row . d(I w + L_o), w fixed, by the coordinates of all joints, followers included, and by their rates.

    (N, S r, k) each, from shapes and rates (N, n), spins w (N, S, 3) and rows (N, S, r, 3), axes of the base.
    """
    coordinates, speeds = tree.coordinates(shapes, rates)
    by_shape, by_rate = np.empty((2, *rows.shape[:3], len(tree.parents)))
    gradient_kernel.momentum_gradients(
        tree.parents, tree.turning, tree.leads, plain(tree.rows), tree.mass, plain(coordinates), plain(speeds),
        plain(spins), plain(rows), LANES, by_shape, by_rate,
    )  # fmt: skip
    products = rows.shape[1] * rows.shape[2]
    return by_shape.reshape(len(rows), products, -1), by_rate.reshape(len(rows), products, -1)


def inertial_sums(tree: LinkRows, shapes: Array, rates: Array, spins: Array, rows: Array) -> Array:
    """Sums over the shapes of row . d(I w + L_o) by the parameters of each frame of the tree; arguments as above.

    (S r, k + 1, 10), by mass, first moment and inertia xx yy zz yz xz xy, axes of the frame.
    """
    coordinates, speeds = tree.coordinates(shapes, rates)
    spins = np.repeat(spins, rows.shape[2], axis=1)
    sums = np.empty((spins.shape[1], len(tree.rows), 10))
    gradient_kernel.inertial_sums(
        tree.parents, tree.turning, tree.leads, plain(tree.rows), tree.mass, plain(coordinates), plain(speeds),
        plain(spins), plain(rows).reshape(spins.shape), LANES, sums,
    )  # fmt: skip
    return sums
