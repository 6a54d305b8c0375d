"""Phases in time, by arcs, in any gauge and from energies (theory.md D4, D5, D9 to D11, D15; Cabrera 2006, 4.1).

The truth is one integration by SciPy of the raw equations with Pinocchio's values (`truth_of`): the attitude, the lift,
and in every gauge the attitude that rolls along with the momentum, the dynamic phase and the area swept about a
reference, all of it continuous in time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.deformation import link_gauge, mean_body_gauge
from shapephase.errors import AccuracyNotReached, GaugeError, ShapeError, TrajectoryError, UnknownNameError
from shapephase.phases import arc_phases, dynamic_phase_from_energy, parallel_transport, running_phases
from support import independent
from support.independent import (
    BODIES,
    EVERY_BODY,
    FreeFloating,
    apart,
    body_of,
    cross,
    hat,
    random_loop,
    random_rotation,
    random_vector,
    to_base,
    turn,
    wrapped,
)
from support.long_runs import full_but

FULL = pytest.mark.full
UP = np.array([0.0, 0.0, 1.0])
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
LINKS = {"cat": "trunk_rear", "satellite": "arm_link_6", "example:human": "right_hand"}


# ---- The truth -----------------------------------------------------------------------------------------------------


def turning(times, axis=AXIS, speed=1.3, swing=0.8):
    """A gauge that turns about one axis by speed t + swing sin 3t, with its body rates."""
    angle = speed * times + swing * np.sin(3.0 * times)
    rate = speed + 3.0 * swing * np.cos(3.0 * times)
    k = hat(axis)
    turns = np.eye(3) + np.multiply.outer(np.sin(angle), k) + np.multiply.outer(1.0 - np.cos(angle), k @ k)
    return turns, rate[:, None] * axis


@dataclass(frozen=True)
class Truth:
    """At some times: attitude and lift (N, 3, 3), by gauge the frame, what rolls along, theta_D and the swept area."""

    attitude: np.ndarray
    frame: dict[str, np.ndarray]
    rolled: dict[str, np.ndarray]
    dynamic: dict[str, np.ndarray]
    area: dict[str, np.ndarray]


def truth_of(name, loop, momentum, attitude, times, references, given=turning, rtol=1e-13):
    """One integration of all; `references` by gauge ("base", "horizontal", "given"), about which areas are swept."""
    body, gauges = FreeFloating(name, body_of(name).joint_names), list(references)
    size = np.linalg.norm(momentum)
    axis = momentum / size

    def slope(t, y):
        quat, lift = y[:4] / np.linalg.norm(y[:4]), y[4:13].reshape(3, 3)
        by_momentum, by_shape = body.rates(quat, loop.shape(t), loop.rate(t), momentum)
        omega = by_momentum - by_shape
        rates = [quaternion_rate(y[:4], omega), (-lift @ hat(by_shape)).ravel()]
        u = to_base(quat, axis)
        for row, gauge in enumerate(gauges):
            if gauge == "base":
                frame, spin = np.eye(3), np.zeros(3)
            elif gauge == "horizontal":
                frame, spin = lift, -by_shape
            else:
                frame, spin = (part[0] for part in given(np.array([t])))
            v, seen = frame @ u, frame @ (omega - spin)
            along = v @ seen
            reference = references[gauge]
            around = cross(v, seen)
            area = reference @ cross(v, around) / (1.0 + reference @ v)
            rolling = cross(around, v)
            rates += [quaternion_rate(y[13 + 6 * row : 17 + 6 * row], rolling), [along, area]]
        return np.concatenate(rates)

    parts = [Rotation.from_matrix(attitude).as_quat(), np.eye(3).ravel()]
    for gauge in gauges:
        first = given(np.zeros(1))[0][0] if gauge == "given" else np.eye(3)
        parts += [Rotation.from_matrix(attitude @ first.T).as_quat(), [0.0, 0.0]]
    run = solve_ivp(
        slope, (0.0, times[-1]), np.concatenate(parts), "DOP853", t_eval=times, rtol=rtol, atol=1e-14, max_step=0.25
    )
    assert run.success, run.message
    y = run.y.T
    lifts = y[:, 4:13].reshape(-1, 3, 3)
    frames = {"base": np.broadcast_to(np.eye(3), lifts.shape), "horizontal": lifts, "given": given(times)[0]}
    rows = {gauge: y[:, 13 + 6 * row : 19 + 6 * row] for row, gauge in enumerate(gauges)}
    return Truth(
        Rotation.from_quat(y[:, :4]).as_matrix(),
        {gauge: frames[gauge] for gauge in gauges},
        {gauge: Rotation.from_quat(part[:, :4]).as_matrix() for gauge, part in rows.items()},
        {gauge: part[:, 4] for gauge, part in rows.items()},
        {gauge: part[:, 5] for gauge, part in rows.items()},
    )


def quaternion_rate(quat, omega):
    # Pulled back to unit length, so that the integration does not drift off.
    return independent.quaternion_rate(quat, omega) + quat * (1.0 - quat @ quat)


def turns_about(axis, angles):
    return np.array([turn(axis, angle) for angle in np.ravel(angles)])


def unit(vector):
    return vector / np.linalg.norm(vector)


def whole_spheres(difference):
    """How far an area is from a multiple of 4 pi."""
    return np.abs(2.0 * np.angle(np.exp(0.5j * np.asarray(difference))))


@lru_cache(maxsize=16)
def deformation_of(name, loops=1):
    body = body_of(name)
    path = random_loop(1, body.n_shape).path
    return sp.articulated(body, path.repeated(loops) if loops > 1 else path)


@lru_cache(maxsize=16)
def some_motion(name, seed=1, loops=1):
    momentum, attitude = random_vector(seed + 1, BODIES[name]), random_rotation(seed + 2)
    return sp.reconstruct(deformation_of(name, loops), momentum, attitude, tolerance=1e-11)


@lru_cache(maxsize=16)
def steady_orbit(name, gauge="base", loops=20):
    """The motion through many loops of a closed orbit, the one near which errors grow the least."""
    deformation = deformation_of(name)
    seen = deformation if gauge == "base" else sp.horizontal_gauge(deformation)
    orbits = sp.closed_orbits(seen, BODIES[name])
    start = min(orbits, key=lambda motion: float(motion.amplification)).initial_attitude
    return sp.reconstruct(deformation_of(name, loops), BODIES[name] * UP, start, tolerance=1e-10)


def gauge_of(name):
    return turning if name == "given" else name


def frames_of(motion, gauge, times):
    """U(t) by the library's gauges of deformations."""
    if gauge == "base":
        return np.broadcast_to(np.eye(3), (len(times), 3, 3))
    return turning(times)[0] if gauge == "given" else sp.horizontal_gauge(motion.deformation).frame(times)


