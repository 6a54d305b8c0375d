"""The panels of a function that is being resolved, and their series."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...arrays import Array, Integers, Mask
from ...chebyshev import inside
from ...integrator.resolved import DEGREE

_SAMPLES = 5200  # of the whole path: with the jitter below no gap is above 1/4,000 of the duration
_JITTER = 0.28  # of the distance of two samples: nothing periodic hides between them
_LEAST_SAMPLES = 12  # of a piece between two breaks, however short
CHECKS = np.array([0.0411, 0.2677, 0.5573, 0.8219])  # places in a panel without samples; none is a node


@dataclass(frozen=True, eq=False)
class Panels:
    """Panels that are being resolved."""

    left: Array
    right: Array
    piece: Integers  # row of the piece that they are in
    before: Array  # (P, 2 n) misfit of what they are halves of

    def of(self, rows: Mask | Integers) -> Panels:
        return Panels(self.left[rows], self.right[rows], self.piece[rows], self.before[rows])

    def halves(self, misfit: Array) -> Panels:
        """Return both halves of every panel; `misfit` (P, 2 n) is that of the panels."""
        middle = 0.5 * (self.left + self.right)
        left, right = np.column_stack([self.left, middle]).ravel(), np.column_stack([middle, self.right]).ravel()
        return Panels(left, right, np.repeat(self.piece, 2), np.repeat(misfit, 2, axis=0))


@dataclass(frozen=True, eq=False)
class PanelFit:
    """Series on panels, and their errors."""

    coefficients: Array  # (P, DEGREE + 1, 2 n)
    misfit: Array  # (P, 2 n) how far the function is from the series
    floor: Array  # (P, 2 n) how far rounding and noise may bring it
    noise: Array  # (P,) [rad], where it is noise


class Piece:
    """Stretch between two breaks, and the kinks found in it."""

    def __init__(self, left: float, right: float) -> None:
        self.left, self.right = left, right
        first, last = inside(np.array([left]), np.array([right]))
        self.first, self.last = float(first[0]), float(last[0])
        self.kinks: list[float] = []


@dataclass(frozen=True, eq=False)
class ResolvedPanels:
    """Panels that are resolved."""

    left: Array
    right: Array
    piece: Integers  # row of their piece among those that were resolved with it
    coefficients: Array  # (P, DEGREE + 1, 2 n)
    noise: Array  # (P,) [rad], where the series follow noise

    def of(self, rows: Mask | Integers) -> ResolvedPanels:
        return ResolvedPanels(*(array[rows] for array in vars(self).values()))

    @staticmethod
    def in_order(parts: list[ResolvedPanels]) -> ResolvedPanels:
        """Return all of them, in the order of time."""
        fields = zip(*(vars(part).values() for part in parts), strict=True)
        panels = ResolvedPanels(*(np.concatenate(arrays) for arrays in fields))
        return panels.of(np.argsort(panels.left))


def sample_times(first: float, last: float, duration: float) -> Array:
    """Unevenly spaced times of a piece."""
    count = max(_LEAST_SAMPLES, int(np.ceil(_SAMPLES * (last - first) / duration)))
    jitter = np.mod(0.6180339887498949 * np.arange(count), 1.0) - 0.5
    return first + (last - first) * ((np.arange(count) + 0.5 + _JITTER * jitter) / count)


def polynomials(x: Array) -> Array:
    """T_0 ... T_DEGREE by their recurrence, which is faster than cosines: (S,) -> (S, DEGREE + 1)."""
    basis = np.empty((DEGREE + 1, len(x)))
    basis[0], basis[1] = 1.0, x
    twice = 2.0 * x
    for k in range(2, DEGREE + 1):
        np.multiply(twice, basis[k - 1], out=basis[k])
        basis[k] -= basis[k - 2]
    return basis.T


@lru_cache(maxsize=1)
def transform() -> Array:
    """Values at the nodes of a panel -> coefficients, from angles that are multiples of pi/DEGREE to rounding."""
    degrees, nodes = np.arange(DEGREE + 1)[:, None], np.arange(DEGREE + 1)
    matrix = np.cos(np.pi / DEGREE * (degrees * (DEGREE - nodes) % (2 * DEGREE))) * (2.0 / DEGREE)
    matrix[:, [0, -1]] *= 0.5
    matrix[[0, -1], :] *= 0.5
    return matrix


@lru_cache(maxsize=1)
def check_matrix() -> Array:
    """Values at the nodes of a panel -> at its check points."""
    return polynomials(2.0 * CHECKS - 1.0) @ transform()


@lru_cache(maxsize=1)
def integral_matrix() -> Array:
    """Coefficients of a series -> of its integral on [-1, 1]: (DEGREE + 2, DEGREE + 1)."""
    matrix = np.zeros((DEGREE + 2, DEGREE + 1))
    matrix[:] = np.polynomial.chebyshev.chebint(np.eye(DEGREE + 1), axis=0)
    return matrix
