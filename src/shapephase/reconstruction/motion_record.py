"""Files of motions: a whole motion as NPZ, a time series as CSV."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import __version__, so3
from ..arrays import Array
from ..chebyshev import nodes_on, values_to_coefficients
from ..deformation.deformation import Deformation
from ..deformation.descriptions import SampledDescription
from ..errors import ResultFileError, TrajectoryError
from ..files import no_such_file, npz_arrays, write_whole
from ..integrator.interpolant import Interpolant
from ..integrator.many_rotations import GroupedRotations, RotationPart
from ..integrator.samples import Perturbed
from ..integrator.stepped import SteppedRotation
from ..provenance import provenance
from ..shape_space.shape_path import ShapePath
from ._stored_arrays import check_deformation, check_rotation, check_rows, check_start
from .attitude_angles import continuous

if TYPE_CHECKING:
    from .reconstruction import Motion

_FORMAT = "shapephase motion 3"
_STEPS = (
    "momentum", "steps", "quaternions", "directions", "turns", "dynamics", "sampling_error", "stepping_error",
    "rounding_error", "amplification",
)  # fmt: skip
_SAMPLES = ("edges", "coefficients")
_VECTOR_DEGREE = 24


def write_motion_record(motion: Motion, path: str | os.PathLike[str]) -> None:
    """Write a motion with versions and units."""
    solution, deformation = motion.stepped, motion.deformation
    interpolant = solution.interpolant
    header = {
        "format": _FORMAT,
        "shapephase": __version__,
        "numpy": np.__version__,
        "deformation": deformation.label,
        "sha256": dict(deformation.inputs),
        "provenance": provenance(deformation.made_from),
        "tolerance": motion.tolerance,
        "method": motion.method,
        "evaluations": motion.evaluations,
        "loops": interpolant.loops,
        "interpolant_evaluations": interpolant.evaluations,
        "shape_gap": deformation.shape_gap,
        "units": "SI: rad, s, m, kg m^2, kg m^2/s; quaternions x y z w",
    }
    arrays: dict[str, Any] = {
        "header": np.array(json.dumps(header)),
        "spatial_momentum": motion.momentum,
        "initial_attitude": motion.initial_attitude,
        "breaks": deformation.breaks,
        "centre": _vector_coefficients(deformation.centre_of_mass, interpolant),
        **_samples(interpolant),
        **_joints(motion),
    }
    if deformation.has_wheels:
        arrays["stored"] = _vector_coefficients(deformation.stored_momentum, interpolant)
    if isinstance(solution, GroupedRotations):
        header["parts"] = [part.rotation.interpolant.evaluations for part in solution.parts]
        arrays["header"] = np.array(json.dumps(header))
        for number, (rows, rotation) in enumerate(solution.parts):
            of_part = {"rows": rows, **_samples(rotation.interpolant), **_steps(rotation)}
            arrays.update({_of_part(number, name): value for name, value in of_part.items()})
    else:
        arrays.update(_steps(solution))
    if deformation.closure is not None:
        arrays["closure"] = deformation.closure
    write_whole(path, lambda stream: np.savez(stream, **arrays))


def _joint_path(deformation: Deformation) -> ShapePath | None:
    """Path of the joints behind a deformation, in any gauge; None without one."""
    description: Any = deformation.description
    while hasattr(description, "original"):
        description = description.original
    path = getattr(description, "path", None)
    return path if isinstance(path, ShapePath) else None


def _joints(motion: Motion) -> dict[str, Array]:
    """Joints and base at `ShapePath.sample_times`, for `read_recorded_motion`; empty for batches and without a path."""
    path = _joint_path(motion.deformation)
    if path is None or motion.batch or not path.n_shape:
        return {}
    with suppress(TrajectoryError):  # a path that needs more than a million rows
        times = path.sample_times
        return {
            "time": times,
            "shapes": path.shape(times),
            "joint_names": np.array(motion.deformation.made_from["joints"]),
            "base_quat_xyzw": continuous(motion.quat_xyzw(times)),
        }
    return {}


def read_motion_record(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Read the fields of a `Motion` from a file of `write_motion_record`.

    Its deformation is made of the samples: it needs neither body nor path.

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    ResultFileError
        If the file is not a motion, is damaged, or was written by a version with another format.
    """
    where = Path(path)
    if not where.is_file():
        raise no_such_file(where)
    try:
        arrays = npz_arrays(where.read_bytes())
        header = json.loads(str(arrays["header"]))
    except (OSError, ValueError, KeyError, RecursionError) as error:
        raise ResultFileError(f"{where}: not a readable motion ({error})") from None
    if not isinstance(header, dict) or "format" not in header:
        raise ResultFileError(f"{where}: not a motion; its header is {str(header)[:80]!r}")
    if header["format"] != _FORMAT:
        raise ResultFileError(
            f"{where}: holds {header['format']!r}, this version reads {_FORMAT!r}; compute the motion anew"
        )
    try:
        return _record(header, arrays)
    except KeyError as error:
        raise ResultFileError(f"{where}: the motion lacks {error}; compute it anew") from None
    except (ArithmeticError, AttributeError, TypeError, ValueError) as error:
        raise ResultFileError(f"{where}: the motion's numbers cannot be used ({error}); compute it anew") from None


