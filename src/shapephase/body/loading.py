"""Bodies from files of all formats that are read, and from models of Pinocchio."""

from __future__ import annotations

import hashlib
import os
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import check_choice, check_object, positive_argument
from ..errors import IgnoredElementWarning, ModelFileError, ShapeError, UnphysicalInertiaWarning, WrongObjectError
from ..letters import value_text
from ._cross_check import check_against_engine, check_against_file
from ._model_tree import checked_model, model_of
from .body import Body
from .catalog import file_of
from .engines.engine_tree import engine_tree, expanded
from .engines.formats import BVH, MJCF, MVNX, OPTIONS, XACRO, format_of
from .formats.bvh import bvh_tree, mvnx_tree
from .formats.foreign import foreign_kind
from .formats.urdf import macro_of, urdf_tree
from .formats.xml_text import quoted, read_file, xml_tree
from .joint_orders import joint_orders
from .link_tree import hollow_warnings, inertia_warnings, massless_warning
from .particles.point_masses import ParticleBody

_Doubts = list[tuple[type[Warning], str]]
_UNUSED = {
    "packages": "is for URDF and xacro files; {} names none",
    "xacro_args": "is for xacro files; {} has no macros",
    "root": "is for URDF, xacro and MJCF files; {} has one root, which floats",
    "root_body": "is for MJCF, OpenSim and bioMod files; {} has one root, which floats",
    "length_unit": "is for BVH files; {} has metres",
    "person_mass": "is for BVH and MVNX files; {} has masses of its own",
}


def load_body(
    source: str | os.PathLike[str] | Any,
    *,
    on_unphysical: str = "error",
    root: str | None = None,
    root_body: str | None = None,
    packages: Sequence[str | os.PathLike[str]] = (),
    xacro_args: Mapping[str, str] | None = None,
    length_unit: float | None = None,
    person_mass: float | None = None,
) -> Body:
    """Load a free-floating body.

    Mass, links and joints of the result are compared with the file, and its locked inertia and internal momentum at a
    random shape with values computed without Pinocchio, to 1e-12.

    Parameters
    ----------
    source : a path to a URDF, a xacro file (`shapephase[bodies]`), an MJCF file (`shapephase[mjcf]`), an OpenSim model
        (`shapephase[opensim]`), a bioMod model (`shapephase[biomod]`), a file of measurements for Yeadon's human
        (`shapephase[bodies]`), or a BVH or MVNX file, whose skeleton becomes a human; a name from `robot_names()` such
        as "cat"; "example:human", a body of the installed example-robot-data; or a `pinocchio.Model` whose root joint
        is a free-flyer
    on_unphysical : "error" or "warn", for a link whose inertia has a negative principal moment, or that has no mass and
        more than 1 % of the body's inertia about an axis
    root : "free" removes all joints between the world, or a root link without mass, and the body of an MJCF or a URDF;
        None: a single one is an error, as for an arm that is bolted down; two or more are the free base, with a
        warning. Their columns are the recorded base
    root_body : the body that floats, with all that hangs on it, of an MJCF, an OpenSim or a bioMod file; needed where
        the file has several trees
    packages : folders that are searched for the packages of a URDF or a xacro file, `package://NAME`, `$(find NAME)`,
        before those around the file
    xacro_args : values of the arguments of a xacro file by name, as `{"payload": "true"}`
    length_unit : the metres of a unit of a BVH file, which states none: 0.01 for centimetres
    person_mass : mass of the human made from the skeleton of a BVH or MVNX file [kg]; None: 70 kg, with a warning

    Raises
    ------
    InputFileNotFoundError, UnknownNameError
        For a missing file or an unknown name.
    ModelFileError, UnphysicalInertiaError
        If the file cannot be used, or a link cannot exist; the message begins with file and line.
    ShapeError
        If `root` or one of the arguments after it is given for a file to which it does not apply.
    TrajectoryError
        If `length_unit` or `person_mass` is not above 0.
    MissingExtraError
        For "example:..." without example-robot-data, and for a format whose engine is not installed.

    Warns
    -----
    UnphysicalInertiaWarning
        Once for each kind of doubt about inertias, with the names of the links.
    IgnoredElementWarning
        For elements of the file that have no meaning for a free body of joints.

    Examples
    --------
    >>> cat = sp.load_body("cat")
    >>> cat.name, round(cat.mass, 6), cat.n_shape
    ('cat', 4.0, 23)
    """
    given = loading_options(
        on_unphysical=on_unphysical,
        root=root,
        root_body=root_body,
        packages=packages,
        xacro_args=xacro_args,
        length_unit=length_unit,
        person_mass=person_mass,
    )
    given.pop("on_unphysical", None)
    if isinstance(source, str | os.PathLike):
        path = file_of(os.fspath(source))
        try:
            body, doubts = _from_file(read_file(path), path, on_unphysical, given)
        except MemoryError:
            raise ModelFileError(f"{path}:1: there is not enough memory to load it; close other programs") from None
    else:
        _check_unused(given, "a pinocchio.Model", ())
        body, doubts = _from_model(source, on_unphysical)
    for category, message in doubts:
        warnings.warn(message, category, stacklevel=2)
    return body


def as_body(value: Any) -> Body:
    """Return a body that a user gave, itself or by what `load_body` takes. Raises like it, and WrongObjectError."""
    if isinstance(value, str):
        return load_body(value)
    check_object(value, "Body", "body")
    return value


