"""Left-invariant metrics on SO(3) against integration of the raw equations, quadratures, limits and conserved laws."""

from __future__ import annotations

import itertools

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from shapephase import so3
from shapephase.errors import AccuracyNotReached, ShapeError, SingularInertiaError, UnphysicalInertiaError
from shapephase.rigid_body import EulerTop
from shapephase.rigid_body.geodesics import andoyer_variables, left_invariant_metric, serret_andoyer_metric
from support.independent import assert_within, cross
from support.long_runs import full_but

METRICS = {
    "triaxial": [3.0, 2.0, 1.0],
    "unsorted": [1.0, 2.5, 1.7],
    "flat": [1.0, 1.0, 3.0],
    "rod": [0.3, 1.0, 1.0],
    "round": [1.0, 1.0, 1.0],
    "strong": [1.0, 20.0, 5.0],
    "sub-Riemannian": [np.inf, 2.0, 1.0],
    "sub-Riemannian about 2": [1.3, np.inf, 0.7],
    "sub-Riemannian, equal": [1.0, 1.0, np.inf],
}
TRIAXIAL = np.array(METRICS["triaxial"])
A1, A2, A3 = so3.hat(np.eye(3))


def inverse(moments):
    return 1.0 / np.array(moments)


def variational(moments, momentum, end):
    """R, Pi, Z and dPi of the raw equations and their linearisation: a function of time."""
    a = inverse(moments)

    def rate(_, y):
        pi, attitude, z, d = y[:3], y[3:12].reshape(3, 3), y[12:21].reshape(3, 3), y[21:].reshape(3, 3)
        u = a * pi
        spin, turn = so3.hat(u), so3.hat(pi)
        return np.concatenate(
            [
                cross(pi, u),
                (attitude @ spin).ravel(),
                (a[:, None] * d - spin @ z).ravel(),
                (turn @ (a[:, None] * d) - spin @ d).ravel(),
            ]
        )

    start = np.concatenate([momentum, np.eye(3).ravel(), np.zeros(9), np.eye(3).ravel()])
    solution = solve_ivp(rate, (0.0, end), start, "DOP853", rtol=3e-14, atol=1e-15, dense_output=True)

    def at(t):
        y = solution.sol(t)
        return y[3:12].reshape(3, 3), y[:3], y[12:21].reshape(3, 3), y[21:].reshape(3, 3)

    return at


@pytest.mark.parametrize("name", ["triaxial", "unsorted", "sub-Riemannian about 2"])
def test_the_controls_maximise_the_pseudo_hamiltonian_q1(name):
    rng = np.random.default_rng(1)
    moments = np.array(METRICS[name])
    metric = left_invariant_metric(moments)
    pi = rng.normal(size=(50, 3))
    u = metric.angular_velocity(pi)
    np.testing.assert_allclose(u, pi / moments, rtol=1e-15)
    best = metric.pseudo_hamiltonian(pi, u)
    assert_within(best, metric.hamiltonian(pi), 1e-14)
    assert_within(best, 0.5 * np.sum(pi**2 / moments, axis=-1), 1e-14)
    step = rng.normal(size=(50, 3)) * np.isfinite(moments)
    weights = np.where(np.isfinite(moments), moments, 0.0)
    lost = 0.5 * np.sum(weights * step**2, axis=-1)
    assert_within(metric.pseudo_hamiltonian(pi, u + step), best - lost, 1e-13)


@pytest.mark.parametrize("name", full_but(METRICS, "unsorted", "rod", "strong", "sub-Riemannian"))
def test_geodesics_solve_the_extremal_equations_q1_q2(name):
    rng = np.random.default_rng(2)
    metric = left_invariant_metric(METRICS[name])
    for _ in range(3):
        start = metric.unit_speed(rng.normal(size=3))
        at = variational(METRICS[name], start, 5.0)
        t = np.array([0.3, 2.0, 5.0])
        assert_within(metric.attitude(start, t), [at(s)[0] for s in t], 1e-11)
        assert_within(metric.body_momentum(start, t), [at(s)[1] for s in t], 1e-11)


