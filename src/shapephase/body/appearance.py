"""What a body looks like: the shapes and meshes of its file by link, and boxes of the same inertia elsewhere."""

from __future__ import annotations

import hashlib
import importlib.util
import math
import os
import warnings
from base64 import b64decode
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ..arguments import check_object, number_argument
from ..arrays import Array, Integers
from ..display import short_repr
from ..errors import InputFileNotFoundError, MissingExtraError, ModelFileError, VisualWarning
from ..inertia_tensor import principal_axes, second_moment
from .body import Body, MovingPart
from .catalog import example_folder
from .drawing_limits import within_limits
from .engines.engine_tree import engine_shapes, expanded
from .engines.formats import MJCF, format_of
from .formats.urdf import macro_of, rpy_matrix
from .formats.xml_text import Node, child_of, name_of, needed_child, number, quoted, read_file, vector, xml_tree

Colour = tuple[float, float, float, float]
_Piece = tuple[Array, Integers, Colour | None]

PLAIN: Colour = (0.72, 0.74, 0.78, 1.0)
BOX_COLOUR: Colour = (0.337, 0.706, 0.914, 1.0)
"""Of what the file gives no colour, and of inertia boxes (the sky blue of Okabe and Ito)."""
_MESHES = (".stl", ".obj", ".dae", ".ply")
_MOST_NAMED = 10
"""Faults that one warning lists."""
_THINNEST = 0.01
"""Edge of an inertia box, as a share of its longest: a flat box is still seen from the side."""
_WATER = 1000.0
"""Density of the ball that stands for a point mass [kg/m^3]."""
_CORNERS = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, 8).T
"""Of the cube [-1, 1]^3: (8, 3)."""


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


def visuals(body: Body) -> tuple[Visual, ...]:
    """The shapes to draw of a body, by link.

    From its file, read anew: the <visual> elements of a URDF, the geoms of an MJCF. A moving part with mass
    that has nothing to show there, and every one of a body made from a `pinocchio.Model`, gets the box of uniform
    density that has the same mass and inertia.

    Warns
    -----
    VisualWarning
        If the file is gone or no longer the one that was loaded (all is drawn as boxes then), or something in it cannot
        be shown: a mesh that is not found or cannot be read, a faulty element.

    Examples
    --------
    >>> cat = sp.load_body("cat_two_halves")
    >>> len(sp.body.visuals(cat)), sp.body.visuals(cat)[0].kind
    (3, 'cylinder')
    """
    check_object(body, "Body", "body")
    found, doubts, _ = drawn_shapes(body)
    shown = {shape.link for shape in found}
    boxes = [_part_box(part) for part in body.moving_parts if part.mass > 0.0 and shown.isdisjoint(part.links)]
    if doubts:
        more = len(doubts) - _MOST_NAMED
        text = "; ".join(doubts[:_MOST_NAMED]) + (f"; and {more} more" if more > 0 else "")
        warnings.warn(f"{text}. Parts with nothing to show are drawn as inertia boxes", VisualWarning, stacklevel=2)
    return (*found, *boxes)


def drawn_shapes(body: Body) -> tuple[list[Visual], list[str], set[str]]:
    """What a body's file has to show, what in it cannot be shown, and the links of which some shape is missing."""
    looks = _Looks(body.file.parent if body.file else Path(), body.packages)
    root = _unchanged(body, looks.doubts)
    if root is not None:
        _read_mjcf(body, looks) if root.tag == "mujoco" else _read_urdf(root, body, looks)
    shapes, simplified = within_limits(looks.found)
    return shapes, looks.doubts + simplified, looks.partly


def inertia_box(mass: float, inertia: Array) -> tuple[Array, Array]:
    """The box of uniform density with a given mass and inertia about its centre.

    Parameters
    ----------
    mass : [kg]
    inertia : (..., 3, 3) [kg m^2]

    Returns
    -------
    edges : (..., 3) [m]; zero along an axis where no mass distribution has so large a moment
    axes : (..., 3, 3) its axes as columns, a proper rotation

    Notes
    -----
    A box has the second moment m a^2 / 12 along an edge a.

    Examples
    --------
    >>> size, axes = sp.body.inertia_box(12.0, np.diag([5.0, 4.0, 3.0]))
    >>> print(size.round(6))  # 12 (4 + 1)/12 and so on
    [1.       1.414214 1.732051]
    """
    mass = number_argument(mass, "mass", "kg")
    moments, axes = principal_axes(second_moment(inertia))
    return np.sqrt(12.0 * np.maximum(moments, 0.0) / mass), axes


@dataclass
class _Looks:
    """What is found on the way through a file that lies in `folder`."""

    folder: Path
    packages: tuple[str, ...] = ()
    found: list[Visual] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    meshes: dict[Path, list[_Piece]] = field(default_factory=dict)
    scaled: dict[tuple[Path, tuple[float, ...]], list[_Piece]] = field(default_factory=dict)
    partly: set[str] = field(default_factory=set)

    def attempt(self, link: str, shapes: Callable[[], list[Visual]]) -> None:
        """Take what can be read; what is faulty spoils the picture only."""
        try:
            self.found += shapes()
        except ModelFileError as error:
            self.doubts.append(str(error))
            self.partly.add(link)


