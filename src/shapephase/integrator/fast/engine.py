"""Whether the kernels are there: imported, and compiled if they never were, when first asked for."""

from __future__ import annotations

import logging
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

from ...errors import CompiledCodeWarning, CompilerError, MissingExtraError
from . import closing, curves, gradients, loops, marches, nodes, panels, rounds, tree, variants
from .cache_folder import kernel_folder
from .switch import is_installed, is_on, is_wanted, may_compile

_KERNELS = {
    "sample_trees": ".kernels.tree_kernel",
    "march_momenta": ".kernels.march_kernel",
    "march_at_rest": ".kernels.march_kernel",
    "march_variants": ".kernels.variant_kernel",
    "growths_and_rounding": ".kernels.growth_kernel",
    "step_derivatives": ".kernels.derivative_kernel",
    "momentum_gradients": ".kernels.gradient_kernel",
    "inertial_sums": ".kernels.gradient_kernel",
    "rotations_within_steps": ".kernels.node_kernel",
    "curve_pieces": ".kernels.curve_kernel",
    "close_curves": ".kernels.closing_kernel",
    "times_of_samples": ".kernels.panel_kernel",
    "series_of_panels": ".kernels.panel_kernel",
    "sample_round": ".kernels.panel_kernel",
    "errors_of_panels": ".kernels.panel_kernel",
    "change_ends": ".kernels.panel_kernel",
    "halve_panels": ".kernels.panel_kernel",
    "errors_of_loop": ".kernels.loop_kernel",
    "sizes_of_terms": ".kernels.plan_kernel",
    "plan_steps": ".kernels.plan_kernel",
    "defects_of_panels": ".kernels.plan_kernel",
    "take_rounds": ".kernels.round_kernel",
}
"""And the modules that they are in."""
# A version of Numba that does not go with this NumPy or this Python says so in many ways.
_NUMBA_DOES_NOT_WORK = (ImportError, AttributeError, SystemError)
_lock = threading.Lock()
_is_ready = False
_is_broken = False
_decided: ContextVar[bool | None] = ContextVar("_decided", default=None)


def is_ready() -> bool:
    """Whether kernels are to be used now; they are imported, and compiled if they never were."""
    decided = _decided.get()
    if decided is not None:
        return decided
    return is_wanted() if _is_ready else is_on() and not _is_broken and _load()


class Decided:
    """Within, whether kernels are used stays as it is at the start: nothing can change it half-way."""

    def __enter__(self) -> None:
        """Ask once."""
        self._before = _decided.set(is_ready())

    def __exit__(self, *_: object) -> None:
        """As before."""
        _decided.reset(self._before)


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

    Examples
    --------
    >>> kept = sp.compile_steps()
    >>> len(kept) > 0
    True
    """
    if not is_installed():
        raise MissingExtraError("compiled steps need Numba; install it with: pip install 'shapephase[fast]'")
    with warnings.catch_warnings():
        warnings.simplefilter("error", CompiledCodeWarning)
        try:
            folder = kernel_folder()
            _import_kernels()
            _warm()
        except (CompiledCodeWarning, *_NUMBA_DOES_NOT_WORK) as error:
            raise CompilerError(str(error)) from None
    files = [] if folder is None else sorted(file for file in folder.rglob("*") if file.is_file())
    if not files:
        raise CompilerError("the kernels are not kept: there is no folder that only this user may write to")
    return files


def _load() -> bool:
    """Import the kernels, and compile them if they are not kept, where that is allowed; whether they can be used."""
    global _is_ready, _is_broken
    with _lock:
        if _is_ready or _is_broken:
            return _is_ready
        kept = _are_kept()
        if not kept and not may_compile():
            return False
        try:
            _import_kernels()
        except _NUMBA_DOES_NOT_WORK as error:
            _is_broken = True
            warnings.warn(f"Numba does not work ({error}): computing without it", CompiledCodeWarning, stacklevel=2)
            return False
        if not kept:
            with _announced():
                _warm()
        _is_ready = True
    return True


def _import_kernels() -> None:
    with _ctrl_c_waits():
        for module in set(_KERNELS.values()):
            import_module(module, __package__)
        import_module(".kernels.jit", __package__).import_late_parts()


@contextmanager
def _ctrl_c_waits() -> Iterator[None]:
    """Ctrl-C comes at the end: Numba half imported would be of no use until the process ends."""
    before: Any = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    presses: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: presses.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if presses:
            signal.raise_signal(signal.SIGINT)


@lru_cache(maxsize=1)
def _are_kept() -> bool:
    """Whether every kernel was compiled before this process first asked, as far as the names of files tell."""
    folder = kernel_folder()
    return folder is not None and all(any(folder.rglob(f"*{name}-*.nbc")) for name in _KERNELS)


@contextmanager
def _announced() -> Iterator[None]:
    """Say what takes so long: a line on a terminal, else a message to the log; nothing where the log wants none."""
    what = "compiling the innermost loops for this machine, once"
    log = logging.getLogger("shapephase")
    on_terminal = sys.stderr is not None and sys.stderr.isatty()
    if not (on_terminal and log.isEnabledFor(logging.WARNING)):
        log.warning("%s", what)
        yield
        return
    start = time.perf_counter()
    print(f"shapephase: {what} ... ", end="", file=sys.stderr, flush=True)
    yield
    print(f"{time.perf_counter() - start:.1f} s", file=sys.stderr)


def _warm() -> None:
    """Call every kernel, so that it is loaded, or compiled and kept."""
    tree.warm()
    gradients.warm()
    nodes.warm()
    marches.warm()
    panels.warm()
    curves.warm()
    loops.warm()
    closing.warm()
    variants.warm()
    rounds.warm()
