"""The store of a study: one array for each result, in which a chunk of cases is one file, and the status comes last."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import check_choice, check_file_name
from ..arrays import Integers
from ..display import short_repr
from ..errors import MissingExtraError, OutputFileError, StudyStoreError
from ..integrator.machine_code import is_used
from ..letters import printable
from ..provenance import provenance
from ..warning_filters import quiet
from ._axes import OF_PARTS
from ._evaluate import DIED, DONE, NAME_LENGTH, RAISED, TEXT_LENGTH, TIMED_OUT, Results
from ._processor import processor_text
from ._stored import array_of, check_attributes, damaged, faults_of

if TYPE_CHECKING:
    from .study import Study

FORMAT = "shapephase study 1"
STATUS: Mapping[str, int] = {"missing": 0, "done": DONE, "raised": RAISED, "timed_out": TIMED_OUT, "died": DIED}
"""What the numbers of `status` say: not computed yet, done, an error was raised, its time was over, its process died.

Examples
--------
>>> sp.study.STATUS["done"]
1
"""
_OF_EVERY_STUDY = ("status", "error_name", "error_text", "processor")
"""Names of arrays."""
_PROCESSOR_LENGTH = 96
"""Of what a chunk was computed by [bytes]."""
_PINNED = ("shapephase", "numpy", "scipy", "pin", "python")
"""Versions on which the bits of results depend."""


@dataclass(frozen=True, eq=False)
class StudyStore:
    """A store and what is in it.

    Attributes
    ----------
    path : of the folder
    attributes : what it says of itself: the study, its hash, inputs, versions, seed, the command

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1, 0.2]}, outputs=("turn",), chunk=2)
    >>> store = study.run("cat.zarr", workers=0)
    >>> store.counts()["done"], store.values("turn").shape, store.attributes["seed"]
    (3, (3,), 0)
    """

    path: Path
    attributes: Mapping[str, Any]

    __repr__ = short_repr

    @property
    def cases(self) -> int:
        """Of the whole study."""
        return int(self.attributes["cases"])

    def values(self, name: str) -> Any:
        """An array of the store, of all cases, in memory.

        Raises
        ------
        UnknownNameError
            If it has none of this name.
        StudyStoreError
            If it is damaged.
        """
        with faults_of(self.path, f"array {name!r}"):
            return self._array(name)[...]

    def statuses(self) -> Any:
        """(cases,) whole numbers as in `STATUS`."""
        found = self.values("status")
        if found.ndim != 1 or found.dtype != np.uint8 or found.max() > max(STATUS.values()):
            raise damaged(self.path, "status has other numbers than there are")
        return found

    def counts(self) -> dict[str, int]:
        """How many cases have which status."""
        counted = np.bincount(self.statuses(), minlength=len(STATUS))
        return {name: int(counted[number]) for name, number in STATUS.items()}

    def missing_chunks(self) -> Integers:
        """Numbers of the chunks that are not stored, or only in part."""
        chunk = int(self.attributes["chunk"])
        starts = np.arange(0, self.cases, chunk)
        return np.flatnonzero(np.minimum.reduceat(self.statuses(), starts) == 0)

    def errors(self, most: int = 20) -> list[tuple[int, str, str]]:
        """The first cases without results: index, name of the error, what it said."""
        found = []
        for index in np.flatnonzero(self.statuses() > DONE)[:most].tolist():
            with faults_of(self.path, f"the error of case {index}"):
                said = [np.asarray(self._array(name)[index]) for name in ("error_name", "error_text")]
            kind, text = (bytes(letters).rstrip(b"\0").decode(errors="ignore") for letters in said)
            found.append((index, kind, text))
        return found

    def dataset(self) -> Any:
        """All of it as an `xarray.Dataset`, along the dimensions of the grids, and of the draws where there are more.

        Raises
        ------
        MissingExtraError
            Without xarray.
        """
        try:
            import xarray
        except ImportError:
            raise MissingExtraError(
                "a data set needs xarray; install it with: pip install 'shapephase[study]'"
            ) from None
        with faults_of(self.path, "it"):
            return self._dataset(xarray)

    def _dataset(self, xarray: Any) -> Any:
        flat = xarray.open_zarr(self.path).load()
        grids = {name: list(values) for name, values in self.attributes["grids"].items()}
        draws = int(self.attributes["draws"])
        dims = {**{name: len(values) for name, values in grids.items()}, "draw": draws}
        if draws == 1 and len(dims) > 1:
            del dims["draw"]
        found = {}
        for name, array in flat.data_vars.items():
            if name in grids or array.dims[:1] != ("case",):
                continue
            values = array.values.reshape(*dims.values(), *array.shape[1:])
            found[name] = ((*dims, *array.dims[1:]), values, array.attrs)
        coordinates = {
            name: (name, values, {"units": self.attributes["units"].get(name, "")})
            for name, values in grids.items()
            if np.ndim(values) == 1
        }
        return xarray.Dataset(found, coordinates, flat.attrs)

    def write(self, number: int, results: Results, processor: str) -> None:
        """Store a chunk; the status comes last. Raises OutputFileError."""
        first = number * int(self.attributes["chunk"])
        part = slice(first, first + len(results.status))
        with _disk_faults(self.path), faults_of(self.path, f"chunk {number}"):
            for name, values in {**results.values, **results.axes}.items():
                self._array(name)[part] = values
            if np.any(results.status > DONE):
                self._array("error_name")[part] = results.error_name
                self._array("error_text")[part] = results.error_text
            self._array("processor")[number] = _letters(processor, _PROCESSOR_LENGTH)
            self._array("status")[part] = results.status

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Nobody else writes. Raises StudyStoreError where somebody does."""
        with open(self.path / "zarr.json", "rb") as handle:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                if error.errno in (errno.EAGAIN, errno.EACCES):
                    raise StudyStoreError(f"{self.path}: another run is writing to this store") from None
            yield

    def _array(self, name: str) -> Any:
        """One array of the store, opened once."""
        if not isinstance(name, str) or name not in self._arrays:
            check_choice(name, "array of the store", (*self.attributes["units"], *_OF_EVERY_STUDY))
            first = -(-self.cases // int(self.attributes["chunk"])) if name == "processor" else self.cases
            self._arrays[name] = array_of(self.path, self._group, name, first)
        return self._arrays[name]

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        return {}

    @cached_property
    def _group(self) -> Any:
        return _zarr().open_group(self.path, mode="r+", zarr_format=3)


def open_study(path: str | os.PathLike[str]) -> StudyStore:
    """Open the store of a study.

    Raises
    ------
    StudyStoreError
        If there is none, or what is there is something else.
    MissingExtraError
        Without Zarr.

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1, 0.2]}, outputs=("turn",), chunk=2)
    >>> _ = study.run("opened.zarr", workers=0)
    >>> sp.study.open_study("opened.zarr").counts()["done"]
    3
    """
    check_file_name(path, "path")
    place = Path(path)
    if not os.path.exists(place):
        raise StudyStoreError(f"{place}: there is no store of a study")
    try:
        attributes = dict(_zarr().open_group(place, mode="r", zarr_format=3).attrs)
    except MissingExtraError:
        raise
    except Exception:
        attributes = {}
    if attributes.get("format") != FORMAT:
        raise StudyStoreError(f"{place}: what is there is no store of a study")
    check_attributes(place, attributes)
    return StudyStore(place, attributes)


def new_store(path: str | os.PathLike[str], study: Study) -> StudyStore:
    """Make an empty store, whole or not at all. Raises StudyStoreError where something is already, OutputFileError."""
    place = Path(path)
    if os.path.exists(place):
        raise StudyStoreError(f"{place}: there is something already; go on with it by resume, or name another place")
    if not place.parent.is_dir():
        raise OutputFileError(f"cannot write {place}: there is no such folder {place.parent}")
    temporary = place.with_name(f".{place.name}.{secrets.token_hex(4)}.part")
    try:
        with _disk_faults(place):
            _make(temporary, study)
            os.rename(temporary, place)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise
    return open_study(place)


def check_same(store: StudyStore, study: Study) -> None:
    """Raise StudyStoreError for a store that another study began, or this one with other versions."""
    if store.attributes["study_hash"] != study.hash:
        mine, theirs = study.description, store.attributes["study"]
        changed = [name for name in _differences(mine, theirs) if name != "inputs"]
        changed += _differences(mine["inputs"], theirs["inputs"])
        raise StudyStoreError(
            f"{store.path}: this is the store of another study, of seed {store.attributes['seed']} and "
            f"{store.cases} cases; different: {', '.join(changed)}"
        )
    then, now = store.attributes["versions"], _versions()
    for name, said in now.items():
        if then.get(name) != said:
            raise StudyStoreError(
                f"{store.path}: it was begun with {name} {then.get(name)}, here it is {said}: the cases would not be "
                "the same; use those versions, or begin a new store"
            )


def _differences(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> list[str]:
    """Names of what is not the same in both."""
    names = dict.fromkeys((*mine, *theirs))
    return [name for name in names if json.dumps(mine.get(name)) != json.dumps(theirs.get(name))]


def _versions() -> dict[str, Any]:
    said = provenance()["versions"]
    # Interpreted motions sample with Pinocchio, which rounds differently.
    return {**{name: said[name] for name in _PINNED}, "machine code": is_used()}


def _make(place: Path, study: Study) -> None:
    said = provenance()
    grids = {
        axis.name: [str(one) for one in axis.grid] if isinstance(axis.grid, tuple) else np.asarray(axis.grid).tolist()
        for axis in study.axes
        if axis.grid is not None
    }
    attributes = {
        "format": FORMAT,
        "study": study.description,
        "study_hash": study.hash,
        "cases": study.cases,
        "chunk": study.chunk,
        "draws": study.draws,
        "grids": grids,
        "seed": study.seed,
        "inputs": study.inputs,
        "versions": _versions(),
        "command": said["command"],
        "date": said["date"],
        "processor": processor_text(),
        "units": {
            **{axis.name: axis.unit for axis in study.axes},
            **{output.name: output.unit for output in study.resolved_outputs},
        },
    }
    group = _zarr().create_group(place, zarr_format=3, attributes=attributes)
    meanings = {"flag_values": list(STATUS.values()), "flag_meanings": " ".join(STATUS)}
    letters = {"about": "letters in UTF-8"}
    _create(group, study, "status", np.uint8, 0, {}, meanings)
    for name, length in (("error_name", NAME_LENGTH), ("error_text", TEXT_LENGTH)):
        _create(group, study, name, np.uint8, 0, {f"{name}_letter": length}, letters)
    group.create_array(
        "processor",
        shape=(study.chunks, _PROCESSOR_LENGTH),
        chunks=(1, _PROCESSOR_LENGTH),
        dtype=np.uint8,
        fill_value=0,
        dimension_names=("chunk", "processor_letter"),
        attributes=letters,
    )
    for axis in study.axes:
        about: dict[str, Any] = {"units": axis.unit, "role": "varied"}
        if isinstance(axis.grid, tuple):
            about["labels"] = grids[axis.name]
        _create(group, study, axis.name, np.float64, np.nan, _dimensions(axis.name, axis.shape), about)
    for output in study.resolved_outputs:
        about = {"units": output.unit, "role": "result", "about": output.about}
        _create(group, study, output.name, np.float64, np.nan, _dimensions(output.name, output.shape), about)
    # Zarr's specification does not have it yet, and xarray complains where it is missing.
    with quiet():
        _zarr().consolidate_metadata(place)


def _dimensions(name: str, shape: tuple[int, ...]) -> dict[str, int]:
    """The axes of one value, by name."""
    if shape == (3, 3):
        return {"row": 3, "column": 3}
    names = [f"{name}_{place}" for place in range(len(shape))]
    if name in OF_PARTS:
        names[0] = "part"
    if shape and shape[-1] == 3:
        names[-1] = "xyz"
    return dict(zip(names, shape, strict=True))


def _create(
    group: Any,
    study: Study,
    name: str,
    kind: type[Any],
    fill: float,
    of_one: Mapping[str, int],
    about: Mapping[str, Any],
) -> None:
    group.create_array(
        name,
        shape=(study.cases, *of_one.values()),
        chunks=(min(study.chunk, study.cases), *of_one.values()),
        dtype=kind,
        fill_value=fill,
        dimension_names=("case", *of_one),
        attributes=dict(about),
        # A chunk of fill values would else not be written, as if it were not done.
        config={"write_empty_chunks": True},
    )


def _letters(text: str, length: int) -> Any:
    found = np.zeros(length, dtype=np.uint8)
    encoded = printable(text).encode()[:length]
    found[: len(encoded)] = np.frombuffer(encoded, dtype=np.uint8)
    return found


@contextlib.contextmanager
def _disk_faults(path: Path) -> Iterator[None]:
    """What the system says of files, as an error of ours."""
    try:
        yield
    except (OutputFileError, StudyStoreError):
        raise
    except OSError as error:
        raise OutputFileError(f"cannot write {path}: {error.strerror or error}") from None


def _zarr() -> Any:
    try:
        with quiet():
            import zarr
    except ImportError:
        raise MissingExtraError("a study needs Zarr; install it with: pip install 'shapephase[study]'") from None
    return zarr
