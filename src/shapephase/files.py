"""Files out, written whole or not at all wherever they go; and NumPy's arrays in."""

from __future__ import annotations

import contextlib
import difflib
import io
import os
import secrets
import stat
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from .errors import InputFileNotFoundError, OutputFileError


def no_such_file(path: str | os.PathLike[str]) -> InputFileNotFoundError:
    """Return the error for a missing file, with the names in its folder that are nearest to its own."""
    where = Path(path)
    try:
        near = difflib.get_close_matches(where.name, os.listdir(where.parent))
    except OSError:
        return InputFileNotFoundError(
            f"{where}: there is no such file, and no folder {where.parent}; type another path"
        )
    choices = " or ".join(str(where.with_name(name)) for name in near)
    remedy = f"type {choices}" if near else f"type ls {where.parent} to see what is there"
    return InputFileNotFoundError(f"{where}: there is no such file; {remedy}")


def write_whole(path: str | os.PathLike[str], write: Callable[[BinaryIO], object]) -> None:
    """Write a file so that a reader sees the old one or the new one, never half, even if the writer is killed.

    A temporary file `.<random>.part` in the same folder is filled, synced and renamed over the old one, whose mode is
    kept; a symbolic link stays, and the file it leads to is replaced. A pipe or a character device (`/dev/stdout`) gets
    the bytes once all of them are known.

    Parameters
    ----------
    write : called with the open stream; if it raises, the old file stays

    Raises
    ------
    InputFileNotFoundError
        If there is no such folder.
    OutputFileError
        If it is a folder or cannot be written to, or the disk is full.
    BrokenPipeError
        If it is a pipe whose reader has closed it.
    """
    target = output_target(path)
    if target.is_stream:
        content = io.BytesIO()
        write(content)
        with _system_faults(target.path), target.opened() as stream:
            stream.write(content.getbuffer())
        return
    temporary = target.path.with_name(f".{secrets.token_hex(8)}.part")
    created = 0o666 if target.mode is None else 0o600  # the system takes the umask off the mode of a new file
    try:
        with _system_faults(target.path):
            with open(temporary, "xb", opener=lambda name, flags: os.open(name, flags, created)) as stream:
                if target.mode is not None:
                    os.fchmod(stream.fileno(), target.mode)
                write(stream)
                stream.flush()
                os.fsync(stream.fileno())
            os.replace(temporary, target.path)
            _sync_folder(target.path.parent)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


@dataclass(frozen=True, kw_only=True)
class OutputTarget:
    """Where bytes go.

    path : of the file itself, links followed; of a stream, as given
    is_stream : whether it takes bytes one after the other, and has no contents to replace
    descriptor : 1 for standard output, 2 for standard error, or None
    mode : permissions of the file that is there; None for a new file
    """

    path: Path
    is_stream: bool = False
    descriptor: int | None = None
    mode: int | None = None

    def opened(self) -> BinaryIO:
        """Return a stream of bytes to it."""
        return open(self.path, "wb") if self.descriptor is None else os.fdopen(os.dup(self.descriptor), "wb")


def output_target(path: str | os.PathLike[str]) -> OutputTarget:
    """Return where bytes to a path go, before anything is computed; nothing is changed there.

    Raises InputFileNotFoundError if there is no such folder, OutputFileError if it cannot be written to.
    """
    given = Path(path)
    try:
        with _system_faults(given):
            return _checked_target(given)
    except ValueError as error:
        raise OutputFileError(f"cannot write {str(given)!r}: {error}") from None


def size_text(path: str | os.PathLike[str]) -> str:
    """Size of a file in words, such as "1.2 MB"."""
    size = float(os.stat(path).st_size)
    for unit in ("bytes", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.0f} {unit}" if unit == "bytes" or size >= 100.0 else f"{size:.1f} {unit}"
        size /= 1000.0
    return f"{size:.1f} GB"


def npz_arrays(data: bytes) -> dict[str, Any]:
    """Arrays of an NPZ file, by name. Raises ValueError for an unreadable file; Python objects are never read."""
    try:
        # Read to the end, where the checksum of a member is compared.
        members = list(zip_members(data).items())
    except ValueError:
        raise
    except Exception as error:  # a damaged archive fails in the decoders in many ways
        raise ValueError(f"no NPZ file that can be read ({error!s:.200}); write it anew with numpy.savez") from None
    names = [name.removesuffix(".npy") for name, _ in members]
    if len(set(names)) != len(names):
        raise ValueError("an array stands twice in the file; write it anew with numpy.savez")
    return {name: npy_array(content) for name, (_, content) in zip(names, members, strict=True)}


def zip_members(data: bytes) -> dict[str, bytes]:
    """Files in a ZIP archive, by name.

    Raises ValueError for names that stand twice; for what is damaged, whatever `zipfile` raises.
    """
    members: dict[str, bytes] = {}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for entry in archive.infolist():
            if entry.filename in members:
                raise ValueError(f"{entry.filename[:40]!r} stands twice in the file")
            members[entry.filename] = archive.read(entry)
    return members


def npy_array(data: bytes) -> Any:
    """Array of an NPY file. Raises ValueError for an unreadable file; Python objects are never read."""
    try:
        return np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # a damaged header fails in NumPy's parser in many ways
        if "allow_pickle" in str(error):
            error = ValueError("it holds Python objects, which can run code; save arrays of numbers and of texts")
        raise ValueError(f"no array that can be read ({error!s:.200})") from None


def _checked_target(given: Path) -> OutputTarget:
    place, status = Path(os.path.realpath(given)), None
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        status = os.stat(given)
    if status is not None:
        for descriptor in (1, 2):
            with contextlib.suppress(OSError):  # closed
                if os.path.samestat(status, os.fstat(descriptor)):
                    return OutputTarget(path=given, is_stream=True, descriptor=descriptor)
        is_stream = stat.S_ISFIFO(status.st_mode) or stat.S_ISCHR(status.st_mode)
        if stat.S_ISDIR(status.st_mode):
            raise OutputFileError(f"cannot write {given}: it is a folder; name a file in it")
        if not is_stream and not stat.S_ISREG(status.st_mode):
            raise OutputFileError(f"cannot write {given}: it is neither a file nor a pipe")
        if not _may(given, os.W_OK):
            raise OutputFileError(f"cannot write {given}: what is there may not be written to")
        if is_stream:
            return OutputTarget(path=given, is_stream=True)
    folder = place.parent
    if not folder.is_dir():
        raise InputFileNotFoundError(
            f"{given}: there is no such folder to write {given.name} to; type mkdir -p {folder}"
        )
    if not _may(folder, os.W_OK | os.X_OK):
        raise OutputFileError(f"cannot write {given}: nothing may be written to the folder {folder}")
    return OutputTarget(path=place, mode=None if status is None else stat.S_IMODE(status.st_mode))


@contextlib.contextmanager
def _system_faults(path: Path) -> Iterator[None]:
    """Raise the system's errors about a file as OutputFileError, but for a pipe whose reader has closed it."""
    try:
        yield
    except (OutputFileError, InputFileNotFoundError, BrokenPipeError):
        raise
    except OSError as error:
        raise OutputFileError(f"cannot write {path}: {error.strerror or error}") from None


def _may(place: Path, mode: int) -> bool:
    """True where the process may use a file or a folder in this way, as the user that it acts for."""
    return os.access(place, mode, effective_ids=os.access in os.supports_effective_ids)


def _sync_folder(folder: Path) -> None:
    """Make the new name survive a power failure, where the system can promise that."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
