"""Dask: a cluster in this process, and a scheduler and workers of their own over TCP, which are killed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time

import numpy as np
import pytest
from distributed import Client, LocalCluster

import shapephase as sp
from shapephase import study as room
from shapephase.study._cluster import _PATIENCE
from support.places import ROOT
from support.study_functions import POISON, bend, logged, poisoned

MOMENTUM = room.Normal([0.0, 0.0, 0.01], 0.004)
OVER = {"momentum": MOMENTUM, "masses": room.LogNormal(0.1)}


@pytest.mark.full
@pytest.mark.filterwarnings("ignore")
def test_a_local_cluster_gives_the_same_and_its_workers_survive_poison(tmp_path):
    grid = [0.0, POISON, 0.0, 3 * POISON, 0.0]
    study = room.Study(
        "cat_two_halves", bend, {"momentum_x": grid}, (room.Output("turned", poisoned),), chunk=2,
        parameters={"depth": 0.5},
    )  # fmt: skip
    with (
        LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        store = study.run(tmp_path / "out.zarr", client)
        workers = client.scheduler_info()["workers"]
    assert len(workers) == 1
    assert store.statuses().tolist() == [1, 2, 1, 4, 1]
    here = room.Study(
        "cat_two_halves", bend, {"momentum_x": [0.0, 0.0]}, ("turn",), parameters={"depth": 0.5}
    ).run(tmp_path / "here.zarr", workers=0)  # fmt: skip
    assert store.values("turned")[0] == here.values("turn")[0]


SCRIPT = """
import sys, shapephase as sp
from distributed import Client
from support.study_functions import bend, counted
study = sp.study.Study("cat_two_halves", bend,
    {"momentum": sp.study.Normal([0.0, 0.0, 0.01], 0.004), "masses": sp.study.LogNormal(0.1)},
    ("final_attitude", "error_estimate", sp.study.Output("turned", counted)), draws=2000, chunk=50,
    parameters={"depth": 0.5})
try:
    study.run("out.zarr", Client(sys.argv[1], timeout=20), resume=True)
except sp.errors.SchedulerLostError as error:
    print(error)
    sys.exit(9)
"""


class Cluster:
    """A scheduler and two workers on 127.0.0.1, started as one does in a shell."""

    def __init__(self, folder, environment):
        self.folder, self.environment, self.workers, self.scheduler = folder, environment, [], None

    def start(self):
        words = ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
        with open(self.folder / "scheduler.log", "w") as log:
            self.scheduler = self._dask(words, stderr=log)
        self.address = self._address()
        for _ in range(2):
            self.add_worker()

    def add_worker(self):
        words = ["worker", self.address, "--nworkers", "1", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        self.workers.append(self._dask([*words, "--death-timeout", "20"], stderr=subprocess.DEVNULL))

    def stop(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _address(self):
        for _ in range(1200):
            found = re.search(r"Scheduler at:\s+(tcp://[\d.:]+)", (self.folder / "scheduler.log").read_text())
            if found:
                return found[1]
            time.sleep(0.1)
        raise AssertionError((self.folder / "scheduler.log").read_text())

    def _dask(self, words, **streams):
        command = [sys.executable, "-m", "dask", *words]
        return subprocess.Popen(command, cwd=self.folder, env=self.environment, stdout=subprocess.DEVNULL, **streams)


@pytest.mark.full
def test_two_thousand_cases_survive_the_death_of_worker_scheduler_and_driver(tmp_path):
    """40 chunks: after each death the store goes on; at the end it is a plain loop's, and little was computed twice."""
    log = tmp_path / "log"
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT / 'tests'}", "STUDY_LOG": str(log)}

    def driver():
        command = [sys.executable, "-c", SCRIPT, cluster.address]
        return subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True)

    def wait_for(cases, running):
        while len(logged(log)) < cases:
            assert running.poll() is None
            time.sleep(0.1)

    cluster = Cluster(tmp_path, environment)
    cluster.start()
    try:
        first = driver()
        wait_for(400, first)
        cluster.workers[0].kill()
        wait_for(700, first)
        cluster.scheduler.kill()
        killed = time.monotonic()
        said, _ = first.communicate(timeout=300)
        assert first.returncode == 9
        assert "scheduler" in said
        waited = time.monotonic() - killed
        cluster.stop()
        cluster = Cluster(tmp_path, environment)
        cluster.start()
        second = driver()
        wait_for(1300, second)
        second.kill()
        second.wait()
        third = driver()
        third.communicate(timeout=900)
        assert third.returncode == 0
    finally:
        cluster.stop()
    store = room.open_study(tmp_path / "out.zarr")
    assert store.counts()["done"] == 2000
    assert len(set(logged(log))) == 2000
    # Of three deaths at most the chunks in flight: of two workers, and those done that were not stored yet.
    again = len(logged(log)) - 2000
    print(f"computed again: {again} cases; the driver ended {waited:.0f} s after its scheduler")
    assert again <= 3 * 4 * 50
    # The driver's patience, once while it waits and once while it asks: within a minute.
    assert 2.0 * _PATIENCE < 60.0
    _check_against_a_plain_loop(store)


def _check_against_a_plain_loop(store):
    body, path = sp.load_body("cat_two_halves"), bend(0.5)
    masses = np.array([part.mass for part in body.moving_parts])
    tensors = np.array([part.inertia for part in body.moving_parts])
    study = room.Study("cat_two_halves", bend, OVER, draws=2000, chunk=50, parameters={"depth": 0.5})
    attitudes, estimates = store.values("final_attitude"), store.values("error_estimate")
    for index in range(2000):
        case = study.case(index)
        family = body.with_inertias(
            masses=(case.masses * masses)[None], inertias=(case.masses[:, None, None] * tensors)[None]
        )
        motion = sp.reconstruct(sp.articulated(family, path), case.momentum)[0]
        np.testing.assert_array_equal(attitudes[index], motion.final_attitude)
        assert estimates[index] == motion.error_estimate
