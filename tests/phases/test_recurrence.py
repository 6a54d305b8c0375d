"""Returns and self-crossings of the momentum curve: closed forms, constructed curves, and a brute-force search."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.spatial import cKDTree

import shapephase as sp
from shapephase.errors import AccuracyNotReached, ShapeError
from shapephase.phases import Crossings, momentum_crossings, momentum_returns
from support.independent import (
    BODIES,
    EVERY_BODY,
    body_of,
    pinocchio_motion,
    random_loop,
    random_rotation,
    random_vector,
    wrapped,
)
from support.long_runs import full_but

Array = NDArray[np.float64]
Plane = Callable[[Array], tuple[Array, Array, Array, Array]]
SIZE = 1.3
INERTIA = np.array([[2.0, 0.2, -0.1], [0.2, 1.5, 0.3], [-0.1, 0.3, 1.1]])


def motion_along(plane: Plane, duration: float, breaks: tuple[float, ...] = ()) -> sp.Motion:
    """A motion whose Pi/|Pi| is (x, y, 1), normalised, for a plane curve x, y with rates: L_o is chosen to make it so.

    With omega = u' x u is u' = u x omega, and L_o = Pi - I omega.
    """

    def internal(times: Array) -> Array:
        x, y, dx, dy = plane(times)
        place, rate = np.stack([x, y, np.ones_like(x)], -1), np.stack([dx, dy, np.zeros_like(x)], -1)
        length = np.linalg.norm(place, axis=-1, keepdims=True)
        u = place / length
        u_rate = rate / length - u * np.sum(u * rate, axis=-1, keepdims=True) / length
        return SIZE * u - np.cross(u_rate, u) @ INERTIA

    x, y, _, _ = plane(np.zeros(1))
    start = np.array([x[0], y[0], 1.0])
    deformation = sp.prescribed(lambda t: np.broadcast_to(INERTIA, (len(t), 3, 3)), internal, duration, breaks)
    return sp.reconstruct(deformation, SIZE * start / np.linalg.norm(start), tolerance=1e-11)


def lissajous(a: int, b: int, alpha: float, beta: float) -> Plane:
    def curve(t: Array) -> tuple[Array, Array, Array, Array]:
        first, second = a * t + alpha, b * t + beta
        return 0.6 * np.cos(first), 0.6 * np.cos(second), -0.6 * a * np.sin(first), -0.6 * b * np.sin(second)

    return curve


def lissajous_crossings(a: int, b: int, alpha: float, beta: float) -> Array:
    """Pairs of parameters in (0, 2 pi) at which cos(a t + alpha), cos(b t + beta) are the same, in closed form."""
    pairs = set()
    for difference, total, phase in ((a, b, beta), (b, a, alpha)):
        # t - s = 2 pi m/difference closes one coordinate, t + s = (2 pi k - 2 phase)/total the other.
        for m in range(1, difference):
            for k in range(-4 * total, 4 * total):
                apart, both = 2.0 * np.pi * m / difference, (2.0 * np.pi * k - 2.0 * phase) / total
                early, late = 0.5 * (both - apart), 0.5 * (both + apart)
                if early > 0.0 and late < 2.0 * np.pi:
                    pairs.add((round(early, 12), round(late, 12)))
    return np.array(sorted(pairs))


def polar(radius: Callable[[Array], tuple[Array, Array]]) -> Plane:
    def curve(t: Array) -> tuple[Array, Array, Array, Array]:
        r, dr = radius(t)
        c, s = np.cos(t), np.sin(t)
        return r * c, r * s, dr * c - r * s, dr * s + r * c

    return curve


@lru_cache(maxsize=8)
def some_motion(name: str) -> sp.Motion:
    body = body_of(name)
    deformation = sp.articulated(body, random_loop(1, body.n_shape).path.repeated(3))
    return sp.reconstruct(deformation, random_vector(1, BODIES[name]), random_rotation(3), tolerance=1e-11)


def polhode(moments: tuple[float, float, float], size: float, a: float) -> Array:
    first, _, third = moments
    along = np.sqrt(1.0 - (first - a) * third / ((first - third) * a))
    return size * np.array([along, 0.0, np.sqrt(1.0 - along**2)])


# ---- Returns -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("moments", "size", "a", "period", "tolerance"),
    [
        ((3.0, 2.0, 1.0), 1.7, 1.3, 8.305738787261774, 1e-11),
        ((3.0, 2.0, 1.0), 1.7, 1.999, 36.61739254324993, 1e-9),
        ((3.0, 2.5, 1.2), 1.0, 1.25, 14.010844764544798, 1e-11),
    ],
)
def test_the_first_return_of_a_rigid_body_is_its_period(moments, size, a, period, tolerance):
    """theory.md section 6."""
    attitude = random_rotation(5)
    deformation = sp.rigid(np.diag(moments), 2.3 * period)
    motion = sp.reconstruct(deformation, attitude @ polhode(moments, size, a), attitude, tolerance=tolerance)
    found = momentum_returns(motion)
    assert len(found.times) == 2
    # At a distance from the error estimate: an error of the attitude is one of the time over the curve's speed.
    speed = np.linalg.norm(np.cross(motion.body_momentum(0.0) / size, motion.angular_velocity(0.0)))
    np.testing.assert_allclose(found.times, [period, 2.0 * period], rtol=0, atol=2.0 * tolerance / speed)
    assert found.gaps.max() < 2.0 * tolerance


def test_returns_are_the_minima_of_the_angle():
    """Of a known curve: roots of the closed form's derivative, bracketed on a fine grid."""
    plane = lissajous(3, 2, 0.4, 1.1)
    motion = motion_along(plane, 20.0)
    start = np.array([0.6 * np.cos(0.4), 0.6 * np.cos(1.1), 1.0])

    def nearing(t: ArrayLike) -> Array:
        x, y, dx, dy = plane(np.atleast_1d(t))
        place, rate = np.stack([x, y, np.ones_like(x)]), np.stack([dx, dy, np.zeros_like(x)])
        return (start @ rate) * np.sum(place * place, axis=0) - (start @ place) * np.sum(place * rate, axis=0)

    def angle(t: float) -> float:
        x, y, _, _ = plane(np.array([t]))
        place = np.array([x[0], y[0], 1.0])
        return float(np.arctan2(np.linalg.norm(np.cross(place, start)), place @ start))

    grid = np.linspace(1e-3, 20.0, 8000)
    slopes = nearing(grid)
    places = np.flatnonzero((slopes[:-1] > 0.0) & (slopes[1:] <= 0.0))
    times = np.array([brentq(lambda t: nearing(t)[0], grid[k], grid[k + 1], xtol=1e-14) for k in places])
    counts = []
    for gap in (0.01, 0.1, np.pi):
        expected = [t for t in times if angle(t) < gap]
        if nearing(20.0)[0] > 0.0 and angle(20.0) < gap:
            expected.append(20.0)
        found = momentum_returns(motion, gap)
        np.testing.assert_allclose(found.times, expected, rtol=0, atol=1e-10)
        np.testing.assert_allclose(found.gaps, [angle(t) for t in expected], rtol=0, atol=1e-10)
        counts.append(len(expected))
    assert 0 < counts[0] < counts[1] < counts[2]