# ---- Open arcs -----------------------------------------------------------------------------------------------------


QUICK = ("cat", "satellite")


@pytest.mark.parametrize("name", [name if name in QUICK else pytest.param(name, marks=FULL) for name in BODIES])
def test_the_attitude_is_the_dynamic_phase_after_parallel_transport(name):
    """R(t) = exp(theta_D(t) mu^) Par(R(0)) at 50 times, Par with omega_h = Pi' x Pi/|Pi|^2, in three gauges."""
    motion = some_motion(name)
    times = np.sort(np.random.default_rng(5).uniform(0.0, 2.0, 50))
    times[[0, -1]] = 0.0, 2.0
    axis = unit(motion.momentum)
    running = {gauge: running_phases(motion, times, gauge_of(gauge)) for gauge in ("base", "horizontal", "given")}
    references = {gauge: phases.reference for gauge, phases in running.items()}
    loop = random_loop(1, body_of(name).n_shape)
    truth = truth_of(name, loop, motion.momentum, motion.initial_attitude, times, references)
    for gauge, phases in running.items():
        seen = motion.attitude(times) @ np.swapaxes(truth.frame[gauge], 1, 2)
        rolled = parallel_transport(motion, times, gauge_of(gauge))
        assert apart(rolled, truth.rolled[gauge]) < 1e-10
        assert apart(turns_about(axis, phases.dynamic_phase) @ truth.rolled[gauge], seen) < 1e-10
        assert apart(turns_about(axis, truth.dynamic[gauge]) @ rolled, seen) < 1e-10
        # What rolls along carries the momentum along too.
        np.testing.assert_allclose(
            np.einsum("nji,j->ni", rolled, axis), np.einsum("nji,j->ni", seen, axis), rtol=0, atol=1e-10
        )
        np.testing.assert_allclose(phases.dynamic_phase, truth.dynamic[gauge], rtol=0, atol=1e-10)
        np.testing.assert_allclose(phases.solid_angle, truth.area[gauge], rtol=0, atol=1e-10)
        np.testing.assert_allclose(
            phases.montgomery_phase, truth.dynamic[gauge] - truth.area[gauge], rtol=0, atol=1e-10
        )
        np.testing.assert_array_equal(phases.geometric_phase, -phases.solid_angle)
        np.testing.assert_array_equal(phases.montgomery_phase, phases.dynamic_phase - phases.solid_angle)
        assert np.abs(wrapped(phases.montgomery_angle - phases.montgomery_phase)).max() < 1e-13
        assert phases.residual < 1e-12
        assert phases.gauge == gauge
        assert phases.montgomery_phase[0] == 0.0


def test_the_reference_is_far_from_the_point_opposite_the_curve():
    for name in ("cat", "example:human"):
        motion = some_motion(name)
        directions = motion.body_momentum(np.linspace(0.0, 2.0, 500)) / BODIES[name]
        reference = running_phases(motion, [0.0, 1.0], "base", closing="reference").reference
        tries = Rotation.random(2000, rng=np.random.default_rng(1)).as_matrix()[:, 0]
        best = np.arccos(np.max(-directions @ tries.T, axis=0)).max()
        assert np.linalg.norm(reference) == pytest.approx(1.0, abs=1e-14)
        assert np.arccos(np.max(-directions @ reference)) > best - 0.15


# ---- Arcs ----------------------------------------------------------------------------------------------------------


def check_arcs(motion, arcs, gauge, tolerance=1e-10):
    """Each arc turns the gauge's frame by its phase and tilt, and all together by theirs."""
    axis = unit(motion.momentum)
    attitudes = motion.attitude(arcs.times) @ np.swapaxes(frames_of(motion, gauge, arcs.times), 1, 2)
    for k, (first, last) in enumerate(pairwise(attitudes)):
        assert apart(turn(axis, arcs.montgomery_phase[k]) @ arcs.closing_tilt[k], last @ first.T) < tolerance
        vector = Rotation.from_matrix(arcs.closing_tilt[k]).as_rotvec()
        assert abs(vector @ axis) < 1e-12
        assert abs(np.linalg.norm(vector) - arcs.momentum_gap[k]) < 1e-12
        here, there = first.T @ axis, last.T @ axis
        assert abs(arcs.momentum_gap[k] - np.arctan2(np.linalg.norm(np.cross(here, there)), here @ there)) < tolerance
    total = attitudes[-1] @ attitudes[0].T
    assert apart(turn(axis, float(arcs.total_phase)) @ arcs.total_closing_tilt, total) < tolerance
    np.testing.assert_array_equal(arcs.montgomery_phase, arcs.dynamic_phase - arcs.solid_angle)
    np.testing.assert_array_equal(arcs.geometric_phase, -arcs.solid_angle)


