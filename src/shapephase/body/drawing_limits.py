"""How much of a body is drawn: more triangles or shapes than a page can hold are replaced by hulls around them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array

if TYPE_CHECKING:
    from .appearance import Visual

# Of all meshes together: some 30 MB in a page; the finest robots of example-robot-data have a million.
_MOST_FACES = 1_500_000
# Of a body: each is an object of its own in a browser.
_MOST_SHAPES = 1_000
# From which the farthest points of a mesh are sought: hulls have up to twice as many faces.
_DIRECTIONS = 100
# Of the longest edge of a box that stands for something flat; where all is one point [m].
_THINNEST = 1e-3


def within_limits(shapes: list[Visual]) -> tuple[list[Visual], list[str]]:
    """Shapes that a page can hold, and what has been simplified, as sentences."""
    fewer, said = _with_fewer_faces(shapes)
    merged, also = _with_fewer_shapes(fewer)
    return merged, said + also


def hull(points: Array) -> tuple[Array, Array] | None:
    """Vertices and faces, seen from outside, of the convex hull of points (N, 3); None if they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    numbers = np.full(len(points), -1)
    numbers[found.vertices] = np.arange(len(found.vertices))
    faces = numbers[found.simplices]
    vertices = points[found.vertices]
    corners = vertices[faces]
    outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turned = np.einsum("ni,ni->n", outwards, found.equations[:, :3]) < 0.0
    faces[turned] = faces[turned][:, ::-1]
    return vertices, faces


def outermost(points: Array) -> Array:
    """The points that are farthest in some directions, all around: (N, 3) -> (M, 3)."""
    number = np.arange(_DIRECTIONS) + 0.5
    height, turn = 1.0 - 2.0 * number / _DIRECTIONS, math.pi * (1.0 + math.sqrt(5.0)) * number
    across = np.sqrt(1.0 - height**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), height])
    return points[np.unique(np.argmax(points @ directions, axis=0))]


def _with_fewer_faces(shapes: list[Visual]) -> tuple[list[Visual], list[str]]:
    counts = np.array([len(shape.faces) for shape in shapes], dtype=np.int64)
    total = left = int(counts.sum())
    if total <= _MOST_FACES:
        return shapes, []
    result, hulls, simplified = list(shapes), {}, 0
    for place in np.argsort(-counts, kind="stable").tolist():
        if left <= _MOST_FACES:
            break
        shape = shapes[place]
        # Visuals of one file share their arrays.
        if id(shape.vertices) not in hulls:
            hulls[id(shape.vertices)] = hull(outermost(shape.vertices))
        result[place] = _as_hull(shape, shape.vertices, hulls[id(shape.vertices)])
        left += len(result[place].faces) - int(counts[place])
        simplified += 1
    said = (
        f"{simplified} meshes are drawn as their convex hulls: all have {total} triangles together, and up to "
        f"{_MOST_FACES} are drawn"
    )
    return result, [said]


def _with_fewer_shapes(shapes: list[Visual]) -> tuple[list[Visual], list[str]]:
    if len(shapes) <= _MOST_SHAPES:
        return shapes, []
    by_link: dict[str, list[Visual]] = {}
    for shape in shapes:
        by_link.setdefault(shape.link, []).append(shape)
    left, simplified = len(shapes), []
    for link, own in sorted(by_link.items(), key=lambda each: -len(each[1])):
        if left <= _MOST_SHAPES or len(own) == 1:
            break
        corners = np.concatenate([shape.corners @ shape.pose[:3, :3].T + shape.pose[:3, 3] for shape in own])
        by_link[link] = [_as_hull(replace(own[0], pose=np.eye(4), mesh=None), corners, hull(outermost(corners)))]
        left += 1 - len(own)
        simplified.append(link)
    said = (
        f"{len(simplified)} links, {simplified[0]!r} first, are drawn as the hull of what they show: the body has "
        f"{len(shapes)} shapes, and up to {_MOST_SHAPES} are drawn"
    )
    return [shape for own in by_link.values() for shape in own], [said]


def _as_hull(shape: Visual, points: Array, found: tuple[Array, Array] | None) -> Visual:
    """A shape as the hull of points in its axes; where they lie in a plane, as a thin box."""
    if found is not None:
        return replace(shape, kind="mesh", dimensions=(1.0, 1.0, 1.0), vertices=found[0], faces=found[1])
    low, high = points.min(axis=0), points.max(axis=0)
    longest = float(np.max(high - low))
    edges = np.maximum(high - low, _THINNEST * longest if longest else _THINNEST)
    pose = shape.pose.copy()
    pose[:3, 3] += pose[:3, :3] @ (0.5 * (low + high))
    nothing = {"vertices": np.zeros((0, 3)), "faces": np.zeros((0, 3), dtype=np.int64)}
    return replace(shape, kind="box", dimensions=tuple(edges.tolist()), pose=pose, **nothing)
