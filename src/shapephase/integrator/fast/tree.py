"""A tree of links in machine code: shapes and rates in, inertia and momentum out."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any, Protocol

import numpy as np

from ...arrays import Array
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
    values, reliable = _sampled(tree, shapes, rates, inverted=True)
    return values if reliable else None


def tree_inertia_and_momentum(tree: LinkRows, shapes: Array, rates: Array) -> tuple[Array, Array]:
    """I and L_o about the centre of mass, axes of the base: (N, n), (N, n) -> (N, 3, 3), (N, 3)."""
    values, _ = _sampled(tree, shapes, rates, inverted=False)
    return values[:, [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(-1, 3, 3), values[:, 6:]


def warm() -> None:
    """Call the kernel with the least that it takes."""
    _sampled(_OneLink(), np.zeros((1, 0)), np.zeros((1, 0)), inverted=True)


def _sampled(tree: LinkRows, shapes: Array, rates: Array, *, inverted: bool) -> tuple[Array, bool]:
    module = _kernel()
    values = np.empty((len(shapes), 9))
    coordinates, speeds = tree.coordinates(shapes, rates)
    reliable = module.sample_tree(
        tree.parents, tree.turning, tree.leads, tree.rows.reshape(-1), tree.mass, plain(coordinates), plain(speeds),
        inverted, module.LANES, values,
    )  # fmt: skip
    return values, bool(reliable)


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module("._tree_kernel", __package__)


class _OneLink:
    """A body without joints."""

    parents = np.zeros(0, dtype=np.uint32)
    turning = leads = np.zeros(0)
    rows = np.ones((1, 22))
    mass = 1.0

    def coordinates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        return shapes, rates
