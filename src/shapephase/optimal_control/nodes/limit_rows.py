"""Rows of a plan's program that bound accelerations, jerks and efforts, each as a share of its limit."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import Array
from .._spline_basis import SplineBasis
from ..task import Reorientation
from .node_efforts import node_efforts
from .node_functions import node_arguments, scipy_sparse, sparse_matrix


def derivative_rows(task: Reorientation, basis: SplineBasis, unknown: Any) -> Any:
    """Second and third derivatives of the coordinates by time, at their control points, as shares of limits: (j,)."""
    import casadi

    sparse, place = scipy_sparse(), task.dimension * basis.dimension
    rows = []
    for order, limit in ((2, task.acceleration_limit), (3, task.jerk_limit)):
        limited = np.flatnonzero(np.isfinite(limit))
        chosen = sparse.csr_matrix(sparse.eye(task.dimension).tocsr()[limited] / limit[limited, None])
        matrix = sparse_matrix(sparse.kron(basis.derivative_control(order), chosen))
        rows.append(matrix @ unknown[:place] / unknown[place] ** order)
    return casadi.vertcat(*rows)


class EffortTerms:
    """Efforts at the nodes and at the ends of pieces, and the integral of their squares.

    Attributes
    ----------
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
