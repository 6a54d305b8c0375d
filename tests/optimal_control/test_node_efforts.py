"""Efforts at a place of a plan against Pinocchio's, and their derivatives, made link by link, against CasADi's."""

from __future__ import annotations

import casadi
import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.body.inverse_dynamics import falling_efforts
from shapephase.optimal_control import Limits
from shapephase.optimal_control._spline_basis import SplineBasis
from shapephase.optimal_control.collocation import CollocationProgram
from shapephase.optimal_control.nodes.inverse_dynamics import _MovingTree, inverse_dynamics
from shapephase.optimal_control.nodes.node_efforts import node_efforts
from shapephase.optimal_control.task import reorientation
from support.random_chains import random_chain

EPS = np.finfo(float).eps
MU = (0.3, -0.2, 0.5)
# Slides, joints without end, followers, branches.
SEEDS = [seed if seed < 3 else pytest.param(seed, marks=pytest.mark.full) for seed in range(20)]


@pytest.fixture(scope="module")
def load(tmp_path_factory):
    def loaded(seed: int) -> sp.Body:
        file = tmp_path_factory.mktemp("chain") / "body.urdf"
        file.write_text(random_chain(seed).urdf)
        return sp.load_body(file)

    return loaded


@pytest.mark.parametrize("seed", SEEDS)
def test_derivatives_are_those_of_the_whole_expression(seed: int, load, rng):
    """First and second ones of all efforts by places, rates, accelerations and momentum, by CasADi alone."""
    chain = load(seed).chain
    count = len(chain.parents)
    x, factors = casadi.SX.sym("x", 3 * count + 3), casadi.SX.sym("factors", count)
    efforts = _MovingTree(chain, x).efforts
    second, _ = casadi.hessian(casadi.dot(factors, efforts), x)
    plain = casadi.Function("plain", [x, factors], [efforts, casadi.jacobian(efforts, x), second])
    dynamics = inverse_dynamics(chain)
    at, weights = rng.uniform(-0.9, 0.9, 3 * count + 3), rng.normal(size=count)
    found = (dynamics.efforts(at), dynamics.slopes(at), dynamics.second(at, weights))
    for seen, value in zip(found, plain(at, weights), strict=True):
        expected = np.array(value)
        # Sums of some hundred terms, which the inverse of the base's inertia makes larger.
        np.testing.assert_allclose(np.array(seen), expected, rtol=0, atol=1e5 * EPS * max(np.abs(expected).max(), 1.0))


@pytest.mark.parametrize("momentum", [0.0, MU])
@pytest.mark.parametrize("seed", SEEDS)
def test_shares_are_the_efforts_of_newton_and_euler(seed: int, momentum, load, rng):
    """By Pinocchio's steps from link to link, at the spin of the base that the momentum gives it."""
    body = load(seed)
    measure = rng.uniform(0.5, 2.0, body.n_shape)
    task = reorientation(
        body,
        np.eye(3),
        momentum=momentum,
        duration=1.3,
        limits=Limits(joint_limits=False, rate_limits=None, effort_limits=measure),
    )
    attitude, shape = so3.exp(rng.normal(size=3)), rng.uniform(-0.9, 0.9, body.n_shape)
    rate, bend = rng.normal(size=(2, body.n_shape))
    y = np.concatenate([shape, 1.3 * rate, 1.3**2 * bend, so3.quat_from_matrix(attitude), [1.3]])
    found = np.array(node_efforts(task).shares(y))[:, 0]
    # The base turns as momentum is conserved; its acceleration is that of the spin a little before and after.
    carried = attitude.T @ np.broadcast_to(momentum, 3)

    def spin(t: float) -> np.ndarray:
        turned = so3.exp(-t * spin_now) @ carried if t else carried
        here = shape + t * rate + 0.5 * t**2 * bend
        return np.linalg.solve(body.locked_inertia(here), turned - body.momentum_matrix(here) @ (rate + t * bend))

    spin_now = spin(0.0)
    step = 1e-4
    slope = (8.0 * (spin(step) - spin(-step)) - (spin(2.0 * step) - spin(-2.0 * step))) / (12.0 * step)
    expected, wrench = falling_efforts(body, shape[None], rate[None], bend[None], spin_now[None], slope[None])
    assert np.abs(wrench).max() < 1e-8 * np.abs(expected).max(), "the oracle's base is free"
    np.testing.assert_allclose(found * measure, expected[0], rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize("cost", ["effort", "time"])
def test_a_program_has_the_derivatives_of_its_rows(cost: str, rng):
    """Limits of accelerations, jerks and efforts, the duration free, against CasADi's own differentiation."""
    limits = Limits(rate_limits=10.0, acceleration_limits=[40.0, 50.0, 60.0], jerk_limits=900.0, effort_limits=0.2)
    task = reorientation(
        sp.load_body("cat_two_halves"), so3.exp(np.array([0.5, 0.0, 0.0])), momentum=(0.01, 0.02, -0.01), cost=cost,
        limits=limits, duration=1.3,
    )  # fmt: skip
    program = CollocationProgram(task, SplineBasis(6))
    unknown, rows, objective = (program.program[key] for key in "xgf")
    factor, multipliers = casadi.MX.sym("factor"), casadi.MX.sym("multipliers", rows.shape[0])
    gradient = casadi.gradient(factor * objective + casadi.dot(multipliers, rows), unknown)
    plain = casadi.Function("plain", [unknown, factor, multipliers], [rows, casadi.jacobian(rows, unknown), gradient])
    at, weights = rng.normal(size=unknown.shape[0]), rng.normal(size=rows.shape[0])
    at[task.dimension * 7] = 1.3
    expected = np.array(plain(at, 0.7, weights)[1])
    _, found = program.derivatives["jac_g"](at, [])
    np.testing.assert_allclose(np.array(found), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    upper = np.array(program.derivatives["hess_lag"](at, [], 0.7, weights))
    hessian = np.triu(upper) + np.triu(upper, 1).T
    way, step = rng.normal(size=len(at)), 1e-6
    ahead, behind = (np.array(plain(at + sign * step * way, 0.7, weights)[2])[:, 0] for sign in (1.0, -1.0))
    along = (ahead - behind) / (2.0 * step)
    np.testing.assert_allclose(hessian @ way, along, rtol=0, atol=1e-7 * np.abs(along).max())
