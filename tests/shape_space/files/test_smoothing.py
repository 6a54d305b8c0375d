"""Smoothing: a linear map whose bias is told, the noise goes and the motion stays, loops close, all of it is C2."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, make_smoothing_spline

import shapephase as sp
from shapephase.errors import ShapeError, ShapePhaseError, TrajectoryError, TrajectoryWarning
from shapephase.shape_space.files._linear_smoother import LinearSmoother
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


def smoother_of(path):
    return path.curve.origin.smoother


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


def least_curvature(t, values, weights, penalty):
    """The periodic smoothing spline at its knots, of dense matrices: second derivatives are broken lines, whose squares
    Simpson's rule sums exactly."""
    unit = np.eye(len(t))[:, : len(t) - 1]
    unit[-1, 0] = 1.0
    bends = CubicSpline(t, unit, bc_type="periodic")
    roughness = np.zeros((len(t) - 1, len(t) - 1))
    for at, share in ((t[:-1], 1.0), (0.5 * (t[1:] + t[:-1]), 4.0), (t[1:], 1.0)):
        there = bends(at, nu=2)
        roughness += np.einsum("i,ij,ik->jk", share * np.diff(t) / 6.0, there, there)
    return np.linalg.solve(np.diag(weights) + penalty * roughness, weights[:, None] * values)


@pytest.mark.parametrize("penalty", [1e-9, 1e-6, 1e-4])
def test_it_is_the_spline_of_least_curvature(penalty):
    """Closed, one of dense matrices, with the mean of both ends at double weight; open, SciPy's far from the ends."""
    t, shapes = noisy(0.02, 60)
    loop_path, _ = smoothed_path(t, shapes, 0.02, True, penalty=penalty)
    weights = np.ones(59)
    weights[0] = 2.0
    joined = np.concatenate([0.5 * (shapes[:1] + shapes[-1:]), shapes[1:-1]])
    expected = least_curvature(t, joined, weights, penalty)
    np.testing.assert_allclose(loop_path.shape(t[:-1]), expected, atol=1e-10, rtol=0)
    t, shapes = noisy(0.02, 600, even=True)
    path, _ = smoothed_path(t, shapes, 0.02, False, penalty=penalty)
    # What the ends do dies out as exp(-distance/width) or faster.
    width = (4.0 * penalty * 3.0 / 599.0) ** 0.25
    inner = slice(250, 350)
    for joint in range(2):
        expected = make_smoothing_spline(t, shapes[:, joint], lam=penalty)(t)
        off = path.shape(t)[inner, joint] - expected[inner]
        assert np.abs(off).max() < 1e-9 + np.exp(-1.25 / width)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("noise", [1e-5, 1e-3, 0.03])
def test_what_is_taken_off_the_motion_is_small_and_told(noise, periodic):
    """The bias of the samples without noise, in bars of the number that shows it most."""
    t, shapes = noisy(noise, 120, even=True)
    path, found = smoothed_path(t, shapes, noise, periodic, NAMES)
    off = shapes - path.shape(t)
    np.testing.assert_allclose(found.residual, np.sqrt((off**2).mean(axis=0)), rtol=1e-12)
    assert found.residual.max() < noise
    assert found.bias_in_bars <= 0.2 * (1.0 + 1e-12)
    count = 120 - periodic
    assert smoother_of(path).penalty == found.penalty
    assert 2.0 < found.degrees_of_freedom < count
    exact, smoother = loop(t)[0][:count], smoother_of(path)
    bias = smoother(exact) - exact
    # A number g has the bias g.b and the bar |S^T g| (in weights): at most |S^-1 b|.
    worst = np.sqrt(smoother.weights)[:, None] * np.linalg.solve(smoother(np.eye(count)), bias)
    assert np.linalg.norm(worst) < 0.25 * noise
    told = np.linalg.norm(found.bias[:, 0]) / np.linalg.norm(bias[:, 0])
    assert 0.5 < told < 2.0


def test_degrees_of_freedom_are_the_trace_of_the_map():
    """Of many samples it is estimated, to some hundredths."""
    for count, near in ((150, 1e-10), (900, 0.1)):
        smoother = LinearSmoother(np.linspace(0.0, 3.0, count), False, 1e-5, 0.1)
        assert smoother.degrees_of_freedom == pytest.approx(np.trace(smoother(np.eye(count))), rel=near)


@pytest.mark.parametrize("periodic", [False, True])
def test_what_goes_backwards_is_the_transpose(periodic):
    t, _ = noisy(0.0, 20)
    smoother = LinearSmoother.of_width(t, periodic, 1e-3)
    unit = np.eye(20 - periodic)
    np.testing.assert_allclose(smoother.transposed(unit), smoother(unit).T, atol=1e-11)


def test_a_penalty_that_is_given_is_used_and_judged():
    t, shapes = noisy(0.01, 60)
    _, chosen = smoothed_path(t, shapes, 0.01, True)
    _, wide = smoothed_path(t, shapes, 0.01, True, penalty=1e3 * chosen.penalty)
    assert wide.penalty == 1e3 * chosen.penalty
    assert wide.bias_in_bars == pytest.approx(1e3 * chosen.bias_in_bars)
    assert wide.degrees_of_freedom < chosen.degrees_of_freedom
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(ShapePhaseError, match="smooth_penalty"):
            smoothed_path(t, shapes, 0.01, True, penalty=wrong)
    with pytest.raises(TrajectoryError, match="state the noise"):
        smoothed_path(t, shapes, 0.0, False, penalty=1.0)
    for wrong in (-1.0, [0.1, 0.2, 0.3]):
        with pytest.raises(ShapeError, match="noise: a number or 2 of them"):
            smoothed_path(t, shapes, wrong, False)


