"""The upright spin of a Lagrange top, against symbols, eigenvalues, 40 digits and simulation."""

from __future__ import annotations

import casadi as ca
import mpmath
import numpy as np
import pytest

from shapephase import so3
from shapephase.errors import ShapeError
from shapephase.rigid_body import (
    HeavyTop,
    LagrangeTop,
    characteristic_polynomial,
    e_quadratic,
    second_variation,
    sleeping_matrix,
    sleeping_spectrum,
    sleeping_top,
    spectrally_stable,
    stability_chart,
    upright_potential,
)
from support.long_runs import full_but

UP = np.array([0.0, 0.0, 1.0])


def random_lagrange(rng):
    return LagrangeTop(*rng.uniform(0.4, 2.5, 2), rng.uniform(0.5, 5.0))


def symbols():
    return ca.SX.sym("pi", 3), ca.SX.sym("gamma", 3)


def at(expression, symbol, value):
    return np.array(ca.Function("f", [symbol], [expression])(value))


def symbolic_energy(top, pi, gamma):
    return 0.5 * ca.dot(pi, ca.mtimes(ca.inv(ca.DM(top.inertia)), pi)) + float(top.mgl) * ca.dot(gamma, ca.DM(top.chi))


def lifted(top, p, phi_dot, a, b, c, d):
    """H + Phi(Pi.Gamma, |Gamma|^2) + phi(Pi_3) with the derivatives that the book's letters stand for."""
    pi, up = symbols()
    x, y, z = ca.dot(pi, up) - p, ca.sumsqr(up) - 1.0, pi[2] - p
    phi_prime, axial_slope = -0.5 * (top.mgl + phi_dot * p), -(p / top.axial + phi_dot)
    phi = phi_dot * x + phi_prime * y + 0.5 * c * x * x + 0.5 * d * x * y + 0.125 * b * y * y
    whole = symbolic_energy(top.heavy_top, pi, up) + phi + axial_slope * z + 0.5 * a * z * z
    point = ca.vertcat(pi, up)
    hessian, gradient = ca.hessian(whole, point)
    value = [0.0, 0.0, p, 0.0, 0.0, 1.0]
    return at(hessian, point, value), at(gradient, point, value).ravel()


def test_first_variation_vanishes_m4():
    rng = np.random.default_rng(8)
    for _ in range(20):
        top, p = random_lagrange(rng), rng.normal() * 3.0
        sleep = sleeping_top(top, p)
        _, gradient = lifted(top, p, sleep.phi_dot, *rng.normal(size=4))
        assert np.abs(gradient).max() < 1e-13
        assert np.abs(sleep.first_variation).max() < 1e-14
        assert sleep.axial_slope == pytest.approx(-(p / top.axial + sleep.phi_dot), rel=1e-14)
        assert sleep.phi_prime == pytest.approx(-0.5 * (top.mgl + sleep.phi_dot * p), rel=1e-14)
        # Printed with phi' free: Phi_dot = -(1/I3 + phi'/p) p, Phi' = (1/I3 + phi'/p) p^2/2 - Mgl/2.
        e = 1.0 / top.axial + sleep.axial_slope / p
        assert (-e * p, 0.5 * e * p * p - 0.5 * top.mgl) == pytest.approx((sleep.phi_dot, sleep.phi_prime), rel=1e-12)


def test_second_variation_and_its_minors_m5():
    rng = np.random.default_rng(9)
    for _ in range(20):
        top, p, phi_dot = random_lagrange(rng), rng.normal() * 3.0, rng.normal()
        a, b, c, d = rng.normal(size=4)
        exact, _ = lifted(top, p, phi_dot, a, b, c, d)
        assert np.abs(second_variation(top, p, phi_dot, a=a, b=b, c=c, d=d) - exact).max() < 1e-12
        sleep = sleeping_top(top, p)
        matrix, i1 = sleep.second_variation, top.transverse
        inner = 2.0 * sleep.phi_prime / i1 - sleep.phi_dot**2
        axial = 1.0 / top.axial
        corner = axial * matrix[5, 5] - sleep.phi_dot**2
        printed = [1 / i1, i1**-2, axial / i1**2, axial / i1 * inner, axial * inner**2, corner * inner**2]
        assert sleep.minors == pytest.approx(printed, rel=1e-9)
        definite = np.linalg.eigvalsh(matrix).min() > 0.0
        assert definite == np.all(sleep.minors > 0.0) == sleep.energy_casimir


