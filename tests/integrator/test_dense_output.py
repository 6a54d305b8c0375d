"""Attitudes between the ends of steps, and the integrals that come out of the steps."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3, sphere
from shapephase.integrator import _dense_output
from shapephase.integrator._dense_output import hermite_matrix
from shapephase.integrator.curve_integrals import curve_integrals
from shapephase.integrator.fast.estimate_constants import TERMS
from shapephase.integrator.integrate import stepped_rotation
from shapephase.integrator.sampling import FinishedSampler
from shapephase.integrator.stepped import SteppedRotation
from shapephase.phases._momentum_curve import momentum_curve
from support.independent import BODIES, body_of, random_loop, random_vector

NAMES = ("cat", "astronaut", "example:human")


@lru_cache(maxsize=32)
def motion_of(name: str, tolerance: float, momentum: float = 1.0) -> sp.Motion:
    body = body_of(name)
    deformation = sp.articulated(body, random_loop(1, body.n_shape).path)
    return sp.reconstruct(deformation, momentum * random_vector(2, BODIES[name]), tolerance=tolerance)


def solution_of(motion: sp.Motion) -> SteppedRotation:
    assert isinstance(motion.solution, SteppedRotation)
    return motion.solution


def some_times(motion: sp.Motion, count: int = 500) -> np.ndarray:
    return np.random.default_rng(3).uniform(0.0, motion.duration, count)


def apart(first: np.ndarray, second: np.ndarray) -> float:
    return float(so3.angle(so3.transpose(first) @ second).max())


def test_a_polynomial_of_full_degree_is_reproduced():
    """Taylor terms of a random polynomial at both ends give its coefficients."""
    exact = np.polynomial.Polynomial(np.random.default_rng(0).normal(size=2 * TERMS))
    # y = 2 x - 1: a derivative by x is twice that by y.
    terms, slope, factorial = [[], []], exact, 1.0
    for order in range(TERMS):
        for side, y in enumerate((-1.0, 1.0)):
            terms[side].append(slope(y) * 2.0**order / factorial)
        slope, factorial = slope.deriv(), factorial * (order + 1)
    np.testing.assert_allclose(hermite_matrix() @ np.concatenate(terms), exact.coef, rtol=0, atol=1e-12)


@pytest.mark.parametrize("momentum", [0.0, 1.0])
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
def test_the_estimate_holds_between_the_steps(name: str, tolerance: float, momentum: float):
    """Against a motion whose steps are others, and whose estimate is far smaller."""
    motion, truth = motion_of(name, tolerance, momentum), motion_of(name, 1e-12, momentum)
    times = some_times(motion)
    error = apart(motion.attitude(times), truth.attitude(times))
    assert error <= motion.error_estimate + truth.error_estimate


@pytest.mark.parametrize("momentum", [0.0, 1.0])
@pytest.mark.parametrize("name", NAMES)
def test_between_the_steps_the_error_is_that_at_their_ends(name: str, momentum: float):
    """The polynomials add a hundredth of the estimate at most, on the samples that the motion has."""
    motion = motion_of(name, 1e-9, momentum)
    solution = solution_of(motion)
    truth = stepped_rotation(FinishedSampler(solution.interpolant), solution.momentum, 1e-12)
    ends, times = solution.times, some_times(motion)
    at_ends = apart(solution.rotation(ends), truth.rotation(ends))
    between = apart(solution.rotation(times), truth.rotation(times))
    assert between <= at_ends + 0.01 * motion.error_estimate + float(truth.error_estimate[0])


def test_the_ends_of_steps_are_what_was_stepped():
    motion = motion_of("cat", 1e-9)
    solution = solution_of(motion)
    stepped = so3.matrix_from_quat(solution.quaternions)
    assert np.array_equal(solution.rotation(solution.times), stepped)
    mixed = np.append(solution.times, 0.37 * motion.duration)
    assert np.array_equal(solution.rotation(mixed)[:, :-1], stepped)
    assert np.array_equal(solution.end, stepped[:, -1])
    phases = solution.dynamic_phase(solution.times)
    np.testing.assert_allclose(phases[:, 1:], np.cumsum(solution.dynamics, axis=1), rtol=0, atol=1e-14)


@pytest.mark.parametrize("momentum", [0.0, 1.0])
def test_a_few_steps_at_once_give_the_same(monkeypatch: pytest.MonkeyPatch, momentum: float):
    """Motions of so many steps that their polynomials are not kept; then other steps may be halved for these."""
    loops = motion_of("cat", 1e-7, momentum).deformation
    often = sp.articulated(body_of("cat"), random_loop(1, body_of("cat").n_shape).path.repeated(3))
    assert loops.duration < often.duration
    spatial = momentum * random_vector(2, BODIES["cat"]) * np.array([[1.0], [0.5]])
    kept, anew = (sp.reconstruct(often, spatial, tolerance=1e-7) for _ in range(2))
    times = some_times(kept)
    attitudes, phases, areas = kept.attitude(times), kept.dynamic_phase(times), kept.solid_angle(times)
    monkeypatch.setattr(_dense_output, "_MOST_PIECES", 7)
    # Without momentum the estimate is hardly more than the error of the steps, which more pieces have at other places.
    near = (0.02 if momentum else 0.5) * float(kept.error_estimate.max())
    assert apart(attitudes, anew.attitude(times)) < near
    np.testing.assert_allclose(anew.dynamic_phase(times), phases, rtol=0, atol=near)
    np.testing.assert_allclose(anew.solid_angle(times), areas, rtol=0, atol=2.0 * near)


def test_steps_are_halved_where_polynomials_are_not_near_enough(monkeypatch: pytest.MonkeyPatch):
    """Without a measure of the error they are not, and the difference shows what halving is for."""
    body = body_of("diver")

    def error(size: float, harmonics: int, tolerance: float) -> float:
        sines, cosines = size * np.random.default_rng(4).normal(size=(2, body.n_shape, harmonics))
        move = sp.articulated(body, sp.ShapePath.fourier(np.zeros(body.n_shape), sines, cosines, 1.0))
        motion = sp.reconstruct(move, [0.0, 0.0, 0.0], tolerance=tolerance)
        solution = solution_of(motion)
        truth = stepped_rotation(FinishedSampler(solution.interpolant), solution.momentum, 1e-13)
        ends, times = solution.times, some_times(motion, 2000)
        at_ends = apart(solution.rotation(ends), truth.rotation(ends))
        return (apart(solution.rotation(times), truth.rotation(times)) - at_ends) / float(motion.error_estimate)

    motions = [(0.8, 3, 1e-4), (0.8, 2, 1e-7), (1.2, 1, 1e-5), (1.2, 3, 1e-4), (1.6, 2, 1e-7), (1.6, 3, 1e-7)]
    assert max(error(*motion) for motion in motions) < 0.01
    monkeypatch.setattr(_dense_output, "_MOST_HALVINGS", 0)
    assert max(error(*motion) for motion in motions) > 0.05


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_integrals_of_the_steps_are_those_of_the_curve(name: str, tolerance: float):
    """Dynamic phase and area, against quadratures over attitudes of a far more precise motion."""
    motion, truth = motion_of(name, tolerance), motion_of(name, 1e-13)
    solution = solution_of(motion)
    near = 10.0 * float(motion.error_estimate + truth.error_estimate)
    magnitude, axis = np.linalg.norm(truth.momentum), truth.momentum / np.linalg.norm(truth.momentum)
    edges = truth.solution.times
    nodes, weights = sphere.gauss_nodes(edges[:-1], edges[1:])
    for lift in (None, motion.lift_with_errors):

        def curve(times: np.ndarray, horizontal: bool = lift is not None) -> tuple[np.ndarray, np.ndarray]:
            direction = so3.apply(so3.transpose(truth.attitude(times)), axis)
            inverse, drift = truth.interpolant.inverse_and_drift(times)
            rate = so3.apply(inverse, magnitude * direction) - (0.0 if horizontal else 1.0) * drift
            frame = truth.horizontal_lift.rotation(times)[0] if horizontal else np.eye(3)
            return so3.apply(frame, direction), so3.apply(frame, rate)

        found = curve_integrals(solution, lift)
        direction, rate = curve(nodes.ravel())
        dynamic = np.sum(direction * rate, axis=-1) @ weights.ravel()
        area = sphere.curve_area(lambda t, at=curve: (at(t)[0], np.cross(*at(t))), edges)
        assert abs(found.dynamic.sum() - dynamic) < near
        whole = found.slivers.sum() + sphere.polygon_area(found.corners)[0]
        assert abs(sphere.wrapped(np.array(whole - area))) < near
        # The dynamic phase and the area of each step are rounded by a few units of the last place of a radian.
        rounding = 24.0 * np.finfo(float).eps * solution.dynamics.shape[1]
        of_split = momentum_curve(motion, "base" if lift is None else "horizontal")
        assert of_split.error[0] < 0.2 * motion.error_estimate + rounding


def test_integrals_do_not_depend_on_how_many_steps_are_taken_at_once(monkeypatch: pytest.MonkeyPatch):
    motion = motion_of("cat", 1e-9)
    whole = curve_integrals(solution_of(motion), motion.lift_with_errors)
    monkeypatch.setattr("shapephase.integrator.curve_integrals._MOST_STEPS", 5)
    parts = curve_integrals(solution_of(motion), motion.lift_with_errors)
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-15)
