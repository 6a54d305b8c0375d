"""The Serret-Andoyer metric, its geodesics and conjugate points: theory.md R2 to R13, R15, errata of Bonnard et al.

Symbols here are those of the paper, I_1 > I_2 > I_3 and A < B < C; in the library I_1 < I_2 < I_3 and a_3, a_2, a_1.
"""

from __future__ import annotations

import itertools
import math

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from shapephase import so3
from shapephase.errors import ShapeError
from shapephase.rigid_body import EulerTop
from shapephase.rigid_body.geodesics import (
    AndoyerVariables,
    andoyer_motion,
    andoyer_variables,
    sadov_frequencies,
    sadov_variables,
    serret_andoyer_metric,
)
from support.long_runs import full_but

MOMENTS = np.array([3.0, 2.0, 1.0])
METRIC = serret_andoyer_metric(MOMENTS)
mp = mpmath.mp.clone()
mp.dps = 30

# theory.md, section 6: p, T, R, phi_1c, theta_1c.
TABLE = np.array(
    [
        [1.70, 11.3634614556, 3.2816745281, -0.094594, 3.565678],
        [1.60, 13.3636563838, 3.8894133371, -0.644765, 5.025759],
        [1.50, 17.0851557433, 5.0954738015, -1.152362, 7.022735],
        [1.43, 25.3967481375, 7.9511732331, -1.676710, 11.331023],
        [1.42, 30.3253866338, 9.6815243490, -1.829686, 13.924233],
    ]
)
# Weights of central differences of eighth order.
OFFSETS = np.array([1, 2, 3, 4, -1, -2, -3, -4])
WEIGHTS = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280, -4 / 5, 1 / 5, -4 / 105, 1 / 280])


def random_moments(rng, count):
    """Descending triples up to a hundredfold apart, also such as no real body has."""
    values = np.sort(10.0 ** rng.uniform(-1, 1, (4 * count, 3)), axis=-1)[:, ::-1]
    apart = np.all(values[:, :-1] > 1.02 * values[:, 1:], axis=-1)
    return values[apart][:count]


def oscillating_momenta(rng, moments, count=1):
    i1, i2, _ = moments
    return np.sqrt(i2 + (i1 - i2) * rng.uniform(1e-3, 1.0, count))


def constants(moments):
    return (1 / mp.mpf(float(moment)) for moment in moments)


def jacobi_functions(u, m):
    return [mp.ellipfun(name, u, m=m) for name in ("sn", "cn", "dn")]


class Exact:
    """An oscillating geodesic by the printed roots and Legendre's integrals with 0 < n < 1, to 30 digits."""

    def __init__(self, moments, p):
        self.a, self.b, self.c = constants(moments)
        self.p = mp.mpf(p)

    def first_return(self, p=None):
        """Theory.md R11."""
        p = self.p if p is None else p
        a, b = self.a, self.b
        y1, y2 = self.roots(p)
        m = y1 * (y2 - 1) / (y2 - y1)
        rate = p * (b - a) * mp.sqrt(y2 - y1)
        period = 4 * mp.ellipk(m) / rate
        rest = mp.ellipk(m) - (1 - y1) * mp.ellippi(y1, m)
        return p * (a * period / 2 + 2 * (b - a) / rate * rest), period

    def roots(self, p):
        return (1 - p**2 * self.a) / (p**2 * (self.b - self.a)), (self.c - self.a) / (self.b - self.a)

    def conjugate(self, time):
        """Time, phi and theta of the conjugate point near a time, by the zero of the derivative in Legendre's forms."""
        a, b, c, p = self.a, self.b, self.c, self.p
        y1, y2 = self.roots(p)
        m = y1 * (y2 - 1) / (y2 - y1)
        rate, ratio = p * (b - a) * mp.sqrt(y2 - y1), (b - a) / (p**2 * b - 1)
        k, e = mp.ellipk(m), mp.ellipe(m)

        def derivative(v):
            sn, cn, dn = jacobi_functions(v, m)
            return a * (2 * k + v) + ratio * (sn * dn / cn - 2 * e - mp.ellipe(mp.asin(sn), m))

        near = mp.mpf(float(time)) * rate - 2 * k
        v = mp.findroot(derivative, (near, near * (1 + mp.mpf(10) ** -12)), tol=mp.mpf(10) ** -50)
        sn, _, dn = jacobi_functions(v, m)
        k2, n = (b - a) / (c - a), (a * p**2 - 1) / (c * p**2 - 1)
        angle = mp.atan2(mp.sqrt(m) * sn, mp.sqrt(1 - k2) * dn)
        third = mp.ellippi(n, mp.asin(sn), m)
        theta = self.first_return()[0] + p / rate * (c * v - (c - a) * third)
        return (2 * k + v) / rate, -mp.ellipf(angle, k2) / mp.sqrt(c - a), theta

    def along(self, y, power, powers=(0, 1)):
        """Integrals along a meridian from pi/2 to y of w^j (1 - p^2 w)^power/sqrt(C - w), j of these powers."""

        def integrand(angle, j):
            w = self.a * mp.sin(angle) ** 2 + self.b * mp.cos(angle) ** 2
            return w**j * (1 - self.p**2 * w) ** power / mp.sqrt(self.c - w)

        return [mp.quad(lambda angle, j=j: integrand(angle, j), [mp.mpf(y), mp.pi / 2]) for j in powers]


