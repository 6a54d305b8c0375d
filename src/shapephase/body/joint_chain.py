"""A body's links and joints as plain numbers, for those who write its mechanics down in symbols."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from ..display import frozen
from ..inertia_tensor import SIX_OF_FULL
from ._model_tree import moving_joints
from .couplings.coordinate_map import CoordinateMap

_BASE = 1  # Pinocchio's number of the free-flyer: joint 0 is the universe
NUMBERS = 22
"""In the row of a frame: its turn at rest in the parent's axes (9, row by row), its place there (3) [m]; then of what
moves with it the mass [kg], the centre of mass (3) [m] and the inertia about that (xx yy zz yz xz xy) [kg m^2]."""
GEOMETRY = 12  # numbers that do not depend on masses; they come first
_PARALLEL = 1e-14  # sine between a screw's axis and its slide: all that rounding leaves


@frozen
class LinkRows:
    """Frame 0 is the base; joint k turns and slides frame k + 1 along its own z axis, by its coordinate q.

    parents : (k,) number of the frame that each hangs on
    turning : (k,) 1 where a joint turns by q, 0 where it only slides
    leads : (k,) by how much it slides, in units of q: 1, 0, or the lead of a screw [m/rad]
    rows : (k + 1, NUMBERS)
    mass : of all [kg]
    follows : as in `JointChain`
    bases : (k + 1, 3, 3) the axes of each frame in those that it has in the chain, in more digits
    """

    parents: Any
    turning: Array
    leads: Array
    rows: Array
    mass: float
    follows: CoordinateMap
    bases: Any

    def coordinates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """Coordinates and rates of all joints, followers included, contiguous: (N, n), (N, n) -> (N, k), (N, k)."""
        coordinates, speeds = self.follows.with_rates(shapes, rates)
        return np.ascontiguousarray(coordinates), np.ascontiguousarray(speeds)


@frozen
class JointChain:
    """Frame 0 is the base; frame k + 1 hangs on joint k, later in the list than its parent, with links fixed to it.

    The coordinate q_k of joint k moves frame k + 1 by a screw of constant axis: in the parent's axes its orientation is
    turns[k] rot(q_k axes[k]) and its origin places[k] + turns[k] slides[k] q_k. A ball joint is three of them, about x,
    y and z at zero, of which the first lies behind the turn that the shape gives (`turns_at`).

    Attributes
    ----------
    names : of the k joints, those that follow others included; of a ball joint those of its rates
    parents : (k,) number of the frame that each hangs on
    turns, places : (k, 3, 3), (k, 3) pose in the parent's axes at coordinate zero [m]
    axes : (k, 3) unit vector of a joint that turns, else zero
    slides : (k, 3) unit vector of one that slides, for a screw its lead along the axis [m/rad], else zero
    masses, centres, inertias : (k + 1,), (k + 1, 3), (k + 1, 3, 3) of what moves with each frame, in its axes; the
        inertia about the centre of mass [kg], [m], [kg m^2]
    follows : coordinates of all joints from the shape: where none follows others by a curve, matrix @ shape + offset
    link_frames : number of the frame that each link moves with, and its pose there, (4, 4)

    Examples
    --------
    >>> chain = sp.optimal_control.symbolic_body(sp.load_body("cat_two_halves")).chain
    >>> chain.names, float(np.sum(chain.masses))
    (('waist_pitch', 'waist_yaw', 'waist_roll'), 2.0)
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    turns: Array
    places: Array
    axes: Array
    slides: Array
    masses: Array
    centres: Array
    inertias: Array
    follows: CoordinateMap
    link_frames: Mapping[str, tuple[int, Array]]

    @property
    def matrix(self) -> Array:
        """(k, n) of the joints that depend on the shape by matrix @ shape + offset."""
        return self.follows.matrix

    @property
    def offset(self) -> Array:
        """Coordinates of the joints at the shape zero: (k,) [rad or m]."""
        return self.follows.offset

    @property
    def has_rows(self) -> bool:
        """True where compiled code supports all its joints; it has no ball joints."""
        return not self.follows.balls

    @cached_property
    def rows(self) -> LinkRows:
        """The chain as rows for compiled code, made when first needed; only where `has_rows`."""
        return link_rows(self)

    def turns_at(self, shapes: Array) -> Array:
        """`turns` at shapes, those of ball joints included: (N, n) -> (N or 1, k, 3, 3)."""
        if not self.follows.balls:
            return self.turns[None]
        turns = np.repeat(self.turns[None], len(shapes), axis=0)
        for ball in self.follows.balls:
            turns[:, ball.row] = turns[:, ball.row] @ ball.turns(shapes)
        return turns

    @cached_property
    def generations(self) -> tuple[tuple[Integers, Integers], ...]:
        """Joints as far from the base as each other, and the frames that they hang on: those near the base first."""
        depths, parents = np.zeros(len(self.names) + 1, dtype=np.int64), np.array(self.parents, dtype=np.int64)
        for joint, parent in enumerate(self.parents):
            depths[joint + 1] = depths[parent] + 1
        groups = (np.flatnonzero(depths[1:] == depth) for depth in range(1, int(depths.max()) + 1))
        return tuple((joints, parents[joints]) for joints in groups)

    @cached_property
    def hanging(self) -> Array:
        """(k, k + 1) one where a frame hangs on a joint, at whatever distance, else zero."""
        carried = np.zeros((len(self.names), len(self.names) + 1))
        for joint in range(len(self.names) - 1, -1, -1):
            carried[joint, joint + 1] = 1.0
            if self.parents[joint]:
                carried[self.parents[joint] - 1] += carried[joint]
        return carried

    def with_inertias(self, masses: Array, centres: Array, inertias: Array) -> JointChain:
        """The chain with other links; rows that were already made are carried over."""
        changed = replace(self, masses=masses, centres=centres, inertias=inertias)
        if "rows" in vars(self):
            rows = self.rows.rows.copy()
            rows[:, GEOMETRY:] = inertial_numbers(self.rows.bases, masses, centres, inertias)
            vars(changed)["rows"] = replace(self.rows, rows=rows, mass=float(masses.sum()))
        return changed


