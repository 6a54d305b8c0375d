"""Beside what people run from Python: `python -m benchmarks.python_peers [tolerance ...]`.

For every case and tolerance: `reconstruct` as anybody calls it, against SciPy's DOP853 on the same equation with the
body computed by Pinocchio (once with a right-hand side without waste, once as one writes it with NumPy), by MuJoCo and
by Drake where these are installed. DOP853 runs at the loosest relative tolerance (on a grid of half decades) at which
the final attitude is within the same error; it takes the same steps whoever computes the body. Each opponent runs in
turn with ours, in one process with one thread, three times at a turn, as a program calls them again and again; medians
of processor time.
Ours runs twice: at the tolerance asked for, which the error stays far below; and, as DOP853 does, at the loosest at
which the true error is within it ("tuned"). Errors are against DOP853 at 3e-14.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

import shapephase as sp
from shapephase import so3

from .cases import Case, cases
from .contestants import solve_ivp_attitude
from .simulators import Contestant, ModelRefused, available

# How many times faster than the leanest opponent is asked for, and what a compiled program would be.
TARGETS = {1e-6: None, 1e-9: (8, 14), 1e-12: (15, None)}
TURNS, TURNS_OF_MORE, RUNS = 9, 3, 3


@dataclass(frozen=True)
class Row:
    """One case at one tolerance: times [ms] of ours and of the others, evaluations, error and estimate [rad]."""

    ours: float
    tuned: float
    tuned_to: float
    others: tuple[float, ...]
    evaluations: int
    their_evaluations: int
    error: float
    estimate: float


def main() -> None:
    """Print the tables."""
    print_tables([float(argument) for argument in sys.argv[1:]] or list(TARGETS))


def print_tables(tolerances: list[float]) -> None:
    """All of them."""
    all_cases = cases()
    truths = [so3.matrix_from_quat(solve_ivp_attitude(case, 3e-14, 1e-16)[0]) for case in all_cases]
    names = ["lean", *(name for name, _ in available())]
    for tolerance in tolerances:
        print(f"\ntolerance {tolerance:g} rad; times in ms")
        heads = "".join(f"{name:>9.8}" for name in names)
        print(
            f"{'case':38}{'ours':>6}{'tuned':>7}{'to':>8}{heads}{'ratio':>7}{'tuned':>7}{'evals':>7}{'ivp':>6}{'error':>9}"
            f"{'estimate':>10}"
        )
        rows = [compared(case, truth, tolerance) for case, truth in zip(all_cases, truths, strict=True)]
        for case, row in zip(all_cases, rows, strict=True):
            times = "".join(f"{other:9.2f}" for other in row.others)
            ratios = f"{row.others[0] / row.ours:7.1f}{row.others[0] / row.tuned:7.1f}"
            print(
                f"{case.name:38}{row.ours:6.2f}{row.tuned:7.2f}{row.tuned_to:8.0e}{times}{ratios}"
                f"{row.evaluations:7d}{row.their_evaluations:6d}{row.error:9.1e}{row.estimate:10.1e}"
            )
        print_summary(rows, names, tolerance)


def print_summary(rows: list[Row], names: list[str], tolerance: float) -> None:
    """Medians and ratios."""
    ours, tuned = np.array([r.ours for r in rows]), np.array([r.tuned for r in rows])
    for place, name in enumerate(names):
        theirs = np.array([r.others[place] for r in rows])
        print(
            f"  {name:18} median {np.nanmedian(theirs):6.2f} ms; ours {np.median(ours):.2f}: median of ratios "
            f"{np.nanmedian(theirs / ours):5.1f}; ours at the same true error {np.median(tuned):.2f}: "
            f"{np.nanmedian(theirs / tuned):5.1f}"
        )
    asked = TARGETS.get(tolerance)
    if asked:
        hoped = f", {asked[1]} if it can be" if asked[1] else ""
        print(f"  asked at the same true error: {asked[0]} times the lean one{hoped}")
    print(
        f"  evaluations {np.median([r.evaluations for r in rows]):.0f} in the median (asked at 1e-9: 130); estimate "
        f"over error {np.median([r.estimate / r.error for r in rows]):.0f} in the median (asked: 1000), error above "
        f"the estimate in {sum(r.error > r.estimate for r in rows)} cases"
    )


def compared(case: Case, truth: np.ndarray, tolerance: float) -> Row:
    """All contestants on one case, in turn."""
    deformation = sp.articulated(case.body, case.path)
    rtol = loosest(case, truth, tolerance)
    _, their_evaluations = solve_ivp_attitude(case, rtol)

    def ours() -> sp.Motion:
        return sp.reconstruct(deformation, case.momentum, tolerance=tolerance)

    tuned_to = our_loosest(case, truth, tolerance)

    def tuned() -> sp.Motion:
        return sp.reconstruct(deformation, case.momentum, tolerance=tuned_to)

    contestants = [solve_ivp_attitude, *(contestant for _, contestant in available())]
    motion = ours()
    ours_ms: list[tuple[float, float]] = []
    others_ms: list[float] = []
    for contestant in contestants:

        def theirs(contestant: Contestant = contestant) -> object:
            return contestant(case, rtol)

        if not works(theirs):
            others_ms.append(np.nan)
            continue
        turns = TURNS if not others_ms else TURNS_OF_MORE
        order = (ours, theirs, tuned, theirs)
        runs = np.array([[[seconds(run) for _ in range(RUNS)] for run in order] for _ in range(turns)])
        mine, other, eased, _ = 1e3 * np.median(runs, axis=(0, 2))
        ours_ms.append((float(mine), float(eased)))
        others_ms.append(float(other))
    error = float(so3.angle(truth.T @ motion.final_attitude))
    estimate = float(motion.error_estimate)
    return Row(*ours_ms[0], tuned_to, tuple(others_ms), motion.evaluations, their_evaluations, error, estimate)


def works(run: Callable[[], object]) -> bool:
    """Whether a simulator accepts the body; the first run also builds its model."""
    try:
        run()
    except ModelRefused:
        return False
    return True


def loosest(case: Case, truth: np.ndarray, tolerance: float) -> float:
    """The loosest tolerance of DOP853 that meets the error."""
    for exponent in np.arange(3.0, 13.6, 0.5):
        rtol = max(10.0**-exponent, 3e-14)
        if so3.angle(truth.T @ so3.matrix_from_quat(solve_ivp_attitude(case, rtol)[0])) <= tolerance:
            return rtol
    return 3e-14


def our_loosest(case: Case, truth: np.ndarray, tolerance: float) -> float:
    """Our loosest tolerance that meets the error."""
    deformation = sp.articulated(case.body, case.path)
    for exponent in np.arange(4.0, 12.6, 0.5):
        motion = sp.reconstruct(deformation, case.momentum, tolerance=10.0**-exponent)
        if so3.angle(truth.T @ motion.final_attitude) <= tolerance:
            return float(10.0**-exponent)
    return tolerance


def seconds(run: Callable[[], object]) -> float:
    """One run's time."""
    start = time.process_time()
    run()
    return time.process_time() - start


if __name__ == "__main__":
    main()