def test_a_direction_still_nearing_its_start_at_the_end_counts():
    plane = lissajous(3, 2, 0.4, 1.1)
    found = momentum_returns(motion_along(plane, 2.0 * np.pi - 0.01))
    assert found.times[-1] == 2.0 * np.pi - 0.01
    assert 1e-3 < found.gaps[-1] < 0.1
    later = momentum_returns(motion_along(plane, 2.0 * np.pi + 0.01))
    assert later.times[-1] == pytest.approx(2.0 * np.pi, abs=1e-10)
    assert later.gaps[-1] < 1e-10
    assert not np.any(momentum_returns(motion_along(plane, 2.0 * np.pi - 0.01), 1e-3).gaps > 1e-3)


@pytest.mark.parametrize("name", full_but(["cat", "satellite"], "satellite"))
def test_a_closed_orbit_returns_at_its_end(name: str):
    body = body_of(name)
    deformation = sp.articulated(body, random_loop(1, body.n_shape).path)
    motion = sp.closed_orbits(deformation, BODIES[name])[0]
    found = momentum_returns(motion, 1e-6)
    assert found.times[-1] == pytest.approx(motion.duration, abs=1e-9)
    assert found.gaps[-1] < 1e-10


@pytest.mark.parametrize("seed", full_but([None, 1, 2], 1))
def test_a_steady_turn_does_not_leave_and_so_does_not_return(seed: int | None):
    axes = np.eye(3) if seed is None else random_rotation(seed)
    motion = sp.reconstruct(sp.rigid(axes @ np.diag([1.0, 2.0, 3.0]) @ axes.T, 40.0), 2.4 * axes[:, 2])
    assert len(momentum_returns(motion).times) == 0
    crossings = momentum_crossings(motion)
    assert len(crossings.first) == len(crossings.retraced) == 0


