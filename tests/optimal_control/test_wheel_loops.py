"""Two crossed wheels turn a body: optimal loops in closed form, and the sub-Riemannian distances of the rotations.

With moments I, J of body and wheel about each axle, the loop's cost is the integral of 1/2 K |omega|^2, K = I (I - J)/J
about both axles, and omega stays in their plane.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import shapephase as sp
from shapephase import so3
from shapephase.optimal_control import (
    Limits,
    Search,
    conjugate_times,
    extremal,
    plan_reorientation,
    shoot,
    small_loop,
    wong_residual,
)
from shapephase.rigid_body.geodesics import axisymmetric_metric
from support.bodies import link, urdf

MOMENTS = (3.0, 3.6, 4.0)
FIRST_WHEEL = 0.5
STIFFNESS = MOMENTS[0] * (MOMENTS[0] - FIRST_WHEEL) / FIRST_WHEEL
# The second wheel makes K equal about both axles.
WHEELS = (FIRST_WHEEL, MOMENTS[1] ** 2 / (STIFFNESS + MOMENTS[1]))
OPTIONS = {"rates_at_ends": "free", "limits": Limits(rate_limits=None), "search": Search(pieces=40)}


@pytest.fixture
def craft(load_urdf):
    body = load_urdf(urdf(link("hub", 20.0, MOMENTS)))
    for name, axis, inertia in zip(("first", "second"), np.eye(3), WHEELS, strict=False):
        body = body.with_wheel(axis, inertia, name=name)
    return body


def slope_of(angle):
    """|omega| in units of the rate at which its direction turns, where one round turns the body by an angle."""
    return np.sqrt((1.0 + angle / (2.0 * np.pi)) ** 2 - 1.0)


def turned_by_a_circle(angle):
    """What omega = (s cos t, s sin t, 0) makes in a round: exp(2 pi (s, 0, 1)^), the axis leans from the third."""
    return so3.exp(2.0 * np.pi * np.array([slope_of(angle), 0.0, 1.0]))


def meetings(angle, until):
    """Conjugate times of the circle, in rounds: where its neighbours, of which all extremals near it are made, meet.

    omega turns by psi = t + any sum of 1, t, cos t, sin t (an elastica's, linearised), at any speed.
    """
    nodes, weights = np.polynomial.legendre.leggauss(60)

    def crossing(rounds):
        t, weight = np.pi * rounds * (nodes + 1.0), np.pi * rounds * weights
        along, across = np.zeros((2, len(t), 3))
        along[:, 0], along[:, 1], across[:, 0], across[:, 1] = np.cos(t), np.sin(t), -np.sin(t), np.cos(t)
        turns = so3.exp(t[:, None] * [slope_of(angle), 0.0, 1.0]) @ so3.exp(-t[:, None] * [0.0, 0.0, 1.0])
        changes = [along, *(part[:, None] * across for part in (np.ones_like(t), t, np.cos(t), np.sin(t)))]
        return np.linalg.det([np.append(weight @ part[:, :2], weight @ so3.apply(turns, part)) for part in changes])

    times = np.linspace(0.3, until, 60)
    signs = np.sign([crossing(time) for time in times])
    places = np.flatnonzero(signs[1:] != signs[:-1])
    return [brentq(crossing, times[k], times[k + 1], xtol=1e-13) for k in places]


def check_circle(craft, path, angle):
    """The extremal next to a path, against the closed forms of the circle that turns the body by an angle."""
    exact = shoot(craft, path, turned_by_a_circle(angle))
    np.testing.assert_allclose(exact.cost, 0.5 * STIFFNESS * angle * (4.0 * np.pi + angle), rtol=1e-11)
    # The charge along the turn is the slope of the cost.
    axis = so3.normalised(np.array([slope_of(angle), 0.0, 1.0]))
    np.testing.assert_allclose(exact.charge @ axis, STIFFNESS * (2.0 * np.pi + angle), rtol=1e-9)
    # A circle, in angles that the base turns by.
    shapes = exact.shape(np.arange(32) / 32.0) * np.array(WHEELS) / MOMENTS[:2]
    np.testing.assert_allclose(np.linalg.norm(shapes - shapes.mean(axis=0), axis=1), slope_of(angle), rtol=1e-9)
    found = [meeting.time for meeting in conjugate_times(exact, until=2.0)]
    np.testing.assert_allclose(found, meetings(angle, 2.0), rtol=1e-7)
    assert found[0] > 1.0


def test_the_circle_of_two_wheels_is_an_extremal_of_any_size(craft):
    """From a circle of other size and place: its turn is known, and it has conjugate times beyond its end."""
    loop = small_loop(craft, [0.3, -2.0])
    np.testing.assert_allclose(loop.cost(1e-3), 2e-3 * np.pi * STIFFNESS, rtol=1e-13)
    path, size = loop.path(1.0), np.sqrt(1.0 + 1.0 / np.pi)
    turn = sp.holonomy(craft, path, 1e-12)
    np.testing.assert_allclose(so3.angle(turn), 2.0 * np.pi * (size - 1.0), rtol=1e-11)
    first, second = 1.05 * slope_of(1.0) * np.array(MOMENTS[:2]) / WHEELS
    check_circle(craft, sp.ShapePath.fourier([0.0, 0.0], [[0.0], [second]], [[-first], [0.0]], 1.0), 1.0)


def test_the_circle_of_two_wheels_ceases_to_be_cheapest_where_it_turns_the_body_right_round(craft):
    """At the charge 2 pi K (s, 0, 1) the wheels draw it from rates along the first axle."""
    angle = 2.0 * np.pi
    slope = slope_of(angle)
    rate = [-2.0 * np.pi * slope * MOMENTS[0] / WHEELS[0], 0.0]
    charge = 2.0 * np.pi * STIFFNESS * np.array([slope, 0.0, 1.0])
    path = extremal(craft, [0.0, 0.0], rate, charge, 1.0, tolerance=1e-13)
    np.testing.assert_allclose(path.shape(1.0), 0.0, atol=1e-9)
    np.testing.assert_allclose(path.attitude(1.0), np.eye(3), atol=1e-9)
    np.testing.assert_allclose(path.cost, 0.5 * STIFFNESS * angle * (4.0 * np.pi + angle), rtol=1e-12)
    times = [meeting.time for meeting in conjugate_times(path, until=1.5)]
    np.testing.assert_allclose(times, meetings(angle, 1.5), rtol=1e-7)
    np.testing.assert_allclose(times[0], 1.0, rtol=1e-7)


@pytest.mark.full
@pytest.mark.parametrize("angle", [0.3, 1.0, 2.5])
def test_the_cheapest_loop_of_two_wheels_is_a_circle(craft, angle):
    """theory of reorientation: K theta (4 pi + theta) / (2 T); the spline's error falls with the fourth power."""
    plan = plan_reorientation(craft, turned_by_a_circle(angle), **OPTIONS)
    assert plan.goal_error < 1e-9
    np.testing.assert_allclose(plan.cost, 0.5 * STIFFNESS * angle * (4.0 * np.pi + angle), rtol=5e-9)
    assert wong_residual(craft, plan.path).residual < 1e-3
    check_circle(craft, plan.path, angle)


GOALS = {
    "about the third axis": [0.0, 0.0, 1.0],
    "a half turn, nearly": [0.0, 0.0, 2.5],
    "about no axis of the body": [0.4, -0.3, 0.8],
    "in the plane of the wheels": [0.5, 0.7, 0.0],
}


@pytest.mark.full
@pytest.mark.parametrize("goal", GOALS.values(), ids=GOALS)
def test_wheels_that_need_not_come_back_take_the_shortest_way_of_the_rotations(craft, goal):
    """Half the square of the sub-Riemannian distance: K theta (4 pi - theta) / (2 T) about the third axis."""
    plan = plan_reorientation(craft, so3.exp(np.array(goal)), end="free", **OPTIONS)
    metric = axisymmetric_metric(STIFFNESS, np.inf)
    np.testing.assert_allclose(plan.cost, 0.5 * metric.distance(so3.exp(np.array(goal))) ** 2, rtol=5e-9)
