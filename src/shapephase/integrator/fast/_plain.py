"""Arrays as the kernels know them."""

from __future__ import annotations

import numpy as np

from ...arrays import Array


def plain(array: Array) -> Array:
    """The array, or a copy, so that it is double precision, in one piece and writable.

    Numba takes any other kind for another argument, and would compile the kernel once more for it. Kernels do not write
    to what they are given to read, so that what is shown as read-only need not be copied where it is not.
    """
    flags = array.flags
    if not (flags.c_contiguous and flags.aligned and array.dtype == np.float64):
        return np.array(array, dtype=np.float64, order="C")
    if flags.writeable:
        return array
    view = array.view()
    try:
        view.flags.writeable = True
    except ValueError:
        return array.copy()
    return view
