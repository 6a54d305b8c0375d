"""Momenta that close together with the shape: found, complete, and closed for other engines too."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

import shapephase as sp
from independent import BODIES, apart, body_of, pinocchio_motion, random_loop, turn
from shapephase.errors import OpenPathError, ShapeError

# Less for the diver, who at his usual momentum turns so fast that the map mixes the sphere.
SIZES = {**BODIES, "diver": 2.0}


@lru_cache(maxsize=8)
def deformation_of(name: str) -> sp.Deformation:
    body = body_of(name)
    return sp.articulated(body, random_loop(1, body.n_shape).path)


@lru_cache(maxsize=8)
def orbits_of(name: str) -> list[sp.Motion]:
    return sp.closed_orbits(deformation_of(name), SIZES[name])


def directions(orbits: list[sp.Motion]) -> np.ndarray:
    starts = np.array([motion.body_momentum(0.0) for motion in orbits])
    return starts / np.linalg.norm(starts, axis=1, keepdims=True)


def index_of(deformation: sp.Deformation, size: float, direction: np.ndarray) -> float:
    """2 - trace of the linearised map on the sphere, by differences; its sign is the index of the fixed point."""
    across = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    first = across / np.linalg.norm(across)
    basis = np.stack([first, np.cross(direction, first)])
    h = 1e-4
    starts = np.array([np.cos(h) * direction + sign * np.sin(h) * e for e in basis for sign in (1.0, -1.0)])
    attitudes = np.array([attitude_showing(u) for u in starts])
    ends = sp.reconstruct(deformation, [0.0, 0.0, size], attitudes, tolerance=1e-9).body_momentum(deformation.duration)
    slopes = (ends[0::2] - ends[1::2]) / (2.0 * h * size)
    return 2.0 - float(np.trace(basis @ slopes.T))


def attitude_showing(direction: np.ndarray) -> np.ndarray:
    """R with R^T z = direction."""
    axis = np.cross(direction, [0.0, 0.0, 1.0])
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return np.eye(3) if direction[2] > 0.0 else turn([1.0, 0.0, 0.0], np.pi)
    return turn(axis, np.arctan2(sine, direction[2]))


@pytest.mark.parametrize("name", SIZES)
def test_orbits_close(name: str):
    orbits = orbits_of(name)
    assert len(orbits) >= 2, "an area-preserving map of the sphere has two fixed points or more"
    for motion in orbits:
        np.testing.assert_array_equal(motion.momentum, [0.0, 0.0, SIZES[name]])
        gap = motion.body_momentum(motion.duration) - motion.body_momentum(0.0)
        assert np.linalg.norm(gap) < 1e-9 * SIZES[name]
        assert sp.split(motion, "base").momentum_gap < 1e-9


@pytest.mark.parametrize("name", ["cat", "satellite", "example:human"])
def test_orbits_close_for_pinocchio(name: str):
    body, motion = body_of(name), orbits_of(name)[0]
    loop = random_loop(1, body.n_shape)
    truth = pinocchio_motion(name, body.joint_names, loop, motion.momentum, motion.initial_attitude)
    assert truth.gap["base"] < 1e-9


@pytest.mark.parametrize("name", SIZES)
def test_orbits_are_apart_and_in_order(name: str):
    points = directions(orbits_of(name))
    distances = np.linalg.norm(points[:, None] - points[None], axis=-1) + 2.0 * np.eye(len(points))
    assert distances.min() > 1e-6
    assert np.all(np.diff(points[:, 2]) <= 0.0)


@pytest.mark.parametrize("name", ["cat", "satellite", "example:human"])
def test_no_orbit_of_a_gentle_motion_is_missing(name: str):
    """Lefschetz: the indices of all fixed points of the map sum to 2 (theory.md section 2)."""
    indices = [np.sign(index_of(deformation_of(name), SIZES[name], point)) for point in directions(orbits_of(name))]
    assert sum(indices) == 2.0


def test_a_rigid_body_within_its_shortest_period_has_only_its_steady_turns():
    """Centres for the greatest and the least moment (index 1), saddles between (index -1)."""
    deformation = sp.rigid(np.diag([1.0, 2.0, 3.0]), 3.0)
    points = directions(sp.closed_orbits(deformation, 1.0))
    assert len(points) >= 2
    sizes = np.sort(np.abs(points), axis=1)
    np.testing.assert_allclose(sizes, np.tile([0.0, 0.0, 1.0], (len(points), 1)), rtol=0, atol=1e-9)
    indices = {tuple(np.round(p).astype(int)): np.sign(index_of(deformation, 1.0, p)) for p in points}
    assert len(indices) == len(points)
    for axis, index in indices.items():
        assert index == (-1.0 if axis[1] else 1.0)


def test_orbits_of_a_body_whose_momentum_vanishes_are_those_of_its_holonomy():
    """For little momentum the map is the inverse holonomy, whose fixed points are both ends of its axis."""
    deformation = deformation_of("cat_two_halves")
    holonomy = sp.split(sp.reconstruct(deformation, np.zeros(3))).holonomy
    points = directions(sp.closed_orbits(deformation, 1e-8))
    assert len(points) == 2
    np.testing.assert_allclose(points @ holonomy.T, points, rtol=0, atol=1e-5)


def test_the_horizontal_gauge_has_orbits_of_its_own():
    deformation = deformation_of("satellite")
    seen = sp.horizontal_gauge(deformation)
    orbits = sp.closed_orbits(seen, SIZES["satellite"], tolerance=1e-10)
    assert len(orbits) >= 2
    for motion in orbits:
        start = motion.initial_attitude
        again = sp.reconstruct(deformation, motion.momentum, start, tolerance=1e-10)
        assert apart(motion.final_attitude @ seen.frame(2.0), again.final_attitude) < 1e-9
        assert sp.split(again).momentum_gap < 1e-9
        assert sp.split(again, "base").momentum_gap > 1e-3


def test_an_open_shape_has_no_closed_orbits():
    body = body_of("cat_two_halves")
    path = sp.ShapePath.waypoints([0.0, 1.0], [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]])
    with pytest.raises(OpenPathError, match=r"ends 0\.5 off"):
        sp.closed_orbits(sp.articulated(body, path), 0.01)


@pytest.mark.parametrize("magnitude", [0.0, -1.0, np.nan, [1.0, 2.0]])
def test_a_magnitude_is_one_number_above_zero(magnitude):
    with pytest.raises(ShapeError, match="magnitude"):
        sp.closed_orbits(deformation_of("cat_two_halves"), magnitude)
