"""I^-1 and I^-1 L_o of a deformation as piecewise Chebyshev polynomials."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..arrays import Array, Integers

_MATRIX = np.array([0, 5, 4, 5, 1, 3, 4, 3, 2])


@dataclass(frozen=True, eq=False)
class Interpolant:
    """I^-1 (6 numbers) and I^-1 L_o (3) on panels: nine channels as Chebyshev series.

    Attributes
    ----------
    edges : (loops P + 1,) panel ends [s]
    coefficients : (P, n, 9), padded with zeros to one degree; channels xx yy zz yz xz xy of I^-1, then I^-1 L_o;
        the P panels of the first loop serve every loop
    loops : how often the panels are repeated
    evaluations : how many times the deformation was evaluated
    """

    edges: Array
    coefficients: Array
    loops: int
    evaluations: int

    def panel_of(self, times: Array) -> Integers:
        """The panel of each time: (N,) -> (N,)."""
        return np.clip(np.searchsorted(self.edges, times, side="right") - 1, 0, len(self.edges) - 2)

    def channels(self, times: Array, panel: Integers) -> Array:
        """The nine channels at times of given panels: (N, k), (N,) -> (N, k, 9)."""
        count, degrees = len(self.coefficients), self.coefficients.shape[1]
        left, right = self.edges[panel, None], self.edges[panel + 1, None]
        local = np.clip((2.0 * times - left - right) / (right - left), -1.0, 1.0)
        values = np.empty((*times.shape, 9))
        chunk = max(1, 2_000_000 // (degrees * (9 + times.shape[1])))
        for start in range(0, len(times), chunk):
            part = slice(start, start + chunk)
            values[part] = chebyshev(local[part], degrees) @ self.coefficients[panel[part] % count]
        return values

    def inverse_and_drift(self, times: Array) -> tuple[Array, Array]:
        """I^-1 and I^-1 L_o: (N,) -> (N, 3, 3) [1/(kg m^2)], (N, 3) [rad/s]."""
        values = self.channels(times[:, None], self.panel_of(times))[:, 0]
        return values[:, _MATRIX].reshape(-1, 3, 3), values[:, 6:]


def chebyshev(x: Array, count: int) -> Array:
    """T_0 ... T_(count-1) at x in [-1, 1]: (...) -> (..., count)."""
    return np.cos(np.arccos(x)[..., None] * np.arange(count))


def inside(left: Array, right: Array) -> tuple[Array, Array]:
    """Times just inside intervals: by more than stretching, reversing and joining paths round, by less than matters."""
    margin = np.minimum(64.0 * np.spacing(np.max(right)), 1e-3 * (right - left))
    return left + margin, right - margin


@lru_cache(maxsize=16)
def unit_nodes(degree: int) -> Array:
    """The ascending Chebyshev points of [-1, 1], ends included: (degree + 1,)."""
    return -np.cos(np.pi * np.arange(degree + 1) / degree) if degree else np.zeros(1)


@lru_cache(maxsize=16)
def values_to_coefficients(degree: int) -> Array:
    """Values at the ascending Chebyshev points of [-1, 1] -> Chebyshev coefficients: (degree + 1, degree + 1)."""
    if degree == 0:
        return np.ones((1, 1))
    matrix = chebyshev(unit_nodes(degree), degree + 1).T * (2.0 / degree)
    matrix[:, [0, -1]] *= 0.5
    matrix[[0, -1], :] *= 0.5
    return matrix
