"""What shows that a plan is optimal."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array
from ..shape_space.connection import mechanical_connection
from ._polish import panel_nodes
from ._spline_basis import SplineBasis
from .task import Reorientation

# Pieces at both ends that are left out: from rest a spline takes some to come to its speed.
_ENDS = 3
# Of a rate limit: what counts as being at it.
_AT_LIMIT = 1.0 - 1e-5


def hamiltonian_spread(task: Reorientation, basis: SplineBasis, control: Array, duration: float) -> float | None:
    """Largest less least mean of Pontryagin's Hamiltonian over a piece, relative to its mean; None where undefined.

    Without momentum the cost's density L is quadratic in the rates, and what the holonomy adds to it is linear in them,
    so that H = L; and H is constant as nothing depends on time. A limit of positions does not change that, a limit of
    rates does, and so does a waypoint with a time; with limits of accelerations, jerks or efforts it is another
    Hamiltonian.

    Source: theory.md B6; Pontryagin's principle.
    """
    timed = any(point.place is not None for point in task.via)
    if task.cost not in ("kinetic", "rate") or task.momentum.any() or task.limits_beyond_rates or timed:
        return None
    places, _ = panel_nodes(basis)
    coordinates = basis.matrix(places) @ control
    rates = basis.matrix(places, 1) @ control / duration
    joints = rates @ task.coupling.T
    if task.cost == "rate":
        density = 0.5 * np.sum(joints**2, axis=1)
    else:
        shapes = task.shapes(coordinates)
        density = task.body.kinetic_energy(shapes, joints, -so3.apply(mechanical_connection(task.body, shapes), joints))
    limited = np.any(np.abs(basis.rate_control @ control) > _AT_LIMIT * task.rate_limit * duration, axis=1)
    free = ~np.any(basis.rate_reaches & limited, axis=1)[_ENDS:-_ENDS]
    means = density.reshape(basis.pieces, -1).mean(axis=1)[_ENDS:-_ENDS][free]
    return float(np.ptp(means) / means.mean()) if means.any() else None
