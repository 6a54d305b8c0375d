"""Bodies and motions as recipes: names, files and functions, from which any process makes the same objects."""

from __future__ import annotations

import importlib
import inspect
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import examples
from ..arguments import inertia_argument, number_argument, positive_argument
from ..arrays import Array, finite_array, lock_arrays
from ..body.body import Body
from ..body.loading import load_body
from ..display import short_repr
from ..errors import ShapePhaseError, StudyError, WrongObjectError, unknown_name
from ..examples.scenarios import MOTIONS
from ..files import no_such_file
from ..letters import what_came
from ..shape_space.files.read import read_shape_path
from ..shape_space.shape_path import ShapePath
from ._identity import body_digest, file_digest, path_digest

_LONGEST_SHOWN = 80
_NAMED = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


@dataclass(frozen=True, eq=False)
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

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what came. Raises ShapeError, SingularInertiaError, TrajectoryError."""
        tensor = inertia_argument(finite_array(self.inertia, "inertia", (3, 3))[None])[0]
        object.__setattr__(self, "inertia", tensor)
        object.__setattr__(self, "duration", positive_argument(self.duration))
        lock_arrays(self)


BodySource = str | os.PathLike[str] | RigidBody
MotionSource = str | os.PathLike[str] | Callable[..., ShapePath]


def check_body(value: object) -> None:
    """Raise WrongObjectError for what is no recipe of a body."""
    if not isinstance(value, str | os.PathLike | RigidBody):
        raise WrongObjectError(
            f"body: a name, a file or a RigidBody is needed, got {what_came(value)}: a study is sent to other "
            "processes, which load the body themselves"
        )


def check_motion(value: object) -> None:
    """Raise WrongObjectError for what is no recipe of a motion."""
    if not isinstance(value, str | os.PathLike) and (not callable(value) or isinstance(value, type)):
        raise WrongObjectError(
            f"motion: a name, a file or a function that makes a path is needed, got {what_came(value)}: a study is "
            "sent to other processes, which make the path themselves"
        )


def check_parameters(given: object) -> None:
    """Raise WrongObjectError, ShapeError for what are no named numbers."""
    if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
        raise WrongObjectError(f"parameters: numbers by their names, a dict, are needed, got {what_came(given)}")
    for name, value in given.items():
        number_argument(value, f"parameters.{name}")


def made_path(source: MotionSource, body: Body, parameters: Mapping[str, float]) -> ShapePath:
    """The path of a recipe; of a file it is read for this body."""
    if is_file(source):
        return read_shape_path(os.fspath(source), body)  # type: ignore[arg-type]
    path = motion_function(source)(**parameters)
    if not isinstance(path, ShapePath):
        raise StudyError(f"motion: the function gives a ShapePath, this gave a {type(path).__name__}")
    return path


def is_file(source: Any) -> bool:
    """Whether a motion is that of a file."""
    return isinstance(source, str | os.PathLike) and os.path.isfile(source)


def motion_function(source: MotionSource) -> Callable[..., ShapePath]:
    """The function that makes a path of named numbers: given itself, as "module:function", or by a name of the library.

    Raises UnknownNameError, InputFileNotFoundError, StudyError.
    """
    if callable(source):
        return source
    name = os.fspath(source)
    if ":" in name:
        return imported(name, "motion")
    if name in examples.__all__ and inspect.isfunction(found := getattr(examples, name)):
        return found
    if name in MOTIONS:
        return MOTIONS[name].path
    if Path(name).suffix:
        raise no_such_file(name[:_LONGEST_SHOWN])
    raise unknown_name("motion (no such file either)", name[:_LONGEST_SHOWN], MOTIONS)


def imported(name: str, what: str) -> Callable[..., Any]:
    """A function by "module:function". Raises StudyError."""
    module, _, attribute = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), attribute)
    except Exception as error:
        raise StudyError(f"{what}: {name[:_LONGEST_SHOWN]!r} cannot be imported ({error})") from None
    if not callable(found):
        raise StudyError(f"{what}: {name[:_LONGEST_SHOWN]!r} is no function")
    return found


def parameter_names(source: MotionSource) -> tuple[str, ...]:
    """What a motion's function can be given; nothing for a file."""
    if is_file(source):
        return ()
    return tuple(inspect.signature(motion_function(source)).parameters)


def unset_parameters(source: MotionSource, given: Iterable[str]) -> list[str]:
    """What it has to be given, and is not."""
    if is_file(source):
        return []
    parameters = inspect.signature(motion_function(source)).parameters.values()
    needed = [one.name for one in parameters if one.default is one.empty and one.kind in _NAMED]
    return [name for name in needed if name not in set(given)]


def body_digests(source: BodySource, loading: Mapping[str, Any]) -> dict[str, str]:
    """SHA-256 of a body's file and of the numbers of its links. Raises what `load_body` raises for a name."""
    if isinstance(source, RigidBody):
        return {}
    name, found = f"body {described(source)}", {}
    if os.path.isfile(source):
        found[name] = file_digest(source)
    try:
        body = load_body(source, **loading)
    except ShapePhaseError:
        if not found:
            raise
        # A file that cannot be read is a status of its cases.
        return found
    return digests_of_body(name, body)


def digests_of_body(name: str, body: Body) -> dict[str, str]:
    """SHA-256 of the file and of the links of a body that is loaded."""
    return {name: body.sha256 or "", f"links of {name}": body_digest(body)}


def motion_digests(source: MotionSource, parameters: Mapping[str, float]) -> dict[str, str]:
    """SHA-256 of a motion's file, or of samples of a path that its function makes. Raises StudyError."""
    name = f"motion {described(source)}"
    if is_file(source):
        return {name: file_digest(source)}  # type: ignore[arg-type]
    try:
        return {f"samples of {name}": path_digest(motion_function(source)(**parameters))}
    except Exception:
        # A function that raises is a status of its cases.
        return {}


def described(source: Any) -> Any:
    """A recipe as JSON can hold it."""
    if isinstance(source, RigidBody):
        return {"inertia": np.asarray(source.inertia).tolist(), "duration": source.duration}
    while isinstance(source, partial):
        source = source.func
    if callable(source):
        return f"{source.__module__}:{getattr(source, '__qualname__', type(source).__name__)}"
    return os.fspath(source)


def inertia_factors(body: Body) -> tuple[Array, Array, Array, Array]:
    """Masses, centres, inertias and radii of gyration of the moving parts: (k,), (k, 3), (k, 3, 3), (k,)."""
    parts = body.moving_parts
    masses = np.array([part.mass for part in parts])
    tensors = np.array([part.inertia for part in parts])
    traces = np.trace(tensors, axis1=1, axis2=2)
    gyration = np.sqrt(np.divide(0.5 * traces, masses, out=np.zeros_like(masses), where=masses > 0.0))
    return masses, np.array([part.centre for part in parts]), tensors, gyration


def part_number(body: Body, link: str) -> int:
    """Which moving part a link begins. Raises UnknownNameError."""
    leads = [part.links[0] for part in body.moving_parts]
    if link not in leads:
        raise unknown_name(f"moving part of {body.name}", link, leads)
    return leads.index(link)
