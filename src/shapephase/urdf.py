"""The text of a URDF file, read once and checked before Pinocchio sees it.

Pinocchio drops what it cannot read (a mass with a unit behind it, an inertia without all six entries, links that hang
on nothing) without a word. So every number is read here first, and Pinocchio gets a text written anew from what
was read: links with their inertia and joints, nothing else.
"""

from __future__ import annotations

import math
import os
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .arrays import Array
from .errors import InputFileNotFoundError, ModelFileError

Element = ElementTree.Element

_MAX_BYTES = 16 * 2**20
_MOST_LINKS, _MOST_JOINTS, _MOST_DEPTH = 2000, 300, 200
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_AXIS_JOINTS = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: angle = multiplier * (angle of `leader`) + offset."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class LinkInertia:
    """Mass [kg] and inertia about the centre of mass [kg m^2] as written for one link."""

    link: str
    mass: float
    inertia: Array


@dataclass(frozen=True)
class UrdfText:
    """A checked URDF: text for Pinocchio, the robot's name, the joints that follow others, the links' inertias."""

    text: str
    name: str
    mimics: dict[str, Mimic]
    inertias: tuple[LinkInertia, ...]


def read_urdf(path: str | os.PathLike[str]) -> UrdfText:
    """Read and check a URDF file.

    Raises
    ------
    InputFileNotFoundError
        If there is no readable file at `path`.
    ModelFileError
        If it is too large, no UTF-8, no XML, no URDF, needs xacro, or a link or joint is faulty.
    """
    where = Path(path)
    if "\0" in str(where):
        raise InputFileNotFoundError(f"{str(where)!r}: a path has no zero bytes")
    if not where.is_file():
        kind = "is a folder, not a file" if where.is_dir() else "there is no such file"
        raise InputFileNotFoundError(f"{where}: {kind}")
    if where.stat().st_size > _MAX_BYTES:
        raise ModelFileError(f"{where}: larger than {_MAX_BYTES >> 20} MiB, which no URDF is")
    try:
        text = where.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ModelFileError(f"{where}: not UTF-8 text, byte {error.start} cannot be read") from None
    except OSError as error:
        raise InputFileNotFoundError(f"{where}: cannot be read ({error.strerror})") from None
    return check_urdf(text, str(where))


def check_urdf(text: str, where: str) -> UrdfText:
    """Check the text of a URDF; `where` names it in messages. Raises as `read_urdf`."""
    if "<!DOCTYPE" in text:
        raise ModelFileError(f"{where}: a document type (DTD) is not allowed in a URDF; remove the <!DOCTYPE>")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ModelFileError(f"{where}: not well-formed XML: {error}") from None
    if root.tag != "robot":
        known = {"mujoco": "an MJCF model", "sdf": "an SDF model", "html": "an HTML page"}
        raise ModelFileError(f"{where}: expected <robot>, found <{root.tag}>: {known.get(root.tag, 'not a URDF')}")
    if _needs_xacro(root):
        raise ModelFileError(f"{where}: an unprocessed xacro file; run `xacro {where} > robot.urdf` first")
    name = root.get("name") or "robot"
    written = ElementTree.Element("robot", name=name)
    links, joints = _named(root, "link", where), _named(root, "joint", where)
    moving = sum(joint.get("type") != "fixed" for joint in joints.values())
    for count, most, kind in ((len(links), _MOST_LINKS, "links"), (moving, _MOST_JOINTS, "moving joints")):
        if count > most:
            raise ModelFileError(f"{where}: {count} {kind}; up to {most} are supported")
    inertias = [_write_link(written, key, link, where) for key, link in links.items()]
    for key, joint in joints.items():
        _write_joint(written, key, joint, where)
    _check_tree(links, joints, where)
    masses = tuple(inertia for inertia in inertias if inertia is not None)
    return UrdfText(ElementTree.tostring(written, encoding="unicode"), name, _mimics(joints, where), masses)


def _needs_xacro(root: Element) -> bool:
    """Whether macros or expressions are left; an unused xacro namespace on <robot> is harmless."""
    if any("wiki/xacro}" in element.tag for element in root.iter()):
        return True
    bodies = (element for kind in ("link", "joint") for top in root.findall(kind) for element in top.iter())
    return any("${" in value or "$(" in value for element in bodies for value in element.attrib.values())


def _named(root: Element, kind: str, where: str) -> dict[str, Element]:
    """The links or joints by name."""
    found: dict[str, Element] = {}
    for element in root.findall(kind):
        name = element.get("name")
        if not name:
            raise ModelFileError(f"{where}: a <{kind}> has no name")
        if name in found:
            raise ModelFileError(f"{where}: two <{kind}> elements are called {name!r}; rename one")
        found[name] = element
    if kind == "link" and not found:
        raise ModelFileError(f"{where}: the robot has no links")
    return found


