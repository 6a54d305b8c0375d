"""The split of a rotation: holonomy, dynamic and Montgomery phase (theory.md U5, U9, B, D).

The truth comes from `pinocchio_motion`: one integration of the attitude, the lift, the dynamic phase and a tangent
vector carried parallel along the momentum curve, whose turn is the solid angle.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise, product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import UnknownNameError
from support.independent import (
    BODIES,
    EVERY_BODY,
    apart,
    body_of,
    geodesic_turn,
    pinocchio_motion,
    random_loop,
    random_rotation,
    random_vector,
    turn,
    wrapped,
)
from support.long_runs import full_but

GAUGES = ("horizontal", "base", "principal")
UP = np.array([0.0, 0.0, 1.0])


@lru_cache(maxsize=16)
def deformation_of(name: str, seed: int = 1) -> sp.Deformation:
    body = body_of(name)
    return sp.articulated(body, random_loop(seed, body.n_shape).path)


@lru_cache(maxsize=16)
def some_motion(name: str, seed: int = 1) -> sp.Motion:
    """Any attitude: neither gauge closes the momentum."""
    momentum, attitude = random_vector(seed + 1, BODIES[name]), random_rotation(seed + 2)
    return sp.reconstruct(deformation_of(name, seed), momentum, attitude, tolerance=1e-11)


@lru_cache(maxsize=16)
def orbits(name: str, gauge: str) -> list[sp.Motion]:
    """Motions whose momentum closes in a gauge, seen from the base."""
    deformation = deformation_of(name)
    if gauge == "base":
        return sp.closed_orbits(deformation, BODIES[name])
    found = sp.closed_orbits(sp.horizontal_gauge(deformation), BODIES[name])
    starts = [motion.initial_attitude for motion in found]
    return [sp.reconstruct(deformation, [0.0, 0.0, BODIES[name]], start, tolerance=1e-11) for start in starts]


def read_off(rotation: np.ndarray, axis: np.ndarray) -> float:
    """The angle of a turn about a known axis."""
    vector = Rotation.from_matrix(rotation).as_rotvec()
    assert np.linalg.norm(np.cross(vector, axis)) < 1e-8
    return float(vector @ axis)


# ---- Momentum and shape close together ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", full_but(["example:human", "cat"], "cat"))
def test_closed_in_the_base_gauge(name: str):
    assert len(orbits(name, "base")) >= 2
    for motion in orbits(name, "base"):
        split = sp.split(motion, "base")
        assert split.momentum_gap < 1e-9
        total = motion.final_attitude @ motion.initial_attitude.T
        np.testing.assert_allclose(split.total_rotation, total, rtol=0, atol=1e-15)
        seen = read_off(total, UP)
        assert abs(wrapped(split.dynamic_phase - split.solid_angle - seen)) < 1e-9
        assert split.residual < 1e-9
        assert apart(turn(UP, split.montgomery_phase), split.total_rotation) < 1e-9
        # In this gauge theta_M already holds the shape's part.
        assert apart(turn(UP, split.montgomery_phase) @ split.holonomy, split.total_rotation) > 1e-2
        assert apart(split.closing_tilt, np.eye(3)) < 1e-9


@pytest.mark.parametrize("name", full_but(["example:human", "cat"], "example:human"))
def test_closed_in_the_horizontal_gauge(name: str):
    assert len(orbits(name, "horizontal")) >= 2
    for motion in orbits(name, "horizontal"):
        split = sp.split(motion)
        assert split.gauge == "horizontal"
        assert split.momentum_gap < 1e-9
        total = motion.final_attitude @ motion.initial_attitude.T
        seen = read_off(total @ split.holonomy.T, UP)
        assert abs(wrapped(split.dynamic_phase - split.solid_angle - seen)) < 1e-9
        assert split.residual < 1e-9
        assert apart(turn(UP, split.montgomery_phase) @ split.holonomy, total) < 1e-9
        assert apart(turn(UP, split.montgomery_phase), total) > 1e-2
        assert apart(split.closing_tilt, np.eye(3)) < 1e-9
        assert apart(split.dynamical_rotation, turn(UP, split.montgomery_phase)) < 1e-9


@pytest.mark.parametrize(
    ("name", "gauge"),
    full_but(
        product(["example:human", "cat"], ["base", "horizontal"]), ("cat", "base"), ("example:human", "horizontal")
    ),
)
def test_phases_of_closed_orbits_are_those_of_parallel_transport(name: str, gauge: str):
    body, loop = body_of(name), random_loop(1, body_of(name).n_shape)
    for motion in orbits(name, gauge)[:2]:
        truth = pinocchio_motion(name, body.joint_names, loop, motion.momentum, motion.initial_attitude)
        assert truth.gap[gauge] < 1e-9
        split = sp.split(motion, gauge)
        assert abs(split.dynamic_phase - truth.dynamic_phase[gauge]) < 1e-9
        assert abs(wrapped(split.solid_angle - truth.solid_angle[gauge])) < 1e-9
        assert split.geometric_phase == -split.solid_angle


@pytest.mark.parametrize("name", EVERY_BODY)
@pytest.mark.parametrize("seed", [1, 2])
def test_any_attitude(name: str, seed: int):
    """U5, lift, holonomy and split: Delta R = exp(theta_M mu^) tilt R_G, without R_G in the base gauge.

    The tilt is a turn across mu by the gap.
    """
    motion = some_motion(name, seed)
    axis = motion.momentum / np.linalg.norm(motion.momentum)
    total = motion.final_attitude @ motion.initial_attitude.T
    for gauge in ("horizontal", "base"):
        split = sp.split(motion, gauge)
        phase = turn(axis, split.montgomery_phase)
        after = split.holonomy if gauge == "horizontal" else np.eye(3)
        assert apart(phase @ split.closing_tilt @ after, total) < 1e-10
        assert apart(split.dynamical_rotation @ split.holonomy, total) < 1e-12
        assert split.momentum_gap > 1e-3
        tilt = Rotation.from_matrix(split.closing_tilt).as_rotvec()
        assert abs(tilt @ axis) < 1e-12
        assert abs(np.linalg.norm(tilt) - split.momentum_gap) < 1e-12
        assert split.residual < 1e-10
        assert split.is_loop
        assert split.has_phase


@pytest.mark.parametrize("name", full_but(BODIES, "cat_two_halves", "satellite"))
def test_open_momentum_is_closed_by_the_great_circle(name: str):
    """Dynamic phase, solid angle, tilt and holonomy of an arc, all from the independent integration."""
    motion = some_motion(name)
    body, loop, start = body_of(name), random_loop(1, body_of(name).n_shape), motion.initial_attitude
    axis = motion.momentum / np.linalg.norm(motion.momentum)
    truth = pinocchio_motion(name, body.joint_names, loop, motion.momentum, start)
    lift = truth.lift[-1]
    for gauge, frame in (("base", np.eye(3)), ("horizontal", lift)):
        split = sp.split(motion, gauge)
        assert abs(split.dynamic_phase - truth.dynamic_phase[gauge]) < 3e-11
        assert abs(wrapped(split.solid_angle - truth.solid_angle[gauge])) < 3e-11
        closing = geodesic_turn(frame @ truth.attitude[-1].T @ axis, start.T @ axis)
        assert apart(split.closing_tilt, start @ closing @ start.T) < 3e-11
        assert apart(split.holonomy, start @ lift @ start.T) < 3e-11
    assert apart(start @ sp.holonomy(body, loop.path, 1e-12) @ start.T, start @ lift @ start.T) < 3e-11


def test_the_solid_angle_is_the_limit_of_polygons():
    """Richardson's extrapolation of the sums of spherical excesses of inscribed polygons, by Eriksson's formula."""
    motion = orbits("cat", "base")[0]
    split = sp.split(motion, "base")

    def polygon(count: int) -> float:
        u = motion.body_momentum(np.linspace(0.0, 2.0, count + 1)) / BODIES["cat"]
        u[-1] = u[0]
        centre = u.mean(axis=0) / np.linalg.norm(u.mean(axis=0))
        a, b = u[:-1], u[1:]
        excess = np.cross(a, b) @ centre / (1.0 + np.sum(a * b, axis=1) + a @ centre + b @ centre)
        return float(np.sum(2.0 * np.arctan(excess)))

    row = [polygon(100 * 2**k) for k in range(5)]
    for order in range(1, 5):
        row = [(4**order * fine - coarse) / (4**order - 1) for coarse, fine in pairwise(row)]
    assert abs(wrapped(split.solid_angle - row[0])) < 1e-9


# ---- The rigid body ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("moments", "size", "a", "period", "phase", "tolerance"),
    [
        ((3.0, 2.0, 1.0), 1.7, 1.3, 8.305738787261774, 5.99603257834978, 1e-11),
        # All but on the separatrix, where errors grow by thousands.
        ((3.0, 2.0, 1.0), 1.7, 1.999, 36.61739254324993, 29.037306487395497, 1e-9),
        ((3.0, 2.5, 1.2), 1.0, 1.25, 14.010844764544798, 5.154654852944097, 1e-11),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_rigid_phase_over_one_period(moments, size, a, period, phase, tolerance, seed):
    """D12, A10: theta_M of Montgomery's formula, theory.md section 6; a = |Pi|^2 / 2h."""
    first, _, third = moments
    body = np.array([np.sqrt(1.0 - (first - a) * third / ((first - third) * a)), 0.0, 0.0]) * size
    body[2] = np.sqrt(size**2 - body[0] ** 2)
    energy = 0.5 * np.sum(body**2 / moments)
    assert size**2 / (2.0 * energy) == pytest.approx(a, rel=1e-14)
    attitude = random_rotation(seed)
    deformation = sp.rigid(np.diag(moments), period)
    motion = sp.reconstruct(deformation, attitude @ body, attitude, tolerance=tolerance)
    near = 2.0 * tolerance
    np.testing.assert_allclose(motion.body_momentum(period), body, rtol=0, atol=near * size)
    split = sp.split(motion)
    axis = attitude @ body / size
    assert abs(wrapped(split.montgomery_phase - phase)) < near
    assert abs(wrapped(read_off(motion.final_attitude @ attitude.T, axis) - phase)) < near
    assert split.dynamic_phase == pytest.approx(2.0 * energy * period / size, abs=near)
    assert apart(turn(axis, split.montgomery_phase), split.total_rotation) < near
    assert apart(split.holonomy, np.eye(3)) < 1e-14
    for gauge in GAUGES:
        assert abs(sp.split(motion, gauge).montgomery_phase - split.montgomery_phase) < near


