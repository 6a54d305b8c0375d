"""Bars cover the truth as often as they say: noisy recordings of a known motion, each with bars of its own."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.stats import binom, chi2

import shapephase as sp
from shapephase import so3
from support.long_runs import full_but

_NOISE = np.radians(0.3)
_RATE = 60.0
_LEVEL = 0.95


def swing(name: str) -> sp.ShapePath:
    """A cycle of a second, all joints in a range of their own, at rest in its second half."""
    body = sp.load_body(name)
    rng = np.random.default_rng(11)
    times = np.arange(61) / _RATE
    share = np.clip(2.0 * times, 0.0, 1.0)[:, None]
    lift = np.sin(np.pi * share) ** 2
    phases = rng.uniform(0.0, 6.0, body.n_shape)
    samples = lift * (0.6 * rng.normal(size=body.n_shape) + 0.5 * np.sin(2.0 * np.pi * share + phases))
    samples[-1] = samples[0]
    return sp.ShapePath.spline(times, samples, periodic=True)


@pytest.mark.parametrize(("name", "draws"), full_but(product(["cat", "astronaut"], [60, 400]), ("cat", 60)))
def test_a_recorded_cycle_with_noise(name: str, draws: int):
    """Each component of the holonomy's error within two bars, and its chi-square, in 95 % of the recordings."""
    body, path = sp.load_body(name), swing(name)
    times = path.breaks
    exact = path.shape(times[:-1])
    truth = sp.holonomy(body, path)
    rng = np.random.default_rng(4)
    errors, covariances = np.empty((draws, 3)), np.empty((draws, 3, 3))
    for row in range(draws):
        noisy = exact + _NOISE * rng.normal(size=exact.shape)
        recorded = sp.ShapePath.spline(times, np.concatenate([noisy, noisy[:1]]), periodic=True)
        motion = sp.reconstruct(sp.articulated(body, recorded), np.zeros(3), tolerance=1e-6)
        errors[row] = so3.log(sp.split(motion).holonomy @ truth.T)
        covariances[row] = sp.uncertainty(motion, joints=_NOISE).holonomy
    deviations = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    squares = np.einsum("na,na->n", errors, np.linalg.solve(covariances, errors[..., None])[..., 0])
    # What so many draws leave open, with a chance of one in a thousand; 92 to 98 % of 400.
    least, most = binom.ppf([5e-4, 1.0 - 5e-4], draws, _LEVEL) / draws
    inside = np.mean(np.abs(errors) < 1.959964 * deviations, axis=0)
    assert np.all((inside >= least) & (inside <= most)), inside
    assert least <= np.mean(squares < chi2.ppf(_LEVEL, 3)) <= most
    # The bar's own length beside the scatter, which is known to one in the root of twice the draws.
    scatter = np.sqrt(np.mean(errors**2, axis=0))
    allowed = max(0.15, 3.3 / np.sqrt(2.0 * draws))
    np.testing.assert_allclose(deviations.mean(axis=0), scatter, rtol=allowed)
