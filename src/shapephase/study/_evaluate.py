"""The cases of a chunk, computed: by batches where these give every case the bits that it has alone, else one by one.

Batches are a family of bodies along one path (in machine code), many momenta on one deformation where only the ends
are asked for, and `final_attitudes`. The bits of a case are always those of a family of one body where inertias are
varied, and of the single call where they are not; so it does not matter who is computed together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from .. import so3
from ..arrays import Array, Integers
from ..body.body import Body
from ..body.family import BodyFamily
from ..body.loading import load_body
from ..deformation.deformation import Deformation, DeformationFamily, articulated, rigid
from ..errors import StudyError
from ..integrator import machine_code
from ..letters import printable
from ..phases.phases import split
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.body_path import in_joint_order
from ..shape_space.many_paths import final_attitudes
from ..shape_space.path_samples import path_samples
from ..shape_space.shape_path import ShapePath
from ._recipes import RigidBody, described, digests_of_body, inertia_factors, made_path
from .case import Case
from .distributions import generators
from .outputs import Output, ends_suffice, final_turn, needs_split
from .study import Study

DONE = 1
RAISED = 2
TIMED_OUT = 3
DIED = 4
NAME_LENGTH = 48
"""Of an error's class, in the store [bytes]."""
TEXT_LENGTH = 240
"""Of what it says [bytes]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Results:
    """What is known of some cases.

    Attributes
    ----------
    values : (N,) + shape of each output, NaN where a case has none
    axes : (N,) + shape of what was varied; of labels their numbers in the grid
    status : (N,)
    error_name, error_text : (N, letters) bytes
    """

    values: dict[str, Array]
    axes: dict[str, Array]
    status: Any
    error_name: Any
    error_text: Any

    @classmethod
    def empty(cls, study: Study, indices: Integers, axes: dict[str, Any] | None = None) -> Results:
        """Of cases of which nothing is known yet but what they are, and if it is given what is varied in them."""
        count, numbers = len(indices), {}
        axes = study.axis_values(indices) if axes is None else axes
        for axis in study.axes:
            own = axes[axis.name]
            if isinstance(axis.grid, tuple):
                where = {id(label): number for number, label in enumerate(axis.grid)}
                own = np.array([where[id(label)] for label in own], dtype=float)
            numbers[axis.name] = np.asarray(own, dtype=float)
        return cls(
            values={one.name: np.full((count, *one.shape), np.nan) for one in study.resolved_outputs},
            axes=numbers,
            status=np.zeros(count, dtype=np.uint8),
            error_name=np.zeros((count, NAME_LENGTH), dtype=np.uint8),
            error_text=np.zeros((count, TEXT_LENGTH), dtype=np.uint8),
        )

    def put(self, row: int, other: Results, of: int = 0) -> None:
        """Take over one case."""
        for name, values in self.values.items():
            values[row] = other.values[name][of]
        for name in ("status", "error_name", "error_text"):
            getattr(self, name)[row] = getattr(other, name)[of]

    def fail(self, row: int, status: int, name: str, text: str) -> None:
        """Say why a case has no results."""
        self.status[row] = status
        for letters, said in ((self.error_name, name), (self.error_text, text)):
            encoded = printable(said).encode()[: letters.shape[1]]
            letters[row] = 0
            letters[row, : len(encoded)] = np.frombuffer(encoded, dtype=np.uint8)


@dataclass(eq=False)
class Evaluator:
    """Computes cases of one study, and keeps what many of them share: bodies, and the path where it is one."""

    study: Study
    inputs: dict[str, str] = field(default_factory=dict)
    _bodies: dict[str, Body] = field(default_factory=dict)
    _paths: dict[Any, ShapePath] = field(default_factory=dict)
    _deformations: dict[Any, Deformation] = field(default_factory=dict)

    @cached_property
    def outputs(self) -> tuple[Output, ...]:
        """What is asked for."""
        return self.study.resolved_outputs

    def together(self, indices: Integers) -> Results:
        """All cases, by batches where that is possible."""
        values = self.study.axis_values(indices)
        found, cases = Results.empty(self.study, indices, values), self.study.some_cases(indices, values)
        for rows in self._lots(cases):
            try:
                self._group([cases[row] for row in rows], rows, found)
            except Exception:
                # Someone in it: each by itself says who.
                for row in rows:
                    self._single(cases[row], row, found)
        return found

    def alone(self, index: int) -> Results:
        """One case."""
        indices = np.array([index])
        found = Results.empty(self.study, indices)
        self._single(self.study.some_cases(indices)[0], 0, found)
        return found

    def _single(self, case: Case, row: int, found: Results) -> None:
        try:
            self._group([case], [row], found)
        except Exception as error:
            for values in found.values.values():
                values[row] = np.nan
            found.fail(row, RAISED, type(error).__name__, str(error))

    def _group(self, cases: list[Case], rows: list[int], found: Results) -> None:
        """Cases of one body, motion, tolerance and gauge; of many motions where only the ends are asked for."""
        first = cases[0]
        momenta = np.array([case.momentum for case in cases])
        attitudes = None if first.attitude is None else np.array([case.attitude for case in cases])
        if not isinstance(first.body, RigidBody) and _has_inertias(first):
            self._families(cases, rows, momenta, attitudes, found)
        elif not ends_suffice(self.outputs) and len(cases) == 1:
            self._of_motion(self._moved(first), first, rows[0], found)
        elif not ends_suffice(self.outputs):
            for case, row in zip(cases, rows, strict=True):
                self._single(case, row, found)
        elif first.joint_noise is None and all(_path_key(case) == _path_key(first) for case in cases):
            motion = reconstruct(self._deformation(first), momenta, attitudes, tolerance=first.tolerance, threads=1)
            starts = motion.initial_attitude
            self._put_ends(rows, starts, motion.final_attitude, motion.error_estimate, found)
        else:
            body = self._body(first)
            paths = (self._path(case, body) for case in cases)
            ends = final_attitudes(body, paths, momenta, attitudes, tolerance=first.tolerance)
            starts = np.eye(3) if attitudes is None else so3.rotation_argument(attitudes, "attitude")
            self._put_ends(rows, starts, ends.attitude, ends.error_estimate, found)

    def _lots(self, cases: list[Case]) -> list[list[int]]:
        """Rows that a batch takes together: those of one path, or each of its own."""
        found: list[list[int]] = []
        alone: dict[Any, list[int]] = {}
        for rows in _groups(cases):
            first = cases[rows[0]]
            if len(rows) > 1 or isinstance(first.body, RigidBody) or _has_inertias(first):
                found.append(rows)
            else:
                alone.setdefault((id(first.body), first.tolerance), []).extend(rows)
        return found + list(alone.values())

    def _families(
        self, cases: list[Case], rows: list[int], momenta: Array, attitudes: Array | None, found: Results
    ) -> None:
        """With inertias of their own: together where they share the path."""
        # Without machine code the sums of a family are those of one large product, whose order is not that of a small.
        if cases[0].joint_noise is None and machine_code.is_used():
            lots: Iterable[slice] = (slice(0, len(cases)),)
        else:
            lots = (slice(row, row + 1) for row in range(len(cases)))
        for lot in lots:
            start = None if attitudes is None else attitudes[lot]
            deformations = self._family(cases[lot])
            motions = reconstruct(deformations, momenta[lot], start, tolerance=cases[0].tolerance, threads=1)
            if ends_suffice(self.outputs):
                ends = motions.initial_attitude, motions.final_attitude, motions.error_estimate
                self._put_ends(rows[lot], *ends, found)
                continue
            for number, (case, row) in enumerate(zip(cases[lot], rows[lot], strict=True)):
                self._of_motion(motions[number], case, row, found)

    def _family(self, cases: Sequence[Case]) -> DeformationFamily:
        body = self._body(cases[0])
        masses, centres, tensors, gyration = inertia_factors(body)
        given: dict[str, Array] = {}
        if cases[0].centres is not None:
            given["centres"] = centres + gyration[:, None] * np.array([case.centres for case in cases])
        if cases[0].masses is not None:
            factors = np.array([case.masses for case in cases])
            given["masses"], given["inertias"] = factors * masses, factors[..., None, None] * tensors
        if cases[0].inertias is not None:
            own = np.array([case.inertias for case in cases])[..., None, None]
            given["inertias"] = own * given.get("inertias", tensors)
        family = body.with_inertias(given.get("masses"), given.get("centres"), given.get("inertias"))
        assert isinstance(family, BodyFamily)
        return articulated(family, self._path(cases[0], body))

    def _moved(self, case: Case) -> Motion:
        deformation = self._deformation(case)
        return reconstruct(deformation, case.momentum, case.attitude, tolerance=case.tolerance, threads=1)

    def _deformation(self, case: Case) -> Deformation:
        if isinstance(case.body, RigidBody):
            return rigid(case.body.inertia, case.body.duration)
        body = self._body(case)
        if case.joint_noise is not None:
            return articulated(body, self._path(case, body))
        key = _path_key(case)
        if key not in self._deformations:
            self._deformations.clear()
            self._deformations[key] = articulated(body, self._path(case, body))
        return self._deformations[key]

    def _body(self, case: Case) -> Body:
        name = str(case.body)
        if name not in self._bodies:
            body = load_body(case.body, **self.study.loading)
            for part, digest in digests_of_body(f"body {described(case.body)}", body).items():
                self._check(part, digest)
            self._bodies[name] = body
        return self._bodies[name]

    def _path(self, case: Case, body: Body) -> ShapePath:
        key = _path_key(case)
        if key not in self._paths:
            self._paths.clear()
            path = in_joint_order(body, made_path(case.motion, body, case.parameters))
            if path.sha256 is not None:
                self._check(f"motion {described(case.motion)}", path.sha256)
            self._paths[key] = path
        path = self._paths[key]
        if case.joint_noise is None:
            return path
        samples = path_samples(path)
        (rng,) = generators(self.study.seed, "joint_noise samples", np.array([case.index]))
        return samples.path_through(samples.values + case.joint_noise * rng.standard_normal(samples.values.shape))

    def _check(self, name: str, digest: str) -> None:
        """Raise StudyError for a file that is not the one of the study."""
        if self.inputs.get(name, digest) != digest:
            raise StudyError(f"{name}: the file here is another than the study was begun with")

    def _put_ends(self, rows: list[int], starts: Array, ends: Array, estimates: Array, found: Results) -> None:
        first = np.broadcast_to(starts, ends.shape)
        ready: dict[str, Callable[[], Array]] = {
            "final_attitude": lambda: ends,
            "error_estimate": lambda: estimates,
            "turn": lambda: np.array([final_turn(*pair) for pair in zip(first, ends, strict=True)]),
        }
        for output in self.outputs:
            found.values[output.name][rows] = ready[output.name]()
        found.status[rows] = DONE

    def _of_motion(self, motion: Motion, case: Case, row: int, found: Results) -> None:
        """What is asked of one motion; it is the case's fault if that raises."""
        try:
            parts = split(motion, case.gauge) if needs_split(self.outputs) else None
            values = [output.of(motion, parts) for output in self.outputs]
        except Exception as error:
            found.fail(row, RAISED, type(error).__name__, str(error))
            return
        for output, value in zip(self.outputs, values, strict=True):
            found.values[output.name][row] = value
        found.status[row] = DONE


def _groups(cases: list[Case]) -> list[list[int]]:
    """Rows that a batch takes together."""
    found: dict[Any, list[int]] = {}
    for row, case in enumerate(cases):
        key = (id(case.body), *_path_key(case), case.tolerance, case.gauge)
        found.setdefault(key, []).append(row)
    return list(found.values())


def _path_key(case: Case) -> tuple[Any, ...]:
    return (str(case.body), id(case.motion), *case.parameters.items())


def _has_inertias(case: Case) -> bool:
    return not (case.masses is None and case.centres is None and case.inertias is None)
