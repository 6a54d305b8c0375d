"""MJCF: the tree and the inertias of a MuJoCo model, read by rules of our own that the tests hold against MuJoCo.

Pinocchio's reader of MJCF is not used: it takes `axisangle`, extrinsic `eulerseq`, `inertiafromgeom="true"` and
`<frame>` for something else than MuJoCo does, and of several bodies in the world it silently keeps one.
The motor inertia of joints (`armature`) belongs to no link and is left out; `<worldbody>` itself has no mass.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ...arrays import Array
from ...errors import ModelFileError
from .._link_tree import LEAST_MASS, MOST_MASS, Joint, Link, LinkTree, from_the_root
from .mjcf_geometry import ORIENTATIONS, Orientation, joined_inertia, solid_of
from .xml_text import Node, child_of, name_of, needed_child, number, quoted, vector

_WRITE_OUT = (
    "let MuJoCo write the model out: m = mujoco.MjModel.from_xml_path(file); mujoco.mj_saveLastXML('plain.xml', m), "
    'with <compiler saveinertial="true"> in the file'
)
_HARMLESS = (
    *(
        "angle",
        "eulerseq",
        "autolimits",
        "inertiafromgeom",
        "strippath",
        "fitaabb",
        "meshdir",
        "texturedir",
        "assetdir",
    ),
    *("discardvisual", "usethread", "fusestatic", "saveinertial", "exactmeshinertia"),
)
# Settings of the compiler that change masses or axes, and the values with which they do not.
_NEUTRAL = {
    "boundmass": ("0",),
    "boundinertia": ("0",),
    "settotalmass": ("-1",),
    "balanceinertia": ("false",),
    "inertiagrouprange": ("0 5",),
    "alignfree": ("false",),
    "coordinate": ("local",),
}
# Attributes that are read of each element: one that is nearly spelt like them is taken for a slip and refused.
_FRAME_READ = ("name", "childclass", "pos", *ORIENTATIONS)
_BODY_READ = ("name", "childclass", "pos", "mocap", *ORIENTATIONS)
_JOINT_READ = ("name", "class", "type", "pos", "axis", "range", "limited", "ref")
_GEOM_READ = (
    "name",
    "class",
    "type",
    "size",
    "pos",
    "fromto",
    "mass",
    "density",
    "shellinertia",
    "mesh",
    *ORIENTATIONS,
)
_INERTIAL_READ = ("pos", "mass", "diaginertia", "fullinertia", *ORIENTATIONS)
_KINDS = {"hinge": "revolute", "slide": "prismatic"}
_PASSIVE = ("site", "camera", "light", "plugin")
_CONSTRAINING = ("equality", "tendon")


@dataclass(frozen=True)
class Placed:
    """An element of a body or the world, with the pose of the frames around it and the default class there."""

    node: Node
    place: Array
    turn: Array
    surrounding: str


@dataclass
class _Reading:
    """What holds for the whole file, and what has been found on the way through it."""

    orientation: Orientation
    autolimits: bool
    from_geoms: str
    classes: dict[str, dict[str, dict[str, str]]]
    links: dict[str, Link] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    frames: set[str] = field(default_factory=set)
    bodies: int = 0


def mjcf_tree(root: Node) -> LinkTree:
    """Check an MJCF from its root element.

    One body hangs in the world, by a free joint or none; hinges and slides anywhere below it. A joint without a name
    is named after its body, "arm_joint1", a body without one by its number, "body3".

    Raises
    ------
    ModelFileError
        If something that shapes the body is faulty, or cannot be read as MuJoCo reads it.
    """
    for node in root.walk():
        if node.tag == "include":
            raise node.fault("<include>", f"other files are not read; {_WRITE_OUT}")
    for tag in ("deformable", "compiler", "worldbody"):
        child_of(root, tag, "<mujoco>")
    for node in root.all("deformable"):
        raise node.fault("<deformable>", "soft bodies are no rigid links; remove them")
    reading = settings_of(root)
    world = needed_child(root, "worldbody", "<mujoco>")
    held = contents_of(reading, world, Placed(world, np.zeros(3), np.eye(3), "main"), "<worldbody>", ("body", "geom"))
    bodies = [each.node for each in held if each.node.tag == "body"]
    if not bodies:
        raise world.fault("<worldbody>", "there is no <body> in it; a free body needs one")
    if len(bodies) > 1:
        named = ", ".join(repr(quoted(node.get("name", "?"))) for node in bodies[:20])
        raise bodies[1].fault(
            f"body {quoted(bodies[1].get('name', '?'))!r}",
            f"{len(bodies)} bodies in the world, one is a free body: {named}; keep the one that floats",
        )
    _body(reading, next(each for each in held if each.node.tag == "body"), None)
    name = root.get("model") or "mujoco"
    from_the_root(reading.links, reading.joints.values(), root.file)
    joints = tuple(reading.joints.values())
    return LinkTree(name, reading.links, joints, frames=frozenset(reading.frames), notes=tuple(_notes(root)))


def settings_of(root: Node) -> _Reading:
    """What a file sets for all of its elements."""
    compiler = child_of(root, "compiler", "<mujoco>")
    if compiler is None:
        return _Reading(Orientation(True, "xyz"), True, "auto", _classes(root))
    owner = "<compiler>"
    for name, value in compiler.attributes.items():
        if name in _NEUTRAL:
            if " ".join(value.split()) not in _NEUTRAL[name]:
                raise compiler.fault(owner, f"{name}={quoted(value)!r} changes masses or axes; {_WRITE_OUT}")
        elif name not in _HARMLESS:
            raise compiler.fault(owner, f"unknown setting {quoted(name)!r}; valid are {', '.join(_HARMLESS)}")
    degrees = _choice(compiler, "angle", ("degree", "radian"), owner) == "degree"
    sequence = compiler.get("eulerseq") or "xyz"
    if len(sequence) != 3 or any(letter not in "xyzXYZ" for letter in sequence):
        raise compiler.fault(owner, f"eulerseq={quoted(sequence)!r}; three letters of xyz or XYZ are needed")
    limits = _choice(compiler, "autolimits", ("true", "false"), owner) == "true"
    from_geoms = _choice(compiler, "inertiafromgeom", ("auto", "true", "false"), owner)
    return _Reading(Orientation(degrees, sequence), limits, from_geoms, _classes(root))


def _choice(node: Node, name: str, valid: tuple[str, ...], owner: str) -> str:
    """The value of an attribute, by default the first of the valid ones."""
    value = node.get(name, valid[0]) or ""
    if value not in valid:
        raise node.fault(owner, f"<{node.tag}> {name}={quoted(value)!r}; valid are {', '.join(valid)}")
    return value


def _classes(root: Node) -> dict[str, dict[str, dict[str, str]]]:
    """Attributes of joints and geoms by default class, those of the classes around it included."""
    classes: dict[str, dict[str, dict[str, str]]] = {"main": {"joint": {}, "geom": {}}}
    tops = root.all("default")
    if len(tops) > 1:
        raise tops[1].fault("<default>", f"{len(tops)} of them; join them in one")
    waiting = [(top, "main", classes["main"]) for top in tops]
    while waiting:
        node, name, above = waiting.pop()
        own = {tag: dict(above[tag]) for tag in ("joint", "geom")}
        for tag, read in (("joint", _JOINT_READ), ("geom", _GEOM_READ)):
            element = child_of(node, tag, f"default class {name!r}")
            if element is not None:
                element.no_misspelt_attributes(read, f"default class {name!r}")
                own[tag] = _merged(own[tag], element.attributes)
        classes[name] = own
        for child in node.all("default"):
            below = name_of(child, "class")
            if below in classes or any(below == other for _, other, _ in waiting):
                raise child.fault(f"default class {below!r}", "two classes have this name; rename one")
            waiting.append((child, below, own))
    return classes


def _merged(above: Mapping[str, str], own: Mapping[str, str]) -> dict[str, str]:
    """Attributes over those of a class; a shorter `size` leaves the last sizes of the class, as in MuJoCo."""
    merged = {**above, **own}
    sizes = [each.get("size", "").split() for each in (above, own)]
    if "size" in own and len(sizes[0]) > len(sizes[1]):
        merged["size"] = " ".join(sizes[1] + sizes[0][len(sizes[1]) :])
    return merged


def with_defaults(reading: _Reading, node: Node, surrounding: str, owner: str) -> Node:
    """The element with the attributes of its default class."""
    name = node.get("class") or surrounding
    if name not in reading.classes:
        raise node.fault(owner, f"there is no default class {quoted(name)!r}; define it in <default>")
    return Node(
        node.tag, _merged(reading.classes[name][node.tag], node.attributes), node.file, node.line, node.children
    )


def contents_of(reading: _Reading, node: Node, here: Placed, owner: str, tags: tuple[str, ...]) -> list[Placed]:
    """What a body or the world holds, through the frames in it."""
    found = []
    for child in node.children:
        if child.tag == "frame":
            child.no_misspelt_attributes(_FRAME_READ, owner)
            place, turn = _pose(reading, child, owner)
            surrounding = child.get("childclass") or here.surrounding
            inside = Placed(child, here.place + here.turn @ place, here.turn @ turn, surrounding)
            found += contents_of(reading, child, inside, owner, ("body", "geom"))
        elif child.tag in tags:
            found.append(Placed(child, here.place, here.turn, here.surrounding))
        elif child.tag not in _PASSIVE:
            raise child.fault(owner, f"<{quoted(child.tag)}> is not supported in <{node.tag}>; {_WRITE_OUT}")
    return found


def _body(reading: _Reading, here: Placed, parent: str | None) -> None:
    """Read a body, its joints, and the bodies on it."""
    node = here.node
    reading.bodies += 1
    name = name_of(node) if node.get("name") else f"body{reading.bodies}"
    owner = f"body {name!r}"
    if name in reading.links or name == "world":
        raise node.fault(owner, "this name is taken; rename it")
    node.no_misspelt_attributes(_BODY_READ, owner)
    if node.get("mocap", "false") != "false":
        raise node.fault(owner, "a mocap body is moved from outside; remove it")
    surrounding = node.get("childclass") or here.surrounding
    own = Placed(node, np.zeros(3), np.eye(3), surrounding)
    held = contents_of(reading, node, own, owner, ("inertial", "joint", "freejoint", "geom", "body"))
    geoms = [each for each in held if each.node.tag == "geom"]
    reading.links[name] = _link(reading, node, name, geoms)
    # Where the body that floats is in the world is read, too: what is no pose is a fault.
    place, turn = _pose(reading, node, owner)
    if parent is None:
        _root_joint(reading, node, surrounding, owner)
    else:
        pose = here.place + here.turn @ place, here.turn @ turn
        _joints(reading, node, parent, name, pose, surrounding)
    for each in held:
        if each.node.tag == "body":
            _body(reading, each, name)


def _root_joint(reading: _Reading, node: Node, surrounding: str, owner: str) -> None:
    """The body that floats: a free joint or none."""
    for child in node.all("freejoint"):
        if child.get("align", "auto") == "true":
            raise child.fault(owner, 'align="true" turns the axes of the body; remove it')
    joints = [with_defaults(reading, child, surrounding, owner) for child in node.all("joint")]
    for joint in joints:
        if joint.get("type") != "free":
            raise joint.fault(
                owner,
                "a joint between the world and the body; a free body has none: replace it by <freejoint/>, or hang the "
                "body with its joints on a body of its own",
            )
    if len(joints) + len(node.all("freejoint")) > 1:
        raise node.fault(owner, "more than one free joint; keep one")


def _joints(reading: _Reading, node: Node, parent: str, body: str, pose: tuple[Array, Array], surrounding: str) -> None:
    """The joints of a body, one after the other, each about its own place in the body."""
    place, turn = pose
    where = f"{node.file}:{node.line}"
    for child in node.all("freejoint"):
        raise child.fault(f"body {body!r}", "a free joint inside the tree; only the body in the world may have one")
    moving = [_joint(reading, child, body, k, surrounding) for k, child in enumerate(node.all("joint"), 1)]
    none = np.zeros(3)
    if not moving:
        key = f"fixed of {body}\0"
        reading.joints[key] = Joint(key, where, "fixed", parent, body, place, turn, np.array([1.0, 0.0, 0.0]), none)
        return
    # Between two joints of a body lie axes that are no link.
    steps = [f"{body}\0{joint.name}" for joint in moving[:-1]]
    reading.frames.update(steps)
    reading.links.update({step: Link(step, where) for step in steps})
    ends = list(pairwise([parent, *steps, body]))
    for k, (joint, (before, after)) in enumerate(zip(moving, ends, strict=True)):
        start = place + turn @ joint.place if k == 0 else joint.place - moving[k - 1].place
        back = -joint.place if after == body else none
        if joint.name in reading.joints:
            raise ModelFileError(f"{joint.where}: joint {joint.name!r}: two joints have this name; rename one")
        reading.joints[joint.name] = Joint(
            *(joint.name, joint.where, joint.kind, before, after, start),
            turn if k == 0 else np.eye(3),
            *(joint.axis, back, joint.limits),
        )


def _joint(reading: _Reading, written: Node, body: str, count: int, surrounding: str) -> Joint:
    """A joint with its place and axis in the body's axes."""
    name = name_of(written) if written.get("name") else f"{body}_joint{count}"
    owner = f"joint {name!r}"
    written.no_misspelt_attributes(_JOINT_READ, owner)
    node = with_defaults(reading, written, surrounding, owner)
    kind = node.get("type") or "hinge"
    if kind not in _KINDS:
        way_out = {
            "ball": "use three hinges in a row",
            "free": "only the body in the world may have one",
        }.get(kind, "use hinge or slide")
        raise node.fault(owner, f"type {quoted(kind)!r} is not supported inside the tree; {way_out}")
    place = vector(node, "pos", owner) if node.get("pos") is not None else [0.0, 0.0, 0.0]
    axis = vector(node, "axis", owner) if node.get("axis") is not None else [0.0, 0.0, 1.0]
    if math.hypot(*axis) < 1e-9:
        raise node.fault(owner, f"the axis {axis} points nowhere; give it a length")
    if number(node, "ref", owner, default="0") != 0.0:
        raise node.fault(owner, "ref is not zero, so the coordinate does not start at the pose in the file; remove it")
    limits = _limits(reading, node, kind, owner)
    kind = "continuous" if kind == "hinge" and not math.isfinite(limits[0]) else _KINDS[kind]
    where, none = f"{node.file}:{node.line}", np.zeros(3)
    return Joint(name, where, kind, body, body, np.array(place), np.eye(3), np.array(axis), none, limits)


