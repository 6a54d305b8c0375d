"""The orders in which simulators number the joints of a body's file: arrays without names are read by them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from ..arguments import check_object
from .body import Body
from .link_tree import Joint, JointOrder, LinkTree
from .virtual_base import joint_coordinates

MUJOCO = "mujoco"
ISAAC = "isaac"
ISAAC_BY_NAME = "isaac-by-name"
OWN = "body"
WORDS = (MUJOCO, ISAAC, ISAAC_BY_NAME, OWN)  # choices of callers
TITLES = {
    MUJOCO: "the order in which MuJoCo compiles the body's file",
    ISAAC: "breadth first, joints of one link as the file lists them",
    ISAAC_BY_NAME: "breadth first, joints of one link by their names",
    OWN: "the order of the body",
}


def joint_orders(tree: LinkTree, *, from_urdf: bool) -> tuple[JointOrder, ...]:
    """The orders of a file's joints in simulators, MuJoCo's first.

    MuJoCo compiles a URDF depth first, children in the order in which the file lists their joints; its own files, and
    those of programs that it does not read, are in their own order. Isaac Lab goes breadth first; links that are fixed
    to others are theirs, or bodies of their own.
    """
    below: dict[str, list[Joint]] = {}
    for joint in tree.joints:
        below.setdefault(joint.parent, []).append(joint)
    first = next(iter(tree.links))
    moved = tuple(joint.child for joint in tree.joints if joint.kind != "fixed" and joint.child not in tree.frames)
    orders = [JointOrder(MUJOCO, _coordinates(tree.joints), (first, *moved))]
    if from_urdf:
        orders = [_order(MUJOCO, first, _below(first, below, lambda _: True), merged=True)]
    for word, key in ((ISAAC, None), (ISAAC_BY_NAME, lambda joint: joint.name)):
        for merged in (True, False):
            orders.append(_order(word, first, _breadth_first(first, below, key, merged=merged), merged=merged))
    return tuple(orders)


def simulator_order(body: Body, word: str, otherwise: tuple[str, ...]) -> tuple[str, ...]:
    """All joints of a body in an order; of one without a file, whose joints have none but their own, what is given."""
    check_object(body, "Body", "body")
    return next((known.joints for known in body.joint_orders if known.word == word), otherwise)


def _order(word: str, first: str, joints: Sequence[Joint], *, merged: bool) -> JointOrder:
    links = (joint.child for joint in joints if joint.kind != "fixed" or not merged)
    return JointOrder(word, _coordinates(joints), (first, *links))


def _coordinates(joints: Iterable[Joint]) -> tuple[str, ...]:
    coordinates: list[str] = []
    for joint in joints:
        names = joint_coordinates(joint)
        # Simulators write w x y z.
        coordinates += names[-1:] + names[:-1] if joint.kind == "ball" else names
    return tuple(coordinates)


def _below(link: str, below: dict[str, list[Joint]], go_on: Callable[[Joint], bool]) -> list[Joint]:
    """The joints on a link, depth first; behind those that go on, the joints on what they move."""
    ordered: list[Joint] = []
    waiting = below.get(link, [])[::-1]
    while waiting:
        ordered.append(waiting.pop())
        if go_on(ordered[-1]):
            waiting += below.get(ordered[-1].child, [])[::-1]
    return ordered


def _breadth_first(
    first: str, below: dict[str, list[Joint]], key: Callable[[Joint], str] | None, *, merged: bool
) -> list[Joint]:
    """Level by level; where fixed links are merged, what moves on them is on the level of what they are fixed to."""
    ordered: list[Joint] = []
    level = [first]
    while level:
        after: list[str] = []
        for link in level:
            joints = _below(link, below, lambda joint: merged and joint.kind == "fixed")
            joints = [joint for joint in joints if joint.kind != "fixed" or not merged]
            if key is not None:
                joints.sort(key=key)
            ordered += joints
            after += [joint.child for joint in joints]
        level = after
    return ordered
