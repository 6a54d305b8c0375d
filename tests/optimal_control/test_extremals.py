"""Normal extremals against equations, laws and limits that do not use the code's own derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import shapephase as sp
from shapephase import so3
from shapephase.errors import (
    AccuracyNotReached,
    ShapeError,
    SingularInertiaError,
    TrajectoryError,
    UndeclaredBreakWarning,
    UnknownNameError,
)
from shapephase.optimal_control import conjugate_times, extremal, jacobi_fields, shoot, wong_residual
from shapephase.optimal_control.extremals import hamiltonian as hamiltonian_module
from shapephase.optimal_control.extremals import wong_residual as wong_residual_module
from support.bodies import joint, link, random_loop, urdf
from support.long_runs import full_but

X = np.array([1.0, 0.0, 0.0])
START, RATE, CHARGE = np.array([0.3, 0.2, -0.1]), np.array([1.0, -0.7, 0.5]), np.array([0.03, -0.02, 0.01])
METRICS = ("kinetic", "rate")
# The charge of the second metric is of the size of a rate.
CHARGES = {"kinetic": CHARGE, "rate": 60.0 * CHARGE}


@pytest.fixture(scope="module")
def cat():
    return sp.load_body("cat_two_halves")


@pytest.fixture
def planar(load_urdf):
    """Three unequal links that move in one plane."""
    return load_urdf(
        urdf(
            link("middle", 1.0, [0.01, 0.05, 0.06], com=(0.0, 0.05, 0.0)),
            link("left", 0.7, [0.01, 0.03, 0.03], com=(-0.25, 0.0, 0.0)),
            link("right", 0.9, [0.01, 0.04, 0.05], com=(0.3, 0.02, 0.0)),
            joint("one", "revolute", "middle", "left", xyz=(-0.3, 0.0, 0.0)),
            joint("two", "revolute", "middle", "right", xyz=(0.3, 0.0, 0.0)),
        )
    )


@pytest.fixture
def rotor(load_urdf):
    parts = link("hull", 1.0, [0.3, 0.4, 0.5]), link("rotor", 0.5, [0.04, 0.04, 0.05])
    return load_urdf(urdf(*parts, joint("axle", "continuous", "hull", "rotor")))


@pytest.fixture
def sliding(load_urdf):
    """Joints of both units, one of them endless, without any symmetry."""
    return load_urdf(
        urdf(
            link("base", 2.0, [[0.05, 0.01, 0.0], [0.01, 0.06, -0.005], [0.0, -0.005, 0.04]], com=(0.1, -0.05, 0.02)),
            link("arm", 1.0, [0.02, 0.03, 0.035], com=(0.0, 0.1, 0.2)),
            link("wheel", 0.7, [0.02, 0.025, 0.02], com=(0.05, 0.0, 0.1)),
            link("mass", 0.5, [0.01, 0.01, 0.01]),
            joint("bend", "revolute", "base", "arm", axis=(1, 2, -2), xyz=(0.1, 0.2, 0.3)),
            joint("spin", "continuous", "arm", "wheel", axis=(0, 3, 4), xyz=(0.0, 0.1, 0.4)),
            joint("push", "prismatic", "base", "mass", axis=(2, -1, 2), xyz=(-0.4, 0.1, 0.2)),
        )
    )


def metric_of(body, shape, kind="kinetic"):
    """g by polarising Pinocchio's kinetic energy at zero momentum."""
    n = body.n_shape
    if kind == "rate":
        return np.eye(n)
    rates = np.concatenate([np.eye(n), (np.eye(n)[:, None] + np.eye(n)[None]).reshape(-1, n)])
    turning = -rates @ sp.mechanical_connection(body, shape).T
    energies = 2.0 * body.kinetic_energy(shape, rates, turning)
    single, pair = energies[:n], energies[n:].reshape(n, n)
    return 0.5 * (pair - single[:, None] - single[None])


def slopes(function, place, step=1e-3):
    """Central differences of fourth order: gradient along the first axis."""
    return np.array(
        [
            (function(place - 2 * d) - 8.0 * function(place - d) + 8.0 * function(place + d) - function(place + 2 * d))
            for d in step * np.eye(len(place))
        ]
    ) / (12.0 * step)


