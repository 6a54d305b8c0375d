"""Euler angles against products of elementary turns, CasADi's derivatives, the printed formulas and integration."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from shapephase import so3
from shapephase.errors import ChartPoleError, ShapeError, ShapePhaseError, SingularInertiaError, UnphysicalInertiaError
from shapephase.rigid_body import ZXZ, ZYZ, canonical_bracket, precession_rate
from support.independent import assert_within

CHARTS = pytest.mark.parametrize("chart", [ZXZ, ZYZ], ids=["zxz", "zyz"])
THIRD = np.array([0.0, 0.0, 1.0])
# An attitude is the product of three turns: entries are sums of up to three products of sines and cosines, each right
# to a unit of rounding, of angles up to pi that were rounded when they were found (by up to two units of 1 each).
ROUNDING = 16.0 * np.finfo(float).eps
SYMPLECTIC = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])


def random_angles(rng, count):
    """Inside the chart, theta from 0.05 to pi - 0.05."""
    return np.stack(
        [rng.uniform(-3.1, 3.1, count), rng.uniform(0.05, np.pi - 0.05, count), rng.uniform(-3.1, 3.1, count)], axis=-1
    )


def random_inertia(rng):
    root = rng.normal(size=(3, 3))
    return root @ root.T + 0.5 * np.eye(3)


def turn(axis, angle):
    """Rodrigues' formula for a unit axis."""
    across = so3.hat(np.asarray(axis, dtype=float))
    return np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across


def symbolic_turn(axis, angle):
    c, s = ca.cos(angle), ca.sin(angle)
    rows = {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis]
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def symbolic_attitude(chart, angles):
    return ca.mtimes([symbolic_turn(axis, angles[i]) for i, axis in enumerate(chart.name)])


def symbolic_vee(matrix):
    return ca.vertcat(matrix[2, 1], matrix[0, 2], matrix[1, 0])


def symbolic_velocities(chart):
    """Functions of angles and rates: Omega and omega, from R^T R' and R' R^T by the chain rule."""
    angles, rates = ca.SX.sym("angles", 3), ca.SX.sym("rates", 3)
    attitude = symbolic_attitude(chart, angles)
    rate = ca.reshape(ca.jacobian(ca.vec(attitude), angles) @ rates, 3, 3)
    body, spatial = symbolic_vee(attitude.T @ rate), symbolic_vee(rate @ attitude.T)
    return angles, rates, body, spatial


def rows(function, *columns):
    """A CasADi function of column vectors, over rows."""
    return np.array([np.array(function(*row)).squeeze() for row in zip(*columns, strict=True)])


def printed_p_matrix(phi, theta, psi):
    """The matrix P of Marsden and Ratiu after (15.6.3)."""
    cf, sf, ct, st, cp, sp = np.cos(phi), np.sin(phi), np.cos(theta), np.sin(theta), np.cos(psi), np.sin(psi)
    return np.array(
        [
            [cp * cf - ct * sf * sp, cp * sf + ct * cf * sp, st * sp],
            [-sp * cf - ct * sf * cp, -sp * sf + ct * cf * cp, st * cp],
            [st * sf, -st * cf, ct],
        ]
    )


def printed_body_velocity(angles, rates):
    """Omega of Marsden and Ratiu (15.7.1)."""
    (_, theta, psi), (dphi, dtheta, dpsi) = angles, rates
    return np.array(
        [
            dtheta * np.cos(psi) + dphi * np.sin(psi) * np.sin(theta),
            -dtheta * np.sin(psi) + dphi * np.cos(psi) * np.sin(theta),
            dphi * np.cos(theta) + dpsi,
        ]
    )


def printed_spatial_velocity(angles, rates):
    """omega of Marsden and Ratiu (15.7.1)."""
    (phi, theta, _), (dphi, dtheta, dpsi) = angles, rates
    return np.array(
        [
            dtheta * np.cos(phi) + dpsi * np.sin(phi) * np.sin(theta),
            dtheta * np.sin(phi) - dpsi * np.cos(phi) * np.sin(theta),
            dphi + dpsi * np.cos(theta),
        ]
    )


