"""Geodesics of the shape metric against the equation itself, made by CasADi from the body's symbols."""

import casadi
import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import TrajectoryError
from shapephase.optimal_control.symbolic import symbolic_body
from shapephase.shape_space.shape_geodesic import shape_geodesic, shape_speed
from support.long_runs import full_but


def exact_acceleration(body):
    """g r'' = grad(r'.g r')/2 - d(g r') r', differentiated by CasADi."""
    r, v = casadi.SX.sym("r", body.n_shape), casadi.SX.sym("v", body.n_shape)
    metric = symbolic_body(body).shape_metric(r)
    momenta = metric @ v
    force = casadi.gradient(0.5 * casadi.dot(v, momenta), r) - casadi.jtimes(momenta, r, v)
    return casadi.Function("acceleration", [r, v], [casadi.solve(metric, force)]), casadi.Function("g", [r], [metric])


@pytest.mark.parametrize("name", full_but(["cat", "satellite", "diver"], "satellite", "diver"))
def test_the_equation_of_geodesics_holds(name):
    body, rng = sp.load_body(name), np.random.default_rng(3)
    start = rng.uniform(-0.3, 0.3, body.n_shape)
    end = start + rng.uniform(-0.05, 0.05, body.n_shape)
    way = shape_geodesic(body, start, end)
    np.testing.assert_array_equal(way.shapes[0], start)
    np.testing.assert_allclose(way.shapes[-1], end, rtol=0.0, atol=1e-15)
    acceleration, metric = exact_acceleration(body)
    fit = np.polynomial.polynomial.polyfit(way.nodes, way.shapes, len(way.nodes) - 1)
    second = np.polynomial.polynomial.polyval(way.nodes, np.polynomial.polynomial.polyder(fit, 2)).T
    exact = np.array([np.array(acceleration(r, v)).ravel() for r, v in zip(way.shapes, way.rates, strict=True)])
    # Central differences of 1e-4 in energies of some joule leave 1e-6 of the acceleration, which is of second order.
    np.testing.assert_allclose(second, exact, rtol=0.0, atol=5e-6 * np.abs(exact).max() + 1e-12)
    speeds = shape_speed(body, way.shapes, way.rates)
    np.testing.assert_allclose(speeds, way.length, rtol=1e-8)
    for r, v, speed in zip(way.shapes, way.rates, speeds, strict=True):
        assert speed**2 == pytest.approx(float(v @ np.array(metric(r)) @ v), rel=1e-10)


def test_no_way_nearby_is_shorter():
    body, rng = sp.load_body("diver"), np.random.default_rng(4)
    way = shape_geodesic(body, [0.2, -0.4], [0.6, 0.1])
    s, weights = np.polynomial.legendre.leggauss(20)
    s, weights = 0.5 + 0.5 * s, 0.5 * weights
    fit = np.polynomial.polynomial.polyfit(way.nodes, way.shapes, len(way.nodes) - 1)

    def length(bump, slope):
        shapes = np.polynomial.polynomial.polyval(s, fit).T + bump
        rates = np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(fit)).T + slope
        return weights @ shape_speed(body, shapes, rates)

    zero = np.zeros((20, 2))
    least = length(zero, zero)
    assert least == pytest.approx(way.length, rel=1e-6)
    for _ in range(20):
        amplitude = 1e-2 * rng.normal(size=2)
        bump = np.sin(np.pi * s)[:, None] * amplitude
        assert length(bump, np.pi * np.cos(np.pi * s)[:, None] * amplitude) > least


def test_shapes_that_are_the_same_or_too_far_apart():
    body = sp.load_body("diver")
    way = shape_geodesic(body, [0.1, 0.2], [0.1, 0.2])
    assert way.length == 0.0
    np.testing.assert_array_equal(way.shapes, np.tile([0.1, 0.2], (len(way.nodes), 1)))
    with pytest.raises(TrajectoryError, match="geodesic"):
        shape_geodesic(body, [0.0, 0.0], [3e4, -2e4])