def test_the_metric_is_that_of_the_energy_r2():
    """(5), (6), (7): the energy is half the inverse metric applied to (p_x, p_y), and that of the body."""
    rng = np.random.default_rng(1)
    attitude = so3.matrix_from_quat(so3.normalised(rng.normal(size=(50, 4))))
    v = andoyer_variables(attitude, rng.normal(size=(50, 3)))
    across, along = METRIC.coefficients(v.l)
    z = 2.0 * (np.sin(v.l) ** 2 / 3.0 + np.cos(v.l) ** 2 / 2.0)
    assert np.abs(across - 2.0 / z).max() < 1e-14
    assert np.abs(along - 2.0 / (2.0 - z)).max() < 1e-14
    energy = v.hamiltonian(np.diag(MOMENTS))
    assert np.abs(METRIC.energy(v.l, v.total, v.axial) - energy).max() < 1e-14
    assert np.abs(0.5 * (v.total**2 / across + v.axial**2 / along) - energy).max() < 1e-14


def test_the_metric_of_the_introduction_is_half_of_7_b_e1():
    y = np.linspace(0.0, 3.0, 13)
    z = 2.0 * METRIC.w(y)
    across, along = METRIC.coefficients(y)
    assert np.abs(np.array([across * z, along * (2.0 / MOMENTS[2] - z)]) - 2.0).max() < 1e-14
    printed = 1.0 / z, 1.0 / (2.0 / MOMENTS[2] - z)
    wrong = 0.5 * (1.3**2 / printed[0] + 0.4**2 / printed[1])
    assert np.abs(wrong / METRIC.energy(y, 1.3, 0.4) - 2.0).max() < 1e-14


def test_equilibria_and_separatrix_planes_r3():
    """lambda^2 = (B - A)(C - B) G^2 at y = 0, -(B - A)(C - A) G^2 at pi/2; H_3 = +-sqrt((B - A)/(C - B)) H_1."""
    a, b, c = 1.0 / MOMENTS

    def rates(y, p_y):
        zero = np.zeros_like(y)
        state = AndoyerVariables(zero, zero, y, zero + 1.7, zero, p_y)
        return np.array(state.rates(np.diag(MOMENTS))[1:])

    for y, square in ((0.0, (b - a) * (c - b)), (0.5 * np.pi, -(b - a) * (c - a))):
        h = 1e-2
        columns = [
            rates(y + h * OFFSETS, 0.0 * OFFSETS) @ WEIGHTS / h,
            rates(y + 0 * OFFSETS, h * OFFSETS) @ WEIGHTS / h,
        ]
        eigenvalues = np.linalg.eigvals(np.array(columns))
        assert np.abs(eigenvalues**2 - square * 1.7**2).max() < 1e-12
        assert np.abs(rates(np.array(y), np.array(0.0))).max() < 1e-15
    slope = np.sqrt((b - a) / (c - b))
    for sign in (1.0, -1.0):
        for factor, name in ((1.0 + 1e-9, "rotating"), (1.0 - 1e-9, "oscillating")):
            assert METRIC.geodesics_of([0.4, 0.3, sign * slope * 0.4 * factor]).trajectory_class == name
    path = METRIC.separatrix()
    t = np.linspace(0.0, 12.0, 25)
    y, p_y, size = path.y(t), path.p_y(t), np.sqrt(MOMENTS[1])
    across = np.sqrt(size**2 - p_y**2)
    assert np.abs(p_y + slope * across * np.sin(y)).max() < 1e-14


def test_the_polar_form_is_that_of_the_integral_along_a_meridian_r4():
    """(9), proposition 8; the coordinate phi by the integral along a meridian."""
    a, b, c = 1.0 / MOMENTS
    assert METRIC.alpha == pytest.approx(np.sqrt(2.0 / 3.0), abs=1e-15)
    assert METRIC.modulus**2 == pytest.approx(0.25, abs=1e-15)
    assert METRIC.crest == pytest.approx(2.0646141015, abs=5e-11)
    for y in (-3.0, -0.4, 0.0, 0.9, 2.0, 4.0):
        length = -quad(lambda s: 1.0 / np.sqrt(c - a * np.sin(s) ** 2 - b * np.cos(s) ** 2), 0.5 * np.pi, y)[0]
        assert METRIC.phi_of_y(y) == pytest.approx(length, abs=1e-12)
    y = np.linspace(-7.0, 7.0, 57)
    phi = METRIC.phi_of_y(y)
    assert np.abs(METRIC.y_of_phi(phi) - y).max() < 1e-13
    m = METRIC.m(phi)
    assert np.abs(m - 1.0 / METRIC.w(y)).max() < 1e-13
    assert np.all((m >= MOMENTS[1] - 1e-14) & (m <= MOMENTS[0] + 1e-14))
    assert np.abs(METRIC.m(-phi) - m).max() < 1e-15
    h = 1e-2
    near = METRIC.m(phi[:, None] + h * OFFSETS)
    first, second = METRIC.m_derivatives(phi)
    assert np.abs(near @ WEIGHTS / h - first).max() < 1e-11
    slopes = METRIC.m_derivatives(phi[:, None] + h * OFFSETS)[0]
    assert np.abs(slopes @ WEIGHTS / h - second).max() < 1e-11


def test_y_falls_as_phi_grows_and_the_root_has_k_squared_b_e5():
    phi = np.linspace(0.1, 2.0, 20)
    h = 1e-2
    slope = METRIC.y_of_phi(phi[:, None] + h * OFFSETS) @ WEIGHTS / h
    speed = np.sqrt(1.0 / MOMENTS[2] - METRIC.w(METRIC.y_of_phi(phi)))
    assert np.abs(slope + speed).max() < 1e-12
    assert np.all(np.abs(slope - speed) > 0.5)
    k2, rest = METRIC.modulus**2, METRIC.complement
    x = np.sin(METRIC.y_of_phi(1.1))

    def integral(factor):
        return quad(lambda s: 1.0 / np.sqrt((1.0 - s * s) * (rest + factor * s * s)), x, 1.0)[0]

    assert integral(k2) == pytest.approx(METRIC.alpha * 1.1, abs=1e-10)
    assert abs(integral(rest) - METRIC.alpha * 1.1) > 1e-2