@CHARTS
def test_attitude_is_the_product_of_three_turns_j1(chart):
    rng = np.random.default_rng(1)
    middle = np.array([*chart.node, 0.0])
    for phi, theta, psi in rng.uniform(-7.0, 7.0, (40, 3)):
        product = turn(THIRD, phi) @ turn(middle, theta) @ turn(THIRD, psi)
        assert np.abs(chart.attitude([phi, theta, psi]) - product).max() < ROUNDING
    angles = rng.uniform(-3.0, 3.0, (5, 4, 3))
    scipy = Rotation.from_euler(chart.name.upper(), angles.reshape(-1, 3)).as_matrix().reshape(5, 4, 3, 3)
    assert np.abs(chart.attitude(angles) - scipy).max() < ROUNDING


def test_printed_matrix_is_the_transpose_j1():
    rng = np.random.default_rng(2)
    for angles in random_angles(rng, 30):
        assert np.abs(ZXZ.attitude(angles).T - printed_p_matrix(*angles)).max() < ROUNDING


def test_the_printed_attitude_contradicts_the_printed_velocities_m_e5():
    """(15.6.6) has [R] = P; with it Omega and omega of (15.7.1) are wrong, with R = P^T both are right."""
    rng = np.random.default_rng(3)
    step = 1e-6
    for angles, rates in zip(random_angles(rng, 20), rng.normal(size=(20, 3)), strict=True):
        ahead, here, behind = (printed_p_matrix(*(angles + s * rates)) for s in (step, 0.0, -step))
        for sign, attitude, rate in (
            (False, here, (ahead - behind) / (2 * step)),
            (True, here.T, (ahead - behind).T / (2 * step)),
        ):
            body = so3.vee(attitude.T @ rate)
            spatial = so3.vee(rate @ attitude.T)
            assert (np.abs(body - printed_body_velocity(angles, rates)).max() < 1e-8) == sign
            assert (np.abs(spatial - printed_spatial_velocity(angles, rates)).max() < 1e-8) == sign
        assert np.abs(ZXZ.attitude(angles) - here).max() > 1e-3


def test_where_theta_is_zero_angles_are_not_unique_m_e15():
    """There the attitude knows phi + psi alone, by SciPy's turns; the differential loses one rank of three, not all."""
    for theta, sign in ((0.0, 1.0), (np.pi, -1.0)):
        angles = np.array([[0.3, theta, 1.1], [0.3 + 0.5, theta, 1.1 - sign * 0.5]])
        first, second = Rotation.from_euler("ZXZ", angles).as_matrix()
        assert np.abs(first - second).max() < ROUNDING
        assert np.abs(ZXZ.attitude(angles) - first).max() < ROUNDING
    step = 1e-6
    for theta, rank in ((0.0, 2), (1.0, 3)):
        around = [Rotation.from_euler("ZXZ", np.array([0.0, theta, 0.0]) + step * e).as_rotvec() for e in np.eye(3)]
        here = Rotation.from_euler("ZXZ", [0.0, theta, 0.0]).as_rotvec()
        assert np.linalg.matrix_rank((np.array(around) - here) / step, tol=1e-3) == rank


@CHARTS
def test_angular_velocities_are_the_derivative_of_the_attitude_j2(chart):
    rng = np.random.default_rng(4)
    angles, rates = random_angles(rng, 50), rng.normal(size=(50, 3))
    q, dq, body, spatial = symbolic_velocities(chart)
    body, spatial = (rows(ca.Function("f", [q, dq], [v]), angles, rates) for v in (body, spatial))
    assert np.abs(chart.body_angular_velocity(angles, rates) - body).max() < 5e-15
    assert np.abs(chart.spatial_angular_velocity(angles, rates) - spatial).max() < 5e-15
    scale = 1.0 / np.sin(angles[:, 1:2])
    assert np.abs((chart.rates(angles, body) - rates) / scale).max() < 1e-14
    assert np.abs((chart.rates_from_spatial(angles, spatial) - rates) / scale).max() < 1e-14
    turned = so3.apply(chart.attitude(angles), body)
    assert np.abs(turned - spatial).max() < 5e-15


