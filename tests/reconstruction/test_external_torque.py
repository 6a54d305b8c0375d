"""Motions under a torque from outside: thirty digits, closed forms, and the balances of momentum and energy."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import shapephase as sp
from shapephase.errors import AccuracyNotReached, ShapeError, TrajectoryError, UnknownNameError
from support import gravity_gradient_reference as reference
from support.independent import apart

MOMENTS = [float(one) for one in reference.MOMENTS]
KNOWN = json.loads(reference.FILE.read_text())["motions"]


def gravity(state):
    """Of a circular orbit of rate 1, begun on the x axis."""
    outward = state.attitude.T @ np.array([np.cos(state.time), np.sin(state.time), 0.0])
    return 3.0 * np.cross(outward, state.inertia @ outward)


def cat_motion(torque, **options):
    cat = sp.load_body("cat_two_halves")
    deformation = sp.articulated(cat, sp.examples.kane_scher(0.3, 1.0))
    return sp.reconstruct(deformation, [0.004, -0.002, 0.005], torque=torque, **options)


def stir(state):
    """Depends on all there is."""
    return [0.002 * np.cos(3.0 * state.time) * state.shape[0], 0.001, -0.01 * state.rate[2] * state.attitude[0, 0]]


@pytest.mark.parametrize("case", range(len(KNOWN)))
def test_a_body_in_the_gravity_gradient_moves_as_thirty_digits_say(case):
    """Three different moments; the measured estimate is above the true error at every time."""
    start = [float(one) for one in reference.STARTS[case]]
    motion = sp.reconstruct(sp.rigid(np.diag(MOMENTS), 10.0), start, torque=gravity, tolerance=1e-9)
    times = np.array([float(t) for t in reference.TIMES])
    known = np.array(KNOWN[case], dtype=float)
    errors = sp.so3.angle(sp.so3.transpose(sp.so3.matrix_from_quat(known[:, :4])) @ motion.attitude(times))
    assert errors.max() < 1e-9
    assert np.all(errors <= motion.error_in_time(times))
    np.testing.assert_allclose(motion.body_momentum(times), known[:, 4:], rtol=0, atol=motion.momentum_error + 1e-14)
    assert motion.error_estimate == motion.error_in_time(10.0) <= 1e-9


@pytest.mark.parametrize("largest", [0.3, 1.4])
def test_planar_libration_on_a_circular_orbit_is_a_pendulum(largest):
    """theta'' + (3/2) (I2 - I1)/I3 sin(2 theta) = 0: sin(theta) = k sn(w t + K), w^2 = 3 (I2 - I1)/I3."""
    first, second, third = MOMENTS
    fast = np.sqrt(3.0 * (second - first) / third)
    k2 = np.sin(largest) ** 2
    duration = 1.3 * 4.0 * ellipk(k2) / fast
    body = sp.rigid(np.diag(MOMENTS), duration)
    motion = sp.reconstruct(body, [0.0, 0.0, third], sp.so3.exp(np.array([0.0, 0.0, largest])), torque=gravity)
    times = np.linspace(0.0, duration, 60)
    swing = np.arcsin(np.sqrt(k2) * ellipj(fast * times + ellipk(k2), k2)[0])
    turned = sp.so3.exp((times + swing)[:, None] * np.array([0.0, 0.0, 1.0]))
    assert apart(motion.attitude(times), turned) < max(1e-10, motion.error_estimate)


def test_balances_of_momentum_and_energy():
    """What momentum and energy gain is what the torque gives, by quadrature of what the motion says of itself."""
    body = sp.rigid(np.diag(MOMENTS), 10.0)
    motion = sp.reconstruct(body, [0.3, 0.2, 2.0], torque=gravity, tolerance=1e-11)
    edges = motion.solution.times
    nodes, weights = sp.sphere.gauss_nodes(edges[:-1], edges[1:])
    times, weights = nodes.ravel(), weights.ravel()
    torque, omega = motion.torque(times), motion.angular_velocity(times)
    gained = weights @ np.einsum("nij,nj->ni", motion.attitude(times), torque)
    np.testing.assert_allclose(motion.final_momentum - motion.momentum(0.0), gained, rtol=0, atol=1e-10)
    work = weights @ np.sum(torque * omega, axis=1)
    energy = [0.5 * motion.angular_velocity(t) @ motion.body_momentum(t) for t in (0.0, 10.0)]
    assert motion.work(10.0) == pytest.approx(work, abs=1e-10)
    assert energy[1] - energy[0] == pytest.approx(work, abs=1e-10)


def test_energy_is_the_work_of_the_torque_and_of_the_joints():
    """The joints' by inverse dynamics; the torque acts on the base, which needs nothing else."""
    motion = cat_motion(stir, tolerance=1e-11)
    found = sp.joint_torques(motion)
    largest = np.abs(found.torque).max()
    assert np.abs(found.base_wrench).max() < 1e-12 * largest
    assert np.abs(motion.torque(found.times)).max() > 1e-2 * largest, "the torque must matter"
    change = np.diff(motion.deformation.kinetic_energy([0.0, 1.0], motion.angular_velocity([0.0, 1.0])))[0]
    whole = motion.work(1.0) + found.loads.work.sum()
    assert whole == pytest.approx(change, abs=1e-10 * found.loads.positive_work.sum())
    assert found.loads.energy_defect < 1e-10


