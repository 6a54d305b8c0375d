"""Stores are made, and found again for a study that goes on."""

from __future__ import annotations

import hashlib
import json
import os
import secrets
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import OutputFileError, StudyStoreError
from ..provenance import provenance
from ..warning_filters import quiet
from ._axes import OF_PARTS
from ._evaluate import NAME_LENGTH, TEXT_LENGTH
from ._processor import computing_versions, other_versions, processor_text
from ._stored import disk_faults, metadata_digest, metadata_of, sync_files, write_file, zarr_module
from .store import FORMAT, PROCESSOR_LENGTH, STATUS, StudyStore, open_study
from .study import Study


def new_store(path: str | os.PathLike[str], study: Study) -> StudyStore:
    """Make an empty store, whole or not at all. Raises StudyStoreError where something is already, OutputFileError."""
    place = Path(path)
    if os.path.exists(place):
        raise StudyStoreError(f"{place}: there is something already; go on with it by resume, or name another place")
    if not place.parent.is_dir():
        raise OutputFileError(f"cannot write {place}: there is no such folder {place.parent}")
    temporary = place.with_name(f".{place.name}.{secrets.token_hex(4)}.part")
    try:
        with disk_faults(place):
            _make(temporary, study)
            sync_files(temporary, list(temporary.rglob("zarr.json")))
            os.rename(temporary, place)
            sync_files(place.parent, [place])
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise
    return open_study(place)


def store_to_resume(path: str | os.PathLike[str], study: Study) -> StudyStore:
    """The store of this study, its metadata mended. Raises StudyStoreError."""
    place = Path(path)
    with tempfile.TemporaryDirectory() as folder, disk_faults(place):
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
                write_file(place / file.relative_to(fresh), file.read_bytes())
            store = open_study(place)
        check_same(store, study)
        for name, metadata in metadata_of(place)["consolidated_metadata"]["metadata"].items():
            if metadata_of(place / name) != metadata:
                write_file(place / name / "zarr.json", json.dumps(metadata).encode())
    return store


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
    group = zarr_module().create_group(place, zarr_format=3, attributes=attributes)
    meanings = {"flag_values": list(STATUS.values()), "flag_meanings": " ".join(STATUS)}
    letters = {"about": "letters in UTF-8"}
    _create(group, study, "status", np.uint8, 0, {}, meanings)
    for name, length in (("error_name", NAME_LENGTH), ("error_text", TEXT_LENGTH)):
        _create(group, study, name, np.uint8, 0, {f"{name}_letter": length}, letters)
    for name, length, about in (
        ("processor", PROCESSOR_LENGTH, letters),
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
        zarr_module().consolidate_metadata(place)
    whole = metadata_of(place)
    whole["attributes"]["digest"] = metadata_digest(whole)
    (place / "zarr.json").write_text(json.dumps(whole, indent=2))


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
        compressors=[zarr_module().codecs.ZstdCodec(), zarr_module().codecs.Crc32cCodec()],
    )
