"""A plan beside those of other programs, for the same problem: `python -m benchmarks.plan_peers [BODY ...]`.

The cat and the human turn by 90 degrees about their long axis within a second, from rest to rest in the posture of the
start, at the least integral of kinetic energy, within the limits of positions and rates that their files state.

    ours       `plan_reorientation` with default arguments
    CasADi     multiple shooting, as one writes it first, solved by IPOPT
    Drake      Hermite-Simpson collocation with its constraint of momentum, solved by IPOPT
    Crocoddyl  accelerations of the joints, FDDP, limits and ends by penalties: in an environment of its own, as its
               wheel needs another release of example-robot-data than this library's tests

The peers start from one small random loop of the joints. Each search is a process of its own and its processor time is
that of everything from the loaded body on; the cost, the miss and what exceeds limits are computed by this library, of
all in the same way, from the path's own reconstruction (whose error is below 1e-9 rad), at 4,001 times.

    --only WAY       one of them (again for more)
    --nodes N        intervals of the peers
    --seconds S      of processor time, at most, for a peer's solver
    --crocoddyl PY   a Python that has Crocoddyl; without it one is made in build/crocoddyl
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import multiprocessing
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.errors import PlanNotFound, ShapePhaseError
from shapephase.optimal_control import plan_reorientation

from .planners import crocoddyl_shooting
from .planners.rest_to_rest import Turn

TURNS = {"cat": (1.0, 0.0, 0.0), "example:human": (0.0, 0.0, 1.0)}
"""Bodies and their long axes."""
ANGLE = 0.5 * np.pi
DURATION = 1.0
NODES = 40
SECONDS = 120.0
WAYS = ("ours", "CasADi", "Drake", "Crocoddyl")


def searched(way: str, name: str, nodes: int, seconds: float, crocoddyl: Path) -> dict[str, Any]:
    """What one of them finds for a body, in how much processor time, and what it comes to."""
    warnings.simplefilter("ignore")
    turn = Turn(sp.load_body(name), so3.exp(ANGLE * np.array(TURNS[name])), DURATION, nodes, seconds)
    begin = time.process_time()
    spent = 0.0
    if way == "ours":
        path, said = _ours(turn)
    elif way == "CasADi":
        from .planners.casadi_shooting import shot

        path, said = shot(turn)
    elif way == "Drake":
        from .planners.drake_collocation import collocated

        path, said = collocated(turn)
    else:
        path, said, spent = crocoddyl_shooting.shot(turn, crocoddyl)
    row = {"joints": turn.body.n_shape, "seconds": time.process_time() - begin + spent, "said": said}
    if path is not None:
        try:
            row |= turn.judged(path)
        except ShapePhaseError as fault:
            row["said"] = f"{said}; {str(fault)[:60]}"
    return row


def _ours(turn: Turn) -> tuple[sp.ShapePath | None, str]:
    try:
        plan = plan_reorientation(turn.body, turn.goal, duration=turn.duration)
    except PlanNotFound as failure:
        return None, str(failure)[:60]
    return plan.path, plan.starts[0].status


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bodies", nargs="*", default=list(TURNS))
    parser.add_argument("--only", action="append", choices=WAYS)
    parser.add_argument("--nodes", type=int, default=NODES)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    parser.add_argument("--crocoddyl", type=Path)
    asked = parser.parse_args()
    ways = asked.only or WAYS
    python = asked.crocoddyl or (crocoddyl_shooting.environment() if "Crocoddyl" in ways else Path())
    columns = ("cost J s", "miss rad", "ends rad", "ends rad/s", "over")
    print(f"{'body':16}{'joints':>7}{'way':>12}{'seconds':>9}{''.join(f'{title:>11}' for title in columns)}  said")
    for name in asked.bodies:
        for way in ways:
            with multiprocessing.get_context("spawn").Pool(1) as alone:
                row = alone.apply(searched, (way, name, asked.nodes, asked.seconds, python))
            figures = [row.get(key, np.nan) for key in ("cost", "miss", "off", "moves", "beyond")]
            shown = f"{figures[0]:11.5g}" + "".join(f"{figure:11.1e}" for figure in figures[1:])
            print(f"{name:16}{row['joints']:7d}{way:>12}{row['seconds']:9.1f}{shown}  {row['said']}", flush=True)


if __name__ == "__main__":
    main()
