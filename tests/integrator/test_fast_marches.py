"""The march in machine code: closed forms, the steps in plain Python, and that momenta do not see each other."""

from __future__ import annotations

import os
from dataclasses import fields
from itertools import pairwise
from multiprocessing import get_context

import numpy as np
import pytest
from numpy.polynomial import chebyshev
from scipy.integrate import DOP853, solve_ivp

import shapephase as sp
from shapephase import so3
from shapephase.arrays import read_only
from shapephase.integrator.fast._plain import plain
from shapephase.integrator.fast.marches import (
    derivatives,
    growths_and_rounding,
    march_in_threads,
    quaternions_at_rest,
)
from shapephase.integrator.steps.error_propagator import _growths_and_rounding
from shapephase.integrator.steps.rotation_step import STAGES, momentum_step, turned, variation
from shapephase.integrator.steps.step_record import StepRecord
from support.independent import cross

pytestmark = pytest.mark.usefixtures("fast")
NONE = np.zeros(0, dtype=int)
EPS = np.finfo(float).eps


def pair_ends(count: int) -> list[int]:
    """Of steps taken two at a time; before the one that is alone are as many pairs as after it, or one more."""
    before = (count // 2 + 1) // 2 if count % 2 else count // 2
    return [*range(0, 2 * before + 1, 2), *range(2 * before + 1, count + 1, 2)]


class Path:
    """Random series of a body that changes: three panels of different widths, degree eleven."""

    def __init__(self, rng, terms=12):
        self.widths = np.array([0.7, 0.2, 0.5])
        decay = 0.4 ** np.arange(terms)[None, :, None]
        self.series = 0.2 * rng.normal(size=(3, terms, 9)) * decay
        self.series[:, 0, :3] += [1.0, 0.8, 0.5]
        self.steps = np.array([6, 2, 40])

    def channels(self, panel, x, series=None):
        return chebyshev.chebval(x, (self.series if series is None else series)[panel])

    def stages(self, steps, series=None, together=1):
        """Of every step its channels at the stages, times its length: (K, 12, 9); or of two at a time."""
        for panel, (count, width) in enumerate(zip(steps, self.widths, strict=True)):
            for start, end in pairwise(range(count + 1) if together == 1 else pair_ends(count)):
                x = 2.0 * (start + (end - start) * DOP853.C[:STAGES]) / count - 1.0
                yield (end - start) * width / count * self.channels(panel, x, series).T

    def march(self, directions, magnitudes, *, loops=1, marks=NONE, perturbed=None, threads=None, steps=None):
        steps = self.steps if steps is None else steps
        return march_in_threads(
            self.widths, self.series, perturbed, steps, loops, directions, magnitudes, marks=marks, threads=threads
        )


@pytest.fixture
def path(rng):
    return Path(rng)


def momenta(rng, count, largest=6.0):
    directions = rng.normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None], rng.uniform(0.1, largest, count)


def in_python(path, direction, magnitude, steps, series=None, loops=1, together=1):
    """The same steps, one operation after another."""
    quaternion, found, turns, dynamics = [0.0, 0.0, 0.0, 1.0], [[0.0, 0.0, 0.0, 1.0]], [], []
    directions = [list(direction)]
    for channels in [*path.stages(steps, series, together)] * loops:
        end, turn, dynamic = momentum_step(directions[-1], magnitude, channels.tolist())[:3]
        quaternion = turned(quaternion, directions[-1], end, (np.sin(0.5 * turn), np.cos(0.5 * turn)))
        found.append(quaternion)
        directions.append(end)
        turns.append(turn)
        dynamics.append(dynamic)
    return np.array(found), np.array(directions), np.array(turns), np.array(dynamics)


