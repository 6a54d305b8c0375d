"""An MJCF file as MuJoCo compiles it, and which of its bodies floats."""

from __future__ import annotations

import codecs
import difflib
import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

os.environ.setdefault("MUJOCO_GL", "disable")  # nothing is drawn here

# What its compiled part brings, a type checker does not see.
# pyright: reportAttributeAccessIssue=false
import mujoco
import numpy as np

from ... import so3
from ...arrays import Array
from ..formats.xml_text import listed, quoted, xml_tree
from ..virtual_base import way_words
from .chain import UnusableModelError
from .mujoco_assets import compiled_without

FREE = int(mujoco.mjtJoint.mjJNT_FREE)
BALL = int(mujoco.mjtJoint.mjJNT_BALL)
SLIDE = int(mujoco.mjtJoint.mjJNT_SLIDE)
"""Kinds of joints; the fourth is a hinge."""
# Attributes of elements whose other attributes MuJoCo ignores in silence.
_PASSED_OVER = {
    "frame": ("name", "childclass", "pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"),
    "replicate": ("count", "sep", "offset", "quat", "axisangle", "xyaxes", "zaxis", "euler"),
}
# Attributes that masses and places depend on; MuJoCo replaces NaN by its default.
_NUMBERS = {
    *("mass", "density", "diaginertia", "fullinertia", "size", "fromto", "axis", "range", "ref", "polycoef"),
    *("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler"),
}
_MEMORY = 2**26  # [bytes] of MuJoCo's work space: the squares of two thousand coordinates
_TAG_LINES = 3  # lines from an element's tag to its name


@dataclass(frozen=True)
class Compiled:
    """A model, the names that its bodies have as links, and their lines where the file itself has them.

    shapeless : geoms whose mesh could not be read
    notes : what is left out
    """

    model: Any
    names: list[str]
    lines: dict[tuple[str, int], int]
    shapeless: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()

    def below(self, base: int) -> list[int]:
        """A body and all that hang on it, parents first."""
        reached = {base}
        for body in range(base + 1, self.model.nbody):
            if int(self.model.body_parentid[body]) in reached:
                reached.add(body)
        return sorted(reached)

    def joints_of(self, body: int) -> range:
        """Numbers of the joints between a body and the one it hangs on."""
        first = int(self.model.body_jntadr[body])
        return range(first, first + int(self.model.body_jntnum[body]))

    def joint_name(self, joint: int) -> str:
        """Its own, or one after the body that it moves."""
        body = int(self.model.jnt_bodyid[joint])
        return self.model.joint(joint).name or f"{self.names[body]}_joint{joint - self.joints_of(body)[0] + 1}"

    def line(self, number: int, kind: str = "body") -> int:
        """Line at which a body or joint begins; 1 for one in another file."""
        return self.lines.get((kind, number), 1)


def compiled_model(path: str, *, drawn: bool = False) -> Compiled:
    """The model that MuJoCo compiles from a file, with or without shapes that are only drawn."""
    content = Path(path).read_bytes()
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise UnusableModelError("<mujoco>: MuJoCo reads no UTF-16; save the file as UTF-8")
    text = content.decode("utf-8-sig", errors="replace")
    _check_passed_over(content, path)
    try:
        written = mujoco.MjSpec.from_file(path)
        # Threads would reserve memory by the gigabyte.
        written.compiler.usethread = False
        # Nor is there need of room for the contacts of a simulation.
        written.memory, written.njmax, written.nconmax = _MEMORY, -1, -1
        written.compiler.discardvisual = written.compiler.discardvisual and not drawn
        model, shapeless, notes = compiled_without(written)
    except (ValueError, RuntimeError) as error:
        raise _refused(str(error), text) from None
    lines = text.splitlines()
    begin = {
        (kind, part.id): _line(part.info, part.name, lines)
        for kind, parts in (("body", written.bodies), ("joint", written.joints))
        for part in parts
    }
    begin["body", 0] = next((number for number, line in enumerate(lines, 1) if "<worldbody" in line), 1)
    names = [model.body(body).name or f"body{body}" for body in range(model.nbody)]
    return Compiled(model, names, begin, shapeless, tuple(notes))


def _check_passed_over(content: bytes, path: str) -> None:
    """Raise UnusableModelError for what MuJoCo would not read: misspelt places, masses that are NaN."""
    for node in xml_tree(content, path).walk():
        for name in _NUMBERS & set(node.attributes):
            if any(word.lower().lstrip("+-") == "nan" for word in node.attributes[name].split()):
                raise UnusableModelError(
                    f"<{node.tag}>: {name}={quoted(node.attributes[name])!r} is not a number, and MuJoCo would take "
                    f"its default; give a number, or leave {name} out",
                    node.line,
                )
        for name in set(node.attributes) - set(_PASSED_OVER.get(node.tag, node.attributes)):
            near = difflib.get_close_matches(name, _PASSED_OVER[node.tag], 1)
            meant = f"; did you mean {near[0]}=?" if near else ""
            raise UnusableModelError(f"<{node.tag}>: MuJoCo ignores {quoted(name)!r}{meant}", node.line)


def _line(message: str, name: str, lines: list[str]) -> int:
    """Line at which the element of this name begins; 1 if it is not in these lines."""
    match = re.search(r"line (\d+)", message)
    number = int(match[1]) if match else 1
    inside = 0 < number <= len(lines) and name in "\n".join(lines[number - 1 : number - 1 + _TAG_LINES])
    return number if inside else 1


