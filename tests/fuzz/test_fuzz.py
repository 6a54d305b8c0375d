"""A sample of the search for inputs that show a fault, with one seed; `make fuzz` searches on.

No input ends in a traceback, by a signal, after 10 s of processor time or beyond 2 GiB, and nothing is accepted that
the rules of the strict readers, written down once more in `rules` and `plain_readers`, do not allow.
"""

from __future__ import annotations

import pytest

from fuzz import finds, trajectory_finds
from fuzz.limited_process import LimitedProcess
from fuzz.pieces import Trial
from fuzz.search import GRAMMARS, SHARES, Tally, searched

CASES = {**finds.CASES, **trajectory_finds.CASES}
QUICK = {
    "delimited": 6,
    "opensim": 3,
    "yaml": 4,
    "names": 3,
    "npz": 5,
    "matlab": 2,
    "excel": 3,
    "urdf": 5,
    "mjcf": 3,
    "balls": 3,
    "ball columns": 4,
    "trajectory": 3,
    "study": 5,
}
FULL = 20


@pytest.fixture(scope="module")
def process(tmp_path_factory):
    started = LimitedProcess(tmp_path_factory.mktemp("fuzz"), long=False)
    yield started
    started.stop()


@pytest.mark.parametrize("grammar", QUICK)
def test_a_sample_shows_no_fault(grammar: str, process: LimitedProcess):
    tally = Tally()
    find = searched(process, grammar, QUICK[grammar], 20261123, tally)
    assert find is None, find
    assert tally.trials == QUICK[grammar]


@pytest.mark.full
@pytest.mark.parametrize("grammar", GRAMMARS)
def test_a_larger_sample_shows_no_fault(grammar: str, process: LimitedProcess):
    tally = Tally()
    find = searched(process, grammar, FULL * SHARES[grammar], 1, tally)
    assert find is None, find
    good = sum(found["accepted"] + found["exit 0"] for found in tally.outcomes.values())
    assert 0 < good < tally.trials, f"damage that nothing notices or nothing survives shows little\n{tally.table()}"


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.full) if c.slow else n for n, c in CASES.items()])
def test_a_find(name: str, process: LimitedProcess):
    case = CASES[name]
    answer = process.tried(case.make())
    assert not answer["faults"], answer
    assert answer["outcome"] == case.outcome, answer
    assert case.said in answer["message"]


def test_what_ends_badly_is_seen(process: LimitedProcess):
    """The examiner examined: a crash, and an error that is none of ours."""
    for kind, said in (("crash", "signal 11"), ("escape", "ZeroDivisionError")):
        answer = process.tried(Trial(kind=kind, source="none"))
        assert any(said in fault for fault in answer["faults"]), answer
