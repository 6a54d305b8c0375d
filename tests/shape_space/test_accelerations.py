"""The accelerations of paths against formulas and differences of their rates."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from support.independent import random_loop

LOOP = random_loop(3, 2)
FOURIER = LOOP.path
KNOTS = np.array([0.0, 0.3, 0.9, 1.4, 2.0])
POINTS = np.array([[0.0, 0.1], [0.4, -0.2], [0.1, 0.3], [-0.3, 0.2], [0.0, 0.1]])
SPLINE = sp.ShapePath.spline(KNOTS, POINTS)
PATHS = {
    "fourier": FOURIER,
    "spline": SPLINE,
    "open spline": sp.ShapePath.spline(KNOTS, POINTS, periodic=False),
    "waypoints": sp.ShapePath.waypoints(KNOTS, POINTS),
    "reversed": SPLINE.reversed(),
    "stretched": FOURIER.stretched(0.4),
    "repeated": SPLINE.repeated(3),
    "joined": SPLINE.then(SPLINE.reversed().stretched(0.7)),
    "function": sp.ShapePath.function(LOOP.at, LOOP.duration),
    "function, repeated and stretched": sp.ShapePath.function(LOOP.at, LOOP.duration).repeated(2).stretched(1.5),
}


@pytest.mark.parametrize("name", PATHS)
def test_acceleration_is_the_slope_of_the_rate(name):
    """By differences of order eight within a piece: short of 1e-12 by their order, off by rounding over the step."""
    path = PATHS[name]
    inner = np.linspace(0.05, 0.95, 7)
    times = (path.breaks[:-1, None] + np.diff(path.breaks)[:, None] * inner).ravel()
    h = 0.003 * np.diff(path.breaks).min()
    slope = (
        sum(
            weight * (path.rate(times + k * h) - path.rate(times - k * h))
            for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), start=1)
        )
        / h
    )
    found = path.acceleration(times)
    np.testing.assert_allclose(found, slope, rtol=0, atol=1e-10 * max(1.0, np.abs(slope).max()))
    assert path.acceleration(times.reshape(-1, 7)).shape == (len(path.breaks) - 1, 7, 2)


def test_a_function_has_the_acceleration_of_its_formula():
    times = np.linspace(0.0, LOOP.duration, 101)
    true = np.array([LOOP.acceleration(t) for t in times])
    size = np.abs(true).max()
    np.testing.assert_allclose(FOURIER.acceleration(times), true, rtol=0, atol=1e-14 * size)
    # The derivative of a series of degree 32 magnifies rounding by its square, a thousand.
    np.testing.assert_allclose(PATHS["function"].acceleration(times), true, rtol=0, atol=1e-11 * size)


def test_columns_follow_the_order_of_the_joints():
    named = sp.ShapePath.fourier([0.0, 0.0], [[0.1], [0.4]], [[0.2], [0.3]], 1.0, joint_names=("a", "b"))
    other = named.matched(("b", "a"), "the body")
    times = np.linspace(0.0, 1.0, 5)
    np.testing.assert_array_equal(other.acceleration(times), named.acceleration(times)[:, ::-1])
