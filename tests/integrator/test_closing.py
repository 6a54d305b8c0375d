"""Curves of directions closed by great circles, and references far from them: in machine code, on arrays, as known."""

from __future__ import annotations

import numpy as np
import pytest

from shapephase import so3, sphere
from shapephase.integrator.closing import closed_curves, far_references
from support.both_engines import both

EPS = np.finfo(float).eps
pytestmark = pytest.mark.usefixtures("fast")
X, Y, Z = np.eye(3)


def some_curves(rng: np.random.Generator, count: int, apart: float) -> np.ndarray:
    """Corners of curves whose ends are that far apart [rad]: (count, 6, 3)."""
    corners = so3.normalised(rng.normal(size=(count, 6, 3)))
    across = so3.normalised(np.cross(corners[:, 0], rng.normal(size=(count, 3))))
    corners[:, -1] = np.cos(apart) * corners[:, 0] + np.sin(apart) * across
    return corners


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1.0, 2.5, np.pi - 1e-5, np.pi])
def test_it_is_what_arrays_give(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator, apart: float):
    count = 50
    corners = some_curves(rng, count, apart)
    references, axes = so3.normalised(rng.normal(size=(2, count, 3)))
    first, last = so3.exp(2.0 * rng.normal(size=(2, count, 3)))
    arrays, kernels = both(monkeypatch, lambda: closed_curves(corners, references, axes, first, last))
    # An area is rounded the more the nearer an arc comes to the point opposite the reference.
    nearness = 1.0 + np.einsum("bki,bi->bk", corners, references).min(axis=1)
    # Nearly opposite ends: the plane of the arc is as uncertain as they are near.
    rounding = 64.0 * EPS / max(np.pi - apart, 1e-5) if apart < np.pi else 64.0 * EPS
    for name in ("gap", "tilt"):
        np.testing.assert_allclose(getattr(kernels, name), getattr(arrays, name), rtol=0, atol=rounding)
    # The nearest turn about an axis is uncertain for half turns about others.
    np.testing.assert_allclose(so3.wrap(kernels.turn - arrays.turn), 0.0, rtol=0, atol=1e3 * rounding)
    for name in ("area", "closing"):
        distance = np.abs(getattr(kernels, name) - getattr(arrays, name))
        assert np.all(np.minimum(distance, np.abs(4.0 * np.pi - distance)) < 64.0 * rounding / nearness)


@pytest.mark.parametrize("setting", ["0", "1"])
def test_an_eighth_of_the_sphere(monkeypatch: pytest.MonkeyPatch, setting: str):
    """From x over y to z and back: a turn by pi/2, and the frame is carried along the last side."""
    monkeypatch.setenv("SHAPEPHASE_FAST", setting)
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


@pytest.mark.parametrize("setting", ["0", "1"])
@pytest.mark.parametrize("axis", [X, Y, Z, so3.normalised(X + Y + Z)])
@pytest.mark.parametrize("angle", [-3.0, -0.5 * np.pi, -1e-9, 0.0, 2.0, np.pi - 1e-9, np.pi])
def test_turns_of_every_size_about_every_axis(
    monkeypatch: pytest.MonkeyPatch, setting: str, axis: np.ndarray, angle: float
):
    monkeypatch.setenv("SHAPEPHASE_FAST", setting)
    corners, reference, last = np.stack([Z, Z])[None], Z[None], so3.exp(angle * axis)[None]
    found = closed_curves(corners, reference, axis[None], np.eye(3)[None], last)
    assert abs(so3.wrap(found.turn[0] - angle)) < 8.0 * EPS
    assert -np.pi < found.turn[0] <= np.pi


@pytest.mark.parametrize("spread", [0.0, 0.3, 3.0])
def test_references_are_the_farthest(monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator, spread: float):
    """Of curves that are a point, that wind about one direction, and that are everywhere."""
    steps = np.cumsum(spread * rng.normal(size=(40, 30, 3)), axis=1)
    curves = so3.normalised(2.0 * rng.normal(size=(40, 1, 3)) + steps)
    arrays, kernels = both(monkeypatch, lambda: far_references(curves))
    np.testing.assert_array_equal(kernels, arrays)
    nearest = (curves @ sphere.fibonacci_directions(642).T).min(axis=1)
    chosen = np.einsum("bki,bi->bk", curves, kernels).min(axis=1)
    np.testing.assert_allclose(chosen, nearest.max(axis=1), rtol=0, atol=4.0 * EPS)
