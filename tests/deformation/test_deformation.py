"""Deformations from joints, point masses and functions against one another and against sums over the masses."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import (
    ShapeError,
    ShapePhaseError,
    SingularInertiaError,
    TrajectoryError,
    UnknownNameError,
    UnphysicalInertiaError,
)
from support.bodies import joint, link, random_loop, urdf
from support.long_runs import full_but


def hat(v):
    return np.cross(np.eye(3), v)


def inertia_of(masses, points):
    return sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))


def slope(function, t, step):
    """Nine-point central difference."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return sum(w * (function(t + k * step) - function(t - k * step)) for k, w in weights.items()) / step


def constant(value):
    return lambda t: np.broadcast_to(np.asarray(value, dtype=float), (len(t), *np.shape(value)))


# ---- Joints ---------------------------------------------------------------------------------------------------------


def test_an_articulated_deformation_is_its_body_along_the_path(body, rng):
    path = random_loop(body, rng)
    deformation = sp.articulated(body, path)
    t = rng.uniform(0, path.duration, (2, 3))
    shapes, rates = path.shape(t), path.rate(t)
    size = np.abs(body.locked_inertia(shapes)).max()
    np.testing.assert_allclose(deformation.inertia(t), body.locked_inertia(shapes), atol=1e-14 * size, rtol=0)
    momentum = body.internal_momentum(shapes, rates)
    np.testing.assert_allclose(deformation.internal_momentum(t), momentum, atol=1e-13 * np.abs(momentum).max(), rtol=0)
    np.testing.assert_allclose(deformation.centre_of_mass(t), body.centre_of_mass(shapes), atol=1e-14, rtol=0)
    np.testing.assert_array_equal(deformation.frame(t), np.broadcast_to(np.eye(3), (2, 3, 3, 3)))
    assert deformation.duration == path.duration
    np.testing.assert_array_equal(deformation.breaks, path.breaks)
    np.testing.assert_array_equal(deformation.closure, np.eye(3))
    assert deformation.shape_gap < 1e-12
    assert deformation.inertia(0.3).shape == (3, 3)
    assert deformation.inertia([]).shape == (0, 3, 3)


def test_the_inertia_rate_is_the_derivative_of_the_inertia(body, rng):
    """U4: against nine-point differences in time."""
    path = random_loop(body, rng, duration=3.0)
    deformation = sp.articulated(body, path)
    t = rng.uniform(0.2, 2.8, 4)
    want = slope(deformation.inertia, t, 5e-3)
    np.testing.assert_allclose(
        deformation.inertia_rate(t), want, atol=1e-10 * np.abs(deformation.inertia(t)).max(), rtol=0
    )


def test_a_path_that_does_not_return_is_no_loop():
    diver = sp.load_body("diver")
    path = sp.ShapePath.waypoints([0, 1, 2], [[0.0, 0.1], [1.0, 0.3], [0.5, 0.0]])
    deformation = sp.articulated(diver, path)
    assert deformation.closure is None
    assert deformation.shape_gap == pytest.approx(0.5)
    np.testing.assert_array_equal(deformation.breaks, [0, 1, 2])
    for gap, closes in ((0.8e-9, True), (1.5e-9, False)):
        path = sp.ShapePath.waypoints([0, 1, 2], [[0.0, 0.1], [1.0, 0.3], [gap, 0.1]])
        assert (sp.articulated(diver, path).closure is not None) == closes


def test_a_wheel_that_ends_whole_turns_on_is_a_loop():
    satellite = sp.load_body("satellite")
    for turns, closes in ((1.0, True), (-3.0, True), (0.5, False)):
        ends = np.stack([satellite.shape(), satellite.shape({"wheel_spin": 2 * np.pi * turns})])
        deformation = sp.articulated(satellite, sp.ShapePath.waypoints([0, 1], ends))
        assert (deformation.closure is not None) == closes
    arm = np.stack([satellite.shape(), satellite.shape({"arm_1": 2 * np.pi})])
    assert sp.articulated(satellite, sp.ShapePath.waypoints([0, 1], arm)).closure is None


def test_a_constant_shape_is_a_rigid_body(body, rng):
    """A10: constant inertia, no internal momentum, and it is a loop."""
    path = random_loop(body, rng)
    frozen = sp.ShapePath.waypoints([0.0, 2.0], np.stack([path.shape(0.4)] * 2), joint_names=body.joint_names)
    deformation = sp.articulated(body, frozen)
    t = np.linspace(0, 2, 5)
    np.testing.assert_array_equal(deformation.internal_momentum(t), np.zeros((5, 3)))
    np.testing.assert_array_equal(deformation.inertia_rate(t), np.zeros((5, 3, 3)))
    np.testing.assert_array_equal(deformation.inertia(t), np.stack([deformation.inertia(0.0)] * 5))
    np.testing.assert_array_equal(deformation.closure, np.eye(3))


