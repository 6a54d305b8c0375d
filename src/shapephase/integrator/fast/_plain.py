"""Arrays as the kernels know them."""

from __future__ import annotations

import numpy as np

from ...arrays import Array


def plain(array: Array) -> Array:
    """The array, or a copy, so that it is double precision, in one piece and writable.

    Numba takes any other kind for another argument, and would compile the kernel once more for it.
    """
    flags = array.flags
    fits = flags.c_contiguous and flags.writeable and flags.aligned and array.dtype == np.float64
    return array if fits else np.array(array, dtype=np.float64, order="C")