def test_signed_area_of_the_rigid_body():
    """Clockwise about the axis of the least moment; the smaller region is counted (theory.md section 6)."""
    body = 1.7 * np.array([np.sqrt(1.0 - 1.7 / 2.6), 0.0, np.sqrt(1.7 / 2.6)])
    motion = sp.reconstruct(sp.rigid(np.diag([3.0, 2.0, 1.0]), 8.305738787261774), body, tolerance=1e-11)
    split = sp.split(motion, "base")
    assert split.solid_angle == pytest.approx(-1.4178671637255, abs=1e-10)
    assert split.geometric_phase == -split.solid_angle
    assert split.montgomery_phase == split.dynamic_phase - split.solid_angle
    assert split.montgomery_phase > np.pi
    assert split.montgomery_angle == pytest.approx(5.99603257834978 - 2.0 * np.pi, abs=1e-10)


def test_two_rigid_periods_have_twice_the_phase():
    body = 1.7 * np.array([np.sqrt(1.0 - 1.7 / 2.6), 0.0, np.sqrt(1.7 / 2.6)])
    once, twice = (
        sp.split(sp.reconstruct(sp.rigid(np.diag([3.0, 2.0, 1.0]), n * 8.305738787261774), body, tolerance=1e-11))
        for n in (1, 2)
    )
    assert twice.dynamic_phase == pytest.approx(2.0 * once.dynamic_phase, abs=1e-10)
    assert twice.solid_angle == pytest.approx(2.0 * once.solid_angle, abs=1e-10)


