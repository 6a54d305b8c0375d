"""The rigid body as a pendulum: exact arithmetic, CasADi's gradients, integration, 70 digits next to the separatrix."""

from __future__ import annotations

import itertools
from fractions import Fraction

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm

from shapephase import elliptic, so3
from shapephase.errors import ShapeError, SingularInertiaError, UnphysicalInertiaError
from shapephase.rigid_body import andoyer_pendulum, rigid_body_pendulum
from shapephase.rigid_body.lie import (
    cylinder_matrix,
    lie_group,
    maxwell_bloch_invariants,
    maxwell_bloch_rate,
    nambu_pair,
    structure_constants,
)
from support.independent import rigid_motion
from support.long_runs import full_but

ASCENDING = np.array([1.0, 2.0, 3.0])
EPS = float(np.finfo(float).eps)
STANDARD = [[0.0, 1.0], [1.0, 0.0]]
ORDERS = list(itertools.permutations(range(3)))
ELLIPTIC_ORDERS = [order for order in ORDERS if order[2] != 1]
"""For ascending moments: those whose last axis is not the intermediate one."""
TOLERANCES = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}


def euler(moments, momentum):
    return np.cross(momentum, momentum / moments)


def integrated(moments, momentum, times):
    return rigid_motion(np.diag(moments), momentum, times)[0]


def random_matrix(rng, determinant):
    (a, b), (c, _) = rng.normal(size=(2, 2))
    return np.array([[a, b], [c, (determinant + b * c) / a]])


def random_inertia(rng):
    root = rng.normal(size=(3, 3))
    return root @ root.T + 0.5 * np.eye(3)


def exact_cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def exact_rate(moments, pi, matrix):
    """grad K x grad N in rational numbers."""
    (a, b), (c, d) = matrix
    k = [(a / m + b) * p for m, p in zip(moments, pi, strict=True)]
    n = [(c / m + d) * p for m, p in zip(moments, pi, strict=True)]
    return exact_cross(k, n)


def test_the_book_runs_backwards_m_e11():
    """In rational numbers: grad H x grad L, and grad K x grad N with ad - bc = 1, are minus Euler's equations."""
    moments, pi = [Fraction(1), Fraction(2), Fraction(7, 2)], [Fraction(3, 5), Fraction(-1, 3), Fraction(4, 7)]
    omega = [p / m for p, m in zip(pi, moments, strict=True)]
    euler_rate = exact_cross(pi, omega)
    printed = exact_cross(omega, pi)
    assert any(euler_rate)
    assert printed != euler_rate
    assert printed == [-v for v in euler_rate]
    a, b, c = Fraction(2, 3), Fraction(-5, 7), Fraction(1, 4)
    book = [(a, b), (c, (1 + b * c) / a)]
    corrected = [(a, b), (c, (-1 + b * c) / a)]
    assert exact_rate(moments, pi, book) == printed
    assert exact_rate(moments, pi, corrected) == euler_rate
    for matrix in (book, corrected):
        pair = nambu_pair(np.diag(np.array(moments, dtype=float)), np.array(matrix, dtype=float))
        # Products of three rounded factors each: relative to the largest such product.
        values = np.array(pi, dtype=float)
        largest = np.abs(values).max() ** 2 / float(min(moments))
        assert np.abs(pair.rate(values) - np.array(euler_rate, dtype=float)).max() < 4.0 * EPS * largest


@pytest.mark.parametrize("determinant", [1.0, -1.0])
def test_every_matrix_of_determinant_one_gives_eulers_equations_n1(determinant):
    rng = np.random.default_rng(2)
    for _ in range(50):
        inertia, matrix = random_inertia(rng), random_matrix(rng, determinant)
        pair = nambu_pair(inertia, matrix)
        pi = rng.normal(size=(7, 3))
        velocity = np.linalg.solve(inertia, pi.T).T
        scale = np.abs(matrix).max() ** 2 * np.linalg.norm(np.linalg.inv(inertia))
        assert pair.orientation == -determinant
        assert np.abs(pair.rate(pi) - np.cross(pi, velocity)).max() < 1e-13 * (1.0 + scale) * (pi**2).sum()
        energy, size = 0.5 * np.sum(pi * velocity, axis=-1), 0.5 * np.sum(pi * pi, axis=-1)
        expected = matrix @ np.stack([energy, size])
        assert np.abs(np.stack(pair.values(pi)) - expected).max() < 1e-13 * (1.0 + scale) * (pi**2).sum()


@pytest.mark.parametrize("determinant", [1.0, -1.0])
def test_bracket_is_poisson_with_casimir_k_and_hamiltonian_n_n1(determinant):
    """By CasADi: F' = {F, N}, {F, K} = 0, Jacobi's identity with non-linear functions."""
    rng = np.random.default_rng(3)
    pi = ca.SX.sym("pi", 3)
    inertia = random_inertia(rng)
    pair = nambu_pair(inertia, random_matrix(rng, determinant))
    f, g, h = pi[0] ** 2 * pi[2], ca.sin(pi[1]) + pi[0] * pi[2], pi[2] ** 3 + pi[0] * pi[1]
    k = 0.5 * ca.dot(pi, pair.casimir @ pi)

    def bracket(a, b):
        return -pair.orientation * ca.dot(ca.gradient(k, pi), ca.cross(ca.gradient(a, pi), ca.gradient(b, pi)))

    cyclic = sum(bracket(x, bracket(y, z)) for x, y, z in ((f, g, h), (g, h, f), (h, f, g)))
    values = ca.Function("v", [pi], [cyclic, bracket(f, g), ca.gradient(f, pi), ca.gradient(g, pi), ca.gradient(k, pi)])
    for point in rng.normal(size=(20, 3)):
        jacobi, fg, df, dg, dk = (np.array(v).ravel() for v in values(point))
        assert abs(jacobi[0]) < 1e-11
        assert abs(pair.bracket(point, df, dg) - fg[0]) < 1e-13 * (1.0 + abs(fg[0]))
        assert abs(pair.bracket(point, df, dk)) < 1e-13 * (1.0 + np.abs(df).max())
        dn = pair.hamiltonian @ point
        assert abs(pair.bracket(point, df, dn) - df @ np.cross(point, np.linalg.solve(inertia, point))) < 1e-12


