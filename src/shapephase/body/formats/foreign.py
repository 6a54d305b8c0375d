"""Files that are not bodies, recognised by their content: what each is, and what to do next.

People load what a download, an export or another program has left; a parser's first complaint about it names neither.
"""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import PurePath

_HEAD = 4096  # bytes that are searched
_MESH = "a mesh, without masses and joints; load the model that names it (URDF, MJCF)"
_CAD = "a CAD file; export a URDF from the CAD program (Onshape, SolidWorks and Fusion have add-ins) and load that"
_MOTION = "a recorded motion; the body comes first: shapephase check BODY MOTION"
_USD = (
    "a USD stage, as Isaac Sim has it; load the URDF or MJCF it was made from, or convert it (Isaac Sim: File > Export "
    "to URDF)"
)
_YEADON = (
    "a file of measurements for Yeadon's human without a unit; add the line measurementconversionfactor: 0.01 where "
    "they are in cm (0.001 in mm, 1 in m)"
)
# First bytes of files, and what these files are.
_STARTS: tuple[tuple[bytes, str], ...] = (
    (rb"version https://git-lfs\.github\.com", "a Git LFS pointer, not the file itself; type: git lfs pull"),
    (rb"PXR-USDC|#usda\b", _USD),
    (rb"ISO-10303-21;", f"a STEP model: {_CAD}"),
    (rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", f"a document of SolidWorks, Inventor or Office: {_CAD}"),
    (rb"glTF|solid [^\n]*\n\s*facet|ply\r?\n|Kaydara FBX|BLENDER|mtllib |o \S+\n|v [-\d.]+ [-\d.]+ [-\d.]+\s", _MESH),
    (rb"MATLAB 5\.0|\x89HDF\r\n|PAR1|[\x01-\x08]\x50|PathFileType|[^\n]*\n(version=|nRows=)", _MOTION),
    (rb"\x1f\x8b", "a file compressed by gzip; unpack it first: gunzip FILE"),
)
# What an XML file is, by the tag of its root element.
_ROOTS = {
    "sdf": "an SDF model; convert it to URDF first (sdf2urdf of the ROS package pysdf)",
    "html": "an HTML page, not the file itself; download the raw file (on GitHub: the button Raw)",
    "mujocoinclude": "a part of an MJCF model; load the file that includes it",
    "COLLADA": _MESH,
    "mvnx": "a recording of an Xsens suit; load its BVH export, or a model with masses, and give this as the motion",
}
# Names in an archive, and what such a file is.
_IN_A_ZIP: tuple[tuple[str, str], ...] = (
    (r"\.usd[ac]?$", _USD),
    (r"\.npy$|xl/workbook\.xml", _MOTION),
    (r"\.(urdf|xacro|xml|osim|bioMod|bvh)$", "a zip archive; unpack it and load {name!r}"),
)
_TABLE = re.compile(rb"[\w.\" -]+([,;\t][\w.\" -]*)+\r?\n[-+\d.eE\" ]+([,;\t][-+\w.\" ]*)+(\r?\n|$)")


def foreign_kind(content: bytes) -> str | None:
    """Kind of a file that is not a body, with what to do next; None for an unknown one."""
    head = content[:_HEAD].removeprefix(b"\xef\xbb\xbf")
    if not content.strip(b"\0 \t\r\n"):
        return "an empty file; download or write it again"
    if head.startswith(b"PK\x03\x04"):
        return _zip_kind(content)
    if head.lstrip().startswith((b"{", b"[")):
        return "a JSON file; no body is read from JSON: load the URDF or MJCF it belongs to"
    for start, kind in _STARTS:
        if re.match(start, head.lstrip(), re.DOTALL):
            return kind
    if re.match(rb"<(!doctype\s+)?html", head.lstrip(), re.IGNORECASE):
        return _ROOTS["html"]
    if len(content) == 84 + 50 * int.from_bytes(content[80:84], "little"):
        return f"an STL file: {_MESH}"
    if _TABLE.match(head):
        return f"a table: {_MOTION}"
    if re.match(rb"\s*<\0?[A-Za-z!?]|\xff\xfe|\xfe\xff", head) or re.search(rb"<(robot|mujoco)\b", head):
        return None
    if re.search(rb"^\s*Ls\dL\s*:", content, re.MULTILINE):
        return _YEADON
    kind = "a binary file" if b"\0" in head else "no XML"
    return f"{kind}, and no format of a body; load a URDF, xacro, MJCF, OpenSim, bioMod, BVH or Yeadon file"


def foreign_root(tag: str) -> str:
    """Kind of an XML file by the tag of its root element, with what to do next."""
    return _ROOTS.get(tag, "neither a URDF nor an MJCF model; load a file whose first element is <robot> or <mujoco>")


def _zip_kind(content: bytes) -> str:
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            names = archive.namelist()
    except zipfile.BadZipFile:
        return "a zip archive that is cut off; download it again"
    for pattern, kind in _IN_A_ZIP:
        for name in names:
            if re.search(pattern, name):
                return kind.format(name=PurePath(name).name)
    return "a zip archive without a model in it; unpack it and look for a URDF or MJCF file"
