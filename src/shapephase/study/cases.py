"""The cases of a study: how many, in which order, and the numbers of each."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, field, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_mapping, number_argument, tolerance_argument, vector_argument
from ..arrays import Array, Integers
from ..body.body import Body
from ..body.loading import load_body, loading_options
from ..deformation.frames import gauge_link
from ..display import frozen
from ..errors import ShapePhaseError, StudyError, WrongObjectError, unknown_name
from ..letters import value_text
from ..shape_space.files.options import ReadingOptions, check_options
from . import _recipes
from ._axes import (
    COMPONENTS,
    LABELS,
    OF_PARTS,
    QUANTITIES,
    Axis,
    check_labels,
    check_name,
    checked_axis,
    start_attitudes,
)
from ._identity import function_digests
from ._recipes import BodySource, MotionSource, RigidBody, described
from .distributions import Distribution
from .outputs import Output, outputs_argument

MOST_CASES = 1_000_000_000  # their statuses alone are a gigabyte
MOST_CASES_OF_A_CHUNK = 100_000  # in memory at once, with some kB each
LOADING = ("root", "root_body", "packages", "xacro_args", "on_unphysical", "length_unit", "person_mass")
"""Attributes that are arguments of `load_body`."""
_TAKEN = ("seal", "status", "error_name", "error_text", "processor", "case", "chunk")
_NOT_OF_RIGID = ("motion", "joint_noise", *OF_PARTS)


@frozen(kw_only=True)
class Case:
    """The numbers that make one case, from which the library's own calls compute it.

    Made by `Study.case`.

    Attributes
    ----------
    index : of the case
    body, motion : descriptions from which they are made
    parameters : of the motion's function
    momentum : (3,) [kg m^2/s]
    attitude : (3, 3) at the start; None: the identity
    tolerance : [rad]
    gauge : of the split
    masses, inertias : (k,) factors of the moving parts' masses, and of their inertias beside those, or None
    centres : (k, 3) by how much their centres of mass are moved, in radii of gyration, or None
    joint_noise : standard deviation of the noise of the path's samples [rad or m], or None
    """

    index: int
    body: Any
    motion: Any
    parameters: Mapping[str, float]
    momentum: Array
    attitude: Array | None
    tolerance: float
    gauge: str
    masses: Array | None = None
    centres: Array | None = None
    inertias: Array | None = None
    joint_noise: float | None = None


@frozen
class CaseTable:
    """Base of `Study`, which describes the attributes: all that its values depend on, checked."""

    body: BodySource
    motion: MotionSource | None = None
    over: Mapping[str, Any] = field(default_factory=dict)
    outputs: Sequence[str | Output] = ("final_attitude", "error_estimate")
    _: KW_ONLY
    draws: int = 1
    seed: int = 0
    chunk: int = 500
    momentum: ArrayLike = (0.0, 0.0, 0.0)
    attitude: ArrayLike | None = None
    tolerance: float = 1e-9
    gauge: str = "horizontal"
    parameters: Mapping[str, float] = field(default_factory=dict)
    time_limit: float | None = None
    version: str | None = None
    root: str | None = None
    root_body: str | None = None
    packages: Sequence[str | os.PathLike[str]] = ()
    xacro_args: Mapping[str, str] | None = None
    on_unphysical: str = "error"
    length_unit: float | None = None
    person_mass: float | None = None
    recording: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        """Check what came."""
        if not isinstance(self.parameters, Mapping) or not all(isinstance(name, str) for name in self.parameters):
            raise WrongObjectError(
                f"parameters: numbers by name, a dict, are needed, got {value_text(self.parameters)}"
            )
        for name, value in self.parameters.items():
            number_argument(value, f"parameters.{name}")
        for name, least, most in (("draws", 1, MOST_CASES), ("chunk", 1, MOST_CASES_OF_A_CHUNK), ("seed", 0, None)):
            _check_whole(name, getattr(self, name), least, most)
        object.__setattr__(self, "momentum", vector_argument(self.momentum, "momentum", unit="kg m^2/s"))
        if self.attitude is not None:
            so3.quat_argument(self.attitude, "attitude")
        tolerance_argument(self.tolerance)
        gauge_link(self.gauge)
        if self.time_limit is not None and not number_argument(self.time_limit, "time_limit", "s") > 0.0:
            raise StudyError(f"time_limit: seconds above 0 are needed, got {value_text(self.time_limit)}")
        if self.version is not None and not isinstance(self.version, str):
            raise WrongObjectError(f"version: a text is needed, got {value_text(self.version)}")
        if isinstance(self.body, RigidBody) and self.loading:
            raise StudyError(f"{next(iter(self.loading))}: a rigid body is not read from a file")
        if self.cases > MOST_CASES:
            raise StudyError(f"{self.cases} cases; at most {MOST_CASES} fit into one study")
        if self.recording is not None:
            self._check_recording(self.recording)
        _ = self.resolved_outputs, self.inputs

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: what was made of them is made anew."""
        return {attribute.name: getattr(self, attribute.name) for attribute in fields(self)}

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """What is varied, in its order."""
        if not isinstance(self.over, Mapping):
            raise StudyError(f"over: names and what they are varied by are needed, got {value_text(self.over)}")
        for name in self.over:
            check_name(name, "over")
            if name in LABELS:
                check_labels(name, self.over[name])
        for kind, sources in (("body", self._bodies), ("motion", self._motions)):
            for source in sources:
                _recipes.check_source(kind, source)
        self._check_motions()
        for name in self.over:
            if isinstance(self.body, RigidBody) and name.partition(".")[0] in _NOT_OF_RIGID:
                raise StudyError(f"over.{name}: a rigid body without links has none")
        if "momentum" in self.over and any(name in self.over for name in COMPONENTS):
            raise StudyError("over.momentum: it is varied as a whole or by its components, not both")
        return tuple(
            checked_axis(name, given, self._parts, self._known_parameters) for name, given in self.over.items()
        )

    @cached_property
    def resolved_outputs(self) -> tuple[Output, ...]:
        """What is computed of each case."""
        return outputs_argument(self.outputs, (*_TAKEN, *(axis.name for axis in self.axes)))

    @property
    def loading(self) -> dict[str, Any]:
        """Arguments of `load_body` for its bodies."""
        return loading_options(**{name: getattr(self, name) for name in LOADING})

    def reading_options(self, source: MotionSource) -> dict[str, Any]:
        """Arguments of `read_recorded_motion` for a file: those of all files, and its own by its name."""
        given = self.recording or {}
        common = {name: value for name, value in given.items() if name in ReadingOptions.__annotations__}
        return common | dict(given.get(os.path.basename(described(source)), {}))

    def _check_recording(self, given: Mapping[str, Any]) -> None:
        check_mapping(given, "recording", "arguments of `read_recorded_motion` by name, such as {'flight': 'all'}")
        for source in self._motions:
            if not _recipes.is_file(source):
                raise StudyError(f"recording: it is for motions from files, {described(source)} is none")
        for name in self.over:
            if name not in (*LABELS, "tolerance"):
                raise StudyError(
                    f"over.{name}: with a recording, momentum and attitude are fitted to the base of each file, and "
                    f"only {', '.join(LABELS)} and tolerance are varied"
                )
        files = [os.path.basename(described(source)) for source in self._motions]
        for name, value in given.items():
            if name not in ReadingOptions.__annotations__ and name not in files:
                raise unknown_name("entry of recording", name, (*ReadingOptions.__annotations__, *files))
            if name in files:
                check_mapping(value, f"recording[{name!r}]", "arguments of `read_recorded_motion` by name")
                check_options(value, ReadingOptions, "read_recorded_motion")

    @property
    def grid_shape(self) -> tuple[int, ...]:
        """Number of values of each grid, and last the draws."""
        return (*(axis.grid_length for axis in self.axes if axis.grid_length is not None), self.draws)

    @property
    def cases(self) -> int:
        """Number of cases."""
        return math.prod(self.grid_shape)

    @property
    def chunks(self) -> int:
        """Number of chunks, of which the last may be shorter."""
        return -(-self.cases // self.chunk)

    def chunk_range(self, number: int) -> tuple[int, int]:
        """Return the first case of a chunk, and the first after it."""
        return number * self.chunk, min((number + 1) * self.chunk, self.cases)

    @cached_property
    def inputs(self) -> dict[str, str]:
        """SHA-256 by name of all that its values depend on beside its numbers: bodies, motions, functions."""
        digests = {}
        for source in self._bodies:
            digests |= _recipes.body_inputs(source, self.loading)
        parameters = dict(self.some_cases(np.array([0]))[0].parameters) if self._motions else {}
        for source in self._motions:
            digests |= _recipes.motion_inputs(source, parameters)
        return digests | self.function_inputs

    @cached_property
    def function_inputs(self) -> dict[str, str]:
        """SHA-256 of the functions of the user and all that they refer to; empty where a version is given."""
        functions = {f"output {output.name}": output.function for output in self.outputs if isinstance(output, Output)}
        for source in self._motions:
            if not _recipes.is_file(source):
                functions[f"motion {described(source)}"] = _recipes.motion_function(source)
        digests = {}
        for name, function in functions.items() if self.version is None else ():
            digests |= function_digests(name, function)
        return digests

    @cached_property
    def description(self) -> dict[str, Any]:
        """All that its results depend on, as JSON can hold it."""
        left_out = {*LOADING, "outputs"} | ({"recording"} if self.recording is None else set())
        names = [attribute.name for attribute in fields(self) if attribute.name not in left_out]
        whole = {
            **{name: getattr(self, name) for name in names},
            "outputs": [(output.name, output.shape, output.unit) for output in self.resolved_outputs],
            "inputs": self.inputs,
            **self.loading,
        }
        return json.loads(json.dumps(whole, default=_plain))

    @property
    def hash(self) -> str:
        """SHA-256 of the description: two studies of one hash have equal results."""
        return hashlib.sha256(json.dumps(self.description, sort_keys=True).encode()).hexdigest()

    def case(self, index: int) -> Case:
        """Return the numbers of one case. Raises StudyError for an index beyond the last."""
        if not isinstance(index, int | np.integer) or not 0 <= index < self.cases:
            raise StudyError(f"case {value_text(index)}: there are {self.cases}, from 0 on")
        return self.some_cases(np.array([index]))[0]

    def some_cases(self, indices: Integers, values: Mapping[str, Array] | None = None) -> list[Case]:
        """Return the numbers of some cases; `values` are their `axis_values`, where these are known."""
        values = self.axis_values(indices) if values is None else values
        count = len(indices)
        columns: dict[str, Any] = {name: [getattr(self, name)] * count for name in (*LABELS, "tolerance")}
        columns["momentum"] = momentum = np.array(values.get("momentum", np.tile(self.momentum, (count, 1))))
        for column, name in enumerate(COMPONENTS):
            momentum[:, column] = values.get(name, momentum[:, column])
        base = None if self.attitude is None else so3.quat_argument(self.attitude, "attitude")
        columns["attitude"] = start_attitudes(values["attitude"], base) if "attitude" in values else [base] * count
        columns |= {name: values[name].tolist() for name in ("tolerance", "joint_noise") if name in values}
        for axis in self.axes:
            if axis.labels:
                columns[axis.name] = [axis.labels[int(place)] for place in values[axis.name]]
        for name in OF_PARTS:
            if any(axis.name.partition(".")[0] == name for axis in self.axes):
                columns[name] = self._of_parts(name, values, count)
        varied = [name for name in self._known_parameters if name in values and name not in (*LABELS, *QUANTITIES)]
        return [
            Case(
                index=index,
                parameters={**self.parameters, **{name: float(values[name][row]) for name in varied}},
                **{name: column[row] for name, column in columns.items()},
            )
            for row, index in enumerate(indices.tolist())
        ]

    def axis_values(self, indices: Integers) -> dict[str, Array]:
        """Return what is varied, in some cases: (N,) + shape by the name of the axis; labels by their places."""
        grid_places = iter(np.unravel_index(indices, self.grid_shape))
        return {
            axis.name: axis.values(self.seed, indices, indices if axis.grid_length is None else next(grid_places))
            for axis in self.axes
        }

    @property
    def _bodies(self) -> tuple[BodySource, ...]:
        return tuple(self.over["body"]) if "body" in self.over else (self.body,)

    @property
    def _motions(self) -> tuple[MotionSource, ...]:
        if self.motion is None:
            return ()
        return tuple(self.over["motion"]) if "motion" in self.over else (self.motion,)

    @cached_property
    def _first_body(self) -> Body:
        """The first body that can be loaded, whose moving parts are varied."""
        faults = []
        for source in self._bodies:
            try:
                return load_body(source, **self.loading)  # type: ignore[arg-type]
            except ShapePhaseError as error:
                faults.append(error)
        raise faults[0]

    @cached_property
    def _parts(self) -> int:
        """Moving parts, where they matter; links that are varied alone are checked."""
        varied = [name.partition(".") for name in self.over if name.partition(".")[0] in OF_PARTS]
        for _, _, link in varied:
            if link:
                _recipes.part_number(self._first_body, link)
        return len(self._first_body.moving_parts) if varied else 0

    @cached_property
    def _known_parameters(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(name for source in self._motions for name in _recipes.parameters_of(source)))

    def _check_motions(self) -> None:
        if isinstance(self.body, RigidBody) != (self.motion is None):
            raise StudyError("motion: a body of joints needs one, a rigid body none")
        if self.motion is None and self.parameters:
            raise StudyError(f"parameters.{next(iter(self.parameters))}: a rigid body has no motion to give it to")
        for source in self._motions:
            known = _recipes.parameters_of(source)
            for name, is_needed in known.items():
                if is_needed and name not in (*self.parameters, *self.over):
                    raise StudyError(f"motion {described(source)}: parameter {name} has no value; vary or give it")
            for name in self.parameters:
                if name not in known:
                    raise StudyError(f"parameters.{name}: the motion {described(source)} has none of this name")

    def _of_parts(self, name: str, values: Mapping[str, Array], count: int) -> Array:
        """Return factors or displacements of all moving parts: (N, k) or (N, k, 3)."""
        neutral = np.zeros((count, self._parts, 3)) if name == "centres" else np.ones((count, self._parts))
        numbers = np.array(values.get(name, neutral))
        for axis in self.axes:
            lead, _, link = axis.name.partition(".")
            if lead == name and link:
                numbers[:, _recipes.part_number(self._first_body, link)] = values[axis.name]
        return numbers


def _check_whole(name: str, value: Any, least: int, most: int | None) -> None:
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < least or (most is not None and value > most):
        limit = f"from {least}" + ("" if most is None else f" to {most}")
        raise StudyError(f"{name}: a whole number {limit} is needed, got {value_text(value)}")


def _plain(value: Any) -> Any:
    """Return what stands for an object in JSON."""
    if isinstance(value, Distribution):
        return {"distribution": type(value).__name__, **vars(value)}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return dict(value)
    is_source = callable(value) or isinstance(value, os.PathLike | RigidBody)
    return described(value) if is_source else np.asarray(value).tolist()
