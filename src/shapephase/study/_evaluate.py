"""Computing the cases of a chunk: by batches where these give every case the bits that it has alone, else one by one.

Batches are a family of bodies along one path, and many momenta on one deformation where only the ends are needed. The
bits of a case are always those of a family of one body where inertias are varied, and of the single call where they are
not: they do not depend on the other cases of the batch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from ..body.body import Body
from ..body.loading import load_body
from ..deformation.deformation import Deformation, DeformationFamily, articulated, rigid
from ..error_bars.recorded_flight import motion_from_recording
from ..errors import StudyError
from ..letters import printable
from ..phases.phases import split
from ..reconstruction.reconstruction import Motion, reconstruct
from ..shape_space.body_path import in_joint_order
from ..shape_space.files.read import read_recorded_motion
from ..shape_space.path_samples import path_samples
from ..shape_space.shape_path import ShapePath
from ..warning_filters import quiet
from ._identity import file_digest
from ._recipes import RigidBody, described, inertia_factors, loaded_body_inputs, made_path
from .cases import Case, CaseTable
from .distributions import generators
from .outputs import ends_of

STATUS: Mapping[str, int] = {"missing": 0, "done": 1, "raised": 2, "timed_out": 3, "died": 4}
"""Numbers in `status`: not computed yet, done, an error was raised, the time limit was reached, its process died.

