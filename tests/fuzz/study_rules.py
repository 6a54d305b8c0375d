"""What is wrong with a study or a store that was accepted: TOML and Zarr read once more."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

_SCALES = {"deg": np.pi / 180.0, "mm": 1e-3, "ms": 1e-3}
_SAME = 1e-12
"""Of a number that was multiplied by a factor: some roundings."""
_STATUSES = range(5)
_KNOWN = (
    *("body", "motion", "rigid", "over", "functions", "outputs", "draws", "seed", "chunk", "momentum", "attitude"),
    *("tolerance", "gauge", "parameters", "time_limit", "root", "root_body", "packages", "length_unit"),
    "person_mass",
)
_NAMES = ("body", "motion", "gauge")


def study_faults(file: Path, study: Any) -> Iterator[str]:
    """Every entry is known and of its kind, numbers are finite, and the cases are those of the grids."""
    said = tomllib.loads(file.read_bytes().decode())
    unknown = set(said) - set(_KNOWN)
    if unknown:
        yield f"entries {unknown}"
    for name in ("root", "root_body", "packages"):
        if name in said and ("rigid" in said or not said[name]) and said[name] != []:
            yield f"{name} = {said[name]!r}"
    over = said.get("over", {})
    plain = ("momentum", "attitude", "tolerance", "time_limit", "seed", "draws", "chunk")
    numbers = {name: said[name] for name in plain if name in said}
    numbers |= {f"parameters.{name}": value for name, value in said.get("parameters", {}).items()}
    numbers |= {f"rigid.{name}": value for name, value in said.get("rigid", {}).items()}
    for name, axis in over.items():
        numbers |= {
            f"over.{name}.{key}": value
            for key, value in _flat(axis)
            if key.rpartition(".")[2] not in ("unit", "distribution") and name not in _NAMES
        }
    for name, value in numbers.items():
        if not _is_number(value):
            yield f"{name} = {value!r} is no number"
            return
    cases = said.get("draws", 1)
    for axis in over.values():
        if isinstance(axis, Mapping) and "distribution" not in axis:
            cases *= axis["count"] if "from" in axis else len(axis["values"])
    if study.cases != cases:
        yield f"{study.cases} cases, and the grids have {cases}"
        return
    for index in (0, cases - 1):
        yield from _case_faults(study.case(index), said, over, last=index > 0)


def _flat(axis: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(axis, Mapping):
        for key, value in axis.items():
            if isinstance(value, Mapping):
                yield from ((f"{key}.{inner}", entry) for inner, entry in _flat(value))
            else:
                yield key, value


def _is_number(value: Any) -> bool:
    if isinstance(value, list):
        return all(map(_is_number, value))
    if isinstance(value, float):
        return math.isfinite(value)
    return isinstance(value, int) and not isinstance(value, bool)


def _case_faults(case: Any, said: Mapping[str, Any], over: Mapping[str, Any], *, last: bool) -> Iterator[str]:
    # What is drawn may be no tolerance; then its case has none of the results.
    drawn = "distribution" in over.get("tolerance", {})
    if not np.isfinite(case.momentum).all() or case.momentum.shape != (3,):
        yield f"momentum {case.momentum}"
    if not np.isfinite(case.tolerance) or (case.tolerance <= 0.0 and not drawn):
        yield f"tolerance {case.tolerance}"
    momentum = np.array(said.get("momentum", [0.0] * 3), dtype=float)
    for name, axis in over.items():
        if "distribution" in axis or name in _NAMES:
            continue
        scale = _SCALES.get(axis.get("unit"), 1.0)
        values = [axis["from"], axis["to"]] if "from" in axis else axis["values"]
        if "from" in axis and axis["count"] == 1:
            values = values[:1]
        value = scale * values[-1 if last else 0]
        found = {"tolerance": case.tolerance, "joint_noise": case.joint_noise} | dict(case.parameters)
        if name.startswith("momentum_"):
            momentum["xyz".index(name[-1])] = value
        elif name in found and not np.isclose(found[name], value, rtol=_SAME, atol=0.0):
            yield f"{name} {found[name]}, and {value} is said"
        elif name in ("masses", "inertias") and not np.allclose(getattr(case, name), value, rtol=_SAME, atol=0.0):
            yield f"{name} {getattr(case, name)}, and {value} is said"
    known = "momentum" not in over and not _drawn_momentum(over)
    if known and not np.allclose(case.momentum, momentum, rtol=_SAME, atol=0.0):
        yield f"momentum {case.momentum}, and {momentum} is said"


def _drawn_momentum(over: Mapping[str, Any]) -> bool:
    return any(name.startswith("momentum_") and "distribution" in axis for name, axis in over.items())


def looked_at(where: str) -> dict[str, Any]:
    """All that a store is asked for."""
    from shapephase.study import open_study
    from shapephase.study.export import study_table

    store = open_study(where)
    return {
        "cases": store.cases,
        "counts": store.counts(),
        "statuses": store.statuses(),
        "errors": store.errors(),
        "missing": store.missing_chunks(),
        "table": study_table(store),
    }


def store_faults(place: Path, found: Mapping[str, Any]) -> Iterator[str]:
    """Every case has a status that there is, the one that Zarr reads, and a row of the table."""
    import zarr

    statuses = np.asarray(zarr.open_group(place, mode="r")["status"][:])
    if statuses.shape != (found["cases"],) or not np.isin(statuses, _STATUSES).all():
        yield f"{found['cases']} cases of statuses {statuses}"
        return
    if sum(found["counts"].values()) != found["cases"] or not np.array_equal(statuses, found["statuses"]):
        yield f"counts {found['counts']} of {statuses}"
    if len(found["table"]) != found["cases"]:
        yield f"{len(found['table'])} rows"
    if len(found["errors"]) != np.count_nonzero(statuses > 1):
        yield f"errors {found['errors']}"