def test_eulers_equation_componentwise_q2():
    rng = np.random.default_rng(3)
    metric = left_invariant_metric(TRIAXIAL)
    h = rng.normal(size=(20, 3))
    i1, i2, i3 = TRIAXIAL
    printed = [
        h[:, 1] * h[:, 2] * (1 / i3 - 1 / i2),
        h[:, 0] * h[:, 2] * (1 / i1 - 1 / i3),
        h[:, 0] * h[:, 1] * (1 / i2 - 1 / i1),
    ]
    assert_within(metric.momentum_rate(h), np.transpose(printed), 1e-15)


def test_times_are_quadratures_of_the_two_integrals_q3():
    # Pi_2'^2 = (1/I_1 - 1/I_3)^2 Pi_1^2 Pi_3^2, both squares linear in Pi_2^2 by H and |Pi|.
    start, t = np.array([1.0, 0.2, 0.9]), 0.6
    for moments in (TRIAXIAL, np.array(METRICS["sub-Riemannian"])):
        a, b, c = inverse(moments)
        metric = left_invariant_metric(moments)
        h, size = 2.0 * metric.hamiltonian(start), start @ start

        def slowness(y, a=a, b=b, c=c, h=h, size=size):
            first = (c * (size - y * y) - h + b * y * y) / (c - a)
            third = (h - b * y * y - a * (size - y * y)) / (c - a)
            return -1.0 / ((c - a) * np.sqrt(first * third))

        end = metric.body_momentum(start, t)[1]
        assert end < start[1]
        assert abs(quad(slowness, start[1], end, epsabs=1e-13)[0] - t) < 1e-12


@pytest.mark.parametrize("name", METRICS)
def test_momentum_in_inertial_axes_and_the_hamiltonian_are_conserved_q4(name):
    rng = np.random.default_rng(4)
    metric = left_invariant_metric(METRICS[name])
    start = metric.unit_speed(rng.normal(size=(20, 3)))
    t = rng.uniform(-20.0, 20.0, 20)
    at = metric.body_momentum(start, t)
    np.testing.assert_allclose(so3.apply(metric.attitude(start, t), at), start, atol=1e-12)
    assert_within(metric.hamiltonian(at), 0.5, 1e-11)
    # The lift of A_i R is one component of R Pi.
    attitude, pi = metric.attitude(start[0], 1.3), metric.body_momentum(start[0], 1.3)
    lifts = [so3.vee(attitude.T @ generator @ attitude) @ pi for generator in (A1, A2, A3)]
    assert_within(lifts, start[0], 1e-12)


def test_geodesics_are_the_motions_of_the_euler_top():
    rng = np.random.default_rng(5)
    for _ in range(20):
        root = rng.normal(size=(3, 3))
        inertia = root @ root.T + 0.3 * np.eye(3)
        metric, start = left_invariant_metric(inertia), rng.normal(size=3)
        top = EulerTop(inertia, start)
        t = rng.uniform(-3.0, 10.0, 5)
        assert_within(metric.attitude(start, t), top.attitude(t), 1e-11)
        assert_within(metric.body_momentum(start, t), top.body_momentum(t), 1e-11)
    # An eigenvalue routine is right for a tensor within some units of rounding of the given one.
    rounding = 16.0 * np.finfo(float).eps * np.trace(inertia)
    assert_within(metric.axes @ np.diag(metric.moments) @ metric.axes.T, inertia, rounding)


@pytest.mark.parametrize("moments", list(itertools.permutations((0.2, 0.47, 0.8))), ids=str)
def test_next_to_the_unstable_axis_with_one_component_zero_q2(moments):
    """P and Q of the closed form are equal there when rounded; which axis is circled is decided by their difference."""
    metric = left_invariant_metric(moments)
    for momentum in itertools.permutations((1.0, 1e-9, 0.0)):
        top = EulerTop.principal(moments, momentum)
        assert_within(metric.attitude(momentum, 5.0), top.attitude(5.0), 1e-12)


