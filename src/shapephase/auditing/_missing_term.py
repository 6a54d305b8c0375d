"""The hypothesis that an engine leaves out the gyroscopic term: a free body then keeps its angular velocity."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .. import so3
from ..arrays import Array
from ._residuals import Residuals, fitted_hypothesis, leftover
from .hypothesis import FittedValue, Hypothesis

_AS_ONE = 1e-3
"""Share of the momentum: joints that add less are at rest, and the body turns as one."""
_SEEN = 1e-9
"""Share of the largest column: what moves nothing, as the inertia of a ball does not, takes no part."""
_AXES = "xyz"


def no_gyroscopic_term(fits: Sequence[Residuals]) -> list[Hypothesis]:
    """Without omega x I omega in Euler's equations omega is constant in world axes: the momentum goes as R I R^T.

    Empty where joints move: what an engine makes of their motion then is not known.
    """
    if any(np.sqrt((fit.seen.internal**2).sum(axis=1).mean()) > _AS_ONE * fit.seen.scale for fit in fits):
        return []
    lefts, values = [], {}
    for fit in fits:
        seen = fit.seen
        columns = fit.columns(seen.attitude @ seen.inertia @ so3.transpose(seen.attitude))
        rate, left = _fitted(columns, fit.vector)
        lefts.append(left)
        if not values:
            values = {
                f"angular velocity {axis}": FittedValue(value=float(part), bar=float(bar), unit="rad/s")
                for axis, part, bar in zip(_AXES, *rate, strict=True)
            }
    return [
        fitted_hypothesis(
            "no gyroscopic term in the engine",
            "engine",
            leftover(fits, np.concatenate(lefts)),
            parameters=3 * len(fits),
            values=values,
            remark="the angular velocity is constant in world axes; switch the gyroscopic force of the engine on",
        )
    ]


def _fitted(columns: Array, vector: Array) -> tuple[tuple[Array, Array], Array]:
    """Least squares: the coefficients with their bars, and what is left."""
    left, strengths, right = np.linalg.svd(columns, full_matrices=False)
    kept = strengths > _SEEN * max(float(strengths.max(initial=0.0)), np.finfo(float).tiny)
    inverse = right[kept].T / strengths[kept]
    amounts = left[:, kept].T @ vector
    return (inverse @ amounts, np.linalg.norm(inverse, axis=1)), vector - left[:, kept] @ amounts
