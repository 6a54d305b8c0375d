"""Meshes that a URDF names: where their files are, and their pieces of one colour each."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ...arrays import Array, Integers
from ..catalog import example_folder
from ..formats.xml_text import Node, quoted
from .visual import Colour

Piece = tuple[Array, Integers, Colour | None]
_ENDINGS = (".stl", ".obj", ".dae", ".ply")


class MeshFiles:
    """Meshes of one URDF, each file read once and each scale applied once."""

    def __init__(self, folder: Path, packages: Sequence[str]) -> None:
        self._folder, self._packages = folder, packages
        self._pieces: dict[Path, list[Piece]] = {}
        self._scaled: dict[tuple[Path, tuple[float, ...]], list[Piece]] = {}

    def pieces(self, node: Node, scale: tuple[float, ...]) -> tuple[Path, list[Piece]]:
        """The file that a <mesh> names, and vertices, faces and colour of its pieces. Raises ModelFileError."""
        name = node.get("filename") or ""
        path = next((place for place in self._places(name) if _is_file(place)), None)
        if path is None:
            raise node.fault(f"the mesh {quoted(name)!r} is not found")
        if path.suffix.lower() not in _ENDINGS:
            raise node.fault(f"the mesh {quoted(name)!r}: files {', '.join(_ENDINGS)} can be read")
        if path not in self._pieces:
            self._pieces[path] = _read(path, node)
        # Faces of a mirror image run the other way round.
        order = 1 if np.prod(scale) > 0.0 else -1
        if (path, scale) not in self._scaled:
            self._scaled[path, scale] = [
                (vertices * np.array(scale), faces[:, ::order], colour)
                for vertices, faces, colour in self._pieces[path]
            ]
        return path, self._scaled[path, scale]

    def _places(self, name: str) -> Iterator[Path]:
        """Places where a mesh may be: in a given package, around the URDF, in example-robot-data, beside the URDF."""
        folder = self._folder
        scheme, _, rest = name.rpartition("://")
        given = [Path(place) for package in self._packages for place in (package, os.path.dirname(package))]
        around = [*given, folder, *folder.parents]
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


def _read(path: Path, node: Node) -> list[Piece]:
    """Vertices, faces and colour of each piece of a file."""
    ending = path.suffix.lower()
    needed = {"trimesh": "trimesh", **({"collada": "pycollada"} if ending == ".dae" else {})}
    for module, package in needed.items():
        if importlib.util.find_spec(module) is None:
            raise node.fault(f"the mesh {path.name} needs {package}: pip install 'shapephase[plot]'")
    import trimesh

    try:
        scene: Any = trimesh.load_scene(path, skip_materials=ending == ".obj")
        if ending == ".dae":
            # Its unit counts, its upward axis does not: other viewers of URDF do the same.
            scene = scene.convert_units("meters")
        pieces = [piece for piece in scene.dump() if isinstance(piece, trimesh.Trimesh) and len(piece.faces)]
    except Exception as error:
        # Readers of mesh files raise whatever a damaged file makes them raise.
        raise node.fault(f"the mesh {path.name} cannot be read ({type(error).__name__}: {error})") from None
    if not pieces or not all(np.isfinite(piece.vertices).all() for piece in pieces):
        raise node.fault(f"the mesh {path.name} has no faces, or vertices that are not finite")
    return [(np.asarray(p.vertices, float), np.asarray(p.faces, np.int64), _colour_of(p)) for p in pieces]


def _colour_of(mesh: Any) -> Colour | None:
    """The colour stored in a mesh, or None."""
    kind = mesh.visual.kind
    if kind is None:
        return None
    rgba = mesh.visual.material.main_color if kind == "texture" else mesh.visual.main_color
    red, green, blue, opacity = (float(value) / 255.0 for value in rgba)
    return red, green, blue, opacity
