"""A shape to draw, and the box of uniform density that has a given mass and inertia."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ...arguments import number_argument
from ...arrays import Array, Integers
from ...display import short_repr
from ...inertia_tensor import principal_axes, second_moment
from ..body import MovingPart

Colour = tuple[float, float, float, float]

PLAIN: Colour = (0.72, 0.74, 0.78, 1.0)
BOX_COLOUR: Colour = (0.337, 0.706, 0.914, 1.0)  # sky blue of Okabe and Ito: distinct for colour-blind readers
_THINNEST = 0.01  # of a box's longest edge: a flat box is still visible from the side
_WATER = 1000.0  # density of the ball that stands for a point mass [kg/m^3]
_CORNERS = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T


@dataclass(frozen=True, eq=False)
class Visual:
    """One shape to draw.

    Attributes
    ----------
    link : the link that carries it
    kind : "box", "cylinder", "capsule", "sphere", "ellipsoid" or "mesh"
    dimensions : edges of a box; radius and length of a cylinder or of the barrel of a capsule, along z; radius of a
        sphere; semi-axes of an ellipsoid [m]; scale of a mesh
    pose : (4, 4) from the axes of the shape to those of the link
    colour : red, green, blue, opacity, each from 0 to 1
    mesh : the file of a mesh, else None
    vertices, faces : (V, 3) [m] and (F, 3) of a mesh, its scale applied; empty otherwise

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> shape = sp.body.visuals(cat)[0]
    >>> shape.kind, shape.pose.shape
    ('cylinder', (4, 4))
    """

    link: str
    kind: str
    dimensions: tuple[float, ...]
    pose: Array
    colour: Colour
    mesh: Path | None = None
    vertices: Array = field(default_factory=lambda: np.zeros((0, 3)))
    faces: Integers = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))

    __repr__ = short_repr

    @property
    def corners(self) -> Array:
        """Corners of the box around the shape, in its own axes: (8, 3) [m]."""
        if self.kind == "mesh":
            low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
            return 0.5 * (low + high) + 0.5 * (high - low) * _CORNERS
        lengths = self.dimensions
        halves: dict[str, tuple[float, ...]] = {
            "sphere": lengths * 3,
            "ellipsoid": lengths,
            "box": tuple(0.5 * edge for edge in lengths),
            "cylinder": (lengths[0], lengths[0], 0.5 * lengths[-1]),
            "capsule": (lengths[0], lengths[0], 0.5 * lengths[-1] + lengths[0]),
        }
        return np.array(halves[self.kind]) * _CORNERS

    @property
    def volume(self) -> float:
        """Volume of a shape other than a mesh [m^3]."""
        first, last = self.dimensions[0], self.dimensions[-1]
        ball = 4.0 / 3.0 * math.pi
        return {
            "box": math.prod(self.dimensions),
            "cylinder": math.pi * first**2 * last,
            "capsule": math.pi * first**2 * last + ball * first**3,
            "sphere": ball * first**3,
            "ellipsoid": ball * math.prod(self.dimensions),
        }[self.kind]


def inertia_box(mass: float, inertia: Array) -> tuple[Array, Array]:
    """The box of uniform density with a given mass and inertia about its centre.

    A box has the second moment m a^2 / 12 along an edge a.

    Parameters
    ----------
    mass : [kg]
    inertia : (..., 3, 3) [kg m^2]

    Returns
    -------
    edges : (..., 3) [m]; zero along an axis where no mass distribution has so large a moment
    axes : (..., 3, 3) its axes as columns, a proper rotation

    Examples
    --------
    >>> size, axes = sp.body.inertia_box(12.0, np.diag([5.0, 4.0, 3.0]))
    >>> print(size.round(6))  # 12 (4 + 1)/12 and so on
    [1.       1.414214 1.732051]
    """
    mass = number_argument(mass, "mass", "kg")
    moments, axes = principal_axes(second_moment(inertia))
    return np.sqrt(12.0 * np.maximum(moments, 0.0) / mass), axes


def part_box(part: MovingPart) -> Visual:
    """The inertia box of a moving part; a ball of water for a point mass."""
    edges, axes = inertia_box(part.mass, part.inertia)
    pose = pose_of(part.centre, axes)
    longest = float(edges.max())
    if longest == 0.0:
        radius = (0.75 * part.mass / (math.pi * _WATER)) ** (1.0 / 3.0)
        return Visual(part.links[0], "sphere", (radius,), pose, BOX_COLOUR)
    dimensions = tuple(np.maximum(edges, _THINNEST * longest).tolist())
    return Visual(part.links[0], "box", dimensions, pose, BOX_COLOUR)


def pose_of(place: Array, turn: Array) -> Array:
    """The matrix (4, 4) of a place (3,) and a rotation (3, 3)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, place
    return pose