def test_moments_and_axes_ascend_and_are_those_given():
    for moments in itertools.permutations((3.0, 2.0, np.inf)):
        metric = left_invariant_metric(moments)
        np.testing.assert_array_equal(metric.moments, [2.0, 3.0, np.inf])
        np.testing.assert_array_equal((metric.axes * metric.inverse_moments) @ metric.axes.T, np.diag(inverse(moments)))
        assert np.linalg.det(metric.axes) == pytest.approx(1.0, abs=1e-15)


def test_one_parameter_is_left_in_the_sub_riemannian_case_q5():
    # k^2 = I_2/I_3: multiplying both moments by a number only multiplies the momenta.
    start, t = np.array([0.7, -0.4, 1.1]), 1.7
    once, thrice = left_invariant_metric([np.inf, 2.0, 1.0]), left_invariant_metric([np.inf, 6.0, 3.0])
    assert_within(thrice.attitude(3.0 * start, t), once.attitude(start, t), 1e-14)
    assert once.is_sub_riemannian
    assert not left_invariant_metric(TRIAXIAL).is_sub_riemannian


def test_the_riemannian_case_converges_as_the_inverse_of_the_moment_q5():
    # The equations are linear in 1/I_1, so attitudes and conjugate times converge at the rate one; the slope of the
    # attitude is the integral of Jacobi's inhomogeneous equation.
    start = np.array([0.9, 0.5, -0.8])
    limit = left_invariant_metric(METRICS["sub-Riemannian"])
    at, conjugate = limit.attitude(start, 3.0), limit.conjugate_time(start)
    inverse_moments = np.array([1e-2, 1e-3, 1e-4])
    near = [left_invariant_metric([1.0 / e, 2.0, 1.0]) for e in inverse_moments]
    gaps = np.array([np.linalg.norm(m.attitude(start, 3.0) - at) for m in near])
    np.testing.assert_allclose(gaps[:-1] / gaps[1:], 10.0, rtol=0.05)
    assert abs(gaps[1] / gaps[2] - 10.0) < 0.01
    delays = [left_invariant_metric([1.0 / e, 2.0, 1.0]).conjugate_time(start) - conjugate for e in (1e-5, 1e-6, 1e-7)]
    np.testing.assert_allclose([delays[0] / delays[1], delays[1] / delays[2]], 10.0, rtol=5e-3)

    def rate(_, y):
        # zeta, delta Pi of the derivative by the first inverse moment.
        pi, z, d = y[:3], y[3:6], y[6:]
        a = inverse(METRICS["sub-Riemannian"])
        extra = np.array([pi[0], 0.0, 0.0])
        u, change = a * pi, a * d + extra
        return np.concatenate([cross(pi, u), change - cross(u, z), cross(d, u) + cross(pi, change)])

    slope = solve_ivp(rate, (0.0, 3.0), np.append(start, np.zeros(6)), "DOP853", rtol=1e-12, atol=1e-13).y[3:6, -1]
    measured = so3.log(at.T @ near[2].attitude(start, 3.0)) / inverse_moments[2]
    assert_within(measured, slope, 2e-3 * np.linalg.norm(slope))
    tiny = left_invariant_metric([1e10, 2.0, 1.0])
    assert_within(so3.log(at.T @ tiny.attitude(start, 3.0)) * 1e10, slope, 1e-4)


@pytest.mark.parametrize("name", full_but(METRICS, "triaxial", "flat", "round", "sub-Riemannian about 2"))
def test_the_differential_solves_the_variational_equation_q6(name):
    rng = np.random.default_rng(7)
    metric = left_invariant_metric(METRICS[name])
    for _ in range(2):
        start = metric.unit_speed(rng.normal(size=3))
        at = variational(METRICS[name], start, 6.0)
        for t in (0.004, 0.3, 2.5, 6.0):
            expected = at(t)[2]
            assert_within(metric.differential(start, t), expected, 2e-11 * max(t, np.abs(expected).max()))


