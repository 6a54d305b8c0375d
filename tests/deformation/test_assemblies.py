"""Spacecraft with moving masses and booms, against sums over many point masses and against links of a URDF."""

from __future__ import annotations

import numpy as np
import pytest

import shapephase as sp
from shapephase.deformation import assembly, boom, mean_body_gauge, moving_mass, rigid_part
from shapephase.errors import (
    GaugeError,
    ShapeError,
    ShapePhaseError,
    SingularInertiaError,
    TrajectoryError,
    UnknownNameError,
    UnphysicalInertiaError,
)
from support.bodies import joint, link, urdf

HULL = np.array([[4.0, 0.3, -0.2], [0.3, 5.0, 0.4], [-0.2, 0.4, 3.0]])
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
ROOT = np.array([0.6, -0.2, 0.3])
DURATION = 2.0
TIMES = np.linspace(0.0, DURATION, 21)


def walk(seed, columns=3, mean=0.0, size=0.4):
    rng = np.random.default_rng(seed)
    waves = rng.uniform(-size, size, (2, columns, 2)) / [1.0, 2.0]
    return sp.ShapePath.fourier(mean + rng.uniform(-0.3, 0.3, columns), *waves, DURATION)


def extension(low, high):
    """Out along a quintic and half in again: rest to rest, breaks in between."""
    lengths = [[low], [high], [0.5 * (low + high)]]
    return sp.ShapePath.waypoints([0.0, 1.2, DURATION], lengths)


def points_of(inertia, mass, centre):
    """Six point masses with this mass, centre and inertia: pairs along the principal axes of the second moment."""
    moment = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    sizes, axes = np.linalg.eigh(moment)
    arms = axes * np.sqrt(3.0 * sizes / mass)
    return np.full(6, mass / 6.0), centre + np.concatenate([arms.T, -arms.T])


def check_equal(one, other, atol=1e-13, *, gauges=True):
    """Two descriptions of one body: everything a deformation says."""
    for name in ("inertia", "internal_momentum", "inertia_rate"):
        found, want = getattr(one, name)(TIMES), getattr(other, name)(TIMES)
        np.testing.assert_allclose(found, want, rtol=0, atol=atol * np.abs(want).max(), err_msg=name)
    spin = np.array([0.7, -0.4, 0.9])
    for omega in (np.zeros(3), spin):
        want = other.kinetic_energy(TIMES, omega)
        np.testing.assert_allclose(one.kinetic_energy(TIMES, omega), want, rtol=0, atol=atol * np.abs(want).max())
    if gauges:
        for found, want in zip(
            one.description.correlation(TIMES, 0.7), other.description.correlation(TIMES, 0.7), strict=True
        ):
            np.testing.assert_allclose(found, want, rtol=0, atol=atol * np.abs(want).max())


def with_hull(masses, curves):
    """The hull as six points, and moving points: masses (k,), curves: times -> (N, k, 3), (N, k, 3)."""
    hull_masses, hull_points = points_of(HULL, 50.0, np.array([0.1, 0.2, -0.1]))

    def positions(t):
        at, speed = curves(t)
        fixed = np.broadcast_to(hull_points, (len(t), 6, 3))
        return np.concatenate([fixed, at], axis=1), np.concatenate([0 * fixed, speed], axis=1)

    return sp.particles(np.concatenate([hull_masses, masses]), positions, DURATION, breaks=[1.2])


HULL_PART = rigid_part(50.0, HULL, [0.1, 0.2, -0.1])


def test_moving_the_furniture_is_a_sum_over_particles_a7():
    """Cabrera example 2.2: L_o is not zero, and the common centre of mass moves in the frame."""
    one, two = walk(1), walk(2, mean=1.0)
    made = assembly(HULL_PART, [moving_mass(70.0, one), moving_mass(12.0, two)])
    want = with_hull(
        np.array([70.0, 12.0]),
        lambda t: (np.stack([one.shape(t), two.shape(t)], 1), np.stack([one.rate(t), two.rate(t)], 1)),
    )
    check_equal(made, want)
    centre = (50.0 * np.array([0.1, 0.2, -0.1]) + 70.0 * one.shape(TIMES) + 12.0 * two.shape(TIMES)) / 132.0
    np.testing.assert_allclose(made.centre_of_mass(TIMES), centre, rtol=0, atol=1e-14)
    assert np.ptp(made.centre_of_mass(TIMES), axis=0).max() > 0.1
    assert np.abs(made.internal_momentum(TIMES)).max() > 1.0
    np.testing.assert_array_equal(made.closure, np.eye(3))
    assert made.duration == DURATION
    mu = np.array([5.0, -8.0, 12.0])
    ends = [sp.reconstruct(each, mu, tolerance=1e-12).final_attitude for each in (made, want)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=3e-12)


