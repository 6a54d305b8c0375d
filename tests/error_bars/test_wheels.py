"""Error bars and exact derivatives of motions with wheels, against motions reconstructed anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, UnknownNameError
from support.gyroscope import AXLE, gyroscope
from support.long_runs import full_but

_NEAR = 1e-6  # of central differences with motions at 1e-12
_START = so3.exp(np.array([0.2, 0.3, -0.4]))
_MOMENTUM = np.array([0.15, -0.25, 0.5])
_TIMES = np.array([0.0, 0.1, 0.25, 0.4, 0.5, 0.65, 0.8, 0.9, 1.0])
_SAMPLES = 0.4 * np.random.default_rng(5).normal(size=(9, 2))
_JOINTS = ("slide", "swing")
_VALUES = {"gyro": 0.4, "fly": 30.0}
ROTATIONS = (
    "final_attitude",
    "total_rotation",
    "holonomy",
    "dynamical_rotation",
    "wheel_rotation",
    "momentum_rotation",
)
PHASES = ("dynamic_phase", "solid_angle", "montgomery_phase")


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> sp.Body:
    return gyroscope(tmp_path_factory.mktemp("body"))


def motion_of(
    body: sp.Body,
    *,
    samples: np.ndarray = _SAMPLES,
    values: dict[str, float] = _VALUES,
    momentum: np.ndarray = _MOMENTUM,
    start: np.ndarray = _START,
    kind: str = "spline",
    tolerance: float = 1e-12,
) -> sp.Motion:
    if kind == "periodic":
        samples = np.concatenate([samples[:-1], samples[:1]])
    path = sp.ShapePath.spline(_TIMES, samples, periodic=kind == "periodic", joint_names=_JOINTS)
    # The first wheel's momentum changes in time; what is uncertain is a constant that is added to it.
    gyro = (_TIMES[::2], values["gyro"] + 0.2 * np.sin(5.0 * _TIMES[::2]))
    wheels = {"rotors": {"gyro": gyro}, "rotor_speeds": {"fly": values["fly"]}}
    return sp.reconstruct(sp.articulated(body, path, **wheels), momentum, start, tolerance=tolerance)


def difference(motion: Callable[[float], sp.Motion], step: float) -> np.ndarray:
    ahead, behind = motion(step), motion(-step)
    parts = sp.split(ahead), sp.split(behind)
    turns = [so3.log(ahead.final_attitude @ behind.final_attitude.T)]
    turns += [so3.log(getattr(parts[0], name) @ getattr(parts[1], name).T) for name in ROTATIONS[1:]]
    return np.concatenate([*turns, [getattr(parts[0], name) - getattr(parts[1], name) for name in PHASES]]) / (2 * step)


def column_of(derivative: sp.ResultDerivative, column: int) -> np.ndarray:
    turns = [getattr(derivative, name)[:, column] for name in ROTATIONS]
    return np.concatenate([*turns, [getattr(derivative, name)[column] for name in PHASES]])


def agree(found: np.ndarray, expected: np.ndarray) -> None:
    """To rounding of the differences in each rotation and each phase."""
    for result in np.split(np.arange(len(found)), [3, 6, 9, 12, 15, 18, 19, 20]):
        assert np.linalg.norm((found - expected)[result]) < _NEAR * np.linalg.norm(expected), result


@pytest.mark.parametrize("momentum", [_MOMENTUM, np.zeros(3)])
def test_by_values_of_wheels_momentum_and_start(body: sp.Body, momentum: np.ndarray):
    found = sp.derivatives(motion_of(body, momentum=momentum))
    for column, joint in enumerate(_VALUES):

        def faster(h: float, joint: str = joint) -> sp.Motion:
            return motion_of(body, momentum=momentum, values=_VALUES | {joint: _VALUES[joint] + h})

        agree(column_of(found.by_rotors, column), difference(faster, 1e-3 * _VALUES[joint]))
    for axis, unit in enumerate(np.eye(3)):
        turned = difference(lambda h, e=unit: motion_of(body, momentum=momentum, start=_START @ so3.exp(h * e)), 1e-4)
        agree(column_of(found.by_attitude, axis), turned)
        if momentum.any():
            pushed = difference(lambda h, e=unit: motion_of(body, momentum=momentum + h * e), 1e-4)
            agree(column_of(found.by_momentum, axis), pushed)


@pytest.mark.parametrize("kind", ["spline", "periodic"])
def test_by_samples(body: sp.Body, kind: str):
    derived = sp.derivatives(motion_of(body, kind=kind))
    found, joints = derived.by_samples, derived.path.joint_names
    assert found.wheel_rotation.shape == (3, 2 * (9 - (kind == "periodic")))
    for sample, joint in ((0, 0), (1, 1), (4, 0), (7, 1)):

        def moved(h: float, place: tuple[int, int] = (sample, joint)) -> sp.Motion:
            samples = _SAMPLES.copy()
            samples[place] += h
            return motion_of(body, kind=kind, samples=samples)

        column = 2 * sample + joints.index(_JOINTS[joint])
        agree(column_of(found, column), difference(moved, 1e-4))


@pytest.mark.parametrize("link", ["boom", "rim", "disc"])
def test_by_inertias(body: sp.Body, link: str):
    """A wheel's own moment counts where it keeps its momentum, too: by what it takes from the inertia."""
    found = sp.derivatives(motion_of(body)).by_inertias
    part = next(part for part in body.moving_parts if link in part.links)
    frame, pose = body.chain.link_frames[link]
    assert np.abs(pose[:3, :3] - np.eye(3)).max() < 1e-15

    def with_inertia(**given: Any) -> sp.Motion:
        return motion_of(body.with_inertias(**{name: {link: value} for name, value in given.items()}))

    axle = {"rim": AXLE, "disc": np.array([0.0, 1.0, 0.0])}.get(link, np.array([0.8, 0.0, 0.6]))
    columns = [column_of(found, 10 * frame + k) for k in range(10)]
    mass = 1e-4 * part.mass
    agree(columns[0], difference(lambda h: with_inertia(masses=part.mass + h), mass))
    along = difference(lambda h: with_inertia(centres=part.centre + h * axle), 1e-5)
    agree(part.mass * sum(axle[k] * columns[1 + k] for k in range(3)), along)
    for tensor in (np.outer(axle, axle), np.eye(3)):
        six = tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]]
        expected = difference(lambda h, e=tensor: with_inertia(inertias=part.inertia + h * e), 1e-4)
        by_tensor = sum(six[k] * columns[4 + k] for k in range(6))
        if link == "rim" and tensor[0, 0] != 1.0:
            # Its momentum is given: the moment that it turns with has no part in anything else.
            assert np.abs(by_tensor).max() < 1e-10 > np.abs(expected).max()
        else:
            agree(by_tensor, expected)


