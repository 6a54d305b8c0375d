"""Every entry point that takes an array: odd but right arrays give the same answer, wrong ones a ShapeError."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

import shapephase as sp
from shapephase.errors import ShapeError

RNG = np.random.default_rng(5)


def single(array) -> np.ndarray:
    """Numbers that float32 holds too."""
    return np.asarray(array, dtype=np.float32).astype(np.float64)


@lru_cache(maxsize=1)
def body() -> sp.Body:
    return sp.load_body("satellite")


@lru_cache(maxsize=1)
def path() -> sp.ShapePath:
    n = body().n_shape
    rng = np.random.default_rng(1)
    return sp.ShapePath.fourier(np.full(n, 0.4), 0.2 * rng.normal(size=(n, 1)), 0.2 * rng.normal(size=(n, 1)), 2.0)


@lru_cache(maxsize=1)
def deformation() -> sp.Deformation:
    return sp.articulated(body(), path())


@lru_cache(maxsize=1)
def motion() -> sp.Motion:
    return sp.reconstruct(deformation(), [0.3, 0.2, 1.0])


def turned(angle: float) -> np.ndarray:
    """A rotation that float32 holds too: about z, by a Pythagorean triple."""
    c, s = 0.6, 0.8
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) if angle else np.eye(3)


SHAPE = single(RNG.uniform(0.1, 0.9, (2, 10)))
RATE = single(RNG.normal(size=(2, 10)))
VECTORS = single(RNG.normal(size=(2, 3)))
TIMES = single(np.linspace(0.0, 2.0, 6))
GRID = single([[0.0, 0.4], [0.7, -0.2], [1.0, 0.1], [0.2, 0.3], [0.0, 0.4], [0.1, 0.1]])

# name, the function of one array, an array that it takes
ENTRIES: list[tuple[str, Callable[[Any], Any], np.ndarray]] = [
    ("locked_inertia", lambda a: body().locked_inertia(a), SHAPE),
    ("momentum_matrix", lambda a: body().momentum_matrix(a), SHAPE),
    ("internal_momentum shape", lambda a: body().internal_momentum(a, RATE), SHAPE),
    ("internal_momentum rate", lambda a: body().internal_momentum(SHAPE, a), RATE),
    ("inertia_gradient", lambda a: body().inertia_gradient(a), SHAPE),
    ("momentum_matrix_gradient", lambda a: body().momentum_matrix_gradient(a), SHAPE),
    ("inertia_rate", lambda a: body().inertia_rate(a, RATE), SHAPE),
    ("angular_momentum_gradient", lambda a: body().angular_momentum_gradient(SHAPE, RATE, a), VECTORS),
    ("centre_of_mass", lambda a: body().centre_of_mass(a), SHAPE),
    ("link_pose", lambda a: body().link_pose(a, "wheel"), SHAPE),
    ("link_angular_velocity", lambda a: body().link_angular_velocity(SHAPE, a, "wheel"), RATE),
    ("mass_correlation", lambda a: body().mass_correlation(a, RATE, SHAPE[0])[0], SHAPE),
    ("mass_correlation reference", lambda a: body().mass_correlation(SHAPE, RATE, a)[1], SHAPE[1]),
    ("kinetic_energy", lambda a: body().kinetic_energy(SHAPE, a), RATE),
    ("kinetic_energy angular_velocity", lambda a: body().kinetic_energy(SHAPE, RATE, a), VECTORS),
    ("mechanical_connection", lambda a: sp.mechanical_connection(body(), a), SHAPE),
    ("curvature", lambda a: sp.curvature(body(), a), SHAPE),
    ("fourier mean", lambda a: sp.ShapePath.fourier(a, np.ones((6, 1)), np.ones((6, 1)), 1.0).shape(0.3), TIMES),
    ("fourier cosines", lambda a: sp.ShapePath.fourier(np.ones(6), a, GRID, 1.0).rate(0.3), GRID),
    ("spline times", lambda a: sp.ShapePath.spline(a, GRID).shape(0.3), TIMES),
    ("spline shapes", lambda a: sp.ShapePath.spline(TIMES, a).shape(0.3), GRID),
    ("waypoints", lambda a: sp.ShapePath.waypoints(TIMES, a).rate(0.3), GRID),
    ("path.shape", lambda a: path().shape(a), TIMES),
    ("path.rate", lambda a: path().rate(a), TIMES),
    ("rigid", lambda a: sp.rigid(a, 1.0).inertia(0.5), single(np.diag([1.0, 2.0, 2.5]))),
    (
        "particles",
        lambda a: sp.particles(
            a, lambda t: (np.ones((len(t), 3, 1)) * np.eye(3), np.zeros((len(t), 3, 3))), 1.0
        ).inertia(0.5),
        np.array([1.0, 2.0, 0.5]),
    ),
    ("deformation.inertia", lambda a: deformation().inertia(a), TIMES),
    ("deformation.internal_momentum", lambda a: deformation().internal_momentum(a), TIMES),
    ("deformation.kinetic_energy", lambda a: deformation().kinetic_energy(TIMES[:2], a), VECTORS),
    ("reconstruct momentum", lambda a: sp.reconstruct(deformation(), a).final_attitude, VECTORS),
    ("reconstruct attitude", lambda a: sp.reconstruct(deformation(), VECTORS[0], a).final_attitude, turned(0.0)),
    ("momentum_from_rate", lambda a: sp.momentum_from_rate(deformation(), a), VECTORS),
    ("motion.attitude", lambda a: motion().attitude(a), TIMES),
    ("motion.body_momentum", lambda a: motion().body_momentum(a), TIMES),
    ("motion.angular_velocity", lambda a: motion().angular_velocity(a), TIMES),
    ("motion.base_position", lambda a: motion().base_position(1.0, start=a), VECTORS[0]),
    ("motion.dynamic_phase", lambda a: motion().dynamic_phase(a), TIMES),
    ("motion.solid_angle", lambda a: motion().solid_angle(a), TIMES),
    ("running_phases", lambda a: sp.running_phases(motion(), a).montgomery_phase, TIMES),
    ("arc_phases", lambda a: sp.arc_phases(motion(), a).montgomery_phase, TIMES),
    ("parallel_transport", lambda a: sp.parallel_transport(motion(), a), TIMES),
    ("is_flat", lambda a: sp.is_flat(body(), a), SHAPE),
    ("curvature_on_plane first", lambda a: sp.curvature_on_plane(body(), ("arm_1", "arm_2"), a, [0.1]), TIMES),
    ("curvature_on_plane shape", lambda a: sp.curvature_on_plane(body(), (0, 1), [0.0], [0.1], a), SHAPE[0]),
    ("stokes_holonomy centre", lambda a: sp.stokes_holonomy(body(), path(), 1e-6, a), SHAPE[0]),
    ("horizontal_lift.attitude", lambda a: sp.horizontal_lift(body(), path()).attitude(a), TIMES),
    ("base_difference times", lambda a: sp.base_difference(motion(), a, np.stack([np.eye(3)] * 6)).angle, TIMES),
    (
        "base_difference attitudes",
        lambda a: sp.base_difference(motion(), TIMES[:2], a).angle,
        np.stack([np.eye(3), turned(0.0)]),
    ),
    (
        "prescribed inertia",
        lambda a: sp.prescribed(lambda _: a, None, 1.0).inertia([0.0, 1.0]),
        np.stack([np.eye(3)] * 2),
    ),
    (
        "prescribed momentum",
        lambda a: sp.prescribed(lambda t: np.stack([np.eye(3)] * len(t)), lambda _: a, 1.0).internal_momentum(
            [0.0, 1.0]
        ),
        VECTORS,
    ),
    ("stroboscopic_map", lambda a: sp.stroboscopic_map(deformation(), 1.0, a).end, VECTORS),
    ("continued_orbits", lambda a: sp.continued_orbits(deformation(), a).directions, single([0.0, 0.1, 0.2])),
    ("EulerTop inertia", lambda a: sp.EulerTop(a, [0.3, 0.2, 1.0]).period, single(np.diag([1.0, 2.0, 2.5]))),
    ("EulerTop momentum", lambda a: sp.EulerTop(np.diag([1.0, 2.0, 2.5]), a).montgomery_phase, VECTORS[0]),
    ("EulerTop attitude", lambda a: sp.EulerTop(np.eye(3), [0.3, 0.2, 1.0], a).attitude(0.5), turned(0.0)),
    ("EulerTop.principal", lambda a: sp.EulerTop.principal(a, [0.3, 0.2, 1.0]).solid_angle, single([1.0, 2.0, 2.5])),
    ("top.attitude", lambda a: sp.EulerTop(np.diag([1.0, 2.0, 2.5]), [0.3, 0.2, 1.0]).attitude(a), TIMES),
    ("top.body_momentum", lambda a: sp.EulerTop(np.diag([1.0, 2.0, 2.5]), [0.3, 0.2, 1.0]).body_momentum(a), TIMES),
]
OPTIONAL = [
    function
    for name, function, _ in ENTRIES
    if name
    in ("reconstruct attitude", "EulerTop attitude", "is_flat", "curvature_on_plane shape", "stokes_holonomy centre")
]
IDS = [name for name, *_ in ENTRIES]


@pytest.mark.parametrize(("function", "good"), [entry[1:] for entry in ENTRIES], ids=IDS)
def test_odd_arrays_with_the_same_numbers(function, good):
    want = function(good)
    read_only = good.copy()
    read_only.setflags(write=False)
    spread = np.zeros((*good.shape[:-1], 2 * good.shape[-1]))
    spread[..., ::2] = good
    for odd in (
        good.astype(">f8"),
        good.astype(np.float32),
        good.astype(">f4"),
        read_only,
        spread[..., ::2],
        np.asfortranarray(good),
        good[..., ::-1].copy()[..., ::-1],
        good.tolist(),
        np.ma.MaskedArray(good, mask=False),
    ):
        np.testing.assert_array_equal(function(odd), want)


@pytest.mark.parametrize(("function", "good"), [entry[1:] for entry in ENTRIES], ids=IDS)
def test_wrong_arrays_are_refused(function, good):
    first = (0,) * good.ndim
    masked = np.ma.MaskedArray(good.copy(), mask=np.zeros(good.shape, bool))
    masked[first] = np.ma.masked
    broken = {}
    for value in (np.nan, np.inf, -np.inf):
        broken[value] = good.copy()
        broken[value][first] = value
    for wrong in (
        masked,
        *broken.values(),
        good.astype(object),
        good.astype(complex),
        good.astype(str),
        None,
        "text",
        [[1.0, 2.0], [3.0]],
        {"a": 1.0},
        good.astype("datetime64[s]") if good.dtype == int else np.array(["2020-01-01"], dtype="datetime64[s]"),
    ):
        if wrong is None and function in OPTIONAL:
            continue
        with pytest.raises(ShapeError):
            function(wrong)


# Those that take times take them in any shape; all others have a fixed last axis.
FIXED = [
    entry
    for entry in ENTRIES
    if not entry[0].startswith(
        ("path.", "top.", "motion.attitude", "motion.body", "motion.ang", "motion.dyn", "motion.solid")
    )
    and entry[0]
    not in (
        "deformation.inertia",
        "deformation.internal_momentum",
        "running_phases",
        "parallel_transport",
        "horizontal_lift.attitude",
    )
]

# A path may have any number of joints, a series any number of terms.
ANY_WIDTH = [
    function
    for name, function, _ in ENTRIES
    if name in ("spline shapes", "waypoints", "fourier cosines", "curvature_on_plane first")
]


@pytest.mark.parametrize(("function", "good"), [entry[1:] for entry in FIXED], ids=[entry[0] for entry in FIXED])
def test_wrong_shapes_are_refused(function, good):
    columns = () if function in ANY_WIDTH else (good[..., :0], np.concatenate([good, good], axis=-1)[..., :-1])
    for wrong in (good[..., None], *columns, np.zeros((2, 0, 7))):
        with pytest.raises((ShapeError, sp.errors.TrajectoryError)):
            function(wrong)