def test_the_differential_at_special_momenta_q6():
    # At rest, along axes, on the separatrix, next to it and next to the unstable axis; t from tiny to long.
    a, b, c = inverse(TRIAXIAL)
    special = [
        *np.eye(3),
        [np.sqrt(c - b), 0.0, np.sqrt(b - a)],
        [np.sqrt(c - b), 0.7, np.sqrt(b - a)],
        [1e-7, 1.0, 0.0],
        [1e-5, 1.0, 1e-5],
        [0.0, 1.0, 1e-12],
    ]
    metric = left_invariant_metric(TRIAXIAL)
    for start in np.array(special):
        at = variational(TRIAXIAL, start, 8.0)
        for t in (1e-3, 0.0199, 0.0201, 3.0, 8.0):
            expected = at(t)[2]
            assert_within(metric.differential(start, t), expected, 1e-11 * max(t, np.abs(expected).max()))
    assert_within(metric.differential(np.zeros(3), 2.0), np.diag(2.0 / TRIAXIAL), 1e-15)
    np.testing.assert_array_equal(metric.differential(np.ones(3), 0.0), np.zeros((3, 3)))


def test_small_turns_keep_their_digits_q6():
    # Both sides of the switch from the integral to the difference, against 40 digits of the Taylor series.
    mpmath.mp.dps = 40
    a = [mpmath.mpf(1) / 3, mpmath.mpf(1) / 2, mpmath.mpf(1)]
    metric, direction = left_invariant_metric(TRIAXIAL), np.array([0.6, 0.0, 0.8])

    def cross(x, y):
        return [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]

    def series(column, t):
        pi, d, z = [[mpmath.mpf(float(v)) for v in direction]], [[mpmath.mpf(i == column) for i in range(3)]], [[0] * 3]
        for k in range(14):
            new_pi, new_d, new_z = [0] * 3, [0] * 3, [a[i] * d[k][i] for i in range(3)]
            for j in range(k + 1):
                u, v = [a[i] * pi[j][i] for i in range(3)], [a[i] * d[j][i] for i in range(3)]
                for i in range(3):
                    new_pi[i] += cross(pi[k - j], u)[i]
                    new_d[i] += cross(d[k - j], u)[i] + cross(pi[k - j], v)[i]
                    new_z[i] += cross(z[k - j], u)[i]
            pi.append([x / (k + 1) for x in new_pi])
            d.append([x / (k + 1) for x in new_d])
            z.append([x / (k + 1) for x in new_z])
        return [float(sum(z[k][i] * mpmath.mpf(t) ** k for k in range(15))) for i in range(3)]

    for t in (1e-6, 1e-3, 0.0199, 0.0201, 0.05):
        expected = np.array([series(column, t) for column in range(3)]).T
        assert_within(metric.differential(direction, t), expected, 1e-13 * t)


@pytest.mark.parametrize(
    "name", full_but([name for name in METRICS if name != "round"], "unsorted", "flat", "sub-Riemannian about 2")
)
def test_conjugate_times_are_zeros_of_the_variational_determinant_q6(name):
    rng = np.random.default_rng(8)
    metric = left_invariant_metric(METRICS[name])
    for _ in range(1):
        start = metric.unit_speed(rng.normal(size=3))
        times = [float(metric.conjugate_time(start, order)) for order in (1, 2, 3)]
        at = variational(METRICS[name], start, times[1] * 1.02)

        def determinant(t, at=at):
            return np.linalg.det(at(t)[2])

        grid = np.linspace(0.03 * times[0], times[1] * 1.015, 250)
        values = np.array([determinant(t) for t in grid])
        change = np.flatnonzero(values[1:] * values[:-1] < 0.0)
        found = [brentq(determinant, grid[k], grid[k + 1], xtol=1e-14) for k in change]
        assert len(found) == 2
        assert_within(found, times[:2], 1e-10)
        assert times[2] > times[1]


UNEQUAL = [([1.0, 1e3, 20.0], [1]), ([np.inf, 1.0, 1e-2], [1]), ([1e4, 1.0, 1e-2], [1])]


