"""Plans of reorientation: they reach the goal within the limits, at the least cost."""

from __future__ import annotations

import re
import signal

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import BSpline

import shapephase as sp
from shapephase import so3
from shapephase.errors import (
    AccuracyNotReached,
    PlanNotFound,
    ShapeError,
    TrajectoryError,
    UnknownNameError,
    UnstatedLimitWarning,
)
from shapephase.examples.scenarios import kane_scher
from shapephase.optimal_control import (
    Goal,
    Limits,
    Search,
    conjugate_times,
    path_cost,
    plan_reorientation,
    shoot,
    symbolic_body,
    wong_residual,
)
from shapephase.optimal_control.task import reorientation
from support.bodies import joint, link, urdf
from support.independent import apart, pinocchio_motion
from support.long_runs import full_but

# What is planned is the same with and without machine code, which is quicker.
HALF_TURN = so3.exp(np.array([np.pi, 0.0, 0.0]))
AXIS = [[0.0, 0.0, 2.0], [0.0, 0.0, -1.0]]
# As the theory of optimal loops has it.
FREE = {"rates_at_ends": "free", "limits": Limits(rate_limits=None)}
RIGHTINGS = [(0, 59.426459), (10, 60.036246), (20, 61.813873), (30, 64.618733), (45, 70.316222), (60, 77.132402)]
CASES = {
    "kinetic": (HALF_TURN, {}),
    "rate": (HALF_TURN, {"cost": "rate"}),
    "acceleration": (HALF_TURN, {"cost": "acceleration"}),
    "time": (HALF_TURN, {"cost": "time", "limits": Limits(rate_limits=[15.0, 20.0, 25.0])}),
    "limited rates": (HALF_TURN, {"limits": Limits(rate_limits=13.0)}),
    "momentum": (so3.exp(np.array([0.5, 0.4, 0.3])), {"momentum": [0.01, 0.0, 0.02]}),
    "momentum in least time": (
        so3.exp(np.array([0.2, 0.1, -0.3])),
        {"momentum": [0.001, 0.0, 0.002], "cost": "time", "limits": Limits(rate_limits=20.0)},
    ),
    "free end": (HALF_TURN, {"end": "free"}),
    "free rates": (HALF_TURN, FREE),
    "periodic": (HALF_TURN, {"rates_at_ends": "periodic"}),
    "another end": (HALF_TURN, {"start": [0.2, 0.0, 0.0], "end": [0.0, 0.3, -0.1]}),
    "axis": (Goal(pointing=AXIS), {}),
    "two joints": (HALF_TURN, {"joints": ["waist_pitch", "waist_yaw"], "start": [0.0, 0.0, 0.2]}),
    "coupled": (
        so3.exp(np.array([0.0, 0.3, 0.0])),
        {"symmetric": {"waist_roll": ("waist_pitch", -0.5)}, "end": "free"},
    ),
}
QUICK = ("momentum",)
LARGE = [
    ("cat", np.array([np.pi, 0.0, 0.0])),
    *(("astronaut", axis * np.pi / 2) for axis in np.eye(3)),
]


def rotor(load_urdf):
    """A wheel about z on a body: J = 0.5 of I = 4.5 kg m^2."""
    text = urdf(
        link("hub", 1.0, (3.0, 3.5, 4.0)),
        link("wheel", 0.5, (0.3, 0.3, 0.5)),
        joint("spin", "continuous", "hub", "wheel"),
    )
    return load_urdf(text)


