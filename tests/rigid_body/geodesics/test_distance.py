"""Distances by shooting: geodesics found again, the closed forms, symmetry, bounds and the sub-Riemannian limit."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from shapephase import so3
from shapephase.errors import AccuracyNotReached, ShapeError
from shapephase.rigid_body.geodesics import (
    axisymmetric_metric,
    left_invariant_metric,
    nearest_attitude,
    shortest_geodesic,
)
from support.independent import assert_within
from support.long_runs import full_but

AXISYMMETRIC = [[1.0, 1.0, 3.0], [1.0, 1.0, 0.3], [0.7, 2.0, 2.0], [1.0, np.inf, 1.0], [1.5, 1.5, 1.5]]
TRIAXIAL = [[3.0, 2.0, 1.0], [1.0, 2.5, 1.7], [np.inf, 2.0, 1.0]]


def axial_form(moments):
    """The closed form of an axisymmetric metric, and the columns that bring its axis to the third place."""
    odd = next(k for k in range(3) if moments[k - 1] == moments[k - 2])
    return axisymmetric_metric(moments[odd - 1], moments[odd]), [(odd + 1) % 3, (odd + 2) % 3, odd]


@pytest.mark.parametrize("moments", full_but(AXISYMMETRIC, *AXISYMMETRIC[1:4]), ids=str)
def test_a_geodesic_before_its_cut_is_found_again_and_certified_q6(moments):
    metric = left_invariant_metric(moments)
    closed, columns = axial_form(moments)
    rng = np.random.default_rng(1)
    for part in (0.3, 0.98):
        start = metric.unit_speed(rng.normal(size=3))
        time = part * float(closed.cut_time(start[columns]))
        found = shortest_geodesic(metric, metric.attitude(start, time))
        assert found.certified
        assert abs(found.length - time) < 1e-11
        assert_within(found.momentum, time * start, 1e-9)
        assert found.residual < 1e-11


@pytest.mark.parametrize("moments", AXISYMMETRIC[:3], ids=str)
def test_past_the_cut_a_shorter_way_is_found_q6(moments):
    metric = left_invariant_metric(moments)
    closed, columns = axial_form(moments)
    start = metric.unit_speed([0.4, -0.7, 0.5])
    time = 1.05 * float(closed.cut_time(start[columns]))
    found = shortest_geodesic(metric, metric.attitude(start, time))
    assert found.certified
    assert found.length < time - 1e-4
    expected = closed.distance(metric.attitude(start, time)[np.ix_(columns, columns)])
    assert abs(found.length - expected) < 1e-11


@pytest.mark.parametrize("moments", full_but(TRIAXIAL, TRIAXIAL[0]), ids=str)
def test_a_geodesic_before_its_conjugate_time_is_found_again_q6(moments):
    metric = left_invariant_metric(moments)
    rng = np.random.default_rng(2)
    for part in (0.3,):
        start = metric.unit_speed(rng.normal(size=3))
        time = part * float(metric.conjugate_time(start))
        found = shortest_geodesic(metric, metric.attitude(start, time))
        assert abs(found.length - time) < 1e-11
        assert_within(found.momentum, time * start, 1e-9)
    # Near it something shorter may come there; never anything longer.
    for part in (0.95,):
        start = metric.unit_speed(rng.normal(size=3))
        time = part * float(metric.conjugate_time(start))
        found = shortest_geodesic(metric, metric.attitude(start, time))
        assert found.length <= time + 1e-11
        assert_within(metric.attitude(found.momentum), metric.attitude(start, time), 1e-10)
        assert metric.conjugate_time(found.momentum) >= 1.0 - 1e-9


def test_distances_agree_with_the_closed_form_q6():
    for moments in AXISYMMETRIC[:4]:
        metric = left_invariant_metric(moments)
        closed, columns = axial_form(moments)
        for attitude in Rotation.random(1, random_state=3).as_matrix():
            found = shortest_geodesic(metric, attitude)
            expected = closed.distance(attitude[np.ix_(columns, columns)])
            assert abs(found.length - expected) < 1e-11
            assert abs(found.lower_bound - expected) < 1e-11
            assert abs(found.upper_bound - expected) < 1e-11


def test_the_sub_riemannian_distance_to_turns_about_the_forbidden_axis_q6():
    # These ends are conjugate and cut at once.
    metric = left_invariant_metric([1.0, 1.0, np.inf])
    for alpha in (0.1, 2.5, np.pi):
        found = shortest_geodesic(metric, so3.exp(np.array([0.0, 0.0, alpha])))
        assert abs(found.length - np.sqrt(alpha * (4.0 * np.pi - alpha))) < 1e-9
        assert found.certified


@pytest.mark.full
@pytest.mark.parametrize("moments", [pytest.param(TRIAXIAL[1], marks=pytest.mark.full), TRIAXIAL[2]], ids=str)
def test_distances_are_a_metric_between_their_bounds_q6(moments):
    attitudes = Rotation.random(2, random_state=4).as_matrix()
    metric = left_invariant_metric(moments)
    found = [shortest_geodesic(metric, attitude) for attitude in attitudes]
    for one in found:
        assert one.lower_bound - 1e-12 <= one.length <= one.upper_bound + 1e-12
        assert not one.certified
    # From the other end, and the triangle.
    assert abs(shortest_geodesic(metric, attitudes[0].T).length - found[0].length) < 1e-10
    between = shortest_geodesic(metric, attitudes[0].T @ attitudes[1]).length
    assert abs(found[0].length - found[1].length) <= between <= found[0].length + found[1].length
    # Moments twice as large: lengths larger by the root of two.
    twice = shortest_geodesic(left_invariant_metric(2.0 * np.array(moments)), attitudes[1])
    assert abs(twice.length - np.sqrt(2.0) * found[1].length) < 1e-10


def heisenberg(moments, turn):
    """Length of the shortest way near the identity where axis 3 is forbidden: in scaled turns an arc of a circle.

    Its chord is r, its length r (w/2)/sin(w/2), and the area between both, which is the turn about axis 3,
    r² (w - sin w)/(8 sin²(w/2)), with w the angle of the arc.
    """
    mean = np.sqrt(moments[0] * moments[1])
    chord, area = np.hypot(*(np.sqrt(moments[:2] / mean) * turn[:2])), abs(turn[2])
    if chord == 0.0:
        return np.sqrt(4.0 * np.pi * area * mean)
    excess = lambda w: chord**2 * (w - np.sin(w)) / (8.0 * np.sin(0.5 * w) ** 2) - area  # noqa: E731
    angle = brentq(excess, 1e-6, 2.0 * np.pi - 1e-9, xtol=1e-14) if area else 1e-9
    return np.sqrt(mean) * chord * 0.5 * angle / np.sin(0.5 * angle)


@pytest.mark.parametrize(
    ("moments", "turn"),
    [
        ((1.0, 1.0), (0.0, 0.0, 1e-4)),
        ((1.0, 2.0), (0.0, 0.0, 1e-6)),
        ((3.0, 1.0), (2e-4, -3e-4, 2e-7)),
        ((1.0, 1e3), (1e-4, 1e-5, 1e-7)),
    ],
    ids=str,
)
def test_short_ways_along_the_forbidden_direction_are_those_of_heisenbergs_group_q5(moments, turn):
    """But for a part that falls with the square of the length."""
    wanted = heisenberg(np.array(moments), np.array(turn))
    found = shortest_geodesic(left_invariant_metric([*moments, np.inf]), so3.exp(np.array(turn)))
    assert abs(found.length / wanted - 1.0) < wanted**2 / min(moments)
    assert found.lower_bound * (1.0 - 1e-12) <= found.length <= found.upper_bound * (1.0 + 1e-12)
    assert found.residual < 1e-15 + 1e-8 * wanted


def test_short_turns_about_stiff_axes_are_straight_q5():
    """As long as no loop of the other turns is shorter: below 2 pi sqrt(I_1 I_2)/I_3 about axis 3."""
    for moments, k in (([1e6, 2.0, 1.0], 0), ([5e3, 1.0, 4e3], 2)):
        found = shortest_geodesic(left_invariant_metric(moments), so3.exp(1e-6 * np.eye(3)[k]))
        assert found.length == pytest.approx(1e-6 * np.sqrt(moments[k]), rel=1e-9)


@pytest.mark.full
def test_distances_converge_as_the_inverse_of_the_moment_q5():
    # d^2/2 is the least action, so that its derivative by 1/I_1 is minus half the integral of Pi_1^2 along the way.
    limit = left_invariant_metric([np.inf, 2.0, 1.0])
    start = limit.unit_speed([0.8, 0.9, -0.6])
    time = 0.3 * float(limit.conjugate_time(start))
    attitude = limit.attitude(start, time)
    best = shortest_geodesic(limit, attitude)
    assert abs(best.length - time) < 1e-11
    nodes, weights = leggauss(30)
    first = limit.body_momentum(best.momentum, 0.5 * (1.0 + nodes))[:, 0]
    slope = 0.5 * weights @ first**2
    gaps = []
    for small in (1e-2, 1e-3, 1e-4):
        near = shortest_geodesic(left_invariant_metric([1.0 / small, 2.0, 1.0]), attitude)
        assert near.length < best.length
        gaps.append((best.length**2 - near.length**2) / small)
    errors = np.abs(np.array(gaps) / slope - 1.0)
    assert errors[2] < 1e-3
    assert 5.0 < errors[0] / errors[1] < 20.0
    assert 5.0 < errors[1] / errors[2] < 20.0


def test_special_ends():
    metric = left_invariant_metric([3.0, 2.0, 1.0])
    here = shortest_geodesic(metric, np.eye(3))
    assert here.length == 0.0
    assert here.certified
    np.testing.assert_array_equal(here.momentum, np.zeros(3))
    near = shortest_geodesic(metric, so3.exp(np.array([1e-6, 2e-6, -1e-6])))
    assert abs(near.length / np.sqrt(3e-12 + 8e-12 + 1e-12) - 1.0) < 1e-9
    half = shortest_geodesic(metric, so3.exp(np.pi * np.eye(3)[2]))
    assert abs(half.length - np.pi) < 1e-11


def test_the_nearest_of_a_set_is_the_nearest_of_all_q6():
    """Small turns about the axes are as far as the roots of their moments say."""
    metric = left_invariant_metric([3.0, 2.0, 1.0])
    attitudes = so3.exp(np.diag([0.5, 0.6, 0.7]))
    number, found = nearest_attitude(metric, attitudes)
    assert number == 2
    assert found.length == pytest.approx(0.7, abs=1e-11)
    number, found = nearest_attitude(metric, attitudes[[0, 1]])
    assert number == 1
    assert found.length == pytest.approx(0.6 * np.sqrt(2.0), abs=1e-11)
    for wrong in (np.eye(3), np.zeros((0, 3, 3))):
        with pytest.raises(ShapeError, match="attitudes"):
            nearest_attitude(metric, wrong)


def test_refusals(monkeypatch):
    metric = left_invariant_metric([3.0, 2.0, 1.0])
    with pytest.raises(ShapeError, match="attitude"):
        shortest_geodesic(metric, np.broadcast_to(np.eye(3), (2, 3, 3)))
    with pytest.raises(ShapeError):
        shortest_geodesic(metric, np.diag([1.0, 1.0, -1.0]))
    monkeypatch.setattr("shapephase.rigid_body.geodesics.distance._STEPS", 0)
    with pytest.raises(AccuracyNotReached, match="most"):
        shortest_geodesic(metric, so3.exp(np.array([1.0, 0.5, 0.2])))
