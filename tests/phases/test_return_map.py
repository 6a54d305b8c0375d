"""Momenta that close together with the shape: the map, its fixed points, and those followed through momenta.

The map is held against Pinocchio and against differences, fixed points against Lefschetz's number, closed forms of
rigid bodies and Pinocchio, branches against fixed points found afresh.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

import shapephase as sp
from shapephase import so3
from shapephase.errors import OpenPathError, ShapeError, TrajectoryError
from shapephase.phases import FixedPoints, _loop_map, continued_orbits, fixed_points, stroboscopic_map
from shapephase.sphere import fibonacci_directions
from support.independent import (
    BODIES,
    apart,
    body_of,
    geodesic_turn,
    pinocchio_motion,
    random_loop,
    random_rotation,
    random_vector,
    turn,
)
from support.long_runs import full_but

# The map is the same with and without machine code, which is quicker.
Array = NDArray[np.float64]
# Less for the diver, who at his usual momentum turns so fast that the map mixes the sphere.
SIZES = {**BODIES, "diver": 2.0}
THREE = ("cat", "satellite", "example:human")
SHARES = (0.1, 0.3, 0.6, 1.0, 1.5)
UP = np.array([0.0, 0.0, 1.0])
MOMENTS = (1.0, 2.0, 3.0)
# Two fixed points of the human, in the order in which they are found, and the size [kg m^2/s] below which neither is.
FOLDING = [4, 5]
FOLD = 7.4601337568


@lru_cache(maxsize=64)
def deformation_of(name: str, seed: int = 1) -> sp.Deformation:
    body = body_of(name)
    return sp.articulated(body, random_loop(seed, body.n_shape).path)


@lru_cache(maxsize=64)
def points_of(name: str, seed: int = 1, share: float = 1.0) -> FixedPoints:
    return fixed_points(deformation_of(name, seed), share * SIZES[name])


@lru_cache(maxsize=8)
def orbits_of(name: str) -> list[sp.Motion]:
    return sp.closed_orbits(deformation_of(name), SIZES[name])


@lru_cache(maxsize=2)
def many_directions() -> Array:
    vectors = np.random.default_rng(5).normal(size=(30, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def directions(orbits: list[sp.Motion]) -> Array:
    starts = np.array([motion.body_momentum(0.0) for motion in orbits])
    return starts / np.linalg.norm(starts, axis=1, keepdims=True)


def tangents(direction: Array) -> Array:
    """e and u x e with e across the smallest component, as `so3.perpendicular` has it."""
    across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    first = across / np.linalg.norm(across)
    return np.stack([first, np.cross(direction, first)])


def ends_of(deformation: sp.Deformation, size: float, starts: Array) -> Array:
    """u(T) by whole motions, the momentum along inertial z."""
    attitudes = np.array([attitude_showing(u) for u in starts])
    motion = sp.reconstruct(deformation, [0.0, 0.0, size], attitudes, tolerance=1e-12)
    return motion.body_momentum(deformation.duration) / size


def derivative_by_differences(deformation: sp.Deformation, size: float, direction: Array, h: float = 3e-4) -> Array:
    """The linearised map from the start's tangents to the same carried along the great circle, by differences."""
    basis = tangents(direction)
    reach = h * np.array([1.0, -1.0, 2.0, -2.0])
    starts = np.array([np.cos(a) * direction + np.sin(a) * e for e in basis for a in reach])
    ends = ends_of(deformation, size, starts).reshape(2, 4, 3)
    slopes = (8.0 * (ends[:, 0] - ends[:, 1]) - (ends[:, 2] - ends[:, 3])) / (12.0 * h)
    end = ends_of(deformation, size, direction[None])[0]
    return basis @ geodesic_turn(direction, end).T @ slopes.T


def attitude_showing(direction: Array) -> Array:
    """R with R^T z = direction."""
    axis = np.cross(direction, [0.0, 0.0, 1.0])
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return np.eye(3) if direction[2] > 0.0 else turn([1.0, 0.0, 0.0], np.pi)
    return turn(axis, np.arctan2(sine, direction[2]))


def pinocchio_gap(name: str, seed: int, size: float, direction: Array) -> float:
    body, start = body_of(name), attitude_showing(direction)
    loop = random_loop(seed, body.n_shape)
    return pinocchio_motion(name, body.joint_names, loop, size * UP, start, [0.0]).gap["base"]


