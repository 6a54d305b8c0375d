"""Files out, written whole or not at all wherever they go; and NumPy's arrays in."""

from __future__ import annotations

import contextlib
import difflib
import fcntl
import io
import os
import re
import secrets
import stat
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from .errors import InputFileNotFoundError, OutputFileError

# Characters of a name that all the file systems in use allow [bytes].
_LONGEST_NAME = 255
# What makes the names of temporary files differ [bytes]; twice as many characters.
_RANDOM_BYTES = 4
_ENDING = ".part"
# Links that may follow one another, as in the kernel.
_MOST_LINKS = 40
# The folders whose entries are the open files of a process.
_OPEN_FILES = re.compile(r"/dev/fd|/proc/[^/]+(/task/[0-9]+)?/fd")


def no_such_file(path: str | os.PathLike[str]) -> InputFileNotFoundError:
    """The error for a file that is not there, with the names in its folder that are nearest to its own."""
    where = Path(path)
    try:
        near = difflib.get_close_matches(where.name, os.listdir(where.parent))
    except OSError:
        return InputFileNotFoundError(
            f"{where}: there is no such file, and no folder {where.parent}; type another path"
        )
    found = " or ".join(str(where.with_name(name)) for name in near)
    return InputFileNotFoundError(
        f"{where}: there is no such file; {f'type {found}' if near else f'type ls {where.parent} to see what is there'}"
    )


