"""Ellipsoids of revolution: printed reference values, mpmath's quadrature, GeographicLib, the raw equations."""

from __future__ import annotations

from functools import partial
from itertools import product

import mpmath as mp
import numpy as np
import pytest
from geographiclib.geodesic import Geodesic
from scipy.optimize import brentq

from shapephase.errors import ShapeError
from shapephase.rigid_body.geodesics import (
    astroid,
    conjugate_height_rate,
    conjugate_locus,
    conjugate_points,
    conjugate_points_of_momentum,
    cut_time,
    ellipsoid,
    extremal,
    surface_of_metric,
)
from support.independent import assert_within
from support.long_runs import full_but

ASPECTS = [0.02, 0.5, 0.6, 0.99, 1.0, 1.5, 20.0]


def by_coefficients(aspect, radius=1.0, across=1.0):
    """The same surface from F_1 and F_2 alone, psi counted from the equator; its parallels stretched by `across`."""
    return surface_of_metric(
        lambda psi: ((across * radius * np.cos(psi)) ** 2, -((across * radius) ** 2) * np.sin(2.0 * psi)),
        np.pi / 2,
        lambda psi: radius**2 * (np.sin(psi) ** 2 + aspect**2 * np.cos(psi) ** 2),
    )


def integrals(aspect, p):
    """T and R by mpmath's quadrature of dt and d theta over the phase: raw, from ds^2 in the parametric latitude."""
    p, aspect = mp.mpf(p), mp.mpf(aspect)
    q = 1 - p * p

    def speed(chi):
        sine2 = q * mp.sin(chi) ** 2
        return mp.sqrt(sine2 + aspect**2 * (1 - sine2))

    def turn(chi):
        # d theta = p dt/cos^2(psi), cos^2(psi) = cos^2(chi) + p^2 sin^2(chi).
        return p * speed(chi) / (mp.cos(chi) ** 2 + p * p * mp.sin(chi) ** 2)

    places = [0, mp.pi / 4, mp.pi / 2 - p / 2, mp.pi / 2] if p < 1 else [0, mp.pi / 2]
    return 4 * mp.quad(speed, places), 2 * mp.quad(turn, places)


def test_the_polar_form_p1():
    """Lengths of the meridian to parametric latitudes, by the elliptic integral of 30 digits."""
    for aspect in ASPECTS:
        surface, latitude = ellipsoid(aspect), np.array([-np.pi / 2, -0.9, 0.0, 0.4, np.pi / 2])
        with mp.workdps(30):
            exact = [float(aspect * mp.ellipe(mp.mpf(psi), 1 - 1 / mp.mpf(aspect) ** 2)) for psi in latitude]
        assert_within(surface.latitude(np.sin(latitude)), exact, 2e-13 * max(1.0, aspect))
        assert_within(surface.metric(exact[1:4]), np.cos(latitude[1:4]) ** 2, 1e-12)


def test_the_surface_of_the_coefficients_alone_is_the_same_p1():
    p = np.array([1e-3, 0.01, 0.3, 0.6, 0.9, 1.0])
    for aspect in (0.1, 0.6, 1.5, 6.0):
        closed, found = ellipsoid(aspect), by_coefficients(aspect)
        assert found.has_smooth_poles
        np.testing.assert_allclose(found.period(p), closed.period(p), rtol=1e-13)
        np.testing.assert_allclose(found.first_return(p), closed.first_return(p), rtol=1e-13)
        np.testing.assert_allclose(found.first_return_rate(p), closed.first_return_rate(p), rtol=1e-10)
        one, other = (conjugate_locus(s, 50, 2, 0.1) for s in (closed, found))
        assert_within(other.points.latitude, one.points.latitude, 1e-11)
        assert_within(other.points.longitude, one.points.longitude, 1e-11)
        np.testing.assert_allclose(other.points.time, one.points.time, rtol=1e-11)


