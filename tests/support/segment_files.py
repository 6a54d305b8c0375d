"""A person of seven links in motion by SciPy alone, and files with the poses of segments in axes of their own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from support.bodies import joint, link, urdf

COUNT, RATE = 31, 60.0
TIMES = np.arange(COUNT) / RATE
STANDING = 0
"""Sample at which the person stands in the zero pose."""


class Part(NamedTuple):
    name: str  # of the link
    parent: str
    joint: str
    kind: str  # "ball", or axes of hinges
    place: tuple[float, float, float]
    turn: tuple[float, float, float]  # roll, pitch, yaw of the joint
    mass: float
    centre: tuple[float, float, float]


BASE = Part("hips", "", "", "", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 12.0, (0.01, 0.02, 0.05))
PARTS = (
    Part("torso", "hips", "waist", "ball", (0.0, 0.0, 0.15), (0.3, 0.1, -0.2), 25.0, (0.0, 0.03, 0.2)),
    Part("thigh_l", "hips", "hip_l", "ball", (0.02, 0.1, -0.05), (0.1, -0.4, 0.2), 9.0, (0.01, 0.0, -0.18)),
    Part("thigh_r", "hips", "hip_r", "ball", (0.02, -0.1, -0.05), (0.0, 0.3, 0.1), 9.0, (0.01, 0.0, -0.17)),
    Part("shank_l", "thigh_l", "knee_l", "y", (0.1, 0.05, -0.38), (0.2, 0.0, 0.0), 3.5, (0.0, 0.01, -0.2)),
    Part("shank_r", "thigh_r", "knee_r", "y", (-0.1, 0.0, -0.39), (0.0, 0.0, 0.3), 3.4, (0.02, 0.0, -0.2)),
    Part("foot_r", "shank_r", "ankle_r", "yx", (0.05, 0.0, -0.4), (0.0, 0.2, 0.0), 1.1, (0.06, 0.0, -0.03)),
)
LINKS = (BASE, *PARTS)
THEIR_NAMES = {
    "hips": "Pelvis", "torso": "Torso", "thigh_l": "LeftUpperLeg", "thigh_r": "RightUpperLeg",
    "shank_l": "LeftLowerLeg", "shank_r": "RightLowerLeg", "foot_r": "RightFoot",
}  # fmt: skip
"""Link -> what an inertial suit calls it; Torso has the link's name."""


def inertia_of(part: Part) -> np.ndarray:
    """(3, 3) about the centre of mass, in axes of the link; no axis is principal."""
    a = np.random.default_rng(len(part.name) + round(10 * part.mass)).normal(size=(3, 3))
    return 0.01 * part.mass * (np.eye(3) + 0.1 * (a + a.T) / 2.0)


def person_urdf() -> str:
    elements = [link(part.name, part.mass, inertia_of(part), part.centre) for part in LINKS]
    for part in PARTS:
        if part.kind == "ball":
            place, turn = (" ".join(map(repr, each)) for each in (part.place, part.turn))
            elements.append(
                f'<joint name="{part.joint}" type="spherical"><parent link="{part.parent}"/><child link="{part.name}"/>'
                f'<origin xyz="{place}" rpy="{turn}"/></joint>'
            )
            continue
        parent, place, turn = part.parent, part.place, part.turn
        for number, axis in enumerate(part.kind):
            last = number == len(part.kind) - 1
            name = part.joint if last else f"{part.joint}_{axis}"
            child = part.name if last else f"{part.joint}_between"
            if not last:
                elements.append(f'<link name="{child}"/>')
            direction = tuple(float(axis == other) for other in "xyz")
            elements.append(joint(name, "continuous", parent, child, direction, place, turn))
            parent, place, turn = child, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    return urdf(*elements, name="person")


class Moved(NamedTuple):
    """What the person does: turns (N, 3, 3) and places (N, 3) of links, and the columns of joints."""

    turns: dict[str, np.ndarray]
    places: dict[str, np.ndarray]
    columns: dict[str, np.ndarray]


