"""Many deformations in machine code: each stepped on series of its own."""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ..steps.step_record import StepRecord
from ._plain import plain
from .marches import segments_of


def march_variants(
    widths: Array,
    coefficients: Array,
    perturbed: Array,
    steps: Integers,
    loops: int,
    directions: Array,
    magnitudes: Array,
    *,
    marks: Integers,
) -> StepRecord:
    """As `marches.march_in_threads`, each momentum on series of its own (V, P, n, 9), in this thread."""
    batch, count = len(magnitudes), loops * int(steps.sum())
    whole = StepRecord.empty(batch, count, len(marks))
    _kernel().march_variants(
        plain(widths), plain(coefficients).reshape(batch, len(widths), -1),
        plain(perturbed).reshape(batch, len(widths), -1), np.array(steps, dtype=np.int64), loops, plain(directions),
        plain(magnitudes), np.array(marks, dtype=np.int64), 1, segments_of(1, loops), whole.quaternions,
        whole.directions, whole.turns, whole.dynamics, whole.propagators.reshape(batch, len(marks), 9),
        whole.stepping, whole.truncation,
    )  # fmt: skip
    return whole


def warm() -> None:
    """Call the kernel with the least that it takes."""
    width, series, steps = np.ones(1), np.zeros((1, 1, 1, 9)), np.array([2])
    direction, none = np.array([[0.0, 0.0, 1.0]]), np.zeros(0, dtype=np.int64)
    march_variants(width, series, series, steps, 1, direction, np.ones(1), marks=none)


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.variant_kernel", __package__)
