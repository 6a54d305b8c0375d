"""Optimal turns of bodies with many joints: their extremals, and a somersault with a twist by the arms alone."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

import shapephase as sp
from shapephase import so3
from shapephase.errors import AccuracyNotReached
from shapephase.optimal_control import (
    Goal,
    Limits,
    Search,
    conjugate_times,
    path_cost,
    plan_reorientation,
    shoot,
    wong_residual,
)
from shapephase.optimal_control.extremals.hamiltonian import integrated
from support.independent import apart, mujoco_motion, pinocchio_motion

X, Y, Z = np.eye(3)
FREE = {"rates_at_ends": "free"}
SKEW = so3.exp(np.array([0.9, 0.5, -0.3]))
# Body, turn [rad], cost, other arguments; a plan on a limit is no extremal.
NO_LIMITS = Limits(joint_limits=False, rate_limits=None)
LARGE = {
    "cat rate": ("cat", np.radians(60.0) * X, "rate", {"limits": NO_LIMITS}),
    "cat kinetic": ("cat", np.radians(8.0) * X, "kinetic", {"limits": NO_LIMITS}),
    "satellite": ("satellite", np.radians(5.0) * Y, "rate", {"limits": NO_LIMITS}),
    "astronaut": ("astronaut", np.radians(60.0) * Z, "rate", {"limits": NO_LIMITS}),
    "human": ("example:human", np.radians(60.0) * X, "rate", {"limits": NO_LIMITS}),
}


@pytest.fixture(scope="module")
def two_halves():
    return sp.load_body("cat_two_halves")


@pytest.fixture(scope="module")
def skew(two_halves):
    """The plan of a skew turn on a few pieces, and its extremal."""
    plan = plan_reorientation(two_halves, SKEW, search=Search(pieces=12), **FREE)
    return plan, shoot(two_halves, plan.path, SKEW)


def within_limits(body, path):
    shapes = path.shape(np.linspace(0.0, path.duration, 401))
    lower, upper = body.joint_limits.T
    return bool(np.all((shapes > lower) & (shapes < upper)))


def wave(rng, joints, duration=1.0):
    """A smooth motion that starts and ends at zero, and its rate."""
    frequencies = np.pi / duration * np.arange(1, 5)
    sines = rng.normal(size=(4, joints)) / np.arange(1, 5)[:, None]
    return lambda t: (
        np.sin(np.outer(t, frequencies)) @ sines,
        (np.cos(np.outer(t, frequencies)) * frequencies) @ sines,
    )


def varied(motion, wave, size):
    def curve(times):
        change, rate = wave(times)
        return motion.path.shape(times) + size * change, motion.path.rate(times) + size * rate

    return sp.ShapePath.function(curve, motion.duration, breaks=np.linspace(0.0, motion.duration, 17)[1:-1])


def slopes(motion, target, wave, cost, size=3e-4):
    """First and second derivative along a variation of the cost and of the turn (inertial axes), by differences."""
    values = []
    for step in (-size, 0.0, size):
        path = varied(motion, wave, step)
        turn = so3.log(sp.holonomy(motion.body, path, 1e-12) @ target.T)
        values.append([path_cost(motion.body, path, cost), *turn])
    before, here, after = np.array(values)
    return (after - before) / (2.0 * size), (after - 2.0 * here + before) / size**2


def check_multipliers(motion, target, cost, rng):
    """The charge is what the turn costs: along any variation the cost changes by the charge times the turn's change.

    Of the variations that keep the turn to first order each is dearer by the second variation.
    """
    n = motion.body.n_shape
    waves = [wave(rng, n, motion.duration) for _ in range(4)]
    firsts = np.array([slopes(motion, target, one, cost)[0] for one in waves])
    size = np.linalg.norm(motion.charge) * np.abs(firsts[:, 1:]).max()
    assert_allclose(firsts[:, 0], firsts[:, 1:] @ motion.charge, rtol=0, atol=1e-6 * size)
    mix = np.linalg.svd(firsts[:, 1:].T)[2][-1]

    def kept(times):
        parts = [one(times) for one in waves]
        return sum(m * part[0] for m, part in zip(mix, parts, strict=True)), sum(
            m * part[1] for m, part in zip(mix, parts, strict=True)
        )

    _, second = slopes(motion, target, kept, cost)
    assert second[0] - second[1:] @ motion.charge > 0.0


@pytest.mark.full
def test_the_charge_is_the_price_of_the_turn(two_halves, skew, rng):
    plan, motion = skew
    assert within_limits(two_halves, plan.path)
    check_multipliers(motion, SKEW, "kinetic", rng)


@pytest.mark.full
def test_from_a_coarse_plan_to_its_extremal(two_halves, skew):
    plan, motion = skew
    truth = pinocchio_motion("cat_two_halves", two_halves.joint_names, motion.path, np.zeros(3))
    assert apart(truth.attitude[-1], SKEW) < 1e-9
    assert np.abs(motion.shape([0.0, 1.0])).max() < 1e-9
    assert wong_residual(two_halves, plan.path).residual > 1e-2
    assert wong_residual(two_halves, motion.path).residual < 1e-8
    assert 1e-4 < plan.cost / motion.cost - 1.0 < 1e-2
    assert motion.cost == pytest.approx(path_cost(two_halves, motion.path), rel=1e-9)


@pytest.mark.full
@pytest.mark.parametrize("seed", [1, 3])
def test_back_from_a_path_beside_it(two_halves, skew, seed):
    """The path runs beside the extremal by a wave, its rate by a good part of itself."""
    _, motion = skew
    beside = varied(motion, wave(np.random.default_rng(seed), 3), 0.05)
    assert wong_residual(two_halves, beside).residual > 0.05
    found = shoot(two_halves, beside, SKEW)
    times = np.linspace(0.0, 1.0, 9)
    assert np.abs(found.shape(times) - motion.shape(times)).max() < 1e-7


@pytest.mark.full
def test_a_field_that_overflows_is_reported_without_a_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(AccuracyNotReached, match="extremal"):
            integrated(lambda y: y**3 * 1e200, 1.0, np.array([1e30, 1e60]), 1e-9, np.ones(2), 5000)


@pytest.mark.full
@pytest.mark.parametrize("case", LARGE)
def test_extremals_of_many_joints(case, rng):
    """From 20 pieces to the extremal; what the spline costs more falls as the sixth power of its pieces, or faster."""
    name, turn, cost, options = LARGE[case]
    body, target = sp.load_body(name), so3.exp(turn)
    plans = [
        plan_reorientation(body, target, cost=cost, search=Search(pieces=pieces), **FREE, **options)
        for pieces in (20, 40)
    ]
    motion = shoot(body, plans[0].path, target, metric=cost)
    truth = pinocchio_motion(name, body.joint_names, motion.path, np.zeros(3))
    assert apart(truth.attitude[-1], target) < 1e-8
    assert np.abs(motion.shape(1.0) - plans[0].path.shape(0.0)).max() < 1e-9
    assert wong_residual(body, motion.path, metric=cost).residual < 1e-8
    assert motion.cost == pytest.approx(path_cost(body, motion.path, cost), rel=1e-9)
    coarse, fine = (plan.cost / motion.cost - 1.0 for plan in plans)
    assert 0.0 < fine < 1e-6
    assert 40.0 < coarse / fine < 200.0
    residuals = [wong_residual(body, plan.path, metric=cost).residual for plan in plans]
    assert 6.0 < residuals[0] / residuals[1] < 20.0, "the rate of a cubic spline is off by the third power"
    assert all(one.time > 1.0 for one in conjugate_times(motion))
    check_multipliers(motion, target, cost, rng)


@pytest.mark.full
def test_more_pieces_obey_wongs_equations_to_the_fourth_digit():
    body = sp.load_body("cat")
    search = Search(pieces=80)
    plan = plan_reorientation(
        body,
        so3.exp(np.radians(60.0) * X),
        cost="rate",
        limits=NO_LIMITS,
        search=search,
        **FREE,
    )
    assert wong_residual(body, plan.path, metric="rate").residual < 1e-4


@pytest.mark.full
def test_an_extremal_of_light_joints_that_whirl():
    """In the kinetic metric the astronaut's shoulders and ankles go far for little: whole steps lead astray."""
    body, target = sp.load_body("astronaut"), so3.exp(np.radians(5.0) * Y)
    plan = plan_reorientation(body, target, limits=NO_LIMITS, search=Search(pieces=20), **FREE)
    motion = shoot(body, plan.path, target)
    truth = pinocchio_motion("astronaut", body.joint_names, motion.path, np.zeros(3))
    assert apart(truth.attitude[-1], target) < 1e-8
    assert wong_residual(body, motion.path).residual < 1e-8
    assert 0.0 < plan.cost / motion.cost - 1.0 < 1e-4