def test_steady_turn_about_a_principal_axis():
    """Pi rests: no solid angle, theta_M = omega T exactly, counted over whole turns."""
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 40.0), [0.0, 0.0, 2.4], tolerance=1e-11)
    for gauge in GAUGES:
        split = sp.split(motion, gauge)
        assert split.montgomery_phase == pytest.approx(32.0, abs=1e-10)
        assert abs(split.solid_angle) < 1e-12
        assert split.montgomery_angle == pytest.approx(32.0 - 10.0 * np.pi, abs=1e-10)


# ---- Gauges --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", EVERY_BODY)
def test_the_rotation_and_its_holonomy_are_the_same_in_every_gauge(name: str):
    motion = some_motion(name)
    splits = [sp.split(motion, gauge) for gauge in ("horizontal", "base")]
    for split in splits[1:]:
        np.testing.assert_array_equal(split.total_rotation, splits[0].total_rotation)
        np.testing.assert_array_equal(split.holonomy, splits[0].holonomy)
        np.testing.assert_array_equal(split.dynamical_rotation, splits[0].dynamical_rotation)
    assert abs(wrapped(splits[0].montgomery_phase - splits[1].montgomery_phase)) > 1e-4


@pytest.mark.parametrize("name", ["satellite", "astronaut", "example:human"])
def test_principal_gauge(name: str):
    """In the principal gauge exp(theta_M mu^) tilt is the turn of the principal frame, whatever the signs of axes."""
    motion = some_motion(name)
    split = sp.split(motion, "principal")
    seen = sp.principal_gauge(motion.deformation)
    inertia = seen.inertia(np.linspace(0.0, 2.0, 9))
    off_diagonal = inertia - np.eye(3) * inertia
    assert np.abs(off_diagonal).max() < 1e-11 * np.abs(inertia).max()
    frames = seen.frame([0.0, 2.0])
    first, last = motion.initial_attitude @ frames[0].T, motion.final_attitude @ frames[1].T
    axis = motion.momentum / np.linalg.norm(motion.momentum)
    assert apart(turn(axis, split.montgomery_phase) @ split.closing_tilt, last @ first.T) < 1e-10
    assert split.residual < 1e-10
    base = sp.split(motion, "base")
    np.testing.assert_array_equal(split.total_rotation, base.total_rotation)
    np.testing.assert_array_equal(split.holonomy, base.holonomy)


