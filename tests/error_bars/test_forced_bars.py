"""Error bars under a torque, against central differences and draws of motions reconstructed anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import shapephase as sp
from shapephase import so3
from shapephase.errors import ShapeError, WrongObjectError
from support.gyroscope import gyroscope

_NEAR = 1e-6  # of central differences with motions at 1e-11
_START = so3.exp(np.array([0.2, 0.3, -0.4]))
_MOMENTUM = np.array([0.15, -0.25, 0.5])
_TIMES = np.array([0.0, 0.1, 0.25, 0.4, 0.5, 0.65, 0.8, 0.9, 1.0])
_SAMPLES = 0.4 * np.random.default_rng(5).normal(size=(9, 2))
_VALUES = {"gyro": 0.4, "fly": 30.0}


def push(state: sp.TorqueState) -> list[float]:
    return [0.4 * np.sin(5.0 * state.time), -0.3, 0.5 * (state.time < 0.3)]


TORQUES = {axes: sp.ExternalTorque(push, axes=axes, breaks=[0.3]) for axes in ("body", "space")}


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> sp.Body:
    return gyroscope(tmp_path_factory.mktemp("body"))


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
    path = sp.ShapePath.spline(_TIMES, samples, periodic=False, joint_names=["swing", "slide"])
    wheels = {"rotors": {"gyro": values["gyro"]}, "rotor_speeds": {"fly": values["fly"]}}
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


@pytest.mark.parametrize("axes", [*TORQUES])
def test_bars_of_one_error_are_its_derivative(body: sp.Body, axes: str):
    torque = TORQUES[axes]
    motion = motion_of(body, torque)
    unit = np.array([0.48, -0.6, 0.64])
    one = np.outer(unit, unit)
    agree(
        sp.uncertainty(motion, momentum=one),
        difference(lambda h: motion_of(body, torque, momentum=_MOMENTUM + h * unit), 1e-4),
    )
    agree(
        sp.uncertainty(motion, attitude=one),
        difference(lambda h: motion_of(body, torque, start=_START @ so3.exp(h * unit)), 1e-4),
    )
    both = np.concatenate([unit, 2.0 * unit])
    agree(
        sp.uncertainty(motion, start=np.outer(both, both)),
        difference(
            lambda h: motion_of(body, torque, start=_START @ so3.exp(h * unit), momentum=_MOMENTUM + 2.0 * h * unit),
            1e-4,
        ),
    )
    for place in ((1, 0), (7, 1)):
        sample = np.zeros((9, 2))
        sample[place] = 1.0
        agree(
            sp.uncertainty(motion, joints=np.outer(sample, sample)),
            difference(lambda h, e=sample: motion_of(body, torque, samples=_SAMPLES + h * e), 1e-4),
        )
    for joint, value in _VALUES.items():
        agree(
            sp.uncertainty(motion, rotors={joint: 1.0}),
            difference(
                lambda h, joint=joint: motion_of(body, torque, values=_VALUES | {joint: _VALUES[joint] + h}),
                1e-3 * value,
            ),
        )


@pytest.mark.parametrize("link", ["boom", "rim"])
def test_bars_of_inertias(body: sp.Body, link: str):
    motion = motion_of(body, TORQUES["body"])
    part = next(part for part in body.moving_parts if link in part.links)

    def heavier(h: float) -> sp.ForcedMotion:
        changed = body.with_inertias(masses={link: (1.0 + h) * part.mass}, inertias={link: (1.0 + h) * part.inertia})
        return motion_of(changed, TORQUES["body"])

    agree(sp.uncertainty(motion, inertias=sp.InertiaErrors(masses={link: 1.0})), difference(heavier, 1e-3))


def test_sources_add_up_and_a_rigid_part_of_the_turn_is_known(body: sp.Body):
    motion = motion_of(body, TORQUES["body"], tolerance=1e-8)
    given = {"joints": 0.005, "momentum": 0.01, "rotors": 0.01, "inertias": sp.InertiaErrors(masses=0.02)}
    together = sp.uncertainty(motion, **given)
    parts = [sp.uncertainty(motion, **{name: value}) for name, value in given.items()]
    np.testing.assert_allclose(together.state, sum(part.state for part in parts), rtol=1e-9)
    assert together.total_angle > 0.0


@pytest.mark.full
def test_bars_are_what_1000_draws_show(body: sp.Body):
    rng, torque = np.random.default_rng(4), TORQUES["body"]
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
def test_a_torque_that_depends_on_the_state_is_refused(body: sp.Body, torque: Callable[[sp.TorqueState], Any]):
    motion = motion_of(body, sp.ExternalTorque(torque, breaks=[0.5]), tolerance=1e-6)
    with pytest.raises(WrongObjectError, match="function of the time alone"):
        sp.uncertainty(motion, momentum=0.01)


def test_what_has_no_bars_under_a_torque(body: sp.Body):
    rigid = sp.reconstruct(sp.rigid(np.eye(3), 1.0), _MOMENTUM, torque=TORQUES["space"])
    with pytest.raises(WrongObjectError, match="articulated"):
        sp.uncertainty(rigid, momentum=0.01)
    with pytest.raises(WrongObjectError, match="Motion"):
        sp.derivatives(motion_of(body, TORQUES["space"], tolerance=1e-6))
    with pytest.raises(ShapeError, match="leave momentum"):
        sp.uncertainty(motion_of(body, TORQUES["space"], tolerance=1e-6), momentum=0.1, start=np.eye(6))
