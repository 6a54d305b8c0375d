"""Plans that keep links apart: their clearance at 4,001 times, rows of the program against differences, refusals."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.cli.main import main
from shapephase.cli.texts.plan_text import undo_lines
from shapephase.errors import PlanNotFound, ShapePhaseError, TrajectoryError
from shapephase.optimal_control import Limits, Search, Waypoint
from shapephase.optimal_control._plan_limits import Margins
from shapephase.optimal_control._spline_basis import SplineBasis
from shapephase.optimal_control.collocation import CollocationProgram
from shapephase.optimal_control.task import reorientation
from support.bodies import joint, link, urdf

DISTANCE = 0.05  # [m]
QUICK = (9,)  # numbers of goals that the quick suite plans
TOUCHING = (0, 1, 2, 4, 6, 7, 9, 10, 13)  # numbers of random goals whose plans pass links through each other
LEGS = ("waist_pitch", "waist_yaw", "waist_roll", "rear_left_hip_pitch", "rear_right_hip_pitch")


@pytest.fixture
def gymnast(load_urdf):
    """A trunk with two arms that turn about x and y, a ball at the end of each."""

    def with_ball(name, xyz, radius):
        shape = f'<visual><origin xyz="{xyz}"/><geometry><sphere radius="{radius}"/></geometry></visual>'
        return link(name, 1.0, [0.02, 0.03, 0.02], (0.0, 0.1, 0.1)).replace("</link>", f"{shape}</link>")

    links = [with_ball("trunk", "0 0 0.6", 0.2), link("shoulder", 0.1, [0.001, 0.001, 0.001])]
    links += [with_ball("left", "0 0 0.7", 0.1), with_ball("right", "0 0 0.7", 0.1)]
    joints = [
        joint("lift", "revolute", "trunk", "shoulder", (1, 0, 0), xyz=(0.5, 0, 0)),
        joint("swing", "revolute", "shoulder", "left", (0, 1, 0)),
        joint("turn", "revolute", "trunk", "right", (0, 0.6, 0.8), xyz=(-0.5, 0, 0)),
    ]
    return load_urdf(urdf(*links, *joints).replace('velocity="1"', 'velocity="100"'))


def test_a_program_has_the_derivatives_of_its_distances(gymnast, rng):
    """Jacobian and Hessian of two pairs at all nodes against differences of rows and of gradients."""
    task = reorientation(gymnast, so3.exp(np.array([1.0, 0.0, 0.0])), limits=Limits(clearance=0.01))
    basis, pairs = SplineBasis(6), [("trunk", "left"), ("left", "right")]
    margins = Margins(dict.fromkeys(pairs, 1e-5), 4)
    with_rows, without = CollocationProgram(task, basis, margins), CollocationProgram(task, basis)
    places, _ = basis.gauss(4)
    count = 2 * len(places)
    at, way = rng.normal(scale=0.3, size=(2, with_rows.program["x"].shape[0]))
    at[task.dimension * basis.dimension] = 1.0
    weights = np.zeros(with_rows.program["g"].shape[0])
    weights[-count:] = rng.normal(size=count)

    def rows_and_slopes(unknown):
        rows, jacobian = with_rows.derivatives["jac_g"](unknown, [])
        return np.array(rows)[-count:, 0], np.array(jacobian)[-count:]

    step = 1e-5
    (ahead, steeper), (behind, flatter) = (rows_and_slopes(at + s * step * way) for s in (1.0, -1.0))
    rows, jacobian = rows_and_slopes(at)
    np.testing.assert_allclose(jacobian @ way, (ahead - behind) / (2.0 * step), atol=1e-8)
    shapes = task.shapes(basis.matrix(places) @ at[: task.dimension * basis.dimension].reshape(-1, 3))
    distances = sp.body.link_distances(task.body, shapes)
    chosen = [distances.pairs.index(pair) for pair in task.geometry.pairs if pair in pairs]
    np.testing.assert_allclose(rows, distances.distance[:, chosen].ravel(), atol=1e-12)
    upper, bare = (
        np.array(program.derivatives["hess_lag"](at, [], 0.0, weights[: program.program["g"].shape[0]]))
        for program in (with_rows, without)
    )
    assert not bare.any()
    hessian = np.triu(upper) + np.triu(upper, 1).T
    along = weights[-count:] @ (steeper - flatter) / (2.0 * step)
    np.testing.assert_allclose(hessian @ way, along, rtol=0, atol=1e-3 * np.abs(along).max())


def at_all_times(body, path, pairs):
    """The least distance of some pairs at 4,001 even times [m]."""
    distances = sp.body.link_distances(body, path.shape(np.linspace(0.0, path.duration, 4001)))
    return distances.distance[:, [distances.pairs.index(pair) for pair in pairs]].min(initial=np.inf)


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
@pytest.mark.parametrize("swing", [-0.7, 0.7])
def test_a_way_back_that_touches_is_not_within_its_limits(gymnast, swing):
    """A recording whose arm goes through the trunk's ball, or away from it; the plan keeps apart in either case."""
    shapes = [[0.0, 0.0, 0.0], [0.1, swing, 0.3], [0.2, 0.1, 0.1], [0.1, 0.0, 0.0]]
    path = sp.ShapePath.waypoints([0.0, 0.3, 0.7, 1.0], shapes, joint_names=gymnast.joint_names)
    motion = sp.reconstruct(sp.articulated(gymnast, path), [0.0, 0.0, 0.0])
    pairs = sp.body.link_distances(gymnast, gymnast.shape()).pairs
    touches = at_all_times(gymnast, path, pairs) < DISTANCE
    assert touches == (swing < 0.0)
    limits, search = Limits(rate_limits=None, clearance=DISTANCE), Search(pieces=12)
    ways = sp.optimal_control.undo(motion, limits=limits, search=search)
    assert ways.backwards.undoes
    assert ways.backwards.keeps_limits != touches
    assert (ways.backwards.closest[0].distance < DISTANCE) if touches else not ways.backwards.closest
    assert ways.plan.keeps_limits
    assert at_all_times(gymnast, ways.plan.path, pairs) >= DISTANCE
    assert ways.best.keeps_limits
    lines = undo_lines(SimpleNamespace(body=gymnast, motion=motion, beginning=""), ways)
    assert any("the motion played backwards: " in line for line in lines) == touches


