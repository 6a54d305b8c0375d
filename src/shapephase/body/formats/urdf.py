"""URDF: every element checked before Pinocchio sees it.

Pinocchio silently drops what it cannot read: a mass with a unit behind it, an inertia without all six entries, links
that no joint connects to the rest. So every number is read here first, and Pinocchio gets a text written anew from what
was read: links with their inertia and joints, nothing else.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from xml.sax.saxutils import quoteattr

import numpy as np

from ...arrays import Array
from ...errors import ModelFileError
from ..couplings.coupling import Coupling, circular
from ..link_tree import LEAST_MASS, MOST_MASS, Joint, Link, LinkTree, from_the_root, grouped
from ..virtual_base import ANYWHERE, IN_A_PLANE, free_base
from .foreign import foreign_root
from .xml_text import Node, quoted

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_AXIS_JOINTS = ("revolute", "continuous", "prismatic")
_BALL = "spherical"
_SCREW, _THREAD = "screw", "drake:screw_thread_pitch"  # of Drake: metres along the axis a turn, in attribute `value`
WHOLE_TURN = 2.0 * math.pi * (1.0 + 1e-3)  # [rad] as rounded in a file; 10 degrees are beyond it
_WORLD = "world"  # an implicit link of Drake and Gazebo
_EXPRESSION = re.compile(r"\$[{(]")
_DRAKE_JOINT = "drake:joint"
_DRAKE_BALL = "ball"
_UNIVERSAL = "universal"  # of Drake: about x, then about the y that was turned (`UniversalJoint`)
_ROBOT_PARTS = ("link", "joint", _DRAKE_JOINT)
_LINK_PARTS = ("inertial", "visual", "collision")
_JOINT_PARTS = (
    "parent",
    "child",
    "origin",
    "axis",
    "limit",
    "mimic",
    "dynamics",
    "calibration",
    "safety_controller",
    _THREAD,
)
# Elements that move a body: in the wrong place they would be ignored, and the body be another.
_MOVING = (*_ROBOT_PARTS, "parent", "child", "axis", "limit", "mimic", "inertial", "mass", "inertia")
# Elements of other programs, without influence on how a free body turns.
_OF_OTHERS = {
    "robot": ("material", "transmission", "gazebo", "sensor", "ros2_control", "mujoco", "group", "disable_collisions"),
    "link": ("contact", "surface", "self_filter", "collision_checking", "gravity", "kinematic", "origin", "material"),
    "joint": ("hardwareInterface", "material"),
}
_NO_OFFSET = np.zeros(3)  # [m] of an <origin> without xyz


@dataclass
class _Reading:
    """Results collected on the way through the file."""

    text: dict[tuple[str, str], str] = field(default_factory=dict)  # by kind of element and name
    mimics: dict[str, tuple[Node, Coupling]] = field(default_factory=dict)
    notes: list[tuple[str, str, str, str]] = field(default_factory=list)  # as `grouped` takes them


def urdf_tree(root: Node, free: str | None = None) -> LinkTree:
    """Check a URDF from its root element.

    free : "free": a single joint between a root without mass and the rest goes, too
    """
    if root.tag != "robot":
        raise root.fault(f"expected <robot>: this is {foreign_root(root.tag)}")
    if (left := macro_of(root)) is not None:
        raise left.fault("a macro or an expression that xacro has left; define or remove it")
    name = root.name() if root.get("name") else "robot"
    reading = _Reading()
    root.own("<robot>")
    _check_parts(root, _ROBOT_PARTS, reading)
    frames = frozenset(map(partial(_split_universal, root), root.all(_DRAKE_JOINT))) - {""}
    links = {key: _link(key, node, reading) for key, node in _named(root, "link").items()}
    if not links:
        groups = "; an SRDF file names groups of joints only: load its URDF" if root.all("group") else ""
        raise root.fault(f"has no links; a body needs at least one <link>{groups}", f"robot {name!r}")
    joints = {key: _joint(key, node, reading) for key, node in _named(root, "joint", _DRAKE_JOINT).items()}
    if _WORLD not in links and any(joint.parent == _WORLD for joint in joints.values()):
        links[_WORLD] = _link(_WORLD, Node("link", {}, root.file, root.line), reading)
    first, ordered = from_the_root(links, joints.values(), root.file)
    _check_mimics(reading.mimics, joints)
    couplings = {key: rule for key, (_, rule) in reading.mimics.items()}
    if (key := circular(couplings)) is not None:
        raise _mimic_fault(reading.mimics[key][0], "mimic joints follow each other in a circle")
    base = free_base(first, links, ordered, couplings, free)
    kept = {base.link: links[base.link]} | {joint.child: links[joint.child] for joint in base.joints}
    # The parser of Pinocchio knows no ball joints and screws, and makes links of mere frames.
    text = None
    if not frames and all(joint.kind not in ("ball", _SCREW) for joint in base.joints):
        written = [("link", link) for link in kept] + [("joint", joint.name) for joint in base.joints]
        text = f"<robot name={quoteattr(name)}>{''.join(reading.text[key] for key in written)}</robot>"
    notes = (*grouped(reading.notes), *base.notes)
    return LinkTree(name, kept, base.joints, couplings, frames, notes, text, base_joints=base.way)


def rpy_matrix(rpy: Array) -> Array:
    """The rotation by fixed-axes angles: about x, then y, then z: (..., 3) -> (..., 3, 3)."""
    (cx, cy, cz), (sx, sy, sz) = np.moveaxis(np.cos(rpy), -1, 0), np.moveaxis(np.sin(rpy), -1, 0)
    rows = [
        [cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx],
        [sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx],
        [-sy, cy * sx, cy * cx],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def macro_of(root: Node) -> Node | None:
    """The first macro or expression of xacro: by its prefix, whatever the address, or by its address."""
    spaces = (name for name, address in root.attributes.items() if address.endswith("/xacro"))
    bound = (name.removeprefix("xmlns:") for name in spaces if name.startswith("xmlns:"))
    prefixes = tuple(f"{prefix}:" for prefix in ("xacro", *bound))
    for top in (root, *root.children):
        read = top is root or top.tag in _ROBOT_PARTS
        for node in [root] if top is root else top.walk():
            if node.tag.startswith(prefixes) or (read and any(map(_EXPRESSION.search, node.attributes.values()))):
                return node
    return None


def _check_parts(node: Node, known: Sequence[str], reading: _Reading) -> None:
    """Raise ModelFileError for an element that would be lost; note those of no known program."""
    node.check_children(known)
    others = _OF_OTHERS["joint" if node.tag == _DRAKE_JOINT else node.tag]
    for child in node.children:
        if child.tag in known or child.tag in others:
            continue
        if child.tag in _MOVING:
            raise child.fault(f"<{child.tag}> stands in <{node.tag}>, where nothing reads it; move it where it belongs")
        reading.notes.append((f"{child.file}:{child.line}", "element", f"<{quoted(child.tag)}>", "not read"))


def _split_universal(root: Node, node: Node) -> str:
    """Put two hinges and a link between them in the place of a universal joint; the link, or "" for other joints."""
    if node.get("type") != _UNIVERSAL:
        return ""
    name = node.name()
    node.own(f"joint {name!r}")
    ends = {end: node.needed_child(end).name("link") for end in ("parent", "child")}
    between = f"{ends['child']}__{name}"

    def part(tag: str, children: Sequence[Node] = (), **attributes: str) -> Node:
        return Node(tag, attributes, node.file, node.line, list(children))

    def hinge(letter: str, parent: str, child: str, axis: str, *more: Node) -> Node:
        parts = (part("parent", link=parent), part("child", link=child), part("axis", xyz=axis), *more)
        return part("joint", parts, name=f"{name}_q{letter}", type="continuous")

    first = hinge("x", ends["parent"], between, "1 0 0", *node.all("origin"))
    place, second = root.children.index(node), hinge("y", between, ends["child"], "0 1 0")
    root.children[place : place + 1] = [part("link", name=between), first, second]
    return between


def _named(root: Node, *tags: str) -> dict[str, Node]:
    """The links or joints by name."""
    named: dict[str, Node] = {}
    for node in root.children:
        if node.tag not in tags:
            continue
        name = node.name()
        node.own(f"{tags[0]} {name!r}")
        if name in named:
            line = named[name].line
            raise node.fault(f"two <{node.tag}> elements have this name, the first in line {line}; rename one")
        named[name] = node
    return named


def _link(name: str, node: Node, reading: _Reading) -> Link:
    where = f"{node.file}:{node.line}"
    _check_parts(node, _LINK_PARTS, reading)
    inertial = node.child("inertial")
    if inertial is None:
        reading.text["link", name] = f"<link name={quoteattr(name)}/>"
        return Link(name, where)
    for part in inertial.children:
        if part.tag not in ("origin", "mass", "inertia"):
            raise part.fault(f"<inertial> holds <origin>, <mass> and <inertia>, not <{quoted(part.tag)}>; move it out")
    written = inertial.needed_child("mass")
    written.check_attributes("value")
    mass = written.number("value", most=MOST_MASS)
    if mass < 0.0:
        raise written.fault(f"negative mass {mass:g} kg; a mass is at least zero: correct it")
    if 0.0 < mass < LEAST_MASS:
        raise written.fault(f"mass {mass:g} kg is too small to be summed; give {LEAST_MASS:g} kg or more, or 0")
    written = inertial.needed_child("inertia")
    written.check_attributes(*_INERTIA)
    xx, xy, xz, yy, yz, zz = values = [written.number(key, most=MOST_MASS) for key in _INERTIA]
    place, turn, origin = _origin(inertial, reading)
    entries = " ".join(f'{key}="{value!r}"' for key, value in zip(_INERTIA, values, strict=True))
    reading.text["link", name] = (
        f'<link name={quoteattr(name)}><inertial>{origin}<mass value="{mass!r}"/><inertia {entries}/></inertial></link>'
    )
    inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    return Link(name, where, mass, place, 0.5 * (inertia + inertia.T))


def _joint(name: str, node: Node, reading: _Reading) -> Joint:
    _check_parts(node, _JOINT_PARTS, reading)
    kind = node.get("type") or ""
    kind = _BALL if kind == _DRAKE_BALL else kind
    if kind not in (*_AXIS_JOINTS, _BALL, _SCREW, "fixed", ANYWHERE, IN_A_PLANE):
        raise node.fault(
            f"type {quoted(kind)!r} is not supported; use {', '.join(_AXIS_JOINTS)}, {_BALL}, {_SCREW} "
            "or fixed, several in a row for a joint of several axes",
        )
    ends = {end: node.needed_child(end) for end in ("parent", "child")}
    for end in ends.values():
        end.check_attributes("link")
    parent, child = (end.name("link") for end in ends.values())
    place, turn, parts = _origin(node, reading)
    parts += f"<parent link={quoteattr(parent)}/><child link={quoteattr(child)}/>"
    axis, limits = [1.0, 0.0, 0.0], (-math.inf, math.inf)
    if kind in (*_AXIS_JOINTS, _SCREW, IN_A_PLANE):
        written = node.child("axis")
        if written is not None:
            written.check_attributes("xyz")
            axis = written.vector("xyz")
            if math.hypot(*axis) < 1e-9:
                raise written.fault(f"the axis {axis} points nowhere; give it a length")
        parts += f'<axis xyz="{_text(axis)}"/>'
    lead = 0.0
    if kind == _SCREW:
        lead = node.needed_child(_THREAD).number("value") / (2.0 * math.pi)
    fastest = effort = 0.0
    if kind != "fixed" and (limit := node.child("limit")) is not None:
        fastest = abs(limit.number("velocity", default="0", most=math.inf))
        effort = _effort(limit)
        for key in ("velocity", "effort"):
            if (limit.get(key) or "").strip().startswith("-"):
                text = f"the {key} limit is negative, read as its size; write it without the sign"
                reading.notes.append((f"{limit.file}:{limit.line}", "joint", repr(name), text))
    if kind in ("revolute", "prismatic"):
        limits = _limits(node, kind)
        parts += f'<limit lower="{limits[0]!r}" upper="{limits[1]!r}" effort="{effort!r}" velocity="{fastest!r}"/>'
    elif kind == "continuous" and (fastest or effort):
        parts += f'<limit effort="{effort!r}" velocity="{fastest!r}"/>'
    reading.text["joint", name] = f'<joint name={quoteattr(name)} type="{kind}">{parts}</joint>'
    _mimic(name, kind, node, reading)
    where = f"{node.file}:{node.line}"
    if kind == _BALL and node.child("limit") is not None:
        reading.notes.append((where, "joint", repr(name), "<limit> of a ball joint is ignored"))
    kind = "ball" if kind == _BALL else kind
    return Joint(
        name, where, kind, parent, child, place, turn, np.array(axis), _NO_OFFSET, limits, (effort, fastest), lead
    )


def _effort(limit: Node) -> float:
    """The effort of a joint's motor [N m or N]; zero where nothing is stated that is a finite number."""
    try:
        stated = abs(float(limit.get("effort") or 0.0))
    except ValueError:
        return 0.0
    return stated if stated < math.inf else 0.0


