"""Rounding measured by marches that round otherwise, where its bound would have the tolerance refused."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.estimates import judged
from benchmarks.random_motions import mixed

import shapephase as sp
from shapephase.errors import AccuracyNotReached
from shapephase.integrator import integrate
from shapephase.integrator._refinement import Errors
from shapephase.integrator.fast.estimate_constants import (
    EPS,
    LEAST_NOISE,
    LEAST_OF_BOUND,
    MEASURED_ROUNDING,
)
from shapephase.integrator.integrate import Integration
from shapephase.integrator.interpolant import Interpolant
from shapephase.integrator.sampling import FinishedSampler
from shapephase.integrator.steps.measured_rounding import SampleScatter, measured_rounding
from shapephase.integrator.steps.step_loop import integrate_steps
from support.compiler import needs_compiler

MOMENTS = np.array([1.0, 2.0, 3.5])
# Beside the unstable axis.
MOMENTUM = np.array([0.02, 2.0, 0.01])


def rigid(duration: float) -> Interpolant:
    """Of constant inertia, in panels of half a second."""
    panels = int(2.0 * duration)
    series = np.zeros((panels, 1, 9))
    series[:, 0, :3] = 1.0 / MOMENTS
    return Interpolant(np.linspace(0.0, duration, panels + 1), series, 1, 0)


@needs_compiler
@pytest.mark.parametrize("fast", ["0", "1"])
@pytest.mark.parametrize("number", [432, 3217, 8980, 9445])
def test_a_tolerance_that_the_bound_would_refuse_is_reached(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, fast: str, number: int
):
    """Of motions whose errors grow some hundred and some thousand times, in extended precision.

    In the second rounding is all that counts once it is sampled densely, and not before.
    """
    if fast == "1":
        request.getfixturevalue("fast")
    else:
        monkeypatch.setenv("SHAPEPHASE_FAST", "0")
    run = judged("mixed", 301, 60.0, number)
    assert run.outcome == "done"
    assert run.error <= run.estimate + run.bound <= run.tolerance + run.bound
    monkeypatch.setattr(integrate, "measured_rounding", lambda bound, *_: bound)
    trial = mixed(number, np.random.default_rng((301, number)))
    with pytest.raises(AccuracyNotReached, match="rounding"):
        sp.reconstruct(sp.articulated(trial.body, trial.path), trial.momentum, tolerance=trial.tolerance)


def test_rounding_that_sparse_samples_overrate_is_looked_at_again():
    """On denser ones, unless it is far too large, or samples are so dense already that they show it."""
    integration = Integration(FinishedSampler(rigid(1.0)), np.array([[0.0, 0.0, 1.0]]), 1e-12, ceiling=1.0)
    parts = [np.array([part]) for part in (1.3e-12, 1e-13, 0.0, 1.2e-12, 5.0, 1e-9)]
    here, best = Errors(*parts, order=8.0, rounded_up=1.0), np.array([np.inf])
    assert integration.first_lost(here, 1, best) is None
    assert integration.first_lost(here._replace(sampling=parts[1] / 100.0, rounding=8.0 * parts[1]), 1, best) is None
    for hopeless in (
        here._replace(sampling=parts[1] / 10.0),
        here._replace(sampling=500.0 * parts[1], rounding=1000.0 * parts[1]),
    ):
        lost = integration.first_lost(hopeless, 1, best)
        assert lost is not None
        assert lost[0] == 0
        assert "rounding" in str(lost[1])


@pytest.mark.usefixtures("fast")
def test_what_no_further_round_would_change_is_refused_at_once(monkeypatch: pytest.MonkeyPatch):
    """Samples and steps that are asked for once more in the same way give the same."""
    asked = []
    attempt = Integration.attempt
    monkeypatch.setattr(Integration, "attempt", lambda self: asked.append(self._refinement) or attempt(self))
    trial = mixed(3667, np.random.default_rng((301, 3667)))
    with pytest.raises(AccuracyNotReached, match="rounding"):
        sp.reconstruct(sp.articulated(trial.body, trial.path), trial.momentum, tolerance=trial.tolerance)
    assert len(asked) == len(set(asked)) < 4


def test_a_bound_far_below_the_tolerance_is_believed_and_no_measure_is_far_below_it():
    interpolant, steps = rigid(4.0), np.full(8, 4)
    alike = interpolant.series
    size = np.array([np.linalg.norm(MOMENTUM)])
    record = integrate_steps(interpolant, None, steps, MOMENTUM[None] / size, size)
    bound = np.array([1e-3])
    assert measured_rounding(bound, interpolant, steps, record, size, 1.01e-3 / MEASURED_ROUNDING, alike) is bound
    (found,) = measured_rounding(bound, interpolant, steps, record, size, 1e-3, alike)
    assert found == LEAST_OF_BOUND * bound[0]
    unknown = np.array([np.inf])
    assert measured_rounding(unknown, interpolant, steps, record, size, 1e-3, alike) is unknown


@pytest.mark.parametrize("panels", [1, 3, 40])
@pytest.mark.parametrize("terms", [2, 21])
def test_series_scatter_as_samples_do(panels: int, terms: int):
    """In size, panel by panel, and in direction, in which all nine channels go together."""
    rng = np.random.default_rng(3)
    # Of unit length in I^-1 and in the drift.
    way = np.array([1.0, 2.0, 2.0, 4.0, 2.0, 2.0, 0.0, 0.6, 0.8]) / np.array([6.0] * 6 + [1.0] * 3)
    unit = np.repeat([200.0 * EPS, 50.0 * EPS], [6, 3])
    sizes = 10.0 ** rng.uniform(-3.0, 0.0, panels)
    coefficients = np.zeros((panels, 30, 9))
    coefficients[:, :terms] = sizes[:, None, None] * rng.uniform(-1.0, 1.0, (panels, terms, 9))
    coefficients[:, 0] = sizes[:, None]
    interpolant = Interpolant(np.linspace(0.0, 2.0, panels + 1), coefficients, 1, 0)

    def sample(times: np.ndarray) -> np.ndarray:
        by = rng.standard_normal(len(times))[:, None] * sizes[interpolant.panel_of(times), None]
        return interpolant.series(times) + by * unit * way

    scatter = SampleScatter(interpolant, sample)
    changes = np.stack([scatter.of_series(number) for number in range(100)])
    assert not changes[:, :, terms:].any()
    # The mean square of a series over all angles.
    squares = changes**2
    found = np.sqrt((squares[:, :, 0] + 0.5 * squares[:, :, 1:].sum(axis=2)).mean(axis=0)) / sizes[:, None]
    # Of eight samples it is known to a third or so, and the least that is added is beside it.
    np.testing.assert_allclose(np.median(found, axis=0), unit * way, rtol=0.6, atol=LEAST_NOISE * EPS * np.sqrt(terms))
    first, second = changes[:, :, 1, 0].ravel(), changes[:, :, 1, 3].ravel()
    assert np.corrcoef(first, second)[0, 1] > 0.99
    np.testing.assert_array_equal(changes[7], scatter.of_series(7))


def test_steps_round_otherwise_where_samples_do_not_scatter():
    interpolant = rigid(4.0)
    changes = SampleScatter(interpolant, interpolant.series).of_series(0)
    assert 0.0 < np.abs(changes).max() <= LEAST_NOISE * EPS
    # There is no drift.
    assert not changes[..., 6:].any()


def test_rows_are_measured_each_for_itself():
    """Of two momenta the one whose bound is large, as if it were alone."""
    interpolant, steps = rigid(8.0), np.full(16, 4)
    alike = interpolant.series
    momenta = np.stack([MOMENTUM, [0.0, 0.0, 1.0]])
    sizes = np.linalg.norm(momenta, axis=1)
    both = integrate_steps(interpolant, None, steps, momenta / sizes[:, None], sizes)
    one = integrate_steps(interpolant, None, steps, momenta[:1] / sizes[:1, None], sizes[:1])
    tolerance = 1e-12
    found = measured_rounding(np.array([1e-12, 1e-14]), interpolant, steps, both, sizes, tolerance, alike)
    (alone,) = measured_rounding(np.array([1e-12]), interpolant, steps, one, sizes[:1], tolerance, alike)
    assert found[0] == alone < 1e-12
    assert found[1] == 1e-14


def of_kind(kind: str, body: sp.Body, rng: np.random.Generator) -> sp.ShapePath:
    """A loop of 0.8 s."""
    sines = 0.3 * rng.normal(size=(body.n_shape, 2))
    loop = sp.ShapePath.fourier(np.zeros(body.n_shape), 0.2 * sines[:, ::-1], sines, 0.8)
    if kind == "recorded":
        times = np.linspace(0.0, 0.8, 121)
        return sp.ShapePath.spline(times, loop.curve(times)[0])
    return loop if kind == "loop" else sp.ShapePath.function(loop.curve, 0.8)


@pytest.mark.parametrize("fast", ["0", "1"])
@pytest.mark.parametrize("kind", ["loop", "function", "recorded"])
def test_samplers_give_the_deformation_between_their_nodes(
    monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, fast: str, kind: str
):
    """As Pinocchio has it along the path, and not as the series through the samples has it."""
    if fast == "1":
        request.getfixturevalue("fast")
    else:
        monkeypatch.setenv("SHAPEPHASE_FAST", "0")
    rng = np.random.default_rng(5)
    body = sp.load_body("cat_two_halves")
    path = of_kind(kind, body, rng)
    sampler = sp.articulated(body, path).sampler()
    sampler.refine(0.3, 1e-9)
    times = rng.uniform(0.0, 0.8, 200)
    found = np.array(sampler.channels(times))
    shapes, rates = path.curve(times)
    inverse = np.linalg.inv(body.locked_inertia(shapes))
    drift = (inverse @ body.internal_momentum(shapes, rates)[:, :, None])[:, :, 0]
    exact = np.column_stack([inverse[:, [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], drift])
    scale = np.abs(exact).max(axis=0)
    # Panels over several knots follow polynomials in the place of the path.
    allowed = 1e-7 if kind == "recorded" else 64.0 * EPS
    assert (np.abs(found - exact).max(axis=0) <= allowed * scale.max()).all()
    series = sampler.interpolant().series(times)
    assert 0.0 < np.abs(found - series).max() < 1e-6 * scale.max()