def test_the_potential_rises_from_the_equator_to_the_crest_lemma_4_1_r5():
    """The potential is even, of period 2 K/alpha, rises from A p^2 at 0 to B p^2 at K/alpha."""
    rng = np.random.default_rng(2)
    for moments in random_moments(rng, 40):
        metric = serret_andoyer_metric(moments)
        phi = np.linspace(0.0, metric.crest, 60)
        v = metric.potential(phi, 1.3)
        assert np.all(np.diff(v) > 0.0)
        assert v[0] == pytest.approx(1.69 / moments[0], rel=1e-13)
        assert v[-1] == pytest.approx(1.69 / moments[1], rel=1e-13)
        assert np.abs(metric.potential(-phi, 1.3) / v - 1.0).max() < 1e-13
        assert np.abs(metric.potential(phi + 2.0 * metric.crest, 1.3) / v - 1.0).max() < 1e-12
        family = metric.geodesics(oscillating_momenta(rng, moments, 5))
        assert np.abs(metric.potential(family.amplitude, family.p_theta) - 1.0).max() < 1e-13


def test_classes_change_at_the_roots_of_the_moments_r6():
    root = np.sqrt(MOMENTS)
    names = METRIC.geodesics([0.0, 0.99, -1.01, 1.41, 1.42, -1.73, root[0]]).trajectory_class
    expected = ["extended"] * 2 + ["rotating"] * 2 + ["oscillating"] * 2
    assert list(names[:6]) == expected
    assert names[6] in ("oscillating", "equator")
    assert METRIC.geodesics(0.5).trajectory_class == "extended"
    assert METRIC.geodesics(np.sqrt(MOMENTS[2])).trajectory_class == "rotating"
    assert serret_andoyer_metric([4.0, 2.0, 1.0]).geodesics(2.0).trajectory_class == "equator"
    assert serret_andoyer_metric([9.0, 4.0, 1.0]).geodesics(2.0).trajectory_class == "separatrix"
    assert METRIC.separatrix().trajectory_class == "separatrix"
    beyond, below = METRIC.geodesics(
        [np.nextafter(np.sqrt(2.0), 0.0), np.nextafter(np.sqrt(2.0), 2.0)]
    ).trajectory_class
    assert (beyond, below) == ("rotating", "oscillating")


@pytest.mark.parametrize("start", [(1.5, 0.0, 0.6), (0.6, 0.0, 1.5), (1.5, 0.0, -0.6), (0.3, 0.0, -1.5)])
def test_free_bodies_run_along_geodesics_r6(start):
    """l is y and g is theta, at p_theta = G/sqrt(2 E), of the mirror image where L > 0."""
    top = EulerTop.principal(MOMENTS, start, so3.exp(np.array([0.3, 0.2, 0.5])))
    speed = np.sqrt(2.0 * top.energy)
    family = METRIC.geodesics(top.magnitude / speed)
    other = METRIC.geodesics_of(start)
    assert family.trajectory_class == ("oscillating" if start[0] > 1 else "rotating")
    times = np.linspace(0.0, 20.0, 81)
    v = andoyer_motion(top, times)
    sign = -np.sign(start[2])
    for path in (family, other):
        assert np.abs(v.l - v.l[0] - sign * (path.y(speed * times) - 0.5 * np.pi)).max() < 1e-12
        assert np.abs(v.g - v.g[0] - path.theta(speed * times)).max() < 1e-12
        assert np.abs(v.axial - sign * speed * path.p_y(speed * times)).max() < 1e-12
        assert path.period == pytest.approx(speed * top.period, rel=1e-13)


def integrated(p, end, moments=MOMENTS):
    """phi, p_phi, theta and the Jacobi field by Hamilton's equations (8) in y, and the curvature by lemma 4.2."""
    a, b, c = (1.0 / moments).tolist()
    total, pairs, product = a + b + c, a * b + b * c + c * a, a * b * c

    def rate(_, state):
        y, p_y, _, _, field, slope = state
        sine, cosine = math.sin(y), math.cos(y)
        w = a * sine**2 + b * cosine**2
        curvature = (total * w * w - 2.0 * pairs * w + 3.0 * product) / (w * w)
        p_phi = -p_y * math.sqrt(c - w)
        return [p_y * (c - w), (b - a) * (p * p - p_y * p_y) * sine * cosine, p * w, p_phi, slope, -curvature * field]

    start = [0.5 * np.pi, -np.sqrt(max(0.0, 1.0 - p * p * a) / (c - a)), 0.0, 0.0, 0.0, 1.0]
    times = np.linspace(0.0, end, 41)
    y, p_y, theta, phi, field, slope = solve_ivp(rate, (0.0, end), start, "DOP853", times, rtol=3e-14, atol=1e-15).y
    return times, [phi, -p_y * np.sqrt(c - a * np.sin(y) ** 2 - b * np.cos(y) ** 2), theta, field, slope, y]


CASES = [("r7_oscillating", p) for p in (1.7, 1.5, -1.43)] + [
    ("r9_rotating", p) for p in (1.40, 1.2, -1.001, 1.0, 0.999, 0.6, -0.2, 1e-3, 0.0)
]


@pytest.mark.parametrize(("name", "p"), CASES)
def test_closed_forms_against_integration_r7_r8_r9(name, p):
    family = METRIC.geodesics(p)
    assert (family.trajectory_class == "oscillating") == name.startswith("r7")
    times, (phi, p_phi, theta, field, _, y) = integrated(p, 25.0)
    assert np.abs(family.phi(times) - phi).max() < 1e-11
    assert np.abs(family.p_phi(times) - p_phi).max() < 1e-11
    assert np.abs(family.theta(times) - theta).max() < 1e-11
    assert np.abs((family.jacobi_field(times) - field) / (1.0 + np.abs(field))).max() < 1e-11
    assert np.abs(y - family.y(times)).max() < 1e-11
    assert np.abs(METRIC.energy(family.y(times), p, family.p_y(times)) - 0.5).max() < 1e-14
    assert np.abs(family.phi(-times) + family.phi(times)).max() < 1e-14
    assert np.abs(family.theta(-times) + family.theta(times)).max() < 1e-14