@pytest.mark.full
def test_no_torque_and_a_tiny_one_go_the_same_way():
    """No branch: zeros and 1e-12 N m; what a small torque changes is linear in it."""
    free = sp.reconstruct(cat_motion(stir).deformation, [0.004, -0.002, 0.005], tolerance=1e-11)

    def moved(size):
        motion = cat_motion(lambda _: [size, 0.0, 0.0], tolerance=1e-11)
        return motion, sp.so3.log(free.final_attitude.T @ motion.final_attitude)

    none, turned = moved(0.0)
    assert np.abs(turned).max() < 1e-11
    np.testing.assert_allclose(none.final_momentum, free.momentum, rtol=0, atol=1e-16)
    tiny, _ = moved(1e-12)
    assert abs(tiny.evaluations - none.evaluations) <= 0.1 * none.evaluations
    small, twice = moved(1e-7)[1], moved(2e-7)[1]
    np.testing.assert_allclose(twice, 2.0 * small, rtol=0, atol=1e-3 * np.abs(small).max() + 1e-11)
    assert np.abs(small).max() > 1e-6


def test_axes_and_breaks():
    """A pulse of a thruster changes the momentum in space by its length, whichever way the body points."""
    pulse = sp.ExternalTorque(lambda s: [0.0, 0.3 * (1.0 < s.time < 1.001), 0.0], "space", breaks=[1.0, 1.001])
    body = sp.rigid(np.diag(MOMENTS), 5.0)
    motion = sp.reconstruct(body, [0.3, 0.2, 2.0], torque=pulse)
    np.testing.assert_allclose(motion.final_momentum, [0.3, 0.2003, 2.0], rtol=0, atol=1e-12)
    free = sp.reconstruct(body, [0.3, 0.2, 2.0])
    assert apart(motion.attitude(0.9), free.attitude(0.9)) < 1e-10
    own = sp.reconstruct(body, [0.3, 0.2, 2.0], torque=lambda s: s.attitude.T @ [0.1, 0.0, 0.0])
    fixed = sp.reconstruct(body, [0.3, 0.2, 2.0], torque=sp.ExternalTorque(lambda _: [0.1, 0.0, 0.0], "space"))
    assert apart(own.final_attitude, fixed.final_attitude) < 1e-10
    np.testing.assert_allclose(fixed.final_momentum, [0.8, 0.2, 2.0], rtol=0, atol=1e-12)


