"""The reconstruction against other people's engines: Pinocchio's ccrba in solve_ivp, and MuJoCo.

The full dynamics as a check (theory.md U10), about the centre of mass whatever the base (theory.md U3, U9), for joint
trajectories from anywhere (theory.md U7, A7).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import shapephase as sp
from support.independent import (
    BODIES,
    EVERY_BODY,
    MujocoBody,
    apart,
    body_of,
    mujoco_motion,
    pinocchio_motion,
    random_loop,
    random_rotation,
    random_vector,
)
from support.long_runs import full_but

TIMES = np.linspace(0.0, 2.0, 41)


@pytest.mark.parametrize(
    ("name", "seed"), full_but(product(BODIES, [1, 2]), ("example:human", 2), ("cat_two_halves", 2), ("satellite", 2))
)
def test_attitude_is_that_of_ccrba_in_solve_ivp(name: str, seed: int):
    body, loop = body_of(name), random_loop(seed, body_of(name).n_shape)
    momentum, attitude = random_vector(seed, BODIES[name]), random_rotation(seed)
    truth = pinocchio_motion(name, body.joint_names, loop, momentum, attitude, TIMES)
    motion = sp.reconstruct(sp.articulated(body, loop.path), momentum, attitude)
    assert apart(motion.attitude(TIMES), truth.attitude) < 1e-9
    # With a tolerance of its own the agreement is that of the two integrators' rounding.
    sharp = sp.reconstruct(sp.articulated(body, loop.path), momentum, attitude, tolerance=1e-10)
    assert apart(sharp.attitude(TIMES), truth.attitude) < 2e-11


def test_the_human_with_momentum_8():
    name = "example:human"
    body, loop = body_of(name), random_loop(8, 36)
    assert body.n_shape == 36
    momentum = random_vector(8, 8.0)
    motion = sp.reconstruct(sp.articulated(body, loop.path), momentum)
    assert apart(motion.attitude(TIMES), pinocchio_motion(name, body.joint_names, loop, momentum).attitude) < 1e-9
    assert apart(motion.attitude(TIMES), mujoco_motion(name, body.joint_names, loop, momentum).attitude) < 1e-8


@pytest.mark.parametrize(
    "name", full_but(["satellite", "cat", "astronaut", "cat_two_halves", "diver"], "satellite", "cat_two_halves")
)
def test_mujoco_dynamics_turn_the_same_way(name: str):
    """U10: no conservation law on MuJoCo's side, only forces; the momentum enters by the initial velocity alone."""
    body, loop = body_of(name), random_loop(3, body_of(name).n_shape)
    momentum, attitude = random_vector(3, BODIES[name]), random_rotation(3)
    truth = mujoco_motion(name, body.joint_names, loop, momentum, attitude, TIMES)
    deformation = sp.articulated(body, loop.path)
    motion = sp.reconstruct(deformation, momentum, attitude)
    assert apart(motion.attitude(TIMES), truth.attitude) < 1e-8
    np.testing.assert_allclose(motion.base_position(TIMES), truth.position, rtol=0, atol=1e-8)
    fastest = np.abs(truth.angular_velocity).max()
    np.testing.assert_allclose(motion.angular_velocity(TIMES), truth.angular_velocity, rtol=0, atol=1e-8 * fastest)
    again = sp.momentum_from_rate(deformation, truth.angular_velocity[0], attitude)
    np.testing.assert_allclose(again, momentum, rtol=0, atol=1e-10 * BODIES[name])


