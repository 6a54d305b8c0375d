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
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arguments import check_choice, check_file_name
from ..arrays import Integers
from ..display import short_repr
from ..errors import MissingExtraError, StudyStoreError
from ..letters import printable
from ._evaluate import DIED, DONE, RAISED, TIMED_OUT, Results
from ._stored import content_of, damaged, disk_faults, metadata_digest, metadata_of, sync_files, zarr_module

if TYPE_CHECKING:
    pass

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
PROCESSOR_LENGTH = 96
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
        with disk_faults(self.path):
            for name in ("seal", *self._names):
                # What is there may be damaged: Zarr reads a chunk that it fills only in part.
                self._file(name, number).unlink(missing_ok=True)
            for name, values in rows.items():
                self._array(name)[part] = values
            self._array("processor")[number] = _letters(processor, PROCESSOR_LENGTH)
            # Zarr writes no file for a chunk of fill values alone.
            files = [self._file(name, number) for name in (*rows, "processor")]
            sync_files(self.path, [file for file in files if file.exists()])
            self._array("seal")[number] = np.frombuffer(self._seal(number), dtype=np.uint8)
            sync_files(self.path, [self._file("seal", number)])

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
        """Chunks without results, by `missing_chunks`. Raises StudyStoreError where some of them are damaged."""
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
            content = content_of(self._file(name, number))
            seal.update(f"\n{name} {None if content is None else len(content)}\n".encode() + (content or b""))
        return seal.digest()

    def _is_whole(self, number: int) -> bool:
        return content_of(self._file("seal", number)) == self._seal(number)

    @cached_property
    def _arrays(self) -> dict[str, Any]:
        return {}

    @cached_property
    def _group(self) -> Any:
        return zarr_module().open_group(self.path, mode="r+", zarr_format=3)


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
    whole = metadata_of(place)
    attributes = whole.get("attributes", {})
    if attributes.get("format") == _WITHOUT_SEALS:
        raise StudyStoreError(
            f"{place}: an earlier version wrote this store, without checksums; read it with xarray.open_zarr, or "
            "compute the study into a new store"
        )
    if attributes.get("digest") != metadata_digest(whole):
        if not (place / "seal").is_dir():
            raise StudyStoreError(f"{place}: what is there is no store of a study")
        raise damaged(place, "its zarr.json is not what was written")
    return StudyStore(place, attributes)


def _text(letters: Any) -> str:
    return np.asarray(letters).tobytes().rstrip(b"\0").decode(errors="ignore")


def _letters(text: str, length: int) -> Any:
    found = np.zeros(length, dtype=np.uint8)
    encoded = printable(text).encode()[:length]
    found[: len(encoded)] = np.frombuffer(encoded, dtype=np.uint8)
    return found
