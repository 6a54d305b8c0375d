"""Bodies and motions as recipes: names, files and functions, from which any process makes equal objects."""

from __future__ import annotations

import importlib
import inspect
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import examples
from ..arguments import inertia_argument, positive_argument
from ..arrays import Array, finite_array, lock_arrays
from ..body.body import Body
from ..body.loading import load_body
from ..display import frozen
from ..errors import ShapePhaseError, StudyError, WrongObjectError, unknown_name
from ..examples.scenarios import MOTIONS
from ..files import no_such_file
from ..letters import shortened, value_text
from ..shape_space.files.read import read_shape_path
from ..shape_space.shape_path import ShapePath
from ._identity import body_digest, file_digest, path_digest

_LONGEST_SHOWN = 80  # characters of a name in a message


@frozen
class RigidBody:
    """A body that keeps its shape, as a study takes it.

    Attributes
    ----------
    inertia : (3, 3) [kg m^2]
    duration : of its motion [s]

    Examples
    --------
    >>> over = {"momentum": sp.study.Directions(1.0)}
    >>> sp.study.Study(sp.study.RigidBody(np.diag([1.0, 2.0, 2.5]), 3.0), over=over, draws=1_000_000).cases
    1000000
    """

    inertia: ArrayLike
    duration: float

    def __post_init__(self) -> None:
        """Check what came. Raises ShapeError, SingularInertiaError, TrajectoryError."""
        tensor = inertia_argument(finite_array(self.inertia, "inertia", (3, 3))[None])[0]
        object.__setattr__(self, "inertia", tensor)
        object.__setattr__(self, "duration", positive_argument(self.duration))
        lock_arrays(self)


BodySource = str | os.PathLike[str] | RigidBody
MotionSource = str | os.PathLike[str] | Callable[..., ShapePath]


def check_source(kind: str, source: object) -> None:
    """Raise WrongObjectError for an object that is not a recipe of this kind, "body" or "motion"."""
    made_by = isinstance(source, RigidBody) if kind == "body" else callable(source) and not isinstance(source, type)
    if not isinstance(source, str | os.PathLike) and not made_by:
        other = "a RigidBody" if kind == "body" else "a function that makes a path"
        raise WrongObjectError(
            f"{kind}: a name, a file or {other} is needed, got {value_text(source)}: a study is sent to other "
            f"processes, which make the {kind} themselves"
        )


def is_file(source: Any) -> bool:
    """Return True for a motion that is read from a file."""
    return isinstance(source, str | os.PathLike) and os.path.isfile(source)


def made_path(source: MotionSource, body: Body, parameters: Mapping[str, float]) -> ShapePath:
    """Return the path of a recipe; a file is read for this body."""
    if is_file(source):
        return read_shape_path(os.fspath(source), body)  # type: ignore[arg-type]
    path = motion_function(source)(**parameters)
    if not isinstance(path, ShapePath):
        raise StudyError(f"motion: the function gives a ShapePath, this gave a {type(path).__name__}")
    return path


def motion_function(source: MotionSource) -> Callable[..., ShapePath]:
    """Return the function that makes a path of named numbers, which may be given as "module:function" or by name.

    Raises UnknownNameError, InputFileNotFoundError, StudyError.
    """
    if callable(source):
        return source
    name = os.fspath(source)
    if ":" in name:
        return imported(name, "motion")
    if name in examples.__all__ and inspect.isfunction(function := getattr(examples, name)):
        return function
    if name in MOTIONS:
        return MOTIONS[name].path
    if Path(name).suffix:
        raise no_such_file(name[:_LONGEST_SHOWN])
    raise unknown_name("motion (no such file either)", name[:_LONGEST_SHOWN], MOTIONS)


def imported(name: str, entry: str) -> Callable[..., Any]:
    """Return a function by "module:function". Raises StudyError."""
    module, _, attribute = name.partition(":")
    shown = repr(shortened(name, _LONGEST_SHOWN))
    try:
        function = getattr(importlib.import_module(module), attribute)
    except Exception as error:
        raise StudyError(f"{entry}: {shown} cannot be imported ({error})") from None
    if not callable(function):
        raise StudyError(f"{entry}: {shown} is not a function")
    return function


def parameters_of(source: MotionSource) -> dict[str, bool]:
    """Return the parameters of a motion's function, True where one has to be given; a file has none."""
    if is_file(source):
        return {}
    parameters = inspect.signature(motion_function(source)).parameters.values()
    variadic = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return {par.name: par.default is par.empty and par.kind not in variadic for par in parameters}


def body_inputs(source: BodySource, loading: Mapping[str, Any]) -> dict[str, str]:
    """Return SHA-256 of a body's file and of the numbers of its links. Raises what `load_body` raises for a name."""
    if isinstance(source, RigidBody):
        return {}
    try:
        return loaded_body_inputs(source, load_body(source, **loading))
    except ShapePhaseError:
        if not os.path.isfile(source):
            raise
        # A file that cannot be read is a status of its cases.
        return {f"body {described(source)}": file_digest(source)}


def loaded_body_inputs(source: BodySource, body: Body) -> dict[str, str]:
    """Return SHA-256 of the file and of the links of a loaded body."""
    name = f"body {described(source)}"
    return {name: body.sha256 or "", f"links of {name}": body_digest(body)}


def motion_inputs(source: MotionSource, parameters: Mapping[str, float]) -> dict[str, str]:
    """Return SHA-256 of a motion's file, or of samples of a path that its function makes. Raises StudyError."""
    name = f"motion {described(source)}"
    if is_file(source):
        return {name: file_digest(source)}  # type: ignore[arg-type]
    try:
        return {f"samples of {name}": path_digest(motion_function(source)(**parameters))}
    except Exception:
        # A function that raises is a status of its cases.
        return {}


def described(source: Any) -> Any:
    """Return a recipe as JSON can hold it."""
    if isinstance(source, RigidBody):
        return {"inertia": np.asarray(source.inertia).tolist(), "duration": source.duration}
    while isinstance(source, partial):
        source = source.func
    if callable(source):
        return f"{source.__module__}:{getattr(source, '__qualname__', type(source).__name__)}"
    return os.fspath(source)


def inertia_factors(body: Body) -> tuple[Array, Array, Array, Array]:
    """Return masses, centres, inertias and radii of gyration of the moving parts: (k,), (k, 3), (k, 3, 3), (k,)."""
    parts = body.moving_parts
    masses, tensors = np.array([part.mass for part in parts]), np.array([part.inertia for part in parts])
    traces = np.trace(tensors, axis1=1, axis2=2)
    gyration = np.sqrt(np.divide(0.5 * traces, masses, out=np.zeros_like(masses), where=masses > 0.0))
    return masses, np.array([part.centre for part in parts]), tensors, gyration


def part_number(body: Body, link: str) -> int:
    """Return which moving part a link begins. Raises UnknownNameError."""
    leads = [part.links[0] for part in body.moving_parts]
    if link not in leads:
        raise unknown_name(f"moving part of {body.name}", link, leads)
    return leads.index(link)