def rod(length, pace, root, axis, density):
    """A moving rod as two Gauss points, exact for moments of order three, and its root."""
    nodes = 0.5 + 0.5 * np.array([-1.0, 1.0]) / np.sqrt(3.0)
    at = root + (length[:, None] * nodes)[:, :, None] * axis
    speed = np.broadcast_to((pace[:, None] * axis)[:, None], at.shape)
    return density * length[:, None] * np.array([0.5, 0.5]), at, speed


def test_a_boom_is_the_rod_that_is_out_and_a_point_that_is_not_a3():
    """I, L_o and energy about the moving common centre, with Gauss points along the rod, by hand."""
    path = extension(0.2, 3.0)
    made = assembly(HULL_PART, [boom(8.0, 4.0, ROOT, 5.0 * AXIS, path)])
    hull_masses, hull_points = points_of(HULL, 50.0, np.array([0.1, 0.2, -0.1]))
    for t in TIMES:
        length, pace = path.shape(t), path.rate(t)
        masses, at, speed = rod(length, pace, ROOT, AXIS, 2.0)
        masses = np.concatenate([hull_masses, [8.0 - 2.0 * length[0]], masses[0]])
        at = np.concatenate([hull_points, [ROOT], at[0]])
        speed = np.concatenate([np.zeros((7, 3)), speed[0]])
        share = masses / masses.sum()
        assert masses.sum() == pytest.approx(58.0, rel=1e-14)
        np.testing.assert_allclose(made.centre_of_mass(t), share @ at, rtol=0, atol=1e-14)
        at, speed = at - share @ at, speed - share @ speed
        inertia = np.einsum(
            "m,mij->ij", masses, np.sum(at**2, -1)[:, None, None] * np.eye(3) - at[:, :, None] * at[:, None]
        )
        np.testing.assert_allclose(made.inertia(t), inertia, rtol=0, atol=1e-13 * inertia.max())
        np.testing.assert_allclose(
            made.internal_momentum(t), masses @ np.cross(at, speed), rtol=0, atol=1e-13 * inertia.max()
        )
        turned = speed + np.cross([0.7, -0.4, 0.9], at)
        energy = 0.5 * masses @ np.sum(turned**2, axis=-1)
        assert made.kinetic_energy(t, [0.7, -0.4, 0.9]) == pytest.approx(energy, rel=1e-13)
    assert made.closure is None
    assert made.shape_gap == pytest.approx(1.4, rel=1e-12)
    np.testing.assert_array_equal(made.breaks, [0.0, 1.2, DURATION])


def test_a_boom_is_made_of_bits_that_keep_their_mass():
    """Against 4000 bits that leave the root one by one, each known by its distance from the tip."""
    count = 4000
    path, other = extension(0.2, 3.0), extension(2.0, 0.1)
    axes = (AXIS, np.array([0.0, 0.6, -0.8]))
    behind = 4.0 * (np.arange(count) + 0.5) / count

    def bits(t):
        at, speed = [], []
        for route, axis in zip((path, other), axes, strict=True):
            out = route.shape(t) - behind
            at.append(ROOT + np.maximum(out, 0.0)[:, :, None] * axis)
            speed.append(np.where(out > 0.0, route.rate(t), 0.0)[:, :, None] * axis)
        return np.concatenate(at, axis=1), np.concatenate(speed, axis=1)

    made = assembly(
        HULL_PART, [boom(8.0, 4.0, ROOT, axis, route) for axis, route in zip(axes, (path, other), strict=True)]
    )
    want = with_hull(np.full(2 * count, 8.0 / count), bits)
    # Bits are points at their middles: what depends on places alone is right to their square, and what depends on
    # speeds to the one bit that has just left the root, or has not.
    check_equal(made, want, atol=2.0 / count)
    inertia = want.inertia(TIMES)
    np.testing.assert_allclose(made.inertia(TIMES), inertia, rtol=0, atol=np.abs(inertia).max() / count**2)
    found, there = made.description.correlation(TIMES, 0.7), want.description.correlation(TIMES, 0.7)
    assert np.abs(found[0] - there[0]).max() < np.abs(there[0]).max() / count**2


