"""Where kernels become machine code, and the one place that decides whether they do.

A kernel is written once, in the part of Python that Numba compiles; the same source runs interpreted, with the same
bits: products and sums are neither reordered nor contracted, and a division by zero gives infinity in both.
"""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache, update_wrapper
from importlib import import_module
from pathlib import Path
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np

from ..arrays import Array
from ..errors import CompiledCodeWarning, CompilerError
from .kept_code import KeptFunction, kernel_folder

_P = ParamSpec("_P")
_R = TypeVar("_R")
_F = TypeVar("_F", bound=Callable[..., Any])

# Modules of `kernels/`, each with a function `warm` that calls its kernels once.
_MODULES = ("step_kernel", "spectra_kernel", "curve_kernel", "tree_kernel")
# Without `forceinline` loops over lanes take half as long again; the compiler takes as long with as without.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "nogil": True, "forceinline": True, "no_cfunc_wrapper": True}
_NUMBA_DOES_NOT_WORK = (ImportError, AttributeError, SystemError)  # raised by a Numba for another NumPy or Python
_MANY_STEPS = 5000  # of the formula, of 110 us interpreted each; a motion takes some 400 in its three marches
_MANY_MOMENTA = 20  # about 0.8 s interpreted
_MANY_ROWS = 200  # of a recording, about 1.5 s interpreted

_lock = threading.RLock()
_parts: dict[Callable[..., Any], Any] = {}  # with Numba's functions, once it is there
_is_command = False
_is_large = False


def inline(function: _F) -> _F:
    """Mark a part of kernels, compiled into each place where it is called; it stays a plain function of Python."""
    with _lock:
        _parts[function] = None
    return function


class Kernel(Generic[_P, _R]):
    """A function that Python calls: machine code where `is_used`, made when first called, else interpreted.

    Kernels call parts, never other kernels; arrays among their arguments are as from `plain`.
    """

    def __init__(self, function: Callable[_P, _R]) -> None:
        update_wrapper(self, function)
        self.interpreted = function
        self._compiled: Callable[_P, _R] | None = None

    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Compute."""
        if is_used():
            return (self._compiled or self._dispatcher())(*args, **kwargs)
        with np.errstate(all="ignore"):
            return self.interpreted(*args, **kwargs)

    def _dispatcher(self) -> Callable[_P, _R]:
        """Numba's function, which loads or compiles the code for the types of its first arguments."""
        import numba
        from numba.core.types import Dispatcher
        from numba.core.typing.templates import infer_global

        jit: Any = numba.njit
        with _lock:
            for part, dispatcher in _parts.items():
                if dispatcher is None:
                    # Numba then knows the plain function by this one, compiled once for the types of its arguments.
                    _parts[part] = jit(no_cpython_wrapper=True, **_OPTIONS)(part)
                    infer_global(part, Dispatcher(_parts[part]))
            compiled: Any = self._compiled or jit(**_OPTIONS)(self.interpreted)
            if self._compiled is None:
                name = f"{self.interpreted.__module__.rpartition('.')[2]}.{self.interpreted.__qualname__}"
                compiled._cache = KeptFunction(name, kernel_folder())
                self._compiled = compiled
            return compiled


kernel = Kernel
"""Make a kernel of a function; a decorator."""


def plain(array: Array) -> Array:
    """Return the array, or a copy, in double precision, contiguous and writable, which kernels are compiled for.

    For any other kind Numba would compile a kernel once more. Kernels do not write to what they are given to read.
    """
    flags = array.flags
    kind: Any = np.complex128 if np.iscomplexobj(array) else np.float64
    if not (flags.c_contiguous and flags.aligned and array.dtype == kind):
        return np.array(array, dtype=kind, order="C")
    if flags.writeable:
        return array
    view = array.view()
    try:
        view.flags.writeable = True
    except ValueError:
        return array.copy()
    return view


