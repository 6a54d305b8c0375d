"""BVH files written for tests: a skeleton with the names and the order of channels of a public library, and motions.

The numbers are our own, of a person of 1.74 m in units of 0.05 m. Written and posed here without the library.
`python -m support.bvh_files`, in `tests/`, writes the jump of `robots/formats` anew.
"""

from __future__ import annotations

import re
import tempfile
import warnings
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import shapephase as sp
from shapephase.errors import IgnoredElementWarning
from support.places import ROBOTS

UNIT = 0.05
"""[m]"""
ZYX = ("Zrotation", "Yrotation", "Xrotation")
_RIGID = re.compile("HipJoint|ToeBase|FingerBase|LowerBack|Neck|Shoulder")  # bones that a solver keeps still
_LIMBS = {
    "Left": (1.0, "LeftToeBase", "LeftFingerBase"),
    "Right": (-1.0, "RightToeBase", "RightFingerBase"),
}


def bones() -> list[tuple[str, str | None, tuple[float, float, float], tuple[float, float, float] | None]]:
    """Name, parent, offset and end of each bone, in the order of a file: y up, z forward, x left."""
    found: list[tuple[str, str | None, tuple[float, float, float], tuple[float, float, float] | None]] = [
        ("Hips", None, (0.0, 0.0, 0.0), None)
    ]
    for side, (sign, toes, _) in _LIMBS.items():
        short = side[0]
        found += [
            (f"{short}HipJoint", "Hips", (0.0, 0.0, 0.0), None),
            (f"{side}UpLeg", f"{short}HipJoint", (1.7 * sign, -1.8, 0.1), None),
            (f"{side}Leg", f"{side}UpLeg", (0.4 * sign, -8.3, 0.0), None),
            (f"{side}Foot", f"{side}Leg", (0.3 * sign, -8.4, -0.2), None),
            (toes, f"{side}Foot", (0.1 * sign, -0.9, 2.6), (0.0, 0.0, 1.2)),
        ]
    found += [
        ("LowerBack", "Hips", (0.0, 0.0, 0.0), None),
        ("Spine", "LowerBack", (0.0, 2.9, -0.2), None),
        ("Spine1", "Spine", (0.0, 3.1, -0.1), None),
        ("Neck", "Spine1", (0.0, 3.4, 0.2), None),
        ("Head", "Neck", (0.0, 2.0, 0.3), (0.0, 2.6, 0.1)),
    ]
    for side, (sign, _, fingers) in _LIMBS.items():
        found += [
            (f"{side}Shoulder", "Spine1", (0.0, 2.4, 0.0), None),
            (f"{side}Arm", f"{side}Shoulder", (3.4 * sign, 0.3, -0.1), None),
            (f"{side}ForeArm", f"{side}Arm", (5.6 * sign, 0.0, 0.0), None),
            (f"{side}Hand", f"{side}ForeArm", (5.3 * sign, 0.0, 0.1), None),
            (fingers, f"{side}Hand", (1.6 * sign, 0.0, 0.0), (1.5 * sign, 0.0, 0.0)),
        ]
    return found


def skeleton_text(turns: tuple[str, ...] = ZYX, nodes: Sequence[str] = ()) -> str:
    """The part above MOTION; of nodes above the root, their names, each with places and turns."""
    lines: list[str] = ["HIERARCHY"]
    listed = bones()
    for depth, node in enumerate(nodes):
        kind = "JOINT" if depth else "ROOT"
        lines += [f"{kind} {node}", "{", "OFFSET 0 0 0", f"CHANNELS 6 Xposition Yposition Zposition {' '.join(turns)}"]

    def write(name: str, depth: int) -> None:
        pad = "\t" * depth
        _, parent, offset, tip = next(bone for bone in listed if bone[0] == name)
        places = "Xposition Yposition Zposition " if parent is None else ""
        count = len(turns) + 3 * (parent is None)
        lines.extend([
            f"{pad}{'JOINT' if parent or nodes else 'ROOT'} {name}",
            f"{pad}{{",
            f"{pad}\tOFFSET {' '.join(map(repr, offset))}",
            f"{pad}\tCHANNELS {count} {places}{' '.join(turns)}",
        ])  # fmt: skip
        for other, above, *_ in listed:
            if above == name:
                write(other, depth + 1)
        if tip is not None:
            lines.extend(
                [f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET {' '.join(map(repr, tip))}", f"{pad}\t}}"]
            )
        lines.append(f"{pad}}}")

    write("Hips", 0)
    return "\n".join([*lines, *["}"] * len(nodes)]) + "\n"


def columns(turns: tuple[str, ...] = ZYX) -> list[str]:
    """Names of all channels."""
    places = [f"Hips_{axis}position" for axis in "XYZ"]
    return places + [f"{name}_{turn}" for name, *_ in bones() for turn in turns]


