"""Many bodies with the same joints in one call: each as if it were alone."""

from __future__ import annotations

import pickle
from functools import cache

import numpy as np
import pytest
from benchmarks.cases import as_function, numbered_case
from benchmarks.extended import Truth, angles_between

import shapephase as sp
from shapephase.arrays import Array
from shapephase.body.family import BodyFamily
from shapephase.errors import AccuracyNotReached, ShapeError, SingularInertiaError, UnknownNameError, WrongObjectError
from shapephase.integrator import many_rotations
from support.bodies import joint, link, urdf
from support.compiler import needs_compiler
from support.long_runs import full_but

CAT = 2
DIVER = 9
SPLINE = 14


def family_of(body: sp.Body, count: int, *, spread: float = 0.1, seed: int = 0) -> BodyFamily:
    """Masses, inertias and places of centres that differ by some such share."""
    rng, parts = np.random.default_rng(seed), body.moving_parts
    shares = np.exp(spread * rng.normal(size=(2, count, len(parts))))
    centres = np.array([part.centre for part in parts]) * (1.0 + 0.5 * spread * rng.normal(size=(count, len(parts), 3)))
    tensors = np.array([part.inertia for part in parts])
    found = body.with_inertias(
        np.array([part.mass for part in parts]) * shares[0], centres, tensors * shares[1][..., None, None]
    )
    assert isinstance(found, BodyFamily)
    return found


@cache
def family(number: int, *, box: bool, count: int = 40, spread: float = 0.1) -> sp.DeformationFamily:
    case = numbered_case(number)
    path = as_function(case.path) if box else case.path
    return sp.articulated(family_of(case.body, count, spread=spread), path)


def momentum_of(number: int, rate: float = 1.0) -> Array:
    """That turns the body by some such rate [rad/s]."""
    body = numbered_case(number).body
    return rate / 3.0 * float(np.trace(body.locked_inertia(np.zeros(body.n_shape)))) * np.array([0.6, 0.0, 0.8])


