"""Smoothing: the residual is the stated noise, the noise goes and the motion stays, loops close, all of it is C2."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import make_smoothing_spline
from scipy.optimize import brentq

import shapephase as sp
from shapephase.errors import TrajectoryError, TrajectoryWarning
from shapephase.shape_space.files.smoothing import smoothed_path

NAMES = ("hip", "knee")


def loop(t):
    """A closed motion of period 3 s and its rate."""
    w = 2.0 * np.pi / 3.0
    shape = np.stack([np.sin(w * t) + 0.2 * np.cos(3 * w * t), 0.5 * np.cos(w * t) - 0.3], axis=-1)
    rate = np.stack([w * np.cos(w * t) - 0.6 * w * np.sin(3 * w * t), -0.5 * w * np.sin(w * t)], axis=-1)
    return shape, rate


def noisy(noise, count=600, seed=2, even=False):
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 3.0, count) if even else np.concatenate([[0.0, 3.0], rng.uniform(0.0, 3.0, count - 2)])
    t = np.sort(t)
    return t, loop(t)[0] + noise * rng.normal(size=(count, 2))


def jumps(path, order):
    """The largest jump of a derivative of a piecewise cubic at its inner knots, from its coefficients."""
    c, h = path.curve.coefficients, np.diff(path.breaks)[:, None]
    before = {
        0: c[0] + h * (c[1] + h * (c[2] + h * c[3])),
        1: c[1] + h * (2 * c[2] + 3 * h * c[3]),
        2: 2 * c[2] + 6 * h * c[3],
    }[order]
    after = {0: c[0], 1: c[1], 2: 2 * c[2]}[order]
    return np.abs(before[:-1] - after[1:]).max(initial=0.0), np.abs(before[-1] - after[0]).max()


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("noise", [1e-5, 1e-3, 0.03, 0.1])
@pytest.mark.parametrize("count", [30, 600])
def test_the_residual_is_the_stated_noise(count, noise, periodic):
    t, shapes = noisy(noise, count)
    path, residual = smoothed_path(t, shapes, np.full(2, noise), periodic, NAMES)
    np.testing.assert_allclose(residual, noise, rtol=5.1e-4)  # FITPACK meets its sum of squares to a thousandth
    off = shapes - path.shape(t)
    np.testing.assert_allclose(residual, np.sqrt((off**2).sum(axis=0) / count), rtol=1e-12)
    assert np.isin(path.breaks, t).all()
    assert path.breaks[0] == 0.0
    assert path.breaks[-1] == path.duration == t[-1]
    assert path.joint_names == NAMES


@pytest.mark.parametrize("periodic", [False, True])
def test_the_path_is_twice_continuously_differentiable(periodic):
    t, shapes = noisy(0.03)
    path, _ = smoothed_path(t, shapes, np.array([0.03, 0.02]), periodic, NAMES)
    assert len(path.breaks) > 10
    for order, tolerance in ((0, 1e-13), (1, 1e-11), (2, 1e-9)):
        inner, end = jumps(path, order)
        assert inner < tolerance
        assert (end < tolerance) == periodic
    # The rate is the derivative of the shape.
    s = np.linspace(0.01, 2.99, 200)
    np.testing.assert_allclose((path.shape(s + 1e-7) - path.shape(s - 1e-7)) / 2e-7, path.rate(s), atol=2e-7, rtol=0)


def test_the_noise_goes_and_the_motion_stays():
    noise = 0.01
    t, shapes = noisy(noise, 2000, even=True)
    s = np.linspace(0.0, 3.0, 3001)
    shape, rate = loop(s)
    through = sp.ShapePath.spline(t, shapes, periodic=False)
    path, _ = smoothed_path(t, shapes, np.full(2, noise), True, NAMES)
    assert np.sqrt(np.mean((path.shape(s) - shape) ** 2)) < 0.15 * noise
    assert np.sqrt(np.mean((path.rate(s) - rate) ** 2)) < 0.06
    # What the samples themselves would give for the rate is useless.
    assert np.sqrt(np.mean((through.rate(s) - rate) ** 2)) > 3.0


def test_it_agrees_with_the_spline_of_least_curvature():
    """SciPy's other routine (a knot at each sample, least squares and curvature), with the same residual."""
    noise = 0.02
    t, shapes = noisy(noise, 400)
    path, _ = smoothed_path(t, shapes, np.full(2, noise), False, NAMES)
    for joint in range(2):
        y = shapes[:, joint]

        def excess(power, y=y):
            return np.sqrt(np.mean((make_smoothing_spline(t, y, lam=10.0**power)(t) - y) ** 2)) - noise

        best = make_smoothing_spline(t, y, lam=10.0 ** brentq(excess, -12.0, 2.0, xtol=1e-10))
        s = np.linspace(0.1, 2.9, 500)
        assert np.sqrt(np.mean((best(s) - path.shape(s)[:, joint]) ** 2)) < 0.35 * noise