def test_theta_on_the_separatrix_r8():
    """sin-Gordon-like: sin am = tanh; time and theta by their integrals in p = sqrt(I_2) exactly."""
    path = METRIC.separatrix()
    exact = Exact(MOMENTS, 1)
    exact.p = mp.sqrt(mp.mpf(2))
    for y in ("1.2", "0.5", "0.01", "1e-5"):
        time, weighted = exact.along(mp.mpf(y), mp.mpf(-0.5))
        assert float(path.theta(float(time))) == pytest.approx(float(exact.p * weighted), abs=1e-13)
        assert float(path.y(float(time))) == pytest.approx(float(mp.mpf(y)), rel=1e-12)
    assert path.phi(1e4) == METRIC.crest
    assert np.isinf(path.period)
    assert path.mean_theta_rate == pytest.approx(1.0 / np.sqrt(2.0), abs=1e-15)
    assert path.theta(1e6) / 1e6 == pytest.approx(1.0 / np.sqrt(2.0), abs=1e-5)


def printed_theta(moments, p, t, with_start):
    """Bonnard et al. (16) to (20) with a complex parameter, eta = cn(M t + psi_0), psi_0 = -K."""
    exact = Exact(moments, p)
    p, a, b, t = exact.p, exact.a, exact.b, mp.mpf(t)
    y1, y2 = exact.roots(p)
    m = y1 * (y2 - 1) / (y2 - y1)
    rate = p * (b - a) * mp.sqrt(y2 - y1)
    start = -mp.ellipk(m)
    square = y1 / m
    sn_a = mp.sqrt(square)
    cn_a, dn_a = mp.sqrt(mp.mpc(1 - square)), mp.sqrt(1 - m * square)

    def third(u):
        factor = m * sn_a * cn_a * dn_a
        s = lambda v: mp.ellipfun("sn", v, m=m) ** 2  # noqa: E731
        return factor * mp.quad(lambda v: s(v) / (1 - m * square * s(v)), mp.linspace(0, u, 4))

    end = third(rate * t + start) - (third(start) if with_start else 0)
    integral = end / (m * sn_a * cn_a * dn_a) / rate
    lam, mu = 1 / y1, mp.mpf(-1)
    return p * (a * t + (b - a) * (t / lam + (-lam - mu) / lam**2 * integral))


def test_the_printed_theta_is_off_by_a_constant_b_e7_b_e8():
    """(20) holds with Pi(psi_0) taken off and a complex a; dropped, theta is shifted by a constant."""
    with mp.workdps(17):
        right = [complex(printed_theta(MOMENTS, 1.5, t, True)) for t in (0.7, 9.0)]
        printed = [complex(printed_theta(MOMENTS, 1.5, t, False)) for t in (0.7, 9.0)]
    ours = METRIC.geodesics(1.5).theta([0.7, 9.0])
    assert np.abs(np.array(right) - ours).max() < 1e-12
    shift = np.array(printed) - ours
    assert np.abs(shift - shift[0]).max() < 1e-12
    assert np.abs(shift[0]) > 0.05
    y1, y2 = Exact(MOMENTS, 1.5).roots(mp.mpf(1.5))
    assert (y2 - y1) / (y2 - 1) > 1
    assert y1 * (y2 - 1) / (y2 - y1) < y1 < 1


@pytest.mark.parametrize("p", [1.3, 1.1, 0.8, 0.3])
def test_the_rotating_case_by_its_own_substitution_b_e11(p):
    """Y by the substitution of theory.md B-E11, on both sides of p = sqrt(I_3), and the equation of eta'."""
    exact = Exact(MOMENTS, p)
    y1, y2 = exact.roots(exact.p)
    factor = (exact.p * (exact.b - exact.a)) ** 2
    rate, m = factor * y1 * (y2 - 1), (y2 - y1) / (y1 * (y2 - 1))
    if y1 > y2:
        rate, m = factor * y2 * (y1 - 1), (y1 - y2) / (y2 * (y1 - 1))
    rate = mp.sqrt(rate)
    family = METRIC.geodesics(p)

    def eta(t):
        sn = mp.ellipfun("sn", rate * t, m=m)
        return sn if y1 > y2 else mp.ellipfun("cn", rate * t - mp.ellipk(m), m=m)

    for t in (0.4, 1.7, 5.0):
        square = eta(mp.mpf(t)) ** 2
        slope = mp.diff(eta, mp.mpf(t)) ** 2
        assert abs(slope - factor * (1 - square) * (y2 * (y1 - 1) + (y2 - y1) * square)) < mp.mpf(10) ** -18
        height = y1 * square / (y1 - 1 + square)
        assert np.cos(family.y(t)) ** 2 == pytest.approx(float(height), abs=1e-14)


def test_equation_10_is_for_the_big_y_b_e6():
    """dY/dt, not dy/dt, is the root of the quartic."""
    family, t, h = METRIC.geodesics(1.5), np.array([0.3, 0.5, 1.0]), 1e-2
    y1, y2 = (float(root) for root in Exact(MOMENTS, 1.5).roots(mp.mpf(1.5)))
    around = family.y(t[:, None] + h * OFFSETS)
    y, height = family.y(t), np.cos(family.y(t)) ** 2
    root = 2.0 * 1.5 * (1.0 / 6.0) * np.sqrt(height * (1.0 - height) * (y2 - height) * (y1 - height))
    assert np.abs(np.cos(around) ** 2 @ WEIGHTS / h - root).max() < 1e-12
    assert np.all(np.abs(np.abs(around @ WEIGHTS / h) - root) > 1e-2)
    assert np.all(y < 0.5 * np.pi)


