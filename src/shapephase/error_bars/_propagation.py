"""Covariances carried to results, and from rotations to their angles."""

from __future__ import annotations

import numpy as np

from .. import so3
from ..arrays import Array

_BARS_FROM_ZERO = 5.0  # an angle that is as large changes by turns about its own axis alone


def carried(derivative: Array, covariance: Array) -> Array:
    """The covariance of derivative @ errors: (r, m), (m,) or (m, m) -> (r, r)."""
    return (derivative * covariance if covariance.ndim == 1 else derivative @ covariance) @ derivative.T


def angle_bar(rotation: Array, covariance: Array) -> float:
    """The rms change of a rotation's angle [rad]; near 0 that of the whole rotation, which it cannot exceed.

    Angles at 180 degrees only shrink: theta = pi - |a . e|, by as much as the error e turns about the axis a.
    """
    vector, variance = so3.log(rotation), np.trace(covariance)
    angle = np.linalg.norm(vector)
    if angle > _BARS_FROM_ZERO * np.sqrt(np.linalg.eigvalsh(covariance)[-1].clip(0.0)):
        axis = vector / angle
        variance = axis @ covariance @ axis
    return float(np.sqrt(max(variance, 0.0)))
