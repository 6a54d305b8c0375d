"""A body's links and joints as plain numbers, for those who write its mechanics down in symbols."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from ..display import short_repr
from ._model_tree import moving_joints
from .couplings.coordinate_map import CoordinateMap
from .link_rows import LinkRows, link_rows, rows_with

# Pinocchio's number of the free-flyer: joint 0 is the universe.
_BASE = 1


@dataclass(frozen=True, eq=False)
class JointChain:
    """Frame 0 is the base; frame k + 1 hangs on joint k, later in the list than its parent, with links fixed to it.

    The coordinate q_k of joint k moves frame k + 1 by a screw of constant axis: in the parent's axes its orientation is
    turns[k] rot(q_k axes[k]) and its origin places[k] + turns[k] slides[k] q_k.

    Attributes
    ----------
    names : of the k joints, those that follow others included
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

    __repr__ = short_repr

    @property
    def matrix(self) -> Array:
        """(k, n) of the joints that depend on the shape by matrix @ shape + offset."""
        return self.follows.matrix

    @property
    def offset(self) -> Array:
        """(k,) [rad or m]."""
        return self.follows.offset

    @cached_property
    def rows(self) -> LinkRows:
        """The same for loops in machine code, made when first needed."""
        return link_rows(self)

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
        found = np.zeros((len(self.names), len(self.names) + 1))
        for joint in range(len(self.names) - 1, -1, -1):
            found[joint, joint + 1] = 1.0
            if self.parents[joint]:
                found[self.parents[joint] - 1] += found[joint]
        return found

    def with_inertias(self, masses: Array, centres: Array, inertias: Array) -> JointChain:
        """The same joints between other links; what is known of the joints' rows goes with them."""
        changed = replace(self, masses=masses, centres=centres, inertias=inertias)
        if "rows" in vars(self):
            vars(changed)["rows"] = rows_with(self.rows, masses, centres, inertias)
        return changed


def joint_chain(model: Any, follows: CoordinateMap) -> JointChain:
    """The numbers of a Pinocchio model with a free-flyer, whose joints have one axis each."""
    moving = moving_joints(model)
    names = tuple(moving)
    poses, screws = [], []
    for name in names:
        joint = model.joints[moving[name]]
        data = joint.createData()
        neutral = np.zeros(model.nq)
        # A joint without end is kept as (cos, sin).
        neutral[joint.idx_q] = float(joint.nq == 2)
        joint.calc(data, neutral)
        poses.append((model.jointPlacements[moving[name]] * data.M).homogeneous)
        screws.append(np.array(data.S).reshape(6))
    pose, screw = np.array(poses).reshape(-1, 4, 4), np.array(screws).reshape(-1, 6)
    carried = model.inertias.tolist()[_BASE:]
    return JointChain(
        names,
        tuple(int(model.parents[moving[name]]) - _BASE for name in names),
        pose[:, :3, :3],
        pose[:, :3, 3],
        screw[:, 3:],
        screw[:, :3],
        np.array([inertia.mass for inertia in carried]),
        np.array([inertia.lever for inertia in carried]),
        np.array([inertia.inertia for inertia in carried]),
        follows,
        {
            frame.name: (int(frame.parentJoint) - _BASE, np.array(frame.placement.homogeneous))
            for frame in model.frames
            if frame.type.name == "BODY"
        },
    )
