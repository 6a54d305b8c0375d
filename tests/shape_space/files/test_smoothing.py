"""Smoothing: a linear map whose bias is known, the noise goes and the motion stays, also where a recording ends."""

import re

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

import shapephase as sp
from shapephase.errors import ShapeError, ShapePhaseError, TrajectoryError, TrajectoryWarning
from shapephase.shape_space.files import smoothed_path
from shapephase.shape_space.linear_smoother import LinearSmoother
from support.long_runs import full_but

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
    return path.origin.smoother


def least_jerk(t, values, weights, penalty, periodic=True):
    """The quintic smoothing spline at its knots, of dense matrices: of the splines of degree five through unit samples
    the third derivatives are parabolas, whose squares Gauss's rule of three points sums exactly."""
    count = len(t) - periodic
    unit = np.eye(len(t))[:, :count]
    if periodic:
        unit[-1, 0] = 1.0
    none = np.zeros(count)
    ends = "periodic" if periodic else ([(3, none), (4, none)], [(3, none), (4, none)])
    jerks = make_interp_spline(t, unit, k=5, bc_type=ends)
    nodes, shares = np.polynomial.legendre.leggauss(3)
    half = 0.5 * np.diff(t)
    roughness = np.zeros((count, count))
    for node, share in zip(nodes, shares, strict=True):
        there = jerks(t[:-1] + half * (1.0 + node), nu=3)
        roughness += np.einsum("i,ij,ik->jk", share * half, there, there)
    return np.linalg.solve(np.diag(weights) + penalty * roughness, weights[:, None] * values)


@pytest.mark.parametrize("penalty", [1e-9, 1e-6, 1e-4])
def test_it_is_the_spline_of_least_jerk(penalty):
    """Closed, with the mean of both ends at double weight, and open, with natural ends."""
    t, shapes = noisy(0.02, 40)
    t = 0.5 * (t + np.linspace(0.0, 3.0, 40))  # uneven, and no two times so near that dense matrices lose digits
    loop_path, _ = smoothed_path(t, shapes, 0.02, True, penalty=penalty)
    weights = np.ones(39)
    weights[0] = 2.0
    joined = np.concatenate([0.5 * (shapes[:1] + shapes[-1:]), shapes[1:-1]])
    expected = least_jerk(t, joined, weights, penalty)
    np.testing.assert_allclose(loop_path.shape(t[:-1]), expected, atol=1e-8, rtol=0)
    path, _ = smoothed_path(t, shapes, 0.02, False, penalty=penalty)
    expected = least_jerk(t, shapes, np.ones(40), penalty, periodic=False)
    np.testing.assert_allclose(path.shape(t), expected, atol=1e-8, rtol=0)


@pytest.mark.parametrize("width", full_but([3.0, 30.0, 300.0], 30.0))
def test_wide_penalties_keep_their_digits(width):
    """Over a loop of even times the map is a convolution, known by its Fourier transform; a width is where half of what
    swings goes, so that what swings 40 times as slowly is kept to 40^-6."""
    t = np.linspace(0.0, 1.0, 20001)
    swing = np.round(20000.0 / (2.0 * np.pi * 40.0 * width))
    wave = np.sin(2.0 * np.pi * swing * t[:-1])[:, None]
    smoother = LinearSmoother(t, True, np.array([width**6 * (1.0 / 20000.0) ** 5]))
    kept = 1.0 / (1.0 + (width * 2.0 * np.pi * swing / 20000.0) ** 6)
    # The first value has double weight, which moves those near it.
    far = slice(6000, 14000)
    np.testing.assert_allclose(smoother(wave)[far], kept * wave[far], atol=1e-8, rtol=0)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("noise", [1e-3, 0.03])
