"""The heavy top against symbols, raw integration and a pendulum in closed form."""

from __future__ import annotations

import casadi as ca
import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from shapephase import so3
from shapephase.errors import AccuracyNotReached, ShapeError, SingularInertiaError, UnphysicalInertiaError
from shapephase.rigid_body import (
    HeavyTop,
    LagrangeTop,
    casimirs,
    nutation,
    semidirect_bracket,
    sleeping_matrix,
    sleeping_spectrum,
    sleeping_top,
    stability_chart,
)
from support.independent import cross
from support.long_runs import full_but

UP = np.array([0.0, 0.0, 1.0])
EPS = float(np.finfo(float).eps)


def random_top(rng):
    axes = Rotation.random(rng=rng).as_matrix()
    inertia = axes @ np.diag(rng.uniform(0.5, 2.0, 3)) @ axes.T
    return HeavyTop(0.5 * (inertia + inertia.T), rng.uniform(0.5, 5.0), so3.normalised(rng.normal(size=3)))


def raw_motion(top, momentum, gamma, times):
    def rates(_, y):
        omega = np.linalg.solve(top.inertia, y[:3])
        return np.concatenate([cross(y[:3], omega) + top.mgl * cross(y[3:], top.chi), cross(y[3:], omega)])

    start = np.concatenate([momentum, gamma])
    run = solve_ivp(rates, (0.0, times[-1]), start, method="DOP853", rtol=1e-13, atol=1e-14, t_eval=times)
    return run.y[:3].T, run.y[3:].T


def symbols():
    return ca.SX.sym("pi", 3), ca.SX.sym("gamma", 3)


def at(expression, symbol, value):
    return np.array(ca.Function("f", [symbol], [expression])(value))


def symbolic_energy(top, pi, gamma):
    return 0.5 * ca.dot(pi, ca.mtimes(ca.inv(ca.DM(top.inertia)), pi)) + float(top.mgl) * ca.dot(gamma, ca.DM(top.chi))


def symbolic_bracket(f, g, pi, gamma):
    fp, fg, gp, gg = (ca.gradient(x, y) for x in (f, g) for y in (pi, gamma))
    return -ca.dot(pi, ca.cross(fp, gp)) - ca.dot(gamma, ca.cross(fp, gg) - ca.cross(gp, fg))


def test_equations_energy_and_casimirs_m1():
    rng = np.random.default_rng(1)
    for _ in range(20):
        top, momentum, gamma = random_top(rng), rng.normal(size=3), rng.normal(size=3)
        pi, up = symbols()
        point = ca.vertcat(pi, up)
        energy = symbolic_energy(top, pi, up)
        omega = ca.gradient(energy, pi)
        field = ca.vertcat(ca.cross(pi, omega) + ca.cross(up, ca.gradient(energy, up)), ca.cross(up, omega))
        value = np.concatenate([momentum, gamma])
        rates = np.concatenate(top.rates(momentum, gamma))
        assert np.abs(at(field, point, value).ravel() - rates).max() < 1e-13 * np.abs(rates).max() + 1e-14
        assert np.abs(at(ca.jacobian(field, point), point, value) - top.linearisation(momentum, gamma)).max() < 1e-12
        assert top.energy(momentum, gamma) == pytest.approx(at(energy, point, value).item(), rel=1e-13)
        gradient = np.concatenate(top.energy_gradient(momentum, gamma))
        assert np.abs(at(ca.gradient(energy, point), point, value).ravel() - gradient).max() < 1e-13
        assert gradient @ rates == pytest.approx(0.0, abs=1e-12)
        first, second = rates[:3], rates[3:]
        assert first @ gamma + momentum @ second == pytest.approx(0.0, abs=1e-12)
        assert second @ gamma == pytest.approx(0.0, abs=1e-13)
        assert casimirs(momentum, gamma) == pytest.approx((momentum @ gamma, gamma @ gamma), rel=1e-14)


