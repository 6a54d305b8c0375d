"""A moving scene drawn through the interface of viser: shapes, arrows, trail, floor and camera.

Nothing here imports viser; its scene and server come as arguments.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array, Integers
from ..body.appearance import Visual
from ._letters import printable
from ._moving_scene import MovingNode, MovingScene

# Colours of Okabe and Ito, RGB from 0 to 255: people with any colour vision can tell them apart, also in grey.
_VERMILION = (213, 94, 0)
_PURPLE = (204, 121, 167)
_GREEN = (0, 158, 115)
_BLUE = (0, 114, 178)
_SKY = (86, 180, 233)
# End of a trail, RGB: dark enough to differ from its light start.
_DARK_BLUE = (0, 60, 110)
# The body at the start, RGB and opacity from 0 to 1: the moving body stays visible through it.
_GHOST = (120, 120, 120)
_GHOST_OPACITY = 0.25
# Lines of the floor, RGB: of its cells, and darker those of every fifth.
_CELL = (215, 215, 215)
_SECTION = (170, 170, 170)
# Vertical field of view [rad]: like that of a lens of 50 mm, without distortion at the edges.
_FIELD_OF_VIEW = math.radians(40.0)
# Width over height of the narrowest page in which all of the motion is visible.
_ASPECT = 1.25
# Distance of the camera over the least from which all is visible.
_MARGIN = 1.12
# Lengths of the momentum's arrow and of the base axes, over the reach of the body: both end outside it.
_ARROW = 1.2
_TRIAD = 1.15
# Radii of the shafts of these arrows, over their lengths.
_ARROW_RADIUS = 0.016
_TRIAD_RADIUS = 0.012
# Length and radius of an arrow's head, over the radius of its shaft.
_HEAD_LENGTH = 8.0
_HEAD_RADIUS = 2.6
# Direction of the camera from the motion: in front, on the right and above, for a body that looks along x.
_FROM = np.array([0.55, -0.75, 0.36])


class DrawnScene:
    """A scene in viser, shown one frame at a time.

    Attributes
    ----------
    speed : seconds of motion in a second of playing, for the clock's text
    moving : handles that move, with their positions (F, 3) and quaternions w x y z (F, 4) in their parents
    stretched : handles that are stretched, with their scales (F, 3)
    frame : the one that is shown
    """

    def __init__(self, api: Any, scene: MovingScene, speed: float, ghost: bool) -> None:
        self.api, self.scene, self.speed = api, scene, speed
        self.moving: list[tuple[Any, Array, Array]] = []
        self.stretched: list[tuple[Any, Array]] = []
        self.frame = 0
        _draw_floor(api, scene)
        self._follow(api.add_frame("/body", show_axes=False), scene.base)
        for number, node in enumerate(scene.nodes):
            self._draw_node(f"/body/{_safe(node.name)}_{number}", node, node.poses, None)
        if ghost:
            for number, node in enumerate(scene.nodes):
                first = scene.world_pose(node)[:1]
                self._draw_node(f"/reference/{_safe(node.name)}_{number}", node, first, _GHOST)
        if not scene.articulated:
            _draw_triad(api, _TRIAD * scene.reach)
        self._draw_momentum()
        self._draw_trail()
        place = tuple(_clock_place(scene).tolist())
        self.clock = api.add_label("/clock", self._time_text(), position=place, anchor="bottom-center")

    def show(self, frame: int) -> None:
        """Show one frame."""
        before, self.frame = self.frame, frame
        for handle, places, quaternions in self.moving:
            if len(places) > 1 and not np.array_equal(places[before], places[frame]):
                handle.position = places[frame]
            if len(places) > 1 and not np.array_equal(quaternions[before], quaternions[frame]):
                handle.wxyz = quaternions[frame]
        for handle, scales in self.stretched:
            if not np.array_equal(scales[before], scales[frame]):
                handle.scale = tuple(scales[frame].tolist())
        if before != frame:
            self.clock.text = self._time_text()

    def _time_text(self) -> str:
        return f"t = {self.scene.times[self.frame]:.3g} s   (× {self.speed:.3g})"

    def _follow(self, handle: Any, poses: Array) -> None:
        quaternions = _wxyz(poses[:, :3, :3])
        handle.position, handle.wxyz = poses[0, :3, 3], quaternions[0]
        self.moving.append((handle, poses[:, :3, 3], quaternions))

    def _draw_node(self, name: str, node: MovingNode, poses: Array, colour: tuple[int, int, int] | None) -> None:
        self._follow(self.api.add_frame(name, show_axes=False), poses)
        for number, shape in enumerate(node.shapes):
            scale = np.ones(3) if node.scales is None else node.scales[0]
            handle = _draw_shape(self.api, f"{name}/{shape.kind}_{number}", shape, scale, colour)
            if node.scales is not None and colour is None:
                self.stretched.append((handle, node.scales))

    def _draw_momentum(self) -> None:
        magnitude = float(np.linalg.norm(self.scene.momentum))
        if magnitude == 0.0:
            return
        tip = _ARROW * self.scene.reach * self.scene.momentum / magnitude
        node = self.api.add_frame("/momentum", show_axes=False)
        _draw_arrow(self.api, "/momentum/arrow", tip, _ARROW_RADIUS, _VERMILION)
        text = f"angular momentum {magnitude:.3g} kg m²/s"
        self.api.add_label("/momentum/label", text, position=tuple((1.03 * tip).tolist()), anchor="bottom-center")
        poses = np.broadcast_to(np.eye(4), (len(self.scene.times), 4, 4)).copy()
        poses[:, :3, 3] = self.scene.centre
        self._follow(node, poses)

    def _draw_trail(self) -> None:
        points = self.scene.trail
        if points is None:
            return
        share = np.linspace(0.0, 1.0, len(points))[:, None]
        shades = np.rint((1.0 - share) * np.array(_SKY) + share * np.array(_DARK_BLUE)).astype(np.uint8)
        self.api.add_line_segments(
            "/trail",
            np.stack([points[:-1], points[1:]], axis=1),
            np.stack([shades[:-1], shades[1:]], axis=1),
            thickness=3.0,
            thickness_units="screen",
        )
        poses = np.broadcast_to(np.eye(4), (len(points), 4, 4)).copy()
        poses[:, :3, 3] = points
        self._follow(self.api.add_icosphere("/trail_now", 0.025 * self.scene.reach, _BLUE), poses)


def _clock_place(scene: MovingScene) -> Array:
    """On the floor and towards the camera, where nothing hides it."""
    low, high = scene.bounds
    place = 0.5 * (low + high) + 0.4 * np.linalg.norm((high - low)[:2]) * so3.normalised(_FROM * [1.0, 1.0, 0.0])
    place[2] = low[2] - 0.05 * scene.reach
    return place


def _draw_shape(api: Any, name: str, shape: Visual, scale: Array, colour: tuple[int, int, int] | None) -> Any:
    """Draw one visual, in its own colour or as a ghost in another; returns its handle."""
    red, green, blue, opacity = shape.colour
    opacity = opacity if colour is None else min(opacity, _GHOST_OPACITY)
    lengths = shape.dimensions
    look: dict[str, Any] = {
        "color": colour or tuple(round(255 * value) for value in (red, green, blue)),
        "opacity": None if opacity >= 1.0 else opacity,
        "cast_shadow": colour is None,
        "receive_shadow": colour is None,
        "position": shape.pose[:3, 3],
        "wxyz": _wxyz(shape.pose[:3, :3]),
        "scale": tuple(scale.tolist()),
    }
    if shape.kind == "box":
        return api.add_box(name, dimensions=lengths, **look)
    if shape.kind == "cylinder":
        return api.add_cylinder(name, radius=lengths[0], height=lengths[1], **look)
    if shape.kind == "sphere":
        return api.add_icosphere(name, lengths[0], **look)
    if shape.kind == "ellipsoid":
        look["scale"] = tuple((scale * lengths).tolist())
        return api.add_icosphere(name, 1.0, **look)
    vertices, faces = (shape.vertices, shape.faces) if shape.kind == "mesh" else _capsule(*lengths)
    return api.add_mesh_simple(name, vertices.astype(np.float32), faces.astype(np.uint32), side="double", **look)


def _capsule(radius: float, length: float) -> tuple[Array, Integers]:
    """Vertices and faces of a capsule along z: circles of latitude, each half moved out by half the cylinder."""
    rings, around = 8, 24
    height = np.concatenate([np.linspace(-0.5, 0.0, rings + 1), np.linspace(0.0, 0.5, rings + 1)]) * np.pi
    angle = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    level = radius * np.sin(height) + 0.5 * length * np.repeat([-1.0, 1.0], rings + 1)
    across = radius * np.cos(height)[:, None]
    vertices = np.stack(np.broadcast_arrays(across * np.cos(angle), across * np.sin(angle), level[:, None]), axis=-1)
    here = np.arange(around * (2 * rings + 1)).reshape(-1, around)
    there, above = np.roll(here, -1, axis=1), here + around
    diagonal = there + around
    triangles = [np.stack([here, there, diagonal], axis=-1), np.stack([here, diagonal, above], axis=-1)]
    return vertices.reshape(-1, 3), np.concatenate(triangles).reshape(-1, 3)


def _draw_triad(api: Any, length: float) -> None:
    """Draw the axes x, y, z of the base."""
    for letter, axis, colour in zip("xyz", np.eye(3), (_PURPLE, _GREEN, _BLUE)):
        _draw_arrow(api, f"/body/axis_{letter}", length * axis, _TRIAD_RADIUS, colour)
        api.add_label(f"/body/label_{letter}", letter, position=tuple(1.08 * length * axis), anchor="center-center")


def _draw_arrow(api: Any, name: str, tip: Array, thickness: float, colour: tuple[int, int, int]) -> None:
    """Draw an arrow from the origin of its parent; the radius of its shaft is `thickness` times its length."""
    length = float(np.linalg.norm(tip))
    radius = thickness * length
    head = _HEAD_LENGTH * radius
    turn = so3.between(np.array([0.0, 0.0, 1.0]), tip / length)
    api.add_frame(name, show_axes=False, wxyz=_wxyz(turn))
    shaft = length - head
    api.add_cylinder(f"{name}/shaft", radius=radius, height=shaft, color=colour, position=(0.0, 0.0, 0.5 * shaft))
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rim = _HEAD_RADIUS * radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(24)], axis=-1)
    vertices = np.concatenate([rim, [[0.0, 0.0, head], [0.0, 0.0, 0.0]]]).astype(np.float32)
    here, there = np.arange(24), np.roll(np.arange(24), -1)
    sides = np.stack([here, there, np.full(24, 24)], axis=-1)
    foot = np.stack([there, here, np.full(24, 25)], axis=-1)
    faces = np.concatenate([sides, foot]).astype(np.uint32)
    api.add_mesh_simple(f"{name}/head", vertices, faces, color=colour, flat_shading=True, position=(0.0, 0.0, shaft))


def _draw_floor(api: Any, scene: MovingScene) -> None:
    """Draw a grid below the lowest point of the motion, with cells of a round length."""
    low, high = scene.bounds
    reach = float(max(np.max(high - low), scene.reach))
    decade = 10.0 ** math.floor(math.log10(reach / 4.0))
    cell = max(step * decade for step in (1.0, 2.0, 5.0) if step * decade <= reach / 4.0)
    width = 2.0 * math.ceil(1.5 * reach / cell) * cell
    middle = 0.5 * (low + high)
    api.add_grid(
        "/floor",
        width=width,
        height=width,
        cell_size=cell,
        section_size=5.0 * cell,
        cell_color=_CELL,
        section_color=_SECTION,
        fade_distance=8.0 * reach,
        position=(float(middle[0]), float(middle[1]), float(low[2]) - 0.05 * scene.reach),
    )


def set_camera(server: Any, scene: MovingScene) -> None:
    """Place the camera as near as it sees all of the motion, the arrow and the clock, in a page 5 to 4 or wider."""
    points = np.concatenate([scene.corners.reshape(-1, 3), _clock_place(scene)[None]])
    magnitude = float(np.linalg.norm(scene.momentum))
    if magnitude:
        points = np.concatenate([points, scene.centre + 1.1 * _ARROW * scene.reach * scene.momentum / magnitude])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    back = so3.normalised(_FROM)
    right = so3.normalised(np.cross([0.0, 0.0, 1.0], back))
    across = np.abs((points - middle) @ np.stack([right / _ASPECT, np.cross(back, right)]).T).max(axis=-1)
    distance = _MARGIN * float(np.max((points - middle) @ back + across / math.tan(0.5 * _FIELD_OF_VIEW)))
    camera = server.initial_camera
    camera.fov = _FIELD_OF_VIEW
    camera.near, camera.far = 0.01 * distance, 100.0 * distance
    camera.look_at = middle
    camera.position = middle + distance * back


def _wxyz(matrix: Array) -> Array:
    """Quaternions w x y z, the order of viser: (..., 3, 3) -> (..., 4)."""
    return np.roll(so3.quat_from_matrix(matrix), 1, axis=-1)


def _safe(name: str) -> str:
    """A name that can be sent, without slashes, which would go one level down in the tree of the scene."""
    return printable(name).replace("/", "_")