def _limits(node: Node, kind: str) -> tuple[float, float]:
    limit = node.child("limit")
    if limit is None:
        raise node.fault(f"a {kind} joint needs <limit lower upper effort velocity>; add it")
    lower, upper = (limit.number(key, default="0", most=math.inf) for key in ("lower", "upper"))
    if lower > upper:
        raise limit.fault(f"the lower limit {lower:g} is above the upper one, {upper:g}; exchange them")
    return lower, upper


def _origin(node: Node, reading: _Reading) -> tuple[Array, Array, str]:
    """Place, rotation and the element written anew."""
    origin = node.child("origin")
    if origin is None:
        return _NO_OFFSET, np.eye(3), ""
    origin.check_attributes("xyz", "rpy")
    parts = {key: origin.vector(key) for key in ("xyz", "rpy") if origin.get(key) is not None}
    written = " ".join(f'{key}="{_text(values)}"' for key, values in parts.items())
    rpy = parts.get("rpy")
    if rpy is not None and max(map(abs, rpy)) > WHOLE_TURN:
        kind, _, name = node.owner.partition(" ")
        radians = _brief(np.radians(rpy).tolist())
        text = f'rpy="{_brief(rpy)}" goes beyond a whole turn; is it in degrees? Give radians: rpy="{radians}"'
        reading.notes.append((f"{origin.file}:{origin.line}", kind, name, text))
    turn = np.eye(3) if rpy is None or not any(rpy) else rpy_matrix(np.array(rpy))
    return np.array(parts.get("xyz", _NO_OFFSET)), turn, f"<origin {written}/>"