@pytest.mark.parametrize(("moments", "axes"), [(TRIAXIAL, [0, 1, 2]), *UNEQUAL], ids=str)
def test_conjugate_times_of_steady_rotations_q6(moments, axes):
    """About axis k the linear flow is a turn by a_k t of the exponential of a constant matrix."""
    a = inverse(moments)
    metric = left_invariant_metric(moments)
    for k in axes:
        i, j = (k + 1) % 3, (k + 2) % 3
        linear = np.array([[0.0, a[k] - a[j]], [a[i] - a[k], 0.0]])

        def determinant(t, k=k, linear=linear):
            turn = expm(t * a[k] * np.array([[0.0, -1.0], [1.0, 0.0]]))
            return 2.0 - np.trace(turn @ expm(t * linear))

        for order in (1, 2, 3)[: len(axes)]:
            time = float(metric.conjugate_time(np.eye(3)[k], order))
            assert abs(determinant(time)) < 1e-12 * np.linalg.norm(expm(time * linear)) ** 2
        if k and len(axes) > 1:
            first = float(metric.conjugate_time(np.eye(3)[k]))
            grid = np.linspace(0.1, 0.999 * first, 200)
            assert min(determinant(t) for t in grid) > 0.0


def test_double_conjugate_points_count_twice_q6():
    # The round metric: every geodesic meets two fields' zeros at each whole turn.
    rng = np.random.default_rng(9)
    metric = left_invariant_metric([2.0, 2.0, 2.0])
    start = metric.unit_speed(rng.normal(size=(10, 3)))
    for order in range(1, 7):
        turn = 2.0 * np.pi * np.sqrt(2.0) * ((order + 1) // 2)
        np.testing.assert_allclose(metric.conjugate_time(start, order), turn, rtol=1e-13)
    # Along the axis of symmetry too, and next to it the two separate.
    rod = left_invariant_metric([1.0, 1.0, 0.3])
    np.testing.assert_allclose([rod.conjugate_time([0, 0, 1.0], k) for k in (1, 2)], 2.0 * np.pi, rtol=1e-13)
    first, second = (float(rod.conjugate_time([0.3, 0, 1.0], k)) * np.hypot(0.3, 1.0) for k in (1, 2))
    assert first < 2.0 * np.pi * (1.0 - 1e-4)
    assert abs(second - 2.0 * np.pi) < 1e-12


def test_conjugate_times_scale_and_are_symmetric_q6():
    rng = np.random.default_rng(10)
    metric = left_invariant_metric(TRIAXIAL)
    start = rng.normal(size=(8, 3))
    time = metric.conjugate_time(start)
    np.testing.assert_allclose(metric.conjugate_time(2.5 * start), time / 2.5, rtol=1e-12)
    for signs in ([-1, -1, 1], [1, -1, -1], [-1, 1, -1]):
        np.testing.assert_allclose(metric.conjugate_time(start * signs), time, rtol=1e-12)
    # The same from the end point backwards.
    np.testing.assert_allclose(metric.conjugate_time(-metric.body_momentum(start, time)), time, rtol=1e-11)
    # In other axes.
    turn = so3.exp(np.array([0.3, -0.8, 0.5]))
    turned = left_invariant_metric(turn @ np.diag(TRIAXIAL) @ turn.T)
    np.testing.assert_allclose(turned.conjugate_time(start @ turn.T), time, rtol=1e-11)
    locus = metric.conjugate_locus(start)
    assert_within(turned.conjugate_locus(start @ turn.T), turn @ locus @ turn.T, 1e-10)


def test_the_conjugate_locus_is_a_critical_value_of_the_exponential_map_q6():
    rng = np.random.default_rng(11)
    for name in ("triaxial", "sub-Riemannian", "flat"):
        metric = left_invariant_metric(METRICS[name])
        start = metric.unit_speed(rng.normal(size=(5, 3)))
        time = metric.conjugate_time(start)
        values = np.linalg.svd(metric.differential(start, time), compute_uv=False)
        assert (values[:, 2] / values[:, 0]).max() < 1e-12
        # Along the null direction the end moves to second order only.
        null = np.linalg.svd(metric.differential(start, time))[2][:, 2]
        locus, step = metric.conjugate_locus(start), 1e-4
        moved = so3.angle(so3.transpose(locus) @ metric.attitude(start + step * null, time))
        assert moved.max() < 1e3 * step**2
        np.testing.assert_array_equal(locus, metric.attitude(start, time))


@pytest.mark.parametrize("name", METRICS)
def test_gauss_lemma_holds_q6(name):
    # Pi . Z dPi = t u . dPi.
    rng = np.random.default_rng(12)
    metric = left_invariant_metric(METRICS[name])
    start, t = rng.normal(size=(20, 3)), rng.uniform(0.1, 6.0, 20)
    projected = np.einsum("ni,nij->nj", metric.body_momentum(start, t), metric.differential(start, t))
    assert_within(projected, t[:, None] * metric.angular_velocity(start), 1e-10)


def test_serret_andoyer_conjugate_points_are_not_those_on_so3_q7():
    surface = serret_andoyer_metric(TRIAXIAL)
    metric = left_invariant_metric(TRIAXIAL)
    a, _, c = inverse(TRIAXIAL)
    for p in (1.70, 1.42):
        momentum = np.array([0.0, 0.0, -np.sqrt((1.0 - a * p * p) / (c - a))])
        momentum[0] = np.sqrt(p * p - momentum[2] ** 2)
        family = surface.geodesics(p)
        time = float(family.conjugate_points().time)
        # The reduced motion is the same one.
        here = metric.body_momentum(momentum, time)
        assert [np.arctan2(here[0], here[1]), here[2]] == pytest.approx([family.y(time), family.p_y(time)], abs=1e-11)
        # But the end of the geodesic on SO(3) is not conjugate there, and is elsewhere.
        conjugates = np.array([metric.conjugate_time(momentum, order) for order in (1, 2, 3)])
        assert np.abs(conjugates / time - 1.0).min() > 0.01
        values = np.linalg.svd(metric.differential(momentum, time), compute_uv=False)
        assert values[2] / values[0] > 1e-3


def test_the_fibre_is_lagrangian_in_andoyer_variables_q8():
    """The sum dG^dg + dK^dk + dL^dl vanishes on the momenta at one attitude, but not on all of the phase space."""
    offsets, weights = np.array([1, 2, 3, -1, -2, -3]), np.array([45, -9, 1, -45, 9, -1]) / 60.0
    h, momentum = 1e-2, np.array([0.8, -0.5, 1.3])
    turns = so3.exp(np.array([0.0, 0.0, h]) * offsets[:, None])
    attitude = so3.exp(np.array([0.3, -1.0, 0.6]))
    states = [andoyer_variables(attitude, momentum + h * offsets[:, None] * unit) for unit in np.eye(3)]
    states.append(andoyer_variables(turns @ attitude, momentum))
    names = ("g", "k", "l", "total", "vertical", "axial")
    slopes = np.array([[weights @ getattr(state, name) / h for name in names] for state in states])
    form = slopes[:, 3:] @ slopes[:, :3].T
    form = form - form.T
    assert np.abs(form[:3, :3]).max() < 1e-9
    # Along a turn about the third axis the form is the differential of K: not zero.
    assert np.abs(form[:3, 3]) == pytest.approx(np.abs(slopes[:3, 4]), abs=1e-9)
    assert np.abs(slopes[:3, 4]).max() > 0.1


def test_batches_and_shapes():
    metric = left_invariant_metric(TRIAXIAL)
    start = np.random.default_rng(13).normal(size=(4, 1, 3))
    t = np.linspace(0.0, 3.0, 5)
    attitude, differential = metric.attitude(start, t), metric.differential(start, t)
    assert attitude.shape == differential.shape == (4, 5, 3, 3)
    assert metric.conjugate_time(start).shape == (4, 1)
    assert np.shape(metric.conjugate_time(start[0, 0])) == ()
    assert metric.conjugate_locus(start).shape == (4, 1, 3, 3)
    assert_within(attitude[2, 3], metric.attitude(start[2, 0], t[3]), 1e-14)
    assert_within(differential[2, 3], metric.differential(start[2, 0], t[3]), 1e-13)
    np.testing.assert_allclose(
        metric.conjugate_time(start)[3, 0], metric.conjugate_time(start[3, 0]), rtol=1e-13, atol=0
    )
    assert metric.conjugate_time(np.zeros((0, 3))).shape == (0,)
    assert metric.attitude(np.zeros((0, 3))).shape == (0, 3, 3)


@pytest.mark.parametrize(
    ("inertia", "error"),
    [
        ([1.0, 2.0], ShapeError),
        ([1.0, -2.0, 3.0], ShapeError),
        ([np.inf, np.inf, 3.0], ShapeError),
        ([-np.inf, 1.0, 3.0], ShapeError),
        ([np.nan, 1.0, 3.0], ShapeError),
        ([0.0, 1.0, 3.0], ShapeError),
        ("abc", ShapeError),
        (np.full((3, 3), np.inf), ShapeError),
        (np.diag([1.0, 2.0, 0.0]), SingularInertiaError),
        (np.triu(np.ones((3, 3))), UnphysicalInertiaError),
    ],
)
def test_metrics_refused(inertia, error):
    with pytest.raises(error):
        left_invariant_metric(inertia)


def test_momenta_refused():
    metric, flat = left_invariant_metric(TRIAXIAL), left_invariant_metric([1.0, np.inf, 2.0])
    with pytest.raises(ShapeError, match="moves"):
        metric.conjugate_time(np.zeros(3))
    with pytest.raises(ShapeError, match="forbidden"):
        flat.unit_speed([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]])
    with pytest.raises(ShapeError, match="forbids"):
        flat.pseudo_hamiltonian([1.0, 1.0, 1.0], [0.0, 0.1, 0.0])
    with pytest.raises(ShapeError, match="broadcast"):
        metric.attitude(np.ones((4, 3)), np.ones(3))
    for order in (0, -1, 1.5, True):
        with pytest.raises(ShapeError, match="order"):
            metric.conjugate_time([1.0, 0.0, 0.0], order)
    with pytest.raises(ShapeError):
        metric.attitude([1.0, np.nan, 0.0])
    with pytest.raises(ShapeError):
        metric.differential([1.0, 0.0, 0.0], np.inf)
    with pytest.raises(ShapeError, match="far"):
        metric.differential([1.0, 0.3, 0.2], 1e9)


