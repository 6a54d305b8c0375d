"""Enclosures of distances and cut times: closed forms, curves of known length, planted longer ways, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from shapephase import so3
from shapephase.errors import ShapeError
from shapephase.rigid_body.geodesics import (
    _symmetric_arrivals,
    axisymmetric_metric,
    cut_time_enclosure,
    diameter_enclosure,
    distance,
    distance_enclosure,
    distance_enclosure_on_su2,
    enclosures,
    left_invariant_metric,
    shortest_geodesic,
)

NEARLY = 1e-9  # by which moments differ that are equal in the closed form: distances then differ by half of it


def shortest_of_shots(metric, attitudes, count, seed):
    """Least lengths of geodesics, random in direction and time, and a straight turn from their ends to the attitudes.

    Where a direction is forbidden the turn is made by (I_2, I_2, inf), in closed form.
    """
    rng = np.random.default_rng(seed)
    start = metric.unit_speed(rng.normal(size=(count, 3)) * np.where(np.isfinite(metric.moments), 1.0, 2.0))
    bounds = [shortest_geodesic(metric, attitude).length for attitude in attitudes]
    times = 1.1 * max(bounds) * rng.uniform(0.0, 1.0, count)
    inverse_ends = so3.transpose(metric.attitude(start, times))
    lengths = []
    for attitude, bound in zip(attitudes, bounds, strict=True):
        early = times <= 1.1 * bound
        rest = so3.log(inverse_ends[early] @ attitude) @ metric.axes
        if not metric.is_sub_riemannian:
            lengths.append((times[early] + np.sqrt(np.sum(metric.moments * rest**2, axis=-1))).min())
            continue
        closed = axisymmetric_metric(metric.moments[1], np.inf)
        near = np.argsort(times[early] + np.sqrt(metric.moments[1]) * np.linalg.norm(rest, axis=-1))[:50]
        lengths.append((times[early][near] + closed.distance(so3.exp(rest[near]))).min())
    return np.array(lengths)


@pytest.mark.parametrize(
    ("moments", "turn"),
    [
        ((3.0, 2.0, 1.0), (0.3, -0.5, 0.2)),
        ((3.0, 2.0, 1.0), (1.7, 1.2, -1.9)),
        ((1.0, 2.5, 1.7), (-0.4, 2.0, 1.0)),
        pytest.param((np.inf, 2.0, 1.0), (0.6, 0.4, -0.8), marks=pytest.mark.full),
    ],
    ids=str,
)
def test_no_curve_is_shorter_than_the_lower_bound(moments, turn):
    metric, attitude = left_invariant_metric(moments), so3.exp(np.array(turn))
    found = distance_enclosure(metric, attitude)
    assert found.certified
    assert found.width <= 1e-3 * found.upper
    assert found.lower <= shortest_of_shots(metric, [attitude], 5000, 1)[0]
    # The upper bound is the length of a geodesic that arrives.
    np.testing.assert_allclose(metric.attitude(found.momentum), attitude, rtol=0.0, atol=1e-11)
    assert found.upper == pytest.approx(metric.speed(found.momentum), abs=1e-6)
    shortest = shortest_geodesic(metric, attitude, width=1e-3)
    assert shortest.certified
    assert shortest.lower_bound == found.lower


@pytest.fixture
def half_of_the_axisymmetric_bound(monkeypatch):
    """The search has to begin at half of a lower bound that would leave it nothing to do."""

    def halved(metric, goal):
        lower, upper = axial_bounds(metric, goal)
        return 0.5 * lower, upper

    axial_bounds = distance.axial_bounds
    monkeypatch.setattr(distance, "axial_bounds", halved)


@pytest.mark.usefixtures("half_of_the_axisymmetric_bound")
@pytest.mark.parametrize(
    ("equatorial", "axial"), [(1.0, 2.5), (1.0, 0.4), pytest.param(1.0, np.inf, marks=pytest.mark.full)]
)
def test_nearly_axisymmetric_distances_hold_the_closed_form(equatorial, axial):
    """The search knows nothing of symmetry; the closed form is that of three moments of which two are equal."""
    closed = axisymmetric_metric(equatorial, axial)
    metric = left_invariant_metric([equatorial, equatorial * (1.0 + NEARLY), axial])
    for attitude in Rotation.random(2, rng=np.random.default_rng(2)).as_matrix():
        found, expected = distance_enclosure(metric, attitude, width=1e-2), float(closed.distance(attitude))
        assert found.certified
        assert found.cells > 0
        assert found.lower <= expected * (1.0 + NEARLY)
        assert found.upper >= expected * (1.0 - NEARLY)


@pytest.mark.usefixtures("half_of_the_axisymmetric_bound")
@pytest.mark.parametrize("angle", [0.4, 3.0, 5.5])
def test_nearly_round_distances_on_su2_are_angles(angle):
    metric = left_invariant_metric([1.0, 1.0 + NEARLY, 1.0 + 2.0 * NEARLY])
    axis = np.array([0.48, -0.6, 0.64])
    found = distance_enclosure_on_su2(metric, np.append(np.sin(0.5 * angle) * axis, np.cos(0.5 * angle)), width=1e-2)
    assert found.certified
    assert found.cells > 0
    assert found.lower <= angle * (1.0 + NEARLY)
    assert found.upper >= angle * (1.0 - NEARLY)


def test_minus_one_is_as_far_as_a_whole_turn_about_the_axis_of_the_smallest_moment():
    moments = [2.5, 0.7, 4.0]
    found = distance_enclosure_on_su2(left_invariant_metric(moments), [0.0, 0.0, 0.0, -1.0])
    assert found.certified
    expected = 2.0 * np.pi * np.sqrt(min(moments))
    assert found.lower <= expected <= found.upper * (1.0 + 1e-14)


@pytest.mark.parametrize("turn", [pytest.param(1e-2, marks=pytest.mark.full), 1e-4])
def test_small_turns_about_the_forbidden_axis_are_loops(turn):
    """Of the area turn, in scaled turns: sqrt(4 pi turn sqrt(I_1 I_2)), but for a part of the size of its square."""
    found = distance_enclosure(left_invariant_metric([1.0, 2.0, np.inf]), so3.exp(np.array([0.0, 0.0, turn])))
    expected = np.sqrt(4.0 * np.pi * turn * np.sqrt(2.0))
    assert found.certified
    assert found.lower < expected < found.upper * (1.0 + turn)


def test_a_longer_way_in_place_of_the_shortest_is_not_certified(monkeypatch):
    metric = left_invariant_metric([1.0, 2.0, 3.0])
    start = metric.unit_speed([1.0, 0.6, -0.9])
    time = 0.8 * float(metric.conjugate_time(start))
    attitude = metric.attitude(start, time)
    true = shortest_geodesic(metric, attitude)
    assert true.length < time - 0.1
    longer = replace(true, momentum=time * start, length=time)
    monkeypatch.setattr(enclosures, "found_geodesic", lambda *_: longer)
    found = distance_enclosure(metric, attitude, most_cells=30_000)
    assert not found.certified
    assert found.lower <= true.length < found.upper == pytest.approx(time, abs=1e-6)


@pytest.mark.full
def test_a_thin_tube_of_momenta_that_many_shots_miss(monkeypatch):
    """A stiff axis: about 1e-5 of all directions begin the loop that turns about it in less than the straight turn."""
    metric, turn = left_invariant_metric([1.0, 1.3, 1e5]), np.array([0.0, 0.0, 2e-4])
    attitude, roots = so3.exp(turn), np.sqrt(metric.moments)
    straight = float(roots[2] * turn[2])
    rng = np.random.default_rng(3)
    starts = metric.unit_speed(rng.normal(size=(20_000, 3)))
    times = straight * rng.uniform(0.0, 1.1, 20_000)

    def missed(momentum):
        return so3.log(so3.transpose(metric.attitude(momentum)) @ attitude) @ metric.axes * roots

    def slope(momentum):
        return -roots[:, None] * (metric.axes.T @ metric.differential(momentum))

    near = np.argsort(times + np.linalg.norm(missed(starts * times[:, None]), axis=-1))[:50]
    polished = [least_squares(missed, starts[i] * times[i], slope, x_scale="jac", xtol=1e-14, ftol=1e-14) for i in near]
    lengths = [metric.speed(fit.x) for fit in polished if np.linalg.norm(fit.fun) < 1e-3 * straight]
    assert min(lengths) == pytest.approx(straight, rel=1e-3)
    found = distance_enclosure(metric, attitude, width=2e-2)
    assert found.certified
    assert found.upper < 0.8 * straight
    longer = replace(shortest_geodesic(metric, attitude), momentum=metric.moments * turn, length=straight)
    monkeypatch.setattr(enclosures, "found_geodesic", lambda *_: longer)
    planted = distance_enclosure(metric, attitude, width=2e-2)
    assert not planted.certified
    assert planted.lower <= found.upper < planted.upper


@pytest.mark.parametrize(("equatorial", "axial"), [(1.0, 2.5), pytest.param(1.0, 0.4, marks=pytest.mark.full)])
def test_nearly_axisymmetric_cut_times_hold_the_closed_form(equatorial, axial):
    closed = axisymmetric_metric(equatorial, axial)
    metric = left_invariant_metric([equatorial, equatorial * (1.0 + NEARLY), axial])
    momentum = np.array([0.5, 0.3, 0.9])
    found, expected = cut_time_enclosure(metric, momentum), float(closed.cut_time(momentum))
    assert found.certified
    assert found.lower <= expected * (1.0 + NEARLY)
    assert found.upper >= expected * (1.0 - NEARLY)
    exact = cut_time_enclosure(left_invariant_metric([equatorial, equatorial, axial]), momentum)
    assert exact.upper == pytest.approx(expected, rel=1e-12)
    assert exact.certified


def test_half_a_turn_about_a_principal_axis_is_where_both_senses_meet():
    """About the axis of the middle moment: no other way is shorter up to there, though no theorem says so."""
    metric = left_invariant_metric([1.0, 2.0, 3.0])
    found = cut_time_enclosure(metric, [0.0, 2.0, 0.0])
    assert found.certified
    assert found.lower <= np.pi <= found.upper
    # Twice as fast, half the time.
    assert cut_time_enclosure(metric, [0.0, 4.0, 0.0]).upper == pytest.approx(0.5 * found.upper, rel=1e-9)


@pytest.mark.parametrize(("equatorial", "axial"), [(1.0, 1.5), (1.0, 3.0), (1.0, 0.4), (1.0, np.inf)])
def test_diameters_of_axisymmetric_metrics_are_those_of_the_closed_form(equatorial, axial):
    """But for rounding, and the farthest attitude is half a turn about an axis of the largest moment."""
    found = diameter_enclosure(left_invariant_metric([equatorial, equatorial, axial]))
    expected = axisymmetric_metric(equatorial, axial).diameter
    assert found.certified
    assert found.lower <= expected == pytest.approx(found.upper, rel=1e-12)
    assert found.width <= 1e-8 * expected


@pytest.mark.parametrize(
    ("equatorial", "axial"),
    [
        (1.0, 1.5),
        pytest.param(1.0, 0.4, marks=pytest.mark.full),
        pytest.param(1.0, 3.0, marks=pytest.mark.full),
        pytest.param(1.0, np.inf, marks=pytest.mark.full),
    ],
)
def test_nearly_axisymmetric_diameters_hold_the_closed_form(monkeypatch, equatorial, axial):
    """The search for symmetric arrivals has to be made, as if no axisymmetric metric bounded the diameter."""
    monkeypatch.setattr(enclosures, "_axial_diameter", lambda _: np.inf)
    found = diameter_enclosure(left_invariant_metric([equatorial, equatorial * (1.0 + NEARLY), axial]))
    expected = axisymmetric_metric(equatorial, axial).diameter
    assert found.certified
    assert found.cells > 0
    assert found.lower <= expected * (1.0 + NEARLY)
    assert found.upper >= expected * (1.0 - NEARLY)


DIAMETERS = [
    (1.0, 2.0, 3.0),
    (2.0, 1.0, 2.6),
    (1.0, 1.6, 2.5),
    (1.0, 1.2, 4.0),
    (0.8, 1.0, 3.0),
    (1.0, 1.3, 3.5),
    (1.0, 1.1, 8.0),
    (1.0, 1.05, np.inf),
    (1.2, np.inf, 1.0),
    (1.0, 1.5, np.inf),
]


@pytest.mark.full
@pytest.mark.parametrize(
    ("moments", "work"), [*((moments, 2_000_000) for moments in DIAMETERS), ((1.0, 2.0, np.inf), 4_000_000)], ids=str
)
def test_diameters_within_two_per_cent(moments, work):
    """Of random attitudes none is further than the upper bound, nor are diameters of smaller metrics."""
    metric = left_invariant_metric(moments)
    found = diameter_enclosure(metric, most_cells=work)
    assert found.certified
    assert found.width <= 2e-2 * found.upper
    smallest, middle, largest = metric.moments
    assert found.upper >= axisymmetric_metric(smallest, largest).diameter
    assert found.upper >= axisymmetric_metric(middle, smallest).diameter
    attitudes = Rotation.random(30, rng=np.random.default_rng(7)).as_matrix()
    assert max(shortest_geodesic(metric, attitude).length for attitude in attitudes) <= found.upper
    np.testing.assert_allclose(
        metric.attitude(found.momentum), so3.exp(np.pi * metric.axes[:, 2]), rtol=0.0, atol=1e-10
    )


@pytest.mark.parametrize(
    "moments", [(1.0, 1.3, 3.5), (1.0, 1.1, 8.0), pytest.param((1.0, 1.05, np.inf), marks=pytest.mark.full)]
)
def test_before_the_diameter_not_all_geodesics_have_met_a_symmetric_one(moments):
    metric = left_invariant_metric(moments)
    time = 0.99 * shortest_geodesic(metric, so3.exp(np.pi * metric.axes[:, 2])).length
    met, work = _symmetric_arrivals.all_met(metric.inverse_moments, time, 0.0, 50_000)
    assert not met
    assert work >= 50_000


@pytest.mark.parametrize("moments", [(1.0, 1.3, 3.5), (2.5, 1.0, 1.7), (1.0, 2.0, np.inf)], ids=str)
def test_a_geodesic_that_has_met_a_symmetric_one_is_not_the_shortest(moments):
    """Signs of the quaternion's components show it, but for those that are 0 because the momentum's is 0 midway."""
    metric = left_invariant_metric(moments)
    times = np.linspace(0.0, 1.1 * shortest_geodesic(metric, so3.exp(np.pi * metric.axes[:, 2])).length, 80)
    for start in metric.unit_speed(np.random.default_rng(8).normal(size=(3, 3))):
        quats = so3.quat_from_matrix(metric.axes.T @ metric.attitude(start, times) @ metric.axes)
        quats[1:] *= np.cumprod(np.sign(np.sum(quats[1:] * quats[:-1], axis=-1)))[:, None]
        midway = metric.body_momentum(start, 0.5 * times) @ metric.axes
        signs = np.column_stack([quats[:, 3], quats[:, :2] * midway[:, :2]])
        first = int(np.argmax(np.any(signs < -1e-3, axis=-1)))
        assert first > 0
        assert shortest_geodesic(metric, metric.attitude(start, times[first])).length < times[first] - 1e-6
    for axis in range(3):
        middle = metric.unit_speed(metric.axes @ np.where(np.arange(3) == axis, 0.0, [0.7, -0.5, 0.9]))
        start = metric.body_momentum(middle, -1.5)
        assert abs(so3.log(metric.attitude(start, 3.0)) @ metric.axes[:, axis]) < 1e-12


def test_too_little_work_leaves_the_bounds_of_axisymmetric_metrics():
    metric, attitude = left_invariant_metric([1.0, 2.0, 3.0]), so3.exp(np.array([1.7, 1.2, -1.9]))
    found, bounds = distance_enclosure(metric, attitude, most_cells=1), shortest_geodesic(metric, attitude)
    assert not found.certified
    assert found.lower == pytest.approx(bounds.lower_bound, rel=1e-8)
    assert not cut_time_enclosure(metric, [1.0, 1.0, 1.0], most_cells=1).certified
    assert distance_enclosure(metric, np.eye(3)).upper == 0.0
    largest = diameter_enclosure(left_invariant_metric([1.0, 1.3, 3.5]), most_cells=1)
    assert not largest.certified
    assert largest.upper == axisymmetric_metric(1.3, 3.5).diameter


@pytest.mark.parametrize("moments", [(1.0, 2.0, 3.0), (1.0, 1.0, 2.0), (1.0, 2.0, 1e6)], ids=str)
def test_turns_near_rounding_are_enclosed(moments):
    """To less than their square, such turns are straight: an attitude's digits are 1e-16, not relative to the turn."""
    metric = left_invariant_metric(moments)
    for turn in (1e-8, 1e-12, 1e-14):
        about_third = np.array([0.0, 0.0, turn])
        found = distance_enclosure(metric, so3.exp(about_third), most_cells=1000)
        expected = np.sqrt(moments[2]) * turn
        assert found.lower <= expected <= found.upper


