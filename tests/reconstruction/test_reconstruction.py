"""Reconstruction: closed forms, tolerances, batches, arguments. Other engines' answers are in test_simulators.py."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace
from functools import lru_cache
from importlib import import_module
from itertools import product
from typing import Any

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import AccuracyNotReached, ShapeError, SingularInertiaError, TrajectoryError, UnknownNameError
from shapephase.integrator.integrate import stepped_rotation
from shapephase.integrator.lift import lift_along
from shapephase.integrator.sampling import Sampler
from shapephase.integrator.stepped import SteppedRotation
from support.independent import (
    BODIES,
    EVERY_BODY,
    apart,
    axisymmetric_attitude,
    body_of,
    pinocchio_motion,
    random_loop,
    random_rotation,
    random_vector,
    turn,
)
from support.long_runs import full_but

TIMES = np.linspace(0.0, 2.0, 41)


def articulated(name: str, seed: int = 1) -> sp.Deformation:
    body = body_of(name)
    return sp.articulated(body, random_loop(seed, body.n_shape).path)


# ---- Closed forms (A10: the rigid body as a special case) ----------------------------------------------------------


def test_axisymmetric_rigid_body_in_turned_axes():
    times, tilt = np.linspace(0.0, 3.0, 20), random_rotation(4)
    momentum, attitude = random_vector(5, 2.0), random_rotation(6)
    motion = sp.reconstruct(
        sp.rigid(tilt @ np.diag([1.0, 1.0, 1.7]) @ tilt.T, 3.0), momentum, attitude, tolerance=1e-12
    )
    own_axes = axisymmetric_attitude(1.0, 1.7, momentum, attitude @ tilt, times)
    assert apart(motion.attitude(times), own_axes @ tilt.T) < 1e-11


# ---- Tolerances, estimates, methods -------------------------------------------------------------------------------


@lru_cache(maxsize=3)
def true_attitude(name: str) -> np.ndarray:
    body, loop = body_of(name), random_loop(1, body_of(name).n_shape)
    momentum, attitude = random_vector(3, BODIES[name]), random_rotation(4)
    return pinocchio_motion(name, body.joint_names, loop, momentum, attitude, TIMES).attitude


@pytest.mark.parametrize(
    ("name", "tolerance"),
    full_but(
        product(["example:human", "cat", "satellite"], [1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12]),
        *(("example:human", 1e-6), ("example:human", 1e-11)),
        *(("cat", 1e-4), ("cat", 1e-9), ("cat", 1e-12), ("satellite", 1e-8), ("satellite", 1e-10)),
    ),
)
def test_true_error_is_within_the_estimate_and_that_within_the_tolerance(name: str, tolerance: float):
    body, loop = body_of(name), random_loop(1, body_of(name).n_shape)
    momentum, attitude = random_vector(3, BODIES[name]), random_rotation(4)
    motion = sp.reconstruct(sp.articulated(body, loop.path), momentum, attitude, tolerance=tolerance)
    assert motion.error_estimate <= tolerance
    # The oracle itself is good to 3e-12.
    assert apart(motion.attitude(TIMES), true_attitude(name)) <= motion.error_estimate + 3e-12


@pytest.mark.parametrize("name", ["satellite", "cat_two_halves"])
@pytest.mark.parametrize("size", [0.0, 1.0])
def test_methods_agree(name: str, size: float):
    momentum, attitude = size * random_vector(3, BODIES[name]), random_rotation(5)
    automatic, stepped, dop853 = (
        sp.reconstruct(articulated(name), momentum, attitude, tolerance=1e-9, method=method)
        for method in ("auto", "spectral", "dop853")
    )
    assert automatic.method == "spectral"
    assert dop853.method == "dop853"
    np.testing.assert_array_equal(automatic.attitude(TIMES), stepped.attitude(TIMES))
    difference = apart(stepped.attitude(TIMES), dop853.attitude(TIMES))
    assert 0.0 < difference <= stepped.error_estimate + dop853.error_estimate
    assert dop853.error_estimate <= 1e-9
    assert stepped.evaluations < dop853.evaluations
    assert dop853.equation_residual < 1e-7


@pytest.mark.parametrize("name", EVERY_BODY)
def test_equation_residual_is_small_and_shows_what_is_broken(name: str):
    motion = sp.reconstruct(articulated(name), random_vector(2, BODIES[name]), random_rotation(2))
    assert motion.equation_residual < 1e-9
    assert replace(motion, momentum=1.01 * motion.momentum).equation_residual > 1e-3
    assert replace(motion, momentum=-motion.momentum).equation_residual > 1e-2
    assert replace(motion, initial_attitude=motion.initial_attitude @ turn([0, 1, 0], 1e-2)).equation_residual > 1e-4
    assert replace(motion, deformation=articulated(name, seed=2)).equation_residual > 1e-3


def test_equation_residual_of_zero_momentum():
    motion = sp.reconstruct(articulated("cat"), np.zeros(3), tolerance=1e-10)
    assert motion.equation_residual < 1e-9
    assert replace(motion, deformation=articulated("cat", seed=2)).equation_residual > 1e-2


# ---- Batches ------------------------------------------------------------------------------------------------------


def test_results_have_the_batch_the_times_and_the_item_as_axes():
    momenta = np.stack([random_vector(k, 0.05) for k in range(2)])[:, None]  # (2, 1, 3)
    attitudes = np.stack([random_rotation(k) for k in range(3)])  # (3, 3, 3)
    deformation = articulated("cat")
    motion = sp.reconstruct(deformation, momenta, attitudes)
    times = np.array([[0.0, 0.4], [1.1, 2.0]])
    assert motion.batch == (2, 3)
    assert motion.error_estimate.shape == (2, 3)
    assert motion.equation_residual.shape == (2, 3)
    assert motion.final_attitude.shape == (2, 3, 3, 3)
    assert motion.attitude(0.3).shape == (2, 3, 3, 3)
    assert motion.attitude(times).shape == (2, 3, 2, 2, 3, 3)
    assert motion.body_momentum(times).shape == (2, 3, 2, 2, 3)
    assert motion.angular_velocity(times).shape == (2, 3, 2, 2, 3)
    assert motion.base_position(times).shape == (2, 3, 2, 2, 3)
    assert motion.quat_xyzw(times).shape == (2, 3, 2, 2, 4)
    for i in range(2):
        for j in range(3):
            single = sp.reconstruct(deformation, momenta[i, 0], attitudes[j])
            bound = single.error_estimate + motion.error_estimate[i, j]
            assert apart(motion.attitude(times)[i, j], single.attitude(times)) <= bound
            near = {"rtol": 0, "atol": 1e-9}
            np.testing.assert_allclose(motion.body_momentum(times)[i, j], single.body_momentum(times), **near)
            np.testing.assert_allclose(motion.angular_velocity(times)[i, j], single.angular_velocity(times), **near)
            np.testing.assert_allclose(motion.base_position(times)[i, j], single.base_position(times), **near)
            np.testing.assert_allclose(motion.quat_xyzw(times)[i, j], single.quat_xyzw(times), **near)


@pytest.mark.parametrize("count", [1, 24, 25, 60])
def test_a_large_batch_equals_single_runs(count: int):
    """Few and many momenta take different ways through the integrator; one of them is zero."""
    deformation = articulated("satellite")
    momenta = np.stack([random_vector(k, 12.0 * k / 10.0) for k in range(count)])
    attitudes = np.stack([random_rotation(k) for k in range(count)])
    batch = sp.reconstruct(deformation, momenta, attitudes, tolerance=1e-10)
    assert np.all(batch.error_estimate <= 1e-10)
    for k in {0, count // 2, count - 1}:
        single = sp.reconstruct(deformation, momenta[k], attitudes[k], tolerance=1e-10)
        assert apart(batch.attitude(TIMES)[k], single.attitude(TIMES)) <= 2e-11


def test_zero_and_nonzero_momentum_in_one_batch():
    body, loop = body_of("cat"), random_loop(1, body_of("cat").n_shape)
    momenta = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.05]])
    motion = sp.reconstruct(sp.articulated(body, loop.path), momenta)
    for row, momentum in enumerate(momenta):
        truth = pinocchio_motion("cat", body.joint_names, loop, momentum, None, TIMES).attitude
        assert apart(motion.attitude(TIMES)[row], truth) < 1e-9
    np.testing.assert_array_equal(motion.body_momentum(TIMES)[0], np.zeros((41, 3)))


# ---- Quantities of a motion ---------------------------------------------------------------------------------------


def test_start_end_and_momentum_of_a_motion():
    momentum, attitude = random_vector(1, 12.0), random_rotation(1)
    motion = sp.reconstruct(articulated("satellite"), momentum, attitude)
    np.testing.assert_allclose(motion.attitude(0.0), attitude, rtol=0, atol=2e-15)
    np.testing.assert_array_equal(motion.final_attitude, motion.attitude(2.0))
    np.testing.assert_allclose(
        motion.body_momentum(TIMES), np.swapaxes(motion.attitude(TIMES), 1, 2) @ momentum, rtol=0, atol=1e-14
    )
    assert motion.duration == 2.0
    assert motion.tolerance == 1e-9
    assert motion.evaluations > 20


def test_angular_velocity_is_that_of_the_attitude():
    motion = sp.reconstruct(articulated("cat"), random_vector(1, 0.05), random_rotation(1), tolerance=1e-12)
    h = 1e-3
    for t in (0.2, 0.9, 1.7):
        ends = motion.attitude([t - 2 * h, t - h, t + h, t + 2 * h])
        slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * h)
        spin = motion.attitude(t).T @ slope
        omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        np.testing.assert_allclose(motion.angular_velocity(t), omega, rtol=0, atol=1e-7)


def test_momentum_from_rate_in_closed_form():
    """Pi = I omega + L_o (C 7), turned to inertial axes."""
    inertia, internal = np.diag([1.0, 2.0, 3.0]), np.array([0.1, -0.2, 0.5])
    deformation = sp.prescribed(
        lambda t: np.broadcast_to(inertia, (len(t), 3, 3)), lambda t: np.broadcast_to(internal, (len(t), 3)), 1.0
    )
    omega, attitude = np.array([0.3, 0.2, -1.0]), random_rotation(1)
    expected = inertia @ omega + internal
    np.testing.assert_allclose(sp.momentum_from_rate(deformation, omega), expected, rtol=0, atol=1e-15)
    turned = sp.momentum_from_rate(deformation, omega, attitude)
    np.testing.assert_allclose(turned, attitude @ expected, rtol=0, atol=1e-15)
    motion = sp.reconstruct(deformation, turned, attitude)
    np.testing.assert_allclose(motion.angular_velocity(0.0), omega, rtol=0, atol=1e-14)
    many = sp.momentum_from_rate(deformation, np.tile(omega, (4, 1)), attitude)
    np.testing.assert_allclose(many, np.tile(turned, (4, 1)), rtol=0, atol=1e-15)


def test_momentum_from_a_rate_later_in_the_motion():
    """Back to the start: of a rigid body by its closed form, of moving joints and wheels by the motion itself."""
    inertia, start = np.diag([1.0, 2.0, 2.5]), random_rotation(2)
    top = sp.EulerTop(inertia, np.array([0.3, 2.0, 1.0]))
    rigid, later = sp.rigid(inertia, 20.0), 17.0
    omega = np.linalg.solve(inertia, top.attitude(np.array([later]))[0].T @ [0.3, 2.0, 1.0])
    found = sp.momentum_from_rate(rigid, [omega, omega], start, time=later)
    np.testing.assert_allclose(found, [start @ [0.3, 2.0, 1.0]] * 2, rtol=0, atol=1e-10)
    motion = sp.reconstruct(articulated("cat"), random_vector(1, 0.05), start, tolerance=1e-12)
    for time in (0.4, motion.duration):
        found = sp.momentum_from_rate(motion.deformation, motion.angular_velocity(time), start, time=time)
        np.testing.assert_allclose(found, motion.momentum, rtol=0, atol=1e-12)
    satellite = body_of("satellite")
    others = [name for name in satellite.joint_names if name != "wheel_spin"]
    ends = np.zeros((2, len(others)))
    ends[1] = 0.3
    path = sp.ShapePath.waypoints([0.0, 3.0], ends, joint_names=others)
    moving = sp.reconstruct(sp.articulated(satellite, path, rotors={"wheel_spin": 2.0}), [1.0, 2.0, 3.0], start)
    found = sp.momentum_from_rate(moving.deformation, moving.angular_velocity(2.0), start, time=2.0)
    np.testing.assert_allclose(found, moving.momentum, rtol=0, atol=1e-8)
    with pytest.raises(TrajectoryError, match="lies outside the motion"):
        sp.momentum_from_rate(rigid, omega, time=21.0)


def test_base_position_of_a_rigid_link_away_from_its_centre():
    """R c + position is the centre of mass."""
    body = body_of("satellite")
    motion = sp.reconstruct(articulated("satellite"), random_vector(1, 12.0), random_rotation(1))
    centre = body.centre_of_mass(np.array([random_loop(1, body.n_shape).shape(t) for t in TIMES]))
    fallen = motion.base_position(TIMES, start=[1.0, 2.0, 3.0], velocity=[0.0, 1.0, 0.0], gravity=[0.0, 0.0, -9.81])
    carried = np.einsum("nij,nj->ni", motion.attitude(TIMES), centre)
    expected = np.stack([1.0 + 0 * TIMES, 2.0 + TIMES, 3.0 - 4.905 * TIMES**2], axis=-1)
    np.testing.assert_allclose(fallen + carried, expected, rtol=0, atol=1e-13)


def test_arguments_are_left_as_they_were():
    momentum, attitude = random_vector(1, 12.0), random_rotation(1)
    kept = momentum.copy(), attitude.copy()
    motion = sp.reconstruct(articulated("satellite"), momentum, attitude)
    momentum[:], attitude[:] = 0.0, 0.0
    np.testing.assert_array_equal(motion.momentum, kept[0])
    np.testing.assert_allclose(motion.initial_attitude, kept[1], rtol=0, atol=2e-15)


# ---- Wrong input --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        ({"momentum": [0.0, 0.0]}, ShapeError, r"momentum: expected shape \(..., 3\).*\(2,\)"),
        ({"momentum": 1.0}, ShapeError, "momentum"),
        ({"momentum": [0.0, np.nan, 0.0]}, ShapeError, r"momentum: entry \[1\] is nan"),
        ({"momentum": [0.0, np.inf, 0.0]}, ShapeError, r"momentum: entry \[1\] is inf"),
        ({"momentum": ["a", "b", "c"]}, ShapeError, "momentum: expected real numbers"),
        ({"attitude": np.eye(2)}, ShapeError, r"attitude: expected shape \(..., 3, 3\)"),
        ({"attitude": 1.1 * np.eye(3)}, ShapeError, "attitude: not a rotation"),
        ({"attitude": np.diag([1.0, 1.0, -1.0])}, ShapeError, "reflection"),
        ({"momentum": [0.0, 1e200, 0.0]}, ShapeError, "at most 1e\\+100"),
        ({"momentum": np.ones((2, 3)), "attitude": np.tile(np.eye(3), (3, 1, 1))}, ShapeError, "do not broadcast"),
        ({"method": "euler"}, UnknownNameError, "'euler'.*auto, spectral, dop853"),
        ({"tolerance": 1e-3}, ShapeError, "tolerance: a number from 1e-13 to 0.0001"),
        ({"tolerance": 0.0}, ShapeError, "tolerance"),
        ({"tolerance": -1e-9}, ShapeError, "tolerance"),
        ({"tolerance": 1e-14}, ShapeError, "tolerance"),
        ({"tolerance": [1e-9, 1e-9]}, ShapeError, "tolerance"),
        ({"tolerance": np.nan}, ShapeError, "tolerance"),
    ],
)
def test_wrong_arguments_are_named(arguments: dict, error: type, said: str):
    with pytest.raises(error, match=said):
        sp.reconstruct(articulated("cat_two_halves"), **{"momentum": [0.0, 0.0, 0.01], **arguments})


@pytest.mark.parametrize("t", [-0.1, 2.1, [0.0, 3.0]])
def test_times_outside_the_motion_are_named(t):
    motion = sp.reconstruct(articulated("cat_two_halves"), [0.0, 0.0, 0.01])
    for quantity in (motion.attitude, motion.body_momentum, motion.angular_velocity, motion.base_position):
        with pytest.raises(TrajectoryError, match="motion"):
            quantity(t)
    with pytest.raises(ShapeError, match="nan"):
        motion.attitude(np.nan)


def test_wrong_rates_and_falls_are_named():
    deformation = articulated("cat_two_halves")
    with pytest.raises(ShapeError, match="angular_velocity"):
        sp.momentum_from_rate(deformation, [1.0, 2.0])
    motion = sp.reconstruct(deformation, [0.0, 0.0, 0.01])
    with pytest.raises(ShapeError, match="gravity"):
        motion.base_position(0.5, gravity=-9.81)


def test_an_inertia_that_becomes_singular_is_named_with_its_time():
    def flattening(t):
        return np.stack([np.diag([1.0, 1.0, 0.5 - s]) for s in t])

    with pytest.raises(SingularInertiaError, match="positive"):
        sp.reconstruct(sp.prescribed(flattening, None, 0.9), [0.0, 0.0, 1.0])


def test_particles_that_line_up_are_named_with_their_time():
    def closing(t):
        spread = np.maximum(1.0 - 2.0 * t, 0.0)
        points, speeds = np.zeros((2, len(t), 3, 3))
        points[:, 0, 0], points[:, 1, 0], points[:, 2, 1] = 1.0, -1.0, spread
        speeds[:, 2, 1] = np.where(t < 0.5, -2.0, 0.0)
        return points, speeds

    deformation = sp.particles([1.0, 1.0, 1.0], closing, 1.0, breaks=[0.5])
    with pytest.raises(SingularInertiaError, match=r"at t = 0\.[5-9]\d* s is not positive definite"):
        sp.reconstruct(deformation, [0.0, 0.0, 1.0])


def test_what_another_method_needs_of_the_integrator_is_integrated_once(monkeypatch: pytest.MonkeyPatch):
    """Interpolant, phases, areas and sensitivities of a motion share one integration; so do its splits."""
    module = import_module("shapephase.reconstruction.reconstruction")
    momenta: list[float] = []

    def counted(sampler: Sampler, momentum: np.ndarray, tolerance: float, **further: Any) -> SteppedRotation:
        momenta.append(float(np.linalg.norm(momentum)))
        return stepped_rotation(sampler, momentum, tolerance, **further)

    lifts: list[SteppedRotation] = []

    def counted_lift(rotation: SteppedRotation, stored: Any) -> SteppedRotation:
        lifts.append(lift_along(rotation, stored))
        return lifts[-1]

    monkeypatch.setattr(module, "stepped_rotation", counted)
    monkeypatch.setattr(module, "lift_along", counted_lift)
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 3.0), [0.3, 1.0, 0.2], method="dop853")
    assert momenta == []
    for _ in range(3):
        _ = motion.interpolant, motion.amplification, motion.sensitivity
        motion.dynamic_phase(1.0), motion.solid_angle(1.0)
    assert len(momenta) == 1
    assert momenta[0] > 0.0
    for gauge in ("horizontal", "base", "horizontal"):
        sp.split(motion, gauge)
        sp.running_phases(motion, 1.0, gauge)
    assert len(momenta) == 1
    assert len(lifts) == 1


@pytest.mark.parametrize("magnitude", [1e6, 1e9, 1e99])
def test_more_turns_than_can_be_stepped_are_refused_before_memory_is_taken(magnitude):
    """The number of turns is known from the samples: the largest rate of turning times the duration bounds it."""
    body = sp.load_body("cat")
    path = random_loop(1, body.n_shape).path
    deformation = sp.articulated(body, path)
    tracemalloc.start()
    try:
        with pytest.raises(AccuracyNotReached, match=r"turns up to (.*) times in 2 s, .* shorten the motion") as raised:
            sp.reconstruct(deformation, [0.0, 0.0, magnitude])
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    turns = float(str(raised.value).split("up to ")[1].split()[0])
    least = np.linalg.eigvalsh(deformation.inertia(np.linspace(0.0, 2.0, 50))).min(axis=-1)
    assert 0.3 <= turns / (magnitude * np.mean(1.0 / least) * 2.0 / (2.0 * np.pi)) <= 3.0
    assert most < 50e6
