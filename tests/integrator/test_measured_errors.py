"""What the coarser marches are made to show: the errors of steps, of series and of rounding, where these are known."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.random_motions import harmonics
from scipy.integrate import DOP853

import shapephase as sp
from shapephase import so3
from shapephase.chebyshev import nodes_on, values_to_coefficients
from shapephase.integrator._last_terms import perturbed_series
from shapephase.integrator._refinement import Errors, Refinement
from shapephase.integrator._spectral_error import Channels
from shapephase.integrator.even.even_sampling import EvenSampler
from shapephase.integrator.fast.estimate_constants import DENSE_SHARE
from shapephase.integrator.integrate import Integration
from shapephase.integrator.interpolant import Interpolant
from shapephase.integrator.steps import step_loop
from shapephase.integrator.steps.error_propagator import growth_and_rounding, largest_growth
from shapephase.integrator.steps.step_control import StepRequirements
from support.compiler import needs_compiler
from support.independent import random_rotation
from support.long_runs import full_but

EPS = np.finfo(float).eps


def about_one_axis(coefficients: np.ndarray, edges: np.ndarray) -> Interpolant:
    """A drift about the third axis alone, by Chebyshev series (P, n) on panels: the angle is its integral."""
    whole = np.zeros((*coefficients.shape, 9))
    whole[:, 0, :3] = 1.0
    whole[:, :, 8] = coefficients
    return Interpolant(edges, whole, 1, 0)


def angles(interpolant: Interpolant, steps: np.ndarray) -> np.ndarray:
    """Turned at the ends of the steps, the other way than the drift (K + 1,) [rad]."""
    edges, places = interpolant.edges, []
    for panel, count in enumerate(steps):
        places.append(edges[panel] + (edges[panel + 1] - edges[panel]) * np.arange(count) / count)
    times = np.append(np.concatenate(places), edges[-1])
    total = []
    for time in times:
        whole = 0.0
        for left, right, series in zip(edges[:-1], edges[1:], interpolant.coefficients[:, :, 8], strict=True):
            until = min(max(time, left), right)
            function = np.polynomial.Chebyshev(series, [left, right])
            whole -= function.integ(lbnd=left)(until)
        total.append(whole)
    return np.array(total)


def turned_by(quaternions: np.ndarray) -> np.ndarray:
    return 2.0 * np.arctan2(quaternions[:, 2], quaternions[:, 3])


# ---- Steps ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("width", [0.12, 0.25, 0.5])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("seed", range(6))
def test_the_error_of_steps_is_within_its_estimate_and_not_far_below(tolerance: float, width: float, seed: int):
    """About one axis the truth is an integral; steps are refined as for a motion, until they are good enough."""
    rng = np.random.default_rng(seed)
    edges, degree = np.array([0.0, 0.4, 1.0, 1.7]), 80
    times = nodes_on(edges[:-1], edges[1:], degree)
    heights, places = rng.normal(size=(2, 4)) * [[1.0], [0.5]] + [[0.0], [0.8]]
    hills = sum(h / (1.0 + ((times - place) / width) ** 2) for h, place in zip(heights, places, strict=True))
    interpolant = about_one_axis(hills @ values_to_coefficients(degree).T, edges)
    requirements = StepRequirements.from_interpolant(interpolant, 0.0, tolerance)
    estimate, finer = np.inf, 1.0
    while estimate > tolerance:
        steps = requirements.whole_steps(finer * requirements.plan(tolerance))
        record = step_loop.integrate_steps_at_rest(interpolant, None, steps)
        (estimate,) = requirements.stepping_error(steps, record.stepping)
        finer *= 1.1
    error = np.abs(so3.wrap(turned_by(record.quaternions[0]) - angles(interpolant, steps))).max()
    assert error <= estimate + 20.0 * EPS * len(record.quaternions[0])
    assert estimate <= 1000.0 * error + 0.02 * tolerance


@pytest.mark.parametrize("fast", ["0", "1"])
@pytest.mark.parametrize("steps", [[4, 8], [3, 1], [2, 5], [33, 7]])
def test_steps_at_rest_are_as_far_from_twice_as_many_as_their_difference_says(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, steps: list[int], fast: str
):
    """About one axis an angle is a sum by the formula's weights; the number is the largest difference of two."""
    if fast == "1":
        request.getfixturevalue("fast")
    else:
        monkeypatch.setenv("SHAPEPHASE_FAST", "0")
    rng = np.random.default_rng(3)
    # So slow that what a step makes of its stages is their sum, but for the angle's square.
    series = 1e-3 * rng.normal(size=(2, 20)) * np.exp(-0.3 * np.arange(20.0))
    record = step_loop.integrate_steps_at_rest(about_one_axis(series, np.arange(3.0)), None, np.array(steps))

    def by_weights(times_finer: int) -> np.ndarray:
        turns = []
        for panel, count in enumerate(times_finer * np.array(steps)):
            stages = 2.0 * (np.arange(count)[:, None] + DOP853.C[:12]) / count - 1.0
            turns += (np.polynomial.chebyshev.chebval(stages, series[panel]) @ DOP853.B / count).tolist()
        return np.cumsum(turns)

    gap = np.abs(by_weights(1) - by_weights(2)[1::2])
    assert record.stepping[0] == pytest.approx(gap.max(), rel=1e-5)
    assert record.truncation[0] == 0.0