@pytest.mark.parametrize(
    "name", [*QUICK, *(pytest.param(name, marks=pytest.mark.full) for name in CASES if name not in QUICK)]
)
def test_a_plan_reaches_its_goal_within_its_limits(name, request):
    """By Pinocchio's centroidal momentum and SciPy's integrator, with nothing of the library but the path."""
    if name in QUICK:
        request.getfixturevalue("few_guesses")
    target, options = CASES[name]
    body = sp.load_body("cat_two_halves")
    plan = plan_reorientation(body, target, search=Search(pieces=12 if name in QUICK else 40), **options)
    momentum = options.get("momentum", np.zeros(3))
    truth = pinocchio_motion("cat_two_halves", body.joint_names, plan.path, momentum, breaks=plan.path.breaks[1:-1])
    end = truth.attitude[-1]
    if not isinstance(target, Goal):
        assert apart(end, target) < 1e-8
    else:
        axis, direction = so3.normalised(np.asarray(AXIS))
        assert np.linalg.norm(end @ axis - direction) < 1e-8
    assert plan.goal_error < 1e-8
    assert plan.starts[0].converged
    assert plan.kkt_residual < 1e-6
    shapes, rates = plan.path.shape(plan.path.sample_times), plan.path.rate(plan.path.sample_times)
    lower, upper = body.joint_limits.T
    assert np.all((shapes >= lower) & (shapes <= upper))
    rate_limits = options.get("limits", Limits()).rate_limits
    if isinstance(rate_limits, str):
        rate_limits = body.rate_limits
    assert rate_limits is None or np.all(np.abs(rates) <= rate_limits * (1.0 + 1e-6))
    at_ends = options.get("rates_at_ends", "zero")
    if at_ends == "zero":
        assert_allclose(rates[[0, -1]], 0.0, atol=1e-8)
    else:
        assert np.abs(rates[[0, -1]]).max() > 0.1
    if at_ends == "periodic":
        assert_allclose(rates[0], rates[-1], atol=1e-8)
    start = np.asarray(options.get("start", np.zeros(3)))
    assert_allclose(shapes[0], start, atol=1e-12)
    end = options.get("end", start)
    if not isinstance(end, str):
        assert_allclose(shapes[-1], end, atol=1e-12)
    if name == "acceleration":
        ends = np.array([0.0, 1.0])
        bends = (plan.path.rate(np.abs(ends - 1e-6)) - plan.path.rate(ends)) / 1e-6
        assert np.abs(bends).max() < 1e-3 * np.abs(rates).max()
    if name == "two joints":
        assert_allclose(shapes[:, 2], 0.2, atol=1e-12)
    if name == "coupled":
        assert_allclose(shapes[:, 2], -0.5 * shapes[:, 0], atol=1e-12)


@pytest.mark.full
@pytest.mark.parametrize(("name", "turn"), LARGE)
def test_cat_and_astronaut_from_default_arguments(name, turn):
    body = sp.load_body(name)
    target = so3.exp(turn)
    plan = plan_reorientation(body, target)
    times = plan.path.breaks
    truth = pinocchio_motion(name, body.joint_names, plan.path, np.zeros(3), breaks=times[1:-1])
    assert apart(truth.attitude[-1], target) < 1e-8
    shapes = plan.path.shape(np.linspace(0.0, 1.0, 2001))
    lower, upper = body.joint_limits.T
    assert max(np.max(lower - shapes), np.max(shapes - upper)) < 1e-15, "beyond a limit by more than rounding"
    assert plan.kkt_residual < 1e-6


@pytest.mark.full
@pytest.mark.parametrize(("alpha", "beta"), RIGHTINGS)
def test_no_dearer_than_kane_and_scher(alpha, beta):
    """With the first posture of their righting at both ends, and its own rotation."""
    body = sp.load_body("cat_two_halves")
    theirs = kane_scher(np.radians(alpha), np.radians(beta))
    target = sp.holonomy(body, theirs, 1e-11)
    plan = plan_reorientation(body, target, start=theirs.shape(0.0), **FREE)
    assert plan.cost <= path_cost(body, theirs) * (1.0 + 1e-6)
    if alpha == 0:
        # Bent without a lean theirs is the best: a circle of the curvature's symmetry.
        assert plan.cost == pytest.approx(path_cost(body, theirs), rel=1e-6)


@pytest.mark.full
def test_twenty_starts_find_nothing_better():
    body = sp.load_body("cat_two_halves")
    one = plan_reorientation(body, HALF_TURN, **FREE)
    many = plan_reorientation(body, HALF_TURN, search=Search(starts=20, seed=3), **FREE)
    assert len(many.starts) == 20
    assert one.cost <= 1.01 * many.cost
    assert many.cost <= one.cost * (1.0 + 1e-9)
    assert many.cost == pytest.approx(min(start.cost for start in many.starts if start.converged), rel=1e-4)


def test_the_cost_of_a_steady_loop():
    """alpha = 0: in the frame of the bend nothing changes, so the energy is constant; and quadratic in the pace."""
    body = sp.load_body("cat_two_halves")
    path = kane_scher(0.0, np.radians(59.426459), 2.0)
    times = np.linspace(0.0, 2.0, 7)
    still = np.array(
        [
            body.kinetic_energy(r, v, -sp.mechanical_connection(body, r) @ v)
            for r, v in zip(path.shape(times), path.rate(times))
        ]
    )
    assert_allclose(still, still[0], rtol=1e-12)
    assert path_cost(body, path) == pytest.approx(2.0 * still[0], rel=1e-12)
    assert path_cost(body, path.stretched(3.0)) == pytest.approx(path_cost(body, path) / 3.0, rel=1e-12)


