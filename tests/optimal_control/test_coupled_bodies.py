"""Bodies whose joints follow others by curves, in symbols: their functions, derivatives, plans and extremals."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.body import Coupling
from shapephase.optimal_control import symbolic_body
from support.coupled_bodies import KNOTS, LEG, TURN, couplings

EPS = np.finfo(float).eps


@pytest.mark.parametrize("turn", TURN)
def test_functions_are_those_of_the_body(turn, load_urdf, rng):
    """At shapes between knots and beyond them; derivatives by Pinocchio's."""
    body = load_urdf(LEG).with_couplings(couplings(TURN[turn][0]))
    functions = symbolic_body(body)
    gradient = functions.derivative("inertia")
    for shape in [*rng.uniform(-1.0, 1.0, (6, 2)), np.array([0.2, KNOTS[2]])]:
        for name, expected in (
            ("inertia", body.locked_inertia(shape)),
            ("momentum_matrix", body.momentum_matrix(shape)),
            ("connection", sp.mechanical_connection(body, shape)),
        ):
            atol = 2000.0 * EPS * np.abs(expected).max()
            np.testing.assert_allclose(np.array(getattr(functions, name)(shape)), expected, rtol=0, atol=atol)
        expected = body.inertia_gradient(shape)
        found = np.array(gradient(shape)).reshape(3, 3, 2).transpose(2, 1, 0)
        np.testing.assert_allclose(found, expected, rtol=0, atol=4000.0 * EPS * np.abs(expected).max())
        rate = rng.normal(size=2)
        energy = body.kinetic_energy(shape, rate, -sp.mechanical_connection(body, shape) @ rate)
        found = 0.5 * rate @ np.array(functions.shape_metric(shape)) @ rate
        np.testing.assert_allclose(found, energy, rtol=4000.0 * EPS)


@pytest.fixture(scope="module")
def bent_cat():
    """Two halves whose roll follows the bend in front, and by a spline that to the side."""
    roll = Coupling.polynomial("waist_pitch", [0.0, 0.0, 1.2])
    return sp.load_body("cat_two_halves").with_couplings(
        {"waist_roll": roll + Coupling.spline("waist_yaw", [-1.0, -0.2, 0.3, 1.0], [-0.5, -0.1, 0.2, 0.3])}
    )


@pytest.mark.full
def test_a_plan_of_a_body_that_follows(bent_cat):
    """Reconstruction, which has its own couplings and knots, reaches what a loop is known to reach, for less."""
    loop = sp.ShapePath.fourier([0.3, 0.2], [[0.5], [0.0]], [[0.0], [0.5]], 4.0)
    goal = sp.holonomy(bent_cat, loop, 1e-12)
    search = sp.optimal_control.Search(pieces=16)
    plan = sp.plan_reorientation(
        bent_cat, goal, start=loop.shape(0.0), duration=4.0, rates_at_ends="periodic", search=search
    )
    end = sp.reconstruct(sp.articulated(bent_cat, plan.path), np.zeros(3), tolerance=1e-9).final_attitude
    assert sp.so3.angle(end.T @ goal) < 1e-8
    costs = [sp.optimal_control.path_cost(bent_cat, path) for path in (plan.path, loop)]
    assert costs[0] < costs[1]


def test_an_extremal_of_a_body_that_follows():
    """Its energy stays, and its residual in Wong's equations vanishes; by polynomials, which have all derivatives."""
    body = sp.load_body("cat_two_halves").with_couplings(
        {"waist_roll": Coupling.polynomial("waist_pitch", [0.0, 0.3, 1.2])}
    )
    found = sp.optimal_control.extremal(body, [0.3, 0.2], [0.5, -0.4], [0.001, 0.002, -0.001], 1.0)
    residual = sp.optimal_control.wong_residual(body, found.path).residual
    assert residual < 1e-6
