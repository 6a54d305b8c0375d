"""The innermost loops of `reconstruct` in machine code."""

from __future__ import annotations

from pathlib import Path

from .fast.engine import compile_kernels


def compile_steps() -> list[Path]:
    """Compile the innermost loops of `reconstruct` with Numba (`pip install 'shapephase[fast]'`), once for all.

    They are kept in $XDG_CACHE_HOME/shapephase (or ~/.cache/shapephase), where this and every later process finds
    them; deleting the folder undoes it. Without this call they are compiled by the first reconstruction, in some ten
    seconds. Results stay the same to rounding.

    Returns
    -------
    The files that keep them.

    Raises
    ------
    MissingExtraError
        If Numba is not installed.
    CompilerError
        If it does not work, or there is no folder that only this user may write to.
    """
    return compile_kernels()
