"""Hostile and odd files given to the command line, each in a process of its own.

It ends by itself, with a documented code and one line for the fault: never a signal, a traceback, a NaN or a gigabyte.
"""

from __future__ import annotations

import json
import math

import pytest

import shapephase as sp
from shapephase.errors import TrajectoryError
from support.hostile_files import cases
from support.loading_process import MOST_MEMORY, Worker
from support.long_runs import full_but
from support.odd_motion_files import ODD_FILES, odd_file

CASES_OF_BODIES = cases()
# Of the odd motions, all of which test_read.py reads in this process, and of the bodies, as test_hostile_files.py does.
QUICK_MOTIONS, QUICK_BODIES = list(ODD_FILES)[::8], CASES_OF_BODIES[::60]


@pytest.fixture(scope="module")
def worker():
    # The process itself limits nothing: each command has a process of its own, whose memory is measured.
    process = Worker(4 * MOST_MEMORY)
    yield process
    process.stop()


def asked(worker: Worker, folder, *arguments: str) -> dict:
    (answer,) = worker.outcomes({"command": [*map(str, arguments), "--json"], "folder": str(folder)})
    assert answer["outcome"].startswith("exit "), answer
    assert "Traceback" not in answer["message"] + answer["printed"], answer
    assert answer["memory"] < MOST_MEMORY
    *doubts, last = answer["message"].splitlines() or [""]
    assert all(doubt.startswith("shapephase: warning: ") for doubt in doubts), answer["message"]
    assert not last or last.startswith("shapephase: "), answer["message"]

    def refused(constant: str) -> None:
        raise AssertionError(f"{constant} in the output")

    data = json.loads(answer["printed"], parse_constant=refused)
    code = int(answer["outcome"].split()[1])
    if code:
        assert data["error"]["exit_code"] == code
        assert last == f"shapephase: {data['error']['message']}"
        assert issubclass(getattr(sp.errors, data["error"]["type"]), sp.ShapePhaseError)
    else:
        assert data["verdict"] == ("OK" if not data["warnings"] else data["verdict"])
        assert math.isfinite(data["body"]["mass"])
    return {"code": code, **data}


@pytest.mark.parametrize("case", full_but(ODD_FILES, *QUICK_MOTIONS))
def test_an_odd_motion(case, worker: Worker, tmp_path):
    _, _, outcome, words = ODD_FILES[case]
    file = odd_file(case, tmp_path)
    answer = asked(worker, tmp_path, "check", "diver", file)
    if outcome is None or issubclass(outcome, Warning):
        assert answer["code"] == 0
        assert len(answer["warnings"]) == (0 if outcome is None else 1)
    else:
        assert answer["code"] == (4 if issubclass(outcome, TrajectoryError) else 2)
        assert answer["error"]["type"] == outcome.__name__
        assert all(" ".join(word.split()) in answer["error"]["message"] for word in words)


def body_through_the_command_line(case, worker: Worker, tmp_path):
    file = tmp_path / case.file
    file.write_bytes(case.content())
    answer = asked(worker, tmp_path, "check", file)
    if case.said is None:
        # What loads with such options only is an error here.
        options = dict(case.options)
        assert answer["code"] == (
            3 if options.get("on_unphysical") == "warn" or {"root", "root_body"} & set(options) else 0
        )
    else:
        assert answer["code"] in (2, 3)
        assert answer["error"]["type"] == case.error


@pytest.mark.parametrize("case", QUICK_BODIES, ids=lambda case: case.name)
def test_a_hostile_body(case, worker: Worker, tmp_path):
    body_through_the_command_line(case, worker, tmp_path)


@pytest.mark.full
@pytest.mark.parametrize("case", CASES_OF_BODIES, ids=lambda case: case.name)
def test_every_hostile_body(case, worker: Worker, tmp_path):
    body_through_the_command_line(case, worker, tmp_path)
