"""Curves of directions closed by great circles, and references far from them."""

from __future__ import annotations

import numpy as np
import pytest

from shapephase import so3, sphere
from shapephase.integrator.closing import closed_curves, far_references

EPS = np.finfo(float).eps
X, Y, Z = np.eye(3)


def test_an_eighth_of_the_sphere():
    """From x over y to z and back: a turn by pi/2, and the frame is carried along the last side."""
    corners, reference = np.stack([X, Y, Z])[None], so3.normalised(X + Y + Z)[None]
    start, back = so3.exp(np.array([[0.3, -0.5, 0.2]])), so3.exp(0.5 * np.pi * Y)
    axis = so3.apply(start, X)
    tilt = start @ back @ so3.transpose(start)
    last = so3.exp(0.7 * axis) @ tilt @ start
    found = closed_curves(corners, reference, axis, start, last)
    np.testing.assert_allclose(found.area, 0.5 * np.pi, rtol=0, atol=8.0 * EPS)
    np.testing.assert_allclose(found.closing, np.pi / 6.0, rtol=0, atol=8.0 * EPS)
    np.testing.assert_allclose(found.gap, 0.5 * np.pi, rtol=0, atol=8.0 * EPS)
    np.testing.assert_allclose(found.tilt, tilt, rtol=0, atol=8.0 * EPS)
    np.testing.assert_allclose(found.turn, 0.7, rtol=0, atol=16.0 * EPS)


@pytest.mark.parametrize("axis", [X, Y, Z, so3.normalised(X + Y + Z)])
@pytest.mark.parametrize("angle", [-3.0, -0.5 * np.pi, -1e-9, 0.0, 2.0, np.pi - 1e-9, np.pi])
def test_turns_of_every_size_about_every_axis(axis: np.ndarray, angle: float):
    corners, reference, last = np.stack([Z, Z])[None], Z[None], so3.exp(angle * axis)[None]
    found = closed_curves(corners, reference, axis[None], np.eye(3)[None], last)
    assert abs(so3.wrap(found.turn[0] - angle)) < 8.0 * EPS
    assert -np.pi < found.turn[0] <= np.pi


@pytest.mark.parametrize("spread", [0.0, 0.3, 3.0])
def test_references_are_the_farthest(rng: np.random.Generator, spread: float):
    """Of curves that are a point, that wind about one direction, and that are everywhere."""
    steps = np.cumsum(spread * rng.normal(size=(40, 30, 3)), axis=1)
    curves = so3.normalised(2.0 * rng.normal(size=(40, 1, 3)) + steps)
    nearest = (curves @ sphere.fibonacci_directions(642).T).min(axis=1)
    chosen = np.einsum("bki,bi->bk", curves, far_references(curves)).min(axis=1)
    np.testing.assert_allclose(chosen, nearest.max(axis=1), rtol=0, atol=4.0 * EPS)