@CHARTS
def test_momenta_are_components_of_the_angular_momentum_j3(chart):
    """p_phi is along the inertial third axis, p_psi along the body's, p_theta along the line of nodes."""
    rng = np.random.default_rng(8)
    angles, momentum = random_angles(rng, 30), rng.normal(size=(30, 3))
    p = chart.conjugate_momenta(angles, momentum)
    attitude = chart.attitude(angles)
    spatial = so3.apply(attitude, momentum)
    nodes = np.stack([np.cos(angles[:, 0]), np.sin(angles[:, 0]), np.zeros(30)], axis=-1)
    if chart is ZYZ:
        nodes = np.cross(THIRD, nodes)
    assert np.abs(p[:, 0] - spatial[:, 2]).max() < 3e-15
    assert np.abs(p[:, 1] - np.sum(nodes * spatial, axis=-1)).max() < 3e-15
    assert np.array_equal(p[:, 2], momentum[:, 2])
    assert np.abs(np.cross(THIRD, attitude[:, :, 2]) - np.sin(angles[:, 1:2]) * nodes).max() < 3e-15


@CHARTS
def test_body_momentum_is_the_inverse_j4(chart):
    rng = np.random.default_rng(9)
    angles, p = random_angles(rng, 60), rng.normal(size=(60, 3))
    back = chart.conjugate_momenta(angles, chart.body_momentum(angles, p))
    assert np.abs((back - p) * np.sin(angles[:, 1:2])).max() < 3e-15


@CHARTS
def test_kinetic_energy_three_ways_j5(chart):
    rng = np.random.default_rng(11)
    inertia = random_inertia(rng)
    angles, rates = random_angles(rng, 40), rng.normal(size=(40, 3))
    momentum = chart.body_angular_velocity(angles, rates) @ inertia
    p = chart.conjugate_momenta(angles, momentum)
    direct = 0.5 * np.sum(momentum * np.linalg.solve(inertia, momentum.T).T, axis=-1)
    assert np.abs(chart.kinetic_energy(inertia, angles, rates) / direct - 1.0).max() < 1e-13
    assert np.abs(chart.hamiltonian(inertia, angles, p) / direct - 1.0).max() < 1e-11
    assert np.abs(0.5 * np.sum(p * rates, axis=-1) / direct - 1.0).max() < 1e-12


@CHARTS
def test_hamilton_equations_are_the_derivatives_of_the_energy_j6(chart):
    """The energy is built from R alone, as the inverse quadratic form of that in the rates."""
    rng = np.random.default_rng(13)
    inertia = random_inertia(rng)
    q, dq, body, _ = symbolic_velocities(chart)
    p = ca.SX.sym("p", 3)
    mass = ca.hessian(0.5 * ca.dot(body, inertia @ body), dq)[0]
    energy = 0.5 * ca.dot(p, ca.solve(mass, p))
    by_q, by_p = (ca.Function("d", [q, p], [ca.gradient(energy, v)]) for v in (q, p))
    angles, momenta = random_angles(rng, 40), rng.normal(size=(40, 3))
    rates, momentum_rates = chart.hamilton_equations(inertia, angles, momenta)
    scale = 1.0 / np.sin(angles[:, 1:2]) ** 3
    assert np.abs((rates - rows(by_p, angles, momenta)) / scale).max() < 1e-13
    assert np.abs((momentum_rates + rows(by_q, angles, momenta)) / scale).max() < 1e-12
    assert not momentum_rates[:, 0].any()


@CHARTS
def test_hamilton_equations_give_eulers_equations_j6(chart):
    rng = np.random.default_rng(14)
    inertia = random_inertia(rng)
    angles, momenta = random_angles(rng, 60), rng.normal(size=(60, 3))
    rates, momentum_rates = chart.hamilton_equations(inertia, angles, momenta)
    momentum = chart.body_momentum(angles, momenta)
    jacobian = chart.body_momentum_jacobian(angles, momenta)
    chain = so3.apply(jacobian, np.concatenate([rates, momentum_rates], axis=-1))
    velocity = np.linalg.solve(inertia, momentum.T).T
    scale = 1.0 / np.sin(angles[:, 1:2]) ** 4
    assert np.abs((chain - np.cross(momentum, velocity)) / scale).max() < 1e-13
    assert np.abs((chart.body_angular_velocity(angles, rates) - velocity) / scale).max() < 1e-13


