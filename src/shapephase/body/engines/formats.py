"""Which formats other programs own, how they are told by their content, and which extra brings the engine."""

from __future__ import annotations

import re
from typing import NamedTuple

from ..formats.bvh_text import is_bvh

_HEAD = 65536
"""[bytes] of a file that are looked at to tell its format."""

MJCF = "mjcf"
"""The one of these formats that is XML throughout, and drawn."""


XACRO = "xacro"
"""The one whose engine makes a URDF of it."""


BVH = "bvh"
"""A skeleton in motion, which no engine owns, and no XML: it is read here."""


MVNX = "mvnx"
"""The poses of a suit's segments, which no engine owns, either."""


class Format(NamedTuple):
    """A format that an engine owns."""

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
"""By our name."""
_COMMENT = re.compile(rb"//[^\n]*|/\*.*?\*/|\s+", re.DOTALL)
_BEFORE_XML = re.compile(rb"<!--.*?-->|<\?.*?\?>|<!DOCTYPE[^>\[]*(?:\[.*?\])?\s*>|\s+", re.DOTALL)


def format_of(content: bytes) -> str | None:
    """The name of the format, by content; None for a URDF and everything else."""
    if is_bvh(content):
        return BVH
    head = content[:_HEAD].removeprefix(b"\xef\xbb\xbf")
    if re.match(rb"<mujoco[\s/>]", _after(_BEFORE_XML, head)):
        return MJCF
    if re.match(rb"<mvnx[\s/>]", _after(_BEFORE_XML, head)):
        return MVNX
    if re.match(rb"version\s+\d", _after(_COMMENT, head), re.IGNORECASE):
        return "biomod"
    if re.search(rb"<OpenSimDocument[\s>]", head):
        return "opensim"
    if re.search(rb"^[ \t]*measurementconversionfactor[ \t]*:", head, re.MULTILINE):
        return "yeadon"
    return None


def _after(passed: re.Pattern[bytes], head: bytes) -> bytes:
    start = 0
    while found := passed.match(head, start):
        start = found.end()
    return head[start:]