def test_an_end_that_is_met_to_the_last_digit_has_no_gap():
    """About a forbidden axis, too, where an infinite moment times a missed angle of 0 is not a number."""
    assert distance.gap(left_invariant_metric([1.0, 2.0, np.inf]), 0.0) == 0.0


def test_refusals():
    metric = left_invariant_metric([3.0, 2.0, 1.0])
    for wrong in (0.0, 1.0, -1e-3, np.nan):
        with pytest.raises(ShapeError, match="width"):
            distance_enclosure(metric, np.eye(3), width=wrong)
    with pytest.raises(ShapeError, match="most_cells"):
        shortest_geodesic(metric, np.eye(3), width=1e-3, most_cells=0)
    with pytest.raises(ShapeError, match="attitude"):
        distance_enclosure(metric, np.broadcast_to(np.eye(3), (2, 3, 3)))
    with pytest.raises(ShapeError, match="quat_xyzw"):
        distance_enclosure_on_su2(metric, np.ones((2, 4)) / 2.0)
    with pytest.raises(ShapeError, match="momentum"):
        cut_time_enclosure(metric, [0.0, 0.0, 0.0])


def random_metric(number):
    """Moments up to fivefold apart; every fifth metric has a forbidden axis."""
    rng = np.random.default_rng(number)
    moments = np.exp(rng.uniform(0.0, np.log(5.0), 3))
    if number % 5 == 0:
        moments[rng.integers(3)] = np.inf
    return left_invariant_metric(moments)


@pytest.mark.full
@pytest.mark.parametrize("number", range(50))
def test_twenty_attitudes_of_each_of_fifty_metrics(number):
    """Of 100,000 shots none is below the lower bound; the width is reached but where the work did not suffice."""
    metric = random_metric(number)
    attitudes = Rotation.random(20, rng=np.random.default_rng(number)).as_matrix()
    enclosed = [distance_enclosure(metric, attitude) for attitude in attitudes]
    for found in enclosed:
        assert found.certified == (found.width <= 1e-3 * found.upper)
        assert found.certified or found.cells >= distance.MOST_CELLS
    assert np.all(
        np.array([found.lower for found in enclosed]) <= shortest_of_shots(metric, attitudes, 100_000, number)
    )
