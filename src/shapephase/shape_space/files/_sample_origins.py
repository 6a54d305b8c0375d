"""Paths made of recorded samples by linear steps: the steps, taken again with other samples and backwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...arrays import Array, Mask
from ...display import frozen
from ..curves import PiecewisePolynomial
from ..linear_smoother import LinearSmoother
from ..path_samples import PathSamples, path_samples
from ..shape_path import ShapePath, interpolated


@frozen(kw_only=True)
class Prepared:
    """Samples, from which turns and drift are taken off, which are smoothed, and through which a spline is put.

    smoother : of columns (n,); has the times of the samples, and whether the spline is periodic
    pilot : a smoother of a higher order, by whose motion it is known what the other one takes off; None: unknown
    inside : the samples between whose times the path is, of those that are smoothed
    turns : (n,) whole turns that a loop makes, evenly [rad]
    drift : True if the gap between the last sample and the first is taken off evenly in time
    """

    samples: Array
    smoother: LinearSmoother
    pilot: LinearSmoother | None
    inside: slice
    turns: Array
    drift: bool
    joint_names: tuple[str, ...] | None

    @property
    def smoothed(self) -> Mask:
        """True for joints that are smoothed: (n,)."""
        return self.smoother.penalties > 0.0

    @cached_property
    def _share(self) -> Array:
        times = self.smoother.times
        return (times / times[-1])[:, None]

    @property
    def _kept(self) -> slice:
        """Places of the knots of the path among the values that are smoothed."""
        return slice(None) if self.smoother.periodic else self.inside

    def joined(self, samples: Array) -> Array:
        """Values that are smoothed, from recorded samples (N, n): (count, n)."""
        even = samples - self._share * self.turns
        if self.drift:
            even = even - self._share * (even[-1] - even[0])
            even[-1] = even[0]
        if not self.smoother.periodic:
            return even
        first = np.where(self.smoothed, 0.5 * (even[0] + even[-1]), even[0])
        return np.concatenate([first[None], even[1:-1]])

    def values(self, samples: Array) -> Array:
        """The values of the spline at its knots: (knots, n)."""
        joined = self.joined(samples)
        # About the first, so that what does not move stays to the last digit.
        smooth = joined[0] + self.smoother(joined - joined[0])
        return np.where(self.smoothed, smooth, joined)[self._kept]

    @cached_property
    def bias(self) -> Array:
        """Bias of the steps at the knots, by the pilot: (knots, n)."""
        values = self.joined(self.samples)
        if self.pilot is None or not self.smoothed.any():
            return np.zeros_like(values)[self._kept]
        motion = self.pilot(values - values[0])
        return (self.smoother(motion) - motion)[self._kept]

    def path(self, samples: Array) -> ShapePath:
        """Return the path that the steps make of other samples (N, n)."""
        times = self.smoother.times[self.inside]
        through = "periodic" if self.smoother.periodic else "not-a-knot"
        plain = interpolated(times, self.values(samples), through, self.joint_names)
        curve = plain.curve
        assert isinstance(curve, PiecewisePolynomial)
        if self.turns.any():
            rate = self.turns / times[-1]
            coefficients = curve.coefficients.copy()
            coefficients[0] += curve.knots[:-1, None] * rate
            coefficients[1] += rate
            curve = PiecewisePolynomial(curve.knots, coefficients, curve.through)
        return replace(plain, curve=curve, origin=replace(self, samples=samples))

    def by_samples(self, by_values: Array) -> Array:
        """Return derivatives by the samples from those by the values at the knots."""
        return self._by_recorded(self.smoother.transposed(self._of_all(by_values)))

    def bias_by_samples(self, by_values: Array) -> Array:
        """Return derivatives of the bias by the samples from those by the bias."""
        given = self._of_all(by_values)
        if self.pilot is None or not self.smoothed.any():
            return self._by_recorded(np.zeros_like(given))
        return self._by_recorded(self.pilot.transposed(self.smoother.transposed(given) - given))

    def _of_all(self, by_values: Array) -> Array:
        """Derivatives by all values that are smoothed, of which those outside of the path are zero."""
        whole = np.zeros((self.smoother.count, *by_values.shape[1:]))
        whole[self._kept] = by_values
        return whole

    def _by_recorded(self, found: Array) -> Array:
        """Convert derivatives by `joined` to those by the samples: (count, m, n) -> (N, m, n)."""
        if not self.smoother.periodic:
            return found
        last = np.where(self.smoothed, 0.5 * found[0], 0.0)
        first = found[0] - last
        even = np.concatenate([first[None], found[1:], last[None]])
        if not self.drift:
            return even
        # With the drift taken off, the last sample is the first, and all move by their share of the gap.
        even[0], even[-1] = even[0] + even[-1], 0.0
        by_gap = (self._share[:, :, None] * even).sum(axis=0)
        even[0] += by_gap
        even[-1] -= by_gap
        return even


@frozen
class Resampled:
    """Values of a path through samples, evenly in time, through which another spline is put.

    count : how many values may differ: of a periodic spline the last is the first
    """

    inner: ShapePath
    times: Array
    count: int

    @property
    def samples(self) -> Array:
        """Samples as they were recorded: (N, n) [rad or m]."""
        return path_samples(self.inner).values

    @property
    def bias(self) -> Array:
        """Bias of the steps at the knots, by the pilot: (knots, n)."""
        samples = path_samples(self.inner)
        taken = samples.bias.reshape(-1, self.inner.n_shape)
        periodic = len(taken) < len(samples.curve.knots)
        through = interpolated(samples.curve.knots, taken, "periodic" if periodic else "not-a-knot")
        return through.shape(self.times[: self.count])

    def path(self, samples: Array) -> ShapePath:
        """Return the path that the steps make of other samples (N, n)."""
        names = self.inner.joint_names
        return resampled(replace(path_samples(self.inner).path_through(samples), joint_names=names), self.times)

    def by_samples(self, by_values: Array) -> Array:
        """Return derivatives by the samples from those by the values at the knots."""
        return self._through(PathSamples.by_samples, by_values)

    def bias_by_samples(self, by_values: Array) -> Array:
        """Return derivatives of the bias by the samples from those by the bias."""
        return self._through(PathSamples.bias_by_samples, by_values)

    def _through(self, rule: Callable[[PathSamples, Array], Array], by_values: Array) -> Array:
        samples = path_samples(self.inner)
        found = rule(samples, samples.by_knots(self.times[: self.count], by_values, np.zeros_like(by_values)))
        return np.moveaxis(found.reshape(len(found), samples.count, -1), 0, 1)


def resampled(path: ShapePath, times: Array) -> ShapePath:
    """The spline through values of a path at times (M,), which remembers the samples of that path."""
    plain = ShapePath.spline(times, path.shape(times), joint_names=path.joint_names)
    curve = plain.curve
    assert isinstance(curve, PiecewisePolynomial)
    return replace(plain, origin=Resampled(path, times, len(times) - (curve.through == "periodic")))