def test_a_direction_that_has_come_back_and_rests_returns_once():
    def plane(t: Array) -> tuple[Array, Array, Array, Array]:
        s = np.where(t < 1.0, np.sin(np.pi * t) ** 2, 0.0)
        ds = np.where(t < 1.0, np.pi * np.sin(2.0 * np.pi * t), 0.0)
        return 0.4 * s + 0.1, 0.3 * s**2, 0.4 * ds, 0.6 * s * ds

    found = momentum_returns(motion_along(plane, 3.0, (1.0,)))
    assert len(found.times) == 1
    assert found.times[0] > 0.99
    assert found.gaps[0] < 1e-7


def test_other_engines_return_at_the_same_times():
    body = polhode((3.0, 2.0, 1.0), 1.7, 1.3)
    motion = sp.reconstruct(sp.rigid(np.diag([3.0, 2.0, 1.0]), 20.0), body, tolerance=1e-9, method="dop853")
    np.testing.assert_allclose(
        momentum_returns(motion).times, np.array([1.0, 2.0]) * 8.305738787261774, rtol=0, atol=1e-8
    )


# ---- Crossings -----------------------------------------------------------------------------------------------------


def rounding(motion: sp.Motion, found: Crossings) -> Array:
    """How far apart the two passages of a crossing may be by rounding alone: (n,) [rad].

    Newton's method on two smooth curves that cross stops when its steps are rounding, whatever the angle between the
    curves: an error along either curve is what the next step takes away. What remains of the gap comes from
    evaluating both points. A direction is a unit vector turned by a product of two unit quaternions: some ten
    operations on numbers of at most one, each off by eps/2; sixteen eps are allowed for either point. And a time is
    a multiple of its spacing, at most eps t, in which the curve moves on by eps t |u'|; it is rounded twice, once as
    the crossing's and once as a share of its step. The motion's own error is no part of this: both passages lie on
    the same computed curve.
    """
    eps = float(np.finfo(float).eps)
    moved = np.zeros(len(found.first))
    for times in (found.first, found.second):
        direction = motion.body_momentum(times) / np.linalg.norm(motion.momentum)
        speed = np.linalg.norm(np.cross(direction, motion.angular_velocity(times)), axis=-1)
        moved += 2.0 * times * speed
    return eps * (2.0 * 16.0 + moved)


def check_pairs(motion: sp.Motion, found: Crossings, expected: Array, near: float) -> None:
    pairs = np.stack([found.first, found.second], axis=1)
    assert pairs.shape == expected.shape
    order = np.lexsort(np.round(pairs, 6).T[::-1])
    np.testing.assert_allclose(pairs[order], expected, rtol=0, atol=near)
    assert np.all(found.gaps <= rounding(motion, found))


