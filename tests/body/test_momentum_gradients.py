"""How the angular momentum answers to shape and rates: sums over subtrees, against Pinocchio's derivatives."""

from __future__ import annotations

import numpy as np

from shapephase.body.inertial_regressor import link_motions
from shapephase.body.momentum_gradients import by_shape_and_rate
from support.bodies import random_shapes

EPS = np.finfo(float).eps


def test_by_shape_and_rate(body, rng):
    """Joints that turn, slide, screw and follow others."""
    count, n = 7, body.n_shape
    shapes, rates = random_shapes(body, rng, count), rng.normal(size=(count, n))
    spins, rows = rng.normal(size=(count, 2, 3)), rng.normal(size=(count, 2, 4, 3))
    links = link_motions(body.chain, shapes, rates)
    by_shape, by_rate = by_shape_and_rate(body.chain, links, shapes, rates, spins, rows)
    gradients = [body.angular_momentum_gradient(shapes, rates, spins[:, k]) for k in range(2)]
    expected = np.concatenate([rows[:, k] @ np.swapaxes(gradients[k], 1, 2) for k in range(2)], axis=1)
    # Some hundred terms are rounded.
    np.testing.assert_allclose(by_shape, expected, rtol=0, atol=500 * EPS * np.abs(expected).max(initial=0.0))
    expected = rows.reshape(count, 8, 3) @ body.momentum_matrix(shapes)
    np.testing.assert_allclose(by_rate, expected, rtol=0, atol=500 * EPS * np.abs(expected).max(initial=0.0))