def _brief(values: Iterable[float]) -> str:
    return " ".join(f"{value:.6g}" for value in values)


def _text(values: list[float]) -> str:
    return " ".join(map(repr, values))


def _mimic(name: str, kind: str, node: Node, reading: _Reading) -> None:
    element = node.child("mimic")
    if element is None:
        return
    if kind == "fixed":
        where = f"{element.file}:{element.line}"
        reading.notes.append((where, "joint", repr(name), "<mimic> of a fixed joint is ignored"))
        return
    if kind not in _AXIS_JOINTS:
        raise element.fault(f"a {kind} joint follows no other: it has no single number; remove the <mimic>")
    element.check_attributes("joint", "multiplier", "offset")
    multiplier, offset = (element.number(k, default=d) for k, d in (("multiplier", "1"), ("offset", "0")))
    reading.mimics[name] = (element, Coupling.linear(element.name("joint"), multiplier, offset))


def _check_mimics(mimics: dict[str, tuple[Node, Coupling]], joints: dict[str, Joint]) -> None:
    """Raise ModelFileError unless every leader exists and is of the follower's kind."""
    for name, (element, rule) in mimics.items():
        (driver,) = rule.drivers
        leader = joints.get(driver)
        if leader is None:
            raise _mimic_fault(element, f"mimics joint {driver!r}, which does not exist")
        kinds = joints[name].kind, leader.kind
        if kinds[1] in ("fixed", "ball") or (kinds[0] == "prismatic") != (kinds[1] == "prismatic"):
            raise _mimic_fault(element, f"is {kinds[0]} and mimics joint {driver!r}, which is {kinds[1]}")


def _mimic_fault(element: Node, message: str) -> ModelFileError:
    return element.fault(f"{message}; remove the <mimic> or name another joint")
