"""Functions of time as Chebyshev series on panels: nodes, coefficients, evaluation and derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from .arrays import Array, Integers
from .display import short_repr

# Numbers in the largest intermediate array of an evaluation: 16 megabytes.
_CHUNK = 2_000_000
MARGIN_OF_WIDTH = 1e-3  # of an interval's width: times are not moved farther inside than this


@dataclass(frozen=True, eq=False)
class PiecewiseChebyshev:
    """A vector-valued function that is a Chebyshev series on each of its panels.

    edges : (m P + 1,) ascending ends of the panels; with m > 1 the P series are repeated m times
    coefficients : (P, n, c) of T_0 ... T_(n-1), padded with zeros to one degree
    """

    edges: Array
    coefficients: Array

    __repr__ = short_repr

    def panel_of(self, times: Array) -> Integers:
        """The panel of each time, an edge belonging to the panel on its right: (N,) -> (N,)."""
        return np.clip(np.searchsorted(self.edges, times, side="right") - 1, 0, len(self.edges) - 2)

    def local(self, times: Array, panel: Integers) -> Array:
        """Times as coordinates of their panels, clipped to [-1, 1]: (N, k), (N,) -> (N, k)."""
        return local_coordinate(times, self.edges[panel, None], self.edges[panel + 1, None])

    def at_local(self, local: Array, panel: Integers) -> Array:
        """Values at coordinates in [-1, 1] of given panels: (N, k), (N,) -> (N, k, c)."""
        count, degrees, components = self.coefficients.shape
        values = np.empty((*local.shape, components))
        chunk = max(1, _CHUNK // (degrees * (components + local.shape[1])))
        for start in range(0, len(local), chunk):
            part = slice(start, start + chunk)
            values[part] = chebyshev(local[part], degrees) @ self.coefficients[panel[part] % count]
        return values

    def on_panels(self, times: Array, panel: Integers) -> Array:
        """Values at times of given panels: (N, k), (N,) -> (N, k, c)."""
        return self.at_local(self.local(times, panel), panel)

    def __call__(self, times: Array) -> Array:
        """Values: (N,) -> (N, c)."""
        return self.on_panels(times[:, None], self.panel_of(times))[:, 0]

    def derivative(self) -> PiecewiseChebyshev:
        """The derivative with respect to time."""
        count, degrees, _ = self.coefficients.shape
        widths = np.diff(self.edges[: count + 1])
        slopes = (derivative_matrix(degrees) @ self.coefficients) * (2.0 / widths)[:, None, None]
        return PiecewiseChebyshev(self.edges, slopes)


def chebyshev(x: Array, count: int) -> Array:
    """T_0 ... T_(count-1) at x in [-1, 1]: (...) -> (..., count)."""
    return np.cos(np.arccos(x)[..., None] * np.arange(count))


def local_coordinate(times: Array, left: Array, right: Array) -> Array:
    """Times as coordinates of their intervals, clipped to [-1, 1]."""
    return np.clip((2.0 * times - left - right) / (right - left), -1.0, 1.0)


def exact_local_coordinate(times: Array, left: Array, right: Array) -> Array:
    """`local_coordinate`, to rounding for short intervals late in a long motion, too."""
    # Differences of near times are exact; 2 t - left - right would lose digits.
    return np.clip(((times - left) - (right - times)) / (right - left), -1.0, 1.0)


def inside(left: Array, right: Array) -> tuple[Array, Array]:
    """Times just inside intervals."""
    margin = end_margin(right - left, float(np.max(right)))
    return left + margin, right - margin


def end_margin(width: Array, end: float) -> Array:
    """How far inside intervals of this width times are on this side of a break, if all are over at `end`.

    It is wider than the rounding of stretching, reversing and joining paths, and too small to matter.
    """
    return np.minimum(widest_margin(end), MARGIN_OF_WIDTH * width)


def widest_margin(end: float) -> float:
    """`end_margin` of wide intervals [s]."""
    return 64.0 * float(np.spacing(end))


@lru_cache(maxsize=64)
def unit_nodes(degree: int) -> Array:
    """The ascending Chebyshev points of [-1, 1], ends included: (degree + 1,)."""
    # Sines of angles on both sides of zero: nodes are opposite each other to the last bit.
    return np.sin(np.pi * np.arange(-degree, degree + 1, 2) / (2 * degree)) if degree else np.zeros(1)


def nodes_on(left: Array, right: Array, degree: int) -> Array:
    """The ascending Chebyshev points of panels, ends included but for rounding: (P,), (P,) -> (P, degree + 1)."""
    return 0.5 * (left + right)[:, None] + 0.5 * (right - left)[:, None] * unit_nodes(degree)


@lru_cache(maxsize=64)
def values_to_coefficients(degree: int) -> Array:
    """Values at the ascending Chebyshev points of [-1, 1] -> Chebyshev coefficients: (degree + 1, degree + 1)."""
    if degree == 0:
        return np.ones((1, 1))
    order = np.arange(degree + 1)
    matrix = _cosines(order[:, None] * order[::-1], degree) * (2.0 / degree)
    matrix[:, [0, -1]] *= 0.5
    matrix[[0, -1], :] *= 0.5
    # Values that are all alike have one coefficient: their rounding would else fill all others.
    share = matrix.sum(axis=1) / (degree + 1)
    share[0] -= 1.0 / (degree + 1)
    return matrix - share[:, None]


def _cosines(numbers: Integers, degree: int) -> Array:
    """cos(pi k / degree) for whole numbers k, right to rounding however large: sines of a quarter turn at most."""
    apart = numbers % (2 * degree)
    return np.sin(np.pi * (degree - 2 * np.minimum(apart, 2 * degree - apart)) / (2 * degree))


@lru_cache(maxsize=16)
def derivative_matrix(count: int) -> Array:
    """Coefficients of a series -> those of its derivative on [-1, 1], the last being zero: (count, count)."""
    matrix = np.zeros((count, count))
    if count > 1:
        matrix[:-1] = np.polynomial.chebyshev.chebder(np.eye(count))
    return matrix


@lru_cache(maxsize=64)
def restriction_matrix(count: int, left: float, right: float) -> Array:
    """Coefficients of a series on [-1, 1] -> those of the same function on a part of it, as many: (count, count)."""
    nodes = 0.5 * (left + right) + 0.5 * (right - left) * unit_nodes(count - 1)
    return values_to_coefficients(count - 1) @ chebyshev(np.clip(nodes, -1.0, 1.0), count)


@cache
def gauss_tableau(count: int) -> tuple[Array, Array, Array]:
    """Gauss nodes and weights of [0, 1], and the integrals from 0 to each node of the polynomials through them."""
    legendre = np.polynomial.legendre
    nodes, weights = legendre.leggauss(count)
    coefficients = (legendre.legvander(nodes, count - 1) * weights[:, None]).T * (np.arange(count)[:, None] + 0.5)
    integrals = 0.5 * legendre.legval(nodes, legendre.legint(coefficients, lbnd=-1)).T
    return 0.5 * (nodes + 1.0), 0.5 * weights, np.asarray(integrals, dtype=np.float64)
