"""Error estimates beside true errors: `python -m benchmarks.estimates [FAMILY ...] [--runs N] [--seed S]`.

The true error of a run is the largest angle at sixty random times and the end, against an integration in extended
precision. `harmonics` are loops of one or two harmonics up to the 24th on all bodies that come with the library;
`mixed` are also random bodies along paths of all kinds; `recordings` have up to some thousand rows. Each run depends on
seed and number alone.

    --jobs J     in J processes
    --kept FILE  every run is a line of this file; runs that it has are not made again
    --only K     this run alone, with what it gave
    --most S     truths that would take more than about S seconds are left out, and counted (default 5)
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import json
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from multiprocessing import Pool
from pathlib import Path

import numpy as np

import shapephase as sp

from .extended import TooLong, Truth, angles_between, prepare
from .random_motions import Trial, harmonics, mixed, recordings

TIMES = 60
FAMILIES = {"harmonics": harmonics, "mixed": mixed, "recordings": recordings}
_HARMLESS = 30.0
"""How far below the tolerance a truth has to be for its refusal to be a fault."""
_FRAME_SECONDS = 2.5e-5
"""[s] of processor time for a step of the extended integrator, for each frame of the body."""
_TERM_SECONDS = 8e-6
"""[s] as above, for each term of the path."""
_MEASURED = 4.0
"""How many times the bound of its own error a true error has to be to be counted in the percentiles."""
_WORST = 8
"""How many of the worst runs are printed."""


@dataclass(frozen=True)
class Run:
    """One reconstruction judged.

    Attributes
    ----------
    outcome : "done", "refused", or "left out" where the truth would take too long
    error : true error [rad], at ten or a hundred times the tolerance where the run was refused; NaN: none
    bound : of the error of the truth [rad]
    estimate : [rad]; NaN without one
    highest : the highest harmonic, 0 for other motions
    seconds : processor time of the run and of its truth
    """

    family: str
    seed: int
    number: int
    what: str
    outcome: str
    tolerance: float
    error: float = np.nan
    bound: float = np.nan
    estimate: float = np.nan
    evaluations: int = 0
    highest: int = 0
    message: str = ""
    seconds: tuple[float, float] = (0.0, 0.0)

    @property
    def above(self) -> float:
        """How many times its estimate the error is at least."""
        return (self.error - self.bound) / self.estimate if self.outcome == "done" else 0.0


def main() -> None:
    """Print a summary of each family."""
    asked = _arguments()
    for family in asked.family or FAMILIES:
        if asked.only is not None:
            print(judged(family, asked.seed, asked.most, asked.only))
            continue
        began = time.perf_counter()
        runs = list(judged_all(family, asked.runs, asked.seed, asked.most, asked.jobs, asked.kept))
        print(summary(family, runs))
        used = [sum(part) for part in zip(*(run.seconds for run in runs), strict=True)]
        print(
            f"  processor time: {used[0]:.0f} s of reconstructions, {used[1]:.0f} s of truths; "
            f"{time.perf_counter() - began:.0f} s now",
            flush=True,
        )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.estimates")
    parser.add_argument("family", nargs="*", choices=[[], *FAMILIES])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--most", type=float, default=5.0)
    parser.add_argument("--kept", type=Path)
    parser.add_argument("--only", type=int)
    return parser.parse_args()


def judged_all(
    family: str, count: int, seed: int = 1, most: float = 5.0, jobs: int = 1, kept: Path | None = None
) -> Iterator[Run]:
    """The first runs of a family, those that a file has among them."""
    have = [run for run in read_runs(kept) if (run.family, run.seed) == (family, seed) and run.number < count]
    yield from have
    missing = sorted(set(range(count)) - {run.number for run in have})
    prepare()
    for run in _mapped(partial(judged, family, seed, most), missing, jobs):
        if kept is not None:
            with kept.open("a") as file:
                # In front, too: the last line may have been cut off.
                file.write("\n" + json.dumps(asdict(run)) + "\n")
        yield run


def read_runs(kept: Path | None) -> list[Run]:
    """Of a file, whose last line may have been cut off."""
    runs = []
    for line in kept.read_text().splitlines() if kept is not None and kept.exists() else ():
        try:
            runs.append(Run(**(entry := json.loads(line)) | {"seconds": tuple(entry["seconds"])}))
        except (ValueError, TypeError):
            continue
    return runs


def _mapped(judge: Callable[[int], Run], numbers: Iterable[int], jobs: int) -> Iterator[Run]:
    if jobs == 1:
        yield from map(judge, numbers)
        return
    with Pool(jobs) as pool:
        yield from pool.imap_unordered(judge, numbers)


def judged(family: str, seed: int, most: float, number: int) -> Run:
    """One run."""
    trial = FAMILIES[family](number, np.random.default_rng((seed, number)))
    body, path, times = trial.body, trial.path, trial.times(TIMES)
    run = partial(Run, family, seed, number, trial.what, tolerance=trial.tolerance, highest=trial.highest)
    began = time.process_time()
    motion, message = _attempt(trial, trial.tolerance)
    loosened = motion
    for factor in (10.0, 100.0):
        loosened = loosened or _attempt(trial, factor * trial.tolerance)[0]
    ended = time.process_time()
    try:
        exact, bound = _truth(body).along(trial.segments, trial.momentum, times, most_steps(trial, most))
    except (TooLong, ArithmeticError):
        return run("left out", message=message, seconds=(ended - began, time.process_time() - ended))
    bound += _time_rounding(trial, path)
    error = float(angles_between(exact, loosened.attitude(times)).max()) if loosened else np.nan
    seconds = (ended - began, time.process_time() - ended)
    if motion is None:
        return run("refused", error=error, bound=bound, message=message, seconds=seconds)
    return run(
        "done", error=error, bound=bound, estimate=float(motion.error_estimate), evaluations=motion.evaluations,
        seconds=seconds,
    )  # fmt: skip


def most_steps(trial: Trial, seconds: float) -> float:
    """Of the extended integrator, in about so many seconds."""
    terms = max(segment.terms for segment in trial.segments)
    return seconds / (_FRAME_SECONDS * (len(trial.body.chain.names) + 1) + _TERM_SECONDS * terms)


def _attempt(trial: Trial, tolerance: float) -> tuple[sp.Motion | None, str]:
    """A motion, or why not."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            deformation = sp.articulated(trial.body, trial.path)
            return sp.reconstruct(deformation, trial.momentum, tolerance=tolerance), ""
    except sp.errors.ShapePhaseError as error:
        return None, f"{type(error).__name__}: {error}"