def joint_chain(model: Any, follows: CoordinateMap) -> JointChain:
    """The numbers of a Pinocchio model with a free-flyer, whose joints have one axis each or are ball joints."""
    inertias = model.inertias.tolist()
    # The last frame that moves with each joint of the model.
    frame_of = {_BASE: 0}
    parents, poses, screws, carried = [], [], [], [inertias[_BASE]]
    for number in moving_joints(model).values():
        joint, frame = model.joints[number], frame_of[int(model.parents[number])]
        data = joint.createData()
        neutral = np.zeros(model.nq)
        # A joint without end is kept as (cos, sin), a ball joint as a quaternion.
        neutral[joint.idx_q + {2: 0, 4: 3}.get(joint.nq, 0)] = float(joint.nq > 1)
        joint.calc(data, neutral)
        pose = (model.jointPlacements[number] * data.M).homogeneous
        for screw in np.array(data.S).reshape(6, joint.nv).T:
            parents.append(frame)
            poses.append(pose)
            screws.append(screw)
            carried.append(None)
            frame, pose = len(parents), np.eye(4)
        carried[frame], frame_of[number] = inertias[number], frame
    pose, screw = np.array(poses).reshape(-1, 4, 4), np.array(screws).reshape(-1, 6)
    return JointChain(
        follows.names,
        tuple(parents),
        pose[:, :3, :3],
        pose[:, :3, 3],
        screw[:, 3:],
        screw[:, :3],
        # Between the axes of a ball joint is nothing.
        np.array([inertia.mass if inertia else 0.0 for inertia in carried]),
        np.array([inertia.lever if inertia else np.zeros(3) for inertia in carried]),
        np.array([inertia.inertia if inertia else np.zeros((3, 3)) for inertia in carried]),
        follows,
        {
            frame.name: (frame_of[int(frame.parentJoint)], np.array(frame.placement.homogeneous))
            for frame in model.frames
            if frame.type.name == "BODY"
        },
    )


def link_rows(chain: JointChain) -> LinkRows:
    """The rows of a chain, with each of its frames turned about its origin so that z is the joint's axis."""
    count = len(chain.names)
    # Turned in more digits, so that only the results are rounded.
    bases = [np.eye(3, dtype=np.longdouble)]
    turning, leads = (chain.axes != 0.0).any(axis=1), np.zeros(count)
    rows = np.zeros((count + 1, NUMBERS))
    for joint, (axis, slide) in enumerate(zip(chain.axes, chain.slides, strict=True)):
        basis = _with_third_axis(axis if turning[joint] else slide)
        lead = slide @ basis
        if np.abs(lead[:2]).max() > _PARALLEL * np.abs(lead).max():
            raise ValueError(f"joint {chain.names[joint]} slides across its axis")
        leads[joint] = lead[2]
        parent = bases[chain.parents[joint]]
        rows[joint + 1, :9] = (parent.T @ chain.turns[joint] @ basis).ravel()
        rows[joint + 1, 9:12] = parent.T @ chain.places[joint]
        bases.append(basis)
    rows[0, [0, 4, 8]] = 1.0
    axes = np.array(bases)
    rows[:, GEOMETRY:] = inertial_numbers(axes, chain.masses, chain.centres, chain.inertias)
    return LinkRows(
        parents=np.array(chain.parents, dtype=np.uint32),
        turning=turning.astype(float),
        leads=leads,
        rows=rows,
        mass=float(chain.masses.sum()),
        follows=chain.follows,
        bases=axes,
    )


def inertial_numbers(bases: Any, masses: Array, centres: Array, inertias: Array) -> Array:
    """Entries of rows that depend on masses: (..., k + 1), (..., k + 1, 3), (..., k + 1, 3, 3) -> (..., k + 1, 10)."""
    back = np.swapaxes(bases, -1, -2)
    turned = (back @ inertias @ bases).reshape(*masses.shape, 9)[..., SIX_OF_FULL]
    return np.concatenate([masses[..., None], (back @ centres[..., None])[..., 0], turned], axis=-1).astype(float)


def _with_third_axis(axis: Array) -> Any:
    """A rotation whose third column is the direction of `axis`; exact where that is one of the axes: (3, 3)."""
    third = axis.astype(np.longdouble)
    third /= np.sqrt(third @ third)
    first = np.zeros(3, dtype=np.longdouble)
    # The axis after the nearest: for a coordinate axis the columns are coordinate axes too.
    first[(int(np.argmax(np.abs(third))) + 1) % 3] = 1.0
    first -= (first @ third) * third
    first /= np.sqrt(first @ first)
    return np.stack([first, np.cross(third, first), third], axis=1)
