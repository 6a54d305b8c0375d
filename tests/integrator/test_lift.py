"""The lift beside a motion: its error estimate against extended precision, its steps, and what is kept of it."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from benchmarks.extended import Truth, angles_between

import shapephase as sp
from shapephase.integrator import stepped_rotation
from support.compiler import needs_compiler
from support.independent import BODIES, apart, body_of, random_loop, random_vector
from support.long_runs import full_but
from support.series_motion import sampler_of_series

TOLERANCES = (1e-5, 1e-8, 1e-11)


def spline(name: str) -> sp.ShapePath:
    rng = np.random.default_rng(5)
    return sp.ShapePath.spline(np.linspace(0.0, 2.0, 9), 0.4 * rng.normal(size=(9, body_of(name).n_shape)))


def motion_of(name: str, path: sp.ShapePath, tolerance: float) -> sp.Motion:
    return sp.reconstruct(sp.articulated(body_of(name), path), random_vector(2, BODIES[name]), tolerance=tolerance)


@needs_compiler
@pytest.mark.parametrize("tolerance", TOLERANCES)
@pytest.mark.parametrize("kind", ["loop", "spline"])
@pytest.mark.parametrize("name", full_but(["cat", "satellite", "cat_two_halves"], "satellite"))
def test_the_lift_is_within_its_estimate_and_that_is_not_far_above(name: str, kind: str, tolerance: float):
    path = spline(name) if kind == "spline" else random_loop(3, body_of(name).n_shape).path
    lift = motion_of(name, path, tolerance).horizontal_lift
    times = np.append(np.sort(np.random.default_rng(1).uniform(0.0, path.duration, 40)), path.duration)
    exact, bound = Truth(body_of(name)).attitudes(path, path.breaks, np.zeros(3), times)
    error = float(angles_between(exact, lift.rotation(times)[0]).max())
    estimate = float(lift.error_estimate[0])
    assert error - bound <= estimate
    # Rounding is some 1e-14 however small the error is.
    assert estimate < 500.0 * error + 2e-14


@pytest.mark.parametrize("tolerance", TOLERANCES)
def test_where_the_motion_s_steps_end_steps_of_the_lift_end(tolerance: float):
    motion = motion_of("cat", spline("cat"), tolerance)
    lift = motion.horizontal_lift
    assert np.isin(motion.solution.times, lift.times).all()
    fine = stepped_rotation(sampler_of_series(motion.interpolant), np.zeros((1, 3)), 1e-12)
    gap = apart(lift.rotation(fine.times)[0], fine.rotation(fine.times)[0])
    assert gap <= lift.stepping_error[0] + lift.rounding_error[0] + fine.error_estimate[0]


def test_a_motion_at_rest_is_its_own_lift():
    motion = sp.reconstruct(sp.articulated(body_of("cat"), spline("cat")), np.zeros(3))
    assert motion.horizontal_lift is motion.solution


@pytest.mark.parametrize("kind", ["loop", "spline"])
def test_a_motion_read_or_unpickled_has_the_same_lift(kind: str, tmp_path):
    path = spline("cat") if kind == "spline" else random_loop(3, body_of("cat").n_shape).path
    motion = motion_of("cat", path, 1e-7)
    motion.save(tmp_path / "motion.npz")
    for other in (sp.load_motion(tmp_path / "motion.npz"), pickle.loads(pickle.dumps(motion))):
        assert other.horizontal_lift.error_estimate == motion.horizontal_lift.error_estimate
        assert np.array_equal(other.horizontal_lift.end, motion.horizontal_lift.end)


def test_what_may_be_missing_of_the_samples_is_kept_when_others_are_taken():
    path = random_loop(3, body_of("cat").n_shape).path
    deformation = sp.articulated(body_of("cat"), path)
    motion = sp.reconstruct(deformation, random_vector(2, 0.3), tolerance=1e-7)
    alone = motion.solution.perturbed.coefficients.copy()
    again = sp.reconstruct(deformation, random_vector(2, 0.3), tolerance=1e-7)
    sp.reconstruct(deformation, random_vector(4, 0.9), tolerance=1e-9)
    assert np.array_equal(again.solution.perturbed.coefficients, alone)