def test_printed_entries_fail_and_the_corrected_ones_hold_m_e9():
    rng = np.random.default_rng(10)
    for _ in range(10):
        top, p, phi_dot = random_lagrange(rng), 2.0 + rng.uniform(), rng.normal()
        a, b, c, d = rng.uniform(0.5, 2.0, size=4)
        exact, _ = lifted(top, p, phi_dot, a, b, c, d)
        vertical = -(top.mgl + phi_dot * p)
        assert abs(exact[2, 5] - (phi_dot + c + d)) > 0.4
        assert exact[2, 5] == pytest.approx(phi_dot + p * c + d, rel=1e-12)
        assert abs(exact[5, 5] - (vertical + b + p * p * c + p * d)) > 0.9
        assert exact[5, 5] == pytest.approx(vertical + b + p * p * c + 2.0 * p * d, rel=1e-12)


def test_e_quadratic_and_the_threshold_m6():
    rng = np.random.default_rng(11)
    for _ in range(10):
        top = random_lagrange(rng)
        threshold = 2.0 * np.sqrt(top.mgl * top.transverse)
        assert top.critical_momentum == pytest.approx(threshold, rel=1e-15)
        for p in threshold * np.array([-2.0, -1.0001, -0.9999, 0.3, 0.9999, 1.0001, 3.0]):
            coefficients = e_quadratic(top, p)
            e = np.linspace(-3.0, 3.0, 4001) / top.transverse
            # The block that decides: (2 Phi' - I1 Phi_dot^2)/I1 with Phi_dot = -e p.
            values = [np.linalg.det(second_variation(top, p, -x * p)[np.ix_([0, 3], [0, 3])]) for x in e[::400]]
            assert np.polyval(coefficients, e[::400]) == pytest.approx(values, rel=1e-9, abs=1e-9)
            discriminant = coefficients[1] ** 2 - 4.0 * coefficients[0] * coefficients[2]
            fast = abs(p) > threshold
            sleep = sleeping_top(top, p)
            assert (discriminant > 0.0) == fast == sleep.energy_casimir
            # The number e = 1/(2 I1) that `sleeping_top` takes is the best.
            best = np.polyval(coefficients, 0.5 / top.transverse)
            assert best >= np.polyval(coefficients, e).max() - 1e-12
            assert (best > 0.0) == fast
            assert sleep.verdict == ("stable" if fast else "unstable")
            assert np.all(sleep.minors > 0.0) == fast
            assert sleep.phi_dot == pytest.approx(-0.5 * p / top.transverse, rel=1e-14)
            assert np.array_equal(sleep.quadratic, coefficients)
    assert sleeping_top(LagrangeTop(1.0, 3.0, 4.0), 4.0).verdict == "stable"
    # However thin the top is across: Phi'' is large enough.
    assert np.all(sleeping_top(LagrangeTop(0.1, 9.0, 1.0), 5.0).minors > 0.0)
    assert sleeping_top(LagrangeTop(1.0, 3.0, -4.0), 0.0).verdict == "stable"
    assert sleeping_top(LagrangeTop(1.0, 3.0, 4.0), 0.0).verdict == "unstable"
    assert LagrangeTop(1.0, 3.0, -4.0).critical_momentum == 0.0