# ---- The map -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", full_but(THREE, "example:human", "satellite"))
def test_the_map_is_that_of_motions_and_of_pinocchio(name: str):
    starts = many_directions()
    found = stroboscopic_map(deformation_of(name), SIZES[name], 7.0 * starts.reshape(3, 10, 3))
    assert found.start.shape == found.end.shape == (3, 10, 3)
    np.testing.assert_allclose(found.start.reshape(-1, 3), starts, rtol=0, atol=1e-15)
    ends = ends_of(deformation_of(name), SIZES[name], starts)
    np.testing.assert_allclose(found.end.reshape(-1, 3), ends, rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        np.cos(found.gap.ravel()), np.sum(starts * found.end.reshape(-1, 3), axis=1), rtol=0, atol=1e-14
    )
    body, loop, first = body_of(name), random_loop(1, body_of(name).n_shape), attitude_showing(starts[0])
    truth = pinocchio_motion(name, body.joint_names, loop, SIZES[name] * UP, first)
    np.testing.assert_allclose(found.end[0, 0], truth.attitude[-1].T @ UP, rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", full_but(SIZES, "diver", "example:human"))
def test_the_linearised_map_is_the_limit_of_differences_and_keeps_areas(name: str):
    starts = many_directions()[:12]
    found = stroboscopic_map(deformation_of(name), SIZES[name], starts, tolerance=1e-12)
    np.testing.assert_allclose(np.linalg.det(found.derivative), 1.0, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.trace, np.trace(found.derivative, axis1=1, axis2=2), rtol=0, atol=0)
    for start, derivative in list(zip(starts, found.derivative))[:3]:
        expected = derivative_by_differences(deformation_of(name), SIZES[name], start)
        np.testing.assert_allclose(derivative, expected, rtol=0, atol=1e-7 * np.linalg.norm(expected))


def test_without_momentum_the_map_is_the_inverse_holonomy():
    deformation = deformation_of("cat")
    holonomy = sp.holonomy(body_of("cat"), random_loop(1, body_of("cat").n_shape).path, 1e-12)
    found = stroboscopic_map(deformation, 0.0, many_directions(), tolerance=1e-12)
    np.testing.assert_allclose(found.end, many_directions() @ holonomy, rtol=0, atol=1e-11)
    np.testing.assert_allclose(np.linalg.det(found.derivative), 1.0, rtol=0, atol=1e-12)
    one = stroboscopic_map(deformation, 0.0, [0.0, 0.0, 1e-200])
    assert one.end.shape == (3,)
    assert one.derivative.shape == (2, 2)
    assert isinstance(one.gap, float)
    assert isinstance(one.trace, float)


def test_many_directions_are_run_in_parts(monkeypatch: pytest.MonkeyPatch):
    """Attitudes of both are within 1e-10; how far a direction is off is at most that."""
    deformation, directions = deformation_of("cat"), fibonacci_directions(50)
    whole = stroboscopic_map(deformation, BODIES["cat"], directions)
    points = fixed_points(deformation, BODIES["cat"])
    monkeypatch.setattr(_loop_map, "_ROWS_AT_ONCE", 20)
    monkeypatch.setattr(_loop_map, "_SLOPES_AT_ONCE", 40)
    parts = stroboscopic_map(deformation, BODIES["cat"], directions)
    assert len(parts.solution.parts) == 3
    np.testing.assert_allclose(parts.end, whole.end, rtol=0.0, atol=2e-10)
    np.testing.assert_allclose(parts.derivative, whole.derivative, rtol=0.0, atol=1e-7)
    again = fixed_points(deformation, BODIES["cat"])
    assert again.stability == points.stability
    np.testing.assert_allclose(again.directions, points.directions, rtol=0.0, atol=1e-9)


def test_a_map_needs_a_loop_directions_and_a_size():
    with pytest.raises(ShapeError, match="directions"):
        stroboscopic_map(deformation_of("cat"), 0.1, [UP, np.zeros(3)])
    with pytest.raises(ShapeError, match="directions"):
        stroboscopic_map(deformation_of("cat"), 0.1, [1.0, 2.0])
    with pytest.raises(ShapeError, match="0 or more"):
        stroboscopic_map(deformation_of("cat"), -0.1, UP)


# ---- Fixed points --------------------------------------------------------------------------------------------------


def check_fixed_points(name: str, seed: int, share: float) -> FixedPoints:
    found = points_of(name, seed, share)
    size = share * SIZES[name]
    assert len(found.directions) >= 2, "an area-preserving map of the sphere has two fixed points or more"
    assert found.index_sum == found.index.sum()
    assert found.complete == (found.index_sum == 2 and bool(found.index.all()))
    assert found.gap.max() < 1e-10
    ends = ends_of(deformation_of(name, seed), size, found.directions)
    assert np.linalg.norm(ends - found.directions, axis=1).max() < 1e-10
    return found


@pytest.mark.parametrize(("name", "share"), [("cat", 0.3), ("example:human", 1.0)])
def test_all_fixed_points_are_found(name: str, share: float):
    found = check_fixed_points(name, 1, share)
    assert found.complete
    assert found.index_sum == 2
    assert pinocchio_gap(name, 1, share * SIZES[name], found.directions[-1]) < 1e-10


@pytest.mark.full
@pytest.mark.parametrize("name", THREE)
def test_all_fixed_points_of_ten_loops_at_five_momenta_are_found(name: str):
    complete = []
    for seed in range(1, 11):
        for share in SHARES:
            found = check_fixed_points(name, seed, share)
            complete.append(found.complete)
            for point in found.directions[[0, -1]]:
                assert pinocchio_gap(name, seed, share * SIZES[name], point) < 1e-10
    assert sum(complete) == 50


@pytest.mark.parametrize("name", full_but(SIZES, "cat"))
def test_index_and_trace_by_differences(name: str):
    """Lefschetz: the indices of all fixed points sum to 2 (theory.md section 2)."""
    found = points_of(name)
    total = 0
    for row, point in enumerate(found.directions):
        derivative = derivative_by_differences(deformation_of(name), SIZES[name], point)
        assert found.trace[row] == pytest.approx(np.trace(derivative), abs=1e-7 * np.linalg.norm(derivative))
        assert found.index[row] == np.sign(2.0 - np.trace(derivative))
        total += found.index[row]
    assert total == found.index_sum == 2
    assert found.complete
    kinds = {"elliptic": (-2.0, 2.0), "hyperbolic": (2.0, np.inf), "inverse hyperbolic": (-np.inf, -2.0)}
    for kind, trace in zip(found.stability, found.trace):
        least, most = kinds[kind]
        assert least < trace < most


def test_all_three_kinds_occur():
    kinds = set(points_of("example:human").stability) | set(points_of("example:human", 1, 0.6).stability)
    assert {"elliptic", "hyperbolic"} <= kinds
    reflecting = fixed_points(deformation_of("example:human"), 4.8)
    assert "inverse hyperbolic" in reflecting.stability
    assert reflecting.index[reflecting.stability.index("inverse hyperbolic")] == 1


@pytest.mark.parametrize("name", full_but(["cat", "example:human"], "cat"))
def test_a_finer_search_finds_no_more(name: str, monkeypatch: pytest.MonkeyPatch):
    found = points_of(name)
    monkeypatch.setattr("shapephase.phases.return_map._STARTS", (2562,))
    monkeypatch.setattr("shapephase.phases._fixed_point_search._SAFETY_FACTOR", 6.0)
    again = fixed_points(deformation_of(name), SIZES[name])
    np.testing.assert_allclose(again.directions, found.directions, rtol=0, atol=1e-9)


def test_a_search_that_missed_some_is_done_again(monkeypatch: pytest.MonkeyPatch):
    for name, value in {"_SAFETY_FACTOR": 0.0, "_BEND": 10.0, "_WIDE": 10.0}.items():
        monkeypatch.setattr(f"shapephase.phases._fixed_point_search.{name}", value)
    monkeypatch.setattr("shapephase.phases.return_map._STARTS", (8,))
    missed = fixed_points(deformation_of("cat"), SIZES["cat"])
    assert missed.index_sum != 2
    assert not missed.complete
    monkeypatch.setattr("shapephase.phases.return_map._STARTS", (8, 2562))
    found = fixed_points(deformation_of("cat"), SIZES["cat"])
    assert found.complete
    np.testing.assert_allclose(found.directions, points_of("cat").directions, rtol=0, atol=1e-9)


def test_a_search_cut_short_says_so():
    found = fixed_points(deformation_of("cat"), SIZES["cat"], most_directions=1000)
    assert not found.complete
    assert found.gap.max(initial=0.0) < 1e-10
    for few in (999, 1e5, "all"):
        with pytest.raises(ShapeError, match="integer"):
            fixed_points(deformation_of("cat"), SIZES["cat"], most_directions=few)  # type: ignore[arg-type]


# ---- Fixed points: known cases -------------------------------------------------------------------------------------


def steady_excess(axis: int, size: float, duration: float) -> float:
    """2 - trace of the linearised Euler equations about a principal axis, theory.md L2."""
    own, one, other = (MOMENTS[(axis + k) % 3] for k in range(3))
    square = (size / own) ** 2 * (own - one) * (own - other) / (one * other)
    half = 0.5 * duration * np.sqrt(abs(square))
    return float(4.0 * np.sin(half) ** 2 if square > 0.0 else -4.0 * np.sinh(half) ** 2)


@pytest.mark.parametrize("seed", [None, 3])
@pytest.mark.parametrize("size", [1e-8, 1e-5, 1e-3, 0.1, 1.0])
def test_a_rigid_body_within_its_shortest_period_has_only_its_steady_turns(size: float, seed: int | None):
    """Centres for the greatest and the least moment (index 1), saddles between (index -1)."""
    axes = np.eye(3) if seed is None else random_rotation(seed)
    found = fixed_points(sp.rigid(axes @ np.diag(MOMENTS) @ axes.T, 3.0), size)
    assert found.complete
    assert len(found.index) == 6
    seen = found.directions @ axes
    for row, point in enumerate(seen):
        axis = int(np.argmax(np.abs(point)))
        assert abs(point[axis]) == pytest.approx(1.0, abs=1e-12 / size)
        assert np.linalg.norm(np.delete(point, axis)) < 1e-11 / size
        assert found.index[row] == (-1 if axis == 1 else 1)
        assert found.stability[row] == ("hyperbolic" if axis == 1 else "elliptic")
        assert 2.0 - found.trace[row] == pytest.approx(steady_excess(axis, size, 3.0), rel=1e-5, abs=1e-15)
    heights, azimuths = np.round(found.directions[:, 2], 6), np.arctan2(found.directions[:, 1], found.directions[:, 0])
    assert all(
        after < h or (after == h and a < b) for h, after, a, b in zip(heights, heights[1:], azimuths, azimuths[1:])
    )


def test_a_steady_turn_that_comes_back_reversed_is_parabolic():
    """Neighbours of the turn about the third axis have gone half round: the linearised map is -1."""
    found = fixed_points(sp.rigid(np.diag(MOMENTS), 3.0), np.pi)
    assert found.complete
    for row in (0, -1):
        assert found.stability[row] == "parabolic"
        assert found.index[row] == 1
        assert found.trace[row] == pytest.approx(-2.0, abs=1e-9)


def test_fixed_points_that_fill_curves_are_told():
    """After one period of a polhode a rigid body's map keeps that whole polhode."""
    deformation = sp.rigid(np.diag([3.0, 2.0, 1.0]), 8.305738787261774)
    found = fixed_points(deformation, 1.7, most_directions=2_000)
    assert not found.complete
    assert np.any(found.index == 0)
    family = found.directions[found.index == 0]
    inverse = np.sum(family**2 / [3.0, 2.0, 1.0], axis=1)
    assert np.any(np.abs(1.0 / inverse - 1.3) < 1e-6), "a = G^2 / 2h of that polhode"
    distances = np.linalg.norm(family[:, None] - family[None], axis=-1) + 3.0 * np.eye(len(family))
    assert distances.min() > 0.29


@pytest.mark.parametrize(
    "moments", [(2.0, 2.0, 3.0), pytest.param((1.0, 1.5, 1.5), marks=pytest.mark.full), (2.0, 2.0, 2.0)]
)
def test_symmetric_bodies_are_told(moments: tuple[float, float, float]):
    found = fixed_points(sp.rigid(np.diag(moments), 1.0), 1.0, most_directions=10_000)
    assert not found.complete
    assert np.any(found.index == 0)
    assert all(kind == "parabolic" for kind, index in zip(found.stability, found.index) if index == 0)
    assert found.gap.max() < 1e-10
    assert len(found.index) < 300


@pytest.mark.parametrize("name", ["cat_two_halves", "cat"])
def test_for_little_momentum_the_fixed_points_are_the_ends_of_the_holonomys_axis(name: str):
    """The map is the inverse holonomy, a turn by alpha: trace 2 cos alpha."""
    holonomy = sp.split(sp.reconstruct(deformation_of(name), np.zeros(3))).holonomy
    found = fixed_points(deformation_of(name), 1e-7 * SIZES[name])
    assert found.complete
    assert len(found.directions) == 2
    np.testing.assert_allclose(found.directions @ holonomy.T, found.directions, rtol=0, atol=1e-5)
    np.testing.assert_allclose(found.trace, np.trace(holonomy) - 1.0, rtol=0, atol=1e-5)
    assert found.stability == ("elliptic", "elliptic")


@pytest.mark.parametrize("size", [1e-2, 1e-4])
def test_little_momentum_without_holonomy(size: float):
    """A shape that goes there and back: the map differs from the identity by what the momentum itself turns."""
    body = body_of("satellite")
    still, bent = np.zeros(body.n_shape), np.full(body.n_shape, 0.4)
    path = sp.ShapePath.waypoints([0.0, 1.0, 2.0], [still, bent, still])
    deformation = sp.articulated(body, path)
    assert apart(sp.holonomy(body, path, 1e-12), np.eye(3)) < 1e-11
    found = fixed_points(deformation, size)
    assert found.complete
    # To first order u moves by u x M u with M the mean of S I^-1 S^T: fixed along its axes, saddles along the middle.
    times = np.linspace(0.0, 2.0, 4001)
    turns = sp.reconstruct(deformation, np.zeros(3), tolerance=1e-12).attitude(times)
    mean = np.mean((turns @ np.linalg.inv(deformation.inertia(times)) @ np.swapaxes(turns, 1, 2))[:-1], axis=0)
    _, axes = np.linalg.eigh(mean)
    assert len(found.index) == 6
    for point, index in zip(found.directions, found.index):
        along = np.abs(point @ axes)
        assert along.max() > 1.0 - 1e-6
        assert index == (-1 if np.argmax(along) == 1 else 1)


# ---- Closed orbits -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", full_but(SIZES, "satellite"))
def test_orbits_close(name: str):
    orbits = orbits_of(name)
    assert len(orbits) >= 2
    for motion in orbits:
        np.testing.assert_array_equal(motion.momentum, [0.0, 0.0, SIZES[name]])
        gap = motion.body_momentum(motion.duration) - motion.body_momentum(0.0)
        assert np.linalg.norm(gap) < 1e-10 * SIZES[name]
    assert sp.split(orbits[0], "base").momentum_gap < 1e-10
    np.testing.assert_allclose(directions(orbits), points_of(name).directions, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", full_but(SIZES, "cat", "satellite"))
def test_orbits_are_apart_and_in_order(name: str):
    points = directions(orbits_of(name))
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1) + 2.0 * np.eye(len(points))
    assert distances.min() > 1e-6
    assert np.all(np.diff(points[:, 2]) <= 1e-9)


def horizontal(deformation: sp.Deformation) -> sp.Deformation:
    return sp.horizontal_gauge(deformation)


def periodic(deformation: sp.Deformation) -> sp.Deformation:
    return sp.in_gauge(deformation, turning(0.6, 0.0))


def turned_on(deformation: sp.Deformation) -> sp.Deformation:
    """A frame that ends turned."""
    return sp.in_gauge(deformation, turning(0.6, 0.9))


def turning(swing: float, spin: float) -> Callable[[Array], tuple[Array, Array]]:
    """U = exp(swing sin(pi t) a) exp(spin t b) for two directions a, b, periodic in 2 s when spin is zero."""
    a, b = random_vector(21, 1.0), random_vector(22, 1.0)

    def u(times: Array) -> tuple[Array, Array]:
        first = np.array([turn(a, swing * np.sin(np.pi * t)) for t in times])
        second = np.array([turn(b, spin * t) for t in times])
        rate = swing * np.pi * np.cos(np.pi * times)[:, None] * (np.swapaxes(second, 1, 2) @ a)
        return first @ second, rate + spin * b

    return u


def check_joint_closure(name: str, seed: int, size: float, gauge: Callable[[sp.Deformation], sp.Deformation]) -> None:
    """B9 and D16: Delta R = exp(theta_M mu^) R(t1) Delta R_0 R(t1)^T in the gauge in which Pi closes."""
    deformation = deformation_of(name, seed)
    seen = gauge(deformation)
    orbits = sp.closed_orbits(seen, size)
    assert len(orbits) >= 2
    frames = seen.frame([0.0, deformation.duration])
    elsewhere = 0
    for motion in orbits:
        split = sp.split(motion, "base")
        assert split.momentum_gap < 1e-10
        start = motion.initial_attitude
        by_phase = turn(UP, split.montgomery_phase) @ start @ seen.closure @ start.T
        assert apart(split.total_rotation, by_phase) < 1e-9
        again = sp.reconstruct(deformation, motion.momentum, start @ frames[0], tolerance=1e-11)
        assert apart(motion.final_attitude @ frames[1], again.final_attitude) < 1e-9
        assert apart(split.total_rotation, again.final_attitude @ again.initial_attitude.T) < 1e-9
        assert apart(split.total_rotation, sp.split(again).total_rotation) < 1e-9
        elsewhere += sp.split(again, "base").momentum_gap > 1e-3
    if gauge is periodic:
        assert elsewhere == 0, "a frame that comes back sees the same closed orbits"
    else:
        assert elsewhere == len(orbits), "an orbit closed in one gauge is open in another"


@pytest.mark.parametrize("gauge", full_but([horizontal, periodic, turned_on], horizontal, turned_on))
def test_each_gauge_has_orbits_of_its_own(gauge):
    check_joint_closure("satellite", 1, SIZES["satellite"], gauge)


def test_the_horizontal_orbits_of_the_cat():
    check_joint_closure("cat", 1, 0.3 * SIZES["cat"], horizontal)


@pytest.mark.full
@pytest.mark.parametrize("gauge", [horizontal, periodic, turned_on])
@pytest.mark.parametrize("name", THREE)
@pytest.mark.parametrize("seed", [1, 2])
def test_orbits_of_gauges(name: str, seed: int, gauge):
    check_joint_closure(name, seed, SIZES[name], gauge)


def test_orbits_of_the_base_are_open_in_the_horizontal_gauge():
    for motion in orbits_of("satellite"):
        assert sp.split(motion, "base").momentum_gap < 1e-10
        assert sp.split(motion).momentum_gap > 1e-3


def test_the_horizontal_gauge_splits_its_orbits_into_phase_and_holonomy():
    """Delta R = exp(theta_M mu^) R_G, theta_M of the horizontal gauge (theory.md section 2)."""
    seen = sp.horizontal_gauge(deformation_of("satellite"))
    for motion in sp.closed_orbits(seen, SIZES["satellite"]):
        again = sp.reconstruct(deformation_of("satellite"), motion.momentum, motion.initial_attitude, tolerance=1e-11)
        split = sp.split(again)
        assert split.momentum_gap < 1e-9
        assert apart(turn(UP, split.montgomery_phase) @ split.holonomy, split.total_rotation) < 1e-9


# ---- Branches ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "most"), full_but([("satellite", 2.0), ("cat", 0.5), ("example:human", 1.0)], ("cat", 0.5))
)
def test_a_branch_goes_through_fixed_points_found_afresh(name: str, most: float):
    deformation = deformation_of(name)
    sizes = most * SIZES[name] * np.array([0.0, 0.3, 0.7, 1.0])
    branch = continued_orbits(deformation, sizes)
    assert branch.stopped is None
    assert branch.fold is None
    np.testing.assert_array_equal(branch.magnitudes, sizes)
    turned = sp.reconstruct(deformation, np.zeros(3), tolerance=1e-12).final_attitude
    axis = np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]])
    np.testing.assert_allclose(branch.directions[0], axis / np.linalg.norm(axis), rtol=0, atol=1e-9)
    assert branch.trace[0] == pytest.approx(np.trace(turned) - 1.0, abs=1e-9)
    for size, point, trace in list(zip(branch.magnitudes, branch.directions, branch.trace))[1:]:
        found = fixed_points(deformation, float(size))
        distances = np.linalg.norm(found.directions - point, axis=1)
        assert distances.min() < 1e-9
        assert trace == pytest.approx(found.trace[np.argmin(distances)], abs=1e-7)
    h = 1e-3 * sizes[2]
    beside = continued_orbits(deformation, sizes[2] + h * np.array([-2.0, -1.0, 1.0, 2.0])).directions
    slope = (8.0 * (beside[2] - beside[1]) - (beside[3] - beside[0])) / (12.0 * h)
    np.testing.assert_allclose(branch.drift[2], slope, rtol=0, atol=1e-6 * np.linalg.norm(slope))
    last = continued_orbits(deformation, sizes[-1:])
    np.testing.assert_allclose(last.directions, branch.directions[-1:], rtol=0, atol=1e-9)
    back = continued_orbits(deformation, sizes[::-1], start=branch.directions[-1])
    np.testing.assert_allclose(back.directions, branch.directions[::-1], rtol=0, atol=1e-9)