def small_circle(body, angle, axis=X, duration=1.0):
    """From the neutral shape, round the circle (in the kinetic metric there) that to lowest order turns by the angle.

    Also the largest curvature about the axis, in that metric.
    """
    shape = np.zeros(body.n_shape)
    root = np.linalg.inv(np.linalg.cholesky(metric_of(body, shape)))
    form = root @ (sp.curvature(body, shape) @ axis) @ root.T
    sigma = np.linalg.norm(form, 2)
    across = np.linalg.svd(form)[2][0]
    # A square from the first direction to the second turns by -F: the second is such that F is negative.
    one, two = root.T @ across, root.T @ (form @ across) / sigma
    size = np.sqrt(angle / (np.pi * sigma))
    cosines, sines = size * one, size * two
    path = sp.ShapePath.fourier(-cosines, cosines[:, None], sines[:, None], duration)
    if so3.log(sp.holonomy(body, path)) @ axis < 0.0:
        path = sp.ShapePath.fourier(-cosines, cosines[:, None], -sines[:, None], duration)
    return path, sigma


# ---- The equations --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", METRICS)
@pytest.mark.parametrize("which", ["cat", "planar", "sliding"])
def test_wongs_equations(which, kind, request, rng):
    """d/dt (g r')_i = 1/2 r' dg/dr_i r' + l F_ik r'_k with F of `curvature`, all else by differences."""
    body = request.getfixturevalue(which)
    n = body.n_shape
    motion = extremal(body, 0.3 * np.ones(n), rng.normal(size=n), CHARGES[kind], 1.0, metric=kind)
    for time in (0.2, 0.5, 0.8):
        step = 2e-3
        momenta = [metric_of(body, motion.shape(t), kind) @ motion.rate(t) for t in time + step * np.arange(-2, 3)]
        left = (momenta[0] - 8.0 * momenta[1] + 8.0 * momenta[3] - momenta[4]) / (12.0 * step)
        shape, rate = motion.shape(time), motion.rate(time)
        gradient = slopes(lambda r: metric_of(body, r, kind), shape)
        moment = motion.attitude(time).T @ motion.charge
        force = sp.curvature(body, shape) @ moment
        right = 0.5 * np.einsum("iab,a,b->i", gradient, rate, rate) + force @ rate
        assert np.abs(left - right).max() < 1e-7 * np.abs(right).max()
        assert np.abs(force @ rate).max() > 1e-3 * np.abs(right).max()


def test_energy_is_kept_and_the_cost_is_its_integral(cat):
    motion = extremal(cat, START, RATE, CHARGE, 2.0)
    assert motion.energy_drift < 1e-9
    times = np.linspace(0.0, 2.0, 9)
    turning = -so3.apply(sp.mechanical_connection(cat, motion.shape(times)), motion.rate(times))
    energies = cat.kinetic_energy(motion.shape(times), motion.rate(times), turning)
    np.testing.assert_allclose(energies, motion.energy, rtol=1e-9)
    assert motion.cost == pytest.approx(2.0 * 0.5 * RATE @ metric_of(cat, START) @ RATE, rel=1e-12)


@pytest.mark.parametrize("which", ["cat", "planar", "sliding"])
def test_the_attitude_is_the_lift_of_the_path(which, request):
    body = request.getfixturevalue(which)
    motion = extremal(body, 0.2 * np.ones(body.n_shape), RATE[: body.n_shape], CHARGE, 1.5)
    lift = sp.horizontal_lift(body, motion.path, 1e-11)
    times = np.array([0.4, 1.1, 1.5])
    assert np.abs(lift.attitude(times) - motion.attitude(times)).max() < 1e-9
    assert motion.path.joint_names == body.joint_names


def test_rates_are_the_slopes_of_shapes(cat):
    motion, times, step = extremal(cat, START, RATE, CHARGE, 2.0), np.linspace(0.1, 1.9, 7), 2e-3
    around = [motion.shape(times + k * step) for k in (-2, -1, 1, 2)]
    slope = (around[0] - 8.0 * around[1] + 8.0 * around[2] - around[3]) / (12.0 * step)
    assert np.abs(slope - motion.rate(times)).max() < 1e-7
    assert motion.shape(np.zeros((2, 0))).shape == (2, 0, 3)


