"""Guesses of many strokes: their slopes, the turns that the integrator gives them, and where they lead."""

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.optimal_control import Limits, Search, path_cost, plan_reorientation
from shapephase.optimal_control.guesses import strokes as module
from shapephase.optimal_control.guesses.stroke_program import PIECES_OF_WAY, Layout, StrokeProgram
from shapephase.optimal_control.guesses.strokes import best_strokes, guess_of_strokes, most_of_a_loop
from shapephase.optimal_control.task import reorientation

SIDEWAYS = so3.exp(np.radians(25.0) * np.array([0.0, 0.0, 1.0]))


def task_of(name, goal=SIDEWAYS, **options):
    return reorientation(sp.load_body(name), goal, **options)


@pytest.fixture(scope="module")
def diver():
    task = task_of("diver")
    return task, best_strokes(task, module._metric(task), 0)


def test_strokes_turn_the_body_as_the_integrator_says(diver):
    """A midpoint's error is of the square of a step."""
    task, found = diver
    assert len(found) == 4
    for stroke in found:
        times = np.linspace(0.0, 1.0, len(stroke.curve))
        loop = sp.ShapePath.spline(times, stroke.curve, joint_names=task.body.joint_names)
        turn = so3.log(sp.holonomy(task.body, loop))
        assert np.linalg.norm(turn - stroke.turn) < 0.03 * np.linalg.norm(turn)


def test_strokes_keep_to_the_limits(diver):
    task, found = diver
    for stroke in found:
        assert np.all(stroke.curve >= task.lower)
        assert np.all(stroke.curve <= task.upper)


def test_the_best_stroke_of_the_diver_is_better_than_any_circle(diver):
    """Circles of all sizes about a grid of middles, by the integrator."""
    task, found = diver
    metric = module._metric(task)
    best = max(abs(stroke.turn[2]) / stroke.length for stroke in found)
    phase = np.linspace(0.0, 2.0 * np.pi, module._STEPS + 1)[:, None]
    circles = np.array(
        [
            np.array([a, b]) + radius * np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
            for a in np.linspace(-2.0, 2.0, 7)
            for b in np.linspace(-2.0, 2.0, 7)
            for radius in (0.3, 0.6, 0.9, 1.2)
        ]
    )
    turns = so3.log(module._turned(task, circles))
    assert best > np.max(np.abs(turns[:, 2]) / module._length(circles, metric))


def test_three_legs_are_euler_angles_where_axes_are_orthogonal():
    strokes = [
        module.Stroke(curve=np.zeros((3, 2)), turn=turn, length=1.0)
        for turn in (np.array([0.0, 0.0, 0.02]), np.array([0.03, 0.0, 0.0]))
    ]
    angles = np.array([0.7, 1.1, -0.4])
    axes = np.eye(3)[[2, 0, 2]]
    goal = so3.exp(angles[0] * axes[0]) @ so3.exp(angles[1] * axes[1]) @ so3.exp(angles[2] * axes[2])
    legs = module._steered(strokes, goal, 0)
    assert legs is not None
    made = np.eye(3)
    for leg in legs:
        made = made @ so3.exp(leg.rounds * leg.stroke.turn)
    assert so3.angle(made.T @ goal) < 1e-6
    dear = sum(abs(angle) / size for angle, size in zip(angles, (0.02, 0.03, 0.02), strict=True))
    assert sum(abs(leg.rounds) for leg in legs) < dear * (1.0 + 1e-6)


@pytest.mark.full
def test_a_guess_of_strokes_keeps_to_the_limits():
    """One stroke of the diver turns him by 1.4 degrees."""
    task = task_of("diver", limits=Limits(rate_limits=None))
    found = guess_of_strokes(task, 0)
    assert found is not None
    layout, control = found
    assert layout.basis.pieces > 15 * module.PIECES_OF_STROKE
    values = layout.basis.matrix(layout.basis.nodes) @ control
    assert np.all(values >= task.lower - 1e-12)
    assert np.all(values <= task.upper + 1e-12)
    assert np.all(np.abs(values[[0, -1]]) < 1e-12)
    assert guess_of_strokes(task, 0, pieces=20) is None


