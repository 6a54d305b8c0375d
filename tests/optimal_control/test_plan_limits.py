"""Plans within limits of accelerations, jerks and efforts, and those of least effort, between the nodes, too."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import shapephase as sp
from shapephase import so3
from shapephase.arrays import Array
from shapephase.errors import PlanNotFound, ShapeError, TrajectoryError, UnknownNameError, UnstatedLimitWarning
from shapephase.optimal_control import Goal, Limits, Plan, Search, plan_reorientation
from support.ball_bodies import BALLS
from support.bodies import joint, link, urdf
from support.independent import MujocoBody

TIMES = 4001
TURN = so3.exp(np.array([1.2, 0.0, 0.0]))
# Of two discs on one axle, and what the joint feels of both.
DISCS = (0.3, 0.5)
REDUCED = 0.3 * 0.5 / 0.8


@pytest.fixture
def discs(load_urdf):
    """The second turns against the first, which answers by 5/8 of that."""
    effort = '<limit effort="0.5" velocity="0"/>'
    first, second = (link(name, 1.0, (0.4, 0.4, moment)) for name, moment in zip("ab", DISCS, strict=True))
    return load_urdf(urdf(first, second, joint("axle", "continuous", "a", "b", extra=effort)))


def spun(body: sp.Body, angle: float, **options) -> Plan:
    """A plan that turns the first disc by an angle, the second wherever it comes to."""
    return plan_reorientation(
        body, so3.exp(np.array([0.0, 0.0, angle])), end="free", search=Search(pieces=16), **options
    )


def path_derivatives(plan: Plan) -> list[Array]:
    """Shapes, rates, accelerations and jerks at 4,001 times, by SciPy's spline through the ends of the pieces."""
    times = plan.path.breaks
    spline = CubicSpline(times, plan.path.shape(times), bc_type="not-a-knot")
    even = np.linspace(0.0, plan.path.duration, TIMES)
    return [spline(even, order) for order in range(4)]


def mujoco_torques(name: str, plan: Plan, momentum: Array) -> Array:
    """At 4,001 times, by `mj_inverse`; the base's acceleration by MuJoCo's forces, its attitude by the motion."""
    body = MujocoBody(name, plan.body.joint_names)
    shapes, rates, bends, _ = path_derivatives(plan)
    attitudes = plan.motion.attitude(np.linspace(0.0, plan.path.duration, TIMES))
    found = np.empty_like(shapes)
    for row, (shape, rate, bend, attitude) in enumerate(zip(shapes, rates, bends, attitudes, strict=True)):
        # Where the body is does not matter.
        body.place(np.zeros(3), attitude, shape)
        wanted = np.concatenate([np.zeros(3), attitude.T @ momentum])
        velocity = np.asarray(np.linalg.solve(body.base_mass(), wanted - body.carried(rate)), dtype=np.float64)
        body.move(velocity[:3], velocity[3:], rate)
        body.data.qacc[:] = body.full(np.linalg.solve(body.base_mass(), -body.base_force(bend)), bend)
        body.mujoco.mj_inverse(body.model, body.data)
        assert np.abs(body.data.qfrc_inverse[:6]).max() < 1e-9
        found[row] = body.data.qfrc_inverse[body.velocity]
    return found


@pytest.mark.parametrize(
    ("cost", "momentum", "limits"),
    [
        ("kinetic", 0.0, [0.14, 0.23, 0.03]),
        pytest.param("rate", 0.01, [0.5, 0.2, 0.12], marks=pytest.mark.full),
        pytest.param("effort", 0.0, [0.4, 0.4, 0.015], marks=pytest.mark.full),
        pytest.param("time", 0.0, [0.4, 0.4, 0.015], marks=pytest.mark.full),
    ],
)
def test_efforts_stay_within_their_limits_between_the_nodes(cost, momentum, limits, request):
    """At some three fifths of what the plan without limits needs, by MuJoCo; all of that is used."""
    if cost == "kinetic":
        request.getfixturevalue("few_guesses")
    body, mu = sp.load_body("cat_two_halves"), momentum * np.array([1.0, 0.5, -0.7])
    duration = 2.0 if cost == "time" else 1.0
    plan = plan_reorientation(
        body,
        TURN,
        momentum=mu,
        cost=cost,
        duration=duration,
        search=Search(pieces=12),
        limits=Limits(effort_limits=limits),
    )
    shares = np.abs(mujoco_torques("cat_two_halves", plan, mu)) / limits
    assert 0.999 < shares.max() < 1.0 + 1e-6
    assert plan.goal_error < 1e-8
    # The plan says so itself, at other times than these.
    assert plan.limit_shares["effort"] == pytest.approx(shares.max(), abs=1e-4)
    assert plan.hamiltonian_spread is None


@pytest.mark.usefixtures("few_guesses")
def test_accelerations_and_jerks_stay_within_their_limits():
    """Of SciPy's spline; from rest without acceleration, as a limit of jerks wants it."""
    body, search = sp.load_body("cat_two_halves"), Search(pieces=12)
    limits = Limits(acceleration_limits=[70.0, 70.0, 20.0], jerk_limits=1200.0)
    plan = plan_reorientation(body, TURN, search=search, limits=limits)
    _, _, bends, jerks = path_derivatives(plan)
    of_bends, of_jerks = np.abs(bends) / limits.acceleration_limits, np.abs(jerks) / 1200.0
    assert 0.999 < of_bends.max() < 1.0 + 1e-6
    assert 0.999 < of_jerks.max() < 1.0 + 1e-6
    assert plan.limit_shares["acceleration"] == pytest.approx(of_bends.max(), abs=1e-3)
    assert plan.limit_shares["jerk"] == pytest.approx(of_jerks.max(), abs=1e-6)
    assert np.abs(bends[[0, -1]]).max() < 1e-6 * np.abs(bends).max()
    assert plan.goal_error < 1e-8


