"""Many momenta in one call: each as if it were alone."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from benchmarks.cases import as_function, numbered_case
from benchmarks.extended import Truth, angles_between

import shapephase as sp
from shapephase.arrays import Array
from shapephase.errors import AccuracyNotReached, ShapeError
from support.long_runs import full_but

DECADES = (-1.5, 1.5)
"""Of the rates of turning [rad/s]."""


@cache
def deformation(number: int, *, box: bool) -> sp.Deformation:
    case = numbered_case(number)
    return sp.articulated(case.body, as_function(case.path) if box else case.path)


@cache
def momenta(number: int, count: int) -> Array:
    """Over three decades of magnitude, mixed with zeros."""
    rng, body = np.random.default_rng(number), numbered_case(number).body
    moment = float(np.trace(body.locked_inertia(np.zeros(body.n_shape)))) / 3.0
    axes = rng.normal(size=(count, 3))
    found = moment * 10.0 ** rng.uniform(*DECADES, (count, 1)) * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    found[rng.integers(0, count, max(1, count // 50))] = 0.0
    return found


@cache
def of_thousand(number: int) -> sp.Motion:
    return sp.reconstruct(deformation(number, box=False), momenta(number, 1000))


@pytest.mark.parametrize(
    ("number", "box"), full_but([(2, False), (2, True), (9, False), (14, True)], (2, True), (9, False))
)
def test_each_is_as_it_is_alone(number: int, box: bool):
    """To the last bit."""
    given = momenta(number, 60)
    motion = sp.reconstruct(deformation(number, box=box), given)
    assert len(motion.parts) > 5
    for k in range(0, 60, 4):
        alone = sp.reconstruct(deformation(number, box=box), given[k])
        assert np.array_equal(alone.final_attitude, motion.final_attitude[k])
        assert alone.error_estimate == motion.error_estimate[k]
        assert alone.amplification == motion.amplification[k]


def test_order_and_threads_change_nothing():
    given = momenta(2, 1000)
    motion = sp.reconstruct(deformation(2, box=False), given, threads=2)
    order = np.random.default_rng(0).permutation(1000)
    shuffled = sp.reconstruct(motion.deformation, given[order], threads=1)
    assert np.array_equal(shuffled.final_attitude, motion.final_attitude[order])
    assert np.array_equal(shuffled.error_estimate, motion.error_estimate[order])


@pytest.mark.parametrize("first", full_but([0, 125], 0))
def test_all_are_within_their_estimate(first: int):
    """A sample of a thousand against an integration in extended precision."""
    motion, given = of_thousand(2), momenta(2, 1000)
    assert motion.error_estimate.max() <= motion.tolerance
    path, truth = numbered_case(2).path, Truth(numbered_case(2).body)
    times = np.linspace(0.0, path.duration, 5)[1:]
    found = motion.attitude(times)
    for k in range(first, 1000, 250):
        exact, _ = truth.attitudes(path, path.breaks, given[k], times)
        assert angles_between(exact, found[k]).max() <= motion.error_estimate[k]


def test_the_body_is_asked_once_for_samples_that_classes_share():
    motion = of_thousand(2)
    each = sum(np.count_nonzero(part.interpolant.coefficients[:, :, 0]) for _, part in motion.parts)
    assert motion.evaluations < 0.2 * each


def test_a_batch_with_and_without_momentum():
    given = momenta(2, 60) * (np.arange(60) % 3 > 0)[:, None]
    motion = sp.reconstruct(deformation(2, box=False), given.reshape(20, 3, 3))
    still = sp.reconstruct(deformation(2, box=False), np.zeros(3))
    assert motion.final_attitude.shape == (20, 3, 3, 3)
    assert np.abs(motion.final_attitude[:, 0] - still.final_attitude).max() <= 1e-12
    assert np.all(motion.dynamic_phase(0.5)[:, 0] == 0.0)


def test_what_follows_is_put_together_by_row():
    given = momenta(2, 12).reshape(4, 3, 3)
    motion = sp.reconstruct(deformation(2, box=False), given)
    assert len(motion.parts) > 3
    times = np.array([0.0, 0.4, 0.9])
    split, running = sp.split(motion), sp.running_phases(motion, times)
    arcs, carried = sp.arc_phases(motion, times), sp.parallel_transport(motion, times)
    sensitivity = motion.sensitivity
    for row in ((0, 1), (2, 2), (3, 0)):
        alone = sp.reconstruct(deformation(2, box=False), given[row])
        assert np.allclose(split.montgomery_phase[row], sp.split(alone).montgomery_phase, rtol=0.0, atol=1e-10)
        assert np.allclose(split.holonomy[row], sp.split(alone).holonomy, rtol=0.0, atol=1e-10)
        assert np.allclose(running.solid_angle[row], sp.running_phases(alone, times).solid_angle, rtol=0.0, atol=1e-10)
        assert np.allclose(arcs.closing_tilt[row], sp.arc_phases(alone, times).closing_tilt, rtol=0.0, atol=1e-10)
        assert np.allclose(carried[row], sp.parallel_transport(alone, times), rtol=0.0, atol=1e-10)
        assert np.allclose(sensitivity.by_attitude[row], alone.sensitivity.by_attitude, rtol=1e-8)
        assert np.allclose(motion.solid_angle(times)[row], alone.solid_angle(times), rtol=0.0, atol=1e-10)
        assert motion.equation_residual[row] < 1e-6
    assert running.times.shape == arcs.times.shape == (3,)


def test_a_batch_can_be_kept(tmp_path):
    motion = sp.reconstruct(deformation(2, box=False), momenta(2, 12))
    motion.save(tmp_path / "motion.npz")
    read = sp.load_motion(tmp_path / "motion.npz")
    times = np.linspace(0.0, motion.duration, 9)
    assert np.array_equal(read.attitude(times), motion.attitude(times))
    assert np.array_equal(read.error_estimate, motion.error_estimate)
    assert np.allclose(sp.split(read).montgomery_phase, sp.split(motion).montgomery_phase, rtol=0.0, atol=1e-10)


def test_what_fails_is_named():
    given = np.array([[0.0, 0.0, 0.1], [0.1, 0.0, 0.0], [0.0, 1e7, 0.0]])
    with pytest.raises(AccuracyNotReached, match="momentum"):
        sp.reconstruct(deformation(2, box=False), given)


@pytest.mark.parametrize("threads", [0, -1, 1.5, True, "two"])
def test_threads_are_counted(threads: Any):
    with pytest.raises(ShapeError, match="threads"):
        sp.reconstruct(deformation(2, box=False), np.zeros(3), threads=threads)
