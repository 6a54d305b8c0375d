"""Dask: a cluster in this process, and a scheduler and workers of their own over TCP, which are killed."""

from __future__ import annotations

import os
import subprocess
import sys
import zlib
from functools import partial

import numpy as np
import pytest

import shapephase as sp
from shapephase import study as room
from shapephase.cli.outcome import ExitCode
from shapephase.study.dask_client import FEWEST_TASKS, PATIENCE, TASKS_PER_THREAD
from support import counted_chunks
from support.dask_cluster import Cluster, wait_for_lines
from support.mortal_process import started
from support.places import ROOT
from support.study_functions import POISON, bend, logged, poisoned

# Chunks that are out at a time, of two workers of one thread each: of a death no more are computed again.
IN_FLIGHT = max(FEWEST_TASKS, 2 * TASKS_PER_THREAD)


@pytest.mark.full
@pytest.mark.filterwarnings("ignore")
def test_a_local_cluster_gives_the_same_and_its_workers_survive_poison(tmp_path):
    grid = [0.0, POISON, 0.0, 3 * POISON, 0.0]
    from distributed import Client, LocalCluster

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


DRIVER = """
import sys, shapephase as sp
from support.study_functions import bend, counted
study = sp.study.Study("cat_two_halves", bend,
    {"momentum": sp.study.Normal([0.0, 0.0, 0.01], 0.004), "masses": sp.study.LogNormal(0.1)},
    ("final_attitude", "error_estimate", sp.study.Output("turned", counted)), draws=2000, chunk=50,
    parameters={"depth": 0.5})
try:
    with sp.study.connected(sys.argv[1]) as client:
        study.run("out.zarr", client, resume=True)
except sp.errors.SchedulerLostError as error:
    print(error)
    sys.exit(9)
"""
"""Of 40 chunks."""


@pytest.mark.full
def test_two_thousand_cases_survive_the_death_of_worker_scheduler_and_driver(tmp_path):
    """40 chunks: after each death the store goes on; at the end it is a plain loop's, and little was computed twice."""
    log = tmp_path / "log"
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT / 'tests'}", "STUDY_LOG": str(log)}
    with_three_deaths(tmp_path, environment, [sys.executable, "-c", DRIVER], log, (400, 700, 1300))
    store = room.open_study(tmp_path / "out.zarr")
    assert store.counts()["done"] == 2000
    assert len(set(logged(log))) == 2000
    again = len(logged(log)) - 2000
    print(f"computed again: {again} cases")
    assert again <= 3 * IN_FLIGHT * 50
    # The driver's patience, once while it waits and once while it asks: within a minute.
    assert 2.0 * PATIENCE < 60.0
    attitudes, estimates = plain_loop(
        sp.load_body("cat_two_halves"), bend(0.5), range(2000), 0, ([0.0, 0.0, 0.01], 0.004)
    )
    np.testing.assert_array_equal(store.values("final_attitude"), attitudes)
    np.testing.assert_array_equal(store.values("error_estimate"), estimates)


STUDY = """
body = "astronaut"
motion = "astronaut_leg_swing"
draws = 100_000
seed = 24

[over.momentum]
distribution = "normal"
mean = [1.0, 2.0, 3.0]
deviation = 2.0

[over.masses]
distribution = "lognormal"
deviation = 0.1

[over.inertias]
distribution = "lognormal"
deviation = 0.1
"""
"""Of 200 chunks; the final attitude and its estimate."""


@pytest.mark.full
def test_a_hundred_thousand_cases_survive_the_death_of_worker_scheduler_and_driver(tmp_path):
    """By the command: none is lost or stored twice, and all are those of a plain loop."""
    (tmp_path / "study.toml").write_text(STUDY)
    begun, stored = tmp_path / "begun", tmp_path / "stored"
    environment = {
        **os.environ,
        "PYTHONPATH": f"{ROOT / 'src'}:{ROOT / 'tests'}",
        "CHUNKS_BEGUN": str(begun),
        "CHUNKS_STORED": str(stored),
    }
    command = [sys.executable, counted_chunks.__file__, "sweep", "study.toml", "--store", "out.zarr", "--resume"]
    command.append("--scheduler")
    with_three_deaths(tmp_path, environment, command, begun, (40, 80, 150), preload="support.counted_chunks")
    store = room.open_study(tmp_path / "out.zarr")
    assert store.counts()["done"] == 100_000
    assert len(logged(stored)) == len(set(logged(stored)))
    assert len(set(logged(begun))) == 200
    again = len(logged(begun)) - 200
    print(f"computed again: {again} chunks; stored: {len(logged(stored))}")
    assert again <= 3 * IN_FLIGHT
    body, path = sp.load_body("astronaut"), sp.examples.named_motion("astronaut_leg_swing")
    loop = partial(plain_loop, body, path, seed=24, momentum=([1.0, 2.0, 3.0], 2.0), inertias=True)
    kept = store.values("final_attitude"), store.values("error_estimate")
    # In lots across the chunks' borders, and some quite alone.
    for numbers, together in ((range(100_000), 333), (range(0, 100_000, 50), 1)):
        for found, expected in zip(kept, loop(numbers, together=together), strict=True):
            np.testing.assert_array_equal(found[numbers], expected)


def with_three_deaths(folder, environment, command, log, lines, preload=None):
    """Run a driver whose worker, then scheduler, and which then itself is killed, when a log has so many lines."""

    def drive():
        return started(
            [*command, cluster.address], folder, environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )

    with Cluster(folder, environment, preload) as cluster:
        first = drive()
        wait_for_lines(log, lines[0], first)
        cluster.workers[0].kill()
        wait_for_lines(log, lines[1], first)
        cluster.scheduler.kill()
        said, _ = first.communicate()
        assert first.returncode == ExitCode.CLUSTER, said
        assert b"scheduler" in said
    with Cluster(folder, environment, preload) as cluster:
        second = drive()
        wait_for_lines(log, lines[2], second)
        second.kill()
        second.communicate()
        third = drive()
        said, _ = third.communicate()
        assert third.returncode == 0, said


def plain_loop(body, path, numbers, seed, momentum, *, together=1, inertias=False):
    """One reconstruction of some bodies after the other, with the random numbers of NumPy: they vary by a tenth."""
    masses = np.array([part.mass for part in body.moving_parts])
    tensors = np.array([part.inertia for part in body.moving_parts])
    mean, deviation = momentum
    ends, estimates = [], []
    for first in range(0, len(numbers), together):
        normal = partial(normal_numbers, seed, numbers[first : first + together])
        factors = np.exp(0.1 * normal("masses", len(masses)))
        own = factors[..., None, None] * tensors
        if inertias:
            own = np.exp(0.1 * normal("inertias", len(masses)))[..., None, None] * own
        family = body.with_inertias(masses=factors * masses, inertias=own)
        motions = sp.reconstruct(sp.articulated(family, path), np.array(mean) + deviation * normal("momentum", 3))
        ends.append(motions.final_attitude)
        estimates.append(motions.error_estimate)
    return np.concatenate(ends), np.concatenate(estimates)


def normal_numbers(seed, cases, axis, count):
    """As in test_cases: Philox, its key made of seed and axis, the index of the case in its counter."""
    key = np.random.SeedSequence(seed, spawn_key=(zlib.crc32(axis.encode()),)).generate_state(2, np.uint64)
    sources = (np.random.Philox(counter=[0, 0, case, 0], key=key) for case in cases)
    return np.array([np.random.Generator(source).standard_normal(count) for source in sources])
