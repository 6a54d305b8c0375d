"""Error estimates of whole motions against extended precision, and where rounding decides."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from benchmarks.estimates import judged
from benchmarks.random_motions import harmonics

import shapephase as sp
from shapephase import so3
from shapephase.integrator import SteppedRotation, stepped_rotation
from support.compiler import needs_compiler
from support.independent import apart
from support.long_runs import full_but

EPS = np.finfo(float).eps
MOMENTS = np.diag([1.0, 2.0, 3.0])


# ---- Rounding -------------------------------------------------------------------------------------------------------


def next_to_the_separatrix(momenta: np.ndarray, duration: float) -> SteppedRotation:
    """A rigid body given by functions, so that it is stepped, not solved in closed form."""
    deformation = sp.prescribed(
        lambda t: np.broadcast_to(MOMENTS, (len(t), 3, 3)), lambda t: np.zeros((len(t), 3)), duration
    )
    return stepped_rotation(deformation.sampler(), momenta, 1e-7)


def test_rounding_is_amplified_as_the_motion_amplifies_errors():
    """Momenta that differ by rounding alone: how far their motions part is the least that rounding contributes.

    The body spins about its middle axis, where errors grow exponentially; what rounding would contribute without that
    growth is far less than what is seen.
    """
    nearby = np.array([1e-3, 1.0, 2e-3]) * (1.0 + EPS * np.random.default_rng(0).integers(-1, 2, (20, 3)))
    solution = next_to_the_separatrix(nearby, 60.0)
    spread = max(apart(end, solution.end[0]) for end in solution.end)
    steps = solution.quaternions.shape[1]
    chords = np.linalg.norm(np.diff(solution.quaternions, axis=1), axis=-1)
    turned_by = 2.0 * chords.sum(axis=1)
    unamplified = EPS * (8.0 + 2.0 * np.sqrt(steps) + 5.0 * turned_by)
    assert solution.amplification.min() > 1e3
    assert np.all(spread > 5.0 * unamplified)
    assert np.all(solution.rounding_error >= spread)
    assert np.all(solution.error_estimate >= solution.rounding_error + solution.stepping_error)


def test_rounding_alone_is_small_where_errors_do_not_grow():
    """About the axis of the largest moment errors grow only slowly, and rounding is some hundred units."""
    solution = next_to_the_separatrix(np.array([[0.0, 0.0, 1.0]]), 30.0)
    assert solution.rounding_error[0] < 2e-13


@needs_compiler
@pytest.mark.parametrize("number", full_but([3217, 9445], 9445))
def test_a_tolerance_that_a_bound_of_rounding_would_refuse_is_reached(number: int):
    """Of motions whose errors grow some hundred and some thousand times."""
    run = judged("mixed", 301, 60.0, number)
    assert run.outcome == "done"
    assert run.error <= run.estimate + run.bound <= run.tolerance + run.bound


@needs_compiler
@pytest.mark.parametrize("number", full_but([269, 719, 899], 719, 899))
def test_rounding_does_not_add_up_over_loops(number: int):
    """The satellite, fifteen to 24 times one loop: errors of 2e-13 once stood beside estimates of 6e-14."""
    run = judged("harmonics", 3, 60.0, number)
    assert run.outcome == "done"
    assert run.above <= 1.0
    assert run.error < 2e-14


# ---- Little momentum ------------------------------------------------------------------------------------------------


def test_a_body_at_rest_and_a_momentum_of_next_to_nothing_are_one_motion():
    """A momentum so small that it turns nothing takes the other way through the steps."""
    path = sp.ShapePath.fourier(np.zeros(3), np.zeros((3, 1)), np.full((3, 1), 0.3), 1.0)
    deformation = sp.articulated(sp.load_body("cat_two_halves"), path)
    rest = sp.reconstruct(deformation, np.zeros(3), tolerance=1e-11)
    moving = sp.reconstruct(deformation, [0.0, 0.0, 1e-18], tolerance=1e-11)
    assert so3.angle(rest.final_attitude.T @ moving.final_attitude) <= rest.error_estimate + moving.error_estimate


def test_a_loop_with_next_to_no_momentum_is_within_its_estimate():
    """One harmonic, 22 times, whose errors cancel alike in steps and in pairs of them: against much finer steps."""
    rng = np.random.default_rng((5, 32))
    trial = harmonics(32, rng)
    moment = float(np.trace(trial.body.locked_inertia(trial.path.shape(0.0)))) / 3.0
    momentum = rng.normal(size=3) * 10.0 ** rng.uniform(-4.0, -1.0) * moment / trial.path.duration
    loop = sp.articulated(trial.body, trial.path)
    motion, finer = (sp.reconstruct(loop, momentum, tolerance=tolerance) for tolerance in (trial.tolerance, 1e-11))
    error = so3.angle(so3.transpose(finer.final_attitude) @ motion.final_attitude)
    assert error <= motion.error_estimate


# ---- Recordings -----------------------------------------------------------------------------------------------------


def loop_of(body: sp.Body, rows: int, noise: float = 0.0) -> sp.ShapePath:
    """A loop of three harmonics recorded in rows."""
    rng = np.random.default_rng(3)
    times = np.linspace(0.0, 1.0, rows + 1)
    sizes, phases = 0.4 * rng.normal(size=(3, body.n_shape)), rng.uniform(0.0, 6.0, (3, body.n_shape))
    shapes = noise * rng.normal(size=(rows + 1, body.n_shape))
    for k in range(3):
        shapes += sizes[k] / (k + 1) * np.sin(2.0 * np.pi * (k + 1) * times[:, None] + phases[k])
    shapes[-1] = shapes[0]
    return sp.ShapePath.spline(times, shapes, periodic=True)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_the_recorded_cat_is_where_the_same_function_has_it(noise: float):
    """The attitude along the same path given as a function, which is resolved between its knots."""
    body = sp.load_body("cat_two_halves")
    path = loop_of(body, 80, noise)
    same = sp.ShapePath.function(path.curve, path.duration, path.breaks[1:-1])
    times = np.linspace(0.0, path.duration, 37)
    for momentum in ([0.0, 0.0, 0.0], [0.05, 0.0, 0.1]):
        motion = sp.reconstruct(sp.articulated(body, path), momentum, tolerance=1e-9)
        exact = sp.reconstruct(sp.articulated(body, same), momentum, tolerance=1e-11)
        assert apart(motion.attitude(times), exact.attitude(times)) <= motion.error_estimate + exact.error_estimate


@pytest.mark.parametrize("number", full_but([0, 6, 9, 10], 0, 9))
@needs_compiler
def test_no_recording_is_off_by_more_than_its_estimate(number: int):
    """Smooth, noisy and rounded ones, with and without momentum, beside extended precision."""
    run = judged("recordings", 17, 1.0, number)
    assert not run.error > run.estimate, run.what


def test_a_recorded_deformation_travels_without_what_was_found_out():
    """Pickled after a reconstruction it is as long as before, and gives the same attitude."""
    body = sp.load_body("cat_two_halves")
    deformation = sp.articulated(body, loop_of(body, 200))
    before = pickle.dumps(deformation)
    motion = sp.reconstruct(deformation, [0.0, 0.0, 0.0], tolerance=1e-6)
    after = pickle.dumps(deformation)
    assert len(after) < 1.1 * len(before)
    again = sp.reconstruct(pickle.loads(after), [0.0, 0.0, 0.0], tolerance=1e-6)
    np.testing.assert_array_equal(again.final_attitude, motion.final_attitude)


def test_a_single_wrong_row_is_seen():
    """Of 4,000 rows one is off by a tenth of a milliradian: the body there is that of the path through it."""
    body = sp.load_body("cat_two_halves")
    path = loop_of(body, 4000)
    shapes = path.shape(path.breaks)
    shapes[1717] += 1e-4
    wrong = sp.ShapePath.spline(path.breaks, shapes)
    deformation = sp.articulated(body, wrong)
    found = deformation.sampler().samples(0.0, 1e-8).interpolant
    times = wrong.breaks[1700] + np.linspace(0.0, 34.0, 300) / 4000.0
    drift = np.linalg.solve(deformation.inertia(times), deformation.internal_momentum(times)[:, :, None])[:, :, 0]
    assert np.abs(drift - found.inverse_and_drift(times)[1]).max() < 1e-5 * np.abs(drift).max()
