"""Functions of time as polynomials on panels, with the values and slopes of the function at both ends.

The polynomial of degree d + 1 passes through the function at d Chebyshev points, ends included, and has its slopes at
both ends. Its derivative, of degree d, has the right integral, and neighbouring panels agree in value and slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np

from ...arrays import Array
from ...chebyshev import chebyshev, derivative_matrix, unit_nodes, values_to_coefficients


@dataclass(frozen=True, eq=False)
class PolynomialFit:
    """From d values and the slopes at both ends, per half of the panel: (d + 2,), to the polynomial on [-1, 1].

    Attributes
    ----------
    series : (d + 2, d + 2) to its Chebyshev coefficients
    slope_series : (d + 1, d + 2) to those of its derivative
    shapes, slopes : (d + 1, d + 2) to its values and slopes at the d + 1 Chebyshev points of the next degree
    between : (2 d + 1, d + 2) to its values at the Chebyshev points of twice that degree
    mean : (d + 2,) to its mean
    """

    series: Array
    slope_series: Array
    shapes: Array
    slopes: Array
    between: Array
    mean: Array


@lru_cache(maxsize=32)
def polynomial_fit(degree: int) -> PolynomialFit:
    """For panels that are sampled at a degree d, at least three."""
    through = degree - 1
    series = np.zeros((degree + 2, degree + 2))
    series[:degree, :degree] = values_to_coefficients(through)
    derivative = derivative_matrix(degree + 2)
    ends = chebyshev(np.array([-1.0, 1.0]), degree + 2) @ derivative
    # Two polynomials that are zero at all those points; their slopes at the ends are of one size.
    zeros = np.zeros((degree + 2, 2))
    zeros[[through - 1, through + 1], 0] = 0.5, -0.5
    zeros[[through - 2, through + 2], 1] = 0.25, -0.25
    missing = -(ends @ series)
    missing[0, degree] += 1.0
    missing[1, degree + 1] += 1.0
    series += zeros @ np.linalg.solve(ends @ zeros, missing)
    nodes, between = unit_nodes(degree), unit_nodes(2 * degree)
    slope_series = (derivative @ series)[:-1]
    return PolynomialFit(
        series=series,
        slope_series=slope_series,
        shapes=chebyshev(nodes, degree + 2) @ series,
        slopes=chebyshev(nodes, degree + 1) @ slope_series,
        between=chebyshev(between, degree + 2) @ series,
        mean=_means(degree + 2) @ series,
    )


def _means(count: int) -> Array:
    """Of T_0 ... T_(count-1) on [-1, 1]."""
    k = np.arange(count)
    return np.where(k % 2, 0.0, 1.0 / (1.0 - np.where(k % 2, 0.0, k) ** 2.0))


@lru_cache(maxsize=32)
def fit_nodes(degree: int) -> Array:
    """Where a function is taken for the fit, in [-1, 1]: (d,)."""
    return unit_nodes(degree - 1)


@lru_cache(maxsize=4)
def kink_errors(degree: int) -> tuple[Array, Array]:
    """Largest errors of the fits to (x - s)^3 beyond s, zero before it, for s in [0, 1]: s and errors, (17,) each."""
    fit, places = polynomial_fit(degree), np.linspace(0.0, 1.0, 17)
    points, nodes = unit_nodes(2 * degree), fit_nodes(degree)
    data = np.zeros((degree + 2, len(places)))
    data[:degree] = np.maximum(nodes[:, None] - places, 0.0) ** 3
    data[-1] = 3.0 * (1.0 - places) ** 2
    return places, np.abs(fit.between @ data - np.maximum(points[:, None] - places, 0.0) ** 3).max(axis=0)


@lru_cache(maxsize=4)
def binomials(count: int) -> Array:
    """Of row over column: (count, count)."""
    return np.array([[float(comb(n, k)) for k in range(count)] for n in range(count)])


@lru_cache(maxsize=4)
def chebyshev_of_powers(count: int) -> Array:
    """From x^p on [0, 1] to the Chebyshev coefficients of the same, which are positive: (count, count)."""
    points = 0.5 + 0.5 * unit_nodes(count - 1)
    return (values_to_coefficients(count - 1) @ points[:, None] ** np.arange(count)).T


def basis(x: Array, count: int) -> Array:
    """T_0 ... T_(count-1) by their recurrence, which is faster than cosines: (K,) -> (count, K)."""
    found = np.empty((count, len(x)))
    found[0], found[1] = 1.0, x
    for k in range(2, count):
        found[k] = 2.0 * x * found[k - 1] - found[k - 2]
    return found


def missing_terms(degree: int, sizes: Array) -> tuple[Array, Array]:
    """What terms beyond a degree, of these sizes (P, 2 degree + 1) or fewer, do to integrals over panels of width one.

    At the end of a panel, and within: (P,) each. A term T_k is taken for T_(2 degree - k).
    """
    k = np.arange(degree + 1, min(2 * degree + 1, sizes.shape[1]))
    alias = 2 * degree - k
    of_even = np.abs(1.0 / (1.0 - k**2.0) - 1.0 / (1.0 - np.where(alias == 1, 0, alias) ** 2.0)) * (k % 2 == 0)
    of_all = 0.5 / (k - 1.0) + 0.5 / np.maximum(alias - 1.0, 0.5)
    beyond = sizes[:, k]
    return beyond @ of_even, beyond @ of_all