def test_joints_must_match():
    diver = sp.load_body("diver")
    with pytest.raises(UnknownNameError, match="left_shoulder_abduction"):
        sp.articulated(
            diver,
            sp.ShapePath.waypoints([0, 1], np.zeros((2, 2)), joint_names=["left_shoulder", "right_shoulder_abduction"]),
        )
    with pytest.raises(TrajectoryError, match="joints"):
        sp.articulated(diver, sp.ShapePath.waypoints([0, 1], np.zeros((2, 3))))


def test_times_outside_are_refused():
    deformation = sp.rigid(np.diag([1.0, 2.0, 2.5]), 2.0)
    for read in (deformation.inertia, deformation.internal_momentum, deformation.inertia_rate, deformation.frame):
        for t in (-0.1, 2.1, [0.0, 3.0]):
            with pytest.raises(TrajectoryError, match="motion"):
                read(t)
        for t in (np.nan, "now", 1j):
            with pytest.raises(ShapeError, match="t: "):
                read(t)


# ---- Point masses ---------------------------------------------------------------------------------------------------


MASSES = np.array([1.0, 0.7, 1.3, 0.4])
POINTS = np.array([[0.5, 0.1, -0.2], [-0.4, 0.6, 0.1], [0.2, -0.5, 0.7], [0.1, 0.3, -0.9]])


def wobble(t):
    """Each mass on its own ellipse, none of it centred."""
    phase = 2 * np.pi * t[:, None, None] / 3.0 + np.arange(12).reshape(4, 3)
    return POINTS + 0.2 * np.sin(phase), 0.2 * 2 * np.pi / 3.0 * np.cos(phase)


def test_particles_are_sums_over_the_masses_a1_a3_a7_a8(rng):
    """I and L_o about the common centre, wherever the frame's origin lies and moves."""
    deformation = sp.particles(MASSES, wobble, 3.0)
    drift = np.array([2.0, -1.0, 0.5])
    drifting = sp.particles(
        MASSES, lambda t: (wobble(t)[0] + t[:, None, None] * drift + 7.0, wobble(t)[1] + drift), 3.0
    )
    share = MASSES / MASSES.sum()
    for t in (0.0, 0.4, 2.9):
        points, speeds = (part[0] for part in wobble(np.array([t])))
        points, speeds = points - share @ points, speeds - share @ speeds
        momentum = sum(m * np.cross(p, v) for m, p, v in zip(MASSES, points, speeds, strict=True))
        for each, precision in ((deformation, 1e-14), (drifting, 1e-12)):
            np.testing.assert_allclose(each.inertia(t), inertia_of(MASSES, points), atol=precision, rtol=0)
            np.testing.assert_allclose(each.internal_momentum(t), momentum, atol=precision, rtol=0)
    t = rng.uniform(0.3, 2.7, 5)
    # The nine-point formula adds inertias, each known to some eight units of rounding (places less their centre,
    # products, a sum over four masses), with weights whose magnitudes sum up to 2.1/step; its own error, of the order
    # of (2 pulse step)^8/630, is a hundredth of that.
    step = 0.01
    rounding = 8.0 * np.finfo(float).eps * np.abs(deformation.inertia(t)).max() * 2.1 / step
    np.testing.assert_allclose(deformation.inertia_rate(t), slope(deformation.inertia, t, step), atol=rounding, rtol=0)
    np.testing.assert_array_equal(deformation.centre_of_mass(t), np.zeros((5, 3)))
    assert deformation.closure is not None
    np.testing.assert_allclose(deformation.closure, np.eye(3), atol=1e-12, rtol=0)


def cloud(rng, count):
    """Point masses with their centre, and the tensor about it."""
    masses, points = rng.uniform(0.3, 1.5, count), rng.normal(size=(count, 3)) * 0.4
    centre = masses @ points / masses.sum()
    return masses, points, centre, inertia_of(masses, points - centre)


