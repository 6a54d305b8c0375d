"""A moving scene as the data of a page: poses frame by frame, shapes, meshes, and the joints to move by hand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ... import so3
from ...arguments import check_choice
from ...arrays import Array
from ...body.body import Body
from ...body.couplings.coordinate_map import CurvedJoint
from ...body.drawing.visual import Visual
from ...body.link_motions import link_motions
from ...shape_space.interpolation import ball_columns, neighbours_signs
from .._moving_scene import MovingNode, MovingScene

_SLIDER_END = math.pi  # [rad or m] for a joint without a limit
_NO_LIMIT = 100.0
_CELLS = 8  # of the floor along the largest extent of a motion
AXES = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}
# Symmetry: distance of a part from the mirror image of another, over the body's size, and share of the mass that may
# be elsewhere; models have a small part on the wrong side.
_ALIKE, _ASTRAY = 0.02, 0.03


def motion_data(scene: MovingScene, *, speed: float, ghost: bool, up: Array) -> dict[str, Any]:
    """Data of a page that shows a scene, with moving numbers as 32-bit floats."""
    meshes: dict[int, int] = {}
    stored: list[dict[str, Any]] = []
    data: dict[str, Any] = {
        "duration": float(scene.times[-1]),
        "frames": len(scene.times),
        "speed": speed,
        "turns": single(so3.quat_from_matrix(scene.base[:, :3, :3])),
        "places": single(scene.base[:, :3, 3]),
        "centre": single(scene.centre),
        "momentum": scene.momentum.tolist(),
        "trail": None if scene.trail is None else single(scene.trail),
        "reach": scene.reach,
        "extent": single(scene.extent),
        "up": up.tolist(),
        "ghost": ghost,
        "floor": single(_floor(scene, up)) if scene.falls else None,
        "meshes": stored,
        "chain": None,
        "joints": [],
    }
    if scene.momenta is not None:
        data |= {"momenta": single(scene.momenta), "momentum_changes": True}
    if scene.body is not None and scene.shapes is not None:
        data |= body_data(scene.body) | {
            "shapes": single(neighbours_signs(scene.shapes, ball_columns(scene.body.joint_names)))
        }
        data["nodes"] = frame_nodes(scene.body, {node.name: node.shapes for node in scene.nodes}, meshes, stored)
    else:
        data["nodes"] = [_moving_node(node, meshes, stored) for node in scene.nodes]
    return data


def body_data(body: Body) -> dict[str, Any]:
    """The joints of a body: how they move its parts, and their limits for sliders."""
    chain = body.chain
    names = ("turns", "places", "axes", "slides", "masses", "centres", "matrix", "offset")
    open_ended = np.abs(body.joint_limits) > _NO_LIMIT
    ends = np.where(np.array(body.joint_units) == "1", 1.0, _SLIDER_END)[:, None] * [-1.0, 1.0]
    limits = np.where(open_ended, ends, body.joint_limits)
    return {
        "chain": {
            "parents": list(chain.parents),
            **{name: np.asarray(getattr(chain, name), dtype=float) for name in names},
            "curved": [_curved_joint(joint) for joint in chain.follows.curved],
            "balls": [{"row": ball.row, "column": ball.column} for ball in chain.follows.balls],
        },
        "joints": [
            {"name": name, "unit": unit, "lower": float(lower), "upper": float(upper)}
            for name, unit, (lower, upper) in zip(body.joint_names, body.joint_units, limits, strict=True)
        ],
    }


def _curved_joint(joint: CurvedJoint) -> dict[str, Any]:
    """A joint that follows others by functions, as the page evaluates them."""
    return {
        "row": joint.row,
        "start": joint.start,
        "terms": [
            {"source": source, "coefficients": function.coefficients.T.tolist()}
            | {name: getattr(function, name).tolist() for name in ("knots", "centres")}
            for source, function in joint.terms
        ],
    }


def frame_nodes(
    body: Body, shapes: Mapping[str, Sequence[Visual]], meshes: dict[int, int], stored: list[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Shapes of a body by link, each with the frame of the body's chain that moves it.

    Meshes are added to those that are stored, `meshes` knows the place of each by its vertices.
    """
    found = []
    for link, own in shapes.items():
        frame, pose = body.chain.link_frames[link]
        drawn = [_shape(shape, pose @ shape.pose, meshes, stored) for shape in own]
        found.append({"name": link, "frame": frame, "shapes": drawn})
    return found


