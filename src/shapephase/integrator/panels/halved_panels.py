"""Panels cut in halves for the steps, which are cut to measure on each; nothing more is sampled for that."""

from __future__ import annotations

from functools import lru_cache
from math import ceil

import numpy as np

from ...arrays import Array

# Of the terms of a series, those that its halves have: T_n swings at most n / sqrt(2) times as fast there.
_SHARE_OF_TERMS = 0.8
# What a radian of the body's turn counts beside the degree of a series.
_DEGREES_A_RADIAN = 5.0
# A panel with more of both takes many steps.
_MANY_DEGREES = 40.0


def pays_to_halve(panels: int, turn: float, degrees: float) -> bool:
    """Whether panels will take many steps: turn of all [rad] and sum of their degrees."""
    return _DEGREES_A_RADIAN * turn + degrees > _MANY_DEGREES * panels


def halved_edges(edges: Array) -> Array:
    """(P + 1,) -> (2 P + 1,) [s]."""
    found = np.empty(2 * len(edges) - 1)
    found[::2], found[1::2] = edges, 0.5 * (edges[:-1] + edges[1:])
    return found


def halved_series(coefficients: Array) -> Array:
    """Chebyshev series (P, n, 9) on both halves of their panels: (2 P, m, 9)."""
    panels, terms, channels = coefficients.shape
    # The mean, far larger than all else, is added at the end: it is rounded once, not with every term.
    found = (_on_halves(terms) @ coefficients[:, 1:]).reshape(panels, 2, -1, channels)
    found[:, :, 0] += coefficients[:, None, 0]
    return found.reshape(2 * panels, -1, channels)


@lru_cache(maxsize=64)
def _on_halves(terms: int) -> Array:
    """Coefficients but the first -> those of the first and then of the second half: (2 m, terms - 1).

    By 2 x T_k = T_(k-1) + T_(k+1), x being (y - 1)/2 or (y + 1)/2; in extended precision.
    """
    halves = np.zeros((2, terms, terms), dtype=np.longdouble)
    halves[:, 0, 0] = 1.0
    for half, middle in enumerate((-0.5, 0.5)):
        for k in range(1, terms):
            last = halves[half, k - 1]
            times_x = middle * last
            times_x[1:] += 0.25 * last[:-1]
            times_x[:-1] += 0.25 * last[1:]
            times_x[1:2] += 0.25 * last[:1]
            halves[half, k] = times_x if k == 1 else 2.0 * times_x - halves[half, k - 2]
    kept = min(terms, ceil(_SHARE_OF_TERMS * terms) + 1)
    return np.ascontiguousarray(halves[:, 1:, :kept].transpose(0, 2, 1), dtype=np.float64).reshape(2 * kept, terms - 1)
