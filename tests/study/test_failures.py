"""What fails beside the disk: cases, their processes, workers of other versions, Ctrl-C."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys

import numpy as np
import pytest
from distributed import Client, LocalCluster

import shapephase as sp
from shapephase import provenance
from shapephase import study as room
from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode
from shapephase.errors import StudyError, UnknownNameError
from shapephase.study import dask_client
from shapephase.study._workers import recipe_of
from support.long_runs import full_but
from support.mortal_process import started
from support.places import ROOT
from support.study_functions import POISON, orphaning

RIGID = room.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0)
FILE = """
outputs = ["turn"]
chunk = 2
[rigid]
inertia = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.5]]
duration = 3.0
[over.momentum]
values = [[0.0, 0.1, 0.2], [0.3, 0.1, 0.2], [0.0, 0.2, 0.2], [0.0, 0.3, 0.2], [0.4, 0.1, 0.2]]
[functions.needs]
call = "support.study_functions:lacking"
"""


def ended(capfd, *arguments):
    code = 0
    try:
        main(list(arguments))
    except SystemExit as stop:
        code = int(stop.code or 0)
    said = capfd.readouterr()
    return code, said.out, said.err


def test_failed_cases_have_an_exit_code_are_said_first_and_are_computed_again(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STUDY_FILE", str(tmp_path / "needed.csv"))
    (tmp_path / "study.toml").write_text(FILE)
    sweep = ("sweep", "study.toml", "--store", "out.zarr", "--workers", "1")
    code, out, err = ended(capfd, *sweep)
    assert code == ExitCode.FAILED_CASES == 11, err
    assert out.splitlines()[0].startswith("2 of 5 cases failed")
    assert "--retry failed" in out.splitlines()[0]
    assert out.splitlines()[1].split("(")[0].strip() == "2 from case 1 on: FileNotFoundError: needed.csv: no such file"
    assert ended(capfd, *sweep, "--resume")[0] == ExitCode.FAILED_CASES
    (tmp_path / "needed.csv").touch()
    assert ended(capfd, *sweep, "--resume")[0] == ExitCode.FAILED_CASES
    code, out, _ = ended(capfd, *sweep, "--retry", "failed", "--json")
    assert (code, json.loads(out)["counts"]["done"], json.loads(out)["complaints"]) == (0, 5, [])
    store = room.open_study("out.zarr")
    momenta = store.values("momentum")
    turns = [
        sp.so3.angle(sp.reconstruct(sp.rigid(RIGID.inertia, 3.0), one, tolerance=1e-9).final_attitude)
        for one in momenta
    ]
    np.testing.assert_array_equal(store.values("needs"), turns)
    assert not (store.path / "error_text" / "c" / "0" / "0").exists()


def test_only_failed_cases_can_be_computed_again(tmp_path):
    with pytest.raises(UnknownNameError, match="failed"):
        room.Study(RIGID).run(tmp_path / "out.zarr", retry="done")
    with pytest.raises(StudyError, match="store"):
        room.Study(RIGID).run(tmp_path / "out.zarr", retry="failed")


@pytest.mark.full
def test_a_process_that_is_gone_is_seen_though_its_child_lives(tmp_path, monkeypatch):
    """And the child does not live to the end of its five seconds, after which it would write a file."""
    monkeypatch.setenv("STUDY_LOG", str(tmp_path / "log"))
    over = {"momentum_x": [0.0, POISON, 0.0]}
    study = room.Study(RIGID, over=over, outputs=(room.Output("one", orphaning),), time_limit=43200.0)
    store = study.run(tmp_path / "out.zarr", workers=1)
    assert not (tmp_path / "log").exists()
    assert store.statuses().tolist() == [1, 4, 1]
    assert store.errors() == [(1, "ProcessDied", "its process ended with code 3")]


@pytest.mark.parametrize("limit", full_but([43200.0, 1e300], 1e300))
def test_a_long_time_limit_is_one(tmp_path, limit):
    study = room.Study(RIGID, over={"momentum": room.Directions(1.0)}, draws=1000, chunk=1000, time_limit=limit)
    assert study.run(tmp_path / "out.zarr", workers=1).counts()["done"] == 1000


def swallowing(motion):
    try:
        signal.raise_signal(signal.SIGINT)
    except BaseException:
        return float(motion.duration)
    return 0.0


def translating(motion):
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt as error:
        raise SystemError("returned a result with an exception set") from error
    return float(motion.duration)


@pytest.mark.parametrize("function", [swallowing, translating])
def test_ctrl_c_is_not_lost_in_a_case(tmp_path, function):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # which a shell's background job does not have
    study = room.Study(RIGID, draws=3, chunk=1, outputs=(room.Output("value", function),))
    with pytest.raises(KeyboardInterrupt):
        study.run(tmp_path / "out.zarr", workers=0)
    assert room.open_study(tmp_path / "out.zarr").counts()["missing"] == 3
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


LONG = "x" * 256


@pytest.mark.parametrize(
    "text",
    [
        f'body = "{LONG}"\nmotion = "cat_righting"',
        f'body = "cat"\nmotion = "{LONG}"',
        f'motion = "cat_righting"\n[over.body]\nvalues = ["{LONG}"]',
        f'body = "cat"\nmotion = "cat_righting"\n[functions.{LONG}]\ncall = "support.study_functions:peak_rate"',
        f'body = "cat"\nmotion = "cat_righting"\n[functions.a]\ncall = "{LONG}:{LONG}"',
    ],
)
def test_a_name_that_no_file_can_have_is_named(tmp_path, monkeypatch, capfd, text):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "study.toml").write_text(text)
    code, _, err = ended(capfd, "sweep", "study.toml", "--store", "out.zarr", "--workers", "1")
    assert code == ExitCode.STUDY, err
    assert len(err.splitlines()) == 1


@pytest.fixture(scope="module")
def client():
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        yield client


@pytest.mark.filterwarnings("ignore")
def test_a_worker_of_another_version_is_refused_at_the_start(tmp_path, client, monkeypatch):
    here = provenance.provenance()["versions"]["numpy"]
    monkeypatch.setattr(
        client,
        "run",
        lambda *_, **__: {"tcp://other:1": {"versions": {**provenance.provenance()["versions"], "numpy": "1.0"}}},
    )
    with pytest.raises(StudyError, match=rf"tcp://other:1.*numpy {here} in the study and 1.0 here"):
        room.Study(RIGID).run(tmp_path / "out.zarr", client)
    assert room.open_study(tmp_path / "out.zarr").counts()["done"] == 0


@pytest.mark.filterwarnings("ignore")
def test_a_worker_of_another_version_that_joins_later_is_refused(client):
    """What a worker of this version does with a study of another."""
    study = room.Study(RIGID)
    versions, content = pickle.loads(recipe_of(study))
    theirs = pickle.dumps(({**versions, "pin": "1.0", "shapephase": "0.0.1"}, content))
    with pytest.raises(StudyError, match="pin"):
        client.submit(dask_client.compute_chunk, theirs, 0).result(timeout=60)


def test_a_worker_whose_functions_are_others_is_refused(tmp_path, monkeypatch):
    """The module is changed on the disk after the study was made."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    (tmp_path / "study_late").with_suffix(".py").write_text("def value(motion):\n    return 1.0\n")
    import study_late  # pyright: ignore[reportMissingImports]

    study = room.Study(RIGID, outputs=(room.Output("value", study_late.value),))
    (tmp_path / "study_late").with_suffix(".py").write_text("def value(motion):\n    return 2.0\n")
    with pytest.raises(StudyError, match="study_late"):
        study.run(tmp_path / "out.zarr", workers=1)


SLEEPING = """
import time, numpy as np, shapephase as sp
def value(motion):
    print("begun", flush=True)
    time.sleep(600.0)
study = sp.study.Study(sp.study.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0), outputs=(sp.study.Output("value", value),))
study.run("out.zarr", workers=0)
"""


@pytest.mark.full
def test_ctrl_c_does_not_wait_for_a_case_that_sleeps(tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src")}
    process = started(
        [sys.executable, "-c", SLEEPING], tmp_path, environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stdout.readline() == b"begun\n"
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert errors.strip().endswith(b"KeyboardInterrupt")