def test_two_orbits_are_born_at_a_fold():
    """Followed downwards an orbit ends where another one does: test_at_a_fold_there_are_two_fixed_points_less."""
    found = points_of("example:human")
    sizes = np.linspace(SIZES["example:human"], 7.0, 5)
    branch = continued_orbits(deformation_of("example:human"), sizes, start=found.directions[FOLDING[0]])
    assert found.index[FOLDING].tolist() == [1, -1]
    assert branch.fold == pytest.approx(FOLD, rel=1e-9)
    assert branch.stopped is not None
    assert f"{branch.fold:.9g}" in branch.stopped
    assert "below there is neither" in branch.stopped
    np.testing.assert_array_equal(branch.magnitudes, sizes[sizes > FOLD])


@pytest.mark.full
def test_at_a_fold_there_are_two_fixed_points_less():
    """All orbits followed downwards: two end at the same size; below it there are two fixed points less."""
    deformation, name = deformation_of("example:human"), "example:human"
    found = points_of(name)
    branches = {
        row: continued_orbits(deformation, np.linspace(SIZES[name], 7.0, 5), start=point)
        for row, point in enumerate(found.directions)
    }
    ended = {row: branch for row, branch in branches.items() if branch.stopped is not None}
    assert list(ended) == FOLDING
    (one, first), (other, second) = ended.items()
    assert found.index[one] * found.index[other] == -1
    assert first.fold == pytest.approx(second.fold, rel=1e-9)
    assert first.fold is not None
    # By another route: near it size = fold + a excess^2 + b excess^3 + ..., on both sides of excess zero.
    apart_by = [fixed_points(deformation, first.fold * (1.0 + share)) for share in (1e-6, 4e-6)]
    near = [
        (one.magnitude, 2.0 - one.trace[row]) for one in apart_by for row in np.argsort(np.abs(2.0 - one.trace))[:2]
    ]
    sizes, excess = np.array(near).T
    fitted = np.linalg.solve(excess[:, None] ** np.array([0, 2, 3, 5]), sizes)[0]
    assert first.fold == pytest.approx(fitted, rel=1e-9)
    assert pytest.approx(fitted, rel=1e-9) == FOLD
    for branch in ended.values():
        assert branch.stopped is not None
        assert f"{branch.fold:.9g}" in branch.stopped
        assert "below there is neither" in branch.stopped
        assert 0 < len(branch.magnitudes) < 5
        assert branch.magnitudes[-1] > branch.fold
        assert len(branch.directions) == len(branch.trace) == len(branch.magnitudes)
    above = fixed_points(deformation, first.fold * (1.0 + 1e-5))
    below = fixed_points(deformation, first.fold * (1.0 - 1e-5))
    assert above.complete
    assert below.complete
    assert len(above.index) == len(below.index) + 2
    assert np.sort(np.abs(above.trace - 2.0))[1] < 0.1
    # Upwards from just above the fold the two come to where they were.
    for row in (one, other):
        near = np.argmin(np.where(above.index == found.index[row], np.abs(above.trace - 2.0), np.inf))
        up = continued_orbits(deformation, [above.magnitude, SIZES[name]], start=above.directions[near])
        np.testing.assert_allclose(up.directions[-1], found.directions[row], rtol=0, atol=1e-9)