@pytest.mark.parametrize("periodic", [None, True])
def test_a_loop_stays_a_loop(periodic):
    t, shapes = noisy(0.02)
    if periodic is None:
        shapes[-1] = shapes[0]
    path, _ = smoothed_path(t, shapes, np.full(2, 0.02), periodic, NAMES)
    np.testing.assert_allclose(path.gap, 0.0, atol=1e-14, rtol=0)
    np.testing.assert_allclose(path.rate(0.0), path.rate(3.0), atol=1e-11, rtol=0)
    assert path.repeated(3).duration == 9.0
    still_open, _ = smoothed_path(t, noisy(0.02)[1], np.full(2, 0.02), None, NAMES)
    assert np.abs(still_open.gap).max() > 1e-4


def test_both_ends_of_a_loop_weigh_alike():
    """Reversed in time, the samples give the reversed path, so neither end is favoured."""
    t, shapes = noisy(0.02, 40)
    there, _ = smoothed_path(t, shapes, np.full(2, 0.02), True, NAMES)
    # The knots are chosen by a search that runs forward in time, so only the fit is the same, not each digit.
    back, _ = smoothed_path(3.0 - t[::-1], shapes[::-1], np.full(2, 0.02), True, NAMES)
    middle = 0.5 * (shapes[0] + shapes[-1])
    for path in (there, back):
        assert np.abs(path.shape(0.0) - middle).max() < 0.04
    np.testing.assert_allclose(there.shape(0.0), back.shape(3.0), atol=0.012, rtol=0)


def test_a_gap_wider_than_the_noise_is_no_loop():
    t, shapes = noisy(0.01)
    shapes[-1, 1] = shapes[0, 1] + 0.08
    with pytest.raises(TrajectoryError, match=r"joint knee ends 0\.08 from its start with a noise level of 0\.01"):
        smoothed_path(t, shapes, np.full(2, 0.01), True, NAMES)
    path, residual = smoothed_path(t, shapes, np.full(2, 0.02), True, NAMES)
    np.testing.assert_allclose(residual, 0.02, rtol=5.1e-4)  # FITPACK meets its sum of squares to a thousandth
    np.testing.assert_allclose(path.gap, 0.0, atol=1e-14, rtol=0)


def test_a_gap_that_spends_all_the_noise_is_refused():
    t, shapes = noisy(0.0, 6)
    shapes[-1, 0] = shapes[0, 0] + 0.06
    with pytest.raises(TrajectoryError, match=r"joint hip could not be smoothed to 0\.01: the spline stays 0\.0173"):
        smoothed_path(t, shapes, np.full(2, 0.01), True, NAMES)


@pytest.mark.parametrize("periodic", [None, False])
def test_no_noise_is_interpolation(periodic):
    t, shapes = noisy(0.01, 30)
    shapes[-1] = shapes[0]
    path, residual = smoothed_path(t, shapes, np.zeros(2), periodic, NAMES)
    plain = sp.ShapePath.spline(t, shapes, periodic)
    s = np.linspace(0.0, 3.0, 100)
    np.testing.assert_array_equal(path.shape(s), plain.shape(s))
    assert residual.max() < 1e-14


