"""Series with their last terms changed: what that does to an attitude tells what the terms beyond them would do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..arrays import Array, Integers, read_only
from ..display import short_repr
from ._spectral_error import spectral_norms
from .fast import engine
from .fast.estimate_constants import (
    FEW_TERMS,
    LAST_TERMS,
    LEAST_DEGREE,
    MISSING_FACTOR,
    ROUNDED_TERM,
    SLOWEST_DECAY,
    TINY,
)
from .fast.panels import series_with_changed_ends


@dataclass(eq=False)
class Perturbed:
    """An interpolant's series with errors like those that they probably have.

    Attributes
    ----------
    make : the coefficients, when they are needed
    hidden : attitude error of what they do not show, without amplification [rad]
    differ : whether they are not the interpolant's own; else steps on them would show nothing
    """

    make: Callable[[], Array]
    hidden: float
    differ: bool = True

    __repr__ = short_repr

    @cached_property
    def coefficients(self) -> Array:
        """(P, n, 9), the last terms of each series changed by as much as is missing beyond them."""
        return read_only(self.make())

    @classmethod
    def known(cls, coefficients: Array, hidden: float) -> Perturbed:
        """With coefficients that are made already."""
        return cls(partial(np.asarray, coefficients), hidden)

    @classmethod
    def same(cls, coefficients: Array, hidden: float) -> Perturbed:
        """With the interpolant's own coefficients: all that is missing is hidden."""
        return cls(partial(np.asarray, coefficients), hidden, differ=False)


def perturbed_series(coefficients: Array, degrees: Integers, widths: Array, momentum: float) -> Array:
    """Chebyshev series (P, n, 9) of degrees (P,) on panels of widths (P,) [s], for momenta of this magnitude."""
    if engine.is_ready():
        return series_with_changed_ends(coefficients, degrees, widths, momentum)
    x = (spectral_norms(coefficients) @ np.array([momentum, 1.0])) * widths[:, None]
    terms, degree = np.arange(x.shape[1]), degrees[:, None]
    start = np.maximum(1, np.minimum(3 * degrees // 5, degrees - LEAST_DEGREE))
    is_last = (terms > degree - LAST_TERMS) & (terms <= degree)
    is_middle = (terms >= start[:, None]) & (terms < degree - 1)
    late, middle = (x * is_last).max(axis=1), (x * is_middle).max(axis=1)
    middle = np.maximum(middle, late)
    power = 1.0 / np.maximum(degrees - 1 - start, 1)
    decay = np.minimum((np.maximum(late, TINY) / np.maximum(middle, TINY)) ** power, SLOWEST_DECAY)
    # Where the body turns as fast as the series swings, what aliases to lower degrees weighs more.
    count = np.maximum(degrees, 1)
    fast = 2.0 * x.sum(axis=1) / count
    missing = MISSING_FACTOR * (1.0 + FEW_TERMS / count) * decay / (1.0 - decay) * (1.0 + fast * fast)
    # Rounding is as large in the terms that are missing as in the last ones, and no larger.
    missing = np.where(late <= ROUNDED_TERM * x.max(axis=1), 1.0, np.minimum(missing, MISSING_FACTOR * degrees))
    changes = is_last & (degree >= LEAST_DEGREE)
    return coefficients * np.where(changes, 1.0 - missing[:, None], 1.0)[:, :, None]
