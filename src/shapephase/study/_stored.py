"""Files of a store: read, written and synced, and the checksum of what the store says of itself."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..errors import MissingExtraError, OutputFileError, StudyStoreError
from ..files import write_whole
from ..warning_filters import quiet


def metadata_of(place: Path) -> dict[str, Any]:
    """What a group or an array says of itself; nothing where that cannot be read."""
    with contextlib.suppress(OSError, ValueError, RecursionError):
        whole = json.loads((place / "zarr.json").read_bytes())
        if isinstance(whole, dict) and isinstance(whole.get("attributes"), dict):
            return whole
    return {}


def metadata_digest(whole: Mapping[str, Any]) -> str:
    """SHA-256 of the metadata of a store."""
    own = {name: value for name, value in whole.get("attributes", {}).items() if name != "digest"}
    return hashlib.sha256(json.dumps({**whole, "attributes": own}, sort_keys=True).encode()).hexdigest()


def content_of(file: Path) -> bytes | None:
    """The bytes of a file; None where it cannot be read."""
    try:
        return file.read_bytes()
    except OSError:
        return None


def write_file(file: Path, content: bytes) -> None:
    file.parent.mkdir(exist_ok=True)
    write_whole(file, lambda stream: stream.write(content))


def sync_files(root: Path, files: Collection[Path]) -> None:
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


@contextlib.contextmanager
def disk_faults(path: Path) -> Iterator[None]:
    """What the system says of files, as an error of ours."""
    try:
        yield
    except (OutputFileError, StudyStoreError):
        raise
    except OSError as error:
        raise OutputFileError(f"cannot write {path}: {error.strerror or error}") from None


def damaged(path: Path, what: str) -> StudyStoreError:
    """The error for a store that is not what was written."""
    return StudyStoreError(f"{path}: the store is damaged: {what}; compute it again with resume=True (--resume)")


def zarr_module() -> Any:
    try:
        with quiet():
            import zarr
    except ImportError:
        raise MissingExtraError("a study needs Zarr; install it with: pip install 'shapephase[study]'") from None
    return zarr