def test_the_semidirect_bracket_gives_the_equations_and_is_a_poisson_bracket_m2():
    rng = np.random.default_rng(2)
    pi, up = symbols()
    point = ca.vertcat(pi, up)
    monomials = [ca.dot(ca.DM(rng.normal(size=6)), point) * ca.dot(ca.DM(rng.normal(size=6)), point) for _ in range(3)]
    f, g, h = (m + ca.dot(ca.DM(rng.normal(size=6)), point) for m in monomials)

    def bracket(a, b):
        return symbolic_bracket(a, b, pi, up)

    top = random_top(rng)
    energy = symbolic_energy(top, pi, up)
    for _ in range(10):
        value = rng.normal(size=6)
        momentum, gamma = value[:3], value[3:]

        def ours(a, b, v=value, m=momentum, u=gamma):
            da, db = (at(ca.gradient(x, point), point, v).ravel() for x in (a, b))
            return semidirect_bracket((da[:3], da[3:]), (db[:3], db[3:]), m, u)

        assert ours(f, g) == pytest.approx(at(bracket(f, g), point, value).item(), rel=1e-12)
        assert ours(f, g) == -ours(g, f)
        jacobi = ours(bracket(f, g), h) + ours(bracket(g, h), f) + ours(bracket(h, f), g)
        assert jacobi == pytest.approx(0.0, abs=1e-11)
        by_parts = ours(f * g, h) - at(f, point, value).item() * ours(g, h) - at(g, point, value).item() * ours(f, h)
        assert by_parts == pytest.approx(0.0, abs=1e-11)
        for casimir in (ca.dot(pi, up), ca.sumsqr(up)):
            assert ours(casimir, f) == pytest.approx(0.0, abs=1e-12)
        rates = [ours(point[k], energy) for k in range(6)]
        assert np.concatenate(top.rates(momentum, gamma)) == pytest.approx(rates, abs=1e-12)


@pytest.mark.parametrize("count", full_but([1, 3], 1))
def test_motion_keeps_both_casimirs_to_rounding_and_solves_the_raw_equations_m1(count):
    rng = np.random.default_rng(3)
    times = np.linspace(0.0, 6.0, 333)
    for _ in range(count):
        top = random_top(rng)
        momentum, gamma = rng.normal(size=3) * 3.0, so3.normalised(rng.normal(size=3))
        motion = top.motion(momentum, gamma, duration=6.0, tolerance=1e-10)
        pi, up = motion.body_momentum(times), motion.gamma(times)
        raw_pi, raw_up = raw_motion(top, momentum, gamma, times)
        assert np.abs(up - raw_up).max() < 2e-10
        assert np.abs(pi - raw_pi).max() < 2e-10 * (3.0 + np.linalg.norm(momentum))
        product, square = casimirs(pi, up)
        assert np.abs(product - momentum @ gamma).max() < 4e-15 * np.linalg.norm(pi, axis=-1).max()
        # A product of quaternions has a length within 4 eps of one, its matrix the square of that, the square of a row
        # the fourth power: 16 eps, and as much again for the sums.
        assert np.abs(square - 1.0).max() < 32.0 * EPS
        energy = top.energy(pi, up)
        assert np.abs(energy - top.energy(momentum, gamma)).max() < motion.energy_drift + 1e-9
        assert motion.energy_drift < 1e-9
        rotation = motion.attitude(times)
        assert np.abs(so3.transpose(rotation) @ rotation - np.eye(3)).max() < 32.0 * EPS
        # R' = R hat(Omega), by differences of the attitude.
        step = 1e-4
        middle = np.linspace(0.1, 5.9, 20)
        turn = so3.log(so3.transpose(motion.attitude(middle - step)) @ motion.attitude(middle + step)) / (2.0 * step)
        assert np.abs(turn - motion.angular_velocity(middle)).max() < 1e-5


@pytest.mark.parametrize("count", full_but([1, 3], 1))
def test_the_error_estimate_is_honest_m1(count):
    rng = np.random.default_rng(4)
    for _ in range(count):
        top, momentum, gamma = random_top(rng), rng.normal(size=3) * 2.0, so3.normalised(rng.normal(size=3))
        best = top.motion(momentum, gamma, duration=4.0, tolerance=1e-11)
        times = np.linspace(0.0, 4.0, 200)
        for tolerance in (1e-4, 1e-9):
            motion = top.motion(momentum, gamma, duration=4.0, tolerance=tolerance)
            error = so3.angle(so3.transpose(motion.attitude(times)) @ best.attitude(times)).max()
            assert error < motion.error_estimate + 1e-11
            assert motion.error_estimate <= tolerance
            energy = top.energy(motion.body_momentum(times), motion.gamma(times))
            assert motion.energy_drift > 0.1 * np.abs(energy - energy[0]).max() - 1e-14


