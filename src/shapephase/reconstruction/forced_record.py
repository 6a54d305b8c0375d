"""Files of motions under a torque: the state as a series on each step, and the torque along the motion."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import so3
from ..arrays import Array
from ..chebyshev import PiecewiseChebyshev, inside, nodes_on, values_to_coefficients
from ..display import frozen
from ..integrator.driven_attitude import DrivenAttitude
from .external_torque import ExternalTorque, TorqueState
from .motion_record import FORCED_FORMAT, read_deformation, read_record, stored_deformation, write_record

if TYPE_CHECKING:
    from .forced_motion import ForcedMotion

_STATE_DEGREE = 7  # of DOP853's dense output on a step
_TORQUE_DEGREE = 16  # on a step: of gravity gradient it misses 1e-15
_SOLUTION = ("scales", "error_times", "attitude_errors", "state_errors")


@frozen
class StoredRun:
    """Unit quaternion and other states in time, as a series on each step.

    times : (K + 1,) ends of the steps [s]
    coefficients : (K, 8, 4 + k)
    """

    times: Array
    coefficients: Array

    def __call__(self, t: Array) -> Array:
        """States at times: (N,) -> (N, 4 + k)."""
        values = PiecewiseChebyshev(self.times, self.coefficients)(t)
        values[:, :4] = so3.normalised(values[:, :4])
        return values


@frozen
class StoredTorque:
    """Torque along a motion, a function of time.

    times, coefficients : (K + 1,) [s], (K, n, 3) [N m]
    """

    times: Array
    coefficients: Array

    def __call__(self, state: TorqueState) -> Array:
        """Torque at the time of a state: (3,)."""
        return PiecewiseChebyshev(self.times, self.coefficients)(np.array([state.time]))[0]


def write_forced_record(motion: ForcedMotion, path: str | os.PathLike[str]) -> None:
    """Write a motion under a torque with versions and units."""
    solution, deformation = motion.solution, motion.deformation
    times = solution.times
    largest = float(np.linalg.norm(motion.momentum(times), axis=-1).max())
    interpolant = deformation.sampler().samples(largest, motion.tolerance).interpolant
    header, arrays = stored_deformation(deformation, interpolant)
    header |= {
        "format": FORCED_FORMAT,
        "tolerance": motion.tolerance,
        "evaluations": motion.evaluations,
        "torque_axes": motion.torque_law.axes,
    }
    at_states, at_torques = _nodes(times, _STATE_DEGREE), _nodes(times, _TORQUE_DEGREE)
    torques = motion.torque(at_torques.ravel())
    if motion.torque_law.axes == "space":
        torques = so3.apply(motion.attitude(at_torques.ravel()), torques)
    arrays |= {
        "spatial_momentum": motion.initial_momentum,
        "initial_attitude": motion.initial_attitude,
        "step_times": times,
        "step_states": _series(solution.run(at_states.ravel()), at_states),
        "step_torques": _series(torques, at_torques),
        "torque_breaks": motion.torque_law.edges(motion.duration),
        **{f"solution_{name}": getattr(solution, name) for name in _SOLUTION},
    }
    write_record(path, header, arrays)


def read_forced_record(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the fields of a `ForcedMotion` from a file of `write_forced_record`. Raises like `read_motion_record`."""
    return read_record(path, FORCED_FORMAT, _record)


def _record(header: Mapping[str, Any], arrays: Mapping[str, Any]) -> dict[str, Any]:
    deformation, _ = read_deformation(header, arrays)
    times = arrays["step_times"]
    law = ExternalTorque(
        StoredTorque(times, arrays["step_torques"]), axes=str(header["torque_axes"]), breaks=arrays["torque_breaks"]
    )
    known = {name: arrays[f"solution_{name}"] for name in _SOLUTION}
    run = StoredRun(times, arrays["step_states"])
    return {
        "deformation": deformation,
        "torque_law": law,
        "initial_momentum": arrays["spatial_momentum"],
        "initial_attitude": so3.orthonormalised(arrays["initial_attitude"]),
        "tolerance": float(header["tolerance"]),
        "solution": DrivenAttitude(run=run, **known, evaluations=int(header["evaluations"])),
    }


def _nodes(times: Array, degree: int) -> Array:
    """Chebyshev points inside each step: (K, degree + 1)."""
    left, right = times[:-1], times[1:]
    first, last = inside(left, right)
    return np.clip(nodes_on(left, right, degree), first[:, None], last[:, None])


def _series(values: Array, nodes: Array) -> Array:
    """Coefficients (K, n, c) of values (K n, c) at nodes (K, n)."""
    return values_to_coefficients(nodes.shape[1] - 1) @ values.reshape(*nodes.shape, -1)
