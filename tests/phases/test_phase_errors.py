"""Error estimates of phases: never below the true error, and not far above it.

The truth is integrated in extended precision by code that shares nothing with the library (`benchmarks`), or is a
closed form of the free rigid body.
"""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest
from benchmarks import phase_estimates
from benchmarks.extended import Segment
from benchmarks.random_motions import Trial

import shapephase as sp
from shapephase import so3, sphere
from shapephase.integrator.curve_integrals import curve_integrals
from shapephase.integrator.integrate import stepped_rotation
from shapephase.integrator.stepped import SteppedRotation
from shapephase.phases import arc_phases, running_phases
from shapephase.phases.momentum_curve import momentum_curve
from support.compiler import needs_compiler
from support.independent import BODIES, apart, body_of, random_loop, random_vector
from support.long_runs import full_but
from support.series_motion import sampler_of_series

GAUGES = ("base", "horizontal", "principal")
NAMES = ("cat", "satellite", "cat_two_halves")
EPS = float(np.finfo(float).eps)
UP = np.array([0.0, 0.0, 1.0])


def motion_of(name: str, tolerance: float, seed: int = 1, loops: int = 1) -> sp.Motion:
    body = body_of(name)
    path = random_loop(seed, body.n_shape).path
    path = path.repeated(loops) if loops > 1 else path
    return sp.reconstruct(sp.articulated(body, path), random_vector(seed + 1, BODIES[name]), tolerance=tolerance)


def solution_of(motion: sp.Motion) -> SteppedRotation:
    assert isinstance(motion.solution, SteppedRotation)
    return motion.solution


def a_trial(tolerance: float) -> Trial:
    body = sp.load_body("cat_two_halves")
    path = random_loop(3, body.n_shape).path
    segment = Segment(path, path.breaks, path.duration)
    return Trial("a loop", body, path, (segment,), random_vector(4, 0.3), tolerance)


@needs_compiler
@pytest.mark.parametrize(("family", "number"), [("harmonics", 2), ("harmonics", 3), ("mixed", 1), ("mixed", 2)])
def test_every_number_of_a_split_is_within_its_estimate(family: str, number: int):
    """Three gauges, attitude and lift, phases and areas; `python -m benchmarks.phase_estimates` has hundreds."""
    rows = phase_estimates.judged(family, 3, number)
    assert len(rows) == len(phase_estimates.GAUGES) * len(phase_estimates.QUANTITIES)
    for row in rows:
        assert row.above <= 1.0, row


@pytest.mark.full
@needs_compiler
@pytest.mark.parametrize("family", ["harmonics", "mixed"])
def test_no_number_of_many_splits_is_above_its_estimate(family: str):
    rows = [row for number in range(40) for row in phase_estimates.judged(family, 4, number)]
    assert [row for row in rows if row.above > 1.0] == []