def test_the_principal_gauge_of_a_symmetric_rigid_body_rests():
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 1.0, 2.0]), 1.0), [0.0, 1.0, 1.0])
    assert abs(sp.split(motion, "principal").montgomery_phase - sp.split(motion, "base").montgomery_phase) < 1e-12


@pytest.mark.parametrize("name", ["cat", "satellite", "example:human"])
@pytest.mark.parametrize("gauge", [sp.horizontal_gauge, sp.principal_gauge])
def test_motions_seen_from_a_gauge_are_the_same_motion(name: str, gauge):
    """B4: R~ = R U^T and Pi~ = U Pi; Delta R is gauge invariant."""
    motion, deformation = some_motion(name), deformation_of(name)
    seen = gauge(deformation)
    times = np.linspace(0.0, 2.0, 17)
    frames = seen.frame(times)
    start = motion.initial_attitude @ frames[0].T
    other = sp.reconstruct(seen, motion.momentum, start, tolerance=1e-10)
    assert apart(other.attitude(times) @ frames, motion.attitude(times)) < 2e-10
    turned = np.einsum("nij,nj->ni", frames, motion.body_momentum(times))
    np.testing.assert_allclose(other.body_momentum(times), turned, rtol=0, atol=2e-10 * BODIES[name])
    assert apart(sp.split(other, "base").total_rotation, sp.split(motion).total_rotation) < 2e-10
    assert apart(sp.split(other).holonomy, sp.split(motion).holonomy) < 2e-10


@pytest.mark.parametrize("name", ["cat", "satellite"])
def test_the_horizontal_gauge_has_no_internal_momentum(name: str):
    seen = sp.horizontal_gauge(deformation_of(name))
    times = np.linspace(0.0, 2.0, 23)
    scale = np.abs(deformation_of(name).internal_momentum(times)).max()
    assert np.abs(seen.internal_momentum(times)).max() < 1e-12 * scale
    body, loop = body_of(name), random_loop(1, body_of(name).n_shape)
    lift = pinocchio_motion(name, body.joint_names, loop, np.zeros(3), None, times).lift
    assert apart(seen.frame(times), lift) < 3e-11
    assert apart(seen.closure, lift[-1]) < 3e-11


def test_another_link_as_base_is_a_gauge():
    """U9: the cat seen from its rear half turns by the same Delta R; the horizontal split is the same throughout."""
    body, loop = body_of("cat"), random_loop(1, body_of("cat").n_shape)
    link = "trunk_rear"

    def from_link(times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        def frames(shifted: np.ndarray) -> np.ndarray:
            shapes = np.array([loop.shape(t) for t in shifted])
            return np.swapaxes(body.link_pose(shapes, link)[:, :3, :3], 1, 2)

        h = 1e-3
        turns = frames(times)
        weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
        slope = sum(w * (frames(times + k * h) - frames(times - k * h)) for k, w in weights.items()) / h
        spin = np.swapaxes(turns, 1, 2) @ slope
        return turns, np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)

    motion = some_motion("cat")
    seen = sp.in_gauge(deformation_of("cat"), from_link)
    start = motion.initial_attitude @ seen.frame(0.0).T
    other = sp.reconstruct(seen, motion.momentum, start, tolerance=1e-9)
    assert apart(other.final_attitude @ seen.frame(2.0), motion.final_attitude) < 1e-9
    split, truth = sp.split(other, "base"), sp.split(motion, "base")
    assert apart(split.total_rotation, truth.total_rotation) < 1e-9
    assert apart(split.holonomy, truth.holonomy) < 1e-9
    # The frame of the link comes back, so what closes and by which angle is the same; how it is made up is not.
    assert abs(wrapped(split.montgomery_phase - truth.montgomery_phase)) < 1e-9
    assert abs(split.dynamic_phase - truth.dynamic_phase) > 1e-2
    assert abs(sp.split(other).dynamic_phase - sp.split(motion).dynamic_phase) < 1e-9
    assert abs(sp.split(other).solid_angle - sp.split(motion).solid_angle) < 1e-9