def derivative(function, t, step=4e-3):
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return sum(w * (function(t + k * step) - function(t - k * step)) for k, w in weights.items()) / step


def test_rates_are_derivatives_and_the_energy_is_that_of_the_masses():
    made = assembly(
        HULL_PART, [boom(8.0, 4.0, ROOT, AXIS, extension(0.2, 3.0)), moving_mass(20.0, walk(4)), rigid_part(3.0)]
    )
    t = np.array([0.1, 0.5, 0.9, 1.5, 1.8])
    np.testing.assert_allclose(made.inertia_rate(t), derivative(made.inertia, t), rtol=0, atol=1e-9)
    for reference in (0.3, 1.9):
        rate = derivative(lambda s, r=reference: made.description.correlation(s, r)[0], t)
        np.testing.assert_allclose(made.description.correlation(t, reference)[1], rate, rtol=0, atol=1e-8)
        own = made.description.correlation(np.array([reference]), reference)[0][0]
        np.testing.assert_allclose(np.trace(own) * np.eye(3) - own, made.inertia(reference), rtol=0, atol=1e-12)
        flow = made.description.correlation(np.array([reference]), reference)[1][0]
        momentum = -np.array([flow[1, 2] - flow[2, 1], flow[2, 0] - flow[0, 2], flow[0, 1] - flow[1, 0]])
        np.testing.assert_allclose(momentum, made.internal_momentum(reference), rtol=0, atol=1e-12)


def test_a_boom_and_a_cart_are_links_on_slides(load_urdf):
    """Against Pinocchio: a rod that slides, out of a body from which its stowed part is taken, is such only with its
    whole length out; a cart on a slide is one always."""
    slide = walk(7, columns=1)
    hinge = np.array([0.3, 0.1, -0.4])
    body = load_urdf(
        urdf(
            link("hull", 50.0, HULL, [0.1, 0.2, -0.1]),
            link("cart", 7.0, np.zeros((3, 3)), [0.05, 0.0, 0.02]),
            joint("rail", "prismatic", "hull", "cart", AXIS, hinge),
        )
    )
    links = sp.articulated(body, slide)
    place = hinge + np.array([0.05, 0.0, 0.02])
    line = sp.ShapePath.fourier(
        place + slide.curve.mean * AXIS,
        AXIS[:, None] * slide.curve.cosines,
        AXIS[:, None] * slide.curve.sines,
        DURATION,
    )
    made = assembly(HULL_PART, [moving_mass(7.0, line)])
    check_equal(made, links, gauges=True)
    np.testing.assert_allclose(made.centre_of_mass(TIMES), links.centre_of_mass(TIMES), rtol=0, atol=1e-13)
    for tolerance in (1e-9, 1e-12):
        motions = [sp.reconstruct(each, [3.0, -5.0, 8.0], tolerance=tolerance) for each in (made, links)]
        np.testing.assert_allclose(motions[0].attitude(TIMES), motions[1].attitude(TIMES), rtol=0, atol=3 * tolerance)
        np.testing.assert_allclose(
            motions[0].base_position(TIMES), motions[1].base_position(TIMES), rtol=0, atol=3 * tolerance
        )