@pytest.mark.parametrize("periodic", [False, True])
def test_of_two_joints_one_is_smoothed_and_one_interpolated(periodic):
    t, shapes = noisy(0.01, 50)
    shapes[:, 1] -= shapes[0, 1]
    shapes[-1] = shapes[0] + [0.0, 1e-10]  # closed, as closed as a file can say
    path, residual = smoothed_path(t, shapes, np.array([0.01, 0.0]), periodic, NAMES)
    np.testing.assert_allclose(residual, [0.01, 0.0], atol=1e-5, rtol=0)
    plain = sp.ShapePath.spline(t, shapes, periodic)
    s = np.linspace(0.0, 3.0, 333)
    np.testing.assert_allclose(path.shape(s)[:, 1], plain.shape(s)[:, 1], atol=1e-13, rtol=0)
    np.testing.assert_allclose(path.rate(s)[:, 1], plain.rate(s)[:, 1], atol=1e-10, rtol=0)


def test_a_joint_at_rest_stays_where_it_is():
    t, shapes = noisy(0.01, 60)
    shapes[:, 1] = 0.3
    path, residual = smoothed_path(t, shapes, np.full(2, 0.01), True, NAMES)
    np.testing.assert_allclose(path.shape(t)[:, 1], 0.3, atol=1e-15, rtol=0)
    assert residual[1] < 1e-15


def test_a_joint_below_its_noise_is_told_and_a_whole_motion_refused():
    rng = np.random.default_rng(4)
    t, shapes = noisy(0.01, 300)
    shapes[:, 1] = 0.3 + 0.009 * rng.normal(size=300)
    with pytest.warns(TrajectoryWarning, match=r"joint knee moves by 0\.00\d+ rms about its mean"):
        path, _ = smoothed_path(t, shapes, np.full(2, 0.01), True, NAMES)
    np.testing.assert_allclose(path.shape(t)[:, 1], shapes[:, 1].mean(), atol=1e-4, rtol=0)
    with pytest.raises(TrajectoryError, match=r"no joint moves more than its noise level.*hip most"):
        smoothed_path(t, shapes, np.full(2, 10.0), False, NAMES)


def test_a_cubic_within_the_noise_is_kept_as_it_is():
    t = np.linspace(0.0, 2.0, 50)
    cubic = np.stack([t**3 - 2 * t, 1 - t**2], axis=1)
    path, residual = smoothed_path(t, cubic, np.full(2, 1e-3), False, NAMES)
    assert residual.max() < 1e-13
    np.testing.assert_array_equal(path.breaks, [0.0, 2.0])
    np.testing.assert_allclose(path.curve.coefficients[:, 0].T, [[0, -2, 0, 1], [1, 0, -1, 0]], atol=1e-12, rtol=0)


def test_few_samples_are_refused():
    with pytest.raises(TrajectoryError, match="5 samples or more, got 4"):
        smoothed_path(np.arange(4.0), np.eye(4)[:, :2], np.full(2, 0.1), False, NAMES)


@settings(max_examples=30, derandomize=True, deadline=None)
@given(st.sampled_from([1e-6, 1e-3, 1.0, 1e3]), st.sampled_from([1e-3, 1.0, 1e3]), st.floats(-100.0, 100.0))
def test_units_of_shape_and_time_and_the_zero_do_not_matter(scale, slow, zero):
    t, shapes = noisy(0.02, 80)
    noise = np.full(2, 0.02)
    first, left = smoothed_path(t, shapes, noise, True, NAMES)
    other, also = smoothed_path(slow * t, scale * (shapes + zero), scale * noise, True, NAMES)
    np.testing.assert_allclose(also, scale * left, rtol=1e-6)
    s = np.linspace(0.0, 3.0, 100)
    again = other.shape(np.clip(slow * s, 0.0, other.duration)) / scale - zero
    np.testing.assert_allclose(again, first.shape(s), atol=1e-9, rtol=0)