def test_the_same_body_as_particles_and_as_links(load_urdf, rng):
    """A3, A7: two links of five and three masses on a hinge and a slide, once as masses, once as a URDF."""
    (m1, p1, c1, i1), (m2, p2, c2, i2) = cloud(rng, 5), cloud(rng, 3)
    axis, slide = np.array([2.0, -1.0, 2.0]) / 3.0, np.array([0.6, 0.0, 0.8])
    hinge_at, slide_at = np.array([0.4, 0.2, -0.1]), np.array([0.1, -0.3, 0.2])
    body = load_urdf(
        urdf(
            link("first", m1.sum(), i1, c1),
            '<link name="between"/>',
            link("second", m2.sum(), i2, c2),
            joint("hinge", "revolute", "first", "between", axis, hinge_at),
            joint("slide", "prismatic", "between", "second", slide, slide_at),
        )
    )
    path = sp.ShapePath.fourier(
        [0.4, 0.2], rng.normal(size=(2, 2)) * 0.3, rng.normal(size=(2, 2)) * 0.3, 2.0, joint_names=["hinge", "slide"]
    )

    def positions(t):
        shapes, rates = path.shape(t), path.rate(t)
        turn = np.array([expm(angle * hat(axis)) for angle in shapes[:, 0]])
        local = p2 + slide_at + shapes[:, 1, None, None] * slide
        arm = np.einsum("nij,nmj->nmi", turn, local)
        speed = rates[:, 0, None, None] * np.cross(axis, arm) + rates[:, 1, None, None] * (turn @ slide)[:, None]
        still = np.broadcast_to(p1, (len(t), *p1.shape))
        return np.concatenate([still, hinge_at + arm], axis=1), np.concatenate([0 * still, speed], axis=1)

    as_links = sp.articulated(body, path)
    as_masses = sp.particles(np.concatenate([m1, m2]), positions, 2.0)
    t = np.linspace(0, 2, 21)
    for name in ("inertia", "internal_momentum", "inertia_rate"):
        one, other = getattr(as_links, name)(t), getattr(as_masses, name)(t)
        np.testing.assert_allclose(one, other, atol=1e-12 * np.abs(other).max(), rtol=0)
    np.testing.assert_allclose(as_masses.closure, np.eye(3), atol=1e-12, rtol=0)
    mu = np.array([0.3, -0.5, 0.8])
    turned = [sp.reconstruct(each, mu, tolerance=5e-13).attitude(t) for each in (as_links, as_masses)]
    np.testing.assert_allclose(turned[0], turned[1], rtol=0, atol=1e-12)


def test_the_closure_of_particles_is_found():
    """Masses that end as they began, turned: c(T) = closure c(0); flat sets too; mirrored ones do not close."""
    turn = Rotation.from_rotvec([1.9, -0.7, 2.0])
    spin = turn.as_rotvec() / 3.0

    def carried(points):
        def f(t):
            phase = 2 * np.pi * t[:, None, None] / 3.0
            here, speed = points * (1 + 0.3 * np.sin(phase)), points * 0.2 * np.pi * np.cos(phase)
            r = Rotation.from_rotvec(t[:, None] * spin).as_matrix()
            at = np.einsum("nij,nmj->nmi", r, here)
            return at + np.array([1.0, 2.0, 3.0]), np.einsum("nij,nmj->nmi", r, speed) + np.cross(spin, at)

        return f

    for points in (POINTS, POINTS * [1.0, 1.0, 0.0]):
        deformation = sp.particles(MASSES, carried(points), 3.0)
        np.testing.assert_allclose(deformation.closure, turn.as_matrix(), atol=1e-12, rtol=0)
        assert deformation.shape_gap < 1e-12

    def mirror(t):
        flat = np.stack([1 + 0 * t, 1 + 0 * t, 1 - 2 * t], axis=-1)[:, None, :]
        return POINTS * flat, POINTS * np.broadcast_to([0.0, 0.0, -2.0], flat.shape)

    mirrored = sp.particles(MASSES, mirror, 1.0)
    larger = sp.particles(MASSES, lambda t: (10.0 * mirror(t)[0], 10.0 * mirror(t)[1]), 1.0)
    assert mirrored.closure is None
    assert mirrored.shape_gap > 0.1
    assert larger.shape_gap == pytest.approx(mirrored.shape_gap, rel=1e-12)


def test_particles_on_one_line_are_refused_when_reconstructed():
    """A2: masses on a line have no rotation about it."""
    points = [[0, 0, 0], [1, 2, 2], [-2, -4, -4], [0.5, 1, 1]]
    deformation = sp.particles(np.ones(4), lambda t: (constant(points)(t), 0 * constant(points)(t)), 1.0)
    with pytest.raises(SingularInertiaError, match="line"):
        sp.reconstruct(deformation, [0.0, 0.0, 1.0])
    with pytest.raises(SingularInertiaError):
        sp.horizontal_gauge(deformation)