@pytest.mark.parametrize("name", ["cat", "satellite", "example:human"])
@pytest.mark.parametrize("gauge", ["base", "horizontal", "given"])
def test_random_arcs_add_up_to_the_whole(name, gauge):
    motion = some_motion(name)
    asked = gauge_of(gauge)
    whole = sp.split(motion, asked)
    random = np.random.default_rng(11)
    one = arc_phases(motion, [0.0, 2.0], asked)
    # With nothing but the integrator's own steps even the region is the same.
    assert one.total_phase == pytest.approx(whole.montgomery_phase, abs=1e-12)
    assert one.montgomery_phase[0] == one.total_phase
    assert one.polygon_angle == 0.0
    assert apart(one.closing_tilt[0], whole.closing_tilt) < 1e-14
    check_arcs(motion, one, gauge)
    for count in (1, 2, 5, 17):
        cuts = np.concatenate([[0.0], np.sort(random.uniform(0.0, 2.0, count)), [2.0]])
        arcs = arc_phases(motion, cuts, asked)
        assert arcs.dynamic_phase.shape == (count + 1,)
        check_arcs(motion, arcs, gauge)
        assert arcs.dynamic_phase.sum() == pytest.approx(whole.dynamic_phase, abs=1e-12)
        assert arcs.total_phase == pytest.approx(arcs.montgomery_phase.sum() - arcs.polygon_angle, abs=1e-12)
        assert arcs.total_phase == pytest.approx(whole.montgomery_phase, abs=1e-11)
        assert apart(arcs.total_closing_tilt, whole.closing_tilt) < 1e-12


@pytest.mark.parametrize("gauge", ["base", "horizontal"])
def test_the_polygon_of_the_closing_circles_by_hand(gauge):
    """The closed polygon through the ends of the arcs: a fan of spherical triangles by Eriksson's formula."""
    motion = some_motion("cat")
    cuts = np.linspace(0.0, 2.0, 12)
    arcs = arc_phases(motion, cuts, gauge)
    frames = frames_of(motion, gauge, cuts)
    corners = np.einsum("nij,nj->ni", frames, motion.body_momentum(cuts)) / BODIES["cat"]
    point = unit(corners.mean(axis=0))
    a, b = corners, np.roll(corners, -1, axis=0)
    excess = np.cross(a, b) @ point / (1.0 + np.sum(a * b, axis=1) + a @ point + b @ point)
    assert whole_spheres(arcs.polygon_angle - np.sum(2.0 * np.arctan(excess))) < 1e-10
    assert abs(arcs.polygon_angle) > 1e-3


