"""What a store must say to be one: its attributes agree with each other, and every array can be read."""

from __future__ import annotations

import contextlib
import hashlib
import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from ..errors import ShapePhaseError, StudyStoreError
from .study import MOST_CASES, MOST_OF_A_CHUNK

_MOST_OF_A_CASE = 1_000_000
"""Numbers of one array; an output has up to a thousand for each axis of its shape."""
_LONGEST_SAID = 120
"""Letters of what Zarr says of a fault."""


def check_attributes(path: Path, attributes: Mapping[str, Any]) -> None:
    """Raise StudyStoreError where a store does not say what it was written with."""
    study, grids = attributes.get("study"), attributes.get("grids")
    whole = {"cases": MOST_CASES, "chunk": MOST_OF_A_CHUNK, "draws": MOST_CASES}
    for name, most in whole.items():
        value = attributes.get(name)
        if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= most:
            raise damaged(path, f"{name} is {value!r:.60}, a whole number from 1 to {most} is needed")
    digest = hashlib.sha256(json.dumps(study, sort_keys=True).encode()).hexdigest()
    if not isinstance(study, Mapping) or digest != attributes.get("study_hash"):
        raise damaged(path, "its study is not the one with its hash")
    if any(attributes.get(name) != study.get(name) for name in ("chunk", "draws", "seed")):
        raise damaged(path, "chunk, draws or seed are not those of its study")
    if not isinstance(grids, Mapping) or not all(isinstance(values, list) for values in grids.values()):
        raise damaged(path, "its grids are no lists by name")
    if math.prod(map(len, grids.values())) * attributes["draws"] != attributes["cases"]:
        raise damaged(path, f"its grids and draws do not give {attributes['cases']} cases")
    names = {*study["over"], *(output[0] for output in study["outputs"])}
    units, versions = attributes.get("units"), attributes.get("versions")
    if not isinstance(units, Mapping) or set(units) != names or not isinstance(versions, Mapping):
        raise damaged(path, "its units or versions are not those of its study")


def array_of(path: Path, group: Any, name: str, first: int) -> Any:
    """An array of Zarr whose first axis is so long. Raises StudyStoreError where there is none."""
    with faults_of(path, f"array {name!r}"):
        array = group[name]
        shape = tuple(array.shape)
    if shape[:1] != (first,) or math.prod(shape[1:]) > _MOST_OF_A_CASE:
        raise damaged(path, f"array {name!r} has the shape {shape}, where the first axis has {first}")
    return array


@contextlib.contextmanager
def faults_of(path: Path, what: str) -> Iterator[None]:
    """Whatever goes wrong with what is stored, as an error of ours."""
    try:
        yield
    except (ShapePhaseError, OSError):
        raise
    except Exception as error:
        # Zarr and its codecs raise what they like.
        said = " ".join(str(error).split())[:_LONGEST_SAID]
        raise damaged(path, f"{what} cannot be used ({type(error).__name__}: {said})") from None


def damaged(path: Path, what: str) -> StudyStoreError:
    """The error for a store that says what cannot be."""
    return StudyStoreError(f"{path}: the store is damaged: {what}; the study fills a new one")
