"""The channels of a deformation, and error estimates from the tails of their spectra."""

from __future__ import annotations

from collections.abc import Callable
from math import expm1, inf, isfinite, log
from operator import mul
from typing import Any, NamedTuple, Protocol

import numpy as np

from .. import run_progress
from ..arrays import Array, Integers, Mask
from ..errors import ShapeError
from ..inertia_tensor import inverse_inertia
from .casadi_calls import map_rows
from .even.fourier import fourier_parts
from .fast.estimate_constants import (
    AT_ROUNDING,
    CONVERGED_TAIL,
    CONVERGING,
    DECAY,
    DRIFT_NORM,
    EPS,
    FLOOR,
    INVERSE,
    INVERSE_NORM,
    LEAST_OF_FLOOR,
    ROUNDING,
    TINY,
    UNAVERAGED_PHASE,
)

Evaluate = Callable[[Array], tuple[Array, Array]]
# The channels in one call, or None where that cannot be done: (N,) -> (N, 9).
Directly = Callable[[Array], Array | None]

# Times in one call of the body: some seconds of work at most, and its arrays stay within some hundred MB.
_AT_ONCE = 16_384
# Numbers in spectra whose norms are computed together: their squares take ten megabytes.
_NUMBERS_AT_ONCE = 1_000_000
# [rad/s] of the body by its joints; what is faster, or no number, is looked at closely.
_LARGEST_RATE = 1e150
_VOIGT = np.array([0, 4, 8, 5, 2, 1])
# Off-diagonal channels stand for two entries of I^-1.
_SQUARES = np.array([[1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0]]).T
_SQUARES_OF_PARTS = np.concatenate([_SQUARES, _SQUARES])


class SampledChannels(Protocol):
    """A deformation as channels, wherever they come from.

    Attributes
    ----------
    count : of the times that were asked for
    """

    count: int

    def __call__(self, times: Array, /) -> Array:
        """I^-1 (xx yy zz yz xz xy) and I^-1 L_o: (N,) -> (N, 9)."""
        ...


class Channels:
    """The deformation as channels, with a count of its evaluations."""

    def __init__(self, evaluate: Evaluate, directly: Directly | None = None) -> None:
        self._evaluate, self._directly = evaluate, directly
        self.count = 0

    def __call__(self, times: Array) -> Array:
        """I^-1 (xx yy zz yz xz xy) and I^-1 L_o: (N,) -> (N, 9)."""
        self.count += len(times)
        run_progress.begin(run_progress.SAMPLING, len(times))
        if len(times) <= _AT_ONCE:
            channels = self._at(times)
            run_progress.advance(len(times))
            return channels
        channels = np.empty((len(times), 9))
        for first in range(0, len(times), _AT_ONCE):
            part = times[first : first + _AT_ONCE]
            channels[first : first + _AT_ONCE] = self._at(part)
            run_progress.advance(len(part))
        return channels

    def _at(self, times: Array) -> Array:
        channels = None if self._directly is None else self._directly(times)
        return self._inverted(times) if channels is None else channels

    def _inverted(self, times: Array) -> Array:
        return inverted(*self._evaluate(times), times)


class RememberedChannels:
    """Other channels, whose whole calls are kept in `known`; a count of what was asked for, kept or not."""

    def __init__(self, channels: SampledChannels, known: dict[bytes, Array]) -> None:
        self._channels, self._known = channels, known
        self.count = 0

    def __call__(self, times: Array) -> Array:
        """As of `Channels`; not to be written to."""
        self.count += len(times)
        key = times.tobytes()
        found = self._known.get(key)
        if found is None:
            # A copy: what is computed in work arrays is overwritten by the next call.
            found = self._known[key] = self._channels(times).copy()
        return found


def inverted(inertia: Array, momentum: Array, times: Array) -> Array:
    """The channels of I and L_o: (N, 3, 3), (N, 3) -> (N, 9); messages have the times (N,) [s].

    Raises
    ------
    SingularInertiaError, ShapeError
        If a tensor is singular, or a momentum not finite.
    """
    flat = np.empty((len(times), 12))
    flat[:, :9], flat[:, 9:] = inertia.reshape(-1, 9), momentum
    channels = map_rows(inverse_channels, 12, flat)
    if not channels[:, 9].min() > 0.0:
        inverse = inverse_inertia(inertia, times)
        channels[:, :6] = inverse.reshape(-1, 9)[:, _VOIGT]
        channels[:, 6:9] = (inverse @ momentum[:, :, None])[:, :, 0]
        if not isfinite(channels[:, :9].sum()):
            row = int(np.argwhere(~np.isfinite(channels[:, :9]))[0, 0])
            raise ShapeError(f"the internal momentum at t = {times[row]:.9g} s is not finite")
    return channels[:, :9]


