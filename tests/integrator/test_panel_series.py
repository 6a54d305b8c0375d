"""Panels of many degrees: series that are known, corrected ends, what is kept; and machine code beside arrays."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.polynomial import chebyshev

from shapephase.chebyshev import end_margin, widest_margin
from shapephase.integrator._last_terms import perturbed_series
from shapephase.integrator.fast.panels import Demand, PanelsToSample, sampled_round
from shapephase.integrator.interpolant import Interpolant
from shapephase.integrator.panels.finer_panels import FinerPanels, refining_factors
from shapephase.integrator.panels.panel_series import PanelSeries, panel_errors, sample_times, series_through
from shapephase.integrator.resolved import Hidden
from shapephase.integrator.steps.step_control import StepRequirements
from support.both_engines import both

EPS = np.finfo(float).eps
DEGREES = np.array([0, 5, 30, 10, 80, 10])
EDGES = np.array([0.0, 0.1, 0.25, 1.0, 1.5, 1.75, 2.0])


@pytest.fixture(params=[False, True], ids=["arrays", "kernels"])
def kernels(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    """With and without machine code."""
    if request.param:
        request.getfixturevalue("fast")
    else:
        monkeypatch.setenv("SHAPEPHASE_FAST", "0")
    return request.param


def channels(times: np.ndarray, degree: int = 5) -> np.ndarray:
    """Nine polynomials of a degree: what is sampled has that many terms on every panel."""
    rng = np.random.default_rng(3)
    return chebyshev.chebval(times - 1.0, rng.normal(size=(degree + 1, 9)), tensor=True).T


def sampled(function=channels, degree: np.ndarray = DEGREES, edges: np.ndarray = EDGES) -> PanelSeries:
    left, right = edges[:-1], edges[1:]
    values = function(sample_times(degree, left, right, edges[-1]))
    return series_through(degree, left, right, values, edges[-1], degree > 0)


@pytest.mark.usefixtures("kernels")
def test_series_are_those_of_the_polynomials():
    """Values at any time, of all panels whose degree is enough; beyond the degree there is nothing."""
    found, rng = sampled(), np.random.default_rng(0)
    for panel in range(1, len(DEGREES)):
        x = rng.uniform(-1.0, 1.0, 20)
        times = 0.5 * (EDGES[panel] + EDGES[panel + 1]) + 0.5 * (EDGES[panel + 1] - EDGES[panel]) * x
        there = chebyshev.chebval(x, found.coefficients[panel], tensor=True).T
        # Each coefficient is a sum of as many values as there are terms.
        assert np.abs(there - channels(times)).max() < 8.0 * EPS * (DEGREES[panel] + 1) * np.abs(channels(times)).max()
        assert not found.coefficients[panel, DEGREES[panel] + 1 :].any()


@pytest.mark.usefixtures("kernels")
def test_values_at_the_ends_are_moved_to_the_ends():
    """Sampled a little inside, where a steep function is off by far more than rounding."""
    steep, margin = 1e6, float(end_margin(np.array([1.0]), 2.0)[0])
    found = sampled(lambda t: np.repeat(steep * t[:, None], 9, axis=1), np.array([10]), np.array([1.0, 2.0]))
    assert steep * margin > 32.0 * EPS * steep
    assert found.values[0] == pytest.approx(np.full(9, steep), rel=4.0 * EPS)
    assert found.values[-1] == pytest.approx(np.full(9, 2.0 * steep), rel=4.0 * EPS)
    assert chebyshev.chebval(-1.0, found.coefficients[0]) == pytest.approx(np.full(9, steep), rel=16.0 * EPS)


@pytest.mark.usefixtures("kernels")
def test_what_was_sampled_is_not_sampled_again():
    """A panel raised, one halved, the others kept: the samples of all are those of panels made from nothing."""
    old, asked = sampled(), []

    def counted(times: np.ndarray) -> np.ndarray:
        asked.append(len(times))
        return channels(times)

    factor = np.array([1, 3, 1, 2, 0, 1])
    finer = FinerPanels.of(old, factor)
    values = finer.values(old, counted(finer.fresh_times(EDGES[-1])))
    assert finer.degree.tolist() == [0, 15, 30, 20, 10, 10, 10]
    assert finer.origin.tolist() == [0, 1, 2, 3, 4, 4, 5]
    assert np.append(finer.left, finer.right[-1]).tolist() == [0.0, 0.1, 0.25, 1.0, 1.5, 1.625, 1.75, 2.0]
    assert asked == [10 + 10 + 2 * 11]
    series = series_through(finer.degree, finer.left, finer.right, values, EDGES[-1], finer.factor == 0)
    anew = sampled(degree=finer.degree, edges=np.append(finer.left, finer.right[-1]))
    scale = 64.0 * EPS * np.abs(anew.coefficients).max() * 31
    assert np.abs(series.coefficients - anew.coefficients).max() < scale


def random_panels(rng: np.random.Generator) -> PanelSeries:
    """Terms that fall as fast as they like, down to rounding or not at all."""

    def rough(times: np.ndarray) -> np.ndarray:
        rates = 10.0 ** rng.uniform(0.0, 2.0, 9)
        return np.cos(times[:, None] * rates + rng.uniform(0.0, 6.0, 9)) + 2.0

    return sampled(rough)


@pytest.mark.usefixtures("fast")
@pytest.mark.parametrize("tolerance", [1e-3, 1e-9, 1e-12])
@pytest.mark.parametrize("with_hidden", [False, True])
def test_a_round_in_one_call_is_the_same_as_its_parts(
    monkeypatch: pytest.MonkeyPatch, tolerance: float, with_hidden: bool
):
    """Panels of known polynomials and rough ones: what is kept, what goes on, and where that is sampled next."""
    left, right, end = EDGES[:-1], EDGES[1:], float(EDGES[-1])
    none = np.zeros(len(DEGREES), dtype=np.int64)
    first = PanelsToSample(none, none, DEGREES, left, right, np.empty(0))
    table = 10.0 ** np.random.default_rng(5).uniform(-12.0, -6.0, (len(DEGREES), 5)) if with_hidden else None
    momentum, loops = 3.0, 2
    demand = Demand(momentum, tolerance, loops * end, loops, widest_margin(end))

    def rough(times: np.ndarray) -> np.ndarray:
        return np.cos(times[:, None] * np.linspace(1.0, 60.0, 9)) + 2.0

    fresh = rough(sample_times(DEGREES, left, right, end))
    found = sampled_round(DEGREES[:0], np.empty((0, 9)), first, fresh, table, demand)
    monkeypatch.setenv("SHAPEPHASE_FAST", "0")
    series = series_through(DEGREES, left, right, fresh.copy(), end, DEGREES > 0)
    errors = panel_errors(series, None if table is None else Hidden(table), momentum)
    assert np.allclose(found.values, series.values, rtol=4.0 * EPS, atol=4.0 * EPS)
    assert np.allclose(found.coefficients, series.coefficients, rtol=0.0, atol=1e-13)
    assert np.allclose(found.errors, errors.table, rtol=1e-6, atol=1e-13)
    share = tolerance / (end * loops) * series.width
    is_rough = (errors.whole > share) & (~series.estimate.at_rounding | (errors.hidden > share))
    if not is_rough.any() or loops * errors.whole.sum() <= tolerance:
        assert not len(found.further)
        return
    factor = refining_factors(series, is_rough, errors.whole, share)
    finer = FinerPanels.of(series, factor)
    assert found.further.tolist() == factor.tolist()
    for name in ("origin", "factor", "degree", "left", "right"):
        assert getattr(found.finer, name).tolist() == getattr(finer, name).tolist(), name
    times = finer.fresh_times(end)
    assert np.allclose(found.finer.times, times, rtol=4.0 * EPS)
    second = rough(times)
    monkeypatch.delenv("SHAPEPHASE_FAST")
    again = sampled_round(DEGREES, found.values, found.finer, second, None, demand)
    values = finer.values(series, second)
    monkeypatch.setenv("SHAPEPHASE_FAST", "0")
    anew = series_through(finer.degree, finer.left, finer.right, values, end, finer.factor == 0)
    assert np.allclose(again.values, anew.values, rtol=16.0 * EPS, atol=16.0 * EPS)
    assert np.allclose(again.coefficients, anew.coefficients, rtol=0.0, atol=1e-13)


@pytest.mark.usefixtures("fast")
@pytest.mark.parametrize("seed", range(8))
def test_kernels_and_arrays_are_one_formula(monkeypatch: pytest.MonkeyPatch, seed: int):
    rng = np.random.default_rng(seed)
    hidden = Hidden(10.0 ** rng.uniform(-12.0, -6.0, (len(DEGREES), 5)))
    momentum, tolerance = 10.0 ** rng.uniform(-2.0, 2.0), 10.0 ** rng.uniform(-12.0, -5.0)
    state, rough, share = rng.bit_generator.state, rng.random(len(DEGREES)) < 0.5, rng.uniform(1e-12, 1e-6, 6)

    def run() -> SimpleNamespace:
        rng.bit_generator.state = state
        series = random_panels(rng)
        # Both go on from the same series: its last terms are rounding, which differs.
        series = series_through(series.degree, series.left, series.right, np.round(series.values, 9), 2.0, DEGREES < 0)
        errors = panel_errors(series, hidden, momentum)
        interpolant = Interpolant(EDGES, series.coefficients, 1, 0)
        needed = StepRequirements.from_interpolant(interpolant, momentum, tolerance)
        steps = needed.whole_steps(needed.plan(tolerance, short=seed % 2 == 0))
        distances = 10.0 ** np.arange(-14.0, 0.0)
        return SimpleNamespace(
            coefficients=series.coefficients,
            table=series.estimate.table,
            errors=errors.table,
            bare=panel_errors(series, None, 0.0).table,
            factor=refining_factors(series, rough & (DEGREES > 0), errors.whole, share),
            changed=perturbed_series(series.coefficients, series.degree, series.width, momentum),
            sizes=needed.sizes,
            steps=steps,
            stepping=needed.stepping_error(steps, distances),
        )

    arrays, kernels = (vars(one) for one in both(monkeypatch, run))
    for name, expected in arrays.items():
        # Errors come of the last terms, 1e-10 large and rounded as the largest is, and of powers of their quotients.
        limit = 1e-4 if name in ("table", "errors", "bare", "changed", "sizes", "stepping") else 1e-9
        assert np.allclose(kernels[name], expected, rtol=limit, atol=1e-13 * np.abs(arrays["coefficients"]).max()), name
