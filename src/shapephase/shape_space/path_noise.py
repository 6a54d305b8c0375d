"""Error bars of a joint motion itself: of its angles, rates and accelerations, by the noise of the samples."""

from __future__ import annotations

from functools import lru_cache
from math import comb

import numpy as np
from numpy.typing import ArrayLike

from ..arguments import check_object, times_argument
from ..arrays import Array, finite_array
from ..display import frozen
from ..errors import ShapeError, WrongObjectError
from ..letters import value_text
from .body_path import as_path
from .path_samples import PathSamples, columns_without_samples, path_samples
from .shape_path import ShapePath

_LOWEST_ORDER = 3  # of differences: the motion itself is in those below
_HIGHEST_ORDER = 12  # of differences, the samples allowing
_ROUNDING = 8.0  # units in the last place: what arithmetic leaves of samples that are otherwise exact
_MOST_NUMBERS = 4_000_000  # in memory at once; more times are taken in parts


@frozen
class PathErrors:
    """Error bars of joints at some times, each from the noise of its own samples. Made by `path_errors`.

    Attributes
    ----------
    times : (N,) [s]
    covariance : (N, n, 3, 3) of shape, rate and acceleration of each joint: by the noise, and by what the noise leaves
        open of the bias
    bias : (N, n, 3) what smoothing took off these, as far as it is known
    """

    times: Array
    covariance: Array
    bias: Array

    @property
    def shape(self) -> Array:
        """Standard deviations of the joints: (N, n) [rad or m]."""
        return self._deviations(0)

    @property
    def rate(self) -> Array:
        """Standard deviations of their rates: (N, n) [rad/s or m/s]."""
        return self._deviations(1)

    @property
    def acceleration(self) -> Array:
        """Standard deviations of their accelerations: (N, n) [rad/s^2 or m/s^2]."""
        return self._deviations(2)

    def of(self, derivative: Array) -> Array:
        """Standard deviations of numbers that follow from all joints: (N, m, n, 3) derivatives by shape, rate and
        acceleration -> (N, m)."""
        by_noise = np.einsum("tmja,tjab,tmjb->tm", derivative, self.covariance, derivative)
        return np.sqrt(by_noise + np.einsum("tmja,tja->tm", derivative, self.bias) ** 2)

    def _deviations(self, which: int) -> Array:
        return np.sqrt(self.covariance[..., which, which] + self.bias[..., which] ** 2)


