"""Fourier series through even samples, and the channels of a body from its inertia."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from shapephase.errors import SingularInertiaError
from shapephase.integrator._fourier import fourier_parts
from shapephase.integrator._spectral_error import inverted

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


def test_channels_against_fifty_digits():
    """Of tensors of condition numbers up to 1e9, which magnify rounding by as much."""
    rng = np.random.default_rng(4)
    for power in range(10):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        tensor = axes * 10.0 ** np.array([0.0, -0.5 * power, -1.0 * power]) @ axes.T
        tensor, momentum = 0.5 * (tensor + tensor.T), rng.normal(size=3)
        found = inverted(tensor[None], momentum[None], np.zeros(1))[0]
        with mpmath.workdps(50):
            exact = mpmath.matrix(tensor.tolist()) ** -1
            drift = exact * mpmath.matrix(momentum.tolist())
            entries = [exact[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))]
            whole = np.array([float(one) for one in [*entries, *drift]])
        limit = 8.0 * EPS * 10.0**power * np.array([np.abs(whole[:6]).max()] * 6 + [np.abs(whole[6:]).max()] * 3)
        assert (np.abs(found - whole) <= limit).all()


@pytest.mark.parametrize("least", [0.0, -1e-3, 1e-13, np.nan])
def test_no_channels_of_a_tensor_that_is_none(least: float):
    """Singular, indefinite with a positive trace, nearly singular, or no number; among good ones."""
    tensors = np.tile(np.diag([1.0, 2.0, 2.5]), (5, 1, 1))
    tensors[3] = np.diag([10.0, 1.0, -2.0]) if least == -1e-3 else np.diag([1.0, 1.0, least])
    with pytest.raises(SingularInertiaError):
        inverted(tensors, np.zeros((5, 3)), np.arange(5.0))
