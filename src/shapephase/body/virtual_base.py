"""Joints between a root without mass and the body that floats: they are coordinates of the base, not of its shape.

Files of planar walkers and converted robots move their base by hinges and slides from a link without mass. Taken for
the base, such a link would turn by whatever its joint does, and the body would not turn at all.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .. import so3
from ..arrays import Array
from ..errors import ModelFileError
from .couplings.ball_joints import coordinate_names
from .couplings.coupling import Coupling
from .link_tree import Joint, Link

ANYWHERE = "floating"  # joints that only a base has
IN_A_PLANE = "planar"
# MuJoCo's names of a planar joint's parts
_PARTS = (("_TX", "prismatic", 0), ("_TY", "prismatic", 1), ("_RZ", "revolute", 2))


class FreeBase(NamedTuple):
    """The link that floats.

    link : its name
    way : the joints from the root of the file to it, those that move nothing among them; none: it is the root
    joints : those of the body, parents before children
    notes : what was decided without an option
    """

    link: str
    way: tuple[Joint, ...]
    joints: tuple[Joint, ...]
    notes: tuple[str, ...]


def free_base(
    first: str,
    links: Mapping[str, Link],
    joints: Sequence[Joint],
    couplings: Mapping[str, Coupling],
    root: str | None,
) -> FreeBase:
    """The link that floats: the root, or the first with mass behind joints that follow each other from a massless one.

    first : the root
    joints : parents before children
    root : "free": a single joint, as arms that are bolted down have it, goes, too
    """
    below: dict[str, list[Joint]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    link, way = first, list[Joint]()
    fixed, moving = _rigid_part(link, below)
    while not _has_mass(links, (link, *(joint.child for joint in fixed))):
        # Frames that move and carry nothing, as those of cameras, do not hold the body.
        carrying = [joint for joint in moving if _has_mass(links, _below(joint.child, below))]
        if len(carrying) != 1:
            break
        way += [*_leading(fixed, link, carrying[0].parent), *carrying]
        link = carrying[0].child
        if carrying[0].kind == ANYWHERE:
            way = []
            break
        fixed, moving = _rigid_part(link, below)
    kept = _below(link, below)
    own = tuple(joint for joint in joints if joint.parent in kept)
    moved = [joint for joint in way if joint.kind != "fixed"]
    for joint in own:
        if joint.kind in (ANYWHERE, IN_A_PLANE):
            raise ModelFileError(_inside(joint))
    names = {joint.name for joint in moved}
    for name, rule in couplings.items():
        tied = names & {name, *rule.drivers}
        if tied:
            where = next(joint.where for joint in joints if joint.name == name)
            raise ModelFileError(
                f"{where}: joint {name!r} follows {' and '.join(rule.drivers)}; {min(tied)!r} moves the free base, "
                "whose coordinates lead and follow no others; remove the <mimic>"
            )
    fault, note = way_words([joint.name for joint in moved], first, link, root)
    if fault:
        raise ModelFileError(f"{moved[0].where}: joint {moved[0].name!r}: {fault}")
    notes = [f"{moved[0].where}: {note}"] if note else []
    fixed, moving = _rigid_part(link, below)
    carrying = [joint for joint in moving if _has_mass(links, _below(joint.child, below))]
    if len(carrying) > 1 and not _has_mass(links, (link, *(joint.child for joint in fixed))):
        listed = ", ".join(repr(joint.name) for joint in carrying)
        notes.append(
            f"{carrying[0].where}: joints {listed} move on {link!r}, which has no mass: it is the free base; what is "
            "bolted down there does not float"
        )
    return FreeBase(link, tuple(part for joint in way for part in _single_axes(joint)), own, tuple(notes))


def way_words(names: Sequence[str], above: str, link: str, root: str | None) -> tuple[str, str]:
    """Fault and note on the joints between a massless root and the link that floats; empty without any."""
    if not names or root is not None:
        return "", ""
    if len(names) == 1:
        return (
            f"the only joint between {above!r}, which has no mass, and {link!r}: what is bolted down does not float. "
            f'root="free" (--root free) removes it: {link!r} floats, and the joint\'s column is its recorded motion'
        ), ""
    listed = ", ".join(map(repr, names))
    return "", (
        f"joints {listed} between {above!r}, which has no mass, and {link!r} are the free base: in a motion, their "
        "columns are its recorded motion"
    )


def way_names(way: Sequence[Joint]) -> tuple[str, ...]:
    """The coordinates of the joints that lead to a base; of a ball joint there are four."""
    return tuple(name for joint in way if joint.kind != "fixed" for name in joint_coordinates(joint))


def joint_coordinates(joint: Joint) -> tuple[str, ...]:
    """The names of a joint's coordinates."""
    if joint.kind == "fixed":
        return ()
    return tuple(coordinate_names(joint.name)) if joint.kind == "ball" else (joint.name,)


