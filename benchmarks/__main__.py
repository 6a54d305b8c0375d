"""Runs the benchmark: `make bench`, or `python -m benchmarks [tolerance ...]`.

For every case and tolerance: `reconstruct` as anybody calls it, against SciPy's DOP853 on Pinocchio's `ccrba` at the
loosest relative tolerance (on a grid of half decades) whose final attitude is within the same error. Both run
in turn, in one process with one thread; medians of several runs. Errors are against DOP853 at 3e-14.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

import shapephase as sp
from shapephase import so3

from .cases import Case, cases
from .contestants import solve_ivp_attitude

TARGETS = {1e-6: None, 1e-9: 8.0, 1e-12: 15.0}
RUNS = 15


@dataclass(frozen=True)
class Row:
    """One case at one tolerance: times [ms], evaluations, error and estimate [rad]."""

    ours: float
    theirs: float
    evaluations: int
    their_evaluations: int
    error: float
    estimate: float


def main() -> None:
    """Print the tables."""
    tolerances = [float(a) for a in sys.argv[1:]] or list(TARGETS)
    all_cases = cases()
    truths = [so3.matrix_from_quat(solve_ivp_attitude(case, 3e-14, 1e-16)[0]) for case in all_cases]
    for tolerance in tolerances:
        print(f"\ntolerance {tolerance:g} rad")
        print(f"{'case':40}{'ours ms':>9}{'ivp ms':>9}{'ratio':>7}{'evals':>7}{'ivp':>6}{'error':>10}{'estimate':>10}")
        rows = [compared(case, truth, tolerance) for case, truth in zip(all_cases, truths, strict=True)]
        for case, row in zip(all_cases, rows, strict=True):
            print(
                f"{case.name:40}{row.ours:9.2f}{row.theirs:9.2f}{row.theirs / row.ours:7.1f}{row.evaluations:7d}"
                f"{row.their_evaluations:6d}{row.error:10.1e}{row.estimate:10.1e}"
            )
        ours, theirs = np.median([r.ours for r in rows]), np.median([r.theirs for r in rows])
        aim = TARGETS.get(tolerance)
        print(f"median {ours:.2f} ms against {theirs:.2f} ms, {theirs / ours:.1f} times faster", end="")
        print(f" (target {aim:g})" if aim else "")
        print(
            f"median of ratios {np.median([r.theirs / r.ours for r in rows]):.1f}; "
            f"evaluations {np.median([r.evaluations for r in rows]):.0f}; "
            f"estimate over error {np.median([r.estimate / r.error for r in rows]):.0f}, below it in "
            f"{sum(r.error > r.estimate for r in rows)} cases"
        )
    print_scaling()
    print(f"\nimport shapephase: {import_seconds():.2f} s (target 0.6)")


def print_scaling() -> None:
    """Many attitudes of one loop, and one loop many times, against once."""
    case = next(c for c in cases() if c.name == "example:human loop")
    deformation = sp.articulated(case.body, case.path)
    for tolerance in (1e-6, 1e-9):
        once = partial(sp.reconstruct, deformation, case.momentum, tolerance=tolerance)
        single = float(np.median([seconds(once) for _ in range(9)]))
        print(f"\nscaling of {case.name} at {tolerance:g} rad, once {1e3 * single:.2f} ms")
        for count in (100, 1000, 10_000):
            attitudes = so3.exp(np.random.default_rng(0).normal(size=(count, 3)))
            taken = seconds(partial(once, attitude=attitudes))
            print(f"  {count:6d} attitudes {taken:8.3f} s, {taken / single:7.0f} times once")
    # About the long axis and slowly: most other motions of this loop are chaotic, and no method follows them that far.
    calm = np.array([0.0, 8.0, 0.0])
    single = float(np.median([seconds(partial(sp.reconstruct, deformation, calm, tolerance=1e-6)) for _ in range(9)]))
    for count in (10, 100, 1000):
        often = sp.articulated(case.body, case.path.repeated(count))
        taken = seconds(partial(sp.reconstruct, often, calm, tolerance=1e-6))
        print(f"  {count:6d} loops at 1e-6 rad in all {taken:8.3f} s, {taken / single:7.0f} times once")


def compared(case: Case, truth: np.ndarray, tolerance: float) -> Row:
    """Both contestants on one case, in turn."""
    deformation = sp.articulated(case.body, case.path)
    rtol = loosest(case, truth, tolerance)

    def ours() -> sp.Motion:
        return sp.reconstruct(deformation, case.momentum, tolerance=tolerance)

    def theirs() -> tuple[np.ndarray, int]:
        return solve_ivp_attitude(case, rtol)

    motion, (_, their_evaluations) = ours(), theirs()
    times = np.array([[seconds(ours), seconds(theirs)] for _ in range(RUNS)])
    ours_ms, theirs_ms = 1e3 * np.median(times, axis=0)
    error = float(so3.angle(truth.T @ motion.final_attitude))
    return Row(ours_ms, theirs_ms, motion.evaluations, their_evaluations, error, float(motion.error_estimate))


def loosest(case: Case, truth: np.ndarray, tolerance: float) -> float:
    """The loosest tolerance of DOP853 that meets the error."""
    for exponent in np.arange(3.0, 13.6, 0.5):
        rtol = max(10.0**-exponent, 3e-14)
        if so3.angle(truth.T @ so3.matrix_from_quat(solve_ivp_attitude(case, rtol)[0])) <= tolerance:
            return rtol
    return 3e-14


def seconds(run: Callable[[], object]) -> float:
    """One run's time."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def import_seconds() -> float:
    """Median import time of the package in new processes."""
    code = "import time; t = time.perf_counter(); import shapephase; print(time.perf_counter() - t)"
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(5)]
    return float(np.median([float(run.stdout) for run in runs]))


if __name__ == "__main__":
    main()
