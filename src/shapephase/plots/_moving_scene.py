"""A motion as a scene in space: poses and scales of all the shapes to be drawn, frame by frame."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_keywords, check_object
from ..arrays import Array
from ..body.body import Body
from ..body.drawing.appearance import visuals
from ..body.drawing.limits import hull, outermost
from ..body.drawing.visual import BOX_COLOUR, Visual
from ..deformation.deformation import Deformation
from ..deformation.descriptions import ArticulatedDescription, Description, ParticleDescription
from ..deformation.frames import principal_frames
from ..deformation.rotors import RotorDescription
from ..display import short_repr
from ..errors import ShapeError, ShapePhaseError, unknown_name
from ..inertia_tensor import principal_axes, second_moment
from ..letters import value_text
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion

_MAX_FRAMES = 10_000  # five minutes at 30 a second: a larger page is too slow for a browser
_MIN_THICKNESS = 0.01  # of the longest edge: the inertia box of a flat body stays visible
_FEW_CORNERS = 64  # of boxes around the shapes of a node: with more, inner ones are left out
_PARTICLE_RADIUS = 0.06  # of the heaviest particle, over the largest distance from the centre of mass


@dataclass(frozen=True, eq=False)
class MovingNode:
    """Shapes that move as one.

    name : of the link, particle or inertia that carries them
    shapes : their poses are relative to the node
    poses : (F, 4, 4) of the node in base axes, one for each frame
    scales : (F, 3) by which the shapes are stretched along the axes of the node; None: they keep their size
    """

    name: str
    shapes: tuple[Visual, ...]
    poses: Array
    scales: Array | None = None

    __repr__ = short_repr


@dataclass(frozen=True, eq=False)
class MovingScene:
    """Moving shapes of a motion at F frames; lengths in m, in inertial axes unless stated otherwise.

    Made by `moving_scene`.

    Attributes
    ----------
    title : of the page
    times : (F,) of the frames, evenly from 0 to the end of the motion [s]
    base : (F, 4, 4) pose of the base axes
    nodes : attached to the base axes
    centre : (F, 3) centre of mass
    momentum : (3,) the angular momentum, under a torque that at the start [kg m^2/s]
    momenta : (F, 3) of the frames, under a torque; None: it stays
    trail : (F, 3) positions of the origin of a link; None: no trail
    body, shapes : whose links the nodes are, and its joints (F, n); None: particles or the locked inertia
    falls : whether gravity moves the centre of mass
    """

    title: str
    times: Array
    base: Array
    nodes: tuple[MovingNode, ...]
    centre: Array
    momentum: Array
    trail: Array | None
    body: Body | None = None
    shapes: Array | None = None
    falls: bool = False
    momenta: Array | None = None

    __repr__ = short_repr

    def world_pose(self, node: MovingNode) -> Array:
        """Pose of a node: (F, 4, 4)."""
        return self.base @ node.poses

    @property
    def largest_turn(self) -> float:
        """The largest angle by which anything turns from one frame to the next [rad]."""
        turns = [self.base, *(self.world_pose(node) for node in self.nodes)]
        steps = [so3.transpose(turn[:-1, :3, :3]) @ turn[1:, :3, :3] for turn in turns]
        return max(float(so3.angle(step).max()) for step in steps)

    @cached_property
    def reach(self) -> float:
        """The largest distance of anything drawn from the centre of mass of the same frame [m]."""
        return float(np.linalg.norm(self.corners - self.centre[:, None], axis=-1).max())

    @cached_property
    def bounds(self) -> Array:
        """Least and largest coordinates of the body over all frames: (2, 3)."""
        points = self.corners.reshape(-1, 3)
        return np.stack([points.min(axis=0), points.max(axis=0)])

    @cached_property
    def extent(self) -> Array:
        """The outermost of all corners over all frames, in directions all around: (K, 3)."""
        return outermost(self.corners.reshape(-1, 3))

    @cached_property
    def corners(self) -> Array:
        """Corners of boxes around all shapes of a node, the outermost of many: (F, K, 3)."""
        found = []
        for node in self.nodes:
            pose = self.world_pose(node)
            points = np.concatenate([s.corners @ s.pose[:3, :3].T + s.pose[:3, 3] for s in node.shapes])
            around = hull(points) if len(points) > _FEW_CORNERS else None
            points = points if around is None else around[0]
            stretched = points[None] if node.scales is None else points * node.scales[:, None]
            found.append(stretched @ so3.transpose(pose[:, :3, :3]) + pose[:, None, :3, 3])
        return np.concatenate(found, axis=1) if found else self.centre[:, None]


def moving_scene(
    motion: Motion | ForcedMotion, frames: int, *, trail: str | None = None, **fall: ArrayLike
) -> MovingScene:
    """The scene of a motion.

    An articulated body has the shapes of its links (`visuals`), whatever gauge the motion was reconstructed in. Point
    masses are balls. Other deformations are shown as the box of uniform density with the same locked inertia; if the
    mass is not known, the box measures one metre from corner to corner at the start.

    Parameters
    ----------
    frames : number of frames, evenly over the motion, 2 or more
    trail : a link whose origin leaves a trail
    fall : start, velocity, gravity of the centre of mass as in `Motion.base_position`

    Raises
    ------
    ShapeError
        If the motion is a batch, or `frames` is out of range.
    UnknownNameError
        If there is no such link.

    Warns
    -----
    VisualWarning
        For the shapes that `visuals` warns of.

    Examples
    --------
    >>> motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 4.0), [0.6, 0.9, 0.5])
    >>> scene = sp.plots.moving_scene(motion, 5)
    >>> scene.times.tolist()
    [0.0, 1.0, 2.0, 3.0, 4.0]
    """
    check_object(motion, "Motion", "motion", or_kind="ForcedMotion")
    check_keywords(fall, moving_scene)
    if motion.batch:
        raise ShapeError(f"one motion can be shown, this is a batch of {motion.batch}; reconstruct one of them")
    if isinstance(frames, bool) or not isinstance(frames, int | np.integer) or not 2 <= frames <= _MAX_FRAMES:
        raise ShapeError(f"frames: a whole number from 2 to {_MAX_FRAMES} is needed, got {value_text(frames)}")
    times = np.linspace(0.0, motion.duration, int(frames))
    description = _ungauged(motion.deformation)
    base = np.broadcast_to(np.eye(4), (len(times), 4, 4)).copy()
    base[:, :3, :3] = motion.attitude(times) @ motion.deformation.frame(times)
    base[:, :3, 3] = motion.base_position(times, **fall)
    in_base = description.centre_of_mass(times)
    centre = base[:, :3, 3] + so3.apply(base[:, :3, :3], in_base)
    body = shapes = points = None
    if isinstance(description, ArticulatedDescription | RotorDescription):
        wheels = isinstance(description, RotorDescription)
        body, path = (description.platform, description.route) if wheels else (description.body, description.path)
        shapes = path.curve(times)[0]
        nodes = _link_nodes(body, shapes)
        if trail is not None:
            points = (base @ body.link_pose(shapes, trail))[:, :3, 3]
    elif trail is not None:
        raise unknown_name(f"link of {motion.deformation.label}", trail, ())
    elif isinstance(description, ParticleDescription):
        nodes = _particle_nodes(description, times)
    else:
        nodes = (_inertia_node(motion.deformation, in_base, times),)
    momenta = motion.momentum(times) if isinstance(motion, ForcedMotion) else None
    return MovingScene(
        title=motion.deformation.label,
        times=times,
        base=base,
        nodes=nodes,
        centre=centre,
        momentum=motion.initial_momentum if isinstance(motion, ForcedMotion) else motion.momentum,
        momenta=momenta,
        trail=points,
        body=body,
        shapes=shapes,
        falls=bool(np.any(fall.get("gravity", 0.0))),
    )


def _ungauged(deformation: Deformation) -> Description:
    """The description before any gauge; the deformation's `frame` leads back to its axes."""
    description = deformation.description
    while hasattr(description, "original"):
        description = description.original  # pyright: ignore[reportAttributeAccessIssue]
    return description