@CHARTS
def test_jacobian_takes_the_canonical_structure_to_hat_of_pi_j7(chart):
    rng = np.random.default_rng(17)
    angles, momenta = random_angles(rng, 50), rng.normal(size=(50, 3))
    jacobian = chart.body_momentum_jacobian(angles, momenta)
    structure = jacobian @ SYMPLECTIC @ so3.transpose(jacobian)
    scale = 1.0 / np.sin(angles[:, 1])[:, None, None] ** 3
    assert np.abs((structure - so3.hat(chart.body_momentum(angles, momenta))) / scale).max() < 2e-14
    rotated = canonical_bracket(jacobian[:, 0], jacobian[:, 1])
    assert np.abs((rotated + chart.body_momentum(angles, momenta)[:, 2]) / scale[:, 0, 0]).max() < 2e-14


@CHARTS
def test_jacobian_is_the_derivative_j7(chart):
    rng = np.random.default_rng(18)
    q, dq, body, _ = symbolic_velocities(chart)
    p = ca.SX.sym("p", 3)
    momentum = ca.solve(ca.jacobian(body, dq).T, p)
    derivative = ca.Function("d", [q, p], [ca.jacobian(momentum, ca.vertcat(q, p))])
    for angles, momenta in zip(random_angles(rng, 30), rng.normal(size=(30, 3)), strict=True):
        error = np.abs(chart.body_momentum_jacobian(angles, momenta) - np.array(derivative(angles, momenta))).max()
        assert error < 2e-14 / np.sin(angles[1]) ** 3


@CHARTS
def test_the_chart_is_a_bijection_inside_its_domain_j8(chart):
    rng = np.random.default_rng(19)
    angles = random_angles(rng, 500)
    assert np.abs(chart.angles(chart.attitude(angles)) - angles).max() < 2e-14
    attitudes = Rotation.random(500, random_state=20).as_matrix()
    found = chart.angles(attitudes)
    # The given matrices are rotations to rounding only.
    assert np.abs(chart.attitude(found) - attitudes).max() < 2.0 * ROUNDING
    assert np.all((found[:, 1] >= 0.0) & (found[:, 1] <= np.pi))
    assert np.all((np.abs(found[:, ::2]) <= np.pi) & (found[:, ::2] > -np.pi))
    assert chart.is_regular(angles).all()


@CHARTS
@pytest.mark.parametrize("near", [1e-3, 1e-7, 1e-9, 1e-12, 3e-15])
def test_next_to_a_pole_the_attitude_is_kept_j8(chart, near):
    for theta in (near, np.pi - near):
        angles = np.array([0.7, theta, -1.9])
        attitude = chart.attitude(angles)
        found = chart.angles(attitude)
        assert np.abs(chart.attitude(found) - attitude).max() < ROUNDING
        assert abs(found[1] - theta) < 4e-16
        assert np.abs(found - angles).max() < 1e-15 + 4e-16 / near


@CHARTS
def test_at_a_pole_theta_is_exact_and_psi_zero_j8(chart):
    rng = np.random.default_rng(21)
    middle = np.array([*chart.node, 0.0])
    for phi, psi in rng.uniform(-3.0, 3.0, (30, 2)):
        for theta, whole in ((0.0, phi + psi), (np.pi, phi - psi)):
            attitude = turn(THIRD, phi) @ np.round(turn(middle, theta)) @ turn(THIRD, psi)
            found = chart.angles(attitude)
            assert found[1] == theta
            assert found[2] == 0.0
            assert abs(so3.wrap(found[0] - whole)) < 1e-14
            assert np.abs(chart.attitude(found) - attitude).max() < ROUNDING
    assert np.array_equal(chart.angles(np.eye(3)), np.zeros(3))


