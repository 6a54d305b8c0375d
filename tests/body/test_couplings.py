"""Joints that follow others by curves: against the same body with each joint driven by hand, and differences."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import shapephase as sp
from shapephase.body import Coupling
from shapephase.body.couplings.functions import cubic_spline
from shapephase.body.inertial_regressor import link_motions
from shapephase.body.inverse_dynamics import falling_efforts
from shapephase.body.momentum_gradients import by_shape_and_rate
from shapephase.cli.texts.result_text import body_lines
from shapephase.errors import ModelFileError, ShapeError, UnknownNameError
from support.coupled_bodies import KNOTS, LEG, TURN, TURNS, bounded, by_hand, couplings
from support.near import by_differences, near

EPS = np.finfo(float).eps


@pytest.fixture
def leg(load_urdf):
    """The body that follows, the free one, and how its joints go: with a spline in the patella's turn."""
    coupling, function = TURN["spline"]
    free = load_urdf(LEG)
    return free.with_couplings(couplings(coupling)), free, by_hand(bounded(function, KNOTS), free.joint_names)


def shapes_between_knots(rng, count):
    """Inside and beyond the knots, but not within a difference's step of one."""
    shapes = rng.uniform(-1.0, 1.0, (40 * count, 2))
    return shapes[np.abs(shapes[:, 1, None] - KNOTS).min(axis=1) > 0.02][:count]


# ---- Functions ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ends", ["not-a-knot", "natural"])
def test_a_spline_is_scipys_and_goes_on_straight(ends):
    function, other = cubic_spline(KNOTS, TURNS, ends), CubicSpline(KNOTS, TURNS, bc_type=ends)
    q = np.linspace(KNOTS[0], KNOTS[-1], 57)
    found = function(q)
    near(found.value, other(q))
    near(found.slope, other(q, 1), 2000.0)
    near(found.bend[1:-1], other(q, 2)[1:-1], 1e5)
    for end, side in ((0, -1.0), (-1, 1.0)):
        beyond = function(KNOTS[end] + side * np.array([0.1, 0.4]))
        near(beyond.value, TURNS[end] + side * np.array([0.1, 0.4]) * other(KNOTS[end], 1), 2000.0)
        near(beyond.slope, np.full(2, other(KNOTS[end], 1)), 2000.0)
        assert not beyond.bend.any()


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_a_spline_with_the_ends_of_four_points(count):
    """What defines it: it goes through the points, twice differentiable; at the ends the third derivative is that of
    the cubic through the four points there, with fewer points zero."""
    knots, values = KNOTS[:count], TURNS[:count]
    function = cubic_spline(knots, values, "four points")
    near(function(knots).value, values)
    before = function(np.nextafter(knots[1:-1], -np.inf))
    for name in ("value", "slope", "bend"):
        np.testing.assert_allclose(getattr(before, name), getattr(function(knots[1:-1]), name), rtol=0, atol=1e-12)
    for piece, some in ((1, slice(0, 4)), (count - 1, slice(-4, None))):
        third = np.polyfit(knots[some], values[some], 3)[0] if count > 3 else 0.0
        np.testing.assert_allclose(function.coefficients[3, piece], third, rtol=0, atol=1e-11)


def test_values_of_couplings():
    """MuJoCo's polynomial about references, a sum, a multiple and a lock."""
    equality = Coupling.constant(0.3) + Coupling.polynomial("a", [0.1, 0.2, -0.3, 0.4, 0.5], about=0.7)
    x = 1.3 - 0.7
    expected = 0.3 + 0.1 + 0.2 * x - 0.3 * x**2 + 0.4 * x**3 + 0.5 * x**4
    assert abs(equality.at({"a": 1.3}) - expected) < 8.0 * EPS
    both = equality.scaled(-2.0) + Coupling.piecewise_linear("b", [0.0, 1.0, 3.0], [1.0, 2.0, -2.0])
    assert abs(both.at({"a": 1.3, "b": 4.0}) - (-2.0 * expected - 4.0)) < 32.0 * EPS
    slope = 0.2 - 0.6 * x + 1.2 * x**2 + 2.0 * x**3
    assert abs(both.rate({"a": 1.3, "b": 0.5}, {"a": 0.5, "b": 2.0}) - (2.0 - slope)) < 32.0 * EPS
    assert both.drivers == ("a", "b")
    assert Coupling.constant(0.4).at({}) == 0.4


def test_the_steepest_slope_of_a_function():
    function = cubic_spline(KNOTS, TURNS, "natural")
    for low, high in ((-1.0, 1.0), (-0.1, 0.3), (0.36, 0.5), (-np.inf, np.inf)):
        q = np.linspace(max(low, -1.0), min(high, 1.0), 20001)
        steepest = np.abs(function(q).slope).max()
        assert steepest <= function.steepest(low, high) * (1.0 + 1e-12) <= steepest * (1.0 + 1e-6)


# ---- Bodies ---------------------------------------------------------------------------------------------------------