@pytest.mark.parametrize("degrees", [1.0, *(pytest.param(size, marks=pytest.mark.full) for size in (0.1, 0.01))])
@pytest.mark.usefixtures("few_guesses")
def test_small_turns_are_isoperimetric_circles(degrees):
    """E T sigma/(2 pi theta) -> 1; sigma is the curvature's largest singular value in the kinetic metric."""
    body = sp.load_body("cat_two_halves")
    metric = symbolic_body(body).shape_metric(np.zeros(3)).full()
    root = np.linalg.inv(np.linalg.cholesky(metric))
    sigma = np.linalg.norm(root @ sp.curvature(body, np.zeros(3))[..., 0] @ root.T, 2)
    theta = np.radians(degrees)
    plan = plan_reorientation(
        body, so3.exp(np.array([theta, 0.0, 0.0])), duration=0.7, search=Search(pieces=20), **FREE
    )
    assert plan.cost * 0.7 * sigma / (2.0 * np.pi * theta) == pytest.approx(1.0, abs=0.0045 * degrees + 5e-6)


@pytest.mark.usefixtures("few_guesses")
def test_a_rotor_in_closed_form(load_urdf):
    """The wheel goes 9 times as far as the body turns back, evenly where nothing else is asked for."""
    body = rotor(load_urdf)
    turn, period = 1.2, 2.0
    target, way = so3.exp(np.array([0.0, 0.0, turn])), -9.0 * turn
    common = {"end": "free", "duration": period, **FREE}
    plan = plan_reorientation(body, target, **common)
    times = np.linspace(0.0, period, 17)
    assert_allclose(plan.path.shape(times)[:, 0], way * times / period, atol=1e-8)
    assert plan.cost == pytest.approx(0.5 * (0.5 - 0.5**2 / 4.5) * way**2 / period, rel=1e-12)
    by_rate = plan_reorientation(body, target, cost="rate", **common)
    assert by_rate.cost == pytest.approx(0.5 * way**2 / period, rel=1e-12)
    for one in (plan, by_rate):
        assert one.starts[0].cost == pytest.approx(one.cost, rel=1e-9), "the program counts as the quadrature does"
    limits = Limits(rate_limits=4.0)
    common = {"end": "free", "duration": 5.0, "rates_at_ends": "free"}
    fast = plan_reorientation(body, target, cost="time", limits=limits, **common)
    assert fast.path.duration == pytest.approx(abs(way) / 4.0, rel=1e-9)
    assert fast.cost == fast.path.duration


@pytest.mark.parametrize(("cost", "end"), [("rate", "free"), ("acceleration", "free"), ("acceleration", "given")])
@pytest.mark.usefixtures("few_guesses")
def test_a_rotor_from_rest_to_rest(load_urdf, cost, end):
    """The best control points of a spline at rest at its ends are linear equations; nothing beats the cubic.

    The integral of half the squared acceleration from rest to rest is at least 6 way^2/T^3, that of the rate at least
    way^2/2T; a spline that also begins without acceleration comes nearer the more pieces it has.
    """
    body, turn, period = rotor(load_urdf), 1.2, 2.0
    target, way = so3.exp(np.array([0.0, 0.0, turn])), -9.0 * turn
    order, still, least = {"rate": (1, 2, 0.5 * way**2 / period), "acceleration": (2, 3, 6.0 * way**2 / period**3)}[
        cost
    ]
    limits, costs = Limits(rate_limits=None), []
    for pieces in (12, 24):
        plan = plan_reorientation(
            *(body, target), cost=cost, duration=period, limits=limits, search=Search(pieces=pieces),
            end="free" if end == "free" else [way],
        )  # fmt: skip
        ends = np.array([0.0, period])
        assert np.abs(plan.path.rate(ends)).max() < 1e-9 * abs(way)
        knots = np.concatenate([np.zeros(4), np.linspace(0.0, 1.0, pieces + 1)[2:-2], np.ones(4)])
        places, weights = np.polynomial.legendre.leggauss(6)
        ends = np.unique(knots)
        places = (0.5 * (ends[1:] + ends[:-1])[:, None] + 0.5 * np.diff(ends)[:, None] * places).ravel()
        weights = (0.5 * np.diff(ends)[:, None] * weights).ravel()
        slopes = BSpline(knots, np.eye(pieces + 1), 3).derivative(order)(places)
        gram = slopes.T @ (weights[:, None] * slopes)
        points = np.concatenate([np.zeros(pieces + 1 - still), np.full(still, way)])
        inner = slice(still, pieces + 1 - still)
        points[inner] = np.linalg.solve(gram[inner, inner], -gram[inner] @ points)
        assert plan.cost == pytest.approx(0.5 * points @ gram @ points / period ** (2 * order - 1), rel=1e-9)
        costs.append(plan.cost / least)
    assert 1.0 < costs[1] < costs[0] < 2.5


