"""A deformation as the integrator sees it: nine channels, I^-1 and I^-1 L_o, as functions of time."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np

from .. import run_progress
from ..arrays import Array
from ..errors import ShapeError
from ..inertia_tensor import inverse_inertia

Evaluate = Callable[[Array], tuple[Array, Array]]
"""Times (N,) -> I (N, 3, 3), L_o (N, 3)."""
Directly = Callable[[Array], Array | None]
"""The channels in one call, or None where that cannot be done: (N,) -> (N, 9)."""

# Times in one call of the body: some seconds of work at most, and its arrays stay within some hundred MB.
_AT_ONCE = 16_384
VOIGT = np.array([0, 4, 8, 5, 2, 1])
"""Entries xx yy zz yz xz xy of a matrix row by row."""
MATRIX = np.array([0, 5, 4, 5, 1, 3, 4, 3, 2])
"""And back."""
# Off-diagonal channels stand for two entries of I^-1.
_WEIGHTS = np.sqrt(np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]))


class Channels:
    """The deformation as channels, with a count of its evaluations.

    Whole calls are kept, but for very large ones: one with the same times is answered from what was found before.
    """

    def __init__(self, evaluate: Evaluate, directly: Directly | None = None) -> None:
        self._evaluate, self._directly = evaluate, directly
        self._known: dict[bytes, Array] = {}
        self._not_asked: set[bytes] = set()
        self.count = 0

    def __call__(self, times: Array) -> Array:
        """I^-1 (xx yy zz yz xz xy) and I^-1 L_o: (N,) -> (N, 9), not to be written to."""
        key = times.tobytes()
        found = self._known.get(key)
        if found is None:
            found = self.fresh(times)
            if len(times) <= _AT_ONCE:
                self._known[key] = found
        elif key in self._not_asked:
            self._not_asked.remove(key)
            self.count += len(times)
        return found

    def know(self, times: Array, channels: Array) -> None:
        """Keep what was evaluated elsewhere; when it is asked for, it counts as evaluations of this."""
        self._known[times.tobytes()] = channels
        self._not_asked.add(times.tobytes())

    def fresh(self, times: Array) -> Array:
        """The same, evaluated anew."""
        self.count += len(times)
        run_progress.begin(run_progress.SAMPLING, len(times))
        channels = np.empty((len(times), 9))
        for first in range(0, len(times), _AT_ONCE):
            part = times[first : first + _AT_ONCE]
            found = None if self._directly is None else self._directly(part)
            channels[first : first + _AT_ONCE] = inverted(*self._evaluate(part), part) if found is None else found
            run_progress.advance(len(part))
        return channels


def inverted(inertia: Array, momentum: Array, times: Array) -> Array:
    """The channels of I and L_o: (N, 3, 3), (N, 3) -> (N, 9); messages have the times (N,) [s].

    Raises
    ------
    SingularInertiaError, ShapeError
        If a tensor is singular, or a momentum not finite.
    """
    inverse = inverse_inertia(inertia, times)
    channels = np.empty((len(times), 9))
    channels[:, :6] = inverse.reshape(-1, 9)[:, VOIGT]
    channels[:, 6:] = (inverse @ momentum[:, :, None])[:, :, 0]
    if not isfinite(channels[:, 6:].sum()):
        row = int(np.argwhere(~np.isfinite(channels[:, 6:]))[0, 0])
        raise ShapeError(f"the internal momentum at t = {times[row]:.9g} s is not finite")
    return channels


def rates_of(channels: Array, momentum: float) -> Array:
    """How fast channels turn the body at most, or terms of their series: (..., 9) -> (...) [rad/s].

    `momentum` : its magnitude [kg m^2/s]
    """
    drift = np.sqrt((channels[..., 6:] ** 2).sum(axis=-1))
    if not momentum:
        return drift
    scaled = channels[..., :6] * _WEIGHTS
    return momentum * np.sqrt((scaled * scaled).sum(axis=-1)) + drift