def keeps_apart(body, goal, distance, search, **options):
    """Plan without and with a clearance; the first touches, the second keeps it and reaches the goal as well."""
    plain = sp.plan_reorientation(body, goal, limits=Limits(rate_limits=None), search=search, **options)
    assert sp.clearance(body, plain.path, below=0.0).approaches, "links touch without a clearance"
    assert plain.closest == ()
    plan = sp.plan_reorientation(
        body, goal, limits=Limits(rate_limits=None, clearance=distance), search=search, **options
    )
    assert plan.status == "found"
    assert so3.angle(plan.motion.final_attitude.T @ goal) < 1e-8
    # Pairs that are always farther apart than a few centimetres are not sampled again.
    near = {approach.links for approach in sp.clearance(body, plan.path, below=distance + 0.02).approaches}
    least = at_all_times(body, plan.path, near)
    assert least >= distance
    assert not plan.closest or plan.closest[0].distance >= distance
    return plan


@pytest.mark.usefixtures("few_guesses")
@pytest.mark.parametrize("number", [k if k in QUICK else pytest.param(k, marks=pytest.mark.full) for k in TOUCHING])
def test_a_plan_keeps_links_apart_at_all_times(gymnast, number):
    goals = np.random.default_rng(0).normal(size=(number + 1, 3))
    turn = 0.7 * goals[-1] / np.linalg.norm(goals[-1])
    keeps_apart(gymnast, so3.exp(turn), DISTANCE, Search(pieces=12))


@pytest.mark.full
def test_a_plan_keeps_the_legs_of_the_cat_off_its_trunk():
    goal = so3.exp(np.array([1.5, 0.0, 0.0]))
    plan = keeps_apart(sp.load_body("cat"), goal, 0.01, Search(pieces=20), joints=LEGS)
    # The mirror image costs the same.
    assert plan.closest[0].links[0] == "trunk_rear"
    assert plan.closest[0].links[1] in ("rear_left_lower_leg", "rear_right_lower_leg")


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_a_goal_that_is_not_reached_without_touching_says_which_links_touch(gymnast):
    """The waypoint puts the left arm into the trunk."""
    through = Waypoint({"swing": -0.62, "lift": 0.0})
    with pytest.raises(PlanNotFound, match=r"clearance of 0.05 m, trunk and left overlap by 0.2.*--avoid") as failure:
        sp.plan_reorientation(
            gymnast,
            so3.exp(np.array([0.5, 0.0, 0.0])),
            via=[through],
            limits=Limits(clearance=DISTANCE),
            search=Search(pieces=8, iterations=60),
        )
    assert failure.value.best.closest[0].distance < -0.2


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_the_command_keeps_links_apart(gymnast, capsys, tmp_path):
    out = tmp_path / "plan.csv"
    command = ["plan", str(gymnast.file), "--turn", "40 about 0.11 -0.57 0.39", "--pieces", "12"]
    main([*command, "--avoid", "5cm", "--json", "--out", str(out)])
    data = json.loads(capsys.readouterr().out)
    assert data["status"] == "found"
    assert all(near["distance_m"] >= DISTANCE for near in data["closest_links"])
    main(["check", str(gymnast.file), str(out), "--clearance", "0.0499"])
    assert "0 of 2 pairs of links come closer" in capsys.readouterr().out
    with pytest.raises(SystemExit) as ended:
        main([*command, "--avoid", "9deg"])
    assert ended.value.code == 2
    assert "--avoid" in capsys.readouterr().err


def test_a_start_nearer_than_the_clearance_is_refused():
    with pytest.raises(TrajectoryError, match=r"start: links rear_left_upper_leg and rear_right_upper_leg are 0.031 m"):
        sp.plan_reorientation(
            sp.load_body("cat"), so3.exp(np.array([1.0, 0.0, 0.0])), joints=LEGS, limits=Limits(clearance=0.05)
        )


@pytest.mark.parametrize("distance", [0.0, -1.0, np.nan, "2cm"])
def test_a_clearance_is_above_zero(distance):
    with pytest.raises(ShapePhaseError, match="clearance: "):
        Limits(clearance=distance)
