"""The kernels for the rest of the library: arrays in, arrays out; imported and compiled when first needed."""

from __future__ import annotations

import logging
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from ...arrays import Array
from ...errors import CompiledCodeWarning, CompilerError, MissingExtraError
from .cache_folder import kernel_folder
from .switch import is_installed, is_on

_MODULES = {"sample_tree": "._tree_kernel"}
"""Kernels and where they are."""
_lock = threading.Lock()
_is_ready = False
_is_broken = False


class LinkRows(Protocol):
    """A tree of links as plain numbers: `shapephase.body.link_rows` says what they are."""

    @property
    def parents(self) -> Any:
        """(k,) unsigned."""
        ...

    @property
    def turning(self) -> Array:
        """(k,)."""
        ...

    @property
    def leads(self) -> Array:
        """(k,)."""
        ...

    @property
    def rows(self) -> Array:
        """(k + 1, 22)."""
        ...

    @property
    def mass(self) -> float:
        """[kg]."""
        ...

    def coordinates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        """Of all joints: (N, n), (N, n) -> (N, k), (N, k)."""
        ...


def is_ready() -> bool:
    """Whether kernels are to be used now; they are imported, and compiled if they never were."""
    return is_on() and not _is_broken and (_is_ready or _load())


def tree_channels(tree: LinkRows, shapes: Array, rates: Array) -> Array | None:
    """I^-1 (xx yy zz yz xz xy) and I^-1 L_o of a tree of links: (N, n), (N, n) -> (N, 9).

    None where a tensor is nearly singular or a number is not finite: slower code says what is wrong.
    """
    values, reliable = _sampled(tree, shapes, rates, inverted=True)
    return values if reliable else None


def tree_inertia_and_momentum(tree: LinkRows, shapes: Array, rates: Array) -> tuple[Array, Array]:
    """I and L_o about the centre of mass, axes of the base: (N, n), (N, n) -> (N, 3, 3), (N, 3)."""
    values, _ = _sampled(tree, shapes, rates, inverted=False)
    return values[:, [0, 5, 4, 5, 1, 3, 4, 3, 2]].reshape(-1, 3, 3), values[:, 6:]


def compile_kernels() -> list[Path]:
    """Compile all kernels, unless this machine has them already; the files that keep them.

    Raises
    ------
    MissingExtraError
        If Numba is not installed.
    CompilerError
        If it does not work, or there is no folder to keep the kernels in.
    """
    if not is_installed():
        raise MissingExtraError("compiled steps need Numba; install it with: pip install 'shapephase[fast]'")
    with warnings.catch_warnings():
        warnings.simplefilter("error", CompiledCodeWarning)
        try:
            folder = kernel_folder()
            _warm()
        except CompiledCodeWarning as warning:
            raise CompilerError(str(warning)) from None
    if folder is None:
        raise CompilerError("there is no safe folder for compiled functions; name another one in $XDG_CACHE_HOME")
    return sorted(file for file in folder.rglob("*") if file.is_file())


def _sampled(tree: LinkRows, shapes: Array, rates: Array, *, inverted: bool) -> tuple[Array, bool]:
    module = import_module("._tree_kernel", __package__)
    values = np.empty((len(shapes), 9))
    coordinates = tree.coordinates(shapes, rates)
    reliable = module.sample_tree(
        tree.parents, tree.turning, tree.leads, tree.rows.reshape(-1), tree.mass, *coordinates, inverted,
        module.LANES, values,
    )  # fmt: skip
    return values, bool(reliable)


def _load() -> bool:
    """Import the kernels, and compile them if they are not kept; False, with one warning, where Numba does not work."""
    global _is_ready, _is_broken
    with _lock:
        if _is_ready or _is_broken:
            return _is_ready
        try:
            for module in set(_MODULES.values()):
                import_module(module, __package__)
            if not _are_kept():
                with _announced():
                    _warm()
        except (ImportError, AttributeError, SystemError) as error:
            # A version of Numba that does not go with this NumPy or this Python says so in many ways.
            _is_broken = True
            warnings.warn(f"Numba does not work ({error}): computing without it", CompiledCodeWarning, stacklevel=2)
        else:
            _is_ready = True
    return _is_ready


def _are_kept() -> bool:
    """Whether every kernel has been compiled before, as far as the names of files tell."""
    folder = kernel_folder()
    return folder is not None and all(any(folder.rglob(f"*{name}-*.nbi")) for name in _MODULES)


@contextmanager
def _announced() -> Iterator[None]:
    """Say what takes so long: a line on a terminal, else a message to the log."""
    what = "compiling the innermost loops for this machine, once"
    if not sys.stderr.isatty():
        logging.getLogger("shapephase").warning("%s", what)
        yield
        return
    start = time.perf_counter()
    print(f"shapephase: {what} ... ", end="", file=sys.stderr, flush=True)
    yield
    print(f"{time.perf_counter() - start:.1f} s", file=sys.stderr)


def _warm() -> None:
    """Call every kernel with the least arguments that it takes."""
    _sampled(_OneLink(), np.zeros((1, 0)), np.zeros((1, 0)), inverted=True)


class _OneLink:
    """A body without joints."""

    parents = np.zeros(0, dtype=np.uint32)
    turning = leads = np.zeros(0)
    rows = np.ones((1, 22))
    mass = 1.0

    def coordinates(self, shapes: Array, rates: Array) -> tuple[Array, Array]:
        return shapes, rates
