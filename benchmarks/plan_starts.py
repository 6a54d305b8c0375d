"""How near to the best a plan from four starts comes: `python -m benchmarks.plan_starts [--kept FILE]`.

Twenty turns on the bodies of up to twelve joints of `benchmarks.plans`, drawn by a seed and kept whatever comes of
them; not the diver, whose two arms cannot turn him so far in one stroke. From rest to rest, within the positions'
limits; without limits of rates, so that the cost falls as the duration grows and the order of plans does not change.
Each turn is planned from four starts, and from forty by guesses of their own; the best is the cheapest of all.

    --goals N  how many of the twenty
    --kept F   every turn is a line of this file; turns that it has are not made again
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import json
import multiprocessing
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from shapephase import so3
from shapephase.errors import PlanNotFound
from shapephase.optimal_control import Limits, Search, plan_reorientation

from .plans import LEAST, MOST, body_named

GOALS = 20
SEED = 20261124
FEW, MANY = 4, 40
NEAR = 0.05
"""Of the best cost, within which a plan counts."""
BODIES = (
    "planar3", "hinged_pair", "cat_two_halves", "satellite", "two_armed_satellite", "example:ur5_robot",
    "example:solo12", "example:anymal",
)  # fmt: skip


def turns() -> list[tuple[str, np.ndarray]]:
    """Bodies and rotation vectors of all goals; a planar body turns in its plane."""
    rng = np.random.default_rng(SEED)
    drawn = []
    for number in range(GOALS):
        axis, angle = so3.normalised(rng.normal(size=3)), rng.uniform(LEAST, MOST)
        name = BODIES[number % len(BODIES)]
        drawn.append((name, angle * (np.array([0.0, 0.0, 1.0]) if name == "planar3" else axis)))
    return drawn


def judged(name: str, turn: np.ndarray) -> dict[str, Any]:
    """Costs and processor times of one turn from one, four and forty starts."""
    warnings.simplefilter("ignore")
    body, goal, limits = body_named(name), so3.exp(turn), Limits(rate_limits=None)
    row: dict[str, Any] = {"body": name, "joints": body.n_shape, "degrees": float(np.degrees(np.linalg.norm(turn)))}
    for starts, seed in ((1, 0), (FEW, 0), (MANY, 1)):
        begin, search = time.process_time(), Search(starts=starts, seed=seed)
        try:
            plan = plan_reorientation(body, goal, limits=limits, search=search)
            cost, reached = plan.cost, sum(start.converged for start in plan.starts)
        except PlanNotFound:
            cost, reached = np.inf, 0
        row |= {
            f"cost_{starts}": cost,
            f"reached_{starts}": reached,
            f"seconds_{starts}": time.process_time() - begin,
        }
    return row


def main() -> None:
    """Print each turn, and how many are near the best."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--goals", type=int, default=GOALS)
    parser.add_argument("--kept", type=Path)
    asked = parser.parse_args()
    rows: dict[int, dict[str, Any]] = {}
    if asked.kept is not None and asked.kept.exists():
        rows = {row["number"]: row for row in map(json.loads, asked.kept.read_text().splitlines())}
    print(f"{'body':22}{'joints':>7}{'degrees':>9}{'best':>12}{'one':>9}{'four':>9}{'forty':>9}{'seconds of each':>24}")
    above = []
    for number, (name, turn) in enumerate(turns()[: asked.goals]):
        if number not in rows:
            # A process for each, so that its first look at the body is its own.
            with multiprocessing.get_context("spawn").Pool(1) as alone:
                rows[number] = alone.apply(judged, (name, turn))
            if asked.kept is not None:
                with asked.kept.open("a") as file:
                    file.write(json.dumps(rows[number] | {"number": number}) + "\n")
        row = rows[number]
        counts = (1, FEW, MANY)
        best = min(row[f"cost_{starts}"] for starts in counts)
        above.append([row[f"cost_{starts}"] / best - 1.0 if np.isfinite(best) else np.inf for starts in counts])
        shares = "".join(f"{one:9.1%}" for one in above[-1])
        seconds = "".join(f"{row[f'seconds_{starts}']:8.1f}" for starts in counts)
        print(f"{name:22}{row['joints']:7d}{row['degrees']:9.1f}{best:12.5g}{shares}{seconds}", flush=True)
    near = np.sum(np.array(above) <= NEAR, axis=0)
    print(f"\nwithin {NEAR:.0%} of the best: {near[0]} of {len(above)} from one start, {near[1]} from four")


if __name__ == "__main__":
    main()