def test_any_radius_and_poles_that_are_tips_p1():
    p = np.array([0.01, 0.3, 0.9])
    closed, found = ellipsoid(0.6, 2.5), by_coefficients(0.6, 2.5)
    np.testing.assert_allclose(found.first_return(2.5 * p), closed.first_return(2.5 * p), rtol=1e-13)
    np.testing.assert_allclose(found.period(2.5 * p), closed.period(2.5 * p), rtol=1e-13)
    # Parallels three times as long are the same surface with a third of the longitude.
    tipped, unit = by_coefficients(0.6, 1.0, 3.0), ellipsoid(0.6)
    assert not tipped.has_smooth_poles
    np.testing.assert_allclose(tipped.first_return(3.0 * p), unit.first_return(p) / 3.0, rtol=1e-13)
    locus = conjugate_locus(tipped, 40)
    assert locus.cusps == 2
    np.testing.assert_allclose(locus.points.time, conjugate_points(unit, locus.points.direction).time, rtol=1e-11)


def exact_period(aspect, momentum):
    alpha2 = mp.mpf(aspect) ** 2 + (1 - mp.mpf(momentum) ** 2) * (1 - mp.mpf(aspect) ** 2)
    return 4 * mp.sqrt(alpha2) * mp.ellipe(1 - mp.mpf(aspect) ** 2 / alpha2)


def test_period_in_closed_form_p2():
    p = np.array([0.0, 0.1, 0.5, 0.99, 1.0])
    for aspect in ASPECTS:
        with mp.workdps(30):
            for one, value in zip(p, ellipsoid(aspect).period(p)):
                assert float(value) == pytest.approx(float(exact_period(aspect, one)), rel=3e-14)


@pytest.mark.parametrize("count", full_but([2, 4], 2))
def test_rates_against_mpmath_p2(count):
    """R' and R'' of the closed form, and R' = T'/(2p), by derivatives at 40 digits: to 1e-12."""
    rng = np.random.default_rng(41)
    with mp.workdps(40):
        for _ in range(count):
            aspect, p = float(np.exp(rng.uniform(-2.0, 1.5))), float(rng.uniform(0.02, 0.999))
            surface = ellipsoid(aspect)

            period = partial(exact_period, aspect)

            def turn_rate(momentum, period=period):
                return mp.diff(period, momentum) / (2 * momentum)

            by_turn = mp.diff(lambda q, aspect=aspect: integrals(aspect, q)[1], mp.mpf(p), h=mp.mpf(10) ** -12)
            assert float(by_turn) == pytest.approx(float(turn_rate(mp.mpf(p))), rel=1e-10)
            assert float(surface.first_return_rate(p)) == pytest.approx(float(turn_rate(mp.mpf(p))), rel=1e-12)
            second = mp.diff(turn_rate, mp.mpf(p), h=mp.mpf(10) ** -8)
            assert float(surface.first_return_second_rate(p)) == pytest.approx(float(second), rel=1e-10)
            period_second = mp.diff(period, mp.mpf(p), 2)
            assert float(surface.period_second_rate(p)) == pytest.approx(float(period_second), rel=1e-10)


def test_oblate_reference_values_p3():
    """theory.md section 6, to all printed digits."""
    half = ellipsoid(0.5)
    assert f"{float(half.first_return(1e-13)):.10f}" == f"{np.pi:.10f}"
    for p, value in ((0.3, 2.7344), (0.6, 2.2999), (0.9, 1.7855)):
        assert f"{float(half.first_return(p)):.4f}" == f"{value:.4f}"
    assert float(half.first_return(1.0)) == pytest.approx(np.pi / 2, abs=1e-14)
    table = {0.95: 0.07746, 0.8: 0.38194, 0.6: 0.65335, 0.4: 0.83038, 0.2: 0.93900, 0.1: 0.96719}
    points = conjugate_points_of_momentum(ellipsoid(0.6), list(table))
    for found, value in zip(np.abs(np.arcsin(points.height)), table.values()):
        assert f"{found:.5f}" == f"{value:.5f}"


