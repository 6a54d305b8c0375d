"""Files of motions: a whole motion as NPZ, a time series as CSV."""

from __future__ import annotations

import hashlib
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
from .attitude_angles import continuous

if TYPE_CHECKING:
    from .reconstruction import Motion

_FORMAT = "shapephase motion 3"
FORCED_FORMAT = "shapephase forced motion 1"
_READERS = {_FORMAT: "load_motion(file)", FORCED_FORMAT: "ForcedMotion.load(file)"}
_STEPS = (
    "momentum", "steps", "quaternions", "directions", "turns", "dynamics", "sampling_error", "stepping_error",
    "rounding_error", "amplification",
)  # fmt: skip
_SAMPLES = ("edges", "coefficients")
_VECTOR_DEGREE = 24


def write_motion_record(motion: Motion, path: str | os.PathLike[str]) -> None:
    """Write a motion with versions and units."""
    solution, deformation = motion.stepped, motion.deformation
    header, arrays = stored_deformation(deformation, solution.interpolant)
    header |= {
        "format": _FORMAT,
        "tolerance": motion.tolerance,
        "method": motion.method,
        "evaluations": motion.evaluations,
    }
    arrays |= {"spatial_momentum": motion.momentum, "initial_attitude": motion.initial_attitude}
    if isinstance(solution, GroupedRotations):
        header["parts"] = [part.rotation.interpolant.evaluations for part in solution.parts]
        for number, (rows, rotation) in enumerate(solution.parts):
            of_part = {"rows": rows, **_samples(rotation.interpolant), **_steps(rotation)}
            arrays.update({_of_part(number, name): value for name, value in of_part.items()})
    else:
        arrays.update(_steps(solution))
    write_record(path, header, arrays | _joints(motion))


def stored_deformation(deformation: Deformation, interpolant: Interpolant) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return header and arrays of a deformation by its samples, with versions and units."""
    header = {
        "shapephase": __version__,
        "numpy": np.__version__,
        "deformation": deformation.label,
        "sha256": dict(deformation.inputs),
        "provenance": provenance(deformation.made_from),
        "loops": interpolant.loops,
        "interpolant_evaluations": interpolant.evaluations,
        "shape_gap": deformation.shape_gap,
        "units": "SI: rad, s, m, kg m^2, kg m^2/s; quaternions x y z w",
    }
    arrays: dict[str, Any] = {
        "breaks": deformation.breaks,
        "centre": _vector_coefficients(deformation.centre_of_mass, interpolant),
        **_samples(interpolant),
    }
    if deformation.has_wheels:
        arrays["stored"] = _vector_coefficients(deformation.stored_momentum, interpolant)
    if deformation.closure is not None:
        arrays["closure"] = deformation.closure
    return header, arrays


def write_record(path: str | os.PathLike[str], header: Mapping[str, Any], arrays: Mapping[str, Any]) -> None:
    """Write an NPZ file with a header, which has a digest of all that is in the file."""
    header = {**header, "digest": _digest(header, arrays)}
    write_whole(path, lambda stream: np.savez(stream, header=np.array(json.dumps(header)), **arrays))


def _digest(header: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    """SHA-256 of a header, its own digest left out, and of arrays by name."""
    whole = hashlib.sha256(json.dumps({**header, "digest": None}, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.asarray(arrays[name])
        whole.update(f"{name} {array.dtype.str} {array.shape}".encode() + array.tobytes())
    return whole.hexdigest()


def joint_path(deformation: Deformation) -> ShapePath | None:
    """Path of all joints behind a deformation, in any gauge, with wheels at zero; None without one."""
    description = _original(deformation)
    path = getattr(description, "path", None) or getattr(description, "route", None)
    return path if isinstance(path, ShapePath) else None


def _original(deformation: Deformation) -> Any:
    """The description behind gauges."""
    description: Any = deformation.description
    while hasattr(description, "original"):
        description = description.original
    return description


def _joints(motion: Motion) -> dict[str, Array]:
    """Joints, wheels left out, and base at `ShapePath.sample_times`, for `read_recorded_motion`.

    Empty for batches and without a path.
    """
    path = joint_path(motion.deformation)
    if path is None or motion.batch or not path.n_shape:
        return {}
    wheels = {rotor.joint for rotor in getattr(_original(motion.deformation), "rotors", ())}
    names = motion.deformation.made_from["joints"]
    driven = [column for column, name in enumerate(names) if name not in wheels]
    with suppress(TrajectoryError):  # a path that needs more than a million rows
        times = path.sample_times
        return {
            "time": times,
            "shapes": path.shape(times)[:, driven],
            "joint_names": np.array([names[column] for column in driven]),
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
    return read_record(path, _FORMAT, _record)


def read_record(
    path: str | os.PathLike[str], known: str, record: Callable[[Mapping[str, Any], Mapping[str, Any]], dict[str, Any]]
) -> dict[str, Any]:
    """Read the fields of a motion from a file of the known format, made of its header and arrays.

    Raises like `read_motion_record`.
    """
    where = Path(path)
    if not where.is_file():
        raise no_such_file(where)
    try:
        arrays = npz_arrays(where.read_bytes())
        header = json.loads(str(arrays.pop("header")))
    except (OSError, ValueError, KeyError, RecursionError) as error:
        raise ResultFileError(f"{where}: not a readable motion ({error})") from None
    if not isinstance(header, dict) or "format" not in header:
        raise ResultFileError(f"{where}: not a motion; its header is {str(header)[:80]!r}")
    if header["format"] != known:
        remedy = _READERS.get(header["format"])
        raise ResultFileError(
            f"{where}: holds {header['format']!r}, this version reads {known!r} here; "
            + ("compute the motion anew" if remedy is None else f"read it with {remedy}")
        )
    # Files of earlier versions have no digest.
    if header.get("digest", digest := _digest(header, arrays)) != digest:
        raise ResultFileError(f"{where}: the motion is damaged, its numbers are not those written; compute it anew")
    try:
        return record(header, arrays)
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


def read_deformation(header: Mapping[str, Any], arrays: Mapping[str, Any]) -> tuple[Deformation, Interpolant]:
    """Return the deformation made of stored samples, and these."""
    interpolant = _interpolant(arrays, int(header["loops"]), int(header["interpolant_evaluations"]))
    breaks = arrays["breaks"]
    deformation = Deformation(
        SampledDescription(interpolant, arrays["centre"], arrays.get("stored")),
        float(breaks[-1]),
        breaks,
        arrays.get("closure"),
        float(header["shape_gap"]),
        str(header["deformation"]),
        inputs={str(name): str(digest) for name, digest in header["sha256"].items()},
        made_from=_made_from(header),
    )
    return deformation, interpolant


def _record(header: Mapping[str, Any], arrays: Mapping[str, Any]) -> dict[str, Any]:
    deformation, interpolant = read_deformation(header, arrays)
    return {
        "deformation": deformation,
        "momentum": arrays["spatial_momentum"],
        "initial_attitude": so3.orthonormalised(arrays["initial_attitude"]),
        "tolerance": float(header["tolerance"]),
        "method": str(header["method"]),
        "evaluations": int(header["evaluations"]),
        "solution": _solution(header, arrays, interpolant),
    }


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
    if "parts" not in header:
        return _rotation(arrays, interpolant)
    parts: list[RotationPart] = []
    for number, evaluations in enumerate(header["parts"]):
        start = _of_part(number, "")
        own = {name.removeprefix(start): value for name, value in arrays.items() if name.startswith(start)}
        samples = _interpolant(own, interpolant.loops, int(evaluations))
        parts.append(RotationPart(own["rows"], _rotation(own, samples)))
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
