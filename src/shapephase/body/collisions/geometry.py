"""Collision geometry of a body: convex solids of its links, and the pairs of links whose distance counts."""

from __future__ import annotations

# What coal's compiled part brings, a type checker does not see.
# pyright: reportAttributeAccessIssue=false
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from ...arguments import check_file_name
from ...arrays import Array, Integers
from ...display import frozen
from ...errors import MissingExtraError, NoCollisionGeometryError, VisualWarning, unknown_name
from ..body import Body
from ..drawing.appearance import collision_shapes
from ..drawing.limits import as_hull, hull
from ..drawing.visual import Visual
from ..formats.xml_text import listed, read_file, xml_tree
from ..joint_chain import JointChain
from ..link_motions import link_motions
from ..loading import as_body

_GJK_TOLERANCE = 1e-10  # [m] with the usual 1e-6 derivatives of distances are off by 1e-3
_EPA_TOLERANCES = (1e-6, 1e-4, 1e-2)  # [m] each where the one before failed: at 1e-8 1 of 100 depths is wrong by half
_FAILED = 1e30  # [m] coal returns the largest number where EPA fails
_ITERATIONS = 1000  # of GJK and EPA: round shapes take more than the usual 128 to that tolerance
_TOUCHING = 1e-9  # [m] rounding of links that touch in a file


@dataclass(frozen=True, eq=False)
class Postures:
    """Frames of a chain and solids of its links at N shapes, in base axes from the base origin.

    shapes : (N, n)
    turns, origins : (N, k + 1, 3, 3), (N, k + 1, 3) of the frames [m]
    solid_turns, solid_places : (N, s, 3, 3), (N, s, 3) of the solids
    centres : (N, s, 3) of the spheres around the solids
    """

    shapes: Array
    turns: Array
    origins: Array
    solid_turns: Array
    solid_places: Array
    centres: Array


@dataclass(frozen=True, eq=False)
class Separations:
    """Signed distances of M pairs of solids, each in one posture.

    distances : (M,) negative where they overlap: the depth [m]
    points : (M, 2, 3) the nearest points, base axes [m]
    normals : (M, 3) unit vectors from the first to the second
    """

    distances: Array
    points: Array
    normals: Array


