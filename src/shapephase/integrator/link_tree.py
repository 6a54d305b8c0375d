"""A tree of links: inertia and angular momentum at many shapes."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from ..arrays import Array
from ..inertia_tensor import FULL_FROM_SIX
from .kernels.tree_kernel import LANES, sample_tree
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
    values, is_reliable = _sampled(tree, shapes, rates, inverted=True)
    return values if is_reliable else None


def tree_inertia_and_momentum(tree: LinkRows, shapes: Array, rates: Array) -> tuple[Array, Array]:
    """I and L_o about the centre of mass, axes of the base: (N, n), (N, n) -> (N, 3, 3), (N, 3)."""
    values, _ = _sampled(tree, shapes, rates, inverted=False)
    return values[:, FULL_FROM_SIX], values[:, 6:]


def _sampled(tree: LinkRows, shapes: Array, rates: Array, *, inverted: bool) -> tuple[Array, bool]:
    values, (coordinates, speeds) = np.empty((len(shapes), 9)), tree.coordinates(shapes, rates)
    is_reliable = sample_tree(
        tree.parents, tree.turning, tree.leads, plain(tree.rows), tree.mass, plain(coordinates), plain(speeds),
        inverted, LANES, values,
    )  # fmt: skip
    return values, is_reliable
