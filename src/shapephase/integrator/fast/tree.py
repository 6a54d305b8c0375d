"""A tree of links in machine code: shapes and rates in, inertia and momentum out."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from ...arrays import Array, Mask
from ._plain import plain


class LinkRows(Protocol):
    """A tree of links as plain numbers: `shapephase.body.link_rows` says what they are."""

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
        """Of all joints: (N, n), (N, n) -> (N, k), (N, k)."""
        ...


def tree_channels(tree: LinkRows, shapes: Array, rates: Array) -> Array | None:
    """I^-1 (xx yy zz yz xz xy) and I^-1 L_o of a tree of links: (N, n), (N, n) -> (N, 9).

    None where a tensor is nearly singular or a number is not finite: slower code says what is wrong.
    """
    values, reliable = _sampled(tree, tree.rows[None], np.array([tree.mass]), shapes, rates, inverted=True)
    return values[0] if reliable[0] else None


def tree_inertia_and_momentum(tree: LinkRows, shapes: Array, rates: Array) -> tuple[Array, Array]:
    """I and L_o about the centre of mass, axes of the base: (N, n), (N, n) -> (N, 3, 3), (N, 3)."""
    (values,), _ = _sampled(tree, tree.rows[None], np.array([tree.mass]), shapes, rates, inverted=False)
    return values[:, [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(-1, 3, 3), values[:, 6:]


def warm() -> None:
    """Call the kernel with the least that it takes."""
    tree_channels(OneLink(), np.zeros((1, 0)), np.zeros((1, 0)))


def trees_channels(tree: LinkRows, rows: Array, masses: Array, shapes: Array, rates: Array) -> tuple[Array, Mask]:
    """As `tree_channels` of trees that differ from one in their masses, each as if alone, and which can be relied on.

    Parameters
    ----------
    rows, masses : (V, k + 1, 22), (V,) as `LinkRows` has them

    Returns
    -------
    (V, N, 9), (V,)
    """
    return _sampled(tree, rows, masses, shapes, rates, inverted=True)


def _sampled(
    tree: LinkRows, rows: Array, masses: Array, shapes: Array, rates: Array, *, inverted: bool
) -> tuple[Array, Mask]:
    module = _kernel()
    values, reliable = np.empty((len(rows), len(shapes), 9)), np.empty(len(rows), dtype=np.bool_)
    coordinates, speeds = tree.coordinates(shapes, rates)
    module.sample_trees(
        tree.parents, tree.turning, tree.leads, plain(rows).reshape(len(rows), -1), plain(masses), plain(coordinates),
        plain(speeds), inverted, module.LANES, values, reliable,
    )  # fmt: skip
    return values, reliable


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.tree_kernel", __package__)


class OneLink:
    """A body without joints, the least that kernels take."""

    parents = np.zeros(0, dtype=np.uint32)
    turning = leads = np.zeros(0)
    rows = np.ones((1, 22))
    mass = 1.0

    def coordinates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """As `LinkRows`."""
        return shapes, rates