_NOISE: dict[str, dict[str, Any]] = {
    "joints": {"joints": 0.01},
    "inertias": {"inertias": sp.InertiaErrors(masses=0.03, centres=0.02, inertias=0.03)},
    "rotors": {"rotors": {"gyro": 0.01, "fly": 0.5}},
    "all": {
        "joints": 0.005,
        "inertias": sp.InertiaErrors(masses=0.02),
        "momentum": 0.005,
        "attitude": 0.005,
        "rotors": {"gyro": 0.01, "fly": 0.5},
    },
}


@pytest.mark.parametrize(
    ("source", "draws"),
    full_but([("inertias", 60), ("all", 60), *((name, 1000) for name in _NOISE)], ("inertias", 60), ("all", 60)),
)
def test_bars_are_what_draws_show(body: sp.Body, source: str, draws: int):
    """Four standard errors of a standard deviation, and 1 % for the second order: of 1,000 draws 10 %."""
    motion = motion_of(body, tolerance=1e-8)
    first = sp.uncertainty(motion, **_NOISE[source])
    drawn = sp.sampled_uncertainty(motion, **_NOISE[source], draws=draws, seed=3)
    allowed = 4.0 / np.sqrt(2.0 * draws) + 0.01
    for name in ROTATIONS:
        bars, expected = (np.sqrt(np.diag(getattr(found, name))) for found in (first, drawn))
        assert np.abs(bars - expected).max() <= allowed * np.linalg.norm(expected) + 1e-7, name
    for name in (*PHASES, "total_angle", "holonomy_angle", "wheel_angle"):
        bar, expected = getattr(first, name), getattr(drawn, name)
        assert abs(bar - expected) <= allowed * expected + 1e-7, name


def test_wheels_that_are_not_there(body: sp.Body):
    motion = motion_of(body, tolerance=1e-6)
    with pytest.raises(UnknownNameError, match="swing"):
        sp.uncertainty(motion, rotors={"swing": 0.1})
    with pytest.raises(ShapeError, match="not negative"):
        sp.uncertainty(motion, rotors=-0.1)
    cat = sp.reconstruct(sp.articulated(sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.0, 0.5)), np.zeros(3))
    with pytest.raises(ShapeError, match="no wheels"):
        sp.uncertainty(cat, rotors=0.1)
    assert not sp.uncertainty(cat, momentum=0.001).wheel_rotation.any()
