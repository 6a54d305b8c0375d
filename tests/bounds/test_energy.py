"""E_t along motions, its rate, the kinetic energy and the level sets, against the particles and Euler's equations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import shapephase as sp
from shapephase.bounds import (
    energy_along,
    energy_rate,
    frozen_polhode,
    homoclinic_energy,
    kinetic_energy_along,
    momentum_energy,
)
from support.independent import cross
from support.random_deformations import KINDS, random_case

PARTICLES = [KINDS.index("particles") + k * len(KINDS) for k in range(3)]
DIAGONAL = KINDS.index("diagonal")


@pytest.fixture(scope="module", params=PARTICLES)
def swarm(request):
    _, deformation, momentum = random_case(request.param)
    return sp.reconstruct(deformation, momentum, tolerance=1e-11)


def particle_energies(motion, times):
    """T and T_0 from the inertial velocities of every particle, by their positions at the attitude."""
    source = motion.deformation.description
    points, speeds = (np.asarray(part) for part in source.positions(times))
    share = source.masses / source.masses.sum()
    points, speeds = points - (share @ points)[:, None], speeds - (share @ speeds)[:, None]
    attitude, omega = motion.attitude(times), motion.angular_velocity(times)
    inertial = (np.cross(omega[:, None], points) + speeds) @ np.swapaxes(attitude, -1, -2)
    return (
        0.5 * np.einsum("m,nmi,nmi->n", source.masses, inertial, inertial),
        0.5 * np.einsum("m,nmi,nmi->n", source.masses, speeds, speeds),
    )


def pieces(motion, times):
    """I^-1, L_o and Pi."""
    inverse = np.linalg.inv(motion.deformation.inertia(times))
    return inverse, motion.deformation.internal_momentum(times), motion.body_momentum(times)


def differentiated(function, times, step):
    """By differences of order eight."""
    total = 0.0
    for k, weight in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), start=1):
        total = total + weight * (function(times + k * step) - function(times - k * step)) / step
    return total


def inner_times(motion, count=25):
    return np.linspace(0.1, 0.9, count) * motion.duration


def test_energy_is_the_quadratic_form_e1(rng):
    moments, momentum = np.array([1.0, 2.0, 4.0]), np.array([1.0, 2.0, 4.0])
    assert momentum_energy(np.diag(moments), momentum) == 3.5
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert momentum_energy(frame @ np.diag(moments) @ frame.T, frame @ momentum) == pytest.approx(3.5, rel=1e-14)
    assert momentum_energy(np.stack([np.eye(3)] * 4), np.ones(3)).shape == (4,)


def test_energy_of_a_rigid_motion_is_kept_e1(rng):
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 9.0), rng.normal(size=(5, 3)), tolerance=1e-11)
    energy = energy_along(motion, np.linspace(0.0, 9.0, 50))
    assert energy.shape == (5, 50)
    assert energy == pytest.approx(np.broadcast_to(energy[:, :1], energy.shape), rel=1e-10)
    assert energy_along(motion, 4.5).shape == (5,)
    assert energy_along(sp.reconstruct(motion.deformation, motion.momentum[0]), 4.5) == pytest.approx(energy[0, 0])


def test_energy_identity_with_the_kinetic_energy_e2(swarm):
    """E_t = T - T_0 + L_o.I^-1 L_o/2 with the energies summed over particles."""
    times = inner_times(swarm)
    inverse, internal, _ = pieces(swarm, times)
    whole, shape_only = particle_energies(swarm, times)
    rest = 0.5 * np.einsum("ni,nij,nj->n", internal, inverse, internal)
    assert energy_along(swarm, times) == pytest.approx(whole - shape_only + rest, rel=1e-10)


def test_kinetic_energy_is_that_of_the_particles_e2(swarm):
    times = inner_times(swarm)
    assert kinetic_energy_along(swarm, times) == pytest.approx(particle_energies(swarm, times)[0], rel=1e-10)


def test_kinetic_energy_needs_the_masses_e2():
    _, deformation, momentum = random_case(DIAGONAL)
    with pytest.raises(sp.ShapePhaseError, match="inertia"):
        kinetic_energy_along(sp.reconstruct(deformation, momentum), 0.1)


@pytest.mark.parametrize("seed", range(len(KINDS)))
def test_energy_rate_is_the_derivative_of_the_energy_e3(seed):
    """Along a motion, for every kind of deformation, with and without internal momentum."""
    _, deformation, momentum = random_case(seed)
    motion = sp.reconstruct(deformation, momentum, tolerance=1e-11)
    times = inner_times(motion)
    expected = differentiated(lambda t: energy_along(motion, t), times, 2e-3 * motion.duration)
    rate = energy_rate(motion, times)
    assert rate.total == pytest.approx(expected, abs=1e-7 * (np.abs(expected).max() + 1e-3))
    if not np.any(deformation.internal_momentum(times)):
        assert not np.any(rate.by_internal_momentum)
        assert rate.by_inertia == pytest.approx(expected, abs=1e-7 * (np.abs(expected).max() + 1e-3))


def test_internal_momentum_and_not_that_of_the_shape_itself_c_e9(swarm):
    """Printed L(d_0) is the sum of m d_0 x d_0 = 0: then neither the rate nor k(t) is right; with L(d_0') both are."""
    times = inner_times(swarm)
    inverse, internal, _ = pieces(swarm, times)
    points, _ = (np.asarray(part) for part in swarm.deformation.description.positions(times))
    printed = np.einsum("m,nmi->ni", swarm.deformation.description.masses, np.cross(points, points))
    assert np.all(printed == 0.0)
    expected = differentiated(lambda t: energy_along(swarm, t), times, 2e-3 * swarm.duration)
    rate = energy_rate(swarm, times)
    assert np.abs(rate.by_inertia - expected).max() > 1e-2 * np.abs(expected).max()
    assert rate.total == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
    whole, shape_only = particle_energies(swarm, times)
    rest = 0.5 * np.einsum("ni,nij,nj->n", internal, inverse, internal)
    assert np.abs(whole - shape_only - energy_along(swarm, times)).max() > 0.5 * rest.max() > 1e-4 * whole.max()


def test_rate_of_the_inverse_and_not_of_its_product_c_e8(swarm):
    """Pi.(d/dt)[I^-1 Pi]/2 is the rate only without internal momentum."""

    def printed(motion, times):
        def turned(t):
            inverse, _, pi = pieces(motion, t)
            return np.einsum("nij,nj->ni", inverse, pi)

        change = differentiated(turned, times, 2e-3 * motion.duration)
        return 0.5 * np.sum(motion.body_momentum(times) * change, axis=1)

    _, deformation, momentum = random_case(DIAGONAL)
    still = sp.reconstruct(deformation, momentum, tolerance=1e-11)
    times = inner_times(still)
    rate = energy_rate(still, times).by_inertia
    assert printed(still, times) == pytest.approx(rate, abs=1e-7 * np.abs(rate).max())
    times = inner_times(swarm)
    by_inertia = energy_rate(swarm, times).by_inertia
    assert np.abs(printed(swarm, times) - by_inertia).max() > 1e-3 * np.abs(by_inertia).max()


def growing(duration=2.0):
    """I = (1, 1.4, 1.6 -> 2.2)."""
    return sp.prescribed(
        lambda t: np.stack([np.ones_like(t), 1.4 + 0.0 * t, 1.6 + 0.6 * t / duration], -1)[:, :, None] * np.eye(3),
        None,
        duration,
    )


def test_rate_of_case_three_needs_its_half_c_e7():
    """dE/dt = Pi_3^2 (1/I_3)'/2; the printed one is twice as much."""
    motion = sp.reconstruct(growing(), [0.6, 0.1, 0.8], tolerance=1e-11)
    times = inner_times(motion)
    third = 1.6 + 0.3 * times
    half = 0.5 * motion.body_momentum(times)[:, 2] ** 2 * (-0.3 / third**2)
    expected = differentiated(lambda t: energy_along(motion, t), times, 4e-3)
    assert half == pytest.approx(expected, rel=1e-8)
    assert energy_rate(motion, times).total == pytest.approx(half, rel=1e-9)
    assert np.all(np.abs(2.0 * half - expected) > 0.9 * np.abs(expected))


@pytest.mark.parametrize(
    ("moments", "momentum", "regime"),
    [
        ((1.0, 2.0, 3.0), (1.0, 0.4, 0.2), "circling"),
        ((1.0, 2.0, 3.0), (0.2, 0.4, -1.0), "circling"),
        ((2.0, 2.0, 3.0), (0.3, 0.4, 1.0), "axisymmetric"),
        ((1.0, 2.0, 2.0), (1.0, 0.4, 0.2), "axisymmetric"),
        ((1.0, 2.0, 3.0), (0.0, 0.0, 1.5), "steady"),
        ((2.0, 2.0, 2.0), (0.3, 0.4, 1.0), "spherical"),
    ],
)
def test_frozen_polhode_is_the_orbit_of_the_frozen_body_e4(moments, momentum, regime):
    """On both the sphere and the ellipsoid, through the start, closed, and along Euler's equations."""
    pi, inverse = np.array(momentum), 1.0 / np.array(moments)
    curve = frozen_polhode(sp.rigid(np.diag(moments), 1.0), 0.5, pi)
    assert curve.regime == regime
    assert np.linalg.norm(curve.points, axis=1) == pytest.approx(np.full(200, np.linalg.norm(pi)), rel=1e-13)
    energies = 0.5 * np.sum(curve.points**2 * inverse, axis=1)
    assert energies == pytest.approx(np.full(200, curve.energy), rel=1e-13)
    assert curve.energy == pytest.approx(0.5 * np.sum(pi**2 * inverse), rel=1e-14)
    assert curve.points[[0, -1]] == pytest.approx(np.stack([pi, pi]), abs=1e-13)
    if np.isfinite(curve.period):
        flow = solve_ivp(lambda _, p: cross(p, p * inverse), (0.0, curve.period), pi, rtol=1e-11, atol=1e-12)
        assert flow.y[:, -1] == pytest.approx(pi, abs=1e-8)
        gaps = np.linalg.norm(flow.y.T[:, None] - curve.points, axis=2).min(axis=1)
        assert gaps.max() < 0.6 * np.linalg.norm(np.diff(curve.points, axis=0), axis=1).max() + 1e-9


def test_frozen_polhode_of_a_moment_of_the_deformation_e4():
    """In any axes and at any time, and the true solution starts along it where there is no internal momentum."""
    _, deformation, momentum = random_case(KINDS.index("turned frame"))
    motion = sp.reconstruct(deformation, momentum)
    t = 0.37 * motion.duration
    pi, inverse = motion.body_momentum(t), np.linalg.inv(deformation.inertia(t))
    curve = frozen_polhode(deformation, t, pi, count=400)
    energies = 0.5 * np.einsum("ni,ij,nj->n", curve.points, inverse, curve.points)
    assert energies == pytest.approx(np.full(400, energy_along(motion, t)), rel=1e-12)
    along = curve.points[1] - curve.points[0]
    rate = np.cross(pi, inverse @ pi)
    assert abs(along @ rate) / np.linalg.norm(along) / np.linalg.norm(rate) == pytest.approx(1.0, abs=1e-3)


def test_frozen_polhode_on_the_separatrix_e4():
    """Half a great circle from one direction of the intermediate axis to the other, through the start."""
    pi = np.array([np.sqrt(1 / 3), 0.0, 1.0])
    curve = frozen_polhode(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), 0.0, pi, count=401)
    assert curve.regime in ("separatrix", "circling")
    assert curve.energy == pytest.approx(curve.homoclinic_energy, rel=1e-14)
    assert np.linalg.norm(curve.points - pi, axis=1).min() < 1e-2
    energies = 0.5 * np.sum(curve.points**2 / [1.0, 2.0, 3.0], axis=1)
    assert energies == pytest.approx(np.full(401, curve.homoclinic_energy), rel=1e-13)


