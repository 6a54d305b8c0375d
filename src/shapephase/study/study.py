"""A study as a recipe: a body, a motion, what is varied, and what is to be known of each case."""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from .. import so3
from ..arguments import check_function, number_argument, tolerance_argument, vector_argument
from ..arrays import Array, Integers
from ..body.loading import load_body, loading_options
from ..deformation.frames import gauge_link
from ..display import short_repr
from ..errors import ShapePhaseError, StudyError, WrongObjectError
from ..letters import what_came
from ._axes import COMPONENTS, LABELS, OF_PARTS, UNITS, Axis, check_labels, checked_axis, start_attitudes
from ._identity import function_digests
from ._recipes import (
    BodySource,
    MotionSource,
    RigidBody,
    body_digests,
    check_body,
    check_motion,
    check_parameters,
    described,
    inertia_factors,
    is_file,
    motion_digests,
    motion_function,
    parameter_names,
    part_number,
    unset_parameters,
)
from .case import Case
from .outputs import Output, outputs_argument

if TYPE_CHECKING:
    from .progress import StudyProgress
    from .store import StudyStore

MOST_CASES = 1_000_000_000
"""Their statuses alone are a gigabyte."""
MOST_OF_A_CHUNK = 100_000
"""Cases that are in memory at once, with room for some kB each."""
_TAKEN = ("seal", "status", "error_name", "error_text", "processor", "case", "chunk")


