"""The store of a study: one array for each result, in which a chunk of cases is one file, and its seal comes last.

The seal of a chunk is the SHA-256 of its files, its number, the study and the versions. A chunk whose seal is missing
or does not fit is not done: a flipped bit, a lost, exchanged or older file is never read as a value.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import hashlib
import itertools
import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import check_choice, check_file_name
from ..arrays import Integers
from ..display import short_repr
from ..errors import MissingExtraError, OutputFileError, StudyStoreError
from ..files import write_whole
from ..letters import printable
from ..provenance import provenance
from ..warning_filters import quiet
from ._axes import OF_PARTS
from ._evaluate import DIED, DONE, NAME_LENGTH, RAISED, TEXT_LENGTH, TIMED_OUT, Results
from ._processor import computing_versions, other_versions, processor_text

if TYPE_CHECKING:
    from .study import Study

FORMAT = "shapephase study 2"
_WITHOUT_SEALS = "shapephase study 1"
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
        """An array of the store, of all cases, in memory; NaN or 0 where a chunk is missing.

        Raises
        ------
        UnknownNameError
            If it has none of this name.
        StudyStoreError
            If a chunk is damaged, which is named.
        """
        array = self._array(name)
        return self._sealed(array, self._unfinished_chunks())

    def statuses(self) -> Any:
        """(cases,) whole numbers as in `STATUS`; a chunk that is damaged is missing."""
        return self._sealed(self._array("status"), self.missing_chunks())

    def counts(self) -> dict[str, int]:
        """How many cases have which status."""
        counted = np.bincount(self.statuses(), minlength=len(STATUS))
        return {name: int(counted[number]) for name, number in STATUS.items()}

    def missing_chunks(self) -> Integers:
        """Numbers of the chunks that are not stored, or only in part, or damaged."""
        return np.array([number for number in range(self._chunks) if not self._is_whole(number)], dtype=np.int64)

    def damaged_chunks(self) -> Integers:
        """Numbers of the chunks that were stored and are not what they were; a run with `resume` computes them again.

        Examples
        --------
        >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1, 0.2]}, outputs=("turn",), chunk=1)
        >>> store = study.run("flipped.zarr", workers=0)
        >>> _ = (store.path / "turn" / "c" / "1").write_bytes(b"")
        >>> store.damaged_chunks().tolist(), store.counts()["missing"]
        ([1], 1)
        """
        return self._with_seal(self.missing_chunks())

    def failed_chunks(self) -> Integers:
        """Numbers of the chunks with cases that have no results."""
        return np.unique(np.flatnonzero(self.statuses() > DONE) // int(self.attributes["chunk"]))

    def chunk_texts(self, numbers: Integers) -> str:
        """For example "chunk 3 (cases 15 to 19) and 2 more"."""
        first = int(numbers[0])
        part = self._part(first)
        more = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
        return f"chunk {first} (cases {part.start} to {part.stop - 1}){more}"

    def errors(self, most: int = 20) -> list[tuple[int, str, str]]:
        """The first cases without results: index, name of the error, what it said."""
        return list(itertools.islice(self._failures(), most))

    def complaints(self) -> list[tuple[int, int, str, str]]:
        """What failed cases say, the most frequent first: how many cases, the first of them, the error, its processor.

        Examples
        --------
        >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1, 0.2]}, outputs=("turn",))
        >>> study.run("well.zarr", workers=0).complaints()
        []
        """
        found: dict[tuple[str, str], list[int]] = {}
        for index, name, text in self._failures():
            where = _text(self._array("processor")[index // int(self.attributes["chunk"])])
            found.setdefault((f"{name}: {text}", where), []).append(index)
        listed = [(len(cases), cases[0], text, where) for (text, where), cases in found.items()]
        return sorted(listed, key=lambda one: -one[0])

    def _failures(self) -> Iterator[tuple[int, str, str]]:
        for number in self.failed_chunks().tolist():
            part = self._part(number)
            status, names, texts = (self._array(name)[part] for name in ("status", "error_name", "error_text"))
            for row in np.flatnonzero(status > DONE).tolist():
                yield part.start + row, _text(names[row]), _text(texts[row])

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
        grids = {name: list(values) for name, values in self.attributes["grids"].items()}
        draws = int(self.attributes["draws"])
        dims = {**{name: len(values) for name, values in grids.items()}, "draw": draws}
        if draws == 1 and len(dims) > 1:
            del dims["draw"]
        found, missing = {}, self._unfinished_chunks()
        for name in (*self.attributes["units"], "status", "error_name", "error_text"):
            if name not in grids:
                array = self._array(name)
                values = self._sealed(array, missing)
                named = (*dims, *array.metadata.dimension_names[1:])
                found[name] = (named, values.reshape(*dims.values(), *values.shape[1:]), dict(array.attrs))
        coordinates = {
            name: (name, values, {"units": self.attributes["units"].get(name, "")})
            for name, values in grids.items()
            if np.ndim(values) == 1
        }
        return xarray.Dataset(found, coordinates, self.attributes)

    def write(self, number: int, results: Results, processor: str) -> None:
        """Store a chunk; its seal comes when all else is on the disk. Raises OutputFileError."""
        part = self._part(number)
        rows: dict[str, Any] = {**results.values, **results.axes, "status": results.status}
        if np.any(results.status > DONE):
            rows |= {"error_name": results.error_name, "error_text": results.error_text}
        with _disk_faults(self.path):
            for name in self._names:
                # What is there may be damaged: Zarr reads a chunk that it fills only in part.
                self._file(name, number).unlink(missing_ok=True)
            for name, values in rows.items():
                self._array(name)[part] = values
            self._array("processor")[number] = _letters(processor, _PROCESSOR_LENGTH)
            # Zarr writes no file for a chunk of fill values alone.
            files = [self._file(name, number) for name in (*rows, "processor")]
            _sync(self.path, [file for file in files if file.exists()])
            self._array("seal")[number] = np.frombuffer(self._seal(number), dtype=np.uint8)
            _sync(self.path, [self._file("seal", number)])

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Nobody else writes. Raises StudyStoreError where somebody does."""
        handle = os.open(self.path, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield
        except OSError as error:
            if error.errno in (errno.EAGAIN, errno.EACCES):
                raise StudyStoreError(
                    f"{self.path}: another run is writing to this store; wait for it, or name another place"
                ) from None
            raise
        finally:
            os.close(handle)

    def _array(self, name: str) -> Any:
        """One array of the store, opened once."""
        if not isinstance(name, str) or name not in self._arrays:
            if name != "seal":
                check_choice(name, "array of the store", (*self.attributes["units"], *_OF_EVERY_STUDY))
            self._arrays[name] = self._group[name]
        return self._arrays[name]

    def _sealed(self, array: Any, missing: Integers) -> Any:
        """The numbers of an array where its chunks are whole, elsewhere its fill value."""
        if not len(missing):
            return array[...]
        found = np.full(array.shape, array.fill_value, dtype=array.dtype)
        for number in np.setdiff1d(np.arange(self._chunks), missing).tolist():
            part = self._part(number) if array.shape[0] == self.cases else slice(number, number + 1)
            found[part] = array[part]
        return found

    def _unfinished_chunks(self) -> Integers:
        """As `missing_chunks`. Raises StudyStoreError where some of them are damaged."""
        missing = self.missing_chunks()
        if len(bad := self._with_seal(missing)):
            raise damaged(self.path, self.chunk_texts(bad))
        return missing

    def _with_seal(self, numbers: Integers) -> Integers:
        return np.array([one for one in numbers.tolist() if self._file("seal", one).exists()], dtype=np.int64)

    @property
    def _chunks(self) -> int:
        return -(-self.cases // int(self.attributes["chunk"]))

    def _part(self, number: int) -> slice:
        """The cases of a chunk."""
        chunk = int(self.attributes["chunk"])
        return slice(number * chunk, min((number + 1) * chunk, self.cases))

    @property
    def _names(self) -> tuple[str, ...]:
        """Arrays that a seal is of."""
        return (*sorted(self.attributes["units"]), *_OF_EVERY_STUDY)

    def _file(self, name: str, number: int) -> Path:
        """The file of a chunk of an array."""
        return (
            self.path
            / name
            / self._array(name).metadata.encode_chunk_key((number,) + (0,) * (self._array(name).ndim - 1))
        )

    def _seal(self, number: int) -> bytes:
        """SHA-256 of the files of a chunk, its number, the study and the versions."""
        identity = [self.attributes["study_hash"], self.attributes["versions"], number]
        seal = hashlib.sha256(json.dumps(identity, sort_keys=True).encode())
        for name in self._names:
            content = _content(self._file(name, number))
            seal.update(f"\n{name} {None if content is None else len(content)}\n".encode() + (content or b""))
        return seal.digest()

    def _is_whole(self, number: int) -> bool:
        return _content(self._file("seal", number)) == self._seal(number)

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
    whole = _metadata(place)
    attributes = whole.get("attributes", {})
    if attributes.get("format") == _WITHOUT_SEALS:
        raise StudyStoreError(
            f"{place}: an earlier version wrote this store, without checksums; read it with xarray.open_zarr, or "
            "compute the study into a new store"
        )
    if attributes.get("digest") != _digest(whole):
        if not (place / "seal").is_dir():
            raise StudyStoreError(f"{place}: what is there is no store of a study")
        raise damaged(place, "its zarr.json is not what was written")
    return StudyStore(place, attributes)


def store_to_resume(path: str | os.PathLike[str], study: Study) -> StudyStore:
    """The store of this study, its metadata mended. Raises StudyStoreError."""
    place = Path(path)
    with tempfile.TemporaryDirectory() as folder, _disk_faults(place):
        try:
            store = open_study(place)
        except StudyStoreError:
            if not (place / "seal").is_dir():
                raise
            # What it says of itself is lost: a seal says whether it is this study's.
            fresh = Path(folder) / place.name
            _make(fresh, study)
            store = StudyStore(place, open_study(fresh).attributes)
            store.__dict__["_group"] = open_study(fresh)._group
            if len(store.missing_chunks()) == study.chunks:
                raise
            for file in fresh.rglob("zarr.json"):
                _write(place / file.relative_to(fresh), file.read_bytes())
            store = open_study(place)
        check_same(store, study)
        for name, metadata in _metadata(place)["consolidated_metadata"]["metadata"].items():
            if _metadata(place / name) != metadata:
                _write(place / name / "zarr.json", json.dumps(metadata).encode())
    return store


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
            _sync(temporary, list(temporary.rglob("zarr.json")))
            os.rename(temporary, place)
            _sync(place.parent, [place])
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
    if differing := other_versions(store.attributes["versions"], computing_versions()):
        raise StudyStoreError(
            f"{store.path}: {differing}: the cases would not be the same; install those versions with pip, or "
            "begin a new store"
        )


def _differences(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> list[str]:
    """Names of what is not the same in both."""
    names = dict.fromkeys((*mine, *theirs))
    return [name for name in names if json.dumps(mine.get(name)) != json.dumps(theirs.get(name))]


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
        "versions": computing_versions(),
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
    for name, length, about in (
        ("processor", _PROCESSOR_LENGTH, letters),
        ("seal", hashlib.sha256().digest_size, {"about": "SHA-256 of the files of each chunk"}),
    ):
        group.create_array(
            name,
            shape=(study.chunks, length),
            chunks=(1, length),
            dtype=np.uint8,
            fill_value=0,
            dimension_names=("chunk", f"{name}_letter"),
            attributes=about,
            compressors=None,
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
    whole = _metadata(place)
    whole["attributes"]["digest"] = _digest(whole)
    (place / "zarr.json").write_text(json.dumps(whole, indent=2))


def _metadata(place: Path) -> dict[str, Any]:
    """What a group or an array says of itself; nothing where that cannot be read."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        whole = json.loads((place / "zarr.json").read_bytes())
        if isinstance(whole, dict) and isinstance(whole.get("attributes"), dict):
            return whole
    return {}


def _digest(whole: Mapping[str, Any]) -> str:
    """SHA-256 of the metadata of a store."""
    own = {name: value for name, value in whole.get("attributes", {}).items() if name != "digest"}
    return hashlib.sha256(json.dumps({**whole, "attributes": own}, sort_keys=True).encode()).hexdigest()


def _content(file: Path) -> bytes | None:
    """The bytes of a file; None where it cannot be read."""
    try:
        return file.read_bytes()
    except OSError:
        return None


def _write(file: Path, content: bytes) -> None:
    file.parent.mkdir(exist_ok=True)
    write_whole(file, lambda stream: stream.write(content))


def _sync(root: Path, files: Collection[Path]) -> None:
    """Wait until files, and the folders that they are in, are on the disk."""
    folders = {root}
    for file in files:
        folders.update(folder for folder in file.parents if folder.is_relative_to(root))
    for place in (*files, *folders):
        handle = os.open(place, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


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
        compressors=[_zarr().codecs.ZstdCodec(), _zarr().codecs.Crc32cCodec()],
    )


def _text(letters: Any) -> str:
    return np.asarray(letters).tobytes().rstrip(b"\0").decode(errors="ignore")


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


def damaged(path: Path, what: str) -> StudyStoreError:
    """The error for a store that is not what was written."""
    return StudyStoreError(f"{path}: the store is damaged: {what}; compute it again with resume=True (--resume)")
