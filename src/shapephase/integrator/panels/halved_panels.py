"""Panels cut in halves for the steps, which are cut to measure on each; nothing more is sampled for that."""

from __future__ import annotations

import numpy as np

from ...arrays import Array
from ...chebyshev import on_halves
from ..fast import engine
from ..fast.panels import halves_of_panels

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
    if engine.is_ready():
        return halves_of_panels(coefficients)
    panels, terms, channels = coefficients.shape
    matrix = on_halves(terms)
    kept = matrix.shape[1]
    # The mean, far larger than all else, is added at the end: it is rounded once, not with every term.
    found = (matrix.reshape(2 * kept, terms - 1) @ coefficients[:, 1:]).reshape(panels, 2, kept, channels)
    found[:, :, 0] += coefficients[:, None, 0]
    return found.reshape(2 * panels, kept, channels)