def inverse_channels(entries: list[Any]) -> list[Any]:
    """I^-1, I^-1 L_o and a number above zero where the tensor is far from singular and all is finite, from I and L_o.

    Far from singular: the condition number is at most some hundred, and so are the digits that the adjugate loses.
    """
    import casadi

    a, f, e, _, b, d, _, _, c, x, y, z = entries
    adjugate = [b * c - d * d, a * c - e * e, a * b - f * f, e * f - a * d, f * d - b * e, d * e - c * f]
    determinant = a * adjugate[0] + f * adjugate[5] + e * adjugate[4]
    trace = a + b + c
    safe = casadi.fmin(determinant - 1e-3 * trace * trace * trace, casadi.fmin(adjugate[2], a))
    xx, yy, zz, yz, xz, xy = inverse = [entry / determinant for entry in adjugate]
    drift = [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
    # No comparison holds for what is not a number.
    return [*inverse, *drift, safe * (casadi.fabs(sum(drift)) < _LARGEST_RATE)]


class TailEstimate(NamedTuple):
    """Error estimate from one spectrum, in plain numbers: for a few entries they are faster than arrays."""

    error: float
    decay: float  # per degree
    converging: bool
    at_rounding: bool
    largest: float
    floor: float  # what rounding alone leaves
    tail: float  # the largest of the last coefficients


def tail_length(degree: int) -> int:
    """How many of the last coefficients are looked at: single ones are small by chance, or by a motion's symmetry."""
    return max(2, degree // 10)


def estimate_tail(norms: list[float], time_rounding: float) -> TailEstimate:
    """As `estimate_spectra`, for one series with the norms of its coefficients at degrees 0, 1, 2 ..."""
    degree = len(norms) - 1
    largest = max(norms)
    if degree == 0:
        return TailEstimate(
            error=0.0, decay=inf, converging=True, at_rounding=True, largest=largest, floor=EPS * largest, tail=0.0
        )
    tail, middle = max(norms[-tail_length(degree) :]), max(norms[degree // 2 - 1 : degree // 2 + 2])
    floor = ROUNDING * largest + 4.0 * time_rounding * sum(map(mul, norms, range(degree + 1)))
    decay = log(middle / tail) * 2.0 / degree if middle > tail > 0.0 else 0.0
    beyond_tail = 2.0 * tail / expm1(decay) if decay > 0.0 else inf
    at_noise_floor = tail <= floor
    return TailEstimate(
        error=max(min(beyond_tail, (2.0 if at_noise_floor else degree) * tail), LEAST_OF_FLOOR * floor),
        decay=inf if at_noise_floor else decay,
        converging=at_noise_floor or tail < CONVERGED_TAIL * middle,
        # More samples of a loop cost little, and only they show what is truly rounding.
        at_rounding=tail <= 0.05 * floor,
        largest=largest,
        floor=floor,
        tail=tail,
    )


def unaveraged_share(converging: bool, phase: float, turn: float) -> float:
    """The share of an interpolation error that does not average out.

    The missing terms of the series run through `phase` or more [rad] while the body turns by `turn`. Only a quarter of
    the averaging is relied on; the error of a kink does not average out at all.
    """
    return min(1.0, UNAVERAGED_PHASE / max(phase - turn, UNAVERAGED_PHASE)) if converging else 1.0


def averaged_share(phase: Array, turn: Array) -> Array:
    """The same for many panels that converge: (G,) -> (G,)."""
    return np.minimum(1.0, UNAVERAGED_PHASE / np.maximum(phase - turn, UNAVERAGED_PHASE))


class SpectralEstimate(NamedTuple):
    """Error estimates from the spectra of some panels: (G, 9), a row for each."""

    table: Array

    @property
    def decay(self) -> Array:
        """Of the spectrum, per degree; the slower one: (G,)."""
        return self.table[:, DECAY]

    @property
    def at_rounding(self) -> Mask:
        """(G,)."""
        return self.table[:, AT_ROUNDING] > 0.0

    @property
    def inverse_norm(self) -> Array:
        """The largest term of I^-1: (G,)."""
        return self.table[:, INVERSE_NORM]

    @property
    def drift_norm(self) -> Array:
        """The largest term of I^-1 L_o: (G,)."""
        return self.table[:, DRIFT_NORM]

    def error(self, momentum: float, width: Array, phase: Array) -> Array:
        """Attitude error caused by the interpolation error: (G,) [rad]; it averages out as in `unaveraged_share`."""
        rate = momentum * self.table[:, INVERSE] + self.table[:, INVERSE + 1]
        turn = width * (momentum * self.inverse_norm + self.drift_norm)
        converging = self.table[:, CONVERGING] > 0.0
        return 0.5 * width * rate * np.where(converging, averaged_share(phase, turn), 1.0)

    def some(self, rows: Mask) -> SpectralEstimate:
        """Of some panels."""
        return SpectralEstimate(self.table[rows])

    def raised_to(self, gaps: Array, rows: Integers) -> SpectralEstimate:
        """With errors of some panels (R,) at least as large as gaps that were seen (R, 2), which do not average out."""
        table = self.table.copy()
        table[rows, :DECAY] = np.maximum(table[rows, :DECAY], gaps)
        table[rows, CONVERGING] = 0.0
        table[rows, AT_ROUNDING] *= np.all(gaps <= 4.0 * table[rows, FLOOR:], axis=1)
        return SpectralEstimate(table)


def estimate_spectra(norms: Array, degree: Integers, time_rounding: Array) -> SpectralEstimate:
    """Error estimates from the tails of spectra; norms (G, n, 2) of I^-1 and of I^-1 L_o, zero above the degree (G,).

    `time_rounding` (G,) is the rounding of the sample times in units of half a panel: it limits the
    accuracy of samples of a fast motion.
    """
    terms, most = np.arange(float(norms.shape[1])), np.maximum(degree, 1)[:, None]
    largest, degrees = norms.max(axis=1), set(degree.tolist())
    if len(degrees) == 1:
        tail, middle = _tail_and_middle(norms, *degrees)
    else:
        tail, middle = np.empty((2, len(norms), 2))
        for one in degrees:
            rows = degree == one
            tail[rows], middle[rows] = _tail_and_middle(norms[rows], one)
    floor = ROUNDING * largest + (4.0 * time_rounding)[:, None] * (terms @ norms)
    decay = np.log(np.maximum(middle, TINY) / np.maximum(tail, TINY)) * (2.0 / most)
    # The rest of a geometric series with this decay beyond its last term; twice, for aliasing.
    beyond_tail = 2.0 * tail / np.expm1(np.maximum(decay, TINY))
    at_noise_floor = tail <= floor
    # A tail at the noise floor shows no decay any more; the terms beyond it are smaller than it.
    error = np.maximum(np.minimum(beyond_tail, np.where(at_noise_floor, 2.0, most) * tail), LEAST_OF_FLOOR * floor)
    table = np.empty((len(norms), 9))
    table[:, :DECAY] = error
    table[:, DECAY] = np.where(at_noise_floor, np.inf, np.maximum(decay, 0.0)).min(axis=1)
    table[:, CONVERGING] = (at_noise_floor | (tail < CONVERGED_TAIL * middle)).all(axis=1)
    table[:, AT_ROUNDING] = at_noise_floor.all(axis=1)
    table[:, INVERSE_NORM:FLOOR] = largest
    table[:, FLOOR:] = floor
    if 0 in degrees:
        constant = degree == 0
        table[constant, :DECAY] = 0.0
        table[constant, DECAY] = np.inf
        table[constant, CONVERGING : AT_ROUNDING + 1] = 1.0
        table[constant, FLOOR:] = EPS * largest[constant]
    return SpectralEstimate(table)


def _tail_and_middle(norms: Array, degree: int) -> tuple[Array, Array]:
    """The largest of the last norms and of those half-way, of spectra of one degree: (G, n, 2) -> (G, 2) each."""
    tail = norms[:, max(degree + 1 - tail_length(degree), 0) :].max(axis=1)
    return tail, norms[:, max(degree // 2 - 1, 0) : degree // 2 + 2].max(axis=1)


def spectral_norms(coefficients: Array) -> Array:
    """Frobenius norm of I^-1 and norm of I^-1 L_o in spectra: (..., 9) -> (..., 2)."""
    if coefficients.size <= _NUMBERS_AT_ONCE:
        return np.sqrt((coefficients * coefficients) @ _SQUARES)
    norms = np.empty((*coefficients.shape[:-1], 2))
    at_once = max(1, _NUMBERS_AT_ONCE * len(coefficients) // coefficients.size)
    for first in range(0, len(coefficients), at_once):
        part = slice(first, first + at_once)
        norms[part] = spectral_norms(coefficients[part])
    return norms


def fourier_norms(values: Array) -> list[list[float]]:
    """The same of the Fourier series through even samples: (N, 9) -> two lists of N // 2 + 1."""
    parts = fourier_parts(values)
    parts *= parts
    return (np.sqrt(parts @ _SQUARES_OF_PARTS) * (2.0 / len(values))).T.tolist()
