"""Surfaces of revolution against the raw equations integrated, mpmath's quadrature and differences of extremals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipj

from shapephase import elliptic
from shapephase.errors import AccuracyNotReached, ShapeError
from shapephase.rigid_body.geodesics import (
    assumptions,
    conjugate_height_rate,
    conjugate_locus,
    conjugate_points,
    conjugate_points_of_momentum,
    cut_locus,
    cut_time,
    ellipsoid,
    extremal,
    surface_of_metric,
    surface_of_stretch,
)
from support.independent import assert_within
from support.long_runs import full_but

ANDOYER = (1.0 / 3.0, 1.0 / 2.0, 1.0)
"""Inverse moments A < B < C of I = (3, 2, 1)."""


@dataclass(frozen=True)
class Case:
    """A metric d phi^2 + m d theta^2: m with two derivatives, the reach, and momenta of oscillating extremals."""

    metric: object
    reach: float
    momenta: tuple[float, ...]

    def surface(self):
        return surface_of_metric(lambda phi: self.metric(phi)[:2], self.reach)


def andoyer_metric(phi):
    a, b, c = ANDOYER
    alpha, m1 = np.sqrt(c - a), (c - b) / (c - a)
    sn, cn, dn, _ = ellipj(alpha * phi, 1.0 - m1)
    w = a * cn**2 + b * sn**2
    first = 2.0 * alpha * (b - a) * sn * cn * dn
    second = 2.0 * alpha**2 * (b - a) * ((cn**2 - sn**2) * dn**2 - (1.0 - m1) * sn**2 * cn**2)
    return 1.0 / w, -first / w**2, 2.0 * first**2 / w**3 - second / w**2


def torus_metric(phi):
    r = 2.0 + np.cos(phi)
    return r**2, -2.0 * np.sin(phi) * r, 2.0 * np.sin(phi) ** 2 - 2.0 * np.cos(phi) * r


def pseudosphere_like(phi):
    square = 1.0 / np.cosh(phi) ** 2
    tanh = np.tanh(phi)
    return square, -2.0 * tanh * square, square * (4.0 * tanh**2 - 2.0 * square)


def bulged_sphere(phi):
    """sqrt(m) = cos(phi) + sin^2(phi) cos^3(phi)/10: a smooth sphere whose curvature is least on the equator."""
    s, c = np.sin(phi), np.cos(phi)
    r = c + 0.1 * s**2 * c**3
    r1 = -s + 0.1 * (2.0 * s * c**4 - 3.0 * s**3 * c**2)
    r2 = -c + 0.1 * (2.0 * c**5 - 17.0 * s**2 * c**3 + 6.0 * s**4 * c)
    return r**2, 2.0 * r * r1, 2.0 * (r1**2 + r * r2)


CASES = {
    "andoyer": Case(andoyer_metric, float(elliptic.complete_k(3.0 / 4.0)) / np.sqrt(2.0 / 3.0), (1.45, 1.6, 1.72)),
    "torus": Case(torus_metric, np.pi, (1.2, 2.0, 2.9)),
    "boundary": Case(pseudosphere_like, 2.0, (0.3, 0.6, 0.97)),
    "bulged": Case(bulged_sphere, np.pi / 2, (0.1, 0.5, 0.95)),
}


@pytest.fixture(params=CASES, scope="module")
def case(request):
    return CASES[request.param]


def hamiltonian_flow(metric, p, start, times, slope):
    """phi, theta, p_phi and their derivatives by the initial momentum along the level set, from the raw equations."""

    def rate(_, z):
        phi, _, p_phi, d_phi, _, d_p, d_pt = z
        m, m1, m2 = (float(a) for a in metric(np.asarray(phi)))
        return [
            p_phi,
            p / m,
            0.5 * p * p * m1 / m**2,
            d_p,
            d_pt / m - p * m1 / m**2 * d_phi,
            p * d_pt * m1 / m**2 + 0.5 * p * p * (m2 / m**2 - 2.0 * m1**2 / m**3) * d_phi,
            0.0,
        ]

    first = [start, 0.0, slope, 0.0, 0.0, -p / (float(metric(np.asarray(start))[0]) * slope), 1.0]
    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
    solution = solve_ivp(rate, (0.0, times[-1]), first, t_eval=times, **options)
    return solution.y


def unit_slope(metric, p, start):
    return np.sqrt(1.0 - p * p / float(metric(np.asarray(start))[0]))


def unit_ellipsoid_stretch(aspect):
    f = 1.0 - aspect**2

    def stretch(square, _):
        d = np.sqrt(aspect**2 + f * square)
        return d, 0.5 * f / d, -0.25 * f * f / d**3

    return stretch


def test_extremals_solve_hamiltons_equations_o1(case):
    surface = case.surface()
    for p in case.momenta:
        times = np.linspace(0.3, 1.7 * float(surface.period(p)), 13)
        raw = hamiltonian_flow(case.metric, p, 0.0, times, unit_slope(case.metric, p, 0.0))
        latitude, longitude, slope = extremal(surface, surface.direction_of(p)).state(times)
        assert_within(latitude, raw[0], 2e-11)
        assert_within(longitude, raw[1], 2e-11)
        assert_within(slope, raw[2], 2e-11)


def test_extremals_from_any_latitude_in_any_direction_o1(case):
    surface = case.surface()
    start = 0.3 * case.reach
    m = float(case.metric(np.asarray(start))[0])
    widest = np.arccos(np.sqrt(max(float(case.metric(np.asarray(case.reach))[0]), 0.0) / m)) - 0.05
    times = np.linspace(0.2, 4.0, 9)
    for angle in (0.7 * widest, -0.6 * widest, np.pi - 0.5 * widest, np.pi + 0.8 * widest):
        p = np.sqrt(m) * np.cos(angle)
        raw = hamiltonian_flow(case.metric, p, start, times, np.sin(angle))
        path = extremal(surface, angle, start)
        latitude, longitude, slope = path.state(times)
        assert_within(np.stack([latitude, longitude, slope]), raw[:3], 5e-12)
        d_phi, d_theta = path.direction_derivative(times)
        scale = -np.sqrt(m) * np.sin(angle)
        assert_within(np.stack([d_phi, d_theta]) / scale, raw[3:5], 3e-10)


def test_clairaut_parallels_and_meridians_o2(case):
    surface = case.surface()
    p = np.array(case.momenta)
    times = np.linspace(0.0, 5.0, 21)
    path = extremal(surface, surface.direction_of(p))
    latitude, longitude, slope = path.state(times)
    # m theta' = p: the angle to the parallels times the radius is kept.
    np.testing.assert_allclose(surface.metric(latitude) * (1.0 - slope**2), (p**2)[:, None] + 0 * times, rtol=2e-13)
    rate = 1e-4
    _, ahead, _ = path.state(times + rate)
    _, behind, _ = path.state(times - rate)
    # An extremal may start 1e-4 before the start: time runs both ways.
    np.testing.assert_allclose((ahead - behind) / (2 * rate) * surface.metric(latitude) / p[:, None], 1.0, atol=3e-7)
    equator = extremal(surface, 0.0).state(times)
    np.testing.assert_allclose(equator[0], 0.0, atol=1e-300)
    np.testing.assert_allclose(equator[1], times / surface.greatest_momentum, rtol=1e-14)
    assert longitude.shape == (len(p), len(times))


def test_a_meridian_runs_over_both_poles_o2():
    surface = ellipsoid(0.7)
    times = np.linspace(0.1, 0.9, 5) * float(surface.period(0.0))
    latitude, longitude, _ = extremal(surface, 0.5 * np.pi).state(times)
    quarter = float(surface.period(0.0)) / 4.0
    expected = np.array([t if t < quarter else 2 * quarter - t if t < 3 * quarter else t - 4 * quarter for t in times])
    np.testing.assert_allclose(latitude, expected, atol=1e-14)
    np.testing.assert_allclose(longitude, np.pi * np.round(times / (2 * quarter)), atol=1e-14)


def test_potential_and_turning_points_o3(case):
    surface = case.surface()
    for p in case.momenta:
        top = brentq(lambda x, p=p: float(case.metric(np.asarray(x))[0]) - p * p, 0.0, case.reach, xtol=1e-15)
        turning, _, slope = extremal(surface, surface.direction_of(p)).state(float(surface.period(p)) / 4.0)
        assert abs(float(turning) - top) < 2e-13
        assert abs(float(slope)) < 1e-12
        assert float(surface.potential(turning, p)) == pytest.approx(1.0, abs=1e-13)
        assert float(surface.potential(0.4 * top, p)) == pytest.approx(
            p * p / float(case.metric(np.asarray(0.4 * top))[0]), rel=1e-13
        )


def test_assumptions_are_checked_o4(case):
    found = assumptions(lambda x: case.metric(x)[:2], case.reach)
    assert found.equator_is_parallel
    assert found.is_symmetric
    assert found.falls_to_reach
    curvature = curvature_of(case.metric, case.reach * np.linspace(0, 0.999, 400))
    greatest = bool((curvature[1:] < curvature[0]).all() and curvature[0] > 0)
    assert case.surface().is_greatest_curvature_on_equator() == greatest


def test_metrics_that_break_an_assumption_are_refused_o4():
    tilted = assumptions(lambda x: (np.cos(x - 0.1) ** 2, -np.sin(2 * x - 0.2)), 1.0)
    assert not tilted.equator_is_parallel
    assert not tilted.is_symmetric
    for word, call in (
        ("A1", lambda: surface_of_metric(lambda x: (np.cos(x - 0.1) ** 2, -np.sin(2 * x - 0.2)), 1.0)),
        (
            "A2",
            lambda: surface_of_metric(
                lambda x: (np.exp(-(x**2) - x**3 / 9), -(2 * x + x**2 / 3) * np.exp(-(x**2) - x**3 / 9)), 1.0
            ),
        ),
        ("fall", lambda: surface_of_metric(lambda x: torus_metric(x)[:2], 4.0)),
        ("derivative", lambda: surface_of_metric(lambda x: (np.cos(x) ** 2, -1.01 * np.sin(2 * x)), 1.0)),
        ("reach", lambda: surface_of_metric(lambda x: torus_metric(x)[:2], -1.0)),
        ("finite", lambda: surface_of_metric(lambda x: (np.cos(x) ** 2, np.full_like(x, np.nan)), 1.0)),
        ("positive", lambda: surface_of_metric(lambda x: (np.cos(x) ** 2 - 0.5, -np.sin(2 * x)), 1.0)),
    ):
        with pytest.raises(ShapeError, match=word):
            call()
    with pytest.raises(AccuracyNotReached):
        surface_of_metric(lambda x: (1 - x**2 + np.abs(x) ** 3 / 9, -2 * x + x * np.abs(x) / 3), 0.8)


def test_poincare_field_and_homogeneity_o5(case):
    surface = case.surface()
    p = case.momenta[1]
    times = np.array([0.7, 2.9])
    path = extremal(surface, surface.direction_of(p))
    by_phi, by_theta = path.poincare_field(times)
    _, _, slope = path.state(times)
    # alpha(J_2) = t 2H = t, alpha(J_1) = 0.
    np.testing.assert_allclose(slope * by_phi + p * by_theta, times, rtol=1e-13)
    # q(t, lambda p) = q(lambda t, p): the derivative by lambda.
    h = 1e-5
    ahead, behind = path.state(times * (1 + h)), path.state(times * (1 - h))
    np.testing.assert_allclose(by_phi, (ahead[0] - behind[0]) / (2 * h), atol=1e-8)
    np.testing.assert_allclose(by_theta, (ahead[1] - behind[1]) / (2 * h), atol=1e-8)


def test_vertical_field_is_normal_to_the_extremal_o6(case):
    surface = case.surface()
    for p in case.momenta:
        path = extremal(surface, surface.direction_of(p))
        times = np.linspace(0.1, 7.0, 15)
        _, _, slope = path.state(times)
        d_phi, d_theta = path.direction_derivative(times)
        np.testing.assert_allclose(slope * d_phi + p * d_theta, 0.0, atol=1e-13 * np.abs(d_phi).max())


def test_no_conjugate_time_before_the_turning_point_o7(case):
    surface = case.surface()
    p = np.array(case.momenta)
    fraction = np.linspace(0.01, 1.0, 30)
    for one in p:
        times = fraction * float(surface.period(one)) / 4.0
        assert (extremal(surface, surface.direction_of(one)).jacobi_field(times) > 0.0).all()
    assert (conjugate_points_of_momentum(surface, p).time > surface.period(p) / 4.0).all()


def test_period_and_first_return_against_quadrature_o8(case):
    surface = case.surface()
    for p in case.momenta:
        top = brentq(lambda x, p=p: float(case.metric(np.asarray(x))[0]) - p * p, 0.0, case.reach, xtol=1e-15)

        def weight(u, p=p, top=top):
            phi = top * (1.0 - u * u)
            m = float(case.metric(np.asarray(phi))[0])
            return phi, m, 2.0 * top * u * np.sqrt(m / (m - p * p))

        options = {"epsabs": 1e-12, "epsrel": 1e-12, "limit": 200}
        period = 4.0 * quad(lambda u, w=weight: w(u)[2], 1e-5, 1.0, **options)[0]
        turn = 2.0 * quad(lambda u, w=weight, p=p: p / w(u)[1] * w(u)[2], 1e-5, 1.0, **options)[0]
        rest = weight(1e-5)
        assert float(surface.period(p)) == pytest.approx(period + 4e-5 * rest[2], rel=1e-8)
        assert float(surface.first_return(p)) == pytest.approx(turn + 2e-5 * p / rest[1] * rest[2], rel=1e-8)
        times = np.array([0.5, 1.0]) * float(surface.period(p))
        raw = hamiltonian_flow(case.metric, p, 0.0, times, unit_slope(case.metric, p, 0.0))
        np.testing.assert_allclose(raw[0], 0.0, atol=2e-11)
        np.testing.assert_allclose(raw[1], float(surface.first_return(p)) * np.array([1.0, 2.0]), rtol=1e-11)


def test_the_stretch_of_the_andoyer_metric_in_closed_form_gives_the_same_o8():
    a, b, c = ANDOYER

    def stretch(square, rest):
        u, v = b * rest, c - a - c * square
        d = np.sqrt(a / (u * v))
        first = 0.5 * d * (b / u + c / v)
        return d, first, 0.5 * first * (b / u + c / v) + 0.5 * d * (b * b / u**2 + c * c / v**2)

    closed = surface_of_stretch(stretch, 1.0 / a, 1.0 - a / b, "parallel")
    table = CASES["andoyer"].surface()
    for surface in (closed, table):
        assert float(surface.curvature(surface.reach)) == pytest.approx(-1 / 6, abs=1e-9)
    p = np.sqrt(3.0 - np.array([1e-12, 1e-4, 0.1, 0.5, 0.9, 0.99, 0.99999]))
    for name in ("period", "first_return"):
        np.testing.assert_allclose(getattr(table, name)(p), getattr(closed, name)(p), rtol=1e-11)
    np.testing.assert_allclose(table.first_return_rate(p), closed.first_return_rate(p), rtol=1e-9)
    np.testing.assert_allclose(table.first_return_second_rate(p), closed.first_return_second_rate(p), rtol=1e-7)


def test_tame_flows_and_proposition_2_o9(case):
    surface = case.surface()
    kinds = {"andoyer": "decreasing", "torus": "decreasing", "boundary": "decreasing", "bulged": "neither"}
    name = next(n for n, c in CASES.items() if c is case)
    assert surface.tameness() == kinds[name]
    p = np.array(case.momenta)
    half = surface.period(p) / 2.0
    tame = surface.first_return(p + 1e-6) < surface.first_return(p - 1e-6)
    np.testing.assert_array_equal(conjugate_points_of_momentum(surface, p).time > half, tame)
    for one in p[tame]:
        inside = float(surface.period(one)) / 2.0 * np.linspace(0.01, 0.999, 50)
        assert (extremal(surface, surface.direction_of(one)).jacobi_field(inside) > 0.0).all()


def curvature_of(metric, phi):
    m, m1, m2 = metric(np.asarray(phi))
    return (m1**2 - 2.0 * m * m2) / (4.0 * m**2)


def test_gauss_curvature_of_surfaces_o10(case):
    surface = case.surface()
    phi = case.reach * np.array([0.0, 1e-3, 0.1, -0.4, 0.7, 0.9])
    assert_within(surface.curvature(phi), curvature_of(case.metric, phi), 2e-11)


def test_first_conjugate_point_of_the_equator_is_a_cusp_o11(case):
    surface = case.surface()
    curvature = float(curvature_of(case.metric, 0.0))
    times = [float(conjugate_points(surface, 0.0, i).time) for i in (1, 2, 3)]
    np.testing.assert_allclose(times, np.pi / np.sqrt(curvature) * np.array([1, 2, 3]), rtol=1e-12)
    angles = np.linspace(-0.3, 0.3, 61)
    points = conjugate_points(surface, angles)
    # A cusp: the locus goes as (angle^2, angle^3) there.
    step = 0.01
    near = conjugate_points(surface, step * np.array([1.0, 2.0]))
    tip = float(conjugate_points(surface, 0.0).longitude)
    assert (near.longitude[1] - tip) / (near.longitude[0] - tip) == pytest.approx(4.0, rel=0.02)
    assert near.latitude[1] / near.latitude[0] == pytest.approx(8.0, rel=0.02)
    if surface.is_greatest_curvature_on_equator():
        assert points.time.argmin() == 30


def test_the_injectivity_radius_is_the_first_conjugate_time_on_the_equator_o11():
    for aspect in (0.3, 0.9):
        times = cut_time(ellipsoid(aspect), np.linspace(-np.pi / 2, np.pi / 2, 101))
        assert times.argmin() == 50
        # G = 1/epsilon^2 on the equator.
        assert times.min() == pytest.approx(np.pi * aspect, abs=1e-14)


@pytest.mark.parametrize("case", full_but(CASES, "andoyer", "torus"), indirect=True)
def test_general_points_and_orders_against_the_raw_equations_o12(case):
    surface = case.surface()
    start = 0.35 * case.reach
    m = float(case.metric(np.asarray(start))[0])
    end = max(float(case.metric(np.asarray(case.reach))[0]), 0.0)
    widest = np.arccos(np.sqrt(end / m))
    for fraction, order in ((0.6, 1), (-0.5, 1), (0.8, 2), (-0.3, 3)):
        angle = fraction * widest
        time = float(conjugate_points(surface, angle, order, start).time)
        p = np.sqrt(m) * np.cos(angle)
        normal = hamiltonian_flow(case.metric, p, start, np.linspace(time / 40, time - 1e-6, 200), np.sin(angle))
        # The sign of the field normal to the extremal: that of d phi/p, as d theta = -p_phi d phi/p.
        assert np.count_nonzero(np.diff(np.sign(normal[3]))) == order - 1

        def raw(t, p=p, angle=angle):
            return hamiltonian_flow(case.metric, p, start, [t], np.sin(angle))[3][0]

        assert brentq(raw, time - 0.01, time + 0.01, xtol=1e-13) == pytest.approx(time, abs=1e-10)


def test_from_a_turning_point_the_next_turning_points_are_conjugate_o12(case):
    surface = case.surface()
    latitude = 0.4 * case.reach
    p = float(surface.momentum_of(0.0, latitude))
    for order in (1, 2):
        point = conjugate_points(surface, 0.0, order, latitude)
        assert float(point.time) == pytest.approx(order * float(surface.period(p)) / 2, rel=1e-12)
        assert float(point.longitude) == pytest.approx(order * float(surface.first_return(p)), rel=1e-12)
        assert float(point.latitude) == pytest.approx((-1) ** order * latitude, abs=1e-12)


def test_derivative_of_the_conjugate_latitude_o13(case):
    """phi_1c' = (R'' + integral of f_pp)/f_p, each by itself."""
    surface = case.surface()
    h = 1e-4
    for p in case.momenta[:2]:
        phi = float(conjugate_points_of_momentum(surface, p).latitude)
        m = float(case.metric(np.asarray(phi))[0])
        f_p = np.sqrt(m) / (m - p * p) ** 1.5
        values = conjugate_points_of_momentum(surface, p + h * np.array([-2, -1, 1, 2])).latitude
        slope = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * h)

        def f_pp(x, p=p):
            m = float(case.metric(np.asarray(x))[0])
            return 3.0 * p * np.sqrt(m) / (m - p * p) ** 2.5

        combined = float(surface.first_return_second_rate(p)) + quad(f_pp, phi, 0.0, epsabs=1e-12, epsrel=1e-12)[0]
        assert float(conjugate_height_rate(surface, p)) == pytest.approx(combined, rel=1e-8)
        assert slope * f_p == pytest.approx(combined, rel=1e-6)
        second = float(conjugate_points_of_momentum(surface, p, 2).latitude)
        combined = 2.0 * float(surface.first_return_second_rate(p)) + quad(f_pp, 0.0, second, epsrel=1e-12)[0]
        assert float(conjugate_height_rate(surface, p, 2)) == pytest.approx(combined, rel=1e-8)