@pytest.mark.parametrize(
    ("goal", "momentum", "match"),
    [
        ({"somersaults": 1}, 0.0, "momentum"),
        ({"somersaults": 1}, [0.0, 0.0, 1.0], "right angles"),
        ({"half_twists": 1, "rotation": np.eye(3)}, [0.0, 1.0, 0.0], "leave the others None"),
        ({}, 0.0, "rotation"),
    ],
)
def test_windings_need_a_momentum_at_right_angles(goal, momentum, match):
    with pytest.raises(ShapeError, match=match):
        plan_reorientation(sp.load_body("diver"), Goal(**goal), momentum=momentum)


@pytest.mark.parametrize("cost", full_but(["kinetic", "time"], "time"))
@pytest.mark.usefixtures("few_guesses")
def test_too_short_a_time(cost, load_urdf):
    """The wheel needs 2.7 s at 4 rad/s."""
    with pytest.raises(PlanNotFound) as failure:
        plan_reorientation(
            rotor(load_urdf),
            so3.exp(np.array([0.0, 0.0, 1.2])),
            end="free",
            duration=2.0,
            cost=cost,
            limits=Limits(rate_limits=4.0),
            search=Search(iterations=60, pieces=20),
        )
    assert max(start.iterations for start in failure.value.best.starts) <= 60


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_the_same_seed_gives_the_same_plan():
    body = sp.load_body("cat_two_halves")
    search = Search(seed=7, starts=2, pieces=10)
    first, second = (plan_reorientation(body, HALF_TURN, search=search) for _ in range(2))
    assert np.array_equal(first.coefficients, second.coefficients)
    assert [start.cost for start in first.starts] == [start.cost for start in second.starts]


@pytest.mark.usefixtures("few_guesses")
def test_nothing_to_turn_costs_nothing():
    plan = plan_reorientation(sp.load_body("cat_two_halves"), np.eye(3), search=Search(pieces=20))
    assert plan.cost == pytest.approx(0.0, abs=1e-12)
    assert plan.goal_error < 1e-8


@pytest.mark.parametrize(
    ("options", "error", "match"),
    [
        ({"pieces": 5}, ShapeError, "pieces"),
        ({"starts": 0}, ShapeError, "starts"),
        ({"iterations": 1.5}, ShapeError, "iterations"),
        ({"seed": -1}, ShapeError, "seed"),
    ],
)
def test_a_search_that_makes_no_sense_is_refused(options, error, match):
    with pytest.raises(error, match=match):
        Search(**options)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"rotation": np.eye(2)}, "rotation"),
        ({"rotation": np.eye(3)[None, None]}, "one rotation"),
        ({"rotation": -np.eye(3)}, "reflection"),
        ({"pointing": [[0, 0, 0], [0, 0, 1]]}, "not zero"),
        ({"pointing": [0, 0, 1]}, "pointing"),
        ({"rotation": np.eye(3), "pointing": AXIS}, "leave the others None"),
        ({"somersaults": np.nan}, "somersaults"),
        ({"half_twists": 1, "twist_axis": [0, 0, 0]}, "twist_axis"),
        ({}, "needed"),
    ],
)
def test_a_goal_that_makes_no_sense_is_refused(options, match):
    with pytest.raises(ShapeError, match=match):
        Goal(**options)


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"rate_limits": 0.0}, "rate_limits"),
        ({"rate_limits": [-1.0, 1.0, 1.0]}, "rate_limits"),
        ({"rate_limits": np.ones((2, 2))}, "rate_limits"),
        ({"joint_limits": 1}, "True"),
        ({"rate_limits": "bodies"}, "body"),
    ],
)
def test_limits_that_make_no_sense_are_refused(options, match):
    with pytest.raises((ShapeError, UnknownNameError), match=match):
        Limits(**options)


def test_rate_limits_of_another_body_are_refused():
    with pytest.raises(ShapeError, match="joints"):
        plan_reorientation(sp.load_body("cat_two_halves"), HALF_TURN, limits=Limits(rate_limits=[1.0, 2.0]))


