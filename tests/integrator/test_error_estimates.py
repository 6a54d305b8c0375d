"""The parts of an error estimate: rounding that grows with the motion, and the tail of a spectrum."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.integrator import _spectral_error
from shapephase.integrator._spectral_error import estimate_spectra, estimate_tail, spectral_norms
from shapephase.integrator.integrate import stepped_rotation
from shapephase.integrator.stepped import SteppedRotation
from support.independent import apart

EPS = np.finfo(float).eps
MOMENTS = np.diag([1.0, 2.0, 3.0])


def next_to_the_separatrix(momenta: np.ndarray, duration: float) -> SteppedRotation:
    """A rigid body given by functions, so that it is stepped, not solved in closed form."""
    deformation = sp.prescribed(
        lambda t: np.broadcast_to(MOMENTS, (len(t), 3, 3)), lambda t: np.zeros((len(t), 3)), duration
    )
    return stepped_rotation(deformation.sampler(), momenta, 1e-7)


def test_rounding_is_amplified_as_the_motion_amplifies_errors():
    """Momenta that differ by rounding alone: how far their motions part is the least that rounding contributes.

    The body spins about its middle axis, where errors grow exponentially; what rounding would contribute without that
    growth is far less than what is seen.
    """
    nearby = np.array([1e-3, 1.0, 2e-3]) * (1.0 + EPS * np.random.default_rng(0).integers(-1, 2, (20, 3)))
    solution = next_to_the_separatrix(nearby, 60.0)
    spread = max(apart(end, solution.end[0]) for end in solution.end)
    steps = solution.quaternions.shape[1]
    chords = np.linalg.norm(np.diff(solution.quaternions, axis=1), axis=-1)
    turned_by = 2.0 * chords.sum(axis=1)
    unamplified = EPS * (8.0 + 2.0 * np.sqrt(steps) + 5.0 * turned_by)
    assert solution.amplification.min() > 1e3
    assert np.all(spread > 5.0 * unamplified)
    assert np.all(solution.rounding_error >= spread)
    assert np.all(solution.rounding_error >= 8.0 * EPS * solution.amplification)
    assert np.all(solution.error_estimate >= solution.rounding_error + solution.stepping_error)


def test_rounding_alone_is_small_where_errors_do_not_grow():
    """About the axis of the largest moment errors grow only slowly, and rounding is some hundred units."""
    solution = next_to_the_separatrix(np.array([[0.0, 0.0, 1.0]]), 30.0)
    assert solution.rounding_error[0] < 1e-13


@pytest.mark.parametrize("degree", [20, 33, 64])
@pytest.mark.parametrize("decay", [0.2, 0.4, 0.6])
def test_the_tail_is_the_largest_of_its_last_tenth(degree: int, decay: float):
    """A series whose last coefficient vanishes by symmetry has the tail of the one before it."""
    norms = np.exp(-decay * np.arange(degree + 1.0))
    whole = estimate_tail(norms.tolist(), 0.0)
    for missing in range(1, max(2, degree // 10)):
        symmetric = norms.copy()
        symmetric[-missing:] = 0.0
        estimate = estimate_tail(symmetric.tolist(), 0.0)
        if estimate.decay == np.inf:  # the tail has sunk into rounding
            continue
        # What is left out is at least the last coefficient that is there, and no less than without the zeros.
        assert estimate.error >= norms[-1 - missing] * np.exp(-decay)
        assert estimate.error >= 0.9 * whole.error * np.exp(-decay * missing)
        assert not estimate.at_rounding


def test_a_single_small_coefficient_is_no_convergence():
    """Of a spectrum that does not fall at all only the last coefficient is zero."""
    norms = [1.0] * 40 + [0.0]
    estimate = estimate_tail(norms, 0.0)
    assert estimate.error >= 1.0
    assert not estimate.converging
    assert not estimate.at_rounding


@pytest.mark.parametrize("degree", [10, 15, 30, 80])
def test_both_estimates_of_a_spectrum_agree(degree: int, rng):
    """The one in plain numbers and the one on arrays are the same formula."""
    for _ in range(50):
        norms = np.exp(-rng.uniform(0.0, 1.0) * np.arange(degree + 1.0)) * rng.uniform(0.0, 1.0, degree + 1)
        norms[-int(rng.integers(1, 3)) :] *= rng.integers(0, 2)
        plain, arrays = (
            estimate_tail(norms.tolist(), EPS),
            estimate_spectra(np.stack([norms, norms], axis=1)[None], np.array([degree]), np.array([EPS])),
        )
        errors, decay, converging = arrays.table[0, :2], arrays.decay[0], arrays.table[0, 3]
        assert plain.error == pytest.approx(errors[0], rel=1e-12)
        assert plain.error == pytest.approx(errors[1], rel=1e-12)
        assert plain.decay == pytest.approx(decay, rel=1e-12)
        assert plain.converging == converging
        assert plain.largest == arrays.inverse_norm[0]


def test_norms_of_many_spectra_are_those_of_each(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch):
    """Frobenius norm of I^-1, whose entries off the diagonal count twice, and norm of I^-1 L_o, in parts too."""
    series = rng.normal(size=(11, 4, 9))
    monkeypatch.setattr(_spectral_error, "_NUMBERS_AT_ONCE", 80)
    found = spectral_norms(series)
    xx, yy, zz, yz, xz, xy = np.moveaxis(series, 2, 0)[:6]
    inverse = np.stack([np.stack(row, axis=-1) for row in ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))], axis=-1)
    assert found[..., 0] == pytest.approx(np.linalg.norm(inverse, axis=(2, 3)), rel=1e-14)
    assert found[..., 1] == pytest.approx(np.linalg.norm(series[..., 6:], axis=2), rel=1e-14)
