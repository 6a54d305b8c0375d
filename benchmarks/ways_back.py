"""Twenty drifts of three satellites, taken back by `undo`: `python -m benchmarks.ways_back [NUMBER ...]`.

Half of the bodies have a momentum. Each drift passes through random postures within the limits of the joints; half of
them exceed the rate limits. The way back keeps to rates and efforts. Where it leaves the body is computed by
`reconstruct`, and by MuJoCo's inertia and momentum integrated by SciPy's DOP853.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import time
from typing import Any

import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.optimal_control import Limits, Search, undo

from .cases import Case
from .plans import body_named
from .simulators import mujoco_attitude

DRIFTS = 20
SEED = 20261129
KNOTS = 5
"""Postures that a drift passes through."""
TURN = 1.0
"""[rad] by which the momentum turns the body, at its largest inertia, during the way back."""
PACES = ((0.3, 2.0), (1.6, 8.0))
"""Largest share of the rate limits in a drift, and the duration of the way back in that of the drift; the second pair
for two of four drifts."""
BODIES = ("satellite", "two_armed_satellite", "winged_satellite")


def drift(number: int) -> tuple[sp.Motion, float]:
    """Motion of a body by a number, and the duration of its way back [s]; odd ones have a momentum."""
    rng = np.random.default_rng([SEED, number])
    body = body_named(BODIES[number % len(BODIES)])
    lower, upper = np.where(np.isfinite(body.joint_limits), body.joint_limits, [-3.0, 3.0]).T
    middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    shapes = middle + half * rng.uniform(-0.5, 0.5, (KNOTS, body.n_shape))
    path = sp.ShapePath.waypoints(np.linspace(0.0, 1.0, KNOTS), shapes, joint_names=body.joint_names)
    pace, longer = PACES[number % 4 > 1]
    share = float((np.abs(path.rate(np.linspace(0.0, 1.0, 1001))) / body.rate_limits).max())
    path = path.stretched(share / pace)
    inertia = body.locked_inertia(shapes[0])
    size = TURN * float(np.linalg.eigvalsh(inertia)[-1]) / (longer * path.duration) if number % 2 else 0.0
    momentum = size * so3.normalised(rng.normal(size=3))
    attitude = so3.exp(rng.uniform(-1.0, 1.0, 3))
    return sp.reconstruct(sp.articulated(body, path), momentum, attitude, tolerance=1e-11), longer * path.duration


def taken_back(number: int, pieces: int | None = None) -> dict[str, Any]:
    """The way back from one drift, and where it leaves the body."""
    motion, duration = drift(number)
    body, began = motion.deformation.description.body, time.process_time()
    limits = Limits(effort_limits="body")
    ways = undo(motion, duration=duration, limits=limits, search=Search(pieces=pieces))
    best = ways.best
    case = Case(body.name, body, best.path, motion.final_attitude.T @ motion.momentum)
    end, _ = mujoco_attitude(case, 1e-12, 1e-13)
    goal = motion.final_attitude.T @ motion.initial_attitude
    return {
        "body": body.name,
        "momentum": float(np.linalg.norm(motion.momentum)),
        "drift": float(so3.angle(goal)),
        "best": best.name,
        "miss": best.error,
        "mujoco": float(so3.angle(goal.T @ so3.matrix_from_quat(end))),
        "shares": dict(best.limit_shares),
        "keeps": best.keeps_limits,
        "cost": np.nan if ways.plan is None else ways.plan.cost,
        "backwards": ways.backwards.cost,
        "backwards_miss": ways.backwards.error,
        "backwards_keeps": ways.backwards.keeps_limits,
        "failure": ways.failure,
        "seconds": time.process_time() - began,
    }


def main() -> None:
    """Print each drift and its way back."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("numbers", nargs="*", type=int)
    for number in parser.parse_args().numbers or range(DRIFTS):
        row = taken_back(number)
        shares = " ".join(f"{name} {share:.3f}" for name, share in row["shares"].items())
        backwards = f"backwards {row['backwards']:.4g} off {row['backwards_miss']:.1e}"
        print(
            f"{number:2d} {row['body']:20}{row['momentum']:8.3g} kg m2/s{np.degrees(row['drift']):7.1f} deg "
            f"{row['best']:>10}{row['miss']:9.1e}{row['mujoco']:9.1e}  cost {row['cost']:.4g}, {backwards}; {shares}; "
            f"{row['seconds']:.1f} s {row['failure'][:200]}",
            flush=True,
        )


if __name__ == "__main__":
    main()