def _limits(reading: _Reading, node: Node, kind: str, owner: str) -> tuple[float, float]:
    limited = _choice(node, "limited", ("auto", "true", "false"), owner)
    written = node.get("range") is not None
    if limited == "auto" and written and not reading.autolimits:
        raise node.fault(owner, "range without limited, and autolimits is off; say limited true or false")
    lower, upper = vector(node, "range", owner, 2) if written else (0.0, 0.0)
    if limited == "false" or (limited == "auto" and not written):
        return -math.inf, math.inf
    if lower >= upper:
        raise node.fault(owner, f"range: the lower limit {lower:g} is not below the upper one, {upper:g}")
    unit = math.pi / 180.0 if kind == "hinge" and reading.orientation.degrees else 1.0
    return lower * unit, upper * unit


def _pose(reading: _Reading, node: Node, owner: str) -> tuple[Array, Array]:
    place = np.array(vector(node, "pos", owner)) if node.get("pos") is not None else np.zeros(3)
    return place, reading.orientation.matrix(node, owner)


def _link(reading: _Reading, node: Node, name: str, geoms: list[Placed]) -> Link:
    """The inertia of a body: as written, or of its geoms."""
    owner, where = f"body {name!r}", f"{node.file}:{node.line}"
    inertial = child_of(node, "inertial", owner)
    # MuJoCo keeps what is written where there is no geom to take its place.
    if inertial is not None and (reading.from_geoms != "true" or not geoms):
        return _written_link(reading, inertial, name, where, owner)
    if reading.from_geoms == "false":
        return Link(name, where)
    solids = []
    for geom in geoms:
        geom.node.no_misspelt_attributes(_GEOM_READ, owner)
        written = with_defaults(reading, geom.node, geom.surrounding, owner)
        solids.append(solid_of(written, reading.orientation, owner).moved(geom.place, geom.turn))
    heavy = [solid for solid in solids if solid.mass > 0.0]
    if inertial is not None and not heavy:
        raise inertial.fault(owner, 'geoms without mass, and inertiafromgeom="true" overrides <inertial>; use "auto"')
    return Link(name, where, *joined_inertia(heavy))


