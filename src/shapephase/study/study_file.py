"""A study as a TOML file: every entry is checked, and named where it is wrong, before anything is computed."""

from __future__ import annotations

import os
import tomllib
from collections.abc import Mapping
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import check_file_name
from ..arrays import Array, finite_array
from ..errors import InputFileNotFoundError, ShapePhaseError, StudyError, unknown_name
from ._axes import LABELS, LONGEST_NAME, UNITS, unit_of
from ._recipes import RigidBody, imported
from .distributions import DISTRIBUTIONS, Choice, LogNormal
from .outputs import Output
from .study import Study

_PLAIN = (
    *("outputs", "draws", "seed", "chunk", "momentum", "attitude", "tolerance", "gauge", "parameters", "time_limit"),
    "version",
    *("root", "root_body", "packages", "xacro_args", "on_unphysical", "length_unit", "person_mass"),
)
_ENTRIES = ("body", "motion", "rigid", "over", "functions", *_PLAIN)
_FACTORS = {
    "rad": 1.0,
    "deg": float(np.pi / 180.0),
    "m": 1.0,
    "mm": 1e-3,
    "kg m^2/s": 1.0,
    "s": 1.0,
    "ms": 1e-3,
    "": 1.0,
}
"""What a number in a unit is multiplied by to be one of the library."""
_BASE = {"deg": "rad", "mm": "m", "ms": "s"}
# A file that is longer is no study.
_MOST_BYTES = 50_000_000


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
        return _made(tomllib.loads(content.decode()), place.parent)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise StudyError(f"{place}: no TOML that can be read ({error})") from None
    except ShapePhaseError as error:
        raise StudyError(f"{place}: {error}") from None
    except (TypeError, ValueError, OverflowError) as error:
        raise StudyError(f"{place}: an entry is of another type than is needed ({error})") from None


def _made(said: Mapping[str, Any], folder: Path) -> Study:
    _check_names("entry", said, _ENTRIES)
    _check_truths({name: value for name, value in said.items() if name != "xacro_args"}, "")
    given: dict[str, Any] = {name: said[name] for name in _PLAIN if name in said}
    if isinstance(given.get("packages"), list):
        given["packages"] = [_folder(one, folder) for one in given["packages"]]
    if ("body" in said or "body" in said.get("over", {})) == ("rigid" in said):
        raise StudyError("one of body and rigid is needed")
    over = {name: _axis(name, one, folder) for name, one in _table(said, "over").items()}
    if "rigid" in said:
        _check_names("entry of rigid", _table(said, "rigid"), ("inertia", "duration"), needed=("inertia", "duration"))
        body: Any = RigidBody(**said["rigid"])
    else:
        body = _file(said.get("body", over["body"][0] if "body" in over else ""), folder, "body")
    motion = said.get("motion", over["motion"][0] if "motion" in over else None)
    if motion is not None:
        motion = _file(motion, folder, "motion")
    outputs = said.get("outputs", Study.outputs)
    if isinstance(outputs, str) or not all(isinstance(one, str) for one in outputs):
        raise StudyError("outputs: a list of names is needed")
    given["outputs"] = (*outputs, *(_function(*one) for one in _table(said, "functions").items()))
    return Study(body, motion, over, **given)