@pytest.mark.parametrize("count", [1, 3, 19])
def test_the_steps_are_those_in_plain_python(path, rng, count):
    directions, magnitudes = momenta(rng, count)
    found = path.march(directions, magnitudes, loops=2)
    for row in range(count):
        expected = in_python(path, directions[row], magnitudes[row], path.steps, loops=2)
        quaternions, ends, turns, dynamics = expected
        # Some ninety steps of a few hundred operations, whose errors grow a few times.
        assert np.abs(found.quaternions[row] - quaternions).max() < 2000.0 * EPS
        assert np.abs(found.directions[row] - ends).max() < 2000.0 * EPS
        assert np.abs(found.turns[row] - turns).max() < 500.0 * EPS
        assert np.abs(found.dynamics[row] - dynamics).max() < 500.0 * EPS


@pytest.mark.parametrize("steps", [[6, 2, 40], [3, 2, 15], [5, 13, 7]])
@pytest.mark.parametrize("what", ["last terms left out", "all terms", "three terms more", "five terms more"])
def test_the_differences_are_those_of_the_coarser_marches(path, rng, what, steps):
    """Of steps taken two at a time, one of an odd number alone."""
    directions, magnitudes = momenta(rng, 9)
    path.steps = np.array(steps)
    ends = [0]
    for count in steps:
        ends += [ends[-1] + end for end in pair_ends(count)[1:]]
    perturbed = path.series.copy()
    if what == "last terms left out":
        perturbed[:, -2:] = 0.0
        perturbed[1, 5] = 0.0
    elif what == "all terms":
        perturbed *= 1.0 + 1e-3 * rng.normal(size=perturbed.shape)
    else:
        path.series[:, 9 if what == "three terms more" else 7 :] = 0.0
    found = path.march(directions, magnitudes, perturbed=perturbed)
    for row in range(9):
        start = directions[row], magnitudes[row]
        whole, pairs = (in_python(path, *start, path.steps, together=n)[0] for n in (1, 2))
        other = in_python(path, *start, path.steps, perturbed, together=2)[0]
        assert angle(whole[ends], pairs) == pytest.approx(found.stepping[row], rel=1e-9, abs=4000.0 * EPS)
        assert angle(pairs, other) == pytest.approx(found.truncation[row], rel=1e-9, abs=4000.0 * EPS)
    assert found.truncation.min() > 1e-6
    assert not path.march(directions, magnitudes).truncation.any()


def angle(a, b):
    """Largest angle between quaternions by the rotation between them, as the length of a chord in their sphere."""
    between = so3.matrix_from_quat(a).transpose(0, 2, 1) @ so3.matrix_from_quat(b)
    half = np.arcsin(np.linalg.norm(between - np.eye(3), axis=(1, 2)).max() / np.sqrt(8.0))
    return 4.0 * np.sin(0.5 * half)


def test_a_rigid_body_turns_as_the_closed_form_says():
    """The Euler top."""
    moments, momentum = np.array([1.0, 2.0, 2.5]), np.array([0.3, 1.1, 0.4])
    series = np.zeros((1, 1, 9))
    series[0, 0, :3] = 1.0 / moments
    size = float(np.linalg.norm(momentum))
    found = march_in_threads(
        np.array([20.0]), series, None, np.array([600]), 1, momentum[None] / size, np.array([size]), marks=NONE
    )
    top = sp.EulerTop(np.diag(moments), momentum)
    times = np.linspace(0.0, 20.0, 601)
    assert np.abs(so3.matrix_from_quat(found.quaternions[0]) - top.attitude(times)).max() < 1e-12
    assert found.stepping[0] < 1e-9


