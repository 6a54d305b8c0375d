"""Spectrum of the noise of residuals, from what is above their slow part: white, correlated, or filtered."""

from __future__ import annotations

import numpy as np
from scipy.fft import dct

from ..arrays import Array

_MEMORIES = np.array([0.0, 0.2, 0.4, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.98, 0.99])  # from sample to sample
_SHARPNESS = (2, 4, 8)  # half the powers of frequency by which Butterworth filters of two to eight poles fall
_ROUNDS = 12  # of Fisher's scoring, each of which gains about two digits of an amplitude
_PLATEAU = 1.5  # lowest cut-off in units of the slow part's highest order: a third of the plateau has to be seen


def noise_spectrum(whitened: Array, slow: int) -> Array:
    """Power of the noise at each order of cosines, relative to that of white noise: (N,).

    It is that of the likeliest of three families above the slow part (Whittle 1953), with log(count) for each number:
    white noise; noise with memory, x' = a x + white, whose highest frequencies are those of the differences of samples;
    and white noise below a cut-off.

    Parameters
    ----------
    whitened : (N, c) residuals in units of white noise
    slow : orders of cosines that may be no noise
    """
    count, columns = whitened.shape
    power = (dct(whitened, axis=0, norm="ortho") ** 2).mean(axis=1)
    orders = np.arange(count)
    seen = orders > slow
    if seen.sum() < 2 or columns == 0:
        return np.ones(count)
    memory = _MEMORIES[:, None]
    remembered = (1.0 + memory) ** 2 / (1.0 - 2.0 * memory * np.cos(np.pi * orders / count) + memory**2)
    cuts = np.geomspace(max(_PLATEAU * slow, 1.0), count, 16)
    shapes = np.vstack([1.0 / (1.0 + (orders / cuts[:, None]) ** (2 * sharp)) for sharp in _SHARPNESS])
    filtered = 1.0 + _amplitudes(shapes[:, seen], power[seen])[:, None] * shapes
    spectra = np.vstack([remembered, filtered])
    penalties = np.concatenate([[0.0], np.ones(len(memory) - 1), 2.0 * np.ones(len(filtered))])
    fit = columns * (np.log(spectra[:, seen]) + power[seen] / spectra[:, seen]).sum(axis=1)
    return spectra[int(np.argmin(fit + penalties * np.log(columns * seen.sum())))]


def _amplitudes(shapes: Array, power: Array) -> Array:
    """The likeliest a of spectra 1 + a shape, at least 0: (families,)."""
    found = np.maximum((power * shapes).sum(axis=1) / (shapes**2).sum(axis=1), 0.0)
    for _ in range(_ROUNDS):
        weights = (shapes / (1.0 + found[:, None] * shapes)) ** 2
        found = np.maximum(
            ((power - 1.0) / np.maximum(shapes, 1e-300) * weights).sum(axis=1) / weights.sum(axis=1), 0.0
        )
    return found
