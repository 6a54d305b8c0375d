"""Goals of plans: any of several attitudes, up to a symmetry, an axis of a link, a steady spin."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

import shapephase as sp
from shapephase.errors import PlanNotFound, ShapeError, UnknownNameError
from shapephase.optimal_control import Goal, Search, plan_reorientation
from support.independent import FreeFloating, apart, pinocchio_motion, turn, urdf_file

# What is planned is the same with and without machine code, which is quicker.
COARSE = Search(pieces=8)
FAR = turn([1.0, 0.1, 0.0], 2.6)
DIRECTION = np.array([0.3, -1.0, 2.5]) / np.linalg.norm([0.3, -1.0, 2.5])


@pytest.fixture(scope="module")
def two_halves():
    return sp.load_body("cat_two_halves")


def link_attitude(name, link, shape, joint_names):
    """Of a link in axes of the base, by Pinocchio's kinematics of the file."""
    known = FreeFloating(name, joint_names)
    model = pin.buildModelFromUrdf(str(urdf_file(name)), pin.JointModelFreeFlyer())
    q = pin.neutral(model)
    q[known.position] = shape
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(link)].rotation


def flown(name, plan, momentum=(0.0, 0.0, 0.0)):
    """The attitude at the end, by Pinocchio's momentum and SciPy's integrator."""
    breaks = plan.path.breaks[1:-1]
    return pinocchio_motion(name, plan.body.joint_names, plan.path, np.asarray(momentum), breaks=breaks).attitude[-1]


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_of_several_attitudes_the_cheapest_is_taken(two_halves):
    near = turn([0.3, 1.0, 0.4], 0.5)
    plan = plan_reorientation(two_halves, np.stack([FAR, near]), search=COARSE)
    assert apart(plan.goal.rotation, near) < 1e-12
    assert apart(flown("cat_two_halves", plan), near) < 1e-8
    assert plan.starts[1].cost < plan.starts[0].cost


@pytest.mark.full
def test_a_goal_up_to_a_finite_symmetry_costs_what_the_cheapest_member_costs(two_halves):
    quarter = turn([1.0, 0.0, 0.0], 0.5 * np.pi)
    members = [FAR @ np.linalg.matrix_power(quarter, power) for power in range(4)]
    costs = [plan_reorientation(two_halves, goal, search=COARSE).cost for goal in members]
    plan = plan_reorientation(two_halves, Goal(rotation=FAR, symmetry=quarter), search=COARSE)
    assert plan.cost == pytest.approx(min(costs), rel=1e-9)
    assert min(costs) < 0.9 * costs[0]
    assert apart(flown("cat_two_halves", plan), members[int(np.argmin(costs))]) < 1e-8


@pytest.mark.full
def test_an_axis_of_symmetry_costs_no_more_than_any_turn_about_it(two_halves):
    plan = plan_reorientation(two_halves, Goal(rotation=FAR, symmetry=[2.0, 0.0, 0.0]), search=COARSE)
    end = flown("cat_two_halves", plan)
    assert np.abs(end[:, 0] - FAR[:, 0]).max() < 1e-8
    for angle in (0.0, 1.0, 2.5, -1.5):
        other = plan_reorientation(two_halves, FAR @ turn([1.0, 0.0, 0.0], angle), search=COARSE)
        assert plan.cost <= other.cost * (1.0 + 1e-9)
    same = plan_reorientation(two_halves, end, search=COARSE)
    assert same.cost == pytest.approx(plan.cost, rel=1e-5), "the attitude taken costs as much when it is asked for"


def test_groups_are_made_of_their_rotations():
    """The tetrahedral and octahedral groups have 12 and 24 rotations; every member is a product of the two given."""
    half, third, quarter = turn([1, 0, 0], np.pi), turn([1, 1, 1], 2.0 * np.pi / 3.0), turn([0, 0, 1], np.pi / 2.0)
    for generators, size in (([half, third], 12), ([quarter, third], 24), ([np.eye(3)], 1)):
        group = np.asarray(Goal(rotation=FAR, symmetry=generators).symmetry)
        assert len(group) == size
        assert min(apart(a, b) for a, b in itertools.combinations(group, 2)) > 1.0 if size > 1 else True
        for one in generators:
            products = group @ np.asarray(one)
            assert all(min(apart(product, member) for member in group) < 1e-9 for product in products)
        attitudes = np.array([member.rotation for member in Goal(rotation=FAR, symmetry=generators).members])
        np.testing.assert_allclose(attitudes, FAR @ group, atol=1e-15)
    both = Goal(pointing=([0.0, 0.0, 1.0], DIRECTION), symmetry=[third]).members
    np.testing.assert_allclose([one.pointing[0] for one in both], np.eye(3)[[2, 0, 1]], atol=1e-15)
    np.testing.assert_allclose([one.pointing[1] for one in both], [DIRECTION] * 3, atol=1e-15)


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_a_body_that_looks_right_already_does_not_move(two_halves):
    half = turn([1.0, 0.0, 0.0], np.pi)
    plan = plan_reorientation(two_halves, Goal(rotation=half, symmetry=half), search=COARSE)
    assert plan.cost < 1e-12
    assert np.abs(plan.path.shape(plan.path.sample_times)).max() < 1e-5
    assert plan.goal_error < 1e-8