def test_cylinders_of_the_book_n2():
    """(15.11.7) makes K free of Pi_3 and N free of Pi_1, with the coefficients of (15.11.8) and (15.11.9)."""
    for moments in ([1.0, 2.0, 3.0], [0.3, 0.7, 0.9], [1.0, 1.0 + 1e-9, 5.0]):
        i1, i2, i3 = moments
        matrix = cylinder_matrix(moments)
        assert abs(np.linalg.det(matrix) - 1.0) < 1e-14
        pair = nambu_pair(np.diag(moments), matrix)
        assert np.abs(pair.casimir - np.diag([1.0 / i1 - 1.0 / i3, 1.0 / i2 - 1.0 / i3, 0.0])).max() < 1e-15 / i1
        assert pair.casimir[2, 2] == 0.0
        assert np.abs(pair.hamiltonian - np.diag([0.0, i3 * (i2 - i1) / (i2 * (i3 - i1)), 1.0])).max() < 1e-14
        assert pair.hamiltonian[0, 0] == 0.0
        pendulum = rigid_body_pendulum(moments)
        assert abs(pair.hamiltonian[1, 1] - pendulum.inverse_square_k3) < 1e-14


@pytest.mark.parametrize("order", ELLIPTIC_ORDERS)
def test_constants_of_the_cylinders_n3(order):
    moments = np.array([0.9, 1.4, 2.2])
    pendulum = rigid_body_pendulum(moments, order)
    i1, i2, i3 = moments[list(order)]
    assert abs(pendulum.k1**-2 - abs(1 / i1 - 1 / i3)) < 1e-15
    assert abs(pendulum.k2**-2 - abs(1 / i2 - 1 / i3)) < 1e-15
    assert abs(pendulum.inverse_square_k3 - i3 * (i2 - i1) / (i2 * (i3 - i1))) < 1e-15
    assert abs(pendulum.stiffness - (1 / i1 - 1 / i2) * np.sign(1 / i1 - 1 / i3)) < 1e-15
    assert abs(pendulum.stiffness - pendulum.inverse_square_k3 / pendulum.k1**2) < 1e-15


@pytest.mark.parametrize("order", ELLIPTIC_ORDERS)
def test_coordinates_and_their_inverse_n4(order):
    rng = np.random.default_rng(4)
    pendulum = rigid_body_pendulum(ASCENDING, order)
    pi = rng.normal(size=(6, 50, 3))
    r, theta, p = pendulum.coordinates(pi)
    # Sines and cosines of a rounded angle times r, each right to some units of rounding of r.
    assert np.abs(pendulum.body_momentum(r, theta, p) - pi).max() < 8.0 * EPS * r.max()
    k = np.abs(0.5 * np.sum(pi * pi / ASCENDING, axis=-1) - 0.5 * np.sum(pi * pi, axis=-1) / ASCENDING[order[2]])
    assert np.abs(k - 0.5 * r * r).max() < 1e-14
    again = pendulum.coordinates(pendulum.body_momentum(2.0, np.array([0.0, np.pi, -0.5, 3.0]), -0.7))
    assert np.abs(so3.wrap(again[1] - [0.0, np.pi, -0.5, 3.0])).max() < 1e-15
    assert np.array_equal(again[2], np.full(4, -0.7))
    assert pendulum.coordinates(np.eye(3)[order[0]] * -1.0)[1] == np.pi


@pytest.mark.parametrize("order", ELLIPTIC_ORDERS)
def test_n_is_the_pendulums_energy_n4(order):
    """N of the cylinders in the chosen order of axes, in exact arithmetic of its coefficients."""
    rng = np.random.default_rng(5)
    pendulum = rigid_body_pendulum(ASCENDING, order)
    i1, i2, i3 = ASCENDING[list(order)]
    pi = rng.normal(size=(50, 3))
    _, second, third = pi[:, list(order)].T
    n = 0.5 * i3 * (i2 - i1) / (i2 * (i3 - i1)) * second**2 + 0.5 * third**2
    # Sums of two products each: some units of rounding of the largest.
    assert np.abs(pendulum.hamiltonian(*pendulum.coordinates(pi)) - n).max() < 16.0 * EPS * n.max()


