"""Names to bodies: those we ship, those of example-robot-data, and files in all formats that are read."""

from __future__ import annotations

import hashlib
import os
import sys
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import check_choice, positive_argument
from ..errors import (
    IgnoredElementWarning,
    MissingExtraError,
    ModelFileError,
    ShapeError,
    UnphysicalInertiaWarning,
    WrongObjectError,
    unknown_name,
)
from ..letters import what_came
from ._cross_check import check_against_file
from ._model_tree import checked_model, model_of
from .body import Body
from .engines.engine_tree import check_against_engine, engine_tree, expanded
from .engines.formats import BVH, FORMATS, MJCF, MVNX, XACRO, format_of
from .formats.bvh import bvh_tree, mvnx_tree
from .formats.foreign import foreign_kind
from .formats.urdf import macro_of, urdf_tree
from .formats.xml_text import quoted, read_file, xml_tree
from .joint_orders import joint_orders
from .link_tree import hollow_warnings, inertia_warnings, massless_warning

_EXAMPLE = "example:"
_ENDINGS = (".urdf", ".xml", ".mjcf", ".xacro", ".osim", ".biomod", ".bvh", ".mvnx")
"""Endings of names that are names of files, in small letters."""
_OF_URDF = ("packages", "root")
"""Options of a URDF."""
_OF_BVH = ("length_unit", "person_mass")
"""Options of a BVH file."""


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

    What comes back has been compared with the numbers of the file: mass, links, joints, and the locked inertia and
    internal momentum at a random shape, computed without Pinocchio, to 1e-12.

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
        None: a single one is an error, as of an arm that is bolted down; two or more are the free base, with a warning.
        Their columns are the recorded base
    root_body : the body that floats, with all that hangs on it, of an MJCF, an OpenSim or a bioMod file; needed where
        the file has several trees
    packages : folders in which the packages that a URDF or a xacro file names, `package://NAME`, `$(find NAME)`, are
        looked for, before those around the file
    xacro_args : values of the arguments of a xacro file by name, as {"payload": "true"}
    length_unit : of a BVH file, which says none: the metres of a unit, 0.01 for centimetres
    person_mass : of the human whose skeleton a BVH or MVNX file has [kg]; None: 70 kg, with a warning

    Raises
    ------
    InputFileNotFoundError, UnknownNameError
        If there is no such file, or no such name.
    ModelFileError, UnphysicalInertiaError
        If the file cannot be used, or a link cannot exist; the message begins with file and line.
    ShapeError
        If `root` or one of those after it is given for a file that has no such choice.
    TrajectoryError
        If `length_unit` or `person_mass` is not above 0.
    MissingExtraError
        For "example:..." without example-robot-data, and for a format whose engine is not installed.

    Warns
    -----
    UnphysicalInertiaWarning
        Once for each kind of doubt about inertias, with the names of the links.
    IgnoredElementWarning
        For what the file says and a free body of joints does not take up.

    Examples
    --------
    >>> cat = sp.load_body("cat")
    >>> cat.name, round(cat.mass, 6), cat.n_shape
    ('cat', 4.0, 23)
    """
    check_choice(on_unphysical, "value of on_unphysical", ("error", "warn"))
    given = loading_options(
        root=root,
        root_body=root_body,
        packages=packages,
        xacro_args=xacro_args,
        length_unit=length_unit,
        person_mass=person_mass,
    )
    if isinstance(source, str | os.PathLike):
        path = _path_of(os.fspath(source))
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
    """Those of these arguments of `load_body` that are given, checked. Raises ShapePhaseError."""
    check_choice(on_unphysical, "value of on_unphysical", ("error", "warn"))
    if root is not None:
        check_choice(root, "value of root", ("free",))
    if not isinstance(root_body, str | None):
        raise WrongObjectError(f"root_body: the name of a body is needed, got {what_came(root_body)}")
    several = isinstance(packages, Sequence) and not isinstance(packages, str | bytes)
    if not several or not all(isinstance(folder, str | os.PathLike) and os.fspath(folder) for folder in packages):
        raise WrongObjectError(f"packages: folders in a list are needed, got {what_came(packages)}")
    if not isinstance(xacro_args, Mapping | None) or not all(isinstance(name, str) for name in xacro_args or ()):
        raise WrongObjectError(
            f'xacro_args: values by name are needed, such as {{"payload": "true"}}, got {what_came(xacro_args)}'
        )
    if length_unit is not None:
        length_unit = positive_argument(length_unit, "length_unit", "a number of metres")
    if person_mass is not None:
        person_mass = positive_argument(person_mass, "person_mass", "a mass in kg")
    found = {
        "on_unphysical": on_unphysical if on_unphysical != "error" else None,
        "root": root,
        "root_body": root_body,
        "packages": [os.fspath(folder) for folder in packages] or None,
        "xacro_args": {name: _as_xacro(value) for name, value in (xacro_args or {}).items()} or None,
        "length_unit": length_unit,
        "person_mass": person_mass,
    }
    return {name: value for name, value in found.items() if value is not None}


def _as_xacro(value: Any) -> str:
    """A value as it is typed behind `:=`."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def pinocchio_features(names: Sequence[str]) -> dict[str, bool]:
    """What Pinocchio was built with, by the names of its own flags."""
    import pinocchio

    return {name: bool(getattr(pinocchio, name, False)) for name in names}


