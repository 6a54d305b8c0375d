"""A study that is killed at any moment goes on, and its values are those of a plain loop."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np
import pytest

import shapephase as sp
from shapephase import study as room
from support.mortal_process import started
from support.places import ROOT

CASES, CHUNK, KILLS = 20_000, 20, 40
SCRIPT = f"""
import os, sys, numpy as np, shapephase as sp
study = sp.study.Study(sp.study.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0),
    over={{"momentum": sp.study.Normal([0.1, 0.2, 0.3], 0.5)}}, outputs=("final_attitude", "error_estimate"),
    draws={CASES}, chunk={CHUNK}, seed=54)
def stored(share, text):
    with open("log", "a") as log:
        log.write("x")
study.run("out.zarr", workers=2, resume=True, progress=stored)
"""


@pytest.mark.full
def test_twenty_thousand_cases_survive_forty_kills_between_and_within_chunks(tmp_path):
    """Each run is killed up to 0.2 s after one to four chunks; some kills leave a chunk without its seal."""
    rng, log, place = np.random.default_rng(40), tmp_path / "log", tmp_path / "out.zarr"
    torn = 0
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(ROOT / "tests")])}
    command = [sys.executable, "-c", SCRIPT]
    for _ in range(KILLS):
        driver = started(command, tmp_path, environment, stderr=subprocess.PIPE)
        wanted = (log.stat().st_size if log.exists() else 0) + int(rng.integers(1, 5))
        while not log.exists() or log.stat().st_size < wanted:
            assert driver.poll() is None, driver.stderr.read()
            time.sleep(0.002)
        time.sleep(rng.uniform(0.0, 0.2))
        driver.kill()
        driver.communicate()
        begun, sealed = ({file.name for file in (place / name / "c").iterdir()} for name in ("momentum", "seal"))
        torn += begun != sealed
    store = room.open_study(place)
    before = store.counts()["done"]
    print(f"{before} cases stored after {KILLS} kills, of which {torn} were within the writing of a chunk")
    assert 0 < before < CASES
    assert torn > 0
    subprocess.run(command, cwd=tmp_path, env=environment, check=True)
    assert store.counts() == {"missing": 0, "done": CASES, "raised": 0, "timed_out": 0, "died": 0}
    momenta = store.values("momentum")
    deformation = sp.rigid(np.diag([1.0, 2.0, 2.5]), 3.0)
    motions = [sp.reconstruct(deformation, momentum, tolerance=1e-9) for momentum in momenta]
    np.testing.assert_array_equal(store.values("final_attitude"), [motion.final_attitude for motion in motions])
    np.testing.assert_array_equal(store.values("error_estimate"), [motion.error_estimate for motion in motions])
