"""The step loop: for a few momenta as one CasADi call each, for many on whole arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array
from ._rotation_step import STAGES, local_error, momentum_step, product, rest_step, turned, unit, variation
from .casadi_calls import call_casadi
from .compilation import compiled_or_interpreted

# Steps in one CasADi call: enough for the cost of a call not to show, and few different lengths to build.
BLOCK = 256
# Momenta: up to so many, one after another in CasADi is faster than all at once on NumPy's arrays.
FEW = 24
# Momenta on arrays at once, so that the arrays of one step stay in the processor's cache.
_ROWS_AT_ONCE = 2048
# The stages at 1/3 and 0.65 of a step: the mean of their variations stands for that of the whole step.
_INNER_STAGES = (5, 8)


@dataclass(frozen=True, eq=False)
class StepRecord:
    """The results of K steps for a batch of B momenta.

    Attributes
    ----------
    quaternions : (B, K + 1, 4) S at the step ends, xyzw
    directions : (B, K + 1, 3) Pi/|Pi| at the step ends; without momentum (B, 0, 3)
    turns : (B, K) of each step about its starting direction, the shortest rotation between its ends taken off [rad]
    dynamics : (B, K) dynamic phase of each step [rad]
    errors : (B, K) estimates of the steps' errors [rad]
    propagators : (B, K + 1, 3, 3) error propagators, the state transition matrices that carry a small turn of the start
        to the step ends; (B, 0, 3, 3) without momentum or where they were not asked for
    """

    quaternions: Array
    directions: Array
    turns: Array
    dynamics: Array
    errors: Array
    propagators: Array


def integrate_steps(
    channels: Array, directions: Array, magnitudes: Array, loops: int, *, with_propagators: bool = True
) -> StepRecord:
    """All steps of all loops, starting at the identity.

    Parameters
    ----------
    channels : (K, 108) of one loop; for each step, at its 12 stages, the step's length times I^-1 (6) and I^-1 L_o (3)
    directions : (B, 3) Pi/|Pi| at the start
    magnitudes : (B,) of the momentum [kg m^2/s]
    with_propagators : whether to integrate the error propagators too, to a few thousandths for every ten radians
        turned
    """
    total = loops * len(channels)
    record = StepRecord(
        quaternions=np.empty((len(magnitudes), total + 1, 4)),
        directions=np.empty((len(magnitudes), total + 1, 3)),
        turns=np.empty((len(magnitudes), total)),
        dynamics=np.empty((len(magnitudes), total)),
        errors=np.empty((len(magnitudes), total)),
        propagators=np.empty((len(magnitudes), total + 1 if with_propagators else 0, 3, 3)),
    )
    record.quaternions[:, 0] = [0.0, 0.0, 0.0, 1.0]
    record.directions[:, 0] = directions
    record.propagators[:, :1] = np.eye(3)
    if len(magnitudes) <= FEW:
        for row, magnitude in enumerate(magnitudes):
            _steps_of_one(record, row, float(magnitude), channels, loops)
        return record
    steps_of_many = _compiled_steps_of_many if _is_compiled(with_propagators) else _steps_of_many
    for first in range(0, len(magnitudes), _ROWS_AT_ONCE):
        steps_of_many(record, slice(first, first + _ROWS_AT_ONCE), magnitudes, channels, loops)
    return record


def integrate_steps_at_rest(channels: Array, loops: int) -> StepRecord:
    """All steps of all loops without momentum, from the identity: a batch of one.

    The equation is linear, so steps do not depend on each other, and a further loop repeats the rotation of the first:
    it costs no steps.
    """
    count = len(channels)
    quaternions, errors = np.empty((count + 1, 4)), np.empty(count)
    quaternions[0] = [0.0, 0.0, 0.0, 1.0]
    drifts = np.ascontiguousarray(channels.reshape(count, STAGES, 9)[:, :, 6:]).reshape(count, -1)
    for first in range(0, count, BLOCK):
        part = slice(first, first + BLOCK)
        states, sides = call_casadi(
            _rest_function(len(drifts[part])), len(drifts[part]), quaternions[first], drifts[part]
        )
        quaternions[first + 1 : first + BLOCK + 1], errors[part] = states, sides[:, 0]
    whole = _repeated(quaternions, loops) if loops > 1 else quaternions
    nothing = np.zeros((1, loops * count))
    return StepRecord(
        quaternions=whole[None],
        directions=np.empty((1, 0, 3)),
        turns=nothing,
        dynamics=nothing,
        errors=np.tile(errors, loops)[None],
        propagators=np.empty((1, 0, 3, 3)),
    )


def _repeated(quaternions: Array, loops: int) -> Array:
    """The first loop's quaternions after 0, 1, 2 ... loops, the last of each being the first of the next."""
    x, y, z, w = quaternions[-1]
    sine = np.sqrt(x * x + y * y + z * z)
    half = np.arctan2(sine, w) * np.arange(loops)
    axis = quaternions[-1, :3] / sine if sine > 0.0 else np.zeros(3)
    powers = np.concatenate([np.sin(half)[:, None] * axis, np.cos(half)[:, None]], axis=1)
    further = np.stack(product(list(powers.T[:, :, None]), list(quaternions[1:].T)), axis=-1).reshape(-1, 4)
    return np.concatenate([quaternions[:1], further])


