"""Signed area on the unit sphere: of a moving direction, closed by the great circle when it does not close.

Areas are positive by the right-hand rule, seen from outside. All functions are batched.

The area form with a reference direction n, dA = n.(u x du) / (1 + n.u), is smooth except at u = -n; its integral
along a closed curve is the signed area modulo 4 pi, self-intersections and windings included, and along a
great-circle arc it has the closed form `triangle_area` (numerics.md section 3).
"""

from __future__ import annotations

import numpy as np

from .arrays import Array


def area_rate(reference: Array, direction: Array, direction_rate: Array) -> Array:
    """dA/dt = n.(u x u')/(1 + n.u): (3,), (..., 3), (..., 3) -> (...) [sr/s]."""
    along = np.sum(np.cross(direction, direction_rate) * reference, axis=-1)
    return along / (1.0 + np.sum(reference * direction, axis=-1))


def triangle_area(reference: Array, start: Array, end: Array) -> Array:
    """Signed area of the spherical triangle (n, start, end), in (-2 pi, 2 pi] [sr].

    The integral of the area form along the great circle from `start` to `end`.
    Source: van Oosterom and Strackee 1983.
    """
    volume = np.sum(reference * np.cross(start, end), axis=-1)
    denominator = 1.0 + np.sum(start * end + reference * start + reference * end, axis=-1)
    return 2.0 * np.arctan2(volume, denominator)


def far_reference(directions: Array) -> Array:
    """The reference n, of a fixed fine set, whose antipode is farthest from a curve: (N, 3) -> (3,).

    The region of the sphere that holds -n is the one whose area is not counted, which fixes the branch
    of the area of a winding curve.
    """
    return _FIBONACCI[np.argmax(np.min(directions @ _FIBONACCI.T, axis=0))]


def fibonacci_directions(count: int) -> Array:
    """Directions spread evenly over the sphere: (count, 3)."""
    index = np.arange(count) + 0.5
    height = 1.0 - 2.0 * index / count
    azimuth = np.pi * (1.0 + np.sqrt(5.0)) * index
    radius = np.sqrt(1.0 - height**2)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height], axis=-1)


_FIBONACCI = fibonacci_directions(642)