@needs_compiler
@pytest.mark.parametrize("away", [1e-2, 1e-5, 1e-12])
def test_near_the_opposite_point_the_closing_makes_errors_large(away: float):
    """A user's gauge turns the end of the curve to `away` from the point opposite its start."""
    trial = a_trial(1e-6)
    deformation = sp.articulated(trial.body, trial.path)
    motion = sp.reconstruct(deformation, trial.momentum, tolerance=trial.tolerance)
    curve = phase_estimates.exact_curve(trial, deformation.closure)
    first, last = curve.direction[0].astype(float), curve.direction[-1].astype(float)
    goal = so3.exp(away * so3.perpendicular(first)) @ -first
    whole = so3.log(so3.between(last, goal)).astype(np.longdouble)

    def frames(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        share = times / trial.path.duration
        angle, axis = np.sqrt(whole @ whole), whole / np.sqrt(whole @ whole)
        x, y, z = axis.astype(times.dtype)
        hat = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = (angle * share).astype(times.dtype)[:, None, None]
        rates = np.broadcast_to((whole / trial.path.duration).astype(times.dtype), (len(times), 3))
        return np.eye(3, dtype=times.dtype) + np.sin(turn) * hat + (1 - np.cos(turn)) * hat @ hat, rates

    exact, found = phase_estimates.exact_split(curve, frames), sp.split(motion, frames)
    assert found.momentum_gap == pytest.approx(np.pi - away, abs=1e-5)
    for name in phase_estimates.QUANTITIES:
        turns = 4.0 if name.endswith(("phase", "angle")) else None
        error = phase_estimates.distance(getattr(found, name), getattr(exact, name), turns)
        assert error - curve.uncertainty <= getattr(found.error_estimates, name), name
    # The error of the end, times the cotangent of half of what is left to the opposite point.
    expected = 2.0 * float(found.error_estimates.momentum_gap) / away
    assert 0.9 * min(expected, np.pi) < found.error_estimates.closing_tilt < 1.2 * expected
    for name in ("solid_angle", "montgomery_phase"):
        assert getattr(found.error_estimates, name) < 1.2 * expected + 10.0 * motion.error_estimate
    assert found.error_estimates.dynamic_phase < 20.0 * motion.error_estimate


def spiral(gap: float) -> sp.Deformation:
    """A round body whose momentum starts at the pole z and ends `gap` from its opposite, longitude 1.3 x colatitude."""

    def internal_momentum(times: np.ndarray) -> np.ndarray:
        colatitude, rate = (np.pi - gap) * np.sin(0.5 * np.pi * times) ** 2, np.sin(np.pi * times)
        longitude, rate = 1.3 * colatitude, 0.5 * np.pi * (np.pi - gap) * rate
        level = np.stack([np.cos(longitude), np.sin(longitude), 0.0 * times], axis=-1)
        across = np.stack([-np.sin(longitude), np.cos(longitude), 0.0 * times], axis=-1)
        sine, cosine = np.sin(colatitude)[:, None], np.cos(colatitude)[:, None]
        unit, along = sine * level + cosine * UP, cosine * level - sine * UP
        # With unit inertia u' = L_o x u; the part along u adds to the dynamic phase.
        return np.cross(unit, rate[:, None] * (along + 1.3 * sine * across)) + 0.3 * unit

    return sp.prescribed(lambda times: np.broadcast_to(np.eye(3), (len(times), 3, 3)), internal_momentum, 1.0)


@pytest.mark.parametrize("gap", [9e-9, 1e-10, 1e-12, 1e-14, 0.0])
def test_a_curve_that_ends_opposite_its_start_is_within_its_estimate(gap: float):
    """Seen from the pole the area is that of the longitude, the integral of (1 - cos) 1.3; the circle back has none."""
    motion = sp.reconstruct(spiral(gap), UP, tolerance=1e-11)
    area, dynamic = 1.3 * (np.pi - gap - np.sin(gap)), 0.7
    whole, arc = sp.split(motion, "base"), arc_phases(motion, [0.0, 1.0], "base")
    running = running_phases(motion, 1.0, "base")
    for found in (whole, running, arc):
        errors = found.error_estimates
        assert np.max(np.abs(sphere.wrapped(found.solid_angle - area))) <= np.max(errors.solid_angle)
        assert np.max(np.abs(so3.wrap(found.montgomery_phase - dynamic + area))) <= np.max(errors.montgomery_phase)
        # The error of the end, over half its distance from the opposite point.
        grown = 2.0 * float(np.max(whole.error_estimates.momentum_gap)) / max(gap, 1e-300)
        # An end that may be nearly as far off as the opposite point is: the circle back may lie anywhere.
        assert np.max(errors.solid_angle) < 2.0 * grown + 10.0 * motion.error_estimate or grown > 0.5
    assert abs(sphere.wrapped(motion.solid_angle(1.0) - area)) <= whole.error_estimates.solid_angle


def test_with_a_torque_too_a_curve_that_ends_opposite_its_start_is_within_its_estimate():
    gap = 5e-9
    nothing = sp.ExternalTorque(lambda _: [0.0, 0.0, 0.0], axes="space")
    found = sp.split(sp.reconstruct(spiral(gap), UP, torque=nothing, tolerance=1e-9), "base")
    error = abs(so3.wrap(found.phase - 0.7 + 1.3 * (np.pi - gap - np.sin(gap))))
    assert error <= found.error_estimate < 0.1


@pytest.mark.parametrize("off", [1e-5, 1e-7, 1e-9, -1e-11, -1e-7])
def test_an_area_keeps_no_error_of_having_passed_the_opposite_of_its_start(off: float):
    """The momentum goes round a circle through its start, whose farthest point is `off` from the start's opposite."""
    radius = 0.5 * (np.pi - off)
    spin = 2.0 * np.pi * np.array([np.sin(radius), 0.0, np.cos(radius)])
    body = sp.prescribed(
        lambda times: np.broadcast_to(np.eye(3), (len(times), 3, 3)), lambda times: np.tile(spin, (len(times), 1)), 3.0
    )
    motion = sp.reconstruct(body, UP, tolerance=1e-13)
    turns = np.array([1.0, 2.0, 3.0])
    area = 2.0 * np.pi * (1.0 - np.cos(radius)) * turns
    np.testing.assert_allclose(sphere.wrapped(motion.solid_angle(turns) - area), 0.0, rtol=0, atol=2e-13)
    times = np.linspace(0.03, 2.97, 50)
    apart = sphere.wrapped(motion.solid_angle(times) - running_phases(motion, times, "base").solid_angle)
    np.testing.assert_allclose(apart, 0.0, rtol=0, atol=2e-13)


TOLERANCES = (1e-6, 1e-9, 1e-11)


@pytest.mark.parametrize(
    ("duration", "tolerance"), full_but(product([3.0, 300.0], TOLERANCES), *product([3.0], TOLERANCES))
)
def test_phases_of_constant_data_are_within_their_estimates(duration: float, tolerance: float):
    """A rigid body, stepped; its energy is constant, so the dynamic phase is 2 T t / |L| and the rest closed forms."""
    moments, momentum = np.array([1.0, 2.0, 3.0]), np.array([0.3, 0.2, 1.1])
    rigid = sp.rigid(np.diag(moments), duration)
    motion = sp.reconstruct(rigid, momentum, tolerance=tolerance, method="spectral")
    found = sp.split(motion, "base")
    magnitude = float(np.linalg.norm(momentum))
    dynamic = float(np.sum(momentum**2 / moments)) * duration / magnitude
    rounding = 8.0 * EPS * dynamic
    error = abs(float(found.dynamic_phase) - dynamic)
    assert error <= found.error_estimates.dynamic_phase + rounding
    exact = sp.reconstruct(rigid, momentum, tolerance=1e-12, method="dop853")
    other = sp.split(exact, "base")
    both = exact.error_estimate + rounding
    for name in ("montgomery_phase", "solid_angle"):
        gap = abs(float(sphere.wrapped(getattr(found, name) - getattr(other, name))))
        slack = float(getattr(other.error_estimates, name)) + both
        assert gap <= getattr(found.error_estimates, name) + slack
    # Not far above either: within what the attitude's own estimate is above its error, and a little.
    attitude = apart(motion.final_attitude, exact.final_attitude) + both
    assert found.error_estimates.dynamic_phase < 100.0 * motion.error_estimate / attitude * (error + attitude)


@pytest.mark.parametrize("name", NAMES)
def test_small_turns_of_the_attitude_change_phases_as_predicted(name: str):
    """Long steps against short ones: their difference in attitude gives that of area and Montgomery phase."""
    loose = motion_of(name, 1e-5)
    fine = stepped_rotation(sampler_of_series(loose.interpolant), solution_of(loose).momentum, 1e-13)
    tight = replace(loose, solution=fine)
    for gauge in GAUGES:
        # Sums over edges are linear between them: steps are long, and cut in halves.
        ends = loose.solution.times
        curve = momentum_curve(loose, gauge, times=np.union1d(ends, 0.5 * (ends[:-1] + ends[1:])))
        times = curve.edges
        turns = so3.log(so3.transpose(loose.attitude(times)) @ tight.attitude(times))[None]
        area, phase, _ = curve.displaced(turns)
        other = momentum_curve(tight, gauge, times=np.union1d(times, tight.solution.times))
        mine, theirs = curve.swept(times), other.swept(times)
        # The reference of both areas must be one.
        np.testing.assert_allclose(curve.references, other.references)
        closing = [
            sphere.triangle_area(curve.references[:, None], part.directions(times), part.directions(times))
            for part in (curve, other)
        ]
        np.testing.assert_allclose(closing[0], closing[1], atol=1e-12)
        change = theirs[0] - mine[0]
        scale, both = np.abs(turns).max(), curve.error[0] + other.error[0]
        assert np.abs(change - (area + phase)).max() < 0.15 * np.abs(area + phase).max() + 0.02 * scale + both


@pytest.mark.parametrize("gauge", GAUGES)
@pytest.mark.parametrize("name", NAMES)
def test_phases_in_time_and_of_arcs_are_within_their_estimates(name: str, gauge: str):
    loose, tight = motion_of(name, 1e-6), motion_of(name, 1e-13)
    # Early ones too: the polynomials between the ends of steps are as wrong there as anywhere, all else hardly is.
    times = np.union1d(np.linspace(0.0, loose.duration, 60), loose.duration * np.geomspace(1e-5, 1e-2, 10))
    mine, theirs = running_phases(loose, times, gauge), running_phases(tight, times, gauge)
    for part in ("dynamic_phase", "montgomery_phase", "solid_angle"):
        gap = np.abs(sphere.wrapped(getattr(mine, part) - getattr(theirs, part)))
        allowed = getattr(mine.error_estimates, part) + getattr(theirs.error_estimates, part)
        assert np.all(gap <= allowed)
        assert allowed.shape == times.shape
    cuts = np.linspace(0.0, loose.duration, 6)
    mine, theirs = arc_phases(loose, cuts, gauge), arc_phases(tight, cuts, gauge)
    for part in ("dynamic_phase", "montgomery_phase", "solid_angle", "polygon_angle", "total_phase", "momentum_gap"):
        gap = np.abs(sphere.wrapped(getattr(mine, part) - getattr(theirs, part)))
        assert np.all(gap <= getattr(mine.error_estimates, part) + getattr(theirs.error_estimates, part)), part
    for part in ("closing_tilt", "total_closing_tilt"):
        gap = so3.angle(so3.transpose(getattr(mine, part)) @ getattr(theirs, part))
        assert np.all(gap <= getattr(mine.error_estimates, part) + getattr(theirs.error_estimates, part)), part


@pytest.mark.parametrize("gauge", GAUGES)
def test_a_batch_has_the_estimates_of_its_motions(gauge: str):
    """Also of a motion at rest among others: its phases are zero and certain."""
    body = body_of("cat")
    deformation = sp.articulated(body, random_loop(1, body.n_shape).path)
    momenta = np.array([[0.02, 0.01, 0.05], [0.0, 0.0, 0.0], [0.0, 0.03, -0.02]])
    together = sp.split(sp.reconstruct(deformation, momenta, tolerance=1e-8), gauge).error_estimates
    for row, momentum in enumerate(momenta):
        alone = sp.split(sp.reconstruct(deformation, momentum, tolerance=1e-8), gauge).error_estimates
        for field in fields(alone):
            one, of_batch = getattr(alone, field.name), getattr(together, field.name)
            assert of_batch.shape == (3,)
            if momentum.any() and field.name != "wheel_rotation":
                assert 0.0 < of_batch[row] < 1e-6
            elif field.name not in ("total_rotation", "holonomy"):
                assert one == of_batch[row] == 0.0
            else:
                assert 0.0 < one < 1e-8


@pytest.mark.parametrize("horizontal", [False, True])
def test_integrals_between_any_edges_add_up_to_those_of_the_steps(horizontal: bool):
    motion = motion_of("cat", 1e-9)
    solution, lift = solution_of(motion), motion.lift_with_errors if horizontal else None
    whole = curve_integrals(solution, lift)
    inner = np.random.default_rng(1).uniform(0.0, motion.duration, 50)
    edges = np.union1d(solution.times, inner)
    parts = curve_integrals(solution, lift, edges)
    near = 0.05 * float(motion.error_estimate)
    assert abs(parts.dynamic.sum() - whole.dynamic.sum()) < near
    areas = [each.slivers.sum() + sphere.polygon_area(each.corners)[0] for each in (whole, parts)]
    assert abs(float(sphere.wrapped(np.array(areas[0] - areas[1])))) < near
    place = np.searchsorted(edges, solution.times)
    np.testing.assert_allclose(parts.corners[:, place], whole.corners, rtol=0, atol=1e-14)
    np.testing.assert_allclose(parts.slopes[:, place], whole.slopes, rtol=1e-11, atol=1e-11)
    same = curve_integrals(solution, lift, solution.times)
    for one, other in zip(same, whole, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-13)


def test_a_motion_at_rest_is_split_within_its_estimate():
    motion = sp.reconstruct(motion_of("cat", 1e-9).deformation, np.zeros(3), tolerance=1e-9)
    errors = sp.split(motion).error_estimates
    assert 0.0 < errors.holonomy == errors.total_rotation <= motion.error_estimate
    assert errors.montgomery_phase == 0.0