class _AsSplined:
    """A plan's path as MuJoCo's integration needs it: one time after another, with accelerations."""

    def __init__(self, path):
        self.duration = path.duration
        self._spline = CubicSpline(path.breaks, path.shape(path.breaks))

    def shape(self, t):
        return self._spline(min(t, self.duration))

    def rate(self, t):
        return self._spline(min(t, self.duration), 1)

    def acceleration(self, t):
        return self._spline(min(t, self.duration), 2)


def check_somersault_with_twist(name, plan, momentum):
    """MuJoCo turns the body just so; the windings are counted by hand from its attitudes."""
    times = np.linspace(0.0, plan.path.duration, 401)
    splined = _AsSplined(plan.path)
    assert np.abs(splined.shape(0.987) - plan.path.shape(0.987)).max() < 1e-12
    truth = mujoco_motion(name, plan.body.joint_names, splined, momentum, None, times).attitude
    assert apart(truth, plan.motion.attitude(times)) < 1e-6
    assert apart(truth[-1], np.eye(3)) < 1e-6
    # The long axis goes once round the momentum, and the side once round the long axis.
    nose, side = truth[:, :, 2], truth[:, :, 1]
    around = np.unwrap(np.arctan2(nose[:, 0], nose[:, 2]))
    assert around[-1] - around[0] == pytest.approx(2.0 * np.pi, abs=1e-5)
    level = so3.normalised(np.cross(Y, nose))
    turned = np.unwrap(np.arctan2(np.sum(-side * level, axis=1), np.sum(side * np.cross(nose, level), axis=1)))
    assert abs(turned[-1] - turned[0]) == pytest.approx(2.0 * np.pi, abs=1e-5)


