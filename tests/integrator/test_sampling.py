"""How the deformation is sampled: kinks, bursts, knots, fast wheels; and whether error estimates are honest.

The truth is `pinocchio_motion`, a run with the kinks declared, or a closed form.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from functools import lru_cache
from itertools import product

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import AccuracyNotReached, UndeclaredBreakWarning
from support.independent import (
    BODIES,
    apart,
    body_of,
    cross,
    pinocchio_motion,
    random_loop,
    random_rotation,
    random_vector,
    turn,
)
from support.long_runs import full_but

# The joints go where no limits are looked at.
pytestmark = pytest.mark.filterwarnings("ignore:joint .* far beyond its limits")
TIMES = np.linspace(0.0, 2.0, 101)
AMPLITUDE = np.array([0.8, -0.5, 0.6])
Curve = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


# ---- Error estimates -----------------------------------------------------------------------------------------------


def hard_cases(seeds: range):
    """Random paths of many swings and sizes for each small body: (name, seed, kind)."""
    names = [name for name in BODIES if name not in ("example:human", "astronaut")]
    return [(name, seed, kind) for name in names for seed in seeds for kind in ("fourier", "spline", "waypoints")]


def hard_path(joints: int, seed: int, kind: str) -> sp.ShapePath:
    random = np.random.default_rng(seed)
    if kind == "fourier":
        size, harmonics = float(random.choice([0.2, 0.5, 1.0, 2.0])), int(random.integers(1, 9))
        return random_loop(seed, joints, size=size, harmonics=harmonics).path
    size = float(random.choice([0.2, 0.6, 1.5]))
    if kind == "waypoints":
        return sp.ShapePath.waypoints([0.0, 0.5, 0.8, 2.0], size * random.uniform(-1.0, 1.0, (4, joints)))
    times = np.linspace(0.0, 2.0, 12)
    times[1:-1] += random.uniform(-0.05, 0.05, 10)
    return sp.ShapePath.spline(times, size * random.uniform(-1.0, 1.0, (12, joints)))


@lru_cache(maxsize=200)
def hard_truth(name: str, seed: int, kind: str) -> sp.Motion:
    """To 1e-10, or to 1e-9 where that is refused; test_simulators compares such runs with other engines."""
    deformation = sp.articulated(body_of(name), hard_path(body_of(name).n_shape, seed, kind))
    momentum = random_vector(seed, (0.0, 0.3, 1.0, 3.0)[seed % 4] * BODIES[name])
    try:
        return sp.reconstruct(deformation, momentum, tolerance=1e-10)
    except AccuracyNotReached:
        return sp.reconstruct(deformation, momentum, tolerance=1e-9)


@pytest.mark.parametrize(
    ("tolerance", "seeds"),
    full_but(product([1e-4, 1e-5, 1e-6, 1e-7, 1e-9], [range(2), range(2, 8)]), (1e-5, range(2)), (1e-9, range(2))),
)
def test_true_errors_are_within_the_estimates(tolerance: float, seeds: range):
    """At times between the steps."""
    broken = []
    for name, seed, kind in hard_cases(seeds):
        times = np.random.default_rng(seed).uniform(0.0, 2.0, 60)
        truth = hard_truth(name, seed, kind)
        motion = sp.reconstruct(truth.deformation, truth.momentum, tolerance=tolerance)
        error = apart(motion.attitude(times), truth.attitude(times))
        assert motion.error_estimate <= tolerance
        if error > motion.error_estimate + truth.error_estimate:
            broken.append((name, seed, kind, error, float(motion.error_estimate)))
    assert not broken


@pytest.mark.parametrize("seeds", full_but([range(6), range(6, 24)], range(6)))
def test_a_loose_tolerance_is_reached_where_a_tight_one_is(seeds: range):
    """Fast slender divers: the attitude turns by many radians between two samples of the shape."""
    body = body_of("diver")
    for seed in seeds:
        random = np.random.default_rng(seed)
        loop = random_loop(seed, 2, size=float(random.choice([0.5, 1.0, 2.0])), harmonics=2)
        deformation, momentum = sp.articulated(body, loop.path), random_vector(seed, 60.0)
        truth = sp.reconstruct(deformation, momentum, tolerance=1e-8)
        for tolerance in (1e-4, 1e-5, 1e-6):
            motion = sp.reconstruct(deformation, momentum, tolerance=tolerance)
            assert apart(motion.attitude(TIMES), truth.attitude(TIMES)) <= motion.error_estimate + truth.error_estimate


@pytest.mark.parametrize("seeds", full_but([range(5), range(5, 20)], range(5)))
def test_steps_so_long_that_they_overflow_are_made_shorter(seeds: range):
    """Arms all but at rest, forty radians of turning in each move: the first plan's steps are far too long."""
    body = body_of("diver")
    shapes = [[-0.173, -0.0892], [0.1376, -0.1192], [0.0419, 0.025], [-0.1517, 0.0536]]
    deformation = sp.articulated(body, sp.ShapePath.waypoints([0.0, 0.5, 0.8, 2.0], shapes))
    momentum = [-34.0, 23.0, 34.5]
    attitudes = np.stack([random_rotation(seed) for seed in seeds])
    truth = sp.reconstruct(deformation, momentum, attitudes, tolerance=1e-8).attitude(TIMES)
    for tolerance in (1e-4, 1e-5, 1e-6):
        for attitude, true in zip(attitudes, truth):
            motion = sp.reconstruct(deformation, momentum, attitude, tolerance=tolerance)
            assert apart(motion.attitude(TIMES), true) <= motion.error_estimate + 1e-8