def way_poses(way: Sequence[Joint], values: Mapping[str, Array], count: int) -> tuple[Array, Array]:
    """Attitude and place of a base in the axes of the file's root.

    values : (N,) by coordinate [rad or m]; one that is missing is zero
    count : N

    Returns (N, 3, 3), (N, 3) [m]
    """
    turned, placed = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
    for joint in way:
        placed, turned = placed + turned @ joint.place, turned @ joint.turn
        parts = [values.get(name, np.zeros(count)) for name in joint_coordinates(joint)]
        axis = joint.axis / np.linalg.norm(joint.axis)
        if joint.kind == "ball":
            numbers = np.stack(parts, axis=-1)
            turned = turned @ so3.matrix_from_quat(numbers / np.linalg.norm(numbers, axis=-1, keepdims=True))
        elif joint.kind == "prismatic":
            placed = placed + parts[0][:, None] * (turned @ axis)
        elif parts:
            turned = turned @ so3.exp(parts[0][:, None] * axis)
        placed = placed + turned @ joint.after
    return turned, placed


def _rigid_part(link: str, below: Mapping[str, list[Joint]]) -> tuple[list[Joint], list[Joint]]:
    """The fixed joints of all that is fixed to a link, and the joints that move on it."""
    fixed: list[Joint] = []
    moving: list[Joint] = []
    waiting = [link]
    while waiting:
        for joint in below.get(waiting.pop(0), ()):
            if joint.kind == "fixed":
                fixed.append(joint)
                waiting.append(joint.child)
            else:
                moving.append(joint)
    return fixed, moving


def _has_mass(links: Mapping[str, Link], names: Iterable[str]) -> bool:
    return any(links[name].mass for name in names)


def _leading(fixed: Sequence[Joint], link: str, to: str) -> list[Joint]:
    """The fixed joints on a link that lead to another."""
    above = {joint.child: joint for joint in fixed}
    way: list[Joint] = []
    while to != link:
        way.append(above[to])
        to = above[to].parent
    return way[::-1]


def _below(link: str, below: Mapping[str, list[Joint]]) -> set[str]:
    """A link and all that hang on it."""
    reached, waiting = {link}, [link]
    while waiting:
        children = [joint.child for joint in below.get(waiting.pop(), ())]
        reached.update(children)
        waiting += children
    return reached


def _single_axes(joint: Joint) -> tuple[Joint, ...]:
    """A planar joint as two slides and the hinge that they carry; any other as it is."""
    if joint.kind != IN_A_PLANE:
        return (joint,)
    axis = joint.axis / np.linalg.norm(joint.axis)
    turn = so3.between(np.array([0.0, 0.0, 1.0]), axis)
    first, last = (joint.place, joint.turn), joint.after
    still = np.zeros(3), np.eye(3)
    return tuple(
        Joint(
            joint.name + ending, joint.where, kind, joint.parent, joint.child,
            *(first if number == 0 else still), turn[:, number], last if number == 2 else np.zeros(3),
        )
        for ending, kind, number in _PARTS
    )  # fmt: skip


def _inside(joint: Joint) -> str:
    """The reason why a floating or planar joint cannot be inside a body."""
    why, instead = {
        ANYWHERE: (
            "it has the coordinates of a rigid motion, and only the base floats here",
            "three prismatic joints and a spherical one",
        ),
        IN_A_PLANE: ("its two slides turn with it", "two prismatic joints and a revolute one"),
    }[joint.kind]
    return (
        f"{joint.where}: joint {joint.name!r}: type {joint.kind!r} is not supported inside a body: {why}; use "
        f"{instead} in a row, or remove it and what it moves"
    )