def write_whole(path: str | os.PathLike[str], write: Callable[[BinaryIO], object]) -> None:
    """Write a file so that a reader sees the old one or the new one, never half, whenever the writer dies.

    A temporary file in the same folder is filled, synced and renamed over the old one, whose mode is kept; a symbolic
    link stays, and the file it leads to is replaced. What killed writers left there for the same name is removed. A
    pipe or a character device (`/dev/stdout`) gets the bytes once all of them are known.

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
        If it is a pipe that nobody reads any more.
    """
    target = output_target(path)
    if target.is_stream:
        content = io.BytesIO()
        write(content)
        with _system_faults(target.path), target.opened() as stream:
            stream.write(content.getbuffer())
            stream.flush()
        return
    with _system_faults(target.path):
        _remove_litter(target.path)
        temporary, stream = _temporary(target)
    try:
        with _system_faults(target.path), stream:
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

    Attributes
    ----------
    path : of the file itself, links followed; of a stream, as given
    descriptor : the number of the open file of this process that it names, or None
    is_stream : whether it takes bytes one after the other, and has no contents to replace
    status : of the file that is there, or None if it is new
    """

    path: Path
    descriptor: int | None = None
    is_stream: bool = False
    status: os.stat_result | None = None

    def opened(self) -> BinaryIO:
        """A stream of bytes to it."""
        if self.descriptor is None:
            return open(self.path, "wb")
        return os.fdopen(os.dup(self.descriptor), "wb")


def output_target(path: str | os.PathLike[str]) -> OutputTarget:
    """Look at where something is to be written, before anything is computed; nothing is changed there.

    Raises InputFileNotFoundError if there is no such folder, OutputFileError if it cannot be written to.
    """
    given = Path(path)
    try:
        with _system_faults(given):
            place, descriptor = _followed(given)
            if descriptor is not None:
                return OutputTarget(path=given, descriptor=descriptor, is_stream=True)
            return _regular(place, given)
    except ValueError as error:
        raise OutputFileError(f"cannot write {str(given)!r}: {error}") from None


def size_text(path: str | os.PathLike[str]) -> str:
    """The size of a file for people, such as "1.2 MB"."""
    size = float(os.stat(path).st_size)
    for unit in ("bytes", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.0f} {unit}" if unit == "bytes" or size >= 100.0 else f"{size:.1f} {unit}"
        size /= 1000.0
    return f"{size:.1f} GB"


def npz_arrays(data: bytes) -> dict[str, Any]:
    """Arrays of an NPZ file, by name. Raises ValueError for what cannot be read; Python objects are never read."""
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
    found: dict[str, bytes] = {}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for entry in archive.infolist():
            if entry.filename in found:
                raise ValueError(f"{entry.filename[:40]!r} stands twice in the file")
            found[entry.filename] = archive.read(entry)
    return found


def npy_array(data: bytes) -> Any:
    """Array of an NPY file. Raises ValueError for what cannot be read; Python objects are never read."""
    try:
        return np.load(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # a damaged header fails in NumPy's parser in many ways
        if "allow_pickle" in str(error):
            error = ValueError("it holds Python objects, which can run code; save arrays of numbers and of texts")
        raise ValueError(f"no array that can be read ({error!s:.200})") from None


def _followed(path: Path) -> tuple[Path, int | None]:
    """The file that links lead to, and the number of the open file of this process that they name on the way."""
    place = Path(os.path.abspath(path))
    for _ in range(_MOST_LINKS):
        folder = os.path.realpath(place.parent)
        if _OPEN_FILES.fullmatch(folder) and place.name.isdecimal():
            own = folder == "/dev/fd" or folder.startswith((f"/proc/{os.getpid()}/", "/proc/self/"))
            return place, int(place.name) if own else None
        if not place.is_symlink():
            break
        place = Path(os.path.normpath(os.path.join(folder, os.readlink(place))))
    return place, None


def _regular(place: Path, given: Path) -> OutputTarget:
    """The target of a path that names no open file of this process."""
    folder = place.parent
    if not folder.is_dir():
        raise InputFileNotFoundError(
            f"{given}: there is no such folder to write {given.name} to; type mkdir -p {folder}"
        )
    try:
        status = os.stat(place)
    except FileNotFoundError:
        status = None
    is_stream = False
    if status is not None:
        is_stream = stat.S_ISFIFO(status.st_mode) or stat.S_ISCHR(status.st_mode)
        if stat.S_ISDIR(status.st_mode):
            raise OutputFileError(f"cannot write {given}: it is a folder; name a file in it")
        if not is_stream and not stat.S_ISREG(status.st_mode):
            raise OutputFileError(f"cannot write {given}: it is neither a file nor a pipe")
        if not _may(place, os.W_OK):
            raise OutputFileError(f"cannot write {given}: what is there may not be written to")
    if not is_stream and not _may(folder, os.W_OK | os.X_OK):
        raise OutputFileError(f"cannot write {given}: nothing may be written to the folder {folder}")
    return OutputTarget(path=given if is_stream else place, is_stream=is_stream, status=status)


@contextlib.contextmanager
def _system_faults(path: Path) -> Iterator[None]:
    """What the system says of a file, as an error of ours; a pipe that nobody reads is no error."""
    try:
        yield
    except (OutputFileError, InputFileNotFoundError, BrokenPipeError):
        raise
    except OSError as error:
        raise OutputFileError(f"cannot write {path}: {error.strerror or error}") from None


def _temporary(target: OutputTarget) -> tuple[Path, BinaryIO]:
    """A new file beside the target, locked as long as it is open, so that nobody takes it for litter."""
    while True:
        place = target.path.with_name(_prefix(target.path) + secrets.token_hex(_RANDOM_BYTES) + _ENDING)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC | os.O_NOFOLLOW
        try:
            # The system takes the umask away from the mode of a new file.
            handle = os.open(place, flags, 0o666 if target.status is None else 0o600)
        except FileExistsError:
            continue
        stream = os.fdopen(handle, "wb")
        try:
            _lock(handle, wait=True)
            if target.status is not None:
                _take_over(handle, target.status)
            if os.fstat(handle).st_nlink:
                return place, stream
        except BaseException:
            stream.close()
            place.unlink(missing_ok=True)
            raise
        # Someone else took it for litter before it was locked.
        stream.close()


def _may(place: Path, mode: int) -> bool:
    """Whether the process may use a file or a folder in this way, as the user that it acts for."""
    return os.access(place, mode, effective_ids=os.access in os.supports_effective_ids)


def _take_over(handle: int, status: os.stat_result) -> None:
    """Give an open file the mode of another and, where that is allowed, its owner."""
    if (status.st_uid, status.st_gid) != (os.geteuid(), os.getegid()):
        with contextlib.suppress(OSError):
            os.fchown(handle, status.st_uid, status.st_gid)
    os.fchmod(handle, stat.S_IMODE(status.st_mode))


def _lock(handle: int, *, wait: bool) -> bool:
    """Lock an open file; whether that was done: nobody else has, and the file system has locks."""
    try:
        fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove_litter(target: Path) -> None:
    """Remove temporary files of the same target whose writers are gone: nobody has locked them."""
    own = re.compile(re.escape(_prefix(target)) + f"[0-9a-z_]{{{2 * _RANDOM_BYTES}}}" + re.escape(_ENDING))
    with os.scandir(target.parent) as entries:
        found = [entry.path for entry in entries if own.fullmatch(entry.name) and entry.is_file(follow_symlinks=False)]
    for litter in found:
        with contextlib.suppress(OSError):
            handle = os.open(litter, os.O_WRONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK)
            try:
                if _lock(handle, wait=False):
                    os.unlink(litter)
            finally:
                os.close(handle)


def _prefix(target: Path) -> str:
    """What the temporary files of a target begin with."""
    room = _LONGEST_NAME - len(_ENDING) - 2 * _RANDOM_BYTES - 2
    return f".{os.fsencode(target.name)[:room].decode(errors='ignore')}."


def _sync_folder(folder: Path) -> None:
    """The new name survives a failure of the power, where the system can promise that."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