@pytest.mark.parametrize(
    ("a", "b", "alpha", "beta"), [(3, 2, 0.4, 1.1), (1, 2, 0.3, 0.2), (5, 4, 0.2, 1.0), (5, 7, 0.1, 0.9)]
)
def test_crossings_of_lissajous_curves(a: int, b: int, alpha: float, beta: float):
    """2 a b - a - b crossings, in closed form; the map (x, y) -> (x, y, 1)/| | makes none and loses none."""
    expected = lissajous_crossings(a, b, alpha, beta)
    assert len(expected) == 2 * a * b - a - b
    plane = lissajous(a, b, alpha, beta)
    motion = motion_along(plane, 2.0 * np.pi)
    found = momentum_crossings(motion)
    check_pairs(motion, found, expected, 1e-9)
    assert len(found.retraced) == 0
    x, y, _, _ = plane(found.first)
    there = np.stack([x, y, np.ones_like(x)], axis=-1)
    np.testing.assert_allclose(
        found.directions, there / np.linalg.norm(there, axis=1, keepdims=True), rtol=0, atol=1e-10
    )


def test_the_loop_of_a_snail():
    """Pascal's snail r = 0.3 + 0.5 cos phi goes through the origin twice, heading along its radius there."""
    motion = motion_along(polar(lambda t: (0.3 + 0.5 * np.cos(t), -0.5 * np.sin(t))), 2.0 * np.pi)
    found = momentum_crossings(motion)
    early = np.arccos(-0.6)
    check_pairs(motion, found, np.array([[early, 2.0 * np.pi - early]]), 1e-10)
    np.testing.assert_allclose(found.directions, [[0.0, 0.0, 1.0]], rtol=0, atol=1e-11)
    # Inwards at `early`, outwards at the other.
    heading, other = -np.array([np.cos(early), np.sin(early)]), np.array([np.cos(early), -np.sin(early)])
    assert found.angles[0] == pytest.approx(np.arccos(heading @ other), abs=1e-9)


def test_three_passages_through_one_point_are_three_pairs():
    """The rose r = cos 3 phi, from the tip of a petal."""
    motion = motion_along(polar(lambda t: (0.7 * np.cos(3.0 * t), -2.1 * np.sin(3.0 * t))), np.pi)
    found = momentum_crossings(motion)
    passages = np.pi * np.array([1.0, 3.0, 5.0]) / 6.0
    check_pairs(motion, found, np.array([[passages[i], passages[j]] for i, j in ((0, 1), (0, 2), (1, 2))]), 1e-9)
    np.testing.assert_allclose(np.sin(found.angles), np.sqrt(0.75), rtol=0, atol=1e-9)


def test_three_crossings_within_a_piece():
    """Two windings, 0.2 (cos x + c cos 3x) with x = phi/2 off a circle either way: they cross where cos x = 0, and
    where cos^2 x = (3 - 1/c)/4, here 0.008 rad beside it.
    """
    delta = 0.008
    c = 1.0 / (3.0 - 4.0 * np.sin(delta) ** 2)

    def radius(phi: Array) -> tuple[Array, Array]:
        x = 0.5 * phi
        return 0.5 + 0.2 * (np.cos(x) + c * np.cos(3.0 * x)), -0.1 * (np.sin(x) + 3.0 * c * np.sin(3.0 * x))

    motion = motion_along(polar(radius), 4.0 * np.pi)
    found = momentum_crossings(motion)
    first = np.pi + np.array([-2.0, 0.0, 2.0]) * delta
    check_pairs(motion, found, np.stack([first, first + 2.0 * np.pi], axis=1), 1e-5)
    assert len(found.retraced) == 0


