"""Names of bodies, and where their files are: those that we ship, and those of example-robot-data."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from ..errors import MissingExtraError, unknown_name
from .formats.xml_text import quoted

_EXAMPLE = "example:"
_ENDINGS = (".urdf", ".xml", ".mjcf", ".xacro", ".osim", ".biomod", ".bvh", ".mvnx")  # of names of files


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


def file_of(source: str | bytes) -> Path:
    """The file of a body by its path or its name. Raises UnknownNameError, MissingExtraError."""
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
