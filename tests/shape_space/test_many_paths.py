"""Many paths of one body in one call, and stretches on which nothing moves."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest

import shapephase as sp
from support.independent import BODIES, apart, body_of, pinocchio_motion, random_loop, random_rotation, random_vector


def loops(name: str, count: int) -> Iterator[sp.ShapePath]:
    for seed in range(count):
        yield random_loop(seed, body_of(name).n_shape).path


def test_each_ends_where_it_ends_alone():
    name = "cat"
    body, momentum, attitude = body_of(name), random_vector(1, BODIES[name]), random_rotation(2)
    ends = sp.final_attitudes(body, loops(name, 6), momentum, attitude, tolerance=1e-10)
    assert ends.attitude.shape == (6, 3, 3)
    assert ends.error_estimate.max() <= 1e-10
    for path, end, count in zip(loops(name, 6), ends.attitude, ends.evaluations, strict=True):
        alone = sp.reconstruct(sp.articulated(body, path), momentum, attitude, tolerance=1e-10)
        assert apart(end, alone.final_attitude) < 1e-14
        assert count == alone.evaluations


def test_momenta_and_attitudes_may_be_one_for_each():
    name = "cat_two_halves"
    body = body_of(name)
    momenta = np.stack([random_vector(seed, BODIES[name]) for seed in range(4)])
    momenta[2] = 0.0
    attitudes = np.stack([random_rotation(seed) for seed in range(4)])
    ends = sp.final_attitudes(body, list(loops(name, 4)), momenta, attitudes)
    for path, momentum, attitude, end in zip(loops(name, 4), momenta, attitudes, ends.attitude, strict=True):
        alone = sp.reconstruct(sp.articulated(body, path), momentum, attitude)
        assert apart(end, alone.final_attitude) < 1e-14


def test_counts_must_agree_and_faults_name_their_path():
    body = body_of("cat_two_halves")
    paths = list(loops("cat_two_halves", 3))
    with pytest.raises(sp.errors.ShapeError, match="more paths"):
        sp.final_attitudes(body, paths, np.ones((2, 3)))
    with pytest.raises(sp.errors.ShapeError, match="momenta"):
        sp.final_attitudes(body, paths, np.ones((4, 3)))
    with pytest.raises(sp.errors.ShapeError, match="each"):
        sp.final_attitudes(body, paths, np.ones((1, 3, 3)))
    other = random_loop(0, body.n_shape + 1).path
    with pytest.raises(sp.ShapePhaseError, match="path 3"):
        sp.final_attitudes(body, [*paths, other], np.zeros(3))
    none = sp.final_attitudes(body, [], np.zeros(3))
    assert none.attitude.shape == (0, 3, 3)


def test_memory_does_not_grow_with_the_paths():
    name = "cat_two_halves"

    def peak(count: int) -> int:
        tracemalloc.start()
        sp.final_attitudes(body_of(name), loops(name, count), np.zeros(3))
        top = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return top

    peak(60)
    assert peak(60) < peak(20) + 100 * 1000


def test_a_stretch_on_which_nothing_moves_leaves_the_motion_as_it_is():
    """Beside another method; a path that rests all the time takes no more samples than a piece of it."""
    body = body_of("cat_two_halves")
    here, there = np.zeros(body.n_shape), np.full(body.n_shape, 0.4)
    momentum = random_vector(1, BODIES["cat_two_halves"])
    pausing = sp.ShapePath.waypoints([0.0, 1.0, 2.0, 3.0, 4.0], [here, there, there, there, here])
    paused = sp.reconstruct(sp.articulated(body, pausing), momentum)
    check = sp.reconstruct(sp.articulated(body, pausing), momentum, tolerance=1e-8, method="dop853")
    assert apart(paused.attitude([1.5, 2.5, 4.0]), check.attitude([1.5, 2.5, 4.0])) < 1e-8
    still = sp.reconstruct(sp.articulated(body, sp.ShapePath.waypoints([0.0, 1.0], [there, there])), momentum)
    assert still.evaluations <= 34


def test_a_pause_of_a_black_box_is_seen_as_one_when_it_is_declared():
    body = body_of("cat_two_halves")
    reach = np.full(body.n_shape, 0.4)

    def path(pause: float) -> sp.ShapePath:
        def curve(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            x = (np.clip(t, 0.0, 1.0) - np.clip(t - 1.0 - pause, 0.0, 1.0))[:, None]
            way = np.where(t < 1.0, 1.0, np.where(t > 1.0 + pause, -1.0, 0.0))[:, None]
            return reach * x**2 * (3.0 - 2.0 * x), reach * 6.0 * x * (1.0 - x) * way

        return sp.ShapePath.function(curve, 2.0 + pause, breaks=[1.0, 1.0 + pause] if pause else [1.0])

    momentum = random_vector(1, BODIES["cat_two_halves"])
    without, paused = (sp.reconstruct(sp.articulated(body, path(p)), momentum).evaluations for p in (0.0, 1.0))
    # A black box is cut into four panels between breaks: one evaluation for each of those.
    assert paused <= without + 4


def test_a_black_box_that_moves_late_in_a_panel_does_not_stand_still():
    """At rest at the start and the middle of its first panel, a quarter of the path, and moving in its last fifth."""
    body = body_of("cat_two_halves")
    reach = np.full(body.n_shape, 0.8)

    def curve(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = np.clip((t - 0.8) / 0.2, 0.0, 1.0)[:, None]
        return reach * (x * (1.0 - x)) ** 4, reach * 4.0 * (x * (1.0 - x)) ** 3 * (1.0 - 2.0 * x) / 0.2

    deformation = sp.articulated(body, sp.ShapePath.function(curve, 4.0))
    momentum = random_vector(1, BODIES["cat_two_halves"])
    motion = sp.reconstruct(deformation, momentum, tolerance=1e-8)
    path, times = sp.ShapePath.function(curve, 4.0, breaks=[0.8, 1.0]), np.array([0.0, 0.85, 0.95, 4.0])
    truth = pinocchio_motion("cat_two_halves", body.joint_names, path, momentum, None, times, [0.8, 1.0])
    assert apart(motion.attitude(times), truth.attitude) < 1e-8
    assert motion.evaluations > 20