def test_at_the_threshold_the_upright_spin_is_stable_m6():
    """The potential has a minimum of fourth order there; motions of a top tilted a little stay as near as it says."""
    rng = np.random.default_rng(17)
    for _ in range(20):
        top = random_lagrange(rng)
        assert sleeping_top(top, top.critical_momentum).verdict == "stable"
        assert not sleeping_top(top, top.critical_momentum).energy_casimir
        p, tilt = float(rng.normal() * 4.0), np.linspace(0.05, 3.0, 7)
        # The energy of a top that is let go at this tilt without tilting, with Pi_3 = Pi.Gamma = p.
        gamma = np.stack([np.sin(tilt), 0.0 * tilt, np.cos(tilt)], axis=-1)
        momentum = np.stack([p * (1.0 - np.cos(tilt)) / np.sin(tilt), 0.0 * tilt, np.full(7, p)], axis=-1)
        energy = top.heavy_top.energy(momentum, gamma) - top.heavy_top.energy(p * UP, UP)
        assert upright_potential(top, p, tilt) == pytest.approx(energy, rel=1e-9, abs=1e-12)
        u = np.tan(0.005) ** 2
        assert upright_potential(top, top.critical_momentum, 0.01) == pytest.approx(2.0 * top.mgl * u * u, rel=1e-4)
    top = LagrangeTop(1.0, 0.5, 2.0)
    # As much energy as at 0.2 rad: the tilt stays below, though it began at a hundredth of that.
    rate = np.sqrt(2.0 * upright_potential(top, top.critical_momentum, 0.2))
    start = [0.0, rate, top.critical_momentum]
    motion = top.heavy_top.motion(start, duration=13.0, tolerance=1e-6)
    largest = np.arccos(motion.gamma(np.linspace(0.0, 13.0, 1001))[:, 2]).max()
    assert 0.199 < largest <= 0.2 + 1e-6
    assert sleeping_top(LagrangeTop(1.0, 3.0, 0.0), 0.0).verdict == "marginal"
    with pytest.raises(ShapeError, match="tilt"):
        upright_potential(top, 1.0, np.pi)


def test_linear_matrix_polynomial_discriminant_and_spectrum_m7():
    rng = np.random.default_rng(12)
    for _ in range(40):
        top, p = random_lagrange(rng), rng.normal() * 4.0
        moments = np.array([top.transverse, top.transverse, top.axial])
        matrix = sleeping_matrix(moments, top.mgl, p)
        whole = top.heavy_top.linearisation(p * UP, UP)
        keep = [0, 1, 3, 4]
        assert np.abs(matrix - whole[np.ix_(keep, keep)]).max() < 1e-13
        b, c, discriminant = characteristic_polynomial(moments, top.mgl, p)
        spin, i1, i3, mgl = p / top.axial, top.transverse, top.axial, top.mgl
        printed = (
            ((i1**2 + (i1 - i3) ** 2) * spin**2 - 2.0 * mgl * i1) / i1**2,
            ((i1 - i3) * spin**2 + mgl) ** 2 / i1**2,
        )
        assert (b, c) == pytest.approx(printed, rel=1e-9, abs=1e-11)
        assert discriminant == pytest.approx(b * b - 4.0 * c, rel=1e-8, abs=1e-8)
        spectrum = np.sort_complex(np.round(sleeping_spectrum(moments, mgl, p), 6))
        assert spectrum == pytest.approx(np.sort_complex(np.round(np.linalg.eigvals(matrix), 6)), abs=3e-6)
        # In inertial axes I1 z'' - i p z' - Mgl z = 0; the body turns at p/I3.
        root = np.sqrt(complex(p * p - 4.0 * mgl * i1))
        frequencies = [(p + sign * root) / (2.0 * i1) - spin for sign in (1.0, -1.0)]
        closed = np.array([1j * f for f in frequencies] + [-1j * f for f in frequencies])
        ours = sleeping_spectrum(moments, mgl, p)
        assert np.abs(closed[:, None] - ours).min(axis=1).max() < 1e-7
        assert np.poly(ours).real == pytest.approx([1.0, 0.0, b, 0.0, c], rel=1e-9, abs=1e-9)
        assert spectrally_stable(moments, mgl, p) == (abs(p) >= top.critical_momentum)


