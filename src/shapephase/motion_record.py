"""Motions in files: a whole motion as NPZ, its attitude in time as CSV."""

from __future__ import annotations

import json
import os
import zipfile
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import so3
from .arrays import Array, finite_array
from .deformation import sampled_deformation
from .errors import InputFileNotFoundError, ResultFileError, ShapeError
from .files import write_whole
from .reconstruction import Motion
from .sampling import Interpolant, values_to_coefficients
from .stepping import SteppedRotation

_FORMAT = "shapephase motion 1"
_STEPS = ("momentum", "times", "panel", "quaternions", "sampling_error", "stepping_error", "amplification", "propagator")
_CENTRE_DEGREE = 16


def save_motion(motion: Motion, stepped: SteppedRotation, path: str | os.PathLike[str]) -> None:
    """Write a motion whole: the sampled deformation, the rotations, the inputs and versions."""
    interpolant = stepped.interpolant
    deformation = motion.deformation
    header = {
        "format": _FORMAT,
        "shapephase": version("shapephase"),
        "numpy": np.__version__,
        "deformation": deformation.label,
        "tolerance": motion.tolerance,
        "method": motion.method,
        "evaluations": motion.evaluations,
        "interpolant_evaluations": interpolant.evaluations,
        "shape_gap": deformation.shape_gap,
        "units": "SI: rad, s, m, kg m^2, kg m^2/s; quaternions x y z w",
    }
    arrays: dict[str, Any] = {
        "header": np.array(json.dumps(header)),
        "spatial_momentum": motion.momentum,
        "initial_attitude": motion.initial_attitude,
        "breaks": deformation.breaks,
        "edges": interpolant.edges,
        "coefficients": interpolant.coefficients,
        "inverse_error": interpolant.inverse_error,
        "drift_error": interpolant.drift_error,
        "centre": _centre_coefficients(motion, interpolant.edges),
        **{f"step_{name}": getattr(stepped, name) for name in _STEPS},
    }
    if deformation.closure is not None:
        arrays["closure"] = deformation.closure
    write_whole(path, lambda stream: np.savez(stream, **arrays))


def load_motion(path: str | os.PathLike[str]) -> Motion:
    """Read a motion written by `Motion.save`; it needs neither the body nor the path it was made from.

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    ResultFileError
        If the file is no motion, is damaged, or was written by a version with another format.
    """
    where = Path(path)
    if not where.is_file():
        raise InputFileNotFoundError(f"{where}: there is no such file")
    try:
        with np.load(where, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        header = json.loads(str(arrays["header"]))
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise ResultFileError(f"{where}: no motion that can be read ({error})") from None
    if header.get("format") != _FORMAT:
        raise ResultFileError(
            f"{where}: holds {header.get('format')!r}, this version reads {_FORMAT!r}; compute the motion anew"
        )
    try:
        return _motion(header, arrays)
    except KeyError as error:
        raise ResultFileError(f"{where}: the motion lacks {error}; compute it anew") from None


def write_attitude_csv(
    motion: Motion, path: str | os.PathLike[str], times: ArrayLike | None = None, **fall: ArrayLike
) -> None:
    """Attitude, angular velocity and base position of one motion as a table in time.

    Raises
    ------
    ShapeError
        If the motion is a batch.
    """
    if motion.batch:
        raise ShapeError(f"a table holds one motion, this is a batch of {motion.batch}; reconstruct one of them")
    t = np.linspace(0.0, motion.duration, 201) if times is None else finite_array(times, "times", (None,), unit="s")
    quaternions = motion.quat_xyzw(t)
    # One sign along the motion, so that a plot of the components does not jump.
    flips = np.cumprod(np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=-1) < 0.0, -1.0, 1.0))
    quaternions[1:] *= flips[:, None]
    columns = [t, *quaternions.T, *motion.angular_velocity(t).T, *motion.base_position(t, **fall).T]  # type: ignore[arg-type]
    names = "time,qx,qy,qz,qw,omega_x_rad_s,omega_y_rad_s,omega_z_rad_s,base_x_m,base_y_m,base_z_m"
    lines = [names, *(",".join(repr(float(v)) for v in row) for row in np.stack(columns, axis=-1))]
    write_whole(path, lambda stream: stream.write(("\n".join(lines) + "\n").encode()) and None)


def _motion(header: dict[str, Any], arrays: dict[str, Array]) -> Motion:
    interpolant = Interpolant(
        arrays["edges"],
        arrays["coefficients"],
        arrays["inverse_error"],
        arrays["drift_error"],
        int(header["interpolant_evaluations"]),
    )
    deformation = sampled_deformation(
        interpolant,
        arrays["centre"],
        arrays["breaks"],
        arrays.get("closure"),
        float(header["shape_gap"]),
        str(header["deformation"]),
    )
    steps = SteppedRotation(interpolant, **{name: arrays[f"step_{name}"] for name in _STEPS})
    return Motion(
        deformation,
        arrays["spatial_momentum"],
        so3.orthonormalised(arrays["initial_attitude"]),
        float(header["tolerance"]),
        str(header["method"]),
        int(header["evaluations"]),
        steps,
    )


def _centre_coefficients(motion: Motion, edges: Array) -> Array:
    """Chebyshev coefficients of the centre of mass on the interpolant's panels: (P, n, 3)."""
    nodes = -np.cos(np.pi * np.arange(_CENTRE_DEGREE + 1) / _CENTRE_DEGREE)
    left, right = edges[:-1, None], edges[1:, None]
    times = np.clip(0.5 * (left + right) + 0.5 * (right - left) * nodes, left, right)
    values = motion.deformation.source.centre_of_mass(times.ravel()).reshape(*times.shape, 3)
    return values_to_coefficients(_CENTRE_DEGREE) @ values
