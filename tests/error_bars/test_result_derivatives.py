"""Exact derivatives of a motion's results, against central differences of motions reconstructed anew."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import shapephase as sp
from shapephase import so3
from shapephase.body import Coupling
from shapephase.errors import ShapeError, WrongObjectError
from shapephase.shape_space.path_samples import path_samples
from support.coupled_bodies import LEG, TURN, couplings

# What is computed is the same with and without machine code, which is quicker.

# Of central differences with motions at 1e-12: their error is some 1e-12 over the step, and the step squared.
_NEAR = 1e-6
_MOMENTA = {"cat": 0.02, "astronaut": 5.0, "diver": 20.0, "example:human": 12.0}
HUMAN = pytest.param("example:human", marks=pytest.mark.full)


def path_of(name: str, kind: str, values: np.ndarray | None = None) -> sp.ShapePath:
    samples = samples_of(name) if values is None else values
    times = np.array([0.0, 0.1, 0.25, 0.4, 0.5, 0.65, 0.8, 0.9, 1.0])
    if kind == "periodic":
        return sp.ShapePath.spline(times, np.concatenate([samples[:-1], samples[:1]]), periodic=True)
    if kind == "waypoints":
        return sp.ShapePath.waypoints(times, samples)
    return sp.ShapePath.spline(times, samples, periodic=False)


@lru_cache
def samples_of(name: str) -> np.ndarray:
    return 0.3 * np.random.default_rng(5).normal(size=(9, sp.load_body(name).n_shape))


def momentum_of(name: str) -> np.ndarray:
    return _MOMENTA[name] * np.array([0.3, -0.5, 1.0])


START = so3.exp(np.array([0.2, 0.3, -0.4]))


def motion_of(
    name: str,
    kind: str = "spline",
    *,
    values: np.ndarray | None = None,
    momentum: np.ndarray | None = None,
    start: np.ndarray = START,
    body: sp.Body | None = None,
) -> sp.Motion:
    shape_path = path_of(name, kind, values)
    deformation = sp.articulated(sp.load_body(name) if body is None else body, shape_path)
    given = momentum_of(name) if momentum is None else momentum
    return sp.reconstruct(deformation, given, start, tolerance=1e-12)


def flat(derivative: sp.ResultDerivative, column: int | slice) -> np.ndarray:
    turns = [getattr(derivative, name)[:, column] for name in ROTATIONS]
    return np.concatenate([*turns, np.array([getattr(derivative, name)[column] for name in PHASES])])


ROTATIONS = ("final_attitude", "total_rotation", "holonomy", "dynamical_rotation")
PHASES = ("dynamic_phase", "solid_angle", "montgomery_phase")


def difference(motion: Callable[[float], sp.Motion], step: float) -> np.ndarray:
    ahead, behind = motion(step), motion(-step)
    split_ahead, split_behind = sp.split(ahead), sp.split(behind)
    turns = [so3.log(ahead.final_attitude @ behind.final_attitude.T)]
    turns += [so3.log(getattr(split_ahead, name) @ getattr(split_behind, name).T) for name in ROTATIONS[1:]]
    phases = [getattr(split_ahead, name) - getattr(split_behind, name) for name in PHASES]
    return np.concatenate([*turns, phases]) / (2.0 * step)


def agree(found: np.ndarray, expected: np.ndarray) -> None:
    assert np.abs(found - expected).max() < _NEAR * np.linalg.norm(expected)


@pytest.mark.parametrize("name", ["cat", pytest.param("astronaut", marks=pytest.mark.full), HUMAN])
def test_by_momentum_and_start(name: str):
    found, momentum = sp.derivatives(motion_of(name)), momentum_of(name)
    for axis, unit in enumerate(np.eye(3)):
        by_momentum = difference(lambda h, e=unit: motion_of(name, momentum=momentum + h * e), 1e-4 * _MOMENTA[name])
        agree(flat(found.by_momentum, axis), by_momentum)
        agree(
            flat(found.by_attitude, axis),
            difference(lambda h, e=unit: motion_of(name, start=START @ so3.exp(h * e)), 1e-4),
        )


@pytest.mark.parametrize("name", ["cat", "astronaut"])
def test_the_end_answers_as_the_derivative_of_the_steps_says(name: str):
    """An independent derivative: that of the Runge-Kutta steps themselves."""
    motion = motion_of(name)
    found, steps = sp.derivatives(motion), motion.sensitivity
    scale = np.linalg.norm(steps.by_momentum)
    np.testing.assert_allclose(
        found.by_momentum.final_attitude, motion.final_attitude @ steps.by_momentum, rtol=0, atol=1e-9 * scale
    )
    np.testing.assert_allclose(found.by_attitude.final_attitude, motion.final_attitude @ steps.by_attitude, atol=1e-8)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("cat", "spline"),
        ("cat", "periodic"),
        ("diver", "waypoints"),
        ("astronaut", "spline"),
        pytest.param("example:human", "spline", marks=pytest.mark.full),
    ],
)
def test_by_samples(name: str, kind: str):
    motion, samples = motion_of(name, kind), samples_of(name)
    found = sp.derivatives(motion).by_samples
    width = samples.shape[1]
    count = len(samples) - (kind == "periodic")
    assert found.total_rotation.shape == (3, count * width)
    for sample, joint in ((0, 0), (1, width // 2), (4, width - 1), (count - 1, width // 3)):

        def moved(h: float, place: tuple[int, int] = (sample, joint)) -> sp.Motion:
            values = samples.copy()
            values[place] += h
            return motion_of(name, kind, values=values)

        agree(flat(found, sample * width + joint), difference(moved, 1e-4))


@pytest.mark.parametrize("name", ["cat", "astronaut", HUMAN])
@pytest.mark.parametrize("part", [0, 3])
def test_by_inertias(name: str, part: int):
    body = sp.load_body(name)
    found = sp.derivatives(motion_of(name)).by_inertias
    moving = body.moving_parts[part]
    link = moving.links[0]
    frame, pose = body.chain.link_frames[link]
    # From axes of the frame, in which the derivatives are, to those of the link.
    turn = pose[:3, :3].T

    def heavier(h: float) -> sp.Motion:
        return motion_of(name, body=body.with_inertias(masses={link: moving.mass + h}))

    def elsewhere(h: float) -> sp.Motion:
        return motion_of(name, body=body.with_inertias(centres={link: moving.centre + h * turn[:, 1]}))

    def skewed(h: float) -> sp.Motion:
        entry = np.outer(turn[:, 0], turn[:, 1])
        tensor = moving.inertia + h * (entry + entry.T)
        return motion_of(name, body=body.with_inertias(inertias={link: tensor}, on_unphysical="allow"))

    agree(flat(found, 10 * frame), difference(heavier, 1e-4 * moving.mass))
    agree(moving.mass * flat(found, 10 * frame + 2), difference(elsewhere, 1e-5))
    agree(flat(found, 10 * frame + 9), difference(skewed, 1e-4 * float(np.trace(moving.inertia))))


def test_without_momentum_the_loop_answers_as_its_curvature_says():
    """By samples, the holonomy's derivative is an integral of the curvature of the connection: another formula."""
    body, path = sp.load_body("cat"), path_of("cat", "periodic")
    motion = sp.reconstruct(sp.articulated(body, path), np.zeros(3), tolerance=1e-12)
    found = sp.derivatives(motion).by_samples
    columns = [(3, 2), (0, 7)]
    base = path_samples(path)

    def variation(times: np.ndarray) -> np.ndarray:
        values = np.zeros((len(times), len(columns), body.n_shape))
        for row, (sample, joint) in enumerate(columns):
            unit = np.zeros((base.count + 1, 1))
            unit[sample] = 1.0
            unit[-1] = unit[0]
            values[:, row, joint] = CubicSpline(path.breaks, unit, bc_type="periodic")(times)[:, 0]
        return values

    holonomy, expected = sp.holonomy_derivative(body, path, variation, 1e-11)
    np.testing.assert_allclose(sp.split(motion).holonomy, holonomy, atol=1e-11)
    for row, (sample, joint) in enumerate(columns):
        agree(found.holonomy[:, sample * body.n_shape + joint], expected[row])
        agree(found.total_rotation[:, sample * body.n_shape + joint], expected[row])
    assert not found.dynamical_rotation.any()
    assert not found.montgomery_phase.any()