@CHARTS
@pytest.mark.parametrize("theta", [0.0, np.pi, -np.pi, 2 * np.pi, 1e-9, np.pi - 1e-9])
def test_poles_are_refused_j8(chart, theta):
    angles, vector = np.array([[0.1, 1.0, 0.2], [0.1, theta, 0.2]]), np.ones(3)
    assert chart.is_regular(angles).tolist() == [True, False]
    for refused in (
        lambda: chart.rates(angles, vector),
        lambda: chart.rates_from_spatial(angles, vector),
        lambda: chart.conjugate_momenta(angles, vector),
        lambda: chart.body_momentum(angles, vector),
        lambda: chart.body_momentum_jacobian(angles, vector),
        lambda: chart.hamiltonian(np.eye(3), angles, vector),
        lambda: chart.hamilton_equations(np.eye(3), angles, vector),
    ):
        with pytest.raises(ChartPoleError, match="theta"):
            refused()
    assert abs(np.linalg.det(chart.body_rate_matrix(angles[1]))) < 1e-8
    assert np.isfinite(chart.kinetic_energy(np.eye(3), angles, vector)).all()
    assert issubclass(ChartPoleError, ShapePhaseError)


@CHARTS
def test_volume_is_the_sine_of_theta_j8(chart):
    angles = random_angles(np.random.default_rng(22), 30)
    for matrix in (chart.body_rate_matrix(angles), chart.spatial_rate_matrix(angles)):
        assert np.abs(np.abs(np.linalg.det(matrix)) - np.sin(angles[:, 1])).max() < 1e-15


@CHARTS
def test_continuous_angles_follow_many_turns(chart):
    t = np.linspace(0.0, 40.0, 4001)
    angles = np.stack([3.0 * t, 1.5 + 1.4 * np.sin(t), -5.0 * t + 1.0], axis=-1)
    found = chart.continuous_angles(chart.attitude(angles))
    assert np.abs(found - found[0] + angles[0] - angles).max() < 1e-12
    assert np.abs(so3.wrap(found[0] - angles[0])).max() < 1e-13


@CHARTS
def test_continuous_angles_keep_the_sum_past_a_pole(chart):
    """Right over theta = 0 and pi: phi and psi jump by half turns, the attitude and the known combination do not."""
    middle = np.array([*chart.node, 0.0])
    tilt = np.linspace(-0.5, 2.0 * np.pi, 201)
    exact = np.concatenate([tilt, [0.0, np.pi]])
    exact.sort()
    attitudes = np.stack([turn(THIRD, 0.4 + a) @ turn(middle, a) @ turn(THIRD, 0.2) for a in exact])
    found = chart.continuous_angles(attitudes)
    assert np.abs(chart.attitude(found) - attitudes).max() < 3e-15
    total, difference = found[:, 0] + found[:, 2], found[:, 0] - found[:, 2]
    north, south = np.abs(exact) < 0.4, np.abs(exact - np.pi) < 0.4
    assert np.abs(np.diff(total[north])).max() < 0.04
    assert np.abs(np.diff(difference[south])).max() < 0.04
    assert np.abs(np.diff(found[:, 1])).max() < 0.04
    top, bottom = np.argmax(exact == 0.0), np.argmax(exact == np.pi)
    assert found[top, 1] == 0.0
    assert found[bottom, 1] == np.pi
    assert abs(difference[top] - difference[top - 1]) < 1e-15
    assert abs(total[bottom] - total[bottom - 1]) < 1e-15