def test_prismatic_and_continuous_joints_in_mujoco():
    """The satellite's boom slides, and its wheel turns five times: a loop, as a continuous joint is one angle."""
    body = body_of("satellite")
    boom, wheel = body.joint_index("boom_extension"), body.joint_index("wheel_spin")
    assert body.continuous[wheel]
    assert not body.continuous[boom]
    loop = random_loop(5, body.n_shape)
    slide = loop.sines.copy()
    slide[boom] = 0.0, 0.4, 0.1
    spin = np.zeros(body.n_shape)
    spin[wheel] = 5 * 2.0 * np.pi / loop.duration
    loop = replace(loop, sines=slide, spin=spin)
    momentum, attitude = random_vector(5, 12.0), random_rotation(5)
    deformation = sp.articulated(body, loop.path)
    np.testing.assert_array_equal(deformation.closure, np.eye(3))
    motion = sp.reconstruct(deformation, momentum, attitude)
    truth = mujoco_motion("satellite", body.joint_names, loop, momentum, attitude, TIMES)
    assert apart(motion.attitude(TIMES), truth.attitude) < 1e-8
    still = sp.reconstruct(sp.articulated(body, replace(loop, sines=0.0 * slide).path), momentum, attitude)
    assert apart(still.attitude(TIMES), truth.attitude) > 1e-2, "the sliding boom must matter"


@pytest.mark.parametrize("name", EVERY_BODY)
def test_momentum_is_the_one_that_mujoco_sums_over_the_links(name: str):
    """A7, U3, U9: about the centre of mass; the base may move at any velocity and sit anywhere."""
    body, simulated = body_of(name), MujocoBody(name, body_of(name).joint_names)
    loop = random_loop(7, body.n_shape)
    deformation = sp.articulated(body, loop.path)
    for seed in range(4):
        attitude, omega = random_rotation(seed), random_vector(seed, 1.5)
        simulated.place(random_vector(seed + 10, 3.0), attitude, loop.shape(0.0))
        simulated.move(random_vector(seed + 20, 4.0), omega, loop.rate(0.0))
        momentum = sp.momentum_from_rate(deformation, omega, attitude)
        size = np.linalg.norm(momentum)
        np.testing.assert_allclose(simulated.momentum_about_centre(), momentum, rtol=0, atol=1e-10 * size)


@pytest.mark.parametrize("name", ["satellite", "cat", "example:human"])
def test_base_position_keeps_the_centre_of_mass_at_rest_or_falling(name: str):
    body, simulated = body_of(name), MujocoBody(name, body_of(name).joint_names)
    loop = random_loop(9, body.n_shape)
    motion = sp.reconstruct(sp.articulated(body, loop.path), random_vector(9, BODIES[name]), random_rotation(9))
    times = np.array([0.0, 0.31, 1.27, 2.0])
    start, velocity, gravity = np.array([0.5, -0.2, 10.0]), np.array([1.0, 0.3, 2.0]), np.array([0.0, 0.0, -9.81])
    resting = motion.base_position(times)
    falling = motion.base_position(times, start=start, velocity=velocity, gravity=gravity)
    for row, t in enumerate(times):
        simulated.place(resting[row], motion.attitude(t), loop.shape(t))
        np.testing.assert_allclose(simulated.centre_of_mass(), np.zeros(3), rtol=0, atol=1e-11)
        simulated.place(falling[row], motion.attitude(t), loop.shape(t))
        wanted = start + velocity * t + 0.5 * gravity * t**2
        np.testing.assert_allclose(simulated.centre_of_mass(), wanted, rtol=0, atol=1e-11)


def test_a_spline_through_twelve_knots_is_that_of_solve_ivp():
    """U7: sampled joint angles. The oracle restarts at the knots."""
    name, random = "cat", np.random.default_rng(12)
    body = body_of(name)
    times = np.array([0.0, 0.1, 0.35, 0.5, 0.62, 0.9, 1.0, 1.15, 1.4, 1.55, 1.8, 2.0])
    path = sp.ShapePath.spline(times, random.uniform(-0.5, 0.5, (12, body.n_shape)))
    momentum, attitude = random_vector(12, 0.05), random_rotation(12)
    motion = sp.reconstruct(sp.articulated(body, path), momentum, attitude)
    truth = pinocchio_motion(name, body.joint_names, path, momentum, attitude, TIMES, breaks=times[1:-1])
    assert apart(motion.attitude(TIMES), truth.attitude) < 1e-9
