"""Metric g of a cost that is the integral of 1/2 r' g r': kinetic, that of rates, or given by the user."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arguments import check_choice
from ..arrays import Array, finite_array
from ..body.body import Body
from ..body.particles.casadi_positions import is_casadi_function
from ..body.particles.point_masses import ParticleBody
from ..display import short_repr
from ..errors import ShapeError
from ..letters import value_text
from .symbolic import symbolic_body

METRIC_COSTS = ("kinetic", "rate", "metric")  # costs that are such integrals
_ASYMMETRY = 1e-9  # of the largest entry: rounding of user input


@dataclass(frozen=True, eq=False)
class CostMetric:
    """Metric of a cost as a function of the shape.

    name : "kinetic", "rate", or "metric" where it is given
    metric : `casadi.Function` r (n,) -> g (n, n)
    key : equal for equal metrics of a body
    """

    name: str
    metric: Any
    key: object

    __repr__ = short_repr

    def values(self, shapes: Array) -> Array:
        """Metric of each shape: (N, n) -> (N, n, n)."""
        n = shapes.shape[1]
        return np.asarray(self.metric.map(len(shapes))(shapes.T)).T.reshape(-1, n, n)


def metric_argument(
    body: Body | ParticleBody, given: Any, name: str, choices: Collection[str] = METRIC_COSTS[:2]
) -> CostMetric:
    """Return the metric that a user gives: one of some words, a matrix (n, n), or a `casadi.Function` r -> g.

    Raises UnknownNameError for another word, ShapeError for what is not a symmetric positive definite matrix.
    """
    import casadi

    n = body.n_shape
    if is_casadi_function(given):
        sizes = (
            [tuple(given.size_in(k)) for k in range(given.n_in())],
            [tuple(given.size_out(k)) for k in range(given.n_out())],
        )
        if sizes != ([(n, 1)], [(n, n)]):
            raise ShapeError(
                f"{name}: a casadi.Function of one shape ({n}, 1) that gives ({n}, {n}) is needed, got {given}"
            )
        return CostMetric("metric", given, id(given))
    if given is None or isinstance(given, str):
        check_choice(given, name, choices)
        if given == "kinetic":
            return CostMetric(given, symbolic_body(body).shape_metric, given)
        matrix = np.eye(n)
    else:
        matrix = finite_array(given, name, (n, n))
        gap = np.abs(matrix - matrix.swapaxes(-1, -2)).max(initial=0.0)
        if matrix.ndim != 2 or gap > _ASYMMETRY * np.abs(matrix).max() or np.linalg.eigvalsh(matrix)[0] <= 0.0:
            raise ShapeError(
                f"{name}: a symmetric positive definite matrix ({n}, {n}) is needed, got {value_text(given)}"
            )
    shape = casadi.SX.sym("shape", n)
    constant = casadi.Function("constant", [shape], [casadi.SX(casadi.DM(0.5 * (matrix + matrix.T)))])
    return CostMetric(given if isinstance(given, str) else "metric", constant, matrix.tobytes())