def robots_folder() -> Path:
    """The folder of the bodies and motions that come with the library, in a wheel as in a checkout.

    Examples
    --------
    >>> (sp.body.robots_folder() / "cat.urdf").exists()
    True
    """
    inside = Path(__file__).parents[1] / "robots"
    return inside if inside.is_dir() else Path(__file__).parents[3] / "robots"


def robot_names() -> tuple[str, ...]:
    """The names of the bodies that come with the library.

    Examples
    --------
    >>> len(sp.robot_names()), sp.robot_names()[0]
    (8, 'astronaut')
    """
    return tuple(sorted(p.stem for p in robots_folder().glob("*.urdf")))


def example_names() -> tuple[str, ...]:
    """The names of the bodies of example-robot-data, where it is installed; otherwise none.

    Examples
    --------
    >>> isinstance(sp.body.example_names(), tuple)  # empty without example-robot-data
    True
    """
    return tuple(sorted(_example_files()))


def example_file(name: str) -> Path:
    """The URDF file of a body of example-robot-data. Raises MissingExtraError, UnknownNameError.

    Examples
    --------
    >>> if "talos" in sp.body.example_names():
    ...     print(sp.body.example_file("talos").suffix)
    ... else:
    ...     print(".urdf")
    .urdf
    """
    files = _example_files()
    if not files:
        raise MissingExtraError(
            f"'example:{name}' needs the example-robot-data package: pip install 'shapephase[bodies]'"
        )
    if name not in files:
        raise unknown_name("body of example-robot-data", name, sorted(files))
    return files[name]


def example_folder() -> Path | None:
    """The folder of example-robot-data, where it is installed."""
    folders = (Path(entry) / "cmeel.prefix" / "share" / "example-robot-data" for entry in sys.path)
    return next((folder for folder in folders if (folder / "robots").is_dir()), None)


def _example_files() -> dict[str, Path]:
    folder = example_folder()
    if folder is None:
        return {}
    return {path.stem: path for path in sorted((folder / "robots").rglob("*.urdf"), reverse=True)}


def _path_of(source: str | bytes) -> Path:
    """The file of a source."""
    text = os.fsdecode(source)
    if text.startswith(_EXAMPLE):
        return example_file(text.removeprefix(_EXAMPLE))
    names = robot_names()
    if text in names and not os.path.isfile(text):
        return robots_folder() / f"{text}.urdf"
    name = bool(text) and "\0" not in text and os.sep not in text and not text.lower().endswith(_ENDINGS)
    if name and not os.path.exists(text):
        raise unknown_name("body (no such file either)", quoted(text), (*names, "example:<name>"))
    return Path(text)