@pytest.mark.usefixtures("few_guesses")
def test_least_effort_of_one_joint_is_a_cubic(discs):
    """x = X (3 s^2 - 2 s^3) makes the integral of x''^2 least from rest to rest: 12 X^2 / T^3."""
    plan = spun(discs, 0.5, cost="effort", duration=1.5, limits=Limits(rate_limits=None))
    far = 0.5 * 0.8 / 0.5
    assert plan.cost == pytest.approx((REDUCED / 0.5) ** 2 * 12.0 * far**2 / 1.5**3, rel=1e-9)
    assert plan.cost_unit == "s"
    s = np.linspace(0.0, 1.0, 11)
    expected = -far * (3.0 * s**2 - 2.0 * s**3)
    np.testing.assert_allclose(plan.path.shape(1.5 * s)[:, 0], expected, rtol=0, atol=1e-7)


@pytest.mark.usefixtures("few_guesses")
def test_the_least_time_of_a_jerk(discs):
    """From rest to rest without acceleration: j, -j, j for a quarter, a half and a quarter of (32 X / j)^(1/3)."""
    plan = spun(discs, 0.5, cost="time", duration=5.0, limits=Limits(rate_limits=50.0, jerk_limits=20.0))
    assert plan.cost == pytest.approx((32.0 * 0.8 / 20.0) ** (1.0 / 3.0), rel=1e-6)
    _, _, _, jerks = path_derivatives(plan)
    assert np.abs(jerks).max() < 20.0 * (1.0 + 1e-6)


@pytest.mark.usefixtures("few_guesses")
def test_the_least_time_of_an_effort_is_near_that_of_full_effort(discs):
    """Full effort one way, then the other, takes 2 (X J / tau)^(1/2); the acceleration of a spline has no jumps."""
    plan = spun(discs, 0.5, cost="time", duration=5.0, limits=Limits(rate_limits=50.0, effort_limits=0.4))
    bound = 2.0 * np.sqrt(0.8 * REDUCED / 0.4)
    assert bound < plan.cost < 1.05 * bound
    torque = REDUCED * path_derivatives(plan)[2]
    assert 0.999 < np.abs(torque).max() / 0.4 < 1.0 + 1e-6


@pytest.mark.usefixtures("few_guesses")
def test_coupled_joints_take_the_tightest_limit():
    """The follower moves half as far, against its leader."""
    body = sp.load_body("cat_two_halves")
    mirror = {"waist_roll": ("waist_pitch", -0.5)}
    most = np.array([30.0, 40.0, 10.0])
    target = so3.exp(np.array([0.0, 0.1, 0.0]))
    plan = plan_reorientation(
        body, target, symmetric=mirror, end="free", limits=Limits(acceleration_limits=most), search=Search(pieces=12)
    )
    bends = np.abs(path_derivatives(plan)[2]).max(axis=0)
    order = [body.joint_index(name) for name in ("waist_pitch", "waist_roll")]
    assert bends[order[1]] == pytest.approx(0.5 * bends[order[0]])
    assert np.all(bends <= most * (1.0 + 1e-6))


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_what_no_motor_can_do_is_told(discs):
    with pytest.raises(PlanNotFound, match="joints"):
        spun(discs, 0.05, duration=0.2, limits=Limits(rate_limits=None, effort_limits=0.1))


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        ({"limits": Limits(effort_limits=[1.0, 2.0])}, ShapeError, "one for each of the 3 joints"),
        ({"limits": Limits(jerk_limits=[1.0])}, ShapeError, "jerk_limits"),
    ],
)
def test_what_cannot_be_limited_is_refused(options, error, words):
    with pytest.raises(error, match=words):
        plan_reorientation(sp.load_body("cat_two_halves"), TURN, **options)


@pytest.mark.parametrize("name", ["acceleration_limits", "jerk_limits", "effort_limits"])
@pytest.mark.parametrize("value", [0.0, [1.0, -2.0], np.nan, "file", [[1.0]]])
def test_limits_that_are_none_are_refused(name, value):
    with pytest.raises((ShapeError, UnknownNameError), match=name):
        Limits(**{name: value})


@pytest.mark.usefixtures("few_guesses")
def test_efforts_that_no_file_states(discs, load_urdf):
    bare = load_urdf(
        urdf(link("a", 1.0, (0.4, 0.4, 0.3)), link("b", 1.0, (0.4, 0.4, 0.5)), joint("axle", "continuous", "a", "b"))
    )
    with pytest.raises(TrajectoryError, match="effort_limits"):
        spun(bare, 0.5, cost="effort", limits=Limits(rate_limits=None))
    with pytest.warns(UnstatedLimitWarning, match="states"):
        spun(bare, 0.5, limits=Limits(rate_limits=None, effort_limits="body"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        stated = spun(discs, 0.5, duration=2.0, limits=Limits(rate_limits=None, effort_limits="body"))
    torque = REDUCED * path_derivatives(stated)[2]
    assert stated.limit_shares["effort"] == pytest.approx(np.abs(torque).max() / 0.5, rel=1e-9)


def test_ball_joints_have_no_such_limits(tmp_path):
    file = tmp_path / "balls.urdf"
    file.write_text(BALLS)
    balls = sp.load_body(file)
    for limits in (Limits(acceleration_limits=1.0), Limits(effort_limits=1.0)):
        with pytest.raises(ShapeError, match="ball"):
            plan_reorientation(balls, Goal(rotation=TURN), limits=limits)