def test_proposition_3_no_cusp_on_a_branch_where_the_first_return_is_convex_o13():
    surface = CASES["andoyer"].surface()
    p = np.sqrt(np.linspace(2.01, 2.999, 200))
    assert (surface.first_return_second_rate(p) > 0.0).all()
    assert (conjugate_height_rate(surface, p) > 0.0).all()
    assert (np.diff(conjugate_points_of_momentum(surface, p).latitude) > 0.0).all()
    locus = conjugate_locus(surface, 200)
    np.testing.assert_allclose(np.mod(locus.cusp_directions + 0.1, np.pi), 0.1, atol=1e-12)
    assert locus.cusps == 2


def test_rates_of_the_first_return_and_of_the_period_o14(case):
    surface = case.surface()
    p = np.array(case.momenta)
    h = 2e-3
    for values, rate in (
        (surface.period, 2.0 * p * surface.first_return_rate(p)),
        (surface.first_return, surface.first_return_rate(p)),
        (surface.first_return_rate, surface.first_return_second_rate(p)),
        (surface.period_rate, surface.period_second_rate(p)),
    ):
        # Richardson's sixth-order difference.
        around = {k: values(p + k * h) for k in (-3, -2, -1, 1, 2, 3)}
        slope = (45 * (around[1] - around[-1]) - 9 * (around[2] - around[-2]) + around[3] - around[-3]) / (60 * h)
        np.testing.assert_allclose(slope, rate, rtol=2e-5, atol=1e-9)


