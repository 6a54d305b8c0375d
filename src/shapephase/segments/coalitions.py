"""Shapley values and interactions of a function of subsets, whose k members are the bits of a number."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array, Integers, finite_array
from ..errors import ShapeError


def shapley_weights(count: int) -> Array:
    """Weights of all subsets in each member's share: -> (k, 2^k); values @ weights.T are the shares."""
    masks = np.arange(1 << count)
    sizes = _sizes(masks)
    weights = np.empty((count, len(masks)))
    for member in range(count):
        inside = (masks >> member & 1).astype(bool)
        others = sizes - inside
        each = np.array([1.0 / (count * comb(count - 1, int(size))) for size in others])
        weights[member] = np.where(inside, each, -each)
    return weights


def shapley_values(values: ArrayLike) -> Array:
    """Return the Shapley values of a function of subsets, which add up to f(all) - f(none).

    The share of a member is the change of the function when it joins, averaged over all orders in which members join.

    Source: Shapley 1953, A value for n-person games.

    Parameters
    ----------
    values : (..., 2^k) of all subsets; member i is in subset m where bit i of m is set

    Returns
    -------
    (..., k)

    Raises
    ------
    ShapeError
        If the number of values is not a power of two.

    Examples
    --------
    >>> sp.segments.shapley_values([0.0, 1.0, 0.0, 3.0]).tolist()  # alone the first does 1, both together 3
    [2.0, 1.0]
    """
    function, count = _function(values)
    return function @ shapley_weights(count).T


def shapley_interactions(values: ArrayLike) -> Array:
    """Return Shapley-Taylor interactions of order two: what each member does alone, and each pair beyond that.

    Source: Dhamdhere, Agarwal and Sundararajan 2020, The Shapley Taylor interaction index.

    Parameters
    ----------
    values : (..., 2^k), as for `shapley_values`

    Returns
    -------
    (..., k, k) symmetric; the diagonal and the entries above it add up to f(all) - f(none)

    Raises
    ------
    ShapeError
        If the number of values is not a power of two.

    Examples
    --------
    >>> sp.segments.shapley_interactions([0.0, 1.0, 0.0, 3.0]).tolist()
    [[1.0, 2.0], [2.0, 0.0]]
    """
    function, count = _function(values)
    masks = np.arange(1 << count)
    sizes = _sizes(masks)
    pairs = np.zeros((*function.shape[:-1], count, count))
    for i in range(count):
        pairs[..., i, i] = function[..., 1 << i] - function[..., 0]
        for j in range(i):
            outside = masks[(masks >> i & 1 | masks >> j & 1) == 0]
            weights = np.array([2.0 / (count * comb(count - 1, int(size))) for size in sizes[outside]])
            both, first, second = outside | 1 << i | 1 << j, outside | 1 << i, outside | 1 << j
            change = function[..., both] - function[..., first] - function[..., second] + function[..., outside]
            pairs[..., i, j] = pairs[..., j, i] = change @ weights
    return pairs


def sampled_orders(count: int, orders: int, seed: int) -> tuple[Integers, Integers]:
    """Random orders of the members, and the subsets of those before each in them: (P, k), (P, k + 1)."""
    rng = np.random.default_rng(seed)
    order = np.array([rng.permutation(count) for _ in range(orders)])
    return order, np.concatenate([np.zeros((orders, 1), dtype=np.int64), np.cumsum(1 << order, axis=1)], axis=1)


def weights_of_orders(order: Integers, before: Integers, subsets: list[int]) -> Array:
    """Weights of ascending subsets in each member's share by `sampled_orders`: (k, q)."""
    weights = np.zeros((order.shape[1], len(subsets)))
    places = np.searchsorted(subsets, before)
    np.add.at(weights, (order, places[:, 1:]), 1.0 / len(order))
    np.add.at(weights, (order, places[:, :-1]), -1.0 / len(order))
    return weights


def _sizes(masks: Integers) -> Integers:
    return np.array([int(mask).bit_count() for mask in masks])


def _function(values: ArrayLike) -> tuple[Array, int]:
    function = finite_array(values, "values", (None,))
    count = function.shape[-1].bit_length() - 1
    if function.shape[-1] != 1 << count:
        raise ShapeError(f"values: one for each of 2^k subsets is needed, got {function.shape[-1]}")
    return function, count
