"""The derivative of the holonomy by the path (theory.md B6): the curvature, carried along a loop.

The truth is differences of `holonomy` at 1e-13, and what the geometry says of variations that change nothing.
"""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from support.independent import BODIES, body_of
from support.long_runs import full_but

HARMONICS, DURATION = 2, 2.0
SIZES = {"satellite": 0.05}


class Family:
    """Fourier loops of a body, and their derivatives by every coefficient of some random directions."""

    def __init__(self, name: str, seed: int, directions: int = 3) -> None:
        self.body = body_of(name)
        rng, n = np.random.default_rng(seed), self.body.n_shape
        size = SIZES.get(name, 0.4)
        self.mean, self.cosines, self.sines = (
            size * rng.normal(size=s) for s in ((n,), (n, HARMONICS), (n, HARMONICS))
        )
        self.d_mean, self.d_cosines, self.d_sines = (
            size * rng.normal(size=(directions, *s)) for s in ((n,), (n, HARMONICS), (n, HARMONICS))
        )

    def path(self, direction: int = 0, step: float = 0.0) -> sp.ShapePath:
        return sp.ShapePath.fourier(
            self.mean + step * self.d_mean[direction],
            self.cosines + step * self.d_cosines[direction],
            self.sines + step * self.d_sines[direction],
            DURATION,
        )

    def variation(self, t: np.ndarray) -> np.ndarray:
        phase = 2.0 * np.pi / DURATION * t[:, None] * np.arange(1, HARMONICS + 1)
        waves = np.einsum("mnh,th->tmn", self.d_cosines, np.cos(phase))
        return self.d_mean + waves + np.einsum("mnh,th->tmn", self.d_sines, np.sin(phase))


@pytest.mark.parametrize("name", full_but([*BODIES, "example:panda"], "cat_two_halves", "satellite", "example:panda"))
def test_it_is_the_limit_of_differences(name: str):
    family = Family(name, seed=1)
    turned, derivative = sp.holonomy_derivative(family.body, family.path(), family.variation, 1e-12)
    np.testing.assert_allclose(turned, sp.holonomy(family.body, family.path(), 1e-13), atol=2e-12, rtol=0)
    for direction, exact in enumerate(derivative):
        slopes = []
        for step in (2e-3, 1e-3):
            ahead, behind = (sp.holonomy(family.body, family.path(direction, s), 1e-13) for s in (step, -step))
            slopes.append(so3.log(ahead @ behind.T) / (2.0 * step))
        np.testing.assert_allclose(
            (4.0 * slopes[1] - slopes[0]) / 3.0, exact, atol=1e-7 * np.abs(derivative).max(), rtol=0
        )


@pytest.mark.parametrize("name", ["cat", "cat_two_halves", "astronaut"])
def test_another_pace_changes_nothing(name: str):
    """rate f(t) with f zero at the ends is a path run through otherwise; the same f everywhere moves its start."""
    family = Family(name, seed=2)
    path = family.path()

    def pace(t: np.ndarray) -> np.ndarray:
        return (np.sin(2.0 * np.pi / DURATION * t)[:, None] * path.rate(t))[:, None]

    def later(t: np.ndarray) -> np.ndarray:
        return path.rate(t)[:, None]

    turned, derivative = sp.holonomy_derivative(family.body, path, pace, 1e-12)
    assert np.abs(derivative).max() < 1e-12
    # Begun a moment later, the base has turned by S on the way: S^-1 H S.
    _, derivative = sp.holonomy_derivative(family.body, path, later, 1e-12)
    rate = -sp.mechanical_connection(family.body, path.shape(0.0)) @ path.rate(0.0)
    np.testing.assert_allclose(derivative[0], turned @ rate - rate, atol=1e-11, rtol=0)


def test_pieces_and_their_breaks_are_followed():
    """A closed path of waypoints, varied by moving one of them: piecewise smooth, with corners of the variation."""
    body = body_of("cat_two_halves")
    rng = np.random.default_rng(5)
    points = 0.4 * rng.normal(size=(4, body.n_shape))
    points[-1] = points[0]
    moves = rng.normal(size=(2, body.n_shape))
    times = np.array([0.0, 0.7, 1.5, 2.0])

    def path(step: float, k: int) -> sp.ShapePath:
        moved = points.copy()
        moved[1] += step * moves[k]
        return sp.ShapePath.waypoints(times, moved)

    units = [np.where(np.arange(4)[:, None] == 1, move, 0.0) for move in moves]

    def variation(t: np.ndarray) -> np.ndarray:
        return np.stack([sp.ShapePath.waypoints(times, unit).shape(t) for unit in units], axis=1)

    _, derivative = sp.holonomy_derivative(body, path(0.0, 0), variation, 1e-12)
    for k, exact in enumerate(derivative):
        ahead, behind = (sp.holonomy(body, path(s, k), 1e-13) for s in (1e-4, -1e-4))
        np.testing.assert_allclose(
            so3.log(ahead @ behind.T) / 2e-4, exact, atol=1e-7 * np.abs(derivative).max(), rtol=0
        )


@pytest.mark.parametrize("name", ["cat", "satellite", "example:panda"])
def test_the_gradient_of_the_momentum_is_that_of_its_parts(name: str):
    body = body_of(name)
    rng = np.random.default_rng(3)
    shapes, rates = rng.normal(size=(2, 2, 4, body.n_shape))
    spins = rng.normal(size=(2, 4, 3))
    parts = np.einsum("...kij,...j->...ki", body.inertia_gradient(shapes), spins)
    parts = parts + np.einsum("...kij,...j->...ki", body.momentum_matrix_gradient(shapes), rates)
    gradient = body.angular_momentum_gradient(shapes, rates, spins)
    np.testing.assert_allclose(gradient, parts, atol=1e-12 * np.abs(parts).max(), rtol=0)


def test_rows_that_open_the_loop_or_have_another_shape_are_refused():
    family = Family("cat_two_halves", seed=4)
    body, path = family.body, family.path()

    def opening(t: np.ndarray) -> np.ndarray:
        return np.broadcast_to(t[:, None, None], (len(t), 1, body.n_shape))

    with pytest.raises(sp.errors.OpenPathError, match="variation"):
        sp.holonomy_derivative(body, path, opening)
    with pytest.raises(sp.errors.ShapeError, match="variation"):
        sp.holonomy_derivative(body, path, lambda t: np.zeros((len(t), body.n_shape)))
    with pytest.raises(sp.errors.ShapeError, match="finite"):
        sp.holonomy_derivative(body, path, lambda t: np.full((len(t), 1, body.n_shape), np.nan))
    open_path = sp.ShapePath.waypoints([0.0, 1.0], [np.zeros(body.n_shape), np.ones(body.n_shape)])
    with pytest.raises(sp.errors.OpenPathError, match="open"):
        sp.holonomy_derivative(body, open_path, family.variation)

    def jumping(t: np.ndarray) -> np.ndarray:
        return np.where((t > 0.3123) & (t < 1.7), 1.0, 0.0)[:, None, None] * np.ones((1, 1, body.n_shape))

    with pytest.raises(sp.errors.AccuracyNotReached, match="breaks"):
        sp.holonomy_derivative(body, path, jumping, 1e-9)
