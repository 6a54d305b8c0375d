"""The momentum's curve in machine code."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import Array
from ._plain import plain


def curve_terms(
    channels: Array, directions: Array, corners: Array, magnitudes: Array, rules: Array, *, lifted: bool
) -> tuple[Array, Array]:
    """Integrals over each step by three rules, and the gauge's rates at both ends: (3, 2, B, M), (3, B, 2, M).

    Parameters
    ----------
    channels : (9, TERMS, 2, M) Taylor terms of the steps
    directions, corners : (3, B, 2, M) of the momentum at both ends, and of the first one as it is seen from both ends
    magnitudes : (B,) of the momenta [kg m^2/s]
    rules : (3, 2 TERMS) from the terms at both ends to integrals
    lifted : whether the gauge is the horizontal one, else the base
    """
    integrals, rates = np.empty((3, 2, *directions.shape[1::2])), np.empty(directions.shape)
    arrays = (plain(array) for array in (channels, directions, corners, magnitudes))
    _kernel().curve_terms(*arrays, lifted, plain(rules), integrals, rates)
    return integrals, rates


def warm() -> None:
    """Call the kernel with the least that it takes."""
    ends = np.ones((3, 1, 2, 1))
    curve_terms(np.ones((9, 6, 2, 1)), ends, ends, np.ones(1), np.ones((3, 12)), lifted=False)


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.curve_kernel", __package__)
