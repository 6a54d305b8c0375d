"""Series with their last terms changed: what that does to an attitude tells what the terms beyond them would do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..arrays import Array, Integers, read_only
from ._spectral_error import spectral_norms

# Terms of a panel's series that are changed: two, since one may be small by chance, or by the symmetry of a motion.
_LAST = 2
# Degree below which a series has too few terms to show how they fall.
_LEAST_DEGREE = 4
# The slowest decay from one degree to the next that is believed.
_SLOWEST = 0.99
# Of the largest term of a series: what is smaller may be rounding, which does not fall any more.
_ROUNDING = 3e-14
# Of what is missing by the decay of the terms: they may fall more slowly beyond, and what aliases adds to it.
_SAFETY_FACTOR = 3.0
# Of few terms the decay is less sure: the factor is twice as large at this degree.
_FEW_TERMS = 10.0
# Keeps quotients of coefficients defined where these are zero.
_TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Perturbed:
    """An interpolant's series with errors like those that they probably have.

    Attributes
    ----------
    make : the coefficients, when they are needed
    hidden : attitude error of what they do not show, without amplification [rad]
    """

    make: Callable[[], Array]
    hidden: float

    @cached_property
    def coefficients(self) -> Array:
        """(P, n, 9), the last terms of each series changed by as much as is missing beyond them."""
        return read_only(self.make())

    @classmethod
    def known(cls, coefficients: Array, hidden: float) -> Perturbed:
        """With coefficients that are made already."""
        return cls(partial(np.asarray, coefficients), hidden)

    def changes(self, coefficients: Array) -> bool:
        """Whether any series is not what it was."""
        return not np.array_equal(self.coefficients, coefficients)


def perturbed_series(coefficients: Array, degrees: Integers, widths: Array, momentum: float) -> Array:
    """Chebyshev series (P, n, 9) of degrees (P,) on panels of widths (P,) [s], for momenta of this magnitude."""
    sizes = (spectral_norms(coefficients) @ np.array([momentum, 1.0])) * widths[:, None]
    changed = coefficients.copy()
    for degree in np.unique(degrees):
        if degree < _LEAST_DEGREE:
            continue
        rows = np.flatnonzero(degrees == degree)
        x = sizes[rows, : degree + 1]
        late, start = x[:, degree - 1 :].max(axis=1), max(1, min(3 * int(degree) // 5, int(degree) - _LEAST_DEGREE))
        middle = np.maximum(x[:, start : degree - 1].max(axis=1), late)
        decay = (np.maximum(late, _TINY) / np.maximum(middle, _TINY)) ** (1.0 / (degree - 1 - start))
        decay = np.minimum(decay, _SLOWEST)
        # Where the body turns as fast as the series swings, what aliases to lower degrees weighs more.
        fast = 2.0 * x.sum(axis=1) / degree
        missing = _SAFETY_FACTOR * (1.0 + _FEW_TERMS / degree) * decay / (1.0 - decay) * (1.0 + fast * fast)
        # Rounding is as large in the terms that are missing as in the last ones, and no larger.
        missing = np.where(late <= _ROUNDING * x.max(axis=1), 1.0, np.minimum(missing, _SAFETY_FACTOR * degree))
        changed[rows, degree + 1 - _LAST : degree + 1] *= (1.0 - missing)[:, None, None]
    return changed
