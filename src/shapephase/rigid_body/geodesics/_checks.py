"""The check that the arguments of geodesics share: the first entry that breaks a condition is named."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Mask
from ...errors import ShapeError


def check_entries(bad: Mask, values: Array, name: str, requirement: str) -> None:
    """Raise `ShapeError` with the first of the values (...) marked in `bad` (...), and what is required of it."""
    if np.any(bad):
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ShapeError(f"{name}: entry {list(where)} is {values[where]:.17g}; {requirement}")
