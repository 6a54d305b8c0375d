"""Dynamic phase and area of the momentum's curve, beside quadratures over attitudes by SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from shapephase import so3, sphere
from shapephase.arrays import Array
from shapephase.integrator import SteppedRotation, stepped_rotation
from shapephase.integrator.curve_integrals import curve_integrals
from shapephase.integrator.lift import lift_along
from support.series_motion import random_interpolant, rates_of_momentum, sampler_of_series, series_motion

MOMENTUM = np.array([1.2, -0.7, 2.1])


def motion_of(seed: int, tolerance: float, momentum: Array = MOMENTUM) -> SteppedRotation:
    body = random_interpolant(np.random.default_rng(seed))
    return stepped_rotation(sampler_of_series(body), momentum[None], tolerance)


def quadratures(seed: int, edges: Array, horizontal: bool) -> tuple[float, float]:
    """Dynamic phase, and area of the curve closed by the great circle back, seen from its start: Gauss's rule."""
    body = random_interpolant(np.random.default_rng(seed))
    nodes, weights = leggauss(10)
    half = 0.5 * np.diff(edges)
    times = np.append(0.0, (edges[:-1, None] + half[:, None] * (1.0 + nodes)).ravel())
    truth = series_motion(body, MOMENTUM, times)
    axis = MOMENTUM / np.linalg.norm(MOMENTUM)
    directions = so3.apply(so3.transpose(so3.matrix_from_quat(truth.quaternions)), axis)
    spin, drift = rates_of_momentum(truth.channels, MOMENTUM, directions)
    rates = spin if horizontal else spin - drift
    along = np.einsum("ni,ni->n", rates, directions)
    slopes = np.cross(directions, rates)
    if horizontal:
        frames = so3.matrix_from_quat(series_motion(body, np.zeros(3), times).quaternions)
        directions, slopes = so3.apply(frames, directions), so3.apply(frames, slopes)
    start = directions[0]
    grown = np.cross(directions, slopes) @ start / (1.0 + directions @ start)
    whole = (half[:, None] * weights).ravel()
    return float(along[1:] @ whole), float(grown[1:] @ whole)


@pytest.mark.parametrize("horizontal", [False, True])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-11])
def test_integrals_are_those_of_the_curve(seed: int, horizontal: bool, tolerance: float):
    motion = motion_of(seed, tolerance)
    found = curve_integrals(motion, lift_along(motion) if horizontal else None)
    dynamic, area = quadratures(seed, np.linspace(0.0, 1.4, 29), horizontal)
    near = 10.0 * float(motion.error_estimate[0]) + float(found.error[0]) + 1e-12
    assert abs(found.dynamic.sum() - dynamic) < near
    whole = found.slivers.sum() + sphere.polygon_area(found.corners)[0]
    assert abs(float(sphere.wrapped(np.array(whole - area)))) < near
    if not horizontal:
        assert abs(motion.dynamic_phase(motion.times[-1:])[0, 0] - dynamic) < near
        assert abs(float(sphere.wrapped(motion.solid_angle(motion.times[-1:])[0, 0] - area))) < near


@pytest.mark.parametrize("horizontal", [False, True])
def test_the_error_of_integrals_is_that_of_finer_pieces(horizontal: bool):
    """Coarse steps on one interpolant, whose pieces are halved twice: the difference is within the estimate."""
    motion = motion_of(1, 1e-4)
    lift = lift_along(motion) if horizontal else None
    quarters = motion.times[:-1, None] + np.diff(motion.times)[:, None] * np.arange(4) / 4.0
    whole, parts = (curve_integrals(motion, lift, edges) for edges in (None, np.append(quarters, motion.times[-1])))
    apart = abs(parts.dynamic.sum() - whole.dynamic.sum())
    assert apart <= whole.error[0] + 0.1 * motion.error_estimate[0] + 1e-14
    assert parts.error[0] < 0.2 * whole.error[0] + 1e-15


def test_a_steady_turn_about_another_axis():
    """A round body of inertia one turns by |Pi| t about Pi: the dynamic phase is the angle, the curve is a point."""
    body = random_interpolant(np.random.default_rng(0))
    series = np.zeros_like(body.coefficients)
    series[:, 0, :3] = 1.0
    round_body = type(body)(body.edges, series, 1, 0)
    motion = stepped_rotation(sampler_of_series(round_body), MOMENTUM[None], 1e-12)
    for lift in (None, lift_along(motion)):
        found = curve_integrals(motion, lift)
        np.testing.assert_allclose(found.dynamic.sum(), 1.4 * np.linalg.norm(MOMENTUM), rtol=1e-14)
        np.testing.assert_allclose(
            found.corners[0], np.tile(found.corners[0, :1], (found.corners.shape[1], 1)), atol=1e-14
        )
        for nothing in (found.slivers, found.slopes, found.by_momentum):
            np.testing.assert_allclose(nothing, 0.0, rtol=0, atol=1e-14)


@pytest.mark.parametrize("horizontal", [False, True])
def test_slopes_are_those_of_the_corners(horizontal: bool):
    """By central differences along the curve in the gauge, in its frame's axes."""
    motion, step = motion_of(2, 1e-9), 1e-4
    lift = lift_along(motion) if horizontal else None
    edges = np.sort(np.concatenate([motion.times, [0.3, 0.3 - step, 0.3 + step]]))
    found = curve_integrals(motion, lift, edges)
    place = int(np.searchsorted(edges, 0.3))
    slope = (found.corners[0, place + 1] - found.corners[0, place - 1]) / (2.0 * step)
    frame = np.eye(3) if lift is None else lift.rotation.rotation(edges[[place]])[0, 0]
    np.testing.assert_allclose(frame @ found.slopes[0, place], slope, rtol=0, atol=1e-6)


def test_integrals_do_not_depend_on_how_many_pieces_are_taken_at_once(monkeypatch: pytest.MonkeyPatch):
    motion = motion_of(3, 1e-9)
    lift = lift_along(motion)
    whole = curve_integrals(motion, lift)
    monkeypatch.setattr("shapephase.integrator.curve_integrals._AT_ONCE", 5)
    for one, other in zip(whole, curve_integrals(motion, lift), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-15)