def test_a_branch_passes_where_its_trace_only_touches_two():
    """The steady turn of a rigid body about its axis of most inertia, through several times 2 pi."""
    deformation = sp.rigid(np.diag(MOMENTS), 3.0)
    sizes = np.linspace(0.5, 12.0, 24)
    branch = continued_orbits(deformation, sizes, start=[0.01, -0.02, 1.0])
    assert branch.stopped is None
    np.testing.assert_allclose(branch.directions, np.tile(UP, (24, 1)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(branch.trace, [2.0 - steady_excess(2, size, 3.0) for size in sizes], rtol=0, atol=1e-9)
    assert branch.trace.min() < -1.9


def test_a_branch_passes_where_others_branch_off():
    """A body that breathes along its principal axes turns on steadily about one; in its resonances that is unstable.

    The linearised equation is integrated as it stands: p' = p x I^-1 p about (0, 0, size).
    """

    def moments(t: ArrayLike) -> Array:
        wave = np.cos(2.0 * np.pi * np.asarray(t))
        return np.stack([1.0 + 0.6 * wave, 1.4 + 0.0 * wave, 2.0 + 0.0 * wave], axis=-1)

    def trace(size: float) -> float:
        def slope(t: float, y: Array) -> Array:
            one, two, three = 1.0 / moments(t)
            return np.concatenate([size * (three - two) * y[2:], size * (one - three) * y[:2]])

        run = solve_ivp(slope, (0.0, 1.0), np.eye(2).ravel(), "DOP853", rtol=1e-12, atol=1e-13)
        return float(run.y[0, -1] + run.y[3, -1])

    deformation = sp.prescribed(lambda t: moments(t)[:, None] * np.eye(3), None, 1.0)
    sizes = np.linspace(8.0, 24.0, 33)
    branch = continued_orbits(deformation, sizes, start=UP)
    assert branch.stopped is None
    np.testing.assert_allclose(branch.directions, np.tile(UP, (33, 1)), rtol=0, atol=1e-8)
    np.testing.assert_allclose(branch.trace, [trace(size) for size in sizes], rtol=0, atol=1e-8)
    assert branch.trace.max() > 2.01
    assert branch.trace[0] < 2.0


def test_a_branch_that_is_lost_is_told(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("shapephase.phases.continuation._continues", lambda *_: False)
    branch = continued_orbits(deformation_of("satellite"), [0.0, 1.0])
    assert branch.stopped is not None
    assert "the orbit was lost between 0 and" in branch.stopped
    assert branch.fold is None
    np.testing.assert_array_equal(branch.magnitudes, [0.0])


def test_without_holonomy_no_branch_begins_at_rest():
    for deformation in (sp.rigid(np.diag(MOMENTS), 3.0), sp.horizontal_gauge(deformation_of("satellite"))):
        for start in (None, UP):
            with pytest.raises(TrajectoryError, match="direction"):
                continued_orbits(deformation, [0.0, 0.1], start=start)


def test_a_branch_needs_a_start_that_closes():
    with pytest.raises(ShapeError, match="closed"):
        continued_orbits(deformation_of("satellite"), [12.0, 13.0], start=many_directions()[0])
    with pytest.raises(ShapeError, match="direction"):
        continued_orbits(deformation_of("satellite"), [12.0, 13.0], start=many_directions())
    for sizes in ([], [1.0, 1.0], [1.0, 2.0, 1.5], [-1.0, 1.0], [[1.0]], 1.0):
        with pytest.raises(ShapeError, match="magnitudes"):
            continued_orbits(deformation_of("satellite"), sizes)


# ---- Arguments -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "ask",
    [
        sp.closed_orbits,
        fixed_points,
        lambda deformation, size: stroboscopic_map(deformation, size, UP),
        lambda deformation, size: continued_orbits(deformation, [size]),
    ],
)
def test_an_open_shape_has_no_closed_orbits(ask):
    body = body_of("cat_two_halves")
    path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    with pytest.raises(OpenPathError, match="ends"):
        ask(sp.articulated(body, path), 0.01)


@pytest.mark.parametrize("magnitude", [0.0, -1.0, np.nan, [1.0, 2.0]])
def test_a_magnitude_is_one_number_above_zero(magnitude):
    for ask in (sp.closed_orbits, fixed_points):
        with pytest.raises(ShapeError, match="magnitude"):
            ask(deformation_of("cat_two_halves"), magnitude)


@pytest.fixture(scope="module")
def unstable():
    """A loop along which errors grow some 300 times, and a magnitude of the momentum; of twice that, a thousand."""
    body = sp.load_body("cat")
    sines = np.random.default_rng(1).normal(size=(body.n_shape, 3)) * 0.3 / np.arange(1, 4)
    path = sp.ShapePath.fourier(np.zeros(body.n_shape), 0.0 * sines, sines, 1.0)
    return sp.articulated(body, path), 20.0 * np.trace(body.locked_inertia(np.zeros(body.n_shape))) / 3.0


@pytest.mark.full
def test_fixed_points_of_an_unstable_loop_close_by_another_integrator(unstable):
    deformation, magnitude = unstable
    found = sp.fixed_points(deformation, magnitude, most_directions=1000)
    assert 1e-11 <= found.tolerance <= 1e-9
    assert len(found.directions) >= 2
    for direction, gap in zip(found.directions, found.gap, strict=True):
        attitude = so3.between(direction, np.array([0.0, 0.0, 1.0]))
        check = sp.reconstruct(deformation, [0.0, 0.0, magnitude], attitude, method="dop853", tolerance=1e-6)
        end = check.body_momentum(1.0) / magnitude
        assert so3.angle_between(end, direction) <= gap + float(check.error_estimate)