def test_twice_as_fast_with_twice_the_charge_is_the_same_way(cat):
    slow, fast = extremal(cat, START, RATE, CHARGE, 1.0), extremal(cat, START, 2.0 * RATE, 2.0 * CHARGE, 0.5)
    times = np.linspace(0.0, 1.0, 5)
    assert np.abs(slow.shape(times) - fast.shape(0.5 * times)).max() < 1e-9
    assert fast.cost == pytest.approx(2.0 * slow.cost, rel=1e-12)


def test_a_free_shape_moves_on_a_geodesic_back_and_forth(cat):
    """Without charge the way back is the way there."""
    there = extremal(cat, START, RATE, np.zeros(3), 0.8)
    back = extremal(cat, there.shape(0.8), -there.rate(0.8), np.zeros(3), 0.8)
    assert np.abs(back.shape(0.8) - START).max() < 1e-9
    charged = extremal(cat, START, RATE, CHARGE, 0.8)
    wrong = extremal(cat, charged.shape(0.8), -charged.rate(0.8), charged.charge, 0.8)
    assert np.abs(wrong.shape(0.8) - START).max() > 1e-2


def test_one_rotor_turns_evenly_whatever_the_charge(rotor):
    """One joint has no curvature; a balanced rotor c of a body of inertia b: base and rotor turn as c to b + c."""
    motion = extremal(rotor, [0.0], [3.0], [0.1, -0.2, 0.4], 2.0)
    assert motion.shape(2.0) == pytest.approx(6.0, rel=1e-12)
    np.testing.assert_allclose(motion.attitude(2.0), so3.exp(np.array([0.0, 0.0, -6.0 * 0.05 / 0.55])), atol=1e-11)
    assert motion.cost == pytest.approx(2.0 * 0.5 * 9.0 * 0.05 * 0.5 / 0.55, rel=1e-12)
    assert conjugate_times(motion) == []


# ---- Planar bodies: magnetic geodesics ------------------------------------------------------------------------------


def test_a_charge_across_the_plane_is_not_felt(planar):
    bare = extremal(planar, [0.6, -0.4], [1.0, 1.3], [0.0, 0.0, 0.2], 1.0)
    charged = extremal(planar, [0.6, -0.4], [1.0, 1.3], [0.5, -0.7, 0.2], 1.0)
    assert np.abs(bare.shape(1.0) - charged.shape(1.0)).max() < 1e-10
    fit = wong_residual(planar, charged.path)
    assert fit.residual < 1e-6
    np.testing.assert_allclose(fit.charge, [0.0, 0.0, 0.2], atol=1e-8)


def test_planar_conjugate_times_are_those_of_the_heisenberg_group(planar):
    """Small loops: whole turns of the charge, and where the tangent of half the angle is that half; no others."""
    shape = np.array([0.6, -0.4])
    metric = metric_of(planar, shape)
    density = sp.curvature(planar, shape)[0, 1, 2] / np.sqrt(np.linalg.det(metric))
    second = brentq(lambda x: np.tan(x) - x, 4.0, 4.6) / np.pi
    times = []
    for size in (1e-4, 5e-5):
        rate = size * np.linalg.solve(np.linalg.cholesky(metric).T, [1.0, 0.5])
        found = conjugate_times(extremal(planar, shape, rate, [0.0, 0.0, 2.0 * np.pi / density], 1.0), 2.2)
        assert [one.multiplicity for one in found] == [1, 1, 1]
        times.append(np.array([one.time for one in found]))
    # What a loop of finite size is off falls with its size: extrapolated to none.
    np.testing.assert_allclose(2.0 * times[1] - times[0], [1.0, second, 2.0], rtol=0, atol=1e-6)


# ---- Small rotations: the isoperimetric circle ----------------------------------------------------------------------


