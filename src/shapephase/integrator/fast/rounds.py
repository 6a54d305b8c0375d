"""Rounds of steps for one momentum in one call of machine code."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from math import inf
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ..interpolant import Interpolant
from ..steps.quadrature_defects import Defects, defect_table, signed_defects
from ..steps.step_record import CHECKPOINTS, StepRecord
from ._plain import plain
from .marches import segments_of

STEPS_OF_FINER = 8
"""Refinements of the steps in each factor of two, that they are rounded up to, so that many momenta share them."""
STEPS_OF_OTHERS = 2
"""The same of what samples must reach, and of what errors grow by."""
_NO_SERIES = np.empty((0, 1))


@dataclass(eq=False)
class Round:
    """Steps that were taken, and what tells how far they are off."""

    steps: Integers  # (P,)
    record: StepRecord
    distances: Array  # (B,) of the steps from those beside them [rad]
    amplification: Array  # (B,) the largest growth of an error from one time to a later one
    sampling: Array  # (B,) errors of the samples, of the steps, and by rounding [rad]
    stepping: Array
    rounding: Array
    defects: Defects
    rounded_up: float  # how many more steps were taken than planned


def rounds_of_one(
    interpolant: Interpolant,
    perturbed: Array | None,
    directions: Array | None,
    magnitudes: Array,
    *,
    ceiling: float,
    tolerance: float,
    expected: float,
    hidden: float | None,
    refinement: Array,
) -> Round | None:
    """Plan the steps for one momentum and take them, finer ones where those do not do; None where it turns too far.

    Parameters
    ----------
    perturbed : (P, n, 9) the interpolant's series with some terms changed; None: not marched on
    directions, magnitudes : (1, 3), (1,) of the momentum at the start [kg m^2/s]; directions None: at rest, one loop
    ceiling : of the magnitude, which the steps are planned for
    expected, hidden : what the samples are off by, and its part that perturbed series do not show, None: not looked at
        [rad]
    refinement : (2,) how much finer the steps are than planned at first, and what errors grow by, infinite where that
        is not known; then those of the last round
    """
    series, loops = interpolant.coefficients, interpolant.loops
    found = _kernel().take_rounds(
        plain(interpolant.widths), plain(series).reshape(len(series), -1),
        _NO_SERIES if perturbed is None else plain(perturbed).reshape(len(series), -1), loops,
        _NO_SERIES if directions is None else directions, magnitudes, ceiling, tolerance,
        refinement, expected, inf if hidden is None else hidden, segments_of(1, loops), CHECKPOINTS,
        *_tables(),
    )  # fmt: skip
    done, steps, quaternions, ends, turns, dynamics, propagators, numbers = found
    if not done:
        return None
    _, distance, truncation, growth, rounding, *_, stepping, sampling = numbers.reshape(13, 1)
    *of_defects, rounded_up = numbers[5:11].tolist()
    errors = propagators.reshape(1, -1, 3, 3), distance, truncation
    record = StepRecord(quaternions, ends, turns, dynamics, *errors)
    return Round(steps, record, distance, growth, sampling, stepping, rounding, Defects(*of_defects), rounded_up)


def warm() -> None:
    """Call the kernel with the least that it takes."""
    still = Interpolant(np.array([0.0, 1.0]), np.zeros((1, 1, 9)), 1, 0)
    options: dict[str, Any] = {"tolerance": 1.0, "expected": 0.0, "hidden": 0.0}
    for directions, ceiling in ((None, 0.0), (np.array([[0.0, 0.0, 1.0]]), 1.0)):
        refinement = np.array([1.0, np.inf])
        rounds_of_one(still, None, directions, np.array([ceiling]), ceiling=ceiling, refinement=refinement, **options)


@lru_cache(maxsize=4)
def marks_between(steps: int) -> Array:
    """The geometric steps from a half to one, both included: (steps + 1,)."""
    return 0.5 * 2.0 ** (np.arange(steps + 1) / steps)


@lru_cache(maxsize=1)
def _tables() -> tuple[Array, Array, Array, Array]:
    """Of defects, and what refinements are rounded up to."""
    defects = plain(defect_table()), plain(signed_defects())
    return *defects, marks_between(STEPS_OF_FINER), marks_between(STEPS_OF_OTHERS)


@lru_cache(maxsize=1)
def _kernel() -> Any:
    return import_module(".kernels.round_kernel", __package__)
