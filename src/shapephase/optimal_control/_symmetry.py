"""Turns of a body after which it looks the same, and the goals that they make of one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arrays import Array, finite_array
from ..errors import ShapeError
from ..letters import what_came

# Rotations whose entries differ by less are the same: rounding of what the user computed.
_SAME = 1e-7
# The most rotations of a group: that of the icosahedron has 60; a body with more of them has an axis for all that it
# looks like.
_MOST_ROTATIONS = 120


def symmetry_argument(value: ArrayLike) -> Array:
    """A unit axis (3,), or all rotations (k, 3, 3) of the group that some of them make, the identity first.

    Raises ShapeError.
    """
    array = finite_array(value, "symmetry")
    if array.shape == (3,) and array.any():
        return so3.normalised(array)
    if array.ndim not in (2, 3) or array.shape[-2:] != (3, 3) or not len(array):
        raise ShapeError(
            "symmetry: an axis (3,) that is not zero, or rotations of the body, (3, 3) or (k, 3, 3), are needed, got "
            f"{what_came(value)}"
        )
    return _group(so3.rotation_argument(array, "symmetry").reshape(-1, 3, 3))


def different(rotations: Array) -> Array:
    """Rotations (k, 3, 3) without those that come again, in their order."""
    kept: list[Array] = []
    for rotation in rotations:
        if not _among(kept, rotation):
            kept.append(rotation)
    return np.array(kept)


def _group(generators: Array) -> Array:
    """All products of rotations."""
    found = [np.eye(3)]
    # The list grows while it is gone through.
    for rotation in found:
        for product in rotation @ generators:
            if not _among(found, product):
                found.append(product)
        if len(found) > _MOST_ROTATIONS:
            raise ShapeError(
                f"symmetry: the rotations make a group of more than {_MOST_ROTATIONS}; for a body that looks the same "
                "after any turn about an axis give this axis, (3,)"
            )
    return np.array(found)


def _among(rotations: list[Array], rotation: Array) -> bool:
    return bool(rotations) and bool(np.any(np.abs(np.array(rotations) - rotation).max(axis=(1, 2)) < _SAME))
