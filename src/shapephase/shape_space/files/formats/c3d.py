"""C3D files: angles that the models of motion-capture programs compute, or poses of segments, beside the markers."""

from __future__ import annotations

import importlib.util
import re
import tempfile
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import TrajectoryError
from ..labels import LENGTHS, unit_of
from ..recording import Table
from .column_tables import column_table
from .parser_process import by_library, parsed
from .segment_poses import matrix_poses

INVERSE_KINEMATICS = (  # the way from markers to joints
    "positions of markers are no angles of joints; find those by inverse kinematics first (in OpenSim: scale the "
    "model, run the Inverse Kinematics tool with these markers), and give the `.mot` file that it writes"
)
_BLOCK = 512  # bytes; the header is one block
_KEY = 0x50  # second byte of every C3D file, and of its parameters
_PROCESSORS = (84, 85, 86)  # number formats: Intel, DEC, MIPS
_AXES = "xyz"


def read_c3d(where: Path, data: bytes) -> Table:
    """Angles of a C3D file, columns `A_x`, `A_y` and `A_z` for each output `A` of the parameter ANGLES.

    Without angles, the poses of segments in its group ROTATION, as markerless systems write them. The file is parsed in
    a process of its own: a damaged one can crash ezc3d.
    """
    with by_library(where, "C3D file", "ezc3d"):
        if importlib.util.find_spec("ezc3d") is None:
            raise ImportError
    _check_sizes(where, data)
    content = parsed(where, data, "C3D", __name__)
    labels, angles = content["labels"].tolist(), set(content["angles"].tolist())
    values, matrices, first = content["points"], content["rotations"], int(content["first"])
    places = [(k, label) for k, label in enumerate(labels[: values.shape[1]]) if label in angles]
    segments = content["segments"].tolist()
    if not places and not segments:
        raise TrajectoryError(f"{where}: {len(labels)} points and no angles among them: {INVERSE_KINEMATICS}")
    rate = float(content["rate"] if places else content["rotation_rate"])
    if not 0.0 < rate < np.inf:
        raise TrajectoryError(f"{where}: the parameter POINT:RATE, samples a second, is {rate:g}")
    if places:
        unit = unit_of(str(content["unit"]))
        frames = first + np.arange(values.shape[2])
        columns = [(f"{label}_{axis}", values[row, k]) for k, label in places for row, axis in enumerate(_AXES)]
        units, poses = {} if unit is None else {name: unit for name, _ in columns}, None
    else:
        known = min(len(segments), matrices.shape[2])
        names = tuple(re.sub(r"_?4[xX]4$", "", label) for label in segments[:known])
        frames = first * matrices.shape[3] // max(int(content["frames"]), 1) + np.arange(matrices.shape[3])
        metre = LENGTHS.get(unit_of(str(content["length_unit"])) or "")
        columns, units, poses = [], {}, matrix_poses(names, matrices[:, :, :known], metre)
    table = column_table(
        str(where), "C3D", [("time", frames / rate), *columns], units=units | {"time": "s"}, row="frame"
    )
    return replace(table, rows=(frames + 1).tolist(), poses=poses)


def parse(data: bytes) -> dict[str, Any]:
    """Parse the bytes of a file, in a process of its own."""
    import ezc3d

    with tempfile.NamedTemporaryFile(suffix=".c3d") as copy:
        copy.write(data)
        copy.flush()
        file = ezc3d.c3d(copy.name)
    point, turned = file["parameters"]["POINT"], file["parameters"].get("ROTATION", {})
    rotations = np.asarray(file["data"].get("rotations", np.empty((4, 4, 0, 0))), dtype=np.float64)
    rate = np.array([*np.ravel(point["RATE"]["value"]), np.nan])[0]
    frames = np.shape(file["data"]["points"])[2]
    return {
        "segments": np.array(_texts(turned, "LABELS") if rotations.size else [], dtype=str),
        "rotations": rotations,
        "rotation_rate": rate * rotations.shape[3] / max(frames, 1),
        "frames": np.array(frames),
        "length_unit": np.array("".join(_texts(point, "UNITS")[:1])),
        "labels": np.array(_texts(point, "LABELS"), dtype=str),
        "angles": np.array(_texts(point, "ANGLES"), dtype=str),
        "unit": np.array("".join(_texts(point, "ANGLE_UNITS")[:1])),
        "rate": rate,
        "first": np.array(int(file["header"]["points"]["first_frame"])),
        "points": np.asarray(file["data"]["points"], dtype=np.float64),
    }


def _check_sizes(where: Path, data: bytes) -> None:
    """Raise TrajectoryError where header or parameters promise more than the file has: ezc3d relies on them."""
    words = np.frombuffer(data[:_BLOCK], dtype=np.uint8)
    place = (int(words[0]) - 1) * _BLOCK if len(words) == _BLOCK else -1
    if place < 0 or words[1] != _KEY or place + 4 > len(data) or data[place + 3] not in _PROCESSORS:
        raise TrajectoryError(f"{where}: no C3D file that can be read (its header is damaged)")
    order = ">" if data[place + 3] == _PROCESSORS[2] else "<"
    header = np.frombuffer(data[:_BLOCK], dtype=f"{order}u2")
    points, analog, first, last = (int(header[k]) for k in (1, 2, 3, 4))
    start = (int(header[8]) - 1) * _BLOCK
    scale = np.frombuffer(data[12:16], dtype=f"{order}f4")[0]
    size = 4 if scale < 0.0 else 2
    frames = last - first + 1
    if place + data[place + 2] * _BLOCK > len(data) or start < 0 or frames < 1:
        raise TrajectoryError(f"{where}: no C3D file that can be read (its header is damaged)")
    if start + frames * (4 * points + analog) * size > len(data):
        raise TrajectoryError(
            f"{where}: the header promises {frames} frames of {points} points, and the file is shorter; it is cut off"
        )


def _texts(group: Any, name: str) -> list[str]:
    """A parameter of texts, and those that continue it under the same name with a number: at most 255 fit into one."""
    texts: list[str] = []
    for k in count(1):
        key = name if k == 1 else f"{name}{k}"
        if key not in group:
            break
        texts += [str(text).strip() for text in np.ravel(group[key]["value"]).tolist()]
    return texts