def test_inertia_and_momentum_are_those_of_joints_driven_by_hand(leg, rng):
    body, free, joints = leg
    assert body.joint_names == ("hip", "knee")
    shapes, rates = shapes_between_knots(rng, 6), rng.normal(size=(6, 2))
    full, speeds = joints(shapes, rates)
    near(body.locked_inertia(shapes), free.locked_inertia(full))
    near(body.centre_of_mass(shapes), free.centre_of_mass(full))
    near(body.internal_momentum(shapes, rates), free.internal_momentum(full, speeds), 2000.0)
    near(body.link_pose(shapes, "cap"), free.link_pose(full, "cap"))
    near(body.link_angular_velocity(shapes, rates, "cap"), free.link_angular_velocity(full, speeds, "cap"), 2000.0)
    near(body.kinetic_energy(shapes, rates), free.kinetic_energy(full, speeds), 2000.0)
    near(body.inertia_rate(shapes, rates), free.inertia_rate(full, speeds), 4000.0)
    for found, expected in zip(body.sample(shapes, rates), free.sample(full, speeds), strict=True):
        near(found, expected, 2000.0)
    there = link_motions(free.chain, full, speeds)
    for name in ("turns", "places", "speeds", "spins"):
        near(getattr(link_motions(body.chain, shapes, rates), name), getattr(there, name), 2000.0)


def test_gradients_are_those_by_differences(leg, rng):
    """Second derivatives of the couplings among them; differences of order six leave 1e-11."""
    body, _, _ = leg
    shapes, rates, spins = shapes_between_knots(rng, 5), rng.normal(size=(5, 2)), rng.normal(size=(5, 3))
    for found, function in (
        (body.inertia_gradient(shapes), body.locked_inertia),
        (body.momentum_matrix_gradient(shapes), body.momentum_matrix),
        (
            body.angular_momentum_gradient(shapes, rates, spins),
            lambda r: (body.locked_inertia(r) @ spins[:, :, None])[..., 0] + body.internal_momentum(r, rates),
        ),
    ):
        expected = by_differences(function, shapes)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_gradients_without_pinocchio(leg, rng):
    body, _, _ = leg
    count, shapes = 5, shapes_between_knots(rng, 5)
    rates, spins, rows = rng.normal(size=(count, 2)), rng.normal(size=(count, 1, 3)), rng.normal(size=(count, 1, 4, 3))
    links = link_motions(body.chain, shapes, rates)
    by_shape, by_rate = by_shape_and_rate(body.chain, links, shapes, rates, spins, rows)
    gradients = body.angular_momentum_gradient(shapes, rates, spins[:, 0])
    near(by_shape, rows[:, 0] @ np.swapaxes(gradients, 1, 2), 4000.0)
    near(by_rate, rows[:, 0] @ body.momentum_matrix(shapes), 4000.0)


def test_curvature_is_pulled_back(leg, rng):
    """F of the body that follows is that of the free one by the slopes of the couplings: second derivatives cancel."""
    body, free, joints = leg
    for shape in shapes_between_knots(rng, 4):
        slopes = np.stack([joints(shape[None], unit[None])[1][0] for unit in np.eye(2)], axis=1)
        expected = np.einsum(
            "ai,bj,abk->ijk", slopes, slopes, sp.curvature(free, joints(shape[None], shape[None])[0][0])
        )
        near(sp.curvature(body, shape), expected, 1e4)


def test_small_loops_turn_by_the_curvature(leg):
    """The rest falls with the third power of the side; a loop about a knot is one like others."""
    body, _, _ = leg
    shape, rest = np.array([0.3, KNOTS[2] + 0.05]), []
    field = sp.curvature(body, shape)[0, 1]
    for side in (0.04, 0.02):
        corners = shape + 0.5 * side * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
        turn = sp.holonomy(body, sp.ShapePath.waypoints(np.arange(5.0), corners), 1e-12)
        rest.append(sp.so3.angle(turn @ sp.so3.exp(side**2 * field)))
    assert 3.0 < np.log2(rest[0] / rest[1]) < 4.2


def test_couplings_are_kept_by_copies_of_a_body(leg, rng):
    body, free, joints = leg
    shapes, rates = shapes_between_knots(rng, 3), rng.normal(size=(3, 2))
    again = pickle.loads(pickle.dumps(body))
    assert np.array_equal(again.momentum_matrix(shapes), body.momentum_matrix(shapes))
    masses = {"thigh": 2.5}
    near(
        body.with_inertias(masses=masses).internal_momentum(shapes, rates),
        free.with_inertias(masses=masses).internal_momentum(*joints(shapes, rates)),
        2000.0,
    )
    family = body.with_inertias(masses={"thigh": [1.0, 2.5]})
    near(family.sample(shapes, rates)[1][1], family[1].internal_momentum(shapes, rates), 2000.0)


