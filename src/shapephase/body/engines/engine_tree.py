"""A body that an engine reads: asked in a process of its own, and compared with what the engine computes."""

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
from .._cross_check import inertia_and_momentum
from ..body import Body
from ..couplings.coupling import Coupling
from ..couplings.functions import JointFunction
from ..formats.xml_text import Node, xml_tree
from ..link_tree import Joint, Link, LinkTree, from_the_root, grouped
from .formats import FORMATS, XACRO
from .reading import BODY, MEMORY, MISSING, NO_MEMORY, REFUSED, SHAPES, TEXT

_SECONDS = 60
"""[s] for the imports and the file; it only ends what would never end."""


def engine_tree(path: Path, name: str, options: Mapping[str, str]) -> tuple[LinkTree, list[dict[str, Any]]]:
    """Links and joints of a file in a format that an engine owns, and what the engine has at some shapes.

    options : arguments of the reader's `chain_of`

    Raises
    ------
    MissingExtraError
        If the engine is not installed.
    ModelFileError
        If it does not accept the file, crashes on it or hangs.
    """
    return _tree_of(_answer(path, name, BODY, json.dumps(dict(options))), str(path))


def expanded(path: Path, packages: Sequence[str], arguments: Mapping[str, str]) -> Node:
    """The root element of the URDF that a xacro file stands for; its lines are those of that.

    arguments : values of the file's arguments, by name

    Raises what `engine_tree` raises.
    """
    options = json.dumps({"packages": list(map(os.path.abspath, packages)), "xacro_args": dict(arguments)})
    return xml_tree(_answer(path, XACRO, TEXT, options).encode(), f"{path} (expanded)")


def engine_shapes(path: Path, name: str) -> dict[str, Any]:
    """What can be drawn of such a file, as its reader says it. Raises what `engine_tree` raises."""
    return _answer(path, name, SHAPES)


def _answer(path: Path, name: str, *words: str) -> Any:
    known, where = FORMATS[name], str(path)
    source = "from shapephase.body.engines.reading import read_in_this_process as read; read()"
    try:
        child = run_alone(source, (str(path.absolute()), name, *words), b"", _SECONDS)
    except subprocess.TimeoutExpired:
        raise ModelFileError(
            f"{where}:1: {known.engine} took more than {_SECONDS} s and was stopped; a smaller model is needed"
        ) from None
    if child.returncode == MISSING:
        raise MissingExtraError(
            f"{where} is {known.title}, which {known.engine} reads: pip install 'shapephase[{known.extra}]'"
        )
    if child.returncode < 0:
        raise ModelFileError(
            f"{where}:1: {known.engine} crashed on it, signal {-child.returncode}; open it in {known.engine} itself"
        )
    if child.returncode == NO_MEMORY:
        raise ModelFileError(
            f"{where}:1: {known.engine} took more than {MEMORY >> 20} MiB and was stopped; a smaller model is needed"
        )
    if child.returncode == REFUSED:
        refused = json.loads(child.stdout)
        raise ModelFileError(f"{where}:{refused['line']}: {refused['message']}")
    if child.returncode:
        said = child.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise ModelFileError(f"{where}:1: {known.engine} does not read it: {''.join(said) or 'it says nothing'}")
    return json.loads(child.stdout)


def _tree_of(said: dict[str, Any], where: str) -> tuple[LinkTree, list[dict[str, Any]]]:
    links = {
        entry["name"]: Link(
            entry["name"], f"{where}:{entry['line']}", entry["mass"], np.array(entry["centre"]),
            np.array(entry["inertia"]).reshape(3, 3),
        )
        for entry in said["links"]
    }  # fmt: skip
    joints = [_joint(entry, where) for entry in said["joints"]]
    first, ordered = from_the_root(links, joints, where)
    reached = {first}
    # The engine's own order, where it has parents before children, as every tree of links has them.
    if all(joint.parent in reached and not reached.add(joint.child) for joint in joints):
        ordered = tuple(joints)
    sorted_links = {name: links[name] for name in (first, *(joint.child for joint in ordered))}
    single = (f"{where}:1: {note}" for note in said["notes"] if isinstance(note, str))
    notes = (*single, *grouped((f"{where}:1", *note) for note in said["notes"] if not isinstance(note, str)))
    couplings = {name: _coupling(rule) for name, rule in said["couplings"].items()}
    frames = frozenset(said["frames"])
    base, slides = said["base_angles"], said["base_slides"]
    tree = LinkTree(
        said["name"],
        sorted_links,
        ordered,
        couplings,
        frames,
        notes,
        base_joints=tuple(_joint(entry, where) for entry in said["base_joints"]),
        base_angles=None if base is None else (tuple(base[0]), base[1]),
        base_slides=None if slides is None else tuple(slides),
    )
    return tree, said["poses"]


def _joint(entry: dict[str, Any], where: str) -> Joint:
    return Joint(
        name=entry["name"],
        where=f"{where}:{entry['line']}",
        kind=entry["kind"],
        parent=entry["parent"],
        child=entry["child"],
        place=np.array(entry["place"]),
        turn=np.array(entry["turn"]).reshape(3, 3),
        axis=np.array(entry["axis"]),
        after=np.array(entry["after"]),
        limits=(-np.inf, np.inf) if entry["limits"] is None else (entry["limits"][0], entry["limits"][1]),
    )


def _coupling(rule: dict[str, Any]) -> Coupling:
    terms = ((driver, JointFunction(*map(np.array, numbers))) for driver, *numbers in rule["terms"])
    return Coupling(rule["start"], tuple(terms))


def check_against_engine(body: Body, tree: LinkTree, poses: list[dict[str, Any]], where: str) -> None:
    """Compare a body with what the engine that owns its format computes.

    Raises
    ------
    ModelFileError
        If mass, centre, inertia or momentum at a random shape and rate differ by more than rounding.
    """
    for pose in poses:
        shape = np.array([pose["shape"][name] for name in body.joint_names])
        rate = np.array([pose["rate"][name] for name in body.joint_names])
        *_, extent, motion = inertia_and_momentum(tree, pose["shape"], pose["rate"])
        exact, coarse = pose["tolerance"]
        allowed = {"inertia": exact * extent, "momentum": coarse * motion}
        found = {"inertia": body.locked_inertia(shape).ravel(), "momentum": body.internal_momentum(shape, rate)}
        if pose["mass"] is not None:
            # The centre is off by its share of the size of the body.
            allowed |= {"mass": exact * body.mass, "centre": exact * np.sqrt(extent / body.mass)}
            found |= {"mass": np.array(body.mass), "centre": body.centre_of_mass(shape)}
        for what, got in found.items():
            # A comparison that NaN fails.
            if not np.all(np.abs(got - np.array(pose[what])) <= allowed[what]):
                raise ModelFileError(
                    f"{where}:1: the engine has another {what} at a random shape: {pose[what]} against {got.tolist()}; "
                    "please report this file"
                )