@pytest.mark.full
@pytest.mark.parametrize("name", ["cat_two_halves", pytest.param("satellite", marks=pytest.mark.full)])
@pytest.mark.usefixtures("few_guesses")
def test_a_link_is_pointed_and_its_joints_help(name):
    """By Pinocchio's kinematics; where the posture at the end is the plan's own choice, too, it costs less."""
    body, link = sp.load_body(name), {"cat_two_halves": "rear", "satellite": "dish"}[name]
    goal = Goal(pointing=([0.0, 0.0, 1.0], DIRECTION), link=link)
    duration = {"cat_two_halves": 1.0, "satellite": 20.0}[name]
    shut = plan_reorientation(body, goal, duration=duration, search=COARSE)
    free = plan_reorientation(body, goal, duration=duration, end="free", search=COARSE)
    for plan in (shut, free):
        last = plan.path.shape(duration)
        seen = flown(name, plan) @ link_attitude(name, link, last, body.joint_names) @ [0.0, 0.0, 1.0]
        assert np.abs(seen - DIRECTION).max() < 1e-8
        assert plan.goal_error < 1e-8
        assert plan.kkt_residual < 1e-6
    assert free.cost < shut.cost


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_a_tumbling_body_ends_in_a_steady_spin(two_halves):
    """Its axis of largest inertia along the momentum at the end: as a rigid body it turns about it for ever."""
    momentum = np.array([0.002, 0.0008, 0.0012])
    axis = np.linalg.eigh(two_halves.locked_inertia(np.zeros(3)))[1][:, 2]
    plan = plan_reorientation(two_halves, Goal(pointing=(axis, momentum)), momentum=momentum, search=COARSE)
    end = flown("cat_two_halves", plan, momentum)
    spin = np.linalg.solve(end @ two_halves.locked_inertia(np.zeros(3)) @ end.T, momentum)
    assert np.abs(np.cross(spin, momentum)).max() < 1e-8 * np.linalg.norm(spin) * np.linalg.norm(momentum)
    after = sp.reconstruct(sp.rigid(two_halves.locked_inertia(np.zeros(3)), 5.0), momentum, attitude=end)
    turning = np.einsum(
        "nij,nj->ni", after.attitude(np.linspace(0, 5, 9)), after.angular_velocity(np.linspace(0, 5, 9))
    )
    assert np.abs(turning - spin).max() < 1e-6 * np.linalg.norm(spin)
    before = np.linalg.solve(two_halves.locked_inertia(np.zeros(3)), momentum)
    assert np.linalg.norm(np.cross(before, momentum)) > 0.1 * np.linalg.norm(before) * np.linalg.norm(momentum)


@pytest.mark.parametrize(
    ("goal", "error", "match"),
    [
        ({"rotation": np.zeros((0, 3, 3))}, ShapeError, "rotation"),
        ({"rotation": np.eye(3), "symmetry": [0.0, 0.0, 0.0]}, ShapeError, "symmetry"),
        ({"rotation": np.eye(3), "symmetry": np.diag([1.0, 1.0, -1.0])}, ShapeError, "symmetry"),
        ({"rotation": np.eye(3), "symmetry": turn([0, 0, 1], 1.0)}, ShapeError, "more than 120"),
        ({"pointing": np.eye(3)[:2], "symmetry": [0.0, 0.0, 1.0]}, ShapeError, "symmetry"),
        ({"somersaults": 1.0, "symmetry": np.eye(3)}, ShapeError, "symmetry"),
        ({"rotation": np.eye(3), "link": "rear"}, ShapeError, "link"),
        ({"pointing": np.eye(3)[:2], "link": "tail"}, UnknownNameError, "tail"),
        ({"pointing": np.zeros((1, 2, 3))}, ShapeError, "pointing"),
    ],
)
@pytest.mark.parametrize("end", [None, "free"])
def test_goals_that_make_no_sense_are_refused(two_halves, goal, end, error, match):
    with pytest.raises(error, match=match):
        plan_reorientation(two_halves, Goal(**goal), end=end, search=COARSE)


@pytest.mark.parametrize("stop", ["callback", "time"])
@pytest.mark.usefixtures("few_guesses")
def test_what_ended_a_search_is_told(two_halves, stop):
    """With the best so far, the same by whichever means."""
    shares = []

    def callback(share, text):
        shares.append(share)
        return stop == "callback" and text.startswith("search")

    limit = 1e-9 if stop == "time" else None
    with pytest.raises(PlanNotFound, match="time limit" if stop == "time" else "on request") as ended:
        plan_reorientation(two_halves, FAR, search=Search(pieces=8, time_limit=limit), progress=callback)
    assert ended.value.best.status == ("out of time" if stop == "time" else "stopped")
    assert shares == sorted(shares)
    assert shares[-1] < 1.0
