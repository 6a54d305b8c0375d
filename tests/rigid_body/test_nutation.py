"""The nutation of a Lagrange top in closed form, against integration, quadrature and 50 digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from shapephase import so3
from shapephase.rigid_body import LagrangeTop, nutation, sleeping_spectrum

UP = np.array([0.0, 0.0, 1.0])


def random_lagrange(rng):
    return LagrangeTop(*rng.uniform(0.4, 2.5, 2), rng.uniform(0.5, 5.0))


def test_lagrange_top_keeps_its_axial_momentum_and_nutates_in_closed_form_m3():
    rng = np.random.default_rng(7)
    times = np.linspace(0.0, 9.0, 300)
    for _ in range(3):
        top = random_lagrange(rng)
        momentum, gamma = rng.normal(size=3) * [1.0, 1.0, 3.0], so3.normalised(rng.normal(size=3))
        motion = top.heavy_top.motion(momentum, gamma, duration=9.0, tolerance=1e-10)
        assert np.abs(motion.body_momentum(times)[:, 2] - momentum[2]).max() < 1e-10
        rise = nutation(top, momentum, gamma)
        assert np.abs(rise.height(times) - motion.gamma(times)[:, 2]).max() < 2e-10
        assert rise.height(0.0) == pytest.approx(gamma[2], abs=1e-14)
        assert rise.height(times + rise.period) == pytest.approx(rise.height(times), abs=1e-12)
        assert rise.third_root >= 1.0


def test_nutation_period_by_quadrature_and_released_from_a_cusp_m3():
    top = LagrangeTop(1.3, 0.7, 2.0)
    gamma = np.array([0.6, 0.0, 0.8])
    momentum = 4.0 * UP  # pi_z = 3.2, released with its axis at rest: the highest point, where u'^2 = 0.
    rise = nutation(top, momentum, gamma)
    assert rise.highest == pytest.approx(0.8, abs=1e-15)
    pi3, vertical, i1, mgl = 4.0, 3.2, 1.3, 2.0

    def square(u):
        return 2.0 * mgl * (0.8 - u) / i1 * (1.0 - u * u) - ((vertical - pi3 * u) / i1) ** 2

    assert square(rise.lowest) == pytest.approx(0.0, abs=1e-13)
    middle, half = 0.5 * (rise.highest + rise.lowest), 0.5 * (rise.highest - rise.lowest)
    period = 2.0 * quad(lambda s: half * np.cos(s) / np.sqrt(square(middle + half * np.sin(s))), -1.5707, 1.5707)[0]
    assert rise.period == pytest.approx(period, rel=1e-4)
    # Small fall from the vertical spin's neighbourhood: twice the inertial frequency difference.
    fast = nutation(top, 40.0 * UP, gamma)
    assert 2.0 * np.pi / fast.period == pytest.approx(40.0 / 1.3, rel=1e-2)


def test_precession_beside_the_nutation_by_quadrature_m3():
    """phi' = (p_phi - p_psi u)/(I_1 (1 - u^2)), with u from the integrated top, over more than a period both ways."""
    rng = np.random.default_rng(11)
    for _ in range(2):
        top = random_lagrange(rng)
        momentum, gamma = rng.normal(size=3) * [1.0, 1.0, 3.0], so3.normalised(rng.normal(size=3))
        motion = top.heavy_top.motion(momentum, gamma, duration=4.0, tolerance=1e-11)
        found, vertical = nutation(top, momentum, gamma), momentum @ gamma

        def rate(t, motion=motion, top=top, vertical=vertical, axial=momentum[2]):
            height = motion.gamma(t)[2]
            return (vertical - axial * height) / (top.transverse * (1.0 - height) * (1.0 + height))

        expected = quad(rate, 0.0, 4.0, epsabs=1e-11, epsrel=1e-11, limit=200)[0]
        assert found.precession(4.0) == pytest.approx(expected, abs=1e-8)
        gained = found.precession([-1.0, found.period - 1.0])
        assert gained[1] - gained[0] == pytest.approx(found.precession_per_period, abs=1e-12)


def test_precession_of_tops_that_do_not_nutate_m3():
    """Slow and fast steady precession: Mgl = rate (p_psi - I_1 rate u); a pendulum in a plane does not precess."""
    top, height = LagrangeTop(1.3, 0.7, 2.0), 0.8
    gamma = np.array([0.6, 0.0, height])
    for rate in (0.5, 3.0):
        axial = 2.0 / rate + 1.3 * rate * height
        steady = nutation(top, [1.3 * rate * 0.6, 0.0, axial], gamma)
        assert steady.precession(2.0) == pytest.approx(2.0 * rate, abs=1e-6)
    plane = nutation(top, [0.0, 0.3, 0.0], gamma)
    assert plane.precession_per_period == 0.0
    assert np.all(plane.precession([0.0, 1.0]) == 0.0)


