"""Shapes to draw of a body: those of its file by link, and boxes of equal inertia elsewhere."""

from __future__ import annotations

import hashlib
import warnings
from base64 import b64decode
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...arrays import Array
from ...errors import InputFileNotFoundError, MissingExtraError, ModelFileError, VisualWarning
from ..body import Body
from ..engines.engine_tree import engine_shapes, expanded
from ..engines.formats import MJCF, format_of
from ..formats.urdf import macro_of, rpy_matrix
from ..formats.xml_text import Node, quoted, read_file, xml_tree
from ..loading import as_body
from .limits import within_limits
from .meshes import MeshFiles
from .visual import PLAIN, Colour, Visual, part_box, pose_of

_MOST_FAULTS = 10  # listed by one warning, which fills a screen
_SIZES = {"box": ("size",), "sphere": ("radius",), "cylinder": ("radius", "length"), "capsule": ("radius", "length")}


def visuals(body: Body | str) -> tuple[Visual, ...]:
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
    body = as_body(body)
    shapes, doubts, _ = drawn_shapes(body)
    shown = {shape.link for shape in shapes}
    boxes = [part_box(part) for part in body.moving_parts if part.mass > 0.0 and shown.isdisjoint(part.links)]
    if doubts:
        more = len(doubts) - _MOST_FAULTS
        text = "; ".join(doubts[:_MOST_FAULTS]) + (f"; and {more} more" if more > 0 else "")
        warnings.warn(f"{text}. Parts with nothing to show are drawn as inertia boxes", VisualWarning, stacklevel=2)
    return (*shapes, *boxes)


def drawn_shapes(body: Body) -> tuple[list[Visual], list[str], set[str]]:
    """Shapes of a body's file, what cannot be shown of it, and the links of which some shape is missing."""
    reading = _Drawing(body)
    root = reading.root()
    if root is not None:
        reading.read(root)
    shapes, simplified = within_limits(reading.shapes)
    return shapes, reading.doubts + simplified, reading.incomplete


def collision_shapes(body: Body) -> tuple[list[Visual], list[str], set[str]]:
    """Return `drawn_shapes` of what collides, unsimplified: <collision> or colliding geoms, else what is drawn."""
    reading = _Drawing(body)
    root = reading.root()
    for collision in (True, False):
        if root is not None and not reading.shapes and not reading.incomplete:
            reading.read(root, collision=collision)
    return reading.shapes, reading.doubts, reading.incomplete


