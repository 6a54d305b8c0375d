"""A motion's bits depend on nothing beside it: not on companions, threads, or what was asked for before."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import shapephase as sp
from shapephase.arrays import Array
from shapephase.errors import AccuracyNotReached
from support.independent import BODIES, body_of, random_loop

CAT = "cat_two_halves"
KINDS = ("loop", "repeated loop", "function", "spline", "waypoints")


def path_of(kind: str) -> sp.ShapePath:
    loop, rng = random_loop(2, 3).path, np.random.default_rng(6)
    times = np.array([0.0, 0.3, 0.9, 1.1, 2.0])
    return {
        "loop": lambda: loop,
        "repeated loop": lambda: loop.repeated(3),
        "function": lambda: sp.ShapePath.function(loop.curve, 2.0),
        "spline": lambda: sp.ShapePath.spline(times, rng.uniform(-0.5, 0.5, (5, 3))),
        "waypoints": lambda: sp.ShapePath.waypoints(times, rng.uniform(-0.5, 0.5, (5, 3))),
    }[kind]()


def deformation_of(kind: str) -> sp.Deformation:
    return sp.articulated(body_of(CAT), path_of(kind))


def momenta(count: int, seed: int = 1) -> Array:
    """Over two decades, some of them zero."""
    rng = np.random.default_rng(seed)
    found = BODIES[CAT] * 10.0 ** rng.uniform(-2.0, 0.5, (count, 1)) * rng.normal(size=(count, 3))
    found[::5] = 0.0
    return found


def values(motion: sp.Motion) -> list[Array]:
    """All that a motion gives."""
    times = np.array([0.0, 0.123, 1.0, 1.987])
    split = sp.split(motion)
    return [
        motion.final_attitude, motion.error_estimate, motion.amplification, motion.attitude(times),
        motion.dynamic_phase(times), motion.solid_angle(times), motion.angular_velocity(times),
        motion.sensitivity.by_momentum, split.montgomery_phase, split.solid_angle,
        split.error_estimates.montgomery_phase,
    ]  # fmt: skip


def bits(every: list[Array], row: int | None = None) -> list[bytes]:
    """Of the values of a motion, or those of one of a batch."""
    return [np.ascontiguousarray(one if row is None else one[row]).tobytes() for one in every]


@pytest.mark.parametrize("kind", KINDS)
def test_companions_and_order_change_nothing(kind: str):
    given = momenta(8)
    together = values(sp.reconstruct(deformation_of(kind), given))
    order = np.random.default_rng(0).permutation(8)
    shuffled = values(sp.reconstruct(deformation_of(kind), given[order]))
    for row in (0, 3, 7):
        alone = values(sp.reconstruct(deformation_of(kind), given[row]))
        place = int(np.flatnonzero(order == row)[0])
        assert bits(alone) == bits(together, row) == bits(shuffled, place)


def test_threads_change_nothing():
    """Of enough rows for two threads."""
    given = np.tile(momenta(8), (40, 1)) * np.linspace(0.9, 1.0, 320)[:, None]
    one, two = (sp.reconstruct(deformation_of("loop"), given, threads=threads) for threads in (1, 2))
    assert np.array_equal(one.final_attitude, two.final_attitude)
    assert np.array_equal(one.error_estimate, two.error_estimate)
    assert np.array_equal(one.dynamic_phase(1.0), two.dynamic_phase(1.0))


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_asked_for_before_changes_nothing(kind: str):
    """Of the same deformation, of its sampler, and of others in between; nor that a call failed."""
    given = momenta(3)[1]
    expected = bits(values(sp.reconstruct(deformation_of(kind), given)))
    used = deformation_of(kind)
    for momentum, tolerance in ((momenta(4, 4), 1e-8), (np.zeros(3), 1e-9), (10.0 * given, 1e-7), (given, 1e-5)):
        sp.reconstruct(used, momentum, tolerance=tolerance)
        sp.reconstruct(deformation_of("loop"), momentum, tolerance=tolerance)
    with pytest.raises(AccuracyNotReached):
        sp.reconstruct(used, 1e9 * given)
    assert bits(values(sp.reconstruct(used, given))) == expected
    assert bits(values(sp.reconstruct(pickle.loads(pickle.dumps(used)), given))) == expected
    sampler = used.sampler()
    first = sampler.samples(0.01, 1e-7)
    sampler.samples(1.0, 1e-9)
    fresh = deformation_of(kind).sampler().samples(0.01, 1e-7)
    assert np.array_equal(first.interpolant.coefficients, fresh.interpolant.coefficients)
    assert np.array_equal(sampler.samples(0.01, 1e-7).perturbed.coefficients, fresh.perturbed.coefficients)


def test_bodies_of_a_family_change_nothing_of_each_other():
    """Twelve bodies of different masses, two of them with no momentum."""
    body, rng = body_of(CAT), np.random.default_rng(7)
    parts = body.moving_parts
    masses = np.array([part.mass for part in parts]) * np.exp(0.3 * rng.normal(size=(12, len(parts))))
    family = sp.articulated(body.with_inertias(masses), path_of("loop"))
    given = momenta(12)
    together = sp.reconstruct(family, given, threads=2)
    order = rng.permutation(12)
    shuffled = sp.reconstruct(sp.articulated(family.bodies.some(order), family.path), given[order], threads=1)
    assert np.array_equal(shuffled.final_attitude, together.final_attitude[order])
    for row in (0, 3, 10):
        alone = sp.reconstruct(sp.articulated(family.bodies.some(np.array([row])), family.path), given[row : row + 1])
        assert bits(values(alone[0])) == bits(values(together[row]))
