"""The programs of optimal control: their splines, their derivatives, and the optimality of what they find."""

from __future__ import annotations

from dataclasses import replace

import casadi
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, TrajectoryError, UnknownNameError
from shapephase.optimal_control import Goal, Limits, Search, Waypoint, plan_reorientation
from shapephase.optimal_control._polish import end_derivative, goal_derivative, polish
from shapephase.optimal_control._spline_basis import SplineBasis
from shapephase.optimal_control.collocation import CollocationProgram
from shapephase.optimal_control.guesses.loops import guesses
from shapephase.optimal_control.task import reorientation

HALF_TURN = so3.exp(np.array([np.pi, 0.0, 0.0]))
SLANTED = so3.exp(np.array([0.5, -0.4, 0.3]))
AXIS = [[0.0, 0.6, 0.8], [0.0, 0.0, 1.0]]
# Shorter than the default: durations must not cancel.
PLAIN = {"duration": 0.8}
TASKS = {
    "kinetic": (HALF_TURN, {}),
    "momentum": (SLANTED, {"momentum": [0.01, -0.02, 0.03], "end": "free"}),
    "rate": (SLANTED, {"cost": "rate", "limits": Limits(rate_limits=20.0)}),
    "acceleration": (SLANTED, {"cost": "acceleration"}),
    "time": (
        SLANTED,
        {"cost": "time", "limits": Limits(rate_limits=[20.0, 30.0, 25.0]), "momentum": [0.0, 0.01, 0.0]},
    ),
    "axis": (Goal(pointing=AXIS), {}),
    "link": (Goal(pointing=AXIS, link="rear"), {"end": "free"}),
    "waypoints": (
        SLANTED,
        {"via": [Waypoint({"waist_yaw": 0.2}, time=0.2), Waypoint([0.1, 0.2, -0.3]), Waypoint({"waist_roll": 0.1})]},
    ),
    "limits": (
        Goal(pointing=AXIS, link="rear"),
        {
            "end": "free",
            "cost": "effort",
            "via": [Waypoint({"waist_yaw": 0.2}, time=0.2), Waypoint({"waist_roll": 0.1})],
            "limits": Limits(acceleration_limits=40.0, jerk_limits=400.0, effort_limits=[0.4, 0.6, 0.8]),
        },
    ),
    "coupled": (SLANTED, {"joints": ["waist_pitch", "waist_yaw"], "start": [0.1, -0.2, 0.3]}),
}
# Their limits, waypoints or durations bind.
NOT_CHECKED_BY_SLOPES = ("time", "waypoints", "limits")


def task_of(name, robot="cat_two_halves"):
    target, changes = TASKS[name]
    return reorientation(sp.load_body(robot), target, **PLAIN | changes)


def random_control(task, basis, rng, size=0.5):
    control = task.start + size * rng.uniform(-1.0, 1.0, (basis.dimension, task.dimension))
    control[0] = task.start
    if task.end is not None:
        control[-1] = task.end
    return np.clip(control, task.lower, task.upper)


@pytest.mark.parametrize("pieces", [6, 20])
def test_the_transcribed_spline_is_the_path(pieces, rng):
    """Everywhere, not at the nodes alone; and SciPy's not-a-knot spline of the nodes' values is the same once more."""
    basis = SplineBasis(pieces)
    control = rng.normal(size=(basis.dimension, 2))
    path = basis.path(control, 3.0, ("a", "b"))
    places = np.linspace(0.0, 1.0, 203)
    assert_allclose(path.shape(3.0 * places), basis.matrix(places) @ control, atol=2e-13)
    assert_allclose(3.0 * path.rate(3.0 * places), basis.matrix(places, 1) @ control, atol=1e-11)
    again = CubicSpline(basis.nodes, path.shape(3.0 * basis.nodes))
    assert_allclose(again(places), basis.matrix(places) @ control, atol=2e-13)
    assert_allclose(again(places, 2), basis.matrix(places, 2) @ control, atol=1e-8)


