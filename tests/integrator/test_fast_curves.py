"""The momentum's curve in machine code beside arrays, and beside an integral that is known."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from shapephase import so3
from shapephase.integrator.curve_integrals import _curve_pieces, _rules
from shapephase.integrator.fast.curves import PiecesOfCurve, curve_pieces
from shapephase.integrator.fast.estimate_constants import TERMS

EPS = np.finfo(float).eps
pytestmark = pytest.mark.usefixtures("fast")


@pytest.mark.parametrize("lifted", [False, True])
def test_it_is_what_arrays_give(rng: np.random.Generator, lifted: bool):
    """Of all pieces at once, and of some of them after the others."""
    batch, count = 3, 7
    terms, places = 0.3 * rng.normal(size=(count + 2, TERMS, 9)), np.array([0, 1, 2, 4, 5, 6, 7])
    # Ends of pieces are near each other: the turn about a corner is not defined opposite it.
    directions = so3.normalised(rng.normal(size=(batch, 1, 3)) + 0.1 * rng.normal(size=(batch, count + 1, 3)))
    frames = so3.exp(rng.normal(size=3)) @ so3.exp(0.1 * rng.normal(size=(count + 1, 3))) if lifted else None
    lengths, magnitudes = rng.uniform(0.5, 2.0, count), rng.uniform(0.1, 2.0, batch)
    arguments = directions, frames, lengths, magnitudes, _rules()
    expected = PiecesOfCurve.empty(batch, count)
    _curve_pieces(terms, places, 0, *arguments, expected)
    for cuts in ([0, count], [0, 3, 5, count]):
        found = PiecesOfCurve.empty(batch, count)
        for first, stop in pairwise(cuts):
            curve_pieces(terms, places[first:stop], first, *arguments, found)
        for one, other in zip(found, expected, strict=True):
            # Sums of some hundred products, whose quotients grow with the order.
            np.testing.assert_allclose(one, other, rtol=0, atol=1e3 * EPS * np.abs(other).max())


def test_a_steady_turn_about_another_axis():
    """A round body of inertia one turns by |Pi| about Pi: the dynamic phase is the angle, and the curve is a point."""
    terms = np.zeros((2, TERMS, 9))
    terms[:, 0, :3] = 0.4
    point = np.broadcast_to(np.array([1.0, 2.0, 2.0]) / 3.0, (1, 2, 3))
    found = PiecesOfCurve.empty(1, 1)
    curve_pieces(terms, np.array([0]), 0, point, None, np.array([0.4]), np.array([1.5]), _rules(), found)
    np.testing.assert_allclose(found.dynamic, 0.6, rtol=0, atol=8.0 * EPS)
    np.testing.assert_allclose(found.corners, point, rtol=0, atol=0)
    for nothing in (found.slivers, found.slopes, found.by_momentum, found.differences):
        np.testing.assert_allclose(nothing, 0.0, rtol=0, atol=8.0 * EPS)
