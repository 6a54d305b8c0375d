"""Shapes and orientations of MJCF: the mass and inertia of a geom, and the many ways to write a rotation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array
from .._link_tree import LEAST_MASS, MOST_MASS
from .xml_text import Node, number, numbers, quoted, vector

ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
# How many numbers the size of each kind of geom has in MJCF.
_SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
# Kinds of geom that `fromto` can place.
_LONG = ("capsule", "cylinder", "box", "ellipsoid")
_DENSITY = "1000"
"""MuJoCo's density of a geom that states none [kg/m^3]: that of water."""
_LEAST_SIZE = 1e-9
"""Sizes of a geom are above this [m]; smaller ones have masses that are lost in rounding."""


@dataclass(frozen=True)
class Solid:
    """Mass [kg], centre (3,) [m] and inertia about it (3, 3) [kg m^2], in the axes of the body."""

    mass: float
    centre: Array
    inertia: Array

    def moved(self, place: Array, turn: Array) -> Solid:
        """The same in the axes around those that lie at (place, turn)."""
        return Solid(self.mass, place + turn @ self.centre, turn @ self.inertia @ turn.T)


@dataclass(frozen=True)
class Orientation:
    """How a file writes rotations: angles in degrees or not, and the sequence of Euler angles."""

    degrees: bool
    sequence: str

    def matrix(self, node: Node, owner: str) -> Array:
        """The rotation of an element, by whichever attribute it is given. Raises ModelFileError."""
        given = [name for name in ORIENTATIONS if node.get(name) is not None]
        if not given:
            return np.eye(3)
        if len(given) > 1:
            raise node.fault(owner, f"<{node.tag}> has {' and '.join(given)}; give one of them")
        (name,) = given
        count = {"quat": 4, "axisangle": 4, "xyaxes": 6}.get(name, 3)
        values = np.array(vector(node, name, owner, count))
        x, unit = values[:3], math.pi / 180.0 if self.degrees else 1.0
        if name == "euler":
            return self._euler(values * unit)
        if name == "quat":
            length = float(np.linalg.norm(values))
            self._long_enough(length, node, name, owner)
            return _turn_by(values[1:] / length, values[0] / length)
        self._long_enough(float(np.linalg.norm(x)), node, name, owner)
        x = x / np.linalg.norm(x)
        if name == "axisangle":
            half = 0.5 * values[3] * unit
            return _turn_by(x * math.sin(half), math.cos(half))
        if name == "zaxis":
            return least_turn(x)
        y = values[3:] - values[3:] @ x * x
        self._long_enough(float(np.linalg.norm(y)), node, name, owner)
        y = y / np.linalg.norm(y)
        return np.stack([x, y, np.cross(x, y)], axis=-1)

    def _euler(self, angles: Array) -> Array:
        """Small letters turn about the moved axes, capitals about the fixed ones."""
        turn = np.eye(3)
        for letter, angle in zip(self.sequence, angles, strict=True):
            half = 0.5 * float(angle)
            step = _turn_by(np.eye(3)["xyz".index(letter.lower())] * math.sin(half), math.cos(half))
            turn = turn @ step if letter.islower() else step @ turn
        return turn

    @staticmethod
    def _long_enough(length: float, node: Node, name: str, owner: str) -> None:
        if length < 1e-9:
            raise node.fault(owner, f"<{node.tag}> {name}={quoted(node.get(name))!r} points nowhere; give it a length")


def _turn_by(vector_part: Array, scalar: float) -> Array:
    """The rotation of a unit quaternion."""
    x, y, z = vector_part
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * scalar * skew + 2.0 * skew @ skew


def least_turn(direction: Array) -> Array:
    """The least rotation that takes z to a unit vector."""
    x, y, z = direction
    across = math.hypot(x, y)
    if across < 1e-12:
        # MuJoCo turns about x to look down.
        return np.eye(3) if z > 0.0 else np.diag([1.0, -1.0, -1.0])
    half = 0.5 * math.atan2(across, z)
    return _turn_by(np.array([-y, x, 0.0]) / across * math.sin(half), math.cos(half))


