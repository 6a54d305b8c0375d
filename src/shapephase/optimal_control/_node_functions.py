"""What one collocation node contributes to the program: turning rate and cost density, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ..body.body import Body
from .symbolic import solve_linear, symbolic_body
from .task import Reorientation


@dataclass(frozen=True, eq=False)
class NodeFunctions:
    """CasADi functions of a node's y = (r, u, q, T): shape, its derivative by place, quaternion, duration.

    Attributes
    ----------
    values : y -> dq/ds (4,) and the density of the cost
    jacobian : y -> derivative of dq/ds by y, (4, 2 m + 5)
    hessian : y, multipliers of dq/ds (4,), factor of the density -> second derivatives of the weighted sum
    """

    values: Any
    jacobian: Any
    hessian: Any


_built: WeakKeyDictionary[Body, dict[tuple[object, ...], NodeFunctions]] = WeakKeyDictionary()


def node_functions(task: Reorientation) -> NodeFunctions:
    """The functions of a task, kept as long as its body: those of many joints take seconds to build."""
    kept = _built.setdefault(task.body, {})
    key = (task.cost, task.coupling.shape, task.coupling.tobytes(), task.offset.tobytes(), task.momentum.tobytes())
    if key not in kept:
        kept[key] = _node_functions(task)
    return kept[key]


def _node_functions(task: Reorientation) -> NodeFunctions:
    import casadi

    m = task.dimension
    y = casadi.SX.sym("y", 2 * m + 5)
    r, u, q, duration = y[:m], y[m : 2 * m], y[2 * m : 2 * m + 4], y[-1]
    turning, form = _turning_and_metric(task, r, u, q, duration)
    density = 0.5 * casadi.dot(u, form @ u)
    multipliers, factor = casadi.SX.sym("multipliers", 4), casadi.SX.sym("factor")
    gradient = casadi.gradient(casadi.dot(multipliers, turning) + factor * density, y)
    # Everything is linear in u but the density: its block of the Hessian is known, only the rest is differentiated.
    others = casadi.vertcat(r, y[2 * m :])
    mixed = casadi.jacobian(gradient, others)
    across = mixed[m : 2 * m, :]
    upper = casadi.horzcat(mixed[:m, :m], across[:, :m].T, mixed[:m, m:])
    middle = casadi.horzcat(across[:, :m], factor * form, across[:, m:])
    lower = casadi.horzcat(mixed[2 * m :, :m], across[:, m:].T, mixed[2 * m :, m:])
    hessian = casadi.densify(casadi.vertcat(upper, middle, lower))
    jacobian = casadi.densify(casadi.jacobian(turning, y))
    options = {"cse": True}
    return NodeFunctions(
        values=casadi.Function("node", [y], [turning, density], options),
        jacobian=casadi.Function("node_jacobian", [y], [jacobian], options),
        hessian=casadi.Function("node_hessian", [y, multipliers, factor], [hessian], options),
    )


def _turning_and_metric(task: Reorientation, r: Any, u: Any, q: Any, duration: Any) -> tuple[Any, Any]:
    """dq/ds (4,), and the metric (m, m) of the density 1/2 u' g u, zero where the cost has none."""
    import casadi

    body = symbolic_body(task.body)
    coupling = casadi.DM(task.coupling)
    joints, rates = coupling @ r + casadi.DM(task.offset), coupling @ u
    turn = -body.connection(joints) @ rates
    vector, scalar = q[:3], q[3]
    if np.any(task.momentum):
        seen = casadi.DM(task.momentum)
        back = seen - 2.0 * scalar * casadi.cross(vector, seen) + 2.0 * casadi.cross(vector, casadi.cross(vector, seen))
        turn = turn + duration * solve_linear(body.inertia(joints), back)
    turning = 0.5 * casadi.vertcat(scalar * turn + casadi.cross(vector, turn), -casadi.dot(vector, turn))
    if task.cost == "kinetic":
        return turning, coupling.T @ body.shape_metric(joints) @ coupling / duration
    if task.cost == "rate":
        return turning, casadi.SX(coupling.T @ coupling) / duration
    return turning, casadi.SX(task.dimension, task.dimension)
