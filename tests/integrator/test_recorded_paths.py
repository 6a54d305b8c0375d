"""Recorded paths: panels over several knots, the polynomials that stand for the path there, and what they hide."""

from __future__ import annotations

import pickle
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from benchmarks.estimates import judged
from benchmarks.random_motions import recordings
from numpy.polynomial import chebyshev as series

import shapephase as sp
from shapephase.chebyshev import unit_nodes
from shapephase.integrator.integrate import stepped_rotation
from shapephase.integrator.recorded import panel_choice
from shapephase.integrator.recorded.body_series import falling_terms
from shapephase.integrator.recorded.knot_path import KnotPath
from shapephase.integrator.recorded.knot_sampling import KnotSampler
from shapephase.integrator.recorded.polynomial_fit import fit_nodes, polynomial_fit
from shapephase.shape_space.body_path import recorded_pieces
from support.compiler import needs_compiler
from support.independent import apart, pinocchio_motion
from support.long_runs import full_but
from support.places import DATA


def loop_of(body: sp.Body, rows: int, seed: int = 3) -> sp.ShapePath:
    """A loop of three harmonics recorded without rounding."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, 1.0, rows + 1)
    sizes, phases = 0.4 * rng.normal(size=(3, body.n_shape)), rng.uniform(0.0, 6.0, (3, body.n_shape))
    shapes = np.zeros((rows + 1, body.n_shape))
    for k in range(3):
        shapes += sizes[k] / (k + 1) * np.sin(2.0 * np.pi * (k + 1) * times[:, None] + phases[k])
    shapes[-1] = shapes[0]
    return sp.ShapePath.spline(times, shapes, periodic=True)


def knots_of(body: sp.Body, path: sp.ShapePath) -> KnotPath:
    found = sp.articulated(body, path).description.smoothness(path.breaks).knots
    assert found is not None
    return found


@pytest.mark.parametrize("degree", [4, 5, 8, 17])
def test_the_fit_has_the_function_s_ends_and_repeats_polynomials(degree: int):
    """Values and slopes at both ends of an arbitrary function; all of a polynomial of degree d + 1, and its mean."""
    fit = polynomial_fit(degree)
    nodes, points = fit_nodes(degree), unit_nodes(degree)
    arbitrary = np.concatenate([np.exp(2.0 * nodes) * np.sin(7.0 * nodes), [0.3, -1.2]])
    assert (fit.shapes @ arbitrary)[[0, -1]] == pytest.approx(arbitrary[[0, degree - 1]], abs=1e-12)
    assert (fit.slopes @ arbitrary)[[0, -1]] == pytest.approx(arbitrary[-2:], abs=1e-11)
    exact = np.random.default_rng(degree).normal(size=degree + 2)
    slopes = series.chebder(exact)
    data = np.concatenate([series.chebval(nodes, exact), series.chebval([-1.0, 1.0], slopes)])
    assert fit.series @ data == pytest.approx(exact, abs=1e-11)
    assert fit.shapes @ data == pytest.approx(series.chebval(points, exact), abs=1e-11)
    assert fit.slopes @ data == pytest.approx(series.chebval(points, slopes), abs=1e-9)
    whole = series.chebint(exact)
    assert fit.mean @ data == pytest.approx(0.5 * (series.chebval(1.0, whole) - series.chebval(-1.0, whole)), abs=1e-12)


def test_paths_made_of_recordings_are_known_as_polynomials():
    """Reversed, stretched, reordered, joined and repeated: the polynomials are the path, at every time."""
    body = sp.load_body("cat_two_halves")
    first = loop_of(body, 80)
    named = replace(first, joint_names=tuple("abc"))
    for path in (
        first.reversed(),
        first.stretched(2.5),
        named.matched(("c", "a", "b"), "a test"),
        first.then(first.stretched(0.3)),
        first.repeated(3).reversed(),
        first.then(first.repeated(2)).stretched(0.7),
    ):
        found = recorded_pieces(path)
        assert found is not None
        times = np.random.default_rng(0).uniform(0.0, float(found.knots[-1]), 200)
        for ours, theirs in zip(found(times), path.curve(times), strict=True):
            assert ours == pytest.approx(theirs, abs=1e-9)
    assert recorded_pieces(sp.ShapePath.fourier([0.0], [[0.1]], [[0.2]], 1.0)) is None
    assert recorded_pieces(loop_of(body, 20)) is None


@pytest.mark.parametrize("name", ["satellite", "cat", "cat_two_halves"])
def test_the_terms_that_samples_miss_are_foreseen(name: str):
    """Beside the series through many samples of noisy intervals: the terms that the first order in the shapes has.

    A satellite's arms change its inertia little, and yet the way they turn it changes as they bend.
    """
    body = sp.load_body(name)
    path = loop_of(body, 1000)
    rows = 0.1 * path.shape(path.breaks) + 1e-3 * np.random.default_rng(2).normal(size=(1001, body.n_shape))
    path = sp.ShapePath.spline(path.breaks, rows)
    nodes = unit_nodes(12)
    times = path.breaks[:-1, None] + np.diff(path.breaks)[:, None] * (0.5 + 0.5 * nodes)
    inertia, momentum = body.sample(*path.curve(times.ravel()))
    drifts = np.linalg.solve(inertia, momentum[..., None])[..., 0].reshape(*times.shape, 3)
    series_of = np.linalg.inv(series.chebvander(nodes, 12))
    true = np.linalg.norm(series_of @ drifts, axis=2)
    foreseen = falling_terms(knots_of(body, path), path.breaks[:-1], path.breaks[1:], 0.0, 9)
    ratios = true[:, 3:6] / foreseen[:, 3:6]
    assert np.median(ratios, axis=0) == pytest.approx(1.0, abs=0.1)
    assert np.all(np.quantile(ratios, 0.9, axis=0) < 1.5)
    assert np.median(true[:, 6] / foreseen[:, 6]) < 1.0


def test_rounding_of_an_ill_conditioned_tensor_ends_refinement():
    """A needle of a body, whose samples are right to 1e-12 only: no finer samples help, and so none are taken."""
    trial = recordings(103, np.random.default_rng((11, 103)))
    sampler = sp.articulated(trial.body, trial.path).sampler()
    magnitude = float(np.linalg.norm(trial.momentum))
    sampler.refine(magnitude, trial.tolerance)
    assert np.linalg.cond(trial.body.locked_inertia(trial.body.shape())) > 5000.0
    assert sampler.error(magnitude) > trial.tolerance
    assert sampler.interpolant().evaluations < 40 * len(trial.path.breaks)


def test_what_is_hidden_is_what_the_body_misses():
    """Beside a brute-force look: the channels along the polynomial and along the path, integrated over each panel.

    The attitude is off within a panel by the integral of the difference of I^-1 L_o; at its end by less than `adding`.
    """
    body = sp.load_body("cat")
    path = loop_of(body, 600)
    rows = np.random.default_rng(1).normal(size=(601, body.n_shape)) * 1e-5
    path = sp.ShapePath.spline(path.breaks, path.shape(path.breaks) + rows)
    knots, degree = knots_of(body, path), 6
    left, right = path.breaks[0:600:5], path.breaks[5:601:5]
    found = knots.hidden(left, right, degree, 0.0)
    within, ends = np.zeros((2, len(left)))
    gauss, weights = np.polynomial.legendre.leggauss(8)
    for panel, (a, b) in enumerate(zip(left, right, strict=True)):
        inner = path.breaks[(path.breaks >= a) & (path.breaks <= b)]
        times = (inner[:-1, None] + np.diff(inner)[:, None] * (0.5 + 0.5 * gauss)).ravel()
        lengths = (np.diff(inner)[:, None] * 0.5 * weights).ravel()
        states = knots.states(np.array([a]), np.array([b]), degree)
        local = (2.0 * times - a - b) / (b - a)
        to_values = series.chebvander(local, degree) @ np.linalg.inv(series.chebvander(unit_nodes(degree), degree))
        shapes, rates = np.asarray(path.shape(times)), np.asarray(path.rate(times))
        inertia, momentum = body.sample(shapes, rates)
        # The polynomial of the shapes is of degree d + 1: it is the integral of that of the rates.
        gone = np.cumsum((to_values @ states[1][0] - rates) * lengths[:, None], axis=0)
        connection = np.linalg.solve(inertia, body.momentum_matrix(shapes))
        turned = np.linalg.norm((connection @ gone[:, :, None])[:, :, 0], axis=1)
        within[panel] = turned.max()
        ends[panel] = np.linalg.norm(gone[-1])
        assert momentum.shape == (len(times), 3)
    assert np.all(within <= found.within)
    assert np.median(found.within / within) < 5.0
    assert ends.max() < 1e-13 < within.min()
    assert found.adding.sum() < 0.5 * found.within.sum()


def test_the_recorded_cat_takes_few_evaluations_and_lands_where_it_did():
    """The attitude along the same path given as a function, which is resolved between its knots."""
    body = sp.load_body("cat")
    path = sp.read_shape_path("robots/cat_righting.csv", body)
    same = sp.ShapePath.function(path.curve, path.duration, path.breaks[1:-1], joint_names=path.joint_names)
    times = np.linspace(0.0, path.duration, 37)
    for momentum in ([0.0, 0.0, 0.0], [0.05, 0.0, 0.1]):
        motion = sp.reconstruct(sp.articulated(body, path), momentum, tolerance=1e-9)
        exact = sp.reconstruct(sp.articulated(body, same), momentum, tolerance=1e-11)
        assert motion.evaluations <= 2000
        gaps = [apart(a, b) for a, b in zip(motion.attitude(times), exact.attitude(times), strict=True)]
        assert max(gaps) <= motion.error_estimate + exact.error_estimate


def test_a_recorded_deformation_travels_without_what_was_found_out():
    """Pickled after a reconstruction it is as long as before, and gives the same attitude."""
    body = sp.load_body("cat_two_halves")
    deformation = sp.articulated(body, loop_of(body, 200))
    before = pickle.dumps(deformation)
    motion = sp.reconstruct(deformation, [0.0, 0.0, 0.0], tolerance=1e-6)
    after = pickle.dumps(deformation)
    assert len(after) < 1.1 * len(before)
    again = sp.reconstruct(pickle.loads(after), [0.0, 0.0, 0.0], tolerance=1e-6)
    np.testing.assert_array_equal(again.final_attitude, motion.final_attitude)


@pytest.mark.parametrize("momentum", full_but([0.0, 1.0], 1.0))
def test_panels_span_the_knots_of_a_dense_recording(momentum: float):
    """A loop recorded in 10,000 rows takes few panels, and its attitudes are those along every single interval."""
    body = sp.load_body("cat_two_halves")
    path = loop_of(body, 10_000)
    deformation = sp.articulated(body, path)
    start = momentum * 0.1 * np.array([[0.3, 0.2, 1.0]])
    few = stepped_rotation(deformation.sampler(), start, 1e-9)
    all_of_them = stepped_rotation(deformation.sampler(pointwise=True), start, 1e-11)
    times = np.random.default_rng(0).uniform(0.0, 1.0, 300)
    assert few.interpolant.evaluations < 600
    assert len(few.interpolant.coefficients) < 20
    gaps = [apart(a, b) for a, b in zip(few.rotation(times)[0], all_of_them.rotation(times)[0], strict=True)]
    assert max(gaps) <= few.error_estimate[0] + all_of_them.error_estimate[0]


def test_a_single_wrong_sample_between_the_check_points_is_seen(monkeypatch: pytest.MonkeyPatch):
    """Far fewer nodes than knots, and one sample off by a tenth of a milliradian: panels end next to it."""
    body = sp.load_body("cat_two_halves")
    path = loop_of(body, 4000)
    shapes = path.shape(path.breaks)
    shapes[1717] += 1e-4
    wrong = sp.ShapePath.spline(path.breaks, shapes)
    monkeypatch.setattr(panel_choice, "_WORTH_A_SEARCH", 100)
    sampler = sp.articulated(body, wrong).sampler()
    sampler.refine(0.0, 1e-8)
    edges = sampler.interpolant().edges
    near = wrong.breaks[[1716, 1717, 1718]]
    assert all(np.abs(edges - time).min() < 1e-12 for time in near)
    assert len(edges) < 200


@pytest.mark.parametrize(
    ("search", "numbers"), [(8, (0, 9)), pytest.param(2000, (0, 6, 9, 10), marks=pytest.mark.full)]
)
@needs_compiler
def test_no_recording_is_off_by_more_than_its_estimate(
    search: int, numbers: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
):
    """Smooth, noisy and rounded ones, with and without momentum, beside extended precision."""
    monkeypatch.setattr(panel_choice, "_WORTH_A_SEARCH", search)
    for run in (judged("recordings", 17, 1.0, number) for number in numbers):
        assert not run.error > run.estimate, run.what


def test_panels_sampled_in_another_order_give_the_attitude():
    """The panels of these 80 rows end in one group, some of them sampled before their neighbours on the left."""
    body = sp.load_body("cat_two_halves")
    path = sp.read_shape_path(DATA / "smooth_recording.csv", body)
    momentum = [0.14171062249092722, 0.016446481221561917, -0.1400893070516673]
    times = np.linspace(0.0, path.duration, 9)[1:]
    truth = pinocchio_motion("cat_two_halves", body.joint_names, path, momentum, None, times, path.breaks[1:-1])
    motion = sp.reconstruct(sp.articulated(body, path), momentum)
    # SciPy's steps at rtol 1e-12, some twenty between two of 80 knots.
    assert apart(motion.attitude(times), truth.attitude) < 1e-10


def test_many_rows_are_sampled_in_blocks(monkeypatch: pytest.MonkeyPatch):
    """No call of the body is large, and its samples are those of one call."""
    body = sp.load_body("cat_two_halves")
    path = loop_of(body, 300)
    sizes: list[int] = []
    knots = knots_of(body, path)
    follow, along_path = knots.follow, sp.articulated(body, path).sampler().body_channels

    def counted(shapes: np.ndarray, rates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        sizes.append(len(shapes))
        return follow(shapes, rates)

    whole = KnotSampler(knots, 1, along_path)
    whole.refine(0.0, 1e-9)
    monkeypatch.setattr(knots, "follow", counted)
    monkeypatch.setattr(knots, "directly", lambda *_: None)
    monkeypatch.setattr("shapephase.integrator.recorded.knot_sampling._NODES_AT_ONCE", 200)
    monkeypatch.setattr("shapephase.integrator.recorded.knot_sampling._BODIES_AT_ONCE", 50)
    parts = KnotSampler(knots, 1, along_path)
    parts.refine(0.0, 1e-9)
    assert max(sizes) <= 50 < len(path.breaks)
    assert parts.interpolant().coefficients == pytest.approx(whole.interpolant().coefficients, abs=1e-13)


def test_samples_of_many_rows_are_kept_once():
    """Beside the interpolant's own array there is little."""
    body = sp.load_body("cat_two_halves")
    times = np.linspace(0.0, 180.0, 5001)
    shapes = 0.4 * np.sin(times[:, None] * [0.3, 0.5, 0.7]) + 1e-3 * np.random.default_rng(0).normal(size=(5001, 3))
    sampler = sp.articulated(body, sp.ShapePath.spline(times, shapes)).sampler()
    # What the first call finds out, and what machine code is loaded for it, is not looked at.
    sp.articulated(body, sp.ShapePath.spline(times[:100], shapes[:100])).sampler().refine(0.0, 1e-6)
    tracemalloc.start()
    try:
        sampler.refine(0.0, 1e-6)
        size = sampler.interpolant().coefficients.nbytes
        kept, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert kept < 1.4 * size
