"""The slow part of residuals: what polynomials of low order take of them, and whether noise alone explains it.

Causes of a drift act over many samples, and noise does not. The first polynomials that are orthogonal on the samples
hold nearly all of the first and little of the second.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.fft import dct
from scipy.special import digamma
from scipy.stats import f

from ..arrays import Array, Mask
from ..display import frozen

_HIGHEST = 12  # order of the polynomials, the samples allowing
_SAMPLES_EACH = 3  # samples that a polynomial needs
_UNSURE = 1.5  # factor of a variance: the noise is itself estimated
_MOST_NOISE = 0.05  # of what residuals are of: samples of noise of 3 degrees, or worse, tell nothing
_CHANCE = 1e-6  # probability with which noise alone is taken for something else, for one residual
_MEMORIES = np.array([0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99])  # from sample to sample
# Half the powers by which Butterworth filters of two to four poles fall, used once or twice.
_SHARPNESS = (2, 3, 4, 6, 8)
_ROUNDS = 12  # of Fisher's scoring, each of which gains about two digits of an amplitude
_PLATEAU = 1.5  # lowest cut-off in units of the slow part's highest order: a third of the plateau has to be seen
_LEAKAGE = 1e-4  # of the largest power: cosines of noise that does not end where it begins
_SHOULDER = 0.01  # of the plateau: down to there the spectrum has to be that of a filter
_ALIKE = 6.6  # deviance that a number of its own takes off by chance once in a hundred
_FEWEST_ORDERS = 5.0  # of a plateau
_UNLIKE = 2.0  # mean deviance in units of that of noise; 1.3 is exceeded by chance in a thousand with 30 orders


@frozen
class SmoothPart:
    """What the first polynomials take of residuals.

    values : (N, k) that they sum up to
    ratio : its square in units of what noise alone brings, over the limit: above 1, noise does not explain it
    noise : what noise alone brings to the values, rms
    colour : mean power of the noise over that of white noise with its highest frequencies
    least : (N,) the slowest curve that is not free, as large as it has to be along every axis to exceed noise
    """

    values: Array
    ratio: float
    noise: float
    colour: float = 1.0
    least: Array = field(default_factory=lambda: np.zeros(0), repr=False)


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

    free : how many of the lowest polynomials a body that nothing acts on may have
    carried : instead of the covariances: what each of m unit noises of a sample adds to its residual, (N, k, m), and
        to all that come after it, (N, k, m)
    whitened : (N, c) residuals in units of white noise, by which the spectrum of the noise is known; None: it is white
    size : of what the residuals are of, in their unit: what is above their slow part is noise up to a twentieth of it
    """
    highest = min(_HIGHEST, max(free, len(times) // _SAMPLES_EACH))
    basis = polynomials(times, highest)[:, free:]
    parts = basis.T @ residuals
    # Noise that is independent from sample to sample.
    if carried is None:
        spread = np.einsum("np,nq,nij->piqj", basis, basis, covariances)
    else:
        own, further = carried
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
    deviations = np.sqrt(power[free : highest + 1])
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


def cosines(values: Array) -> Array:
    """Coefficients of orthonormal cosines of values (N, c) along the first axis."""
    return np.asarray(dct(values, axis=0, norm="ortho"), dtype=np.float64)


def noise_spectrum(whitened: Array, slow: int) -> Array:
    """Power of the noise at each order of cosines, relative to that of white noise: (N,).

    It is that of the likeliest of three families above the slow part (Whittle 1953), with log(count) for each number:
    white noise; noise with memory, x' = a x + white, whose highest frequencies are those of the differences of samples;
    and white noise below a cut-off, if the powers there scatter as those of noise do.

    whitened : (N, c) residuals in units of white noise
    slow : orders of cosines that may be no noise
    """
    count, columns = whitened.shape
    power = (cosines(whitened) ** 2).mean(axis=1)
    orders = np.arange(count)
    seen = orders > slow
    if seen.sum() < 2 or columns == 0:
        return np.ones(count)
    memory = _MEMORIES[:, None]
    spectra = (1.0 + memory) ** 2 / (1.0 - 2.0 * memory * np.cos(np.pi * orders / count) + memory**2)
    penalties = np.minimum(np.arange(len(memory)), 1.0)
    filtered, _ = _below_cut_offs(power, seen, columns, _PLATEAU * slow)
    spectra = np.vstack([spectra, filtered])
    penalties = np.concatenate([penalties, np.full(len(filtered), 2.0)])
    deviance = _deviance(power, spectra, seen, columns) + penalties * np.log(columns * seen.sum())
    # Few samples do not tell memories apart: the one that brings most to the slow part counts.
    alike = np.flatnonzero(deviance <= deviance.min() + _ALIKE)
    return spectra[alike[int(np.argmax(spectra[alike, : slow + 1].sum(axis=1)))]]


def cut_off(whitened: Array, free: int) -> float | None:
    """Order of cosines at which the spectrum of residuals (N, c) ends; None where it is not that of filtered noise.

    free : orders of cosines that were taken off
    """
    count, columns = whitened.shape
    power = (cosines(whitened) ** 2).mean(axis=1)
    seen = np.arange(count) > free
    spectra, cuts = _below_cut_offs(power, seen, columns, _FEWEST_ORDERS)
    return None if not len(cuts) else float(cuts[int(np.argmin(_deviance(power, spectra, seen, columns)))])


def _deviance(power: Array, spectra: Array, seen: Mask, columns: int) -> Array:
    """-2 log likelihood of spectra (families, N): (families,)."""
    return columns * (np.log(spectra[:, seen]) + power[seen] / spectra[:, seen]).sum(axis=1)


def _below_cut_offs(power: Array, seen: Mask, columns: int, lowest: float) -> tuple[Array, Array]:
    """The likeliest spectra of noise below each cut-off, and these, without those about which powers do not scatter."""
    orders = np.arange(len(power))
    cuts = np.tile(np.geomspace(max(lowest, 1.0), max(len(power), lowest + 1.0), 24), len(_SHARPNESS))
    sharpness = np.repeat(_SHARPNESS, len(cuts) // len(_SHARPNESS))
    shapes = 1.0 / (1.0 + (orders / cuts[:, None]) ** (2 * sharpness[:, None]))
    floor = max(1.0, _LEAKAGE * float(power[seen].max()))
    spectra = floor + _amplitudes(shapes[:, seen], power[seen], floor)[:, None] * shapes
    alike = np.array([_is_noise(power[seen], spectrum[seen], columns) for spectrum in spectra])
    return spectra[alike], cuts[alike]


def _is_noise(power: Array, spectrum: Array, columns: int) -> bool:
    """True where powers, each the mean of so many squares, scatter about a spectrum's plateau as those of noise."""
    inside = spectrum >= _SHOULDER * spectrum[0]
    ratio = np.maximum(power[inside] / spectrum[inside], np.finfo(float).tiny)
    expected = np.log(0.5 * columns) - digamma(0.5 * columns)
    return bool((ratio - np.log(ratio) - 1.0).mean() <= _UNLIKE * expected)


def _amplitudes(shapes: Array, power: Array, floor: float) -> Array:
    """The likeliest a of spectra floor + a shape, at least 0: (families,)."""
    found = np.maximum((power * shapes).sum(axis=1) / (shapes**2).sum(axis=1), 0.0)
    for _ in range(_ROUNDS):
        weights = (shapes / (floor + found[:, None] * shapes)) ** 2
        ratios = (power - floor) / np.maximum(shapes, 1e-300)
        found = np.maximum((ratios * weights).sum(axis=1) / weights.sum(axis=1), 0.0)
    return found
