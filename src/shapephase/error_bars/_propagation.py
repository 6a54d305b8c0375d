"""Covariances carried to results, and from rotations to their angles."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array

_BARS_FROM_THE_ENDS = 5.0  # from an angle to 0 and to 180 degrees, for it to have a bar of its own


def carried(derivative: Array, covariance: Array) -> Array:
    """The covariance of derivative @ errors: (r, m), (m,) or (m, m) -> (r, r)."""
    return (derivative * covariance if covariance.ndim == 1 else derivative @ covariance) @ derivative.T


def angle_bar(rotation: Array, covariance: Array) -> float:
    """The standard deviation of a rotation's angle, along its axis [rad]; NaN near 0 and 180 degrees."""
    vector = so3.log(rotation)
    angle = float(np.linalg.norm(vector))
    # Across the axis the angle of a small rotation only grows: the widest direction decides.
    widest = float(np.sqrt(max(np.linalg.eigvalsh(covariance)[-1], 0.0)))
    if _BARS_FROM_THE_ENDS * widest >= min(angle, np.pi - angle):
        return np.nan
    axis = vector / angle
    return float(np.sqrt(max(axis @ covariance @ axis, 0.0)))