@CHARTS
def test_continuous_angles_that_start_or_stay_at_a_pole(chart):
    spin = np.stack([turn(THIRD, a) for a in np.linspace(0.0, 20.0, 101)])
    found = chart.continuous_angles(spin)
    assert not found[:, 1].any()
    assert np.abs(found[:, 0] + found[:, 2] - np.linspace(0.0, 20.0, 101)).max() < 1e-13
    upside_down = spin @ np.round(turn([*chart.node, 0.0], np.pi))
    found = chart.continuous_angles(upside_down)
    difference = found[:, 0] - found[:, 2]
    assert np.all(found[:, 1] == np.pi)
    assert np.abs(difference - difference[0] - np.linspace(0.0, 20.0, 101)).max() < 1e-13
    assert np.abs(chart.attitude(found) - upside_down).max() < 1e-14
    assert chart.continuous_angles(np.zeros((0, 3, 3))).shape == (0, 3)
    batch = chart.continuous_angles(np.stack([spin, upside_down]))
    assert np.array_equal(batch[1], found)


def test_bonnards_precession_and_angles_j9():
    """(4) and the relations before it, with L along the inertial third axis, against the derivative of R."""
    rng = np.random.default_rng(23)
    inertia = np.diag([3.0, 2.0, 1.2])
    momentum = rng.normal(size=(200, 3))
    velocity = momentum / np.diag(inertia)
    size = np.linalg.norm(momentum, axis=-1)
    for chart in (ZXZ, ZYZ):
        theta_psi = chart.angles_about_momentum(momentum)
        angles = np.concatenate([rng.uniform(-3.0, 3.0, (200, 1)), theta_psi], axis=-1)
        upright = so3.apply(chart.attitude(angles), momentum) / size[:, None]
        assert np.abs(upright - THIRD).max() < ROUNDING
        rates = chart.rates(angles, velocity)
        error = (rates[:, 0] - precession_rate(momentum, velocity)) * np.sin(angles[:, 1])
        assert np.abs(error / size).max() < 1e-14
        p = chart.conjugate_momenta(angles, momentum)
        assert np.abs(p[:, 0] - size).max() < 2e-14
        assert np.abs(p[:, 1]).max() < 2e-14
    (h1, h2, _), (u1, u2, _), (_, phi3) = momentum.T, velocity.T, ZYZ.angles_about_momentum(momentum).T
    first = size * (np.sin(phi3) * u2 - np.cos(phi3) * u1) / (h2 * np.sin(phi3) - h1 * np.cos(phi3))
    assert np.abs(first / precession_rate(momentum, velocity) - 1.0).max() < 1e-12


def test_the_printed_sign_of_h3_is_wrong_b_e3():
    rng = np.random.default_rng(25)
    for momentum in rng.normal(size=(30, 3)):
        size = np.linalg.norm(momentum)
        phi2, phi3 = ZYZ.angles_about_momentum(momentum)
        common = [-size * np.sin(phi2) * np.cos(phi3), size * np.sin(phi2) * np.sin(phi3)]
        corrected, printed = [*common, size * np.cos(phi2)], [*common, -size * np.cos(phi2)]
        attitude = turn(THIRD, 0.3) @ turn([0, 1, 0], phi2) @ turn(THIRD, phi3)
        assert np.abs(attitude @ corrected - size * THIRD).max() < 3e-15 * size
        assert np.abs(attitude @ printed - size * THIRD).max() > 0.1 * abs(momentum[2])
        assert np.abs(corrected - momentum).max() < 3e-15 * size


def momentum_map_derivative(chart, angles, momenta):
    """(angles', momenta') -> (Omega, Pi'), the chart in left trivialisation, 6 x 6."""
    lower = chart.body_momentum_jacobian(angles, momenta)
    upper = np.concatenate([chart.body_rate_matrix(angles), np.zeros((3, 3))], axis=-1)
    return np.concatenate([upper, lower])


