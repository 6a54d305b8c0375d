"""Ways back: what a motion turned is undone, by MuJoCo too, within limits, and no dearer than playing it backwards."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.ways_back import DRIFTS, taken_back

import shapephase as sp
from shapephase import so3
from shapephase.errors import PlanNotFound, ShapeError, WrongObjectError
from shapephase.optimal_control import Limits, Search, undo
from support.independent import apart, random_rotation
from support.long_runs import full_but

COARSE = Search(pieces=12)


def swung(momentum=(0.0, 0.0, 0.0), *, share: float = 0.3) -> sp.Motion:
    """An open motion of the cat of two halves from rest to rest, at a share of its rate limits."""
    body = sp.load_body("cat_two_halves")
    shapes = [[0.0, 0.0, 0.1], [0.5, -0.4, 0.3], [-0.3, 0.6, 0.1], [0.2, 0.1, -0.1]]
    path = sp.ShapePath.waypoints([0.0, 0.3, 0.7, 1.0], shapes, joint_names=body.joint_names)
    used = (np.abs(path.rate(np.linspace(0.0, 1.0, 1001))) / body.rate_limits).max()
    along = sp.articulated(body, path.stretched(used / share))
    return sp.reconstruct(along, momentum, random_rotation(4), tolerance=1e-11)


def satisfied(row) -> None:
    """One way back of the benchmark, whose third word on its end is MuJoCo's."""
    assert row["miss"] < 1e-8
    assert row["mujoco"] < 1e-8
    assert row["keeps"], row["shares"]
    assert {"rate", "effort"} <= set(row["shares"])
    assert bool(row["momentum"]) == (row["backwards_miss"] > 1e-2)  # playing backwards undoes without momentum alone


@pytest.mark.usefixtures("few_guesses")
@pytest.mark.parametrize("number", full_but([0, 4, 5], 5))
def test_drifts_of_satellites_are_taken_back(number):
    satisfied(taken_back(number, pieces=10))


@pytest.mark.full
@pytest.mark.parametrize("number", range(DRIFTS))
def test_all_drifts_of_satellites_are_taken_back(number):
    row = taken_back(number)
    satisfied(row)
    if not row["momentum"]:
        assert row["cost"] <= row["backwards"] or not row["backwards_keeps"]


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
@pytest.mark.parametrize("cost", ["effort", "kinetic", "acceleration", "time"])
def test_costs_and_shares_of_a_way_back_are_those_of_its_plan(cost):
    """By a quadrature of the path and by one over the spline's places; rates by samples and by control points."""
    limits = Limits(effort_limits=2.0, acceleration_limits=200.0, jerk_limits=1e5)
    way = undo(swung(), cost=cost, limits=limits, search=COARSE).plan
    assert way.cost == pytest.approx(way.plan.cost, rel=1e-8)
    for name, share in way.limit_shares.items():
        theirs = way.plan.limit_shares[name]
        assert (0.8 if name == "rate" else 0.99) * theirs < share < theirs + 1e-6, name


@pytest.mark.usefixtures("few_guesses")
def test_played_backwards_at_any_pace():
    """The holonomy of a path run backwards is the inverse; a tenth of the pace has a hundredth of the cost by rate."""
    motion = swung()
    for factor in (1.0, 10.0):
        ways = undo(motion, duration=factor * motion.duration, cost="rate", search=COARSE)
        assert ways.backwards.undoes
        assert apart(ways.backwards.motion.final_attitude, motion.initial_attitude) < 1e-9
        assert apart(ways.plan.motion.final_attitude, motion.initial_attitude) < 1e-9
        assert ways.plan.cost <= ways.backwards.cost
        for way in (ways.backwards, ways.plan):
            ends = way.path.shape([0.0, way.path.duration])
            path = motion.deformation.description.path
            assert np.abs(ends - path.shape([path.duration, 0.0])).max() < 1e-9
        assert ways.backwards.path.duration == factor * motion.duration


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_limits_that_the_motion_exceeds_are_kept_by_the_plan():
    motion = swung(share=1.5)
    ways = undo(motion, duration=2.0 * motion.duration, search=COARSE)
    assert ways.backwards.limit_shares["rate"] == pytest.approx(0.75, abs=1e-5)  # at half the pace
    ways = undo(motion, limits=Limits(rate_limits=0.9 * ways.backwards.peak_rates.max()), search=COARSE)
    assert not ways.backwards.keeps_limits
    assert ways.best is ways.plan
    assert ways.plan.keeps_limits


@pytest.mark.full
@pytest.mark.usefixtures("few_guesses")
def test_with_momentum_a_plan_undoes_at_a_given_time():
    motion = swung([0.002, 0.001, -0.002])
    with pytest.raises(ShapeError, match="duration"):
        undo(motion)
    ways = undo(motion, duration=1.5 * motion.duration, search=COARSE)
    assert not ways.backwards.undoes
    assert ways.best is ways.plan
    assert apart(ways.plan.motion.final_attitude, motion.initial_attitude) < 1e-8
    assert np.array_equal(ways.plan.motion.momentum, motion.momentum)
    # By SciPy's integrator and without the frame of the search.
    again = sp.reconstruct(
        sp.articulated(ways.plan.plan.body, ways.plan.path), motion.momentum, motion.final_attitude, method="dop853"
    )
    assert apart(again.final_attitude, motion.initial_attitude) < 1e-8


@pytest.mark.full
def test_a_search_without_result_leaves_playing_backwards():
    """Stopped at once, without momentum; with too little room for it, nothing is left."""
    ways = undo(swung(), search=COARSE, progress=lambda *_: True)
    assert (ways.plan, ways.best, ways.status) == (None, ways.backwards, "stopped")
    assert "stopped" in ways.failure
    with pytest.raises(PlanNotFound):
        undo(swung(), limits=Limits(rate_limits=0.5), search=COARSE, progress=lambda *_: True)


@pytest.mark.usefixtures("few_guesses")
def test_a_search_starts_from_a_path():
    """The wanted path itself is an optimum where nothing else is: the solver stays on it."""
    body = sp.load_body("cat_two_halves")
    first = sp.plan_reorientation(body, so3.exp(np.array([0.4, 0.0, 0.0])), search=COARSE)
    slow = first.path.stretched(3.0)
    again = sp.plan_reorientation(
        body, first.goal.rotation, search=Search(pieces=12, iterations=15, guess=slow), duration=1.0
    )
    assert len(again.starts) == 2
    assert again.starts[0].iterations <= 15
    assert again.cost == pytest.approx(first.cost, rel=1e-6)
    with pytest.raises(WrongObjectError, match="guess"):
        Search(guess=body)


def test_what_has_no_way_back(tmp_path):
    motion = swung()
    batch = sp.reconstruct(motion.deformation, np.zeros((2, 3)))
    with pytest.raises(ShapeError, match="batch"):
        undo(batch)
    motion.save(tmp_path / "motion.npz")
    for other in (sp.load_motion(tmp_path / "motion.npz"), sp.reconstruct(sp.rigid(np.eye(3), 1.0), [0.0, 0.0, 1.0])):
        with pytest.raises(WrongObjectError, match="a way back needs"):
            undo(other)
