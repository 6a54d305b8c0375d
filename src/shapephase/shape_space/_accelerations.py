"""The second derivatives of shape paths: exact for all known kinds of curves, by the scan's series for functions."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..chebyshev import PiecewiseChebyshev, widest_margin
from ..integrator.resolved import ResolvedPath
from .curves import (
    Curve,
    Fourier,
    Joined,
    Multiplied,
    PiecewisePolynomial,
    Reordered,
    Repeated,
    Reversed,
    Stretched,
    Widened,
)

_ROUNDING = 32.0 * float(np.finfo(float).eps)  # relative to the largest coefficient: the scan's resolution


def exact_accelerations(curve: Curve, times: Array) -> Array | None:
    """r'' of a curve at times of its interval: (N,) -> (N, n); None where a function of a user is in it.

    At a break it is that of the piece on the right, as rates are.
    """
    if isinstance(curve, Fourier):
        return _fourier(curve, times)
    if isinstance(curve, PiecewisePolynomial):
        return _polynomial(curve, times)
    if isinstance(curve, Joined):
        late = times >= curve.first_duration
        inside = np.minimum(times[late] - curve.first_duration, curve.second_duration)
        first, second = exact_accelerations(curve.first, times[~late]), exact_accelerations(curve.second, inside)
        if first is None or second is None:
            return None
        joined = np.empty((len(times), len(curve.offset)))
        joined[~late], joined[late] = first, second
        return joined
    if not isinstance(curve, Reversed | Stretched | Reordered | Multiplied | Widened | Repeated):
        return None
    if isinstance(curve, Reversed):
        times = curve.duration - times
    elif isinstance(curve, Stretched):
        times = np.minimum(times / curve.factor, curve.duration)
    elif isinstance(curve, Repeated):
        starts = curve.period * np.arange(curve.count)
        times = np.minimum(times - starts[np.searchsorted(starts, times, side="right") - 1], curve.period)
    inner = exact_accelerations(curve.curve, times)
    if inner is None or isinstance(curve, Reversed | Repeated):
        return inner
    if isinstance(curve, Stretched):
        return inner / curve.factor**2
    if isinstance(curve, Reordered):
        return inner[:, curve.order]
    if isinstance(curve, Multiplied):
        return inner * curve.factors
    widened = np.zeros((len(times), curve.n_shape))
    widened[:, curve.columns] = inner
    return widened


def resolved_accelerations(resolved: ResolvedPath, loops: int, times: Array) -> Array:
    """Accelerations by the derivative of the series of the rates, of all loops by the first one: (N, n)."""
    n_shape, edges = resolved.coefficients.shape[2] // 2, resolved.edges
    rates = PiecewiseChebyshev(edges, _continuous(resolved.coefficients[:, :, n_shape:], edges))
    loop = np.minimum(np.floor(times / resolved.duration), loops - 1)
    return rates.derivative()(times - loop * resolved.duration)


def _continuous(series: Array, edges: Array) -> Array:
    """Series (P, k, n) that meet where panels do, as far as rounding keeps them apart, by a change of their slopes.

    What accelerations add up to is then what the rates change by, also where these are large for a short time. At a
    break both sides were sampled at some distance from it, which counts as rounding of times.
    """
    degrees, widths = np.arange(series.shape[1])[:, None], np.diff(edges)[:, None]
    signs = np.where(degrees % 2, -1.0, 1.0)
    starts, ends = (signs * series).sum(axis=1), series.sum(axis=1)
    sizes = np.abs(series)
    slopes = 2.0 / widths * (degrees**2 * sizes).sum(axis=1)
    noise = _ROUNDING * sizes.max(axis=1) + widest_margin(float(edges[-1])) * slopes
    gaps = starts[1:] - ends[:-1]
    gaps = np.where(np.abs(gaps) <= noise[1:] + noise[:-1], gaps, 0.0)
    changed = series.copy()
    none = np.zeros_like(series[:1, 0])
    at_start, at_end = np.concatenate([none, -0.5 * gaps]), np.concatenate([0.5 * gaps, none])
    changed[:, 0] += 0.5 * (at_start + at_end)
    changed[:, 1] += 0.5 * (at_end - at_start)
    return changed


def _fourier(curve: Fourier, times: Array) -> Array:
    harmonics = 2.0 * np.pi / curve.period * np.arange(1, curve.cosines.shape[1] + 1)
    phase = times[:, None] * harmonics
    squares = harmonics**2
    return -(np.cos(phase) @ (curve.cosines * squares).T + np.sin(phase) @ (curve.sines * squares).T)


def _polynomial(curve: PiecewisePolynomial, times: Array) -> Array:
    piece = np.searchsorted(curve.knots[1:-1], times, side="right")
    since = (times - curve.knots[piece])[:, None]
    accelerations = np.zeros((len(times), curve.coefficients.shape[2]))
    for power in range(len(curve.coefficients) - 1, 1, -1):
        accelerations = accelerations * since + power * (power - 1) * curve.coefficients[power, piece]
    return accelerations