def _written_link(reading: _Reading, node: Node, name: str, where: str, owner: str) -> Link:
    node.no_misspelt_attributes(_INERTIAL_READ, owner)
    mass = number(node, "mass", owner, most=MOST_MASS)
    if mass < 0.0:
        raise node.fault(owner, f"negative mass {mass:g} kg; a mass is at least zero")
    if 0.0 < mass < LEAST_MASS:
        raise node.fault(owner, f"mass {mass:g} kg is too small to be summed; give {LEAST_MASS:g} kg or more, or 0")
    centre, turn = np.array(vector(node, "pos", owner)), reading.orientation.matrix(node, owner)
    given = [key for key in ("diaginertia", "fullinertia") if node.get(key) is not None]
    if len(given) != 1:
        raise node.fault(owner, "<inertial> needs one of diaginertia and fullinertia")
    if given == ["diaginertia"]:
        tensor = np.diag(vector(node, "diaginertia", owner, most=MOST_MASS))
    else:
        if any(node.get(key) is not None for key in ORIENTATIONS):
            raise node.fault(owner, "<inertial> has fullinertia and an orientation; give one of them")
        xx, yy, zz, xy, xz, yz = vector(node, "fullinertia", owner, 6, most=MOST_MASS)
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    tensor = turn @ tensor @ turn.T
    return Link(name, where, mass, centre, 0.5 * (tensor + tensor.T))


def _notes(root: Node) -> list[str]:
    """Constraints between joints, which a free body with given joints does not know."""
    return [
        f"{node.file}:{node.line}: <{tag}>: {len(node.children)} constraints ({_kinds(node)}) are ignored, every joint "
        "moves on its own"
        for tag in _CONSTRAINING
        for node in root.all(tag)
        if node.children
    ]


def _kinds(node: Node) -> str:
    return ", ".join(sorted({quoted(child.tag) for child in node.children}))
