"""The text of a URDF file, read once and checked before Pinocchio sees it."""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path

from .errors import InputFileNotFoundError, ModelFileError

_MAX_BYTES = 16 * 2**20


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: angle = multiplier * (angle of `leader`) + offset."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class UrdfText:
    """A checked URDF: its text, the robot's name and the joints that follow others."""

    text: str
    name: str
    mimics: dict[str, Mimic]


def read_urdf(path: str | os.PathLike[str]) -> UrdfText:
    """Read and check a URDF file.

    Raises
    ------
    InputFileNotFoundError
        If there is no readable file at `path`.
    ModelFileError
        If it is too large, no UTF-8, no XML, no URDF, needs xacro, or a mass, inertia or mimic joint is faulty.
    """
    where = Path(path)
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
    for link in root.findall("link"):
        _check_inertial(link, where)
    return UrdfText(text, root.get("name") or "robot", _mimics(root, where))


def _needs_xacro(root: ElementTree.Element) -> bool:
    """Whether macros or expressions are left; an unused xacro namespace on <robot> is harmless."""
    if any("wiki/xacro}" in element.tag for element in root.iter()):
        return True
    bodies = (element for kind in ("link", "joint") for top in root.findall(kind) for element in top.iter())
    return any("${" in value or "$(" in value for element in bodies for value in element.attrib.values())


def _check_inertial(link: ElementTree.Element, where: str) -> None:
    place = f"{where}: link {link.get('name')!r}"
    inertials = link.findall("inertial")
    if len(inertials) > 1:
        raise ModelFileError(f"{place}: {len(inertials)} <inertial> elements, at most one is allowed")
    for inertial in inertials:
        mass = inertial.find("mass")
        if mass is None:
            raise ModelFileError(f"{place}: <inertial> has no <mass>")
        if _number(mass, "value", place) < 0.0:
            raise ModelFileError(f"{place}: negative mass {mass.get('value')}")
        inertia = inertial.find("inertia")
        if inertia is None:
            raise ModelFileError(f"{place}: <inertial> has no <inertia>")
        for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"):
            _number(inertia, name, place)


def _mimics(root: ElementTree.Element, where: str) -> dict[str, Mimic]:
    names = {joint.get("name") for joint in root.findall("joint")}
    mimics = {}
    for joint in root.findall("joint"):
        element = joint.find("mimic")
        if element is None or joint.get("type") == "fixed":
            continue
        place = f"{where}: joint {joint.get('name')!r}"
        leader = element.get("joint") or ""
        if leader not in names:
            raise ModelFileError(f"{place}: mimics joint {leader!r}, which does not exist")
        multiplier = _number(element, "multiplier", place, default="1")
        mimics[joint.get("name") or ""] = Mimic(leader, multiplier, _number(element, "offset", place, default="0"))
    for name in mimics:
        seen, follower = {name}, name
        while follower in mimics:
            follower = mimics[follower].leader
            if follower in seen:
                raise ModelFileError(f"{where}: joint {name!r}: mimic joints follow each other in a circle")
            seen.add(follower)
    return mimics


def _number(element: ElementTree.Element, name: str, place: str, default: str | None = None) -> float:
    text = element.get(name, default)
    try:
        value = float(text) if text is not None and "_" not in text else math.nan
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ModelFileError(f"{place}: <{element.tag}> {name}={text!r} is no finite number")
    return value
