"""Rows of a plan's program that bound accelerations, jerks and efforts, each a part of its limit."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import Array
from .._spline_basis import SplineBasis
from ..task import Reorientation
from .node_efforts import node_efforts
from .node_functions import scipy_sparse, seen_at, sparse_matrix


class DerivativeRows:
    """Second and third derivatives of the coordinates at their control points, between which they lie.

    Attributes
    ----------
    values, jacobian : expressions of the unknowns, (j,) and (j, N)
    """

    def __init__(self, task: Reorientation, basis: SplineBasis, unknown: Any) -> None:
        import casadi

        sparse, count, place = scipy_sparse(), unknown.shape[0], task.dimension * basis.dimension
        self._unknown, self._duration = unknown, unknown[place]
        self._by_duration = casadi.DM(casadi.Sparsity.triplet(1, count, [0], [place]), 1.0)
        self._bare: dict[int, Any] = {}
        for order, limit in ((2, task.acceleration_limit), (3, task.jerk_limit)):
            limited = np.flatnonzero(np.isfinite(limit))
            chosen = sparse.eye(task.dimension).tocsr()[limited] / limit[limited, None]
            rows = sparse.kron(basis.derivative_control(order), sparse.csr_matrix(chosen))
            rest = sparse.csr_matrix((rows.shape[0], count - place))
            self._bare[order] = sparse_matrix(sparse.hstack([rows, rest]))
        scaled = [(order, rows, self._duration**-order) for order, rows in self._bare.items()]
        self.values = casadi.vertcat(*((rows @ unknown) * scale for _, rows, scale in scaled))
        slopes = [
            rows * scale - (order / self._duration) * scale * ((rows @ unknown) @ self._by_duration)
            for order, rows, scale in scaled
        ]
        self.jacobian = casadi.vertcat(*slopes)

    def hessian(self, multipliers: Any, cost_factor: Any) -> Any:  # noqa: ARG002 (they cost nothing)
        """Second derivatives of the weighted sum of the rows: (j,) -> (N, N)."""
        import casadi

        count, first = self._unknown.shape[0], 0
        found = casadi.MX(count, count)
        for order, rows in self._bare.items():
            weighted = rows.T @ multipliers[first : first + rows.shape[0]]
            first += rows.shape[0]
            scale = self._duration ** -(order + 1)
            across = -order * scale * (weighted @ self._by_duration)
            alone = (order * (order + 1) / self._duration) * scale * casadi.dot(weighted, self._unknown)
            found = found + across + across.T + alone * (self._by_duration.T @ self._by_duration)
        return found


class EffortTerms:
    """Efforts at the nodes and at the ends of pieces, and the integral of their squares.

    Attributes
    ----------
    values, jacobian : expressions of the unknowns, (j,) and (j, N): of each place all shares; none where they have no
        limits
    cost : [s]
    """

    def __init__(self, task: Reorientation, basis: SplineBasis, nodes: Array, weights: Array, unknown: Any) -> None:
        import casadi

        limited = task.efforts_limited
        places = np.concatenate([nodes, basis.nodes]) if limited else nodes
        # Quadrature is by the nodes alone; the attitudes at the ends of pieces come behind those there.
        self._weights = casadi.DM(np.append(weights, np.zeros(len(places) - len(nodes)))).T
        self._costs = 1.0 if task.cost == "effort" else 0.0
        self._seen = seen_at(task, basis, places, 2, unknown.shape[0])
        self._width, count = 3 * task.dimension + 5, len(places)
        self._at = casadi.reshape(self._seen @ unknown, self._width, count)
        self._functions = node_efforts(task)
        found = self._functions.shares.map(count)(self._at)
        self._counted = found.shape
        self.cost = casadi.dot(self._functions.load.map(count)(self._at), self._weights)
        self.values = casadi.vec(found) if limited else casadi.MX(0, 1)
        self.jacobian = casadi.MX(0, unknown.shape[0])
        if limited:
            slopes = self._functions.slopes.map(count)(self._at)
            self.jacobian = casadi.diagcat(*casadi.horzsplit(slopes, self._width)) @ self._seen

    def hessian(self, multipliers: Any, cost_factor: Any) -> Any:
        """Second derivatives of the weighted sum of the rows and of the cost: (j,), () -> (N, N)."""
        import casadi

        weights = casadi.reshape(multipliers, *self._counted) if multipliers.numel() else casadi.MX(*self._counted)
        blocks = self._functions.second.map(self._counted[1])(
            self._at, weights, self._costs * cost_factor * self._weights
        )
        return self._seen.T @ (casadi.diagcat(*casadi.horzsplit(blocks, self._width)) @ self._seen)