def write_table(path: str | os.PathLike[str], columns: Mapping[str, Array]) -> None:
    """Write columns of numbers as CSV, every digit kept."""
    rows = np.column_stack(list(columns.values())).tolist()
    text = "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows), ""])
    write_whole(path, lambda stream: stream.write(text.encode()))


def _samples(interpolant: Interpolant) -> dict[str, Array]:
    return {name: getattr(interpolant, name) for name in _SAMPLES}


def _steps(rotation: SteppedRotation) -> dict[str, Array]:
    kept = {f"step_{name}": getattr(rotation, name) for name in _STEPS}
    return kept | {"perturbed": rotation.perturbed.coefficients, "hidden": np.array(rotation.perturbed.hidden)}


def _of_part(number: int, name: str) -> str:
    """Name of an array of one part of a batch whose samples differ."""
    return f"part_{number}_{name}"


def _record(header: Mapping[str, Any], arrays: Mapping[str, Any]) -> dict[str, Any]:
    loops = int(header["loops"])
    check_deformation(arrays, loops)
    interpolant = _interpolant(arrays, loops, int(header["interpolant_evaluations"]))
    breaks = arrays["breaks"]
    deformation = Deformation(
        SampledDescription(interpolant, arrays["centre"], arrays.get("stored")),
        float(breaks[-1]),
        breaks,
        arrays.get("closure"),
        _positive(header, "shape_gap"),
        str(header["deformation"]),
        inputs={str(name): str(digest) for name, digest in header["sha256"].items()},
        made_from=_made_from(header),
    )
    return {
        "deformation": deformation,
        "momentum": arrays["spatial_momentum"],
        "initial_attitude": so3.orthonormalised(arrays["initial_attitude"]),
        "tolerance": _positive(header, "tolerance"),
        "method": str(header["method"]),
        "evaluations": int(header["evaluations"]),
        "solution": _solution(header, arrays, interpolant),
    }


def _positive(header: Mapping[str, Any], name: str) -> float:
    """Return a number of the header that is not negative."""
    value = float(header[name])
    if not 0.0 <= value < np.inf:
        raise ValueError(f"{name} is {value}")
    return value


def _made_from(header: Mapping[str, Any]) -> dict[str, Any]:
    """Return the provenance of a stored motion, with date, command and versions under "computed"."""
    stored = header.get("provenance", {})
    if not isinstance(stored, dict):
        raise TypeError("its provenance is not an object")
    how = {name: stored[name] for name in ("date", "command", "versions") if name in stored}
    return {name: value for name, value in stored.items() if name not in how} | ({"computed": how} if how else {})


def _solution(
    header: Mapping[str, Any], arrays: Mapping[str, Any], interpolant: Interpolant
) -> SteppedRotation | GroupedRotations:
    count = check_start(arrays)
    if "parts" not in header:
        check_rotation(arrays, interpolant.loops, count)
        return _rotation(arrays, interpolant)
    parts: list[RotationPart] = []
    for number, evaluations in enumerate(header["parts"]):
        start = _of_part(number, "")
        own = {name.removeprefix(start): value for name, value in arrays.items() if name.startswith(start)}
        check_rotation(own, interpolant.loops, len(own["rows"]))
        samples = _interpolant(own, interpolant.loops, int(evaluations))
        parts.append(RotationPart(own["rows"], _rotation(own, samples)))
    check_rows([part.rows for part in parts], count)
    return GroupedRotations(tuple(parts), int(header["evaluations"]))


def _interpolant(arrays: Mapping[str, Any], loops: int, evaluations: int) -> Interpolant:
    return Interpolant(**{name: arrays[name] for name in _SAMPLES}, loops=loops, evaluations=evaluations)


def _rotation(arrays: Mapping[str, Any], interpolant: Interpolant) -> SteppedRotation:
    perturbed = Perturbed(arrays["perturbed"], float(arrays["hidden"]))
    return SteppedRotation(interpolant, **{name: arrays[f"step_{name}"] for name in _STEPS}, perturbed=perturbed)


def _vector_coefficients(vector: Callable[[Array], Array], interpolant: Interpolant) -> Array:
    """Chebyshev coefficients of a vector in time on the interpolant's panels: (P, n, 3)."""
    edges = interpolant.edges[: len(interpolant.coefficients) + 1]
    left, right = edges[:-1], edges[1:]
    times = np.clip(nodes_on(left, right, _VECTOR_DEGREE), left[:, None], right[:, None])
    values = vector(times.ravel()).reshape(*times.shape, 3)
    return values_to_coefficients(_VECTOR_DEGREE) @ values