class _Drawing:
    """Shapes of a body's file on the way through it."""

    def __init__(self, body: Body) -> None:
        self.body = body
        self.links = set(body.link_names)
        self.meshes = MeshFiles(body.file.parent if body.file else Path(), body.packages)
        self.shapes: list[Visual] = []
        self.doubts: list[str] = []
        self.incomplete: set[str] = set()

    def root(self) -> Node | None:
        """The root element of the body's file; None without a file, or where it has changed."""
        body = self.body
        if body.file is None:
            return None
        try:
            content = read_file(body.file)
            if hashlib.sha256(content).hexdigest() != body.sha256:
                raise ModelFileError(
                    f"{body.file} has changed since {body.name} was loaded from it; load it again to see it"
                )
            # Files of other engines are drawn as boxes: measurements have no shapes, meshes of bioMod are not read.
            root = xml_tree(content, str(body.file)) if format_of(content) in (None, MJCF) else None
            if root is None or root.tag != "robot" or macro_of(root) is None:
                return root
            return expanded(body.file, body.packages, body.xacro_args)
        except (InputFileNotFoundError, MissingExtraError, ModelFileError) as error:
            self.doubts.append(str(error))
            return None

    def read(self, root: Node, *, collision: bool = False) -> None:
        """Add the shapes of a URDF or MJCF file that are drawn, or those that collide."""
        if root.tag == "mujoco":
            self._read_mjcf(collision=collision)
        else:
            self._read_urdf(root, "collision" if collision else "visual")

    def _read_urdf(self, root: Node, tag: str) -> None:
        """Add the elements of this tag; a faulty one is left out and reported."""
        named = [(material, material.get("name")) for node in root.walk() for material in node.all("material")]
        materials = {name: material for material, name in named if name and material.all("color")}
        for link in root.all("link"):
            # Links that only lead to the base are not part of the body.
            if link.get("name") not in self.links:
                continue
            link.own(f"link {link.name()!r}")
            for node in link.all(tag):
                try:
                    self.shapes += self._urdf_shape(link.name(), node, materials)
                except ModelFileError as error:
                    self.doubts.append(str(error))
                    self.incomplete.add(link.name())

    def _urdf_shape(self, name: str, node: Node, materials: dict[str, Node]) -> list[Visual]:
        origin = node.child("origin")
        place, turn = np.zeros(3), np.eye(3)
        if origin is not None:
            place = np.array(origin.vector("xyz")) if origin.get("xyz") is not None else place
            turn = rpy_matrix(np.array(origin.vector("rpy"))) if origin.get("rpy") is not None else turn
        material = node.child("material")
        colour = None if material is None else _urdf_colour(material, materials)
        shape, kind = _geometry(node.needed_child("geometry"))
        pose = pose_of(place, turn)
        if kind == "mesh":
            scale = tuple(shape.vector("scale")) if shape.get("scale") is not None else (1.0, 1.0, 1.0)
            path, pieces = self.meshes.pieces(shape, scale)
            return [
                Visual(name, kind, scale, pose, colour or own or PLAIN, path, vertices, faces)
                for vertices, faces, own in pieces
            ]
        box = kind == "box"
        sizes = shape.vector("size") if box else [shape.number(key) for key in _SIZES[kind]]
        if not all(value > 0.0 for value in sizes):
            raise shape.fault(f"<{kind}> of size {sizes}; sizes are above zero")
        return [Visual(name, kind, tuple(sizes), pose, colour or PLAIN)]

    def _read_mjcf(self, *, collision: bool) -> None:
        """Add the geoms that MuJoCo's viewer would show, for a link without any of those its others; or all that
        collide."""
        assert self.body.file is not None
        try:
            drawn = engine_shapes(self.body.file, MJCF, collision=collision)
        except (ModelFileError, MissingExtraError) as error:
            self.doubts.append(str(error))
            return
        meshes = {
            number: (_unpacked(mesh["vertices"], "<f4").astype(float), _unpacked(mesh["faces"], "<i4").astype(np.int64))
            for number, mesh in drawn["meshes"].items()
        }
        self.incomplete.update(drawn["partly"])
        for shape in drawn["shapes"]:
            if shape["link"] not in self.links:
                continue
            pose = pose_of(np.array(shape["place"]), np.array(shape["turn"]).reshape(3, 3))
            visual = Visual(shape["link"], shape["kind"], tuple(shape["dimensions"]), pose, tuple(shape["colour"]))
            if shape["kind"] == "mesh":
                vertices, faces = meshes[shape["mesh"]]
                visual = replace(visual, dimensions=(1.0, 1.0, 1.0), vertices=vertices, faces=faces)
            self.shapes.append(visual)


def _geometry(node: Node) -> tuple[Node, str]:
    """The shape in a <geometry> and its kind, without the prefix of an extension."""
    valid = (*_SIZES, "mesh")
    shapes = [(child, child.tag.rpartition(":")[2]) for child in node.children]
    if len(shapes) != 1 or shapes[0][1] not in valid:
        tags = ", ".join(f"<{quoted(child.tag)}>" for child, _ in shapes) or "nothing"
        raise node.fault(f"<geometry> holds {tags}; one of {', '.join(valid)} can be shown")
    return shapes[0]


def _urdf_colour(material: Node, materials: dict[str, Node]) -> Colour | None:
    source = material if material.all("color") else materials.get(material.get("name") or "")
    colour = None if source is None else source.child("color")
    if colour is None:
        return None
    red, green, blue, opacity = (min(max(value, 0.0), 1.0) for value in colour.vector("rgba", 4))
    return red, green, blue, opacity


def _unpacked(text: str, kind: str) -> Array:
    return np.frombuffer(b64decode(text), kind).reshape(-1, 3)
