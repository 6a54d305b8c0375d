"""The one look at a path known only as a function: what it finds, and what it refuses."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from benchmarks.hostile_paths import KINDS, SMOOTH, hostile_path, judged

import shapephase as sp
from shapephase.errors import AccuracyNotReached, NoisyPathError, TrajectoryError, UndeclaredBreakWarning
from shapephase.integrator.resolved import DEGREE, ResolvedPath
from support.compiler import needs_compiler
from support.long_runs import full_but

AMPLITUDE = np.array([0.8, -0.5, 0.6])
DURATION = 2.0
Scalar = Callable[[np.ndarray], np.ndarray]


@dataclass
class Watched:
    """A function of one swing for three joints that keeps the times at which it is evaluated."""

    value: Scalar
    slope: Scalar
    calls: list[np.ndarray] = field(default_factory=list)

    def __call__(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self.calls.append(np.array(t))
        return self.value(t)[:, None] * AMPLITUDE, self.slope(t)[:, None] * AMPLITUDE

    def path(self, breaks=()) -> sp.ShapePath:
        return sp.ShapePath.function(self, DURATION, breaks)


def swing() -> Watched:
    return Watched(lambda t: np.sin(5.0 * t), lambda t: 5.0 * np.cos(5.0 * t))


def bump(centre: float, support: float, size: float = 1.0) -> Watched:
    """Smooth, and exactly zero beyond its support."""

    def both(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = 2.0 * (t - centre) / support
        room = np.where(np.abs(x) < 1.0, 1.0 - x * x, np.inf)
        value = size * np.where(np.isfinite(room), np.exp(1.0 - 1.0 / room), 0.0)
        return value, -value * 4.0 * x / (support * room**2)

    return Watched(lambda t: both(t)[0], lambda t: both(t)[1])


def kink(where: float, size: float = 1.0) -> Watched:
    return Watched(
        lambda t: np.sin(3.0 * t) + size * np.maximum(t - where, 0.0),
        lambda t: 3.0 * np.cos(3.0 * t) + size * (t >= where),
    )


def series_at(resolved: ResolvedPath, times: np.ndarray) -> np.ndarray:
    """Shapes and rates from the resolved panels, by NumPy's own Chebyshev sums."""
    rows = np.searchsorted(resolved.left, times, side="right") - 1
    x = (2.0 * times - resolved.left[rows] - resolved.right[rows]) / (resolved.right - resolved.left)[rows]
    return np.array(
        [np.polynomial.chebyshev.chebval(at, resolved.coefficients[row]) for at, row in zip(x, rows, strict=True)]
    )


# ---- What is resolved ----------------------------------------------------------------------------------------------


def test_known_kinds_need_no_scan():
    fourier = sp.ShapePath.fourier([0.0], [[1.0]], [[0.0]], DURATION)
    spline = sp.ShapePath.spline([0.0, 1.0, 2.0], [[0.0], [1.0], [0.0]])
    for path in (fourier, spline, spline.reversed().then(spline), fourier.repeated(3).stretched(2.0)):
        assert path.scan is None


def test_a_path_is_looked_at_in_one_call_without_gaps():
    f = swing()
    path = f.path()
    before = len(f.calls)
    scan = path.scan
    assert scan is not None
    assert len(f.calls) == before + 1 == before + scan.calls
    times = np.concatenate([[0.0], np.sort(f.calls[-1]), [DURATION]])
    assert np.diff(times).max() <= DURATION / 4000.0
    assert 5000 <= len(f.calls[-1]) == scan.evaluations <= 6000
    assert path.scan is scan
    assert f"{scan.panels} panels from {scan.evaluations} evaluations in 1 calls" in str(scan)


FUNCTIONS = [swing(), bump(0.7, 0.01), bump(1.3, 1.2), kink(0.777)]


@pytest.mark.parametrize("f", FUNCTIONS, ids=["swing", "short", "wide", "kink"])
def test_the_series_are_the_function(f: Watched, rng):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UndeclaredBreakWarning)
        scan = f.path().scan
    assert scan is not None
    times = rng.uniform(0.0, DURATION, 400)
    exact = np.concatenate(f(times), axis=1)
    scale = np.abs(exact).max(axis=0)
    np.testing.assert_array_less(np.abs(series_at(scan.resolved, times) - exact).max(axis=0), 2e-13 * (1.0 + scale))