@pytest.mark.parametrize(
    "name", full_but(["cat", "cat_two_halves", "satellite", "astronaut"], "cat_two_halves", "satellite")
)
def test_twelve_digits_are_reached_and_true(name: str):
    body, loop = body_of(name), random_loop(1, body_of(name).n_shape)
    momentum, attitude = random_vector(3, BODIES[name]), random_rotation(4)
    motion = sp.reconstruct(sp.articulated(body, loop.path), momentum, attitude, tolerance=1e-12)
    truth = pinocchio_motion(name, body.joint_names, loop, momentum, attitude, TIMES).attitude
    assert motion.error_estimate <= 1e-12
    assert apart(motion.attitude(TIMES), truth) < 4e-12


# ---- Splines, waypoints, wheels ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("periodic", "tolerance"), full_but(product([True, False], [1e-6, 1e-9, 1e-11]), (True, 1e-6), (False, 1e-11))
)
def test_splines_with_twelve_knots(tolerance: float, periodic: bool):
    """Their knots are breaks, so accuracy costs a few hundred samples, not thousands."""
    name, random = "cat", np.random.default_rng(7)
    body = body_of(name)
    knots = np.concatenate([[0.0], np.linspace(0.0, 2.0, 13)[1:-1] + random.uniform(-0.05, 0.05, 11), [2.0]])
    shapes = random.uniform(-0.4, 0.4, (13, body.n_shape))
    if periodic:
        shapes[-1] = shapes[0]
    path = sp.ShapePath.spline(knots, shapes)
    momentum = random_vector(7, 0.05)
    motion = sp.reconstruct(sp.articulated(body, path), momentum, tolerance=tolerance)
    truth = pinocchio_motion(name, body.joint_names, path, momentum, None, TIMES, breaks=knots[1:-1]).attitude
    assert apart(motion.attitude(TIMES), truth) <= motion.error_estimate + 5e-12
    assert motion.error_estimate <= tolerance
    assert motion.evaluations < 1500
    assert (motion.deformation.closure is not None) == periodic


def test_waypoints_rest_at_every_waypoint():
    path = sp.ShapePath.waypoints([0.0, 0.4, 1.5, 2.0], np.random.default_rng(1).uniform(-1.0, 1.0, (4, 23)))
    body, momentum = body_of("cat"), random_vector(2, 0.05)
    motion = sp.reconstruct(sp.articulated(body, path), momentum, tolerance=1e-10)
    truth = pinocchio_motion("cat", body.joint_names, path, momentum, None, TIMES, breaks=[0.4, 1.5]).attitude
    assert apart(motion.attitude(TIMES), truth) < 1e-10
    for t in (0.0, 0.4, 1.5, 2.0):
        assert np.abs(motion.deformation.internal_momentum(t)).max() < 1e-12


def test_a_wheel_that_spins_fast_turns_the_body_by_the_law_of_its_momentum():
    """Only the satellite's wheel moves, 200 turns: at zero momentum the bus turns about a fixed axis, by quadrature."""
    body = body_of("satellite")
    wheel = body.joint_index("wheel_spin")
    angle = 400.0 * np.pi
    shapes = np.zeros((2, body.n_shape))
    shapes[1, wheel] = angle
    deformation = sp.articulated(body, sp.ShapePath.waypoints([0.0, 5.0], shapes))
    motion = sp.reconstruct(deformation, np.zeros(3), tolerance=1e-11)
    rate = -np.linalg.solve(body.locked_inertia(shapes[0]), body.momentum_matrix(shapes[0])[:, wheel])
    assert np.linalg.norm(rate) * angle > 0.5
    assert apart(motion.final_attitude, turn(rate, np.linalg.norm(rate) * angle)) < 1e-10
    assert deformation.closure is not None, "whole turns of a continuous joint are a loop"