def _from_file(
    content: bytes, path: Path, on_unphysical: str, given: dict[str, Any]
) -> tuple[Body, list[tuple[type[Warning], str]]]:
    where, poses = str(path), []
    owned = format_of(content)
    if owned is None and (kind := foreign_kind(content)) is not None:
        raise ModelFileError(f"{where}:1: this is {kind}")
    root = xml_tree(content, where) if owned in (None, MJCF) else None
    if root is not None and root.tag == "mujoco":
        owned = MJCF
    if root is not None and root.tag == "robot" and macro_of(root) is not None:
        owned = XACRO
    options = {BVH: _OF_BVH, MVNX: _OF_BVH[1:], **{name: known.options for name, known in FORMATS.items()}}
    _check_unused(given, where, options.get(owned or "", _OF_URDF))
    if owned == XACRO:
        root = expanded(path, given.get("packages", ()), given.get("xacro_args", {}))
    if owned == BVH:
        tree = bvh_tree(content, path.stem, where, **given)
    elif owned == MVNX:
        tree = mvnx_tree(content, path.stem, where, **given)
    elif root is None or owned == MJCF:
        tree, poses = engine_tree(path, owned or MJCF, given)
    else:
        tree = urdf_tree(root, given.get("root"))
    doubts = inertia_warnings(tree.links.values(), on_unphysical)
    body = Body(model_of(tree, where), path.stem, tree.couplings)
    body.joint_orders, body.base_joints = joint_orders(tree, from_urdf=owned in (None, XACRO)), tree.base_joints
    body.base_angles, body.base_slides, body.length_unit = tree.base_angles, tree.base_slides, tree.length_unit
    body.sha256, body.file = hashlib.sha256(content).hexdigest(), path.absolute()
    body.packages = tuple(map(os.path.abspath, given.get("packages", ())))
    body.xacro_args = dict(given.get("xacro_args", {}))
    check_against_file(body, tree, where)
    check_against_engine(body, tree, poses, where)
    doubts += massless_warning(tree)
    shape = body.shape()
    parts = [link for name, link in tree.links.items() if name not in tree.frames]
    turns = np.array([body.link_pose(shape, link.name)[:3, :3] for link in parts])
    doubts += hollow_warnings(parts, turns, body.locked_inertia(shape), on_unphysical)
    found: list[tuple[type[Warning], str]] = [(UnphysicalInertiaWarning, doubt) for doubt in doubts]
    if tree.notes:
        found.append((IgnoredElementWarning, "; ".join(tree.notes)))
    return body, found


def _check_unused(given: dict[str, Any], where: str, options: tuple[str, ...]) -> None:
    why = {
        "packages": "is for URDF and xacro files; {} names none",
        "xacro_args": "is for xacro files; {} has no macros",
        "root": "is for URDF, xacro and MJCF files; {} has one root, which floats",
        "root_body": "is for MJCF, OpenSim and bioMod files; {} has one root, which floats",
        "length_unit": "is for BVH files; {} has metres",
        "person_mass": "is for BVH and MVNX files; {} has masses of its own",
    }
    for name in given:
        if name not in options:
            option = "--xacro" if name == "xacro_args" else f"--{name.replace('_', '-')}"
            raise ShapeError(f"{name} {why[name].format(quoted(where))}: leave {option} out")


def _from_model(model: Any, on_unphysical: str) -> tuple[Body, list[tuple[type[Warning], str]]]:
    import pinocchio

    if not isinstance(model, pinocchio.Model):  # pyright: ignore[reportAttributeAccessIssue]
        raise ModelFileError(f"a body is loaded from a path, a name or a pinocchio.Model, got {type(model).__name__}")
    where = f"model {model.name!r}"
    checked, moved, doubts = checked_model(model, where, on_unphysical)
    _name_bare_parts(checked)
    body = Body(checked, model.name)
    pin: Any = pinocchio
    data = checked.createData()
    pin.forwardKinematics(checked, data, pin.neutral(checked))
    turns = np.array([data.oMi[number].rotation for number in range(1, checked.njoints)])
    inertia = body.locked_inertia(body.shape())
    doubts += hollow_warnings(moved, turns, inertia, on_unphysical, "what joint {!r} moves")
    return body, [(UnphysicalInertiaWarning, doubt) for doubt in doubts]


def _name_bare_parts(model: Any) -> None:
    """A link, named after the joint, for whatever a joint moves without a link of its own, so that it has a pose."""
    import pinocchio

    pin: Any = pinocchio
    named = {frame.parentJoint for frame in model.frames if frame.type == pin.FrameType.BODY}
    for joint in range(1, model.njoints):
        if joint not in named and not model.existFrame(model.names[joint], pin.FrameType.BODY):
            model.addBodyFrame(model.names[joint], joint, pin.SE3.Identity(), 0)