def moved(scale: float = 1.0, stretch: float = 1.0, start: tuple[float, ...] = (0.7, 0.2, -0.3)) -> Moved:
    """A smooth random motion that begins in the zero pose, turned by Euler angles z, y, x; lengths times `stretch`."""
    generator = np.random.default_rng(8)

    def wave(width: int) -> np.ndarray:
        grown = [np.sin(k * 3.0 * TIMES)[:, None] * generator.normal(size=width) / k for k in (1, 2, 3)]
        return scale * 0.5 * np.sum(grown, axis=0)

    turns = {"hips": (Rotation.from_euler("ZYX", start) * Rotation.from_rotvec(wave(3))).as_matrix()}
    places = {"hips": np.array([1.0, -2.0, 1.5]) + wave(3)}
    columns: dict[str, np.ndarray] = {}
    for part in PARTS:
        angles = wave(3)
        if part.kind == "ball":
            own = Rotation.from_rotvec(angles)
            quaternions = own.as_quat()
            columns |= {f"{part.joint}.{axis}": quaternions[:, k] for k, axis in enumerate("xyzw")}
        else:
            own = Rotation.from_euler(part.kind.upper(), angles[:, : len(part.kind)])
            names = [*(f"{part.joint}_{axis}" for axis in part.kind[:-1]), part.joint]
            columns |= {name: angles[:, k] for k, name in enumerate(names)}
        turns[part.name] = turns[part.parent] @ Rotation.from_euler("xyz", part.turn).as_matrix() @ own.as_matrix()
        places[part.name] = places[part.parent] + stretch * turns[part.parent] @ np.array(part.place)
    return Moved(turns, places, columns)


def momentum_between(motion: Moved) -> np.ndarray:
    """Angular momentum about the centre of mass (N - 1, 3), by turns and ways between samples."""
    steps, total = np.diff(TIMES)[:, None], 0.0
    mass = sum(part.mass for part in LINKS)
    centres = {part.name: motion.places[part.name] + motion.turns[part.name] @ np.array(part.centre) for part in LINKS}
    whole = sum(part.mass * centres[part.name] for part in LINKS) / mass
    for part in LINKS:
        turns = Rotation.from_matrix(motion.turns[part.name])
        step = (turns[1:] * turns[:-1].inv()).as_rotvec()
        halfway = (Rotation.from_rotvec(0.5 * step) * turns[:-1]).as_matrix()
        inertia = halfway @ inertia_of(part) @ halfway.transpose(0, 2, 1)
        seen = centres[part.name] - whole
        total = total + np.einsum("nij,nj->ni", inertia, step / steps)
        total = total + part.mass * np.cross(0.5 * (seen[1:] + seen[:-1]), np.diff(seen, axis=0) / steps)
    return total


def own_axes(motion: Moved) -> dict[str, np.ndarray]:
    """The turns of segments whose axes lie anyhow in the links."""
    generator = np.random.default_rng(4)
    return {name: turns @ Rotation.random(rng=generator).as_matrix() for name, turns in motion.turns.items()}


def table_text(turns: dict[str, np.ndarray], places: dict[str, np.ndarray] | None, unit: str = "") -> str:
    """A table of quaternions, and places in metres or mm."""
    header, columns = ["time"], [TIMES]
    for name, each in turns.items():
        header += [f"{name}_q{axis}" for axis in "wxyz"]
        columns += list(np.roll(Rotation.from_matrix(each).as_quat(), 1, axis=1).T)
        if places is not None:
            header += [f"{name}_{axis}{f' [{unit}]' if unit else ''}" for axis in "xyz"]
            columns += list((1e3 if unit == "mm" else 1.0) * places[name].T)
    rows = [",".join(map(repr, row)) for row in np.column_stack(columns).tolist()]
    return "\n".join([",".join(header), *rows]) + "\n"


