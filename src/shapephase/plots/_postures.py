"""Flat pictures of a body at some shapes, in parallel projection: each link as its outline, the nearest on top."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array
from ..body.body import Body
from ..body.drawing.appearance import visuals
from ..body.drawing.visual import Visual
from .pages.motion_data import up_axis

_VIEW = (20.0, -60.0)  # [degrees] elevation and azimuth of the eye, as Matplotlib's
_ROUND = 24  # points on a circle, whose corners are not seen at half an inch
_LINE = 0.4  # [pt] outlines in a picture of half an inch


def draw_postures(axes: list[Any], body: Body, shapes: Array, attitudes: Array, up: str | None = None) -> None:
    """Draw one posture on each of some flat axes, all on one scale.

    shapes, attitudes : (K, n) joints in the body's order, (K, 3, 3) of the base
    """
    from matplotlib.collections import PolyCollection
    from scipy.spatial import ConvexHull

    rise, turn = np.radians(_VIEW)
    eye = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    upright = so3.between(up_axis(up, body), np.array([0.0, 0.0, 1.0]))
    seen = np.stack([right, np.cross(eye, right), eye]) @ upright @ attitudes
    drawn = [shape for shape in visuals(body) if len(_outline(shape))]
    poses = [body.link_pose(shapes, shape.link) @ shape.pose for shape in drawn]
    centre = body.centre_of_mass(shapes)
    outlines = [
        (_outline(shape) @ so3.transpose(pose[:, :3, :3]) + pose[:, None, :3, 3] - centre[:, None])
        @ so3.transpose(seen)
        for shape, pose in zip(drawn, poses, strict=True)
    ]
    reach = 1.02 * np.max([np.abs(points[..., :2]).max(axis=(0, 1)) for points in outlines], axis=0)
    for k, ax in enumerate(axes):
        flat = [(points[k, :, 2].mean(), points[k, :, :2], shape.colour) for points, shape in zip(outlines, drawn)]
        flat.sort(key=lambda part: part[0])
        ax.add_collection(
            PolyCollection(
                [points[ConvexHull(points, qhull_options="QJ").vertices] for _, points, _ in flat],
                facecolors=[colour[:3] for _, _, colour in flat],
                edgecolors="#333333",
                linewidths=_LINE,
            )
        )
        ax.set(xlim=(-reach[0], reach[0]), ylim=(-reach[1], reach[1]), aspect="equal")
        ax.set_axis_off()


def _outline(shape: Visual) -> Array:
    """Points whose convex hull is the shape, or is near to it: (M, 3) in its own axes [m]."""
    turn, rise = np.linspace(0.0, 2.0 * np.pi, _ROUND, endpoint=False), np.linspace(-0.5, 0.5, _ROUND // 2 + 1) * np.pi
    ring = np.stack([np.cos(turn), np.sin(turn), np.zeros(_ROUND)], axis=-1)
    ball = (np.cos(rise)[:, None, None] * ring + np.sin(rise)[:, None, None] * np.eye(3)[2]).reshape(-1, 3)
    lengths, half = shape.dimensions, np.eye(3)[2] * 0.5 * (shape.dimensions[-1] if shape.dimensions else 0.0)
    if shape.kind == "cylinder":
        return np.concatenate([lengths[0] * ring - half, lengths[0] * ring + half])
    if shape.kind == "capsule":
        return np.concatenate([lengths[0] * ball - half, lengths[0] * ball + half])
    if shape.kind in ("sphere", "ellipsoid"):
        return np.array(lengths) * ball
    return shape.vertices if shape.kind == "mesh" else shape.corners