def test_part_of_a_motion():
    """Arcs need not begin at 0 nor end at the end; an arc is the motion of its own time."""
    motion = some_motion("cat")
    cuts = np.array([0.31, 0.9, 1.7])
    arcs = arc_phases(motion, cuts, "base")
    check_arcs(motion, arcs, "base")
    whole = arc_phases(motion, [0.31, 1.7], "base")
    assert whole_spheres(whole.total_phase - arcs.total_phase) < 1e-11
    assert apart(whole.total_closing_tilt, arcs.total_closing_tilt) < 1e-12
    running = running_phases(motion, cuts, "base")
    np.testing.assert_allclose(np.diff(running.dynamic_phase), arcs.dynamic_phase, rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", ["satellite", pytest.param("example:human", marks=FULL)])
def test_each_loop_of_a_closed_orbit_has_the_same_phase(name):
    """D10: the phases of loops add up, and there is nothing between them."""
    motion = steady_orbit(name)
    periods = 2.0 * np.arange(21)
    arcs = arc_phases(motion, periods, "base")
    once = sp.split(sp.reconstruct(deformation_of(name), motion.momentum, motion.initial_attitude), "base")
    assert np.abs(arcs.montgomery_phase - arcs.montgomery_phase[0]).max() < 1e-9
    assert whole_spheres(arcs.montgomery_phase[0] - once.montgomery_phase) < 1e-8
    assert arcs.momentum_gap.max() < 1e-9
    assert apart(arcs.closing_tilt, np.eye(3)) < 1e-9
    assert abs(arcs.polygon_angle) < 1e-9
    assert abs(arcs.total_phase - 20.0 * arcs.montgomery_phase[0]) < 1e-8
    # Seen from the lift, each loop of the curve is the one before, turned by the holonomy.
    lifted = arc_phases(motion, periods)
    assert whole_spheres(lifted.montgomery_phase - lifted.montgomery_phase[0]).max() < 1e-8
    assert np.ptp(lifted.momentum_gap) < 1e-9
    check_arcs(motion, lifted, "horizontal", 1e-9)


ROUND = sp.rigid(2.0 * np.eye(3), 1.0)


def great_circle(times, angle=np.pi, wiggle=0.0):
    """U(t) about z by `angle` t, then about x by a wiggle that vanishes at both ends."""
    about, spin = turning(times, UP, angle, 0.0)
    swings, rates = wiggle * np.sin(np.pi * times) ** 2, wiggle * np.pi * np.sin(2.0 * np.pi * times)
    across = np.array([1.0, 0.0, 0.0])
    k = hat(across)
    tipped = np.eye(3) + np.multiply.outer(np.sin(swings), k) + np.multiply.outer(1.0 - np.cos(swings), k @ k)
    return tipped @ about, spin + np.einsum("nji,j->ni", about, across) * rates[:, None]


@pytest.mark.parametrize("off", [0.0, 1e-15, 1e-10, 1e-8, -1e-8, 1e-5, -1e-3])
@pytest.mark.parametrize("wiggle", [0.0, 0.7])
def test_arcs_with_opposite_or_nearly_opposite_ends(off, wiggle):
    """A round body whose momentum the gauge carries half round.

    Hardly off opposite, the direction of the closing great circle is known to rounding over the distance only.
    """
    near = 1e-11
    motion = sp.reconstruct(ROUND, [0.6, 0.8, 0.0], tolerance=1e-12)
    gauge = partial(great_circle, angle=np.pi + off, wiggle=wiggle)
    arcs = arc_phases(motion, [0.0, 0.5, 1.0], gauge)
    ends = gauge(np.array([0.0, 0.5, 1.0]))[0]
    attitudes = motion.attitude([0.0, 0.5, 1.0]) @ np.swapaxes(ends, 1, 2)
    axis = np.array([0.6, 0.8, 0.0])
    for k in range(2):
        total = attitudes[k + 1] @ attitudes[k].T
        assert apart(turn(axis, arcs.montgomery_phase[k]) @ arcs.closing_tilt[k], total) < 1e-11
    assert np.all(arcs.momentum_gap < 2.0)
    total = attitudes[2] @ attitudes[0].T
    assert apart(turn(axis, float(arcs.total_phase)) @ arcs.total_closing_tilt, total) < near
    split = sp.split(motion, gauge)
    assert split.momentum_gap == pytest.approx(np.pi - abs(off), abs=1e-12)
    assert apart(turn(axis, float(split.montgomery_phase)) @ split.closing_tilt, total) < near
    assert whole_spheres(split.montgomery_phase - arcs.total_phase) < 1e-11
    assert split.residual < 1e-12


@pytest.mark.parametrize("times", [[0.0], [], [0.0, 1.0, 1.0], [1.0, 0.5], [[0.0, 1.0]], [0.0, np.nan]])
def test_arcs_need_times_that_increase(times):
    with pytest.raises(ShapeError):
        arc_phases(some_motion("cat"), times)


def test_arcs_outside_the_motion():
    with pytest.raises(TrajectoryError, match="outside"):
        arc_phases(some_motion("cat"), [0.0, 2.1])


# ---- A continuous phase --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "loops"),
    [("satellite", 3), pytest.param("cat", 20, marks=FULL), pytest.param("satellite", 20, marks=FULL)],
)
def test_phases_of_momenta_that_do_not_close(name, loops):
    """Not only modulo 2 pi: the integrals along the curve, by an independent integration, at 60 times."""
    momentum, attitude = random_vector(8, BODIES[name]), random_rotation(8)
    motion = sp.reconstruct(deformation_of(name, loops), momentum, attitude, tolerance=1e-11)
    times = np.linspace(0.0, 2.0 * loops, 61)
    running = {gauge: running_phases(motion, times, gauge_of(gauge)) for gauge in ("base", "horizontal", "given")}
    references = {gauge: phases.reference for gauge, phases in running.items()}
    loop = random_loop(1, body_of(name).n_shape)
    truth = truth_of(name, loop, momentum, attitude, times, references)
    assert apart(motion.attitude(times), truth.attitude) < 1e-9
    for gauge, phases in running.items():
        np.testing.assert_allclose(phases.dynamic_phase, truth.dynamic[gauge], rtol=0, atol=1e-9)
        np.testing.assert_allclose(phases.solid_angle, truth.area[gauge], rtol=0, atol=1e-9)
        assert phases.residual < 1e-11


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("turns", [1, 8])
def test_a_curve_that_passes_close_to_the_point_opposite_its_start(off, turns):
    """The momentum of a round body goes about z as seen from the gauge, on a parallel just off the equator.

    About the pole z the area is (1 - cos) times the angle; about the reference it differs by a function of the place.
    """
    height = np.sin(off)
    momentum = 2.0 * np.array([np.cos(off), 0.0, height])
    motion = sp.reconstruct(ROUND, momentum, tolerance=1e-12)
    gauge = partial(great_circle, angle=2.0 * np.pi * turns)
    times = np.linspace(0.0, 1.0, 400 * turns + 1)
    phases = running_phases(motion, times, gauge, closing="reference")
    whole = phases.solid_angle[::400]
    pole = UP if phases.reference[2] > 0.0 else -UP
    one = 2.0 * np.pi * (1.0 - height) if pole[2] > 0.0 else -2.0 * np.pi * (1.0 + height)
    np.testing.assert_allclose(whole, one * np.arange(turns + 1), rtol=0, atol=1e-11)
    # The body turns by |mu|/I = 1 rad about the momentum, and the gauge the other way, seen along the momentum.
    np.testing.assert_allclose(phases.dynamic_phase, times * (1.0 - 2.0 * np.pi * turns * height), rtol=0, atol=1e-11)
    n = phases.reference
    v = np.stack(
        [
            np.cos(off) * np.cos(2 * np.pi * turns * times),
            np.cos(off) * np.sin(2 * np.pi * turns * times),
            0.0 * times + height,
        ],
        axis=-1,
    )
    speed = 2.0 * np.pi * turns * np.cross(UP, v)
    rate = np.cross(v, speed) @ n / (1.0 + v @ n)
    assert np.abs(np.diff(phases.solid_angle)).max() < 1.1 * np.abs(rate).max() * times[1]
    np.testing.assert_allclose(np.gradient(phases.solid_angle, times)[1:-1], rate[1:-1], rtol=0, atol=2e-2 * turns)
    assert phases.residual < 1e-12