def _unchanged(body: Body, doubts: list[str]) -> Node | None:
    """The root element of the body's file, or None if there is no file, or no longer the same."""
    if body.file is None:
        return None
    try:
        content = read_file(body.file)
    except (InputFileNotFoundError, ModelFileError) as error:
        doubts.append(str(error))
        return None
    if hashlib.sha256(content).hexdigest() != body.sha256:
        doubts.append(f"{body.file} has changed since {body.name} was loaded from it; load it again to see it")
        return None
    # What engines own is drawn as boxes: a file of measurements has no shapes, and meshes of bioMod are not read.
    root = xml_tree(content, str(body.file)) if format_of(content) in (None, MJCF) else None
    if root is None or root.tag != "robot" or macro_of(root) is None:
        return root
    try:
        return expanded(body.file, body.packages, body.xacro_args)
    except (MissingExtraError, ModelFileError) as error:
        doubts.append(str(error))
        return None


def _part_box(part: MovingPart) -> Visual:
    edges, axes = inertia_box(part.mass, part.inertia)
    pose = _pose(part.centre, axes)
    longest = float(edges.max())
    if longest == 0.0:
        # A point mass has no box: a ball of water.
        radius = (0.75 * part.mass / (math.pi * _WATER)) ** (1.0 / 3.0)
        return Visual(part.links[0], "sphere", (radius,), pose, BOX_COLOUR)
    dimensions = tuple(np.maximum(edges, _THINNEST * longest).tolist())
    return Visual(part.links[0], "box", dimensions, pose, BOX_COLOUR)


