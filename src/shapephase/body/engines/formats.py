"""Formats of bodies: how each is recognised by its content, the engine that reads it, and options of `load_body`."""

from __future__ import annotations

import re
from typing import NamedTuple

from ..formats.bvh_text import is_bvh

_HEAD = 2**16  # bytes that are searched: comments of bioMod files fill some thousand

MJCF = "mjcf"  # XML throughout, and drawn
XACRO = "xacro"  # expanded to a URDF
BVH = "bvh"  # read here, without an engine
MVNX = "mvnx"  # read here, without an engine


class Format(NamedTuple):
    """A format that another program owns."""

    title: str
    engine: str  # the module to import
    extra: str  # of this package, which installs it
    module: str  # the reader beside this module
    drawing: str = ""  # the reader of what can be drawn
    options: tuple[str, ...] = ()  # arguments of `load_body` that the reader takes


FORMATS = {
    MJCF: Format("an MJCF model", "mujoco", "mjcf", ".mujoco_reading", ".mujoco_drawing", ("root", "root_body")),
    "biomod": Format("a bioMod model", "biorbd", "biomod", ".biorbd_reading", options=("root_body",)),
    "opensim": Format("an OpenSim model", "opensim", "opensim", ".opensim_reading", options=("root_body",)),
    XACRO: Format("a xacro file", "xacrodoc", "bodies", ".xacro_reading", options=("packages", "root", "xacro_args")),
    "yeadon": Format("measurements for Yeadon's model", "yeadon", "bodies", ".yeadon_reading"),
}
OPTIONS: dict[str | None, tuple[str, ...]] = {
    None: ("packages", "root"),  # a URDF
    BVH: ("length_unit", "person_mass"),
    MVNX: ("person_mass",),
    **{name: known.options for name, known in FORMATS.items()},
}
_COMMENT = re.compile(rb"//[^\n]*|/\*.*?\*/|\s+", re.DOTALL)
_BEFORE_XML = re.compile(rb"<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^>\[]*(?:\[.*?\])?\s*>|\s+", re.DOTALL)


def format_of(content: bytes) -> str | None:
    """The name of the format, by content; None for a URDF and everything else."""
    if is_bvh(content):
        return BVH
    head = content[:_HEAD].removeprefix(b"\xef\xbb\xbf")
    if root := re.match(rb"<(mujoco|mvnx)[\s/>]", _after(_BEFORE_XML, head)):
        return MJCF if root[1] == b"mujoco" else MVNX
    if re.match(rb"version\s+\d", _after(_COMMENT, head), re.IGNORECASE):
        return "biomod"
    if re.search(rb"<OpenSimDocument[\s>]", head):
        return "opensim"
    if re.search(rb"^[ \t]*measurementconversionfactor[ \t]*:", head, re.MULTILINE):
        return "yeadon"
    return None


def _after(skipped: re.Pattern[bytes], head: bytes) -> bytes:
    start = 0
    while match := skipped.match(head, start):
        start = match.end()
    return head[start:]
