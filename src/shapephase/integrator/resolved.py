"""A function of time resolved to rounding: Chebyshev series on panels, by which functions of it are sampled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array, Integers
from ..display import frozen

DEGREE = 32  # of the series on every panel
_AT_REST = 1e-14  # [rad]: values without rates, like a given inertia, scatter by this much through rounding


@frozen
class ResolvedPath:
    """Shapes and rates as Chebyshev series on panels, right to rounding.

    left, right : (P,) ends of the panels, which adjoin and ascend [s]
    coefficients : (P, DEGREE + 1, 2 n) of the shapes and of their rates
    noise : (P,) where the series cannot follow noise, the larger of shapes and rates times half the width; else 0 [rad]
    duration : [s]
    defect : sum over the panels of the largest difference between the integral of a rate and its shape [rad]
    """

    left: Array
    right: Array
    coefficients: Array
    noise: Array
    duration: float
    defect: float = 0.0

    @property
    def edges(self) -> Array:
        """Ends of all panels: (P + 1,) [s]."""
        return np.append(self.left, self.right[-1])

    def terms(self, tolerance: float) -> Integers:
        """Lowest degrees beyond which the coefficients add up to `tolerance` [rad] at most: (P,).

        They are those of shapes, and of rates times half the width, whichever need more. A panel on which nothing
        moves has 0, any other at least 1.
        """
        sizes = np.abs(self.coefficients)
        sizes[:, :, self._n_shape :] *= 0.5 * (self.right - self.left)[:, None, None]
        # From each degree on.
        sums = np.cumsum(sizes[:, ::-1], axis=1)[:, ::-1].max(axis=2, initial=0.0)
        lowest = 1 + np.sum(sums[:, 2:] > tolerance, axis=1)
        moves = self.coefficients[:, :, self._n_shape :].any(axis=(1, 2)) | (sums[:, 1] > _AT_REST)
        return np.where(moves, lowest, 0)

    @property
    def _n_shape(self) -> int:
        return self.coefficients.shape[2] // 2


def joined(paths: Sequence[ResolvedPath]) -> ResolvedPath:
    """Return several paths one after another as one."""
    starts = np.cumsum([0.0, *(path.duration for path in paths)])
    return ResolvedPath(
        left=np.concatenate([path.left + start for path, start in zip(paths, starts[:-1], strict=True)]),
        right=np.concatenate([path.right + start for path, start in zip(paths, starts[:-1], strict=True)]),
        coefficients=np.concatenate([path.coefficients for path in paths]),
        noise=np.concatenate([path.noise for path in paths]),
        duration=float(starts[-1]),
        defect=sum(path.defect for path in paths),
    )