def _write_link(written: Element, name: str, link: Element, where: str) -> LinkInertia | None:
    place = f"{where}: link {name!r}"
    out = ElementTree.SubElement(written, "link", name=name)
    inertials = link.findall("inertial")
    if len(inertials) > 1:
        raise ModelFileError(f"{place}: {len(inertials)} <inertial> elements, at most one is allowed")
    if not inertials:
        return None
    inertial = inertials[0]
    mass = _number(_child(inertial, "mass", place), "value", place)
    if mass < 0.0:
        raise ModelFileError(f"{place}: negative mass {mass:g} kg")
    inertia = _child(inertial, "inertia", place)
    values = {key: _number(inertia, key, place) for key in _INERTIA}
    out = ElementTree.SubElement(out, "inertial")
    _write_origin(out, inertial, place)
    ElementTree.SubElement(out, "mass", value=repr(mass))
    ElementTree.SubElement(out, "inertia", {key: repr(value) for key, value in values.items()})
    xx, xy, xz, yy, yz, zz = values.values()
    return LinkInertia(name, mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


def _write_joint(written: Element, name: str, joint: Element, where: str) -> None:
    place = f"{where}: joint {name!r}"
    kind = joint.get("type") or ""
    if kind not in (*_AXIS_JOINTS, "fixed"):
        raise ModelFileError(
            f"{place}: type {kind!r} is not supported; use {', '.join(_AXIS_JOINTS)} or fixed, several in a row for "
            "a joint of several axes"
        )
    out = ElementTree.SubElement(written, "joint", name=name, type=kind)
    _write_origin(out, joint, place)
    for end in ("parent", "child"):
        link = _child(joint, end, place).get("link")
        if not link:
            raise ModelFileError(f"{place}: <{end}> names no link")
        ElementTree.SubElement(out, end, link=link)
    if kind == "fixed":
        return
    axis = joint.find("axis")
    direction = [1.0, 0.0, 0.0] if axis is None else _vector(axis, "xyz", place)
    if math.hypot(*direction) < 1e-9:
        raise ModelFileError(f"{place}: the axis {direction} points nowhere")
    ElementTree.SubElement(out, "axis", xyz=" ".join(map(repr, direction)))
    if kind != "continuous":
        limit = joint.find("limit")
        if limit is None:
            raise ModelFileError(f"{place}: a {kind} joint needs <limit lower upper effort velocity>")
        lower, upper = (_number(limit, key, place, default="0") for key in ("lower", "upper"))
        if lower > upper:
            raise ModelFileError(f"{place}: the lower limit {lower:g} is above the upper one, {upper:g}")
        # Effort and velocity are for motors; Pinocchio insists on them, this library has no use for them.
        ElementTree.SubElement(out, "limit", lower=repr(lower), upper=repr(upper), effort="0", velocity="0")


def _write_origin(out: Element, source: Element, place: str) -> None:
    origin = source.find("origin")
    if origin is not None:
        parts = {key: _vector(origin, key, place) for key in ("xyz", "rpy") if origin.get(key) is not None}
        ElementTree.SubElement(out, "origin", {key: " ".join(map(repr, part)) for key, part in parts.items()})


def _check_tree(links: dict[str, Element], joints: dict[str, Element], where: str) -> None:
    """One root, one parent for every other link, every link reachable."""
    parent_joint: dict[str, str] = {}
    children: dict[str, list[str]] = {name: [] for name in links}
    for name, joint in joints.items():
        parent, child = (_child(joint, end, where).get("link", "") for end in ("parent", "child"))
        for end, link in (("parent", parent), ("child", child)):
            if link not in links:
                raise ModelFileError(f"{where}: joint {name!r}: its {end} link {link!r} does not exist")
        if child in parent_joint:
            raise ModelFileError(
                f"{where}: link {child!r} has two parents, joints {parent_joint[child]!r} and {name!r}"
            )
        parent_joint[child] = name
        children[parent].append(child)
    roots = [name for name in links if name not in parent_joint]
    if len(roots) > 1:
        raise ModelFileError(f"{where}: {len(roots)} links have no parent, one is allowed: {', '.join(roots)}")
    reached, waiting, depth = set(roots), list(roots), 0
    while waiting:
        depth += 1
        if depth > _MOST_DEPTH:
            raise ModelFileError(f"{where}: a chain of more than {_MOST_DEPTH} links, at {waiting[0]!r}")
        waiting = [child for parent in waiting for child in children[parent]]
        reached.update(waiting)
    lost = [name for name in links if name not in reached]
    if lost:
        raise ModelFileError(f"{where}: links that hang on each other in a circle: {', '.join(lost)}")


def _mimics(joints: dict[str, Element], where: str) -> dict[str, Mimic]:
    mimics: dict[str, Mimic] = {}
    for name, joint in joints.items():
        element = joint.find("mimic")
        if element is None or joint.get("type") == "fixed":
            continue
        place = f"{where}: joint {name!r}"
        leader = element.get("joint") or ""
        if leader not in joints:
            raise ModelFileError(f"{place}: mimics joint {leader!r}, which does not exist")
        multiplier = _number(element, "multiplier", place, default="1")
        mimics[name] = Mimic(leader, multiplier, _number(element, "offset", place, default="0"))
    for name in mimics:
        seen, follower = {name}, name
        while follower in mimics:
            follower = mimics[follower].leader
            if follower in seen:
                raise ModelFileError(f"{where}: joint {name!r}: mimic joints follow each other in a circle")
            seen.add(follower)
    return mimics


def _child(element: Element, tag: str, place: str) -> Element:
    found = element.find(tag)
    if found is None:
        raise ModelFileError(f"{place}: <{element.tag}> has no <{tag}>")
    return found


def _number(element: Element, name: str, place: str, default: str | None = None) -> float:
    return _numbers(element, name, element.get(name, default), 1, place)[0]


def _vector(element: Element, name: str, place: str) -> list[float]:
    return _numbers(element, name, element.get(name, ""), 3, place)


def _numbers(element: Element, name: str, text: str | None, count: int, place: str) -> list[float]:
    words = (text or "").split()
    values = [float(word) for word in words if _NUMBER.fullmatch(word)]
    if len(words) != count or len(values) != count or not all(map(math.isfinite, values)):
        wanted = "a finite number is" if count == 1 else f"{count} finite numbers are"
        raise ModelFileError(f"{place}: <{element.tag}> {name}={text!r}: {wanted} needed")
    return values