@pytest.mark.parametrize("support", [1 / 2000, 1 / 1000, 1 / 100])
@pytest.mark.parametrize("size", [1.0, 1e-8])
def test_a_bump_wider_than_the_promise_is_found_wherever_it_is(support: float, size: float):
    """And there panels have terms when it matters to the tolerance."""
    width = support * DURATION
    for centre in np.random.default_rng(3).uniform(width, DURATION - width, 4):
        scan = bump(float(centre), width, size).path().scan
        assert scan is not None
        assert np.abs(series_at(scan.resolved, np.array([centre]))[0, :3]).max() == pytest.approx(0.8 * size, rel=1e-9)
        inside = np.searchsorted(scan.resolved.left, centre) - 1
        assert scan.resolved.terms(1e-3 * size)[inside] > 1
        assert np.diff(scan.resolved.edges)[inside] < 2.0 * width
        assert scan.resolved.terms(10.0 * size).max() == 1


CHIRP = Watched(lambda t: np.sin(20.0 * t * t), lambda t: 40.0 * t * np.cos(20.0 * t * t))
RAMP = Watched(lambda t: np.tanh(30.0 * (t - 0.7)), lambda t: 30.0 / np.cosh(30.0 * (t - 0.7)) ** 2)


@pytest.mark.parametrize("function", [swing(), CHIRP, RAMP, bump(0.7123, 0.2), bump(0.3, 0.002)])
@pytest.mark.parametrize("tolerance", full_but([1e-2, 1e-5, 1e-8, 1e-11], 1e-2, 1e-8))
def test_series_of_fewest_terms_miss_no_more_than_the_tolerance(function: Watched, tolerance: float, rng):
    """Neither in the shapes nor, times half the width, in the rates; with one term fewer more than it is left out."""
    scan = function.path().scan
    assert scan is not None
    resolved, degree = scan.resolved, scan.resolved.terms(tolerance)
    left_out = np.arange(DEGREE + 1) > degree[:, None]
    short = replace(resolved, coefficients=np.where(left_out[:, :, None], 0.0, resolved.coefficients))
    times = rng.uniform(0.0, DURATION, 1000)
    panel = np.searchsorted(resolved.left, times, side="right") - 1
    weights = np.ones((scan.panels, 6))
    weights[:, 3:] = 0.5 * np.diff(resolved.edges)[:, None]
    exact = np.concatenate(function(times), axis=1)
    rounding = 1e-13 * (1.0 + np.abs(exact).max(axis=0) * weights[panel])
    assert (weights[panel] * np.abs(series_at(short, times) - exact) <= tolerance + rounding).all()
    sizes = np.abs(resolved.coefficients) * weights[:, None]
    for row in np.flatnonzero(degree > 1):
        assert sizes[row, degree[row] :].sum(axis=0).max() > tolerance


def test_only_panels_at_rest_have_no_terms():
    """Not those on which a rate is constant, nor values without rates; rounding of these is no motion."""
    series = np.zeros((5, DEGREE + 1, 4))
    series[:, 0, 0] = 1.0
    series[1, 0, 3] = 1e-3
    series[2, 1, 0] = 1e-3
    series[3, 1, 0] = 1e-15
    series[4, DEGREE, 1] = 1e-3
    edges = np.arange(6.0)
    resolved = ResolvedPath(edges[:-1], edges[1:], series, np.zeros(5), 5.0)
    np.testing.assert_array_equal(resolved.terms(1.0), [0, 1, 1, 0, 1])
    np.testing.assert_array_equal(resolved.terms(1e-9), [0, 1, 1, 0, DEGREE])


# ---- Kinks and jumps -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1.0, -0.01, 1e-5])
@pytest.mark.parametrize("where", [0.7123, 1.0, 0.125, 1.9997, 1e-4])
def test_a_kink_is_located_to_rounding_and_named(where: float, size: float):
    with pytest.warns(UndeclaredBreakWarning, match="kinks") as caught:
        scan = kink(where, size).path().scan
    assert scan is not None
    assert scan.found_breaks == pytest.approx([where], abs=4e-15 / min(abs(size), 1.0))
    assert len(caught) == 1
    assert f"{scan.found_breaks[0]:.15g} s" in str(caught[0].message)
    assert scan.panels < 20, "panels that led to the kink are merged again"