def is_used() -> bool:
    """True where kernels are machine code now; imports Numba.

    Always in a program that imports the library; in a command once much work is expected. Never with
    NUMBA_DISABLE_JIT=1, nor where Numba cannot be imported.
    """
    return (_is_large or not _is_command) and not fault()


def fault() -> str:
    """Return why there can be no machine code in this process, empty where there can; imports Numba."""
    # A Numba that interprets would take the loops one operation after another.
    compiles = os.environ.get("NUMBA_DISABLE_JIT", "0").strip() in ("", "0")
    return _import_fault() if compiles else "NUMBA_DISABLE_JIT is set"


@contextmanager
def as_command() -> Iterator[None]:
    """Interpret within, until much work is expected: Numba takes as long to import as a short command to run."""
    global _is_command, _is_large
    before = _is_command, _is_large
    _is_command, _is_large = True, False
    try:
        yield
    finally:
        _is_command, _is_large = before


def expect_work(*, momenta: int = 1, rows: int = 0, steps: int = 0) -> None:
    """`expect_much` if momenta on one motion, rows of a recording or steps to come are many."""
    if momenta >= _MANY_MOMENTA or rows >= _MANY_ROWS or steps >= _MANY_STEPS:
        expect_much()


def expect_much() -> None:
    """Use machine code in this command from now on."""
    global _is_large
    _is_large = True


def compile_steps() -> list[Path]:
    """Compile the innermost loops with Numba, once for all.

    They are kept in $XDG_CACHE_HOME/shapephase (or ~/.cache/shapephase), where this and every later process finds
    them; deleting the folder undoes it. Without this call each is compiled when it is first needed, in some seconds.

    Returns
    -------
    The files that keep them.

    Raises
    ------
    CompilerError
        If Numba does not work, or there is no folder that only this user may write to.

    Examples
    --------
    >>> kept = sp.compile_steps()
    >>> len(kept) > 0
    True
    """
    expect_much()
    with warnings.catch_warnings():
        warnings.simplefilter("error", CompiledCodeWarning)
        try:
            folder = kernel_folder()
            if fault():
                raise CompilerError(f"nothing can be compiled: {fault()}")
            for name in _MODULES:
                import_module(f".kernels.{name}", __package__).warm()
        except CompiledCodeWarning as error:
            raise CompilerError(str(error)) from None
    if folder is None:
        raise CompilerError("the kernels are not kept: there is no folder that only this user may write to")
    return sorted(file for file in folder.iterdir() if file.is_file())


@lru_cache(maxsize=1)
def _import_fault() -> str:
    """Import Numba; why that fails, warned of once, or an empty text."""
    try:
        # Ctrl-C interrupts the main thread alone: in another, Numba is imported wholly or not at all.
        with _lock, ThreadPoolExecutor(1) as importing:
            importing.submit(_import_numba).result()
    except _NUMBA_DOES_NOT_WORK as error:
        why = f"Numba does not work ({error})"
        warnings.warn(f"{why}: computing without it, much slower", CompiledCodeWarning, stacklevel=3)
        return why
    return ""


def _import_numba() -> None:
    """Import also what Numba leaves for the first call of a compiled function."""
    from numba.core.registry import cpu_target

    context: Any = cpu_target.target_context
    context.refresh()


def _acquire_before_fork() -> None:
    """Wait until no other thread imports or compiles: a child would wait for that thread, which it does not have."""
    _lock.acquire()
    # Numba has a lock of its own once it is imported.
    numba = sys.modules.get("numba.core.compiler_lock")
    _held_at_fork.append([_lock] if numba is None else [_lock, numba.global_compiler_lock])
    for lock in _held_at_fork[-1][1:]:
        lock.acquire()


def _release_after_fork() -> None:
    for lock in reversed(_held_at_fork.pop()):
        lock.release()


_held_at_fork: list[list[Any]] = []
if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_acquire_before_fork, after_in_parent=_release_after_fork, after_in_child=_release_after_fork
    )
