"""Extremes of joints, tables of paths and integrals along them, however often the paths swing."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import TrajectoryError, TrajectoryWarning

CAT = sp.load_body("cat_two_halves")
NAMES = CAT.joint_names


def swings(harmonic: int, size: float = 0.5, duration: float = 1.0) -> sp.ShapePath:
    """A circle of two joints that is gone through so many times, by one harmonic."""
    cosines, sines = np.zeros((2, 3, harmonic))
    cosines[0, -1] = sines[1, -1] = size
    return sp.ShapePath.fourier(np.zeros(3), cosines, sines, duration, joint_names=NAMES)


def burst(width: float, duration: float = 1.0) -> sp.ShapePath:
    """A swing of one joint by 1 rad and back, known only as a function, in a small part of the duration."""

    def bell(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        since = (times - 0.3123 * duration) / width
        values = np.exp(-(since**2))
        rest = np.zeros_like(times)
        return np.stack([values, rest, rest], axis=1), np.stack([-2.0 * since / width * values, rest, rest], axis=1)

    return sp.ShapePath.function(bell, duration, joint_names=NAMES)


@lru_cache
def few_terms() -> sp.MinimumPerturbation:
    """Frames of little disturbance, of low degree, so that they are quick."""
    return sp.minimum_perturbation(CAT, np.zeros(3), 0.5, degree=1)


@pytest.mark.parametrize("count", [1, 7, 100, 200, 300])
@pytest.mark.parametrize("kind", ["repeated", "harmonic"])
def test_extremes_of_loops_gone_through_many_times_are_those_of_one_sine(count: int, kind: str) -> None:
    """A sine of 3 rad reaches 3 rad, and its rate 3 times its angular frequency; 400 loops are seen whole, too."""
    path = swings(1, 3.0).repeated(count) if kind == "repeated" else swings(count, 3.0, float(count))
    found = sp.path_summary(CAT, path)
    assert np.allclose(found.highest, [3.0, 3.0, 0.0], rtol=1e-14)
    assert np.allclose(found.lowest, [-3.0, -3.0, 0.0], rtol=1e-14)
    assert np.allclose(found.fastest, [6.0 * np.pi, 6.0 * np.pi, 0.0], rtol=1e-13)


def test_extremes_of_a_slow_swing_with_a_fast_one_are_roots_of_its_derivative() -> None:
    """By the roots on the unit circle of the polynomial in exp(i t) that the derivative of a Fourier series is."""
    rng = np.random.default_rng(7)
    order = 40
    cosines, sines = 0.2 * rng.normal(size=(2, 3, order)) / np.arange(1, order + 1)
    path = sp.ShapePath.fourier(np.zeros(3), cosines, sines, 2.0 * np.pi, joint_names=NAMES)
    found = sp.path_summary(CAT, path)
    k = np.arange(1, order + 1)
    for joint in range(3):
        half = 0.5 * (cosines[joint] - 1j * sines[joint])
        whole = np.concatenate([np.conj(half[::-1]), [0.0], half])
        for power, high, low in ((1, found.highest, found.lowest), (2, found.fastest, -found.fastest)):
            slopes = whole * (1j * np.concatenate([-k[::-1], [0], k])) ** power
            roots = np.roots(slopes[::-1])
            angles = np.angle(roots[np.abs(np.abs(roots) - 1.0) < 1e-6])
            values = path.shape(np.mod(angles, 2.0 * np.pi)) if power == 1 else path.rate(np.mod(angles, 2.0 * np.pi))
            top, bottom = values[:, joint].max(), values[:, joint].min()
            if power == 2:
                top, bottom = np.abs(values[:, joint]).max(), -np.abs(values[:, joint]).max()
            assert np.isclose(high[joint], top, rtol=1e-10)
            assert np.isclose(low[joint], bottom, rtol=1e-10)


def test_extremes_of_splines_lie_between_their_knots() -> None:
    """Of the cubic t (1 - t) (0.5 - t): where 6 t^2 - 6 t + 1 is zero; its rate is largest at the ends."""
    times = np.linspace(0.0, 1.0, 4)
    shapes = np.zeros((4, 3))
    shapes[:, 0] = times * (1.0 - times) * (0.5 - times)
    found = sp.path_summary(CAT, sp.ShapePath.spline(times, shapes, periodic=False, joint_names=NAMES))
    top = np.sqrt(3.0) / 36.0
    assert np.allclose([found.highest[0], found.lowest[0], found.fastest[0]], [top, -top, 0.5], rtol=1e-13)


def test_extremes_of_a_short_burst_known_only_as_a_function_are_found() -> None:
    """A bell of 1/1,000 of the duration is 1 rad high, and its rate is largest where its second derivative is zero."""
    width = 1e-3
    found = sp.path_summary(CAT, burst(width))
    assert np.isclose(found.highest[0], 1.0, rtol=1e-12)
    assert np.isclose(found.fastest[0], np.sqrt(2.0) * np.exp(-0.5) / width, rtol=1e-9)


def test_a_joint_that_winds_goes_as_far_as_all_its_loops() -> None:
    """Ten loops of one turn each, of a joint without limits, there and back: 20 pi, and 0."""
    body = sp.load_body("satellite")
    wheel = int(np.flatnonzero(body.continuous)[0])
    turned = np.zeros((2, body.n_shape))
    turned[1, wheel] = 2.0 * np.pi
    path = sp.ShapePath.waypoints([0.0, 1.0], turned, joint_names=body.joint_names).repeated(10)
    there, back = sp.path_summary(body, path), sp.path_summary(body, path.reversed())
    assert np.isclose(there.highest[wheel], 20.0 * np.pi, rtol=1e-14)
    assert there.lowest[wheel] == 0.0
    assert np.isclose(back.highest[wheel], 20.0 * np.pi, rtol=1e-14)
    assert np.isclose(there.fastest[wheel], 2.0 * np.pi * 1.875, rtol=1e-13)


@pytest.mark.parametrize("count", [1, 20, 200])
def test_a_table_is_read_back_as_the_path(count: int, tmp_path) -> None:
    """To 1e-9 rad at times that are in no table: 400 rows saw nothing of 200 loops."""
    path, file = swings(count) if count < 200 else swings(1).repeated(count), tmp_path / "m.npz"
    sp.write_shape_path(path, file)
    again = sp.read_shape_path(file, CAT)
    times = path.duration * np.random.default_rng(count).random(4000)
    assert np.abs(again.shape(times) - path.shape(times)).max() < 1e-9


@pytest.mark.parametrize(
    "path", [burst(1e-3), burst(1e-3).repeated(3), burst(2e-3).reversed()], ids=["once", "3", "back"]
)
def test_a_table_of_a_burst_is_read_back_as_the_path(path: sp.ShapePath, tmp_path) -> None:
    file = tmp_path / "m.csv"
    sp.write_shape_path(path, file)
    again = sp.read_shape_path(file, CAT)
    times = path.duration * np.random.default_rng(3).random(20_000)
    assert np.abs(again.shape(times) - path.shape(times)).max() < 1e-9


def test_a_table_of_a_path_with_a_kink_has_ever_nearer_rows_there(tmp_path) -> None:
    """Which a reader takes for what they are: no row stands twice, nothing is warned of."""

    def tent(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        rest = np.zeros_like(times)
        rising = times < 0.37
        values = np.where(rising, times, 0.74 - times)
        return np.stack([values, rest, rest], axis=1), np.stack([np.where(rising, 1.0, -1.0), rest, rest], axis=1)

    path = sp.ShapePath.function(tent, 1.0, [0.37], joint_names=NAMES)
    sp.write_shape_path(path, tmp_path / "m.csv")
    again = sp.read_shape_path(tmp_path / "m.csv", CAT)
    times = 0.37 + np.concatenate([-np.logspace(-10, -0.5, 60), np.logspace(-10, -0.3, 60)])
    assert np.abs(again.shape(times) - path.shape(times)).max() < 1e-9


def test_rows_that_do_not_describe_the_path_are_warned_of(tmp_path) -> None:
    with pytest.warns(TrajectoryWarning, match="waist_pitch"):
        sp.write_shape_path(swings(10), tmp_path / "m.csv", np.linspace(0.0, 1.0, 11))


def test_a_path_that_needs_too_many_rows_says_so(tmp_path) -> None:
    with pytest.raises(TrajectoryError, match="times"):
        sp.write_shape_path(swings(1).repeated(70_000), tmp_path / "m.csv")


@pytest.mark.parametrize("count", [64, 100, 300])
@pytest.mark.parametrize("kind", ["repeated", "harmonic"])
def test_first_order_turn_of_many_loops_is_that_of_one_as_often(count: int, kind: str) -> None:
    """exp(-n integral): the integral of one loop by the trapezoid rule, which is exact for a smooth loop."""
    frames = few_terms()
    loop = swings(1, 0.4)
    times = np.arange(200) / 200.0
    rates = np.einsum("tak,tk->ta", frames.connection(loop.shape(times)), loop.rate(times))
    start = frames.frame(loop.shape(0.0))
    expected = start.T @ sp.so3.exp(-count * rates.mean(axis=0)) @ start
    path = loop.repeated(count) if kind == "repeated" else swings(count, 0.4)
    assert sp.so3.angle(expected.T @ frames.first_order_turn(path)) < 1e-12 * count


def test_holonomy_derivative_of_a_path_of_many_swings_is_that_of_one_loop() -> None:
    """By the size of the loop, of a series whose only harmonic is a high one; against the difference of holonomies."""
    path, step = swings(60, 0.3), 1e-4
    _, slope = sp.holonomy_derivative(CAT, path, lambda times: path.shape(times)[:, None] / 0.3)
    larger, smaller = (sp.holonomy(CAT, swings(60, 0.3 + sign * step), 1e-12) for sign in (1, -1))
    differences = sp.so3.log(larger @ smaller.T) / (2.0 * step)
    assert np.allclose(slope[0], differences, atol=1e-4 * np.linalg.norm(differences))


def test_a_path_joined_of_many_loops_knows_how_often_it_swings() -> None:
    joined = swings(1).repeated(30).then(swings(1))
    assert joined.swings.most == 30.0
    assert np.isclose(sp.path_summary(CAT, joined).highest[0], 0.5, rtol=1e-14)
