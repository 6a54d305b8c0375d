"""Motions as skeletons in motion: BVH, as programs of animation and motion capture read it."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_choice, check_file_name, check_keywords, positive_argument
from ..arrays import Array
from ..body.joint_chain import JointChain
from ..errors import ShapeError
from ..files import write_whole
from ..reconstruction.attitude_angles import euler_angles
from ..reconstruction.forced_motion import ForcedMotion
from ..reconstruction.reconstruction import Motion
from ._whole_motion import Fall, WholeMotion, check_ending, checked_times, whole_motion

# Places first, then angles about z, x and y, one after the other: all readers take this order.
_PLACES = "Xposition Yposition Zposition"
_TURNS = "Zrotation Xrotation Yrotation"
_ORDER = "ZXY"
# From inertial and base axes to those of a skeleton, whose y is up.
_UPWARD = {
    "x": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "y": np.eye(3),
    "z": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
}
_SHORTEST = 1e-3  # [m] from a joint to its link's centre of mass: some readers drop bones of no length
_MOST_FRAMES = 1_000_000


def write_bvh(
    motion: Motion | ForcedMotion,
    path: str | os.PathLike[str],
    *,
    rate: float = 120.0,
    up: str = "z",
    scale: float = 1.0,
    **fall: ArrayLike,
) -> None:
    """Write base and joints as a BVH file: a skeleton at zero coordinates, and angles of every bone in time.

    Bones are named as the joints that move them, the root as the body; a bone ends in the centre of mass of its link. A
    ball joint moves one bone. A joint that slides has places instead of an offset. Angles are in degrees.

    Parameters
    ----------
    motion : of an articulated body, in any gauge
    rate : frames in a second, the first at the motion's start
    up : the inertial axis "x", "y" or "z" that becomes the y of the file, which is up there
    scale : units of the file in a metre; 100 for centimetres
    fall : start, velocity, gravity as in `Motion.base_position`

    Raises
    ------
    ShapeError
        For more than a million frames.
    UnknownNameError
        For another axis.

    Examples
    --------
    >>> cat, loop = sp.load_body("cat_two_halves"), sp.examples.kane_scher(0.3, 0.5)
    >>> sp.exports.write_bvh(sp.reconstruct(sp.articulated(cat, loop), [0.0, 0.0, 0.005]), "turn.bvh", rate=60.0)
    >>> with open("turn.bvh") as file:
    ...     print([line.strip() for line in file if line.startswith(("Frames", "Frame Time"))])
    ['Frames: 61', 'Frame Time: 0.016666666666666666']
    """
    check_file_name(path, "path")
    check_keywords(fall, write_bvh)
    check_choice(up, "axis", tuple(_UPWARD))
    where, often = Path(path), positive_argument(rate, "rate", "a number of frames in a second")
    longer = positive_argument(scale, "scale", "a number of units in a metre")
    check_ending(where, "a BVH file", ".bvh")
    checked_times(motion, [0.0])
    frames = int(np.floor(motion.duration * often * (1.0 + np.finfo(float).eps))) + 1
    if frames > _MOST_FRAMES:
        raise ShapeError(f"rate: {frames} frames are more than {_MOST_FRAMES}; give fewer in a second")
    times = np.minimum(np.arange(frames) / often, motion.duration)
    whole = whole_motion(motion, times, Fall.of(**fall))
    chain, axes = whole.body.chain, _UPWARD[up]
    rest = _rest_orientations(chain)
    lines = ["HIERARCHY", *_skeleton(whole, rest, axes, longer), "MOTION", f"Frames: {frames}"]
    lines += [f"Frame Time: {1.0 / often!r}"]
    lines += [" ".join(map(repr, row)) for row in np.hstack(_channels(whole, rest, axes, longer)).tolist()]
    write_whole(where, lambda stream: stream.write(("\n".join(lines) + "\n").encode()))


def _rest_orientations(chain: JointChain) -> Array:
    """Orientations of all frames at zero coordinates, base axes: (k + 1, 3, 3)."""
    orientations = np.empty((len(chain.names) + 1, 3, 3))
    orientations[0] = np.eye(3)
    for joint, parent in enumerate(chain.parents):
        orientations[joint + 1] = orientations[parent] @ chain.turns[joint]
    return orientations


class _Bone(NamedTuple):
    """A bone and the joint that moves it: joints `first` to `last` of the chain, three for a ball joint."""

    name: str
    first: int
    last: int
    depth: int


def _bones(chain: JointChain) -> list[_Bone]:
    """Bones in the order of a skeleton: each before those that hang on it, and these before the next."""
    balls = {ball.row: ball for ball in chain.follows.balls}
    bones: list[_Bone] = []
    waiting = [(joint, 1) for joint, parent in enumerate(chain.parents) if parent == 0][::-1]
    while waiting:
        joint, depth = waiting.pop()
        ball = balls.get(joint)
        name, last = (chain.names[joint], joint) if ball is None else (ball.name, ball.rows.stop - 1)
        bones.append(_Bone(re.sub(r"\s", "_", name), joint, last, depth))
        waiting += [(below, depth + 1) for below, parent in enumerate(chain.parents) if parent == last + 1][::-1]
    return bones


def _skeleton(whole: WholeMotion, rest: Array, axes: Array, scale: float) -> list[str]:
    chain = whole.body.chain
    root = _Bone(re.sub(r"\s", "_", whole.body.name), -1, -1, 0)
    lines, previous = [], 0
    for bone in [root, *_bones(chain)]:
        lines += [f"{'  ' * depth}}}" for depth in range(previous, bone.depth - 1, -1) if bone.depth]
        pad, frame, slides = "  " * bone.depth, bone.last + 1, bool(bone.depth and chain.slides[bone.first].any())
        placed = slides or not bone.depth
        offset = np.zeros(3) if placed else rest[chain.parents[bone.first]] @ chain.places[bone.first]
        channels = f"CHANNELS 6 {_PLACES} {_TURNS}" if placed else f"CHANNELS 3 {_TURNS}"
        lines += [f"{pad}{'JOINT' if bone.depth else 'ROOT'} {bone.name}", f"{pad}{{"]
        lines += [f"{pad}  OFFSET {_numbers(scale * axes @ offset)}", f"{pad}  {channels}"]
        if frame not in chain.parents:
            tip = rest[frame] @ chain.centres[frame]
            tip = tip if np.linalg.norm(tip) > _SHORTEST else np.zeros(3)
            lines += [f"{pad}  End Site", f"{pad}  {{", f"{pad}    OFFSET {_numbers(scale * axes @ tip)}", f"{pad}  }}"]
        previous = bone.depth
    return [*lines, *(f"{'  ' * depth}}}" for depth in range(previous, -1, -1))]


def _channels(whole: WholeMotion, rest: Array, axes: Array, scale: float) -> list[Array]:
    """Columns of all bones in the order of the skeleton."""
    chain = whole.body.chain
    balls = {ball.row: ball.turns(whole.shapes) for ball in chain.follows.balls}
    columns = [scale * whole.position @ axes.T, _degrees(axes @ whole.attitude @ axes.T)]
    for bone in _bones(chain):
        joint = bone.first
        coordinate, parent = whole.joints[:, joint], rest[chain.parents[joint]]
        if chain.slides[joint].any():
            along = chain.places[joint] + coordinate[:, None] * (chain.turns[joint] @ chain.slides[joint])
            columns.append(scale * along @ (axes @ parent).T)
        about = axes @ rest[joint + 1]
        turned = so3.exp(coordinate[:, None] * (about @ chain.axes[joint]))
        columns.append(_degrees(about @ balls[joint] @ about.T if joint in balls else turned))
    return columns


def _degrees(rotations: Array) -> Array:
    return np.degrees(euler_angles(rotations, _ORDER))


def _numbers(vector: Array) -> str:
    return " ".join(map(repr, vector.tolist()))