def test_what_is_taken_off_the_motion_is_known(noise, periodic):
    """The bias is that of the samples without noise, to some of what noise leaves."""
    t, shapes = noisy(noise, 120, even=True)
    path, found = smoothed_path(t, shapes, noise, periodic, NAMES)
    off = shapes - path.shape(t)
    np.testing.assert_allclose(found.residual, np.sqrt((off**2).mean(axis=0)), rtol=1e-12)
    assert found.residual.max() < 1.2 * noise
    count = 120 - periodic
    smoother = smoother_of(path)
    np.testing.assert_array_equal(smoother.penalties, found.penalty)
    assert np.all((found.degrees_of_freedom > 3.0) & (found.degrees_of_freedom < count))
    exact = loop(t)[0][:count]
    bias = smoother(exact) - exact
    assert np.sqrt(np.mean((found.bias - bias) ** 2)) < 0.5 * np.sqrt(np.mean(bias**2)) + 0.1 * noise
    assert found.bias_in_bars < 1.0


def ends_and_middle(estimate, truth):
    """Rms errors of rate and acceleration at both ends, and in the middle: (2, 2)."""
    off = [estimate(nu=nu) - truth[nu - 1] for nu in (1, 2)]
    return np.array([[np.sqrt(np.mean(part**2)) for part in (one[[0, -1]], one[2:-2])] for one in off])


@pytest.mark.parametrize(("count", "noise"), [(46, 0.02), (61, 0.005)])
def test_where_a_recording_ends_errors_are_those_of_the_best_quintic_spline(count, noise):
    """At most 1.5 times the least that any one penalty has over 12 seeds, for rate and for acceleration; the best
    penalty is found with the truth known."""
    t, at = np.linspace(0.0, 1.5, count), np.linspace(0.0, 1.5, 16)
    swing, turn = np.array([4.0, 7.5]), np.array([0.4, 2.0])
    phase = swing * at[:, None] + turn
    truth = [swing * np.cos(phase), -(swing**2) * np.sin(phase)]
    rng = np.random.default_rng(1)
    seeds = [np.sin(swing * t[:, None] + turn) + noise * rng.normal(size=(count, 2)) for _ in range(12)]
    ours = []
    for samples in seeds:
        path, _ = smoothed_path(t, samples, noise, False)
        ours.append(ends_and_middle(lambda nu, p=path: p.rate(at) if nu == 1 else p.acceleration(at), truth))
    none = np.zeros((2, len(seeds) * 2))
    natural = [[(3, end), (4, end)] for end in (none[0], none[1])]
    together = np.hstack(seeds)
    least = np.full(2, np.inf)
    for penalty in 10.0 ** np.arange(-10.0, -3.0, 0.5):
        values = least_jerk(t, together, np.ones(count), penalty, periodic=False)
        spline = make_interp_spline(t, values, k=5, bc_type=tuple(natural))
        for nu in (1, 2):
            off = spline(at[[0, -1]], nu=nu).reshape(2, -1, 2) - truth[nu - 1][[0, -1]][:, None]
            least[nu - 1] = min(least[nu - 1], np.sqrt(np.mean(off**2)))
    at_ends = np.sqrt(np.mean(np.square(ours), axis=0))[:, 0]
    assert np.all(at_ends < 1.5 * least)


def test_degrees_of_freedom_are_the_trace_of_the_map():
    for periodic in (False, True):
        smoother = LinearSmoother(np.linspace(0.0, 3.0, 81), periodic, np.full(81 - periodic, 1e-5))
        assert smoother.degrees_of_freedom()[0] == pytest.approx(np.trace(smoother(np.eye(81 - periodic))), rel=1e-6)


@pytest.mark.parametrize("periodic", [False, True])
def test_what_goes_backwards_is_the_transpose(periodic):
    t, _ = noisy(0.0, 20)
    count = 20 - periodic
    smoother = LinearSmoother(t, periodic, np.full(count, 1e-5))
    unit = np.eye(count)
    backwards = LinearSmoother(t, periodic, np.full(1, 1e-5)).transposed(unit[:, :, None])[:, :, 0]
    np.testing.assert_allclose(backwards, smoother(unit).T, atol=1e-11)


