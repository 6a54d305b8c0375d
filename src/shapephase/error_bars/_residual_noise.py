"""Noise in the residuals of a least-squares fit to recorded attitudes: its correlation, and whether it is noise.

Noise of each axis is taken for a stationary process whose correlation is one of three kinds, of any length: it dies out
exponentially (a tracker), it is the mean of neighbours, or a filter's bell. The restricted likelihood of each (which
counts what the fit has taken out of the residuals) weighs it; whatever follows is averaged over all.

Sources: Patterson and Thompson, Biometrika 58 (1971) 545, the restricted likelihood; Berger and Yang, Econometric
Theory 10 (1994) 461, the prior of an exponential one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array

# Correlations of neighbours, even in their arcsines: there the reference prior is flat. The last is 0.999.
_EXPONENTIAL = np.sin((np.arange(36) + 0.5) / 36.0 * np.pi - 0.5 * np.pi)
# Samples of a mean, or until a bell is 1/e: shorter is nearly white, longer hardly noise.
_LENGTHS = np.array([2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 24.0, 32.0])
_OWN = 0.01  # white share of the variance of smoothed noise: digits of recordings are rounded
_BLOCK = 128  # samples weighed together, four times the longest mean; blocks count as independent
_CHANCE = 0.02  # probability with which noise makes bars longer
_SURE = 0.001  # probability with which noise is taken for a momentum that changes
_ROUNDED = 1e-9  # singular values of slopes, relative: smaller ones are rounding of the reconstruction
_MOST_MODES = 6  # Legendre polynomials of a momentum in time: more resolve less than a tenth of the flight


@dataclass(frozen=True, eq=False)
class ResidualNoise:
    """Probability of each kind and length of correlation, and the parameters of the fit that follow.

    weights : (F,) of the correlations; their sum is one
    variances : (F,) of each residual [rad^2], the larger of what is left of whitened and of plain residuals: where the
        kind does not fit, as of a filter's stop band, whitened ones are too small
    parameters : (F, m) by generalised least squares
    precisions : (F, m, m) inverse covariances of the parameters, where residuals have variance one
    free : numbers less parameters
    """

    weights: Array
    variances: Array
    parameters: Array
    precisions: Array
    free: int

    @property
    def correlation(self) -> float:
        """Mean correlation of neighbouring residuals."""
        return float(self.weights @ _correlations(2)[:, 1])

    def covariance(self, estimator: Array) -> Array:
        """Covariance of parameters that are linear in these residuals: estimator (m, 3 N) -> (m, m)."""
        return _by_correlation(estimator) @ (self.weights * self.variances)

    def chance(self, last: int, added: Array) -> float:
        """Probability that the last few parameters come out so far from zero although they are zero: the F test.

        added : (last, last) covariance of these parameters by what is no noise of the residuals' kinds
        """
        from scipy.special import fdtrc

        parameters = self.parameters[:, -last:]
        by_noise = np.linalg.inv(self.precisions)[:, -last:, -last:]
        known = np.linalg.inv(self.variances[:, None, None] * by_noise + added)
        ratios = np.einsum("fa,fab,fb->f", parameters, known, parameters) / last
        return float(self.weights @ fdtrc(last, self.free, ratios))


def residual_noise(residuals: Array, slopes: Array) -> ResidualNoise:
    """Noise of residuals (N, 3) [rad] that parameters with slopes (3 N, m) may explain in part."""
    count, unknowns = len(residuals), slopes.shape[1]
    rows = np.concatenate([residuals[:, :, None], slopes.reshape(count, 3, unknowns)], axis=2)
    blocks = np.array_split(rows, -(-count // _BLOCK))
    longest = len(blocks[0])
    lags = np.abs(np.subtract.outer(np.arange(longest), np.arange(longest)))
    roots = np.linalg.cholesky(_correlations(longest)[:, lags])
    whitened = np.linalg.inv(roots)
    moments, volumes = np.zeros((len(roots), unknowns + 1, unknowns + 1)), np.zeros(len(roots))
    diagonals = np.log(np.diagonal(roots, axis1=1, axis2=2))
    for block in blocks:
        size = len(block)
        white = whitened[:, :size, :size] @ block.reshape(size, -1)
        white = white.reshape(len(roots), 3 * size, unknowns + 1)
        moments += np.swapaxes(white, 1, 2) @ white
        volumes += 3.0 * diagonals[:, :size].sum(axis=1)
    precisions, right = moments[:, 1:, 1:], moments[:, 1:, 0]
    parameters = np.asarray(np.linalg.solve(precisions, right[:, :, None])[:, :, 0], dtype=np.float64)
    free = 3 * count - unknowns
    plain = residuals.ravel() - slopes @ np.linalg.lstsq(slopes, residuals.ravel(), rcond=None)[0]
    estimator = np.asarray(np.linalg.pinv(slopes), dtype=np.float64)
    taken = np.einsum("abf,ba->f", _by_correlation(estimator), slopes.T @ slopes)
    left = np.maximum(moments[:, 0, 0] - (right * parameters).sum(axis=1), np.finfo(float).tiny)
    likelihood = -0.5 * (free * np.log(left) + np.linalg.slogdet(precisions)[1]) - volumes
    # One half for the exponential ones, white noise among them, and a quarter for each of the others.
    kinds = len(_EXPONENTIAL), 2 * len(_LENGTHS)
    weights = np.exp(likelihood - likelihood.max()) * np.repeat(0.5 / np.array(kinds), kinds)
    return ResidualNoise(
        weights=weights / weights.sum(),
        variances=np.maximum(left / free, (plain @ plain) / (3 * count - taken)),
        parameters=parameters,
        precisions=precisions,
        free=free,
    )


def independent(slopes: Array) -> Array:
    """Orthonormal columns for slopes (n, m) of which some parameters may change nothing: (n, r)."""
    columns, sizes, _ = np.linalg.svd(slopes, full_matrices=False)
    return columns[:, sizes > _ROUNDED * sizes[0]]


def _by_correlation(estimator: Array) -> Array:
    """Covariances of linear estimates, where residuals have variance one: (m, 3 N) -> (m, m, F)."""
    inverse = estimator.reshape(len(estimator), -1, 3)
    count = inverse.shape[1]
    size = 1 << (2 * count - 1).bit_length()
    waves = np.fft.rfft(inverse, size, axis=1)
    by_lag = np.fft.irfft(np.einsum("afc,bfc->abf", waves, waves.conj()), size, axis=2)[:, :, :count]
    by_lag += np.swapaxes(by_lag, 0, 1)
    by_lag[:, :, 0] *= 0.5
    return by_lag @ _correlations(count).T


def _correlations(count: int) -> Array:
    """Correlations of residuals at lags below `count`, for each kind and length: (F, count)."""
    lags = np.arange(count, dtype=np.float64)
    means = np.maximum(1.0 - lags / _LENGTHS[:, None], 0.0)
    bells = np.exp(-((lags / _LENGTHS[:, None]) ** 2))
    smoothed = (1.0 - _OWN) * np.concatenate([means, bells]) + _OWN * (lags == 0)
    return np.concatenate([_EXPONENTIAL[:, None] ** lags, smoothed])


def drift_modes(residuals: Array, slopes: Array, by_modes: Array, carried: Array) -> tuple[int, bool]:
    """Number of Legendre polynomials of the momentum in time that the residuals need, and whether surely.

    residuals (N, 3) [rad], slopes (3 N, m), by_modes (3 N, 3 K): change of the attitudes by each polynomial's momentum;
    carried (3 N, c): of what noise of the joints turns the reconstruction by, the part that slopes and modes explain,
    for c independent numbers of variance one. It grows in time as no noise of the attitudes does.
    One more polynomial counts where chance brings as much in less than one of 50 cases, also together with the next:
    bars that are too long cost less than a drift outside of them. It is sure below one case of 1000.
    """
    modes, sure = 0, False
    for tried in range(1, by_modes.shape[1] // 3 + 1):
        if tried > modes + 2 or 3 * len(residuals) <= slopes.shape[1] + 3 * (tried + 1):
            break
        parameters, last = np.hstack([slopes, by_modes[:, : 3 * tried]]), 3 * (tried - modes)
        by_joints = np.linalg.pinv(parameters)[-last:] @ carried
        chance = residual_noise(residuals, parameters).chance(last, by_joints @ by_joints.T)
        if chance < _CHANCE:
            modes, sure = tried, sure or chance < _SURE
    return modes, sure


def most_modes(count: int) -> int:
    """Legendre polynomials that are tried of a momentum in time, with so many attitudes."""
    return min(_MOST_MODES, max(count // 3 - 1, 0))


def held(deviations: Array) -> Array:
    """A covariance (3, 3) whose standard deviation along each principal axis of deviations (N, 3) is the largest there.

    Along any other axis the largest deviation is at most sqrt(3) standard deviations, fewer than those of a 95 % bar.
    """
    _, axes = np.linalg.eigh(deviations.T @ deviations)
    return (axes * np.abs(deviations @ axes).max(axis=0) ** 2) @ axes.T