@pytest.mark.full
@pytest.mark.parametrize(("orbits", "factor"), [(3, 2.0), pytest.param(10, 30.0, marks=pytest.mark.full)])
def test_the_estimate_grows_where_the_motion_is_chaotic(orbits, factor):
    """Hyperion tumbles: an ellipsoid of 190, 145 and 114 km on an orbit of eccentricity 0.1, a period 2 pi.

    Its estimate grows like its errors, by a factor in each orbit, and holds against a sharper integration.
    """
    a, b, c = 190.0, 145.0, 114.0
    moments = np.array([b * b + c * c, a * a + c * c, a * a + b * b]) / (a * a + b * b)
    orbit = sp.bounds.KeplerOrbit.from_elements(1.0, 0.1, 0.0, 0.0, 0.0, 0.0, gm=1.0)

    def torque(state):
        away = orbit.position(state.time)
        distance = np.linalg.norm(away)
        outward = state.attitude.T @ (away / distance)
        return 3.0 / distance**3 * np.cross(outward, state.inertia @ outward)

    start = sp.so3.exp(np.array([0.1, 0.05, 0.4]))
    end = 2.0 * np.pi * orbits
    body = sp.rigid(np.diag(moments), end)
    motion = sp.reconstruct(body, start @ (moments * [0.05, 0.1, 1.3]), start, torque=torque, tolerance=1e-5)
    sharp = sp.reconstruct(body, motion.initial_momentum, start, torque=torque, tolerance=1e-8)
    times = np.linspace(1.0, end, 40)
    errors = sp.so3.angle(sp.so3.transpose(sharp.attitude(times)) @ motion.attitude(times))
    assert np.all(errors <= motion.error_in_time(times) + sharp.error_in_time(times))
    grown = motion.error_in_time(end) / motion.error_in_time(2.0 * np.pi)
    assert grown > factor
    with pytest.raises(AccuracyNotReached, match="errors"):
        sp.reconstruct(body, motion.initial_momentum, start, torque=torque, tolerance=1e-13)


def test_it_writes_a_table_and_refuses_what_it_cannot_do(tmp_path):
    motion = cat_motion(stir)
    motion.write_csv(tmp_path / "motion.csv")
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    assert len(table) == 201
    assert table["work_J"][-1] == motion.work(1.0)
    assert "work of the torque" in repr(motion)
    top = sp.rigid(np.eye(3), 1.0)
    with pytest.raises(ShapeError, match="numbers"):
        sp.reconstruct(top, [0.0, 0.0, 1.0], torque=lambda _: [1.0])
    with pytest.raises(ShapeError, match="motion"):
        sp.reconstruct(top, np.ones((2, 3)), torque=lambda _: np.zeros(3))
    with pytest.raises(UnknownNameError, match="method"):
        sp.reconstruct(top, np.ones(3), torque=lambda _: np.zeros(3), method="spectral")
    with pytest.raises(UnknownNameError, match="axes"):
        sp.ExternalTorque(lambda _: np.zeros(3), "sky")
    with pytest.raises(TrajectoryError):
        sp.reconstruct(top, np.ones(3), torque=sp.ExternalTorque(lambda _: np.zeros(3), breaks=[2.0]))
    with pytest.raises(ShapeError, match="torque"):
        sp.reconstruct(top, np.ones(3), torque=[0.0, 0.0, 1.0])


@pytest.mark.full
def test_the_torque_that_a_free_motion_neglects_is_as_large_as_its_estimate_says():
    """The first-order estimate of a satellite's gravity gradient against the motion with that torque."""
    orbit = sp.bounds.KeplerOrbit.from_state([7.0e6, 0.0, 0.0], [0.0, 7546.05, 0.0], gm=3.986e14)
    body = sp.rigid(np.diag([80.0, 110.0, 150.0]), 100.0)
    start = [0.0, 0.4, 2.0]
    free = sp.reconstruct(body, start)
    true = sp.reconstruct(
        body,
        start,
        torque=lambda s: sp.bounds.gravity_gradient_torque(s.inertia, s.attitude.T @ orbit.position(s.time), 3.986e14),
    )
    times = np.linspace(0.0, 100.0, 101)
    apart_by = sp.so3.angle(sp.so3.transpose(free.attitude(times)) @ true.attitude(times)).max()
    assert apart_by == pytest.approx(sp.bounds.gravity_torque_estimate(free, orbit).attitude_error, rel=0.05)
