"""Phases of heavy tops: the integrated attitude, Stokes' theorem with the curvature, and steady precession."""

from __future__ import annotations

import numpy as np
import pytest

from shapephase import so3
from shapephase.rigid_body import HeavyTop, heavy_top_phase


def random_motion(rng, duration=None):
    turn = so3.exp(rng.normal(size=3))
    inertia = turn @ np.diag(rng.uniform(1.0, 2.0, 3)) @ turn.T
    top = HeavyTop(inertia, rng.uniform(0.0, 3.0), so3.normalised(rng.normal(size=3)))
    gamma = so3.normalised(rng.normal(size=3))
    length = rng.uniform(1.0, 6.0) if duration is None else duration
    return top.motion(rng.normal(size=3) * 2.0, gamma, duration=length, tolerance=1e-11)


@pytest.mark.parametrize("count", [8, pytest.param(100, marks=pytest.mark.full)])
def test_both_parts_make_the_integrated_turn(count):
    rng = np.random.default_rng(count)
    for _ in range(count):
        motion = random_motion(rng)
        phase = heavy_top_phase(motion)
        assert phase.residual < 1e-10
        assert phase.residual < 10.0 * phase.error_estimate
        assert phase.angle == pytest.approx(so3.wrap(phase.geometric + phase.dynamic), abs=1e-14)


def test_the_geometric_part_is_an_integral_of_the_curvature():
    """Over the cone of great circles from Gamma(0), with the curvature of Marsden, Montgomery and Ratiu."""
    motion = random_motion(np.random.default_rng(5), 0.8)
    inertia, start = motion.top.inertia, motion.gamma(0.0)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    times, parts = 0.4 * (nodes + 1.0), 0.5 * (nodes + 1.0)
    ends = motion.gamma(times)
    rates = np.cross(ends, motion.angular_velocity(times))
    opening = np.arccos(ends @ start)[:, None, None]
    s = parts[None, :, None]
    # Slerp and its derivatives, by s and by the time through the end and the opening.
    towards = -np.einsum("ti,i->t", rates, start)[:, None, None] / np.sin(opening)
    points = (np.sin((1.0 - s) * opening) * start + np.sin(s * opening) * ends[:, None]) / np.sin(opening)
    along = opening * (-np.cos((1.0 - s) * opening) * start + np.cos(s * opening) * ends[:, None]) / np.sin(opening)
    across = (
        towards * ((1.0 - s) * np.cos((1.0 - s) * opening) * start + s * np.cos(s * opening) * ends[:, None])
        + np.sin(s * opening) * rates[:, None]
    ) / np.sin(opening) - points * towards * np.cos(opening) / np.sin(opening)
    element = np.einsum("tsi,tsi->ts", points, np.cross(along, across))
    about = np.einsum("tsi,ij,tsj->ts", points, inertia, points)
    carried = points @ inertia
    curvature = (2.0 * np.sum(carried**2, axis=-1) - np.trace(inertia) * about) / about**2
    flux = 0.4 * 0.5 * weights @ (curvature * element) @ weights
    assert float(heavy_top_phase(motion).geometric) == pytest.approx(flux, abs=1e-10)


def test_steady_precession_turns_by_its_rate():
    """A symmetric top at a constant tilt, whose spin and precession balance gravity: Gamma returns after one spin."""
    across, along, mgl, tilt, precession = 1.3, 0.7, 2.0, 0.6, 0.9
    # (I3 w3 - I1 p cos) p = Mgl, with w3 = spin + p cos.
    axial = mgl / (along * precession) + across * precession * np.cos(tilt) / along
    spin = axial - precession * np.cos(tilt)
    gamma = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    momentum = np.array([across * precession * np.sin(tilt), 0.0, along * axial])
    top, period = HeavyTop(np.diag([across, across, along]), mgl), 2.0 * np.pi / spin
    phase = heavy_top_phase(top.motion(momentum, gamma, duration=period, tolerance=1e-11))
    about = across * np.sin(tilt) ** 2 + along * np.cos(tilt) ** 2
    assert phase.angle == pytest.approx(so3.wrap(precession * period), abs=1e-10)
    assert phase.dynamic == pytest.approx(momentum @ gamma / about * period, abs=1e-10)
    # Gamma goes round the axis of the top against its spin.
    assert phase.solid_angle == pytest.approx(-2.0 * np.pi * (1.0 - np.cos(tilt)) * np.sign(spin), abs=1e-10)


def test_a_batch_is_each_of_its_tops():
    moments = np.array([[1.0, 1.5, 2.0], [1.2, 1.9, 0.8]])
    tops = HeavyTop(np.eye(3) * moments[:, None], [1.0, 2.0])
    both = heavy_top_phase(tops.motion([0.3, 0.2, 1.0], [0.6, 0.0, 0.8], duration=2.0, tolerance=1e-11))
    for row, strength in enumerate([1.0, 2.0]):
        top = HeavyTop(np.diag(moments[row]), strength)
        alone = heavy_top_phase(top.motion([0.3, 0.2, 1.0], [0.6, 0.0, 0.8], duration=2.0, tolerance=1e-11))
        assert both.geometric[row] == pytest.approx(alone.geometric, abs=1e-10)
        assert both.dynamic[row] == pytest.approx(alone.dynamic, abs=1e-10)


def test_a_top_that_stands_still_has_no_phase():
    phase = heavy_top_phase(HeavyTop(np.eye(3), 1.0).motion([0.0, 0.0, 0.0], [0.0, 0.0, 1.0], duration=1.0))
    assert (phase.geometric, phase.dynamic, phase.residual) == (0.0, 0.0, 0.0)
