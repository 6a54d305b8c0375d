"""Derivatives of a tree's angular momentum in machine code."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ._plain import plain
from .tree import LinkRows, OneLink


def momentum_gradients(
    tree: LinkRows,
    shapes: Array,
    rates: Array,
    spins: Array,
    rows: Array,
    pieces: Integers,
    powers: Array,
    slopes: Array,
    count: int,
) -> Array:
    """Sums over the shapes of row . d(I w + L_o), w staying, by coefficients of polynomials of all joints.

    Parameters
    ----------
    shapes, rates : (N, n)
    spins, rows : (N, S, 3) w, and (N, S, r, 3), axes of the base
    pieces, powers, slopes : (N,), (N, order), (N, order) which polynomials each shape is on, one of `count`, and its
        derivative, and that of its rate, by their coefficients

    Returns
    -------
    (order, count, S r, k), the followers among the k joints included
    """
    module, (several, each) = _kernel(), rows.shape[1:3]
    coordinates, speeds = tree.coordinates(shapes, rates)
    found = np.empty((powers.shape[1], count, several * each * len(tree.parents)))
    module.momentum_gradients(
        tree.parents, tree.turning, tree.leads, plain(tree.rows).ravel(), tree.mass, plain(coordinates), plain(speeds),
        plain(spins).reshape(len(rows), -1), plain(rows).reshape(len(rows), -1), several, module.LANES,
        np.array(pieces, dtype=np.int64), plain(powers), plain(slopes), found,
    )  # fmt: skip
    return found.reshape(len(found), count, several * each, -1)


def inertial_sums(tree: LinkRows, shapes: Array, rates: Array, spins: Array, rows: Array) -> Array:
    """Sums over the shapes of row . d(I w + L_o) by the parameters of each frame of the tree; arguments as above.

    Returns
    -------
    (S r, k + 1, 10) by mass, first moment and inertia xx yy zz yz xz xy, axes of the frame
    """
    module, (several, each) = _kernel(), rows.shape[1:3]
    coordinates, speeds = tree.coordinates(shapes, rates)
    found = np.empty((several * each, len(tree.rows), 10))
    module.inertial_sums(
        tree.parents, tree.turning, tree.leads, plain(tree.rows).ravel(), tree.mass, plain(coordinates), plain(speeds),
        plain(spins).reshape(len(rows), -1), plain(rows).reshape(len(rows), -1), several, module.LANES, found,
    )  # fmt: skip
    return found


def warm() -> None:
    """Call the kernels with the least that they take."""
    none, spins, rows = np.zeros((1, 0)), np.zeros((1, 1, 3)), np.zeros((1, 1, 1, 3))
    momentum_gradients(
        OneLink(), none, none, spins, rows, np.zeros(1, dtype=np.int64), np.ones((1, 1)), np.zeros((1, 1)), 1
    )
    inertial_sums(OneLink(), none, none, spins, rows)


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.gradient_kernel", __package__)