def crossing(t):
    """Three masses that are on one line at t = 0.3721 only."""
    points = np.zeros((len(t), 3, 3))
    points[:, :, 0] = [-1.0, 0.1, 1.0]
    points[:, 1, 1] = np.sin(t - 0.3721)
    speeds = np.zeros_like(points)
    speeds[:, 1, 1] = np.cos(t - 0.3721)
    return points, speeds


def test_a_line_between_the_samples_is_found_when_the_motion_is_computed_a2():
    """No time at which the inertia is asked is the one; and near it nothing is refused."""
    deformation = sp.particles([1.0, 2.0, 1.0], crossing, 1.0)
    assert deformation.inertia(0.3722)[0, 0] > 0.0
    with pytest.raises(SingularInertiaError, match="mass"):
        sp.reconstruct(deformation, [1.0, 0.0, 0.3])
    with pytest.raises(SingularInertiaError, match=r"t = 0\.3721 s"):
        deformation.inertia(0.3721)
    late = sp.particles([1.0, 2.0, 1.0], lambda t: crossing(t + 0.7), 1.0)
    assert sp.reconstruct(late, [0.0, 0.0, 1.0]).error_estimate < 1e-9


# ---- Point masses sampled in time -----------------------------------------------------------------------------------


def test_sampled_particles_are_joined_by_the_cubic_spline(rng):
    """Positions and rates are SciPy's spline, on its own knots, whatever the samples' origin and first time."""
    times = np.sort(rng.uniform(0.0, 3.0, 12))
    samples = POINTS + 0.3 * rng.normal(size=(12, 4, 3))
    far = np.array([7e6, -2e6, 1e6])
    spline = CubicSpline(times - times[0], samples)
    length = times[-1] - times[0]
    want = sp.particles(MASSES, lambda t: (spline(t), spline(t, 1)), length, times[1:-1] - times[0])
    found = sp.particles(MASSES, (times, samples))
    away = sp.particles(MASSES, (times, samples + far + times[:, None, None] * 7e3))
    assert found.duration == pytest.approx(length, rel=1e-15)
    np.testing.assert_allclose(found.breaks, times - times[0], rtol=0, atol=1e-15)
    t = rng.uniform(0.0, length, 20)
    for name in ("inertia", "internal_momentum", "inertia_rate", "kinetic_energy"):
        value = getattr(want, name)(t)
        np.testing.assert_allclose(getattr(found, name)(t), value, rtol=0, atol=1e-13 * np.abs(value).max())
        # 7e6 m have 1e-9 m of digits, and knots lie 0.02 s apart.
        np.testing.assert_allclose(getattr(away, name)(t), value, rtol=0, atol=1e-5 * np.abs(value).max())
    assert found.closure is None
    ends = [sp.reconstruct(each, [0.3, -0.5, 0.8], tolerance=1e-11).final_attitude for each in (found, want)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=3e-11)


def test_sampled_particles_that_return_move_smoothly_on():
    """The spline is periodic where the last sample is the first, and converges to the motion in fourth order."""
    gaps = []
    for count in (40, 80):
        times = np.linspace(0.0, 3.0, count + 1)
        samples = wobble(times)[0]
        deformation = sp.particles(MASSES, (times, samples))
        np.testing.assert_allclose(deformation.closure, np.eye(3), rtol=0, atol=1e-12)
        start, end = (deformation.inertia_rate(t) for t in (0.0, 3.0))
        np.testing.assert_allclose(start, end, rtol=0, atol=1e-12)
        true = sp.particles(MASSES, wobble, 3.0)
        t = np.linspace(0, 3, 300)
        gaps.append(np.abs(deformation.inertia(t) - true.inertia(t)).max())
    assert 12.0 < gaps[0] / gaps[1] < 20.0


def test_samples_on_one_line_are_refused_at_once_a2():
    times = np.linspace(0.0, 1.0, 9)
    with pytest.raises(SingularInertiaError, match="mass"):
        sp.particles([1.0, 2.0, 1.0], (times, crossing(times)[0]))
    flat = np.outer(np.arange(4.0), [1.0, 2.0, 2.0])
    with pytest.raises(SingularInertiaError, match="mass"):
        sp.particles(MASSES, ([0.0, 1.0], np.stack([flat, 2.0 * flat])))


