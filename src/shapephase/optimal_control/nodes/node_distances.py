"""Distances between links at the nodes of a plan, by coal, with exact first derivatives, as functions for CasADi."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from .._plan_limits import Margins
from .._spline_basis import SplineBasis
from ..task import Reorientation
from .node_functions import scipy_sparse, sparse_matrix

_STEP = 1e-4  # [rad or m] of differences of gradients: their error is 1e-5, a kink of parallel faces is as sharp
_COUNTS = 1e-6  # share of the largest multiplier below which a distance has no part in second derivatives


class DistanceTerms:
    """Distances of pairs of links at the nodes of a program.

    values, jacobian : expressions of the unknowns, (K N,) and its derivative: all distances at each of N places [m]
    """

    def __init__(self, task: Reorientation, basis: SplineBasis, margins: Margins, unknown: Any) -> None:
        import casadi

        assert task.geometry is not None
        assert task.clearance is not None
        self._geometry = geometry = task.geometry
        numbers = [geometry.pairs.index(pair) for pair in margins.beyond]
        self._task, self._least, self._members = (
            task,
            task.clearance,
            np.flatnonzero(np.isin(geometry.members[1], numbers)),
        )
        places, _ = basis.gauss(margins.nodes)
        m, count, kinds = task.dimension, len(places), len(self._members)
        sparse = scipy_sparse()
        shapes = sparse.kron(basis.matrix(places), sparse.eye(m))
        rest = sparse.csr_matrix((m * count, unknown.shape[0] - shapes.shape[1]))
        self._arguments = sparse_matrix(sparse.hstack([shapes, rest]))
        self._at = casadi.reshape(self._arguments @ unknown, m, count)
        # CasADi does not keep callbacks alive.
        self._distances = _callback("distances", self._distance_rows, [(m, count)], (kinds, count))
        self._slopes = _callback("distance_slopes", self._slope_rows, [(m, count)], (kinds, m * count))
        self._second = _callback("distance_second", self._second_rows, [(m, count), (kinds, count)], (m, m * count))
        self.values = casadi.vec(self._distances(self._at))
        self.jacobian = casadi.diagcat(*casadi.horzsplit(self._slopes(self._at), m)) @ self._arguments

    def bounds(self, margins: Margins) -> Array:
        """Least values of the rows: the clearance, and the margin of each pair: (K N,) [m]."""
        pairs = [self._geometry.pairs[number] for number in self._geometry.members[1][self._members].tolist()]
        least = [self._least + margins.beyond[pair] for pair in pairs]
        return np.tile(least, self._at.shape[1])

    def hessian(self, multipliers: Any) -> Any:
        """Second derivatives of the weighted sum of the rows, by differences of gradients: (K N,) -> (U, U)."""
        import casadi

        blocks = self._second(self._at, casadi.reshape(multipliers, *self._distances.size_out(0)))
        banded = casadi.diagcat(*casadi.horzsplit(blocks, self._task.dimension))
        return self._arguments.T @ (banded @ self._arguments)

    def _measured(self, coordinates: Array, rows: Integers, members: Integers) -> tuple[Array, Array]:
        """Distances of pairs of solids (M,) at coordinates (N, m) of rows (M,), and their derivatives (M, m)."""
        geometry = self._geometry
        postures = geometry.postures(self._task.shapes(coordinates))
        separations = geometry.separations(postures, rows, members)
        slopes = geometry.slopes(postures, rows, members, separations)
        return separations.distances, slopes @ self._task.coupling

    def _everywhere(self, at: Array) -> tuple[Array, Array]:
        count, kinds = at.shape[1], len(self._members)
        return self._measured(at.T, np.repeat(np.arange(count), kinds), np.tile(self._members, count))

    def _distance_rows(self, at: Array) -> Array:
        return self._everywhere(at)[0].reshape(at.shape[1], -1).T

    def _slope_rows(self, at: Array) -> Array:
        slopes = self._everywhere(at)[1].reshape(at.shape[1], -1, len(at))
        return slopes.transpose(1, 0, 2).reshape(slopes.shape[1], -1)

    def _second_rows(self, at: Array, weights: Array) -> Array:
        m, count = at.shape
        kinds, nodes = np.nonzero(np.abs(weights) > _COUNTS * np.abs(weights).max(initial=0.0))
        shifts = _STEP * np.vstack([np.zeros(m), np.eye(m)])
        coordinates = (at.T[None] + shifts[:, None]).reshape(-1, m)
        rows = (np.arange(m + 1)[:, None] * count + nodes).ravel()
        _, slopes = self._measured(coordinates, rows, np.tile(self._members[kinds], m + 1))
        gradients = np.zeros((count, m + 1, m))
        weighted = slopes.reshape(m + 1, -1, m) * weights[kinds, nodes][:, None]
        np.add.at(gradients, nodes, weighted.transpose(1, 0, 2))
        bent = (gradients[:, 1:] - gradients[:, :1]) / _STEP
        return (0.5 * (bent + bent.transpose(0, 2, 1))).transpose(1, 0, 2).reshape(m, -1)


def _callback(name: str, function: Callable[..., Array], inputs: list[tuple[int, int]], output: tuple[int, int]) -> Any:
    """A function of dense matrices as one of CasADi, without derivatives."""
    import casadi

    class Evaluated(casadi.Callback):
        def __init__(self) -> None:
            super().__init__()
            self.construct(name)

        def get_n_in(self) -> int:
            return len(inputs)

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            return casadi.Sparsity.dense(*inputs[i])

        def get_sparsity_out(self, i: int) -> Any:  # noqa: ARG002
            return casadi.Sparsity.dense(*output)

        def eval(self, given: Any) -> list[Any]:
            return [casadi.DM(function(*(np.array(matrix) for matrix in given)))]

    return Evaluated()