def test_unknown_gauge():
    with pytest.raises(UnknownNameError, match="base"):
        sp.split(some_motion("cat"), "flat")


# ---- Without momentum, without closure, in batches -----------------------------------------------------------------


@pytest.mark.parametrize("gauge", ["horizontal", "base"])
def test_zero_momentum_has_no_phase(gauge: str):
    """B8: the motion is the horizontal lift."""
    attitude = random_rotation(3)
    motion = sp.reconstruct(deformation_of("cat"), np.zeros(3), attitude)
    split = sp.split(motion, gauge)
    assert not split.has_phase
    assert split.is_loop
    for phase in ("montgomery_phase", "montgomery_angle", "dynamic_phase", "geometric_phase", "solid_angle"):
        assert getattr(split, phase) == 0.0
    assert split.residual == split.momentum_gap == 0.0
    np.testing.assert_array_equal(split.dynamical_rotation, np.eye(3))
    np.testing.assert_array_equal(split.closing_tilt, np.eye(3))
    assert apart(split.holonomy, split.total_rotation) < 1e-9
    assert apart(split.total_rotation, motion.final_attitude @ attitude.T) < 1e-15


@pytest.mark.parametrize("size", [1e-12, 1e-100, 1e-170, 1e-300])
def test_a_momentum_too_small_to_matter_still_has_its_direction(size: float):
    """Squares of such numbers vanish; the motion is that of zero momentum, and the split must hold."""
    direction, attitude = random_vector(1, 1.0), random_rotation(2)
    motion = sp.reconstruct(deformation_of("cat"), size * direction, attitude, tolerance=1e-10)
    still = sp.reconstruct(deformation_of("cat"), np.zeros(3), attitude, tolerance=1e-10)
    assert apart(motion.final_attitude, still.final_attitude) < 1e-9
    for gauge in ("horizontal", "base"):
        split = sp.split(motion, gauge)
        about = (
            turn(direction, split.montgomery_phase) @ split.closing_tilt
            if split.has_phase
            else split.dynamical_rotation
        )
        after = split.holonomy if gauge == "horizontal" or not split.has_phase else np.eye(3)
        assert apart(about @ after, split.total_rotation) < 1e-9


def test_an_open_path_has_a_lift_but_no_loop():
    body = body_of("cat")
    path = sp.ShapePath.waypoints([0.0, 1.0], np.stack([np.zeros(23), 0.4 * np.ones(23)]))
    momentum, attitude = random_vector(1, 0.05), random_rotation(1)
    motion = sp.reconstruct(sp.articulated(body, path), momentum, attitude, tolerance=1e-11)
    assert motion.deformation.closure is None
    split = sp.split(motion)
    assert not split.is_loop
    assert split.shape_gap == pytest.approx(0.4, abs=1e-12)
    truth = pinocchio_motion("cat", body.joint_names, path, momentum, attitude)
    assert apart(split.holonomy, attitude @ truth.lift[-1] @ attitude.T) < 3e-11
    assert apart(split.total_rotation, truth.attitude[-1] @ attitude.T) < 3e-11
    axis = momentum / 0.05
    assert apart(turn(axis, split.montgomery_phase) @ split.closing_tilt @ split.holonomy, split.total_rotation) < 1e-10