def test_oblate_first_return_falls_from_pi_to_pi_epsilon_p3():
    for aspect in (0.02, 0.3, 0.6, 0.99):
        surface = ellipsoid(aspect)
        values = surface.first_return(np.linspace(0.0, 1.0, 101))
        assert values[0] == pytest.approx(np.pi, abs=1e-13)
        assert values[-1] == pytest.approx(np.pi * aspect, abs=1e-13)
        assert (np.diff(values) < 0.0).all()
        assert surface.tameness() == "decreasing"
        assert surface.is_greatest_curvature_on_equator()
        assert surface.curvature_trend() == "decreasing"
        assert float(surface.curvature(0.0)) == pytest.approx(aspect**-2, rel=1e-14)
        assert float(surface.curvature(surface.reach)) == pytest.approx(aspect**2, rel=1e-10)


def test_the_caustic_is_an_astroid_with_cusps_on_the_axes_p3():
    surface = ellipsoid(0.6)
    locus = conjugate_locus(surface, 400)
    assert locus.cusps == 4
    np.testing.assert_allclose(np.mod(locus.cusp_directions + 0.1, np.pi / 2), 0.1, atol=1e-12)
    tips = conjugate_points(surface, 0.5 * np.pi * np.arange(4))
    assert tips.longitude[0] == pytest.approx(0.6 * np.pi, abs=1e-14)
    np.testing.assert_allclose(np.mod(tips.longitude[[1, 3]], 2 * np.pi), np.pi, atol=1e-12)
    np.testing.assert_allclose(tips.latitude[[0, 2]], 0.0, atol=1e-15)
    # Nearly round ellipsoids: to first order in the flattening, with an error of second order.
    angles = np.linspace(0.05, 1.5, 20)
    errors = []
    for flattening in (1e-2, 1e-3):
        points = conjugate_points(ellipsoid(1.0 - flattening), angles)
        latitude, longitude = astroid(1.0 - flattening, angles)
        errors.append(np.abs([np.arcsin(points.height) - latitude, points.longitude - longitude]).max())
    assert errors[0] < 20e-4
    assert errors[0] / errors[1] == pytest.approx(100.0, rel=0.1)


def test_prolate_first_return_rises_from_pi_p4():
    surface = ellipsoid(1.5)
    assert f"{float(surface.first_return(0.3)):.4f}" == "3.6592"
    assert f"{float(surface.first_return(1.0)):.4f}" == "4.7124"
    for aspect in (1.01, 1.5, 20.0):
        surface = ellipsoid(aspect)
        values = surface.first_return(np.linspace(0.0, 1.0, 101))
        assert values[0] == pytest.approx(np.pi, abs=1e-13)
        assert values[-1] == pytest.approx(np.pi * aspect, rel=1e-14)
        assert (np.diff(values) > 0.0).all()
        assert surface.tameness() == "increasing"
        assert not surface.is_greatest_curvature_on_equator()
        first = conjugate_points_of_momentum(surface, np.linspace(0.05, 0.95, 10))
        assert (first.time < surface.period(first.momentum) / 2).all()
        assert (first.height > 0.0).all()


