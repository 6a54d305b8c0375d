"""Where machine code is kept: a folder that belongs to the user and that nobody else may write to.

What is loaded from there is run, so a folder that others could have written to is not used.
"""

from __future__ import annotations

import hashlib
import os
import stat
import warnings
from functools import lru_cache
from pathlib import Path

from ...errors import CompiledCodeWarning

_HERE = Path(__file__).parent
_PRIVATE = 0o700
OTHERS_MAY_WRITE = stat.S_IWGRP | stat.S_IWOTH
"""Bits of the mode of a file or folder that is not to be trusted."""


def code_folder() -> Path:
    """Where compiled functions are kept: $XDG_CACHE_HOME/shapephase, or ~/.cache/shapephase.

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
    """The folder of this version's kernels, made if need be; None, with one warning, where there is no safe one."""
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
    """Make a folder of mode 700, or see that it is one of this user. Raises OSError."""
    try:
        folder.mkdir(mode=_PRIVATE, parents=True)
    except FileExistsError:
        found = os.lstat(folder)
        if not stat.S_ISDIR(found.st_mode):
            raise NotADirectoryError(f"{folder} is no folder") from None
        if found.st_uid != os.getuid():
            raise PermissionError(f"{folder} belongs to another user") from None
        if found.st_mode & OTHERS_MAY_WRITE:
            raise PermissionError(f"others may write to {folder}") from None
        if stat.S_IMODE(found.st_mode) != _PRIVATE:
            os.chmod(folder, _PRIVATE)


def _fingerprint() -> str:
    """Hash of the sources of all kernels, and of `so3`, whose constants they contain.

    A function that was compiled does not know when one that it calls, or a constant, has changed.
    """
    whole = hashlib.sha256()
    for file in [*sorted(_HERE.rglob("*.py")), _HERE.parents[1] / "so3.py"]:
        whole.update(file.read_bytes())
    return whole.hexdigest()[:16]
