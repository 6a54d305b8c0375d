"""Gauss quadrature and collocation on [0, 1]."""

from __future__ import annotations

import numpy as np

from ..arrays import Array


def gauss_tableau(stages: int) -> tuple[Array, Array, Array]:
    """Gauss nodes and weights on [0, 1], and the integrals from 0 to each node of the polynomials through the nodes."""
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    places = 0.5 * (nodes + 1.0)
    powers = np.arange(stages)
    values = places[:, None] ** powers
    integrals = places[:, None] ** (powers + 1) / (powers + 1)
    return places, 0.5 * weights, np.asarray(np.linalg.solve(values.T, integrals.T).T, dtype=np.float64)