def test_gauss_curvature_of_the_polar_form_r10():
    """-(sqrt m)''/sqrt m, and the polynomial in z of lemma 4.2."""
    assert METRIC.gauss_curvature([0.0, METRIC.crest]) == pytest.approx([1.0 / 3.0, -1.0 / 6.0], abs=1e-15)
    rng = np.random.default_rng(4)
    for moments in random_moments(rng, 60):
        metric = serret_andoyer_metric(moments)
        a, b, c = 1.0 / moments
        phi = np.linspace(-metric.crest, 3.0 * metric.crest, 41)
        m, (first, second) = metric.m(phi), metric.m_derivatives(phi)
        bent = 0.25 * (first / m) ** 2 - 0.5 * second / m
        curvature = metric.gauss_curvature(phi)
        scale = 1e-13 * metric.alpha**2 * (moments[0] / moments[2])
        assert np.abs(curvature - bent).max() < scale
        pairs, total = a * b + b * c + c * a, a + b + c
        root = np.sqrt(pairs**2 - 3.0 * a * b * c * total)
        z = 2.0 / m
        low, high = 2.0 * (pairs - root) / total, 2.0 * (pairs + root) / total
        assert np.abs(curvature - total * (z - low) * (z - high) / z**2).max() < 10.0 * scale


def test_lemma_4_2_over_100_bodies_r10():
    """The largest curvature, (B - A)(C - A)/A, is on the equator, as the lemma says.

    The least, of which it says nothing, is at z = 2 B only if 2 I_2 >= I_1 + I_3.
    """
    inner = 0
    for moments in random_moments(np.random.default_rng(5), 100):
        metric = serret_andoyer_metric(moments)
        a, b, c = 1.0 / moments
        curvature = metric.gauss_curvature(np.linspace(0.0, metric.crest, 301))
        assert curvature[0] == pytest.approx((b - a) * (c - a) / a, rel=1e-12)
        assert curvature[-1] == pytest.approx(-(b - a) * (c - b) / b, rel=1e-10)
        assert np.argmax(curvature) == 0
        assert curvature[0] > 0.0 > curvature[-1]
        least, largest = metric.curvature_range
        assert largest == pytest.approx(curvature[0], rel=1e-12)
        rounding = 1e-12 * (a + b + c)
        assert np.all(curvature >= least - rounding)
        assert least == pytest.approx(curvature.min(), abs=2e-3 * (largest - least))
        if 2.0 * moments[1] >= moments[0] + moments[2]:
            assert np.argmin(curvature) == 300
            assert least == pytest.approx(curvature[-1], rel=1e-10)
        else:
            # The parallel with m the mean of the moments.
            w = 3.0 / moments.sum()
            y = np.arccos(np.sqrt((w - a) / (b - a)))
            assert metric.gauss_curvature(metric.phi_of_y(y)) == pytest.approx(least, abs=rounding)
            assert least < curvature[-1]
            inner += 1
    assert 10 < inner < 90


def test_the_reference_table_r11_r12():
    p, period, first_return, phi, theta = TABLE.T
    family = METRIC.geodesics(p)
    points = family.conjugate_points()
    assert np.abs(family.period - period).max() < 5.1e-11
    assert np.abs(family.first_return - first_return).max() < 5.1e-11
    assert np.abs(points.phi - phi).max() < 5.1e-7
    assert np.abs(points.theta - theta).max() < 5.1e-7
    assert METRIC.geodesics(np.sqrt(3.0)).first_return == pytest.approx(np.pi, abs=1e-14)


@pytest.mark.parametrize("p", [1.3, 0.7, float(np.sqrt(2.0) * (1.0 - 1e-9))])
def test_rotating_geodesics_pass_the_crest_r9(p):
    """At odd quarters of the period, to the last digits around them, phi is the same multiple of K/alpha."""
    family = METRIC.geodesics(p)
    odd = np.array([-5.0, -1.0, 1.0, 3.0, 7.0])[:, None]
    times = 0.25 * family.period * odd * (1.0 + 1e-16 * np.arange(-20.0, 21.0))
    assert np.abs(family.phi(times) - odd * METRIC.crest).max() < 1e-13
    assert np.abs(family.y(times) - 0.5 * np.pi * (1.0 - odd)).max() < 1e-13


def extreme_case(rng, kind):
    """Moments nearly equal or far apart, and p next to the ends of its class, 0 oscillating, 1 rotating, 2 extended."""
    i3 = 10 ** rng.uniform(-4, 0)
    i2 = i3 * (1 + 10 ** rng.uniform(-7, 5))
    i1 = i2 * (1 + 10 ** rng.uniform(-7, 5))
    low, high = ((i2, i1), (i3, i2), (0.0, i3))[kind]
    part = 10 ** rng.uniform(-12, 0)
    return np.array([i1, i2, i3]), float(np.sqrt(low + (high - low) * (part if rng.uniform() < 0.5 else 1.0 - part)))


@pytest.mark.parametrize("count", full_but([10, 100], 10))
def test_conjugate_points_of_extreme_bodies_r11_r12(count):
    """To rounding of the point itself, from next to the cusp to next to the separatrix."""
    rng = np.random.default_rng(9)
    tried = 0
    with mp.workdps(60):
        for _ in range(count):
            moments, p = extreme_case(rng, 0)
            family = serret_andoyer_metric(moments).geodesics(p)
            if family.trajectory_class != "oscillating":
                continue
            exact = Exact(moments, p)
            points = family.conjugate_points()
            errors = [
                float(found / right - 1)
                for found, right in zip(
                    (points.time, points.phi, points.theta), exact.conjugate(points.time), strict=True
                )
            ]
            assert np.abs(errors).max() < 1e-14
            first_return, period = exact.first_return()
            assert float(family.period / period) == pytest.approx(1.0, abs=1e-14)
            assert float(family.first_return / first_return) == pytest.approx(1.0, abs=1e-12)
            tried += 1
    assert tried > 0.7 * count


