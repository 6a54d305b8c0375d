"""How a plan's unknowns are laid out, x = (control points, T, q at nodes, q at the ends of pieces), in CasADi."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...arrays import Array
from .._spline_basis import SplineBasis
from ..task import Reorientation


def seen_at(task: Reorientation, basis: SplineBasis, places: Array, order: int, unknowns: int) -> Any:
    """W: at each of the first places y = (r, dr/ds, ..., q, T) as linear functions of the unknowns.

    places : (N,), whose attitudes are the first N unknown ones
    order : of the last derivative
    """
    sparse = scipy_sparse()
    m, count = task.dimension, len(places)
    shapes = sparse.vstack([sparse.kron(basis.matrix(places, k), sparse.eye(m)) for k in range(order + 1)])
    whole = sparse.block_diag([shapes, np.ones((count, 1)), sparse.eye(4 * count)]).tocsr()
    width, passed = (order + 1) * m, (order + 1) * m * count
    rows = np.concatenate(
        [
            np.arange(passed).reshape(order + 1, count, m).transpose(1, 0, 2).reshape(count, width),
            passed + count + np.arange(4 * count).reshape(count, 4),
            passed + np.arange(count)[:, None],
        ],
        axis=1,
    )
    rest = sparse.csr_matrix((whole.shape[0], unknowns - whole.shape[1]))
    return sparse_matrix(sparse.hstack([whole, rest]).tocsr()[rows.ravel()])


def scipy_sparse() -> Any:
    """SciPy's sparse matrices: imported late, and without the types that they lack."""
    from scipy import sparse

    return sparse


def sparse_matrix(matrix: Any) -> Any:
    """A constant sparse matrix of CasADi."""
    import casadi

    return casadi.DM(scipy_sparse().csc_matrix(matrix))
