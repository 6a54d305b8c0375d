"""Plans of bodies with ball joints: against the same body with three hinges, and by the body's own matrices."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, TrajectoryError
from shapephase.optimal_control import Limits, Search, path_cost, plan_reorientation, symbolic_body
from shapephase.optimal_control.task import reorientation
from support.ball_bodies import BALLS, TWO_AND_A_BALL, TWO_AND_HINGES

EPS = np.finfo(float).eps
TURN = so3.exp(np.array([0.0, 0.3, 0.4]))
FREE = Limits(rate_limits=None)


@pytest.fixture
def two(load_urdf):
    return load_urdf(TWO_AND_A_BALL)


def test_symbols_are_the_body(load_urdf, rng):
    """At quaternions of any length, and derivatives by their four numbers."""
    body = load_urdf(BALLS)
    symbols = symbolic_body(body)
    for shape in rng.normal(size=(3, 9)):
        connection = sp.mechanical_connection(body, shape)
        for found, expected in (
            (symbols.inertia(shape), body.locked_inertia(shape)),
            (symbols.momentum_matrix(shape), body.momentum_matrix(shape)),
            (symbols.connection(shape), connection),
            (symbols.centre_of_mass(shape), body.centre_of_mass(shape)[:, None]),
            (symbols.link_pose("hand")(shape), body.link_pose(shape, "hand")),
        ):
            np.testing.assert_allclose(np.array(found), expected, rtol=0, atol=1e3 * EPS * np.abs(expected).max())
        slopes = sp.shape_space.connection_slopes(body, shape)[1]
        found = np.array(symbols.derivative("connection")(shape)).reshape(9, 3, 9)
        expected = np.moveaxis(slopes, 0, -1).reshape(9, 3, 9)
        np.testing.assert_allclose(
            found.reshape(27, 9), expected.reshape(27, 9), rtol=0, atol=1e-12 * np.abs(expected).max()
        )


def test_three_coordinates_for_each_ball_joint(two, load_urdf):
    """The tangent of half the turn from the start; joints by the name of the ball; half a turn is not reached."""
    start = two.shape({"waist": Rotation.from_euler("XYZ", [0.4, -0.3, 1.0]).as_quat()})
    turned = Rotation.from_quat(start) * Rotation.from_rotvec([0.0, 1.2, 0.0])
    task = reorientation(two, TURN, start=start, end=-2.0 * turned.as_quat(), limits=FREE)
    np.testing.assert_allclose(task.start, 0.0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(task.end, [0.0, np.tan(0.6), 0.0], rtol=0, atol=1e-15)
    ends = Rotation.from_quat(np.stack([task.shapes(task.start), task.shapes(task.end)]))
    np.testing.assert_allclose(ends.as_matrix()[0], Rotation.from_quat(start).as_matrix(), rtol=0, atol=1e-15)
    np.testing.assert_allclose(ends.as_matrix()[1], turned.as_matrix(), rtol=0, atol=1e-15)
    away = (Rotation.from_quat(start) * Rotation.from_rotvec([np.pi, 0.0, 0.0])).as_quat()
    with pytest.raises(TrajectoryError, match="turn"):
        reorientation(two, TURN, start=start, end=away, limits=FREE)
    for cost in ("rate", "acceleration", "time"):
        with pytest.raises(ShapeError, match=f"cost='{cost}'.*waist is a ball joint"):
            reorientation(two, TURN, cost=cost, limits=FREE)
    body = load_urdf(BALLS)
    for names in (["neck", "elbow"], ["neck.y", "elbow"]):
        held = reorientation(body, TURN, joints=names, limits=FREE)
        assert held.dimension == 4
        np.testing.assert_array_equal(held.shapes(np.ones(4))[:4], [0.0, 0.0, 0.0, 1.0])
    mirrored = {f"neck.{part}": (f"shoulder.{part}", sign) for part, sign in zip("xyzw", (1.0, -1.0, -1.0, 1.0))}
    both = reorientation(body, TURN, symmetric=mirrored, limits=FREE)
    shape = both.shapes(np.array([0.3, -0.2, 0.5, 0.1]))
    np.testing.assert_allclose(shape[4:8], shape[:4] * [1.0, -1.0, -1.0, 1.0], rtol=0, atol=1e-15)


@pytest.mark.usefixtures("few_guesses")
def test_a_plan_reaches_its_goal(two):
    """One start on few pieces; the cost by the body's own matrices, the attitude by a reconstruction of its own."""
    plan = plan_reorientation(two, TURN, limits=FREE, search=Search(pieces=12))
    assert plan.goal_error < 1e-10
    assert plan.cost == pytest.approx(path_cost(two, plan.path), rel=1e-9)
    end = sp.reconstruct(sp.articulated(two, plan.path), [0.0, 0.0, 0.0], tolerance=1e-11).final_attitude
    assert so3.angle(end.T @ TURN) < 1e-10
    assert sp.path_summary(two, plan.path).is_loop


@pytest.mark.full
def test_a_plan_costs_what_it_does_with_three_hinges(two, load_urdf):
    """The energy knows no coordinates: both optima differ by what their splines cannot follow."""
    hinged = load_urdf(TWO_AND_HINGES)
    costs = [plan_reorientation(body, TURN, limits=FREE).cost for body in (two, hinged)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-3)