@pytest.mark.parametrize("kind", range(3))
def test_closed_forms_of_extreme_bodies_r7_r8_r9(kind):
    """phi and theta at exactly known times, by integrals in an angle that is regular at the turning point."""
    rng = np.random.default_rng(10 + kind)
    for _ in range(6):
        moments, p = extreme_case(rng, kind)
        family = serret_andoyer_metric(moments).geodesics(p)
        exact = Exact(moments, p)
        a, b, c, p = exact.a, exact.b, exact.c, exact.p
        top = exact.roots(p)[0]

        def integrand(angle, j, a=a, b=b, c=c, p=p, top=top):
            square = min(top, 1) * mp.sin(angle) ** 2
            w = a + (b - a) * square
            rest = (1 - square) * p**2 * (b - a) if top < 1 else 1 - p**2 * w
            return w**j / mp.sqrt((c - w) * rest)

        for part in ("0.1", "0.97"):
            end = mp.pi / 2 * mp.mpf(part)
            edges = [end * x for x in map(mp.mpf, ("0", "0.9", "0.99", "0.999", "1"))]
            with mp.workdps(20):
                time, weighted = (mp.quad(lambda angle, j=j: integrand(angle, j), edges) for j in (0, 1))
            angle = mp.asin(mp.sqrt(min(top, 1)) * mp.sin(end))
            phi = mp.ellipf(angle, (b - a) / (c - a)) / mp.sqrt(c - a)
            assert float(family.phi(float(time)) / phi) == pytest.approx(1.0, abs=1e-14)
            assert abs(float(family.theta(float(time)) - p * weighted)) < 4e-15 * (1 + float(p * b * time))


def test_derivative_of_the_return_is_that_of_the_period_r11():
    """Lemma 2.8, R' = T'/(2 p), each by differences of its own closed form; and R''."""
    rng = np.random.default_rng(7)
    for moments in random_moments(rng, 50):
        metric, (i1, i2, _) = serret_andoyer_metric(moments), moments
        p = np.sqrt(i2 + (i1 - i2) * rng.uniform(0.2, 0.9))
        h = 0.02 * min(np.sqrt(i1) - p, p - np.sqrt(i2))
        around = metric.geodesics(p + h * OFFSETS)
        here = metric.geodesics(p)
        rounding = 1e-10 * abs(here.first_return_slope)
        assert abs(around.first_return @ WEIGHTS / h - here.first_return_slope) < rounding
        assert abs(around.period @ WEIGHTS / h / (2.0 * p) - here.first_return_slope) < rounding
        assert around.first_return_slope @ WEIGHTS / h == pytest.approx(here.first_return_bend, rel=1e-9)


def test_proposition_9_and_b_e10_over_200_bodies_r11():
    """On I_2 < p^2 < I_1 the first return decreases and is convex."""
    rng = np.random.default_rng(8)
    for moments in random_moments(rng, 200):
        i1, i2, _ = moments
        p = np.sqrt(i2 + (i1 - i2) * np.linspace(0.02, 1.0, 40))
        p[-1] = np.sqrt(i1)
        family = serret_andoyer_metric(moments).geodesics(p)
        values = family.first_return
        slopes = np.diff(values) / np.diff(p)
        assert np.all(slopes < 0.0)
        assert np.all(np.diff(slopes) > 0.0)
        assert np.all(family.first_return_slope < 0.0)
        assert np.all(family.first_return_bend > 0.0)
        assert np.all(family.is_oscillating)
        assert not serret_andoyer_metric(moments).geodesics(np.sqrt(i2) * 0.999).is_oscillating


def test_conjugate_points_are_zeros_of_the_jacobi_field_r12():
    for p in (1.7, 1.5, -1.45):
        family = METRIC.geodesics(p)
        for order in (1, 2, 3):
            points = family.conjugate_points(order)
            times, state = integrated(p, float(points.time))
            phi, _, theta, field, slope, _ = (series[-1] for series in state)
            assert abs(field / slope) < 1e-10
            inner = np.count_nonzero(np.diff(np.sign(family.jacobi_field(np.linspace(1e-3, points.time - 1e-3, 999)))))
            assert inner == order - 1
            assert times[-1] == points.time
            assert [phi, theta] == pytest.approx([points.phi, points.theta], abs=1e-10)
            assert [family.phi(points.time), family.theta(points.time)] == pytest.approx(
                [points.phi, points.theta], abs=1e-12
            )


def test_two_symmetric_branches_a_cusp_and_the_asymptote_r12_r14():
    """From a horizontal cusp on the equator to the parallel phi = -K/alpha; the mirror image is conjugate too."""
    root = np.sqrt(3.0)
    end = METRIC.geodesics(root).conjugate_points()
    assert [end.phi, end.theta] == pytest.approx([0.0, np.pi], abs=1e-7)
    # At the cusp phi ~ (theta - R)^(3/2).
    near = METRIC.geodesics(root - np.array([1e-4, 1e-5, 1e-6])).conjugate_points()
    exponents = np.diff(np.log(-near.phi)) / np.diff(np.log(near.theta - np.pi))
    assert exponents == pytest.approx(1.5, abs=1e-3)
    p = np.sqrt(2.0) * (1.0 + np.logspace(-1, -12, 45))
    points = METRIC.geodesics(p).conjugate_points()
    assert np.all(np.diff(points.phi) < 0.0)
    assert np.all(np.diff(points.theta) > 0.0)
    assert np.all(points.phi > -METRIC.crest)
    gap = points.phi + METRIC.crest
    assert gap[-1] < 1e-5
    # theta grows as the logarithm of the gap.
    assert points.theta[-1] > 35.0
    assert np.diff(points.theta)[-1] == pytest.approx(np.diff(points.theta)[-9], rel=1e-3)
    mirrored = METRIC.geodesics(-p).conjugate_points()
    assert np.array_equal(mirrored.theta, -points.theta)
    assert np.array_equal(mirrored.phi, points.phi)