def test_declared_kinks_are_no_news():
    scan = kink(0.7123).path([0.7123]).scan
    assert scan is not None
    assert not len(scan.found_breaks)
    assert scan.calls <= 3


def test_many_kinks_are_all_found():
    knots = np.linspace(0.0, DURATION, 24)
    corners = np.random.default_rng(2).normal(size=24)
    slopes = np.diff(corners) / np.diff(knots)
    f = Watched(
        lambda t: np.interp(t, knots, corners),
        lambda t: slopes[np.clip(np.searchsorted(knots, t, side="right") - 1, 0, 22)],
    )
    with pytest.warns(UndeclaredBreakWarning, match="14 more"):
        scan = f.path().scan
    assert scan is not None
    np.testing.assert_allclose(scan.found_breaks, knots[1:-1], atol=1e-14)


@pytest.mark.parametrize("size", [1.0, 1e-7])
@pytest.mark.parametrize("moving", [0.0, 1.0])
def test_a_jump_of_the_shape_is_refused_with_joint_and_time(size: float, moving: float):
    f = Watched(lambda t: moving * np.sin(t) + size * (t > 0.7123), lambda t: moving * np.cos(t))
    with pytest.raises(TrajectoryError, match="jumps"):
        _ = f.path().scan
    with pytest.raises(TrajectoryError, match=r"0\.7123"):
        _ = f.path([0.7123]).scan


def test_an_angle_that_goes_on_at_another_turn_is_no_jump_and_no_news():
    """As arctan2 gives it; pytest turns warnings into errors."""
    path = sp.ShapePath.function(
        lambda t: (np.arctan2(np.sin(3.0 * t), np.cos(3.0 * t))[:, None], np.full((len(t), 1), 3.0)), DURATION
    )
    assert path.scan is not None
    assert path.scan.found_breaks == pytest.approx([np.pi / 3.0], abs=1e-14)


@pytest.mark.parametrize("width", [1e-3, 1e-5, 1e-7])
def test_a_short_ramp_is_no_jump(width: float):
    f = Watched(
        lambda t: np.sin(t) + np.clip((t - 0.7) / width, 0.0, 1.0),
        lambda t: np.cos(t) + ((t > 0.7) & (t < 0.7 + width)) / width,
    )
    with pytest.warns(UndeclaredBreakWarning):
        scan = f.path().scan
    assert scan is not None
    assert scan.found_breaks == pytest.approx([0.7, 0.7 + width], abs=1e-14)
    # In one rounding of its time the shape changes by more than its own rounding: that is left to the tolerance.
    assert np.spacing(0.7) * 0.8 / width < scan.resolved.noise.max() < 20.0 * np.spacing(0.7) * 0.8 / width


# ---- Noise, roughness, wrong rates ---------------------------------------------------------------------------------


@pytest.mark.parametrize("level", [1e-3, 1e-7])
@pytest.mark.parametrize("which", ["shape", "rate"])
def test_noise_is_named(level: float, which: str):
    rng = np.random.default_rng(4)
    on = np.array([which == "shape", which == "rate"]) * level
    f = Watched(
        lambda t: 0.02 * np.sin(t) + on[0] * rng.normal(size=len(t)),
        lambda t: 0.02 * np.cos(t) + on[1] * rng.normal(size=len(t)),
    )
    path = sp.ShapePath(f, DURATION, np.array([0.0, DURATION]), 3)
    with pytest.raises(NoisyPathError, match=which):
        _ = path.scan


def test_noise_near_rounding_is_left_to_the_tolerance():
    """As of a function that adds large numbers and subtracts them again."""
    f = Watched(lambda t: (1e3 + np.sin(t)) - 1e3, np.cos)
    scan = f.path().scan
    assert scan is not None
    assert 0.0 <= scan.noise < 1e-12
    assert scan.panels < 40


