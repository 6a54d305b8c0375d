"""Machine code in files: one for each kernel, types of arguments and processor, loaded only if nothing can be wrong.

What is loaded is run, so files and folders that others could have written to are not used. Numba's own cache keeps an
index and data files: a process that is killed between them, two at once, or a file that was cut off leave it with an
exception or with the code of another processor, and a changed helper in another file with old numbers (its issues
1833, 4807).
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
import os
import pickle
import stat
import sys
import warnings
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..errors import CompiledCodeWarning, InputFileNotFoundError, OutputFileError
from ..files import write_whole

_HERE = Path(__file__).parent
SOURCES = tuple(_HERE / name for name in ("kernels", "constants.py", "machine_code.py", "kept_code.py"))
"""Whatever the kernels' code and constants depend on: files, and folders of files."""
_PRIVATE = 0o700
_OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
_DIGEST_BYTES = hashlib.sha256().digest_size  # at the beginning of each file
_DIGITS = 16  # of a digest in the name of a file or folder


def code_folder() -> Path:
    """Return the folder of compiled functions: $XDG_CACHE_HOME/shapephase, or ~/.cache/shapephase.

    Raises RuntimeError if the home directory cannot be determined.

    Examples
    --------
    >>> sp.integrator.code_folder().name
    'shapephase'
    """
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    # A relative path is to be ignored: XDG Base Directory Specification.
    return (named if named.is_absolute() else Path.home() / ".cache") / "shapephase"


@lru_cache(maxsize=1)
def kernel_folder() -> Path | None:
    """Return the folder of this version's kernels, made if need be; None, with one warning, where none is safe."""
    try:
        folder = code_folder()
        _make_private(folder)
        kernels = folder / f"kernels-{_fingerprint()}"
        _make_private(kernels)
    except (OSError, RuntimeError) as error:
        warnings.warn(
            f"machine code is not kept, and made anew by every process: {error}; $XDG_CACHE_HOME names another folder",
            CompiledCodeWarning,
            stacklevel=2,
        )
        return None
    return kernels


def _make_private(folder: Path) -> None:
    """Make a folder of mode 700, or check that an existing one belongs to this user alone. Raises OSError."""
    try:
        folder.mkdir(mode=_PRIVATE, parents=True)
    except FileExistsError:
        status = os.lstat(folder)
        if not stat.S_ISDIR(status.st_mode):
            raise NotADirectoryError(f"{folder} is no folder") from None
        if status.st_uid != os.getuid():
            raise PermissionError(f"{folder} belongs to another user") from None
        if status.st_mode & _OTHERS_MAY_WRITE:
            raise PermissionError(f"others may write to {folder}") from None
        if stat.S_IMODE(status.st_mode) != _PRIVATE:
            os.chmod(folder, _PRIVATE)


def _fingerprint() -> str:
    """Hash of `SOURCES`: compiled code does not show that a function it calls, or a constant, has changed."""
    files = [file for source in SOURCES for file in (sorted(source.glob("*.py")) if source.is_dir() else [source])]
    whole = hashlib.sha256()
    for file in files:
        content = file.read_bytes()
        whole.update(f"{file.name} {len(content)} ".encode() + content)
    return whole.hexdigest()[:_DIGITS]


class KeptFunction:
    """The files of one kernel; in the place of the cache of Numba's dispatcher, with the two methods called there.

    name : of the kernel
    folder : None: nothing is kept
    """

    def __init__(self, name: str, folder: Path | None) -> None:
        self._name, self._folder = name, folder

    def load_overload(self, signature: object, context: Any) -> Any:
        """Return the compiled function for argument types; None, which is announced, if it must be compiled."""
        from numba.core.compiler import CompileResult

        # Numba registers here what the code refers to.
        context.refresh()
        content = self._content(self._key(signature, context.codegen()))
        if content is None:
            _announce()
            return None
        rebuild: Any = CompileResult._rebuild
        return rebuild(context, *pickle.loads(content))

    def save_overload(self, signature: object, compiled: Any) -> None:
        """Keep what was compiled; where that fails, warn, once for all kernels."""
        from numba.core.serialize import dumps

        if self._folder is None:
            return
        key, content = self._key(signature, compiled.codegen), dumps(compiled._reduce())
        file = self._file(key)
        # An old file could not be used; `write_whole` would keep its mode.
        with contextlib.suppress(OSError):
            file.unlink()
        try:
            write_whole(file, lambda stream: stream.write(_digest(key, content) + content))
        except (OutputFileError, InputFileNotFoundError) as error:
            why = str(error).rpartition(": ")[2]
            warnings.warn(
                f"machine code is not kept in {self._folder}, and made anew by every process: {why}",
                CompiledCodeWarning,
                stacklevel=2,
            )

    def _key(self, signature: object, codegen: Any) -> bytes:
        """All that the code depends on besides the sources: types of the arguments, processor, versions."""
        import numba

        python = sys.implementation.cache_tag
        return repr((self._name, signature, codegen.magic_tuple(), numba.__version__, python)).encode()

    def _content(self, key: bytes) -> bytes | None:
        """Return what is kept for a key, whole and written by this user; else None."""
        try:
            whole = b"" if self._folder is None else _trusted_bytes(self._file(key))
        except OSError:
            return None
        content = whole[_DIGEST_BYTES:]
        return content if whole[:_DIGEST_BYTES] == _digest(key, content) else None

    def _file(self, key: bytes) -> Path:
        return Path(self._folder or "") / f"{self._name}-{_digest(key, b'').hex()[:_DIGITS]}.nbc"


def _digest(key: bytes, content: bytes) -> bytes:
    """Hash of the code and of what it is for, so that one file is never taken for another."""
    return hashlib.sha256(hashlib.sha256(key).digest() + content).digest()


def _trusted_bytes(file: Path) -> bytes:
    """Content of a file that nobody else could have written to; of any other nothing. Raises OSError."""
    handle = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode) or status.st_uid != os.getuid() or status.st_mode & _OTHERS_MAY_WRITE:
            return b""
        with open(handle, "rb", closefd=False) as stream:
            return stream.read()
    finally:
        os.close(handle)


@lru_cache(maxsize=1)
def _announce() -> None:
    """Log, once, why the first results of a process take seconds."""
    logging.getLogger("shapephase").warning("compiling loops that are new on this machine: some seconds")
