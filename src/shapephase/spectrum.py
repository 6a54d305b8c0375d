"""The channels of a deformation, and what the tails of their spectra say of the error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .arrays import Array, Mask
from .errors import ShapeError
from .inertia_tensor import inverse_inertia

Evaluate = Callable[[Array], tuple[Array, Array]]

EPS = float(np.finfo(float).eps)
_ROUNDING = 30.0 * EPS
_VOIGT = np.array([0, 4, 8, 5, 2, 1])
_TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # off-diagonal channels stand for two entries of I^-1


class Channels:
    """The deformation as channels, with a count of how often it was asked."""

    def __init__(self, evaluate: Evaluate) -> None:
        self._evaluate = evaluate
        self.count = 0

    def __call__(self, times: Array) -> Array:
        """I^-1 (xx yy zz yz xz xy) and I^-1 L_o: (N,) -> (N, 9)."""
        inertia, momentum = self._evaluate(times)
        self.count += len(times)
        inverse = inverse_inertia(inertia, times)
        channels = np.empty((len(times), 9))
        channels[:, :6] = inverse.reshape(-1, 9)[:, _VOIGT]
        channels[:, 6:] = (inverse @ momentum[:, :, None])[:, :, 0]
        if not np.isfinite(channels).all():
            row = int(np.argwhere(~np.isfinite(channels))[0, 0])
            raise ShapeError(f"the internal momentum at t = {times[row]:.9g} s is not finite")
        return channels


@dataclass(frozen=True, eq=False)
class Judgement:
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
        """Attitude error that the interpolation error feeds in: (G,) [rad].

        What a converging series lacks runs through `phase` or more in a panel [rad], so most of it averages out, as
        long as the body itself turns less; a third of that is relied on. The error of a kink does not average out.
        """
        rate = momentum * self.inverse + self.drift
        turn = width * (momentum * self.inverse_size + self.drift_size)
        left = np.where(self.converging, np.minimum(1.0, 6.0 / np.maximum(phase - turn, 6.0)), 1.0)
        return 0.5 * width * rate * left

    def raised(self, gaps: Array, seen: Mask) -> Judgement:
        """The same with errors at least as large as those seen (G, 2), which are not expected to average out."""
        return replace(
            self,
            inverse=np.maximum(self.inverse, gaps[:, 0]),
            drift=np.maximum(self.drift, gaps[:, 1]),
            converging=self.converging & ~seen,
            at_rounding=self.at_rounding & np.all(gaps <= 4.0 * self.floor, axis=1),
        )


def judged(size: Array, degree: int, time_rounding: Array | float) -> Judgement:
    """Error estimates from the tails of spectra; size (G, degree + 1, 2) of I^-1 and of I^-1 L_o.

    `time_rounding` is the rounding of the sample times in units of half a panel (or of a radian): it limits what
    samples of a fast motion can tell.
    """
    if degree == 0:
        zero = np.zeros(len(size))
        sure = zero == 0.0
        return Judgement(zero, zero, zero + np.inf, sure, sure, size[:, 0, 0], size[:, 0, 1], size[:, 0] * EPS)
    top = size.max(axis=1)
    late = size[:, -max(2, degree // 10) :].max(axis=1)
    centre = degree // 2
    middle = size[:, centre - 1 : centre + 2].max(axis=1)
    slope = np.arange(degree + 1) @ size
    floor = _ROUNDING * top + 4.0 * np.reshape(time_rounding, (-1, 1)) * slope
    with np.errstate(divide="ignore", invalid="ignore"):
        decay = np.where((late > 0.0) & (middle > late), np.log(middle / late) * (2.0 / degree), 0.0)
        # A geometric series with this decay leaves this much beyond its last term; twice, for aliasing.
        left_over = np.where(decay > 0.0, 2.0 * late / np.expm1(decay), np.inf)
    calm = late <= floor
    # A tail that has sunk into rounding says nothing of its decay any more; what lies beyond it is less than it.
    error = np.maximum(np.minimum(left_over, np.where(calm, 2.0, degree) * late), 0.02 * floor)
    return Judgement(
        error[:, 0],
        error[:, 1],
        np.where(calm, np.inf, decay).min(axis=1),
        (calm | (late < 1e-2 * middle)).all(axis=1),
        calm.all(axis=1),
        top[:, 0],
        top[:, 1],
        floor,
    )


def spectral_sizes(coefficients: Array | NDArray[np.complex128]) -> Array:
    """Frobenius norm of I^-1 and norm of I^-1 L_o in spectra: (..., 9) -> (..., 2)."""
    squares = coefficients.real**2 + coefficients.imag**2
    return np.sqrt(np.stack([squares[..., :6] @ _TWICE, squares[..., 6:].sum(axis=-1)], axis=-1))