def mvnx_text(
    turns: dict[str, np.ndarray],
    places: dict[str, np.ndarray],
    *,
    joints: str = "",
    points: dict[str, dict[str, tuple[float, ...]]] | None = None,
    poses: tuple[str, ...] = ("tpose",),
) -> str:
    """A file of a suit; calibration poses are the first sample."""
    names = list(turns)
    lines = ['<?xml version="1.0" encoding="UTF-8"?>', '<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">']
    lines += [f'<subject label="S" frameRate="{RATE:g}" segmentCount="{len(names)}">', "<segments>"]
    for number, name in enumerate(names, start=1):
        inner = "".join(
            f'<point label="{label}"><pos_b>{" ".join(map(repr, place))}</pos_b></point>'
            for label, place in (points or {}).get(name, {}).items()
        )
        lines.append(f'<segment label="{name}" id="{number}"><points>{inner}</points></segment>')
    lines += ["</segments>", joints, "<frames>"]
    quaternions = {name: np.roll(Rotation.from_matrix(each).as_quat(), 1, axis=1) for name, each in turns.items()}

    def frame(head: str, k: int) -> str:
        orientation = " ".join(repr(v) for name in names for v in quaternions[name][k].tolist())
        position = " ".join(repr(v) for name in names for v in places[name][k].tolist())
        return f"<frame {head}><orientation>{orientation}</orientation><position>{position}</position></frame>"

    lines += [frame(f'time="0" type="{kind}"', STANDING) for kind in poses]
    count = len(next(iter(turns.values())))
    lines += [frame(f'time="{round(1e3 * k / RATE)}" index="{k}" type="normal"', k) for k in range(count)]
    return "\n".join([*lines, "</frames>", "</subject>", "</mvnx>"]) + "\n"


def body_kinematics_text(turns: dict[str, np.ndarray], centres: dict[str, np.ndarray], first: str = "Positions") -> str:
    """A file of OpenSim's BodyKinematics: centres of mass, and angles about x, y and z of the body."""
    header, columns = ["time"], [TIMES]
    for name, each in turns.items():
        header += [f"{name}_{axis}" for axis in ("X", "Y", "Z", "Ox", "Oy", "Oz")]
        columns += [*centres[name].T, *Rotation.from_matrix(each).as_euler("XYZ", degrees=True).T]
    rows = ["\t".join(map(repr, row)) for row in np.column_stack(columns).tolist()]
    head = f"{first}\nversion=1\nnRows={COUNT}\nnColumns={len(header)}\ninDegrees=yes\nendheader\n"
    return head + "\t".join(header) + "\n" + "\n".join(rows) + "\n"


def write_c3d(
    file: str, turns: dict[str, np.ndarray], places: dict[str, np.ndarray], units: str | None, unseen: int = 0
) -> None:
    """A C3D file without points: a 4 x 4 matrix of each segment and frame, places in mm; the last frames not seen."""
    import ezc3d

    matrices = np.zeros((4, 4, len(turns), COUNT))
    for k, name in enumerate(turns):
        matrices[:3, :3, k] = turns[name].transpose(1, 2, 0)
        matrices[:3, 3, k], matrices[3, 3, k] = 1e3 * places[name].T, 1.0
    if unseen:
        matrices[..., -unseen:] = np.nan
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [RATE]
    if units is not None:
        content["parameters"]["POINT"]["UNITS"]["value"] = [units]
    content.add_parameter("ROTATION", "USED", [len(turns)])
    content.add_parameter("ROTATION", "RATE", [RATE])
    content.add_parameter("ROTATION", "LABELS", [f"{name}_4X4" for name in turns])
    content.add_parameter("ROTATION", "RATIO", [1])
    content["data"]["rotations"] = matrices
    content["data"]["points"] = np.zeros((4, 0, COUNT))
    content.write(file)