@dataclass(frozen=True, eq=False)
class Study:
    """The same motion many times, with other bodies, momenta, paths.

    Every entry of `over` is a grid (a sequence of values) or a distribution. The cases are all combinations of the
    grids, in the order in which they are named, the last one fastest, and of each so many `draws`. What is drawn for a
    case depends on the seed, the name of the axis and the index of the case, so that results depend neither on chunks
    nor on who computes them.

    Attributes
    ----------
    body : a name, a file or a `RigidBody`
    motion : a name, a file, a function that makes a `ShapePath` of named numbers, or "module:function"; None for a
        rigid body
    over : what is varied, by its name: "momentum" (3,) or "momentum_x", "momentum_y", "momentum_z" [kg m^2/s];
        "attitude" (4,), a quaternion x y z w; "masses" and "inertias", factors of those of each moving part, and
        "centres" (3,), by how much their centres of mass are moved in radii of gyration, or "masses.LINK" of one part;
        "joint_noise", the standard deviation of noise at the samples of the path [rad or m]; "tolerance" [rad];
        "body", "motion" and "gauge", lists of them; and any parameter of the motion's function
    outputs : names of `OUTPUTS`, or `Output` of a function of the motion
    draws : of each point of the grids
    seed : of the random numbers
    chunk : cases that are computed and stored together
    momentum, attitude, tolerance, gauge, parameters : of what is not varied; the attitude a quaternion x y z w,
        None: the identity, also along motions of the library that commands begin otherwise
    time_limit : of one case [s]; None: none
    version : of the functions of the motion and the outputs, a text that changes when their results do; None: they are
        compared by their code and all that it refers to when the study is resumed
    root, root_body, packages, xacro_args, on_unphysical : how the bodies' files are read, as for `load_body`
    length_unit, person_mass : of the bodies' BVH files, as for `load_body` [m, kg]

    Raises
    ------
    StudyError, UnknownNameError, ShapeError, InputFileNotFoundError
        For what cannot be computed as it is described. A file of a body or a motion that turns out to be damaged is a
        status of its cases.

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1], "masses": sp.study.LogNormal(0.05)},
    ...                        outputs=("turn",), draws=3, chunk=2)
    >>> store = study.run("masses.zarr", workers=0)
    >>> print(store.counts()["done"], np.degrees(store.values("turn")[0]).round(1))
    6 178.6
    """

    body: BodySource
    motion: MotionSource | None = None
    over: Mapping[str, Any] = field(default_factory=dict)
    outputs: Sequence[str | Output] = ("final_attitude", "error_estimate")
    draws: int = field(default=1, kw_only=True)
    seed: int = field(default=0, kw_only=True)
    chunk: int = field(default=500, kw_only=True)
    momentum: ArrayLike = field(default=(0.0, 0.0, 0.0), kw_only=True)
    attitude: ArrayLike | None = field(default=None, kw_only=True)
    tolerance: float = field(default=1e-9, kw_only=True)
    gauge: str = field(default="horizontal", kw_only=True)
    parameters: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    time_limit: float | None = field(default=None, kw_only=True)
    version: str | None = field(default=None, kw_only=True)
    root: str | None = field(default=None, kw_only=True)
    root_body: str | None = field(default=None, kw_only=True)
    packages: Sequence[str | os.PathLike[str]] = field(default=(), kw_only=True)
    xacro_args: Mapping[str, str] | None = field(default=None, kw_only=True)
    on_unphysical: str = field(default="error", kw_only=True)
    length_unit: float | None = field(default=None, kw_only=True)
    person_mass: float | None = field(default=None, kw_only=True)

    __repr__ = short_repr

    def __post_init__(self) -> None:
        """Check what came."""
        check_parameters(self.parameters)
        for name, most in (("draws", MOST_CASES), ("chunk", MOST_OF_A_CHUNK), ("seed", None)):
            _check_whole(name, getattr(self, name), 0 if name == "seed" else 1, most)
        object.__setattr__(self, "momentum", vector_argument(self.momentum, "momentum", unit="kg m^2/s"))
        if self.attitude is not None:
            so3.quat_argument(self.attitude, "attitude")
        tolerance_argument(self.tolerance)
        gauge_link(self.gauge)
        if self.time_limit is not None and not number_argument(self.time_limit, "time_limit", "s") > 0.0:
            raise StudyError(f"time_limit: seconds above 0 are needed, got {what_came(self.time_limit)}")
        if self.version is not None and not isinstance(self.version, str):
            raise WrongObjectError(f"version: a text is needed, got {what_came(self.version)}")
        if isinstance(self.body, RigidBody) and self.loading:
            raise StudyError(f"{next(iter(self.loading))}: a rigid body is not read from a file")
        if self.cases > MOST_CASES:
            raise StudyError(f"{self.cases} cases; at most {MOST_CASES} fit into one study")
        _ = self.resolved_outputs, self.inputs

    def __getstate__(self) -> dict[str, Any]:
        """The recipe alone: what was made of it is made anew."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @cached_property
    def axes(self) -> tuple[Axis, ...]:
        """What is varied, in its order."""
        if not isinstance(self.over, Mapping):
            raise StudyError(f"over: names and what they are varied by are needed, got {what_came(self.over)}")
        for name in self.over:
            if not isinstance(name, str):
                raise StudyError(f"over: a name is needed for what is varied, got {what_came(name)}")
            if name in LABELS:
                check_labels(name, self.over[name])
        for source in self._bodies:
            check_body(source)
        for source in self._motions:
            check_motion(source)
        self._check_motions()
        rigid = isinstance(self.body, RigidBody)
        not_for_rigid = ("motion", "joint_noise", "masses", "centres", "inertias")
        for name in self.over:
            if rigid and name.partition(".")[0] in not_for_rigid:
                raise StudyError(f"over.{name}: a rigid body without links has none")
        if "momentum" in self.over and any(name in self.over for name in COMPONENTS):
            raise StudyError("over.momentum: it is varied as a whole or by its components, not both")
        return tuple(checked_axis(name, one, self._parts, self._known_parameters) for name, one in self.over.items())

    @cached_property
    def resolved_outputs(self) -> tuple[Output, ...]:
        """What is known of each case."""
        return outputs_argument(self.outputs, (*_TAKEN, *(axis.name for axis in self.axes)))

    @property
    def loading(self) -> dict[str, Any]:
        """Arguments of `load_body` for its bodies."""
        return loading_options(
            on_unphysical=self.on_unphysical,
            root=self.root,
            root_body=self.root_body,
            packages=self.packages,
            xacro_args=self.xacro_args,
            length_unit=self.length_unit,
            person_mass=self.person_mass,
        )

    @property
    def grid_shape(self) -> tuple[int, ...]:
        """How many values each grid has, and last the draws."""
        return (*(len(axis.grid) for axis in self.axes if axis.grid is not None), self.draws)

    @property
    def cases(self) -> int:
        """How many there are."""
        return math.prod(self.grid_shape)

    @property
    def chunks(self) -> int:
        """How many there are, of which the last may be shorter."""
        return -(-self.cases // self.chunk)

    def chunk_range(self, number: int) -> tuple[int, int]:
        """The first case of a chunk, and the first after it."""
        return number * self.chunk, min((number + 1) * self.chunk, self.cases)

    @cached_property
    def inputs(self) -> dict[str, str]:
        """SHA-256 by name of all that its values depend on beside its numbers: bodies, motions, functions."""
        found = {}
        for source in self._bodies:
            found |= body_digests(source, self.loading)
        parameters = dict(self.some_cases(np.array([0]))[0].parameters) if self._motions else {}
        for source in self._motions:
            found |= motion_digests(source, parameters)
        return found | self.function_inputs

    @cached_property
    def function_inputs(self) -> dict[str, str]:
        """SHA-256 of the functions of the user and all that they refer to; nothing where a version is given."""
        named = {f"output {one.name}": one.function for one in self.outputs if isinstance(one, Output)}
        for source in self._motions:
            if not is_file(source):
                named[f"motion {described(source)}"] = motion_function(source)
        functions = {} if self.version is not None else named
        return {part: digest for name, one in functions.items() for part, digest in function_digests(name, one).items()}

    @cached_property
    def description(self) -> dict[str, Any]:
        """All that its results depend on, as JSON can hold it."""
        return {
            "body": described(self.body),
            "motion": None if self.motion is None else described(self.motion),
            "over": {name: _plain(one) for name, one in self.over.items()},
            "outputs": [[one.name, list(one.shape), one.unit] for one in self.resolved_outputs],
            "draws": self.draws,
            "seed": self.seed,
            "chunk": self.chunk,
            "momentum": _plain(self.momentum),
            "attitude": None if self.attitude is None else _plain(self.attitude),
            "tolerance": self.tolerance,
            "gauge": self.gauge,
            "parameters": _plain(self.parameters),
            "time_limit": self.time_limit,
            "inputs": self.inputs,
            "version": self.version,
            **self.loading,
        }

    @property
    def hash(self) -> str:
        """SHA-256 of the description: two studies with the same have the same results."""
        return hashlib.sha256(json.dumps(self.description, sort_keys=True).encode()).hexdigest()

    def case(self, index: int) -> Case:
        """The numbers of one case. Raises StudyError for an index that there is not."""
        if not isinstance(index, int | np.integer) or not 0 <= index < self.cases:
            raise StudyError(f"case {what_came(index)}: there are {self.cases}, from 0 on")
        return self.some_cases(np.array([index]))[0]

    def some_cases(self, indices: Integers, values: Mapping[str, Any] | None = None) -> list[Case]:
        """The numbers of some cases; `values` are their `axis_values`, where these are known."""
        values = self.axis_values(indices) if values is None else values
        momentum = np.tile(np.asarray(self.momentum, dtype=float), (len(indices), 1))
        momentum = np.asarray(values.get("momentum", momentum), dtype=float)
        for column, name in enumerate(COMPONENTS):
            if name in values:
                momentum[:, column] = values[name]
        base = None if self.attitude is None else so3.quat_argument(self.attitude, "attitude")
        attitude = [base] * len(indices)
        if "attitude" in values:
            attitude = list(start_attitudes(values["attitude"], base))
        parts = {name: self._of_parts(name, values, len(indices)) for name in OF_PARTS}
        varied = {
            name: values[name] for name in self._known_parameters if name in values and name not in _NOT_PARAMETERS
        }
        found = []
        for row, index in enumerate(indices.tolist()):
            own = {name: float(numbers[row]) for name, numbers in varied.items()}
            found.append(
                Case(
                    index=index,
                    body=values["body"][row] if "body" in values else self.body,
                    motion=values["motion"][row] if "motion" in values else self.motion,
                    parameters={**self.parameters, **own},
                    momentum=momentum[row],
                    attitude=attitude[row],
                    tolerance=float(values["tolerance"][row]) if "tolerance" in values else self.tolerance,
                    gauge=values["gauge"][row] if "gauge" in values else self.gauge,
                    joint_noise=float(values["joint_noise"][row]) if "joint_noise" in values else None,
                    **{name: None if one is None else one[row] for name, one in parts.items()},
                )
            )
        return found

    def axis_values(self, indices: Integers) -> dict[str, Any]:
        """What is varied, in some cases: (N,) + shape by the name of the axis, or labels."""
        places = np.unravel_index(indices, self.grid_shape)
        found, grids = {}, 0
        for axis in self.axes:
            place = places[grids] if axis.grid is not None else indices
            grids += axis.grid is not None
            found[axis.name] = axis.values(self.seed, indices, place)
        return found

    def run(
        self,
        store: str | os.PathLike[str],
        client: Any = None,
        *,
        workers: int | None = None,
        resume: bool = False,
        retry: str | None = None,
        progress: Callable[[StudyProgress], Any] | None = None,
    ) -> StudyStore:
        """Compute what is missing, and store it.

        Parameters
        ----------
        store : a folder, which the study makes (`out.zarr`)
        client : a `distributed.Client` of any cluster; None: processes of this machine
        workers : how many processes; None: one for each processor; 0: in this process, without time limits, and where
            a case that ends its process ends this one. A cluster has its own
        resume : go on with a store that is there already, which must be this study's
        retry : "failed": go on with a store, and compute its chunks with failed cases again
        progress : called with a `StudyProgress` after each chunk; if it returns something true, the run stops, as by
            Ctrl-C: what is stored is kept

        Raises
        ------
        StudyStoreError
            If there is a store and `resume` is not given, or it is another study's, or in use.
        OutputFileError
            If the store cannot be written to.
        SchedulerLostError
            If the cluster cannot be reached any more.
        MissingExtraError
            Without Zarr.
        RunStopped
            If `progress` stopped it.
        """
        from .run import run_study

        if progress is not None:
            check_function(progress, "progress", "a function that takes a StudyProgress")
        return run_study(self, store, client, workers=workers, resume=resume, retry=retry, progress=progress)

    @property
    def _bodies(self) -> tuple[BodySource, ...]:
        return tuple(self.over["body"]) if "body" in self.over else (self.body,)

    @property
    def _motions(self) -> tuple[MotionSource, ...]:
        if self.motion is None:
            return ()
        return tuple(self.over["motion"]) if "motion" in self.over else (self.motion,)

    @cached_property
    def _parts(self) -> int:
        """Moving parts, where they matter: of the first body that can be loaded."""
        if not any(name.partition(".")[0] in OF_PARTS for name in self.over):
            return 0
        fault: ShapePhaseError | None = None
        for source in self._bodies:
            try:
                body = load_body(source, **self.loading)
            except ShapePhaseError as error:
                fault = fault or error
                continue
            for name in self.over:
                lead, _, link = name.partition(".")
                if lead in OF_PARTS and link:
                    part_number(body, link)
            return len(inertia_factors(body)[0])
        assert fault is not None
        raise fault

    @cached_property
    def _known_parameters(self) -> tuple[str, ...]:
        names = [parameter_names(source) for source in self._motions]
        return tuple(dict.fromkeys(name for one in names for name in one))

    def _check_motions(self) -> None:
        if isinstance(self.body, RigidBody) != (self.motion is None):
            raise StudyError("motion: a body of joints needs one, a rigid body none")
        if self.motion is None and self.parameters:
            raise StudyError(f"parameters.{next(iter(self.parameters))}: a rigid body has no motion to give it to")
        for source in self._motions:
            given = (*self.parameters, *self.over)
            missing = unset_parameters(source, given)
            if missing:
                raise StudyError(f"motion {described(source)}: parameter {missing[0]} has no value; vary or give it")
            for name in self.parameters:
                if is_file(source) or name not in parameter_names(source):
                    raise StudyError(f"parameters.{name}: the motion {described(source)} has none of this name")

    def _of_parts(self, name: str, values: Mapping[str, Any], count: int) -> Array | None:
        """Factors of all moving parts: (N, k) or (N, k, 3); None: the body's own."""
        single = {axis.name: axis for axis in self.axes if axis.name.startswith(f"{name}.")}
        if name not in values and not single:
            return None
        neutral = np.zeros if name == "centres" else np.ones
        found = np.array(values[name]) if name in values else neutral((count, self._parts, *OF_PARTS[name]))
        if single:
            body = load_body(self._bodies[0], **self.loading)
            for axis in single:
                found[:, part_number(body, axis.partition(".")[2])] = values[axis]
        return found


_NOT_PARAMETERS = (*LABELS, *UNITS)


def _check_whole(name: str, value: Any, least: int, most: int | None) -> None:
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < least or (most is not None and value > most):
        limit = f"from {least}" + ("" if most is None else f" to {most}")
        raise StudyError(f"{name}: a whole number {limit} is needed, got {what_came(value)}")


def _plain(value: Any) -> Any:
    if is_dataclass(value) and not isinstance(value, type) and hasattr(value, "drawn"):
        return {"distribution": type(value).__name__, **{key: _plain(one) for key, one in asdict(value).items()}}
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, str | bool | int | float) or value is None:
        return value
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    return described(value) if callable(value) or isinstance(value, os.PathLike | RigidBody) else repr(value)