def reversals(surface, order, latitude):
    points = conjugate_points(surface, 2.0 * np.pi * (np.arange(360) + 0.3) / 360, order, latitude)
    step = np.stack([np.roll(points.latitude, -1) - points.latitude, np.roll(points.longitude, -1) - points.longitude])
    step[1] = (step[1] + np.pi) % (2 * np.pi) - np.pi
    return np.count_nonzero(np.sum(step * np.roll(step, 1, axis=1), axis=0) < 0.0)


@pytest.mark.parametrize("aspect", [0.6, 0.9, 1.3])
@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("latitude", [0.0, 0.4])
def test_four_cusps_of_every_caustic_o15(aspect, order, latitude):
    surface = ellipsoid(aspect)
    locus = conjugate_locus(surface, 360, order, latitude)
    assert locus.cusps == 4
    # The same by the locus itself: the velocity of the point reverses four times. No direction is along an axis.
    assert reversals(surface, order, latitude) == 4


@pytest.mark.parametrize("latitude", [0.0, -0.3])
def test_the_sampled_locus_is_that_of_its_directions_o15(case, latitude):
    surface = case.surface()
    locus = conjugate_locus(surface, 24, 2, latitude)
    assert (np.diff(locus.points.direction) > 0.0).all()
    points = conjugate_points(surface, locus.points.direction, 2, latitude)
    for name, values in vars(points).items():
        np.testing.assert_allclose(getattr(locus.points, name), values, rtol=0, atol=1e-10, err_msg=name)
    rate = conjugate_locus(surface, locus.points.direction, 2, latitude).time_rate
    np.testing.assert_allclose(locus.time_rate, rate, rtol=1e-7, atol=1e-8)