def test_spectrum_to_the_last_digits_next_to_the_threshold_and_next_to_zero_m7():
    # A nearly flat disc, a last digit beside the threshold: the discriminant has its sign.
    for ratio in (1.9, 1.99, 1.9999, 2.0001):
        moments, threshold = np.array([1.3, 1.3, 1.3 * ratio]), 2.0 * np.sqrt(2.0 * 1.3)
        assert not spectrally_stable(moments, 2.0, threshold * (1.0 - 1e-13))
        assert spectrally_stable(moments, 2.0, threshold * (1.0 + 1e-13))
    for axial in (0.3, 0.7, 1.1, 3.1):
        assert characteristic_polynomial([1.0, 1.0, axial], 4.0, 4.0)[2] == 0.0
        assert spectrally_stable([1.0, 1.0, axial], 4.0, 4.0)
    cases = (([1.0, 1.1, 2.0], 1.0000001, 2.0), ([1.0, 1.1, 2.0], 3.6000001, 4.0), ([1.0, 1.13, 2.1], 1.02788889, 2.03))
    for moments, mgl, p in cases:
        b, c, _ = characteristic_polynomial(moments, mgl, p)
        with mpmath.workdps(40):
            half, product = mpmath.mpf(float(b)) / 2, mpmath.mpf(float(c))
            root = mpmath.sqrt(half**2 - product)
            squares = np.array([complex(-half - root), complex(-half + root)])
        ours = sleeping_spectrum(moments, mgl, p)[[0, 2]] ** 2
        assert np.sort_complex(ours) == pytest.approx(np.sort_complex(squares), rel=1e-13, abs=0.0)


def test_the_discriminant_vanishes_for_a_flat_disc_and_the_spectrum_still_decides_m_e10():
    moments, mgl = np.array([1.5, 1.5, 3.0]), 2.0
    threshold = 2.0 * np.sqrt(3.0)
    for p in threshold * np.array([0.3, 0.9, 1.1, 4.0]):
        b, c, discriminant = characteristic_polynomial(moments, mgl, p)
        # Printed: negative, with four different roots, if and only if the top is slow.
        assert discriminant == 0.0
        assert b * b - 4.0 * c == pytest.approx(0.0, abs=1e-12)
        spectrum = sleeping_spectrum(moments, mgl, p)
        assert np.unique(np.round(spectrum, 6)).size == 2
        slow = p < threshold
        assert np.abs(spectrum.imag if slow else spectrum.real).max() == 0.0
        assert spectrally_stable(moments, mgl, p) == (not slow)
        assert sleeping_top(LagrangeTop(1.5, 3.0, mgl), p).verdict == ("unstable" if slow else "stable")
        # The closed form of the double roots, by NumPy's eigenvalues of the linearised equations.
        matrix = sleeping_matrix(moments, mgl, p)
        square = (4.0 * mgl * 1.5 - p * p) / (4.0 * 1.5**2)
        assert np.abs(matrix @ matrix - square * np.eye(4)).max() < 1e-12
    growth = np.linalg.eigvals(sleeping_matrix([1.0, 1.0, 2.0], 0.9, 0.95 * 2.0 * np.sqrt(0.9))).real
    assert np.sort(growth) == pytest.approx([-0.296, -0.296, 0.296, 0.296], abs=5e-4)
    # Disc of mass M and moments (m, m, 2 m) about its own centre, at the distance l: I3 = 2 (I1 - M l^2) < 2 I1.
    points = np.array([[np.cos(u), np.sin(u), 0.7] for u in np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)])
    inertia = np.einsum("ij,ij->", points, points) * np.eye(3) - points.T @ points
    assert inertia[2, 2] == pytest.approx(2.0 * (inertia[0, 0] - 12.0 * 0.7**2), rel=1e-14)


