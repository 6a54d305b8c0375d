"""Error bars of recordings that were closed, smoothed or resampled, by the samples as they were recorded."""

from __future__ import annotations

import numpy as np
import pandas
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.shape_space.path_samples import path_samples

# What is computed is the same with and without machine code, which is quicker.

_SIGMA = np.radians(0.3)
BODY = sp.load_body("diver")
OPTIONS = {
    "drift": {"close": "3deg", "close_by": "drift"},
    "smooth loop": {"close": "3deg", "smooth": "0.3deg"},
    "smooth": {"smooth": "0.3deg"},
    "resampled": {"close": "3deg", "resample": 50.0},
}


def recording(*, body: sp.Body = BODY, joints: int = 2, **options) -> sp.RecordedMotion:
    times = np.arange(25) / 24.0
    wave = np.stack([0.5 + 0.3 * np.sin(2.0 * np.pi * times), 0.8 + 0.3 * np.cos(2.0 * np.pi * times)], axis=1)
    wave += _SIGMA * np.random.default_rng(2).normal(size=wave.shape)
    index = pandas.Index(times, name="time [s]")
    table = pandas.DataFrame(wave[:, :joints], columns=body.joint_names[:joints], index=index)
    return sp.read_recorded_motion(table, body, **options)


def motion(recorded: sp.RecordedMotion) -> sp.Motion:
    return sp.reconstruct(sp.articulated(BODY, recorded.path), [1.0, -2.0, 30.0], tolerance=1e-11)


@pytest.mark.parametrize("name", OPTIONS)
def test_by_the_recorded_samples(name: str):
    """Against central differences of recordings that are read anew, at the same penalty."""
    penalty = {"smooth_penalty": 1e-7} if "smooth" in OPTIONS[name] else {}
    recorded = recording(**OPTIONS[name] | penalty)
    whole = motion(recorded)
    found = sp.derivatives(whole).by_samples
    samples = path_samples(recorded.path).values
    assert found.holonomy.shape == (3, samples.size)
    index = pandas.Index(recorded.times, name="time [s]")

    def end(sample: int, joint: int, step: float) -> tuple[sp.Motion, sp.PhaseSplit]:
        changed = samples.copy()
        changed[sample, joint] += step
        table = pandas.DataFrame(changed, columns=BODY.joint_names, index=index)
        there = motion(sp.read_recorded_motion(table, BODY, **OPTIONS[name] | penalty))
        return there, sp.split(there)

    scale = np.abs(found.total_rotation).max()
    step = 1e-4
    for sample, joint in ((0, 1), (10, 0), (24, 0)):
        (_, ahead), (_, behind) = end(sample, joint, step), end(sample, joint, -step)
        column = 2 * sample + joint
        for part in ("total_rotation", "holonomy"):
            expected = so3.log(getattr(ahead, part) @ getattr(behind, part).T) / (2.0 * step)
            np.testing.assert_allclose(getattr(found, part)[:, column], expected, rtol=0.0, atol=1e-6 * scale)
        expected = (ahead.montgomery_phase - behind.montgomery_phase) / (2.0 * step)
        assert found.montgomery_phase[column] == pytest.approx(expected, abs=1e-6 * scale)


def test_both_ends_of_a_cycle_are_known_twice_as_well_by_a_smoother_as_by_taking_off_the_drift():
    """At the first knot: the mean of two samples, and one of them."""
    deviations = {}
    for name in ("drift", "smooth loop"):
        path = recording(**OPTIONS[name] | ({"smooth_penalty": 1e-16} if name == "smooth loop" else {})).path
        samples = path_samples(path)
        unit = np.zeros((1, 1, 2))
        unit[0, 0, 0] = 1.0
        deviations[name] = np.linalg.norm(samples.derivative(np.zeros(1), unit, 0.0 * unit))
    assert deviations["drift"] == pytest.approx(1.0, rel=1e-9)
    assert deviations["smooth loop"] == pytest.approx(np.sqrt(0.5), rel=1e-6)


def test_what_smoothing_shifts_is_told_and_grows_with_the_penalty_and_bars_hold_it():
    """To first order the shift is that of the path, by the change of the result between two paths."""
    chosen = recording(**OPTIONS["smooth loop"])
    wide = recording(**OPTIONS["smooth loop"], smooth_penalty=300.0 * float(chosen.smoothing.penalty.max()))
    few, many = (sp.uncertainty(motion(each), joints=_SIGMA) for each in (chosen, wide))
    assert 0.0 < few.smoothing_bias < 0.7
    assert few.smoothing_bias < many.smoothing_bias <= 1.0
    assert np.trace(many.holonomy) > 2.0 * np.trace(few.holonomy)
    assert sp.uncertainty(motion(chosen), momentum=0.1).smoothing_bias == 0.0
    assert sp.uncertainty(motion(recording(**OPTIONS["drift"])), joints=_SIGMA).smoothing_bias == 0.0


def test_first_order_is_what_draws_of_the_recorded_samples_show():
    whole = motion(recording(**OPTIONS["smooth loop"]))
    first, drawn = sp.uncertainty(whole, joints=0.01), sp.sampled_uncertainty(whole, joints=0.01, draws=40, seed=1)
    for name in ("total_rotation", "holonomy"):
        ratio = np.trace(getattr(first, name)) / np.trace(getattr(drawn, name))
        # A variance of 40 draws of three components is known to some 20 %.
        assert 0.55 < ratio < 1.8


def test_a_joint_without_a_column_has_no_noise():
    half = recording(joints=1, rest={BODY.joint_names[1]: 0.5})
    whole = motion(half)
    all_joints, one_joint = (sp.uncertainty(whole, joints=given) for given in (_SIGMA, [_SIGMA, 0.0]))
    np.testing.assert_allclose(all_joints.total_rotation, one_joint.total_rotation, rtol=1e-12)
    both = sp.uncertainty(whole, joints=[_SIGMA, _SIGMA])
    assert np.trace(both.total_rotation) > 1.001 * np.trace(one_joint.total_rotation)