def test_samples_of_particles_are_checked():
    times, samples = np.linspace(0.0, 3.0, 7), wobble(np.linspace(0.0, 3.0, 7))[0]
    assert sp.particles(MASSES, (times, samples), 3.0).duration == 3.0
    for make, said in (
        (lambda: sp.particles(MASSES, wobble), "duration"),
        (lambda: sp.particles(MASSES, (times, samples), 2.0), "duration.*3 s"),
        (lambda: sp.particles(MASSES, (times, samples[:, :3])), r"positions: expected shape .*4, 3\)"),
        (lambda: sp.particles(MASSES, (times, samples[0])), "positions"),
        (lambda: sp.particles(MASSES, (times, samples[None])), "positions: samples"),
        (lambda: sp.particles(MASSES, (times[:5], samples)), "times"),
        (lambda: sp.particles(MASSES, (times[::-1], samples)), "ascend"),
        (lambda: sp.particles(MASSES, (times[:1], samples[:1])), "two samples"),
        (lambda: sp.particles(MASSES, (times, np.where(samples > 0.3, np.nan, samples))), "nan"),
        (lambda: sp.particles(MASSES, samples), "pair"),
        (lambda: sp.particles(MASSES, (times, samples), breaks=[4.0]), "breaks"),
    ):
        with pytest.raises((ShapeError, TrajectoryError), match=said):
            make()


@pytest.mark.parametrize("count", [0, 1, 2])
def test_one_or_two_particles_are_no_body(count):
    """A2: they are always on a line."""
    with pytest.raises(ShapePhaseError):
        sp.reconstruct(
            sp.particles(np.ones(count), lambda t: (np.eye(count, 3) + 0 * t[:, None, None],) * 2, 1.0), [0.0, 0.0, 1.0]
        )


def test_particles_in_one_place_are_no_body():
    with pytest.raises(ShapePhaseError):
        sp.reconstruct(sp.particles(MASSES, lambda t: (np.ones((len(t), 4, 3)),) * 2, 1.0), [0.0, 0.0, 1.0])


def test_particles_that_meet_on_a_line_are_named_with_the_time():
    """A2: collinear at t = 1/4 only; the time is in the message."""

    def f(t):
        height = np.cos(2 * np.pi * t)
        points = np.zeros((len(t), 3, 3))
        points[:, :, 0] = [-1.0, 0.0, 1.0]
        points[:, 1, 1] = height
        speeds = np.zeros_like(points)
        speeds[:, 1, 1] = -2 * np.pi * np.sin(2 * np.pi * t)
        return points, speeds

    with pytest.raises(SingularInertiaError, match="line"):
        sp.reconstruct(sp.particles([1.0, 1.0, 1.0], f, 1.0, breaks=[0.25]), [1.0, 0.0, 0.3])


@pytest.mark.parametrize(
    ("masses", "said"),
    [
        ([1.0, -1.0], "above 0"),
        ([1.0, 0.0], "above 0"),
        ([1.0, np.nan], "nan"),
        ([[1.0, 2.0]], "masses"),
        (["a", "b"], "masses"),
    ],
)
def test_masses_are_positive_numbers(masses, said):
    with pytest.raises(ShapeError, match=said):
        sp.particles(masses, lambda t: (np.zeros((len(t), 2, 3)),) * 2, 1.0)


def test_the_function_of_particles_must_return_the_right_shapes():
    for bad, said in (
        (
            lambda t: (np.zeros((len(t), 3, 3)), np.zeros((len(t), 4, 3))),
            r"positions must return \(2, 4, 3\).*\(2, 3, 3\)",
        ),
        (lambda t: (np.zeros((len(t), 4, 3)), np.zeros((4, 3))), "velocities must return"),
        (lambda t: (np.full((len(t), 4, 3), np.nan), np.zeros((len(t), 4, 3))), "positions: entry"),
        (lambda t: (np.zeros((len(t), 4, 3)), np.zeros((len(t), 4, 3)) + 1j), "velocities: .*complex"),
    ):
        with pytest.raises(ShapeError, match=said):
            sp.particles(MASSES, bad, 1.0)


# ---- Prescribed inertia ---------------------------------------------------------------------------------------------


def swelling(t):
    z = np.zeros((len(t), 3, 3))
    for i, (a, b) in enumerate(((3.0, 0.3), (2.0, -0.2), (1.5, 0.1))):
        z[:, i, i] = a + b * np.sin(2 * np.pi * t)
    z[:, 0, 1] = z[:, 1, 0] = 0.2 * np.cos(2 * np.pi * t)
    return z


