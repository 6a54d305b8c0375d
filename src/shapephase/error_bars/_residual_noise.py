"""Noise of what a least-squares fit leaves of recorded attitudes: how far it is correlated, and whether it is noise.

Noise of each axis is taken for an autoregressive process of the first order, e_k = phi e_{k-1} + white noise, whose phi
is unknown. With V(phi) its covariance, the restricted likelihood of phi (which counts what the fit has taken out of the
residuals) times the reference prior (1 - phi^2)^(-1/2) weighs each phi; whatever follows is averaged over phi.

Sources: Patterson and Thompson, Biometrika 58 (1971) 545, the restricted likelihood; Berger and Yang, Econometric
Theory 10 (1994) 461, the prior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array

_CORRELATIONS = np.sin((np.arange(160) + 0.5) / 160.0 * np.pi - 0.5 * np.pi)
"""Of neighbours, even in arcsin phi: there the reference prior is flat. The last is 1 - 5e-5: 20,000 samples."""
_CHANCE = 0.001
"""With which residuals that are noise are taken for a momentum that changes."""
_MOST_MODES = 6
"""Legendre polynomials of a momentum in time: more resolve less than a tenth of the flight."""


@dataclass(frozen=True, eq=False)
class ResidualNoise:
    """How likely each correlation of neighbouring residuals is, and what follows of the parameters with it.

    Attributes
    ----------
    weights : (G,) of the correlations; their sum is one
    variances : (G,) of each residual [rad^2]
    parameters : (G, m) by generalised least squares
    precisions : (G, m, m) inverse covariances of the parameters, where the innovations have variance one
    innovations : (G,) variance of the white noise that drives the process [rad^2]
    free : numbers less parameters
    """

    weights: Array
    variances: Array
    parameters: Array
    precisions: Array
    innovations: Array
    free: int

    @property
    def correlation(self) -> float:
        """Of neighbouring residuals, on average."""
        return float(self.weights @ _CORRELATIONS)

    def covariance(self, slopes: Array) -> Array:
        """Covariance of the parameters of an ordinary least-squares fit: slopes (3 N, m) -> (m, m)."""
        answers = np.linalg.pinv(slopes).reshape(slopes.shape[1], -1, 3)
        count = answers.shape[1]
        size = 1 << (2 * count - 1).bit_length()
        waves = np.fft.rfft(answers, size, axis=1)
        by_lag = np.fft.irfft(np.einsum("afc,bfc->abf", waves, waves.conj()), size, axis=2)[:, :, :count]
        by_lag += np.swapaxes(by_lag, 0, 1)
        by_lag[:, :, 0] *= 0.5
        expected = (self.weights * self.variances) @ _CORRELATIONS[:, None] ** np.arange(count)
        return by_lag @ expected

    def chance(self, last: int) -> float:
        """Probability that the last few parameters come out so far from zero although they are zero: the F test."""
        from scipy.special import fdtrc

        there = self.parameters[:, -last:]
        known = np.linalg.inv(np.linalg.inv(self.precisions)[:, -last:, -last:])
        ratios = np.einsum("ga,gab,gb->g", there, known, there) / (last * self.innovations)
        return float(self.weights @ fdtrc(last, self.free, ratios))


def residual_noise(residuals: Array, slopes: Array) -> ResidualNoise:
    """Noise of residuals (N, 3) [rad] that parameters with slopes (3 N, m) may explain in part."""
    count, unknowns = len(residuals), slopes.shape[1]
    rows = np.concatenate([residuals[:, :, None], slopes.reshape(count, 3, unknowns)], axis=2)

    def products(first: Array, second: Array) -> Array:
        return np.einsum("nca,ncb->ab", first, second)

    phi = _CORRELATIONS[:, None, None]
    across = products(rows[1:], rows[:-1])
    # Each row less phi times the one before; the first has the variance of the whole process.
    moments = (
        (1.0 - phi**2) * products(rows[:1], rows[:1])
        + products(rows[1:], rows[1:])
        - phi * (across + across.T)
        + phi**2 * products(rows[:-1], rows[:-1])
    )
    precisions, right = moments[:, 1:, 1:], moments[:, 1:, 0]
    parameters = np.asarray(np.linalg.solve(precisions, right[:, :, None])[:, :, 0], dtype=np.float64)
    left = moments[:, 0, 0] - (right * parameters).sum(axis=1)
    free, scale = 3 * count - unknowns, 1.0 - _CORRELATIONS**2
    left = np.maximum(left, np.finfo(float).tiny)
    likelihood = -0.5 * (free * np.log(left) - 3.0 * np.log(scale) + np.linalg.slogdet(precisions)[1])
    weights = np.exp(likelihood - likelihood.max())
    innovations = left / free
    return ResidualNoise(
        weights=weights / weights.sum(),
        variances=innovations / scale,
        parameters=parameters,
        precisions=precisions,
        innovations=innovations,
        free=free,
    )


def drift_modes(residuals: Array, slopes: Array, by_modes: Array) -> int:
    """How many Legendre polynomials of the momentum in time the residuals ask for; 0 where they are noise.

    residuals (N, 3) [rad], slopes (3 N, m), by_modes (3 N, 3 K): change of the attitudes by each polynomial's momentum.
    One more polynomial counts where chance brings as much in less than one of 1000 cases, also together with the next.
    """
    modes = 0
    for tried in range(1, by_modes.shape[1] // 3 + 1):
        if tried > modes + 2 or 3 * len(residuals) <= slopes.shape[1] + 3 * (tried + 1):
            break
        noise = residual_noise(residuals, np.hstack([slopes, by_modes[:, : 3 * tried]]))
        if noise.chance(3 * (tried - modes)) < _CHANCE:
            modes = tried
    return modes


def most_modes(count: int) -> int:
    """Legendre polynomials that are tried of a momentum in time, with so many attitudes."""
    return min(_MOST_MODES, max(count // 3 - 1, 0))


def held(deviations: Array) -> Array:
    """A covariance (3, 3) whose standard deviation along each principal axis of deviations (N, 3) is the largest there.

    Along any other axis the largest deviation is at most sqrt(3) standard deviations, fewer than those of a 95 % bar.
    """
    _, axes = np.linalg.eigh(deviations.T @ deviations)
    return (axes * np.abs(deviations @ axes).max(axis=0) ** 2) @ axes.T