@pytest.mark.parametrize("gauge", ["base", "horizontal", "given"])
def test_times_of_any_shape(gauge):
    motion = some_motion("satellite")
    asked = gauge_of(gauge)
    times = np.linspace(0.0, 2.0, 12)
    line = running_phases(motion, times, asked)
    table = running_phases(motion, times.reshape(3, 4), asked)
    fields = ("dynamic_phase", "geometric_phase", "montgomery_phase", "montgomery_angle", "solid_angle")
    for field in fields:
        np.testing.assert_allclose(getattr(table, field), getattr(line, field).reshape(3, 4), rtol=0, atol=1e-12)
        for place in (0, 5, -1):
            alone = getattr(running_phases(motion, times[place], asked), field)
            assert np.ndim(alone) == 0
            assert alone == pytest.approx(getattr(line, field)[place], abs=1e-11)
    shuffled = np.random.default_rng(3).permutation(12)
    mixed = running_phases(motion, times[shuffled], asked)
    np.testing.assert_allclose(mixed.montgomery_phase, line.montgomery_phase[shuffled], rtol=0, atol=1e-12)
    assert table.times.shape == (3, 4)
    assert np.ndim(table.residual) == 0
    assert running_phases(motion, [], asked).dynamic_phase.shape == (0,)
    assert parallel_transport(motion, times.reshape(3, 4), asked).shape == (3, 4, 3, 3)
    first = parallel_transport(motion, 0.0, asked)
    assert apart(first, motion.initial_attitude @ frames_of(motion, gauge, np.zeros(1))[0].T) < 1e-14
    with pytest.raises(TrajectoryError, match="outside"):
        running_phases(motion, 2.001, asked)


@pytest.mark.parametrize("gauge", ["base", "horizontal", "principal", "mean_body", "link:wheel", "given"])
def test_without_momentum_there_is_no_phase(gauge):
    motion = sp.reconstruct(deformation_of("satellite"), np.zeros(3), random_rotation(3), tolerance=1e-10)
    asked = gauge_of(gauge)
    times = np.linspace(0.0, 2.0, 9)
    running, arcs = running_phases(motion, times, asked), arc_phases(motion, times, asked)
    for field in ("dynamic_phase", "geometric_phase", "montgomery_phase", "montgomery_angle", "solid_angle"):
        np.testing.assert_array_equal(getattr(running, field), np.zeros(9))
    for field in ("dynamic_phase", "geometric_phase", "montgomery_phase", "solid_angle", "momentum_gap"):
        np.testing.assert_array_equal(getattr(arcs, field), np.zeros(8))
    np.testing.assert_array_equal(arcs.closing_tilt, np.broadcast_to(np.eye(3), (8, 3, 3)))
    np.testing.assert_array_equal(arcs.total_closing_tilt, np.eye(3))
    assert arcs.total_phase == arcs.polygon_angle == running.residual == 0.0
    assert np.isfinite(running.reference).all()
    rolled = parallel_transport(motion, times, asked)
    if gauge in ("base", "horizontal", "given"):
        seen = motion.attitude(times) @ np.swapaxes(frames_of(motion, gauge, times), 1, 2)
        assert apart(rolled, seen) < 1e-10
    split = sp.split(motion, asked)
    assert split.montgomery_phase == split.residual == 0.0
    assert dynamic_phase_from_energy(motion) == 0.0


@pytest.mark.parametrize("gauge", full_but(["base", "horizontal", "given"], "given"))
def test_batches_are_their_members(gauge):
    momenta = np.stack([np.zeros(3), random_vector(1, 12.0), random_vector(2, 3.0)])
    attitudes = np.stack([random_rotation(k) for k in range(2)])
    deformation, asked = deformation_of("satellite"), gauge_of(gauge)
    batch = sp.reconstruct(deformation, momenta[:, None], attitudes[None], tolerance=1e-11)
    times = np.array([[0.0, 0.4, 0.9], [1.3, 1.8, 2.0]])
    cuts = np.array([0.0, 0.7, 2.0])
    running, arcs = running_phases(batch, times, asked), arc_phases(batch, cuts, asked)
    rolled = parallel_transport(batch, times, asked)
    assert running.montgomery_phase.shape == (3, 2, 2, 3)
    assert running.reference.shape == (3, 2, 3)
    assert running.residual.shape == arcs.total_phase.shape == arcs.polygon_angle.shape == (3, 2)
    assert arcs.montgomery_phase.shape == arcs.momentum_gap.shape == (3, 2, 2)
    assert arcs.closing_tilt.shape == (3, 2, 2, 3, 3)
    assert arcs.total_closing_tilt.shape == (3, 2, 3, 3)
    assert rolled.shape == (3, 2, 2, 3, 3, 3)
    assert dynamic_phase_from_energy(batch).shape == (3, 2)
    for i, j in np.ndindex(3, 2):
        one = sp.reconstruct(deformation, momenta[i], attitudes[j], tolerance=1e-11)
        alone, cut = running_phases(one, times, asked), arc_phases(one, cuts, asked)
        np.testing.assert_allclose(running.dynamic_phase[i, j], alone.dynamic_phase, rtol=0, atol=3e-11)
        if i:
            np.testing.assert_array_equal(running.reference[i, j], alone.reference)
        np.testing.assert_allclose(running.solid_angle[i, j], alone.solid_angle, rtol=0, atol=3e-11)
        np.testing.assert_allclose(arcs.montgomery_phase[i, j], cut.montgomery_phase, rtol=0, atol=3e-11)
        assert abs(arcs.total_phase[i, j] - cut.total_phase) < 3e-11
        assert apart(arcs.closing_tilt[i, j], cut.closing_tilt) < 3e-11
        assert apart(arcs.total_closing_tilt[i, j], cut.total_closing_tilt) < 3e-11
        assert apart(rolled[i, j], parallel_transport(one, times, asked)) < 3e-11
        assert dynamic_phase_from_energy(batch)[i, j] == pytest.approx(dynamic_phase_from_energy(one), abs=3e-11)


