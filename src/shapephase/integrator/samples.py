"""Samples of a deformation, and the probable errors of their series."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ..arrays import Array, Integers, read_only
from ..display import frozen
from ..errors import AccuracyNotReached
from ..inertia_tensor import FULL_FROM_SIX, SIX_OF_FULL
from .constants import EPS
from .interpolant import Interpolant
from .kernels import spectra_kernel as spectra
from .machine_code import plain

_AT_ONCE = 2048  # panels: some megabytes


@frozen
class Perturbed:
    """The interpolant with its last coefficients perturbed by the estimated truncation error.

    coefficients : (P, n, 9)
    hidden : attitude error that the coefficients do not show, without amplification [rad]
    """

    coefficients: Array
    hidden: float


@dataclass(frozen=True, eq=False)
class Panels:
    """Panels of one loop, which are sampled at Chebyshev points.

    edges : (P + 1,) [s]
    degrees : (P,)
    """

    edges: Array
    degrees: Integers


@frozen
class Samples:
    """Samples of a deformation for momenta up to a magnitude.

    interpolant : the series through the samples
    panels : those of the series
    change : (P,) relative errors of the last two terms of each series
    noisy : (P,) one where these terms are noise, which all others have as well, else zero
    between : attitude error within a panel that its ends do not show [rad]
    hidden : attitude error that no series shows, without amplification [rad]
    level : tolerance below which there would be more samples [rad]; 0: only noise is missing
    condition : a bound of the inertia's condition number
    rates : the largest of I^-1 [1/(kg m^2)] and of I^-1 L_o [rad/s], as sums over the terms of a panel
    too_rough : why the samples are less dense than requested; None: they are not
    """

    interpolant: Interpolant
    panels: Panels
    change: Array
    noisy: Array
    between: float
    hidden: float
    level: float
    condition: float
    rates: tuple[float, float]
    too_rough: AccuracyNotReached | None = None

    @cached_property
    def perturbed(self) -> Perturbed:
        """The series with their probable errors."""
        series = self.interpolant.coefficients
        changed = np.empty_like(series)
        degrees, signs = self.panels.degrees, _signs(len(series))
        spectra.change(plain(series), degrees, plain(self.change), plain(self.noisy), signs, changed)
        return Perturbed(read_only(changed), self.hidden)


def rounded_series(samples: Samples, units: float) -> Array:
    """Series (P, n, 9) of inertias and momenta with random roundings of so many units of their largest entries.

    With L the largest moment, a rounding eps L E of the inertia, E of size one in any direction, changes I^-1 by
    -I^-1 eps L E I^-1: of a body that hardly resists turning about one axis, by more than units of its own.
    """
    series, degrees, rng = samples.interpolant.coefficients, samples.panels.degrees, np.random.default_rng(0)
    rounded, terms = series.copy(), series.shape[1]
    for first in range(0, len(series), _AT_ONCE):
        part = slice(first, first + _AT_ONCE)
        inverse, drift = series[part, 0][:, None, FULL_FROM_SIX], series[part, :, 6:]
        count, least = len(inverse), np.linalg.eigvalsh(inverse[:, 0])[:, 0]
        unit = (units * EPS / np.where(least > 0.0, least, np.inf))[:, None, None]
        unit = unit * (np.arange(terms) <= degrees[part, None])[:, :, None]
        tensors, vectors = rng.standard_normal((count, terms, 3, 3)), rng.standard_normal((count, terms, 3))
        turned = inverse @ (tensors + np.swapaxes(tensors, -1, -2))
        vectors *= np.abs(drift).max(axis=(1, 2))[:, None, None]
        rounded[part, :, :6] += unit * (turned @ inverse).reshape(count, terms, 9)[:, :, SIX_OF_FULL]
        of_drift = (turned @ drift[:, None, 0, :, None])[..., 0] + (inverse @ vectors[..., None])[..., 0]
        rounded[part, :, 6:] += unit * of_drift
    return rounded


@lru_cache(maxsize=64)
def _signs(count: int) -> Array:
    """Random signs: (count,)."""
    return np.where(np.random.default_rng(0).random(count) < 0.5, -1.0, 1.0)
