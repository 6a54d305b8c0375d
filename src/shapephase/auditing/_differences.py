"""Rates that the samples of a trajectory themselves have, by differences of neighbours on both sides."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array

REACH = 4
"""Neighbours on each side, which the samples at both ends do not have."""


def difference_weights(times: Array, reach: int = REACH) -> Array:
    """(N - 2 reach, 2 reach + 1): what neighbours are multiplied by for the derivative in their middle [1/s]."""
    count = 2 * reach + 1
    windows = np.lib.stride_tricks.sliding_window_view(times, count)
    since = windows - windows[:, reach, None]
    usual = np.abs(since).max(axis=1, keepdims=True)
    powers = (since / usual)[:, None, :] ** np.arange(count)[:, None]
    slope = np.zeros((len(windows), count, 1))
    slope[:, 1] = 1.0
    return np.linalg.solve(powers, slope)[:, :, 0] / usual


def fewer_neighbours(times: Array) -> Array:
    """Weights without the outermost neighbours, which get zeros: the difference shows the truncation error."""
    return np.pad(difference_weights(times[1:-1], REACH - 1), ((0, 0), (1, 1)))


def differentiated(values: Array, weights: Array) -> Array:
    """(N, k) -> (N - 2 REACH, k)."""
    windows = np.lib.stride_tricks.sliding_window_view(values, weights.shape[1], axis=0)
    return np.einsum("nw,nkw->nk", weights, windows)


def turn_rates(attitudes: Array, weights: Array) -> Array:
    """Angular velocity, base axes: (N, 3, 3) -> (N - 2 REACH, 3), by the turns from the middle to its neighbours."""
    count = len(weights)
    middle = so3.transpose(attitudes[REACH : REACH + count])
    found = np.zeros((count, 3))
    for k in range(weights.shape[1]):
        if k != REACH:
            found += weights[:, k, None] * so3.log(middle @ attitudes[k : k + count])
    return found
