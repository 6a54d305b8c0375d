"""How the series of a body falls on panels within one interval of a recorded path, where that is one polynomial."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...arrays import Array
from .knot_path import KnotPath, blocks

# Of the largest coefficient: smaller ones are rounding.
_NEGLIGIBLE = 1e-16


def falling_terms(path: KnotPath, left: Array, right: Array, magnitude: float, count: int) -> Array:
    """Sizes of the Chebyshev coefficients of a body's channels, as rates of turning: (P, count) [rad/s].

    I^-1 L_o is A(r) times the rate. With A as at the panel's start that ends with the path's own degree. What A changes
    by, to first order in the shapes, is a product of two polynomials that are both known: the next terms of the series
    are computed from the derivatives of A, directions and all. Higher orders are taken for powers of how far the
    shapes go, by as much as the channels change with them.
    """
    found = np.empty((len(left), count))
    joints = len(path.weights)
    for rows in blocks(np.arange(len(left)), np.full(len(left), 12 * joints)):
        found[rows] = _falling_terms(path, left[rows], right[rows], magnitude, count)
    return found


def _falling_terms(path: KnotPath, left: Array, right: Array, magnitude: float, count: int) -> Array:
    shapes, rates = path.local_series(left, right)
    bends = 0.5 * np.abs(shapes[:, 1:]) @ path.weights
    total, first = np.zeros((2, len(left), max(count, shapes.shape[1] + rates.shape[1])))
    total[:, : rates.shape[1]] = np.abs(rates) @ path.rate_weights
    total[:, 0] += magnitude * path.slopes.inverse_norm
    power = _raised(total, bends)
    row = path.slopes.nearest_change(0.5 * (left + right))
    order = np.argsort(row, kind="stable")
    for start, stop in pairwise(np.concatenate([[0], 1 + np.flatnonzero(np.diff(row[order])), [len(row)]])):
        some = order[start:stop]
        changes = _first_order(path, int(row[some[0]]), shapes[some], rates[some], magnitude)
        first[some, : changes.shape[1]] = changes
    total += first
    # By symmetry the first order may be nothing.
    power = np.maximum(first, power)
    for _ in range(count):
        power = _raised(power, bends)
        total += power
        if power.max(initial=0.0) < _NEGLIGIBLE * total.max(initial=0.0):
            break
    return total[:, :count]


def _first_order(path: KnotPath, row: int, shapes: Array, rates: Array, magnitude: float) -> Array:
    """Of panels near one time at which derivatives are known: (P, terms)."""
    joints, slopes = shapes.shape[2], path.slopes
    moved = shapes[:, 1:]
    changes = (moved @ slopes.drift_changes[row].reshape(joints, -1)).reshape(*moved.shape[:2], 3, joints)
    series = np.zeros((len(shapes), shapes.shape[1] + rates.shape[1] - 1, 3))
    for k in range(1, shapes.shape[1]):
        products = changes[:, k - 1] @ np.swapaxes(rates, 1, 2)
        for j in range(rates.shape[1]):
            series[:, k + j] += 0.5 * products[:, :, j]
            series[:, abs(k - j)] += 0.5 * products[:, :, j]
    sizes = np.sqrt((series**2).sum(axis=2))
    if magnitude:
        of_inverse = moved @ slopes.inverse_changes[row].T
        sizes[:, 1 : shapes.shape[1]] += magnitude * np.sqrt((of_inverse**2).sum(axis=2))
    return sizes


def _raised(power: Array, bends: Array) -> Array:
    """The next order: a shape that bends (P, degrees) carries each power of it to higher degrees, too."""
    raised = np.zeros_like(power)
    for k in range(1, min(bends.shape[1] + 1, power.shape[1])):
        raised[:, k:] += bends[:, k - 1, None] * power[:, :-k]
    return raised
