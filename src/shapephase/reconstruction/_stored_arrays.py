"""Checks of the arrays of a stored motion before they are used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array, Integers, finite_array

_CHANNELS = 9  # of the interpolant: six of the inverse inertia, three of the drift
_UNIT = 1e-6  # distance of a stored rotation from an orthonormal one that `so3.orthonormalised` accepts


def check_deformation(arrays: Mapping[str, Any], loops: int) -> None:
    """Raise ValueError where samples, breaks, centre of mass or closure do not go together, KeyError if one lacks."""
    edges, coefficients = _samples(arrays, loops)
    breaks = _numbers(arrays, "breaks", None)
    if len(breaks) < 2 or breaks[0] != 0.0 or np.any(np.diff(breaks) <= 0.0):
        raise ValueError("breaks do not ascend from 0")
    if breaks[-1] != edges[-1]:
        raise ValueError(f"breaks end at {breaks[-1]:g} s, edges at {edges[-1]:g} s")
    for name in ("centre", "stored"):
        if name in arrays or name == "centre":
            _numbers(arrays, name, len(coefficients), None, 3)
    if "closure" in arrays:
        _check_rotations(_numbers(arrays, "closure", 3, 3), "closure")


def check_start(arrays: Mapping[str, Any]) -> int:
    """Number of motions. Raises ValueError where momenta and attitudes have different shapes."""
    momentum = finite_array(arrays["spatial_momentum"], "spatial_momentum", (3,))
    attitude = _numbers(arrays, "initial_attitude", *momentum.shape, 3)
    _check_rotations(attitude, "initial_attitude")
    return momentum.size // 3


def check_rotation(arrays: Mapping[str, Any], loops: int, count: int) -> None:
    """Raise ValueError where the steps of `count` motions do not go with their samples."""
    _, coefficients = _samples(arrays, loops)
    steps = _integers(arrays, "step_steps", len(coefficients))
    if np.any(steps < 1):
        raise ValueError("step_steps: a panel has one step or more")
    total = loops * sum(steps.tolist())
    _numbers(arrays, "step_momentum", count, 3)
    quaternions = _numbers(arrays, "step_quaternions", None, total + 1, 4)
    if len(quaternions) not in (1, count):
        raise ValueError(f"step_quaternions: {count} motions are needed, got {len(quaternions)}")
    if np.any(np.abs((quaternions**2).sum(axis=-1) - 1.0) > _UNIT):
        raise ValueError("step_quaternions: not all are of length 1")
    directions = _numbers(arrays, "step_directions", count, None, 3)
    if directions.shape[1] not in (0, total + 1):
        raise ValueError(f"step_directions: {total + 1} directions are needed, got {directions.shape[1]}")
    if directions.shape[1]:
        _check_directions(directions, quaternions)
    for name in ("step_turns", "step_dynamics"):
        _numbers(arrays, name, count, None if directions.shape[1] == 0 else total)
    for name in ("step_sampling_error", "step_stepping_error", "step_rounding_error", "step_amplification"):
        if np.any(_numbers(arrays, name, count) < 0.0):
            raise ValueError(f"{name} is below 0")
    _numbers(arrays, "perturbed", *coefficients.shape)
    _numbers(arrays, "hidden")


def _check_directions(directions: Array, quaternions: Array) -> None:
    """Raise ValueError where directions of the momentum contradict the attitudes."""
    turned = so3.apply(so3.transpose(so3.matrix_from_quat(quaternions)), directions[:, :1])
    # Compared before squares, which overflow for the numbers of a damaged file.
    if np.any(np.abs(directions) > 2.0) or np.any(np.abs(turned - directions) > _UNIT):
        raise ValueError("step_directions: the momentum is not constant in space")
    if np.any(np.abs((directions[:, :1] ** 2).sum(axis=-1) - 1.0) > _UNIT):
        raise ValueError("step_directions: not of length 1")


def check_forced(arrays: Mapping[str, Any], duration: float, degrees: int) -> None:
    """Raise ValueError where states, torques and errors of a motion under a torque do not go together."""
    times = _numbers(arrays, "step_times", None)
    if len(times) < 2 or times[0] != 0.0 or times[-1] != duration or np.any(np.diff(times) <= 0.0):
        raise ValueError("step_times do not ascend from 0 to the end")
    states = _numbers(arrays, "step_states", len(times) - 1, degrees, 8)
    _numbers(arrays, "step_torques", len(times) - 1, None, 3)
    # At the ends of steps Chebyshev polynomials are 1 and -1.
    at_ends = states[:, :, :4].sum(axis=1), states[:, ::2, :4].sum(axis=1) - states[:, 1::2, :4].sum(axis=1)
    if any(np.any(np.abs((ends**2).sum(axis=-1) - 1.0) > _UNIT) for ends in at_ends):
        raise ValueError("step_states: quaternions are not of length 1")
    if np.any(_numbers(arrays, "solution_scales", 4) <= 0.0):
        raise ValueError("solution_scales are not above 0")
    checked = _numbers(arrays, "solution_error_times", None)
    errors = (
        _numbers(arrays, "solution_attitude_errors", len(checked)),
        _numbers(arrays, "solution_state_errors", len(checked), 4),
    )
    if not len(checked) or any(np.any(error < 0.0) for error in errors):
        raise ValueError("solution_attitude_errors: none, or some below 0")
    _numbers(arrays, "torque_breaks", None)


def check_rows(parts: Sequence[Any], count: int) -> None:
    """Raise ValueError unless each of `count` motions is in one part, and in one only."""
    rows = [row for part in parts for row in _integers({"rows": part}, "rows", None).tolist()]
    if sorted(rows) != list(range(count)):
        raise ValueError(f"rows: each of {count} motions is needed once")


def _samples(arrays: Mapping[str, Any], loops: int) -> tuple[Array, Array]:
    """Edges and coefficients of an interpolant."""
    coefficients = _numbers(arrays, "coefficients", None, None, _CHANNELS)
    if loops < 1 or not coefficients.size:
        raise ValueError("no samples")
    edges = _numbers(arrays, "edges", loops * len(coefficients) + 1)
    if edges[0] != 0.0 or np.any(np.diff(edges) <= 0.0):
        raise ValueError("edges do not ascend from 0")
    return edges, coefficients


def _numbers(arrays: Mapping[str, Any], name: str, *shape: int | None) -> Array:
    """An array of finite numbers with as many axes as lengths are given; None: any length."""
    array = finite_array(arrays[name], name, shape)
    if array.ndim != len(shape) or np.asarray(arrays[name]).dtype != np.float64:
        raise ValueError(f"{name}: {len(shape)} axes of doubles are needed, got {array.shape}")
    return array


def _integers(arrays: Mapping[str, Any], name: str, length: int | None) -> Integers:
    array = np.asarray(arrays[name])
    if array.dtype != np.int64 or array.ndim != 1 or length not in (None, len(array)):
        raise ValueError(f"{name}: {'' if length is None else length} whole numbers are needed, got {array.shape}")
    return array


def _check_rotations(matrices: Array, name: str) -> None:
    excess = matrices.swapaxes(-1, -2) @ matrices - np.eye(3)
    if np.any(np.abs(excess) > _UNIT) or np.any(np.linalg.det(matrices) < 0.0):
        raise ValueError(f"{name}: not a rotation")
