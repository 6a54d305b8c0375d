"""Fourier series through even samples, beside NumPy's transform."""

from __future__ import annotations

import numpy as np
import pytest

from shapephase.integrator.even.fourier import fourier_parts

EPS = np.finfo(float).eps


@pytest.mark.parametrize("count", [1, 2, 9, 83, 170, 171, 243])
def test_parts_are_the_discrete_fourier_transform(count: int):
    """To the rounding of sums of so many numbers; samples of one harmonic have that term alone."""
    rng = np.random.default_rng(count)
    values = rng.normal(size=(count, 9))
    found, expected = fourier_parts(values), np.fft.rfft(values, axis=0)
    assert found.shape == (count // 2 + 1, 18)
    limit = 4.0 * EPS * np.sqrt(count) * np.abs(values).sum(axis=0).max()
    assert np.abs(found[:, :9] - expected.real).max() < limit
    assert np.abs(found[:, 9:] - expected.imag).max() < limit


def test_one_harmonic_has_one_term():
    count = 83
    angles = 2.0 * np.pi * (7 * np.arange(count) % count) / count
    found = fourier_parts(np.stack([np.cos(angles), np.sin(angles)], axis=1))
    rest = np.delete(found, 7, axis=0)
    assert found[7] == pytest.approx([0.5 * count, 0.0, 0.0, -0.5 * count], abs=4.0 * EPS * count)
    assert np.abs(rest).max() < 4.0 * EPS * count
