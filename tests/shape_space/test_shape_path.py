"""Shape paths against direct sums, SciPy-free splines, and the laws of joining them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import shapephase as sp
from shapephase.chebyshev import inside
from shapephase.errors import OpenPathError, ShapeError, TrajectoryError, UnknownNameError
from support.bodies import joint, link, random_loop, urdf

laws = settings(derandomize=True, max_examples=40, deadline=None)
ShapePath = sp.ShapePath


EPS = float(np.finfo(float).eps)


def slope(path, t, order=1, step=1e-3):
    """A derivative of the shape by the five-point rule, inside a smooth piece: (N,) -> (N, n)."""
    a, b, c, d, e = (path.shape(t + k * step) for k in (-2, -1, 0, 1, 2))
    if order == 1:
        return (a - 8 * b + 8 * d - e) / (12 * step)
    return (-a + 16 * b - 30 * c + 16 * d - e) / (12 * step**2)


def zigzag(knots, rng, n=2, closed=True):
    """Straight moves with corners at the knots, as a function with breaks; also its rates on each piece."""
    knots = np.asarray(knots, dtype=float)
    corners = rng.uniform(-1.0, 1.0, (len(knots), n))
    if closed:
        corners[-1] = corners[0]
    rates = np.diff(corners, axis=0) / np.diff(knots)[:, None]

    def f(t):
        i = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(rates) - 1)
        return corners[i] + rates[i] * (t - knots[i])[:, None], rates[i]

    return ShapePath.function(f, knots[-1], knots[1:-1]), rates


# ---- Fourier --------------------------------------------------------------------------------------------------------


def test_a_fourier_loop_is_its_sum(rng):
    mean, a, b = rng.normal(size=3), rng.normal(size=(3, 4)), rng.normal(size=(3, 4))
    path = ShapePath.fourier(mean, a, b, 2.5)
    # Each term is the product of an amplitude and a sine of an angle up to 8 pi, which is itself rounded.
    rounding = 2.0 * EPS * (1.0 + 8.0 * np.pi) * (np.abs(a) + np.abs(b)).sum(axis=1).max()
    for t in (0.0, 0.3, 1.7, 2.5):
        shape, rate = mean.copy(), np.zeros(3)
        for k in range(1, 5):
            w = 2.0 * np.pi * k / 2.5
            shape += a[:, k - 1] * np.cos(w * t) + b[:, k - 1] * np.sin(w * t)
            rate += w * (b[:, k - 1] * np.cos(w * t) - a[:, k - 1] * np.sin(w * t))
        np.testing.assert_allclose(path.shape(t), shape, atol=rounding, rtol=0)
        np.testing.assert_allclose(path.rate(t), rate, atol=1e-13, rtol=0)
    np.testing.assert_allclose(path.gap, 0.0, atol=rounding, rtol=0)
    np.testing.assert_array_equal(path.breaks, [0.0, 2.5])
    assert (path.duration, path.n_shape, path.joint_names) == (2.5, 3, None)


def test_rates_are_derivatives_in_every_kind_of_path(rng):
    t = np.sort(rng.uniform(0, 2, 6))
    t[0], t[-1] = 0.0, 2.0
    samples = rng.normal(size=(6, 2))
    paths = [
        ShapePath.fourier([0.1, 0.2], rng.normal(size=(2, 3)), rng.normal(size=(2, 3)), 2.0),
        ShapePath.spline(t, samples),
        ShapePath.spline(t, np.vstack([samples[:-1], samples[:1]]), periodic=True),
        ShapePath.waypoints(t, samples),
        ShapePath.function(lambda s: (np.sin(s)[:, None], np.cos(s)[:, None]), 2.0),
    ]
    for path in paths:
        for variant in (path, path.reversed(), path.stretched(1.7)):
            middle = 0.5 * (variant.breaks[1:] + variant.breaks[:-1])
            step = 1e-3 * np.diff(variant.breaks).min()
            rate = variant.rate(middle)
            np.testing.assert_allclose(
                slope(variant, middle, step=step), rate, atol=5e-9 * (1 + np.abs(rate).max()), rtol=0
            )


def test_times_may_have_any_shape(rng):
    path = ShapePath.fourier([0.0, 1.0], rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), 1.0)
    t = rng.uniform(0, 1, (2, 3))
    assert path.shape(t).shape == (2, 3, 2)
    assert path.shape(0.5).shape == (2,)
    assert path.rate([]).shape == (0, 2)
    np.testing.assert_allclose(path.rate(t)[1, 2], path.rate(t[1, 2]), rtol=0.0, atol=2e-14)


# ---- Splines --------------------------------------------------------------------------------------------------------


def second_derivatives(path):
    """From the rates, which are quadratics on each piece: at its left and right end, exactly."""
    left, right = np.nextafter(path.breaks[:-1], 99.0), np.nextafter(path.breaks[1:], -99.0)
    middle = 0.5 * (left + right)
    a, m, b = path.rate(left), path.rate(middle), path.rate(right)
    h = (right - left)[:, None]
    return (-3 * a + 4 * m - b) / h, (a - 4 * m + 3 * b) / h


@pytest.mark.parametrize("closed", [True, False])
def test_a_spline_is_c2_and_goes_through_its_samples(closed, rng):
    """At every knot, and at the closing when periodic; not-a-knot: the third derivative too at the outer knots."""
    t = np.array([3.0, 3.4, 4.1, 4.3, 5.2, 6.0])
    samples = rng.normal(size=(6, 3))
    if closed:
        samples[-1] = samples[0]
    path = ShapePath.spline(t, samples)
    assert path.duration == 3.0
    np.testing.assert_allclose(path.breaks, t - 3.0, atol=1e-15, rtol=0)
    np.testing.assert_allclose(path.shape(t - 3.0), samples, atol=1e-14, rtol=0)
    inner = path.breaks[1:-1]
    before, after = np.nextafter(inner, 0.0), np.nextafter(inner, 9.0)
    np.testing.assert_allclose(path.shape(after), path.shape(before), atol=1e-14, rtol=0)
    np.testing.assert_allclose(path.rate(after), path.rate(before), atol=1e-12, rtol=0)
    at_left, at_right = second_derivatives(path)
    np.testing.assert_allclose(at_right[:-1], at_left[1:], atol=1e-10, rtol=0)
    if closed:
        # The value of a cubic at the end of its piece: four terms of the size of the samples.
        rounding = 4.0 * EPS * max(1.0, np.abs(samples).max())
        np.testing.assert_allclose(path.shape(0.0), path.shape(3.0), atol=rounding, rtol=0)
        np.testing.assert_allclose(path.rate(0.0), path.rate(3.0), atol=1e-12, rtol=0)
        np.testing.assert_allclose(at_right[-1], at_left[0], atol=1e-10, rtol=0)
    else:
        third = (at_right - at_left) / np.diff(t)[:, None]
        np.testing.assert_allclose(third[[0, -1]], third[[1, -2]], atol=1e-9, rtol=0)
        assert np.all(np.abs(third[1] - third[2]) > 1e-3)


def test_a_spline_reproduces_cubics():
    """Not-a-knot: four samples of a cubic give the cubic back; three a parabola, two a line."""
    x = np.linspace(0.0, 2.0, 201)
    for count, polynomial in ((2, [1, -2]), (3, [1, -2, 0.5]), (4, [1, -2, 0.5, 0.3]), (9, [1, -2, 0.5, 0.3])):
        p = np.polynomial.Polynomial(polynomial)
        t = np.linspace(0.0, 1.0, count) ** 1.3 * 2.0
        path = ShapePath.spline(t, p(t)[:, None], periodic=False)
        np.testing.assert_allclose(path.shape(x)[:, 0], p(x), atol=1e-13, rtol=0)
        np.testing.assert_allclose(path.rate(x)[:, 0], p.deriv()(x), atol=1e-12, rtol=0)


def test_periodic_by_itself_when_the_samples_close(rng):
    t, samples = np.linspace(0, 1, 7), rng.normal(size=(7, 2))
    samples[-1] = samples[0] + 4e-10
    closed = ShapePath.spline(t, samples)
    np.testing.assert_allclose(closed.gap, 0.0, atol=1e-15, rtol=0)
    np.testing.assert_allclose(closed.rate(0.0), closed.rate(1.0), atol=1e-12, rtol=0)
    left_open = ShapePath.spline(t, samples, periodic=False)
    assert np.all(np.abs(left_open.rate(0.0) - left_open.rate(1.0)) > 1e-3)
    samples[-1, 1] += 1e-6
    assert np.abs(ShapePath.spline(t, samples).gap[1]) > 9e-7
    with pytest.raises(TrajectoryError, match="number 1"):
        ShapePath.spline(t, samples, periodic=True)
    with pytest.raises(TrajectoryError, match="samples"):
        ShapePath.spline([0, 1], np.zeros((2, 2)), periodic=True)


@pytest.mark.parametrize("make", [ShapePath.spline, ShapePath.waypoints])
def test_faulty_samples_are_refused_by_place(make):
    good_t, good_r = np.linspace(0, 1, 5), np.zeros((5, 2))
    bad = [
        (good_t[::-1], good_r, TrajectoryError, "sample 1 at 0.75 s follows 1 s"),
        (np.array([0, 0.2, 0.2, 0.4, 1]), good_r, TrajectoryError, "sample 2 at 0.2 s"),
        (good_t[:1], good_r[:1], TrajectoryError, "two samples"),
        (good_t[:4], good_r, ShapeError, r"\(4,\) and \(5, 2\)"),
        (good_t, good_r[:, 0], ShapeError, "shapes"),
        (good_t, np.where(np.eye(5, 2) > 0, np.nan, 0), ShapeError, r"shapes: entry \[0, 0\] is nan"),
        (np.where(good_t > 0.9, np.inf, good_t), good_r, ShapeError, r"times: entry \[4\] is inf"),
        (good_t, good_r + 1j, ShapeError, "complex"),
        (good_t, [["a", "b"]] * 5, ShapeError, "<U1"),
        (np.ma.masked_equal(good_t, 0.5), good_r, ShapeError, "masked"),
    ]
    for t, r, error, said in bad:
        with pytest.raises(error, match=said):
            make(t, r)
    with pytest.raises(TrajectoryError, match="joint_names"):
        make(good_t, good_r, joint_names=["a"])
    with pytest.raises(TrajectoryError, match="joint_names"):
        make(good_t, good_r, joint_names=["a", "a"])


# ---- Waypoints ------------------------------------------------------------------------------------------------------


def test_waypoints_are_quintics_from_rest_to_rest(rng):
    t, corners = np.array([1.0, 1.5, 3.0, 3.2]), rng.normal(size=(4, 2))
    path = ShapePath.waypoints(t, corners)
    np.testing.assert_allclose(path.breaks, t - 1.0, atol=1e-15, rtol=0)
    for i in range(3):
        s = np.linspace(0.0, 1.0, 21)[1:-1]
        here = t[i] - 1.0 + s * (t[i + 1] - t[i])
        move = corners[i + 1] - corners[i]
        want = corners[i] + np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, move)
        # The powers of s have coefficients whose magnitudes sum up to 31; and a time is rounded by its spacing, in
        # which a path moves on by up to 15/8 of its corners' distance over their time.
        steepest = 15.0 / 8.0 * np.abs(move).max() / (t[i + 1] - t[i])
        rounding = EPS * (np.abs(corners).max() + 31.0 * np.abs(move).max() + 2.0 * t[-1] * steepest)
        np.testing.assert_allclose(path.shape(here), want, atol=rounding, rtol=0)
        rate = np.outer(30 * s**2 - 60 * s**3 + 30 * s**4, move) / (t[i + 1] - t[i])
        np.testing.assert_allclose(path.rate(here), rate, atol=1e-12, rtol=0)
    for side in (0.0, 99.0):
        corner = np.clip(np.nextafter(path.breaks, side), 0.0, path.duration)
        # At its end the quintic is the sum of those coefficients times the distance of the corners.
        rounding = EPS * (np.abs(corners).max() + 31.0 * np.abs(np.diff(corners, axis=0)).max())
        np.testing.assert_allclose(path.shape(corner), corners, atol=rounding, rtol=0)
        np.testing.assert_allclose(path.rate(corner), 0.0, atol=1e-12, rtol=0)
    # Rest means no acceleration either: the rate leaves zero with the square of the time.
    near = path.breaks[1:-1, None] + np.array([-1e-3, -5e-4, 5e-4, 1e-3])
    rates = np.abs(path.rate(near))
    np.testing.assert_allclose(rates[:, [0, 3]] / rates[:, [1, 2]], 4.0, rtol=0.05)


# ---- Functions ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "rates",
    [
        lambda t: -np.stack([np.cos(t), 2 * t], -1),
        lambda t: np.stack([np.cos(t), 2 * t], -1) * 1.01,
        lambda t: np.stack([np.cos(t), 0 * t], -1),
        lambda t: np.stack([2 * t, np.cos(t)], -1),
        lambda t: np.zeros((len(t), 2)),
    ],
)
def test_a_function_with_wrong_rates_is_refused(rates):
    with pytest.raises(TrajectoryError, match="rate"):
        ShapePath.function(lambda t: (np.stack([np.sin(t), t**2], -1), rates(t)), 3.0)


def test_the_rate_of_each_joint_is_judged_on_its_own_scale():
    """A rotor far round must not hide the wrong sign of a small joint."""
    with pytest.raises(TrajectoryError, match="number 1"):
        ShapePath.function(
            lambda t: (np.stack([600.0 * t, 0.1 * np.sin(t)], -1), np.stack([600.0 + 0 * t, -0.1 * np.cos(t)], -1)), 1.0
        )


def test_wrong_rates_on_a_late_piece_are_found():
    def f(t):
        late = t > 2.0
        return np.where(late, 4.0 - t, t)[:, None], np.ones((len(t), 1))

    with pytest.raises(TrajectoryError, match="number 0"):
        ShapePath.function(f, 4.0, [2.0])


def test_faulty_functions_are_refused():
    good = lambda t: (np.zeros((len(t), 2)), np.zeros((len(t), 2)))  # noqa: E731
    with pytest.raises(ShapeError, match="shapes"):
        ShapePath.function(lambda t: (np.zeros(len(t)), np.zeros(len(t))), 1.0)
    with pytest.raises(ShapeError, match="rates"):
        ShapePath.function(lambda t: (np.zeros((len(t), 2)), np.zeros((len(t), 3))), 1.0)
    with pytest.raises(TrajectoryError, match=r"0\.38"):
        ShapePath.function(lambda t: (np.where(t > 0.3, np.nan, 0.0)[:, None], np.zeros((len(t), 1))), 1.0)
    for breaks in ([-0.1], [1.1]):
        with pytest.raises(TrajectoryError, match="breaks"):
            ShapePath.function(good, 1.0, breaks)
    np.testing.assert_array_equal(ShapePath.function(good, 1.0, [0.7, 0.2, 0.7, 0.0]).breaks, [0, 0.2, 0.7, 1.0])


@pytest.mark.parametrize("which", ["shapes", "rates"])
@pytest.mark.parametrize(
    "spoil",
    [
        lambda x: x + 1j,
        lambda x: np.ma.masked_less(x, 1.0),
        lambda x: x.astype(str),
        lambda x: x.astype(object),
        lambda x: [[0.0], [0.0, 1.0]],  # noqa: ARG005
    ],
    ids=["complex", "masked", "text", "objects", "ragged"],
)
def test_a_function_that_returns_no_real_numbers_is_refused(which, spoil):
    """Not silently stripped of imaginary parts and masks."""

    def f(t):
        good = np.zeros((len(t), 1))
        return (spoil(good), good) if which == "shapes" else (good, spoil(good))

    with pytest.raises(ShapeError, match=which):
        ShapePath.function(f, 1.0)


def test_breaks_are_a_list_of_times():
    for breaks in ([[0.1, 0.2]], 0.5, ["soon"], [np.nan]):
        with pytest.raises(ValueError, match="breaks"):
            ShapePath.function(lambda t: (np.zeros((len(t), 1)),) * 2, 1.0, breaks)


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, np.inf, "long", [1.0, 2.0], None])
def test_a_duration_is_a_positive_number(duration):
    with pytest.raises(ValueError, match="duration"):
        ShapePath.fourier([0.0], [[1.0]], [[0.0]], duration)
    with pytest.raises(ValueError, match="duration"):
        ShapePath.function(lambda t: (np.zeros((len(t), 1)),) * 2, duration)


def test_fourier_coefficients_must_match():
    for arguments in (([0.0], [[1.0], [1.0]], [[0.0]]), ([0.0], [[1.0]], [[0.0, 1.0]]), (0.0, [[1.0]], [[0.0]])):
        with pytest.raises(ShapeError):
            ShapePath.fourier(*arguments, 1.0)


def test_times_outside_are_refused():
    path = ShapePath.waypoints([0, 2], [[0.0], [1.0]])
    for t in (-0.01, 2.01, [0.5, 7.0], np.nan):
        for read in (path.shape, path.rate):
            with pytest.raises(ValueError, match=r"outside|finite"):
                read(t)
    with pytest.raises(TrajectoryError, match="time -5"):
        path.shape([1.0, -5.0])
    with pytest.raises(TrajectoryError, match="outside"):
        path.shape([7.0, 1.0])
    # Rounding of a time is forgiven, in proportion to the duration.
    for duration in (1e-3, 2.0, 1e4):
        stretched = path.stretched(duration / 2.0)
        assert stretched.shape(duration * (1 + 5e-10)) == stretched.shape(duration)
        with pytest.raises(TrajectoryError):
            stretched.shape(duration * (1 + 2e-9))


# ---- Laws -----------------------------------------------------------------------------------------------------------


@laws
@given(st.floats(0.0, 1.0), st.floats(0.01, 50.0), st.integers(0, 1000))
def test_reversed_and_stretched(fraction, factor, seed):
    rng = np.random.default_rng(seed)
    path = ShapePath.waypoints(np.cumsum(rng.uniform(0.1, 1, 5)), rng.normal(size=(5, 2)))
    t = fraction * path.duration
    back, slow = path.reversed(), path.stretched(factor)
    np.testing.assert_allclose(back.shape(path.duration - t), path.shape(t), atol=1e-13, rtol=0)
    np.testing.assert_allclose(back.rate(path.duration - t), -path.rate(t), atol=1e-11, rtol=0)
    np.testing.assert_allclose(slow.shape(min(factor * t, slow.duration)), path.shape(t), atol=1e-12, rtol=0)
    np.testing.assert_allclose(factor * slow.rate(min(factor * t, slow.duration)), path.rate(t), atol=1e-11, rtol=0)
    np.testing.assert_allclose(back.reversed().shape(t), path.shape(t), atol=1e-13, rtol=0)
    np.testing.assert_allclose(slow.breaks, factor * path.breaks, rtol=1e-15)
    np.testing.assert_allclose(back.breaks, path.duration - path.breaks[::-1], atol=1e-15, rtol=0)
    assert slow.duration == slow.breaks[-1]
    assert back.duration == back.breaks[-1]


def test_then_is_one_after_the_other(rng):
    first = ShapePath.waypoints([0, 1, 1.5], rng.normal(size=(3, 2)))
    second = ShapePath.spline([0, 1, 2, 3], np.vstack([first.shape(1.5), rng.normal(size=(3, 2))]))
    both = first.then(second)
    assert both.duration == 4.5
    np.testing.assert_allclose(both.breaks, [0, 1, 1.5, 2.5, 3.5, 4.5], atol=1e-15, rtol=0)
    t = np.linspace(0, 1.5, 30)[:-1]
    np.testing.assert_array_equal(both.shape(t), first.shape(t))
    np.testing.assert_array_equal(both.rate(t), first.rate(t))
    t = np.linspace(0, 3, 30)
    np.testing.assert_allclose(both.shape(1.5 + t), second.shape(t), atol=1e-13, rtol=0)
    np.testing.assert_allclose(both.rate(1.5 + t), second.rate(t), atol=1e-12, rtol=0)
    third = second.reversed()
    np.testing.assert_allclose(
        first.then(second).then(third).gap, first.then(second.then(third)).gap, atol=1e-14, rtol=0
    )


def test_repeated_is_then_again_and_again(rng):
    loop = ShapePath.fourier([0.1, 0.2], rng.normal(size=(2, 2)), rng.normal(size=(2, 2)), 0.7)
    three, joined = loop.repeated(3), loop.then(loop).then(loop)
    assert three.duration == pytest.approx(2.1)
    np.testing.assert_allclose(three.breaks[[0, -1]], [0, 2.1], atol=1e-15, rtol=0)
    t = np.linspace(0, 2.1, 50)
    np.testing.assert_allclose(three.shape(t), joined.shape(t), atol=1e-13, rtol=0)
    np.testing.assert_allclose(three.rate(t), joined.rate(t), atol=1e-11, rtol=0)
    np.testing.assert_allclose(three.shape(t[t < 1.4] + 0.7), three.shape(t[t < 1.4]), atol=1e-13, rtol=0)
    np.testing.assert_array_equal(loop.repeated(1).shape(t[t < 0.7]), loop.shape(t[t < 0.7]))


def test_breaks_are_kept_when_a_loop_is_repeated(rng):
    """All inner ones, and the seams where the loop is not smooth; of a smooth loop no seam is needed."""
    knots = np.array([0.0, 0.3, 0.8, 1.0])
    samples = rng.normal(size=(4, 2))
    samples[-1] = samples[0]
    want = np.unique(np.round(np.add.outer(np.arange(4), knots), 12))
    for loop in (ShapePath.waypoints(knots, samples), ShapePath.spline(knots, samples), zigzag(knots, rng)[0]):
        np.testing.assert_allclose(loop.repeated(4).breaks, want, atol=1e-14, rtol=0)
        np.testing.assert_allclose(loop.repeated(2).repeated(2).breaks, want, atol=1e-14, rtol=0)
        np.testing.assert_allclose(loop.repeated(4).stretched(0.5).breaks, 0.5 * want, atol=1e-14, rtol=0)
    smooth = ShapePath.fourier([0.0], [[1.0]], [[0.3]], 1.0)
    for path in (smooth.repeated(4), smooth.repeated(2).repeated(2), smooth.reversed().repeated(4)):
        assert set(path.breaks) <= {0.0, 1.0, 2.0, 3.0, 4.0}
        t = np.linspace(0.0, 4.0, 37)
        sign = 1.0 if path.rate(0.0) > 0 else -1.0
        np.testing.assert_allclose(
            path.shape(t)[:, 0],
            np.cos(2 * np.pi * t) + sign * 0.3 * np.sin(2 * np.pi * t),
            atol=1e-12,
            rtol=0,
        )


def test_a_rotor_that_goes_round_can_be_repeated_and_continued():
    """A joint that ends whole turns from its start goes on from there: no jump back."""
    loop = ShapePath.waypoints([0, 1], [[0.3, 0.5], [0.3 - 4.0 * np.pi, 0.5]])
    many = loop.repeated(3)
    np.testing.assert_allclose(many.gap, [-12.0 * np.pi, 0.0], atol=1e-12, rtol=0)
    np.testing.assert_allclose(many.shape(1.5), loop.shape(0.5) - [4.0 * np.pi, 0.0], atol=1e-12, rtol=0)
    for seam in (1.0, 2.0):
        np.testing.assert_allclose(
            many.shape(np.nextafter(seam, 0)), many.shape(np.nextafter(seam, 9)), atol=1e-12, rtol=0
        )
    both = loop.then(ShapePath.waypoints([0, 2], [[0.3, 0.5], [0.7, 0.6]]))
    np.testing.assert_allclose(both.shape(3.0), [0.7 - 4.0 * np.pi, 0.6], atol=1e-12, rtol=0)
    np.testing.assert_allclose(both.shape(1.0), [0.3 - 4.0 * np.pi, 0.5], atol=1e-12, rtol=0)


def test_gaps_are_refused_with_the_joint():
    path = ShapePath.waypoints([0, 1], [[0.0, 0.0], [0.0, 0.25]], joint_names=["hip", "knee"])
    with pytest.raises(OpenPathError, match="knee"):
        path.repeated(2)
    with pytest.raises(TrajectoryError, match="knee"):
        path.then(path)
    with pytest.raises(TrajectoryError, match="joints"):
        path.then(ShapePath.waypoints([0, 1], [[0.0], [1.0]]))
    turned = ShapePath.waypoints([0, 1], [[0.0, 0.0], [2 * np.pi, 0.25]], joint_names=["hip", "knee"])
    with pytest.raises(OpenPathError, match="knee"):
        turned.repeated(2)
    with pytest.raises(TrajectoryError, match="knee"):
        turned.then(path)
    swapped = ShapePath.waypoints([0, 1], [[0.25, 0.0], [0.0, 0.0]], joint_names=["knee", "hip"])
    with pytest.raises(TrajectoryError, match="order"):
        path.then(swapped)
    half_turn = ShapePath.waypoints([0, 1], [[0.0], [np.pi]])
    with pytest.raises(OpenPathError):
        half_turn.repeated(2)


@pytest.mark.parametrize("count", [0, -1, 1.5, np.nan, np.inf, "3", None])
def test_only_whole_numbers_of_times(count):
    loop = ShapePath.fourier([0.0], [[1.0]], [[0.0]], 1.0)
    with pytest.raises(TrajectoryError, match="whole"):
        loop.repeated(count)


@pytest.mark.parametrize("factor", [0.0, -2.0, np.nan, np.inf])
def test_a_path_is_stretched_by_a_positive_number(factor):
    with pytest.raises(ValueError, match="factor"):
        ShapePath.fourier([0.0], [[1.0]], [[0.0]], 1.0).stretched(factor)


def test_how_fast_a_path_may_swing_is_unknown_when_a_part_of_it_is():
    known = ShapePath.waypoints([0, 1], [[0.0], [0.0]])
    unknown = ShapePath.function(lambda t: (np.zeros((len(t), 1)),) * 2, 1.0)
    assert known.then(known).swings.most is not None
    assert known.then(unknown).swings.most is None
    assert unknown.then(known).swings.most is None


def test_names_survive_all_this():
    loop = ShapePath.fourier([0.0, 0.1], [[1.0], [2.0]], [[0.0], [1.0]], 1.0, joint_names=["b", "a"])
    for path in (loop.reversed(), loop.stretched(2), loop.repeated(2), loop.then(loop)):
        assert path.joint_names == ("b", "a")
    bare = ShapePath.fourier([0.0, 0.1], [[1.0], [2.0]], [[0.0], [1.0]], 1.0)
    assert loop.then(bare).joint_names == ("b", "a")
    assert bare.then(loop).joint_names == ("b", "a")


# ---- Corners: on each side of a break stands the rate of that side --------------------------------------------------


def beside(path):
    """Rates just before and after each inner break: where the sampler puts the ends of its panels."""
    first, last = inside(path.breaks[:-1], path.breaks[1:])
    return path.rate(last[:-1]), path.rate(first[1:])


def assert_corners(path, rates):
    before, after = beside(path)
    np.testing.assert_allclose(before, rates[:-1], atol=1e-8, rtol=0)
    np.testing.assert_allclose(after, rates[1:], atol=1e-8, rtol=0)


@pytest.mark.parametrize("seed", range(8))
def test_corners_keep_their_sides_after_a_short_path(seed):
    """A long path after a short one: the difference of the times is rounded."""
    rng = np.random.default_rng(seed)
    for _ in range(10):
        short, quick = zigzag([0.0, *np.cumsum(rng.uniform(1e-4, 1e-2, 2))], rng)
        long, slow = zigzag([0.0, *np.cumsum(rng.uniform(1.0, 30.0, 4))], rng)
        shift = short.shape(short.duration) - long.shape(0.0)
        moved = ShapePath.function(
            lambda t, long=long, shift=shift: (long.curve(t)[0] + shift, long.curve(t)[1]), long.duration, long.breaks
        )
        assert_corners(short.then(moved), np.vstack([quick, slow]))


# ---- Matching by name -----------------------------------------------------------------------------------------------


def test_joints_are_matched_by_name_in_any_order(rng):
    cat = sp.load_body("cat")
    loop = random_loop(cat, rng)
    order = rng.permutation(cat.n_shape)
    mixed = ShapePath.fourier(
        loop.curve.mean[order],
        loop.curve.cosines[order],
        loop.curve.sines[order],
        loop.duration,
        joint_names=[cat.joint_names[i] for i in order],
    )
    matched = mixed.matched(cat.joint_names, "cat")
    assert matched.joint_names == cat.joint_names
    t = np.linspace(0, loop.duration, 7)
    np.testing.assert_allclose(matched.shape(t), loop.shape(t), atol=1e-14, rtol=0)
    np.testing.assert_allclose(matched.rate(t), loop.rate(t), atol=1e-13, rtol=0)
    np.testing.assert_allclose(
        sp.articulated(cat, mixed).internal_momentum(t),
        sp.articulated(cat, loop).internal_momentum(t),
        atol=1e-14,
        rtol=0,
    )
    np.testing.assert_allclose(sp.holonomy(cat, mixed), sp.holonomy(cat, loop), atol=1e-9, rtol=0)


def test_joints_that_do_not_match_are_named(load_urdf):
    arms = load_urdf(
        urdf(
            link("base", 1, [1, 1, 1]),
            link("l", 1, [1, 1, 1]),
            link("r", 1, [1, 1, 1]),
            joint("left", "revolute", "base", "l"),
            joint("right", "revolute", "base", "r", (0, 1, 0)),
        )
    )

    def path(*names):
        return ShapePath.waypoints([0, 1], np.zeros((2, len(names) or 3)), joint_names=names or None)

    with pytest.raises(UnknownNameError, match="'right'"):
        sp.articulated(arms, path("left", "rigth"))
    with pytest.raises(TrajectoryError, match="right"):
        sp.articulated(arms, path("left"))
    with pytest.raises(TrajectoryError, match="left, right"):
        sp.articulated(arms, path())
    with pytest.raises(UnknownNameError, match="middle"):
        sp.holonomy(arms, path("left", "right", "middle"))


def test_joints_do_not_go_beyond_a_million():
    """Beyond 1e6 rad, where an angle has lost six digits."""
    far = 1.1e6
    for make in (
        lambda: sp.ShapePath.fourier([far], [[0.0]], [[0.0]], 1.0),
        lambda: sp.ShapePath.spline([0.0, 1.0], [[0.0], [far]]),
        lambda: sp.ShapePath.waypoints([0.0, 1.0], [[0.0], [-far]]),
        lambda: sp.ShapePath.function(lambda t: (far + 0.0 * t[:, None], 0.0 * t[:, None]), 1.0),
        lambda: sp.load_body("cat_two_halves").locked_inertia([0.0, far, 0.0]),
    ):
        with pytest.raises(sp.errors.ShapeError, match="rad"):
            make()
    assert sp.ShapePath.spline([0.0, 1.0], [[0.0], [9e5]]).shape(1.0) == 9e5
