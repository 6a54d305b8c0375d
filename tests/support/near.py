"""Arrays near others, to so many roundings, and derivatives by differences."""

from __future__ import annotations

import numpy as np

EPS = np.finfo(float).eps


def near(found, expected, roundings=500.0):
    """To so many roundings of the largest entry."""
    atol = roundings * EPS * np.abs(expected).max(initial=0.0)
    np.testing.assert_allclose(found, expected, rtol=0, atol=atol)


def by_differences(function, shapes, step=2e-3):
    """Derivatives by the shape, of order six: (N, n) -> (N, n, ...)."""
    found = 0.0
    for steps, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
        sides = [
            np.stack([function(shapes + side * steps * step * unit) for unit in np.eye(shapes.shape[1])], axis=1)
            for side in (1.0, -1.0)
        ]
        found = found + weight * (sides[0] - sides[1]) / step
    return found
