"""Steps: a formula of order eight, attitudes within steps, derivatives, growth; machine code gives the same bits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import DOP853
from scipy.linalg import expm

import shapephase as sp
from shapephase import so3
from shapephase.integrator import SteppedRotation, machine_code, stepped_rotation
from shapephase.integrator.curve_integrals import curve_integrals
from shapephase.integrator.kernels import step_kernel
from shapephase.integrator.lift import lift_along
from shapephase.integrator.stepping import attempted, momentum_slope, small_turns, stepped_quaternions
from support.independent import apart, axisymmetric_attitude, hat
from support.series_motion import constant_interpolant, random_interpolant, sampler_of_series, series_motion

EPS = np.finfo(float).eps
TOP = 0.8, 0.3  # moments across and along the axis
STEPS = np.array([6, 2, 4])


def momenta(rng: np.random.Generator, count: int) -> np.ndarray:
    """Up to six times the identity's, one of them zero."""
    found = rng.uniform(-3.5, 3.5, (count, 3))
    found[count // 2] = 0.0
    return found


def stepped(interpolant, momentum: np.ndarray, tolerance: float = 1e-9) -> SteppedRotation:
    return stepped_rotation(sampler_of_series(interpolant), momentum, tolerance)


def angles(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Between quaternions near each other."""
    return np.linalg.norm(small_turns(first, second), axis=-1)


# ---- The formula ----------------------------------------------------------------------------------------------------


def test_the_tableau_is_that_of_dop853():
    """As the kernel adds it up, entry by entry; its last row is the end of the step."""
    rows = np.zeros((step_kernel.STAGES + 1, step_kernel.STAGES))
    for column in range(step_kernel.STAGES):
        slopes = np.zeros((step_kernel.STAGES, 4))
        slopes[column] = 1.0
        for row in range(len(rows)):
            (rows[row, column],) = set(step_kernel.combined(slopes, row, 0.0, 0.0, 0.0, 0.0))
    assert np.array_equal(rows[:-1], DOP853.A[:12, :12])
    assert np.array_equal(rows[-1], DOP853.B)
    assert np.array_equal(step_kernel.WEIGHTS, DOP853.B)
    assert np.array_equal(step_kernel.NODES, DOP853.C[:12])


def test_steps_of_a_symmetric_top_converge_with_order_eight():
    """It precesses and spins in closed form; half as long steps have a 256th of the error."""
    momentum, errors = np.array([[1.1, 0.3, 1.4]]), []
    top = constant_interpolant([TOP[0], TOP[0], TOP[1]], 2.0)
    truth = axisymmetric_attitude(*TOP, momentum[0], np.eye(3), np.array([2.0]))[0]
    for steps in (4, 8, 16):
        end = stepped_quaternions(top, top.coefficients, np.array([steps]), momentum)[0, -1]
        errors.append(apart(so3.matrix_from_quat(end), truth))
    assert errors[-1] > 1e-12
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([8.0, 8.0], abs=0.35)


def test_without_momentum_a_drift_about_one_axis_turns_by_its_integral():
    """A turn that swings: cos 3 t is integrated to sin 3 t / 3, and with order eight."""
    times = np.cos(np.pi * np.arange(25) / 24)
    series = np.zeros((1, 25, 9))
    series[0, :, 0:3] = np.eye(25)[0][:, None]
    series[0, :, 8] = np.polynomial.chebyshev.chebfit(times, -2.0 * np.cos(3.0 * (1.0 + times)), 24)
    drift = constant_interpolant([1.0, 1.0, 1.0], 2.0)
    errors = []
    for steps in (3, 6, 12):
        quaternions = stepped_quaternions(drift, series, np.array([steps]), np.zeros((1, 3)))[0]
        ends = 2.0 * np.arange(steps + 1) / steps
        errors.append(np.abs(2.0 * np.arcsin(quaternions[:, 2]) - 2.0 * np.sin(3.0 * ends) / 3.0).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx([8.0, 8.0], abs=0.7)


@pytest.mark.parametrize("loops", [1, 3])
def test_all_marches_of_an_attempt_are_marches(loops: int, rng: np.random.Generator):
    """The distances between m, 2 m and 4 m steps and those on changed series are those between attitudes marched."""
    body, given = random_interpolant(rng, loops=loops), momenta(rng, 4)
    changed = body.coefficients * (1.0 + 1e-4 * rng.normal(size=body.coefficients.shape))
    found = attempted(body, changed, STEPS, given, None)
    coarse, fine, finest = (stepped_quaternions(body, body.coefficients, k * STEPS, given) for k in (1, 2, 4))
    other = stepped_quaternions(body, changed, STEPS, given)
    assert np.array_equal(found.quaternions, finest)
    assert np.array_equal(found.steps, 4 * STEPS)
    # Chords of quaternions here, of vectors there.
    near = {"rtol": 1e-5, "atol": 4.0 * EPS}
    np.testing.assert_allclose(found.coarse, angles(coarse, fine[:, ::2]).max(axis=1), **near)
    np.testing.assert_allclose(found.fine, angles(fine, finest[:, ::2]).max(axis=1), **near)
    np.testing.assert_allclose(found.sampling, angles(coarse, other).max(axis=1), **near)
    np.testing.assert_allclose(found.turned, angles(finest[:, 1:], finest[:, :-1]).sum(axis=1), rtol=1e-2)


# ---- Between the ends of steps --------------------------------------------------------------------------------------


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_between_steps_a_top_is_within_its_estimate(tolerance: float, rng: np.random.Generator):
    top = constant_interpolant([TOP[0], TOP[0], TOP[1]], 3.0)
    momentum = np.array([1.1, 0.3, 1.4])
    motion, times = stepped(top, momentum[None], tolerance), np.sort(rng.uniform(0.0, 3.0, 200))
    error = apart(motion.rotation(times)[0], axisymmetric_attitude(*TOP, momentum, np.eye(3), times))
    assert error <= motion.error_estimate[0] <= tolerance
    # Energy is constant.
    energy = (momentum[:2] @ momentum[:2]) / TOP[0] + momentum[2] ** 2 / TOP[1]
    gap = np.abs(motion.dynamic_phase(times)[0] - energy * times / np.linalg.norm(momentum)).max()
    assert gap <= motion.error_estimate[0] + 20.0 * EPS


@pytest.mark.parametrize("tolerance", 10.0 ** np.arange(-4.0, -12.0, -1.0))
def test_few_long_steps_at_rest_are_within_their_estimate_and_not_refused(tolerance: float):
    """One step on each interval of a spline: more steps are no better at first, and yet the tolerance is reached."""
    times = np.array([0.0, 0.3, 0.9, 1.1, 2.0])
    path = sp.ShapePath.spline(times, np.random.default_rng(6).uniform(-0.5, 0.5, (5, 3)))
    still = sp.articulated(sp.load_body("cat_two_halves"), path)
    motion, truth = (sp.reconstruct(still, np.zeros(3), tolerance=each) for each in (tolerance, 1e-12))
    times = np.linspace(0.0, 2.0, 60)
    assert apart(motion.attitude(times), truth.attitude(times)) <= motion.error_estimate + truth.error_estimate


@pytest.mark.parametrize("size", [0.0, 4.0])
@pytest.mark.parametrize("tolerance", [1e-5, 1e-8, 1e-11])
def test_between_steps_a_body_that_changes_is_where_scipy_has_it(tolerance: float, size: float):
    rng = np.random.default_rng(int(-np.log10(tolerance)))
    body, momentum = random_interpolant(rng), size * np.array([0.36, -0.48, 0.8])
    motion, times = stepped(body, momentum[None], tolerance), np.sort(rng.uniform(0.0, 1.4, 100))
    truth = series_motion(body, momentum, times)
    error = apart(motion.rotation(times)[0], so3.matrix_from_quat(truth.quaternions))
    assert error <= motion.error_estimate[0] + 1e-13
    assert motion.error_estimate[0] <= tolerance
    assert np.abs(motion.dynamic_phase(times)[0] - truth.dynamic).max() <= 10.0 * motion.error_estimate[0] + 1e-12


def test_the_ends_of_steps_are_what_was_stepped(rng: np.random.Generator):
    motion = stepped(random_interpolant(rng, loops=2), momenta(rng, 3))
    ends = so3.matrix_from_quat(motion.quaternions)
    assert np.array_equal(motion.rotation(motion.times), ends)
    mixed = np.append(motion.times, 0.37)
    assert np.array_equal(motion.rotation(mixed)[:, :-1], ends)
    assert np.array_equal(motion.end, ends[:, -1])
    phases = motion.dynamic_phase(motion.times)
    np.testing.assert_allclose(phases[:, 1:], np.cumsum(motion.dynamics, axis=1), rtol=0, atol=1e-14)


# ---- Derivatives ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("loops", [1, 2])
def test_the_slope_by_the_momentum_is_that_of_central_differences(loops: int, rng: np.random.Generator):
    """Of the steps themselves, however long, also of a body at rest; differences are extrapolated twice."""
    body, given = random_interpolant(rng, loops=loops), momenta(rng, 4)
    found = momentum_slope(body, STEPS, given)

    def difference(width: float) -> np.ndarray:
        moved = given[:, None, None] + width * np.array([1.0, -1.0])[:, None] * np.eye(3)[:, None]
        ends = stepped_quaternions(body, body.coefficients, STEPS, moved.reshape(-1, 3))[:, -1].reshape(4, 3, 2, 4)
        here = stepped_quaternions(body, body.coefficients, STEPS, given)[:, None, -1]
        turns = [so3.rotation_vector_from_quat(_less(here, ends[:, :, side])) for side in (0, 1)]
        return np.swapaxes(turns[0] - turns[1], -1, -2) / (2.0 * width)

    coarse, middle, fine = (difference(width) for width in (8e-3, 4e-3, 2e-3))
    first, second = (4.0 * middle - coarse) / 3.0, (4.0 * fine - middle) / 3.0
    np.testing.assert_allclose(found, (16.0 * second - first) / 15.0, rtol=0, atol=1e-10)
    assert np.abs(found).max() > 1.0


def _less(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """The quaternion start^-1 end."""
    u, p, v, q = start[..., :3], start[..., 3:], end[..., :3], end[..., 3:]
    return np.concatenate([p * v - q * u - np.cross(u, v), p * q + (u * v).sum(axis=-1, keepdims=True)], axis=-1)


# ---- Growth of errors -----------------------------------------------------------------------------------------------


def largest_of(propagators: np.ndarray) -> float:
    """Singular value of P_j P_i^-1, j after i: (M, 3, 3)."""
    each = [
        np.linalg.svd(later @ np.linalg.inv(earlier), compute_uv=False)[0]
        for j, later in enumerate(propagators)
        for earlier in propagators[: j + 1]
    ]
    return max(each)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_growth_about_a_principal_axis_is_that_of_the_linearised_equation(axis: int):
    """d' = -omega x d + I^-1 (Pi x d) has constant coefficients; about the middle axis errors grow a thousandfold."""
    moments, momentum = np.array([1.0, 2.0, 3.5]), 3.0 * np.eye(3)[axis]
    body = constant_interpolant(moments, 8.0)
    motion = stepped(body, momentum[None], 1e-8)
    slope = -hat(momentum / moments) + np.diag(1.0 / moments) @ hat(momentum)
    exact = [np.linalg.svd(expm(slope * lag), compute_uv=False)[0] for lag in np.linspace(0.0, 8.0, 401)]
    if axis == 1:
        assert motion.amplification[0] == pytest.approx(exact[-1], rel=1e-4)
        assert exact[-1] > 1e3
    else:
        assert 0.9 * max(exact) < motion.amplification[0] < max(exact) * (1.0 + 1e-3)


@pytest.mark.parametrize("seed", range(4))
def test_growth_is_that_of_motions_that_start_turned(seed: int):
    """Whole marches from turned attitudes, by central differences, at the ends of steps that are marks."""
    rng = np.random.default_rng(seed)
    body, steps = random_interpolant(rng, loops=4), np.array([16, 16, 16])
    given = momenta(rng, 3)[:1]
    found = attempted(body, body.coefficients, steps, given, None)

    def turned(by: np.ndarray) -> np.ndarray:
        start = np.append(0.5 * by, 1.0)[None]
        ends = stepped_quaternions(body, body.coefficients, steps, given, start / np.linalg.norm(start))[0, ::12]
        assert len(ends) == 17
        return small_turns(stepped_quaternions(body, body.coefficients, steps, given)[0, ::12], ends)

    columns = [(turned(1e-5 * axis) - turned(-1e-5 * axis)) / 2e-5 for axis in np.eye(3)]
    largest = largest_of(np.stack(columns, axis=-1))
    # Found as if the middle singular value were one; the product of all three is.
    assert 0.96 * largest < found.amplification[0] < 1.5 * largest


# ---- Machine code ---------------------------------------------------------------------------------------------------


def test_interpreted_and_compiled_a_motion_has_the_same_bits(monkeypatch: pytest.MonkeyPatch):
    """Its samples, steps, estimates and derivatives, attitudes within steps, and the integrals of its curve."""

    def run() -> list[np.ndarray]:
        rng = np.random.default_rng(3)
        motion, times = stepped(random_interpolant(rng, terms=6), momenta(rng, 3), 1e-5), rng.uniform(0.0, 1.4, 20)
        lift = lift_along(motion)
        return [
            *(getattr(motion, name) for name in ("quaternions", "directions", "turns", "dynamics", "amplification")),
            *(motion.sampling_error, motion.stepping_error, motion.rounding_error, motion.perturbed.coefficients),
            *(motion.interpolant.coefficients, motion.momentum_slope, motion.rotation(times)),
            *(motion.dynamic_phase(times), motion.solid_angle(times), lift.quaternions, lift.turns),
            *curve_integrals(motion),
            *curve_integrals(motion, lift),
        ]

    assert machine_code.is_used()
    compiled = run()
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert not machine_code.is_used()
    for one, other in zip(compiled, run(), strict=True):
        assert np.array_equal(one, other)