def test_a_boom_through_the_centre_makes_no_internal_momentum():
    """F4b: along an axis through the common centre two moments grow, by the rod's closed form, the third stays."""
    path = extension(0.0, 4.0)
    made = assembly(rigid_part(50.0, np.diag([4.0, 5.0, 6.0])), [boom(8.0, 4.0, [0, 0, 0.5], [0, 0, 1.0], path)])
    length = path.shape(TIMES)[:, 0]
    np.testing.assert_allclose(made.internal_momentum(TIMES), np.zeros((21, 3)), rtol=0, atol=1e-13)
    second = 8.0 * 0.25 + 2.0 * (0.5 * length**2 + length**3 / 3.0) - (4.0 + length**2) ** 2 / 58.0
    found = made.inertia(TIMES)
    np.testing.assert_allclose(found[:, 2, 2], 6.0, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found[:, 0, 0], 4.0 + second, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found[:, 1, 1], 5.0 + second, rtol=0, atol=1e-12)


def test_a_frame_far_from_the_body_costs_no_digits():
    """A1: what is meant is the motion about the common centre, wherever the frame's origin lies."""
    far = np.array([4e3, -2e3, 1e3])
    near = walk(3)
    away = sp.ShapePath.fourier(near.curve.mean + far, near.curve.cosines, near.curve.sines, DURATION)
    one = assembly(HULL_PART, [moving_mass(7.0, near), boom(8.0, 4.0, ROOT, AXIS, extension(0.2, 3.0))])
    other = assembly(
        rigid_part(50.0, HULL, far + np.array([0.1, 0.2, -0.1])),
        [moving_mass(7.0, away), boom(8.0, 4.0, ROOT + far, AXIS, extension(0.2, 3.0))],
    )
    for name in ("inertia", "internal_momentum", "inertia_rate"):
        want = getattr(one, name)(TIMES)
        np.testing.assert_allclose(getattr(other, name)(TIMES), want, rtol=0, atol=1e-11 * np.abs(want).max())
    np.testing.assert_allclose(other.centre_of_mass(TIMES), one.centre_of_mass(TIMES) + far, rtol=0, atol=1e-11)


def test_the_base_goes_where_the_centre_of_mass_does_not():
    """At rest and with the centre fixed, the spacecraft's origin stays at -R c."""
    made = assembly(HULL_PART, [moving_mass(20.0, walk(5))])
    motion = sp.reconstruct(made, [0.0, 0.0, 0.0], tolerance=1e-11)
    attitude = motion.attitude(TIMES)
    want = -np.einsum("nij,nj->ni", attitude, made.centre_of_mass(TIMES))
    np.testing.assert_allclose(motion.base_position(TIMES), want, rtol=0, atol=1e-14)


def test_a_motion_of_an_assembly_is_saved_with_its_centre_of_mass(tmp_path):
    made = assembly(HULL_PART, [moving_mass(20.0, walk(5)), boom(8.0, 4.0, ROOT, AXIS, extension(0.2, 3.0))])
    motion = sp.reconstruct(made, [3.0, -5.0, 8.0], tolerance=1e-9)
    motion.save(tmp_path / "motion.npz")
    again = sp.load_motion(tmp_path / "motion.npz")
    np.testing.assert_allclose(again.attitude(TIMES), motion.attitude(TIMES), rtol=0, atol=1e-13)
    np.testing.assert_allclose(again.base_position(TIMES), motion.base_position(TIMES), rtol=0, atol=1e-8)


def test_repeated_and_unlike_loops():
    """Loops that are repeated together are sampled once; unlike ones give the same motion as one description."""
    near = walk(6)
    thrice = assembly(HULL_PART, [moving_mass(20.0, near.repeated(3))])
    assert thrice.loops == 3
    other = sp.ShapePath.fourier(near.curve.mean, near.curve.cosines, near.curve.sines, DURATION).stretched(3.0)
    mixed = assembly(HULL_PART, [moving_mass(20.0, near.repeated(3)), moving_mass(5.0, other)])
    assert mixed.loops == 1
    want = sp.particles(
        np.concatenate([points_of(HULL, 50.0, np.array([0.1, 0.2, -0.1]))[0], [20.0, 5.0]]),
        lambda t: tuple(
            np.concatenate([np.broadcast_to(fixed, (len(t), 6, 3)), np.stack([a, b], 1)], axis=1)
            for fixed, a, b in (
                (
                    points_of(HULL, 50.0, np.array([0.1, 0.2, -0.1]))[1],
                    near.shape(t % DURATION),
                    other.shape(t),
                ),
                (np.zeros((6, 3)), near.rate(t % DURATION), other.rate(t)),
            )
        ),
        3 * DURATION,
    )
    ends = [sp.reconstruct(each, [3.0, -5.0, 8.0], tolerance=1e-10).final_attitude for each in (mixed, want)]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=1e-9)
    one = sp.reconstruct(thrice, [3.0, -5.0, 8.0], tolerance=1e-10)
    plain = sp.reconstruct(assembly(HULL_PART, [moving_mass(20.0, near)]), [3.0, -5.0, 8.0], tolerance=1e-10)
    np.testing.assert_allclose(one.attitude(DURATION), plain.final_attitude, rtol=0, atol=1e-9)