@frozen
class CollisionGeometry:
    """Convex solids of a body's links, and the pairs of links whose distance counts. Made by `collision_geometry`.

    Attributes
    ----------
    solids : boxes, spheres, cylinders, capsules, ellipsoids, and convex hulls of meshes
    pairs : names of the links of each pair
    left_out : pairs that do not count: link, link, and why ("adjacent", "overlap at rest", "SRDF")
    missing : links whose shapes are not all known, which have no solids
    """

    chain: JointChain
    solids: tuple[Visual, ...]
    pairs: tuple[tuple[str, str], ...]
    left_out: tuple[tuple[str, str, str], ...]
    missing: tuple[str, ...]

    def __getstate__(self) -> dict[str, Any]:
        """Return everything but what is derived: solids of coal cannot be pickled."""
        return {name: vars(self)[name] for name in self.__dataclass_fields__}

    @cached_property
    def frames(self) -> Integers:
        """Number of the chain's frame that each solid moves with: (s,)."""
        return np.array([self.chain.link_frames[solid.link][0] for solid in self.solids], dtype=np.int64)

    @cached_property
    def members(self) -> tuple[Integers, Integers]:
        """Solids of each pair of solids, and the pair of links that it belongs to: (K, 2), (K,)."""
        by_link: dict[str, list[int]] = {}
        for number, solid in enumerate(self.solids):
            by_link.setdefault(solid.link, []).append(number)
        rows = [
            (first, second, number)
            for number, (one, other) in enumerate(self.pairs)
            for first in by_link[one]
            for second in by_link[other]
        ]
        table = np.array(rows, dtype=np.int64).reshape(-1, 3)
        return table[:, :2], table[:, 2]

    @cached_property
    def spheres(self) -> tuple[Array, Array]:
        """Centres, in axes of the solids, and radii of spheres around them: (s, 3), (s,) [m]."""
        centres, radii = zip(*(_sphere(solid) for solid in self.solids), strict=True)
        return np.array(centres), np.array(radii)

    @cached_property
    def extents(self) -> Array:
        """Largest distances of points of the solids from the origins of their frames: (s,) [m]."""
        centres, radii = self.spheres
        placed = (self.poses[:, :3, :3] @ centres[..., None])[..., 0] + self.poses[:, :3, 3]
        return np.linalg.norm(placed, axis=1) + radii

    @cached_property
    def poses(self) -> Array:
        """Poses of the solids in the axes of their frames: (s, 4, 4)."""
        return np.array([self.chain.link_frames[solid.link][1] @ solid.pose for solid in self.solids])

    @cached_property
    def _coal(self) -> list[Any]:
        return [_coal_solid(solid) for solid in self.solids]

    def postures(self, shapes: Array) -> Postures:
        """Places of frames and solids: (N, n) of the independent joints."""
        motions = link_motions(self.chain, shapes, np.zeros_like(shapes))
        origins = motions.places - (motions.turns @ self.chain.centres[..., None])[..., 0]
        origins -= origins[:, :1]
        turns = motions.turns[:, self.frames] @ self.poses[:, :3, :3]
        places = origins[:, self.frames] + (motions.turns[:, self.frames] @ self.poses[:, :3, 3:])[..., 0]
        middles, _ = self.spheres
        return Postures(shapes, motions.turns, origins, turns, places, places + (turns @ middles[..., None])[..., 0])

    def least_gaps(self, postures: Postures) -> Array:
        """Lower bounds of the distances of all pairs of solids, by the spheres around them: (N, K) [m]."""
        first, second = self.members[0].T
        between, (_, radii) = postures.centres[:, first] - postures.centres[:, second], self.spheres
        return np.linalg.norm(between, axis=-1) - radii[first] - radii[second]

    def separations(self, postures: Postures, rows: Integers, members: Integers) -> Separations:
        """Distances of pairs of solids `members` (M,) in the postures `rows` (M,)."""
        import coal

        requests, result = [coal.DistanceRequest() for _ in _EPA_TOLERANCES], coal.DistanceResult()
        for request, tolerance in zip(requests, _EPA_TOLERANCES, strict=True):
            request.gjk_tolerance, request.epa_tolerance = _GJK_TOLERANCE, tolerance
            request.gjk_max_iterations = request.epa_max_iterations = _ITERATIONS
        pairs = self.members[0][members]
        distances, points, normals = np.empty(len(rows)), np.empty((len(rows), 2, 3)), np.empty((len(rows), 3))
        for number, (row, (first, second)) in enumerate(zip(rows.tolist(), pairs.tolist(), strict=True)):
            poses = [
                coal.Transform3s(postures.solid_turns[row, solid], postures.solid_places[row, solid])
                for solid in (first, second)
            ]
            for request in requests:
                result.clear()
                solids = self._coal[first], poses[0], self._coal[second], poses[1]
                distances[number] = coal.distance(*solids, request, result)
                if abs(distances[number]) < _FAILED:
                    break
            points[number] = result.getNearestPoint1(), result.getNearestPoint2()
            normals[number] = result.normal
        return Separations(distances, points, normals)

    def slopes(self, postures: Postures, rows: Integers, members: Integers, separations: Separations) -> Array:
        """Exact derivatives of these distances by the shape: (M, n) [m per unit of joint].

        n . (J_b - J_a) of the nearest points along their normal: only joints between the two links count, and they turn
        the wrench of a unit force along the line through both points. Where faces or edges are parallel, several points
        are nearest, and it is the derivative of one of them.
        """
        first, second = self.frames[self.members[0][members]].T
        carried = (self.chain.hanging[:, second] - self.chain.hanging[:, first]).T
        turns, origins = postures.turns[rows, 1:], postures.origins[rows, 1:]
        axes, slides = ((turns @ vectors[..., None])[..., 0] for vectors in (self.chain.axes, self.chain.slides))
        normals = separations.normals[:, None]
        arms = np.cross(separations.points[:, None, 1] - origins, normals)
        columns = carried * ((slides * normals).sum(axis=-1) + (axes * arms).sum(axis=-1))
        return self.chain.follows.folded(columns, postures.shapes[rows])


_kept: WeakKeyDictionary[Body, CollisionGeometry] = WeakKeyDictionary()


def collision_geometry(body: Body | str, *, srdf: str | Path | None = None) -> CollisionGeometry:
    """Return the convex solids of a body's links, and the pairs of links whose distance counts.

    The solids are those of the <collision> elements of its file (colliding geoms of an MJCF), or if it has none those
    that are drawn; a mesh counts as its convex hull. Pairs are left out whose links are adjacent, over links without
    mass, too, or overlap in the neutral shape (within the joint limits).

    Parameters
    ----------
    srdf : file whose <disable_collisions> elements name further pairs that do not count

    Raises
    ------
    NoCollisionGeometryError
        If the body's file has no shapes, or the body has no file.
    ModelFileError, UnknownNameError
        For an SRDF that cannot be read, or that names an unknown link.

    Warns
    -----
    VisualWarning
        If a mesh or an element cannot be read: its link has no solids, and is not compared with others.

    Examples
    --------
    >>> geometry = sp.body.collision_geometry(sp.load_body("astronaut"))
    >>> len(geometry.pairs), geometry.left_out[0]
    (95, ('lower_trunk', 'left_thigh', 'adjacent'))
    """
    body = as_body(body)
    if srdf is not None:
        check_file_name(srdf, "srdf")
    if body not in _kept:
        _kept[body] = _geometry(body)
    geometry = _kept[body]
    disabled = set() if srdf is None else set(_disabled_pairs(body, Path(srdf)))
    return _without(geometry, {pair for pair in geometry.pairs if frozenset(pair) in disabled}, "SRDF")


