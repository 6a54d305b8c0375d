"""The channels of a deformation, and what the tails of their spectra say of the error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import expm1, inf, isfinite, log
from operator import mul
from typing import Any, NamedTuple

import numpy as np

from ..arrays import Array, Mask
from ..errors import ShapeError
from ..inertia_tensor import inverse_inertia
from .casadi_calls import map_rows

Evaluate = Callable[[Array], tuple[Array, Array]]

EPS = float(np.finfo(float).eps)
_ROUNDING = 30.0 * EPS
_TINY = 1e-300
_VOIGT = np.array([0, 4, 8, 5, 2, 1])
# Off-diagonal channels stand for two entries of I^-1.
_SQUARES = np.array([[1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]]).T
_SQUARES_OF_PAIRS = np.repeat(_SQUARES, 2, axis=0)


class Channels:
    """The deformation as channels, with a count of how often it was asked."""

    def __init__(self, evaluate: Evaluate) -> None:
        self._evaluate = evaluate
        self.count = 0

    def __call__(self, times: Array) -> Array:
        """I^-1 (xx yy zz yz xz xy) and I^-1 L_o: (N,) -> (N, 9)."""
        inertia, momentum = self._evaluate(times)
        self.count += len(times)
        flat = np.empty((len(times), 12))
        flat[:, :9], flat[:, 9:] = inertia.reshape(-1, 9), momentum
        channels = map_rows(inverted, 12, flat)
        if not (channels[:, 9].min() > 0.0 and isfinite(channels.sum())):
            inverse = inverse_inertia(inertia, times)
            channels[:, :6] = inverse.reshape(-1, 9)[:, _VOIGT]
            channels[:, 6:9] = (inverse @ momentum[:, :, None])[:, :, 0]
        if not isfinite(channels[:, :9].sum()):
            row = int(np.argwhere(~np.isfinite(channels[:, :9]))[0, 0])
            raise ShapeError(f"the internal momentum at t = {times[row]:.9g} s is not finite")
        return channels[:, :9]


def inverted(entries: list[Any]) -> list[Any]:
    """I^-1, I^-1 L_o and a number above zero where the tensor is far from singular, from the nine of I and L_o.

    Far from singular: the condition number is at most some hundred, and so are the digits that the adjugate loses.
    """
    import casadi

    a, f, e, _, b, d, _, _, c, x, y, z = entries
    adjugate = [b * c - d * d, a * c - e * e, a * b - f * f, e * f - a * d, f * d - b * e, d * e - c * f]
    determinant = a * adjugate[0] + f * adjugate[5] + e * adjugate[4]
    trace = a + b + c
    safe = casadi.fmin(determinant - 1e-3 * trace * trace * trace, casadi.fmin(adjugate[2], a))
    xx, yy, zz, yz, xz, xy = inverse = [entry / determinant for entry in adjugate]
    return [*inverse, xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z, safe]


class Tail(NamedTuple):
    """What the tail of one spectrum says, in plain numbers: arrays of a few entries cost more than they hold."""

    error: float
    decay: float  # per degree
    converging: bool
    at_rounding: bool
    top: float

    @classmethod
    def of(cls, sizes: list[float], time_rounding: float) -> Tail:
        """As `estimate_spectrum`, of the sizes of one series at degrees 0, 1, 2 ..."""
        degree = len(sizes) - 1
        top = max(sizes)
        if degree == 0:
            return cls(0.0, inf, True, True, top)
        late, middle = max(sizes[-max(2, degree // 10) :]), max(sizes[degree // 2 - 1 : degree // 2 + 2])
        floor = _ROUNDING * top + 4.0 * time_rounding * sum(map(mul, sizes, range(degree + 1)))
        decay = log(middle / late) * 2.0 / degree if middle > late > 0.0 else 0.0
        left_over = 2.0 * late / expm1(decay) if decay > 0.0 else inf
        calm = late <= floor
        error = max(min(left_over, (2.0 if calm else degree) * late), 0.02 * floor)
        # More samples of a loop cost little, and show what is rounding indeed.
        return cls(error, inf if calm else decay, calm or late < 1e-2 * middle, late <= 0.05 * floor, top)


def averaged(converging: bool, phase: float, turn: float) -> float:
    """The share of an error of the interpolant that does not average out, of a series whose lacking terms run through
    `phase` or more [rad] while the body turns by `turn`: a quarter of what averages out is relied on. The error of a
    kink does not average out.
    """
    return min(1.0, 8.0 / max(phase - turn, 8.0)) if converging else 1.0


@dataclass(frozen=True, eq=False)
class SpectralEstimate:
    """What the spectra of some panels say: (G,) each."""

    inverse: Array  # error estimate of I^-1
    drift: Array  # error estimate of I^-1 L_o
    decay: Array  # of the spectrum, per degree; the slower one
    converging: Mask
    at_rounding: Mask
    inverse_size: Array
    drift_size: Array
    floor: Array  # (G, 2) what rounding alone leaves

    def error(self, momentum: float, width: Array, phase: float) -> Array:
        """Attitude error that the interpolation error feeds in: (G,) [rad]; averages as `averaged`."""
        rate = momentum * self.inverse + self.drift
        turn = width * (momentum * self.inverse_size + self.drift_size)
        left = np.where(self.converging, np.minimum(1.0, 8.0 / np.maximum(phase - turn, 8.0)), 1.0)
        return 0.5 * width * rate * left

    def raised(self, gaps: Array, seen: Mask) -> SpectralEstimate:
        """The same with errors at least as large as those seen (G, 2), which are not expected to average out."""
        return replace(
            self,
            inverse=np.maximum(self.inverse, gaps[:, 0]),
            drift=np.maximum(self.drift, gaps[:, 1]),
            converging=self.converging & ~seen,
            at_rounding=self.at_rounding & np.all(gaps <= 4.0 * self.floor, axis=1),
        )


def estimate_spectrum(size: Array, time_rounding: Array | float) -> SpectralEstimate:
    """Error estimates from the tails of spectra; size (G, degree + 1, 2) of I^-1 and of I^-1 L_o.

    `time_rounding` is the rounding of the sample times in units of half a panel (or of a radian): it limits what
    samples of a fast motion can tell.
    """
    degree = size.shape[1] - 1
    if degree == 0:
        zero = np.zeros(len(size))
        sure = zero == 0.0
        return SpectralEstimate(zero, zero, zero + np.inf, sure, sure, size[:, 0, 0], size[:, 0, 1], size[:, 0] * EPS)
    centre, tail = degree // 2, degree + 1 - max(2, degree // 10)
    parts = np.maximum.reduceat(size, (0, centre - 1, centre + 2, tail), axis=1)
    top, middle, late = parts.max(axis=1), parts[:, 1], parts[:, 3]
    floor = _ROUNDING * top + (4.0 * np.reshape(time_rounding, (-1, 1))) * (np.arange(degree + 1) @ size)
    decay = np.log(np.maximum(middle, _TINY) / np.maximum(late, _TINY)) * (2.0 / degree)
    # A geometric series with this decay leaves this much beyond its last term; twice, for aliasing.
    left_over = 2.0 * late / np.expm1(np.maximum(decay, _TINY))
    calm = late <= floor
    # A tail that has sunk into rounding says nothing of its decay any more; what lies beyond it is less than it.
    error = np.maximum(np.minimum(left_over, np.where(calm, 2.0, degree) * late), 0.02 * floor)
    return SpectralEstimate(
        error[:, 0],
        error[:, 1],
        np.where(calm, np.inf, np.maximum(decay, 0.0)).min(axis=1),
        (calm | (late < 1e-2 * middle)).all(axis=1),
        calm.all(axis=1),
        top[:, 0],
        top[:, 1],
        floor,
    )


def spectral_sizes(coefficients: Array) -> Array:
    """Frobenius norm of I^-1 and norm of I^-1 L_o in spectra: (..., 9) -> (..., 2)."""
    return np.sqrt((coefficients * coefficients) @ _SQUARES)


def fourier_sizes(values: Array) -> list[list[float]]:
    """The same of the Fourier series through even samples: (N, 9) -> two lists of N // 2 + 1."""
    pairs = np.fft.rfft(values, axis=0).view(np.float64)
    return (np.sqrt((pairs * pairs) @ _SQUARES_OF_PAIRS) * (2.0 / len(values))).T.tolist()