# ---- The end of the running phase, and the rigid body --------------------------------------------------------------


def rigid_start(moments, size, a):
    """Where Pi_2 = 0 on the curve with |Pi|^2 = 2 a h (theory.md section 6)."""
    first, _, third = moments
    x = np.sqrt(1.0 - (first - a) * third / ((first - third) * a))
    return size * np.array([x, 0.0, np.sqrt(1.0 - x**2)])


@pytest.mark.parametrize(
    ("moments", "size", "a", "period", "phase"),
    [
        ((3.0, 2.0, 1.0), 1.7, 1.3, 8.305738787261774, 5.99603257834978),
        ((3.0, 2.5, 1.2), 1.0, 1.25, 14.010844764544798, 5.154654852944097),
    ],
)
@pytest.mark.parametrize("gauge", ["base", "horizontal", "principal"])
def test_rigid_phase_at_one_two_and_three_periods(moments, size, a, period, phase, gauge):
    """D12: Montgomery's formula in closed form, theory.md section 6, and the running phase passes through it."""
    body = rigid_start(moments, size, a)
    attitude = random_rotation(5)
    motion = sp.reconstruct(sp.rigid(np.diag(moments), 3.0 * period), attitude @ body, attitude, tolerance=1e-12)
    times = np.linspace(0.0, 3.0 * period, 301)
    running = running_phases(motion, times, gauge)
    at_periods = running.montgomery_phase[::100]
    energy = 0.5 * np.sum(body**2 / moments)
    np.testing.assert_allclose(running.dynamic_phase, 2.0 * energy * times / size, rtol=0, atol=1e-10)
    np.testing.assert_allclose(at_periods, np.arange(4) * at_periods[1], rtol=0, atol=1e-10)
    assert abs(wrapped(at_periods[1] - phase)) < 2e-11
    # The curve lies about the axis of the least moment, and is counted from there.
    area = 2.0 * energy * period / size - at_periods[1]
    assert abs(area) < 2.0 * np.pi
    if a == 1.3:
        assert area == pytest.approx(-1.4178671637255, abs=1e-10)
    assert running.residual < 1e-12
    arcs = arc_phases(motion, period * np.arange(4), gauge)
    np.testing.assert_allclose(arcs.montgomery_phase, at_periods[1], rtol=0, atol=1e-10)
    assert sp.split(motion, gauge).montgomery_phase == pytest.approx(at_periods[3], abs=1e-10)
    direct = Rotation.from_matrix(motion.final_attitude @ attitude.T).as_rotvec() @ unit(attitude @ body)
    assert abs(wrapped(at_periods[3] - direct)) < 1e-10


@pytest.mark.parametrize("name", ["satellite", pytest.param("example:human", marks=FULL)])
def test_the_running_phase_ends_as_the_split(name):
    """Where the momentum closes both are the phase of one closed curve, counted from one region."""
    motion = steady_orbit(name, loops=1)
    for count in (2, 50, 400):
        running = running_phases(motion, np.linspace(0.0, 2.0, count), "base")
        split = sp.split(motion, "base")
        assert split.momentum_gap < 1e-9
        assert running.dynamic_phase[-1] == pytest.approx(split.dynamic_phase, abs=1e-11)
        assert abs(wrapped(running.montgomery_phase[-1] - split.montgomery_phase)) < 1e-9
        assert whole_spheres(running.montgomery_phase[-1] - split.montgomery_phase) < 1e-9
        assert running.residual < 1e-11


# ---- Gauges --------------------------------------------------------------------------------------------------------


def seen_from(motion, gauge, tolerance=1e-11):
    """The same motion reconstructed anew from a gauge."""
    if gauge == "mean_body":
        deformation = mean_body_gauge(motion.deformation)
    elif isinstance(gauge, str):
        deformation = link_gauge(motion.deformation, gauge.removeprefix("link:"))
    else:
        deformation = sp.in_gauge(motion.deformation, gauge)
    start = motion.initial_attitude @ deformation.frame(0.0).T
    return sp.reconstruct(deformation, motion.momentum, start, tolerance=tolerance)


def check_split(motion, gauge, near=1e-10):
    """The split in a gauge is that of the motion reconstructed in it, whose frame it turns."""
    split, other = sp.split(motion, gauge), seen_from(motion, gauge, 0.1 * near)
    again = sp.split(other, "base")
    axis = unit(motion.momentum)
    total = other.final_attitude @ other.initial_attitude.T
    assert apart(turn(axis, float(split.montgomery_phase)) @ split.closing_tilt, total) < near
    assert split.dynamic_phase == pytest.approx(again.dynamic_phase, abs=near)
    assert whole_spheres(split.solid_angle - again.solid_angle) < near
    assert split.momentum_gap == pytest.approx(again.momentum_gap, abs=near)
    assert apart(split.closing_tilt, again.closing_tilt) < near
    assert split.residual < near
    truth = sp.split(motion, "base")
    for field in ("total_rotation", "holonomy", "dynamical_rotation"):
        np.testing.assert_array_equal(getattr(split, field), getattr(truth, field))
        assert apart(getattr(again, field), getattr(truth, field)) < near
    running = running_phases(motion, np.linspace(0.0, 2.0, 21), gauge)
    rebuilt = running_phases(other, np.linspace(0.0, 2.0, 21), "base")
    np.testing.assert_allclose(running.dynamic_phase, rebuilt.dynamic_phase, rtol=0, atol=near)
    assert running.residual < near
    return split