def test_control_points_bound_the_spline_and_its_rate(rng):
    basis = SplineBasis(9)
    control = rng.normal(size=(basis.dimension, 4))
    places = np.linspace(0.0, 1.0, 1001)
    values, rates = basis.matrix(places) @ control, basis.matrix(places, 1) @ control
    assert np.all(values <= control.max(axis=0) + 1e-14)
    assert np.all(values >= control.min(axis=0) - 1e-14)
    assert np.all(np.abs(rates) <= np.abs(basis.rate_control @ control).max(axis=0) * (1.0 + 1e-14))
    # The rate is a quadratic spline with these control points: they average to its mean, the difference of the ends.
    assert_allclose(rates[0], (basis.rate_control @ control)[0], atol=1e-12)


@pytest.mark.parametrize("name", TASKS)
def test_the_programs_derivatives_are_exact(name, rng):
    """Against CasADi's own differentiation of the whole program, which knows nothing of nodes."""
    task, basis = task_of(name), SplineBasis(6)
    program = CollocationProgram(task, basis)
    parts = program.program
    unknown, cost, rows = parts["x"], parts["f"], parts["g"]
    weights, of_cost = casadi.MX.sym("weights", rows.shape[0]), casadi.MX.sym("of_cost")
    lagrangian = of_cost * cost + casadi.dot(weights, rows)
    oracle = casadi.Function(
        "oracle", [unknown, of_cost, weights], [casadi.jacobian(rows, unknown), casadi.hessian(lagrangian, unknown)[0]]
    )
    x = rng.uniform(0.2, 0.8, unknown.shape[0])
    multipliers = rng.normal(size=rows.shape[0])
    jacobian, hessian = (part.full() for part in oracle(x, 1.7, multipliers))
    _, ours = program.derivatives["jac_g"](x, [])
    assert_allclose(ours.full(), jacobian, atol=1e-12 * np.abs(jacobian).max())
    second = program.derivatives["hess_lag"](x, [], 1.7, multipliers).full()
    assert_allclose(second, np.triu(hessian), atol=1e-12 * np.abs(hessian).max())


@pytest.mark.parametrize("name", ["momentum", "coupled"])
def test_the_ends_derivative_is_the_difference_of_ends(name, rng):
    """Open paths, momentum, fixed joints."""
    task, basis = task_of(name), SplineBasis(7)
    control, change = random_control(task, basis, rng), rng.normal(size=(8, task.dimension))

    def moved(size):
        path = basis.path(task.shapes(control + size * change), task.duration, task.body.joint_names)
        return path, sp.reconstruct(sp.articulated(task.body, path), task.momentum, tolerance=1e-13)

    slopes = end_derivative(task, basis, *moved(0.0))
    step = 1e-3
    ends = {k: moved(k * step)[1].final_attitude for k in (-2, -1, 1, 2)}
    first, second = (so3.log(ends[k] @ ends[-k].T) / (2 * k * step) for k in (1, 2))
    assert_allclose(np.einsum("ask,sk->a", slopes, change), (4.0 * first - second) / 3.0, atol=1e-8)


def test_the_goals_derivative_is_the_difference_of_where_a_link_points(rng):
    """Where it points is the goal itself, as the derivative is seen across that direction."""
    task, basis = task_of("link"), SplineBasis(7)
    control, change = random_control(task, basis, rng), rng.normal(size=(8, task.dimension))

    def moved(size):
        path = basis.path(task.shapes(control + size * change), task.duration, task.body.joint_names)
        return path, sp.reconstruct(sp.articulated(task.body, path), task.momentum, tolerance=1e-13)

    def pointed(size):
        path, motion = moved(size)
        return motion.final_attitude @ task.body.link_pose(path.shape(task.duration), "rear")[:3, :3] @ [0.0, 0.6, 0.8]

    here = pointed(0.0)
    task = replace(task, pointing=np.array([[0.0, 0.6, 0.8], here]))
    slopes = goal_derivative(task, basis, *moved(0.0), control)
    first, second = ((pointed(k * 1e-3) - pointed(-k * 1e-3)) / (2e-3 * k) for k in (1, 2))
    turning = np.cross(here, (4.0 * first - second) / 3.0)
    assert_allclose(np.einsum("ask,sk->a", slopes, change), task.constrained_directions() @ turning, atol=1e-8)


