"""Files of machine code that are loaded only if they are whole, of this user, and of exactly what is asked for.

Numba's own index and data files are two for one function: a process that is killed between them, two at once, or a file
that was cut off leave it with an error, or with the code of another processor.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import pickle
import stat
import warnings
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.serialize import dumps

from ....errors import CompiledCodeWarning, InputFileNotFoundError, OutputFileError
from ....files import write_whole
from ..cache_folder import OTHERS_MAY_WRITE

# Of the key, in the name of a file [hexadecimal digits].
_DIGITS = 16
# What a file begins with.
_DIGEST_BYTES = hashlib.sha256().digest_size


class KeptFunction(FunctionCache):
    """The machine code of a function, one file for each key: signature, processor, code of the function."""

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = _CheckedFiles(Path(self._cache_path) / self._impl.filename_base)


class _CheckedFiles:
    """Stands for Numba's index and data files.

    Parameters
    ----------
    stem : what the names of the files begin with, and their folder
    """

    def __init__(self, stem: Path) -> None:
        self._stem = stem

    def load(self, key: object) -> Any:
        """What was kept for a key; None if there is nothing that can be trusted."""
        try:
            whole = _trusted_content(self._file(key))
        except OSError:
            return None
        content = whole[_DIGEST_BYTES:]
        return pickle.loads(content) if whole[:_DIGEST_BYTES] == self._digest(key, content) else None

    def save(self, key: object, data: Any) -> None:
        """Keep it; where that cannot be done a warning says so, once for all functions."""
        file, content = self._file(key), dumps(data)
        # What is there could not be used; its owner and mode would be kept.
        with contextlib.suppress(OSError):
            file.unlink()
        try:
            write_whole(file, lambda stream: stream.write(self._digest(key, content) + content))
        except (OutputFileError, InputFileNotFoundError) as error:
            why = str(error).rpartition(": ")[2]
            warnings.warn(
                f"machine code is not kept in {self._stem.parent}, and made anew by every process: {why}",
                CompiledCodeWarning,
                stacklevel=2,
            )

    def flush(self) -> None:
        """Nothing: a file of another key is never loaded."""

    def _file(self, key: object) -> Path:
        return self._stem.with_name(f"{self._stem.name}.{self._label(key).hex()[:_DIGITS]}.nbc")

    def _digest(self, key: object, content: bytes) -> bytes:
        """Of what the code is for and of the code, so that one file is never taken for another."""
        return hashlib.sha256(self._label(key) + content).digest()

    def _label(self, key: object) -> bytes:
        """Of the function and the key, in which two functions may be the same."""
        return hashlib.sha256(repr((numba.__version__, self._stem.name, key)).encode()).digest()


def _trusted_content(file: Path) -> bytes:
    """Of a file that nobody else could have written to; of any other nothing. Raises OSError."""
    handle = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & OTHERS_MAY_WRITE:
            return b""
        with open(handle, "rb", closefd=False) as stream:
            return stream.read()
    finally:
        os.close(handle)
