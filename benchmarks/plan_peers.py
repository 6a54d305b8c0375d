"""A plan beside one by a plain transcription in CasADi: `python -m benchmarks.plan_peers [BODY ...]`.

The same problem for both: the cat and the human turn by 90 degrees about their long axis within a second, from rest to
rest in the posture of the start, at the least integral of kinetic energy, within the positions' limits, without
limits of rates. The peer is what one writes first: multiple shooting with Runge-Kutta steps of fourth order between
even nodes, joints that accelerate evenly between them, attitude as a quaternion, IPOPT with its limited memory (an
exact Hessian of the human's energy takes minutes to build), from a small random loop of the joints. It gets this
library's own expressions of connection and energy; what is compared is the search.

The miss is that of both motions reconstructed by the library, whose error is below 1e-9 rad.

    --nodes N    of the peer
    --seconds S  of processor time, at most, for the peer's solver
"""

from __future__ import annotations

import os

for _pool in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_pool, "1")

import argparse
import time
import warnings
from functools import partial
from typing import Any

import casadi
import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.errors import PlanNotFound
from shapephase.optimal_control import Limits, path_cost, plan_reorientation, symbolic_body

TURNS = {"cat": (1.0, 0.0, 0.0), "example:human": (0.0, 0.0, 1.0)}
"""Bodies and their long axes."""
ANGLE = 0.5 * np.pi
DURATION = 1.0
NODES = 40
SECONDS = 120.0
SMALL = 0.2
"""[rad or m] of the peer's first guess."""


def ours(body: sp.Body, goal: np.ndarray) -> tuple[sp.ShapePath | None, str]:
    """The path of `plan_reorientation` with default arguments."""
    try:
        plan = plan_reorientation(body, goal, duration=DURATION, limits=Limits(rate_limits=None))
    except PlanNotFound as failure:
        return None, str(failure)[:60]
    return plan.path, plan.starts[0].status


def peer(body: sp.Body, goal: np.ndarray, nodes: int, seconds: float) -> tuple[sp.ShapePath, str]:
    """The path of the transcription."""
    functions, n, step = symbolic_body(body), body.n_shape, DURATION / nodes
    slope = _slope(functions, n)
    state, bend = casadi.MX.sym("state", 4 + 2 * n + 1), casadi.MX.sym("bend", n)
    k1 = slope(state, bend)
    k2 = slope(state + 0.5 * step * k1, bend)
    k3 = slope(state + 0.5 * step * k2, bend)
    k4 = slope(state + step * k3, bend)
    advance = casadi.Function("advance", [state, bend], [state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)])
    states, bends = casadi.MX.sym("states", 4 + 2 * n + 1, nodes + 1), casadi.MX.sym("bends", n, nodes)
    gaps = advance.map(nodes)(states[:, :-1], bends) - states[:, 1:]
    wanted = so3.quat_from_matrix(goal)
    x, y, z, w = wanted
    # The vector part of the quaternion that is missing at the end.
    missing = casadi.DM([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]]) @ states[:4, -1]
    begin = body.shape()
    first = np.concatenate([[0.0, 0.0, 0.0, 1.0], begin, np.zeros(n), [0.0]])
    ends = casadi.vertcat(states[:, 0] - first, states[4 : 4 + 2 * n, -1] - first[4 : 4 + 2 * n], missing)
    unknowns = casadi.vertcat(casadi.vec(states), casadi.vec(bends))
    constraints = casadi.vertcat(casadi.vec(gaps), ends)
    problem = {"x": unknowns, "f": states[-1, -1], "g": constraints}
    settings = {"hessian_approximation": "limited-memory", "max_cpu_time": seconds, "max_iter": 3000, "print_level": 0}
    solver = casadi.nlpsol("peer", "ipopt", problem, {"ipopt": settings, "print_time": False, "error_on_fail": False})
    lower, upper = np.full((4 + 2 * n + 1, nodes + 1), -np.inf), np.full((4 + 2 * n + 1, nodes + 1), np.inf)
    lower[4 : 4 + n], upper[4 : 4 + n] = body.joint_limits[:, :1], body.joint_limits[:, 1:]
    free = np.full(n * nodes, np.inf)
    found = solver(
        x0=_guess(body, begin, nodes),
        lbx=np.concatenate([lower.T.ravel(), -free]),
        ubx=np.concatenate([upper.T.ravel(), free]),
        lbg=0.0,
        ubg=0.0,
    )
    kept = np.array(found["x"]).ravel()[: states.numel()].reshape(nodes + 1, -1)
    bent = np.array(found["x"]).ravel()[states.numel() :].reshape(nodes, n)
    status = str(solver.stats()["return_status"])
    return _path(body, kept[:, 4 : 4 + n], kept[:, 4 + n : 4 + 2 * n], bent, step), status


