"""Times and costs of plans from default arguments: `python -m benchmarks.planning`.

Times are processor times of the first plan for a body, so its symbolic functions are included; beside each stands the
time aimed at.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import time

import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.errors import PlanNotFound
from shapephase.examples.scenarios import kane_scher
from shapephase.optimal_control import Search, path_cost, plan_reorientation

# Body, turn [rad], the time aimed at [s].
TURNS = (
    ("cat_two_halves", np.pi * np.eye(3)[0], 5.0),
    ("cat", np.pi * np.eye(3)[0], 60.0),
    *(("astronaut", 0.5 * np.pi * axis, 120.0) for axis in np.eye(3)),
)
PIECES = (None, 10)
RIGHTINGS = ((0, 59.426459), (10, 60.036246), (20, 61.813873), (30, 64.618733), (45, 70.316222), (60, 77.132402))


def main() -> None:
    """Print both tables."""
    print(
        f"{'body':16}{'turn':>18}{'pieces':>7}{'time s':>8}{'aim':>5}{'cost':>12}{'miss':>9}"
        f"{'gap':>9}{'KKT':>9}{'iterations':>11}"
    )
    for name, turn, aim in TURNS:
        for pieces in PIECES:
            print_row(name, turn, aim, pieces)
    print(f"\n{'alpha':>6}{'Kane and Scher':>16}{'optimum':>12}{'saved':>8}")
    body = sp.load_body("cat_two_halves")
    for alpha, beta in RIGHTINGS:
        theirs = kane_scher(np.radians(alpha), np.radians(beta))
        cost, target = path_cost(body, theirs), sp.holonomy(body, theirs, 1e-11)
        plan = plan_reorientation(body, target, start=theirs.shape(0.0), rates_at_ends="free")
        print(f"{alpha:6d}{cost:16.7f}{plan.cost:12.7f}{1.0 - plan.cost / cost:8.2%}")
    straight = plan_reorientation(body, so3.exp(TURNS[0][1]), rates_at_ends="free")
    print(f"from the straight posture, half a turn about the long axis: {straight.cost:.7f}")


def print_row(name: str, turn: np.ndarray, aim: float, pieces: int | None) -> None:
    """One plan."""
    degrees = " ".join(f"{value:.0f}" for value in np.degrees(turn))
    body = sp.load_body(name)
    begin = time.process_time()
    try:
        search = Search(pieces=pieces, iterations=500)
        plan = plan_reorientation(body, so3.exp(turn), rates_at_ends="free", search=search)
    except PlanNotFound as failure:
        print(f"{name:16}{degrees:>18}{pieces or 'default':>7}{time.process_time() - begin:8.1f}{aim:5.0f}  {failure}")
        return
    seconds = time.process_time() - begin
    print(
        f"{name:16}{degrees:>18}{len(plan.coefficients) - 1:7d}{seconds:8.1f}{aim:5.0f}{plan.cost:12.6g}"
        f"{plan.goal_error:9.1e}{plan.transcription_gap:9.1e}{plan.kkt_residual:9.1e}{plan.iterations:11d}",
        flush=True,
    )


if __name__ == "__main__":
    main()
