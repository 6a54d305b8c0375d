"""Processes of this machine: the same results whatever their number, and cases that raise, hang or kill as data."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from shapephase import study as room
from shapephase.errors import StudyError
from support.places import ROOT
from support.study_functions import POISON, bend, counted, logged, poisoned, slow

MOMENTUM = room.Normal([0.0, 0.0, 0.01], 0.004)
ENDS = ("final_attitude", "error_estimate")


def test_a_case_that_ends_its_process_is_data_and_so_is_one_that_raises(tmp_path):
    """What is beside them in the chunk is there, and says the same."""
    study = room.Study(
        "cat_two_halves",
        bend,
        {"momentum_x": [0.0, POISON, 3 * POISON, 0.0]},
        (room.Output("turned", poisoned),),
        parameters={"depth": 0.5},
    )
    store = study.run(tmp_path / "out.zarr", workers=1)
    assert store.statuses().tolist() == [1, 2, 4, 1]
    assert store.errors() == [
        (1, "ArithmeticError", "the case is poisoned"),
        (2, "ProcessDied", "its process died by SIGABRT"),
    ]
    turned = store.values("turned")
    assert np.isnan(turned[1:3]).all()
    assert turned[0] == turned[3]


@pytest.mark.full
def test_a_case_that_hangs_is_data(tmp_path):
    """With the same limit of time for its chunk and for itself."""
    grid = [0.0, POISON, 2 * POISON, 3 * POISON, 0.0]
    study = room.Study(
        "cat_two_halves",
        bend,
        {"momentum_x": grid},
        (room.Output("turned", poisoned),),
        parameters={"depth": 0.5},
        time_limit=30.0,
    )
    store = study.run(tmp_path / "out.zarr", workers=1)
    assert store.statuses().tolist() == [1, 2, 3, 4, 1]
    assert store.errors()[1] == (2, "TimeLimit", "not done after 30 s")


@pytest.mark.full
def test_results_do_not_depend_on_chunks_nor_on_workers(tmp_path):
    """Five settings, bit by bit."""
    over = {"momentum": MOMENTUM, "masses": room.LogNormal(0.1)}
    found = []
    for number, (chunk, workers) in enumerate([(60, 0), (60, 1), (7, 2), (1, 3), (13, 4)]):
        study = room.Study("cat_two_halves", bend, over, ENDS, draws=60, chunk=chunk, parameters={"depth": 0.5})
        store = study.run(tmp_path / f"{number}.zarr", workers=workers)
        found.append([store.values(name).tobytes() for name in (*ENDS, "momentum", "masses")])
    assert all(one == found[0] for one in found)


SCRIPT = """
import sys, shapephase as sp
from support.study_functions import bend, slow
study = sp.study.Study("cat_two_halves", bend, {"momentum": sp.study.Normal([0.0, 0.0, 0.01], 0.004)},
    (sp.study.Output("turned", slow),), draws=120, chunk=4, parameters={"depth": 0.5})
study.run("out.zarr", workers=2, resume=True)
"""


@pytest.mark.full
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_driver_that_was_ended_goes_on_and_computes_only_the_chunks_in_flight_again(tmp_path, how):
    """Two processes have a chunk each, and two results for each may wait to be stored."""
    log = tmp_path / "log"
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT / 'tests'}", "STUDY_LOG": str(log)}
    driver = subprocess.Popen([sys.executable, "-c", SCRIPT], cwd=tmp_path, env=environment, stderr=subprocess.PIPE)
    while len(logged(log)) < 40:
        assert driver.poll() is None, driver.stderr.read()
        time.sleep(0.05)
    driver.send_signal(how)
    driver.communicate(timeout=60)
    time.sleep(2.5)  # its processes see that it is gone
    before = len(logged(log))
    subprocess.run([sys.executable, "-c", SCRIPT], cwd=tmp_path, env=environment, check=True)
    again = len(logged(log)) - 120
    assert 0 <= again <= 4 * (2 + 2 * 2 + 1), (before, again)
    assert len(set(logged(log))) == 120
    study = room.Study(
        "cat_two_halves", bend, {"momentum": MOMENTUM}, (room.Output("turned", slow),), draws=120, chunk=4,
        parameters={"depth": 0.5},
    )  # fmt: skip
    store = room.open_study(tmp_path / "out.zarr")
    assert store.counts()["done"] == 120
    assert store.attributes["study_hash"] == study.hash


def test_processes_that_do_not_start_are_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", "/bin/false")
    study = room.Study(room.RigidBody(np.eye(3), 1.0), over={"momentum": room.Directions(1.0)}, draws=3)
    with pytest.raises(StudyError, match="begin"):
        study.run(tmp_path / "out.zarr", workers=1)


def test_functions_of_a_notebook_go_with_their_code(tmp_path):
    """They have no module in which another process would find them."""
    offset = 1.0
    output = room.Output("more", lambda motion: offset + float(np.linalg.norm(motion.momentum)))
    study = room.Study(
        room.RigidBody(np.eye(3), 1.0), over={"momentum": room.Directions(1.0)}, outputs=(output,), draws=3
    )
    np.testing.assert_allclose(study.run(tmp_path / "out.zarr", workers=1).values("more"), 2.0, rtol=1e-15)


@pytest.mark.full
def test_a_counted_case_is_computed_once(tmp_path, monkeypatch):
    log = tmp_path / "log"
    monkeypatch.setenv("STUDY_LOG", str(log))
    output = room.Output("turned", counted)
    study = room.Study(
        "cat_two_halves", bend, {"momentum": MOMENTUM}, (output,), draws=9, chunk=2, parameters={"depth": 0.5}
    )
    study.run(tmp_path / "out.zarr", workers=2)
    assert len(logged(log)) == len(set(logged(log))) == 9
