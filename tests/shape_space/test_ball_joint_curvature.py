"""Connection and curvature of ball joints, in coordinates and in rates that do not commute."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.errors import UnknownNameError
from support.ball_bodies import BALLS, THREE_HINGES, shapes_of_both

EPS = np.finfo(float).eps


@pytest.fixture
def both(load_urdf):
    return load_urdf(BALLS), load_urdf(THREE_HINGES)


def test_curvature_in_rates_is_that_of_three_hinges(both, rng):
    """A two-form seen in two frames: no derivative is common to both, the brackets of the rates are in one alone."""
    body, hinged = both
    shapes, angles, rates, slopes = shapes_of_both(hinged, rng, 20)
    expected = sp.curvature(hinged, angles)
    of_rates = sp.curvature(body, shapes, of="rates")
    assert of_rates.shape == (20, 7, 7, 3)
    seen = np.einsum("nai,nabk,nbj->nijk", rates, of_rates, rates)
    atol = 1e3 * EPS * np.abs(expected).max()
    np.testing.assert_allclose(seen, expected, rtol=0, atol=atol)
    seen = np.einsum("nai,nabk,nbj->nijk", slopes, sp.curvature(body, shapes), slopes)
    np.testing.assert_allclose(seen, expected, rtol=0, atol=atol)
    near = sp.mechanical_connection(body, shapes, of="rates") @ rates
    np.testing.assert_allclose(near, sp.mechanical_connection(hinged, angles), rtol=0, atol=1e-13)
    with pytest.raises(UnknownNameError, match="coordinates"):
        sp.curvature(body, shapes, of="angles")


LOCK = np.concatenate([Rotation.from_euler("XYZ", [0.3, 0.5 * np.pi, -0.7]).as_quat(), [0.2, -0.1, 0.3, 0.9], [0.4]])


def moved(shape, rates, step):
    """A shape after its joints have gone at rates for a while, by exponentials: (9,), (7,) -> (9,)."""
    found = shape.copy()
    for ball in range(2):
        turn = Rotation.from_quat(shape[4 * ball : 4 * ball + 4])
        further = turn * Rotation.from_rotvec(step * rates[3 * ball : 3 * ball + 3])
        found[4 * ball : 4 * ball + 4] = further.as_quat()
    found[8] += step * rates[6]
    return found


def test_curvature_in_rates_by_differences_and_brackets(both):
    """e_a(A_b) - e_b(A_a) - A([e_a, e_b]) - A_a x A_b at a quarter turn about y, where three hinges have no rates;
    derivatives along one-parameter groups, of order two. [e_x, e_y] = e_z of rates in axes of the child."""
    body, _ = both
    structure = np.zeros((7, 7, 7))
    for first in (0, 3):
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            structure[first + i, first + j, first + k], structure[first + j, first + i, first + k] = 1.0, -1.0
    exact = sp.curvature(body, LOCK, of="rates")
    columns = sp.mechanical_connection(body, LOCK, of="rates").T
    errors = []
    for step in (2e-2, 1e-2):
        ahead, behind = (
            [sp.mechanical_connection(body, moved(LOCK, unit, side * step), of="rates").T for unit in np.eye(7)]
            for side in (1.0, -1.0)
        )
        slopes = (np.array(ahead) - np.array(behind)) / (2.0 * step)
        found = slopes - np.swapaxes(slopes, 0, 1) - np.einsum("abc,ck->abk", structure, columns)
        found -= np.cross(columns[:, None], columns[None])
        errors.append(np.abs(found - exact).max())
    assert errors[1] < 2e-4 * np.abs(exact).max()
    assert 3.8 < errors[0] / errors[1] < 4.2
    # Without the brackets it is another two-form.
    assert np.abs(np.einsum("abc,ck->abk", structure, columns)).max() > 0.05 * np.abs(exact).max()


def test_the_holonomy_answers_to_the_loop(both):
    """Its derivative, an integral of the curvature, against differences of holonomies of order four."""
    body, _ = both
    mean = np.array([0.1, 0.6, -0.2, 0.8, 0.0, 0.3, 0.2, 0.9, 0.3])
    cosines, sines = np.random.default_rng(3).uniform(-0.3, 0.3, (2, 9, 1))
    change = np.random.default_rng(4).uniform(-0.3, 0.3, (9, 1))

    def loop(by):
        return sp.ShapePath.fourier(mean, cosines + by * change, sines, 1.0, joint_names=body.joint_names)

    turn, slope = sp.holonomy_derivative(
        body, loop(0.0), lambda t: (np.cos(2.0 * np.pi * t)[:, None] * change[:, 0])[:, None], 1e-10
    )
    steps = {by: so3.log(sp.holonomy(body, loop(by), 1e-12) @ turn.T) for by in (-0.02, -0.01, 0.01, 0.02)}
    expected = (8.0 * (steps[0.01] - steps[-0.01]) - (steps[0.02] - steps[-0.02])) / 0.12
    np.testing.assert_allclose(slope[0], expected, rtol=0, atol=1e-6)