@pytest.mark.parametrize(("somersaults", "half_twists"), [(1.0, 2.0), (2.5, -3.0)])
def test_windings_are_counted(somersaults, half_twists):
    goal = Goal(somersaults=somersaults, half_twists=half_twists)
    task = reorientation(sp.load_body("diver"), goal, momentum=[0.0, -2.0, 0.0], **PLAIN)
    places = np.linspace(0.0, 1.0, 300)
    quats = task.uniform_winding(places)
    assert np.all(np.sum(quats[1:] * quats[:-1], axis=1) > 0.99)
    attitudes = so3.matrix_from_quat(quats)
    angles = [2.0 * np.pi * somersaults, np.pi * half_twists]
    assert_allclose(task.counted_windings(attitudes), angles, atol=1e-12)
    assert_allclose(attitudes[-1], task.target, atol=1e-12)
    # The long axis goes about the momentum, -y; a tilt that comes and goes changes no count.
    seen = Rotation.from_rotvec([0.0, -angles[0] * places[30], 0.0]).apply([0.0, 0.0, 1.0])
    assert_allclose(attitudes[30, :, 2], seen, atol=1e-14)
    tilt = so3.exp(0.6 * np.sin(np.pi * places)[:, None] * task.winding_axes[:, 1])
    tilted = (
        so3.exp(angles[0] * places[:, None] * task.winding_axes[:, 0])
        @ tilt
        @ so3.exp(angles[1] * places[:, None] * task.winding_axes[:, 2])
    )
    assert_allclose(task.counted_windings(tilted), angles, atol=1e-12)


def test_guesses_turn_the_right_way():
    """Small circles in the plane of largest curvature reach a small turn to a few percent, in the right sense."""
    turn = so3.exp(np.array([-0.05, 0.0, 0.0]))
    task = reorientation(sp.load_body("cat_two_halves"), turn, **PLAIN)
    best = min(guesses(task, SplineBasis(20), 0, 20), key=lambda guess: guess.goal_error)
    assert best.goal_error < 0.1 * 0.05


def test_the_correction_is_newtons_method_and_keeps_ends_and_limits(rng):
    task, basis = task_of("kinetic"), SplineBasis(8)
    control = random_control(task, basis, rng, 0.8)
    path = basis.path(control, task.duration, task.body.joint_names)
    near = sp.reconstruct(sp.articulated(task.body, path), np.zeros(3), tolerance=1e-11).final_attitude
    goal = so3.exp(np.array([2e-3, -1e-3, 3e-3])) @ near
    task = reorientation(task.body, goal, **PLAIN)
    # A control point at its limit stays there.
    limited = np.minimum(task.upper, control.max(axis=0))
    task = type(task)(**{**vars(task), "upper": limited})
    done = polish(task, basis, control, task.duration)
    assert done.first_goal_error == pytest.approx(np.sqrt(14e-6), rel=1e-6)
    assert done.goal_error < 5e-10
    assert done.steps <= 3
    assert np.all(done.control <= limited)
    assert_allclose(done.control[[0, -1]], control[[0, -1]], atol=0.0)
    highest = control.argmax(axis=0)
    assert_allclose(done.control[highest, range(3)], limited, atol=0.0)


def test_the_correction_keeps_rates_at_their_limits(rng):
    task, basis = task_of("kinetic"), SplineBasis(8)
    control = random_control(task, basis, rng)
    rates = basis.rate_control @ control / task.duration
    near = sp.reconstruct(
        sp.articulated(task.body, basis.path(control, task.duration, task.body.joint_names)), np.zeros(3)
    ).final_attitude
    limits = Limits(rate_limits=np.abs(rates).max(axis=0))
    task = reorientation(task.body, so3.exp(np.array([2e-5, 1e-5, -3e-5])) @ near, limits=limits, **PLAIN)
    done = polish(task, basis, control, task.duration)
    assert 0 < done.steps < 3
    assert done.goal_error < 5e-10
    fastest = np.abs(rates).argmax(axis=0)
    after = basis.rate_control @ done.control / task.duration
    assert_allclose(after[fastest, range(3)], rates[fastest, range(3)], rtol=1e-13)
    assert np.abs(after - rates).max() > 1e-6