@pytest.mark.parametrize("order", ELLIPTIC_ORDERS)
def test_bracket_of_angle_and_momentum_n5(order):
    """The bracket -+grad K.(grad theta x grad p) by CasADi, with the sign that makes N the Hamiltonian."""
    rng = np.random.default_rng(6)
    pendulum = rigid_body_pendulum(ASCENDING, order)
    i1, i2, i3 = ASCENDING[list(order)]
    pi = ca.SX.sym("pi", 3)
    first, second, third = (pi[i] for i in order)
    theta = ca.atan2(second / pendulum.k2, first / pendulum.k1)
    k = 0.5 * ((1 / i1 - 1 / i3) * first**2 + (1 / i2 - 1 / i3) * second**2)
    n = 0.5 * i3 * (i2 - i1) / (i2 * (i3 - i1)) * second**2 + 0.5 * third**2
    book = ca.dot(ca.gradient(k, pi), ca.cross(ca.gradient(theta, pi), ca.gradient(third, pi)))
    flow = ca.cross(ca.gradient(n, pi), ca.gradient(k, pi))
    function = ca.Function("f", [pi], [book, flow])
    for point in rng.normal(size=(20, 3)):
        bracket, rate = (np.array(v).ravel() for v in function(point))
        assert np.abs(rate - euler(ASCENDING, point)).max() < 1e-14
        assert abs(bracket[0] - pendulum.angle_momentum_bracket) < 1e-14
    assert abs(abs(pendulum.angle_momentum_bracket) - 1.0 / (pendulum.k1 * pendulum.k2)) < 1e-15


@pytest.mark.parametrize("order", ELLIPTIC_ORDERS)
def test_the_angle_obeys_the_pendulum_equation_n6(order):
    """By the chain rule through Euler's equations twice, with CasADi, for every order of the axes."""
    rng = np.random.default_rng(7)
    pendulum = rigid_body_pendulum(ASCENDING, order)
    pi = ca.SX.sym("pi", 3)
    flow = ca.cross(pi, pi / ASCENDING)
    theta = ca.atan2(pi[order[1]] / pendulum.k2, pi[order[0]] / pendulum.k1)
    rate = ca.dot(ca.gradient(theta, pi), flow)
    second = ca.dot(ca.gradient(rate, pi), flow)
    function = ca.Function("f", [pi], [rate, second])
    for point in rng.normal(size=(30, 3)):
        r, angle, p = pendulum.coordinates(point)
        theta_rate, theta_second = (float(v) for v in function(point))
        assert abs(pendulum.acceleration(r, angle) - theta_second) < 2e-14 * (1.0 + abs(theta_second))
        assert abs(pendulum.rates(r, angle, p)[0] - theta_rate) < 2e-14 * (1.0 + abs(theta_rate))
        assert abs(pendulum.rates(r, angle, p)[1] - euler(ASCENDING, point)[order[2]]) < 2e-14


def regime_of(moments, pi):
    """For axis 1 stable, from the energy of the intermediate axis: whether theta, about the third axis, librates."""
    order = np.argsort(moments)
    twice, square, middle = np.sum(pi * pi / moments), np.sum(pi * pi), moments[order[1]]
    return "libration" if twice > square / middle else "rotation"


@pytest.mark.parametrize("order", [None, *ELLIPTIC_ORDERS])
@pytest.mark.parametrize("moments", [[1.0, 2.0, 3.0], [1.0, 1.001, 4.0], [0.5, 2.0, 2.01]], ids=str)
def test_closed_solution_is_the_motion_of_the_body_n6(moments, order):
    rng = np.random.default_rng(8)
    moments = np.array(moments)
    pendulum = rigid_body_pendulum(moments, order)
    times = np.linspace(0.0, 12.0, 25)
    seen = set()
    one, two, three = 1.0 / moments
    for pi, ratio in zip(rng.normal(size=(8, 3)), [0.0, 0.3, 0.9, 0.99, 1.01, 1.1, 3.0, -3.0], strict=True):
        # At ratio 1 is the separatrix.
        pi[[0, 2]] = pi[0] * np.array(
            [np.sqrt((two - three) / (one - three)), np.sqrt((one - two) / (one - three)) * ratio]
        )
        motion = pendulum.motion(pi)
        seen.add(motion.regime)
        truth = integrated(moments, pi, times)
        assert np.abs(motion.body_momentum(times) - truth).max() < 3e-12
        assert np.abs(motion.momentum(times) - truth[:, pendulum.axes[2]]).max() < 3e-12
        _, theta, _ = pendulum.coordinates(truth)
        assert np.abs(np.exp(1j * motion.angle(times)) - np.exp(1j * theta)).max() < 2e-11
        # Angles up to pi, whose own spacing is 2 eps, from an arctangent on one side and an amplitude on the other:
        # four spacings for either.
        assert abs(motion.angle(0.0) - theta[0]) < 16.0 * EPS
        assert np.abs(motion.body_momentum(0.0) - pi).max() < 1e-15 * np.abs(pi).max() * 4
        if pendulum.axes[2] == 2:
            assert motion.regime == regime_of(moments, pi)
    assert seen == {"libration", "rotation"}


def test_moments_in_any_order_n6():
    rng = np.random.default_rng(9)
    times = np.linspace(0.0, 10.0, 11)
    for order in ORDERS:
        moments = ASCENDING[list(order)]
        pi = rng.normal(size=3)
        truth = integrated(moments, pi, times)
        assert np.abs(rigid_body_pendulum(moments).motion(pi).body_momentum(times) - truth).max() < 3e-12


