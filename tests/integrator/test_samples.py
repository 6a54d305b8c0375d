"""Samples of a deformation and their error estimates, beside closed forms, quadratures and fifty digits."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest

from shapephase import so3
from shapephase.chebyshev import nodes_on, values_to_coefficients
from shapephase.errors import AccuracyNotReached, SingularInertiaError
from shapephase.integrator import Sampler, Smoothness, stepped_rotation
from shapephase.integrator.channels import inverted
from support.independent import apart

EPS = np.finfo(float).eps
UNITY = np.eye(3)
STILL = np.zeros((1, 3))


def turning(rate, end: float, **known) -> Sampler:
    """A body of unit inertia that turns about the third axis at the rate, a function of time."""

    def evaluate(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        drift = np.zeros((len(times), 3))
        drift[:, 2] = -rate(times)
        return np.broadcast_to(UNITY, (len(times), 3, 3)), drift

    return Sampler(evaluate, Smoothness(np.array([0.0, end]), **known))


def error_of(sampler: Sampler, angle, tolerance: float) -> tuple[float, float]:
    """The largest error of a turn about the third axis at 200 times, and its estimate."""
    motion, times = stepped_rotation(sampler, STILL, tolerance), np.linspace(0.0, sampler.known.breaks[-1], 200)
    truth = so3.exp(angle(times)[:, None] * UNITY[2])
    return apart(motion.rotation(times)[0], truth), float(motion.error_estimate[0])


# ---- Channels -------------------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("moments", [[1.0, 1.0, 0.0], [10.0, 1.0, -2.0], [1.0, 1.0, 1e-13], [1.0, 1.0, np.nan]])
def test_no_channels_of_a_tensor_that_is_none(moments: list[float]):
    """Singular, indefinite with a positive trace, nearly singular, or not a number; among good ones."""
    tensors = np.tile(np.diag([1.0, 2.0, 2.5]), (5, 1, 1))
    tensors[3] = np.diag(moments)
    with pytest.raises(SingularInertiaError):
        inverted(tensors, np.zeros((5, 3)), np.arange(5.0))


# ---- Transforms -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [8, 16, 32])
def test_equal_values_at_nodes_are_one_coefficient(degree: int):
    """Beside the constant there is nothing, to the rounding of the sums of weights that are one in all."""
    found = values_to_coefficients(degree) @ np.ones(degree + 1)
    assert abs(found[0] - 1.0) <= 0.5 * (degree + 1) * EPS
    # Of the others the weights cancel: their absolute values add up to 1.3 at most.
    assert np.abs(found[1:]).max() <= 0.65 * (degree + 1) * EPS


@pytest.mark.parametrize("oscillations", [1.0, 4.0, 12.0])
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_equal_samples_of_a_loop_are_one_coefficient(oscillations: float, tolerance: float):
    """What is constant is far larger than what is not, and its rounding would be repeated in every loop."""
    inertia = np.diag([1.0, 2.0, 3.0])
    known = Smoothness(np.array([0.0, 20.0]), oscillations=oscillations, loops=20, smooth_loop=True)
    sampler = Sampler(lambda t: (np.broadcast_to(inertia, (len(t), 3, 3)), np.zeros((len(t), 3))), known)
    coefficients = sampler.samples(1.0, tolerance).interpolant.coefficients
    constant = np.tile([1.0, 0.5, 1.0 / 3.0], (len(coefficients), 1))
    np.testing.assert_allclose(coefficients[:, 0, :3], constant, rtol=0, atol=EPS * coefficients.shape[1])
    assert np.abs(coefficients[:, 1:]).sum(axis=1).max() < EPS * coefficients.shape[1]


# ---- Estimates ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pole", [0.1, 0.3, 0.6, 1.0, 2.0])
@pytest.mark.parametrize("shift", [0.0, 0.4, 1.0])
def test_series_cut_at_any_degree_are_within_their_estimates(pole: float, shift: float):
    """Of a rate with a pole near the panels, in closed form; at tolerances from 1e-4 to 1e-12."""
    ratios = []
    for tolerance in 10.0 ** np.arange(-4.0, -13.0, -1.0):
        error, estimate = error_of(
            turning(lambda t: 1.0 / ((t - 1.0 - shift) ** 2 + pole**2), 2.0, oscillations=1.0),
            lambda t: (np.arctan((t - 1.0 - shift) / pole) - np.arctan((-1.0 - shift) / pole)) / pole,
            tolerance,
        )
        assert error <= estimate <= tolerance
        ratios.append(estimate / max(error, 1e-14))
    assert np.median(ratios) < 200.0


@pytest.mark.parametrize("frequency", [1.0, 5.0, 23.0, 80.0])
@pytest.mark.parametrize("loops", [1, 7])
def test_swings_are_within_their_estimates_whatever_is_thought_of_them(frequency: float, loops: int):
    """Loops of a whole number of swings, of which too few are stated, or nothing is known."""
    w = 2.0 * np.pi * frequency
    for tolerance in (1e-4, 1e-7, 1e-10):
        for known in ({"oscillations": 1.0, "smooth_loop": True}, {"oscillations": 3.0}, {}):
            sampler = turning(lambda t: w * np.cos(w * t) + 0.3, 1.0 * loops, loops=loops, **known)
            error, estimate = error_of(sampler, lambda t: np.sin(w * t) + 0.3 * t, tolerance)
            assert error <= estimate <= tolerance


def test_the_last_terms_are_changed_and_no_others():
    """Where they are no noise; a tail of rounding is changed by its own size and no more."""
    samples = turning(lambda t: 1.0 / (1.0 + 4.0 * t**2), 2.0, oscillations=1.0).samples(0.0, 1e-6)
    series, changed = samples.interpolant.coefficients, samples.perturbed.coefficients
    moved = np.abs(changed - series).max(axis=2)
    for row, degree in enumerate(samples.panels.degrees):
        assert moved[row, degree] > 0.0
        assert not moved[row, : degree - 1].any()
    noisy = turning(lambda t: np.exp(-t), 0.5, oscillations=1.0).samples(0.0, 1e-15, strict=False)
    assert 0.0 < np.abs(noisy.perturbed.coefficients - noisy.interpolant.coefficients).max() < 1e-14


def test_noise_of_samples_is_no_reason_to_sample_more():
    """Beyond rounding a body scatters by 1e-12: it is refused at 1e-13 after few samples, and reached at 1e-9."""
    scatter = np.random.default_rng(3)

    def rate(times: np.ndarray) -> np.ndarray:
        return np.cos(times) + 1e-12 * scatter.normal(size=len(times))

    rough = turning(rate, 3.0, oscillations=2.0)
    error, estimate = error_of(rough, np.sin, 1e-9)
    assert error <= estimate <= 1e-9
    assert rough.evaluations < 400
    with pytest.raises(AccuracyNotReached):
        stepped_rotation(turning(rate, 3.0, oscillations=2.0), STILL, 1e-13)


def test_samples_that_cannot_be_denser_are_whole():
    """They give the deformation as far as it is smooth, and say why they are not as dense as they were to be."""
    ripple = turning(lambda t: np.cos(t) + 1e-5 * np.sin(1e5 * t), 2.0)
    with pytest.raises(AccuracyNotReached, match="rough"):
        ripple.samples(0.0, 1e-9)
    samples = ripple.samples(0.0, 1e-9, strict=False)
    assert "rough" in str(samples.too_rough)
    times = np.linspace(0.01, 1.99, 300)
    assert np.abs(samples.interpolant.inverse_and_drift(times)[1][:, 2] + np.cos(times)).max() < 2e-4


def test_what_is_evaluated_is_not_evaluated_again():
    """A panel that needs more gets the nodes between those it has; the same question is answered from what is known."""
    sampler, asked = turning(lambda t: np.cos(5.0 * t), 2.0, oscillations=1.0), []
    evaluate = sampler.channels._evaluate
    sampler.channels._evaluate = lambda times: asked.extend(times.tolist()) or evaluate(times)
    samples = sampler.samples(0.0, 1e-12)
    assert len(asked) == len(set(asked)) == sampler.evaluations == samples.interpolant.evaluations
    assert max(samples.panels.degrees) == 32
    assert sampler.samples(0.0, 1e-12) is samples
    assert len(asked) == sampler.evaluations


def test_panels_end_at_breaks_and_cover_the_interval():
    sampler = turning(np.cos, 4.0)
    breaks = np.array([0.0, 0.3, 1.7, 4.0])
    known = Sampler(sampler.channels._evaluate, Smoothness(breaks, oscillations=3.0)).samples(0.0, 1e-9).interpolant
    assert np.isin(breaks, known.edges).all()
    assert np.all(np.diff(known.edges) > 0.0)
    assert known.widths == pytest.approx(np.diff(known.edges))


@pytest.mark.parametrize("degree", [8, 16, 32])
def test_a_polynomial_is_what_was_sampled(degree: int, rng: np.random.Generator):
    """At any time, from panels of each degree; nodes at breaks are moved to this side of them."""
    exact = np.polynomial.Chebyshev(rng.normal(size=degree + 1) * 0.5 ** np.arange(degree + 1), [0.0, 2.0])
    found = turning(exact, 2.0, oscillations=1.0).samples(0.0, 1e-12).interpolant
    times = np.append(rng.uniform(0.0, 2.0, 100), [0.0, 2.0])
    np.testing.assert_allclose(found.inverse_and_drift(times)[1][:, 2], -exact(times), rtol=0, atol=1e-12)
    nodes = nodes_on(np.array([0.0]), np.array([2.0]), degree)
    assert np.abs(values_to_coefficients(degree) @ exact(nodes[0]) - exact.coef).max() < 40.0 * EPS
