"""A body with two ball joints and a hinge, and the same with three hinges for each ball."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from shapephase.arrays import Array
from support.bodies import joint, link, urdf

HINGES = "xyz"


def _tensor(a: float, b: float, c: float) -> Array:
    return np.array([[a, 0.002, -0.001], [0.002, b, 0.003], [-0.001, 0.003, c]])


LINKS = (
    link("trunk", 3.0, _tensor(0.03, 0.05, 0.06), (0.0, 0.05, 0.1)),
    link("arm", 1.2, _tensor(0.02, 0.015, 0.03), (0.02, -0.2, 0.01)),
    link("hand", 0.7, _tensor(0.01, 0.014, 0.012), (0.1, 0.0, -0.03)),
    link("head", 0.9, _tensor(0.01, 0.012, 0.013), (0.0, 0.02, 0.15)),
)
ELBOW = joint("elbow", "continuous", "arm", "hand", (1.0, 2.0, 0.5), (0.0, -0.4, 0.0), (0.5, 0.0, 0.0))
SHOULDER = ("trunk", "arm", (0.1, 0.2, 0.3), (0.1, 0.2, 0.3))
NECK = ("trunk", "head", (0.0, 0.0, 0.4), (0.0, 0.2, 0.0))


def _ball(name, parent, child, xyz, rpy):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    places = [" ".join(map(repr, each)) for each in (xyz, rpy)]
    return f'<joint name="{name}" type="spherical">{ends}<origin xyz="{places[0]}" rpy="{places[1]}"/></joint>'


def _hinges(name, parent, child, xyz, rpy):
    """About x, y and z, one after the other."""
    found = []
    for number, axis in enumerate(HINGES):
        below = child if axis == "z" else f"{name}_{axis}"
        if axis != "z":
            found.append(f'<link name="{below}"/>')
        direction = tuple(float(axis == other) for other in HINGES)
        place = (xyz, rpy) if number == 0 else ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        found.append(joint(f"{name}{axis}", "continuous", parent, below, direction, *place))
        parent = below
    return found


BALLS = urdf(*LINKS, _ball("shoulder", *SHOULDER), ELBOW, _ball("neck", *NECK), name="balls")
THREE_HINGES = urdf(*LINKS, *_hinges("shoulder", *SHOULDER), ELBOW, *_hinges("neck", *NECK), name="hinges")
ORDER = (
    *(f"shoulder.{part}" for part in "xyzw"),
    *(f"neck.{part}" for part in "xyzw"),
    "elbow",
)
"""Of the shape of the first body."""


class Hinges:
    """Angles of the hinges of one ball, as functions of time or not, seen as the ball's quaternion and rates."""

    @staticmethod
    def quaternions(angles: Array) -> Array:
        """(..., 3) -> (..., 4), x, y, z, w."""
        return Rotation.from_euler("XYZ", angles).as_quat()

    @staticmethod
    def rates(angles: Array) -> Array:
        """The ball's rates from those of the hinges: (..., 3) -> (..., 3, 3)."""
        y, z = angles[..., 1], angles[..., 2]
        none = np.zeros_like(y)
        rows = [
            [np.cos(y) * np.cos(z), np.sin(z), none],
            [-np.cos(y) * np.sin(z), np.cos(z), none],
            [np.sin(y), none, none + 1.0],
        ]
        return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def shapes_of_both(hinged, random: np.random.Generator, count: int) -> tuple[Array, Array, Array, Array]:
    """Shapes of the first body, of the second, the first's rates from the second's: (N, 9), (N, 7), (N, 7, 7); and
    derivatives of the first's shape by the hinges' angles (N, 9, 7). Away from where three axes fall together."""
    angles = random.uniform(-np.pi, np.pi, (count, 7))
    place = {name: k for k, name in enumerate(hinged.joint_names)}
    shapes, rates, slopes = np.zeros((count, 9)), np.zeros((count, 7, 7)), np.zeros((count, 9, 7))
    for ball, name in enumerate(("shoulder", "neck")):
        columns = [place[f"{name}{axis}"] for axis in HINGES]
        angles[:, columns[1]] *= 0.4
        own = angles[:, columns]
        length = random.uniform(0.5, 2.0, (count, 1))
        p = length * Hinges.quaternions(own)
        shapes[:, 4 * ball : 4 * ball + 4] = p
        spins = Hinges.rates(own)
        rates[:, 3 * ball : 3 * ball + 3, columns] = spins
        for k, column in enumerate(columns):
            # dp = p (w, 0)/2, by SciPy's own product.
            v, w = spins[..., k], p[:, 3:]
            along = (p[:, :3] * v).sum(axis=1, keepdims=True)
            product = np.concatenate([w * v + np.cross(p[:, :3], v), -along], axis=1)
            slopes[:, 4 * ball : 4 * ball + 4, column] = 0.5 * product
    shapes[:, 8] = angles[:, place["elbow"]]
    rates[:, 6, place["elbow"]] = slopes[:, 8, place["elbow"]] = 1.0
    return shapes, angles, rates, slopes


TWO_LINKS = (
    link("chest", 1.0, _tensor(0.02, 0.03, 0.025), (0.0, 0.0, 0.1)),
    link("hip", 1.0, _tensor(0.03, 0.02, 0.035), (0.02, 0.0, -0.2)),
)
WAIST = ("chest", "hip", (0.0, 0.0, -0.1), (0.0, 0.0, 0.0))
TWO_AND_A_BALL = urdf(*TWO_LINKS, _ball("waist", *WAIST), name="two")
TWO_AND_HINGES = urdf(*TWO_LINKS, *_hinges("waist", *WAIST), name="two")
