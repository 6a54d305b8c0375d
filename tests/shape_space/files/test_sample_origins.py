"""What leads from recorded samples to a path is linear, and known backwards: closing, smoothing, resampling."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import shapephase as sp
from shapephase.shape_space.files import read_recorded_motion
from shapephase.shape_space.path_samples import path_samples

DIVER = sp.load_body("diver")
SATELLITE = sp.load_body("satellite")
T = np.concatenate([np.arange(20) / 60.0, [0.34, 0.39, 0.41]])
OPTIONS = {
    "drift": {"close": "3deg"},
    "smooth": {"smooth": "0.5deg"},
    "smooth loop": {"smooth": "0.5deg", "close": "3deg"},
    "smooth drift": {"smooth": "0.5deg", "close": "3deg", "close_by": "drift"},
    "one joint": {"smooth": {DIVER.joint_names[0]: "0.5deg"}, "close": "3deg", "close_by": "drift"},
    "resampled": {"resample": 50.0},
    "all": {"smooth": "0.5deg", "close": "3deg", "resample": 40.0},
}


def recorded(body, shapes, **options):
    import pandas

    table = pandas.DataFrame(shapes, columns=body.joint_names, index=pandas.Index(T, name="time [s]"))
    return read_recorded_motion(table, body, **options)


def samples(body) -> np.ndarray:
    share = T[:, None] / T[-1]
    wave = 0.4 * np.sin(2.0 * np.pi * share + np.arange(body.n_shape)) + 0.02 * share
    return wave + 0.004 * np.random.default_rng(3).normal(size=wave.shape)


@pytest.mark.parametrize("name", OPTIONS)
def test_the_path_answers_to_the_samples_as_is_said(name):
    """A sum along the path, as it answers to each sample; of what is linear, a difference has no error of its own."""
    path = recorded(DIVER, samples(DIVER), **OPTIONS[name]).path
    found = path_samples(path)
    np.testing.assert_array_equal(found.values, samples(DIVER))
    rng = np.random.default_rng(4)
    at = rng.uniform(0.0, path.duration, 30)
    by_shape, by_rate = rng.normal(size=(2, 30, 3, 2))

    def total(values):
        shapes, rates = found.path_through(values).curve(at)
        return np.einsum("nkj,nj->k", by_shape, shapes) + np.einsum("nkj,nj->k", by_rate, rates)

    derivative = found.derivative(at, by_shape, by_rate)
    same = found.path_through(found.values)
    np.testing.assert_allclose(same.shape(at), path.shape(at), rtol=0.0, atol=1e-14)
    middle = total(found.values)
    scale = np.abs(derivative).max()
    for sample, joint in ((0, 0), (3, 1), (11, 0), (len(T) - 1, 0), (len(T) - 1, 1)):
        changed = found.values.copy()
        changed[sample, joint] += 1.0
        expected = total(changed) - middle
        np.testing.assert_allclose(derivative[:, 2 * sample + joint], expected, rtol=0.0, atol=1e-11 * scale)


def test_whole_turns_of_a_wheel_stay_what_they_are():
    wheel = int(np.flatnonzero(SATELLITE.continuous)[0])
    shapes = 0.3 + 0.2 * samples(SATELLITE)
    shapes[:, wheel] += 2.0 * np.pi * T / T[-1]
    for options in ({"close_by": "drift"}, {"smooth": 0.01}):
        path = recorded(SATELLITE, shapes, close=0.1, degrees=False, **options).path
        found = path_samples(path)
        assert path.gap[wheel] == pytest.approx(2.0 * np.pi, abs=1e-12)
        changed = shapes.copy()
        changed[7, wheel] += 0.5
        other = found.path_through(changed)
        assert other.gap[wheel] == pytest.approx(2.0 * np.pi, abs=1e-12)
        at = np.array([0.1, 0.25])
        unit = np.zeros((2, 2, SATELLITE.n_shape))
        unit[[0, 1], [0, 1], wheel] = 1.0
        by_sample = found.derivative(at, unit, 0.0 * unit)[:, 7 * SATELLITE.n_shape + wheel]
        np.testing.assert_allclose((other.shape(at) - path.shape(at))[:, wheel], 0.5 * by_sample, atol=1e-12)


def test_the_bias_at_other_knots_is_that_of_the_path_between():
    plain = recorded(DIVER, samples(DIVER), smooth="0.5deg", close="3deg")
    dense = recorded(DIVER, samples(DIVER), smooth="0.5deg", close="3deg", resample=200.0)
    before, after = path_samples(plain.path), path_samples(dense.path)
    assert np.abs(before.bias).max() > 0.0
    knots = before.curve.knots
    bias = before.bias.reshape(-1, 2)
    through = sp.ShapePath.spline(knots, np.concatenate([bias, bias[:1]]), True)
    np.testing.assert_allclose(after.bias.reshape(-1, 2), through.shape(after.curve.knots[:-1]), atol=1e-15)


def test_a_path_that_knows_its_samples_is_copied_and_pickled():
    path = recorded(DIVER, samples(DIVER), **OPTIONS["all"]).path
    for other in (pickle.loads(pickle.dumps(path)), copy.deepcopy(path)):
        np.testing.assert_array_equal(path_samples(other).values, path_samples(path).values)