def test_quick_loops_beside_slow_ones_are_not_missed():
    """Eight swings beside half a one: the motion is that of the functions, stepped by DOP853."""
    quick = sp.ShapePath.fourier([0.3, 1.0, 0.2], np.full((3, 1), 0.3), [[0.1], [-0.2], [0.3]], 0.25).repeated(8)
    slow = sp.ShapePath.waypoints([0.0, DURATION], [[0.5], [1.5]])
    made = assembly(HULL_PART, [moving_mass(20.0, quick), boom(8.0, 4.0, ROOT, AXIS, slow)])
    ends = [sp.reconstruct(made, [3.0, -5.0, 8.0], tolerance=1e-7, method=m).final_attitude for m in ("auto", "dop853")]
    np.testing.assert_allclose(ends[0], ends[1], rtol=0, atol=2e-7)


def test_a_path_that_goes_on_by_two_pi_metres_is_no_loop():
    """A joint is back after a whole turn, a mass is not: the third lap is not the first."""
    lap = sp.ShapePath.waypoints([0.0, 0.5, 1.0], [[0.0, 1.0, 0.0], [2.0, 0.5, 0.3], [2.0 * np.pi, 1.0, 0.0]])
    path = lap.repeated(3)
    made = assembly(HULL_PART, [moving_mass(7.0, path)])
    assert made.loops == 1
    assert made.closure is None
    motions = [sp.reconstruct(made, [3.0, -5.0, 8.0], tolerance=1e-9, method=m) for m in ("auto", "dop853")]
    t = np.linspace(0.0, 3.0, 7)
    np.testing.assert_allclose(motions[0].attitude(t), motions[1].attitude(t), rtol=0, atol=3e-9)
    half = np.array([0.25, 2.25])
    inertia = made.inertia(half)
    assert np.abs(inertia[1] - inertia[0]).max() > 100.0


def test_the_mean_frame_of_an_assembly_is_that_of_its_particles():
    near = walk(8)
    made = assembly(HULL_PART, [moving_mass(20.0, near)])
    want = with_hull(np.array([20.0]), lambda t: (near.shape(t)[:, None], near.rate(t)[:, None]))
    frames = [mean_body_gauge(each).frame(TIMES) for each in (made, want)]
    np.testing.assert_allclose(frames[0], frames[1], rtol=0, atol=1e-12)
    with pytest.raises(GaugeError, match="link"):
        made.description.link_frames(TIMES, "hull")


def test_an_assembly_without_moving_parts_is_rigid():
    made = assembly(HULL_PART, [rigid_part(3.0, centre=[1.0, 0.0, 0.0])], duration=4.0)
    arm = np.array([0.9, -0.2, 0.1])
    want = HULL + 150.0 / 53.0 * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    np.testing.assert_allclose(made.inertia(1.0), want, rtol=0, atol=1e-13)
    assert made.duration == 4.0
    np.testing.assert_array_equal(made.closure, np.eye(3))
    motion = sp.reconstruct(made, [1.0, 2.0, 3.0])
    assert (
        np.abs(motion.attitude(4.0) - sp.reconstruct(sp.rigid(want, 4.0), [1.0, 2.0, 3.0]).attitude(4.0)).max() < 2e-9
    )


