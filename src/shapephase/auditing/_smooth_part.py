"""The slow part of residuals: what polynomials of low order take of them, and whether noise alone explains it.

Causes of a drift act over many samples, and noise does not. The first polynomials that are orthogonal on the samples
hold nearly all of the first and little of the second.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.stats import f

from ..arguments import check_pair, whole_argument
from ..arrays import Array, finite_array
from ..display import short_repr
from ._noise_spectrum import noise_spectrum

_HIGHEST = 12
"""Order of the polynomials, the samples allowing."""
_SAMPLES_EACH = 3
"""Samples that a polynomial needs."""
_UNSURE = 1.5  # factor of a variance: the noise is itself estimated
_MOST_NOISE = 0.05  # of what residuals are of: samples of noise of 3 degrees, or worse, tell nothing
_CHANCE = 1e-6
"""Probability with which noise alone is taken for something else, for one residual."""


@dataclass(frozen=True, eq=False)
class SmoothPart:
    """What the first polynomials take of residuals.

    Attributes
    ----------
    values : (N, k) that they sum up to
    ratio : its square in units of what noise alone brings, over the limit: above 1, noise does not explain it
    noise : what noise alone brings to the values, rms
    colour : mean power of the noise over that of white noise with its highest frequencies
    least : (N,) the slowest curve that is not free, as large as it has to be along every axis to exceed noise

    Examples
    --------
    >>> rest = np.zeros((40, 3))
    >>> found = sp.auditing.smooth_part(np.linspace(0.0, 1.0, 40), rest, np.tile(np.eye(3), (40, 1, 1)), 1)
    >>> print(found.ratio)
    0.0
    """

    values: Array
    ratio: float
    noise: float
    colour: float = 1.0
    least: Array = field(default_factory=lambda: np.zeros(0), repr=False)

    __repr__ = short_repr


def polynomials(times: Array, highest: int) -> Array:
    """(N, highest + 1) orthonormal on the samples."""
    span = times[-1] - times[0]
    return np.linalg.qr(legvander(2.0 * (times - times[0]) / span - 1.0, highest))[0]


def smooth_part(
    times: Array,
    residuals: Array,
    covariances: Array,
    free: int,
    carried: tuple[Array, Array] | None = None,
    whitened: Array | None = None,
    size: float = np.inf,
) -> SmoothPart:
    """The smooth part of residuals (N, k) whose noise has covariances (N, k, k).

    Parameters
    ----------
    free : how many of the lowest polynomials a body that nothing acts on may have
    carried : instead of the covariances: what each of m unit noises of a sample adds to its residual, (N, k, m), and
        to all that come after it, (N, k, m)
    whitened : (N, c) residuals in units of white noise, by which the spectrum of the noise is known; None: it is white
    size : of what the residuals are of, in their unit: what is above their slow part is noise up to a twentieth of it

    Examples
    --------
    >>> times, noise = np.linspace(0.0, 1.0, 40), np.tile(1e-4 * np.eye(1), (40, 1, 1))
    >>> drift = sp.auditing.smooth_part(times, times[:, None] ** 2, noise, 1)
    >>> drift.ratio > 1.0  # more than noise of 0.01
    True
    """
    lowest = whole_argument(free, "free", 0)
    highest = int(min(_HIGHEST, max(lowest, len(times) // _SAMPLES_EACH)))
    basis = polynomials(times, highest)[:, lowest:]
    parts = basis.T @ residuals
    # Noise that is independent from sample to sample.
    if carried is None:
        spread = np.einsum("np,nq,nij->piqj", basis, basis, covariances)
    else:
        check_pair(carried, "carried", "two arrays")
        own, further = (finite_array(part, "carried", (*residuals.shape, None)) for part in carried)
        after = np.cumsum(basis[::-1], axis=0)[::-1] - basis
        of_each = np.einsum("np,nim->npim", basis, own) + np.einsum("np,nim->npim", after, further)
        spread = np.einsum("npim,nqjm->piqj", of_each, of_each)
    power, known = np.ones(len(times)), 1e9
    # A smooth curve has cosines of all orders, and no polynomials above its own.
    slow = polynomials(times, highest)
    rough = residuals - slow @ (slow.T @ residuals)
    if whitened is not None and np.sqrt((rough**2).sum() / len(times)) <= _MOST_NOISE * size:
        power = noise_spectrum(whitened - slow @ (slow.T @ whitened), highest)
        # Numbers that the power of the noise is known from (Satterthwaite 1946).
        above = power[highest + 1 :]
        known = whitened.shape[1] * above.sum() ** 2 / (above**2).sum()
    deviations = np.sqrt(power[lowest : highest + 1])
    spread = spread * deviations[:, None, None, None] * deviations[None, None, :, None]
    count = parts.size
    matrix = spread.reshape(count, count)
    square = float(parts.ravel() @ np.linalg.solve(matrix, parts.ravel()))
    axes = residuals.shape[1]
    slowest = np.linalg.eigvalsh(np.linalg.inv(matrix)[:axes, :axes])[0]
    limit = _UNSURE * count * float(f.isf(_CHANCE, count, known))
    return SmoothPart(
        values=basis @ parts,
        ratio=square / limit,
        noise=float(np.sqrt(np.trace(matrix) / len(times))),
        colour=float(power.mean()),
        least=basis[:, 0] * float(np.sqrt(limit / slowest)),
    )