@pytest.mark.parametrize("degrees", full_but([1.0, 0.1, 0.01], 0.1))
def test_small_rotations_cost_what_the_isoperimetric_circle_costs(cat, degrees):
    """E T sigma_max / (2 pi theta) -> 1, linearly in theta; the circle is closed at T, and its symmetry opens there."""
    angle = np.radians(degrees)
    path, sigma = small_circle(cat, angle)
    assert sigma == pytest.approx(350.0, rel=1e-9)
    motion = shoot(cat, path, so3.exp(angle * X), tolerance=1e-11)
    ratio = motion.cost * sigma / (2.0 * np.pi * angle)
    assert 0.0 < ratio - 1.0 < 0.004 * degrees
    assert np.linalg.norm(motion.charge) * sigma == pytest.approx(2.0 * np.pi, rel=0.01 * degrees)
    assert np.abs(sp.holonomy(cat, motion.path, 1e-11) - so3.exp(angle * X)).max() < 1e-10
    found = conjugate_times(motion)
    assert [one.multiplicity for one in found] == [1]
    assert found[0].time == pytest.approx(1.0, abs=1e-9)


@pytest.mark.full
def test_the_flip_is_conjugate_at_its_end_and_not_before(cat):
    """Half a turn, reached in steps; its optima come in circles about the long axis."""
    path, _ = small_circle(cat, np.radians(5.0))
    for degrees in (5.0, 15.0, 30.0, 60.0, 90.0, 120.0, 150.0, 180.0):
        motion = shoot(cat, path, so3.exp(np.radians(degrees) * X))
        path = motion.path
    found = conjugate_times(motion)
    assert [one.multiplicity for one in found] == [1]
    assert found[0].time == pytest.approx(1.0, abs=1e-8)
    assert wong_residual(cat, path).residual < 1e-6
    assert so3.angle(sp.holonomy(cat, path) @ so3.exp(-np.pi * X)) < 1e-8


# ---- Optimality of paths --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", METRICS)
@pytest.mark.parametrize("which", ["cat", "sliding"])
def test_an_extremals_path_is_recognised_with_its_charge(which, kind, request):
    body = request.getfixturevalue(which)
    motion = extremal(body, START, RATE, CHARGES[kind], 1.0, metric=kind)
    fit = wong_residual(body, motion.path, metric=kind)
    assert fit.residual < 1e-8
    np.testing.assert_allclose(fit.charge, CHARGES[kind], rtol=0, atol=1e-7 * np.abs(CHARGES[kind]).max())
    np.testing.assert_allclose(fit.rate, RATE, rtol=0, atol=1e-7)


def test_loops_that_are_no_extremals_are_recognised(cat, rng):
    path, _ = small_circle(cat, np.radians(0.1))
    assert wong_residual(cat, path).residual < 0.01
    # An ellipse of the same area, and any loop; and the first metric's extremal in the second.
    ellipse = sp.ShapePath.fourier(path.shape(0.25), np.diag([0.0, 0.0, 0.02]), np.diag([0.0, 0.04, 0.0]), 1.0)
    assert wong_residual(cat, ellipse).residual > 0.1
    assert wong_residual(cat, random_loop(cat, rng)).residual > 0.1
    motion = extremal(cat, START, RATE, CHARGE, 1.0)
    assert wong_residual(cat, motion.path, metric="rate").residual > 0.05


@pytest.mark.parametrize("kind", METRICS)
def test_the_residual_of_an_uneven_rotor_is_the_spread_of_its_rate(rotor, kind):
    """r' = 1 + cos(2 pi t)/2 where 1 would do: a root mean square of 1/sqrt 8 against one of sqrt(9/8)."""

    def uneven(times):
        angle = 2.0 * np.pi * times[:, None]
        return times[:, None] + 0.5 * np.sin(angle) / (2.0 * np.pi), 1.0 + 0.5 * np.cos(angle)

    fit = wong_residual(rotor, sp.ShapePath.function(uneven, 3.0, breaks=(0.8,)), metric=kind)
    assert fit.residual == pytest.approx(1.0 / 3.0, rel=1e-9)
    assert fit.rate == pytest.approx(1.0, rel=1e-9)
    assert np.array_equal(fit.charge, np.zeros(3))


