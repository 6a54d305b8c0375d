"""Steps of many momenta at once, on whole arrays."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ... import run_progress
from ...arrays import Array
from .propagator_step import next_propagator
from .rotation_step import STAGES, momentum_step, turned
from .step_record import StepRecord, checkpoint_steps

_IDENTITY = np.eye(3)


def record_many(
    record: StepRecord, rows: slice, channels: Array, loops: int, directions: Array, magnitudes: Array
) -> None:
    """All steps of many momenta into their rows."""
    with_propagators = bool(record.propagators.shape[1])
    marks = checkpoint_steps(loops * len(channels)).tolist()
    record.directions[rows, 0], record.quaternions[rows, 0] = directions, [0.0, 0.0, 0.0, 1.0]
    record.propagators[rows] = _IDENTITY
    propagator: Any = np.eye(3).tolist()
    start = list(directions.T)
    steps = _steps_of_many(channels, loops, directions, magnitudes)
    for number, (step, end, quaternion, turn, dynamic) in enumerate(steps, 1):
        record.turns[rows, number - 1], record.dynamics[rows, number - 1] = turn, dynamic
        for column, part in enumerate(end):
            record.directions[rows, number, column] = part
        for column, part in enumerate(quaternion):
            record.quaternions[rows, number, column] = part
        if with_propagators:
            propagator = next_propagator(propagator, start, end, magnitudes, step)
            for mark in (place for place, reached in enumerate(marks) if reached == number):
                for i, line in enumerate(propagator):
                    for j, part in enumerate(line):
                        record.propagators[rows, mark, i, j] = part
        start = end


def quaternions_of_many(channels: Array, loops: int, directions: Array, magnitudes: Array) -> Array:
    """The quaternions alone at the ends of all steps: (B, K + 1, 4)."""
    quaternions = np.empty((len(magnitudes), loops * len(channels) + 1, 4))
    quaternions[:, 0] = [0.0, 0.0, 0.0, 1.0]
    for number, (_, _, quaternion, _, _) in enumerate(_steps_of_many(channels, loops, directions, magnitudes), 1):
        for column, part in enumerate(quaternion):
            quaternions[:, number, column] = part
    return quaternions


def _steps_of_many(channels: Array, loops: int, directions: Array, magnitudes: Array) -> Iterator[tuple[Any, ...]]:
    """After each step its channels, directions, quaternions, turns and dynamic phases, the components apart."""
    direction, quaternion = list(directions.T), [0.0, 0.0, 0.0, 1.0]
    steps = channels.reshape(-1, STAGES, 9).tolist()
    for _ in range(loops):
        for step in steps:
            end, turn, dynamic = momentum_step(direction, magnitudes, step)
            half = 0.5 * turn
            quaternion = turned(quaternion, direction, end, (np.sin(half), np.cos(half)))
            run_progress.advance(1)
            yield step, end, quaternion, turn, dynamic
            direction = end
