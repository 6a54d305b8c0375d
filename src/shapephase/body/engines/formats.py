"""Which formats other programs own, how they are told by their content, and which extra brings the engine."""

from __future__ import annotations

import re
from typing import NamedTuple

_HEAD = 65536
"""[bytes] of a file that are looked at to tell its format."""


class Format(NamedTuple):
    """A format that an engine owns."""

    title: str
    engine: str  # the module to import
    extra: str  # of this package, which installs it
    module: str  # the reader beside this module


FORMATS = {
    "biomod": Format("a bioMod model", "biorbd", "biomod", ".biorbd_reading"),
    "opensim": Format("an OpenSim model", "opensim", "opensim", ".opensim_reading"),
    "yeadon": Format("measurements for Yeadon's model", "yeadon", "yeadon", ".yeadon_reading"),
}
"""By our name."""
_COMMENT = re.compile(rb"//[^\n]*|/\*.*?\*/|\s+", re.DOTALL)


def format_of(content: bytes) -> str | None:
    """The name of the format, by content; None for XML and everything else."""
    head = content[:_HEAD]
    start = 3 if head.startswith(b"\xef\xbb\xbf") else 0
    while found := _COMMENT.match(head, start):
        start = found.end()
    if re.match(rb"version\s+\d", head[start:], re.IGNORECASE):
        return "biomod"
    if re.search(rb"<OpenSimDocument[\s>]", head):
        return "opensim"
    if re.search(rb"^\s*measurementconversionfactor\s*:", head, re.MULTILINE):
        return "yeadon"
    return None