def momenta_of(number: int, count: int) -> Array:
    """Over two decades, mixed with zeros."""
    rng = np.random.default_rng(number)
    found = momentum_of(number) * 10.0 ** rng.uniform(-1.0, 1.0, (count, 1))
    found[rng.integers(0, count, max(1, count // 10))] = 0.0
    return found


def picked(deformations: sp.DeformationFamily, rows: Array) -> sp.DeformationFamily:
    return sp.articulated(deformations.bodies.some(rows), deformations.path)


@pytest.mark.parametrize(
    ("number", "box"),
    full_but([(CAT, False), (CAT, True), (DIVER, False), (SPLINE, True)], (DIVER, False), (SPLINE, True)),
)
def test_companions_order_and_threads_change_nothing(number: int, box: bool):
    """To the last bit: the attitude, its estimate and what they were computed from."""
    deformations = family(number, box=box)
    momenta = momenta_of(number, len(deformations))
    together = sp.reconstruct(deformations, momenta, threads=2)
    order = np.random.default_rng(1).permutation(len(deformations))
    shuffled = sp.reconstruct(picked(deformations, order), momenta[order], threads=1)
    assert np.array_equal(shuffled.final_attitude, together.final_attitude[order])
    assert np.array_equal(shuffled.error_estimate, together.error_estimate[order])
    for row in range(0, len(deformations), 7):
        alone = sp.reconstruct(picked(deformations, np.array([row])), momenta[row])
        assert np.array_equal(alone.final_attitude[0], together.final_attitude[row])
        assert alone.error_estimate[0] == together.error_estimate[row]
        ours, theirs = alone[0], together[row]
        assert np.array_equal(ours.interpolant.coefficients, theirs.interpolant.coefficients)
        assert ours.evaluations == theirs.evaluations == together.evaluations[row]
        assert np.array_equal(ours.attitude(0.3), theirs.attitude(0.3))


@needs_compiler
@pytest.mark.parametrize("first", full_but([0, 10], 0))
@pytest.mark.parametrize("number", [CAT, DIVER])
def test_all_are_within_their_estimate(number: int, first: int):
    """Against an integration of each body in extended precision."""
    deformations = family(number, box=False)
    momenta = momenta_of(number, len(deformations))
    motions = sp.reconstruct(deformations, momenta)
    assert motions.error_estimate.max() <= motions.tolerance
    path = numbered_case(number).path
    times = np.linspace(0.0, path.duration, 4)[1:]
    for row in range(first, len(deformations), 20):
        truth = Truth(deformations.bodies[row])
        exact, _ = truth.attitudes(path, path.breaks, momenta[row], times)
        assert angles_between(exact, motions[row].attitude(times)).max() <= motions.error_estimate[row]


@pytest.mark.parametrize(("number", "box"), [(CAT, False), (SPLINE, False), (SPLINE, True)])
def test_each_is_as_the_one_body_s_own_motion(number: int, box: bool):
    """Another sampler, other steps, and the body's own I and L_o: both are within the tolerance."""
    deformations = family(number, box=box)
    momentum, start = momentum_of(number), np.diag([1.0, -1.0, -1.0])
    motions = sp.reconstruct(deformations, momentum, start)
    times = np.linspace(0.0, motions.duration, 5)
    attitudes = motions.attitude(times)
    assert attitudes.shape == (len(deformations), 5, 3, 3)
    for row in range(0, len(deformations), 13):
        alone = sp.reconstruct(deformations[row], momentum, start)
        assert np.abs(alone.attitude(times) - attitudes[row]).max() <= 2.0 * motions.tolerance
        assert np.abs(motions[row].attitude(times) - attitudes[row]).max() == 0.0
        assert np.abs(motions.final_attitude[row] - attitudes[row, -1]).max() < 1e-14
        assert motions[row].equation_residual < 1e-6
        assert np.allclose(
            sp.split(motions[row]).montgomery_phase, sp.split(alone).montgomery_phase, rtol=0.0, atol=1e-8
        )


def test_bodies_that_are_far_from_the_one_they_were_made_from_are_right_too():
    """Masses and inertias over two decades: some turn much faster, and need more than all begin with."""
    deformations = family(CAT, box=False, spread=1.2)
    motions = sp.reconstruct(deformations, momentum_of(CAT, 10.0))
    assert motions.error_estimate.max() <= motions.tolerance
    for row in range(0, len(deformations), 8):
        alone = sp.reconstruct(deformations[row], momentum_of(CAT, 10.0), tolerance=1e-11)
        assert np.abs(alone.final_attitude - motions.final_attitude[row]).max() <= 1e-11 + motions.error_estimate[row]


def test_a_recorded_path_is_followed_between_all_of_its_rows():
    body = sp.load_body("cat")
    path = sp.read_shape_path(sp.body.robots_folder() / "cat_righting.csv", body)
    motions = sp.reconstruct(sp.articulated(family_of(body, 3), path), np.zeros(3), tolerance=1e-8)
    alone = sp.reconstruct(motions.deformations[1], np.zeros(3), tolerance=1e-8)
    assert np.abs(alone.final_attitude - motions.final_attitude[1]).max() <= 2e-8


@pytest.mark.parametrize("moves", [True, False])
def test_loops_are_repeated(moves: bool):
    case = numbered_case(CAT)
    bodies, momentum = family_of(case.body, 5), momentum_of(CAT) * float(moves)
    motions = sp.reconstruct(sp.articulated(bodies, case.path.repeated(3)), momentum)
    alone = sp.reconstruct(sp.articulated(bodies[2], case.path.repeated(3)), momentum)
    assert np.abs(alone.final_attitude - motions.final_attitude[2]).max() <= 2.0 * motions.tolerance
    assert motions.error_estimate.max() <= motions.tolerance


def test_a_body_at_rest_does_not_turn():
    case = numbered_case(CAT)
    n = case.body.n_shape
    still = sp.ShapePath.waypoints([0.0, 1.0], [np.zeros(n), np.zeros(n)])
    motions = sp.reconstruct(sp.articulated(family_of(case.body, 3), still), np.zeros(3))
    assert np.array_equal(motions.final_attitude, np.broadcast_to(np.eye(3), (3, 3, 3)))


def rod_family(load_urdf) -> sp.DeformationFamily:
    """Of two rods on one axis, where the second body has no width."""
    body = load_urdf(
        urdf(
            link("a", 1.0, (1.0, 1.0, 1.0)), link("b", 1.0, (1.0, 1.0, 1.0), com=(0.3, 0.0, 0.0)),
            joint("hinge", "revolute", "a", "b", axis=(1.0, 0.0, 0.0)),
        )
    )  # fmt: skip
    thin = np.diag([0.0, 1.0, 1.0])
    tensors = np.stack([np.eye(3), thin, np.eye(3)])
    bodies = body.with_inertias(inertias={"a": tensors, "b": tensors})
    return sp.articulated(bodies, sp.ShapePath.fourier([0.0], [[0.1]], [[0.2]], 1.0))


def test_what_fails_is_named(load_urdf):
    with pytest.raises(SingularInertiaError, match=r"^body 1 of 3: locked inertia at t = \S+ s is not positive"):
        sp.reconstruct(rod_family(load_urdf), [0.1, 0.0, 0.0])
    momenta = np.stack([momentum_of(CAT), 1e9 * momentum_of(CAT)])
    with pytest.raises(AccuracyNotReached, match=r"^body 1 of 2: "):
        sp.reconstruct(family(CAT, box=False)[:2], momenta)


def test_more_than_can_be_kept_is_refused(monkeypatch):
    monkeypatch.setattr(many_rotations, "_MOST_KEPT", 10_000)
    with pytest.raises(AccuracyNotReached, match="take slices of the family"):
        sp.reconstruct(family(CAT, box=False), momentum_of(CAT))


def test_arguments_are_checked():
    deformations = family(CAT, box=False)
    with pytest.raises(ShapeError, match="bodies"):
        sp.reconstruct(deformations, np.zeros((3, 3)))
    with pytest.raises(UnknownNameError, match="method"):
        sp.reconstruct(deformations, np.zeros(3), method="dop853")
    with pytest.raises(ShapeError, match="threads"):
        sp.reconstruct(deformations, np.zeros(3), threads=0)
    with pytest.raises(sp.ShapePhaseError, match="joint"):
        sp.articulated(deformations.bodies, sp.ShapePath.waypoints([0.0, 1.0], [[0.0], [1.0]]))


def test_all_may_start_at_one_rate():
    """Then each has a momentum of its own."""
    deformations, rate = family(CAT, box=False)[:4], np.array([0.3, -0.2, 0.5])
    momenta = sp.momentum_from_rate(deformations, rate)
    motions = sp.reconstruct(deformations, momenta)
    for row, motion in enumerate(motions):
        assert np.abs(momenta[row] - sp.momentum_from_rate(deformations[row], rate)).max() < 1e-14
        assert np.abs(motion.angular_velocity(0.0) - rate).max() < 1e-12
    times = np.array([[0.1, 0.2, 0.3]])
    assert deformations.inertia(times).shape == (4, 1, 3, 3, 3)
    assert np.abs(deformations.inertia(times)[2] - deformations[2].inertia(times)).max() < 1e-14
    assert np.abs(deformations.internal_momentum(times)[2] - deformations[2].internal_momentum(times)).max() < 1e-13
    with pytest.raises(ShapeError, match="broadcast"):
        sp.momentum_from_rate(deformations, np.zeros((3, 3)))


def test_where_one_is_needed_the_sentence_says_how_to_take_it():
    deformations = family(CAT, box=False)[:2]
    motions = sp.reconstruct(deformations, np.zeros(3))
    for function, arguments in (
        (sp.holonomy, (deformations.bodies, deformations.path)),
        (sp.horizontal_gauge, (deformations,)),
        (sp.split, (motions,)),
    ):
        with pytest.raises(WrongObjectError, match=r"family\[0\]"):
            function(*arguments)


def test_a_family_of_motions_is_a_sequence():
    motions = sp.reconstruct(family(CAT, box=False)[:4], momentum_of(CAT))
    assert len(motions) == len(list(motions)) == 4
    assert [motion.error_estimate for motion in motions[1:3]] == motions.error_estimate[1:3].tolist()
    assert np.array_equal(motions[-1].final_attitude, motions[3].final_attitude)
    with pytest.raises(IndexError):
        motions[4]
    none = sp.reconstruct(family(CAT, box=False)[:0], np.zeros(3))
    assert none.final_attitude.shape == (0, 3, 3)


def test_a_long_run_tells_its_progress():
    shares: list[float] = []
    sp.reconstruct(family(CAT, box=False), np.zeros(3), progress=lambda share, _: shares.append(share))
    assert shares[-1] == 1.0
    assert np.all(np.diff(shares) >= 0.0)


def test_families_can_be_pickled_and_not_be_written_to():
    motions = sp.reconstruct(family(CAT, box=False)[:3], momentum_of(CAT))
    again = pickle.loads(pickle.dumps(motions))
    assert np.array_equal(again[1].attitude(0.5), motions[1].attitude(0.5))
    bodies = motions.deformations.bodies
    for array in (bodies.masses, motions.momentum, motions.initial_attitude):
        assert not array.flags.writeable
