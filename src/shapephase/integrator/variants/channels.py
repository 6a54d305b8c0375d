"""The channels of many deformations, from their inertias and momenta at the same times."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Mask
from ...errors import ShapeError, SingularInertiaError
from .._spectral_error import inverted


def many_inverted(inertia: Array, momentum: Array, times: Array) -> tuple[Array, Mask]:
    """I^-1 and I^-1 L_o, and which can be relied on: (V, S, 3, 3), (V, S, 3), (S,) -> (V, S, 9), (V,)."""
    count = len(inertia)
    reliable = np.ones(count, dtype=np.bool_)
    try:
        whole = inverted(inertia.reshape(-1, 3, 3), momentum.reshape(-1, 3), np.tile(times, count))
        return whole.reshape(count, len(times), 9), reliable
    except (SingularInertiaError, ShapeError):
        channels = np.zeros((count, len(times), 9))
    for place in range(count):
        try:
            channels[place] = inverted(inertia[place], momentum[place], times)
        except (SingularInertiaError, ShapeError):
            reliable[place] = False
    return channels, reliable
