"""The momentum's curve in machine code beside arrays, and beside an integral that is known."""

from __future__ import annotations

import numpy as np
import pytest

from shapephase.integrator.curve_integrals import _curve_terms, _rules
from shapephase.integrator.fast.curves import curve_terms
from shapephase.integrator.fast.estimate_constants import TERMS

EPS = np.finfo(float).eps
pytestmark = pytest.mark.usefixtures("fast")


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=0)


@pytest.mark.parametrize("lifted", [False, True])
def test_it_is_what_arrays_give(rng: np.random.Generator, lifted: bool):
    batch, steps = 3, 7
    channels = 0.3 * rng.normal(size=(9, TERMS, 2, steps))
    directions = unit(rng.normal(size=(3, batch, 2, steps)))
    # Not opposite each other, where the turn about the corner is not defined.
    corners = unit(directions + 0.2 * rng.normal(size=directions.shape))
    arguments = channels, directions, corners, rng.uniform(0.1, 2.0, batch), _rules()
    for found, expected in zip(
        curve_terms(*arguments, lifted=lifted), _curve_terms(*arguments, lifted=lifted), strict=True
    ):
        assert found.shape == expected.shape
        # Sums of some hundred products, whose quotients grow with the order.
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e3 * EPS * np.abs(expected).max())


def test_a_steady_turn_about_another_axis():
    """A round body of inertia one turns by |Pi| about Pi: the dynamic phase is the angle, and the curve is a point."""
    channels = np.zeros((9, TERMS, 2, 1))
    channels[:3, 0] = 0.4
    point = np.broadcast_to(unit(np.array([1.0, 2.0, 2.0]))[:, None, None, None], (3, 1, 2, 1))
    (by_rule, rates) = curve_terms(channels, point, point, np.array([1.5]), _rules(), lifted=False)
    np.testing.assert_allclose(by_rule[:, 0, 0, 0], 0.6, rtol=0, atol=8.0 * EPS)
    np.testing.assert_allclose(by_rule[:, 1, 0, 0], 0.0, rtol=0, atol=8.0 * EPS)
    np.testing.assert_allclose(rates, 0.6 * point, rtol=0, atol=8.0 * EPS)