def test_propagators_are_derivatives_of_the_attitude(path, rng):
    """Of the variational equation, by SciPy: along short steps the middle of each stands for it."""
    (direction,), (magnitude,) = momenta(rng, 1)
    steps = 40 * path.steps
    marks = np.array([0, 3, int(steps.sum()) // 2, int(steps.sum())])
    found = path.march(direction[None], np.array([magnitude]), steps=steps, marks=marks)
    assert np.array_equal(found.propagators[0, 0], np.eye(3))
    propagator, quaternion = np.eye(3), np.array([0.0, 0.0, 0.0, 1.0])
    for panel, width in enumerate(path.widths):

        def slope(t, state, panel=panel, width=width):
            channels = path.channels(panel, 2.0 * t / width - 1.0)
            momentum = so3.matrix_from_quat(so3.normalised(state[:4])).T @ (magnitude * direction)
            inverse = channels[[0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(3, 3)
            omega = inverse @ momentum - channels[6:]
            q, w = state[:3], state[3]
            growth = np.array(variation(momentum.tolist(), channels.tolist())) @ state[4:].reshape(3, 3)
            return np.concatenate([0.5 * (w * omega + cross(q, omega)), [-0.5 * q @ omega], growth.ravel()])

        start = np.append(quaternion, propagator)
        end = solve_ivp(slope, (0.0, width), start, "DOP853", rtol=1e-11, atol=1e-12)
        quaternion, propagator = end.y[:4, -1], end.y[4:, -1].reshape(3, 3)
    assert np.abs(found.quaternions[0, -1] - quaternion).max() < 1e-9
    assert np.abs(found.propagators[0, -1] - propagator).max() < 1e-3 * np.abs(propagator).max()


def test_the_largest_growth_is_about_the_largest_singular_value(path, rng):
    """Between any two marks, from the sum of squares as if the three were s, 1 and 1/s, which they are nearly."""
    directions, magnitudes = momenta(rng, 12)
    count = int(path.steps.sum())
    record = path.march(directions, magnitudes, marks=np.arange(6) * count // 5)
    propagators = record.propagators
    found, rounding = growths_and_rounding(propagators, record.quaternions)
    interpreted = _growths_and_rounding(propagators, record.quaternions)
    assert np.allclose(interpreted, (found, rounding), rtol=1e-13, atol=0.0)
    for row, matrices in enumerate(propagators):
        between = [matrices[j] @ np.linalg.inv(matrices[i]) for j in range(1, 6) for i in range(j)]
        half = max(1.0, 0.5 * (max(np.linalg.norm(one) for one in between) ** 2 - 1.0))
        assert found[row] == pytest.approx(np.sqrt(half + np.sqrt(half**2 - 1.0)), rel=1e-3)
        assert found[row] == pytest.approx(max(np.linalg.norm(one, 2) for one in between), rel=0.1)
    assert found.max() > 1.2
    propagators[3, 2, 1, 1] = np.nan
    propagators[4] *= 1e200
    assert np.array_equal(np.flatnonzero(np.isinf(growths_and_rounding(propagators, record.quaternions)[0])), [3, 4])


@pytest.mark.parametrize("loops", [1, 2])
def test_derivatives_are_those_of_the_steps(path, rng, loops):
    """Central differences of marches from directions a little apart; the error is that of their third derivative."""
    (direction,), (magnitude,) = momenta(rng, 1)
    seeds = np.cross(direction, np.eye(3)[:2])
    channels = np.array(list(path.stages(path.steps))).reshape(-1, 108)
    total = loops * len(channels)
    marks = np.array([0, 0, 3, total // 2, total - 1, total])
    quaternions, slopes = derivatives(channels, loops, direction, seeds, magnitude, marks)
    start = np.array([magnitude])
    whole = path.march(direction[None], start, loops=loops)
    assert np.abs(quaternions - whole.quaternions[0, marks]).max() < 2000.0 * EPS
    for seed, slope in zip(seeds, np.swapaxes(slopes, 0, 1), strict=True):
        change = 1e-5 * seed
        apart = [path.march((direction + sign * change)[None], start, loops=loops) for sign in (1.0, -1.0)]
        expected = (apart[0].quaternions[0, marks] - apart[1].quaternions[0, marks]) / 2e-5
        assert np.abs(slope - expected).max() < 1e-7 * np.abs(expected).max()


@pytest.mark.parametrize("loops", [1, 3])
def test_momenta_do_not_see_each_other_nor_threads(path, rng, loops):
    directions, magnitudes = momenta(rng, 300)
    count = loops * int(path.steps.sum())
    options = {"loops": loops, "marks": np.arange(5) * count // 4, "perturbed": 0.999 * path.series}
    together = path.march(directions, magnitudes, threads=1, **options)
    in_threads = path.march(directions, magnitudes, threads=2, **options)
    for field in fields(StepRecord):
        assert np.array_equal(getattr(together, field.name), getattr(in_threads, field.name))
    for row in (0, 7, 8, 131, 299):
        alone = path.march(directions[row : row + 1], magnitudes[row : row + 1], **options)
        for field in fields(StepRecord):
            assert np.array_equal(getattr(together, field.name)[row], getattr(alone, field.name)[0])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_child_of_a_process_with_waiting_threads_has_its_own(path, rng):
    """Those that wait for the next call are not copied by a fork."""
    directions, magnitudes = momenta(rng, 300)
    path.march(directions, magnitudes, threads=2)
    with get_context("fork").Pool(1) as pool:
        found = pool.apply_async(_marched, (path, directions, magnitudes)).get(timeout=60.0)
    assert np.array_equal(found, _marched(path, directions, magnitudes))


def _marched(path, directions, magnitudes):
    return path.march(directions, magnitudes, threads=2).quaternions


def test_without_momentum_a_constant_drift_is_one_rotation():
    """Each channel of I^-1 L_o constant: S = exp(-hat(drift) t), also over panels of many steps."""
    series = np.zeros((3, 4, 9))
    series[:, 0, 6:] = [0.3, -0.8, 0.5]
    widths, steps = np.array([0.5, 1.0, 0.25]), np.array([6, 50, 2])
    found = quaternions_at_rest(widths, series, steps)
    step = np.repeat(widths / steps, steps)
    times = np.append(0.0, np.cumsum(step))
    expected = so3.exp(-times[:, None] * series[0, 0, 6:])
    assert np.abs(so3.matrix_from_quat(found) - expected).max() < 1e-12


def test_without_momentum_the_march_is_that_of_a_momentum_of_zero(path):
    """Whose direction shows the rotation: three of them, the whole of it."""
    found = quaternions_at_rest(path.widths, path.series, 4 * path.steps)
    marched = path.march(np.eye(3), np.zeros(3), steps=4 * path.steps)
    for row in range(3):
        assert np.abs(marched.quaternions[row] - found).max() < 1e-10


def test_steps_far_too_long_are_told():
    series = np.zeros((1, 1, 9))
    series[0, 0, :3] = [1.0, 0.5, 0.3]
    directions = np.array([[0.6, 0.0, 0.8]])
    found = march_in_threads(np.array([1.0]), series, None, np.array([2]), 1, directions, np.array([1e12]), marks=NONE)
    assert not found.stepping[0] < 0.1


def test_arrays_of_any_kind_are_taken(path):
    """Read-only, integers, every other row."""
    directions = np.zeros((2, 6), dtype=np.int64)[:, ::2]
    directions[:, 2] = 1
    directions.setflags(write=False)
    expected = path.march(np.array([[0.0, 0.0, 1.0]] * 2), np.array([1.0, 2.0]))
    assert np.array_equal(path.march(directions, np.array([1, 2])).quaternions, expected.quaternions)


def test_views_that_only_show_an_array_are_not_copied():
    """An array whose owner may write to it is taken as it is; one that nobody may write to is copied."""
    array = np.arange(6.0).reshape(2, 3)
    assert np.shares_memory(plain(read_only(array)), array)
    locked = array.copy()
    locked.setflags(write=False)
    for other in (locked.view(), np.frombuffer(array.tobytes()), array[:, ::2], array.astype(np.float32)):
        taken = plain(other)
        assert not np.shares_memory(taken, other)
        assert taken.flags.writeable
        np.testing.assert_array_equal(taken, other)