def test_frozen_polhode_checks_its_count_e4():
    for count in (1, 2.5, True):
        with pytest.raises(sp.ShapePhaseError, match="count"):
            frozen_polhode(sp.rigid(np.eye(3), 1.0), 0.0, [1.0, 0.0, 0.0], count=count)


def test_homoclinic_energy_is_that_of_the_intermediate_axis_e5():
    deformation = growing()
    times = np.linspace(0.0, 2.0, 7)
    inverse = np.linalg.inv(deformation.inertia(times))
    expected = [0.5 * 1.7**2 * np.sort(np.linalg.eigvalsh(m))[1] for m in inverse]
    assert homoclinic_energy(deformation, times, 1.7) == pytest.approx(expected, rel=1e-13)
    assert homoclinic_energy(deformation, 0.0, 1.7) == pytest.approx(0.5 * 1.7**2 / 1.4, rel=1e-13)


def test_principal_axes_are_equilibria_e15():
    """Without internal momentum and with axes that stay, Pi along one stays there, whatever the moments do."""
    _, deformation, _ = random_case(DIAGONAL)
    for axis in np.eye(3):
        motion = sp.reconstruct(deformation, 1.3 * axis)
        momenta = motion.body_momentum(np.linspace(0.0, motion.duration, 40))
        assert momenta == pytest.approx(np.broadcast_to(1.3 * axis, momenta.shape), abs=1e-12)


def test_principal_axes_are_no_equilibria_with_internal_momentum_e15():
    _, deformation, _ = random_case(KINDS.index("diagonal, internal momentum"))
    motion = sp.reconstruct(deformation, [0.0, 0.0, 1.3])
    assert np.linalg.norm(motion.body_momentum(motion.duration) - [0.0, 0.0, 1.3]) > 1e-3