def _pose(place: Array, turn: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, place
    return pose


# ---- URDF -----------------------------------------------------------------------------------------------------------


def _read_urdf(root: Node, body: Body, looks: _Looks) -> None:
    named = [(material, material.get("name")) for node in root.walk() for material in node.all("material")]
    materials: dict[str, Node] = {name: material for material, name in named if name and material.all("color")}
    links = set(body.link_names)
    for link in root.all("link"):
        # What only leads to the base is no part of the body.
        if link.get("name") not in links:
            continue
        for node in link.all("visual"):
            looks.attempt(name_of(link), lambda link=link, node=node: _urdf_shape(link, node, materials, looks))


def _urdf_shape(link: Node, node: Node, materials: dict[str, Node], looks: _Looks) -> list[Visual]:
    name = name_of(link)
    owner = f"link {name!r}"
    origin = child_of(node, "origin", owner)
    place, turn = np.zeros(3), np.eye(3)
    if origin is not None:
        place = np.array(vector(origin, "xyz", owner)) if origin.get("xyz") is not None else place
        turn = rpy_matrix(np.array(vector(origin, "rpy", owner))) if origin.get("rpy") is not None else turn
    written = child_of(node, "material", owner)
    colour = None if written is None else _urdf_colour(written, materials, owner)
    shape, kind = _geometry(needed_child(node, "geometry", owner), owner)
    pose = _pose(place, turn)
    if kind == "mesh":
        scale = np.array(vector(shape, "scale", owner)) if shape.get("scale") is not None else np.ones(3)
        empty = Visual(name, kind, tuple(scale.tolist()), pose, colour or PLAIN)
        return _mesh_shapes(shape, empty, colour, owner, looks)
    dimensions = {
        "box": lambda: vector(shape, "size", owner),
        "sphere": lambda: [number(shape, "radius", owner)],
        "cylinder": lambda: [number(shape, key, owner) for key in ("radius", "length")],
        "capsule": lambda: [number(shape, key, owner) for key in ("radius", "length")],
    }[kind]()
    if not all(value > 0.0 for value in dimensions):
        raise shape.fault(owner, f"<{kind}> of size {dimensions}; sizes are above zero")
    return [Visual(name, kind, tuple(dimensions), pose, colour or PLAIN)]


def _geometry(node: Node, owner: str) -> tuple[Node, str]:
    """The shape in a <geometry>, and its kind; extensions have a prefix before it."""
    valid = ("box", "cylinder", "sphere", "capsule", "mesh")
    found = [(child, child.tag.rpartition(":")[2]) for child in node.children]
    if len(found) != 1 or found[0][1] not in valid:
        tags = ", ".join(f"<{quoted(child.tag)}>" for child, _ in found) or "nothing"
        raise node.fault(owner, f"<geometry> holds {tags}; one of {', '.join(valid)} can be shown")
    return found[0]


def _urdf_colour(material: Node, materials: dict[str, Node], owner: str) -> Colour | None:
    source = material if material.all("color") else materials.get(material.get("name") or "")
    colour = None if source is None else child_of(source, "color", owner)
    return None if colour is None else _rgba(colour, owner)


def _rgba(node: Node, owner: str) -> Colour:
    red, green, blue, opacity = (min(max(value, 0.0), 1.0) for value in vector(node, "rgba", owner, 4))
    return red, green, blue, opacity


# ---- Meshes ---------------------------------------------------------------------------------------------------------


def _mesh_shapes(node: Node, empty: Visual, colour: Colour | None, owner: str, looks: _Looks) -> list[Visual]:
    """A mesh, in pieces of one colour each."""
    name = node.get("filename") or ""
    path = next((p for p in _mesh_places(name, looks) if _is_file(p)), None)
    if path is None:
        raise node.fault(owner, f"the mesh {quoted(name)!r} is not found")
    if path.suffix.lower() not in _MESHES:
        raise node.fault(owner, f"the mesh {quoted(name)!r}: files {', '.join(_MESHES)} can be read")
    if path not in looks.meshes:
        looks.meshes[path] = _mesh_pieces(path, node, owner)
    scale = np.array(empty.dimensions)
    # A mirror image has its faces the other way round.
    order = 1 if np.prod(scale) > 0.0 else -1
    # Visuals of one mesh share their arrays.
    key = (path, empty.dimensions)
    if key not in looks.scaled:
        looks.scaled[key] = [(vertices * scale, faces[:, ::order], own) for vertices, faces, own in looks.meshes[path]]
    return [
        replace(empty, colour=colour or own or PLAIN, mesh=path, vertices=vertices, faces=faces)
        for vertices, faces, own in looks.scaled[key]
    ]


def _mesh_places(name: str, looks: _Looks) -> Iterator[Path]:
    """Where a mesh may be: in a package where these are looked for, that lies around the URDF or in example-robot-data,
    or beside the URDF.
    """
    folder = looks.folder
    scheme, _, rest = name.partition("://") if "://" in name else ("", "", name)
    around = [
        *(Path(place) for one in looks.packages for place in (one, os.path.dirname(one))),
        folder,
        *folder.parents,
    ]
    if scheme == "file":
        yield Path(unquote(rest))
    elif scheme:
        inside = rest.lstrip("/")
        yield from (place / inside for place in around)
        examples = example_folder()
        if examples is not None:
            yield examples.parent / inside
        # A package in a folder with another name.
        yield from (place / inside.partition("/")[2] for place in around)
    else:
        yield folder / rest


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:
        return False


def _mesh_pieces(path: Path, node: Node, owner: str) -> list[_Piece]:
    """Vertices, faces and colour of each piece."""
    missing = {"trimesh": "trimesh", **({"collada": "pycollada"} if path.suffix.lower() == ".dae" else {})}
    for module, package in missing.items():
        if importlib.util.find_spec(module) is None:
            raise node.fault(owner, f"the mesh {path.name} needs {package}: pip install 'shapephase[plot]'")
    import trimesh

    try:
        scene: Any = trimesh.load_scene(path, skip_materials=path.suffix.lower() == ".obj")
        if path.suffix.lower() == ".dae":
            # Its unit counts, its upward axis does not, as in other viewers of URDF.
            scene = scene.convert_units("meters")
        pieces = [piece for piece in scene.dump() if isinstance(piece, trimesh.Trimesh) and len(piece.faces)]
    except Exception as error:
        # A reader of foreign files fails in every way there is.
        raise node.fault(owner, f"the mesh {path.name} cannot be read ({type(error).__name__}: {error})") from None
    if not pieces or not all(np.isfinite(piece.vertices).all() for piece in pieces):
        raise node.fault(owner, f"the mesh {path.name} has no faces, or vertices that are not finite")
    return [(np.asarray(p.vertices, float), np.asarray(p.faces, np.int64), _own_colour(p)) for p in pieces]


def _own_colour(mesh: Any) -> Colour | None:
    """The colour that a mesh brings along, where it has one."""
    kind = mesh.visual.kind
    if kind is None:
        return None
    rgba = mesh.visual.material.main_color if kind == "texture" else mesh.visual.main_color
    red, green, blue, opacity = (float(value) / 255.0 for value in rgba)
    return red, green, blue, opacity


# ---- MJCF -----------------------------------------------------------------------------------------------------------


def _read_mjcf(body: Body, looks: _Looks) -> None:
    """The geoms that MuJoCo's viewer would show; of a link that has none of those, the others."""
    assert body.file is not None
    try:
        said = engine_shapes(body.file, MJCF)
    except (ModelFileError, MissingExtraError) as error:
        looks.doubts.append(str(error))
        return
    meshes = {
        number: (_unpacked(mesh["vertices"], "<f4").astype(float), _unpacked(mesh["faces"], "<i4").astype(np.int64))
        for number, mesh in said["meshes"].items()
    }
    links = set(body.link_names)
    looks.partly.update(said["partly"])
    for shape in said["shapes"]:
        if shape["link"] not in links:
            continue
        pose = _pose(np.array(shape["place"]), np.array(shape["turn"]).reshape(3, 3))
        plain = Visual(shape["link"], shape["kind"], tuple(shape["dimensions"]), pose, tuple(shape["colour"]))
        if shape["kind"] == "mesh":
            vertices, faces = meshes[shape["mesh"]]
            plain = replace(plain, dimensions=(1.0, 1.0, 1.0), vertices=vertices, faces=faces)
        looks.found.append(plain)


def _unpacked(text: str, kind: str) -> Array:
    return np.frombuffer(b64decode(text), kind).reshape(-1, 3)