def test_without_weight_the_spatial_momentum_stands_still_m1():
    rng = np.random.default_rng(5)
    top = HeavyTop(random_top(rng).inertia, 0.0)
    momentum = rng.normal(size=3)
    attitude = Rotation.random(rng=rng).as_matrix()
    motion = top.motion(momentum, attitude=attitude, duration=20.0)
    times = np.linspace(0.0, 20.0, 50)
    spatial = so3.apply(motion.attitude(times), motion.body_momentum(times))
    assert np.abs(spatial - attitude @ momentum).max() < 1e-14
    # A given rotation is made a quaternion and a matrix again.
    assert np.abs(motion.attitude(0.0) - attitude).max() < 16.0 * EPS


def test_hanging_at_rest_swings_like_a_plane_pendulum_m1():
    # chi sideways, released at rest: theta'' = -(Mgl/I) sin(theta), by its quarter period from a right angle.
    top = HeavyTop(np.diag([2.0, 1.0, 1.5]), 3.0, [0.0, 1.0, 0.0])
    quarter = float(mpmath.ellipk(0.5)) * np.sqrt(2.0 / 3.0)
    motion = top.motion([0.0, 0.0, 0.0], duration=4.0 * quarter, tolerance=1e-11)
    height = motion.gamma(quarter * np.array([0.0, 1.0, 2.0, 4.0])) @ [0.0, 1.0, 0.0]
    assert height == pytest.approx([0.0, -1.0, 0.0, 0.0], abs=1e-10)


def test_batches_are_what_their_members_are_m1():
    rng = np.random.default_rng(6)
    tops = [random_top(rng) for _ in range(3)]
    batch = HeavyTop(
        np.array([t.inertia for t in tops])[:, None],
        np.array([[t.mgl] for t in tops]),
        np.array([[t.chi] for t in tops]),
    )
    momenta, gammas = rng.normal(size=(2, 3)), so3.normalised(rng.normal(size=(3, 2, 3)))
    motion = batch.motion(momenta, gammas, duration=3.0)
    times = np.linspace(0.0, 3.0, 8).reshape(2, 4)
    assert [c.shape for c in (*casimirs(momenta, UP), *casimirs(UP, momenta))] == [(2,)] * 4
    assert motion.attitude(times).shape == (3, 2, 2, 4, 3, 3)
    assert motion.angular_velocity(times).shape == motion.gamma(times).shape == (3, 2, 2, 4, 3)
    assert motion.error_estimate.shape == motion.energy_drift.shape == motion.vertical_momentum.shape == (3, 2)
    assert motion.gamma(np.array([])).shape == (3, 2, 0, 3)
    for i, j in ((0, 1), (2, 0)):
        single = tops[i].motion(momenta[j], gammas[i, j], duration=3.0)
        assert np.abs(single.body_momentum(times) - motion.body_momentum(times)[i, j]).max() < 5e-9
        assert np.abs(single.angular_velocity(times) - motion.angular_velocity(times)[i, j]).max() < 1e-8
        assert np.abs(batch.rates(momenta, gammas)[0][i, j] - tops[i].rates(momenta[j], gammas[i, j])[0]).max() < 1e-14


def test_energy_plus_half_gamma_squared_generates_the_same_motion_m10():
    rng = np.random.default_rng(13)
    for _ in range(10):
        top, momentum, gamma = random_top(rng), rng.normal(size=3), rng.normal(size=3)
        omega, v = top.legendre(momentum, gamma)
        # Its gradient is (Omega, v): by the bracket the coordinates move as before.
        for k in range(6):
            unit = np.eye(6)[k]
            rate = semidirect_bracket((unit[:3], unit[3:]), (omega, v), momentum, gamma)
            assert rate == pytest.approx(np.concatenate(top.rates(momentum, gamma))[k], abs=1e-12)
        pi, up = symbols()
        modified = symbolic_energy(top, pi, up) + 0.5 * ca.sumsqr(up)
        gradient = at(ca.gradient(modified, ca.vertcat(pi, up)), ca.vertcat(pi, up), np.concatenate([momentum, gamma]))
        assert gradient.ravel() == pytest.approx(np.concatenate([omega, v]), abs=1e-13)