def test_eight_cusps_where_the_curvature_is_not_monotone_and_the_rate_of_the_time_o15():
    surface = CASES["bulged"].surface()
    angles = np.array([-2.6, -1.1, 0.3, 1.0, 2.2])
    assert conjugate_locus(surface, 200).cusps == reversals(surface, 1, 0.0) == 8
    for latitude in (0.0, 0.3):
        for order in (1, 2):
            h = 1e-3
            times = {k: conjugate_points(surface, angles + k * h, order, latitude).time for k in (-2, -1, 1, 2)}
            slope = (times[-2] - 8 * times[-1] + 8 * times[1] - times[2]) / (12 * h)
            rate = conjugate_locus(surface, angles, order, latitude).time_rate
            assert_within(rate, slope, 1e-9)


def test_cut_locus_is_an_arc_of_the_opposite_parallel_or_meridian_o16():
    oblate, prolate, sphere = ellipsoid(0.7), ellipsoid(1.4), ellipsoid(1.0)
    for latitude in (0.0, 0.5):
        arc = cut_locus(oblate, latitude)
        assert arc.kind == "parallel"
        assert arc.latitudes == (-latitude, -latitude)
        p = float(oblate.momentum_of(0.0, latitude))
        np.testing.assert_allclose(
            arc.longitudes, np.pi + np.array([-1, 1]) * (np.pi - oblate.first_return(p)), atol=1e-12
        )
        arc = cut_locus(prolate, latitude)
        assert arc.kind == "meridian"
        assert arc.longitudes == (np.pi, np.pi)
    assert cut_locus(oblate).longitudes[0] == pytest.approx(0.7 * np.pi, abs=1e-13)
    assert cut_locus(sphere, 0.3).kind == "point"
    assert cut_time(sphere, 0.7) == pytest.approx(np.pi, abs=1e-13)
    with pytest.raises(ShapeError, match="smooth"):
        cut_locus(CASES["torus"].surface())
    with pytest.raises(ShapeError, match="poles"):
        cut_locus(oblate, oblate.reach)