def test_no_conjugate_points_on_rotating_geodesics_r13():
    """The Jacobi field never comes back to zero, in closed form and integrated."""
    p = np.array([0.0, 0.4, 0.99, 1.0, 1.2, 1.4, 1.414])
    family = METRIC.geodesics(p[:, None])
    times = np.linspace(0.01, 60.0, 600)
    assert np.all(family.jacobi_field(times) > 0.0)
    assert np.all(METRIC.separatrix().jacobi_field(times) > 0.0)
    for one in (0.4, 1.2, 1.4):
        assert np.all(integrated(one, 60.0)[1][3][1:] > 0.0)
    for one in (0.4, 1.2):
        with pytest.raises(ShapeError, match="oscillate"):
            METRIC.geodesics(one).conjugate_points()
    with pytest.raises(ShapeError, match="oscillate"):
        METRIC.separatrix().conjugate_points()


def test_the_metric_is_singular_in_the_sub_riemannian_limit_b_e12():
    """I_1 -> infinity: the curvature of the equator and m(0) grow without bound."""
    for i1 in (1e2, 1e4, 1e6):
        metric = serret_andoyer_metric([i1, 2.0, 1.0])
        assert metric.m(0.0) == pytest.approx(i1, rel=1e-12)
        assert metric.gauss_curvature(0.0) == pytest.approx(0.5 * i1, rel=4.0 / i1)


STATES = [(0.6, 0.3, 1.5), (1.5, 0.3, 0.6), (-1.5, -0.3, 0.6), (0.6, 0.2, -1.5), (-0.6, -0.2, 1.5), (-1.5, 0.7, -0.2)]


def action_by_quadrature(total, energy):
    """(1/2 pi) times the integral of |L| dl once round."""
    a, b, c = 1.0 / MOMENTS

    def square(angle):
        w = a * np.sin(angle) ** 2 + b * np.cos(angle) ** 2
        return (2.0 * energy - total**2 * w) / (c - w)

    if square(0.0) > 0.0:
        return quad(lambda angle: np.sqrt(square(angle)), 0.0, 2.0 * np.pi, epsabs=1e-14, limit=200)[0] / (2.0 * np.pi)
    half = np.arcsin(np.sqrt((2.0 * energy - a * total**2) / ((b - a) * total**2)))

    def smooth(s):
        return np.sqrt(max(square(0.5 * np.pi + half * np.sin(s)), 0.0)) * half * np.cos(s)

    return 2.0 * quad(smooth, -0.5 * np.pi, 0.5 * np.pi, epsabs=1e-14, limit=200)[0] / (2.0 * np.pi)


@pytest.mark.parametrize("start", STATES)
def test_actions_by_quadrature_and_frequencies_by_their_derivatives_r15(start):
    """dJ/dE = 1/own_rate, dJ/dG = -precession_rate/own_rate."""
    v = andoyer_variables(so3.exp(np.array([0.3, 0.2, 0.5])), start)
    s = sadov_variables(MOMENTS, v)
    total, energy = float(v.total), float(v.hamiltonian(np.diag(MOMENTS)))
    assert s.action == pytest.approx(action_by_quadrature(total, energy), abs=1e-12)
    h = 3e-3
    by_energy = np.array([action_by_quadrature(total, energy + h * k) for k in OFFSETS]) @ WEIGHTS / h
    by_total = np.array([action_by_quadrature(total + h * k, energy) for k in OFFSETS]) @ WEIGHTS / h
    assert 1.0 / s.own_rate == pytest.approx(by_energy, rel=1e-9)
    assert -s.precession_rate / s.own_rate == pytest.approx(by_total, rel=1e-9)
    # Euler's theorem on homogeneous functions.
    assert total * s.precession_rate + s.action * s.own_rate == pytest.approx(2.0 * energy, rel=1e-13)
    assert sadov_frequencies(MOMENTS, start) == pytest.approx((float(s.own_rate), float(s.precession_rate)), rel=1e-14)


@pytest.mark.parametrize("start", STATES)
def test_the_variables_are_canonical_r15(start):
    v = andoyer_variables(so3.exp(np.array([0.3, 0.2, 0.5])), start)
    point, h = np.array([v.g, v.l, v.total, v.axial]), 1e-3
    shifted = point + h * OFFSETS[:, None, None] * np.eye(4)
    g, l, total, axial = np.moveaxis(shifted, -1, 0)  # noqa: E741
    zero = np.zeros_like(g)
    s = sadov_variables(MOMENTS, AndoyerVariables(g, zero, l, total, zero, axial))
    here = sadov_variables(MOMENTS, v)
    values = np.stack([so3.wrap(s.precession - here.precession), so3.wrap(s.own - here.own), s.total, s.action])
    jacobian = np.einsum("ism,s->im", values, WEIGHTS) / h
    form = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.eye(2), np.zeros((2, 2))]])
    assert np.abs(jacobian.T @ form @ jacobian - form).max() < 1e-10