def as_body_or_particles(value: Body | ParticleBody | str) -> Body | ParticleBody:
    """Return `as_body`, or a body of particles."""
    return value if isinstance(value, ParticleBody) else as_body(value)


def loading_options(
    *,
    on_unphysical: str = "error",
    root: str | None = None,
    root_body: str | None = None,
    packages: Sequence[str | os.PathLike[str]] = (),
    xacro_args: Mapping[str, str] | None = None,
    length_unit: float | None = None,
    person_mass: float | None = None,
) -> dict[str, Any]:
    """The given ones of these arguments of `load_body`, checked; defaults are left out. Raises ShapePhaseError."""
    check_choice(on_unphysical, "value of on_unphysical", ("error", "warn"))
    if root is not None:
        check_choice(root, "value of root", ("free",))
    if not isinstance(root_body, str | None):
        raise WrongObjectError(f"root_body: the name of a body is needed, got {value_text(root_body)}")
    several = isinstance(packages, Sequence) and not isinstance(packages, str | bytes)
    if not several or not all(isinstance(folder, str | os.PathLike) and os.fspath(folder) for folder in packages):
        raise WrongObjectError(f"packages: folders in a list are needed, got {value_text(packages)}")
    if not isinstance(xacro_args, Mapping | None) or not all(isinstance(name, str) for name in xacro_args or ()):
        raise WrongObjectError(
            f'xacro_args: values by name are needed, such as {{"payload": "true"}}, got {value_text(xacro_args)}'
        )
    if length_unit is not None:
        length_unit = positive_argument(length_unit, "length_unit", "a number of metres")
    if person_mass is not None:
        person_mass = positive_argument(person_mass, "person_mass", "a mass in kg")
    # xacro takes true and false, not True and False.
    typed = {name: str(v).lower() if isinstance(v, bool) else str(v) for name, v in (xacro_args or {}).items()}
    options = {
        "on_unphysical": on_unphysical if on_unphysical != "error" else None,
        "root": root,
        "root_body": root_body,
        "packages": [os.fspath(folder) for folder in packages] or None,
        "xacro_args": typed or None,
        "length_unit": length_unit,
        "person_mass": person_mass,
    }
    return {name: value for name, value in options.items() if value is not None}


def _from_file(content: bytes, path: Path, on_unphysical: str, given: dict[str, Any]) -> tuple[Body, _Doubts]:
    where, poses = str(path), []
    kind = format_of(content)
    if kind is None and (foreign := foreign_kind(content)) is not None:
        raise ModelFileError(f"{where}:1: this is {foreign}")
    root = xml_tree(content, where) if kind in (None, MJCF) else None
    if root is not None and root.tag == "mujoco":
        kind = MJCF
    if root is not None and root.tag == "robot" and macro_of(root) is not None:
        kind = XACRO
    _check_unused(given, where, OPTIONS[kind])
    if kind == XACRO:
        root = expanded(path, given.get("packages", ()), given.get("xacro_args", {}))
    if kind == BVH:
        tree = bvh_tree(content, path.stem, where, **given)
    elif kind == MVNX:
        tree = mvnx_tree(content, path.stem, where, **given)
    elif root is None or kind == MJCF:
        tree, poses = engine_tree(path, kind or MJCF, given)
    else:
        tree = urdf_tree(root, given.get("root"))
    doubts = inertia_warnings(tree.links.values(), on_unphysical)
    body = Body(model_of(tree, where), path.stem, tree.couplings)
    body.joint_orders, body.base_joints = joint_orders(tree, from_urdf=kind in (None, XACRO)), tree.base_joints
    body.base_angles, body.base_slides, body.length_unit = tree.base_angles, tree.base_slides, tree.length_unit
    body.sha256, body.file = hashlib.sha256(content).hexdigest(), path.absolute()
    body.packages = tuple(map(os.path.abspath, given.get("packages", ())))
    body.xacro_args = dict(given.get("xacro_args", {}))
    check_against_file(body, tree, where)
    check_against_engine(body, tree, poses, where)
    doubts += massless_warning(tree)
    shape = body.shape()
    links = [link for name, link in tree.links.items() if name not in tree.frames]
    turns = np.array([body.link_pose(shape, link.name)[:3, :3] for link in links])
    doubts += hollow_warnings(links, turns, body.locked_inertia(shape), on_unphysical)
    ignored: _Doubts = [(IgnoredElementWarning, "; ".join(tree.notes))] if tree.notes else []
    return body, [*((UnphysicalInertiaWarning, doubt) for doubt in doubts), *ignored]


def _check_unused(given: dict[str, Any], where: str, options: tuple[str, ...]) -> None:
    for name in given:
        if name not in options:
            option = "--xacro" if name == "xacro_args" else f"--{name.replace('_', '-')}"
            raise ShapeError(f"{name} {_UNUSED[name].format(quoted(where))}: leave {option} out")


def _from_model(source: Any, on_unphysical: str) -> tuple[Body, _Doubts]:
    model, links, turns, doubts = checked_model(source, on_unphysical)
    body = Body(model, model.name)
    inertia = body.locked_inertia(body.shape())
    doubts += hollow_warnings(links, turns, inertia, on_unphysical, "what joint {!r} moves")
    return body, [(UnphysicalInertiaWarning, doubt) for doubt in doubts]


def pinocchio_features(names: Sequence[str]) -> dict[str, bool]:
    """Features that Pinocchio was built with, by the names of its own flags."""
    import pinocchio

    return {name: bool(getattr(pinocchio, name, False)) for name in names}