@pytest.mark.parametrize("name", ["cat", "satellite", pytest.param("example:human", marks=FULL)])
@pytest.mark.parametrize("gauge", ["mean_body", "link"])
def test_frames_of_the_body(name, gauge):
    """They come back with the shape: what the frame turns is then the total rotation, but the phase is another."""
    motion = some_motion(name)
    asked = f"link:{LINKS[name]}" if gauge == "link" else gauge
    split, base = check_split(motion, asked), sp.split(motion, "base")
    assert split.gauge == asked
    first, last = seen_from(motion, asked).deformation.frame([0.0, 2.0])
    assert apart(first, last) < 1e-10
    axis = unit(motion.momentum)
    assert apart(turn(axis, float(split.montgomery_phase)) @ split.closing_tilt, split.total_rotation) < 1e-10
    assert abs(split.dynamic_phase - base.dynamic_phase) > 1e-3


@pytest.mark.parametrize("name", ["cat", "satellite"])
def test_a_function_as_gauge(name):
    split = check_split(some_motion(name), turning)
    assert split.gauge == "given"
    without_rates = sp.split(some_motion(name), lambda times: turning(times)[0])
    assert without_rates.montgomery_phase == pytest.approx(split.montgomery_phase, abs=1e-9)
    assert without_rates.residual < 1e-9


@pytest.mark.parametrize(("speed", "near"), full_but([(40.0, 1e-10), (-40.0, 1e-10), (300.0, 2e-9)], (-40.0, 1e-10)))
def test_fast_gauges_are_resolved(speed, near):
    """The gauge's frame turns twelve times or more while the integrator takes a step or two."""
    fast = partial(turning, speed=speed, swing=0.3)
    motion = some_motion("satellite")
    split = check_split(motion, fast, near)
    times = np.linspace(0.0, 2.0, 50)
    phases = running_phases(motion, times, fast)
    truth = truth_of(
        "satellite",
        random_loop(1, body_of("satellite").n_shape),
        motion.momentum,
        motion.initial_attitude,
        times,
        {"given": phases.reference},
        fast,
    )
    np.testing.assert_allclose(phases.dynamic_phase, truth.dynamic["given"], rtol=0, atol=near)
    np.testing.assert_allclose(phases.solid_angle, truth.area["given"], rtol=0, atol=near)
    assert abs(split.dynamic_phase) > 0.1 * abs(speed)


@FULL
def test_a_gauge_that_trembles_too_fast_is_refused():
    def trembling(times):
        turns, rates = turning(times, UP, 1.0, 0.0)
        return turns, rates + 1e-4 * np.cos(1e7 * times)[:, None] * UP

    with pytest.raises(AccuracyNotReached, match="gauge"):
        sp.split(sp.reconstruct(ROUND, [1.0, 0.0, 1.0]), trembling)


@pytest.mark.parametrize("name", ["flat", "", "Base", "link", "horizontal "])
def test_unknown_gauges_are_answered_with_the_valid_ones(name):
    motion = some_motion("cat")
    for function in (sp.split, partial(running_phases, t=0.0), partial(arc_phases, times=[0.0, 1.0])):
        with pytest.raises(UnknownNameError, match="mean_body"):
            function(motion, gauge=name)
    with pytest.raises(UnknownNameError, match="trunk_rear"):
        parallel_transport(motion, 0.0, "link:trunk_reer")


def test_gauges_that_do_not_exist():
    rigid = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.0, 1.0, 1.0])
    with pytest.raises(GaugeError, match="link"):
        sp.split(rigid, "link:head")
    known = sp.prescribed(lambda t: np.broadcast_to(np.diag([1.0, 2.0, 3.0]), (len(t), 3, 3)), None, 1.0)
    blind = sp.reconstruct(known, [0.0, 1.0, 1.0])
    with pytest.raises(GaugeError, match="mean"):
        running_phases(blind, 0.5, "mean_body")
    with pytest.raises(ShapeError, match="function"):
        sp.split(rigid, 3.0)  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="body"):
        sp.split(rigid, lambda times: (turning(times)[0], 2.0 * turning(times)[1]))


