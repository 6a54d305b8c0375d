"""A deformation for the integrator: nine channels, I^-1 and I^-1 L_o, as functions of time."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np

from .. import run_progress
from ..arrays import Array
from ..errors import ShapeError
from ..inertia_tensor import SIX_OF_FULL, inverse_inertia

Evaluate = Callable[[Array], tuple[Array, Array]]  # times (N,) -> I (N, 3, 3), L_o (N, 3)
Directly = Callable[[Array], Array | None]  # times (N,) -> the channels (N, 9) in one call, or None
_AT_ONCE = 16_384  # times in one call of the body: some seconds, some hundred MB
_WEIGHTS = np.sqrt(np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]))  # off-diagonal channels stand for two entries of I^-1


class Channels:
    """The deformation as channels, with a count of its evaluations.

    Whole calls are kept, but for very large ones: a call with equal times returns the kept array.
    """

    def __init__(self, evaluate: Evaluate, directly: Directly | None = None) -> None:
        self._evaluate, self._directly = evaluate, directly
        self._known: dict[bytes, Array] = {}
        self.count = 0

    def __call__(self, times: Array) -> Array:
        """I^-1 (xx yy zz yz xz xy) and I^-1 L_o: (N,) -> (N, 9), not to be written to."""
        key = times.tobytes()
        channels = self._known.get(key)
        if channels is None:
            channels = self.fresh(times)
            if len(times) <= _AT_ONCE:
                self._known[key] = channels
        return channels

    def fresh(self, times: Array) -> Array:
        """Channels evaluated anew: (N,) -> (N, 9)."""
        self.count += len(times)
        run_progress.begin(run_progress.SAMPLING, len(times))
        channels = np.empty((len(times), 9))
        for first in range(0, len(times), _AT_ONCE):
            part = times[first : first + _AT_ONCE]
            direct = None if self._directly is None else self._directly(part)
            channels[first : first + _AT_ONCE] = inverted(*self._evaluate(part), part) if direct is None else direct
            run_progress.advance(len(part))
        return channels


def inverted(inertia: Array, momentum: Array, times: Array) -> Array:
    """The channels of I and L_o: (N, 3, 3), (N, 3) -> (N, 9); messages have the times (N,) [s].

    Raises SingularInertiaError if a tensor is singular, ShapeError if a momentum is not finite.
    """
    inverse = inverse_inertia(inertia, times)
    channels = np.empty((len(times), 9))
    channels[:, :6] = inverse.reshape(-1, 9)[:, SIX_OF_FULL]
    channels[:, 6:] = (inverse @ momentum[:, :, None])[:, :, 0]
    if not isfinite(channels[:, 6:].sum()):
        row = int(np.argwhere(~np.isfinite(channels[:, 6:]))[0, 0])
        raise ShapeError(f"the internal momentum at t = {times[row]:.9g} s is not finite")
    return channels


def rates_of(channels: Array, momentum: float) -> Array:
    """Largest rates of turning by channels, or by terms of their series: (..., 9) -> (...) [rad/s].

    `momentum` : its magnitude [kg m^2/s]
    """
    drift = np.sqrt((channels[..., 6:] ** 2).sum(axis=-1))
    if not momentum:
        return drift
    scaled = channels[..., :6] * _WEIGHTS
    return momentum * np.sqrt((scaled * scaled).sum(axis=-1)) + drift
