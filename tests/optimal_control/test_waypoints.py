"""Waypoints of plans: passed where and when they must be, at the least cost."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError
from shapephase.optimal_control import Goal, Limits, Search, Waypoint, plan_reorientation
from shapephase.optimal_control.task import reorientation
from support.independent import apart, pinocchio_motion, turn

# What is planned is the same with and without machine code, which is quicker.
GOAL = turn([2.0, 0.3, 0.1], 2.0)
BESIDE = Waypoint([0.5, 0.2, 0.1])


@pytest.fixture(scope="module")
def two_halves():
    return sp.load_body("cat_two_halves")


def planned(body, via=(), pieces=12, **options):
    return plan_reorientation(body, GOAL, via=via, search=Search(pieces=pieces), **options)


def end_of(plan):
    """By Pinocchio's momentum and SciPy's integrator."""
    path, names = plan.path, plan.body.joint_names
    return pinocchio_motion(plan.body.name, names, path, np.zeros(3), breaks=path.breaks[1:-1]).attitude[-1]


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_waypoints_on_the_best_path_change_nothing(two_halves):
    """With their times, without, and of one joint alone; those that are open are found where they were taken from."""
    plain = planned(two_halves)
    yaw = two_halves.joint_index("waist_yaw")
    via = [
        Waypoint(plain.path.shape(0.3)),
        Waypoint({"waist_yaw": plain.path.shape(0.5)[yaw]}),
        Waypoint(plain.path.shape(0.8), time=0.8),
    ]
    plan = planned(two_halves, via)
    assert plan.cost == pytest.approx(plain.cost, rel=1e-7)
    np.testing.assert_allclose(plan.waypoint_times, [0.3, 0.5, 0.8], atol=1e-4)
    assert plan.waypoint_times[2] == 0.8
    times = np.linspace(0.0, 1.0, 21)
    np.testing.assert_allclose(plan.path.shape(times), plain.path.shape(times), atol=1e-3)


@pytest.mark.full
def test_waypoints_beside_it_are_passed_in_their_order(two_halves):
    via = [Waypoint(BESIDE.shape, time=0.25), Waypoint({"waist_roll": -0.3}), Waypoint({"waist_pitch": 0.1}, time=0.9)]
    plan = planned(two_halves, via)
    assert plan.goal_error < 1e-8
    assert apart(end_of(plan), GOAL) < 1e-8
    first, second, third = plan.path.shape(plan.waypoint_times)
    pitch, roll = two_halves.joint_index("waist_pitch"), two_halves.joint_index("waist_roll")
    np.testing.assert_allclose(first, BESIDE.shape, atol=1e-9)
    assert abs(second[roll] + 0.3) < 1e-9
    assert abs(third[pitch] - 0.1) < 1e-9
    assert plan.waypoint_times[0] == 0.25
    assert plan.waypoint_times[2] == pytest.approx(0.9, abs=1e-15)
    assert 0.25 <= plan.waypoint_times[1] <= 0.9
    assert plan.kkt_residual < 1e-6
    assert plan.hamiltonian_spread is None
    lower, upper = two_halves.joint_limits.T
    shapes, rates = plan.path.shape(np.linspace(0, 1, 4001)), plan.path.rate(np.linspace(0, 1, 4001))
    assert np.all((shapes >= lower - 1e-9) & (shapes <= upper + 1e-9))
    assert np.all(np.abs(rates) <= two_halves.rate_limits * (1.0 + 1e-6))


@pytest.mark.full
def test_a_time_that_is_open_is_the_best(two_halves):
    """No time given beside it is cheaper, and the cost is flat there."""
    best = planned(two_halves, [BESIDE])
    (found,) = best.waypoint_times
    away = {step: planned(two_halves, [Waypoint(BESIDE.shape, time=found + step)]).cost for step in (-0.02, 0.0, 0.02)}
    assert away[0.0] == pytest.approx(best.cost, rel=1e-7)
    for step in (-0.02, 0.02):
        assert best.cost < away[step] < best.cost * 1.02


@pytest.mark.full
def test_least_time_through_a_waypoint(two_halves):
    """Faster than at any pace through it that a plan with a given time has, and dearer than without it."""
    limits = Limits(rate_limits=10.0)
    plan = planned(two_halves, [BESIDE], cost="time", limits=limits)
    free = planned(two_halves, cost="time", limits=limits)
    assert free.cost < plan.cost
    np.testing.assert_allclose(plan.path.shape(plan.waypoint_times)[0], BESIDE.shape, atol=1e-8)
    assert np.abs(plan.path.rate(np.linspace(0.0, plan.path.duration, 4001))).max() <= 10.0 * (1.0 + 1e-6)
    assert apart(end_of(plan), GOAL) < 1e-8


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_waypoints_within_limits_of_efforts(two_halves):
    """To which the plan comes between the nodes, by torques that know nothing of the program; a link is pointed."""
    direction, most = np.array([0.0, 0.5, 1.0]) / np.sqrt(1.25), 0.06
    plan = plan_reorientation(
        two_halves, Goal(pointing=([0.0, 0.0, 1.0], direction), link="rear"), end="free", search=Search(pieces=8),
        via=[Waypoint({"waist_yaw": 0.4}), Waypoint({"waist_roll": -0.1}, time=0.8)],
        limits=Limits(effort_limits=most, acceleration_limits=14.0),
    )  # fmt: skip
    times = np.linspace(0.0, 1.0, 4001)
    assert 0.999 < np.abs(sp.joint_torques(plan.motion, times).torque).max() / most < 1.0 + 1e-6
    assert 0.999 < np.abs(plan.path.acceleration(times)).max() / 14.0 < 1.0 + 1e-6
    passed = plan.path.shape(plan.waypoint_times)
    assert abs(passed[0, two_halves.joint_index("waist_yaw")] - 0.4) < 1e-9
    assert abs(passed[1, two_halves.joint_index("waist_roll")] + 0.1) < 1e-9
    seen = end_of(plan) @ two_halves.link_pose(plan.path.shape(1.0), "rear")[:3, 2]
    np.testing.assert_allclose(seen, direction, atol=1e-8)


def test_waypoints_bind_what_follows(two_halves):
    """A follower's coordinate is its leader's divided by the factor, beside a joint that is held."""
    task = reorientation(
        two_halves, GOAL, joints=["waist_pitch", "waist_yaw"], symmetric={"waist_yaw": ("waist_pitch", -0.5)},
        via=[Waypoint({"waist_yaw": 0.2}, time=0.5), Waypoint({"waist_pitch": -0.4, "waist_roll": 0.0})],
    )  # fmt: skip
    for point, place in zip(task.via, (0.5, None), strict=True):
        assert point.place == place
        assert point.columns.tolist() == [0]
        np.testing.assert_allclose(point.values, [-0.4], atol=1e-15)


@pytest.mark.parametrize(
    ("via", "options", "error", "match"),
    [
        ([{"waist_yaw": 0.1}], {}, ShapeError, "Waypoint"),
        ([Waypoint([0.1, 0.2])], {}, ShapeError, "3 joints"),
        ([Waypoint({"tail": 0.1})], {}, UnknownNameError, "waist_yaw"),
        ([Waypoint({"waist_yaw": 9.0})], {}, TrajectoryError, "beyond its limits"),
        ([Waypoint({"waist_yaw": 0.1}, time=1.0)], {}, TrajectoryError, "before the end"),
        ([Waypoint({"waist_yaw": 0.1}, 0.5), Waypoint({"waist_yaw": 0.2}, 0.4)], {}, TrajectoryError, "after 0.5"),
        ([Waypoint({"waist_yaw": 0.1})], {"joints": ["waist_roll", "waist_pitch"]}, TrajectoryError, "held fixed"),
        ([Waypoint({"waist_yaw": 0.0})], {"joints": ["waist_roll", "waist_pitch"]}, TrajectoryError, "moves"),
        (
            [Waypoint({"waist_yaw": 0.1, "waist_roll": 0.1})],
            {"symmetric": {"waist_roll": ("waist_yaw", -1.0)}},
            TrajectoryError,
            "follows puts it",
        ),
        (
            [Waypoint({"waist_yaw": 0.1}, 0.5)],
            {"cost": "time", "limits": Limits(rate_limits=9.0)},
            TrajectoryError,
            "leave their times out",
        ),
    ],
)
def test_waypoints_that_cannot_be_passed_are_refused(two_halves, via, options, error, match):
    with pytest.raises(error, match=match):
        planned(two_halves, via, **options)


@pytest.mark.parametrize(
    ("shape", "time", "match"),
    [({}, None, "names of joints"), ([[0.1]], None, "each joint"), ([np.nan], None, "finite"), ([0.1], 0.0, "above 0")],
)
def test_what_is_no_waypoint_is_said(shape, time, match):
    with pytest.raises((ShapeError, TrajectoryError), match=match):
        Waypoint(shape, time)
