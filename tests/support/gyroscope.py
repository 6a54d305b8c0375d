"""A body with wheels: a gyroscope at the end of a hinge and a slide, and a wheel on the base."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import shapephase as sp

# What the first wheel's axle is not along, no axis is along.
AXLE = np.array([0.48, 0.6, 0.64])


def _link(name: str, mass: float, centre: np.ndarray, tensor: np.ndarray) -> str:
    six = tensor[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]].tolist()
    entries = " ".join(f'i{k}="{value!r}"' for k, value in zip(("xx", "yy", "zz", "yz", "xz", "xy"), six, strict=True))
    return (
        f'<link name="{name}"><inertial><origin xyz="{" ".join(map(repr, centre.tolist()))}"/><mass value="{mass}"/>'
        f"<inertia {entries}/></inertial></link>"
    )


def _joint(name: str, kind: str, parent: str, child: str, axis: str, xyz: str) -> str:
    limit = "" if kind == "continuous" else '<limit lower="-3" upper="3" effort="1" velocity="9"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        f'<origin xyz="{xyz}" rpy="0.3 -0.2 0.5"/>{limit}</joint>'
    )


def _wheel(across: float, about: float, axis: np.ndarray) -> np.ndarray:
    return across * np.eye(3) + (about - across) * np.outer(axis, axis)


def gyroscope(folder: Path) -> sp.Body:
    """Joints `swing`, `slide`, and the wheels `gyro` on their end and `fly` on the base."""
    file = folder / "gyroscope.urdf"
    skew = np.array([[0.3, 0.02, 0.01], [0.02, 0.4, -0.03], [0.01, -0.03, 0.5]])
    parts = [
        _link("base", 5.0, np.array([0.1, 0.0, -0.1]), skew),
        _link("arm", 1.0, np.array([0.2, 0.1, 0.0]), 0.1 * skew),
        _link("boom", 1.5, np.array([0.0, 0.1, 0.3]), 0.2 * skew),
        _link("rim", 1.0, 0.1 * AXLE, _wheel(0.03, 0.05, AXLE)),
        _link("disc", 0.8, np.array([0.0, 0.05, 0.0]), _wheel(0.006, 0.01, np.array([0.0, 1.0, 0.0]))),
        _joint("swing", "revolute", "base", "arm", "0 0.6 0.8", "0.3 0.1 0"),
        _joint("slide", "prismatic", "arm", "boom", "1 0 0", "0.4 0 0.1"),
        _joint("gyro", "continuous", "boom", "rim", "0.48 0.6 0.64", "0 0.2 0.1"),
        _joint("fly", "continuous", "base", "disc", "0 1 0", "0 0 0.2"),
    ]
    file.write_text(f'<robot name="gyroscope">{"".join(parts)}</robot>')
    return sp.load_body(file)