@pytest.mark.usefixtures("few_guesses")
def test_rates_that_no_file_states_are_told(load_urdf):
    """And those that it states hold: of the shipped body 20 rad/s, of a wheel without a limit none."""
    with pytest.warns(UnstatedLimitWarning, match="body"):
        plan = plan_reorientation(
            rotor(load_urdf), so3.exp(np.array([0.0, 0.0, 0.1])), end="free", cost="rate", search=Search(pieces=10)
        )
    assert plan.rates_at_ends == "zero"
    task = reorientation(sp.load_body("cat_two_halves"), HALF_TURN)
    assert_array_equal(task.rate_limit, [20.0, 20.0, 20.0])


@pytest.mark.parametrize("rates", ["still", "periodic"])
def test_rates_at_ends_that_make_no_sense_are_refused(rates):
    with pytest.raises((UnknownNameError, TrajectoryError), match=r"zero, periodic, free|is for loops"):
        plan_reorientation(sp.load_body("cat_two_halves"), HALF_TURN, end="free", rates_at_ends=rates)


@pytest.mark.usefixtures("few_guesses")
def test_too_fast_for_the_joints_says_how_much_time_to_give(load_urdf):
    with pytest.raises(PlanNotFound, match="joints"):
        plan_reorientation(
            rotor(load_urdf),
            so3.exp(np.array([0.0, 0.0, 1.2])),
            end="free",
            cost="rate",
            limits=Limits(rate_limits=4.0),
            search=Search(iterations=40, pieces=10),
        )


def test_an_axis_to_be_pointed_needs_a_goal():
    with pytest.raises(ShapeError, match="Goal"):
        plan_reorientation(sp.load_body("cat_two_halves"), AXIS)


