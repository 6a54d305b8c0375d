"""Derivatives in machine code: sums over a body's subtrees as without it, and attitudes within steps."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.body.inertial_regressor import by_link_parameters, link_motions
from shapephase.body.momentum_gradients import by_shape_and_rate
from shapephase.error_bars._along_motion import one_rotation, rotations
from shapephase.integrator.fast.gradients import inertial_sums, momentum_gradients
from support.bodies import random_loop, random_shapes

pytestmark = pytest.mark.usefixtures("fast")
EPS = np.finfo(float).eps


def test_sums_are_those_of_arrays(body, rng):
    """Numbers of shapes that do not fill lanes; what hangs on joints is summed in another order."""
    chain, count = body.chain, 11
    shapes, rates = random_shapes(body, rng, count), rng.normal(size=(count, body.n_shape))
    spins, rows = rng.normal(size=(count, 2, 3)), rng.normal(size=(count, 2, 4, 3))
    pieces, powers, slopes = (
        np.sort(rng.integers(0, 3, count)),
        rng.normal(size=(count, 4)),
        rng.normal(size=(count, 4)),
    )
    slopes[:, 0] = 0.0
    found = momentum_gradients(chain.rows, shapes, rates, spins, rows, pieces, powers, slopes, 3) @ chain.matrix
    links = link_motions(chain, shapes, rates)
    by_shape, by_rate = by_shape_and_rate(chain, links, shapes, rates, spins, rows)
    expected = np.zeros_like(found)
    for at, piece in enumerate(pieces):
        expected[:, piece] += powers[at, :, None, None] * by_shape[at] + slopes[at, :, None, None] * by_rate[at]
    np.testing.assert_allclose(found, expected, rtol=0, atol=2000 * EPS * np.abs(expected).max(initial=0.0))
    sums = chain.rows.in_chain_axes(inertial_sums(chain.rows, shapes, rates, spins, rows)).reshape(8, -1)
    expected = np.concatenate([by_link_parameters(links, rows[:, k], spins[:, k]) for k in range(2)])
    np.testing.assert_allclose(sums, expected, rtol=0, atol=2000 * EPS * np.abs(expected).max())


@pytest.mark.parametrize("momentum", [[0.0, 0.0, 0.0], [0.02, -0.01, 0.03]])
def test_attitudes_within_steps(momentum, rng):
    """The polynomials between the ends of steps are another way to them."""
    body = sp.load_body("cat")
    motion = sp.reconstruct(sp.articulated(body, random_loop(body, rng)), momentum, tolerance=1e-12)
    stepped = one_rotation(motion)
    times = np.sort(np.append(rng.uniform(0.0, motion.duration, 40), stepped.times[[0, 3, -1]]))
    np.testing.assert_allclose(rotations(stepped, times), stepped.rotation(times)[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(so3.angle(rotations(motion.horizontal_lift, times[:1])), 0.0, atol=1e-12)
