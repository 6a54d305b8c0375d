"""Geoms and meshes of a body that MuJoCo's own viewer would show, or that collide, as plain numbers."""

from __future__ import annotations

from base64 import b64encode
from typing import Any

# What its compiled part brings, a type checker does not see.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

from .mujoco_model import Compiled, compiled_model, rotation

# Names of the kinds, and factors of their sizes: MuJoCo has half lengths.
_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): ("sphere", (1.0,)),
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): ("capsule", (1.0, 2.0)),
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): ("cylinder", (1.0, 2.0)),
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): ("ellipsoid", (1.0, 1.0, 1.0)),
    int(mujoco.mjtGeom.mjGEOM_BOX): ("box", (2.0, 2.0, 2.0)),
    int(mujoco.mjtGeom.mjGEOM_MESH): ("mesh", ()),
}
_SHOWN_GROUPS = (0, 1, 2)  # of geoms in MuJoCo's viewer; the others are for collisions
_GREY = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)  # of a geom without a colour: its material's counts


def shapes_of(path: str, *, collision: bool) -> dict[str, Any]:
    """The geoms to be drawn, or those that collide, and the meshes that they name by number.

    Vertices are float32 [m] and faces int32, each in Base64.
    """
    compiled = compiled_model(path, drawn=not collision)
    model = compiled.model
    chosen = _colliding if collision else _drawn
    drawn = [geom for body in range(1, model.nbody) for geom in chosen(compiled, body)]
    meshes = sorted({int(model.geom_dataid[geom]) for geom in drawn if _kind(model, geom) == "mesh"})
    return {
        "shapes": [_shape(compiled, geom) for geom in drawn],
        "partly": sorted({compiled.names[int(model.geom_bodyid[geom])] for geom in compiled.shapeless}),
        "meshes": {str(mesh): _mesh(model, mesh) for mesh in meshes},
    }


def _drawn(compiled: Compiled, body: int) -> list[int]:
    """The geoms of a body that the viewer shows, or all if it shows none."""
    solid = _solid(compiled, body)
    return [geom for geom in solid if int(compiled.model.geom_group[geom]) in _SHOWN_GROUPS] or solid


def _colliding(compiled: Compiled, body: int) -> list[int]:
    model = compiled.model
    return [geom for geom in _solid(compiled, body) if model.geom_contype[geom] or model.geom_conaffinity[geom]]


def _solid(compiled: Compiled, body: int) -> list[int]:
    """The geoms of a body whose shape is known."""
    model = compiled.model
    first = int(model.body_geomadr[body])
    geoms = range(first, first + int(model.body_geomnum[body]))
    return [geom for geom in geoms if geom not in compiled.shapeless and int(model.geom_type[geom]) in _KINDS]


def _kind(model: Any, geom: int) -> str:
    return _KINDS[int(model.geom_type[geom])][0]


def _shape(compiled: Compiled, geom: int) -> dict[str, Any]:
    model = compiled.model
    kind, factors = _KINDS[int(model.geom_type[geom])]
    colour, material = model.geom_rgba[geom], int(model.geom_matid[geom])
    if material >= 0 and np.array_equal(colour, _GREY):
        colour = model.mat_rgba[material]
    return {
        "link": compiled.names[int(model.geom_bodyid[geom])],
        "kind": kind,
        "dimensions": [factor * size for factor, size in zip(factors, model.geom_size[geom].tolist(), strict=False)],
        "place": model.geom_pos[geom].tolist(),
        "turn": rotation(model.geom_quat[geom]).ravel().tolist(),
        # MuJoCo keeps them in single precision.
        "colour": [round(min(max(float(part), 0.0), 1.0), 6) for part in colour],
        "mesh": str(int(model.geom_dataid[geom])) if kind == "mesh" else None,
    }


def _mesh(model: Any, mesh: int) -> dict[str, str]:
    def text(rows: Any, first: int, count: int, kind: str) -> str:
        return b64encode(np.ascontiguousarray(rows[int(first) : int(first) + int(count)], kind).tobytes()).decode()

    return {
        "vertices": text(model.mesh_vert, model.mesh_vertadr[mesh], model.mesh_vertnum[mesh], "<f4"),
        "faces": text(model.mesh_face, model.mesh_faceadr[mesh], model.mesh_facenum[mesh], "<i4"),
    }