def test_euler_poincare_form_m10():
    rng = np.random.default_rng(14)
    for _ in range(10):
        top, momentum, gamma = random_top(rng), rng.normal(size=3), so3.normalised(rng.normal(size=3))
        omega, v = top.legendre(momentum, gamma)
        w, s = ca.SX.sym("omega", 3), ca.SX.sym("v", 3)
        rest = s - float(top.mgl) * ca.DM(top.chi)
        lagrangian = 0.5 * ca.dot(w, ca.mtimes(ca.DM(top.inertia), w)) + 0.5 * ca.sumsqr(rest)
        point, value = ca.vertcat(w, s), np.concatenate([omega, v])
        assert top.lagrangian(omega, v) == pytest.approx(at(lagrangian, point, value).item(), rel=1e-13)
        # The momenta are back, and the Legendre transform is the modified energy.
        momenta = at(ca.gradient(lagrangian, point), point, value).ravel()
        assert momenta == pytest.approx(np.concatenate([momentum, gamma]), abs=1e-13)
        modified = top.energy(momentum, gamma) + 0.5 * gamma @ gamma
        assert momenta @ value - top.lagrangian(omega, v) == pytest.approx(modified, rel=1e-12)
        # d/dt (dl/dxi) = ad*_xi (dl/dxi) on se(3).
        rates = top.rates(momentum, gamma)
        assert rates[0] == pytest.approx(np.cross(momenta[:3], omega) + np.cross(momenta[3:], v), abs=1e-12)
        assert rates[1] == pytest.approx(np.cross(momenta[3:], omega), abs=1e-12)


def test_heavy_tops_refuse_bad_input():
    inertia = np.diag([1.0, 2.0, 3.0])
    top = HeavyTop(inertia, 1.0)
    for build, message in (
        (lambda: HeavyTop(inertia, 1.0, [0.0, 0.0, 2.0]), "length 1"),
        (lambda: HeavyTop([inertia] * 2, [1.0] * 3), "broadcast"),
        (lambda: top.motion(UP, UP, duration=1.0, attitude=np.eye(3)), "give one of them"),
        (lambda: top.motion(UP, 2.0 * UP, duration=1.0), "length 1"),
        (lambda: top.motion(UP, duration=0.0), "duration"),
        (lambda: top.motion(UP, duration=1.0, tolerance=1e-15), "tolerance"),
        (lambda: top.motion(UP, duration=1.0).gamma(1.5), "the motion is on"),
        (lambda: top.motion([1.0, np.nan, 0.0], duration=1.0), "finite"),
        (lambda: LagrangeTop(1.0, 2.0, np.inf), "finite"),
        (lambda: LagrangeTop([1.0, 1.0], 2.0, 1.0), "one number"),  # type: ignore[arg-type]
        (lambda: sleeping_top(LagrangeTop(1.0, 2.0, 1.0), np.nan), "finite"),
        (lambda: sleeping_matrix(np.ones((2, 3)), np.ones(3), 1.0), "broadcast"),
        (lambda: stability_chart(1.0, [2.0]), "two lists"),
        (lambda: stability_chart([1.0], [2.0], tilt=0.5), "tilt"),
        (lambda: nutation(LagrangeTop(1.0, 2.0, -1.0), UP, UP), "Mgl > 0"),
        (lambda: nutation(LagrangeTop(1.0, 2.0, 1.0), UP, 2.0 * UP), "length 1"),
        (lambda: nutation(LagrangeTop(1.0, 2.0, 1.0), [UP], UP), "is needed"),
    ):
        with pytest.raises(ShapeError, match=message):
            build()
    with pytest.raises(UnphysicalInertiaError, match="symmetric"):
        HeavyTop(inertia + 0.1 * np.eye(3, k=1), 1.0)
    for bad in (lambda: HeavyTop(np.diag([1.0, 0.0, 2.0]), 1.0), lambda: LagrangeTop(0.0, 1.0, 1.0)):
        with pytest.raises(SingularInertiaError):
            bad()
    with pytest.raises(SingularInertiaError, match="above"):
        sleeping_spectrum([1.0, -1.0, 1.0], 1.0, 1.0)


def test_a_tolerance_out_of_reach_is_said_so():
    # Tumbling chaotically: rounding grows beyond the tolerance.
    top = HeavyTop(np.diag([1.0, 1.2, 0.8]), 1.0)
    with pytest.raises(AccuracyNotReached, match="tolerance"):
        top.motion([0.3, 0.4, 0.1], so3.normalised([0.6, 0.1, 1.0]), duration=25.0, tolerance=1e-12)
