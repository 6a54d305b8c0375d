"""Chebyshev series on panels against NumPy's own evaluation and against mpmath."""

from __future__ import annotations

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from numpy.polynomial import chebyshev as reference

from shapephase.chebyshev import (
    PiecewiseChebyshev,
    chebyshev,
    derivative_matrix,
    exact_local_coordinate,
    gauss_tableau,
    inside,
    local_coordinate,
    nodes_on,
    restriction_matrix,
    unit_nodes,
    values_to_coefficients,
)

EPS = np.finfo(float).eps
EDGES = np.array([-0.5, 0.25, 1.0, 3.0])


@pytest.fixture
def series(rng):
    return PiecewiseChebyshev(EDGES, rng.normal(size=(3, 8, 2)) / (1.0 + np.arange(8.0))[:, None] ** 2)


def by_numpy(series: PiecewiseChebyshev, times: np.ndarray, order: int = 0) -> np.ndarray:
    """Panel by panel, with NumPy's Clenshaw recurrence on its own mapped domain."""
    values = np.empty((len(times), series.coefficients.shape[2]))
    count = len(series.coefficients)
    for row, t in enumerate(times):
        panel = next(p for p in range(len(series.edges) - 1) if t < series.edges[p + 1] or p == len(series.edges) - 2)
        domain = series.edges[panel : panel + 2]
        for column in range(values.shape[1]):
            one = reference.Chebyshev(series.coefficients[panel % count, :, column], domain=domain)
            values[row, column] = (one.deriv(order) if order else one)(t)
    return values


def test_basis_against_fifty_digits():
    """T_k(x) is cos(k arccos x); an argument rounded by eps/2 moves it by at most k^2 eps/2."""
    with mpmath.workdps(50):
        for x in (-1.0, -0.999999, -0.3, 0.0, 1e-9, 0.7, 1.0):
            exact = np.array([float(mpmath.chebyt(k, mpmath.mpf(x))) for k in range(33)])
            assert np.all(np.abs(chebyshev(np.array(x), 33) - exact) <= EPS * (4.0 + np.arange(33) ** 2))


@pytest.mark.parametrize("degree", [1, 2, 5, 30, 41, 80])
def test_nodes_and_coefficients_against_fifty_digits(degree: int):
    """Rounded once each, a unit more for sums of a row being zero; opposite nodes are so to the last bit."""
    with mpmath.workdps(50):
        angles = [mpmath.pi * (degree - k) / degree for k in range(degree + 1)]
        nodes = np.array([float(mpmath.cos(angle)) for angle in angles])
        weights = [mpmath.mpf(1 if 0 < k < degree else 0.5) for k in range(degree + 1)]
        matrix = np.array(
            [[float(2 * a * b * mpmath.cos(j * t) / degree) for b, t in zip(weights, angles, strict=True)]
             for j, a in enumerate(weights)]
        )  # fmt: skip
    assert np.abs(unit_nodes(degree) - nodes).max() <= EPS
    assert np.abs(values_to_coefficients(degree) - matrix).max() <= 3.0 * EPS / degree
    assert (unit_nodes(degree) == -unit_nodes(degree)[::-1]).all()


@pytest.mark.parametrize("count", [1, 2, 8, 16])
def test_gauss_nodes_integrate_polynomials_from_zero_to_each_node(count: int):
    nodes, weights, integrals = gauss_tableau(count)
    powers = np.arange(2 * count)
    assert weights @ nodes[:, None] ** powers == pytest.approx(1.0 / (powers + 1.0), abs=1e-14)
    powers = powers[:count]
    assert integrals @ nodes[:, None] ** powers == pytest.approx(nodes[:, None] ** (powers + 1.0) / (powers + 1.0))


def test_values_against_numpy(series):
    times = np.concatenate([np.linspace(-0.5, 3.0, 71), EDGES])
    assert series(times) == pytest.approx(by_numpy(series, times), abs=1e-14)


def test_an_edge_belongs_to_the_panel_on_its_right(series):
    assert series.panel_of(np.array([-1.0, -0.5, 0.25, 0.999, 1.0, 3.0, 9.0])).tolist() == [0, 0, 1, 1, 2, 2, 2]


def test_beyond_its_ends_a_function_keeps_its_end_values(series):
    assert np.array_equal(series(np.array([-7.0, 8.0])), series(np.array([-0.5, 3.0])))