def test_limits_of_the_action_r15():
    """0 along axis 1, G along axis 3, and on the separatrix the same from both sides."""
    zero = np.zeros(())
    for momentum, action in (((1.3, 0.0, 0.0), 0.0), ((-1.3, 0.0, 0.0), 0.0), ((0.0, 0.0, -1.3), 1.3)):
        s = sadov_variables(MOMENTS, andoyer_variables(np.eye(3), momentum))
        assert s.action == pytest.approx(action, abs=1e-14)
        assert np.isfinite([s.own, s.precession, s.own_rate, s.precession_rate]).all()
    middle = METRIC.separatrix().action
    sides = METRIC.geodesics(np.sqrt(2.0) * (1.0 + np.array([1e-13, -1e-13]))).action
    assert np.abs(sides - middle).max() < 1e-11
    area = quad(lambda angle: np.sqrt(separatrix_square(angle)), 0.0, np.pi)[0] / np.pi
    assert middle == pytest.approx(area, abs=1e-12)
    on_it = AndoyerVariables(zero, zero, zero, zero + 1.0, zero, zero)
    with pytest.raises(ShapeError, match="separatrix"):
        sadov_variables(MOMENTS, on_it)
    rates = sadov_frequencies(MOMENTS, [0.0, 1.0, 0.0])
    assert rates == pytest.approx((0.0, 0.5), abs=1e-15)


def separatrix_square(angle):
    """L^2 at p_theta = sqrt(I_2), 2 E = 1."""
    a, b, c = 1.0 / MOMENTS
    w = a * np.sin(angle) ** 2 + b * np.cos(angle) ** 2
    return (b - a) * np.sin(angle) ** 2 / b / (c - w)


def test_tiny_momenta_keep_their_digits():
    tiny = METRIC.geodesics([1e-12, 1e-30, 1e-300]).theta(7.0)
    assert tiny / np.array([1e-12, 1e-30, 1e-300]) == pytest.approx(METRIC.geodesics(1e-8).theta(7.0) / 1e-8, rel=1e-12)


ORDERS = [list(order) for order in itertools.permutations(range(3))]


@pytest.mark.parametrize("order", ORDERS, ids=str)
def test_moments_in_any_order_give_the_same_geodesics(order):
    """Andoyer's y and p_y refer to the axes of the largest, the middle and the smallest moment, wherever they stand."""
    rng = np.random.default_rng(21)
    momentum = rng.normal(size=(20, 3))
    metric = serret_andoyer_metric(MOMENTS[order])
    assert np.array_equal(metric.moments, MOMENTS[order])
    for name in ("alpha", "complement", "crest", "separatrix_momentum", "largest_momentum", "curvature_range"):
        assert getattr(metric, name) == getattr(METRIC, name)
    y, phi = rng.uniform(-3.0, 3.0, (2, 20))
    assert np.array_equal(metric.coefficients(y), METRIC.coefficients(y))
    assert np.array_equal(metric.m(phi), METRIC.m(phi))
    assert np.array_equal(metric.gauss_curvature(phi), METRIC.gauss_curvature(phi))
    there, here = metric.geodesics_of(momentum[:, order]), METRIC.geodesics_of(momentum)
    assert np.array_equal(there.trajectory_class, here.trajectory_class)
    for name in ("p_theta", "period", "first_return", "action"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), rtol=1e-14)
    axes = metric.andoyer_axes
    assert np.linalg.det(axes) == pytest.approx(1.0, abs=1e-15)
    np.testing.assert_allclose(np.diag(axes.T @ np.diag(MOMENTS[order]) @ axes), MOMENTS, rtol=1e-15)
    np.testing.assert_allclose(
        sadov_frequencies(MOMENTS[order], momentum[:, order]), sadov_frequencies(MOMENTS, momentum), rtol=1e-13
    )


@pytest.mark.parametrize("order", ORDERS, ids=str)
def test_sadov_variables_do_not_depend_on_the_names_of_the_axes(order):
    rng = np.random.default_rng(22)
    attitude = so3.matrix_from_quat(so3.normalised(rng.normal(size=(30, 4))))
    momentum = rng.normal(size=(30, 3))
    here = sadov_variables(MOMENTS, andoyer_variables(attitude, momentum))
    turn = serret_andoyer_metric(MOMENTS[order]).andoyer_axes.T
    there = sadov_variables(MOMENTS[order], andoyer_variables(attitude @ turn, momentum @ turn))
    for name in ("own", "precession", "node"):
        assert np.abs(so3.wrap(getattr(there, name) - getattr(here, name))).max() < 1e-12
    for name in ("action", "total", "vertical", "own_rate", "precession_rate"):
        np.testing.assert_allclose(getattr(there, name), getattr(here, name), rtol=1e-13)


def test_refusals_say_what_is_wrong():
    for word, call in (
        ("different", lambda: serret_andoyer_metric([2.0, 2.0, 1.0])),
        ("different", lambda: serret_andoyer_metric([1.0, 2.0, 1.0])),
        ("positive", lambda: serret_andoyer_metric([2.0, 1.0, 0.0])),
        ("equator", lambda: METRIC.geodesics([1.0, 1.74])),
        ("broadcast", lambda: METRIC.geodesics([1.0, 1.1]).theta([1.0, 2.0, 3.0])),
        ("p_y", lambda: METRIC.energy([1.0, 1.1], 1.0, [1.0, 2.0, 3.0])),
        ("phi", lambda: METRIC.potential([1.0, 1.1], [1.0, 2.0, 3.0])),
        ("order", lambda: METRIC.geodesics(1.6).conjugate_points(0)),
        ("order", lambda: METRIC.geodesics(1.6).conjugate_points(True)),
        ("phi", lambda: METRIC.geodesics(1.2).amplitude),
        ("oscillate", lambda: METRIC.geodesics(1.2).first_return_slope),
        ("zero", lambda: METRIC.geodesics_of([0.0, 0.0, 0.0])),
        ("1e100", lambda: METRIC.separatrix().jacobi_field(1e4)),
        ("p_theta", lambda: METRIC.geodesics(np.nan)),
    ):
        with pytest.raises(ShapeError, match=word):
            call()
