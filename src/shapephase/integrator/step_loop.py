"""Steps one after another: for a few momenta as one CasADi call, for many on whole arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array
from .casadi_calls import call_casadi
from .compilation import compiled_or_interpreted
from .rotation_step import STAGES, local_error, momentum_step, product, rest_step, turned, unit, variation

BLOCK = 256
FEW = 24
_ROWS_AT_ONCE = 2048
_NO_GROWTH = np.eye(3)
# The stages at 1/3 and 0.65 of a step: the mean of their variations stands for that of the whole step.
_INNER = (5, 8)


@dataclass(frozen=True, eq=False)
class StepRecord:
    """What the steps came to, for a batch of B momenta and K steps.

    Attributes
    ----------
    quaternions : (B, K + 1, 4) S at the step ends, xyzw
    directions : (B, K + 1, 3) Pi/|Pi| at the step ends; without momentum (B, 0, 3)
    turns : (B, K) of each step about its starting direction, the shortest rotation between its ends taken off [rad]
    dynamics : (B, K) dynamic phase of each step [rad]
    errors : (B, K) estimates of the steps' errors [rad]
    growth : (B, K + 1, 3, 3) how a small error of the start has grown; without momentum (B, 0, 3, 3)
    """

    quaternions: Array
    directions: Array
    turns: Array
    dynamics: Array
    errors: Array
    growth: Array


def integrate_steps(
    channels: Array, directions: Array, sizes: Array, loops: int, *, with_growth: bool = True
) -> StepRecord:
    """All steps of all loops, from the identity.

    Parameters
    ----------
    channels : (K, 108) of one loop; for each step, at its 12 stages, the step's length times I^-1 (6) and I^-1 L_o (3)
    directions : (B, 3) Pi/|Pi| at the start
    sizes : (B,) of the momentum [kg m^2/s]
    with_growth : whether to carry along how errors grow, to a few thousandths for every ten radians turned
    """
    total = loops * len(channels)
    march = StepRecord(
        quaternions=np.empty((len(sizes), total + 1, 4)),
        directions=np.empty((len(sizes), total + 1, 3)),
        turns=np.empty((len(sizes), total)),
        dynamics=np.empty((len(sizes), total)),
        errors=np.empty((len(sizes), total)),
        growth=np.empty((len(sizes), total + 1 if with_growth else 0, 3, 3)),
    )
    march.quaternions[:, 0] = [0.0, 0.0, 0.0, 1.0]
    march.directions[:, 0] = directions
    march.growth[:, :1] = _NO_GROWTH
    if len(sizes) <= FEW:
        for row, size in enumerate(sizes):
            _march_one(march, row, float(size), channels, loops)
        return march
    together = _march_many_compiled if _is_compiled(with_growth) else _march_many
    for first in range(0, len(sizes), _ROWS_AT_ONCE):
        together(march, slice(first, first + _ROWS_AT_ONCE), sizes, channels, loops)
    return march


def integrate_steps_at_rest(channels: Array, loops: int) -> StepRecord:
    """All steps of all loops without momentum, from the identity: a batch of one.

    The equation is linear, so steps do not depend on each other, and a further loop is the first one's rotation, once
    more: it costs no steps.
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
        growth=np.empty((1, 0, 3, 3)),
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


def _march_one(march: StepRecord, row: int, size: float, channels: Array, loops: int) -> None:
    count, with_growth = len(channels), bool(march.growth.shape[1])
    state = np.zeros(17 if with_growth else 8)
    state[:3], state[6], state[7] = march.directions[row, 0], 1.0, size
    state[8::4] = 1.0
    done = 0
    for _ in range(loops):
        for first in range(0, count, BLOCK):
            block = channels[first : first + BLOCK]
            states, sides = call_casadi(_momentum_function(len(block), with_growth), len(block), state, block)
            after = slice(done + 1, done + len(block) + 1)
            march.directions[row, after] = states[:, :3]
            march.quaternions[row, after] = states[:, 3:7]
            if with_growth:
                march.growth[row, after] = states[:, 8:].reshape(-1, 3, 3)
            part = slice(done, done + len(block))
            march.turns[row, part], march.dynamics[row, part], march.errors[row, part] = sides.T
            state, done = states[-1], done + len(block)


def _march_many(march: StepRecord, rows: slice, sizes: Array, channels: Array, loops: int) -> None:
    direction = list(march.directions[rows, 0].T)
    quaternion: Any = [0.0, 0.0, 0.0, 1.0]
    growth: Any = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    size = sizes[rows]
    steps = channels.reshape(-1, STAGES, 9).tolist()
    for number in range(loops * len(channels)):
        step = steps[number % len(steps)]
        end, turn, dynamic, differences = momentum_step(direction, size, step)
        half = 0.5 * turn
        quaternion = turned(quaternion, direction, end, (np.sin(half), np.cos(half)))
        march.turns[rows, number], march.dynamics[rows, number] = turn, dynamic
        march.errors[rows, number] = local_error(differences)
        for column, part in enumerate(end):
            march.directions[rows, number + 1, column] = part
        for column, part in enumerate(quaternion):
            march.quaternions[rows, number + 1, column] = part
        if march.growth.shape[1]:
            growth = _grown(growth, direction, end, size, step)
            for i, line in enumerate(growth):
                for j, part in enumerate(line):
                    march.growth[rows, number + 1, i, j] = part
        direction = end


