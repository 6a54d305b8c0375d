"""Error bars under a torque, against central differences and draws of motions reconstructed anew."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, WrongObjectError
from support.gyroscope import gyroscope
from support.long_runs import full_but

_NEAR = 1e-6  # of central differences with motions at 1e-11
_START = so3.exp(np.array([0.2, 0.3, -0.4]))
_MOMENTUM = np.array([0.15, -0.25, 0.5])
_TIMES = np.array([0.0, 0.3, 0.7, 1.0])
_SAMPLES = 0.4 * np.random.default_rng(5).normal(size=(4, 2))
_VALUES = {"gyro": 0.4, "fly": 30.0}
_UNIT = np.array([0.48, -0.6, 0.64])


def push(state: sp.TorqueState) -> list[float]:
    return [0.4 * np.sin(5.0 * state.time), -0.3, 0.5 * (state.time < 0.3)]


TORQUES = {axes: sp.ExternalTorque(push, axes=axes, breaks=[0.3]) for axes in ("body", "space")}


@pytest.fixture(scope="module")
def bodies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, sp.Body]:
    return {"diver": sp.load_body("diver"), "wheels": gyroscope(tmp_path_factory.mktemp("body"))}


def motion_of(
    body: sp.Body,
    torque: Any,
    *,
    samples: np.ndarray = _SAMPLES,
    values: dict[str, float] = _VALUES,
    momentum: np.ndarray = _MOMENTUM,
    start: np.ndarray = _START,
    tolerance: float = 1e-11,
) -> sp.ForcedMotion:
    has_wheels = "gyro" in body.joint_names
    names = ("swing", "slide") if has_wheels else body.joint_names
    path = sp.ShapePath.spline(_TIMES, samples, periodic=False, joint_names=names)
    wheels = {"rotors": {"gyro": values["gyro"]}, "rotor_speeds": {"fly": values["fly"]}} if has_wheels else {}
    return sp.reconstruct(sp.articulated(body, path, **wheels), momentum, start, torque=torque, tolerance=tolerance)


def difference(motion: Callable[[float], sp.ForcedMotion], step: float) -> np.ndarray:
    """Derivative of the turn and momentum at the end, and of the total rotation."""
    ahead, behind = motion(step), motion(-step)
    total = [moved.final_attitude @ moved.initial_attitude.T for moved in (ahead, behind)]
    turns = so3.log(ahead.final_attitude @ behind.final_attitude.T), so3.log(total[0] @ total[1].T)
    return np.concatenate([turns[0], ahead.final_momentum - behind.final_momentum, turns[1]]) / (2.0 * step)


def agree(found: sp.ForcedUncertainty, expected: np.ndarray) -> None:
    """The covariance of one error of size one is the product of its derivative with itself."""
    turn, momentum, total = np.split(expected, 3)
    for covariance, vector in (
        (found.final_attitude, turn), (found.final_momentum, momentum), (found.total_rotation, total),
    ):  # fmt: skip
        assert np.abs(covariance - np.outer(vector, vector)).max() < _NEAR * (expected @ expected)
    across = np.outer(turn, momentum)
    assert np.abs(found.state[:3, 3:] - across).max() < _NEAR * (expected @ expected)


def moved_inputs(
    body: sp.Body, link: str
) -> dict[str, tuple[dict[str, Any], Callable[[float], dict[str, Any]], float]]:
    """Errors of size one by name, how they change the arguments of `motion_of`, and the step of differences."""
    part = next(part for part in body.moving_parts if link in part.links)
    sample = np.zeros((4, 2))
    sample[1, 0] = 1.0
    both = np.concatenate([_UNIT, 2.0 * _UNIT])

    def heavier(h: float) -> sp.Body:
        return body.with_inertias(masses={link: (1.0 + h) * part.mass}, inertias={link: (1.0 + h) * part.inertia})

    def turned(h: float) -> np.ndarray:
        return _START @ so3.exp(h * _UNIT)

    return {
        "momentum": (
            {"momentum": np.outer(_UNIT, _UNIT)},
            lambda h: {"momentum": _MOMENTUM + h * _UNIT},
            1e-4,
        ),
        "attitude": ({"attitude": np.outer(_UNIT, _UNIT)}, lambda h: {"start": turned(h)}, 1e-4),
        "start": (
            {"start": np.outer(both, both)},
            lambda h: {"start": turned(h), "momentum": _MOMENTUM + 2.0 * h * _UNIT},
            1e-4,
        ),
        "joints": ({"joints": np.outer(sample, sample)}, lambda h: {"samples": _SAMPLES + h * sample}, 1e-4),
        "inertias": (
            {"inertias": sp.InertiaErrors(masses={link: 1.0})},
            lambda h: {"body": heavier(h)},
            1e-3,
        ),
        "gyro": ({"rotors": {"gyro": 1.0}}, lambda h: {"values": _VALUES | {"gyro": _VALUES["gyro"] + h}}, 1e-3),
        "fly": ({"rotors": {"fly": 1.0}}, lambda h: {"values": _VALUES | {"fly": _VALUES["fly"] + h}}, 0.1),
    }


_ALL = ("momentum", "attitude", "start", "joints", "inertias")
_QUICK = [
    ("diver", "body", "inertias"),
    ("diver", "space", "joints"),
]


@pytest.mark.parametrize(
    ("name", "axes", "source"),
    full_but(
        [
            *product(["diver"], TORQUES, _ALL),
            *product(["wheels"], TORQUES, (*_ALL, "gyro", "fly")),
        ],
        *_QUICK,
    ),
)
def test_bars_of_one_error_are_its_derivative(bodies: dict[str, sp.Body], name: str, axes: str, source: str):
    body, torque = bodies[name], TORQUES[axes]
    error, changed, step = moved_inputs(body, "rim" if name == "wheels" else body.link_names[-1])[source]

    def moved(h: float) -> sp.ForcedMotion:
        return motion_of(**{"body": body, "torque": torque} | changed(h))

    agree(sp.uncertainty(motion_of(body, torque), **error), difference(moved, step))


def test_sources_add_up(bodies: dict[str, sp.Body]):
    motion = motion_of(bodies["diver"], TORQUES["body"], tolerance=1e-8)
    given = {"joints": 0.005, "momentum": 0.01, "inertias": sp.InertiaErrors(masses=0.02)}
    together = sp.uncertainty(motion, **given)
    parts = [sp.uncertainty(motion, **{name: value}) for name, value in given.items()]
    np.testing.assert_allclose(together.state, sum(part.state for part in parts), rtol=1e-9)
    assert together.total_angle > 0.0


@pytest.mark.full
def test_bars_are_what_1000_draws_show(bodies: dict[str, sp.Body]):
    rng, torque, body = np.random.default_rng(4), TORQUES["body"], bodies["wheels"]
    motion = motion_of(body, torque, tolerance=1e-8)
    bars = sp.uncertainty(motion, joints=0.005, momentum=0.01, rotors={"gyro": 0.01})
    ends = np.empty((1000, 6))
    for end in ends:
        drawn = motion_of(
            body, torque, tolerance=1e-7,
            samples=_SAMPLES + 0.005 * rng.normal(size=_SAMPLES.shape),
            momentum=_MOMENTUM + 0.01 * rng.normal(size=3),
            values=_VALUES | {"gyro": _VALUES["gyro"] + 0.01 * rng.normal()},
        )  # fmt: skip
        end[:] = [*so3.log(drawn.final_attitude @ motion.final_attitude.T), *drawn.final_momentum]
    np.testing.assert_allclose(ends.std(axis=0), np.sqrt(np.diag(bars.state)), rtol=0.1)


@pytest.mark.parametrize(
    "torque",
    [
        lambda state: -0.1 * state.rate,
        lambda state: state.attitude[0],
        lambda state: [state.inertia[0, 0], 0.0, 0.0],
        lambda state: [0.0, state.momentum[1], 0.0],
        lambda state: [0.0, 0.0, state.shape[0] if state.time > 0.5 else 0.0],
    ],
)
def test_a_torque_that_depends_on_the_state_is_refused(
    bodies: dict[str, sp.Body], torque: Callable[[sp.TorqueState], Any]
):
    motion = motion_of(bodies["diver"], sp.ExternalTorque(torque, breaks=[0.5]), tolerance=1e-6)
    with pytest.raises(WrongObjectError, match="function of the time alone"):
        sp.uncertainty(motion, momentum=0.01)


def test_what_has_no_bars_under_a_torque(bodies: dict[str, sp.Body]):
    rigid = sp.reconstruct(sp.rigid(np.eye(3), 1.0), _MOMENTUM, torque=TORQUES["space"])
    with pytest.raises(WrongObjectError, match="articulated"):
        sp.uncertainty(rigid, momentum=0.01)
    with pytest.raises(WrongObjectError, match="Motion"):
        sp.derivatives(motion_of(bodies["diver"], TORQUES["space"], tolerance=1e-6))
    with pytest.raises(ShapeError, match="leave momentum"):
        sp.uncertainty(motion_of(bodies["diver"], TORQUES["space"], tolerance=1e-6), momentum=0.1, start=np.eye(6))
