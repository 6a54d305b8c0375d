"""Double steps one after another, for a few momenta as one CasADi call, for many on whole arrays."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from .arrays import Array
from .rotation_step import (
    STAGES,
    body_momentum,
    judged_step,
    judged_steps_in_numpy,
    relative_angle,
    variation,
)

_BLOCK = 256


def march_in_numpy(channels: Array, start: Array, size: Array | None, loops: int) -> tuple[Array, Array, Array | None]:
    """All double steps for a large batch, each formula on whole arrays of the batch."""
    quaternion = start
    track = [quaternion]
    judged = np.empty((len(start), loops * len(channels), 3))
    growth = None if size is None else [np.tile(np.eye(3), (len(start), 1, 1))]
    for number in range(loops * len(channels)):
        block = channels[number % len(channels)]
        whole, first, second = block[:STAGES], block[STAGES : 2 * STAGES], block[2 * STAGES :]
        coarse, far = judged_steps_in_numpy(quaternion, size, whole)
        middle, near = judged_steps_in_numpy(quaternion, size, first)
        quaternion, next_near = judged_steps_in_numpy(middle, size, second)
        judged[:, number, 0] = relative_angle(quaternion.T, coarse.T)
        judged[:, number, 1], judged[:, number, 2] = np.sqrt(far), np.sqrt(near) + np.sqrt(next_near)
        track += [middle, quaternion]
        if growth is not None:
            rows = variation(body_momentum(middle.T, size), 4.0 * second[0])
            matrix = np.moveaxis(np.array([np.broadcast_arrays(*row) for row in rows]), -1, 0)
            growth.append(_exponential(matrix) @ growth[-1])
    propagators = None if growth is None else np.stack(growth, axis=1)
    return np.stack(track, axis=1), judged, propagators


def _exponential(matrix: Array) -> Array:
    """exp by its (2, 2) Pade approximant: of fourth order, and a rotation where the matrix is antisymmetric."""
    even, odd = np.eye(3) + matrix @ matrix / 12.0, 0.5 * matrix
    return np.asarray(np.linalg.solve(even - odd, even + odd), dtype=np.float64)


def march_in_casadi(channels: Array, start: Array, size: Array | None, loops: int) -> tuple[Array, Array, Array | None]:
    """All double steps for a few momenta, one call of a CasADi function for each block of steps."""
    batch, count = len(start), len(channels)
    total = loops * count
    quaternions = np.empty((batch, 2 * total + 1, 4))
    quaternions[:, 0] = start
    judged = np.empty((batch, total, 3))
    growth = None if size is None else np.empty((batch, total + 1, 3, 3))
    blocks = [_Block(channels[k : k + _BLOCK], size is not None) for k in range(0, count, _BLOCK)]
    for row in range(batch):
        state = np.zeros(4 if size is None else 14)
        state[:4] = start[row]
        if size is not None and growth is not None:
            state[4:13:4] = 1.0
            state[13] = size[row]
            growth[row, 0] = np.eye(3)
        done = 0
        for _ in range(loops):
            for block in blocks:
                states, sides = block(state)
                stop = done + block.count
                quaternions[row, 2 * done + 1 : 2 * stop : 2] = sides[:, :4]
                quaternions[row, 2 * done + 2 : 2 * stop + 1 : 2] = states[:, :4]
                judged[row, done:stop] = sides[:, 4:]
                if growth is not None:
                    growth[row, done + 1 : stop + 1] = states[:, 4:13].reshape(-1, 3, 3)
                state, done = states[-1], stop
    return quaternions, judged, growth


class _Block:
    """A run of double steps over given channels, ready to be called with one state after another.

    A state holds the quaternion and, with momentum, the propagator row by row and the momentum's size.
    """

    def __init__(self, channels: Array, with_momentum: bool) -> None:
        self.count = len(channels)
        length = _block_length(self.count)
        function = _double_steps(length, with_momentum)
        self._channels = np.zeros((length, channels[0].size))
        self._channels[: self.count] = channels.reshape(self.count, -1)
        self._state = np.empty(function.size1_in(0))
        self._results = [np.empty((length, function.size1_out(k))) for k in range(2)]
        # The buffer belongs to this block: threads that integrate at the same time do not share it.
        self._buffer, self._evaluate = function.buffer()
        for place, argument in enumerate((self._state, self._channels)):
            self._buffer.set_arg(place, argument.data)
        for place, result in enumerate(self._results):
            self._buffer.set_res(place, result.data)

    def __call__(self, state: Array) -> tuple[Array, Array]:
        """States after each double step, and beside: the quaternion after its first half and what judges the step."""
        self._state[:] = state
        self._evaluate()
        states, sides = self._results
        return states[: self.count], sides[: self.count]


def _block_length(count: int) -> int:
    """The next of a few lengths, so that few functions are built; the rest of a block is filled with rest."""
    for length in (4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192):
        if count <= length:
            return length
    return _BLOCK


@lru_cache(maxsize=64)
def _double_steps(length: int, with_momentum: bool) -> Any:
    """`length` double steps as one CasADi function of the state and the channels (length, 36 * 9 or 36 * 3)."""
    return _double_step_function(with_momentum).mapaccum("double_steps", length)


@lru_cache(maxsize=2)
def _double_step_function(with_momentum: bool) -> Any:
    import casadi

    state = casadi.SX.sym("state", 14 if with_momentum else 4)
    per_stage = 9 if with_momentum else 3
    data = casadi.SX.sym("channels", 3 * STAGES * per_stage)
    components = casadi.vertsplit(data)
    stages = [components[per_stage * s : per_stage * (s + 1)] for s in range(3 * STAGES)]
    parts = casadi.vertsplit(state)
    quaternion = parts[:4]
    size = parts[13] if with_momentum else None
    coarse, far = judged_step(quaternion, size, stages[:STAGES])
    middle, near = judged_step(quaternion, size, stages[STAGES : 2 * STAGES])
    end, next_near = judged_step(middle, size, stages[2 * STAGES :])
    side = casadi.vertcat(*middle, relative_angle(end, coarse), far**0.5, near**0.5 + next_near**0.5)
    if size is None:
        return casadi.Function("double_step", [state, data], [casadi.vertcat(*end), side])
    doubled = [4.0 * channel for channel in stages[2 * STAGES]]
    matrix = casadi.vertcat(*(casadi.horzcat(*row) for row in variation(body_momentum(middle, size), doubled)))
    propagator = casadi.reshape(casadi.vertcat(*parts[4:13]), 3, 3).T
    even, odd = casadi.SX.eye(3) + casadi.mtimes(matrix, matrix) / 12.0, 0.5 * matrix
    total = casadi.mtimes(casadi.inv_minor(even - odd), casadi.mtimes(even + odd, propagator))
    following = casadi.vertcat(*end, casadi.reshape(total.T, 9, 1), size)
    return casadi.Function("double_step", [state, data], [following, side])