# ---- Series ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [5, 8, 10, 15, 20, 30])
@pytest.mark.parametrize("pole", [0.3, 0.6, 1.0, 2.0])
@pytest.mark.parametrize("shift", [0.0, 0.4, 1.0])
def test_a_perturbed_series_is_as_far_off_as_the_series_itself(degree: int, pole: float, shift: float):
    """Of a function with a pole near the panel: its integral, as the nodes give it, against the closed form."""
    left, right = np.array([0.0]), np.array([2.0])

    def drift(t: np.ndarray) -> np.ndarray:
        return 1.0 / ((t - 1.0 - shift) ** 2 + pole**2)

    series = values_to_coefficients(degree) @ drift(nodes_on(left, right, degree)[0])
    interpolant = about_one_axis(series[None], np.array([0.0, 2.0]))
    steps = np.array([4 * degree])
    other = perturbed_series(interpolant.coefficients, np.array([degree]), np.array([2.0]), 0.0)
    record = step_loop.integrate_steps_at_rest(interpolant, other, steps)
    times = np.linspace(0.0, 2.0, steps[0] + 1)
    truth = -(np.arctan((times - 1.0 - shift) / pole) - np.arctan((-1.0 - shift) / pole)) / pole
    error = np.abs(so3.wrap(turned_by(record.quaternions[0]) - truth)).max()
    assert error <= record.truncation[0] + record.stepping[0] + 1e-13
    assert np.array_equal(other[:, : degree - 1], interpolant.coefficients[:, : degree - 1])


def test_what_is_rounding_is_not_taken_for_the_beginning_of_more():
    """A tail that does not fall, but is 1e-16 of the rest, is changed by its own size and no more."""
    series = np.exp(-2.0 * np.arange(31.0)) + 1e-16 * np.random.default_rng(0).normal(size=31)
    interpolant = about_one_axis(series[None], np.array([0.0, 1.0]))
    other = perturbed_series(interpolant.coefficients, np.array([30]), np.array([1.0]), 0.0)
    assert np.abs(other - interpolant.coefficients).max() <= 1e-15


# ---- Transforms -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("degree", [4, 10, 15, 30, 60, 80])
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
    channels = Channels(lambda t: (np.broadcast_to(inertia, (len(t), 3, 3)), np.zeros((len(t), 3))))
    sampler = EvenSampler(channels, 1.0, 20, oscillations)
    assert sampler.refine(1.0, tolerance)
    coefficients = sampler.interpolant().coefficients
    constant = np.tile([1.0, 0.5, 1.0 / 3.0], (len(coefficients), 1))
    count = coefficients.shape[1] * len(coefficients)
    np.testing.assert_allclose(coefficients[:, 0, :3], constant, rtol=0, atol=EPS * count)
    # The rows of the transform add up to zero but for the rounding of each of their numbers.
    assert np.abs(coefficients[:, 1:]).sum(axis=1).max() < EPS * coefficients.shape[1]


@needs_compiler
@pytest.mark.parametrize("number", full_but([269, 719, 899], 719, 899))
def test_rounding_does_not_add_up_over_loops(number: int):
    """The satellite, fifteen to 24 times one loop: errors of 2e-13 once stood beside estimates of 6e-14."""
    from benchmarks.estimates import judged

    run = judged("harmonics", 3, 60.0, number)
    assert run.outcome == "done"
    assert run.above <= 1.0
    assert run.error < 2e-14


# ---- Rounding -------------------------------------------------------------------------------------------------------


def growing(rate: float) -> np.ndarray:
    """Propagators whose singular values are s, 1, 1/s with s growing evenly to exp(rate): (1, M, 3, 3)."""
    frame, found = random_rotation(4), []
    for share in np.arange(step_loop.CHECKPOINTS) / (step_loop.CHECKPOINTS - 1):
        size = np.exp(rate * share)
        found.append(frame @ np.diag([size, 1.0, 1.0 / size]) @ frame.T)
    return np.array(found)[None]


@pytest.mark.parametrize("rate", [0.0, 1.0, 5.0])
def test_amplification_is_the_largest_singular_value_from_one_time_to_a_later_one(rate: float):
    propagators = growing(rate)
    largest = 1.0
    for later in range(step_loop.CHECKPOINTS):
        for earlier in range(later):
            between = propagators[0, later] @ np.linalg.inv(propagators[0, earlier])
            largest = max(largest, np.linalg.svd(between, compute_uv=False)[0])
    # The sum of squares cancels down to one where nothing grows: then only half the digits are left.
    assert largest_growth(propagators)[0] == pytest.approx(largest, rel=1e-12 if rate else 1e-6)


