"""A turn by a plain transcription in CasADi, what one writes first.

Multiple shooting with Runge-Kutta steps of fourth order between even nodes, joints that accelerate evenly between them,
attitude as a quaternion, IPOPT with its limited memory (an exact Hessian of the human's energy takes minutes to build).
It gets this library's own expressions of connection and energy; what is compared is the search.
"""

from __future__ import annotations

from typing import Any

import casadi
import numpy as np

import shapephase as sp
from shapephase import so3
from shapephase.optimal_control import symbolic_body

from .rest_to_rest import Turn


def shot(turn: Turn) -> tuple[sp.ShapePath, str]:
    """The path, and what the solver said."""
    body, nodes, step = turn.body, turn.nodes, turn.step
    functions, n = symbolic_body(body), body.n_shape
    slope = _slope(functions, n)
    state, bend = casadi.MX.sym("state", 4 + 2 * n + 1), casadi.MX.sym("bend", n)
    k1 = slope(state, bend)
    k2 = slope(state + 0.5 * step * k1, bend)
    k3 = slope(state + 0.5 * step * k2, bend)
    k4 = slope(state + step * k3, bend)
    advance = casadi.Function("advance", [state, bend], [state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)])
    states, bends = casadi.MX.sym("states", 4 + 2 * n + 1, nodes + 1), casadi.MX.sym("bends", n, nodes)
    gaps = advance.map(nodes)(states[:, :-1], bends) - states[:, 1:]
    x, y, z, w = so3.quat_from_matrix(turn.goal)
    # The vector part of the quaternion that is missing at the end.
    missing = casadi.DM([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]]) @ states[:4, -1]
    begin = body.shape()
    first = np.concatenate([[0.0, 0.0, 0.0, 1.0], begin, np.zeros(n), [0.0]])
    ends = casadi.vertcat(states[:, 0] - first, states[4 : 4 + 2 * n, -1] - first[4 : 4 + 2 * n], missing)
    unknowns = casadi.vertcat(casadi.vec(states), casadi.vec(bends))
    constraints = casadi.vertcat(casadi.vec(gaps), ends)
    problem = {"x": unknowns, "f": states[-1, -1], "g": constraints}
    settings = {
        "hessian_approximation": "limited-memory",
        "max_cpu_time": turn.seconds,
        "max_iter": 3000,
        "print_level": 0,
    }
    solver = casadi.nlpsol("peer", "ipopt", problem, {"ipopt": settings, "print_time": False, "error_on_fail": False})
    lower, upper = np.full((4 + 2 * n + 1, nodes + 1), -np.inf), np.full((4 + 2 * n + 1, nodes + 1), np.inf)
    lower[4 : 4 + n], upper[4 : 4 + n] = body.joint_limits[:, :1], body.joint_limits[:, 1:]
    lower[4 + n : 4 + 2 * n], upper[4 + n : 4 + 2 * n] = -turn.rates[:, None], turn.rates[:, None]
    free = np.full(n * nodes, np.inf)
    found = solver(
        x0=_guess(turn),
        lbx=np.concatenate([lower.T.ravel(), -free]),
        ubx=np.concatenate([upper.T.ravel(), free]),
        lbg=0.0,
        ubg=0.0,
    )
    kept = np.array(found["x"]).ravel()[: states.numel()].reshape(nodes + 1, -1)
    bent = np.array(found["x"]).ravel()[states.numel() :].reshape(nodes, n)
    status = str(solver.stats()["return_status"])
    shapes, rates = kept[:-1, 4 : 4 + n], kept[:-1, 4 + n : 4 + 2 * n]
    return turn.path(np.stack([shapes, rates, 0.5 * bent], axis=-1)), f"IPOPT: {status}"


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


def _guess(turn: Turn) -> np.ndarray:
    """The joints' loop, and a base that rests."""
    shapes, rates, accelerations = turn.first_guess(np.linspace(0.0, 1.0, turn.nodes + 1))
    rest = np.tile([0.0, 0.0, 0.0, 1.0], (turn.nodes + 1, 1))
    states = np.hstack([rest, shapes, rates, np.zeros((turn.nodes + 1, 1))])
    return np.concatenate([states.ravel(), accelerations[:-1].ravel()])
