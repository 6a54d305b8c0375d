"""Names to bodies: those we ship, those of example-robot-data, and any URDF file."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from .body import Body, body_from_model, body_from_urdf
from .errors import MissingExtraError, ModelFileError, unknown_name
from .urdf import read_urdf

_EXAMPLE = "example:"
_CHILD_SECONDS = 60


def load_body(source: str | os.PathLike[str] | Any, *, on_unphysical: str = "error", isolate: bool = False) -> Body:
    """Load a free-floating body.

    Parameters
    ----------
    source : a path to a URDF file; a name from `robot_names()` such as "cat"; "example:human", a body of the
        installed example-robot-data; or a `pinocchio.Model` whose root joint is a free-flyer
    on_unphysical : "error" or "warn", for a link whose inertia has a negative principal moment
    isolate : load a file in a process of its own first, so that even a crash of the parser is an error

    Raises
    ------
    InputFileNotFoundError, UnknownNameError
        If there is no such file, or no such name.
    ModelFileError, UnphysicalInertiaError
        If the file cannot be used, or a link cannot exist.
    MissingExtraError
        For "example:..." without example-robot-data.
    """
    if not isinstance(source, str | os.PathLike):
        return _from_model(source, on_unphysical)
    text = os.fspath(source)
    if isolate:
        _try_in_child(text, on_unphysical)
    if text.startswith(_EXAMPLE):
        return _from_file(example_file(text.removeprefix(_EXAMPLE)), on_unphysical)
    names = robot_names()
    if text in names and not Path(text).is_file():
        return _from_file(robots_folder() / f"{text}.urdf", on_unphysical)
    if not text.endswith((".urdf", ".xml")) and os.sep not in text and not Path(text).exists():
        raise unknown_name("body (no such file either)", text, (*names, "example:<name>"))
    return _from_file(Path(text), on_unphysical)


def robots_folder() -> Path:
    """The folder of the bodies and motions that come with the library, in a wheel as in a checkout."""
    inside = Path(__file__).parent / "robots"
    return inside if inside.is_dir() else Path(__file__).parents[2] / "robots"


def robot_names() -> tuple[str, ...]:
    """The names of the bodies that come with the library."""
    return tuple(sorted(p.stem for p in robots_folder().glob("*.urdf")))


def example_names() -> tuple[str, ...]:
    """The names of the bodies of example-robot-data, where it is installed; otherwise none."""
    return tuple(sorted(_example_files()))


def example_file(name: str) -> Path:
    """The URDF file of a body of example-robot-data. Raises MissingExtraError, UnknownNameError."""
    files = _example_files()
    if not files:
        raise MissingExtraError(
            f"'example:{name}' needs the example-robot-data package: pip install 'shapephase[robots]'"
        )
    if name not in files:
        raise unknown_name("body of example-robot-data", name, sorted(files))
    return files[name]


def _example_files() -> dict[str, Path]:
    for entry in sys.path:
        folder = Path(entry) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
        if folder.is_dir():
            return {path.stem: path for path in sorted(folder.rglob("*.urdf"), reverse=True)}
    return {}


def _try_in_child(source: str, on_unphysical: str) -> None:
    """Load in a child process; what it raises is raised again by the parent, what kills it is named here."""
    code = "import sys, shapephase; shapephase.load_body(sys.argv[1], on_unphysical=sys.argv[2])"
    try:
        child = subprocess.run(
            [sys.executable, "-c", code, source, on_unphysical], capture_output=True, timeout=_CHILD_SECONDS
        )
    except subprocess.TimeoutExpired:
        raise ModelFileError(f"{source}: loading it took more than {_CHILD_SECONDS} s and was stopped") from None
    if child.returncode < 0:
        raise ModelFileError(f"{source}: the parser crashed on it (signal {-child.returncode})")


def _from_file(path: Path, on_unphysical: str) -> Body:
    urdf = read_urdf(path)
    return body_from_urdf(urdf, path.stem, str(path), on_unphysical)


def _from_model(model: Any, on_unphysical: str) -> Body:
    import pinocchio

    if not isinstance(model, pinocchio.Model):  # pyright: ignore[reportAttributeAccessIssue]
        raise ModelFileError(f"a body is loaded from a path, a name or a pinocchio.Model, got {type(model).__name__}")
    return body_from_model(model, model.name, f"model {model.name!r}", on_unphysical)