def _link_nodes(body: Body, joints: Array) -> tuple[MovingNode, ...]:
    return tuple(
        MovingNode(name=link, shapes=shapes, poses=body.link_pose(joints, link))
        for link, shapes in shapes_by_link(visuals(body)).items()
    )


def shapes_by_link(shapes: Iterable[Visual]) -> dict[str, tuple[Visual, ...]]:
    """Shapes by the link that carries them, links in the order of their first shapes."""
    found: dict[str, list[Visual]] = {}
    for shape in shapes:
        found.setdefault(shape.link, []).append(shape)
    return {link: tuple(own) for link, own in found.items()}


def _particle_nodes(description: ParticleDescription, times: Array) -> tuple[MovingNode, ...]:
    points, _ = description.centred(times)
    largest = _PARTICLE_RADIUS * float(np.linalg.norm(points, axis=-1).max())
    radii = largest * np.cbrt(description.masses / description.masses.max())
    nodes = []
    for number, radius in enumerate(radii.tolist()):
        poses = np.broadcast_to(np.eye(4), (len(times), 4, 4)).copy()
        poses[:, :3, 3] = points[:, number]
        ball = Visual(
            link=f"particle {number + 1}", kind="sphere", dimensions=(radius,), pose=np.eye(4), colour=BOX_COLOUR
        )
        nodes.append(MovingNode(name=ball.link, shapes=(ball,), poses=poses))
    return tuple(nodes)


def _inertia_node(deformation: Deformation, in_base: Array, times: Array) -> MovingNode:
    """The box of the locked inertia, stretched frame by frame."""
    description = _ungauged(deformation)
    moment = second_moment(description.sample(times)[0])
    axes = _continuous_axes(replace(deformation, description=description, closure=None), moment, times)
    moments = np.maximum(np.einsum("nji,njk,nki->ni", axes, moment, axes), 0.0)
    # The second moment of a box along an edge a is m a^2/12; if the mass is unknown, the start sets the scale.
    mass = getattr(description, "mass", 12.0 * moments[0].sum())
    edges = np.sqrt(12.0 * moments / mass)
    poses = np.broadcast_to(np.eye(4), (len(times), 4, 4)).copy()
    poses[:, :3, :3], poses[:, :3, 3] = axes, in_base
    cube = Visual(link="locked inertia", kind="box", dimensions=(1.0, 1.0, 1.0), pose=np.eye(4), colour=BOX_COLOUR)
    thin = _MIN_THICKNESS * edges.max(axis=-1, keepdims=True)
    return MovingNode(name=cube.link, shapes=(cube,), poses=poses, scales=np.maximum(edges, thin))


def _continuous_axes(deformation: Deformation, moment: Array, times: Array) -> Array:
    """Continuous principal axes if there are any, else those of each frame, as columns: (F, 3, 3)."""
    try:
        return so3.transpose(principal_frames(deformation)(times)[0])
    except ShapePhaseError:
        return principal_axes(moment)[1]