def test_angle_and_period_n6():
    """Unwrapped theta has the rate p/(k1 k2); the period is that of Pi, and a quadrature."""
    pendulum = rigid_body_pendulum(ASCENDING)
    for pi, regime in (([0.9, 0.2, 0.4], "libration"), ([-0.1, 0.3, -0.9], "rotation")):
        motion = pendulum.motion(pi)
        assert motion.regime == regime
        times = np.linspace(-3.0, 4.0 * motion.period, 400)
        sums = np.cumsum(np.diff(motion.angle(times)))
        for i in (100, 399):
            expected = quad(lambda t, m=motion: m.momentum(t), times[0], times[i], epsabs=1e-12, limit=300)[0]
            assert abs(sums[i - 1] - pendulum.angle_momentum_bracket * expected) < 1e-11
        assert np.abs(motion.body_momentum(times + motion.period) - motion.body_momentum(times)).max() < 1e-13
        turn = motion.angle(motion.period) - motion.angle(0.0)
        assert abs(turn - (0.0 if regime == "libration" else 2.0 * np.pi * np.sign(motion.rate))) < 1e-13
        r, theta, p = pendulum.coordinates(pi)
        well = pendulum.stiffness * r * r
        energy = (pendulum.angle_momentum_bracket * p) ** 2 + well * np.sin(theta) ** 2
        if regime == "rotation":
            slowness = quad(lambda a, e=energy, w=well: (e - w * np.sin(a) ** 2) ** -0.5, 0.0, 2.0 * np.pi)[0]
            assert abs(motion.period - slowness) < 1e-9
        else:
            assert abs(motion.swing - np.sin(np.abs(motion.angle(times)).max())) < 1e-3
            assert abs(motion.swing**2 - energy / well) < 1e-15
        assert abs(motion.modulus**2 + motion.complement - 1.0) < 1e-15


def test_closed_solution_on_the_separatrix_n6():
    """Moments (6, 3, 2), whose inverses go in steps of 1/6: the separatrix is at |Pi_1| = |Pi_3| exactly."""
    moments, times = np.array([6.0, 3.0, 2.0]), np.linspace(0.0, 5.0, 11)
    for order in ELLIPTIC_ORDERS:
        for pi in itertools.product((-1.0, 1.0), (-0.7, 0.0, 0.3), (-1.0, 1.0)):
            motion = rigid_body_pendulum(moments, order).motion(pi)
            assert motion.regime == "separatrix"
            assert motion.period == np.inf
            assert motion.complement == 0.0
            assert np.abs(motion.body_momentum(times) - integrated(moments, np.array(pi), times)).max() < 1e-11
            far = motion.body_momentum([-2e3, 2e3])
            assert np.abs(np.abs(far[:, 1]) - np.linalg.norm(pi)).max() < 1e-14
            assert far[0, 1] * far[1, 1] < 0.0
            assert np.abs(far[:, ::2]).max() < 1e-100


BITS = 240
"""Of the fraction in fixed-point arithmetic, 72 decimals."""


def fixed(fraction):
    return int(fraction * 2**BITS)


