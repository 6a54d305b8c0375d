"""What limits of efforts cost a plan: `python -m benchmarks.plan_efforts [BODY ...]`.

Each turn is planned without limits of efforts, and again with limits of three fifths of the torques that this needs at
most, joint by joint. The torques are those of `joint_torques`, at 4,001 even times.
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import time
import warnings

import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.optimal_control import Limits, Plan, plan_reorientation

TURNS = {
    "example:ur5_robot": (60.0, "y", 3.0),
    "satellite": (40.0, "y", 20.0),
    "cat": (90.0, "x", 1.0),
    "astronaut": (60.0, "z", 2.0),
    "example:human": (90.0, "x", 1.0),
}
"""Degrees, axis, and duration [s]."""
SHARE = 0.6
"""Of the torques of the plan without limits."""
LEAST = 1e-3
"""Of the largest torque: the least limit of a joint."""
TIMES = 4001
RATE = 3.0
"""[rad/s or m/s] where a file states none."""


def torques(plan: Plan) -> np.ndarray:
    """Sizes of all torques of a plan: (4001, n)."""
    return np.abs(sp.joint_torques(plan.motion, np.linspace(0.0, plan.path.duration, TIMES)).torque)


def main() -> None:
    """Print each turn without and with limits."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bodies", nargs="*", default=list(TURNS))
    warnings.simplefilter("ignore")
    words = ("joints", "cost", "limited", "more", "s", "s", "share", "residual")
    print(f"{'body':20}" + "".join(f"{word:>11}" for word in words))
    for name in parser.parse_args().bodies:
        degrees, axis, duration = TURNS[name]
        body, turn = sp.load_body(name), np.radians(degrees) * np.eye(3)["xyz".index(axis)]
        rates = np.where(np.isfinite(body.rate_limits), body.rate_limits, RATE)
        begin = time.process_time()
        free = plan_reorientation(body, so3.exp(turn), duration=duration, limits=Limits(rate_limits=rates))
        seconds, peaks = time.process_time() - begin, torques(free).max(axis=0)
        most = np.maximum(SHARE * peaks, LEAST * peaks.max())
        begin = time.process_time()
        limits = Limits(rate_limits=rates, effort_limits=most)
        plan = plan_reorientation(body, so3.exp(turn), duration=duration, limits=limits)
        limited, share = time.process_time() - begin, (torques(plan) / most).max()
        more = plan.cost / free.cost - 1.0
        numbers = f"{free.cost:11.5g}{plan.cost:11.5g}{more:11.2%}{seconds:11.1f}{limited:11.1f}"
        print(f"{name:20}{body.n_shape:11d}{numbers}{share:11.7f}{plan.kkt_residual:11.1e}", flush=True)


if __name__ == "__main__":
    main()