def test_the_round_sphere_has_one_period_and_one_conjugate_point_p5():
    surface = ellipsoid(1.0, 2.5)
    p = 2.5 * np.array([0.0, 0.2, 0.9, 1.0])
    np.testing.assert_allclose(surface.period(p), 5.0 * np.pi, rtol=1e-14)
    np.testing.assert_allclose(surface.first_return(p), np.pi, rtol=1e-14)
    np.testing.assert_allclose(surface.first_return_rate(p), 0.0, atol=1e-14)
    assert surface.tameness() == "constant"
    angles = np.linspace(-3.0, 3.0, 13)
    for order in (1, 2):
        for latitude in (0.0, 1.1):
            points = conjugate_points(surface, angles, order, latitude)
            np.testing.assert_allclose(points.time, 2.5 * np.pi * order, rtol=1e-14)
            np.testing.assert_allclose(points.latitude, (-1) ** order * latitude, atol=1e-14)
            np.testing.assert_allclose(np.cos(points.longitude), (-1) ** order, atol=1e-14)
            assert conjugate_locus(surface, 40, order, latitude).cusps == 0
    times = np.linspace(0.0, 20.0, 40)
    latitude, longitude, _ = extremal(surface, 0.8, 0.7).state(times)
    lat0, along = 0.7 / 2.5, times / 2.5
    start = np.array([np.cos(lat0), 0.0, np.sin(lat0)])
    ahead = np.cos(0.8) * np.array([0.0, 1.0, 0.0]) + np.sin(0.8) * np.array([-np.sin(lat0), 0.0, np.cos(lat0)])
    circle = np.cos(along)[:, None] * start + np.sin(along)[:, None] * ahead
    here = np.stack([np.cos(latitude / 2.5) * np.cos(longitude), np.cos(latitude / 2.5) * np.sin(longitude)], axis=-1)
    np.testing.assert_allclose(here, circle[:, :2], atol=1e-14)
    np.testing.assert_allclose(np.sin(latitude / 2.5), circle[:, 2], atol=1e-14)


@pytest.mark.parametrize(("flattening", "start"), [(1 / 50, 0.0), (1 / 298, 30.0), (-1 / 50, -20.0)])
def test_cut_times_against_geographiclib_p6(flattening, start):
    """GeographicLib's inverse problem: the distance to the point at the cut time is that time, beyond it is less."""
    aspect, model = 1.0 - flattening, Geodesic(1.0, flattening)
    surface = ellipsoid(aspect)
    latitude = latitude_of(surface, aspect, start)
    for azimuth in (20.0, 75.0, 100.0, 160.0):
        time = float(cut_time(surface, np.deg2rad(90.0 - azimuth), latitude))
        for factor in (0.999, 1.0, 1.003):
            end = model.Direct(start, 0.0, azimuth, factor * time)
            distance = model.Inverse(start, 0.0, end["lat2"], end["lon2"])["s12"]
            if factor <= 1.0:
                assert distance == pytest.approx(factor * time, abs=1e-12)
            else:
                assert distance < factor * time - 1e-6


def latitude_of(surface, aspect, degrees):
    """phi of a geodetic latitude."""
    parametric = np.arctan(aspect * np.tan(np.deg2rad(degrees)))
    return float(surface.latitude(np.sin(parametric)))


@pytest.mark.parametrize("flattening", [1 / 298, 1 / 50, -1 / 50])
@pytest.mark.parametrize("start", [0.0, 35.0])
def test_conjugate_times_against_geographiclib_o12(flattening, start):
    aspect, model = 1.0 - flattening, Geodesic(1.0, flattening)
    surface = ellipsoid(aspect)
    latitude = latitude_of(surface, aspect, start)
    for azimuth in (0.0, 15.0, 50.0, 89.0, 90.0, 120.0, -100.0, 180.0):
        mask = Geodesic.REDUCEDLENGTH | Geodesic.LATITUDE | Geodesic.LONGITUDE | Geodesic.LONG_UNROLL
        line = model.Line(start, 0.0, azimuth, Geodesic.DISTANCE_IN | mask)
        for order in (1, 2):
            point = conjugate_points(surface, np.deg2rad(90.0 - azimuth), order, latitude)
            time = float(point.time)

            def reduced(s, line=line, mask=mask):
                return line.Position(s, mask)["m12"]

            assert brentq(reduced, time - 0.01, time + 0.01, xtol=1e-14) == pytest.approx(time, abs=1e-10)
            there = line.Position(time, mask)
            assert latitude_of(surface, aspect, there["lat2"]) == pytest.approx(float(point.latitude), abs=1e-10)
            if azimuth not in (0.0, 180.0):
                assert np.deg2rad(there["lon2"]) == pytest.approx(float(point.longitude), abs=1e-10)


