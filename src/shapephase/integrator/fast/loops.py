"""Loops at even times in machine code."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import Array
from ..even.fourier import fourier_parts
from ._plain import plain


def errors_of_loop(values: Array, tests: Array, shares: Array, time_rounding: float) -> list[list[float]]:
    """The fields of `TailEstimate` and the largest gap at a test, of I^-1 and of I^-1 L_o.

    Parameters
    ----------
    values : (N, 9) at even times
    tests : (T, 9) at others
    shares : (T, N) from the former to the latter
    time_rounding : as of `estimate_tail`
    """
    found = np.empty((2, 8))
    _kernel().errors_of_loop(fourier_parts(values), plain(values), plain(tests), plain(shares), time_rounding, found)
    return found.tolist()


def warm() -> None:
    """Call the kernel with the least that it takes."""
    errors_of_loop(np.ones((2, 9)), np.ones((1, 9)), np.ones((1, 2)), 0.0)


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.loop_kernel", __package__)