def test_the_residual_falls_with_the_error_of_a_spline(cat):
    """A cubic through samples of an extremal: its rate is off by the cube of the spacing."""
    motion = extremal(cat, START, RATE, CHARGE, 1.0)
    fits = []
    for count in (21, 41):
        times = np.linspace(0.0, 1.0, count)
        fits.append(wong_residual(cat, sp.ShapePath.spline(times, motion.shape(times), periodic=False)))
    assert fits[0].residual < 2e-3
    assert 7.0 < fits[0].residual / fits[1].residual < 12.0
    assert np.abs(fits[1].charge - CHARGE).max() < 2e-3 * np.abs(CHARGE).max()
    assert np.abs(fits[1].rate - RATE).max() < 2e-3


def test_a_path_at_rest_is_an_extremal(planar):
    still = sp.ShapePath.spline([0.0, 1.0, 2.0], np.zeros((3, 2)), periodic=False)
    assert wong_residual(planar, still).residual == 0.0


@pytest.mark.parametrize("kind", full_but(METRICS, "rate"))
def test_shooting_from_a_path_that_is_nearly_optimal(sliding, kind):
    """A spline through disturbed samples of an extremal; the answer has its ends and its rotation exactly."""
    motion = extremal(sliding, START, RATE, 3.0 * CHARGES[kind], 2.0, metric=kind)
    times = np.linspace(0.0, 2.0, 41)
    bump = 1e-3 * np.sin(np.pi * times / 2.0)[:, None] ** 2 * np.sin(2.0 * times[:, None] * [1.0, 2.0, 1.5])
    near = sp.ShapePath.spline(times, motion.shape(times) + bump, periodic=False)
    answer = shoot(sliding, near, metric=kind)
    assert np.abs(answer.shape(2.0) - near.shape(2.0)).max() < 1e-9
    assert np.abs(answer.attitude(2.0) - sp.horizontal_lift(sliding, near).end).max() < 1e-8
    assert wong_residual(sliding, answer.path, metric=kind).residual < 1e-6
    exact = shoot(sliding, near, motion.attitude(2.0), metric=kind)
    np.testing.assert_allclose(exact.charge, motion.charge, rtol=0, atol=1e-5 * np.abs(motion.charge).max())
    assert exact.cost == pytest.approx(motion.cost, rel=1e-7)


# ---- Jacobi fields --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", METRICS)
def test_jacobi_fields_are_differences_of_extremals(sliding, kind):
    charge, span, step = CHARGES[kind], 0.8, 1e-3
    fields = jacobi_fields(sliding, kind, START, RATE, charge, span, 1e-12)
    shape, attitude, matrix = fields.end()
    central = extremal(sliding, START, RATE, charge, span, metric=kind, tolerance=1e-13)
    assert np.abs(shape - central.shape(span)).max() < 1e-10
    assert np.abs(attitude - central.attitude(span)).max() < 1e-10
    metric = metric_of(sliding, START, kind)

    def end(change):
        rate = RATE + np.linalg.solve(metric, change[:3] * fields.momentum_scales)
        moved = extremal(
            sliding, START, rate, charge + change[3:] * fields.charge_scale, span, metric=kind, tolerance=1e-13
        )
        return np.concatenate([moved.shape(span), so3.log(moved.attitude(span) @ central.attitude(span).T)])

    truth = slopes(end, np.zeros(6), step).T
    assert np.abs(matrix - truth).max() < 1e-7 * np.abs(truth).max()


def test_the_way_itself_is_a_jacobi_field(sliding):
    """Faster with more charge is further along the same way: t times the velocity, the turning included."""
    fields = jacobi_fields(sliding, "kinetic", START, RATE, CHARGE, 1.0, 1e-12)
    scaling = np.concatenate([metric_of(sliding, START) @ RATE / fields.momentum_scales, CHARGE / fields.charge_scale])
    motion = extremal(sliding, START, RATE, CHARGE, 1.0)
    times = np.array([0.3, 1.0])
    turning = -so3.apply(sp.mechanical_connection(sliding, motion.shape(times)), motion.rate(times))
    truth = times[:, None] * np.concatenate([motion.rate(times), so3.apply(motion.attitude(times), turning)], axis=1)
    assert np.abs(fields.matrix(times) @ scaling - truth).max() < 1e-9


# ---- What is refused ------------------------------------------------------------------------------------------------


