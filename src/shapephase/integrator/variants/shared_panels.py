"""Panels that one deformation needs, on which others along the same path are sampled side by side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array, Mask
from ...chebyshev import chebyshev, local_coordinate
from .._last_terms import perturbed_series
from ..fresh_times import fresh_times, swings
from ..panels.panel_sampling import PanelSampler
from ..panels.panel_series import panel_errors, series_through, sum_of_noise
from ..resolved import Hidden


@dataclass(frozen=True, eq=False)
class ManySeries:
    """What V deformations are on the same panels.

    Attributes
    ----------
    coefficients : (V, P, n, 9), as those of an `Interpolant`
    perturbed : the same with errors like those that they probably have
    error : (V,) as `Sampler.error` [rad]
    hidden : (V,) as that of `Perturbed` [rad]
    """

    coefficients: Array
    perturbed: Array
    error: Array
    hidden: Array

    def some(self, which: Mask) -> ManySeries:
        """Of those for which `which` (V,) is true."""
        return ManySeries(*(part[which] for part in vars(self).values()))


class SharedPanels:
    """The panels of a sampler as they are now."""

    def __init__(self, sampler: PanelSampler) -> None:
        interpolant = sampler.as_sampled()
        self._end, self._panels, self._hidden = sampler.end, sampler.series, sampler.hidden
        self._defect = sampler.defect
        self.degrees, self.widths = self._panels.degree, self._panels.width
        self.edges, self.loops = interpolant.edges, interpolant.loops
        self.times = sampler.sample_times
        self._fresh, self._tested = fresh_times(interpolant)
        self.times_with_fresh = np.concatenate([self.times, self._fresh])

    def swings(self, coefficients: Array, fresh: Array, momentum: float) -> Array:
        """Largest angle by which series differ from bodies at fresh times: (V, P, n, 9), (V, N, 9) -> (V,) [rad]."""
        panel = self._tested
        local, series = local_coordinate(self._fresh, self.edges[panel], self.edges[panel + 1]), coefficients[:, panel]
        gaps = np.einsum("ij,vijk->vik", chebyshev(local, series.shape[2]), series) - fresh
        return self.loops * swings(gaps, series, self.widths[panel], momentum).max(axis=1)

    def series(self, channels: Array, momentum: float) -> ManySeries:
        """Of deformations whose channels at the times are (V, S, 9), for momenta of this magnitude."""
        count, each = len(channels), len(self.degrees)
        left, right = np.tile(self._panels.left, count), np.tile(self._panels.right, count)
        values = np.array(channels, dtype=np.float64).reshape(-1, 9)
        degree = np.tile(self.degrees, count)
        found = series_through(degree, left, right, values, self._end, degree > 0)
        hidden = None if self._hidden is None else Hidden(np.tile(self._hidden.table, (count, 1)))
        errors = panel_errors(found, hidden, momentum)
        noise = np.array([sum_of_noise(row) for row in errors.noise.reshape(count, each)])
        changed = perturbed_series(found.coefficients, found.degree, found.width, momentum)
        return ManySeries(
            coefficients=found.coefficients.reshape(count, each, -1, 9),
            perturbed=changed.reshape(count, each, -1, 9),
            error=self.loops * (_sums(errors.whole.reshape(count, each)) + noise + self._defect),
            hidden=self.loops * (_sums(errors.hidden.reshape(count, each)) + noise + self._defect),
        )


def _sums(rows: Array) -> Array:
    """Of each row, alike whatever the others are: (V, G) -> (V,)."""
    return np.add.accumulate(rows, axis=1)[:, -1]
