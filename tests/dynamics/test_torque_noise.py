"""Error bars of torques, rates, power and work against motions that are reconstructed anew from other samples."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.dynamics import load_errors
from shapephase.errors import ShapeError

BODY = sp.load_body("diver")
TIMES = np.linspace(0.0, 1.0, 5)
SHAPES = [1.2, -1.0] + 0.5 * np.sin(4.0 * TIMES[:, None] + [0.0, 0.7])
AT = np.array([0.0, 0.3, 1.0])
NOISE = 1e-3


def moved(shapes):
    path = sp.ShapePath.spline(TIMES, shapes, False, joint_names=BODY.joint_names)
    # Without momentum torques do not answer to the attitude, which the bars take as it is.
    return sp.reconstruct(sp.articulated(BODY, path), np.zeros(3), tolerance=1e-10)


@pytest.fixture(scope="module")
def by_samples():
    """Of torque, rate and power at those times, and of the work, by each sample: central differences."""
    step, found = 1e-4, []
    for sample in range(SHAPES.size):
        ends = []
        for sign in (1.0, -1.0):
            changed = SHAPES.copy().ravel()
            changed[sample] += sign * step
            torques = sp.joint_torques(moved(changed.reshape(SHAPES.shape)), AT)
            ends.append([torques.torque, torques.rate, torques.power, torques.loads.work])
        found.append([(ahead - behind) / (2.0 * step) for ahead, behind in zip(*ends, strict=True)])
    return [np.array(part) for part in zip(*found, strict=True)]


def test_bars_are_those_of_motions_through_other_samples(by_samples):
    motion = moved(SHAPES)
    torques = sp.joint_torques(motion, AT)
    found = sp.torque_errors(torques, NOISE)
    for bars, derivative in zip((found.torque, found.rate, found.power), by_samples, strict=False):
        np.testing.assert_allclose(bars, NOISE * np.sqrt((derivative**2).sum(axis=0)), rtol=1e-5)
    work = NOISE * np.sqrt((by_samples[3] ** 2).sum(axis=0))
    total = NOISE * np.sqrt((by_samples[3].sum(axis=1) ** 2).sum())
    loads = load_errors(motion, torques.loads, NOISE)
    # Summed over 201 even times.
    np.testing.assert_allclose(loads.work, work, rtol=1e-2)
    assert loads.total_work == pytest.approx(total, rel=1e-2)
    peak = sp.torque_errors(sp.joint_torques(motion, torques.loads.peak_time), NOISE).torque
    np.testing.assert_allclose(loads.peak_torque, np.diag(peak), rtol=1e-9)


def test_a_batch_has_no_bars():
    path = sp.ShapePath.spline(TIMES, SHAPES, False, joint_names=BODY.joint_names)
    motion = sp.reconstruct(sp.articulated(BODY, path), np.eye(3))
    with pytest.raises(ShapeError, match="motion"):
        sp.torque_errors(sp.joint_torques(motion, AT), NOISE)
