"""Files that are not bodies, recognised by their content: what each is, and what to do next.

People load what a download, an export or another program has left; a parser's first complaint about it names neither.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from pathlib import PurePath
from typing import Any

_HEAD = 4096  # bytes that are searched
_MESH = "a mesh, without masses and joints; load the model that names it (URDF, MJCF)"
_CAD = "a CAD file; export a URDF from the CAD program (Onshape, SolidWorks and Fusion have add-ins) and load that"
_MOTION = "a recorded motion; the body comes first: shapephase check BODY MOTION"
_USD = (
    "a USD stage, as Isaac Sim has it; load the URDF or MJCF it was made from, or convert it (Isaac Sim: File > Export "
    "to URDF)"
)
_SIMSCAPE = (
    "a Simulink or Simscape model; in MATLAB write a URDF from it: exportrobot(importrobot('MODEL')), or load the URDF "
    "it was imported from"
)
_YEADON = (
    "a file of measurements for Yeadon's human without a unit; add the line measurementconversionfactor: 0.01 where "
    "they are in cm (0.001 in mm, 1 in m)"
)
# First bytes of files, and what these files are.
_STARTS: tuple[tuple[bytes, str], ...] = (
    (rb"version https://git-lfs\.github\.com", "a Git LFS pointer, not the file itself; type: git lfs pull"),
    (rb"PXR-USDC|#usda\b", _USD),
    (rb"<{3,}[^<>\n]*>{3,}", "a file of NASA's 42; write its bodies and joints as a URDF or MJCF and load that"),
    (rb"ISO-10303-21;", f"a STEP model: {_CAD}"),
    (rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", f"a document of SolidWorks, Inventor or Office: {_CAD}"),
    (rb"glTF|solid [^\n]*\n\s*facet|ply\r?\n|Kaydara FBX|BLENDER|mtllib |o \S+\n|v [-\d.]+ [-\d.]+ [-\d.]+\s", _MESH),
    (rb"#VRML", f"a VRML file: {_MESH}"),
    (rb"MATLAB 5\.0|\x89HDF\r\n|PAR1|[\x01-\x08]\x50|PathFileType|[^\n]*\n(version=|nRows=)", _MOTION),
    (rb"Model \{|# MathWorks", _SIMSCAPE),
    (rb"\x1f\x8b", "a file compressed by gzip; unpack it first: gunzip FILE"),
    (rb"7z\xbc\xaf|Rar!|.{257}ustar", "an archive; unpack it and load the model that is in it"),
    (rb"%PDF", "a PDF document; download the model that it describes"),
    (rb"KPL/|DAF/", "a SPICE kernel; a body comes from a URDF, an MJCF or another model file"),
    (rb":version \d", "an Acclaim skeleton (ASF); convert it and its AMC to BVH (amc2bvh) and load that"),
    (rb"(#!.*python|import |from \S+ import )", "a Python program; run it, and load the model file that it writes"),
)
# What an XML file is, by the tag of its root element.
_ROOTS = {
    "sdf": "an SDF model; convert it to URDF first (sdf2urdf of the ROS package pysdf)",
    "gazebo": "an SDF world of old Gazebo; convert its model to URDF first (sdf2urdf of the ROS package pysdf)",
    "html": "an HTML page, not the file itself; download the raw file (on GitHub: the button Raw)",
    "mujocoinclude": "a part of an MJCF model; load the file that includes it",
    "COLLADA": _MESH,
    "X3D": _MESH,
    "mvnx": "a recording of an Xsens suit; load its BVH export, or a model with masses, and give this as the motion",
    "launch": "a ROS launch file; load the URDF or xacro file that it names",
    "package": "the description of a ROS package; load a file of its folder urdf/",
    "KinematicModel": "a Vicon skeleton (VSK), which has no masses; load a model with masses",
    "SimscapeMultibodyImportXML": _SIMSCAPE,
    "PhysicalModelingXMLFile": _SIMSCAPE,
    "svg": "a picture; load the model that it shows",
}
# Names in an archive, and what such a file is.
_IN_A_ZIP: tuple[tuple[str, str], ...] = (
    (r"simulink/|\.mdlx?$", _SIMSCAPE),
    (r"\.usd[ac]?$", _USD),
    (r"\.npy$|xl/workbook\.xml", _MOTION),
    (r"Document\.xml$|3D/3dmodel", _CAD),
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
    if (kind := _json_kind(content, head)) is not None:
        return kind
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


def _json_kind(content: bytes, head: bytes) -> str | None:
    if not head.lstrip().startswith((b"{", b"[")):
        return None
    try:
        data: Any = json.loads(content)
    except (ValueError, RecursionError):
        return None
    keys = set(data) if isinstance(data, dict) else set()
    if "asset" in keys:
        return f"a glTF file: {_MESH}"
    if {"Frames", "frames"} & keys:
        return f"a JSON file of frames: {_MOTION}"
    return "a JSON file; no body is read from JSON: load the URDF or MJCF it belongs to"