def test_the_period_integrand_has_the_square_of_the_sine_b_e6():
    """Printed: sin^2(psi_1^2); T is right with sin^2(psi_1)."""
    aspect, p = 0.6, 0.5
    psi = np.arccos(p)

    def period(sine2):
        with mp.workdps(20):
            return float(
                4 * mp.quad(lambda u: mp.sqrt(aspect**2 + mp.sin(u) ** 2 * sine2 * (1 - aspect**2)), [0, mp.pi / 2])
            )

    true = float(ellipsoid(aspect).period(p))
    assert period(np.sin(psi) ** 2) == pytest.approx(true, rel=1e-14)
    assert abs(period(np.sin(psi**2) ** 2) - true) > 0.04


def test_the_period_of_oblate_ellipsoids_is_concave_and_the_combined_quantity_decides_b_e9():
    """Printed: T' < 0 < T''. T'' and R'' are negative, so proposition 3 does not apply; yet the branch has no cusp."""
    p = np.linspace(0.02, 0.999, 60)
    for aspect in (0.1, 0.3, 0.6, 0.9, 0.999):
        with mp.workdps(30):
            for one, order in product(p[::20], (1, 2)):
                assert mp.diff(partial(exact_period, aspect), mp.mpf(one), order) < 0
        surface = ellipsoid(aspect)
        assert (surface.period_rate(p) < 0.0).all()
        assert not (surface.period_second_rate(p) > 0.0).any()
        assert (surface.period_second_rate(p) < 0.0).all()
        assert (surface.first_return_second_rate(p) < 0.0).all()
        assert (conjugate_height_rate(surface, p) > 0.0).all()
        heights = conjugate_points_of_momentum(surface, p).height
        assert (np.diff(heights) > 0.0).all()
        assert (heights < 0.0).all()


def test_extreme_ellipsoids_and_tiny_momenta():
    with mp.workdps(40):
        for aspect in (1e-3, 1e3):
            surface = ellipsoid(aspect)
            for p in (1e-8, 1e-3, 0.5):
                alpha2 = mp.mpf(aspect) ** 2 + (1 - mp.mpf(p) ** 2) * (1 - mp.mpf(aspect) ** 2)
                k = 1 - alpha2 / mp.mpf(aspect) ** 2
                q = 1 - mp.mpf(p) ** 2
                # theta = p times the integral of (1/(1 - Y) - (1 - epsilon^2))/D.
                turn = 2 * p / mp.mpf(aspect) * (mp.ellippi(q, k) - (1 - mp.mpf(aspect) ** 2) * mp.ellipk(k))
                assert float(surface.first_return(p)) == pytest.approx(float(turn), rel=1e-12)
                assert float(surface.period(p)) == pytest.approx(float(4 * aspect * mp.ellipe(k)), rel=1e-12)


def test_lengths_scale_with_the_radius():
    unit, large = ellipsoid(0.7), ellipsoid(0.7, 6.4e6)
    one, other = conjugate_points(unit, [0.3, 2.0], 1, 0.4), conjugate_points(large, [0.3, 2.0], 1, 0.4 * 6.4e6)
    np.testing.assert_allclose(other.time, 6.4e6 * one.time, rtol=1e-13)
    np.testing.assert_allclose(other.latitude, 6.4e6 * one.latitude, rtol=1e-12)
    np.testing.assert_allclose(other.longitude, one.longitude, rtol=1e-13)
    assert conjugate_locus(large, 100).cusps == 4


def test_bad_arguments_are_refused():
    for bad in (0.0, -1.0, 1e-4, 2e3, np.nan, [0.5, 0.6], "0.5"):
        with pytest.raises(ShapeError, match="aspect"):
            ellipsoid(bad)
    with pytest.raises(ShapeError, match="equatorial_radius"):
        ellipsoid(0.5, 0.0)
    with pytest.raises(ShapeError, match="momentum"):
        ellipsoid(0.5).first_return(1.1)