@pytest.mark.parametrize("kind", ["spline", "periodic", "waypoints"])
@pytest.mark.parametrize("count", [2, 3, 4, 5, 12])
def test_sums_along_a_path_by_its_samples(kind: str, count: int):
    """Against the polynomials through each unit sample, from SciPy."""
    if kind == "periodic" and count < 4:
        return
    rng = np.random.default_rng(count)
    times = np.cumsum(rng.uniform(0.2, 1.0, count)) - 0.1
    times -= times[0]
    values = rng.normal(size=(count, 2))
    if kind == "periodic":
        values[-1] = values[0]
    make = sp.ShapePath.waypoints if kind == "waypoints" else sp.ShapePath.spline
    path = make(times, values)
    samples = path_samples(path)
    at = rng.uniform(0.0, times[-1], 40)
    by_shape, by_rate = rng.normal(size=(2, 40, 3, 2))
    found = samples.derivative(at, by_shape, by_rate).reshape(3, samples.count, 2)
    np.testing.assert_allclose(samples.values, values[: samples.count], atol=1e-14)
    for sample in range(samples.count):
        for joint in range(2):
            unit = np.zeros((samples.count, 2))
            unit[sample, joint] = 1.0
            shapes, rates = samples.path_through(unit).curve(at)
            expected = np.einsum("nkj,nj->k", by_shape, shapes) + np.einsum("nkj,nj->k", by_rate, rates)
            size = np.abs(by_shape).sum() + np.abs(by_rate).sum() * (1.0 + np.abs(rates).max())
            np.testing.assert_allclose(found[:, sample, joint], expected, atol=64 * np.finfo(float).eps * size)