def test_the_printed_conditions_do_not_make_the_second_variation_definite_m_e14():
    """(15.10.8) to (15.10.10) ask of the corner only that it is positive; definite needs its Schur complement to be."""
    i1, i3, mgl, p, phi_dot, b = 1.0, 0.5, 0.1, 3.0, -1.5, -3.9
    vertical = -(mgl + phi_dot * p)
    assert 1.0 / i3 > 0.0
    assert vertical / i1 - phi_dot**2 > 0.0
    assert vertical + b > 0.0
    matrix = np.diag([1.0 / i1, 1.0 / i1, 1.0 / i3, vertical, vertical, vertical + b])
    for k in range(3):
        matrix[k, k + 3] = matrix[k + 3, k] = phi_dot
    assert np.linalg.eigvalsh(matrix)[0] == pytest.approx(-0.427, abs=5e-4)
    exact, _ = lifted(LagrangeTop(i1, i3, mgl), p, phi_dot, 0.0, b, 0.0, 0.0)
    assert np.abs(exact - matrix).max() < 1e-12
    rng = np.random.default_rng(19)
    for _ in range(40):
        top, p, phi_dot = random_lagrange(rng), rng.normal() * 3.0, rng.normal()
        a, b, c, d = rng.normal(size=4) * 4.0
        exact, _ = lifted(top, p, phi_dot, a, b, c, d)
        corner, coupling, axial = exact[5, 5], exact[2, 5], 1.0 / top.axial + a + c
        inner = exact[3, 3] / top.transverse - phi_dot**2
        right = axial > 0.0 and inner > 0.0 and axial * corner > coupling**2
        assert right == (np.linalg.eigvalsh(exact)[0] > 0.0)


def test_a_top_at_rest_and_one_that_spins_backwards_m_e16():
    """The theorem means |Pi3|. At rest the discriminant is zero, the two squares of the roots are Mgl/I1."""
    mgl = 2.0
    for axial in (0.6, 1.7):
        moments = [1.3, 1.3, axial]
        squares = np.linalg.eigvals(sleeping_matrix(moments, mgl, 0.0)) ** 2
        assert squares == pytest.approx(np.full(4, mgl / 1.3), rel=1e-7)
        assert characteristic_polynomial(moments, mgl, 0.0)[2] == 0.0
        assert not spectrally_stable(moments, mgl, 0.0)
        top = LagrangeTop(1.3, axial, mgl)
        assert sleeping_top(top, 0.0).verdict == "unstable"
        assert [sleeping_top(top, p).verdict for p in (-10.0, -1.0)] == ["stable", "unstable"]


def test_energy_casimir_spectrum_and_simulation_agree_m8():
    chart = stability_chart([0.5, 2.0], [0.3, 1.0, 1.7, 1.9, 1.97, 2.03, 2.1, 2.5, 3.5], duration=45.0)
    assert np.array_equal(chart.simulation, chart.spectrum)
    assert np.array_equal(chart.energy_casimir, chart.spectrum)
    assert chart.simulation.tolist() == [[False] * 5 + [True] * 4] * 2
    # Of the tilt itself: an upright spin of a slow top falls to cos(theta) = p^2/2 - 1.
    slow = np.arccos(0.5 * chart.momenta[:4] ** 2 - 1.0)
    assert np.abs(chart.largest_tilt[:, :4] - slow).max() < 1e-2


@pytest.mark.parametrize("ratio", full_but([0.5, 1.0, 2.0], 0.5))
def test_simulation_finds_the_threshold_within_a_percent_m8(ratio):
    below, above = np.array([1.0, 1.5, 1.9, 1.98]), np.array([2.02, 2.1, 2.5, 3.0])
    stable = stability_chart([ratio], np.concatenate([below, above]), duration=60.0).simulation
    assert stable.tolist() == [[False] * len(below) + [True] * len(above)]


