"""Steps one after another: for a few momenta as one CasADi call, for many on whole arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from . import so3
from .arrays import Array
from .compiled import called, for_rows
from .rotation_step import (
    STAGES,
    local_error,
    momentum_step,
    product,
    rest_step,
    turned,
    unit,
    variation,
)

_BLOCK = 256
_FEW, _MANY = 24, 400
_ROWS_AT_ONCE = 2048
_CHECKPOINTS = 8
# The stages at 1/3 and 0.65 of a step: the mean of their variations stands for that of the whole step.
_INNER = (5, 8)


@dataclass(frozen=True, eq=False)
class March:
    """What the steps came to, for a batch of B momenta and K steps.

    Attributes
    ----------
    quaternions : (B, K + 1, 4) S at the step ends, xyzw
    directions : (B, K + 1, 3) Pi/|Pi| at the step ends; without momentum (B, 0, 3)
    turns : (B, K) of each step about its starting direction, the shortest rotation between its ends taken off [rad]
    dynamics : (B, K) dynamic phase of each step [rad]
    errors : (B, K) estimates of the steps' errors [rad]
    growth : (B, K + 1, 3, 3) how a small error of the start has grown; without momentum (B, 0, 3, 3)
    slope : (B, 3, 3) turn of the end, in body axes, by a change of Pi at the start; known only where it is exact
    """

    quaternions: Array
    directions: Array
    turns: Array
    dynamics: Array
    errors: Array
    growth: Array
    slope: Array


def marched(channels: Array, directions: Array, sizes: Array, loops: int, *, exact: bool | None = None) -> March:
    """All steps of all loops, from the identity.

    Parameters
    ----------
    channels : (K, 108) of one loop; for each step, at its 12 stages, the step's length times I^-1 (6) and I^-1 L_o (3)
    directions : (B, 3) Pi/|Pi| at the start
    sizes : (B,) of the momentum [kg m^2/s]; all positive if `exact`
    exact : whether the growth of errors is the derivative of the steps themselves, which takes three times as long, or
        good to a few thousandths for every ten radians turned; None: exact where many steps follow each other
    """
    total = loops * len(channels)
    if exact is None:
        exact = total > _MANY
    march = March(
        quaternions=np.empty((len(sizes), total + 1, 4)),
        directions=np.empty((len(sizes), total + 1, 3)),
        turns=np.empty((len(sizes), total)),
        dynamics=np.empty((len(sizes), total)),
        errors=np.empty((len(sizes), total)),
        growth=np.empty((len(sizes), total + 1, 3, 3)),
        slope=np.full((len(sizes), 3, 3), np.nan),
    )
    march.quaternions[:, 0] = [0.0, 0.0, 0.0, 1.0]
    march.directions[:, 0] = directions
    march.growth[:, 0] = np.eye(3)
    if exact or len(sizes) <= _FEW:
        one = _march_exactly if exact else _march_one
        for row, size in enumerate(sizes):
            one(march, row, float(size), channels, loops)
        return march
    for first in range(0, len(sizes), _ROWS_AT_ONCE):
        _march_many(march, slice(first, first + _ROWS_AT_ONCE), sizes, channels, loops)
    return march


def marched_at_rest(channels: Array, loops: int) -> March:
    """All steps of all loops without momentum, from the identity: a batch of one.

    The equation is linear, so steps do not depend on each other, and a further loop is the first one's rotation, once
    more: it costs no steps.
    """
    count = len(channels)
    quaternions, errors = np.empty((count + 1, 4)), np.empty(count)
    quaternions[0] = [0.0, 0.0, 0.0, 1.0]
    drifts = np.ascontiguousarray(channels.reshape(count, STAGES, 9)[:, :, 6:]).reshape(count, -1)
    for first in range(0, count, _BLOCK):
        part = slice(first, first + _BLOCK)
        states, sides = called(_rest_function(len(drifts[part])), len(drifts[part]), quaternions[first], drifts[part])
        quaternions[first + 1 : first + _BLOCK + 1], errors[part] = states, sides[:, 0]
    whole = _repeated(quaternions, loops) if loops > 1 else quaternions
    nothing = np.zeros((1, loops * count))
    return March(
        quaternions=whole[None],
        directions=np.empty((1, 0, 3)),
        turns=nothing,
        dynamics=nothing,
        errors=np.tile(errors, loops)[None],
        growth=np.empty((1, 0, 3, 3)),
        slope=np.full((1, 3, 3), np.nan),
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


def _march_one(march: March, row: int, size: float, channels: Array, loops: int) -> None:
    count = len(channels)
    state = np.zeros(17)
    state[:3], state[6], state[16] = march.directions[row, 0], 1.0, size
    state[7:16:4] = 1.0
    done = 0
    for _ in range(loops):
        for first in range(0, count, _BLOCK):
            block = channels[first : first + _BLOCK]
            states, sides = called(_momentum_function(len(block)), len(block), state, block)
            after = slice(done + 1, done + len(block) + 1)
            march.directions[row, after] = states[:, :3]
            march.quaternions[row, after] = states[:, 3:7]
            march.growth[row, after] = states[:, 7:16].reshape(-1, 3, 3)
            part = slice(done, done + len(block))
            march.turns[row, part], march.dynamics[row, part], march.errors[row, part] = sides.T
            state, done = states[-1], done + len(block)


def _march_exactly(march: March, row: int, size: float, channels: Array, loops: int) -> None:
    """As `_march_one`, with the derivatives of direction and quaternion by Pi at the start carried along."""
    count, start = len(channels), march.directions[row, 0]
    state = np.zeros(32)
    state[:3], state[6], state[7] = start, 1.0, size
    across = (np.eye(3) - np.outer(start, start)) / size if size > 0.0 else np.zeros((3, 3))
    # One column for each component of Pi: direction, quaternion, size.
    state[8:] = np.concatenate([across, np.zeros((4, 3)), start[None]]).T.ravel()
    done, turning = 0, so3.hat(size * start)
    for _ in range(loops):
        for first in range(0, count, _BLOCK):
            block = channels[first : first + _BLOCK]
            states, sides = called(_exact_function(len(block)), len(block), state, block)
            after = slice(done + 1, done + len(block) + 1)
            march.directions[row, after] = states[:, :3]
            march.quaternions[row, after] = states[:, 3:7]
            slope = so3.turn_of(states[:, None, 3:7], states[:, 8:].reshape(-1, 3, 8)[:, :, 3:7])
            rotation = so3.matrix_from_quat(states[:, 3:7])
            march.growth[row, after] = so3.transpose(rotation) + so3.transpose(slope) @ turning
            part = slice(done, done + len(block))
            march.turns[row, part], march.dynamics[row, part], march.errors[row, part] = sides.T
            state, done = states[-1], done + len(block)
            march.slope[row] = slope[-1].T


def _march_many(march: March, rows: slice, sizes: Array, channels: Array, loops: int) -> None:
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
        growth = _grown(growth, direction, end, size, step)
        march.turns[rows, number], march.dynamics[rows, number] = turn, dynamic
        march.errors[rows, number] = local_error(differences)
        for column, part in enumerate(end):
            march.directions[rows, number + 1, column] = part
        for column, part in enumerate(quaternion):
            march.quaternions[rows, number + 1, column] = part
        for i, line in enumerate(growth):
            for j, part in enumerate(line):
                march.growth[rows, number + 1, i, j] = part
        direction = end


def amplification(growth: Array) -> Array:
    """Largest growth of an error from one time to a later one, from the growth matrices: (B, K + 1, 3, 3) -> (B,).

    Between eight times. A turn about the momentum's axis stays what it is, and volumes are kept: taking the singular
    values as s, 1, 1/s, the sum of their squares gives the largest.
    """
    count = growth.shape[1]
    if count == 0:
        return np.ones(1)
    chosen = growth[:, np.arange(_CHECKPOINTS) * (count - 1) // (_CHECKPOINTS - 1)].reshape(len(growth), -1)
    largest = for_rows(_largest_growth, 9 * _CHECKPOINTS, chosen)[:, 0]
    # Where steps were so long that they overflowed, nothing is known.
    return np.where(np.isfinite(chosen.sum(axis=1)), largest, np.inf)


def _largest_growth(entries: Any) -> list[Any]:
    """From the growth matrices at the checkpoints, row by row."""
    import casadi

    matrices = [[entries[9 * k + 3 * i : 9 * k + 3 * i + 3] for i in range(3)] for k in range(_CHECKPOINTS)]
    rest: Any = 1.0
    for later in range(1, _CHECKPOINTS):
        for earlier in range(later):
            between = _product(matrices[later], _adjugate(matrices[earlier])) if earlier else matrices[later]
            squares = sum(entry * entry for row in between for entry in row)
            rest = casadi.fmax(rest, 0.5 * (squares - 1.0))
    return [(rest + (rest * rest - 1.0) ** 0.5) ** 0.5]


def _adjugate(matrix: Any) -> list[list[Any]]:
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
    moved = [[g + h for g, h in zip(*rows, strict=True)] for rows in zip(growth, _product(half, growth), strict=True)]
    back = [[float(i == j) - half[i][j] for j in range(3)] for i in range(3)]
    adjugate = _adjugate(back)
    scale = 1.0 / (back[0][0] * adjugate[0][0] + back[0][1] * adjugate[1][0] + back[0][2] * adjugate[2][0])
    return _product([[scale * entry for entry in row] for row in adjugate], moved)


def _product(a: Any, b: Any) -> list[list[Any]]:
    return [[row[0] * b[0][j] + row[1] * b[1][j] + row[2] * b[2][j] for j in range(3)] for row in a]


@lru_cache(maxsize=512)
def _momentum_function(length: int) -> Any:
    """`length` steps as one CasADi function of the state (direction, quaternion, growth, size) and the channels."""
    return _momentum_step_function().mapaccum("steps", length)


@lru_cache(maxsize=512)
def _rest_function(length: int) -> Any:
    """`length` steps without momentum as one CasADi function of the quaternion and the drifts."""
    return _rest_step_function().mapaccum("steps", length)


@lru_cache(maxsize=512)
def _exact_function(length: int) -> Any:
    """`length` steps as one CasADi function of the state, its derivatives and the channels."""
    return _exact_step_function().mapaccum("steps", length)


@lru_cache(maxsize=1)
def _exact_step_function() -> Any:
    import casadi

    state, slopes = casadi.SX.sym("state", 8), casadi.SX.sym("slopes", 8, 3)
    data = casadi.SX.sym("channels", 9 * STAGES)
    parts, components = casadi.vertsplit(state), casadi.vertsplit(data)
    channels = [components[9 * s : 9 * s + 9] for s in range(STAGES)]
    direction, quaternion, size = parts[:3], parts[3:7], parts[7]
    end, turn, dynamic, differences = momentum_step(direction, size, channels)
    attitude = turned(quaternion, direction, end, (casadi.sin(0.5 * turn), casadi.cos(0.5 * turn)))
    following = casadi.vertcat(*end, *attitude, size)
    further = casadi.jtimes(following, state, slopes)
    side = casadi.vertcat(turn, dynamic, local_error(differences))
    whole = casadi.vertcat(state, casadi.reshape(slopes, 24, 1))
    return casadi.Function("step", [whole, data], [casadi.vertcat(following, casadi.reshape(further, 24, 1)), side])


@lru_cache(maxsize=1)
def _momentum_step_function() -> Any:
    import casadi

    state, data = casadi.SX.sym("state", 17), casadi.SX.sym("channels", 9 * STAGES)
    parts, components = casadi.vertsplit(state), casadi.vertsplit(data)
    channels = [components[9 * s : 9 * s + 9] for s in range(STAGES)]
    direction, quaternion, size = parts[:3], parts[3:7], parts[16]
    growth = [parts[7 + 3 * i : 10 + 3 * i] for i in range(3)]
    end, turn, dynamic, differences = momentum_step(direction, size, channels)
    attitude = turned(quaternion, direction, end, (casadi.sin(0.5 * turn), casadi.cos(0.5 * turn)))
    grown = _grown(growth, direction, end, size, channels)
    following = casadi.vertcat(*end, *attitude, *(part for row in grown for part in row), size)
    side = casadi.vertcat(turn, dynamic, local_error(differences))
    return casadi.Function("step", [state, data], [following, side])


@lru_cache(maxsize=1)
def _rest_step_function() -> Any:
    import casadi

    state, data = casadi.SX.sym("state", 4), casadi.SX.sym("drifts", 3 * STAGES)
    components = casadi.vertsplit(data)
    turn, differences = rest_step([components[3 * s : 3 * s + 3] for s in range(STAGES)])
    following = casadi.vertcat(*unit(product(casadi.vertsplit(state), turn)))
    return casadi.Function("step", [state, data], [following, local_error(differences)])
