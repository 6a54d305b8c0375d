"""Limits of a drawing: meshes and shapes beyond what a page holds are replaced by their hulls."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...arrays import Array
from .visual import Visual

MOST_FACES = 1_500_000  # of all meshes, 30 MB in a page; the finest robots of example-robot-data have a million
MOST_SHAPES = 1_000  # each is an object of its own in a browser
_DIRECTIONS = 100  # farthest points of a mesh are taken in so many; a hull has up to twice as many faces
_THINNEST = 1e-3  # edge of the box around something flat, of its longest; in metres around a point


def within_limits(
    shapes: list[Visual], most_faces: int = MOST_FACES, most_shapes: int = MOST_SHAPES
) -> tuple[list[Visual], list[str]]:
    """Return shapes that a page can hold, and sentences on what was simplified."""
    fewer_faces, on_faces = _with_fewer_faces(shapes, most_faces)
    fewer_shapes, on_shapes = _with_fewer_shapes(fewer_faces, most_shapes)
    return fewer_shapes, on_faces + on_shapes


def hull(points: Array) -> tuple[Array, Array] | None:
    """Vertices and faces, seen from outside, of the convex hull of points (N, 3); None if they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        convex = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    numbers = np.full(len(points), -1)
    numbers[convex.vertices] = np.arange(len(convex.vertices))
    faces, vertices = numbers[convex.simplices], points[convex.vertices]
    corners = vertices[faces]
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inverted = np.einsum("ni,ni->n", outwards, convex.equations[:, :3]) < 0.0
    faces[inverted] = faces[inverted][:, ::-1]
    return vertices, faces


def outermost(points: Array) -> Array:
    """The points that are farthest in some directions, all around: (N, 3) -> (M, 3)."""
    number = np.arange(_DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * number / _DIRECTIONS, math.pi * (1.0 + math.sqrt(5.0)) * number
    across = np.sqrt(1.0 - height**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), height])
    return points[np.unique(np.argmax(points @ directions, axis=0))]


def _with_fewer_faces(shapes: list[Visual], most: int) -> tuple[list[Visual], list[str]]:
    counts = np.array([len(shape.faces) for shape in shapes], dtype=np.int64)
    total = left = int(counts.sum())
    result, hulls, simplified = list(shapes), {}, 0
    for place in np.argsort(-counts, kind="stable").tolist():
        if left <= most:
            break
        shape = shapes[place]
        # Visuals of one file share their arrays.
        if id(shape.vertices) not in hulls:
            hulls[id(shape.vertices)] = hull(outermost(shape.vertices))
        result[place] = as_hull(shape, shape.vertices, hulls[id(shape.vertices)])
        left += len(result[place].faces) - int(counts[place])
        simplified += 1
    sentence = (
        f"{simplified} meshes are drawn as their convex hulls: all have {total} triangles together, and up to "
        f"{most} are drawn"
    )
    return result, [sentence] * bool(simplified)


def _with_fewer_shapes(shapes: list[Visual], most: int) -> tuple[list[Visual], list[str]]:
    if len(shapes) <= most:
        return shapes, []
    by_link: dict[str, list[Visual]] = {}
    for shape in shapes:
        by_link.setdefault(shape.link, []).append(shape)
    left, simplified = len(shapes), []
    for link, own in sorted(by_link.items(), key=lambda item: -len(item[1])):
        if left <= most or len(own) == 1:
            break
        corners = np.concatenate([shape.corners @ shape.pose[:3, :3].T + shape.pose[:3, 3] for shape in own])
        by_link[link] = [as_hull(replace(own[0], pose=np.eye(4), mesh=None), corners, hull(outermost(corners)))]
        left += 1 - len(own)
        simplified.append(link)
    sentence = (
        f"{len(simplified)} links, {simplified[0]!r} first, are drawn as the hull of what they show: the body has "
        f"{len(shapes)} shapes, and up to {most} are drawn"
    )
    return [shape for own in by_link.values() for shape in own], [sentence]


def as_hull(shape: Visual, points: Array, convex: tuple[Array, Array] | None) -> Visual:
    """The shape replaced by the hull of points in its axes; by a thin box where they lie in a plane."""
    if convex is not None:
        return replace(shape, kind="mesh", dimensions=(1.0, 1.0, 1.0), vertices=convex[0], faces=convex[1])
    low, high = points.min(axis=0), points.max(axis=0)
    longest = float(np.max(high - low))
    edges = np.maximum(high - low, _THINNEST * longest if longest else _THINNEST)
    pose = shape.pose.copy()
    pose[:3, 3] += pose[:3, :3] @ (0.5 * (low + high))
    return Visual(shape.link, "box", tuple(edges.tolist()), pose, shape.colour, shape.mesh)