def test_a_layout_repeats_its_strokes():
    layout = Layout(((6, 3), (9, 2)))
    assert layout.basis.pieces == 18 + 18 + 3 * PIECES_OF_WAY
    shared = layout.shared
    for first, (pieces, rounds) in zip(layout.firsts, layout.strokes, strict=True):
        control = np.arange(shared.max() + 1.0)[shared] ** 2 % 7.0
        inside = np.linspace(0.01, pieces - 0.01, 20)
        seen = [
            layout.basis.matrix((first + k * pieces + inside) / layout.basis.pieces) @ control for k in range(rounds)
        ]
        for again in seen[1:]:
            np.testing.assert_allclose(again, seen[0], atol=1e-12)
    passed = np.concatenate([np.repeat(chain, times) for chain, times in layout.chains])
    assert len(passed) == layout.basis.pieces


@pytest.mark.parametrize("cost", ["kinetic", "time"])
def test_a_motion_of_equal_strokes_turns_as_the_integrator_says(cost):
    """Three rounds and two of two loops of the cat's waist, to a turn about a slanted axis."""
    goal = so3.exp(np.array([0.5, 0.2, -0.1]))
    task = task_of("cat_two_halves", goal, cost=cost, limits=Limits(rate_limits=20.0))
    layout = Layout(((6, 3), (6, 2)))
    rng = np.random.default_rng(1)
    legs = [
        module._Leg(
            module.Stroke(module._curve(module._random_loop(task, 0.6 * module._reach(task), rng)), goal[0], 1.0),
            rounds,
        )
        for rounds in (3.0, 2.0)
    ]
    guess = layout.basis.through(module._joined(task, layout, legs))
    found = StrokeProgram(task, layout).solve_strokes(guess)
    assert found.converged
    assert found.kkt_residual < 1e-6
    path = layout.basis.path(found.control, found.duration, task.body.joint_names)
    motion = sp.reconstruct(sp.articulated(task.body, path), [0.0, 0.0, 0.0], tolerance=1e-9)
    assert so3.angle(goal.T @ motion.final_attitude) < 1e-4
    assert so3.angle(goal.T @ found.attitude) < 1e-6
    assert np.abs(path.rate(np.linspace(0.0, found.duration, 2001))).max() < 20.0 * (1.0 + 1e-6)
    if cost == "kinetic":
        assert path_cost(task.body, path, "kinetic") == pytest.approx(found.cost, rel=1e-4)
    else:
        assert found.cost == found.duration < task.duration


def test_no_loop_turns_a_body_further_than_its_curvature(rng):
    """Of the diver's arms: convex loops within limits, by the integrator."""
    task = task_of("diver")
    most = most_of_a_loop(task)
    phase = np.linspace(0.0, 2.0 * np.pi, 65)[:, None]
    for _ in range(4):
        middle, size = rng.uniform(-1.0, 1.0, size=2), rng.uniform(0.5, 2.2, size=2)
        curve = middle + size * np.concatenate([np.cos(phase), np.sin(phase)], axis=1)
        loop = sp.ShapePath.spline(phase[:, 0], curve, joint_names=task.body.joint_names)
        turn = so3.angle(sp.holonomy(task.body, loop))
        assert 0.0 < turn < most < np.radians(70.0)


def test_no_bound_of_loops_where_there_is_none():
    assert most_of_a_loop(task_of("cat_two_halves")) == np.inf
    assert most_of_a_loop(task_of("diver", end="free")) == np.inf
    assert most_of_a_loop(task_of("diver", limits=Limits(joint_limits=False))) > 2.0 * np.pi


def test_no_strokes_with_momentum():
    assert guess_of_strokes(task_of("diver", momentum=[0.0, 1.0, 0.0]), 0) is None
    assert guess_of_strokes(task_of("diver", joints=["left_shoulder_abduction"]), 0) is None


@pytest.mark.full
def test_the_diver_turns_by_many_strokes():
    body = sp.load_body("diver")
    plan = plan_reorientation(body, SIDEWAYS, duration=30.0, search=Search())
    assert plan.goal_error < 1e-8
    again = sp.reconstruct(sp.articulated(body, plan.path), [0.0, 0.0, 0.0], tolerance=1e-11)
    assert so3.angle(SIDEWAYS.T @ again.final_attitude) < 1e-8
    times = np.linspace(0.0, 30.0, 20001)
    assert np.abs(plan.path.shape(times)).max() <= 3.2 + 1e-9
    assert np.abs(plan.path.rate(times)).max() <= 20.0 * (1.0 + 1e-6)
    assert len(plan.coefficients) > 15 * module.PIECES_OF_STROKE
    assert plan.kkt_residual < 1e-6