@pytest.mark.usefixtures("few_guesses")
@pytest.mark.parametrize(
    "name",
    ["rate", *(pytest.param(k, marks=pytest.mark.full) for k in TASKS if k not in ("rate", *NOT_CHECKED_BY_SLOPES))],
)
def test_a_plan_is_optimal_among_the_splines_that_reach_its_goal(name):
    """The slope of its cost by the free control points is a combination of those of the goal's rows.

    Both are differences, of SciPy's spline and of the integrator, which share nothing with the program.
    """
    target, changes = TASKS[name]
    body, options = sp.load_body("cat_two_halves"), {"limits": Limits(rate_limits=None), **PLAIN, **changes}
    task, basis = reorientation(body, target, **options), SplineBasis(10)
    plan = plan_reorientation(body, target, search=Search(pieces=10), **options)

    def cost_and_rows(control):
        path = basis.path(task.shapes(control), task.duration, body.joint_names)
        end = sp.reconstruct(sp.articulated(body, path), task.momentum, tolerance=1e-12).final_attitude
        rows = task.constrained_directions() @ task.turn_to_goal(end, control[-1])
        if task.cost != "acceleration":
            return np.append(rows, sp.optimal_control.path_cost(body, path, task.cost))
        nodes = np.linspace(0.0, task.duration, 11)
        bends = CubicSpline(nodes, path.shape(nodes), bc_type="not-a-knot").derivative(2)
        ends = [bends(nodes[:-1] + 1e-12), bends(nodes[1:] - 1e-12)]  # the square of a line, integrated exactly
        return np.append(rows, sum(np.sum(a * b) for a, b in ((ends[0], ends[0]), (*ends,), (ends[1], ends[1]))) / 6.0)

    def residual(control):
        equal, shape, slopes = task.equal_points, control.shape, []
        groups = [[k] for k in range(equal, shape[0] - equal)]
        groups += [list(range(shape[0] - equal, shape[0]))] if task.end is None else []
        for points in groups:
            for column in np.flatnonzero(task.movable):
                if np.any(np.abs(control[points, column] - [[task.lower[column]], [task.upper[column]]]) < 1e-3):
                    continue
                change = np.zeros(shape)
                change[points, column] = 1e-4
                slopes.append(cost_and_rows(control + change) - cost_and_rows(control - change))
        *rows, cost = np.array(slopes).T
        left = cost - np.array(rows).T @ np.linalg.lstsq(np.array(rows).T, cost, rcond=None)[0]
        return np.linalg.norm(left) / np.linalg.norm(cost)

    assert plan.goal_error < 1e-8
    assert residual(plan.coefficients) < 0.01
    other = plan.coefficients.copy()
    other[4] += 0.1
    assert residual(other) > 0.03


@pytest.mark.parametrize(
    ("target", "changes", "error", "match"),
    [
        (np.eye(2), {}, ShapeError, "rotation"),
        (-np.eye(3), {}, ShapeError, "reflection"),
        (HALF_TURN, {"momentum": 1.0}, ShapeError, "momentum"),
        (HALF_TURN, {"duration": 0.0}, TrajectoryError, "duration"),
        (HALF_TURN, {"start": [0.0, 4.0, 0.0]}, TrajectoryError, "waist_yaw"),
        (HALF_TURN, {"start": [0.0, 4.0]}, ShapeError, "start"),
        (HALF_TURN, {"end": "anywhere"}, UnknownNameError, "free"),
        (HALF_TURN, {"cost": "speed"}, UnknownNameError, "kinetic"),
        (HALF_TURN, {"cost": "time", "limits": Limits(rate_limits=None)}, TrajectoryError, "rate_limits"),
        (HALF_TURN, {"joints": ["tail"]}, UnknownNameError, "waist_pitch"),
        (HALF_TURN, {"joints": []}, TrajectoryError, "joints"),
        (HALF_TURN, {"symmetric": {"waist_yaw": ("waist_yaw", 1.0)}}, TrajectoryError, "symmetric"),
        (
            HALF_TURN,
            {"symmetric": {"waist_yaw": ("waist_roll", 1.0)}, "start": [0, 0.2, 0]},
            TrajectoryError,
            "follows",
        ),
    ],
)
def test_what_makes_no_sense_is_refused(target, changes, error, match):
    with pytest.raises(error, match=match):
        reorientation(sp.load_body("cat_two_halves"), target, **PLAIN | changes)