def many_digits(moments, pi, times):
    """Pi at ascending times from the exact numbers, by Taylor series of Euler's equations in fixed-point arithmetic."""
    inverse = [1 / Fraction(float(m)) for m in moments]
    constants = [fixed(inverse[i - 1] - inverse[i - 2]) for i in range(3)]
    values, path, now, order = [fixed(Fraction(float(v))) for v in pi], [], Fraction(0), 45
    for time in times:
        steps = int(time - now) + 1
        step = fixed((Fraction(float(time)) - now) / steps)
        for _ in range(steps):
            series = [[v] for v in values]
            for n in range(order):
                rows = [(series[i - 2][:], series[i - 1][::-1]) for i in range(3)]
                for i, (a, b) in enumerate(rows):
                    product = sum(x * y for x, y in zip(a, b, strict=True)) >> BITS
                    series[i].append((constants[i] * product >> BITS) // (n + 1))
            values = [0, 0, 0]
            for i in range(3):
                for coefficient in reversed(series[i]):
                    values[i] = (values[i] * step >> BITS) + coefficient
        now = Fraction(float(time))
        path.append([float(Fraction(v, 2**BITS)) for v in values])
    return np.array(path)


@pytest.mark.parametrize("nudge", [1e-4, 1e-10, 1e-15, -1e-4, -1e-10, -1e-15])
def test_next_to_the_separatrix_against_seventy_digits_n6(nudge):
    """Moments (6, 3, 2) have the separatrix at |Pi_1| = |Pi_3|; the flip takes a time of log(1/nudge)."""
    moments, times = np.array([6.0, 3.0, 2.0]), [3.0, 40.0, 180.0]
    pi = np.array([1.0 + nudge, 0.4, -1.0])
    truth = many_digits(moments, pi, times)
    for order in ELLIPTIC_ORDERS:
        assert np.abs(rigid_body_pendulum(moments, order).motion(pi).body_momentum(times) - truth).max() < 1e-13


@pytest.mark.parametrize(
    "pi", [[1e-9, 1.0, 3e-9], [1e-9, -1.0, 1e-9], [0.0, 1.0, 1e-7], [1e-7, -1.0, 0.0], [1e-60, 1.0, 1e-30]]
)
def test_next_to_the_unstable_equilibrium_n6(pi):
    moments = np.array([6.0, 3.0, 2.0])
    truth = many_digits(moments, pi, [60.0])
    for order in ELLIPTIC_ORDERS:
        assert np.abs(rigid_body_pendulum(moments, order).motion(pi).body_momentum([60.0]) - truth).max() < 1e-13


@pytest.mark.parametrize("pi", [[1.0, 1e-12, 0.0], [1.0, 0.0, -1e-12], [-2.0, -3e-13, 1e-12]])
def test_next_to_a_stable_equilibrium_small_parts_keep_their_digits_n6(pi):
    moments = np.array([6.0, 3.0, 2.0])
    truth = many_digits(moments, pi, [7.0])
    motion = rigid_body_pendulum(moments, (0, 1, 2)).motion(pi)
    assert np.abs((motion.body_momentum([7.0]) - truth)[:, 1:]).max() < 1e-26


def test_two_moments_equal_is_a_uniform_turn_n6():
    for moments in ([2.0, 2.0, 3.0], [2.0, 2.0, 0.7], [1.0, 3.0, 3.0], [3.0, 1.0, 3.0]):
        pi = np.array([0.3, -0.8, 0.5])
        pendulum = rigid_body_pendulum(moments)
        motion = pendulum.motion(pi)
        times = np.linspace(0.0, 20.0, 41)
        assert pendulum.stiffness == 0.0
        assert motion.regime == "rotation"
        assert motion.complement == 1.0
        assert np.abs(motion.body_momentum(times) - integrated(np.array(moments), pi, times)).max() < 3e-12
        angles = motion.angle(times)
        assert np.abs(np.diff(angles, 2)).max() < 1e-13
        still = pi * (np.arange(3) != pendulum.axes[2])
        rest = pendulum.motion(still)
        assert rest.regime == "equilibrium"
        assert np.abs(rest.body_momentum(times) - still).max() < 1e-15
        assert rest.period == np.inf
        assert {e.stability for e in pendulum.equilibria} == {"neutral"}


@pytest.mark.parametrize("order", ELLIPTIC_ORDERS)
def test_half_turn_symmetry_equilibria_and_stability_n7(order):
    """Stability by sign against the eigenvalues of Euler's equations linearised by CasADi."""
    pendulum = rigid_body_pendulum(ASCENDING, order)
    pi = ca.SX.sym("pi", 3)
    linearised = ca.Function("l", [pi], [ca.jacobian(ca.cross(pi, pi / ASCENDING), pi)])
    r = 1.3
    equilibria = pendulum.equilibria
    assert [e.angle for e in equilibria] == [0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi]
    for equilibrium in equilibria:
        momentum = pendulum.body_momentum(r, equilibrium.angle, 0.0)
        # A rounded sine of pi is no zero: some units of r, times the differences of the rates.
        assert np.abs(euler(ASCENDING, momentum)).max() < 8.0 * EPS * r * r
        assert momentum[equilibrium.axis] * equilibrium.sign > 0.0
        growth = np.linalg.eigvals(np.array(linearised(momentum))).real.max()
        assert equilibrium.stability == ("unstable" if growth > 0.1 else "stable")
        assert equilibrium.stability == ("unstable" if equilibrium.axis == 1 else "stable")
        assert pendulum.motion(np.round(momentum, 12)).regime == "equilibrium"
        slope = (pendulum.acceleration(r, equilibrium.angle + 1e-6) - 0.0) / 1e-6
        assert (slope > 0.0) == (equilibrium.stability == "unstable")
    theta, p = np.linspace(-3.0, 3.0, 13), 0.4
    assert np.abs(pendulum.hamiltonian(r, theta + np.pi, p) - pendulum.hamiltonian(r, theta, p)).max() < 1e-14
    mirrored = pendulum.body_momentum(r, theta + np.pi, p) * np.where(np.arange(3) == order[2], 1.0, -1.0)
    # Angles up to 2 pi are rounded by up to four units.
    assert np.abs(mirrored - pendulum.body_momentum(r, theta, p)).max() < 8.0 * EPS * r


def test_equilibria_stay_n7():
    times = np.linspace(0.0, 100.0, 5)
    for order in ELLIPTIC_ORDERS:
        pendulum = rigid_body_pendulum(ASCENDING, order)
        for axis, sign in itertools.product(order[:2], (1.0, -1.0)):
            pi = sign * np.eye(3)[axis]
            motion = pendulum.motion(pi)
            assert motion.regime == "equilibrium"
            assert np.abs(motion.body_momentum(times) - pi).max() < 3e-16
            assert abs(motion.angle(7.0) - pendulum.coordinates(pi)[1]) < 1e-15
            assert not motion.momentum(times).any()
            if axis == 1:
                assert motion.period == np.inf
            else:
                frequency = abs(np.prod([1 / ASCENDING[axis] - 1 / m for i, m in enumerate(ASCENDING) if i != axis]))
                assert abs(motion.period - 2.0 * np.pi / np.sqrt(frequency)) < 1e-13


def test_equilibria_along_the_third_axis_are_left_out_and_found_by_permuting_n8():
    pi = np.array([0.0, 0.0, -2.0])
    pendulum = rigid_body_pendulum(ASCENDING)
    assert not euler(ASCENDING, pi).any()
    for call in (pendulum.coordinates, pendulum.motion):
        with pytest.raises(ShapeError, match="cylinders"):
            call(pi)
    assert 2 not in {e.axis for e in pendulum.equilibria}
    other = rigid_body_pendulum(ASCENDING, (1, 2, 0))
    assert {(e.axis, e.sign) for e in other.equilibria if e.stability == "stable"} == {(2, 1), (2, -1)}
    assert other.motion(pi).regime == "equilibrium"
    close = np.array([1e-5, 0.0, -2.0])
    truth = integrated(ASCENDING, close, np.linspace(0.0, 5.0, 6))
    for p in (pendulum, other):
        assert np.abs(p.motion(close).body_momentum(np.linspace(0.0, 5.0, 6)) - truth).max() < 1e-12


def killing_form(c):
    return np.einsum("iab,jba->ij", c, c)


def is_lie_algebra(c):
    jacobi = np.einsum("ijl,lkm->ijkm", c, c)
    cyclic = jacobi + jacobi.transpose(1, 2, 0, 3) + jacobi.transpose(2, 0, 1, 3)
    return np.abs(cyclic).max() < 1e-13 and np.abs(c + c.transpose(1, 0, 2)).max() == 0.0


def algebra_name(c):
    """From the algebra alone: Killing form, derived algebra, eigenvalues of the adjoint action."""
    derived = np.linalg.matrix_rank(c.reshape(9, 3), tol=1e-10)
    if derived == 3:
        return "SO(3)" if np.linalg.eigvalsh(killing_form(c)).max() < 0.0 else "SO(2,1)"
    if derived == 2:
        return "SE(2)" if np.linalg.eigvalsh(killing_form(c)).min() < -1e-10 else "SE(1,1)"
    return "Heisenberg" if derived == 1 else "R^3"


FAMILY = [
    ("SO(3)", [1.0, 2.0, 3.0], STANDARD),
    ("SO(3)", [1.0, 2.0, 3.0], [[1.0, 0.0], [0.0, 1.0]]),
    ("SO(3)", [1.0, 2.0, 3.0], [[1.0, -2.0], [0.0, 1.0]]),
    ("SO(2,1)", [1.0, 2.0, 3.0], [[1.0, -0.4], [0.0, 1.0]]),
    ("SO(2,1)", [1.0, 2.0, 3.0], [[1.0, -0.7], [0.0, -1.0]]),
    ("SE(2)", [1.0, 2.0, 3.0], cylinder_matrix([1.0, 2.0, 3.0])),
    ("SE(2)", [1.0, 2.0, 3.0], [[1.0, -1.0], [0.0, -1.0]]),
    ("SE(1,1)", [1.0, 2.0, 3.0], [[1.0, -0.5], [0.0, 1.0]]),
    ("Heisenberg", [2.0, 2.0, 3.0], [[1.0, -0.5], [0.0, 1.0]]),
    ("SE(2)", [2.0, 2.0, 3.0], [[1.0, -1.0 / 3.0], [0.0, 1.0]]),
    ("R^3", [3.0, 3.0, 3.0], [[1.0, -1.0 / 3.0], [0.0, 1.0]]),
]


@pytest.mark.parametrize(("name", "moments", "matrix"), FAMILY)
def test_groups_by_the_signature_of_k_n9(name, moments, matrix):
    rng = np.random.default_rng(11)
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    for axes in (np.eye(3), frame):
        pair = nambu_pair(axes @ np.diag(moments) @ axes.T, matrix)
        assert pair.group == lie_group(pair.casimir) == lie_group(-pair.casimir) == name
        c = pair.structure_constants
        assert is_lie_algebra(c)
        assert algebra_name(c) == name
        pi, a, b = rng.normal(size=(3, 3))
        assert abs(pair.bracket(pi, a, b) + pi @ np.einsum("ijk,i,j->k", c, a, b)) < 1e-14
        coadjoint = expm(np.einsum("ijk,i->kj", c, a)).T
        moved = coadjoint @ pi
        assert abs(pair.values(moved)[0] - pair.values(pi)[0]) < 1e-12
        if name in ("SO(3)", "SO(2,1)"):
            action = expm(np.einsum("ijk,i->kj", c, a))
            metric = np.linalg.inv(pair.casimir)
            assert np.abs(action.T @ metric @ action - metric).max() < 1e-11 * np.abs(metric).max()


def test_groups_of_turned_bodies_with_far_moments_n9():
    """The moments of a turned tensor have the rounding of the largest, which must not hide a zero."""
    rng = np.random.default_rng(18)
    for _ in range(50):
        moments = np.array([1.0, rng.uniform(2.0, 9.0), 10.0 ** rng.uniform(1.0, 6.0)])
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        inertia = axes @ np.diag(moments) @ axes.T
        for moment, name in zip(moments, ("SE(2)", "SE(1,1)", "SE(2)"), strict=True):
            assert nambu_pair(0.5 * (inertia + inertia.T), [[-moment, 1.0], [1.0, 0.0]]).group == name


@pytest.mark.parametrize("order", ELLIPTIC_ORDERS)
def test_symplectic_form_of_the_leaf_n10(order):
    """The bracket of two functions on the leaf is the form on their fields; the form is area over |grad K|."""
    rng = np.random.default_rng(12)
    pendulum = rigid_body_pendulum(ASCENDING, order)
    i1, i2, i3 = ASCENDING[list(order)]
    gradient_k = np.zeros(3)
    for theta, r, p in rng.uniform(0.2, 3.0, (20, 3)):
        pi = pendulum.body_momentum(r, theta, p)
        by_theta = np.zeros(3)
        by_theta[order[0]], by_theta[order[1]] = -pendulum.k1 * r * np.sin(theta), pendulum.k2 * r * np.cos(theta)
        by_p = np.eye(3)[order[2]]
        gradient_k[order[0]] = (1 / i1 - 1 / i3) * pi[order[0]]
        gradient_k[order[1]] = (1 / i2 - 1 / i3) * pi[order[1]]
        density = gradient_k @ np.cross(by_theta, by_p) / (gradient_k @ gradient_k)
        assert abs(density - pendulum.symplectic_density) < 1e-14 * abs(density)
        f, g = rng.normal(size=(2, 2))
        bracket = pendulum.angle_momentum_bracket * (f[0] * g[1] - f[1] * g[0])
        fields = [pendulum.angle_momentum_bracket * np.array([v[1], -v[0]]) for v in (f, g)]
        form = pendulum.symplectic_density * (fields[0][0] * fields[1][1] - fields[0][1] * fields[1][0])
        assert abs(form - bracket) < 1e-14


def test_maxwell_bloch_is_pendulum_and_duffing_n11():
    state = np.array([0.4, 0.9, -0.6])
    times = np.linspace(0.0, 12.0, 25)
    path = solve_ivp(lambda _, y: maxwell_bloch_rate(y), (0.0, 12.0), state, t_eval=times, **TOLERANCES).y.T
    circle, parabola = maxwell_bloch_invariants(path)
    assert np.ptp(circle) < 1e-12
    assert np.ptp(parabola) < 1e-12

    def pendulum(_, y):
        return [y[1], np.sqrt(2.0 * circle[0]) * np.sin(y[0])]

    def duffing(_, y):
        return [y[1], parabola[0] * y[0] - 0.5 * y[0] ** 3]

    angle = solve_ivp(pendulum, (0.0, 12.0), [np.arctan2(0.9, -0.6), 0.4], t_eval=times, **TOLERANCES).y
    radius = np.sqrt(2.0 * circle[0])
    swung = np.stack([angle[1], radius * np.sin(angle[0]), radius * np.cos(angle[0])], axis=-1)
    assert np.abs(swung - path).max() < 1e-11
    oscillator = solve_ivp(duffing, (0.0, 12.0), state[:2], t_eval=times, **TOLERANCES).y
    assert np.abs(oscillator.T - path[:, :2]).max() < 1e-11


def test_andoyer_equations_are_hamiltons_n12():
    rng = np.random.default_rng(15)
    moments = np.array([3.0, 2.0, 1.0])
    pendulum = andoyer_pendulum(moments)
    variables = ca.SX.sym("v", 2)
    a, b, c = 1.0 / moments
    wave = a * ca.sin(variables[0]) ** 2 + b * ca.cos(variables[0]) ** 2
    h = 0.5 * ((1.3**2 - variables[1] ** 2) * wave + c * variables[1] ** 2)
    gradient, hessian = ca.Function("g", [variables], [ca.gradient(h, variables)]), ca.hessian(h, variables)[0]
    for point in rng.uniform(-1.2, 1.2, (20, 2)):
        by_y, by_p = np.array(gradient(point)).ravel()
        assert np.abs(np.array(pendulum.rates(1.3, *point)) - [by_p, -by_y]).max() < 1e-14
    linear = ca.Function("l", [variables], [ca.SX([[0.0, 1.0], [-1.0, 0.0]]) @ hessian])
    for place, expected in zip((0.5 * np.pi, 0.0), pendulum.square_eigenvalues(1.3), strict=True):
        eigenvalues = np.linalg.eigvals(np.array(linear([place, 0.0])))
        assert np.abs(eigenvalues**2 - expected).max() < 1e-14


def test_symmetries_and_types_of_trajectories_n12():
    """y -> -y, p_y -> -p_y, y -> y + pi; oscillating about pi/2, rotating, separatrix by integration of (8)."""
    rng = np.random.default_rng(16)
    pendulum = andoyer_pendulum([3.0, 2.0, 1.0])
    y, p_y = rng.uniform(-3.0, 3.0, 50), rng.uniform(-1.0, 1.0, 50)
    h = pendulum.hamiltonian(1.0, y, p_y)
    for mirrored in ((-y, p_y), (y, -p_y), (y + np.pi, p_y)):
        assert np.abs(pendulum.hamiltonian(1.0, *mirrored) - h).max() < 1e-15
    counted = {"oscillating": 0, "rotating": 0}
    for momentum in rng.normal(size=(8, 3)):
        size, start, p = pendulum.coordinates(momentum)
        path = solve_ivp(lambda _, v, s=size: pendulum.rates(s, *v), (0.0, 20.0), [start, p], rtol=1e-6).y
        kind = "rotating" if np.ptp(path[0]) > np.pi else "oscillating"
        counted[kind] += 1
        assert pendulum.trajectory_type(momentum) == kind
        if kind == "oscillating":
            centre = np.round((path[0].mean() - 0.5 * np.pi) / np.pi) * np.pi + 0.5 * np.pi
            assert np.abs(path[0] - centre).max() < 0.5 * np.pi
    assert min(counted.values()) > 1
    assert andoyer_pendulum([6.0, 3.0, 2.0]).trajectory_type([1.0, 0.3, -1.0]) == "separatrix"
    assert pendulum.trajectory_type([0.0, -1.0, 0.0]) == pendulum.trajectory_type([2.0, 0.0, 0.0]) == "equilibrium"


ORDERS = [list(order) for order in itertools.permutations(range(3))]


@pytest.mark.parametrize("order", ORDERS, ids=str)
def test_andoyer_equations_are_eulers_for_moments_in_any_order_n12(order):
    """On the caller's axes; p_y is the component along the axis of the smallest moment."""
    moments = np.array([3.0, 2.0, 1.0])[order]
    momentum = np.random.default_rng(15).normal(size=(100, 3))
    pendulum = andoyer_pendulum(moments)
    magnitude, y, p_y = pendulum.coordinates(momentum)
    np.testing.assert_array_equal(p_y, momentum[:, np.argmin(moments)])
    assert np.abs(pendulum.body_momentum(magnitude, y, p_y) - momentum).max() < 1e-14
    energy = 0.5 * np.sum(momentum**2 / moments, axis=-1)
    assert np.abs(pendulum.hamiltonian(magnitude, y, p_y) - energy).max() < 1e-14
    h = 1e-4
    ahead, behind = (pendulum.coordinates(momentum + step * euler(moments, momentum)) for step in (h, -h))
    y_rate, p_rate = pendulum.rates(magnitude, y, p_y)
    assert np.abs(so3.wrap(ahead[1] - behind[1]) / (2.0 * h) - y_rate).max() < 1e-4
    assert np.abs((ahead[2] - behind[2]) / (2.0 * h) - p_rate).max() < 1e-11


@pytest.mark.parametrize("count", full_but([2, 12], 2))
@pytest.mark.parametrize("order", full_but(ORDERS, [2, 0, 1]), ids=str)
def test_closed_solution_for_y_n12(order, count):
    moments = np.array([3.0, 2.0, 1.0])[order]
    pendulum = andoyer_pendulum(moments)
    times = np.linspace(0.0, 20.0, 81)
    axes = np.argsort(-moments)
    for momentum in np.random.default_rng(17).normal(size=(count, 3))[:, order]:
        motion = rigid_body_pendulum(moments, axes).motion(momentum)
        y = pendulum.from_pendulum_angle(motion.angle(times))
        size, start, p = pendulum.coordinates(momentum)
        path = solve_ivp(
            lambda _, v, s=size: pendulum.rates(s, *v), (0.0, 20.0), [start, p], t_eval=times, **TOLERANCES
        )
        assert abs(so3.wrap(y[0] - start)) < 1e-14
        assert np.abs(y - y[0] - (path.y[0] - start)).max() < 1e-10
        assert np.abs(motion.momentum(times) - path.y[1]).max() < 1e-11


def test_a_million_times_in_one_call():
    motion = rigid_body_pendulum(ASCENDING).motion([0.3, 0.5, -0.8])
    times = np.linspace(0.0, 1e4, 200_000).reshape(2, -1)
    path = motion.body_momentum(times)
    assert path.shape == (2, 100_000, 3)
    assert np.abs(np.sum(path**2, axis=-1) / 0.98 - 1.0).max() < 1e-12
    assert motion.angle(times).shape == motion.momentum(times).shape == (2, 100_000)
    assert motion.body_momentum(1.0).shape == (3,)
    assert elliptic.complete_k(motion.complement) * 4.0 / abs(motion.rate) == motion.period


def test_scales_from_tiny_to_huge():
    base = rigid_body_pendulum(ASCENDING).motion([0.3, 0.5, -0.8])
    for size, mass in ((1e-200, 1e-100), (1e200, 1e150), (1e150, 1e-100)):
        motion = rigid_body_pendulum(mass * ASCENDING).motion(size * np.array([0.3, 0.5, -0.8]))
        assert abs(motion.complement / base.complement - 1.0) < 1e-13
        assert abs(motion.rate / base.rate / (size / mass) - 1.0) < 1e-13
        path = motion.body_momentum(3.0 / size * mass)
        assert np.abs(path / size - base.body_momentum(3.0)).max() < 1e-13


def test_bad_input_is_refused():
    for moments, match in (
        ([1.0, 2.0], "moments"),
        ([1.0, 2.0, -3.0], "positive"),
        ([1.0, 2.0, 0.0], "positive"),
        ([1.0, np.nan, 2.0], "moments"),
        (np.ones((2, 3)), "three principal moments"),
        ([2.0, 2.0, 2.0], "all are 2"),
    ):
        with pytest.raises(ShapeError, match=match):
            rigid_body_pendulum(moments)
    for axes in ((0, 1), (0, 1, 1), (1, 2, 3), "zxz"):
        with pytest.raises(ShapeError, match="axes"):
            rigid_body_pendulum(ASCENDING, axes)
    for axes in ((0, 2, 1), (2, 0, 1)):
        with pytest.raises(ShapeError, match="axes"):
            rigid_body_pendulum(ASCENDING, axes)
    with pytest.raises(ShapeError, match="axes"):
        rigid_body_pendulum([1.0, 3.0, 3.0], (0, 1, 2))
    pendulum = rigid_body_pendulum(ASCENDING)
    for momentum in (np.ones((2, 3)), [1.0, 2.0], [np.inf, 0.0, 1.0], np.zeros(3), [1.0, 1e-200, 0.3]):
        with pytest.raises(ShapeError, match="momentum"):
            pendulum.motion(momentum)
    with pytest.raises(ShapeError, match="broadcast"):
        pendulum.body_momentum(1.0, np.zeros(2), np.zeros(3))
    with pytest.raises(ShapeError, match="time"):
        pendulum.motion([1.0, 2.0, 0.3]).angle([np.nan])


def test_bad_pairs_are_refused():
    with pytest.raises(ShapeError, match="matrix"):
        nambu_pair(np.eye(3), [[1.0, 0.0], [0.0, 2.0]])
    with pytest.raises(ShapeError, match="array"):
        nambu_pair(np.eye(3), np.ones((1, 2, 2)))
    with pytest.raises(ShapeError, match="array"):
        nambu_pair(np.ones((1, 1, 1)) * np.eye(3), STANDARD)
    with pytest.raises(SingularInertiaError):
        nambu_pair(np.diag([1.0, 2.0, 0.0]), STANDARD)
    with pytest.raises(UnphysicalInertiaError):
        nambu_pair([[1.0, 0.4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], STANDARD)
    with pytest.raises(ShapeError, match="symmetric"):
        lie_group([[1.0, 0.4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(ShapeError, match="array"):
        structure_constants(np.ones((2, 3, 3)))
    with pytest.raises(ShapeError, match="moments"):
        cylinder_matrix([2.0, 3.0, 2.0])


def test_bad_andoyer_input_is_refused():
    for moments in ([3.0, 3.0, 2.0], [3.0, 2.0, 2.0], [2.0, 3.0, 2.0]):
        with pytest.raises(ShapeError, match="different"):
            andoyer_pendulum(moments)
    pendulum = andoyer_pendulum([3.0, 2.0, 1.0])
    with pytest.raises(ShapeError, match="undefined"):
        pendulum.coordinates([0.0, 0.0, 1.0])
    with pytest.raises(ShapeError, match="p_y"):
        pendulum.rates(1.0, 0.0, 1.5)
    with pytest.raises(ShapeError, match="broadcast"):
        pendulum.hamiltonian(np.ones(2), np.zeros(3), 0.0)