def _steps_of_one(record: StepRecord, row: int, magnitude: float, channels: Array, loops: int) -> None:
    count, with_propagators = len(channels), bool(record.propagators.shape[1])
    state = np.zeros(17 if with_propagators else 8)
    state[:3], state[6], state[7] = record.directions[row, 0], 1.0, magnitude
    state[8::4] = 1.0
    done = 0
    for _ in range(loops):
        for first in range(0, count, BLOCK):
            block = channels[first : first + BLOCK]
            states, sides = call_casadi(_momentum_function(len(block), with_propagators), len(block), state, block)
            after = slice(done + 1, done + len(block) + 1)
            record.directions[row, after] = states[:, :3]
            record.quaternions[row, after] = states[:, 3:7]
            if with_propagators:
                record.propagators[row, after] = states[:, 8:].reshape(-1, 3, 3)
            part = slice(done, done + len(block))
            record.turns[row, part], record.dynamics[row, part], record.errors[row, part] = sides.T
            state, done = states[-1], done + len(block)


def _steps_of_many(record: StepRecord, rows: slice, magnitudes: Array, channels: Array, loops: int) -> None:
    direction = list(record.directions[rows, 0].T)
    quaternion: Any = [0.0, 0.0, 0.0, 1.0]
    propagator: Any = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    magnitude = magnitudes[rows]
    steps = channels.reshape(-1, STAGES, 9).tolist()
    for number in range(loops * len(channels)):
        step = steps[number % len(steps)]
        end, turn, dynamic, differences = momentum_step(direction, magnitude, step)
        half = 0.5 * turn
        quaternion = turned(quaternion, direction, end, (np.sin(half), np.cos(half)))
        record.turns[rows, number], record.dynamics[rows, number] = turn, dynamic
        record.errors[rows, number] = local_error(differences)
        for column, part in enumerate(end):
            record.directions[rows, number + 1, column] = part
        for column, part in enumerate(quaternion):
            record.quaternions[rows, number + 1, column] = part
        if record.propagators.shape[1]:
            propagator = _next_propagator(propagator, direction, end, magnitude, step)
            for i, line in enumerate(propagator):
                for j, part in enumerate(line):
                    record.propagators[rows, number + 1, i, j] = part
        direction = end


def _compiled_steps_of_many(record: StepRecord, rows: slice, magnitudes: Array, channels: Array, loops: int) -> None:
    count, with_propagators = len(magnitudes[rows]), bool(record.propagators.shape[1])
    state = np.zeros((count, 17 if with_propagators else 8))
    state[:, :3], state[:, 6], state[:, 7] = record.directions[rows, 0], 1.0, magnitudes[rows]
    state[:, 8::4] = 1.0
    function = _many_function(count, with_propagators)
    for number in range(loops * len(channels)):
        state, sides = call_casadi(function, count, state, channels[number % len(channels)])
        record.directions[rows, number + 1] = state[:, :3]
        record.quaternions[rows, number + 1] = state[:, 3:7]
        if with_propagators:
            record.propagators[rows, number + 1] = state[:, 8:].reshape(-1, 3, 3)
        record.turns[rows, number], record.dynamics[rows, number], record.errors[rows, number] = sides.T


