"""Frames of least perturbation: gauges like any other, in which one integral tells the turn of a loop best."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import OpenPathError, ShapeError


@pytest.fixture(scope="module")
def frames():
    return sp.minimum_perturbation(sp.load_body("cat_two_halves"), np.zeros(3), 0.5, 3)


LOOP = sp.ShapePath.fourier(
    np.zeros(3), [[0.4, 0.0], [0.0, 0.1], [0.1, 0.0]], [[0.0, 0.1], [0.4, 0.0], [0.0, -0.1]], 1.0
)


def test_it_is_a_gauge_of_the_deformation(frames):
    """The law of theory.md B4: internal momentum over inertia in the frame is its connection times the rate."""
    body = frames.body
    seen = sp.in_gauge(sp.articulated(body, LOOP), frames.along(LOOP))
    times = np.array([0.1, 0.37, 0.8])
    drift = np.linalg.solve(seen.inertia(times), seen.internal_momentum(times)[..., None])[..., 0]
    expected = sp.so3.apply(frames.connection(LOOP.shape(times)), LOOP.rate(times))
    np.testing.assert_allclose(drift, expected, rtol=0, atol=2e-14)
    momentum = [0.01, 0.02, 0.03]
    plain = sp.reconstruct(sp.articulated(body, LOOP), momentum)
    # The same motion: the frame's attitude times the frame is the base's.
    start = frames.frame(LOOP.shape(0.0))
    turned = sp.reconstruct(seen, momentum, attitude=start.T)
    np.testing.assert_allclose(
        turned.attitude(times) @ frames.frame(LOOP.shape(times)), plain.attitude(times), rtol=0, atol=3e-9
    )


def test_it_has_no_divergence_at_the_best_frame(frames):
    """Small turns psi(r) of the frame do not make the connection smaller: first the slope vanishes, then it grows."""
    body = frames.body
    nodes, weights = np.polynomial.legendre.leggauss(8)
    shapes = 0.5 * np.stack(np.meshgrid(nodes, nodes, nodes), axis=-1).reshape(-1, 3)
    share = np.einsum("i,j,k->ijk", weights, weights, weights).ravel() / 8.0
    seen = frames.connection(shapes)
    base = sp.mechanical_connection(body, shapes)
    # Joints count by the width of the region.
    means = [0.25 * share @ np.sum(one**2, axis=(1, 2)) for one in (seen, base)]
    np.testing.assert_allclose(frames.mean_square, means, rtol=0.05)
    assert means[0] < 0.2 * means[1]
    x = shapes / 0.5
    for axis in np.eye(3):
        for powers in np.array([[1, 0, 0], [0, 1, 1], [2, 1, 0]]):
            raised, lowered = x**powers, powers * x ** np.maximum(powers - 1, 0) / 0.5
            slopes = np.stack([lowered[:, j] * np.delete(raised, j, axis=1).prod(axis=1) for j in range(3)], axis=1)
            change = slopes[:, None] * axis[:, None] + raised.prod(axis=1)[:, None, None] * (sp.so3.hat(axis) @ seen)
            size = np.sqrt((share @ np.sum(change**2, axis=(1, 2))) * (share @ np.sum(seen**2, axis=(1, 2))))
            # The points of the region are others than those of the fit.
            assert abs(share @ np.sum(seen * change, axis=(1, 2))) < 0.03 * size


def test_one_integral_tells_the_turn_of_a_loop_better_than_in_the_base_or_the_mean_body(frames):
    body = frames.body
    turn = sp.holonomy(body, LOOP, 1e-11)

    def off(gauge):
        """In a gauge that closes with the shape, the integral alone, seen from the base at the start."""
        times = np.arange(400) / 400
        seen = sp.deformation.named_gauge(sp.articulated(body, LOOP), gauge)
        drift = np.linalg.solve(seen.inertia(times), seen.internal_momentum(times)[..., None])[..., 0]
        start = seen.frame(0.0)
        return sp.so3.angle((start.T @ sp.so3.exp(-drift.mean(axis=0)) @ start).T @ turn)

    best = sp.so3.angle(frames.first_order_turn(LOOP).T @ turn)
    assert best < 0.02 * sp.so3.angle(turn)
    assert best < 0.2 * off("base")
    assert best < off("mean_body")


def test_wrong_regions_and_open_paths_are_refused(frames):
    body = frames.body
    for centre, width, degree in (([0.0], 0.5, 3), (np.zeros(3), -1.0, 3), (np.zeros(3), [0.1, 0.2], 3),
                                  (np.zeros(3), 0.5, 7), (np.zeros(3), 0.5, 0)):  # fmt: skip
        with pytest.raises(ShapeError):
            sp.minimum_perturbation(body, centre, width, degree)
    with pytest.raises(OpenPathError):
        frames.first_order_turn(sp.ShapePath.waypoints([0.0, 1.0], [np.zeros(3), 0.1 * np.ones(3)]))