def test_prescribed_functions_come_back(rng):
    momentum = lambda t: np.stack([np.sin(t), t, 0 * t], -1)  # noqa: E731
    deformation = sp.prescribed(swelling, momentum, 2.0)
    t = rng.uniform(0, 2, (3, 2))
    np.testing.assert_allclose(deformation.inertia(t), swelling(t.ravel()).reshape(3, 2, 3, 3), atol=1e-15, rtol=0)
    np.testing.assert_allclose(
        deformation.internal_momentum(t), momentum(t.ravel()).reshape(3, 2, 3), atol=1e-15, rtol=0
    )
    np.testing.assert_array_equal(deformation.closure, np.eye(3))
    assert sp.prescribed(swelling, None, 2.0).internal_momentum(0.3).tolist() == [0.0, 0.0, 0.0]
    part = sp.prescribed(swelling, None, 0.25)
    assert part.closure is None
    assert part.shape_gap == pytest.approx(0.1, rel=1e-12)  # 0.3 of 3
    assert sp.prescribed(lambda t: 7.0 * swelling(t), None, 0.25).shape_gap == pytest.approx(0.1, rel=1e-12)
    assert deformation.inertia([]).shape == (0, 3, 3)
    assert deformation.internal_momentum([]).shape == (0, 3)
    growing = sp.prescribed(lambda t: (1.0 + t)[:, None, None] * np.eye(3), None, 2.0)
    assert growing.closure is None
    assert growing.shape_gap == pytest.approx(2.0)
    np.testing.assert_array_equal(growing.centre_of_mass([0.0, 1.0]), np.zeros((2, 3)))


def test_a_rounding_of_asymmetry_is_taken_out():
    """Up to 1e-9 of the largest entry; more is an error."""
    rounded = np.diag([4.0, 3.0, 2.0])
    rounded[0, 1], rounded[1, 0] = 0.5, 0.5 + 3e-9
    inertia = sp.rigid(rounded, 1.0).inertia(0.5)
    np.testing.assert_array_equal(inertia, inertia.T)
    np.testing.assert_allclose(inertia[0, 1], 0.5 + 1.5e-9, rtol=1e-15)
    rounded[1, 0] = 0.5 + 6e-9
    with pytest.raises(UnphysicalInertiaError):
        sp.rigid(rounded, 1.0)


def test_prescribed_inertia_rate(rng):
    """By differences inside a panel: exact for polynomials up to the eighth degree, one-sided at breaks and ends."""
    t = np.concatenate([rng.uniform(0, 2, 20), [0.0, 2.0]])
    deformation = sp.prescribed(swelling, None, 2.0)
    want = 2 * np.pi * np.cos(2 * np.pi * t)[:, None] * [0.3, -0.2, 0.1]
    found = deformation.inertia_rate(t)
    np.testing.assert_allclose(np.diagonal(found, axis1=1, axis2=2), want, atol=1e-9, rtol=0)
    np.testing.assert_allclose(found[:, 0, 1], -0.4 * np.pi * np.sin(2 * np.pi * t), atol=1e-9, rtol=0)

    def kinked(t):
        return (1.0 + np.abs(t - 0.7) + 0.1 * t**8)[:, None, None] * np.eye(3)

    t = np.array([0.0, 0.3, np.nextafter(0.7, 0), 0.7, 0.71, 1.0])
    found = sp.prescribed(kinked, None, 1.0, breaks=[0.7]).inertia_rate(t)[:, 0, 0]
    np.testing.assert_allclose(found, np.where(t < 0.7, -1.0, 1.0) + 0.8 * t**7, atol=3e-10, rtol=0)
    late = sp.prescribed(lambda t: (1.0 + np.abs(t - 99.9))[:, None, None] * np.eye(3), None, 100.0, breaks=[99.9])
    t = np.array([0.0, 50.0, 99.89, 99.91, 100.0])
    np.testing.assert_allclose(late.inertia_rate(t)[:, 0, 0], np.where(t < 99.9, -1.0, 1.0), atol=5e-8, rtol=0)


def test_prescribed_functions_are_checked():
    with pytest.raises(UnphysicalInertiaError, match="symmetric"):
        sp.prescribed(constant([[2.0, 0.25, 0], [0, 2.0, 0], [0, 0, 2.0]]), None, 1.0)
    for bad, said in (
        (constant(np.eye(4)), r"inertia must return \(2, 3, 3\).*\(2, 4, 4\)"),
        (lambda _: np.eye(3), r"\(3, 3\)"),
        (constant(np.diag([1.0, 1.0, np.nan])), "nan"),
        (lambda _: [["a"] * 3] * 3, "inertia"),
    ):
        with pytest.raises(ShapeError, match=said):
            sp.prescribed(bad, None, 1.0)
    with pytest.raises(ShapeError, match="momentum"):
        sp.prescribed(swelling, constant([1.0, 2.0]), 1.0)
    with pytest.raises(ShapeError, match="momentum"):
        sp.prescribed(swelling, constant([1.0, 2.0, np.inf]), 1.0)


