"""A human from a BVH file: its skeleton as links and hinges, with the masses of a person's segments."""

from __future__ import annotations

import numpy as np

from ...errors import ModelFileError
from .._link_tree import Joint, Link, LinkTree, from_the_root
from .bvh_text import Bone, BvhFaultError, Skeleton, axis_of, bvh_skeleton
from .human_segments import Segment, height_of, segments_of

_MASS = 70.0
"""[kg] of a person of whom nobody has said it: a usual one of reference persons."""
_LIKELY = {"m": 1.0, "cm": 0.01, "in": 0.0254, "of the motion capture library of Carnegie Mellon": 0.056444}
"""Lengths of units [m] that are met; the last is an inch by 0.45."""
_AXES = dict(zip("xyz", np.eye(3), strict=True))


def bvh_tree(
    content: bytes, name: str, where: str, length_unit: float | None = None, person_mass: float | None = None
) -> LinkTree:
    """Links and hinges of a skeleton, in the order of its file.

    length_unit : length of a unit of the file [m]; needed
    person_mass : [kg]; None: 70 kg, with a note

    Raises
    ------
    ModelFileError
        For faults of the file, for bones that are not known by their names, without `length_unit`.
    """
    try:
        skeleton = bvh_skeleton(content)
        if length_unit is None:
            raise BvhFaultError(_unit_question(skeleton), skeleton.bones[0].line)
        segments = segments_of(skeleton, _MASS if person_mass is None else person_mass, length_unit)
    except BvhFaultError as error:
        raise ModelFileError(f"{where}:{error.line}: {error}") from None
    notes = []
    if person_mass is None:
        notes.append(f"{where}:1: the person is taken to have {_MASS:g} kg; person_mass (--person-mass) says another")
    return _tree(skeleton, segments, name, where, length_unit, notes)


def _unit_question(skeleton: Skeleton) -> str:
    height = height_of(skeleton)
    tall = ", ".join(f"{unit:g} ({what}): {height * unit:.2f} m" for what, unit in _LIKELY.items())
    return (
        f"a BVH file has no unit of length: give length_unit (--length-unit), the metres of one. The skeleton measures "
        f"{height:.4g} units; with {tall}"
    )


def _tree(
    skeleton: Skeleton, segments: list[Segment], name: str, where: str, metre: float, notes: list[str]
) -> LinkTree:
    bones = skeleton.bones
    moves = {bone for segment in segments for bone in skeleton.above(segment.bone)}
    links: dict[str, Link] = {}
    joints: list[Joint] = []
    frames: set[str] = set()
    for number, bone in enumerate(bones):
        at = f"{where}:{bone.line}"
        links[bone.name] = _link(bone.name, at, [segment for segment in segments if segment.bone == number])
        if bone.parent is None:
            continue
        parent, place = bones[bone.parent].name, metre * bone.offset
        channels = bone.turns if number in moves else ()
        for order, channel in enumerate(channels or ("fixed",)):
            last = order >= len(channels) - 1
            child = bone.name if last else f"{bone.name}__{channel}"
            if not last:
                links[child] = Link(child, at)
                frames.add(child)
            joints.append(
                Joint(
                    name=f"{bone.name}_{channel}",
                    where=at,
                    kind="revolute" if channels else "fixed",
                    parent=parent,
                    child=child,
                    place=place,
                    turn=np.eye(3),
                    axis=_AXES[axis_of(channel) if channels else "x"],
                    after=np.zeros(3),
                )
            )
            parent, place = child, np.zeros(3)
    idle = [bone.name for number, bone in enumerate(bones) if number not in moves and bone.turns]
    if idle:
        notes.append(f"{where}:1: without mass, these bones do not move: {', '.join(idle)}")
    first, _ = from_the_root(links, joints, where)
    sorted_links = {first: links[first]} | {joint.child: links[joint.child] for joint in joints}
    root = bones[0]
    places = tuple(f"{root.name}_{axis}position" for axis in "XYZ")
    return LinkTree(
        name,
        sorted_links,
        tuple(joints),
        frames=frozenset(frames),
        notes=tuple(notes),
        base_angles=(tuple(f"{root.name}_{turn}" for turn in root.turns), "".join(map(axis_of, root.turns))),
        base_slides=places if len(root.channels) > len(root.turns) else None,
        length_unit=metre,
    )


def _link(name: str, where: str, carried: list[Segment]) -> Link:
    """What a bone carries, in one."""
    mass = sum(segment.mass for segment in carried)
    if not carried:
        return Link(name, where)
    centre = sum((segment.mass * segment.centre for segment in carried), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for segment in carried:
        apart = segment.centre - centre
        inertia += segment.inertia + segment.mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    return Link(name, where, mass, centre, inertia)


def column_names(bone: Bone) -> tuple[str, ...]:
    """Of its channels: those that turn it are its joints."""
    return tuple(f"{bone.name}_{channel}" for channel in bone.channels)