@pytest.mark.full
def test_a_fine_chart_m8():
    momenta = np.concatenate([np.linspace(0.1, 1.98, 30), np.linspace(2.02, 5.0, 30)])
    chart = stability_chart(np.linspace(0.2, 2.0, 10), momenta, duration=120.0)
    assert np.array_equal(chart.simulation, chart.spectrum)
    assert np.array_equal(chart.energy_casimir, chart.spectrum)


@pytest.mark.parametrize(("eps", "duration"), full_but([(1e-3, 20.0), (0.05, 20.0), (0.05, 150.0)], (0.05, 20.0)))
def test_a_nearly_symmetric_fast_top_is_linearly_stable_and_stays_near_for_long_m9(eps, duration):
    moments = np.array([1.0, 1.0 + eps, 0.6])
    top = HeavyTop(np.diag(moments), 1.0)
    for p, stable in ((1.7, False), (2.5, True), (4.0, True)):
        whole = np.linalg.eigvals(top.linearisation(p * UP, UP))
        ours = sleeping_spectrum(moments, 1.0, p)
        assert np.abs(ours[:, None] - whole).min(axis=1).max() < 1e-9
        assert spectrally_stable(moments, 1.0, p) == stable == (whole.real.max() < 1e-9)
        if stable:
            gamma = so3.normalised(np.array([0.01, 0.005, 1.0]))
            motion = top.motion(p * UP, gamma, duration=duration, tolerance=1e-4)
            times = np.linspace(0.0, duration, 4000)
            assert np.arccos(motion.gamma(times)[:, 2]).max() < 0.04
            momentum = motion.body_momentum(times)[:, 2]
            # The axial momentum is no longer conserved.
            assert 1e-9 < np.abs(momentum - p).max() < 1e-2


def test_linear_matrix_and_polynomial_of_asymmetric_tops_m9():
    rng = np.random.default_rng(15)
    for _ in range(30):
        moments, mgl, p = rng.uniform(0.4, 2.5, 3), rng.normal() * 3.0, rng.normal() * 4.0
        whole = HeavyTop(np.diag(moments), mgl).linearisation(p * UP, UP)
        keep = [0, 1, 3, 4]
        matrix = sleeping_matrix(moments, mgl, p)
        assert np.abs(matrix - whole[np.ix_(keep, keep)]).max() < 1e-13
        b, c, discriminant = characteristic_polynomial(moments, mgl, p)
        scale = np.abs(matrix).max() ** 2
        assert np.poly(matrix) == pytest.approx([1.0, 0.0, b, 0.0, c], abs=1e-11 * scale**2 + 1e-12)
        assert discriminant == pytest.approx(b * b - 4.0 * c, abs=1e-12 * scale**2 + 1e-12)
        values = np.linalg.eigvals(matrix)
        if abs(discriminant) > 1e-3 and abs(c) > 1e-3:
            assert np.abs(sleeping_spectrum(moments, mgl, p)[:, None] - values).min(axis=1).max() < 1e-9
            assert spectrally_stable(moments, mgl, p) == (values.real.max() < 1e-7)


def test_the_asymmetric_threshold_is_where_simulation_finds_it_m9():
    moments = np.array([1.0, 1.4, 0.6])
    spins = np.linspace(0.5, 5.0, 4001)
    stable = spectrally_stable(moments, 1.0, spins)
    change = np.flatnonzero(stable[1:] & ~stable[:-1])
    assert change.size == 1
    threshold = spins[change[0]]
    assert threshold > 2.05
    top = HeavyTop(np.diag(moments), 1.0)
    motion = top.motion(
        np.array([[0.95], [1.05]]) * threshold * UP, so3.normalised([1e-4, 1e-4, 1.0]), duration=45.0, tolerance=1e-3
    )
    tilt = np.arccos(np.minimum(motion.gamma(np.linspace(0.0, 45.0, 1500))[..., 2], 1.0)).max(axis=-1)
    assert tilt[0] > 0.05
    assert tilt[1] < 2e-3
