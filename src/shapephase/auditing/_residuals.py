"""Residuals of an observation in units of its noise, and what a change of momentum or of the fall makes of them.

What a free body may have anyway is taken off: any constant momentum, any parabola of the centre of mass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ._observation import Observation

_ROUNDING = 16.0 * float(np.finfo(np.float64).eps)
"""Of the largest variance: what sums of a dozen products leave of a smaller one."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Of momentum and fall, whitened.

    Attributes
    ----------
    seen : what they are of
    vector : (M,)
    """

    seen: Observation
    vector: Array
    _momentum_factor: Array
    _centre_factor: Array | None
    _free: Array

    @property
    def square(self) -> float:
        """Their squares, summed."""
        return float(self.vector @ self.vector)

    @property
    def freedom(self) -> int:
        """Numbers that are independent."""
        return len(self.vector) - self._free.shape[1]

    def columns(self, momentum: Array, centre: Array | None = None) -> Array:
        """What changes of the momentum (N, 3, k) and of the centre of mass (N, 3, k) add to the vector: (M, k)."""
        rows = [_whitened(self._momentum_factor, self.seen.seen(momentum))]
        if self._centre_factor is not None:
            moved = np.zeros_like(momentum) if centre is None else centre
            rows.append(_whitened(self._centre_factor, moved))
        whole = np.vstack(rows)
        return whole - self._free @ (self._free.T @ whole)

    def of(self, seen: Observation) -> Array:
        """The vector that another observation of the same samples has, in units of this one's noise."""
        momentum, centre = seen.momentum[:, :, None], seen.centre
        return self.columns(momentum, None if centre is None else centre[:, :, None])[:, 0]


def residuals(seen: Observation) -> Residuals:
    """The residuals of an observation."""
    factor = _inverse_factor(seen.momentum_noise)
    centre = None if seen.centre_noise is None else _inverse_factor(seen.centre_noise)
    since = (seen.times - seen.times[0]) / (seen.times[-1] - seen.times[0])
    allowed = [factor] if seen.given_rates else [factor, since[:, None, None] * factor]
    blocks = [np.concatenate(allowed, axis=2).reshape(3 * len(since), -1)]
    if centre is not None:
        powers = np.concatenate([since[:, None, None] ** k * centre for k in range(3)], axis=2)
        blocks.append(powers.reshape(3 * len(since), -1))
    rows = sum(len(block) for block in blocks)
    free = np.zeros((rows, sum(block.shape[1] for block in blocks)))
    row = column = 0
    for block in blocks:
        free[row : row + len(block), column : column + block.shape[1]] = block
        row, column = row + len(block), column + block.shape[1]
    made = Residuals(seen, np.zeros(rows), factor, centre, np.linalg.qr(free)[0])
    return Residuals(seen, made.of(seen), factor, centre, made._free)


def _inverse_factor(covariances: Array) -> Array:
    """W with W C W^T = 1: (N, 3, 3)."""
    # Noise of one joint alone has one direction, and rounding what is across.
    floor = _ROUNDING * np.trace(covariances, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return np.asarray(np.linalg.inv(np.linalg.cholesky(covariances + floor)), dtype=np.float64)


def _whitened(factor: Array, change: Array) -> Array:
    """(N, 3, 3), (N, 3, k) -> (3 N, k)."""
    turned = factor @ change
    return turned.reshape(-1, change.shape[2])