def test_roughness_is_no_noise():
    """A ripple that no panel resolves is smooth where times are near enough to each other."""
    f = Watched(lambda t: np.sin(t) + 1e-7 * np.sin(1e7 * t), lambda t: np.cos(t) + np.cos(1e7 * t))
    path = sp.ShapePath(f, DURATION, np.array([0.0, DURATION]), 3)
    with pytest.raises(AccuracyNotReached, match="rough"):
        _ = path.scan
    assert sum(map(len, f.calls)) < 1_000_000


@pytest.mark.parametrize("share", [1e-2, 1e-5])
def test_a_rate_that_is_wrong_only_for_a_while_is_refused(share: float):
    window = bump(1.1234, 0.02)
    f = Watched(np.sin, lambda t: np.cos(t) * (1.0 + share * window.value(t)))
    with pytest.raises(TrajectoryError, match="number 0"):
        _ = f.path().scan


# ---- Kept with the path --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("loops", [1, 3])
def test_the_scan_is_that_of_the_first_loop(loops: int, rng):
    f = bump(0.3, 0.4)
    path = sp.ShapePath.function(f, DURATION, joint_names=["c", "a", "b"]).repeated(loops)
    for one in (path, path.stretched(0.5).reversed(), path.matched(["a", "b", "c"], "it")):
        scan, period = one.scan, one.duration / loops
        assert scan is not None
        assert scan.duration == pytest.approx(period, rel=1e-15)
        times = rng.uniform(0.0, period, 200)
        exact = np.concatenate(one.curve(times), axis=1)
        np.testing.assert_allclose(series_at(scan.resolved, times), exact, atol=1e-12 * (1.0 + np.abs(exact).max()))


def test_the_next_momentum_costs_no_look():
    f = swing()
    deformation = sp.articulated(sp.load_body("cat_two_halves"), f.path())
    sp.reconstruct(deformation, [0.0, 0.0, 0.02])
    looked = sum(map(len, f.calls))
    motion = sp.reconstruct(deformation, [0.01, 0.0, 0.0])
    assert sum(map(len, f.calls)) - looked < 3 * motion.evaluations + 200


def test_found_breaks_are_those_of_every_loop():
    triangle = Watched(lambda t: np.abs(t - 1.0), lambda t: np.where(t < 1.0, -1.0, 1.0))
    path = triangle.path().repeated(3)
    with pytest.warns(UndeclaredBreakWarning):
        smoothness = path.smoothness
    np.testing.assert_allclose(smoothness.breaks, np.arange(7.0), atol=1e-13)
    body, momentum = sp.load_body("cat_two_halves"), [0.0, 0.01, 0.02]
    motion = sp.reconstruct(sp.articulated(body, path), momentum, tolerance=1e-9)
    declared = sp.reconstruct(sp.articulated(body, triangle.path([1.0]).repeated(3)), momentum, tolerance=1e-9)
    np.testing.assert_allclose(motion.final_attitude, declared.final_attitude, atol=2e-9)


def test_a_black_box_costs_no_more_of_the_body_than_before():
    """Four panels of degree 32 or less, and the fresh times."""
    motion = sp.reconstruct(sp.articulated(sp.load_body("cat_two_halves"), swing().path()), np.zeros(3), tolerance=1e-6)
    assert motion.evaluations < 140


# ---- Hostile paths -------------------------------------------------------------------------------------------------


@needs_compiler
@pytest.mark.parametrize("runs", full_but([1, 6], 1))
@pytest.mark.parametrize("kind", KINDS)
def test_nothing_wider_than_the_promise_is_silently_wrong(kind: str, runs: int):
    """A sample of `python -m benchmarks.hostile_paths`, against 80-bit precision."""
    judged_runs = 0
    for number in range(40):
        hostile = hostile_path(kind, np.random.default_rng((2, number)))
        if hostile.width < 1 / 2000 or judged_runs == runs:
            continue
        judged_runs += 1
        verdict = judged(hostile)
        assert verdict.outcome not in ("silently wrong", "refused"), verdict
        if kind in SMOOTH and hostile.width > 1 / 500:
            assert verdict.outcome == "solved", verdict
    assert judged_runs == runs
