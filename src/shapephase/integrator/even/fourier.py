"""Fourier series through samples at even times."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...arrays import Array

# Samples: for so many a product of matrices takes less time than a fast transform, which prime numbers delay most.
_FEW_SAMPLES = 170


def fourier_parts(values: Array) -> Array:
    """The discrete Fourier transform of samples: (N, k) -> (N // 2 + 1, 2 k), real parts, then imaginary ones."""
    count, channels = values.shape
    if count <= _FEW_SAMPLES:
        return (_transform(count) @ values).reshape(-1, 2 * channels)
    found = np.fft.rfft(values, axis=0)
    return np.concatenate([found.real, found.imag], axis=1)


@lru_cache(maxsize=32)
def _transform(count: int) -> Array:
    """cos(2 pi j k / count) and -sin(2 pi j k / count), a row of each in turn: (2 (count // 2 + 1), count)."""
    # However large the product is, no large angle is rounded.
    angles = (2.0 * np.pi / count) * (np.outer(np.arange(count // 2 + 1), np.arange(count)) % count)
    return np.stack([np.cos(angles), -np.sin(angles)], axis=1).reshape(-1, count)