# ---- Kinks ---------------------------------------------------------------------------------------------------------


def kinked(power: int, where: float) -> Curve:
    """|t - where|^power times a sign that makes only derivative `power` jump; 1: the rate itself jumps."""

    def curve(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = t - where
        return np.abs(s)[:, None] ** power * AMPLITUDE, (power * np.abs(s) ** (power - 1) * np.sign(s))[
            :, None
        ] * AMPLITUDE

    return curve


def motion_along(curve: Curve, momentum, tolerance: float, breaks=()) -> sp.Motion:
    path = sp.ShapePath.function(curve, 2.0, breaks)
    return sp.reconstruct(sp.articulated(body_of("cat_two_halves"), path), momentum, tolerance=tolerance)


@pytest.mark.parametrize(("power", "size"), full_but(product([1, 2, 3], [0.0, 0.02]), (1, 0.02), (2, 0.0), (3, 0.02)))
def test_a_declared_kink_costs_nothing(power: int, size: float):
    body, momentum = body_of("cat_two_halves"), random_vector(1, size)
    path = sp.ShapePath.function(kinked(power, 0.7123), 2.0, [0.7123])
    motion = sp.reconstruct(sp.articulated(body, path), momentum, tolerance=1e-10)
    truth = pinocchio_motion("cat_two_halves", body.joint_names, path, momentum, None, TIMES, [0.7123]).attitude
    assert apart(motion.attitude(TIMES), truth) < 1e-10
    assert motion.evaluations < 600


@pytest.mark.parametrize("power", [1, 2, 3])
@pytest.mark.parametrize("where", full_but([0.7123, 1.0, 0.5, 1.999], 0.7123, 1.999))
@pytest.mark.parametrize("size", [0.0, 0.02])
def test_an_undeclared_kink_is_located_and_becomes_a_break(power: int, where: float, size: float):
    momentum = random_vector(1, size)
    truth = motion_along(kinked(power, where), momentum, 1e-11, [where]).attitude(TIMES)
    for tolerance in (1e-4, 1e-6, 1e-9, 1e-11):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            motion = motion_along(kinked(power, where), momentum, tolerance)
        assert apart(motion.attitude(TIMES), truth) <= motion.error_estimate + 1e-11
        assert motion.evaluations < 600
        # The joint goes where no limits are looked at.
        said = [warning for warning in caught if "far beyond its limits" not in str(warning.message)]
        assert all(warning.category is UndeclaredBreakWarning for warning in said)
        named = [float(re.search(r"at t = ([0-9.]+) s", str(warning.message)).group(1)) for warning in said]
        # A kink of a higher derivative is where both sides are alike to rounding.
        assert named == pytest.approx([where], abs=1e-14 if power == 1 else 1e-7) or (not named and power != 1)


def test_a_motion_that_never_gets_smooth_is_refused_in_bounded_time():
    """A ripple of a millionth of a second: samples must stay countable (here: below three million)."""
    asked = 0

    def rippled(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nonlocal asked
        asked += len(t)
        assert asked < 3_000_000, "sampling has run away"
        slow, fast = np.sin(np.pi * t)[:, None], np.sin(1e7 * t)[:, None]
        slow_rate, fast_rate = np.pi * np.cos(np.pi * t)[:, None], 1e7 * np.cos(1e7 * t)[:, None]
        return slow * AMPLITUDE + 1e-9 * fast, slow_rate * AMPLITUDE + 1e-9 * fast_rate

    path = sp.ShapePath(rippled, 2.0, np.array([0.0, 2.0]), 3)
    deformation = sp.articulated(body_of("cat_two_halves"), path)
    with pytest.raises(AccuracyNotReached, match="rough"):
        sp.reconstruct(deformation, [0.0, 0.0, 0.02], tolerance=1e-10)


# ---- Bursts --------------------------------------------------------------------------------------------------------


def burst(centre: float, width: float, size: float, background: float, kind: str) -> Curve:
    """A small loop in two joints, run through in a burst; Gaussian, or of bounded support (-width, width)."""

    def curve(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = (t - centre) / width
        if kind == "gaussian":
            bump, slope = np.exp(-0.5 * x * x), -x * np.exp(-0.5 * x * x)
        else:
            inside = np.maximum(1.0 - x * x, 0.0)
            bump, slope = inside**6, -12.0 * x * inside**5
        first, first_rate = size * bump, size * slope / width
        second, second_rate = 2.0 * size * x * bump, 2.0 * size * (bump + x * slope) / width
        shapes = [first + background * np.sin(2.0 * t), second + background * np.cos(t), 0.0 * t]
        rates = [first_rate + 2.0 * background * np.cos(2.0 * t), second_rate - background * np.sin(t), 0.0 * t]
        return np.stack(shapes, axis=1), np.stack(rates, axis=1)

    return curve


@pytest.mark.parametrize(
    ("kind", "size", "background", "tolerance"),
    full_but(
        product(["gaussian", "bounded"], [1.0, 0.1], [0.01, 0.5, 2.0], [1e-4, 1e-6, 1e-9]),
        *[("gaussian", 1.0, 0.01, 1e-4), ("gaussian", 0.1, 0.5, 1e-6), ("gaussian", 1.0, 2.0, 1e-9)],
        *[("bounded", 0.1, 0.01, 1e-9), ("bounded", 1.0, 2.0, 1e-4), ("bounded", 0.1, 0.5, 1e-6)],
    ),
)
def test_a_burst_between_samples_is_not_missed(kind: str, size: float, background: float, tolerance: float):
    """A hundredth of the motion wide, wherever it is: the path is known only by its values."""
    width = 0.01 * 2.0 * (0.5 if kind == "bounded" else 0.4)
    broken = []
    for centre in np.random.default_rng(5).uniform(0.1, 1.9, 12):
        curve = burst(centre, width, size, background, kind)
        spread = width * np.array([-6.0, -1.0, 0.0, 1.0, 6.0])
        truth = motion_along(curve, np.zeros(3), 1e-10, np.clip(centre + spread, 0.0, 2.0))
        motion = motion_along(curve, np.zeros(3), tolerance)
        error = apart(motion.attitude(TIMES), truth.attitude(TIMES))
        if error > motion.error_estimate + truth.error_estimate:
            broken.append((float(centre), error, float(motion.error_estimate)))
    assert not broken


def test_a_burst_of_the_inertia_is_not_missed():
    """The same for a deformation given by functions: about a fixed axis the turn is a quadrature."""
    width = 0.004 * 2.0

    def inertia(t):
        return np.broadcast_to(np.diag([1.0, 2.0, 4.0]), (len(t), 3, 3))

    for centre in np.random.default_rng(6).uniform(0.1, 1.9, 12):

        def momentum(t, centre=centre):
            return np.stack([0.0 * t, 0.0 * t, np.exp(-0.5 * ((t - centre) / width) ** 2)], axis=1)

        motion = sp.reconstruct(sp.prescribed(inertia, momentum, 2.0), np.zeros(3), tolerance=1e-9)
        angle = -0.25 * width * np.sqrt(2.0 * np.pi)
        assert apart(motion.final_attitude, turn([0.0, 0.0, 1.0], angle)) < 1e-9


@pytest.mark.parametrize("centre", full_but([0.3, 0.9, 1.7], 0.3))
def test_a_path_at_rest_but_for_one_burst_is_accepted(centre: float):
    """Far from the burst the rates are tiny numbers, which differences cannot check."""
    path = sp.ShapePath.function(burst(centre, 0.006, 1.0, 0.0, "gaussian"), 2.0)
    body = body_of("cat_two_halves")
    motion = sp.reconstruct(sp.articulated(body, path), np.zeros(3), tolerance=1e-9)
    edges = np.clip(centre + np.array([-0.04, 0.0, 0.04]), 0.0, 2.0)
    truth = pinocchio_motion("cat_two_halves", body.joint_names, path, np.zeros(3), None, TIMES, edges).attitude
    assert apart(motion.attitude(TIMES), truth) < 1e-9


@pytest.mark.parametrize("background", [0.0, 0.01, 0.5])
def test_true_rates_are_accepted_wherever_the_burst_is(background: float):
    """The check of rates by differences must not refuse a steep flank, nor the all but flat foot of a burst."""
    for width in (0.02, 0.008, 0.004):
        for centre in np.linspace(0.7, 0.82, 121):
            for kind in ("gaussian", "bounded"):
                sp.ShapePath.function(burst(float(centre), width, 1.0, background, kind), 2.0)


# ---- Other deformations --------------------------------------------------------------------------------------------


def test_every_way_to_describe_a_motion_gives_the_same_attitude():
    """The satellite's joints, its inertia as functions, its links as particles: one answer."""
    body, loop = body_of("satellite"), random_loop(3, 10)
    momentum, attitude = random_vector(3, 12.0), random_rotation(3)
    joints = sp.reconstruct(sp.articulated(body, loop.path), momentum, attitude, tolerance=1e-10)
    functions = sp.prescribed(
        lambda t: body.locked_inertia(loop.at(t)[0]), lambda t: body.internal_momentum(*loop.at(t)), 2.0
    )
    described = sp.reconstruct(functions, momentum, attitude, tolerance=1e-10)
    black_box = sp.ShapePath.function(loop.at, 2.0)
    boxed = sp.reconstruct(sp.articulated(body, black_box), momentum, attitude, tolerance=1e-10)
    for motion in (described, boxed):
        assert apart(motion.attitude(TIMES), joints.attitude(TIMES)) < 2e-10


def test_particles_turn_as_newton_says():
    """Three masses that shrink and swing: inertia and momentum summed by hand in a DOP853 of the test's own."""
    from scipy.integrate import solve_ivp

    masses = np.array([1.0, 2.0, 0.5])

    def positions(t):
        zero = 0.0 * t
        places = [[1.0 + 0.3 * np.sin(t), zero, zero], [zero, np.cos(t), zero + 0.2], [zero, zero, 1.0 + 0.5 * t]]
        speeds = [[0.3 * np.cos(t), zero, zero], [zero, -np.sin(t), zero], [zero, zero, zero + 0.5]]
        return np.moveaxis(np.array(places), 2, 0), np.moveaxis(np.array(speeds), 2, 0)

    momentum = np.array([0.3, -0.5, 1.0])

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        r = y.reshape(3, 3)
        x, v = (part[0] for part in positions(np.array([t])))
        x, v = x - masses @ x / masses.sum(), v - masses @ v / masses.sum()
        inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, x))
        internal = sum(m * cross(p, s) for m, p, s in zip(masses, x, v))
        a, b, c = np.linalg.solve(inertia, r.T @ momentum - internal)
        return (r @ np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])).ravel()

    run = solve_ivp(slope, (0.0, 2.0), np.eye(3).ravel(), "DOP853", rtol=1e-12, atol=1e-14, t_eval=TIMES)
    motion = sp.reconstruct(sp.particles(masses, positions, 2.0), momentum, tolerance=1e-11)
    assert apart(motion.attitude(TIMES), run.y.T.reshape(-1, 3, 3)) < 2e-11