def solid_of(geom: Node, orientation: Orientation, owner: str) -> Solid:
    """Mass and inertia of a geom. Raises ModelFileError for a mesh with mass, and for faulty numbers."""
    owner = f"{owner}, geom {quoted(geom.get('name'))!r}" if geom.get("name") else owner
    kind = geom.get("type", "sphere")
    nothing = Solid(0.0, np.zeros(3), np.zeros((3, 3)))
    mass = None if geom.get("mass") is None else number(geom, "mass", owner, most=MOST_MASS)
    density = number(geom, "density", owner, default=_DENSITY, most=MOST_MASS)
    if density < 0.0 or (mass or 0.0) < 0.0:
        raise geom.fault(owner, "negative mass or density; both are at least zero")
    if kind in ("plane", "hfield") or mass == 0.0 or (mass is None and density == 0.0):
        return nothing
    if kind not in _SIZES or geom.get("mesh") is not None:
        raise geom.fault(
            owner,
            f"a geom of type {quoted(kind)!r} with mass: inertia is computed from {', '.join(_SIZES)}; give the body "
            'an <inertial>, or the geom mass="0"',
        )
    if geom.get("shellinertia", "false") != "false":
        raise geom.fault(owner, "inertia of a shell is not computed; give the body an <inertial>")
    place, turn, dimensions = placed_geom(geom, kind, orientation, owner)
    volume, moments = _unit_solid(kind, dimensions)
    mass = density * volume if mass is None else mass
    if not (LEAST_MASS < mass < MOST_MASS):
        raise geom.fault(owner, f"its mass is {mass:g} kg; between {LEAST_MASS:g} and {MOST_MASS:g} is needed")
    return Solid(mass, place, turn @ np.diag(mass * moments) @ turn.T)


def placed_geom(geom: Node, kind: str, orientation: Orientation, owner: str) -> tuple[Array, Array, list[float]]:
    """Place, rotation and sizes, from `fromto` where it is given."""
    text = geom.get("size", "") or ""
    given = len(text.split())
    fromto, needed = geom.get("fromto") is not None, _SIZES[kind]
    if fromto:
        needed = 1
    if not needed <= given <= 3:
        raise geom.fault(owner, f"size={quoted(text)!r}: {needed} numbers are needed for a {kind}")
    dimensions = numbers(geom, "size", given, owner, text, 1e6)[:needed]
    if not fromto:
        place = np.array(vector(geom, "pos", owner)) if geom.get("pos") is not None else np.zeros(3)
        turn = orientation.matrix(geom, owner)
    else:
        if kind not in _LONG or any(geom.get(name) is not None for name in ("pos", *ORIENTATIONS)):
            raise geom.fault(owner, f"fromto with pos, an orientation or type {kind}; give one of them")
        ends = np.array(vector(geom, "fromto", owner, 6)).reshape(2, 3)
        along = ends[0] - ends[1]
        length = float(np.linalg.norm(along))
        if length < 1e-9:
            raise geom.fault(owner, "fromto: both ends are the same point; move one")
        # As thick as wide: MuJoCo takes one size for both.
        thickness = dimensions * (_SIZES[kind] - 1)
        place, turn, dimensions = ends.mean(axis=0), least_turn(along / length), [*thickness, 0.5 * length]
    if not all(value > _LEAST_SIZE for value in dimensions):
        raise geom.fault(owner, f"size={quoted(text)!r}: sizes are positive, above {_LEAST_SIZE:g} m")
    return place, turn, dimensions


def _unit_solid(kind: str, dimensions: list[float]) -> tuple[float, Array]:
    """Volume, and principal moments for unit mass; the long axis is z."""
    if kind == "sphere":
        return 4.0 / 3.0 * math.pi * dimensions[0] ** 3, np.full(3, 0.4 * dimensions[0] ** 2)
    if kind in ("box", "ellipsoid"):
        x, y, z = (value**2 for value in dimensions)
        volume, factor = (8.0, 1.0 / 3.0) if kind == "box" else (4.0 / 3.0 * math.pi, 0.2)
        return volume * math.prod(dimensions), factor * np.array([y + z, x + z, x + y])
    radius, half = dimensions
    barrel = 2.0 * math.pi * radius**2 * half
    across, along = radius**2 / 4.0 + half**2 / 3.0, radius**2 / 2.0
    if kind == "cylinder":
        return barrel, np.array([across, across, along])
    # Two half balls, their centres 3/8 of the radius beyond the ends of the barrel.
    caps = 4.0 / 3.0 * math.pi * radius**3
    cap_across, cap_along = 0.4 * radius**2 + half**2 + 0.75 * half * radius, 0.4 * radius**2
    share = caps / (caps + barrel)
    across, along = (1.0 - share) * across + share * cap_across, (1.0 - share) * along + share * cap_along
    return barrel + caps, np.array([across, across, along])


def joined_inertia(solids: Sequence[Solid]) -> tuple[float, Array, Array]:
    """Mass, centre and inertia about it of several solids together."""
    mass = sum(solid.mass for solid in solids)
    if not solids:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    centre = sum((solid.mass * solid.centre for solid in solids), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for solid in solids:
        lever = solid.centre - centre
        inertia += solid.inertia + solid.mass * (lever @ lever * np.eye(3) - np.outer(lever, lever))
    return mass, centre, 0.5 * (inertia + inertia.T)
