"""Efforts of a body's joints at the places of a plan, and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ...arrays import Array
from ...body.body import Body
from .._spline_basis import SplineBasis
from ..symbolic import turned_back
from ..task import Reorientation
from .inverse_dynamics import InverseDynamics, inverse_dynamics
from .node_functions import node_arguments


@dataclass(frozen=True, eq=False)
class NodeEfforts:
    """CasADi functions of a place's y = (r, u, w, q, T): shape, its two derivatives by place, quaternion, duration.

    Shares are efforts relative to their measure, of the joints that have one: (l,). The load is T times the sum of
    their squares: its integral over places is that of the squares over time.

    shares : y -> shares (l,)
    load : y -> load of the shares
    slopes : y -> derivatives of the shares (l, 3 m + 5)
    second : y, multipliers of the shares (l,), factor of the load -> second derivatives of the weighted sum
    """

    shares: Any
    load: Any
    slopes: Any
    second: Any


_built: WeakKeyDictionary[Body, InverseDynamics] = WeakKeyDictionary()


def node_efforts(task: Reorientation) -> NodeEfforts:
    """Return the functions of a task; those of its body are kept as long as the body."""
    import casadi

    m, chain = task.dimension, task.links.chain
    if task.links not in _built:
        _built[task.links] = inverse_dynamics(chain)
    dynamics, measured = _built[task.links], np.flatnonzero(np.isfinite(task.effort_measure))
    y, multipliers, factor = casadi.MX.sym("y", 3 * m + 5), casadi.MX.sym("l", len(measured)), casadi.MX.sym("f")
    values, derivative, second = _dynamics_arguments(task)
    x, onward = values(y), derivative(y)
    duration = y[3 * m + 4]
    # Derivatives are by place: these efforts are those in time, times T^2.
    scale = casadi.DM(chain.matrix[:, measured] / task.effort_measure[measured]).T
    bare = scale @ dynamics.efforts(x)
    by_duration = casadi.MX(1, 3 * m + 5)
    by_duration[3 * m + 4] = 1.0
    shares = bare / duration**2
    slopes = (scale @ dynamics.slopes(x) @ onward) / duration**2 - 2.0 * (shares @ by_duration) / duration
    weights = multipliers + 2.0 * factor * duration * shares
    gradient = scale.T @ weights / duration**2
    curved = onward.T @ dynamics.second(x, gradient) @ onward + second(y, dynamics.slopes(x).T @ gradient)
    # Derivatives by T of the factor 1 / T^2, and of T times the squares of the shares.
    with_duration = -2.0 * (slopes.T @ weights) / duration + factor * 2.0 * (slopes.T @ shares)
    alone = -2.0 * casadi.dot(weights, shares) / duration**2
    across = with_duration @ by_duration
    curved = curved + across + across.T + alone * (by_duration.T @ by_duration)
    curved = curved + 2.0 * factor * duration * (slopes.T @ slopes)
    return NodeEfforts(
        shares=casadi.Function("shares", [y], [shares]),
        load=casadi.Function("load", [y], [duration * casadi.dot(shares, shares)]),
        slopes=casadi.Function("share_slopes", [y], [casadi.densify(slopes)]),
        second=casadi.Function("share_second", [y, multipliers, factor], [casadi.densify(curved)]),
    )


def _dynamics_arguments(task: Reorientation) -> tuple[Any, Any, Any]:
    """Return the arguments of inverse dynamics, (3 k + 3,), as functions of y.

    y -> x; y -> derivatives of x; y, factors of x -> second derivatives of the weighted sum.
    """
    import casadi

    m, chain = task.dimension, task.links.chain
    y, factors = casadi.SX.sym("y", 3 * m + 5), casadi.SX.sym("factors", 3 * len(chain.parents) + 3)
    from_shape = casadi.DM(chain.matrix @ task.coupling)
    place = from_shape @ y[:m] + casadi.DM(chain.matrix @ task.offset + chain.offset)
    momentum = casadi.SX(3, 1)
    if task.momentum.any():
        momentum = y[3 * m + 4] * turned_back(y[3 * m : 3 * m + 4], casadi.DM(task.momentum))
    x = casadi.vertcat(place, from_shape @ y[m : 2 * m], from_shape @ y[2 * m : 3 * m], momentum)
    second, _ = casadi.hessian(casadi.dot(factors, x), y)
    return (
        casadi.Function("seen", [y], [casadi.densify(x)]),
        casadi.Function("seen_slopes", [y], [casadi.jacobian(x, y)]),
        casadi.Function("seen_second", [y, factors], [second]),
    )


class EffortTerms:
    """Efforts at the nodes and at the ends of pieces, and the integral of their squares.

    values, jacobian : expressions of the unknowns, (j,) and (j, N): all shares at each place; empty without limits
    cost : [s]
    """

    def __init__(self, task: Reorientation, basis: SplineBasis, nodes: Array, weights: Array, unknown: Any) -> None:
        import casadi

        limited = task.efforts_limited
        places = np.concatenate([nodes, basis.nodes]) if limited else nodes
        # The nodes alone have weights; attitudes at the ends of pieces follow theirs.
        self._weights = casadi.DM(np.append(weights, np.zeros(len(places) - len(nodes)))).T
        self._costs = 1.0 if task.cost == "effort" else 0.0
        self._arguments = node_arguments(task, basis, places, 2, unknown.shape[0])
        self._width, count = 3 * task.dimension + 5, len(places)
        self._at = casadi.reshape(self._arguments @ unknown, self._width, count)
        self._functions = node_efforts(task)
        shares = self._functions.shares.map(count)(self._at)
        self._counted = shares.shape
        self.cost = casadi.dot(self._functions.load.map(count)(self._at), self._weights)
        self.values = casadi.vec(shares) if limited else casadi.MX(0, 1)
        self.jacobian = casadi.MX(0, unknown.shape[0])
        if limited:
            slopes = self._functions.slopes.map(count)(self._at)
            self.jacobian = casadi.diagcat(*casadi.horzsplit(slopes, self._width)) @ self._arguments

    def hessian(self, multipliers: Any, cost_factor: Any) -> Any:
        """Second derivatives of the weighted sum of the rows and of the cost: (j,), () -> (N, N)."""
        import casadi

        weights = casadi.reshape(multipliers, *self._counted) if multipliers.numel() else casadi.MX(*self._counted)
        blocks = self._functions.second.map(self._counted[1])(
            self._at, weights, self._costs * cost_factor * self._weights
        )
        return self._arguments.T @ (casadi.diagcat(*casadi.horzsplit(blocks, self._width)) @ self._arguments)
