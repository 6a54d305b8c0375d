"""Arrays as the kernels know them."""

from __future__ import annotations

import numpy as np

from ...arrays import Array


def plain(array: Array) -> Array:
    """The array, or a copy, so that it is double precision, in one piece and writable.

    Numba takes any other kind for another argument, and would compile the kernel once more for it.
    """
    return np.require(array, np.float64, ("C", "W"))
