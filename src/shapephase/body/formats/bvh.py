"""A human from a BVH or MVNX file: its skeleton as links and ball joints, with the masses of a person's segments.

A bone with three channels of rotation is a rotation, whatever their order: many triples are the same one, and programs
write any of them. One or two channels are hinges.
"""

from __future__ import annotations

import numpy as np

from ...errors import ModelFileError
from ..link_tree import Joint, Link, LinkTree, from_the_root
from .bvh_text import Bone, BvhFaultError, Skeleton, bvh_skeleton, check_base, check_lengths
from .human_segments import Person, Segment, person_of
from .mvnx_text import read_suit, suit_skeleton

_MASS = 70.0  # [kg] a usual reference person
# Lengths of usual units [m]; the last is an inch by 0.45.
_LIKELY = {"m": 1.0, "cm": 0.01, "in": 0.0254, "of the motion capture library of Carnegie Mellon": 0.056444}
_HEIGHTS = (0.5, 2.5)  # [m] of people of any age; puppets and giants come from another unit
_WRONG_SIZE = ": is the unit of length another (--length-unit)?"
_AXES = dict(zip("xyz", np.eye(3), strict=True))


def bvh_tree(
    content: bytes, name: str, where: str, length_unit: float | None = None, person_mass: float | None = None
) -> LinkTree:
    """Links and joints of a skeleton, in the order of its file.

    The tree begins at the base; bones above it only move it.

    length_unit : length of a unit of the file [m]; needed
    person_mass : [kg]; None: 70 kg, with a note
    """
    try:
        skeleton = bvh_skeleton(content)
        if length_unit is None:
            raise BvhFaultError(_unit_question(person_of(skeleton, _MASS, 1.0).height), skeleton.bones[0].line)
        person = person_of(skeleton, _MASS if person_mass is None else person_mass, length_unit)
        check_base(skeleton, person.base)
        check_lengths(skeleton, person.moving[1:])
    except BvhFaultError as error:
        raise ModelFileError(f"{where}:{error.line}: {error}") from None
    return _tree(skeleton, person, name, where, length_unit, person_mass)


def mvnx_tree(content: bytes, name: str, where: str, person_mass: float | None = None) -> LinkTree:
    """Links and joints of the person in an inertial suit; a link's axes are those of its segment.

    person_mass : [kg]; None: 70 kg, with a note
    """
    try:
        skeleton = suit_skeleton(read_suit(content, motion=False))
        person = person_of(skeleton, _MASS if person_mass is None else person_mass, 1.0)
    except BvhFaultError as error:
        raise ModelFileError(f"{where}:{error.line}: {error}") from None
    return _tree(skeleton, person, name, where, 1.0, person_mass)


def _notes(skeleton: Skeleton, person: Person, where: str, person_mass: float | None) -> list[str]:
    notes = []
    if person_mass is None:
        notes.append(f"{where}:1: the person is taken to have {_MASS:g} kg; person_mass (--person-mass) states another")
    if person.frame is not None:
        low, high = _HEIGHTS
        notes.append(
            f"{where}:{skeleton.lines[person.frame]}: segments are laid out in this frame, at "
            f"{person.frame * skeleton.step:.4g} s, in which trunk and legs are straightest; the person is "
            f"{person.height:.2f} m tall{'' if low < person.height < high else _WRONG_SIZE}"
        )
    return notes


def _unit_question(height: float) -> str:
    tall = ", ".join(f"{unit:g} ({what}): {height * unit:.2f} m" for what, unit in _LIKELY.items())
    return (
        f"a BVH file has no unit of length: give length_unit (--length-unit), the metres of one. The skeleton measures "
        f"{height:.4g} units; with {tall}"
    )


def _tree(skeleton: Skeleton, person: Person, name: str, where: str, metre: float, mass: float | None) -> LinkTree:
    bones, links, joints, frames = skeleton.bones, {}, [], set[str]()
    notes = _notes(skeleton, person, where, mass)
    below = [number for number in range(len(bones)) if person.base in skeleton.above(number)]
    for number in below:
        bone, at = bones[number], f"{where}:{bones[number].line}"
        links[bone.name] = _link(bone.name, at, [segment for segment in person.segments if segment.bone == number])
        if number == person.base:
            continue
        assert bone.parent is not None
        parent, place, turn = bones[bone.parent].name, metre * bone.offset, np.eye(3)
        moves = _joints_of(bone)
        if number not in person.moving:
            # It stays as it is in the frame in which segments are laid out.
            turn = person.turns[bone.parent].T @ person.turns[number]
            moves = [(f"{bone.name}_fixed", "fixed", "x")]
        for order, (joint, kind, axis) in enumerate(moves, 1):
            child = bone.name if order == len(moves) else f"{bone.name}__{axis}"
            if child != bone.name:
                links[child] = Link(child, at)
                frames.add(child)
            joints.append(Joint(joint, at, kind, parent, child, place, turn, _AXES[axis]))
            parent, place = child, np.zeros(3)
    idle = [bones[number].name for number in below if number not in person.moving and bones[number].turns]
    if idle:
        notes.append(f"{where}:1: without mass, these bones do not move: {', '.join(idle)}")
    first, _ = from_the_root(links, joints, where)
    sorted_links = {first: links[first]} | {joint.child: links[joint.child] for joint in joints}
    return LinkTree(name, sorted_links, tuple(joints), frames=frozenset(frames), notes=tuple(notes), length_unit=metre)


def _joints_of(bone: Bone) -> list[tuple[str, str, str]]:
    """Name, kind and axis of the joints that move a bone."""
    if bone.is_ball:
        return [(bone.name, "ball", "x")]
    hinges = [(name, "revolute", axis) for name, (axis, _) in zip(bone.hinge_names, bone.turns, strict=True)]
    return hinges or [(f"{bone.name}_fixed", "fixed", "x")]


def _link(name: str, where: str, carried: list[Segment]) -> Link:
    """One link of all segments that a bone carries."""
    mass = sum(segment.mass for segment in carried)
    if not carried:
        return Link(name, where)
    centre = sum((segment.mass * segment.centre for segment in carried), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for segment in carried:
        apart = segment.centre - centre
        inertia += segment.inertia + segment.mass * (apart @ apart * np.eye(3) - np.outer(apart, apart))
    return Link(name, where, mass, centre, inertia)
