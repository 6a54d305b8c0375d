"""How functions become machine code: the only place that imports Numba.

Products and sums are never reordered, and contracted in `fused` only, where there is no choice of what is fused with
what: a result does not depend on what is computed beside it, on how many lanes the processor has, or on threads.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import config
from numba.core.registry import cpu_target

from ..cache_folder import kernel_folder
from .kept_code import KeptFunction

# Without the interpreter's lock; a division by zero gives infinity, as in NumPy, and needs no branch.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
_config: Any = config
_lock = threading.Lock()

inline: Callable[[Any], Any] = njit(forceinline=True, **_OPTIONS)
"""A part of kernels, put where it is called; not to be called from Python."""
part: Callable[[Any], Any] = njit(**_OPTIONS)
"""A part of kernels that exists once, however often it is called."""
fused: Callable[[Any], Any] = njit(fastmath={"contract"}, **_OPTIONS)
"""The same with each product and the sum that it is added to in one operation, rounded once, where the processor has
that: only for sums of products one after another, in which there is no choice what is fused with what."""


def kernel(function: Any) -> Any:
    """What Python calls: compiled when first called, and kept for later processes where there is a safe folder."""
    folder = kernel_folder()
    if folder is None:
        return njit(**_OPTIONS)(function)
    with _lock:
        # Numba asks where to keep a function once, here; what else uses Numba in this process has its own place.
        before, _config.CACHE_DIR = _config.CACHE_DIR, str(folder)
        try:
            made: Any = njit(**_OPTIONS)(function)
            made._cache = KeptFunction(function)
            return made
        except RuntimeError:
            return njit(**_OPTIONS)(function)
        finally:
            _config.CACHE_DIR = before


def import_late_parts() -> None:
    """Import what Numba leaves for the first call of a compiled function."""
    context: Any = cpu_target.target_context
    context.refresh()