def test_no_conjugate_time_is_an_error(monkeypatch):
    monkeypatch.setattr("shapephase.rigid_body.geodesics._conjugate_search._STEPS_EACH", 2)
    with pytest.raises(AccuracyNotReached, match="conjugate"):
        left_invariant_metric(TRIAXIAL).conjugate_time([1.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("part", "saddle"), full_but([(0.9, False), (0.99, False), (1.01, True), (1.1, True)], (0.99, False), (1.01, True))
)
def test_geodesics_are_minima_of_the_length_up_to_the_conjugate_time_q6(part, saddle):
    # Of curves of two geodesics with the same ends, by where they meet off the middle: Morse's index.
    metric = left_invariant_metric(TRIAXIAL)
    start = metric.unit_speed([0.3, 0.8, -0.5])
    time = part * float(metric.conjugate_time(start))
    target, middle = metric.attitude(start, time), metric.attitude(start, 0.5 * time)
    here = metric.body_momentum(start, 0.5 * time)
    tangent = so3.normalised(metric.angular_velocity(here))
    across = so3.perpendicular(tangent)
    plane = np.stack([across, np.cross(tangent, across)])

    def length(x, y):
        total, meeting = 0.0, middle @ so3.exp(x * plane[0] + y * plane[1])
        for attitude, pi in ((meeting, 0.5 * time * start), (meeting.T @ target, 0.5 * time * here)):
            for _ in range(4):
                pi = pi + np.linalg.solve(metric.differential(pi), so3.log(metric.attitude(pi).T @ attitude))
            total += float(metric.speed(pi))
        return total

    h = 1e-3
    straight = length(0.0, 0.0)
    assert abs(straight - time) < 1e-12
    second = np.empty((2, 2))
    second[0, 0] = length(h, 0.0) + length(-h, 0.0) - 2.0 * straight
    second[1, 1] = length(0.0, h) + length(0.0, -h) - 2.0 * straight
    mixed = length(h, h) + length(-h, -h) - length(h, -h) - length(-h, h)
    second[0, 1] = second[1, 0] = 0.25 * mixed
    least, largest = np.linalg.eigvalsh(second) / h**2
    assert largest > 0.0
    assert (least < -1e-4) if saddle else (least > 1e-4)
