"""Attitudes at times between the ends of steps, in machine code."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ._plain import plain


def rotations_within_steps(
    widths: Array,
    series: Array,
    steps: Integers,
    index: Integers,
    fractions: Array,
    quaternions: Array,
    directions: Array,
    magnitude: float,
) -> Array:
    """Quaternions xyzw after parts of steps: (N, 4).

    Parameters
    ----------
    widths, series, steps : (P,), (P, n, 9), (P,) of one loop
    index, fractions : (N,) which step of all loops, and which part of it; ascending
    quaternions, directions : (K + 1, 4), (K + 1, 3) at the ends of all steps; (0, 3): without momentum
    """
    inner = index % int(steps.sum())
    starts = np.cumsum(steps) - steps
    panels = np.searchsorted(starts, inner, side="right") - 1
    found = np.empty((len(index), 4))
    _kernel().rotations_within_steps(
        plain(widths), plain(series).reshape(len(widths), -1), np.array(steps, dtype=np.int64), panels,
        inner - starts[panels], plain(fractions), quaternions[index],
        directions[index] if len(directions) else np.empty((0, 3)), float(magnitude), found,
    )  # fmt: skip
    return found


def warm() -> None:
    """Call the kernel with the least that it takes."""
    ends = np.array([[0.0, 0.0, 0.0, 1.0]] * 2)
    none = np.zeros(1, dtype=np.int64)
    rotations_within_steps(np.ones(1), np.zeros((1, 1, 9)), none + 1, none, np.ones(1), ends, ends[:, 1:], 1.0)


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.node_kernel", __package__)