def test_a_loop_too_wild_for_even_samples_is_sampled_on_panels():
    """An arm that swings by a hundred radians each way, against the same swing known only by its values."""
    body = body_of("satellite")
    cosines = np.zeros((body.n_shape, 1))
    cosines[body.joint_index("arm_2")] = 100.0
    loop = sp.ShapePath.fourier(np.zeros(body.n_shape), cosines, 0.0 * cosines, 2.0)
    black_box = sp.ShapePath.function(loop.curve, 2.0, np.linspace(0.1, 1.9, 19))
    motion, truth = (
        sp.reconstruct(sp.articulated(body, path), [1.0, 2.0, 3.0], tolerance=1e-8) for path in (loop, black_box)
    )
    assert motion.evaluations > 768
    assert apart(motion.attitude(TIMES), truth.attitude(TIMES)) < 1e-8


@pytest.mark.parametrize("hundreds", full_but([2, 10], 2))
def test_hundreds_of_loops_cost_the_samples_of_one(hundreds: int):
    """And stay orthogonal and true to the momentum; the end is that of so many times a hundred loops."""
    body, loop = body_of("cat"), random_loop(1, body_of("cat").n_shape)
    momentum = random_vector(3, BODIES["cat"])
    once = sp.reconstruct(sp.articulated(body, loop.path), momentum, tolerance=1e-6)
    deformation = sp.articulated(body, loop.path.repeated(100 * hundreds))
    motion = sp.reconstruct(deformation, momentum, tolerance=1e-6)
    assert motion.evaluations <= 4 * once.evaluations
    end = motion.final_attitude
    assert np.abs(end.T @ end - np.eye(3)).max() < 1e-14
    assert np.abs(end @ motion.body_momentum(motion.duration) - momentum).max() < 1e-13 * np.linalg.norm(momentum)
    hundred, attitude = sp.articulated(body, loop.path.repeated(100)), np.eye(3)
    for _ in range(hundreds):
        attitude = sp.reconstruct(hundred, momentum, attitude, tolerance=1e-9).final_attitude
    assert apart(end, attitude) <= motion.error_estimate + 1e-6