def test_particles_that_end_turned_have_a_closure():
    """B9: Delta R = R(T) Delta R_0 R(0)^T for a loop of shapes seen from a frame that turned.

    The particles only turn as one, so they are a rigid body, and the total rotation is the rigid body's.
    """
    random = np.random.default_rng(4)
    masses, points = np.array([1.0, 2.0, 1.5, 0.7]), random.normal(size=(4, 3))
    axis = random_vector(5, 1.0)

    def positions(t):
        turns = np.array([turn(axis, 1.1 * s) for s in t])
        places = np.einsum("nij,mj->nmi", turns, points)
        return places, np.cross(1.1 * axis, places)

    deformation = sp.particles(masses, positions, 1.0)
    assert apart(deformation.closure, turn(axis, 1.1)) < 1e-12
    momentum, attitude = random_vector(6, 3.0), random_rotation(6)
    motion = sp.reconstruct(deformation, momentum, attitude, tolerance=1e-12)
    centred = points - masses @ points / masses.sum()
    inertia = np.einsum("m,mij->ij", masses, np.array([np.dot(r, r) * np.eye(3) - np.outer(r, r) for r in centred]))
    rigid = sp.reconstruct(sp.rigid(inertia, 1.0), momentum, attitude, tolerance=1e-12)
    expected = rigid.final_attitude @ attitude.T
    assert apart(motion.final_attitude @ turn(axis, 1.1), rigid.final_attitude) < 1e-11
    split = sp.split(motion)
    assert apart(split.total_rotation, expected) < 1e-11
    assert apart(split.holonomy, np.eye(3)) < 1e-11
    assert abs(split.montgomery_phase - sp.split(rigid).montgomery_phase) < 1e-10


def test_a_batch_is_split_like_its_members():
    momenta = np.stack([np.zeros(3), random_vector(1, 0.05), random_vector(2, 0.02)])
    attitudes = np.stack([random_rotation(k) for k in range(3)])
    deformation = deformation_of("cat")
    batch = sp.reconstruct(deformation, momenta[:, None], attitudes[None, :], tolerance=1e-11)
    for gauge in ("horizontal", "base"):
        split = sp.split(batch, gauge)
        assert split.total_rotation.shape == (3, 3, 3, 3)
        assert split.montgomery_phase.shape == split.residual.shape == split.has_phase.shape == (3, 3)
        for i, j in np.ndindex(3, 3):
            single = sp.split(sp.reconstruct(deformation, momenta[i], attitudes[j], tolerance=1e-11), gauge)
            assert split.has_phase[i, j] == single.has_phase
            for field in ("total_rotation", "holonomy", "dynamical_rotation", "closing_tilt"):
                assert apart(getattr(split, field)[i, j], getattr(single, field)) < 3e-11
            for field in ("dynamic_phase", "solid_angle", "montgomery_phase", "montgomery_angle", "momentum_gap"):
                assert abs(getattr(split, field)[i, j] - getattr(single, field)) < 3e-11


@pytest.mark.parametrize("name", EVERY_BODY)
def test_the_angle_is_the_phase_in_one_turn(name: str):
    fast = sp.reconstruct(deformation_of(name), random_vector(1, 5.0 * BODIES[name]), tolerance=1e-9)
    for gauge in ("horizontal", "base"):
        split = sp.split(fast, gauge)
        assert -np.pi < split.montgomery_angle <= np.pi
        assert abs(wrapped(split.montgomery_phase - split.montgomery_angle)) < 1e-12
        assert split.montgomery_phase == split.dynamic_phase + split.geometric_phase
        assert split.residual < 1e-9


@pytest.mark.parametrize("name", EVERY_BODY)
def test_the_dynamic_phase_lies_between_those_of_the_extreme_moments(name: str):
    """In the horizontal gauge theta_D = integral of u . I^-1 u: between |mu| T over the largest and least moment."""
    motion = some_motion(name)
    size = np.linalg.norm(motion.momentum)
    moments = np.linalg.eigvalsh(motion.deformation.inertia(np.linspace(0.0, 2.0, 400)))
    phase = sp.split(motion).dynamic_phase
    assert 2.0 * size / moments.max() < phase < 2.0 * size / moments.min()


@pytest.mark.parametrize("gauge", ["horizontal", "base", "principal"])
def test_a_motion_by_dop853_is_split_too(gauge: str):
    momentum, attitude = random_vector(2, 12.0), random_rotation(3)
    ours = sp.reconstruct(deformation_of("satellite"), momentum, attitude, tolerance=1e-10)
    theirs = sp.reconstruct(deformation_of("satellite"), momentum, attitude, tolerance=1e-9, method="dop853")
    first, second = sp.split(ours, gauge), sp.split(theirs, gauge)
    assert apart(first.total_rotation, second.total_rotation) < 1e-9
    assert abs(first.montgomery_phase - second.montgomery_phase) < 2e-9
    assert second.residual < 2e-9
