"""The store of a study: one array for each result, in which a chunk of cases is one file, and its seal comes last.

The seal of a chunk is the SHA-256 of its files, its number, the study and the versions. A chunk whose seal is missing
or does not fit is not done: a flipped bit, a lost, exchanged or older file is never read as a value.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import itertools
import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Collection, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..arguments import check_choice, check_file_name
from ..arrays import Integers
from ..display import frozen
from ..errors import MissingExtraError, OutputFileError, StudyStoreError
from ..files import write_whole
from ..provenance import provenance
from ..warning_filters import quiet
from ._axes import OF_PARTS, unit_of
from ._evaluate import DONE, LETTERS, STATUS, Results, letters
from ._identity import computing_versions, processor_text, version_differences
from .cases import CaseTable

_FORMAT = "shapephase study 2"  # with seals
_FORMAT_WITHOUT_SEALS = "shapephase study 1"  # of earlier versions
_OF_EVERY_STUDY = ("status", *LETTERS, "processor")
_PROCESSOR_LENGTH = 96  # bytes


@frozen
class StudyStore:
    """A store and its contents.

    Made by `Study.run`.

    Attributes
    ----------
    path : of the folder
    attributes : its description: the study, its hash, inputs, versions, seed, the command
    """

    path: Path
    attributes: Mapping[str, Any]

    @property
    def cases(self) -> int:
        """Number of cases of the whole study."""
        return int(self.attributes["cases"])

    def values(self, name: str) -> Any:
        """Return an array of the store, of all cases; NaN or 0 where a chunk is missing.

        Raises
        ------
        UnknownNameError
            If it has none of this name.
        StudyStoreError
            If a chunk is damaged, which is named.
        """
        check_choice(name, "array of the store", (*self.attributes["units"], *_OF_EVERY_STUDY))
        return self._sealed(name, self._unfinished_chunks())

    def statuses(self) -> Any:
        """Return (cases,) whole numbers as in `STATUS`; the cases of a damaged chunk are missing."""
        return self._sealed("status", self.missing_chunks())

    def counts(self) -> dict[str, int]:
        """Return how many cases have which status."""
        counted = np.bincount(self.statuses(), minlength=len(STATUS))
        return {name: int(counted[number]) for name, number in STATUS.items()}

    def missing_chunks(self) -> Integers:
        """Return the numbers of the chunks that are not stored, or only in part, or damaged."""
        return np.array([n for n in self._chunks if _content(self._file("seal", n)) != self._seal(n)], dtype=np.int64)

    def damaged_chunks(self) -> Integers:
        """Return the numbers of the chunks that are not what was stored; a resumed run computes them again."""
        return self._with_seal(self.missing_chunks())

    def failed_chunks(self) -> Integers:
        """Return the numbers of the chunks with cases that have no results."""
        return np.unique(np.flatnonzero(self.statuses() > DONE) // self.attributes["chunk"])

    def chunk_texts(self, numbers: Integers) -> str:
        """Return for example "chunk 3 (cases 15 to 19) and 2 more"."""
        part = self._part(first := int(numbers[0]))
        more = f" and {len(numbers) - 1} more" if len(numbers) > 1 else ""
        return f"chunk {first} (cases {part.start} to {part.stop - 1}){more}"

    def errors(self, most: int = 20) -> list[tuple[int, str, str]]:
        """Return the first cases without results: index, name of the error, its text."""
        return [failure[:3] for failure in itertools.islice(self._failures(), most)]

    def complaints(self) -> list[tuple[int, int, str, str]]:
        """Return errors, the most frequent first: how many cases, the first of them, the error, its processor."""
        cases: dict[tuple[str, str], list[int]] = {}
        for index, name, text, processor in self._failures():
            cases.setdefault((f"{name}: {text}", processor), []).append(index)
        listed = [(len(indices), indices[0], *error) for error, indices in cases.items()]
        return sorted(listed, key=lambda complaint: -complaint[0])

    def dataset(self) -> Any:
        """Return an `xarray.Dataset` along the dimensions of the grids, and of the draws where there are more.

        Raises
        ------
        MissingExtraError
            Without xarray.
        """
        try:
            import xarray
        except ImportError:
            raise MissingExtraError("xarray is needed; install it with: pip install 'shapephase[study]'") from None
        grids, units = self.attributes["grids"], self.attributes["units"]
        dims = {**{name: len(values) for name, values in grids.items()}, "draw": int(self.attributes["draws"])}
        if dims["draw"] == 1 and len(dims) > 1:
            del dims["draw"]
        variables, missing = {}, self._unfinished_chunks()
        for name in (name for name in (*units, "status", *LETTERS) if name not in grids):
            array, values = self._arrays[name], self._sealed(name, missing)
            named = (*dims, *array.metadata.dimension_names[1:])
            variables[name] = (named, values.reshape(*dims.values(), *values.shape[1:]), dict(array.attrs))
        coordinates = {
            name: (name, values, {"units": units[name]}) for name, values in grids.items() if np.ndim(values) == 1
        }
        return xarray.Dataset(variables, coordinates, self.attributes)

    def write(self, number: int, results: Results, processor: str) -> None:
        """Store a chunk; its seal comes when all else is on the disk. Raises OutputFileError."""
        rows = {name: values for name, values in results.items() if name not in LETTERS or np.any(values)}
        with _disk_faults(self.path):
            for name in ("seal", *self._names):
                # Zarr reads a chunk that it fills only in part, and it may be damaged.
                self._file(name, number).unlink(missing_ok=True)
            for name, values in rows.items():
                self._arrays[name][self._part(number)] = values
            self._arrays["processor"][number] = letters(processor, _PROCESSOR_LENGTH)
            # Zarr writes no file for a chunk of fill values alone.
            files = [self._file(name, number) for name in (*rows, "processor")]
            _sync(self.path, [file for file in files if file.exists()])
            self._arrays["seal"][number] = np.frombuffer(self._seal(number), dtype=np.uint8)
            _sync(self.path, [self._file("seal", number)])

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep others from writing. Raises StudyStoreError where somebody does."""
        handle = os.open(self.path, os.O_RDONLY)
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise StudyStoreError(
                    f"{self.path}: another run is writing to this store; wait for it, or name another place"
                ) from None
            yield
        finally:
            os.close(handle)

    def _failures(self) -> Iterator[tuple[int, str, str, str]]:
        for number in self.failed_chunks().tolist():
            part = self._part(number)
            statuses, names, texts = (self._arrays[name][part] for name in ("status", *LETTERS))
            processor = _text(self._arrays["processor"][number])
            for row in np.flatnonzero(statuses > DONE).tolist():
                yield part.start + row, _text(names[row]), _text(texts[row]), processor

    def _sealed(self, name: str, missing: Integers) -> Any:
        """Return the numbers of an array where its chunks are whole, elsewhere its fill value."""
        array = self._arrays[name]
        if not len(missing):
            return array[...]
        rows = np.full(array.shape, array.fill_value, dtype=array.dtype)
        for number in np.setdiff1d(self._chunks, missing).tolist():
            part = self._part(number) if array.shape[0] == self.cases else number
            rows[part] = array[part]
        return rows

    def _unfinished_chunks(self) -> Integers:
        """Return `missing_chunks`. Raises StudyStoreError where some of them are damaged."""
        missing = self.missing_chunks()
        if len(damaged := self._with_seal(missing)):
            raise _damaged(self.path, self.chunk_texts(damaged))
        return missing

    def _with_seal(self, numbers: Integers) -> Integers:
        return np.array([number for number in numbers.tolist() if self._file("seal", number).exists()], dtype=np.int64)

    @property
    def _chunks(self) -> range:
        return range(-(-self.cases // self.attributes["chunk"]))

    def _part(self, number: int) -> slice:
        """Return the cases of a chunk."""
        chunk = self.attributes["chunk"]
        return slice(number * chunk, min((number + 1) * chunk, self.cases))

    @property
    def _names(self) -> tuple[str, ...]:
        """Arrays that a seal is of."""
        return (*sorted(self.attributes["units"]), *_OF_EVERY_STUDY)

    def _file(self, name: str, number: int) -> Path:
        """Return the file of a chunk of an array."""
        return self.path.joinpath(name, "c", str(number), *["0"] * (self._arrays[name].ndim - 1))

    def _seal(self, number: int) -> bytes:
        """Return SHA-256 of the files of a chunk, its number, the study and the versions."""
        identity = [self.attributes["study_hash"], self.attributes["versions"], number]
        seal = hashlib.sha256(json.dumps(identity, sort_keys=True).encode())
        for name in self._names:
            content = _content(self._file(name, number))
            seal.update(f"\n{name} {None if content is None else len(content)}\n".encode() + (content or b""))
        return seal.digest()

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        return dict(_zarr().open_group(self.path, mode="r+", zarr_format=3).arrays())


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
    metadata = _metadata(place)
    attributes = metadata.get("attributes", {})
    if attributes.get("format") == _FORMAT_WITHOUT_SEALS:
        raise StudyStoreError(
            f"{place}: an earlier version wrote this store, without checksums; read it with xarray.open_zarr, or "
            "compute the study into a new store"
        )
    if attributes.get("digest") != _metadata_digest(metadata):
        if not (place / "seal").is_dir():
            raise StudyStoreError(f"{place}: what is there is no store of a study")
        raise _damaged(place, "its zarr.json is not what was written")
    return StudyStore(place, attributes)


def new_store(path: str | os.PathLike[str], study: CaseTable) -> StudyStore:
    """Make an empty store, whole or not at all. Raises StudyStoreError where something is already, OutputFileError."""
    place = Path(path)
    if os.path.exists(place):
        open_study(place)
        raise StudyStoreError(
            f"{place}: there is a store already; go on with resume=True (--resume), or name another place"
        )
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


def store_to_resume(path: str | os.PathLike[str], study: CaseTable) -> StudyStore:
    """Return the store of this study, its metadata mended. Raises StudyStoreError."""
    place = Path(path)
    with tempfile.TemporaryDirectory() as folder, _disk_faults(place):
        try:
            store = open_study(place)
        except StudyStoreError:
            if not (place / "seal").is_dir():
                raise
            # Its description is lost: a seal shows whether the store is this study's.
            _make(fresh := Path(folder) / place.name, study)
            store = StudyStore(place, open_study(fresh).attributes)
            store.__dict__["_arrays"] = open_study(fresh)._arrays
            if len(store.missing_chunks()) == study.chunks:
                raise
            _write(place, (fresh / "zarr.json").read_bytes())
            store = open_study(place)
        _check_same(store, study)
        for name, metadata in _metadata(place)["consolidated_metadata"]["metadata"].items():
            if _metadata(place / name) != metadata:
                _write(place / name, json.dumps(metadata).encode())
    return store


def _check_same(store: StudyStore, study: CaseTable) -> None:
    """Raise StudyStoreError for a store that another study began, or this one with other versions."""
    if store.attributes["study_hash"] != study.hash:
        described = study.description, store.attributes["study"]
        mine, theirs = ({**whole, **whole["inputs"], "inputs": None} for whole in described)
        changed = [name for name in dict.fromkeys((*mine, *theirs)) if mine.get(name) != theirs.get(name)]
        raise StudyStoreError(
            f"{store.path}: this is the store of another study, of seed {store.attributes['seed']} and "
            f"{store.cases} cases; different: {', '.join(changed)}"
        )
    if differing := version_differences(store.attributes["versions"], computing_versions()):
        raise StudyStoreError(
            f"{store.path}: {differing}: the cases would not be the same; install those versions with pip, or "
            "begin a new store"
        )


def _make(place: Path, study: CaseTable) -> None:
    """Make an empty store, which holds only descriptions."""
    grids = {
        axis.name: [str(label) for label in axis.labels] or np.asarray(axis.grid).tolist()
        for axis in study.axes
        if axis.grid_length is not None
    }
    origin = provenance()
    attributes = {
        "format": _FORMAT,
        "study": study.description,
        "study_hash": study.hash,
        **{name: getattr(study, name) for name in ("cases", "chunk", "draws", "seed", "inputs")},
        "grids": grids,
        "versions": computing_versions(),
        **{name: origin[name] for name in ("command", "date")},
        "processor": processor_text(),
        "units": {
            **{axis.name: unit_of(axis.name) for axis in study.axes},
            **{output.name: output.unit for output in study.resolved_outputs},
        },
    }
    text = {"about": "letters in UTF-8"}
    arrays: list[tuple[str, str, Mapping[str, int], Mapping[str, Any]]] = [
        ("status", "case", {}, {"flag_values": [*STATUS.values()], "flag_meanings": " ".join(STATUS)}),
        *((name, "case", {f"{name}_letter": length}, text) for name, length in LETTERS.items()),
        ("processor", "chunk", {"processor_letter": _PROCESSOR_LENGTH}, text),
        ("seal", "chunk", {"seal_letter": 32}, {"about": "SHA-256 of the files of each chunk"}),
    ]
    for axis in study.axes:
        labels = {"labels": grids[axis.name]} if axis.labels else {}
        about = {"units": unit_of(axis.name), "role": "varied", **labels}
        arrays.append((axis.name, "case", _dimensions(axis.name, axis.shape), about))
    for output in study.resolved_outputs:
        about = {"units": output.unit, "role": "result", "about": output.about}
        arrays.append((output.name, "case", _dimensions(output.name, output.shape), about))
    zarr = _zarr()
    group = zarr.create_group(place, zarr_format=3, attributes=attributes)
    for name, by, dimensions, about in arrays:
        rows, chunk = (study.cases, min(study.chunk, study.cases)) if by == "case" else (study.chunks, 1)
        group.create_array(
            name,
            shape=(rows, *dimensions.values()),
            chunks=(chunk, *dimensions.values()),
            dtype=np.float64 if "units" in about else np.uint8,
            fill_value=np.nan if "units" in about else 0,
            dimension_names=(by, *dimensions),
            attributes=dict(about),
            compressors=[zarr.codecs.ZstdCodec(), zarr.codecs.Crc32cCodec()] if by == "case" else None,
        )
    # Zarr warns that its specification does not have this yet, and xarray where it is missing.
    with quiet():
        zarr.consolidate_metadata(place)
    metadata = _metadata(place)
    metadata["attributes"]["digest"] = _metadata_digest(metadata)
    _write(place, json.dumps(metadata, indent=2).encode())


def _dimensions(name: str, shape: tuple[int, ...]) -> dict[str, int]:
    """Return the axes of one value, by name."""
    if shape == (3, 3):
        return {"row": 3, "column": 3}
    names = [f"{name}_{place}" for place in range(len(shape))]
    if name in OF_PARTS:
        names[0] = "part"
    if shape and shape[-1] == 3:
        names[-1] = "xyz"
    return dict(zip(names, shape, strict=True))


def _metadata(place: Path) -> dict[str, Any]:
    """Return the description of a group or an array; empty where that cannot be read."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        metadata = json.loads((place / "zarr.json").read_bytes())
        if isinstance(metadata, dict) and isinstance(metadata.get("attributes"), dict):
            return metadata
    return {}


def _metadata_digest(metadata: Mapping[str, Any]) -> str:
    own = {name: value for name, value in metadata.get("attributes", {}).items() if name != "digest"}
    return hashlib.sha256(json.dumps({**metadata, "attributes": own}, sort_keys=True).encode()).hexdigest()


def _content(file: Path) -> bytes | None:
    """Return the bytes of a file; None where it cannot be read."""
    with contextlib.suppress(OSError):
        return file.read_bytes()
    return None


def _write(place: Path, metadata: bytes) -> None:
    write_whole(place / "zarr.json", lambda stream: stream.write(metadata))


def _sync(root: Path, files: Collection[Path]) -> None:
    """Wait until files, and the folders that they are in, are on the disk."""
    folders = {folder for file in files for folder in file.parents if folder.is_relative_to(root)}
    for place in (*files, *folders, root):
        handle = os.open(place, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextlib.contextmanager
def _disk_faults(path: Path) -> Iterator[None]:
    """Turn faults of the system's files into errors of ours."""
    try:
        yield
    except (OutputFileError, StudyStoreError):
        raise
    except OSError as error:
        raise OutputFileError(f"cannot write {path}: {error.strerror or error}") from None


def _damaged(path: Path, what: str) -> StudyStoreError:
    return StudyStoreError(f"{path}: the store is damaged: {what}; compute it again with resume=True (--resume)")


def _zarr() -> Any:
    try:
        with quiet():
            import zarr
    except ImportError:
        raise MissingExtraError("a study needs Zarr; install it with: pip install 'shapephase[study]'") from None
    return zarr


def _text(row: Any) -> str:
    return np.asarray(row).tobytes().rstrip(b"\0").decode(errors="ignore")