def test_couplings_are_added_one_after_the_other(leg, rng):
    body, free, _ = leg
    shapes = shapes_between_knots(rng, 3)
    stepwise = free
    for name, coupling in couplings(TURN["spline"][0]).items():
        stepwise = stepwise.with_couplings({name: coupling})
    assert np.array_equal(stepwise.locked_inertia(shapes), body.locked_inertia(shapes))
    locked = free.with_couplings({"hip": Coupling.constant(0.3), "knee": Coupling.linear("shoulder", 2.0, 0.1)})
    assert locked.joint_names == tuple(name for name in free.joint_names if name not in ("hip", "knee"))
    shape = {"shoulder": 0.2, "knee_slide": 0.05}
    near(locked.locked_inertia(locked.shape(shape)), free.locked_inertia(free.shape(shape | {"hip": 0.3, "knee": 0.5})))
    assert locked.chain.follows.is_linear


def test_limits_of_rates_hold_for_followers(load_urdf):
    """All joints of the file may go at 1."""
    free = load_urdf(LEG)
    body = free.with_couplings({"patella_turn": Coupling.piecewise_linear("knee", [0.0, 1.0, 2.0], [0.0, 3.0, 5.0])})
    assert free.rate_limits[free.joint_index("knee")] == 1.0
    np.testing.assert_allclose(body.rate_limits[body.joint_index("knee")], 1.0 / 3.0, rtol=1e-15)


def test_what_can_be_no_coupling_is_refused(load_urdf):
    free = load_urdf(LEG)
    with pytest.raises(UnknownNameError, match="kneee"):
        free.with_couplings({"kneee": Coupling.constant(0.0)})
    with pytest.raises(ModelFileError, match="'hip'"):
        free.with_couplings({"hip": Coupling.linear("ankle", 1.0)})
    circle = {"hip": Coupling.linear("knee", 1.0), "knee": Coupling.polynomial("hip", [0.0, 0.0, 1.0])}
    with pytest.raises(ModelFileError, match="circle"):
        free.with_couplings(circle)
    with pytest.raises(ShapeError, match="Coupling"):
        free.with_couplings({"hip": 0.5})  # pyright: ignore[reportArgumentType]
    for made, said in (
        (lambda: Coupling.spline("knee", [0.0, 1.0, 1.0], [0.0, 1.0, 2.0]), "knots must ascend: 1 follows 1"),
        (lambda: Coupling.piecewise_linear("knee", [0.0], [0.0]), "knots: from 2"),
        (lambda: Coupling.polynomial("knee", []), "coefficients: from 1"),
        (lambda: Coupling.polynomial("knee", [np.nan]), "coefficients"),
        (lambda: Coupling.spline(3, [0.0, 1.0], [0.0, 1.0]), "driver: the name of a joint is needed, got"),
    ):
        with pytest.raises(ShapeError, match=said):
            made()


def test_a_summary_says_who_follows_whom(leg):
    body, free, _ = leg
    rules = sp.body_summary(body).followers
    assert rules == {
        "knee_slide": "cubic in knee, 5 knots",
        "patella_turn": "cubic in knee, 5 knots",
        "patella_slide": "polynomial of degree 2 in patella_turn",
        "shoulder": "polynomial of degree 4 in hip - 0.5 knee + 0.2",
    }
    lines = body_lines(sp.body_summary(body))
    assert "patella_slide  polynomial of degree 2 in patella_turn" in lines
    locked = free.with_couplings({"hip": Coupling.constant(0.25)})
    assert sp.body_summary(locked).followers == {"hip": "locked at 0.25"}
    assert not any("follower" in line for line in body_lines(sp.body_summary(free)))


def test_efforts_are_those_of_all_joints_by_their_work(leg, rng):
    """Those of the free body, driven with the accelerations that the couplings have, weighted with the slopes."""
    body, free, joints = leg
    shapes, rates, accelerations = shapes_between_knots(rng, 4), rng.normal(size=(4, 2)), rng.normal(size=(4, 2))
    spins, spin_rates = rng.normal(size=(2, 4, 3))

    def speeds(t):
        return joints(shapes + t[:, :1] * rates + 0.5 * t[:, :1] ** 2 * accelerations, rates + t[:, :1] * accelerations)

    full, rate = speeds(np.zeros((4, 1)))
    slopes = by_differences(lambda t: speeds(t)[1], np.zeros((4, 1)))[:, 0]
    expected, wrenches = falling_efforts(free, full, rate, slopes, spins, spin_rates)
    fold = np.stack([joints(shapes, np.tile(unit, (4, 1)))[1] for unit in np.eye(2)], axis=-1)
    found, outside = falling_efforts(body, shapes, rates, accelerations, spins, spin_rates)
    expected = (expected[:, None] @ fold)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(outside, wrenches, rtol=0, atol=1e-9 * np.abs(wrenches).max())
    line = {"patella_turn": Coupling.piecewise_linear("knee", KNOTS, TURNS)}
    with pytest.raises(ShapeError, match="smoothly"):
        falling_efforts(free.with_couplings(line), shapes, rates, accelerations, spins, spin_rates)