def orbital_transfer_metric(latitude):
    """cos^2/(1 - 4/5 cos^2) of the latitude, and its derivative."""
    square = np.cos(latitude) ** 2
    room = 1.0 - 0.8 * square
    return square / room, -np.sin(2.0 * latitude) / room**2


def test_where_only_the_first_return_falls_the_cut_locus_is_an_arc_of_the_parallel_o16():
    """Orbital transfer (Bonnard, Caillau, Sinclair, Tanaka 2009): p^2/m = p^2/cos^2 - 4 p^2/5, so all is a sphere's."""
    surface = surface_of_metric(orbital_transfer_metric, 0.5 * np.pi)
    assert (surface.curvature_trend(), surface.tameness()) == ("neither", "decreasing")
    p = np.array([0.3, 1.0, 2.0, 2.2])
    root = np.sqrt(1.0 + 0.8 * p**2)
    assert_within(surface.period(p), 2.0 * np.pi / root, 1e-13)
    assert_within(surface.first_return(p), np.pi * (1.0 - 0.8 * p / root), 1e-13)
    assert_within(cut_locus(surface).longitudes, (0.2 * np.pi, 1.8 * np.pi), 1e-13)
    latitude, angle = 0.3, 0.6
    largest = np.sqrt(orbital_transfer_metric(latitude)[0])
    end = np.pi * (1.0 - 0.8 * largest / np.sqrt(1.0 + 0.8 * largest**2))
    arc = cut_locus(surface, latitude)
    assert (arc.kind, arc.latitudes) == ("parallel", (-latitude, -latitude))
    assert_within(arc.longitudes, (end, 2.0 * np.pi - end), 1e-12)
    time = float(cut_time(surface, angle, latitude))
    there, mirrored = (np.array(extremal(surface, sign * angle, latitude).state(time)[:2]) for sign in (1.0, -1.0))
    assert_within(there, mirrored, 1e-11)
    # None of the points that are nearer is the end.
    near = extremal(surface, np.linspace(-np.pi, np.pi, 1441), latitude).state(0.98 * time)
    across = 2.0 * np.sqrt(surface.metric(there[0])) * np.sin(0.5 * (near[1] - there[1]))
    assert np.hypot(near[0] - there[0], across).min() > 0.015 * time