@pytest.mark.parametrize("name", ["cat", "satellite", pytest.param("example:human", marks=FULL)])
def test_ten_random_gauges(name):
    """D: the total rotation, the holonomy and the dynamical rotation belong to the motion; theta_M to the gauge."""
    motion = some_motion(name)
    axis = unit(motion.momentum)
    base = sp.split(motion, "base")
    phases = []
    for seed in range(10):
        random = np.random.default_rng(seed)
        speed, swing = random.normal(size=2)
        gauge = partial(turning, axis=unit(random.normal(size=3)), speed=speed, swing=swing)
        split = sp.split(motion, gauge)
        for field in ("total_rotation", "holonomy", "dynamical_rotation"):
            np.testing.assert_array_equal(getattr(split, field), getattr(base, field))
        assert apart(split.dynamical_rotation @ split.holonomy, split.total_rotation) < 1e-12
        first, last = gauge(np.array([0.0, 2.0]))[0]
        turned = motion.final_attitude @ last.T @ first @ motion.initial_attitude.T
        assert apart(turn(axis, float(split.montgomery_phase)) @ split.closing_tilt, turned) < 1e-10
        assert split.residual < 1e-12
        phases.append(split.montgomery_angle)
        if seed < 3:
            again = sp.split(seen_from(motion, gauge))
            for field in ("total_rotation", "holonomy", "dynamical_rotation"):
                assert apart(getattr(again, field), getattr(base, field)) < 1e-10
            # From every gauge the lift is the same up to where it starts.
            assert again.montgomery_phase == pytest.approx(sp.split(motion).montgomery_phase, abs=1e-10)
    assert np.diff(np.sort(phases)).min() > 1e-6


# ---- The dynamic phase from energies -------------------------------------------------------------------------------


@pytest.mark.parametrize("name", EVERY_BODY)
def test_the_dynamic_phase_of_links_in_motion(name):
    """D11 (Cabrera 2006, remark 3.7), summed over the links."""
    motion = some_motion(name)
    assert dynamic_phase_from_energy(motion) == pytest.approx(float(motion.dynamic_phase(2.0)), rel=1e-12)


@pytest.mark.parametrize("gauge", ["horizontal", "mean_body", "link", "given"])
def test_the_energies_in_a_gauge_give_the_phase_of_that_gauge(gauge):
    motion = some_motion("satellite")
    if gauge == "horizontal":
        seen = sp.horizontal_gauge(motion.deformation)
        other = sp.reconstruct(seen, motion.momentum, motion.initial_attitude, tolerance=1e-11)
    else:
        other = seen_from(motion, {"given": turning, "link": "link:arm_link_6"}.get(gauge, gauge))
    found = dynamic_phase_from_energy(other)
    assert found == pytest.approx(float(other.dynamic_phase(2.0)), rel=1e-12)
    asked = {"given": turning, "link": "link:arm_link_6"}.get(gauge, gauge)
    assert found == pytest.approx(float(sp.split(motion, asked).dynamic_phase), abs=1e-10)


def test_the_energies_of_particles():
    random = np.random.default_rng(4)
    places, swings = random.normal(size=(2, 5, 3))

    def positions(t):
        wave, slope = np.sin(2.0 * np.pi * t), 2.0 * np.pi * np.cos(2.0 * np.pi * t)
        moved = places + 0.4 * np.multiply.outer(wave, swings)
        moved[:, 0, 1] += 0.3 * np.cos(4.0 * np.pi * t)
        speeds = 0.4 * np.multiply.outer(slope, swings)
        speeds[:, 0, 1] -= 0.3 * 4.0 * np.pi * np.sin(4.0 * np.pi * t)
        return moved, speeds

    deformation = sp.particles(random.uniform(0.5, 2.0, 5), positions, 1.0)
    motion = sp.reconstruct(deformation, random_vector(1, 9.0), random_rotation(1), tolerance=1e-11)
    assert dynamic_phase_from_energy(motion) == pytest.approx(float(motion.dynamic_phase(1.0)), rel=1e-12)
    seen = seen_from(motion, turning)
    assert dynamic_phase_from_energy(seen) == pytest.approx(float(seen.dynamic_phase(1.0)), rel=1e-12)


def test_the_energy_of_a_rigid_body():
    """2 T t/|mu|, T constant; and the kinetic energy of a turning frame is known there, too."""
    moments, momentum = np.array([3.0, 2.0, 1.0]), np.array([0.3, -1.1, 0.7])
    motion = sp.reconstruct(sp.rigid(np.diag(moments), 5.0), momentum, tolerance=1e-12)
    energy = 0.5 * np.sum(momentum**2 / moments)
    truth = 2.0 * energy * 5.0 / np.linalg.norm(momentum)
    assert dynamic_phase_from_energy(motion) == pytest.approx(truth, rel=1e-12)
    assert float(motion.dynamic_phase(5.0)) == pytest.approx(truth, rel=1e-12)


def test_energies_of_a_file(tmp_path):
    """A motion read back has lost its masses, and keeps its phases."""
    motion = some_motion("satellite")
    motion.save(tmp_path / "motion.npz")
    read = sp.load_motion(tmp_path / "motion.npz")
    with pytest.raises(GaugeError, match="inertia"):
        dynamic_phase_from_energy(read)
    times = np.linspace(0.0, 2.0, 5)
    for gauge in ("base", "horizontal", "given"):
        ours, theirs = (running_phases(one, times, gauge_of(gauge)) for one in (motion, read))
        np.testing.assert_allclose(theirs.montgomery_phase, ours.montgomery_phase, rtol=0, atol=1e-10)


def test_other_methods_have_running_phases_too():
    momentum, attitude = random_vector(2, 12.0), random_rotation(3)
    motion = sp.reconstruct(deformation_of("satellite"), momentum, attitude, tolerance=1e-9, method="dop853")
    best = some_motion("satellite")
    np.testing.assert_allclose(best.momentum, momentum, rtol=0, atol=0)
    times = np.linspace(0.0, 2.0, 11)
    for gauge in ("base", "horizontal", "given"):
        phases, truth = (running_phases(one, times, gauge_of(gauge)) for one in (motion, best))
        np.testing.assert_allclose(phases.dynamic_phase, truth.dynamic_phase, rtol=0, atol=3e-9)
        assert phases.residual < 3e-9