@pytest.mark.parametrize("periodic", [False, True])
def test_the_path_is_twice_continuously_differentiable(periodic):
    t, shapes = noisy(0.03, even=True)
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
    t, shapes = noisy(0.02, 40, even=True)
    there, _ = smoothed_path(t, shapes, np.full(2, 0.02), True, NAMES)
    back, _ = smoothed_path(3.0 - t[::-1], shapes[::-1], np.full(2, 0.02), True, NAMES)
    middle = 0.5 * (shapes[0] + shapes[-1])
    for path in (there, back):
        assert np.abs(path.shape(0.0) - middle).max() < 0.04
    np.testing.assert_allclose(there.shape(0.0), back.shape(3.0), atol=1e-9, rtol=0)


def test_a_gap_wider_than_the_noise_is_no_loop():
    t, shapes = noisy(0.01)
    shapes[-1, 1] = shapes[0, 1] + 0.08
    with pytest.raises(TrajectoryError, match=r"joint knee ends 0\.08 from its start with a noise level of 0\.01"):
        smoothed_path(t, shapes, np.full(2, 0.01), True, NAMES)
    path, _ = smoothed_path(t, shapes, np.full(2, 0.02), True, NAMES)
    np.testing.assert_allclose(path.gap, 0.0, atol=1e-14, rtol=0)


@pytest.mark.parametrize("periodic", [None, False])
def test_no_noise_is_interpolation(periodic):
    t, shapes = noisy(0.01, 30)
    shapes[-1] = shapes[0]
    path, found = smoothed_path(t, shapes, np.zeros(2), periodic, NAMES)
    plain = sp.ShapePath.spline(t, shapes, periodic)
    s = np.linspace(0.0, 3.0, 100)
    np.testing.assert_array_equal(path.shape(s), plain.shape(s))
    assert found.residual.max() < 1e-14
    assert (found.penalty, found.bias_in_bars, found.degrees_of_freedom) == (0.0, 0.0, 29.0 + (periodic is False))


@pytest.mark.parametrize("periodic", [False, True])
def test_of_two_joints_one_is_smoothed_and_one_interpolated(periodic):
    t, shapes = noisy(0.01, 50)
    shapes[:, 1] -= shapes[0, 1]
    shapes[-1] = shapes[0] + [0.0, 1e-10]  # closed, as closed as a file can say
    path, found = smoothed_path(t, shapes, np.array([0.01, 0.0]), periodic, NAMES)
    assert 0.002 < found.residual[0] < 0.01
    assert found.residual[1] < 1e-10
    plain = sp.ShapePath.spline(t, shapes, periodic)
    s = np.linspace(0.0, 3.0, 333)
    np.testing.assert_allclose(path.shape(s)[:, 1], plain.shape(s)[:, 1], atol=1e-13, rtol=0)
    np.testing.assert_allclose(path.rate(s)[:, 1], plain.rate(s)[:, 1], atol=1e-10, rtol=0)


def test_a_joint_at_rest_stays_where_it_is():
    t, shapes = noisy(0.01, 60)
    shapes[:, 1] = 0.3
    path, found = smoothed_path(t, shapes, np.full(2, 0.01), True, NAMES)
    np.testing.assert_allclose(path.shape(t)[:, 1], 0.3, atol=1e-15, rtol=0)
    assert found.residual[1] < 1e-15
    assert not found.bias[:, 1].any()


def test_a_joint_below_its_noise_is_told_and_a_whole_motion_refused():
    rng = np.random.default_rng(4)
    t, shapes = noisy(0.01, 300)
    shapes[:, 1] = 0.3 + 0.009 * rng.normal(size=300)
    with pytest.warns(TrajectoryWarning, match=r"joint knee moves by 0\.00\d+ rms about its mean"):
        smoothed_path(t, shapes, np.full(2, 0.01), True, NAMES)
    with pytest.raises(TrajectoryError, match=r"no joint moves more than its noise level.*hip most"):
        smoothed_path(t, shapes, np.full(2, 10.0), False, NAMES)


def test_a_straight_line_is_kept_as_it_is():
    t = np.linspace(0.0, 2.0, 50)
    line = np.stack([1.0 - 3.0 * t, 0.5 + t], axis=1)
    path, _ = smoothed_path(t, line, 1e-3, False, NAMES, penalty=10.0)
    np.testing.assert_allclose(path.shape(t), line, atol=1e-11, rtol=0)


def test_few_samples_are_refused():
    with pytest.raises(TrajectoryError, match="5 samples or more, got 4"):
        smoothed_path(np.arange(4.0), np.eye(4)[:, :2], np.full(2, 0.1), False, NAMES)


@pytest.mark.parametrize("scale", [1e-6, 1e3])
@pytest.mark.parametrize("slow", [1e-3, 1e3])
def test_units_of_shape_and_time_and_the_zero_do_not_matter(scale, slow):
    t, shapes = noisy(0.02, 80, even=True)
    first, left = smoothed_path(t, shapes, 0.02, True, NAMES)
    other, also = smoothed_path(slow * t, scale * (shapes - 70.0), scale * 0.02, True, NAMES)
    np.testing.assert_allclose(also.residual, scale * left.residual, rtol=1e-6)
    np.testing.assert_allclose(also.bias, scale * left.bias, atol=1e-6 * scale * np.abs(left.bias).max())
    assert also.penalty == pytest.approx(slow**3 * left.penalty, rel=1e-6)
    s = np.linspace(0.0, 3.0, 100)
    again = other.shape(np.clip(slow * s, 0.0, other.duration)) / scale + 70.0
    np.testing.assert_allclose(again, first.shape(s), atol=1e-9, rtol=0)