@pytest.mark.full
def test_the_astronaut_twists_in_a_somersault():
    """Upright, both arms up; nothing moves but the shoulders, within their limits."""
    body = sp.load_body("astronaut")
    joints = [f"{side}_shoulder_{way}" for side in ("left", "right") for way in ("flexion", "abduction", "rotation")]
    start = body.shape({"left_shoulder_abduction": 3.0, "right_shoulder_abduction": -3.0})
    momentum, duration = [0.0, 57.5, 0.0], 2.0
    plan = plan_reorientation(
        body,
        Goal(somersaults=1, half_twists=2),
        momentum=momentum,
        duration=duration,
        start=start,
        end="free",
        joints=joints,
        cost="rate",
        limits=Limits(rate_limits=None),
        search=Search(pieces=20),
    )
    assert plan.goal_error < 1e-8
    assert plan.starts[0].converged
    times = np.linspace(0.0, duration, 401)
    shapes = plan.path.shape(times)
    lower, upper = body.joint_limits.T
    assert max(np.max(lower - shapes), np.max(shapes - upper)) < 1e-12
    held = np.array([name not in joints for name in body.joint_names])
    assert np.array_equal(shapes[:, held], np.broadcast_to(start[held], (401, held.sum())))
    check_somersault_with_twist("astronaut", plan, momentum)


@pytest.mark.full
def test_the_diver_twists_in_a_somersault():
    """The diver leaves upright, arms down, and moves nothing but them."""
    momentum = [0.0, 37.6, 0.0]
    plan = plan_reorientation(
        sp.load_body("diver"),
        Goal(somersaults=1, half_twists=2),
        momentum=momentum,
        duration=1.5,
        end="free",
        cost="rate",
        search=Search(pieces=20),
    )
    assert plan.goal_error < 1e-8
    check_somersault_with_twist("diver", plan, momentum)