def test_growth_that_shrinks_again_counts_from_the_lowest_to_the_highest():
    """Backwards in time the same matrices shrink first: what grows is told from what shrinks."""
    propagators = growing(3.0)
    falls = np.stack([propagators[0, -1 - k] for k in range(step_loop.CHECKPOINTS)])[None]
    turned_round = falls @ np.linalg.inv(falls[:, :1])
    assert largest_growth(turned_round)[0] == pytest.approx(np.exp(3.0), rel=1e-12)


def test_rounding_grows_from_where_it_is_made():
    """What is made late grows less than what is made early: the sum is between both."""
    propagators, count = growing(6.0), 70
    half = 0.5 * np.linspace(0.0, 7.0, count + 1)
    quaternions = np.stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=-1)[None]
    growth, (rough,) = growth_and_rounding(propagators, quaternions, np.inf)
    _, (found,) = growth_and_rounding(propagators, quaternions, 0.0)
    # The growth of what is made at a share of the way is exp(6 (1 - share)); its integral is a sixth.
    evenly = growth[0] / 6.0
    assert EPS * (7.0 * evenly) < found < rough
    assert found < 0.8 * rough


@pytest.mark.parametrize("turn", [1.0, 10.0, 100.0])
def test_without_growth_rounding_is_by_steps_and_turns(turn: float):
    half = 0.5 * np.linspace(0.0, turn, 1001)
    quaternions = np.stack([0.0 * half, 0.0 * half, np.sin(half), np.cos(half)], axis=-1)[None]
    growth, (found,) = growth_and_rounding(np.empty((1, 0, 3, 3)), quaternions, 0.0)
    assert growth[0] == 1.0
    assert EPS * turn < found < EPS * (turn + 2.0 * np.sqrt(1000.0) + 10.0)


def test_a_body_at_rest_and_a_momentum_of_zero_are_one_motion():
    """A momentum so small that it turns nothing takes the other way through the steps."""
    body = sp.load_body("cat_two_halves")
    path = sp.ShapePath.fourier(np.zeros(3), np.zeros((3, 1)), np.full((3, 1), 0.3), 1.0)
    deformation = sp.articulated(body, path)
    rest = sp.reconstruct(deformation, np.zeros(3), tolerance=1e-11)
    moving = sp.reconstruct(deformation, [0.0, 0.0, 1e-18], tolerance=1e-11)
    gap = so3.angle(rest.final_attitude.T @ moving.final_attitude)
    assert gap <= rest.error_estimate + moving.error_estimate


class _SaysOfItself:
    """A sampler of which only its own error is asked."""

    def error(self, momentum: float) -> float:
        return 1e-9 * (1.0 + momentum)


@pytest.mark.parametrize("rounding", [0.0, 0.3, 0.85])
def test_what_is_above_the_tolerance_is_made_finer(rounding: float):
    """Samples or steps, however both share the error: else the next round would be the same."""
    tolerance, before = 1e-9, Refinement(2e-9, 1.0, 1.0)
    share, one = np.linspace(0.0, 1.0, 4001), np.ones(4001)
    rest = (1.0 - rounding) * tolerance
    errors = Errors(
        estimate=(1.0 + DENSE_SHARE) * tolerance * one, sampling=share * rest, stepping=(1.0 - share) * rest,
        rounding=rounding * tolerance * one, amplification=one, distance=1e-6 * one, order=8.0, rounded_up=1.0,
    )  # fmt: skip
    integration = Integration(_SaysOfItself(), np.array([[0.0, 0.0, 1.0]]), tolerance, ceiling=1.0, refinement=before)
    after = integration.refined(errors)
    assert ((after.finer > before.finer) | (after.sampling_target < _SaysOfItself().error(1.0))).all()


def test_a_loop_with_next_to_no_momentum_is_within_its_estimate():
    """One harmonic, 22 times, whose errors cancel alike in steps and in pairs of them: against much finer steps."""
    rng = np.random.default_rng((5, 32))
    trial = harmonics(32, rng)
    moment = float(np.trace(trial.body.locked_inertia(trial.path.shape(0.0)))) / 3.0
    momentum = rng.normal(size=3) * 10.0 ** rng.uniform(-4.0, -1.0) * moment / trial.path.duration
    loop = sp.articulated(trial.body, trial.path)
    motion, finer = (sp.reconstruct(loop, momentum, tolerance=tolerance) for tolerance in (trial.tolerance, 1e-11))
    error = so3.angle(so3.transpose(finer.final_attitude) @ motion.final_attitude)
    assert error <= motion.error_estimate