def bvh_text(rows: np.ndarray, step: float, turns: tuple[str, ...] = ZYX, nodes: Sequence[str] = ()) -> str:
    """A whole file of frames (N, c) [units and degrees]."""
    frames = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    return f"{skeleton_text(turns, nodes)}MOTION\nFrames: {len(rows)}\nFrame Time: {step!r}\n{frames}\n"


def posed(row: np.ndarray, turns: tuple[str, ...] = ZYX) -> dict[str, np.ndarray]:
    """Pose of each bone in the recorder's axes, by the definition of the format: (4, 4), in units."""
    values = dict(zip(columns(turns), row.tolist(), strict=True))
    found: dict[str, np.ndarray] = {}
    for name, parent, offset, _ in bones():
        pose = np.eye(4)
        pose[:3, 3] = offset if parent else [values[f"Hips_{axis}position"] for axis in "XYZ"]
        for turn in turns:
            pose[:3, :3] = pose[:3, :3] @ rotation(turn[0], np.radians(values[f"{name}_{turn}"]))
        found[name] = found[parent] @ pose if parent else pose
    return found


def rotation(axis: str, angle: float) -> np.ndarray:
    """About one axis: (3, 3)."""
    first, second = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
    turned = np.eye(3)
    turned[[first, second], [first, second]] = np.cos(angle)
    turned[first, second], turned[second, first] = -np.sin(angle), np.sin(angle)
    return turned


def write(path: Path, text: str) -> Path:
    """The file, written."""
    path.write_text(text, encoding="utf-8")
    return path


def load(path, **options):
    """The person of a file, of 70 kg; what the file leaves open is not told."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IgnoredElementWarning)
        return sp.load_body(path, **{"length_unit": UNIT, "person_mass": 70.0, **options})


JUMP = ROBOTS / "formats" / "jump.bvh"
JUMP_MOMENTUM = np.array([75.0, 0.0, 0.0])
"""[kg m^2/s] Forwards about the axis from right to left."""
JUMP_JOINT_NOISE = 0.2
"""[deg]"""


_JUMP_STEP = 1.0 / 60.0
_JUMP_TIMES = _JUMP_STEP * np.arange(61)


@cache
def _clean_jump() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the joints (61, c), places [m] and attitudes of the hips: without noise."""
    times, rows, names = _JUMP_TIMES, np.zeros((61, len(columns()))), columns()

    def rise(first: float, last: float) -> np.ndarray:
        part = np.clip((times - first) / (last - first), 0.0, 1.0)
        return part**3 * (10.0 - 15.0 * part + 6.0 * part**2)

    lowered, pike = rise(0.12, 0.4) - rise(0.72, 0.97), 1.0 - rise(0.0, 0.25) + rise(0.75, 1.0)
    turned = {"LeftArm_Z": 80.0 - 155.0 * lowered, "RightArm_Z": np.full(len(times), -80.0), "Spine_X": 10.0 * pike}
    for side in _LIMBS:
        turned |= {f"{side}UpLeg_X": -15.0 * pike, f"{side}Leg_X": 20.0 * pike}
    for name, angles in turned.items():
        rows[:, names.index(f"{name}rotation")] = angles
    with tempfile.TemporaryDirectory() as folder:
        body = load(write(Path(folder) / "jump.bvh", bvh_text(rows, _JUMP_STEP)))
        path = sp.read_shape_path(body.file, body)
        flown = sp.reconstruct(sp.articulated(body, path), JUMP_MOMENTUM)
        places = flown.base_position(times, start=[0.0, 1.2, 0.0], velocity=[0.0, 4.9, 0.2], gravity=[0.0, -9.81, 0.0])
    return rows, places, flown.attitude(times)


def jump_text(seed: int = 6) -> str:
    """Somersault with a twist off a trampoline: the left arm lowers and lifts again; with noise."""
    rng, (clean, places, attitudes) = np.random.default_rng(seed), _clean_jump()
    rows, names = clean.copy(), columns()
    noise = rng.normal(size=(len(rows), 3))
    hips = Rotation.from_matrix(attitudes) * Rotation.from_rotvec(np.radians(0.3) * noise)
    rows[:, :3] = (places + 0.001 * rng.normal(size=places.shape)) / UNIT
    rows[:, 3:6] = hips.as_euler("ZYX", degrees=True)
    tracked = [k for k, name in enumerate(names) if k > 5 and not _RIGID.search(name)]
    rows[:, tracked] += JUMP_JOINT_NOISE * rng.normal(size=(len(rows), len(tracked)))
    return bvh_text(rows.round(2), _JUMP_STEP)


def jump_joint_noise(body: sp.Body) -> np.ndarray:
    """Standard deviations of the quaternions' components of each ball joint: half of a turn's, none of rigid bones."""
    tracked = np.array([not _RIGID.search(name) for name in body.joint_names])
    return 0.5 * np.radians(JUMP_JOINT_NOISE) * tracked


if __name__ == "__main__":
    write(JUMP, jump_text())