def adjugate_of(matrix: Any) -> list[list[Any]]:
    """Of a 3 x 3 matrix of numbers, arrays or symbols."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return [
        [e * i - f * h, c * h - b * i, b * f - c * e],
        [f * g - d * i, a * i - c * g, c * d - a * f],
        [d * h - e * g, b * g - a * h, a * e - b * d],
    ]


def _next_propagator(propagator: Any, start: Any, end: Any, magnitude: Any, channels: Any) -> list[list[Any]]:
    """The error propagator after a step, by the Cayley transform of the variation at its middle.

    That is a rotation where the variation is one, however long the step.
    """
    middle = [0.25 * magnitude * (a + b) for a, b in zip(start, end, strict=True)]
    first, second = (channels[stage] for stage in _INNER_STAGES)
    inner = [0.5 * (a + b) for a, b in zip(first[:6], second[:6], strict=True)]
    half = variation(middle, [*inner, *(0.25 * (a + b) for a, b in zip(first[6:], second[6:], strict=True))])
    moved = [
        [g + h for g, h in zip(*rows, strict=True)]
        for rows in zip(propagator, matrix_product(half, propagator), strict=True)
    ]
    back = [[float(i == j) - half[i][j] for j in range(3)] for i in range(3)]
    adjugate = adjugate_of(back)
    scale = 1.0 / (back[0][0] * adjugate[0][0] + back[0][1] * adjugate[1][0] + back[0][2] * adjugate[2][0])
    return matrix_product([[scale * entry for entry in row] for row in adjugate], moved)


def matrix_product(a: Any, b: Any) -> list[list[Any]]:
    """Of two 3 x 3 matrices of numbers, arrays or symbols."""
    return [[row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j] for j in range(3)] for row in a]


@lru_cache(maxsize=1024)
def _momentum_function(length: int, with_propagators: bool) -> Any:
    """`length` steps as one CasADi function of the state (direction, quaternion, magnitude, propagator)."""
    return compiled_or_interpreted(momentum_step_function(with_propagators)).mapaccum("steps", length)


@lru_cache(maxsize=2)
def _is_compiled(with_propagators: bool) -> bool:
    """Whether steps are machine code: only then is looping over many momenta faster than whole arrays."""
    function = momentum_step_function(with_propagators)
    return compiled_or_interpreted(function) is not function


@lru_cache(maxsize=16)
def _many_function(count: int, with_propagators: bool) -> Any:
    """One step of many states as one CasADi function, for machine code."""
    return compiled_or_interpreted(momentum_step_function(with_propagators)).map("many", "serial", count, [1], [])


@lru_cache(maxsize=512)
def _rest_function(length: int) -> Any:
    """`length` steps without momentum as one CasADi function of the quaternion and the drifts."""
    return compiled_or_interpreted(rest_step_function()).mapaccum("steps", length)


@lru_cache(maxsize=2)
def momentum_step_function(with_propagators: bool) -> Any:
    """One step as a CasADi function: state and channels -> the next state; turn, dynamic phase and error estimate."""
    import casadi

    state, data = casadi.SX.sym("state", 17 if with_propagators else 8), casadi.SX.sym("channels", 9 * STAGES)
    parts, components = casadi.vertsplit(state), casadi.vertsplit(data)
    channels = [components[9 * s : 9 * s + 9] for s in range(STAGES)]
    direction, quaternion, magnitude = parts[:3], parts[3:7], parts[7]
    end, turn, dynamic, differences = momentum_step(direction, magnitude, channels)
    attitude = turned(quaternion, direction, end, (casadi.sin(0.5 * turn), casadi.cos(0.5 * turn)))
    following = [*end, *attitude, magnitude]
    if with_propagators:
        propagator = [parts[8 + 3 * i : 11 + 3 * i] for i in range(3)]
        following += [part for row in _next_propagator(propagator, direction, end, magnitude, channels) for part in row]
    side = casadi.vertcat(turn, dynamic, local_error(differences))
    name = "momentum_step_with_propagator" if with_propagators else "momentum_step"
    return casadi.Function(name, [state, data], [casadi.vertcat(*following), side])


@lru_cache(maxsize=1)
def rest_step_function() -> Any:
    """One step without momentum as a CasADi function: quaternion and drifts -> the next one; error estimate."""
    import casadi

    state, data = casadi.SX.sym("state", 4), casadi.SX.sym("drifts", 3 * STAGES)
    components = casadi.vertsplit(data)
    turn, differences = rest_step([components[3 * s : 3 * s + 3] for s in range(STAGES)])
    following = casadi.vertcat(*unit(product(casadi.vertsplit(state), turn)))
    return casadi.Function("rest_step", [state, data], [following, local_error(differences)])


def forget_functions() -> None:
    """Build the functions anew when next needed."""
    for kept in (_momentum_function, _rest_function, _many_function, _is_compiled):
        kept.cache_clear()
