"""Turns drawn by a seed on small bodies: from rest to rest within rate limits, judged as in `benchmarks/plans.py`."""

from __future__ import annotations

import pytest
from benchmarks.plans import REACHED, SEED, judged, turns

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
