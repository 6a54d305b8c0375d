"""A body that another program's engine reads, in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...child_process import run_alone
from ...errors import MissingExtraError, ModelFileError
from ..couplings.coupling import Coupling
from ..couplings.functions import JointFunction
from ..formats.xml_text import Node, xml_tree
from ..link_tree import Joint, Link, LinkTree, from_the_root, grouped
from .formats import FORMATS, XACRO
from .reading import BODY, MEMORY, MISSING, NO_MEMORY, REFUSED, SHAPES, TEXT

_SECONDS = 60  # for the imports and the file: it only ends what would never end
_PROGRAM = "from shapephase.body.engines.reading import read_in_this_process as read; read()"


def engine_tree(path: Path, name: str, options: Mapping[str, str]) -> tuple[LinkTree, list[dict[str, Any]]]:
    """Links and joints of a file in an engine's format, and the engine's numbers at some shapes.

    options : arguments of the reader's `chain_of`
    """
    return _tree_of(_result(path, name, BODY, json.dumps(dict(options))), str(path))


def expanded(path: Path, packages: Sequence[str], arguments: Mapping[str, str]) -> Node:
    """The root element of the URDF that a xacro file expands to; its lines are those of the expanded text.

    arguments : values of the file's arguments, by name
    """
    options = json.dumps({"packages": list(map(os.path.abspath, packages)), "xacro_args": dict(arguments)})
    return xml_tree(_result(path, XACRO, TEXT, options).encode(), f"{path} (expanded)")


def engine_shapes(path: Path, name: str, *, collision: bool) -> dict[str, Any]:
    """Shapes of such a file to draw, or that collide, as plain numbers. Raises what `engine_tree` raises."""
    return _result(path, name, SHAPES, json.dumps({"collision": collision}))


def _result(path: Path, name: str, *words: str) -> Any:
    known, where = FORMATS[name], str(path)
    try:
        child = run_alone(_PROGRAM, (str(path.absolute()), name, *words), b"", _SECONDS)
    except subprocess.TimeoutExpired:
        fault = f"took more than {_SECONDS} s and was stopped; a smaller model is needed"
        raise ModelFileError(f"{where}:1: {known.engine} {fault}") from None
    if child.returncode == 0:
        return json.loads(child.stdout)
    if child.returncode == MISSING:
        raise MissingExtraError(
            f"{where} is {known.title}, which {known.engine} reads: pip install 'shapephase[{known.extra}]'"
        )
    if child.returncode == REFUSED:
        refused = json.loads(child.stdout)
        raise ModelFileError(f"{where}:{refused['line']}: {refused['message']}")
    if child.returncode == NO_MEMORY:
        fault = f"took more than {MEMORY >> 20} MiB and was stopped; a smaller model is needed"
    elif child.returncode < 0:
        fault = f"crashed on it, signal {-child.returncode}; open it in {known.engine} itself"
    else:
        last = child.stderr.decode(errors="replace").strip().splitlines()[-1:]
        fault = f"does not read it: {''.join(last) or 'no reason given'}"
    raise ModelFileError(f"{where}:1: {known.engine} {fault}")


def _tree_of(chain: dict[str, Any], where: str) -> tuple[LinkTree, list[dict[str, Any]]]:
    """The tree of links of a `Chain` in JSON, and its poses."""
    links = {name: Link(**_fields(entry, where)) for name, entry in chain["links"].items()}
    joints = [Joint(**_fields(entry, where)) for entry in chain["joints"]]
    first, ordered = from_the_root(links, joints, where)
    reached = {first}
    # The engine's own order is kept where parents come before children.
    if all(joint.parent in reached and not reached.add(joint.child) for joint in joints):
        ordered = tuple(joints)
    single = (f"{where}:1: {note}" for note in chain["notes"] if isinstance(note, str))
    kinds = grouped((f"{where}:1", *note) for note in chain["notes"] if not isinstance(note, str))
    angles, slides = chain["base_angles"], chain["base_slides"]
    tree = LinkTree(
        chain["name"],
        {name: links[name] for name in (first, *(joint.child for joint in ordered))},
        ordered,
        {name: _coupling(rule) for name, rule in chain["couplings"].items()},
        frozenset(chain["frames"]),
        (*single, *kinds),
        base_joints=tuple(Joint(**_fields(entry, where)) for entry in chain["base_joints"]),
        base_angles=None if angles is None else (tuple(angles[0]), angles[1]),
        base_slides=None if slides is None else tuple(slides),
    )
    return tree, chain["poses"]


def _fields(entry: dict[str, Any], where: str) -> dict[str, Any]:
    """Fields of a link or joint, their arrays and their place in the file restored."""
    pairs = {name: tuple(entry[name]) for name in ("limits", "most") if name in entry}
    arrays = {name: np.array(value) for name, value in entry.items() if isinstance(value, list)}
    return entry | arrays | pairs | {"where": f"{where}:{entry['where']}"}


def _coupling(rule: dict[str, Any]) -> Coupling:
    terms = (
        (driver, JointFunction(**{k: np.array(v) for k, v in function.items()})) for driver, function in rule["terms"]
    )
    return Coupling(rule["start"], tuple(terms))