def _march_many_compiled(march: StepRecord, rows: slice, sizes: Array, channels: Array, loops: int) -> None:
    count, with_growth = len(sizes[rows]), bool(march.growth.shape[1])
    state = np.zeros((count, 17 if with_growth else 8))
    state[:, :3], state[:, 6], state[:, 7] = march.directions[rows, 0], 1.0, sizes[rows]
    state[:, 8::4] = 1.0
    function = _many_function(count, with_growth)
    for number in range(loops * len(channels)):
        state, sides = call_casadi(function, count, state, channels[number % len(channels)])
        march.directions[rows, number + 1] = state[:, :3]
        march.quaternions[rows, number + 1] = state[:, 3:7]
        if with_growth:
            march.growth[rows, number + 1] = state[:, 8:].reshape(-1, 3, 3)
        march.turns[rows, number], march.dynamics[rows, number], march.errors[rows, number] = sides.T


def adjugate_of(matrix: Any) -> list[list[Any]]:
    """Of a 3 x 3 matrix of numbers, arrays or symbols."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return [
        [e * i - f * h, c * h - b * i, b * f - c * e],
        [f * g - d * i, a * i - c * g, c * d - a * f],
        [d * h - e * g, b * g - a * h, a * e - b * d],
    ]


def _grown(growth: Any, start: Any, end: Any, size: Any, channels: Any) -> list[list[Any]]:
    """The growth matrix after a step, by the Cayley transform of the variation at its middle.

    That is a rotation where the variation is one, however long the step.
    """
    middle = [0.25 * size * (a + b) for a, b in zip(start, end, strict=True)]
    first, second = (channels[stage] for stage in _INNER)
    inner = [0.5 * (a + b) for a, b in zip(first[:6], second[:6], strict=True)]
    half = variation(middle, [*inner, *(0.25 * (a + b) for a, b in zip(first[6:], second[6:], strict=True))])
    moved = [
        [g + h for g, h in zip(*rows, strict=True)] for rows in zip(growth, matrix_product(half, growth), strict=True)
    ]
    back = [[float(i == j) - half[i][j] for j in range(3)] for i in range(3)]
    adjugate = adjugate_of(back)
    scale = 1.0 / (back[0][0] * adjugate[0][0] + back[0][1] * adjugate[1][0] + back[0][2] * adjugate[2][0])
    return matrix_product([[scale * entry for entry in row] for row in adjugate], moved)


def matrix_product(a: Any, b: Any) -> list[list[Any]]:
    """Of two 3 x 3 matrices of numbers, arrays or symbols."""
    return [[row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j] for j in range(3)] for row in a]


@lru_cache(maxsize=1024)
def _momentum_function(length: int, with_growth: bool) -> Any:
    """`length` steps as one CasADi function of the state (direction, quaternion, size, growth) and the channels."""
    return compiled_or_interpreted(momentum_step_function(with_growth)).mapaccum("steps", length)


@lru_cache(maxsize=2)
def _is_compiled(with_growth: bool) -> bool:
    """Whether steps are machine code: only then are those of many sooner done one by one than on whole arrays."""
    function = momentum_step_function(with_growth)
    return compiled_or_interpreted(function) is not function


@lru_cache(maxsize=16)
def _many_function(count: int, with_growth: bool) -> Any:
    """One step of many states as one CasADi function, for machine code."""
    return compiled_or_interpreted(momentum_step_function(with_growth)).map("many", "serial", count, [1], [])


@lru_cache(maxsize=512)
def _rest_function(length: int) -> Any:
    """`length` steps without momentum as one CasADi function of the quaternion and the drifts."""
    return compiled_or_interpreted(rest_step_function()).mapaccum("steps", length)


@lru_cache(maxsize=2)
def momentum_step_function(with_growth: bool) -> Any:
    """One step as a CasADi function: state and channels -> the next state; turn, dynamic phase and error estimate."""
    import casadi

    state, data = casadi.SX.sym("state", 17 if with_growth else 8), casadi.SX.sym("channels", 9 * STAGES)
    parts, components = casadi.vertsplit(state), casadi.vertsplit(data)
    channels = [components[9 * s : 9 * s + 9] for s in range(STAGES)]
    direction, quaternion, size = parts[:3], parts[3:7], parts[7]
    end, turn, dynamic, differences = momentum_step(direction, size, channels)
    attitude = turned(quaternion, direction, end, (casadi.sin(0.5 * turn), casadi.cos(0.5 * turn)))
    following = [*end, *attitude, size]
    if with_growth:
        growth = [parts[8 + 3 * i : 11 + 3 * i] for i in range(3)]
        following += [part for row in _grown(growth, direction, end, size, channels) for part in row]
    side = casadi.vertcat(turn, dynamic, local_error(differences))
    name = "momentum_step_with_growth" if with_growth else "momentum_step"
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