def test_wrong_arguments_are_named(cat):
    for change in (
        {"shape": [0.0, 0.0]},
        {"rate": np.zeros((2, 3))},
        {"charge": [1.0]},
        {"charge": [np.nan, 0.0, 0.0]},
    ):
        arguments = {"shape": START, "rate": RATE, "charge": CHARGE} | change
        with pytest.raises(ShapeError, match=next(iter(change))):
            extremal(cat, **arguments, duration=1.0)
    with pytest.raises(TrajectoryError):
        extremal(cat, START, RATE, CHARGE, 0.0)
    with pytest.raises(UnknownNameError, match="kinetic"):
        extremal(cat, START, RATE, CHARGE, 1.0, metric="energy")
    with pytest.raises(UnknownNameError, match="kinetic"):
        wong_residual(cat, small_circle(cat, 0.01)[0], metric="energy")
    with pytest.raises(ShapeError, match="target"):
        shoot(cat, small_circle(cat, 0.01)[0], np.eye(3)[None])


def test_a_motion_without_energy_is_refused(load_urdf, cat):
    parts = link("hull", 1.0, [0.3, 0.4, 0.5]), '<link name="ghost"/>', joint("haunt", "continuous", "hull", "ghost")
    with pytest.warns(match="ghost"):
        empty = load_urdf(urdf(*parts))
    with pytest.raises(SingularInertiaError, match="haunt"):
        extremal(empty, [0.0], [1.0], CHARGE, 1.0)
    # Pitch and roll of the waist fall together at a yaw of a right angle.
    with pytest.raises(SingularInertiaError, match="waist"):
        extremal(cat, [0.0, 0.5 * np.pi, 0.0], RATE, CHARGE, 1.0)

    def into_it(times):
        return np.minimum(times, 1.0)[:, None] * [0.0, 0.5 * np.pi, 0.0], (times < 1.0)[:, None] * [
            0.0,
            0.5 * np.pi,
            0.0,
        ]

    with pytest.raises(SingularInertiaError, match="waist"):
        wong_residual(cat, sp.ShapePath.function(into_it, 2.0, breaks=(1.0,)))


def test_an_extremal_that_cannot_be_integrated_is_refused(cat, monkeypatch):
    monkeypatch.setattr(hamiltonian_module, "_MOST", 2000)
    with pytest.raises(AccuracyNotReached, match="charge"):
        extremal(cat, START, RATE, 1e6 * CHARGE, 1.0)


def test_a_solution_that_grows_without_end_is_refused():
    with pytest.raises(AccuracyNotReached, match="breaks"):
        hamiltonian_module.integrated(lambda y: y**2, 2.0, np.ones(1), 1e-9, np.ones(1))


def test_an_extremal_at_rest_has_no_conjugate_times(cat):
    motion = extremal(cat, START, np.zeros(3), CHARGE, 1.0)
    assert np.array_equal(motion.shape(1.0), START)
    with pytest.raises(ShapeError, match="rest"):
        conjugate_times(motion)


def test_a_path_whose_rate_jumps_is_no_extremal(cat):
    """Declared or not, the jump is most of what is missing."""

    def corner(times):
        return np.abs(times - 0.37)[:, None] * RATE, np.where(times < 0.37, -1.0, 1.0)[:, None] * RATE

    declared = wong_residual(cat, sp.ShapePath.function(corner, 1.0, breaks=(0.37,))).residual
    assert declared > 0.5
    with pytest.warns(UndeclaredBreakWarning, match=r"t = 0\.37 s"):
        found = wong_residual(cat, sp.ShapePath.function(corner, 1.0)).residual
    assert found == pytest.approx(declared, rel=1e-2)


def test_a_path_too_rough_for_its_samples_is_refused(cat, rng, monkeypatch):
    monkeypatch.setattr(wong_residual_module, "_PANELS", (1, 2))
    with pytest.raises(AccuracyNotReached, match="breaks"):
        wong_residual(cat, random_loop(cat, rng, harmonics=6))


def test_a_target_out_of_reach_is_refused(planar):
    loop = sp.ShapePath.fourier([0.6, -0.4], [[0.1], [0.0]], [[0.0], [0.1]], 1.0)
    with pytest.raises(AccuracyNotReached, match="found"):
        shoot(planar, loop, so3.exp(0.5 * X))
