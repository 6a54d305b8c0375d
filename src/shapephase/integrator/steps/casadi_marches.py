"""Steps of a few momenta, one after another, and of none: each march is one CasADi call after another."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np

from ... import run_progress
from ...arrays import Array
from ..casadi_calls import call_casadi_into
from .propagator_step import next_propagator
from .rotation_step import STAGES, momentum_step, product, rest_step, turned, unit
from .step_record import StepRecord, checkpoint_steps

# Steps in one CasADi call: enough for the cost of a call not to show, and few different lengths to build.
BLOCK = 256


def record_of_few(
    channels: Array, loops: int, directions: Array, magnitudes: Array, *, with_propagators: bool
) -> StepRecord:
    """All steps of a few momenta; what is no step's own is left empty."""
    width, (batch, _) = 17 if with_propagators else 8, directions.shape
    count = loops * len(channels)
    states, sides = np.empty((batch, count + 1, width)), np.empty((batch, count, 2))
    steps_of = partial(_momentum_function, with_propagators=with_propagators)
    for row in range(batch):
        _take_steps(steps_of, channels, loops, directions[row], magnitudes[row], states[row], sides[row])
    marks = checkpoint_steps(count) if with_propagators else []
    return StepRecord(
        quaternions=states[:, :, 3:7],
        directions=states[:, :, :3],
        turns=sides[:, :, 0],
        dynamics=sides[:, :, 1],
        propagators=states[:, marks, 8:].reshape(batch, -1, 3, 3),
        stepping=np.empty(batch),
        truncation=np.zeros(batch),
    )


def quaternions_of_few(channels: Array, loops: int, directions: Array, magnitudes: Array) -> Array:
    """The quaternions alone at the ends of all steps: (B, K + 1, 4)."""
    states = np.empty((len(magnitudes), loops * len(channels) + 1, 8))
    for row in range(len(magnitudes)):
        _take_steps(_attitude_function, channels, loops, directions[row], magnitudes[row], states[row])
    return states[:, :, 3:7]


def _take_steps(
    steps_of: Callable[[int], Any], channels: Array, loops: int, direction: Array, magnitude: float,
    states: Array, *sides: Array,
) -> None:  # fmt: skip
    """All steps of one momentum from the identity, by functions of so many: states (K + 1, n), sides (K, 2).

    A state is direction, quaternion, magnitude and propagator.
    """
    first, count, done = states[0], len(channels), 0
    first[:], first[:3], first[6], first[7], first[8::4] = 0.0, direction, 1.0, magnitude, 1.0
    for _ in range(loops):
        for start in range(0, count, BLOCK):
            block = channels[start : start + BLOCK]
            after = done + len(block)
            results = [states[done + 1 : after + 1], *(side[done:after] for side in sides)]
            call_casadi_into(steps_of(len(block)), (states[done], block), results)
            run_progress.advance(len(block))
            done = after


def quaternions_of_one_loop(half_rates: Array) -> Array:
    """From half the rates at all stages, times the steps' lengths: (K, 36) -> (K + 1, 4)."""
    count = len(half_rates)
    quaternions = np.empty((count + 1, 4))
    quaternions[0] = [0.0, 0.0, 0.0, 1.0]
    for first in range(0, count, BLOCK):
        block = half_rates[first : first + BLOCK]
        call_casadi_into(
            _rest_function(len(block)), (quaternions[first], block), [quaternions[first + 1 : first + BLOCK + 1]]
        )
        run_progress.advance(len(block))
    return quaternions


@lru_cache(maxsize=1024)
def _momentum_function(length: int, *, with_propagators: bool) -> Any:
    """`length` steps as one CasADi function of state and channels."""
    return momentum_step_function(with_propagators=with_propagators).mapaccum("steps", length)


@lru_cache(maxsize=1024)
def _attitude_function(length: int) -> Any:
    """The same without turns and dynamic phases."""
    return attitude_step_function().mapaccum("steps", length)


@lru_cache(maxsize=512)
def _rest_function(length: int) -> Any:
    """`length` steps without momentum as one CasADi function of the quaternion and half the rates."""
    return rest_step_function().mapaccum("steps", length)


@lru_cache(maxsize=2)
def momentum_step_function(*, with_propagators: bool) -> Any:
    """One step as a CasADi function: state and channels -> the next state; turn and dynamic phase.

    The state is direction, quaternion, magnitude and propagator.
    """
    import casadi

    state, data, channels = _symbols(17 if with_propagators else 8)
    parts = casadi.vertsplit(state)
    end, attitude, sides = _following(parts, channels, with_dynamic=True)
    following = [*end, *attitude, parts[7]]
    if with_propagators:
        propagator = [parts[8 + 3 * i : 11 + 3 * i] for i in range(3)]
        following += [part for row in next_propagator(propagator, parts[:3], end, parts[7], channels) for part in row]
    name = "momentum_step_with_propagator" if with_propagators else "momentum_step"
    return casadi.Function(name, [state, data], [casadi.vertcat(*following), casadi.vertcat(*sides)])


@lru_cache(maxsize=1)
def attitude_step_function() -> Any:
    """The same of direction, quaternion and magnitude alone."""
    import casadi

    state, data, channels = _symbols(8)
    parts = casadi.vertsplit(state)
    end, attitude, _ = _following(parts, channels, with_dynamic=False)
    return casadi.Function("attitude_step", [state, data], [casadi.vertcat(*end, *attitude, parts[7])])


def _symbols(width: int) -> tuple[Any, Any, list[list[Any]]]:
    """A state of so many numbers, the channels of a step, and these by stages."""
    import casadi

    state, data = casadi.SX.sym("state", width), casadi.SX.sym("channels", 9 * STAGES)
    components = casadi.vertsplit(data)
    return state, data, [components[9 * s : 9 * s + 9] for s in range(STAGES)]


def _following(parts: list[Any], channels: list[list[Any]], *, with_dynamic: bool) -> tuple[Any, Any, tuple[Any, Any]]:
    """Direction, quaternion, turn and dynamic phase after a step."""
    import casadi

    direction, quaternion, magnitude = parts[:3], parts[3:7], parts[7]
    end, turn, dynamic = momentum_step(direction, magnitude, channels, with_dynamic=with_dynamic)
    half_turn = casadi.sin(0.5 * turn), casadi.cos(0.5 * turn)
    return end, turned(quaternion, direction, end, half_turn), (turn, dynamic)


@lru_cache(maxsize=1)
def rest_step_function() -> Any:
    """One step without momentum as a CasADi function: quaternion and half the rates of turning -> the next one."""
    import casadi

    state, data = casadi.SX.sym("state", 4), casadi.SX.sym("half_rates", 3 * STAGES)
    components = casadi.vertsplit(data)
    turn = rest_step([components[3 * s : 3 * s + 3] for s in range(STAGES)])
    following = casadi.vertcat(*unit(product(casadi.vertsplit(state), turn)))
    return casadi.Function("rest_step", [state, data], [following])