def test_nutation_where_the_axis_stands_or_creeps_up_m3():
    top = LagrangeTop(1.3, 0.7, 2.0)
    for momentum, gamma in ((3.0, UP), (5.0, UP), (0.0, -UP)):
        still = nutation(top, momentum * UP, gamma)
        assert np.all(still.height(np.linspace(0.0, 9.0, 5)) == gamma[2])
    # The plane pendulum from one degree off the bottom.
    low = nutation(top, [0.0, 0.0, 0.0], [np.sin(np.pi / 180.0), 0.0, -np.cos(np.pi / 180.0)])
    assert low.period == pytest.approx(np.pi * np.sqrt(1.3 / 2.0), rel=1e-4)
    # A slow top on the level of the upright spin (Pi.Gamma = Pi_3, same energy) creeps up as sech^2.
    tilt = np.arccos(3.0**2 / (2.0 * 2.0 * 1.3) - 1.0)
    gamma = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    creep = nutation(top, [3.0 * np.tan(0.5 * tilt), 0.0, 3.0], gamma)
    growth = sleeping_spectrum([1.3, 1.3, 0.7], 2.0, 3.0).real.max()
    times = np.array([0.0, 1.0, 3.0])
    expected = 1.0 - (1.0 - np.cos(tilt)) / np.cosh(growth * times) ** 2
    assert creep.height(times) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("lean", [1e-3, 1e-6, 1e-9])
def test_period_next_to_the_upright_spin_of_a_slow_top_to_fifty_digits_m3(lean):
    # Twice close to a double root: the logarithm of a distance that is lost in 1 - cos(theta).
    gamma = np.array([lean, 0.0, np.sqrt(1.0 - lean * lean)])
    rise = nutation(LagrangeTop(1.3, 0.7, 2.0), 3.0 * UP, gamma)
    with mpmath.workdps(50):
        i1, mgl, p, s = mpmath.mpf(1.3), mpmath.mpf(2.0), mpmath.mpf(3.0), mpmath.mpf(lean)
        height = mpmath.sqrt(1 - s * s)
        # Released with the axis at rest: u'^2 = (u0 - u)(2 Mgl/I1 (1 - u^2) - (p/I1)^2 (u0 - u)), so u0 is one root.
        beta, spin = 2 * mgl / i1, (p / i1) ** 2
        root = mpmath.sqrt(spin**2 - 4 * beta * (spin * height - beta))
        low, third = (spin - root) / (2 * beta), (spin + root) / (2 * beta)
        parameter = (height - low) / (third - low)
        period = 2 * mpmath.ellipk(parameter) / mpmath.sqrt(beta * (third - low) / 4)
        assert rise.period == pytest.approx(float(period), rel=1e-12)
        assert rise.complement == pytest.approx(float(1 - parameter), rel=1e-11)


def test_steady_precession_is_steady_m3():
    # I1 cos(theta) w^2 - p w + Mgl = 0 for the rate w of the slow precession.
    theta, p, i1, mgl = 0.7, 5.0, 1.3, 2.0
    w = (p - np.sqrt(p * p - 4.0 * i1 * np.cos(theta) * mgl)) / (2.0 * i1 * np.cos(theta))
    gamma = np.array([np.sin(theta), 0.0, np.cos(theta)])
    steady = nutation(LagrangeTop(i1, 0.7, mgl), [i1 * w * np.sin(theta), 0.0, p], gamma)
    assert np.ptp(steady.height(np.linspace(0.0, 10.0, 50))) < 1e-14


STARTS = (
    ([1e-7, 2e-7, 3.0], [3e-7, -1e-7]),  # next to the upright spin, rising
    ([1e-9, -2e-4, 3.0], [1e-5, 2e-5]),
    ([1.0, -0.6, 2.5], [0.3, 0.5]),
    ([1.4, 1e-6, 2.0], [0.99, 0.0]),
    ([1.2, 1e-4, 3.0], [0.683, 0.0]),  # next to the lowest point of a motion that nearly reaches the top
    ([1.2, 1e-9, 3.0], [0.683, 0.0]),
)


@pytest.mark.parametrize(("momentum", "gamma"), STARTS)
def test_roots_of_the_cubic_to_fifty_digits_m3(momentum, gamma):
    gamma = np.array([*gamma, np.sqrt(1.0 - np.sum(np.square(gamma)))])
    gamma /= np.linalg.norm(gamma)
    rise = nutation(LagrangeTop(1.3, 0.7, 2.0), momentum, gamma)
    with mpmath.workdps(60):
        i1, mgl = mpmath.mpf(1.3), mpmath.mpf(2.0)
        (p1, p2, p3), (g1, g2, _) = map(mpmath.mpf, momentum), map(mpmath.mpf, gamma.tolist())
        g3 = mpmath.sqrt(1 - g1**2 - g2**2)
        # Of u: u'^2 = (alpha - beta u)(1 - u^2) - (b - a u)^2 in the textbook's letters.
        beta, a, b = 2 * mgl / i1, p3 / i1, (p1 * g1 + p2 * g2 + p3 * g3) / i1
        alpha = (p1**2 + p2**2) / i1**2 + beta * g3
        second, first, last = -(alpha + a**2) / beta, (2 * a * b - beta) / beta, (alpha - b**2) / beta
        # Three real roots by Viete's cosines.
        p, q = first - second**2 / 3, 2 * second**3 / 27 - second * first / 3 + last
        turn = mpmath.acos(3 * q / (2 * p) * mpmath.sqrt(-3 / p)) / 3
        size = 2 * mpmath.sqrt(-p / 3)
        low, high, third = sorted(size * mpmath.cos(turn - 2 * mpmath.pi * k / 3) - second / 3 for k in range(3))
        complement = (third - high) / (third - low)
        period = 2 * mpmath.ellipk(1 - complement) / mpmath.sqrt(beta * (third - low) / 4)
        assert (rise.lowest, rise.highest) == pytest.approx((float(low), float(high)), abs=5e-14)
        assert rise.complement == pytest.approx(float(complement), rel=3e-12)
        assert rise.period == pytest.approx(float(period), rel=1e-12)