def test_goals_and_limits_keep_copies_that_cannot_change():
    turn, rates = HALF_TURN.copy(), np.array([1.0, 2.0, 3.0])
    goal, limits = Goal(rotation=turn), Limits(rate_limits=rates)
    turn[0, 0], rates[0] = 5.0, 5.0
    assert_allclose(goal.rotation, HALF_TURN, atol=1e-15)
    assert limits.rate_limits[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        limits.rate_limits[0] = 5.0


def test_the_cost_of_a_wavy_path_without_breaks():
    body = sp.load_body("cat_two_halves")
    names = body.joint_names
    frequency = 2.0 * np.pi * 40.0

    def curve(times):
        turn = frequency * times[:, None]
        return 0.01 * np.sin(turn) * [1.0, 2.0, 0.0], 0.01 * frequency * np.cos(turn) * [1.0, 2.0, 0.0]

    path = sp.ShapePath.function(curve, 1.0, joint_names=names)
    assert path_cost(body, path, "rate") == pytest.approx(0.25 * (0.01 * frequency) ** 2 * 5.0, rel=1e-12)


def test_the_cost_of_an_undeclared_jump_is_refused():
    body = sp.load_body("cat_two_halves")

    def curve(times):
        late = np.maximum(times - 1.0 / 3.0, 0.0)
        along = np.array([1.0, 0.0, 0.0])
        return (times - 0.7 * late)[:, None] * along, np.where(late > 0.0, 0.3, 1.0)[:, None] * along

    with pytest.raises(AccuracyNotReached, match="breaks"):
        path_cost(body, sp.ShapePath.function(curve, 1.0, joint_names=body.joint_names), "rate")


def test_the_cost_of_another_kind_is_refused():
    with pytest.raises(UnknownNameError, match="rate"):
        path_cost(sp.load_body("cat_two_halves"), kane_scher(0.0, 1.0), "time")


@pytest.mark.full
@pytest.mark.parametrize("cost", ["kinetic", "rate"])
@pytest.mark.usefixtures("few_guesses")
def test_a_plan_with_free_rates_is_an_extremal(cost):
    """Wong's equations hold, shooting finds the same optimum, and no conjugate time comes before its end, where the
    kernel has the dimension of the symmetries that fix start and target: one, the optima come in circles."""
    body, target = sp.load_body("cat_two_halves"), so3.exp(np.array([np.pi, 0.0, 0.0]))
    plan = plan_reorientation(body, target, cost=cost, **FREE)
    assert wong_residual(body, plan.path, metric=cost).residual < 1e-4
    found = shoot(body, plan.path, target, metric=cost)
    assert found.cost == pytest.approx(plan.cost, rel=1e-6)
    times = np.linspace(0.0, 1.0, 50)
    assert_allclose(found.shape(times), plan.path.shape(times), atol=1e-5)
    if cost == "kinetic":
        ((time, multiplicity),) = [(c.time, c.multiplicity) for c in conjugate_times(found, 1.2)]
        assert (round(time, 6), multiplicity) == (1.0, 1)


@pytest.mark.usefixtures("few_guesses")
def test_the_search_reports_progress_and_is_stopped_with_the_best_so_far():
    body = sp.load_body("cat_two_halves")
    turn = so3.exp(np.array([np.pi / 3.0, 0.0, 0.0]))
    search = Search(pieces=10)
    whole = plan_reorientation(body, turn, search=search)
    reported = []

    def callback(share, text):
        reported.append((share, text))
        return text.startswith("search: iteration 3,")

    with pytest.raises(PlanNotFound, match="stopped") as stopped:
        plan_reorientation(body, turn, search=search, progress=callback)
    shares, texts = zip(*reported, strict=True)
    assert re.fullmatch(r"search: iteration 3, off the goal by \d\.\de-\d\d rad, cost [\d.]+", texts[-1])
    assert {text.partition(" ")[0].rstrip(":") for text in texts[:-1]} == {"guesses", "search"}
    assert list(shares) == sorted(shares)
    assert (shares[0], shares[-1] < 1.0) == (0.0, True)
    best = stopped.value.best
    assert so3.angle(best.motion.final_attitude.T @ turn) < 1e-8
    assert whole.cost * (1.0 - 1e-6) < best.cost < 2.0 * whole.cost
    assert not best.starts[-1].converged
    assert best.cost == pytest.approx(path_cost(body, best.path), rel=1e-12)


@pytest.mark.usefixtures("few_guesses")
def test_a_search_stopped_among_its_guesses_keeps_one():
    goal = so3.exp(np.array([0.6, 0.0, 0.0]))
    with pytest.raises(PlanNotFound, match="stopped") as stopped:
        plan_reorientation(
            sp.load_body("cat_two_halves"),
            goal,
            search=Search(pieces=20),
            progress=lambda _, text: ": iteration 1," in text,
        )
    assert so3.angle(stopped.value.best.motion.final_attitude.T @ goal) < 1e-8


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_a_search_stopped_after_a_start_has_its_plan():
    body = sp.load_body("cat_two_halves")
    plan = plan_reorientation(
        body,
        HALF_TURN,
        search=Search(pieces=10, starts=3, seed=1),
        progress=lambda _, text: text.startswith("search 2 "),
    )
    assert [start.converged for start in plan.starts] == [True, False]
    assert plan.goal_error < 1e-8


class OutOfPatience(Exception):
    """Raised by the callback."""


@pytest.mark.parametrize("error", full_but([OutOfPatience, KeyboardInterrupt], OutOfPatience))
@pytest.mark.usefixtures("few_guesses")
def test_what_the_callback_raises_comes_through(error):
    def callback(_, text):
        if ": iteration 2," in text:
            raise error

    with pytest.raises(error):
        plan_reorientation(sp.load_body("cat_two_halves"), HALF_TURN, search=Search(pieces=10), progress=callback)


@pytest.mark.parametrize("seconds", [0.05, 0.6])
@pytest.mark.usefixtures("heard_ctrl_c")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_is_not_taken_for_a_failed_search(seconds):
    body = sp.load_body("cat_two_halves")
    before = signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    # Pressed again, since Python itself loses one that comes while it frees an object.
    signal.setitimer(signal.ITIMER_REAL, seconds, 0.5)
    try:
        with pytest.raises(KeyboardInterrupt):
            plan_reorientation(body, HALF_TURN, search=Search(starts=50))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.usefixtures("heard_ctrl_c")
@pytest.mark.parametrize("iteration", [0, 2])
def test_ctrl_c_in_an_iteration_is_raised_by_the_plan_and_handlers_stay_as_they_are(iteration):
    handlers = []

    def pressed(_, text):
        handlers.append(signal.getsignal(signal.SIGINT))
        if f": iteration {iteration}," in text:
            signal.raise_signal(signal.SIGINT)

    goal = sp.so3.exp(np.array([1.0, 0.0, 0.0]))
    with pytest.raises(KeyboardInterrupt):
        sp.plan_reorientation(sp.load_body("cat_two_halves"), goal, search=Search(pieces=8), progress=pressed)
    assert len(handlers) == iteration + 1
    assert set(handlers) == {signal.default_int_handler}