Examples
--------
>>> sp.study.STATUS["done"]
1
"""
DONE = STATUS["done"]
LETTERS = {"error_name": 48, "error_text": 240}  # bytes in the store

Results = dict[str, Any]
"""Rows (N,) + shape by the name of the array in the store: outputs, what is varied, status, error name and text."""


def empty_results(study: CaseTable, indices: Integers, values: Mapping[str, Array] | None = None) -> Results:
    """Return rows of cases that are not computed yet; `values` are their `axis_values`, where these are known."""
    count = len(indices)
    return {
        **{output.name: np.full((count, *output.shape), np.nan) for output in study.resolved_outputs},
        **(study.axis_values(indices) if values is None else values),
        "status": np.zeros(count, dtype=np.uint8),
        **{name: np.zeros((count, length), dtype=np.uint8) for name, length in LETTERS.items()},
    }


def fail(study: CaseTable, results: Results, row: int, status: str, name: str, text: str) -> None:
    """Record why a case has no results."""
    for output in study.resolved_outputs:
        results[output.name][row] = np.nan
    results["status"][row] = STATUS[status]
    for array, words in (("error_name", name), ("error_text", text)):
        results[array][row] = letters(words, LETTERS[array])


def letters(text: str, length: int) -> Any:
    """Return a text as bytes in UTF-8, cut or filled with zeros to this length."""
    encoded = printable(text).encode()[:length]
    return np.frombuffer(encoded.ljust(length, b"\0"), dtype=np.uint8)


@dataclass(eq=False)
class Evaluator:
    """Computes cases of one study, and keeps what many of them share: bodies, and the path where it is one."""

    study: CaseTable
    inputs: Mapping[str, str] = field(default_factory=dict)
    _bodies: dict[str, Body] = field(default_factory=dict)
    _paths: dict[Any, ShapePath] = field(default_factory=dict)
    _deformations: dict[Any, Deformation] = field(default_factory=dict)
    _is_closed: bool = False

    def chunk(self, number: int) -> Results:
        """Return the results of a chunk."""
        with quiet():
            return self.together(np.arange(*self.study.chunk_range(number)))

    def close(self) -> None:
        """End at the next batch, from any thread."""
        self._is_closed = True

    def together(self, indices: Integers) -> Results:
        """Return the results of cases, by batches where that is possible."""
        values = self.study.axis_values(indices)
        results, cases = empty_results(self.study, indices, values), self.study.some_cases(indices, values)
        for rows in self._batches(cases):
            self._compute([cases[row] for row in rows], rows, results)
        return results

    def alone(self, index: int) -> Results:
        """Return the results of one case."""
        results = empty_results(self.study, indices := np.array([index]))
        self._compute(self.study.some_cases(indices), [0], results)
        return results

    @cached_property
    def _needs(self) -> set[str]:
        return {output.needs for output in self.study.resolved_outputs}

    def _batches(self, cases: list[Case]) -> list[list[int]]:
        """Return rows that are computed together: those of one path, for ends alone or with inertias of their own."""
        groups: dict[Any, list[int]] = {}
        for row, case in enumerate(cases):
            has_own_path = self.study.recording is not None or case.joint_noise is not None
            is_alone = has_own_path or (self._needs != {"ends"} and not _has_own_inertias(case))
            key = row if is_alone else (id(case.body), *_path_key(case), case.tolerance, case.gauge)
            groups.setdefault(key, []).append(row)
        return list(groups.values())

    def _compute(self, cases: list[Case], rows: list[int], results: Results) -> None:
        """Compute a batch; where that fails its cases are computed one by one, and the one at fault has a status."""
        if self._is_closed:
            raise KeyboardInterrupt
        try:
            self._compute_batch(cases, rows, results)
        except Exception as error:
            if len(rows) == 1:
                fail(self.study, results, rows[0], "raised", type(error).__name__, str(error))
                return
            for case, row in zip(cases, rows, strict=True):
                self._compute([case], [row], results)

    def _compute_batch(self, cases: list[Case], rows: list[int], results: Results) -> None:
        first = cases[0]
        if self.study.recording is not None:
            self._put_motion(self._fitted(first), first, rows[0], results)
            return
        settings: dict[str, Any] = {"tolerance": first.tolerance, "threads": 1}
        momenta = np.array([case.momentum for case in cases])
        attitudes = None if first.attitude is None else np.array([case.attitude for case in cases])
        if _has_own_inertias(first):
            motions = reconstruct(self._family(cases), momenta, attitudes, **settings)
            if self._needs == {"ends"}:
                self._put_ends(rows, *ends_of(motions), results)
                return
            for motion, case, row in zip(motions, cases, rows, strict=True):
                self._put_motion(motion, case, row, results)
        elif self._needs != {"ends"}:
            motion = reconstruct(self._deformation(first), first.momentum, first.attitude, **settings)
            self._put_motion(motion, first, rows[0], results)
        else:
            motion = reconstruct(self._deformation(first), momenta, attitudes, **settings)
            self._put_ends(rows, *ends_of(motion), results)

    def _put_ends(self, rows: list[int], starts: Array, ends: Array, estimates: Array, results: Results) -> None:
        each = list(zip(np.broadcast_to(starts, ends.shape), ends, estimates, strict=True))
        for output in self.study.resolved_outputs:
            results[output.name][rows] = [output.function(*case_ends) for case_ends in each]
        results["status"][rows] = DONE

    def _put_motion(self, motion: Motion, case: Case, row: int, results: Results) -> None:
        try:
            parts = split(motion, case.gauge) if "split" in self._needs else None
            values = {output.name: output.of(motion, parts) for output in self.study.resolved_outputs}
        except Exception as error:
            # Only this case is at fault, not the batch.
            fail(self.study, results, row, "raised", type(error).__name__, str(error))
            return
        for name, value in values.items():
            results[name][row] = value
        results["status"][row] = DONE

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
            factors = np.array([case.inertias for case in cases])
            given["inertias"] = factors[..., None, None] * given.get("inertias", tensors)
        return articulated(body.with_inertias(**given), self._path(cases[0], body))  # type: ignore[return-value]

    def _deformation(self, case: Case) -> Deformation:
        if isinstance(case.body, RigidBody):
            return rigid(case.body.inertia, case.body.duration)
        body, key = self._body(case), (None if case.joint_noise is None else case.index, *_path_key(case))
        if key not in self._deformations:
            self._deformations = {key: articulated(body, self._path(case, body))}
        return self._deformations[key]

    def _fitted(self, case: Case) -> Motion:
        """The motion of a recording, with the momentum that fits its base."""
        body, name = self._body(case), f"motion {described(case.motion)}"
        self._check(name, file_digest(case.motion))
        recorded = read_recorded_motion(case.motion, body, **self.study.reading_options(case.motion))
        flown = motion_from_recording(body, recorded, tolerance=case.tolerance)
        if flown.fitted is None:
            raise StudyError(
                f"{name}: nothing of the base is recorded, to which a momentum could be fitted; leave `recording` out "
                "and give the momentum"
            )
        return flown.motion

    def _body(self, case: Case) -> Body:
        name = str(case.body)
        if name not in self._bodies:
            body = load_body(case.body, **self.study.loading)
            for entry, digest in loaded_body_inputs(case.body, body).items():
                self._check(entry, digest)
            self._bodies[name] = body
        return self._bodies[name]

    def _path(self, case: Case, body: Body) -> ShapePath:
        key = _path_key(case)
        if key not in self._paths:
            path = in_joint_order(body, made_path(case.motion, body, case.parameters))
            if path.sha256 is not None:
                self._check(f"motion {described(case.motion)}", path.sha256)
            self._paths = {key: path}
        path = self._paths[key]
        if case.joint_noise is None:
            return path
        samples = path_samples(path)
        (rng,) = generators(self.study.seed, "joint_noise samples", np.array([case.index]))
        return samples.path_through(samples.values + case.joint_noise * rng.standard_normal(samples.values.shape))

    def _check(self, name: str, digest: str) -> None:
        """Raise StudyError for a file that differs from that of the study."""
        if self.inputs.get(name, digest) != digest:
            raise StudyError(f"{name}: the file here is another than the study was begun with")


def _path_key(case: Case) -> tuple[Any, ...]:
    return (str(case.body), id(case.motion), *case.parameters.items())


def _has_own_inertias(case: Case) -> bool:
    return not (case.masses is None and case.centres is None and case.inertias is None)