def _refused(message: str, text: str) -> UnusableModelError:
    """The error of MuJoCo in one line, with the element and its line."""
    words = " ".join(message.split())
    at = re.search(r"\s*Element (name )?'([^']*)'(?:, id \d+)?(?:, line (\d+))?\.?$", words)
    reason = re.sub(r"^(XML )?(Error: )+", "", words[: at.start()] if at else words)
    reason += " (it may have run out of memory)" if "unknown exception" in reason else ""
    element, number = "<mujoco>", 1
    if at:
        number = int(at[3] or 1)
        lines = "\n".join(text.splitlines()[number - 1 : number - 1 + _TAG_LINES])
        tag = re.search(rf"<(\w+)[^<>]*\bname\s*=\s*[\"']{re.escape(at[2])}[\"']", lines)
        named = f"{tag[1]} {at[2]!r}" if tag else f"<mujoco>, element {at[2]!r}"
        element = f"<{at[2]}>" if not at[1] else named if at[2] else element
    if number == 0:
        # MuJoCo keeps no lines of included files.
        reason += "; in a file that is included"
    return UnusableModelError(f"{element}: MuJoCo does not accept it: {reason}", max(number, 1))


def base_of(compiled: Compiled, root: str | None, root_body: str | None) -> tuple[int, list[int], list[str]]:
    """The body that floats, those on the way to it from the world whose joints move it, and notes on what is done.

    root : "free" removes a single joint between it and what it hangs on, too
    root_body : its name, where the file has several trees
    """
    model, names = compiled.model, compiled.names
    notes: list[str] = []
    if root_body is None:
        way = _way_to_mass(compiled, _only_tree(compiled, notes))
    elif root_body in names[1:]:
        way = _way_from_world(compiled, names.index(root_body, 1))
    else:
        near = difflib.get_close_matches(root_body, names[1:], 1) or names[1:]
        raise UnusableModelError(
            f"<worldbody>: root_body: no body is named {quoted(root_body)!r}; there is {listed([*map(repr, near)])}",
            compiled.line(0),
        )
    base = way[-1]
    if model.body_mocapid[base] >= 0:
        raise UnusableModelError(
            f"body {names[base]!r}: a mocap body is moved from outside; name another by root_body", compiled.line(base)
        )
    joints = [joint for body in way for joint in compiled.joints_of(body) if model.jnt_type[joint] != FREE]
    above = int(model.body_parentid[way[0]])
    if above and joints and root is None:
        raise UnusableModelError(
            f"body {names[base]!r}: {listed([repr(compiled.joint_name(joint)) for joint in joints])} between "
            f'{names[above]!r} and the body that floats; a free body has none: root="free" (--root free) removes it',
            compiled.line(base),
        )
    fault, note = way_words([compiled.joint_name(joint) for joint in joints], "the world", names[base], root)
    if fault:
        raise UnusableModelError(
            f"joint {compiled.joint_name(joints[0])!r}: {fault}", compiled.line(joints[0], "joint")
        )
    # The world's place relative to something with mass in between is unknown.
    return base, [] if above else way, notes + [note] * bool(note)


def _way_to_mass(compiled: Compiled, top: int) -> list[int]:
    """Bodies from one in the world to the first with mass, or on which several move, each alone on the last."""
    model, way = compiled.model, [top]
    while not any(model.jnt_type[joint] == FREE for joint in compiled.joints_of(way[-1])):
        fixed, moving = _rigid_part(compiled, way[-1])
        if len(moving) != 1 or any(model.body_mass[body] for body in fixed) or not model.body_subtreemass[top]:
            break
        way += [*_between(compiled, way[-1], moving[0]), moving[0]]
    return way


def _way_from_world(compiled: Compiled, base: int) -> list[int]:
    """Bodies from one in the world to another where nothing on the way has mass; else the last alone."""
    model, way = compiled.model, [*_between(compiled, 0, base), base]
    clear = all(not model.body_mass[body] for step in way[:-1] for body in _rigid_part(compiled, step)[0])
    return way if clear else [base]


def _rigid_part(compiled: Compiled, body: int) -> tuple[list[int], list[int]]:
    """A body with those that are fixed to it, and those that move on them."""
    fixed, moving = [body], list[int]()
    for part in compiled.below(body)[1:]:
        if int(compiled.model.body_parentid[part]) in fixed:
            (moving if len(compiled.joints_of(part)) else fixed).append(part)
    return fixed, moving


def _between(compiled: Compiled, above: int, below: int) -> list[int]:
    """The bodies between one and another that hangs on it, from above; without both."""
    bodies = [int(compiled.model.body_parentid[below])]
    while bodies[-1] != above:
        bodies.append(int(compiled.model.body_parentid[bodies[-1]]))
    return bodies[-2::-1]


def _only_tree(compiled: Compiled, notes: list[str]) -> int:
    """The body in the world that moves, or on which others move."""
    model, names = compiled.model, compiled.names
    tops = [body for body in range(1, model.nbody) if model.body_parentid[body] == 0]
    if not tops:
        raise UnusableModelError("<worldbody>: there is no <body> in it; a free body needs one", compiled.line(0))
    moving = [body for body in tops if any(len(compiled.joints_of(part)) for part in compiled.below(body))]
    trees = moving or tops
    if len(trees) > 1:
        moved = [repr(names[body]) for body in trees]
        raise UnusableModelError(
            f"body {moved[1]}: {len(trees)} bodies in the world, one is a free body: {listed(moved)}; choose one "
            f"by root_body={moved[0]} (--root-body {names[trees[0]]})",
            compiled.line(trees[1]),
        )
    left = [repr(names[body]) for body in tops if body != trees[0] and model.body_subtreemass[body] > 0.0]
    if left:
        notes.append(f"what stands still in the world is left out: {listed(left)}")
    return trees[0]


def rotation(quaternion: Array) -> Array:
    """Rotation of a quaternion w x y z, made of length one: (3, 3)."""
    return so3.matrix_from_quat(np.roll(quaternion / np.linalg.norm(quaternion), -1))