def test_the_search_in_parts_is_the_search_in_one(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("shapephase.phases.recurrence._AT_ONCE", 50)
    motion = motion_along(lissajous(5, 4, 0.2, 1.0), 3.0 * np.pi)
    found = momentum_crossings(motion)
    check_pairs(motion, found, lissajous_crossings(5, 4, 0.2, 1.0), 1e-9)
    np.testing.assert_allclose(found.retraced, [[2.0 * np.pi, 3.0 * np.pi]], rtol=0, atol=1e-7)


def test_a_crossing_in_the_middle_of_pieces_is_no_retracing(monkeypatch: pytest.MonkeyPatch):
    early = np.arccos(-0.6)
    passages, times = np.array([early, 2.0 * np.pi - early]), np.linspace(0.0, 2.0 * np.pi, 1000)
    away = np.abs(times[:, None] - passages).min(axis=1) > 0.015
    ends = (passages[:, None] + 0.01 * np.array([-1.0, 1.0])).ravel()
    monkeypatch.setattr(
        "shapephase.phases.recurrence._resolved", lambda *_: np.sort(np.concatenate([times[away], ends]))
    )
    motion = motion_along(polar(lambda t: (0.3 + 0.5 * np.cos(t), -0.5 * np.sin(t))), 2.0 * np.pi)
    found = momentum_crossings(motion)
    check_pairs(motion, found, passages[None], 1e-10)
    assert len(found.retraced) == 0


def test_a_tiny_loop_is_found():
    """A snail whose inner loop is 0.002 long: r = b + 0.5 cos phi with b all but 0.5."""
    b = 0.4995
    motion = motion_along(polar(lambda t: (b + 0.5 * np.cos(t), -0.5 * np.sin(t))), 2.0 * np.pi)
    found = momentum_crossings(motion)
    early = np.arccos(-b / 0.5)
    check_pairs(motion, found, np.array([[early, 2.0 * np.pi - early]]), 1e-7)


def test_a_simple_curve_has_no_crossings():
    """A snail without an inner loop; its ends meet, which is no crossing."""
    motion = motion_along(polar(lambda t: (0.6 + 0.3 * np.cos(t), -0.3 * np.sin(t))), 2.0 * np.pi)
    found = momentum_crossings(motion)
    assert len(found.first) == len(found.retraced) == 0


def test_a_curve_gone_through_again_is_reported_and_not_counted_again():
    expected = lissajous_crossings(3, 2, 0.4, 1.1)
    motion = motion_along(lissajous(3, 2, 0.4, 1.1), 5.0 * np.pi)
    found = momentum_crossings(motion)
    check_pairs(motion, found, expected, 1e-9)
    np.testing.assert_allclose(found.retraced, [[2.0 * np.pi, 5.0 * np.pi]], rtol=0, atol=1e-7)


@pytest.mark.parametrize("offset", [-4e-3, -1e-3, 1e-3, 4e-3])
def test_what_crosses_where_going_again_begins_is_not_counted_again(offset: float):
    """The curve starts next to a crossing, so that crossing is where the curve begins to repeat itself, too."""
    passage = lissajous_crossings(3, 2, 0.4, 1.1)[0, 0] + offset
    shifted = (3, 2, 0.4 + 3.0 * passage, 1.1 + 2.0 * passage)
    motion = motion_along(lissajous(*shifted), 3.0 * np.pi)
    found = momentum_crossings(motion)
    check_pairs(motion, found, lissajous_crossings(*shifted), 1e-9)
    np.testing.assert_allclose(found.retraced, [[2.0 * np.pi, 3.0 * np.pi]], rtol=0, atol=1e-7)


def test_ends_that_meet_at_an_angle_are_no_crossing():
    """The inner loop of a snail alone."""
    early = np.arccos(-0.6)
    radius = polar(lambda t: (0.3 + 0.5 * np.cos(t + early), -0.5 * np.sin(t + early)))
    found = momentum_crossings(motion_along(radius, 2.0 * (np.pi - early)))
    assert len(found.first) == len(found.retraced) == 0


def test_a_curve_gone_back_along_is_reported():
    """To the end of an arc, back over its start, and on: what is retraced is the way back to the start."""
    cosine, sine = np.cos, np.sin

    def plane(t: Array) -> tuple[Array, Array, Array, Array]:
        s, ds = 1.2 * sine(t), 1.2 * cosine(t)
        return 0.5 * cosine(s), 0.5 * sine(s), -0.5 * sine(s) * ds, 0.5 * cosine(s) * ds

    found = momentum_crossings(motion_along(plane, 1.5 * np.pi))
    assert len(found.first) == 0
    np.testing.assert_allclose(found.retraced, [[0.5 * np.pi, np.pi]], rtol=0, atol=2e-3)
    assert found.retraced[0, 1] == pytest.approx(np.pi, abs=1e-6)


def test_rigid_periods_are_retraced():
    """A polhode is a simple curve."""
    moments = (3.0, 2.0, 1.0)
    motion = sp.reconstruct(sp.rigid(np.diag(moments), 300.0), polhode(moments, 1.7, 1.3), tolerance=1e-8)
    found = momentum_crossings(motion)
    assert len(found.first) == 0
    np.testing.assert_allclose(found.retraced, [[8.305738787261774, 300.0]], rtol=0, atol=1e-6)


def test_a_closed_orbit_gone_through_three_times_is_retraced():
    body = body_of("satellite")
    path = random_loop(1, body.n_shape).path
    once = sp.closed_orbits(sp.articulated(body, path), BODIES["satellite"])[-1]
    thrice = sp.reconstruct(
        sp.articulated(body, path.repeated(3)), once.momentum, once.initial_attitude, tolerance=1e-11
    )
    found, again = momentum_crossings(once), momentum_crossings(thrice)
    assert len(found.retraced) == 0
    assert len(found.first) == 3
    check_pairs(thrice, again, np.stack([found.first, found.second], axis=1), 1e-8)
    np.testing.assert_allclose(again.retraced, [[2.0, 6.0]], rtol=0, atol=1e-6)


def brute_force(motion: sp.Motion, count: int) -> Array:
    """Arcs between many samples that have each other's ends on both sides."""
    times = np.linspace(0.0, motion.duration, count)
    u = motion.body_momentum(times)
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    a, b = u[:-1], u[1:]
    normal = np.cross(a, b)
    near = cKDTree(0.5 * (a + b)).query_pairs(1.01 * np.linalg.norm(b - a, axis=1).max(), output_type="ndarray")
    i, j = near.min(axis=1), near.max(axis=1)
    i, j = i[j - i > 1], j[j - i > 1]
    first = np.sum(normal[i] * a[j], axis=1) * np.sum(normal[i] * b[j], axis=1)
    second = np.sum(normal[j] * a[i], axis=1) * np.sum(normal[j] * b[i], axis=1)
    hit = (first < 0.0) & (second < 0.0)
    return np.stack([times[i[hit]], times[j[hit]]], axis=1)


@pytest.mark.parametrize("name", EVERY_BODY)
def test_crossings_of_bodies_are_those_of_a_fine_polygon(name: str):
    motion = some_motion(name)
    found, expected = momentum_crossings(motion), brute_force(motion, 20001)
    pairs = np.stack([found.first, found.second], axis=1)
    assert len(pairs) == len(expected)
    assert len(found.retraced) == 0
    distance = np.abs(pairs[:, None] - expected[None]).max(axis=2)
    assert np.all(distance.min(axis=1) < 3e-3)
    assert np.all(distance.min(axis=0) < 3e-3)
    assert np.all(found.gaps <= rounding(motion, found))
    assert np.all(found.first < found.second)


@pytest.mark.parametrize("name", full_but(["cat", "example:human"], "cat"))
def test_crossings_are_crossings_for_pinocchio(name: str):
    body, loop = body_of(name), random_loop(1, body_of(name).n_shape)
    deformation = sp.articulated(body, loop.path)
    for seed in range(1, 9):
        momentum, attitude = random_vector(seed, 4.0 * BODIES[name]), random_rotation(seed)
        motion = sp.reconstruct(deformation, momentum, attitude, tolerance=1e-11)
        found = momentum_crossings(motion)
        if len(found.first) >= 2:
            break
    times = np.stack([found.first, found.second], axis=1)[:3]
    order = np.argsort(times.ravel())
    truth = pinocchio_motion(name, body.joint_names, loop, momentum, attitude, times.ravel()[order])
    seen = np.empty((times.size, 3))
    seen[order] = np.swapaxes(truth.attitude, -1, -2) @ momentum / np.linalg.norm(momentum)
    seen = seen.reshape(-1, 2, 3)
    assert len(seen) >= 2
    assert np.linalg.norm(seen[:, 0] - seen[:, 1], axis=-1).max() < 1e-10
    np.testing.assert_allclose(seen[:, 0], found.directions[:3], rtol=0, atol=1e-10)


def test_the_solid_angle_of_a_figure_of_eight_is_that_of_its_two_loops():
    """Between the two passages of a crossing the curve closes: both loops' areas make up the whole (theory.md D8)."""
    motion = motion_along(lissajous(1, 2, 0.3, 0.2), 2.0 * np.pi)
    found = momentum_crossings(motion)
    assert len(found.first) == 1
    whole = motion.solid_angle(2.0 * np.pi)
    early, late = found.first[0], found.second[0]
    fine = np.linspace(early, late, 4001)
    u = motion.body_momentum(fine) / SIZE
    centre = np.array([0.0, 0.0, 1.0])
    a, b = u[:-1], u[1:]
    excess = np.sum(centre * np.cross(a, b), axis=1) / (1.0 + np.sum(a * b, axis=1) + a @ centre + b @ centre)
    inner = 2.0 * np.sum(np.arctan(excess))
    rest = np.concatenate([np.linspace(late, 2.0 * np.pi, 2001), np.linspace(0.0, early, 2001)])
    u = motion.body_momentum(rest) / SIZE
    a, b = u, np.roll(u, -1, axis=0)
    excess = np.sum(centre * np.cross(a, b), axis=1) / (1.0 + np.sum(a * b, axis=1) + a @ centre + b @ centre)
    outer = 2.0 * np.sum(np.arctan(excess))
    assert inner * outer < 0.0, "the two loops go round opposite ways"
    assert abs(wrapped(inner + outer - whole)) < 1e-5


def test_a_curve_of_too_many_pieces_is_refused(monkeypatch: pytest.MonkeyPatch):
    motion = motion_along(lissajous(3, 2, 0.4, 1.1), 2.0 * np.pi)
    monkeypatch.setattr("shapephase.phases.recurrence._LONGEST", 1e-3)
    monkeypatch.setattr("shapephase.phases.recurrence._MOST_PIECES", 1000)
    for ask in (momentum_returns, momentum_crossings):
        with pytest.raises(AccuracyNotReached, match="pieces"):
            ask(motion)


# ---- Arguments -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ask", [momentum_returns, momentum_crossings])
def test_one_motion_with_momentum_is_needed(ask):
    deformation = sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0)
    with pytest.raises(ShapeError, match="angular"):
        ask(sp.reconstruct(deformation, np.zeros(3)))
    with pytest.raises(ShapeError, match="batch"):
        ask(sp.reconstruct(deformation, np.eye(3)[:2]))


@pytest.mark.parametrize("gap", [0.0, -1.0, 4.0, np.nan, [0.1, 0.2], "wide"])
def test_a_gap_is_an_angle(gap):
    with pytest.raises(ShapeError, match="gap"):
        momentum_returns(sp.reconstruct(sp.rigid(np.eye(3), 1.0), [0.0, 0.0, 1.0]), gap)