@pytest.mark.parametrize("moments", [(1, 1, 0), (1, 1, -1), (1, 1, -1000), (-1, -1, -1), (0, 0, 0)])
def test_an_inertia_that_is_not_positive_is_refused(moments):
    tensor = np.diag(np.array(moments, dtype=float))
    for make in (lambda: sp.prescribed(constant(tensor), None, 1.0), lambda: sp.rigid(tensor, 1.0)):
        with pytest.raises(SingularInertiaError, match="positive"):
            make()


def test_an_inertia_that_stops_being_positive_in_between_is_refused():
    def f(t):
        return np.stack([np.diag([1.0, 1.0, 0.5 + np.cos(2 * np.pi * s)]) for s in t])

    with pytest.raises(SingularInertiaError, match="t = 0"):
        sp.reconstruct(sp.prescribed(f, None, 1.0), [0.1, 0.0, 1.0])


def unphysical_for_a_while(t):
    """Moments 1, 2 and 3 + a bump of 0.05 at t = 0.6137, of width 0.1: only there the third is above the sum."""
    third = 2.98 + 0.05 * np.exp(-(((t - 0.6137) / 0.1) ** 2))
    return np.stack([1 + 0 * t, 2 + 0 * t, third], axis=-1)[:, :, None] * np.eye(3)


def test_prescribed_tensors_are_checked_at_all_times_where_asked_a4():
    """Physical at both ends, not in between: the message has the worst time and by how much; to 1e-7 s here."""
    with pytest.raises(UnphysicalInertiaError, match="inequality"):
        sp.prescribed(unphysical_for_a_while, None, 1.0, on_unphysical="error")
    with pytest.warns(sp.UnphysicalInertiaWarning, match="on_unphysical"):
        warned = sp.prescribed(unphysical_for_a_while, None, 1.0, on_unphysical="warn")
    allowed = sp.prescribed(unphysical_for_a_while, None, 1.0)
    for deformation in (warned, allowed):
        defect, when = deformation.triangle_defect()
        assert defect == pytest.approx(0.03 / 3.03, rel=1e-9)
        assert when == pytest.approx(0.6137, abs=1e-6)
        assert sp.reconstruct(deformation, [0.1, 0.2, 3.0]).error_estimate < 1e-9
    with pytest.raises(UnknownNameError, match="'allow'"):
        sp.prescribed(swelling, None, 1.0, on_unphysical="alow")


def test_every_piece_between_breaks_is_searched_a4():
    """One of 200 pieces is unphysical, for a fifth of its length."""

    def inertia(t):
        third = 2.9 + 0.2 * np.exp(-(((t - 137.37) / 0.1) ** 2))
        return np.stack([1 + 0 * t, 2 + 0 * t, third], axis=-1)[:, :, None] * np.eye(3)

    with pytest.raises(UnphysicalInertiaError, match=r"t = 137\.37 s"):
        sp.prescribed(inertia, None, 200.0, np.arange(1.0, 200.0), on_unphysical="error")


def test_what_the_search_missed_is_refused_when_it_is_evaluated_a4():
    def inertia(t):
        third = 2.9 + 0.2 * np.exp(-(((t - 0.51234) / 1e-5) ** 2))
        return np.stack([1 + 0 * t, 2 + 0 * t, third], axis=-1)[:, :, None] * np.eye(3)

    deformation = sp.prescribed(inertia, None, 1.0, on_unphysical="error")
    with pytest.raises(UnphysicalInertiaError, match=r"t = 0\.51234 s"):
        deformation.inertia(0.51234)


def test_cabreras_examples_as_printed_are_allowed_and_named_c_e13():
    """Examples 4.4 and 4.5 let one moment grow alone: past the sum of the others no body has them."""

    def antenna(t):
        return np.stack([1 + 0 * t, 1.05 + 0 * t, 1.06 + 2.0 * t], axis=-1)[:, :, None] * np.eye(3)

    printed = sp.prescribed(antenna, None, 1.0)
    defect, when = printed.triangle_defect()
    assert defect == pytest.approx((3.06 - 2.05) / 3.06, rel=1e-9)
    assert when == pytest.approx(1.0, abs=1e-9)
    assert sp.reconstruct(printed, [0.6, 0.0, 0.8]).error_estimate < 1e-9
    with pytest.raises(UnphysicalInertiaError, match="33 %"):
        sp.prescribed(antenna, None, 1.0, on_unphysical="error")
    capped = sp.prescribed(lambda t: antenna(0.49 * t), None, 1.0, on_unphysical="error")
    assert -0.01 < capped.triangle_defect()[0] < 0.0