def test_an_assembly_is_physical_because_its_parts_are_a4():
    """The second moments add; whatever the parts do the triangle inequality holds."""
    rng = np.random.default_rng(9)
    for seed in range(20):
        parts = [moving_mass(float(rng.uniform(1, 50)), walk(seed)), boom(8.0, 4.0, ROOT, AXIS, extension(0.2, 3.0))]
        flat = rigid_part(10.0, np.diag([1.0, 2.0, 3.0]))
        defect, when = assembly(flat, parts).triangle_defect()
        assert defect <= 1e-12
        assert 0.0 <= when <= DURATION
    with pytest.raises(UnphysicalInertiaError, match="triangle"):
        rigid_part(1.0, np.diag([1.0, 2.0, 3.5]))
    with pytest.warns(sp.UnphysicalInertiaWarning, match="triangle"):
        rigid_part(1.0, np.diag([1.0, 2.0, 3.5]), on_unphysical="warn")
    assert rigid_part(1.0, np.diag([1.0, 2.0, 3.5]), on_unphysical="allow").mass == 1.0
    for negative in ([-1.0, 2.0, 2.0], [-1.0, -1.0, -1.0]):
        with pytest.raises(UnphysicalInertiaError, match="negative"):
            rigid_part(1.0, np.diag(negative), on_unphysical="allow")
    with pytest.raises(UnknownNameError, match="on_unphysical"):
        rigid_part(1.0, HULL, on_unphysical="ignore")


def test_an_assembly_on_one_line_is_refused_with_the_time_a2():
    """A point, a boom along x, and a mass that crosses the line at t = 0.5."""
    path = sp.ShapePath.function(
        lambda t: (
            np.stack([1 + 0 * t, t - 0.4879, 0 * t], axis=-1),
            np.stack([0 * t, 1 + 0 * t, 0 * t], axis=-1),
        ),
        DURATION,
    )
    with pytest.raises(SingularInertiaError, match="line"):
        assembly(rigid_part(1.0), [boom(1.0, 4.0, [0, 0, 0], [1, 0, 0], extension(1.0, 3.0)), moving_mass(1.0, path)])
    with pytest.raises(SingularInertiaError, match="line"):
        assembly(rigid_part(1.0), [boom(1.0, 4.0, [0, 0, 0], [1, 0, 0], extension(1.0, 3.0))])


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: boom(8.0, 2.9, ROOT, AXIS, extension(0.2, 3.0)), r"between 0 and 2\.9 m, at t = 1\.2\d* s it is 3 m"),
        (lambda: boom(8.0, 4.0, ROOT, AXIS, extension(3.0, -0.1)), r"t = 1\.2 s it is -0\.1 m"),
        (lambda: boom(8.0, 4.0, ROOT, np.zeros(3), extension(0.2, 3.0)), "direction"),
        (lambda: boom(8.0, 4.0, [ROOT], AXIS, extension(0.2, 3.0)), "root"),
        (lambda: boom(-8.0, 4.0, ROOT, AXIS, extension(0.2, 3.0)), "mass"),
        (lambda: boom(8.0, 0.0, ROOT, AXIS, extension(0.2, 3.0)), "full_length"),
        (lambda: boom(8.0, 4.0, ROOT, AXIS, walk(1)), "1 columns"),
        (lambda: moving_mass(1.0, walk(1, columns=2)), "3 columns"),
        (lambda: moving_mass(1.0, lambda t: t), "ShapePath"),
        (lambda: moving_mass(0.0, walk(1)), "mass"),
        (lambda: rigid_part(0.0, HULL), "mass"),
        (lambda: rigid_part(1.0, np.triu(HULL)), "symmetric"),
        (lambda: rigid_part(1.0, np.stack([HULL, HULL])), "symmetric"),
        (lambda: rigid_part(1.0, HULL, [0.0, np.nan, 0.0]), "centre"),
        (lambda: assembly(HULL_PART, []), "duration"),
        (lambda: assembly(HULL_PART, [moving_mass(1.0, walk(1))], duration=3.0), "one time"),
        (
            lambda: assembly(HULL_PART, [moving_mass(1.0, walk(1)), moving_mass(1.0, walk(1).stretched(2.0))]),
            "one time",
        ),
    ],
)
def test_arguments_are_checked(make, said):
    with pytest.raises(ShapePhaseError, match=said) as caught:
        make()
    assert isinstance(caught.value, ShapeError | TrajectoryError)