def _time_rounding(trial: Trial, path: sp.ShapePath) -> float:
    """What the rounding of times near the end is worth in angle, where loops begin at rounded times [rad]."""
    if len(trial.segments) == 1:
        return 0.0
    body, eps = trial.body, float(np.finfo(float).eps)
    shapes, rates = path.curve(np.linspace(0.0, path.duration / path.loops, 50))
    least = min(float(np.linalg.eigvalsh(body.locked_inertia(shape))[0]) for shape in shapes[::5])
    spin = float(np.linalg.norm(trial.momentum)) / least + float(np.abs(rates).sum(axis=1).max())
    return eps * path.duration * spin


@lru_cache(maxsize=16)
def _truth(body: sp.Body) -> Truth:
    return Truth(body)


def summary(name: str, runs: list[Run]) -> str:
    """What the runs of a family came to."""
    done = [run for run in runs if run.outcome == "done"]
    refused = [run for run in runs if run.outcome == "refused"]
    harmless = [run for run in refused if run.error * _HARMLESS <= run.tolerance]
    left_out = [run for run in runs if run.outcome == "left out"]
    above = sorted((run for run in done if run.above > 1.0), key=lambda run: -run.above)
    measured = [run for run in done if run.error > _MEASURED * run.bound]
    refused_left_out = sum(bool(run.message) for run in left_out)
    lines = [
        f"{name}, seed {runs[0].seed}: {len(runs)} runs, {len(above)} above their estimate, {len(refused)} refused "
        f"({100.0 * len(refused) / len(runs):.2f} %), {len(harmless)} of these with a truth {_HARMLESS:g} times below "
        f"the tolerance; {len(left_out)} left out, their truth too long ({refused_left_out} of these refused), "
        f"{len(done) - len(measured)} too exact to be measured"
    ]
    for words, values in (
        ("estimate / true", [run.estimate / run.error for run in measured]),
        ("tolerance / true", [run.tolerance / run.error for run in measured]),
        ("evaluations", [float(run.evaluations) for run in done]),
    ):
        lines.append(f"  {words:17}" + _percentiles(values))
    if any(run.highest for run in done):
        lines.append(_by_harmonic(done))
    lines += [f"  {run.above:.3g} times its estimate {run.estimate:.2g}: {_line(run)}" for run in above]
    for run in refused[:_WORST]:
        lines += [f"  refused, true error {run.error:.2g}: {_line(run)}", f"    {run.message[:150]}"]
    for run in sorted(measured, key=lambda run: run.error / run.estimate)[:_WORST]:
        lines.append(f"  estimate {run.estimate / run.error:.3g} times the truth {run.error:.2g}: {_line(run)}")
    return "\n".join(lines)


def _percentiles(values: list[float]) -> str:
    shares = (0.0, 1.0, 5.0, 50.0, 95.0, 99.0, 100.0)
    found = np.percentile(values, shares) if values else np.full(len(shares), np.nan)
    return " ".join(f"{share:g} %: {value:.3g}," for share, value in zip(shares, found, strict=True)).rstrip(",")


def _by_harmonic(done: list[Run]) -> str:
    """Median evaluations by the highest harmonic."""
    found = {
        k: np.median([run.evaluations for run in done if run.highest == k])
        for k in sorted({run.highest for run in done})
    }
    return "  evaluations by harmonic: " + ", ".join(f"{k}: {value:.0f}" for k, value in found.items())


def _line(run: Run) -> str:
    """What it was and how it is made again."""
    asked = f"python -m benchmarks.estimates {run.family} --seed {run.seed} --only {run.number}"
    return f"{run.what}, tolerance {run.tolerance:.2g}; {asked}"


if __name__ == "__main__":
    main()
