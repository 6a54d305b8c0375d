"""Turns drawn by a seed on small bodies: from rest to rest within rate limits, judged as in `benchmarks/plans.py`."""

from __future__ import annotations

import pytest
from benchmarks.plans import REACHED, SEED, body_named, judged, turns

import shapephase as sp
from shapephase import so3
from shapephase.errors import PlanNotFound
from shapephase.optimal_control import Limits, Search, plan_reorientation

SMALL = {"planar3": 1, "hinged_pair": 2, "cat_two_halves": 2, "two_armed_satellite": 1}


def first_turns():
    """Of each body, by the number of its turn."""
    left = dict(SMALL)
    for number, (name, turn) in enumerate(turns(SEED)):
        if left.get(name):
            left[name] -= 1
            yield pytest.param(name, turn, id=f"{name} {number}")


@pytest.mark.full
@pytest.mark.parametrize(("name", "turn"), list(first_turns()))
def test_goals_are_reached_within_limits(name, turn):
    row = judged(name, turn)
    assert row["said"] == ""
    assert row["miss"] < REACHED
    assert row["beyond"] < 1e-6
    assert row["kkt"] < 1e-6


@pytest.mark.full
def test_pieces_that_are_too_coarse_are_halved():
    """The satellite's wheel is so fast that twenty pieces miss this goal by 0.8 mrad; on given pieces it stays so."""
    name, turn = turns(SEED)[16]
    row = judged(name, turn)
    assert row["said"] == ""
    assert row["miss"] < REACHED
    body, limits = body_named(name), Limits(rate_limits=sp.load_body(name).rate_limits)
    with pytest.raises(PlanNotFound, match="goal"):
        plan_reorientation(body, so3.exp(turn), duration=row["duration"], limits=limits, search=Search(pieces=20))
