"""What a study costs beside the library's own batches: `python -m benchmarks.studies [--turns N] [--million]`.

Costs are processor time of all processes taken together, in turns. A study of one process is run with few and with many
cases, and the difference counts, so that starting a process is not in it; so is the store. Two processes are measured
by the clock between chunks, at the same time as two that know nothing of each other.

    --turns N    how often everything is measured (default 5)
    --million    also 10^6 cases of a rigid body, and the memory of the process that runs them
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import shapephase as sp

CHUNK = 500
"""Cases, as a study has them by default."""
_FEW = 2
"""Chunks of the short study of one process."""
_SIDE_BY_SIDE = 12
"""Chunks of two processes that are counted."""
_SETTLED = 4
"""Chunks before those."""
_MILLION = 1_000_000
_CHUNK_OF_MILLION = 5000
_SPREAD = 0.1
"""Of the logarithm of masses and inertias."""
_MOMENTUM = sp.study.Normal([1.0, 2.0, 3.0], 2.0)
_SMALL_MOMENTUM = sp.study.Normal([0.0, 0.0, 0.01], 0.004)


@dataclass(frozen=True)
class Workload:
    """A study of so many cases, the same cases in one call of the library, and chunks of the long study."""

    study: Callable[[int], sp.study.Study]
    batch: Callable[[list[sp.study.Case]], object]
    many: int


def _astronaut(draws: int) -> sp.study.Study:
    over = {"momentum": _MOMENTUM, "masses": sp.study.LogNormal(_SPREAD), "inertias": sp.study.LogNormal(_SPREAD)}
    return sp.study.Study("astronaut", "astronaut_leg_swing", over, draws=draws, chunk=CHUNK)


def _family(cases: list[sp.study.Case]) -> object:
    body, path = sp.load_body("astronaut"), sp.examples.named_motion("astronaut_leg_swing")
    masses = np.array([part.mass for part in body.moving_parts])
    tensors = np.array([part.inertia for part in body.moving_parts])
    factors = np.array([case.masses for case in cases])
    own = np.array([case.inertias for case in cases]) * factors
    family = body.with_inertias(masses=factors * masses, inertias=own[..., None, None] * tensors)
    momenta = np.array([case.momentum for case in cases])
    return sp.reconstruct(sp.articulated(family, path), momenta, threads=1).final_attitude


def _cat(draws: int) -> sp.study.Study:
    return sp.study.Study("cat", "cat_righting", {"momentum": _SMALL_MOMENTUM}, draws=draws, chunk=CHUNK)


def _momenta(cases: list[sp.study.Case]) -> object:
    deformation = sp.articulated(sp.load_body("cat"), sp.examples.named_motion("cat_righting"))
    return sp.reconstruct(deformation, np.array([case.momentum for case in cases]), threads=1).final_attitude


def _bends(draws: int) -> sp.study.Study:
    over = {"beta": sp.study.Uniform(0.3, 1.2), "momentum": _SMALL_MOMENTUM}
    return sp.study.Study("cat_two_halves", "kane_scher", over, draws=draws, chunk=CHUNK, parameters={"alpha": 0.0})


def _paths(cases: list[sp.study.Case]) -> object:
    body = sp.load_body("cat_two_halves")
    deformations = (sp.articulated(body, sp.examples.kane_scher(**case.parameters)) for case in cases)
    return [sp.reconstruct(d, case.momentum).final_attitude for d, case in zip(deformations, cases, strict=True)]


WORKLOADS = {
    "astronauts, a family of bodies": Workload(_astronaut, _family, 10),
    "momenta of the cat": Workload(_cat, _momenta, 40),
    "paths of the cat of two halves": Workload(_bends, _paths, 6),
}


def print_costs(turns: int) -> None:
    """What a case costs in chunks of one process, beside batches of as many (target: 1.3 times), and one of all."""
    print(f"\nprocessor time of a case [ms]: chunks of {CHUNK} in one process, batches of {CHUNK}, one batch of all")
    for name, workload in WORKLOADS.items():
        count = workload.many - _FEW
        cases = workload.study(CHUNK * count).some_cases(np.arange(CHUNK * count))
        workload.batch(cases[:2])
        found = []
        for _ in range(turns):
            few, many = (_study_seconds(workload.study(CHUNK * chunks)) for chunks in (_FEW, workload.many))
            in_parts = sum(_seconds(workload.batch, cases[k * CHUNK : (k + 1) * CHUNK]) for k in range(count))
            found.append([many - few, in_parts, _seconds(workload.batch, cases)])
        ours, parts, whole = np.transpose(found)
        each = 1e3 * np.median(found, axis=0) / len(cases)
        print(f"  {name:32}" + "".join(f"{one:8.3f}" for one in each), flush=True)
        print(f"  {'':6}to batches: {_spread(ours / parts)};  to one batch: {_spread(ours / whole)}", flush=True)


def _seconds(call: Callable[[list[sp.study.Case]], object], cases: list[sp.study.Case]) -> float:
    began = time.process_time()
    call(cases)
    return time.process_time() - began


def _study_seconds(study: sp.study.Study) -> float:
    """Processor time of a study by one process, this one and its own together."""
    with tempfile.TemporaryDirectory() as folder:
        before = _used()
        store = study.run(Path(folder) / "out.zarr", workers=1)
        taken = _used() - before
        assert store.counts()["done"] == study.cases
    return taken


def _used() -> float:
    """[s] of processor time, of this process and of those that it has ended."""
    taken = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in taken)


def print_two_processes(turns: int) -> None:
    """Cases in a second of a study by two processes, beside two processes on their own (target: 0.85)."""
    print("\ncases in a second: a study by two processes, and two that know nothing of each other, at the same time")
    for name in WORKLOADS:
        found = [_rates(name) for _ in range(turns)]
        ours, theirs = np.median(found, axis=0)
        print(f"  {name:32}{ours:8.0f}{theirs:8.0f}   {_spread(np.divide(*np.transpose(found)))}", flush=True)


def _rates(name: str) -> tuple[float, float]:
    """Of both within the same seconds: from when all are at work until the study's last chunk but one is stored."""
    command = [sys.executable, "-m", "benchmarks.studies", "--alone", name]
    pair = [subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    stored: list[float] = []

    def note(*_: object) -> None:
        if not stored:
            for process in pair:
                process.stdin.write("go\n")  # type: ignore[union-attr]
                process.stdin.flush()  # type: ignore[union-attr]
        stored.append(time.perf_counter())

    try:
        for process in pair:
            process.stdout.readline()  # type: ignore[union-attr]
        with tempfile.TemporaryDirectory() as folder:
            WORKLOADS[name].study(CHUNK * (_SETTLED + _SIDE_BY_SIDE + 1)).run(
                Path(folder) / "out.zarr", workers=2, progress=note
            )
    finally:
        for process in pair:
            process.kill()
    first, last = stored[_SETTLED - 1], stored[-2]
    theirs = 0.0
    for process in pair:
        ends = [float(line) for line in process.communicate()[0].splitlines()]
        theirs += float(np.diff(np.interp([first, last], ends, np.arange(len(ends))))[0])
    return CHUNK * _SIDE_BY_SIDE / (last - first), CHUNK * theirs / (last - first)


def alone(name: str) -> None:
    """One of those two: it waits until it is needed, and says when each chunk is done, until it is killed."""
    workload = WORKLOADS[name]
    study = workload.study(CHUNK)
    workload.batch(study.some_cases(np.arange(CHUNK)))
    print("ready", flush=True)
    sys.stdin.readline()
    while True:
        print(time.perf_counter(), flush=True)
        workload.batch(study.some_cases(np.arange(CHUNK)))


def print_million() -> None:
    """The memory of the process that runs a million cases (target: 500 MB), and what it costs that process."""
    rigid = sp.study.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0)
    over = {"momentum": sp.study.Directions(1.0)}
    study = sp.study.Study(rigid, over=over, draws=_MILLION, chunk=_CHUNK_OF_MILLION)
    print(f"\n{_MILLION} cases of a rigid body, two processes, chunks of {_CHUNK_OF_MILLION}")
    with tempfile.TemporaryDirectory() as folder:
        before = time.process_time()
        store = study.run(Path(folder) / "out.zarr", workers=2)
        print(f"  done {store.counts()['done']}, the driver's processor time {time.process_time() - before:.1f} s")
    peaks = (resource.getrusage(who).ru_maxrss / 1024.0 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print("  memory at most: driver {:.0f} MB, one of its processes {:.0f} MB".format(*peaks), flush=True)


def _spread(ratios: np.ndarray) -> str:
    return f"ratio {np.median(ratios):5.2f}   from {ratios.min():5.2f} to {ratios.max():5.2f}"


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.studies")
    parser.add_argument("--turns", type=int, default=5)
    parser.add_argument("--million", action="store_true")
    parser.add_argument("--alone", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.alone:
        alone(given.alone)
        return
    if given.million:
        # Before all else: peaks of memory are those since the process began.
        print_million()
    print_costs(given.turns)
    print_two_processes(given.turns)


if __name__ == "__main__":
    main()