def _moving_node(node: MovingNode, meshes: dict[int, int], stored: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "name": node.name,
        "turns": single(so3.quat_from_matrix(node.poses[:, :3, :3])),
        "places": single(node.poses[:, :3, 3]),
        "scales": None if node.scales is None else single(node.scales),
        "shapes": [_shape(shape, shape.pose, meshes, stored) for shape in node.shapes],
    }


def _shape(shape: Visual, pose: Array, meshes: dict[int, int], stored: list[dict[str, Any]]) -> dict[str, Any]:
    described = {
        "kind": shape.kind,
        "dimensions": list(shape.dimensions),
        "colour": list(shape.colour),
        # In columns, as WebGL takes it.
        "pose": pose.T.ravel().tolist(),
    }
    if shape.kind == "mesh":
        if id(shape.vertices) not in meshes:
            meshes[id(shape.vertices)] = len(stored)
            stored.append({"vertices": single(shape.vertices), "faces": shape.faces.astype(np.uint32)})
        described["mesh"] = meshes[id(shape.vertices)]
    return described


def _floor(scene: MovingScene, up: Array) -> Array:
    """Lines of a grid below the lowest point of the motion, across `up`: (N, 3)."""
    low, high = scene.bounds
    middle, reach = 0.5 * (low + high), float(np.max(high - low))
    across = np.eye(3)[int(np.argmin(np.abs(up)))]
    side = so3.normalised(across - (across @ up) * up)
    other = np.cross(up, side)
    height = float(np.min(scene.corners @ up)) - 0.02 * reach
    foot = middle + (height - middle @ up) * up
    ticks = np.linspace(-reach, reach, 2 * _CELLS + 1)
    ends = np.array([-reach, reach])
    lines = [
        (foot + ticks[:, None, None] * along + ends[None, :, None] * across)
        for along, across in ((side, other), (other, side))
    ]
    return np.concatenate(lines).reshape(-1, 3)


def single(values: Array) -> np.ndarray:
    """The values as 32-bit floats, as pages hold moving numbers."""
    return np.asarray(values, dtype=np.float32)


def up_axis(up: str | None, body: Body | None) -> Array:
    """Return the named axis (3,); without a name z, or y for a body that is drawn with y up.

    Robots and most bodies have x in front and z up, so that left and right are mirror images across y; models of
    people from biomechanics have y up, and left and right across z.

    Raises UnknownNameError for an unknown axis.
    """
    if up is not None:
        check_choice(up, "axis", AXES)
        return np.array(AXES[up])
    y_up = body is not None and body.n_shape > 0 and _mirrored(body, 2) and not _mirrored(body, 1)
    return np.array(AXES["y" if y_up else "z"])


def _mirrored(body: Body, axis: int) -> bool:
    """True where the parts of a neutral body lie as their mirror images across an axis do."""
    shape = body.shape()[None]
    places = link_motions(body.chain, shape, np.zeros_like(shape)).places[0]
    masses = body.chain.masses
    # Frames between the joints of one place carry no mass.
    heavy = masses > 0.0
    places, masses = places[heavy], masses[heavy]
    images = places * np.where(np.arange(3) == axis, -1.0, 1.0)
    apart = np.linalg.norm(places[:, None] - images, axis=-1) / max(float(np.ptp(places, axis=0).max()), 1e-300)
    alike = np.abs(masses[:, None] - masses) <= _ALIKE * (masses[:, None] + masses)
    astray = ~np.any(alike & (apart <= _ALIKE), axis=1)
    return bool(masses[astray].sum() <= _ASTRAY * masses.sum())