@pytest.mark.parametrize("aspect", [0.7, 1.4])
def test_at_the_cut_time_the_mirror_image_arrives_and_no_shorter_way_exists_o16(aspect):
    surface = ellipsoid(aspect)
    latitude = 0.3
    angles = np.array([0.2, 0.9, 1.4, -0.5, 2.1])
    times = cut_time(surface, angles, latitude)
    assert (times <= conjugate_points(surface, angles, 1, latitude).time + 1e-12).all()
    fan = np.linspace(-np.pi, np.pi, 1441)
    paths = extremal(surface, fan, latitude)
    for angle, time in zip(angles, times):
        end = [float(a) for a in extremal(surface, angle, latitude).state(time)]
        mirror = np.pi - angle if aspect > 1 else -angle
        other = [float(a) for a in extremal(surface, mirror, latitude).state(time)]
        assert other[0] == pytest.approx(end[0], abs=1e-11)
        assert np.cos(other[1] - end[1]) == pytest.approx(1.0, abs=1e-11)
        # The sphere of radius slightly less: none of its points is the end, as that is farther.
        shorter = paths.state(0.98 * time)
        distance = np.hypot(
            shorter[0] - end[0], np.sin(0.5 * (shorter[1] - end[1])) * 2 * np.sqrt(surface.metric(end[0]))
        )
        assert distance.min() > 0.015 * time