def test_joints_of_a_path_may_be_in_another_order():
    body = sp.load_body("diver")
    times, values = np.linspace(0.0, 1.0, 6), np.random.default_rng(2).normal(size=(6, 2))
    names = body.joint_names
    straight = sp.ShapePath.spline(times, values, joint_names=names)
    turned = sp.ShapePath.spline(times, values[:, ::-1], joint_names=names[::-1])
    first, second = (
        sp.derivatives(sp.reconstruct(sp.articulated(body, path), [3.0, 4.0, 5.0])).by_samples.holonomy
        for path in (straight, turned)
    )
    np.testing.assert_allclose(first, second, atol=1e-12)


def test_what_has_no_such_derivatives_is_refused():
    body = sp.load_body("diver")
    loop = sp.ShapePath.fourier(np.zeros(2), np.ones((2, 1)), np.ones((2, 1)), 1.0)
    motion = sp.reconstruct(sp.articulated(body, loop), [1.0, 2.0, 3.0])
    assert sp.derivatives(motion).by_momentum.final_attitude.shape == (3, 3)
    with pytest.raises(WrongObjectError, match="through"):
        _ = sp.derivatives(motion).by_samples
    with pytest.raises(ShapeError, match="reconstruct"):
        sp.derivatives(sp.reconstruct(sp.articulated(body, loop), np.eye(3)))
    with pytest.raises(WrongObjectError, match="articulated"):
        sp.derivatives(sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 2.5]), 1.0), [1.0, 2.0, 3.0]))


def leg_motion(load_urdf, turn, values: np.ndarray) -> sp.Motion:
    body = load_urdf(LEG).with_couplings(couplings(turn))
    path = sp.ShapePath.spline(np.linspace(0.0, 1.0, len(values)), values, periodic=False)
    return sp.reconstruct(sp.articulated(body, path), [0.5, -0.3, 0.8], START, tolerance=1e-12)


def test_by_samples_through_the_knots_of_a_coupling(load_urdf):
    """Times at which the knee goes through knots move with the samples."""
    samples = np.array([[0.1, -0.8], [0.3, -0.1], [-0.2, 0.3], [0.2, 0.9], [0.4, 0.4]])
    turn = TURN["spline"][0]
    found = sp.derivatives(leg_motion(load_urdf, turn, samples)).by_samples
    for sample, joint in ((1, 1), (3, 1)):

        def moved(h: float, place: tuple[int, int] = (sample, joint)) -> sp.Motion:
            values = samples.copy()
            values[place] += h
            return leg_motion(load_urdf, turn, values)

        agree(flat(found, sample * 2 + joint), difference(moved, 1e-4))
    line = Coupling.piecewise_linear("knee", [0.0, 0.5, 1.0], [0.0, 0.3, 0.2])
    with pytest.raises(ShapeError, match="patella_turn"):
        _ = sp.derivatives(leg_motion(load_urdf, line, samples)).by_samples
