"""Error bars of joint motions: those of the samples where nothing is smoothed, and of what noise does where it is."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapeError, WrongObjectError
from shapephase.shape_space.files import smoothed_path

NOISE = 0.01
TIMES = np.linspace(0.0, 1.2, 41)


def moved(times):
    """Shapes, rates and accelerations of two joints."""
    swing, start = np.array([5.0, 7.0]), np.array([0.4, 2.0])
    phase = swing * times[:, None] + start
    return np.sin(phase), swing * np.cos(phase), -(swing**2) * np.sin(phase)


@pytest.mark.parametrize("periodic", [False, True])
def test_bars_are_sums_over_paths_through_unit_samples(periodic):
    """A path through samples is linear in them: columns of one unit sample each show what noise does."""
    times = np.sort(np.random.default_rng(0).uniform(0.0, 1.0, 9))
    count = len(times) - periodic
    at = np.linspace(0.0, times[-1] - times[0], 7)
    squares = np.zeros((3, 7))
    for row in range(count):
        unit = np.zeros((len(times), 1))
        unit[row] = 1.0
        if periodic and row == 0:
            unit[-1] = 1.0
        one = sp.ShapePath.spline(times, unit, periodic)
        squares += np.stack([one.shape(at), one.rate(at), one.acceleration(at)])[:, :, 0] ** 2
    path = sp.ShapePath.spline(times, np.zeros((len(times), 1)), periodic)
    found = sp.path_errors(path, at, NOISE)
    for which, bars in enumerate((found.shape, found.rate, found.acceleration)):
        np.testing.assert_allclose(bars[:, 0], NOISE * np.sqrt(squares[which]), rtol=1e-9)


def test_bars_of_a_smoothed_recording_hold_at_the_ends_and_within():
    """95 % bars of 6 draws of two joints, at 41 places: in the mean, and at both ends, some 95 %."""
    random, at = np.random.default_rng(5), TIMES
    truth = moved(at)
    held = np.zeros((3, len(at)))
    for _ in range(6):
        path, _ = smoothed_path(TIMES, truth[0] + NOISE * random.normal(size=truth[0].shape), NOISE, False)
        bars = sp.path_errors(path, at, NOISE)
        values = path.shape(at), path.rate(at), path.acceleration(at)
        for which, (value, bar) in enumerate(zip(values, (bars.shape, bars.rate, bars.acceleration), strict=True)):
            held[which] += np.mean(np.abs(value - truth[which]) < 1.96 * bar, axis=1) / 6.0
    assert np.all((held.mean(axis=1) > 0.9) & (held.mean(axis=1) < 0.99))
    assert held[:, [0, -1]].mean() > 0.85


def test_what_has_no_bars_says_why():
    path = sp.ShapePath.spline(TIMES, moved(TIMES)[0])
    with pytest.raises(WrongObjectError, match="--smooth"):
        sp.path_errors(path, [0.1])
    for wrong in ([0.1, 0.2, 0.3], -1.0):
        with pytest.raises(ShapeError, match="joints"):
            sp.path_errors(path, [0.1], wrong)
    with pytest.raises(WrongObjectError, match="samples"):
        sp.path_errors(sp.examples.kane_scher(0.0, 0.5), [0.1], NOISE)


def test_what_is_cut_off_is_smoothed_first():
    """The same samples in a longer recording: the rate at the ends of the cut is known several times as well, as its
    bars say; samples that no number is known of, or behind a gap, are as if they were not there."""
    import pandas

    body = sp.load_body("diver")
    times = np.arange(-0.5, 1.7001, 0.02)
    shapes = [1.0, -1.0] + 0.5 * moved(times)[0] + NOISE * np.random.default_rng(1).normal(size=(len(times), 2))
    kept = (times > -0.01) & (times < 1.21)

    def read(rows, **options):
        index = pandas.Index(times[rows], name="time [s]")
        table = pandas.DataFrame(shapes[rows], columns=body.joint_names, index=index)
        return sp.read_recorded_motion(table, body, smooth=NOISE, **options)

    alone, cut = read(kept), read(slice(None), trim=(-0.01, 1.21))
    np.testing.assert_array_equal(cut.times, alone.times)
    ends = np.array([0.0, cut.path.duration])
    truth = 0.5 * moved(np.array([0.0, 1.2]))[1]
    bars = [sp.path_errors(one.path, ends).rate for one in (alone, cut)]
    assert np.all(bars[1] < 0.5 * bars[0])
    assert np.all(np.abs(cut.path.rate(ends) - truth) < 3.0 * bars[1])
    gap = (times < -0.2) | kept | (times > 1.45)
    shapes[times < -0.2] = 0.0
    for rows in (gap,):
        behind = read(rows, trim=(-0.01, 1.21))
        np.testing.assert_allclose(behind.path.shape(ends), alone.path.shape(ends), atol=1e-12)
