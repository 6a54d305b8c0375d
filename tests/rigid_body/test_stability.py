"""Steady rotations of a free rigid body, against symbols, eigenvalues and raw integration."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from shapephase import so3
from shapephase.errors import ShapeError, SingularInertiaError, UnphysicalInertiaError
from shapephase.rigid_body import EulerTop, spin_in_space, steady_rotation, steady_rotations
from support.independent import cross
from support.long_runs import full_but

INTERMEDIATE = 1


def turned(moments, rng):
    axes = Rotation.random(rng=rng).as_matrix()
    tensor = axes @ np.diag(moments) @ axes.T
    return 0.5 * (tensor + tensor.T)


def random_tops(count, seed):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield turned(np.exp(rng.uniform(-1.5, 1.5, 3)), rng), float(np.exp(rng.uniform(-2.0, 2.0)))


def energy(inertia, pi):
    return 0.5 * ca.dot(pi, ca.solve(ca.DM(inertia), pi))


def euler_field(inertia, pi):
    return ca.cross(pi, ca.solve(ca.DM(inertia), pi))


def at(expression, symbol, value):
    return np.array(ca.Function("f", [symbol], [expression])(value))


def raw_rates(moments):
    return lambda _, x: cross(x, x / moments)


def test_energy_casimir_first_and_second_variation_are_derivatives_of_energy_and_phi_l1():
    pi = ca.SX.sym("pi", 3)
    for inertia, magnitude in random_tops(20, 1):
        for steady in steady_rotations(inertia, magnitude):
            x = 0.5 * ca.sumsqr(pi)
            at_equilibrium = 0.5 * steady.momentum @ steady.momentum
            phi = steady.slope * x + 0.5 * steady.curvature * (x - at_equilibrium) ** 2
            hessian, gradient = ca.hessian(energy(inertia, pi) + phi, pi)
            scale = 1.0 / steady.moment
            assert np.abs(at(gradient, pi, steady.momentum)).max() < 1e-13 * magnitude * np.linalg.cond(inertia) * scale
            assert np.abs(steady.first_variation).max() < 1e-13 * magnitude * np.linalg.cond(inertia) * scale
            exact = at(hessian, pi, steady.momentum)
            assert np.abs(exact - steady.second_variation).max() < 2e-13 * np.abs(exact).max()
            assert steady.slope == -1.0 / steady.moment
            values = np.linspace(0.0, 3.0, 7) * at_equilibrium
            written = steady.slope * values + 0.5 * steady.curvature * (values - at_equilibrium) ** 2
            assert steady.casimir(values) == pytest.approx(written, rel=1e-14)


def test_definite_where_the_moment_is_extreme_and_named_so_l1():
    for inertia, magnitude in random_tops(40, 2):
        smallest, intermediate, largest = steady_rotations(inertia, magnitude)
        assert np.linalg.eigvalsh(largest.second_variation).min() > 0.0
        assert np.linalg.eigvalsh(smallest.second_variation).max() < 0.0
        spread = np.linalg.eigvalsh(intermediate.second_variation)
        assert spread[0] < 0.0 < spread[2]
        names = [s.definiteness for s in (smallest, intermediate, largest)]
        assert names == ["negative definite", "indefinite", "positive definite"]
        assert np.sign([smallest.curvature, largest.curvature]).tolist() == [-1.0, 1.0]


def test_one_casimir_cannot_serve_both_stable_axes_l1():
    # The book's Phi = -x/I1 + (x - 1/2)^2 for |Pi| = 1: definite about the largest moment, not about the smallest.
    pi, unit = ca.SX.sym("pi", 3), np.array([1.0, 0.0, 0.0])
    x = 0.5 * ca.sumsqr(pi)
    for moments, sign in (([3.0, 2.0, 1.0], 1.0), ([1.0, 2.0, 3.0], -1.0)):
        for trial in (1.0, -1.0):
            hessian, _ = ca.hessian(energy(np.diag(moments), pi) - x / moments[0] + trial * (x - 0.5) ** 2, pi)
            values = np.linalg.eigvalsh(at(hessian, pi, unit))
            assert (np.all(values > 0.0) or np.all(values < 0.0)) == (trial == sign)
            assert np.sign(steady_rotation(np.diag(moments), unit).curvature) == sign


def test_linearisation_and_eigenvalues_l2():
    pi = ca.SX.sym("pi", 3)
    for inertia, magnitude in random_tops(30, 3):
        jacobian = ca.jacobian(euler_field(inertia, pi), pi)
        for steady in steady_rotations(inertia, magnitude):
            exact = at(jacobian, pi, steady.momentum)
            scale = magnitude / np.linalg.eigvalsh(inertia)[0]
            # Of the tangent vectors: off the sphere the two differ by a change of |Pi|.
            assert np.abs((exact - steady.linearisation) @ steady.tangent).max() < 1e-13 * scale
            assert np.abs(exact @ steady.momentum - steady.linearisation @ steady.momentum).max() < 1e-12 * scale**2
            numeric = np.linalg.eigvals(steady.tangent.T @ exact @ steady.tangent)
            key = np.lexsort((numeric.imag, numeric.real))
            ours = steady.eigenvalues[np.lexsort((steady.eigenvalues.imag, steady.eigenvalues.real))]
            assert np.abs(np.sort_complex(ours) - np.sort_complex(numeric[key])).max() < 1e-6 * scale
            # To rounding by their squares, which have no root to blur them.
            assert np.abs(ours**2 - np.mean(numeric**2)).max() < 1e-12 * scale**2


def test_the_printed_eigenvalues_about_axis_one_l2():
    rng = np.random.default_rng(4)
    for _ in range(50):
        i1, i2, i3 = np.exp(rng.uniform(-1.0, 1.0, 3))
        printed = 2.5 * np.sqrt(complex((i1 - i2) * (i3 - i1))) / (i1 * np.sqrt(i2 * i3))
        ours = steady_rotation(np.diag([i1, i2, i3]), [-2.5, 0.0, 0.0]).eigenvalues
        assert ours == pytest.approx([printed, -printed], rel=1e-13)


@pytest.mark.parametrize("count", full_but([40, 1000], 40))
def test_stability_theorem_energy_casimir_spectrum_and_simulation_agree_over_many_bodies_l3(count):
    rng = np.random.default_rng(5)
    gaps = np.exp(rng.uniform(np.log(0.05), 0.0, (count, 2)))
    moments = np.cumprod(np.column_stack([np.exp(rng.uniform(-1.0, 1.0, count)), np.exp(gaps)]), axis=-1)
    axes = Rotation.random(count, rng=rng).as_matrix()
    tensors = axes @ (moments[..., None] * np.eye(3)) @ np.swapaxes(axes, -1, -2)
    tensors = 0.5 * (tensors + np.swapaxes(tensors, -1, -2))
    steady = [steady_rotations(tensor) for tensor in tensors]
    inverse = np.linalg.inv(tensors)[:, None]
    starts = np.array([[s.momentum for s in three] for three in steady])
    growth = np.abs(np.array([[s.eigenvalues[0] for s in three] for three in steady]))
    tilt = 1e-3
    offset = rng.normal(size=starts.shape)
    offset -= np.sum(offset * starts, axis=-1, keepdims=True) * starts
    pi = so3.normalised(starts + tilt * so3.normalised(offset))
    first = np.linalg.norm(pi - starts, axis=-1)
    farthest = first.copy()
    # Sixteen characteristic times of each, in steps fine enough for the fastest of the three motions.
    step = 0.06 / growth.max(axis=1) * np.ones((3, 1))
    step = step.T[..., None]

    def rates(x):
        return np.cross(x, (inverse @ x[..., None])[..., 0])

    limit = int(np.ceil(16.0 / (0.06 * (growth / growth.max(axis=1, keepdims=True)).min())))
    for _ in range(limit):
        k1 = rates(pi)
        k2 = rates(pi + 0.5 * step * k1)
        k3 = rates(pi + 0.5 * step * k2)
        pi = pi + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rates(pi + step * k3))
        farthest = np.maximum(farthest, np.linalg.norm(pi - starts, axis=-1))
    left = farthest > 0.3
    assert np.abs(np.linalg.norm(pi, axis=-1) - 1.0).max() < 1e-3
    for row in range(count):
        for column, s in enumerate(steady[row]):
            unstable = s.verdict == "unstable"
            assert unstable == (s.definiteness == "indefinite")
            assert unstable == (s.eigenvalues.real.max() > 0.0)
            assert unstable == (column == INTERMEDIATE) == left[row, column]
            if not unstable:
                # Liapunov's bound by the level set of the second variation.
                gaps = np.abs(np.diag(s.sphere_hessian))
                assert farthest[row, column] < 1.05 * first[row, column] * np.sqrt(gaps.max() / gaps.min())


def test_second_variation_on_the_momentum_sphere_l5():
    u = ca.SX.sym("u", 2)
    for inertia, magnitude in random_tops(20, 6):
        for index, steady in enumerate(reversed(steady_rotations(inertia, magnitude))):
            height = ca.sqrt(magnitude**2 - ca.sumsqr(u))
            point = height * (steady.momentum / magnitude) + ca.mtimes(ca.DM(steady.tangent), u)
            hessian, gradient = ca.hessian(energy(inertia, point), u)
            exact = at(hessian, u, [0.0, 0.0])
            scale = 1.0 / np.linalg.eigvalsh(inertia)[0]
            assert np.abs(at(gradient, u, [0.0, 0.0])).max() < 1e-12 * magnitude * scale
            assert np.abs(exact - steady.sphere_hessian).max() < 1e-13 * scale
            assert np.abs(steady.tangent.T @ steady.second_variation @ steady.tangent - exact).max() < 1e-13 * scale
            assert steady.index == index == np.count_nonzero(np.linalg.eigvalsh(exact) < 0.0)
            frame = np.column_stack([steady.tangent, steady.momentum / magnitude])
            assert np.abs(frame - so3.orthonormalised(frame)).max() < 1e-13
            assert np.linalg.det(frame) == pytest.approx(1.0)
            # The spectrum is that of the Hessian by the sphere's symplectic form.
            assert steady.eigenvalues[0] ** 2 == pytest.approx(-(magnitude**2) * np.linalg.det(exact), rel=1e-9)


def test_indices_of_the_six_equilibria_sum_to_the_euler_characteristic_l5():
    for inertia, magnitude in random_tops(10, 7):
        momenta = [sign * s.momentum for s in steady_rotations(inertia, magnitude) for sign in (1.0, -1.0)]
        assert sum((-1) ** steady_rotation(inertia, momentum).index for momentum in momenta) == 2


def test_the_phase_of_small_loops_is_the_steady_rate_over_the_eigenvalue_l6():
    rng = np.random.default_rng(8)
    for _ in range(10):
        moments = np.array([1.0, 1.6, 2.6]) * np.exp(rng.uniform(-0.15, 0.15, 3))
        for axis, steady in ((0, steady_rotations(np.diag(moments))[0]), (2, steady_rotations(np.diag(moments))[2])):
            momentum = np.array([1e-5, 1e-5, 1e-5])
            momentum[axis] = 1.0
            limit = 2.0 * np.pi / (moments[axis] * np.abs(steady.eigenvalues[0]))
            phase = EulerTop.principal(moments, momentum).montgomery_phase
            assert abs(so3.wrap(phase - limit)) < 1e-7


def test_stable_axes_go_by_moment_and_the_largest_belongs_to_the_shortest_edge_m_e12():
    edges = np.array([3.0, 2.0, 0.5])
    inertia = np.diag((np.sum(edges**2) - edges**2) / 12.0)
    smallest, intermediate, largest = steady_rotations(inertia)
    assert np.abs(largest.momentum).argmax() == edges.argmin()
    assert np.abs(smallest.momentum).argmax() == edges.argmax()
    ellipsoid = 1.0 / np.sqrt(np.diag(inertia))
    assert np.abs(largest.momentum).argmax() == ellipsoid.argmin()
    # Printed: positive definite is "the longest axis". Read of edges or of the ellipsoid, that is false.
    longest = np.eye(3)[ellipsoid.argmax()]
    assert steady_rotation(inertia, longest).definiteness == "negative definite"
    assert [s.verdict for s in (smallest, intermediate, largest)] == ["stable", "unstable", "stable"]


@pytest.mark.parametrize("symmetry", [0, 2])
def test_equal_moments_are_stable_modulo_the_circle_of_equilibria_m_e13(symmetry):
    # Printed: the two extreme axes are stable. With a tie a neighbour of one of them drifts away for good.
    moments = np.array([2.0, 2.0, 2.0])
    moments[symmetry] = 3.0 if symmetry == 2 else 1.0
    equal = 0 if symmetry == 2 else 2
    steady = steady_rotation(np.diag(moments), np.eye(3)[equal])
    assert steady.verdict == "stable modulo the circle of equilibria"
    assert steady.definiteness == "semidefinite"
    assert np.all(steady.eigenvalues == 0.0)
    assert np.abs(steady.linearisation).max() > 0.1
    assert np.abs(steady.linearisation @ steady.linearisation).max() == 0.0
    start = np.eye(3)[equal] + 1e-3 * np.eye(3)[symmetry]
    run = solve_ivp(raw_rates(moments), (0.0, 2.5e4), start, method="DOP853", rtol=1e-10, atol=1e-12)
    assert np.linalg.norm(run.y.T - np.eye(3)[equal], axis=-1).max() > 1.9
    assert np.abs(run.y[symmetry]).max() < 1.01e-3
    assert steady_rotation(np.diag(moments), np.eye(3)[symmetry]).verdict == "stable"
    slanted = np.array([1.0, 1.0, 1.0])
    slanted[symmetry] = 0.0
    assert steady_rotation(np.diag(moments), slanted).verdict == "stable modulo the circle of equilibria"


def test_ties_of_turned_tensors_and_of_spheres_m_e13():
    rng = np.random.default_rng(9)
    for moments in ([1.0, 1.0, 2.0], [1.0, 2.0, 2.0]):
        verdicts = {s.verdict for s in steady_rotations(turned(moments, rng))}
        assert verdicts == {"stable", "stable modulo the circle of equilibria"}
    for sphere in (2.0 * np.eye(3), turned([2.0, 2.0, 2.0], rng)):
        assert {s.verdict for s in steady_rotations(sphere)} == {"stable"}
    # Given as they are, moments a last digit apart are different.
    near = np.diag([1.0, 1.0 + 4e-16, 2.0])
    assert [s.verdict for s in steady_rotations(near)] == ["stable", "unstable", "stable"]


def test_steady_rotations_refuse_what_is_none():
    inertia = np.diag([1.0, 2.0, 3.0])
    with pytest.raises(ShapeError, match="principal"):
        steady_rotation(inertia, [1.0, 1e-6, 0.0])
    with pytest.raises(ShapeError, match="rest"):
        steady_rotation(inertia, [0.0, 0.0, 0.0])
    for size in (1e-150, 1e150):
        with pytest.raises(ShapeError, match="range"):
            steady_rotations(inertia, size)
    with pytest.raises(ShapeError, match="vector"):
        steady_rotation(inertia, np.eye(3))
    with pytest.raises(ShapeError, match="shape"):
        steady_rotation([inertia, inertia], [1.0, 0.0, 0.0])
    with pytest.raises(UnphysicalInertiaError, match="symmetric"):
        steady_rotation([[1.0, 0.1, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]], [0.0, 0.0, 1.0])
    with pytest.raises(SingularInertiaError):
        steady_rotation(np.diag([1.0, -2.0, 3.0]), [1.0, 0.0, 0.0])
    for magnitude in (0.0, -1.0, [1.0, 2.0]):
        with pytest.raises(ShapeError, match="magnitude"):
            steady_rotations(inertia, magnitude)


# ---- In space -------------------------------------------------------------------------------------------------------


def between(momenta, axis):
    """Angles, by the cross product where they are small."""
    return np.arctan2(np.linalg.norm(np.cross(momenta, axis), axis=-1), momenta @ np.asarray(axis))


def test_in_space_the_axis_stays_in_a_cone_about_the_momentum_l7():
    """The widest angle, and the mean rate of the turn, along integrated motions in axes that are not principal."""
    rng = np.random.default_rng(21)
    for index in (0, 2):
        for size in (0.02, 0.2):
            tensor = turned([1.0, 2.0, 3.0], rng)
            steady = steady_rotations(tensor, 1.3)[index].momentum
            disturbed = steady + size * rng.normal(size=3)
            found = spin_in_space(tensor, steady, disturbed)
            top = EulerTop(tensor, disturbed)
            inverse = np.linalg.inv(tensor)
            times = np.linspace(0.0, top.period, 1001)
            run = solve_ivp(
                lambda _, y, inverse=inverse: np.cross(y, inverse @ y),
                (0.0, top.period),
                disturbed,
                rtol=1e-11,
                atol=1e-13,
                t_eval=times,
            )
            angles = between(run.y.T, steady)
            assert found.verdict == "stable up to the turn about the momentum"
            assert angles.max() <= found.tilt + 1e-9
            assert angles.max() > found.tilt - 1e-3 * found.tilt
            # In space: the axis R n and the constant R Pi, and how far an axis across has gone round.
            attitudes = top.attitude(np.linspace(0.0, 40.0 * top.period, 8001))
            across = attitudes @ so3.perpendicular(steady / np.linalg.norm(steady))
            first, second = np.linalg.svd(top.momentum[None])[2][1:]
            second = np.cross(top.momentum / np.linalg.norm(top.momentum), first)
            angle = np.unwrap(np.arctan2(across @ second, across @ first))
            steady_rate = np.linalg.norm(steady) / steady_rotation(tensor, steady).moment
            rate = (angle[-1] - angle[0]) / (40.0 * top.period)
            assert rate - steady_rate == pytest.approx(found.drift, abs=1e-11 * steady_rate)


def test_small_disturbances_tilt_little_where_the_spin_is_stable_l7():
    tensor = np.diag([1.0, 2.0, 3.0])
    for axis, stable in ((0, True), (1, False), (2, True)):
        steady = np.eye(3)[axis]
        tilts = [spin_in_space(tensor, steady, steady + s * np.array([1.0, 2.0, -1.0])).tilt for s in (1e-3, 1e-6)]
        assert (tilts[0] < 5e-3 and tilts[1] < 5e-6) if stable else min(tilts) > 3.0
    # Two equal moments: the momentum wanders along the circle of equilibria, however little it left it.
    wandering = spin_in_space(np.diag([1.0, 1.0, 2.0]), [1.0, 0.0, 0.0], [1.0, 0.0, 1e-6])
    assert wandering.verdict == "unstable"
    assert wandering.tilt > 3.0
    ball = spin_in_space(np.eye(3), [1.0, 0.0, 0.0], [1.0, 0.1, 0.0])
    assert ball.tilt == pytest.approx(np.arctan(0.1), abs=1e-15)
    assert ball.verdict.startswith("stable")
    behind = spin_in_space(tensor, [0.0, 0.0, -1.0], [0.1, 0.1, 1.0])
    polhode = EulerTop(tensor, [0.1, 0.1, 1.0])
    angles = between(polhode.body_momentum(np.linspace(0.0, polhode.period, 4001)), [0.0, 0.0, -1.0])
    assert behind.tilt == pytest.approx(angles.max(), abs=1e-6)
    # On the separatrix, exactly: 1 - 1/2 = 3^2 (1/2 - 1/2.25).
    moments, start = [1.0, 2.0, 2.25], np.array([1.0, 0.0, 3.0])
    track = EulerTop.principal(moments, start).body_momentum(np.linspace(-40.0, 40.0, 2001))
    assert EulerTop.principal(moments, start).regime == "separatrix"
    for axis in np.eye(3):
        found = spin_in_space(np.diag(moments), axis, start)
        assert found.tilt == pytest.approx(between(track, axis).max(), abs=1e-6)
    with pytest.raises(ShapeError, match="disturbed"):
        spin_in_space(tensor, [0.0, 0.0, 1.0], np.zeros(3))
