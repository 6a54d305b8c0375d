"""Panels that one deformation needs, on which others along the same path are sampled side by side."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Array, Mask
from .._last_terms import perturbed_series
from .._panel_sampling import PanelGroup, PanelSampler, PanelsToSample, hidden_errors, panel_group, sum_of_noise
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
        interpolant = sampler.interpolant()
        self._parts = sampler.panels
        self._order = np.argsort(np.concatenate([panels.left for panels, _ in self._parts]))
        degrees = np.concatenate([np.full(len(panels.left), panels.degree) for panels, _ in self._parts])
        self.degrees = degrees[self._order]
        self.edges, self.loops = interpolant.edges, interpolant.loops
        self.widths = np.diff(interpolant.edges[: len(self._order) + 1])
        self.times = np.concatenate([panels.new_points().ravel() for panels, _ in self._parts])

    def series(self, channels: Array, momentum: float) -> ManySeries:
        """Of deformations whose channels at the times are (V, S, 9), for momenta of this magnitude."""
        count, terms = len(channels), int(self.degrees.max()) + 1
        coefficients = np.zeros((count, len(self._order), terms, 9))
        error, hidden, noises, start, first = np.zeros(count), np.zeros(count), [np.zeros((count, 1))], 0, 0
        for panels, of_path in self._parts:
            degree, each = panels.degree, len(panels.left)
            stop, last = start + each * (degree + 1), first + each
            g = _repeated(panels, channels[:, start:stop])
            coefficients[:, first:last, : degree + 1] = g.coefficients.reshape(count, each, degree + 1, 9)
            errors = g.estimate.error(momentum, g.width, 2.0 * degree)
            if of_path is not None:
                between, noise = hidden_errors(_tiled(of_path, count), g, momentum)
                errors = np.maximum(errors, between)
                hidden += _sums(between.reshape(count, each))
                noises.append(noise.reshape(count, each))
            error += _sums(errors.reshape(count, each))
            start, first = stop, last
        noise = np.array([sum_of_noise(row) for row in np.concatenate(noises, axis=1)])
        coefficients = coefficients[:, self._order]
        degrees, widths = np.tile(self.degrees, count), np.tile(self.widths, count)
        changed = perturbed_series(coefficients.reshape(-1, terms, 9), degrees, widths, momentum)
        return ManySeries(
            coefficients=coefficients,
            perturbed=changed.reshape(coefficients.shape),
            error=self.loops * (error + noise),
            hidden=self.loops * (hidden + noise),
        )


def _repeated(panels: PanelsToSample, channels: Array) -> PanelGroup:
    """The panels once for each of many deformations, whose channels there are (V, G (degree + 1), 9)."""
    count = len(channels)
    tiled = replace(panels, left=np.tile(panels.left, count), right=np.tile(panels.right, count))
    values = tiled.with_values(channels.reshape(len(tiled.left), panels.degree + 1, 9))
    return panel_group(panels.degree, tiled.left, tiled.right, values)


def _tiled(hidden: Hidden, count: int) -> Hidden:
    return Hidden(*(np.concatenate([part] * count) for part in hidden))


def _sums(rows: Array) -> Array:
    """Of each row, alike whatever the others are: (V, G) -> (V,)."""
    return np.add.accumulate(rows, axis=1)[:, -1]