def test_cut_times_end_in_the_conjugate_time_at_the_ends_of_the_arc_o16():
    for aspect, tips in ((0.7, (0.0, np.pi)), (1.4, (0.5 * np.pi, -0.5 * np.pi))):
        surface = ellipsoid(aspect)
        np.testing.assert_allclose(
            cut_time(surface, np.array(tips), 0.2), conjugate_points(surface, np.array(tips), 1, 0.2).time, atol=1e-11
        )
        near = cut_time(surface, np.array(tips) + 1e-4, 0.2)
        np.testing.assert_allclose(near, cut_time(surface, np.array(tips), 0.2), atol=1e-6)


def test_momenta_and_directions_out_of_range_are_refused():
    torus = CASES["torus"].surface()
    for bad in (3.1, 1.0 + 1e-10, 1.0, 0.5, -0.9, np.nan):
        with pytest.raises(ShapeError, match="momentum"):
            torus.period(bad)
    for word, call in (
        ("momentum", lambda: extremal(torus, 1.5)),
        ("order", lambda: conjugate_points(torus, 0.3, 0)),
        ("infinite", lambda: conjugate_height_rate(torus, 3.0)),
        ("ascending", lambda: conjugate_locus(torus, [0.3, 0.2])),
        ("latitude", lambda: torus.height(3.2)),
        ("height", lambda: torus.latitude(1.0)),
        ("8", lambda: conjugate_locus(torus, 4)),
        ("end", lambda: surface_of_stretch(unit_ellipsoid_stretch(0.5), 1.0, 1.0, "edge")),
        ("depth", lambda: surface_of_stretch(unit_ellipsoid_stretch(0.5), 1.0, 0.9)),
        ("stretch", lambda: surface_of_stretch(lambda y, _: (y - 0.5, 0 * y + 1, 0 * y), 1.0, 1.0)),
    ):
        with pytest.raises(ShapeError, match=word):
            call()
    cone = surface_of_stretch(unit_ellipsoid_stretch(0.5), 2.0, 1.0)
    assert not cone.has_smooth_poles
    with pytest.raises(ShapeError, match="tip"):
        cone.period(0.0)


def test_results_are_odd_and_even_as_they_should_be():
    torus = CASES["torus"].surface()
    p = np.array([[1.5, -1.5], [2.0, -2.0]])
    assert torus.first_return(p).shape == (2, 2)
    np.testing.assert_array_equal(torus.first_return(p)[:, 0], -torus.first_return(p)[:, 1])
    np.testing.assert_array_equal(torus.period(p)[:, 0], torus.period(p)[:, 1])
    points = conjugate_points(torus, np.array([0.4, -0.4, np.pi - 0.4, np.pi + 0.4]), 1)
    np.testing.assert_allclose(points.latitude, points.latitude[0] * np.array([1, -1, 1, -1]), atol=1e-13)
    np.testing.assert_allclose(points.longitude, points.longitude[0] * np.array([1, 1, -1, -1]), atol=1e-13)