def _axis(name: str, said: Any, folder: Path) -> Any:
    if len(name) > LONGEST_NAME:
        raise StudyError(f"over: a name of {len(name)} characters, {name[:20]!r}...; {LONGEST_NAME} are enough")
    where = f"over.{name}"
    if not isinstance(said, Mapping):
        raise StudyError(f"{where}: a table is needed, with values, with from, to and count, or with a distribution")
    if name in LABELS:
        _check_names(f"entry of {where}", said, ("values",), needed=("values",))
        values = said["values"]
        if not isinstance(values, list) or not all(isinstance(one, str) for one in values):
            raise StudyError(f"{where}.values: a list of names is needed")
        return values if name == "gauge" else [_file(one, folder, where) for one in values]
    factor = _factor(name, said.get("unit"))
    ways = [way for way in ("values", "from", "distribution") if way in said]
    if len(ways) != 1:
        raise StudyError(f"{where}: one of values, from (with to and count) and distribution is needed")
    if ways[0] == "values":
        _check_names(f"entry of {where}", said, ("values", "unit"))
        return factor * _numbers(said["values"], f"{where}.values")
    if ways[0] == "from":
        needed = ("from", "to", "count")
        _check_names(f"entry of {where}", said, (*needed, "unit"), needed=needed)
        count = said["count"]
        if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= 10**7:
            raise StudyError(f"{where}.count: a whole number from 1 to 10000000 is needed, got {count!r}")
        first, last = (_numbers(said[end], f"{where}.{end}") for end in ("from", "to"))
        return factor * np.linspace(first, last, count)
    if said["distribution"] not in DISTRIBUTIONS:
        raise unknown_name(f"distribution of {where}", str(said["distribution"]), DISTRIBUTIONS)
    kind = DISTRIBUTIONS[said["distribution"]]
    names = [one.name for one in fields(kind)]
    needed_names = [one.name for one in fields(kind) if one.default is MISSING]
    _check_names(f"entry of {where}", said, ("distribution", "unit", *names), needed=needed_names)
    numbers = {one: _numbers(said[one], f"{where}.{one}") for one in names if one in said}
    for one, value in numbers.items():
        scaled = value if kind is LogNormal and one == "deviation" else factor * value
        numbers[one] = scaled.tolist()  # type: ignore[assignment]
    return kind(**numbers) if kind is not Choice else Choice(numbers["values"])  # type: ignore[arg-type]


def _factor(name: str, unit: Any) -> float:
    """What numbers of an axis are multiplied by."""
    if unit is None:
        return 1.0
    own = unit_of(name)
    if unit not in _FACTORS and unit != own:
        raise unknown_name(f"unit of over.{name}", str(unit), [one for one in _FACTORS if one])
    fits = unit == own or _BASE.get(unit, unit) in own.split(" or ") or name.partition(".")[0] not in UNITS
    if not fits:
        raise StudyError(f"over.{name}.unit: it is in {own or 'no unit'}, got {unit!r}")
    return _FACTORS.get(unit, 1.0)


def _function(name: str, said: Any) -> Output:
    where = f"functions.{name}"
    if not isinstance(said, Mapping):
        raise StudyError(f'{where}: a table with call = "module:function" is needed')
    _check_names(f"entry of {where}", said, ("call", "shape", "unit", "about"), needed=("call",))
    shape = said.get("shape", [])
    if not isinstance(shape, list) or not all(isinstance(one, int) and 1 <= one <= 1000 for one in shape):
        raise StudyError(f"{where}.shape: a list of whole numbers from 1 to 1000 is needed, got {shape!r}")
    call = imported(str(said["call"]), f"{where}.call")
    return Output(name, call, tuple(shape), str(said.get("unit", "")), str(said.get("about", "")))


def _file(name: Any, folder: Path, where: str) -> str:
    """A file beside the study's, if there is one, or the name as it is."""
    if not isinstance(name, str) or not name:
        raise StudyError(f"{where}: a name or a file is needed, got {name!r}")
    beside = str(folder / name)
    return beside if os.path.isfile(beside) else name


def _folder(name: Any, folder: Path) -> Any:
    """A folder beside the study's file, if there is one, or the name as it is."""
    return str(folder / name) if isinstance(name, str) and name and os.path.isdir(folder / name) else name


def _table(said: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = said.get(name, {})
    if not isinstance(found, Mapping):
        raise StudyError(f"{name}: a table is needed, got {found!r:.60}")
    return found


def _check_names(kind: str, said: Mapping[str, Any], known: Any, *, needed: Any = ()) -> None:
    for name in said:
        if name not in known:
            raise unknown_name(kind, name, known)
    for name in needed:
        if name not in said:
            raise StudyError(f"{kind}: {name} is missing")


def _numbers(value: Any, name: str) -> Array:
    return finite_array(value, name)


def _check_truths(value: Any, name: str) -> None:
    """Raise StudyError for what is true or false, as no entry is: NumPy reads it as 1 and 0."""
    if isinstance(value, bool):
        raise StudyError(f"{name}: true and false are no numbers")
    if isinstance(value, Mapping):
        for key, entry in value.items():
            _check_truths(entry, f"{name}.{key}" if name else key)
    elif isinstance(value, list):
        for entry in value:
            _check_truths(entry, name)