def _slope(functions: Any, n: int) -> Any:
    """Rates of quaternion x y z w, joints, their rates, and energy, by the joints' accelerations."""
    state, bend = casadi.SX.sym("state", 4 + 2 * n + 1), casadi.SX.sym("bend", n)
    quat, shape, rate = state[:4], state[4 : 4 + n], state[4 + n : 4 + 2 * n]
    a, b, c = casadi.vertsplit(-functions.connection(shape) @ rate)
    x, y, z, w = casadi.vertsplit(quat)
    turning = 0.5 * casadi.vertcat(
        w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a, -x * a - y * b - z * c
    )
    energy = 0.5 * rate.T @ functions.shape_metric(shape) @ rate
    return casadi.Function("slope", [state, bend], [casadi.vertcat(turning, rate, bend, energy)])


def _guess(body: sp.Body, begin: np.ndarray, nodes: int) -> np.ndarray:
    """A small random loop of the joints, and a base that rests."""
    rng, places = np.random.default_rng(0), np.linspace(0.0, 1.0, nodes + 1)[:, None]
    sines, cosines = SMALL * rng.normal(size=(2, body.n_shape))
    phase = 2.0 * np.pi * places
    shapes = begin + sines * np.sin(phase) + cosines * (1.0 - np.cos(phase))
    shapes = np.clip(shapes, *body.joint_limits.T)
    rates = 2.0 * np.pi / DURATION * (sines * np.cos(phase) + cosines * np.sin(phase))
    states = np.hstack([np.tile([0.0, 0.0, 0.0, 1.0], (nodes + 1, 1)), shapes, rates, 0.0 * places])
    return np.concatenate([states.ravel(), np.zeros(body.n_shape * nodes)])


def _path(body: sp.Body, shapes: np.ndarray, rates: np.ndarray, bends: np.ndarray, step: float) -> sp.ShapePath:
    """Joints that accelerate evenly between nodes."""

    def at(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        node = np.clip((times / step).astype(int), 0, len(bends) - 1)
        after = (times - node * step)[:, None]
        return shapes[node] + after * rates[node] + 0.5 * after**2 * bends[node], rates[node] + after * bends[node]

    breaks = step * np.arange(1, len(bends))
    return sp.ShapePath.function(at, DURATION, breaks=breaks, joint_names=body.joint_names)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bodies", nargs="*", default=list(TURNS))
    parser.add_argument("--nodes", type=int, default=NODES)
    parser.add_argument("--seconds", type=float, default=SECONDS)
    asked = parser.parse_args()
    print(f"{'body':16}{'joints':>7}{'search':>12}{'cost J s':>12}{'seconds':>9}{'miss rad':>10}  said")
    for name in asked.bodies:
        body, goal = sp.load_body(name), so3.exp(ANGLE * np.array(TURNS[name]))
        ways = (("ours", partial(ours, body, goal)), ("CasADi", partial(peer, body, goal, asked.nodes, asked.seconds)))
        for title, search in ways:
            begin = time.process_time()
            path, said = search()
            seconds = time.process_time() - begin
            cost, miss = np.nan, np.nan
            if path is not None:
                try:
                    motion = sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.0])
                    cost, miss = path_cost(body, path), so3.angle(goal.T @ motion.final_attitude)
                except sp.ShapePhaseError as fault:
                    said = f"{said}; {str(fault)[:60]}"
            print(f"{name:16}{body.n_shape:7d}{title:>12}{cost:12.5g}{seconds:9.1f}{miss:10.1e}  {said}", flush=True)


if __name__ == "__main__":
    main()
