"""Meshes, textures and height fields of an MJCF that cannot be read: left out where no mass comes from them."""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import Any

# What its compiled part brings, a type checker does not see.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

from ..formats.xml_text import listed
from .chain import UnusableModelError

_CORNERS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
_FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])  # of the tetrahedron that replaces a mesh
_EDGES = ((1.0, 1.0, 1.0), (3.0, 2.0, 1.0))  # [m] two tetrahedra: masses that differ come from the mesh
_OF_MASS = ("body_mass", "body_inertia", "body_ipos", "body_iquat")
_KINDS = {"meshes": "mesh", "textures": "texture", "hfields": "height field", "skins": "skin"}


def compiled_without(written: mujoco.MjSpec) -> tuple[Any, frozenset[int], list[str]]:
    """The model of a specification, numbers of geoms whose shape is not known, and notes on what is left out."""
    left: dict[str, tuple[str, str]] = {}
    meshes: list[Any] = []
    while True:
        try:
            model = written.compile()
            break
        except ValueError as error:
            kind, asset = _asset_of(written, str(error), left)
            if asset is None:
                raise
            left[f"{kind} {asset.name!r}"] = (kind, _file_of(asset))
            _replace(written, kind, asset)
            if kind == "mesh":
                meshes.append(asset)
    geoms = [
        (body, geom)
        for body in written.bodies
        for geom in body.geoms
        if f"mesh {geom.meshname!r}" in left or f"height field {geom.hfieldname!r}" in left
    ]
    shapeless = frozenset(geom.id for _, geom in geoms)
    if meshes:
        _check_masses(written, model, meshes, geoms, left)
    if not left:
        return model, shapeless, []
    names = [f"{what} ({file})" for what, (_, file) in left.items()]
    return (
        model,
        shapeless,
        [f"not found or not readable, and left out, as no mass comes from them: {listed(names)}"],
    )


def _asset_of(written: mujoco.MjSpec, message: str, left: dict[str, tuple[str, str]]) -> tuple[str, Any]:
    """The kind and the asset that an error is about; None where it is about something else."""
    missing = re.search(r"[Oo]pening file '([^']*)'", message)
    element = re.search(r"Element name '([^']*)'", message)
    for group, kind in _KINDS.items():
        for asset in getattr(written, group):
            file = _file_of(asset)
            if not file or f"{kind} {asset.name!r}" in left:
                continue
            if missing and PurePath(missing[1]).name in {PurePath(path).name for path in _files_of(asset)}:
                return kind, asset
            if element and element[1] == asset.name:
                return kind, asset
    return "", None


def _files_of(asset: Any) -> list[str]:
    return [file for file in (asset.file, *getattr(asset, "cubefiles", ())) if file]


def _file_of(asset: Any) -> str:
    return next(iter(_files_of(asset)), "")


def _replace(written: mujoco.MjSpec, kind: str, asset: Any) -> None:
    """Something small in the place of what cannot be read, so that what names it still finds it."""
    if kind == "skin":
        written.delete(asset)
        return
    asset.file = ""
    if kind == "mesh":
        _shape(asset, _EDGES[0])
    elif kind == "texture":
        asset.cubefiles = [""] * len(asset.cubefiles)
        asset.builtin, asset.width, asset.height = mujoco.mjtBuiltin.mjBUILTIN_FLAT, 1, 1
    else:
        asset.nrow, asset.ncol, asset.userdata = 2, 2, np.zeros(4)


def _shape(mesh: Any, extent: tuple[float, float, float]) -> None:
    mesh.uservert, mesh.userface = (_CORNERS * extent).ravel(), _FACES.ravel()
    mesh.usernormal = mesh.usertexcoord = np.zeros(0)


def _check_masses(
    written: mujoco.MjSpec,
    model: Any,
    meshes: list[Any],
    geoms: list[tuple[Any, Any]],
    left: dict[str, tuple[str, str]],
) -> None:
    """Raise UnusableModelError for a body that has other masses with other shapes for the missing meshes."""
    masses = [np.array(getattr(model, name)) for name in _OF_MASS]
    for mesh in meshes:
        _shape(mesh, _EDGES[1])
    larger = written.compile()
    changed = np.zeros(model.nbody, dtype=bool)
    for name, before in zip(_OF_MASS, masses, strict=True):
        changed |= (np.array(getattr(larger, name)) != before).reshape(model.nbody, -1).any(axis=1)
    if not changed.any():
        return
    body = int(np.argmax(changed))
    own = dict.fromkeys(geom.meshname for part, geom in geoms if part.id == body and geom.meshname)
    names = list(own) or [mesh.name for mesh in meshes]
    named = ", ".join(f"{name!r} ({left[f'mesh {name!r}'][1]})" for name in names)
    line = re.search(r"line (\d+)", next((part.info for part in written.bodies if part.id == body), ""))
    raise UnusableModelError(
        f"body {model.body(body).name or body!r}: its mass or inertia comes from a mesh that is not found or not "
        f"readable, {named}; put the file where the model names it, or give the body an <inertial>",
        int(line[1]) if line else 1,
    )