def _geometry(body: Body) -> CollisionGeometry:
    shapes, doubts, incomplete = collision_shapes(body)
    missing = tuple(name for name in body.link_names if name in incomplete)
    if missing:
        doubts = [*doubts, f"links of {body.name} left out, as not all of their shapes are known: {listed(missing)}"]
    solids = tuple(_convex(shape) for shape in shapes if shape.link not in incomplete)
    if not solids:
        reasons = "".join(f"; {doubt}" for doubt in doubts[:3])
        raise NoCollisionGeometryError(
            f"{body.name} has no shapes to compute distances with; load it from a URDF or MJCF file with <collision> "
            f"or <visual> elements, boxes, spheres, cylinders, capsules or meshes{reasons}"
        )
    if doubts:
        warnings.warn("; ".join(doubts), VisualWarning, stacklevel=3)
    frame_of = {name: body.chain.link_frames[name][0] for name in dict.fromkeys(solid.link for solid in solids)}
    links = sorted(frame_of, key=frame_of.__getitem__)
    apart = [pair for pair in combinations(links, 2) if frame_of[pair[0]] != frame_of[pair[1]]]
    geometry = CollisionGeometry(body.chain, solids, tuple(apart), (), missing)
    adjacent = {pair for pair in apart if _adjacent(body.chain, *(frame_of[link] for link in pair))}
    geometry = _without(geometry, adjacent, "adjacent")
    postures = geometry.postures(np.clip(body.shape(), *body.joint_limits.T)[None])
    members = np.flatnonzero(geometry.least_gaps(postures)[0] <= _TOUCHING)
    separations = geometry.separations(postures, np.zeros(len(members), dtype=np.int64), members)
    overlapping = geometry.members[1][members[separations.distances <= _TOUCHING]]
    return _without(geometry, {geometry.pairs[number] for number in overlapping.tolist()}, "overlap at rest")


def _without(geometry: CollisionGeometry, pairs: set[tuple[str, str]], reason: str) -> CollisionGeometry:
    """Return the geometry with these pairs left out for a reason."""
    if not pairs:
        return geometry
    kept = tuple(pair for pair in geometry.pairs if pair not in pairs)
    left_out = (*geometry.left_out, *((*pair, reason) for pair in geometry.pairs if pair in pairs))
    return CollisionGeometry(geometry.chain, geometry.solids, kept, left_out, geometry.missing)


def _adjacent(chain: JointChain, first: int, second: int) -> bool:
    """True where one frame hangs on the other with nothing but frames without mass between them."""

    def leads_to(frame: int, target: int) -> bool:
        while frame:
            frame = chain.parents[frame - 1]
            if frame == target or chain.masses[frame] > 0.0:
                break
        return frame == target

    return leads_to(second, first) or leads_to(first, second)


def _disabled_pairs(body: Body, path: Path) -> Iterator[frozenset[str]]:
    for node in xml_tree(read_file(path), str(path)).all("disable_collisions"):
        names = [node.get(key) or "" for key in ("link1", "link2")]
        for name in names:
            if name not in body.link_names:
                raise unknown_name(f"link of {body.name} in {path}:{node.line}", name, body.link_names)
        yield frozenset(names)


def _convex(shape: Visual) -> Visual:
    """The shape; of a mesh its convex hull, a thin box if it is flat."""
    return as_hull(shape, shape.vertices, hull(shape.vertices)) if shape.kind == "mesh" else shape


def _sphere(solid: Visual) -> tuple[Array, float]:
    """Centre, in its own axes, and radius of a sphere around a solid: (3,), [m]."""
    points = solid.vertices if solid.kind == "mesh" else solid.corners
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radii = {"sphere": solid.dimensions[0], "capsule": solid.dimensions[0] + 0.5 * solid.dimensions[-1]}
    return centre, radii.get(solid.kind, float(np.linalg.norm(points - centre, axis=1).max()))


def _coal_solid(solid: Visual) -> Any:
    try:
        import coal
    except ImportError:
        raise MissingExtraError(
            "distances between links need coal, which comes with Pinocchio: pip install coal"
        ) from None
    sizes = solid.dimensions
    if solid.kind == "mesh":
        corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        corners.extend(solid.vertices)
        triangles.extend(coal.Triangle(*face) for face in solid.faces.tolist())
        return coal.Convex(corners, triangles)
    kinds = {
        "box": coal.Box,
        "sphere": coal.Sphere,
        "cylinder": coal.Cylinder,
        "capsule": coal.Capsule,
        "ellipsoid": coal.Ellipsoid,
    }
    return kinds[solid.kind](*sizes)