@pytest.mark.parametrize("count", full_but([15, 50], 15))
def test_flat_and_round_bodies_are_physical_a4(count):
    """At the limit rounding decides nothing."""
    turns = Rotation.random(count, rng=np.random.default_rng(4)).as_matrix()
    for turn in turns:
        flat = turn @ np.diag([0.7, 1.9, 2.6]) @ turn.T
        deformation = sp.prescribed(constant(flat), None, 1.0, on_unphysical="error")
        assert abs(deformation.triangle_defect()[0]) < 1e-14
    assert sp.rigid(np.eye(3), 1.0).triangle_defect()[0] == pytest.approx(-1.0)


@pytest.mark.parametrize("duration", [0.0, -1.0, np.nan, "long", [1.0]])
def test_a_duration_is_a_positive_number(duration):
    for make in (
        lambda: sp.rigid(np.eye(3), duration),
        lambda: sp.prescribed(swelling, None, duration),
        lambda: sp.particles(MASSES, wobble, duration),
    ):
        with pytest.raises(ValueError, match="duration"):
            make()


def test_breaks_lie_inside():
    for breaks in ([1.5], [-0.1, 0.3], [np.nan], [[0.1, 0.2]], ["soon"]):
        with pytest.raises(ValueError, match="breaks"):
            sp.prescribed(swelling, None, 1.0, breaks)
        with pytest.raises(ValueError, match="breaks"):
            sp.particles(MASSES, wobble, 1.0, breaks)
    np.testing.assert_array_equal(sp.prescribed(swelling, None, 1.0, [0.5, 0.25, 0.5]).breaks, [0, 0.25, 0.5, 1.0])


# ---- Rigid bodies ---------------------------------------------------------------------------------------------------


def test_a_rigid_body():
    """A10, Cabrera example 2.6."""
    tensor = np.array([[3.0, 0.2, 0.1], [0.2, 2.0, 0.3], [0.1, 0.3, 1.7]])
    deformation = sp.rigid(tensor, 4.0)
    t = np.linspace(0, 4, 3)
    np.testing.assert_allclose(deformation.inertia(t), np.stack([tensor] * 3), atol=1e-15, rtol=0)
    np.testing.assert_array_equal(deformation.internal_momentum(t), np.zeros((3, 3)))
    np.testing.assert_array_equal(deformation.inertia_rate(t), np.zeros((3, 3, 3)))
    np.testing.assert_array_equal(deformation.closure, np.eye(3))
    assert (deformation.duration, deformation.shape_gap) == (4.0, 0.0)
    np.testing.assert_array_equal(deformation.breaks, [0.0, 4.0])
    np.testing.assert_array_equal(deformation.centre_of_mass(t), np.zeros((3, 3)))
    for bad in (np.eye(2), np.full((3, 3), np.nan), "round", np.ones((3, 3)) * 1j):
        with pytest.raises(ShapeError, match="inertia"):
            sp.rigid(bad, 1.0)
    with pytest.raises(UnphysicalInertiaError, match="symmetric"):
        sp.rigid(tensor + np.triu(np.ones((3, 3)), 1), 1.0)


def test_a_rigid_body_described_from_a_turning_frame_a10():
    """Cabrera example 2.7: d_0(t) = U(t) d in the fibre moves as the rigid body: R U is Euler's motion."""
    spin = np.array([0.7, -0.4, 0.9])
    centred = POINTS - MASSES @ POINTS / MASSES.sum()
    inertia = inertia_of(MASSES, centred)

    def f(t):
        u = Rotation.from_rotvec(t[:, None] * spin).as_matrix()
        points = np.einsum("nij,mj->nmi", u, centred)
        return points, np.cross(spin, points)

    deformation = sp.particles(MASSES, f, 3.0)
    t = np.linspace(0, 3, 7)
    u = Rotation.from_rotvec(t[:, None] * spin).as_matrix()
    np.testing.assert_allclose(deformation.inertia(t), u @ inertia @ np.swapaxes(u, 1, 2), atol=1e-14, rtol=0)
    np.testing.assert_allclose(deformation.internal_momentum(t), u @ inertia @ spin, atol=1e-14, rtol=0)
    np.testing.assert_allclose(deformation.closure, u[-1], atol=1e-13, rtol=0)
    mu = np.array([0.5, 1.0, -0.3])

    def euler(_, r):
        r = r.reshape(3, 3)
        return (r @ hat(np.linalg.solve(inertia, r.T @ mu))).ravel()

    rigid = solve_ivp(euler, (0, 3), np.eye(3).ravel(), "DOP853", t, rtol=1e-12, atol=1e-14).y.T.reshape(-1, 3, 3)
    motion = sp.reconstruct(deformation, mu, tolerance=1e-11)
    np.testing.assert_allclose(motion.attitude(t) @ u, rigid, atol=1e-10, rtol=0)
