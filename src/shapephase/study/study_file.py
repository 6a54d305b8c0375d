"""A study as a TOML file: every entry is checked, and named where it is wrong, before anything is computed."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import check_file_name
from ..arrays import Array, finite_array
from ..errors import InputFileNotFoundError, ShapePhaseError, StudyError, unknown_name
from ._axes import LABELS, QUANTITIES, check_name, unit_of
from ._recipes import RigidBody, imported
from .distributions import DISTRIBUTIONS, LogNormal
from .outputs import Output
from .study import Study

# What a number in a unit is multiplied by, and the unit of the library that it then has.
_UNITS = {
    **{unit: (1.0, unit) for unit in ("rad", "m", "s", "kg m^2/s")},
    "deg": (float(np.pi / 180.0), "rad"),
    "mm": (1e-3, "m"),
    "ms": (1e-3, "s"),
    "": (1.0, ""),
}
_MOST_BYTES = 50_000_000  # a longer file is no study
_MOST_VALUES = 10_000_000  # of an even grid


def read_study(path: str | os.PathLike[str]) -> Study:
    """Read a study from a TOML file.

    It has the arguments of `Study` as entries. What is varied are tables `[over.NAME]` with either `values`, or `from`,
    `to` and `count` of an even grid, or `distribution` ("normal", "lognormal", "uniform", "choice", "directions",
    "rotations") and its numbers; and `unit`, where it is not the library's own ("deg", "mm", "ms"). `[functions.NAME]`
    with `call = "module:function"`, `shape` and `unit` are outputs of the user. A rigid body is `[rigid]` with
    `inertia` and `duration`. Files are looked for beside the study's.

    Raises
    ------
    InputFileNotFoundError
        If there is no such file.
    StudyError
        For anything that is wrong in it, with the entry's name.

    Examples
    --------
    >>> with open("study.toml", "w") as file:
    ...     _ = file.write('body = "cat_two_halves"\\nmotion = "kane_scher"\\nparameters = {alpha = 0.0}\\n'
    ...                    '[over.beta]\\nunit = "deg"\\nfrom = 20\\nto = 60\\ncount = 5\\n')
    >>> study = sp.study.read_study("study.toml")
    >>> study.cases, round(study.case(4).parameters["beta"], 6)
    (5, 1.047198)
    """
    check_file_name(path, "path")
    place = Path(path)
    try:
        with open(place, "rb") as stream:
            content = stream.read(_MOST_BYTES + 1)
    except OSError as error:
        raise InputFileNotFoundError(f"{place}: it cannot be read ({error.strerror or error})") from None
    try:
        if len(content) > _MOST_BYTES:
            raise StudyError(f"it has more than {_MOST_BYTES // 10**6} MB")
        return _study(tomllib.loads(content.decode()), place.parent)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise StudyError(f"{place}: no TOML that can be read ({error})") from None
    except ShapePhaseError as error:
        raise StudyError(f"{place}: {error}") from None
    except (TypeError, ValueError, OverflowError) as error:
        raise StudyError(f"{place}: an entry is of another type than is needed ({error})") from None


def _study(entries: dict[str, Any], folder: Path) -> Study:
    _refuse_booleans({name: entry for name, entry in entries.items() if name != "xacro_args"}, "")
    arguments = [field.name for field in fields(Study)]
    given = dict(_table(entries, "", (*arguments, "rigid", "functions")))
    over = _table(given.pop("over", {}), "over")
    functions = _table(given.pop("functions", {}), "functions")
    if ("body" in given or "body" in over) == ("rigid" in given):
        raise StudyError("one of body and rigid is needed")
    given["over"] = {name: _axis(name, entry, folder) for name, entry in over.items()}
    for name in ("body", "motion"):
        if name in given or name in over:
            given[name] = _beside(given[name], folder, name) if name in given else given["over"][name][0]
    if "rigid" in given:
        given["body"] = RigidBody(**_table(given.pop("rigid"), "rigid", needed=("inertia", "duration")))
    if isinstance(given.get("packages"), list):
        given["packages"] = [_beside(entry, folder, "packages") for entry in given["packages"]]
    outputs = given.get("outputs", Study.outputs)
    if isinstance(outputs, str) or not all(isinstance(output, str) for output in outputs):
        raise StudyError("outputs: a list of names is needed")
    given["outputs"] = (*outputs, *(_function(name, entry) for name, entry in functions.items()))
    return Study(**given)


def _axis(name: str, entry: Any, folder: Path) -> Any:
    check_name(name, "over")
    where = f"over.{name}"
    table = _table(entry, where)
    if name in LABELS:
        values = _table(table, where, needed=("values",))["values"]
        if not isinstance(values, list) or not all(isinstance(label, str) for label in values):
            raise StudyError(f"{where}.values: a list of names is needed")
        return values if name == "gauge" else [_beside(label, folder, where) for label in values]
    factor = _factor(name, table.get("unit", unit_of(name)))
    ways = [way for way in ("values", "from", "distribution") if way in table]
    if len(ways) != 1:
        raise StudyError(f"{where}: one of values, from (with to and count) and distribution is needed")
    if ways == ["values"]:
        return factor * _numbers(_table(table, where, ("values", "unit")), where, "values")
    if ways == ["from"]:
        _table(table, where, ("unit",), needed=("from", "to", "count"))
        count = table["count"]
        if not isinstance(count, int) or not 1 <= count <= _MOST_VALUES:
            raise StudyError(f"{where}.count: a whole number from 1 to {_MOST_VALUES} is needed, got {count!r}")
        return factor * np.linspace(_numbers(table, where, "from"), _numbers(table, where, "to"), count)
    if table["distribution"] not in DISTRIBUTIONS:
        raise unknown_name(f"distribution of {where}", str(table["distribution"]), DISTRIBUTIONS)
    kind = DISTRIBUTIONS[table["distribution"]]
    needed = [parameter.name for parameter in fields(kind) if parameter.default is MISSING]  # type: ignore[arg-type]
    parameters = [parameter.name for parameter in fields(kind)]  # type: ignore[arg-type]
    _table(table, where, ("distribution", "unit", *parameters), needed=needed)
    numbers = {name: _numbers(table, where, name) for name in parameters if name in table}
    in_unit = {name for name in numbers if kind is not LogNormal or name != "deviation"}
    return kind(**{name: (factor * value if name in in_unit else value).tolist() for name, value in numbers.items()})


def _factor(name: str, unit: Any) -> float:
    """Return what numbers of an axis in a unit are multiplied by."""
    own = unit_of(name)
    if unit == own:
        return 1.0
    if unit not in _UNITS:
        raise unknown_name(f"unit of over.{name}", str(unit), [known for known in _UNITS if known])
    factor, base = _UNITS[unit]
    if base not in own.split(" or ") and name.partition(".")[0] in QUANTITIES:
        raise StudyError(f"over.{name}.unit: it is in {own or 'no unit'}, got {unit!r}")
    return factor


def _function(name: str, entry: Any) -> Output:
    where = f"functions.{name}"
    table = _table(entry, where, ("shape", "unit", "about"), needed=("call",))
    shape = table.get("shape", [])
    if not isinstance(shape, list) or not all(isinstance(length, int) and 1 <= length <= 1000 for length in shape):
        raise StudyError(f"{where}.shape: a list of whole numbers from 1 to 1000 is needed, got {shape!r}")
    call = imported(str(table["call"]), f"{where}.call")
    return Output(name, call, tuple(shape), str(table.get("unit", "")), str(table.get("about", "")))


def _beside(name: Any, folder: Path, where: str) -> str:
    """Return a file or folder beside the study's, if there is one, or the name as it is."""
    if not isinstance(name, str) or not name:
        raise StudyError(f"{where}: a name or a file is needed, got {name!r}")
    beside = folder / name
    return str(beside) if os.path.isfile(beside) or (where == "packages" and os.path.isdir(beside)) else name


def _table(
    entry: Any, where: str, known: Iterable[str] | None = None, *, needed: Iterable[str] = ()
) -> Mapping[str, Any]:
    """Return a table after a check of the names in it; any are allowed where none are known or needed."""
    if not isinstance(entry, Mapping):
        raise StudyError(f"{where}: a table is needed, got {entry!r:.60}")
    allowed = (*(known or ()), *needed)
    for name in entry if allowed else ():
        if name not in allowed:
            raise unknown_name(f"entry of {where}" if where else "entry", name, allowed)
    for name in needed:
        if name not in entry:
            raise StudyError(f"{where}: {name} is missing")
    return entry


def _numbers(table: Mapping[str, Any], where: str, name: str) -> Array:
    return finite_array(table[name], f"{where}.{name}")


def _refuse_booleans(value: Any, name: str) -> None:
    """Raise StudyError for true and false, which NumPy reads as 1 and 0."""
    if isinstance(value, bool):
        raise StudyError(f"{name}: true and false are no numbers")
    for key, entry in value.items() if isinstance(value, Mapping) else ():
        _refuse_booleans(entry, f"{name}.{key}" if name else key)
    for entry in value if isinstance(value, list) else ():
        _refuse_booleans(entry, name)