def test_a_given_panel_is_evaluated_at_its_own_end(series):
    """At an edge the left panel has its own limit, where the series jump."""
    left = series.on_panels(np.array([[0.25]]), np.array([0]))[0, 0]
    assert left == pytest.approx(series.coefficients[0].sum(axis=0), abs=1e-15)


def test_derivative_against_numpy_and_differences(series):
    times = np.linspace(-0.49, 2.99, 60)
    slopes = series.derivative()(times)
    assert slopes == pytest.approx(by_numpy(series, times, order=1), abs=1e-12)
    panel, step = series.panel_of(times), 1e-6
    ahead, behind = (series.on_panels((times + sign * step)[:, None], panel)[:, 0] for sign in (1.0, -1.0))
    assert slopes == pytest.approx((ahead - behind) / (2.0 * step), abs=1e-8)


def test_repeated_panels(series):
    edges = np.concatenate([EDGES, EDGES[1:] + 3.5, EDGES[1:] + 7.0])
    repeated = PiecewiseChebyshev(edges, series.coefficients)
    times = np.linspace(-0.49, 2.99, 40)
    for loop in range(3):
        assert repeated(times + 3.5 * loop) == pytest.approx(series(times), abs=1e-13)
        assert repeated.derivative()(times + 3.5 * loop) == pytest.approx(series.derivative()(times), abs=1e-11)


def test_many_times_are_those_of_one_at_a_time(series):
    """An evaluation in several pieces."""
    times = np.linspace(-0.5, 3.0, 250_001)
    values = series(times)
    one_by_one = np.stack([series(t[None])[0] for t in times[::50_000]])
    assert values[::50_000] == pytest.approx(one_by_one, abs=1e-14)


def test_local_coordinates_late_in_a_long_motion():
    """Panels of a microsecond after a day: the exact coordinate is right to rounding, against fifty digits."""
    left, right = np.array(86400.0), np.nextafter(86400.0 + 1e-6, np.inf)
    times = np.linspace(left, right, 37)
    with mpmath.workdps(50):
        low, high = mpmath.mpf(float(left)), mpmath.mpf(float(right))
        exact = np.array([float((2 * mpmath.mpf(float(t)) - low - high) / (high - low)) for t in times])
    assert exact_local_coordinate(times, left, right) == pytest.approx(exact, abs=2.0 * EPS)
    # 2 t and left + right are rounded in units of 2^-36 s.
    assert local_coordinate(times, left, right) == pytest.approx(exact, abs=4.0 * 2.0**-36 / 1e-6)


@pytest.mark.parametrize("degree", [0, 1, 2, 7, 32])
def test_coefficients_of_an_interpolant_against_numpy(degree: int, rng):
    values = rng.normal(size=degree + 1)
    coefficients = values_to_coefficients(degree) @ values
    assert reference.chebval(unit_nodes(degree), coefficients) == pytest.approx(values, abs=1e-13)


def test_nodes_are_those_of_numpy():
    for degree in (1, 2, 5, 16):
        assert unit_nodes(degree) == pytest.approx(reference.chebpts2(degree + 1), abs=4.0 * EPS)
    nodes = nodes_on(EDGES[:-1], EDGES[1:], 5)
    for row, (left, right) in enumerate(pairwise(EDGES)):
        assert nodes[row] == pytest.approx(
            0.5 * (left + right) + 0.5 * (right - left) * reference.chebpts2(6), abs=2e-15
        )


@pytest.mark.parametrize("count", [1, 2, 9])
def test_derivative_and_restriction_as_matrices(count: int, rng):
    coefficients, x = rng.normal(size=count), np.linspace(-1.0, 1.0, 21)
    slopes = derivative_matrix(count) @ coefficients
    assert reference.chebval(x, slopes) == pytest.approx(
        reference.chebval(x, reference.chebder(coefficients)), abs=1e-12
    )
    part = restriction_matrix(count, -0.25, 0.5) @ coefficients
    assert reference.chebval(x, part) == pytest.approx(reference.chebval(0.125 + 0.375 * x, coefficients), abs=1e-13)


def test_inside_is_inside_and_near():
    first, last = inside(EDGES[:-1], EDGES[1:])
    assert np.all(first > EDGES[:-1])
    assert np.all(last < EDGES[1:])
    assert np.all(first - EDGES[:-1] <= 64.0 * np.spacing(3.0) + 2.0 * EPS)