def path_errors(path: ShapePath | str, t: ArrayLike, joints: ArrayLike | None = None) -> PathErrors:
    """Error bars of joints, their rates and accelerations, from the noise of the samples of a path.

    The bars of a smoothed recording hold the noise that is left and the bias of smoothing.

    Source: own derivation; the bias is that of the quintic smoothing spline on the motion that one of degree nine sees
    in the same samples.

    Parameters
    ----------
    path : through samples: `ShapePath.spline`, `ShapePath.waypoints`, or a recorded motion
    t : times (N,) [s]
    joints : standard deviation of the samples' white noise, one number or one for each joint (n,) [rad or m]; None: the
        one that a recording was smoothed for, or that was estimated where it was low-pass filtered

    Raises
    ------
    WrongObjectError
        If the path was not put through samples; without `joints`, if no noise was stated.
    ShapeError
        For a noise of another length, or below zero.
    TrajectoryError
        For times outside of the path.

    Examples
    --------
    >>> times = np.linspace(0.0, 1.0, 41)
    >>> noisy = np.sin(2.0 * np.pi * times)[:, None] + 0.01 * np.cos(40.0 * times)[:, None]
    >>> path, told = sp.shape_space.files.smoothed_path(times, noisy, 0.01, periodic=False)
    >>> found = sp.path_errors(path, [0.0, 0.5], 0.01)
    >>> bool(found.rate[0, 0] > 3.0 * found.rate[1, 0])  # more is open at an end
    True
    """
    path = as_path(path)
    times = times_argument(t, path.duration).ravel()
    samples, levels = path_samples(path), _levels(path, joints)
    rows = max(samples.count * path.n_shape, samples.curve.coefficients[..., 0].size)
    chunks = np.array_split(times, max(1, -(-3 * len(times) * rows // _MOST_NUMBERS)))
    parts = [_errors(samples, part, levels) for part in chunks if len(part)]
    covariance, bias = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return PathErrors(times=times, covariance=covariance, bias=bias)


def summed_errors(path: ShapePath, times: Array, derivative: Array, joints: ArrayLike | None = None) -> Array:
    """Standard deviations of sums over times (N,) of (N, m, n, 3) derivatives by shape, rate and acceleration: (m,)."""
    check_object(path, "ShapePath", "path")
    samples, levels, used = path_samples(path), _levels(path, joints), derivative.any(axis=(1, 2, 3))
    rows = samples.rows_by_knots(times[used])
    by_knots = np.einsum("tmja,atk->mkj", derivative[used], rows, optimize=True).reshape(derivative.shape[1], -1)
    variance = (by_knots @ samples.bias) ** 2
    for rule in samples.rules:
        answers = rule(by_knots).reshape(len(by_knots), -1, path.n_shape) * levels
        variance += (answers**2).sum(axis=(1, 2))
    return np.sqrt(variance)


def stated_noise(path: ShapePath) -> Array | None:
    """The noise that a recording was smoothed for, or that a low-pass filter found: (n,) [rad or m]; else None."""
    check_object(path, "ShapePath", "path")
    record = path.record or {}
    stated = record.get("smooth") or (record.get("lowpass") or {}).get("noise")
    return None if stated is None else np.array([stated[name] for name in path.joint_names or stated])


def _levels(path: ShapePath, joints: ArrayLike | None) -> Array:
    given = stated_noise(path) if joints is None else finite_array(joints, "joints")
    if given is None:
        raise WrongObjectError(
            "the noise of the samples is not stated: give joints, or read the recording with smooth (--smooth) or "
            "lowpass (--lowpass)"
        )
    if given.shape not in ((), (path.n_shape,)) or np.any(given < 0.0):
        raise ShapeError(
            f"joints: one standard deviation or {path.n_shape} of them, zero or above, are needed, got "
            f"{value_text(given)}"
        )
    levels = np.array(np.broadcast_to(given, path.n_shape))
    levels[columns_without_samples(path)] = 0.0
    return levels


def _errors(samples: PathSamples, times: Array, levels: Array) -> tuple[Array, Array]:
    """Covariances (N, n, 3, 3) and biases (N, n, 3)."""
    n_shape, count = len(levels), len(times)
    rows = samples.rows_by_knots(times)
    of_all = np.repeat(rows.reshape(3 * count, -1), n_shape, axis=1)
    covariance = np.zeros((count, n_shape, 3, 3))
    for rule in samples.rules:
        answers = (levels * rule(of_all).reshape(3, count, -1, n_shape)).transpose(1, 3, 0, 2)
        covariance += answers @ np.swapaxes(answers, 2, 3)
    bias = np.einsum("atk,kj->tja", rows, samples.bias.reshape(-1, n_shape))
    return covariance, bias


def white_noise(samples: Array, freedom: int) -> Array:
    """Standard deviation of noise that is alike in all directions of c vectors (N, c, k): (c,).

    freedom : in how many directions there is noise
    """
    largest = np.abs(samples).max(axis=(0, 2), initial=0.0)
    least = np.full(samples.shape[1], np.inf)
    differences = samples
    for order in range(1, min(_HIGHEST_ORDER, len(samples) // 2) + 1):
        differences = np.diff(differences, axis=0)
        if order >= _LOWEST_ORDER:
            # The median: a blow or a break is in few of them.
            squares = np.median((differences**2).sum(axis=2), axis=0) / comb(2 * order, order)
            least = np.minimum(least, np.sqrt(squares / _median_square(freedom)))
    return np.maximum(least, _ROUNDING * float(np.finfo(np.float64).eps) * largest)


@lru_cache(maxsize=8)
def _median_square(freedom: int) -> float:
    """Median of the squared length of a vector of `freedom` numbers with variance one."""
    from scipy.stats import chi2

    return float(chi2.median(freedom))