@CHARTS
def test_charts_pull_back_the_canonical_form_j10(chart):
    """On T*SO(3) in body axes: omega((a, x), (b, y)) = a.y - b.x + Pi.(a x b)."""
    rng = np.random.default_rng(27)
    for angles, p in zip(random_angles(rng, 40), rng.normal(size=(40, 3)), strict=True):
        pi = chart.body_momentum(angles, p)
        form = np.block([[so3.hat(pi).T, np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
        derivative = momentum_map_derivative(chart, angles, p)
        defect = derivative.T @ form @ derivative - SYMPLECTIC
        assert np.abs(defect).max() < 2e-14 / np.sin(angles[1]) ** 3


@CHARTS
def test_batches_go_in_front(chart):
    rng = np.random.default_rng(30)
    angles, p = random_angles(rng, 4)[:, None], rng.normal(size=(5, 3))
    inertia = np.stack([random_inertia(rng) for _ in range(5)])
    rates, momentum_rates = chart.hamilton_equations(inertia, angles, p)
    energy = chart.hamiltonian(inertia, angles, p)
    assert rates.shape == momentum_rates.shape == (4, 5, 3)
    assert energy.shape == chart.kinetic_energy(inertia, angles, p).shape == (4, 5)
    one = chart.hamilton_equations(inertia[2], angles[3, 0], p[2])
    assert np.array_equal(rates[3, 2], one[0])
    assert np.abs(momentum_rates[3, 2] - one[1]).max() < 1e-15
    assert energy[3, 2] == chart.hamiltonian(inertia[2], angles[3, 0], p[2])
    assert chart.angles(chart.attitude(np.zeros((2, 0, 3)))).shape == (2, 0, 3)


@CHARTS
def test_bad_input_is_refused(chart):
    angles = [0.1, 1.0, 0.2]
    for bad in ([0.1, 1.0], [0.1, np.nan, 0.2], ["a", "b", "c"], [1j, 0.0, 0.0]):
        for call in (chart.attitude, chart.body_rate_matrix, chart.is_regular, chart.spatial_rate_matrix):
            with pytest.raises(ShapeError, match="angles"):
                call(bad)
        with pytest.raises(ShapeError, match="momenta"):
            chart.body_momentum(angles, bad)
    with pytest.raises(ShapeError, match="rates"):
        chart.body_angular_velocity(np.ones((2, 3)), np.ones((3, 3)))
    with pytest.raises(ShapeError, match="inertia"):
        chart.hamiltonian(np.stack([np.eye(3)] * 2), np.ones((3, 3)), np.ones(3))
    with pytest.raises(SingularInertiaError):
        chart.hamiltonian(np.diag([1.0, 1.0, 0.0]), angles, np.ones(3))
    with pytest.raises(UnphysicalInertiaError):
        chart.kinetic_energy(np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), angles, np.ones(3))
    with pytest.raises(ShapeError, match="reflection"):
        chart.angles(-np.eye(3))
    with pytest.raises(ShapeError, match="attitudes"):
        chart.continuous_angles(np.eye(3))
    with pytest.raises(ShapeError, match="zero"):
        chart.angles_about_momentum(np.zeros(3))


def test_bad_brackets_and_precessions_are_refused():
    with pytest.raises(ShapeError, match="2n"):
        canonical_bracket(np.ones(3), np.ones(3))
    with pytest.raises(ShapeError, match="2n"):
        canonical_bracket(np.ones(4), np.ones(6))
    with pytest.raises(ShapeError, match="broadcast"):
        canonical_bracket(np.ones((2, 4)), np.ones((3, 4)))
    with pytest.raises(ChartPoleError, match="entry"):
        precession_rate([[1.0, 0.0, 0.0], [0.0, 0.0, 2.0]], np.ones(3))
    with pytest.raises(ChartPoleError):
        precession_rate(np.zeros(3), np.ones(3))
    assert np.array_equal(ZXZ.angles_about_momentum([0.0, 0.0, -2.0]), [np.pi, 0.0])
    assert np.array_equal(ZYZ.angles_about_momentum([0.0, -0.0, 2.0]), [0.0, 0.0])
    assert ZXZ.angles_about_momentum([-0.0, -1.0, 0.0])[1] == ZYZ.angles_about_momentum([1.0, -0.0, 0.0])[1] == np.pi


@pytest.mark.parametrize("chart", [ZXZ, ZYZ])
def test_one_sample_alone_is_continuous(chart):
    turned = so3.exp(np.array([[[0.3, -0.4, 0.9]], [[-1.0, 0.2, 0.1]]]))
    assert_within(chart.continuous_angles(turned), chart.angles(turned), 1e-15)
