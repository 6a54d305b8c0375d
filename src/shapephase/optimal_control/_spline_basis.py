"""Splines of plans, linear in their control points, which bound them; and Gauss quadrature and collocation."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, Mask
from ..chebyshev import gauss_tableau
from ..shape_space.shape_path import ShapePath

_DEGREE = 3  # twice differentiable: the acceleration cost is finite, and `ShapePath.spline` reads it back


@dataclass(frozen=True)
class SplineBasis:
    """C2 cubic splines on `pieces` equal pieces of [0, 1], with not-a-knot ends.

    The functions that `ShapePath.spline(..., periodic=False)` makes of values at the ends of the pieces. A spline lies
    between the least and the largest of its control points, its rate between those of the rate.

    pieces : six or more
    """

    pieces: int

    @property
    def dimension(self) -> int:
        """Number k of control points, the dimension of the spline space."""
        return self.pieces + 1

    @cached_property
    def nodes(self) -> Array:
        """Ends of the pieces: (pieces + 1,)."""
        return np.linspace(0.0, 1.0, self.pieces + 1)

    @cached_property
    def knots(self) -> Array:
        """Knots: the nodes without the second and the last but one, the ends fourfold."""
        return np.concatenate([np.zeros(_DEGREE + 1), self.nodes[2:-2], np.ones(_DEGREE + 1)])

    def gauss(self, stages: int) -> tuple[Array, Array]:
        """Gauss nodes of all pieces of [0, 1] and their weights: (N,), (N,)."""
        inside, weights, _ = gauss_tableau(stages)
        places = (self.nodes[:-1, None] + inside / self.pieces).ravel()
        return places, np.tile(weights, self.pieces) / self.pieces

    def matrix(self, places: Array, order: int = 0) -> Array:
        """Values of the basis functions, or of a derivative by place, at places of [0, 1]: (N,) -> (N, k)."""
        from scipy.interpolate import BSpline

        spline = BSpline(self.knots, np.eye(self.dimension), _DEGREE)
        return np.asarray(spline.derivative(order)(places) if order else spline(places))

    def sparse_matrix(self, places: Array, order: int = 0) -> Any:
        """Sparse `matrix` for long splines; order 0 or 1, places within [0, 1]."""
        from scipy.interpolate import BSpline
        from scipy.sparse import csr_matrix

        if order == 0:
            return BSpline.design_matrix(places, self.knots, _DEGREE)
        return BSpline.design_matrix(places, self.knots[1:-1], _DEGREE - 1) @ csr_matrix(self.rate_control)

    @cached_property
    def inverse_norm(self) -> Array:
        """Inverse of the Gram matrix of values at the control points and of rates along the path: (k, k)."""
        places, weights = self.gauss(_DEGREE)
        rates = self.sparse_matrix(places, 1)
        weighted = rates.multiply(weights[:, None])
        return np.linalg.inv((weighted.T @ rates).toarray() + np.eye(self.dimension))

    @cached_property
    def rate_control(self) -> Array:
        """Matrix from control points to those of the derivative by place: (k - 1, k)."""
        return self.derivative_control(1)

    def derivative_control(self, order: int) -> Array:
        """Matrix from control points to those of a derivative by place, the first to the third: (k - order, k)."""
        matrix = np.eye(self.dimension)
        for past in range(order):
            degree = _DEGREE - past
            spread = self.knots[_DEGREE + 1 : -1 - past] - self.knots[1 + past : -_DEGREE - 1]
            matrix = degree / spread[:, None] * np.diff(matrix, axis=0)
        return matrix

    @cached_property
    def rate_reaches(self) -> Mask:
        """True for the pieces into which each control point of the derivative reaches: (pieces, k - 1)."""
        from scipy.interpolate import BSpline

        middles = 0.5 * (self.nodes[1:] + self.nodes[:-1])
        return np.asarray(BSpline(self.knots[1:-1], np.eye(self.dimension - 1), _DEGREE - 1)(middles)) > 0.0

    def end_conditions(self, equal: int, *, end_moves: bool, periodic: bool) -> Array:
        """Rows whose products with the control points are zero: (j, k).

        equal : number of equal control points at the end; counts only where the last of them moves
        end_moves : whether the end is free
        periodic : whether the rates at both ends are equal
        """
        rows = []
        if end_moves:
            for place in range(1, equal):
                row = np.zeros(self.dimension)
                row[[-1 - place, -1]] = [1.0, -1.0]
                rows.append(row)
        if periodic:
            difference = self.rate_control[0] - self.rate_control[-1]
            rows.append(difference / np.abs(difference).max())
        return np.array(rows).reshape(-1, self.dimension)

    def fitted(self, values: Array, places: Array) -> Array:
        """Control points of the spline nearest to the values of a curve, with its ends: (N, m) -> (k, m)."""
        weights = self.matrix(places)
        control = np.zeros((self.dimension, values.shape[1]))
        control[[0, -1]] = values[[0, -1]]
        rest = values - weights @ control
        control[1:-1] = np.linalg.lstsq(weights[:, 1:-1], rest, rcond=None)[0]
        return control

    def through(self, values: Array) -> Array:
        """Control points of the spline with these values at the ends of the pieces: (pieces + 1, m) -> (k, m)."""
        from scipy.interpolate import make_interp_spline

        return np.asarray(make_interp_spline(self.nodes, values, k=_DEGREE).c)

    def path(self, control: Array, duration: float, joint_names: tuple[str, ...]) -> ShapePath:
        """Return the spline with control points (k, n) as a path of the joints."""
        values = self.matrix(self.nodes) @ control
        return ShapePath.spline(self.nodes * duration, values, periodic=False, joint_names=joint_names)