def test_a_penalty_that_is_given_is_used_and_judged():
    t, shapes = noisy(0.01, 60)
    _, chosen = smoothed_path(t, shapes, 0.01, True)
    most = float(chosen.penalty.max())
    _, wide = smoothed_path(t, shapes, 0.01, True, penalty=1e3 * most)
    np.testing.assert_array_equal(wide.penalty, 1e3 * most)
    assert wide.bias_in_bars > 3.0 * chosen.bias_in_bars
    assert np.all(wide.degrees_of_freedom < chosen.degrees_of_freedom)
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(ShapePhaseError, match="smooth_penalty"):
            smoothed_path(t, shapes, 0.01, True, penalty=wrong)
    with pytest.raises(TrajectoryError, match="--smooth"):
        smoothed_path(t, shapes, 0.0, False, penalty=1.0)
    for wrong in (-1.0, [0.1, 0.2, 0.3]):
        with pytest.raises(ShapeError, match="noise"):
            smoothed_path(t, shapes, wrong, False)


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
    with pytest.raises(TrajectoryError, match="knee"):
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
    assert not found.penalty.any()
    assert found.bias_in_bars == 0.0
    np.testing.assert_array_equal(found.degrees_of_freedom, 29.0 + (periodic is False))


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
    with pytest.warns(TrajectoryWarning, match="knee"):
        smoothed_path(t, shapes, np.full(2, 0.01), True, NAMES)
    with pytest.raises(TrajectoryError, match="hip"):
        smoothed_path(t, shapes, np.full(2, 10.0), False, NAMES)


def test_joints_below_their_noise_are_one_warning_and_a_ball_joint_is_one_joint():
    rng, t = np.random.default_rng(4), np.linspace(0.0, 3.0, 300)
    still = 0.003 * rng.normal(size=(300, 3))
    neck = np.column_stack([still, np.sqrt(1.0 - np.sum(still**2, axis=1))])
    shapes = np.column_stack([loop(t)[0][:, 0], neck, 0.009 * rng.normal(size=300)])
    names = ("hip", "neck.x", "neck.y", "neck.z", "neck.w", "knee")
    with pytest.warns(TrajectoryWarning) as caught:
        smoothed_path(t, shapes, np.full(6, 0.01), False, names)
    (said,) = (str(warning.message) for warning in caught)
    assert re.search(r"of 2 joints: neck \(by 0\.003\d*\), knee \(by 0\.009\d*\)$", said)


def test_a_straight_line_is_kept_as_it_is():
    t = np.linspace(0.0, 2.0, 50)
    line = np.stack([1.0 - 3.0 * t, 0.5 + t], axis=1)
    path, _ = smoothed_path(t, line, 1e-3, False, NAMES, penalty=10.0)
    np.testing.assert_allclose(path.shape(t), line, atol=1e-11, rtol=0)


def test_few_samples_are_refused():
    with pytest.raises(TrajectoryError, match="samples"):
        smoothed_path(np.arange(4.0), np.eye(4)[:, :2], np.full(2, 0.1), False, NAMES)


@pytest.mark.parametrize("scale", [1e-6, 1e3])
@pytest.mark.parametrize("slow", [1e-3, 1e3])
def test_units_of_shape_and_time_and_the_zero_do_not_matter(scale, slow):
    t, shapes = noisy(0.02, 80, even=True)
    first, left = smoothed_path(t, shapes, 0.02, True, NAMES)
    other, also = smoothed_path(slow * t, scale * (shapes - 70.0), scale * 0.02, True, NAMES)
    np.testing.assert_allclose(also.residual, scale * left.residual, rtol=1e-6)
    np.testing.assert_allclose(also.bias, scale * left.bias, atol=1e-6 * scale * np.abs(left.bias).max())
    np.testing.assert_allclose(also.penalty, slow**5 * left.penalty, rtol=1e-6)
    s = np.linspace(0.0, 3.0, 100)
    again = other.shape(np.clip(slow * s, 0.0, other.duration)) / scale + 70.0
    np.testing.assert_allclose(again, first.shape(s), atol=1e-9, rtol=0)
