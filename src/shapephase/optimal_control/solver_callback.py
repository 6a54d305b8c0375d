"""Solvers observed: progress is reported, the best iterate is kept, a stop is passed on, and Ctrl-C is not lost."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

import numpy as np

from ..arrays import Array

IterationCallback = Callable[[int, float, float, float], bool]
"""Called after each iteration with its number, cost, largest constraint violation and goal error [rad]; True stops the
solver."""

# Constraint violation, scaled, up to which iterates are compared by cost: the Newton corrections remove this much.
_FEASIBLE = 1e-3
# In its module `casadi.py`, what CasADi calls to see what an argument is, such as `DM_from_array`.
_ASKS = "_from_"
# Where Python drops what is raised when an object that others know weakly ends: functions and their modules.
_ENDS = (("remove", "weakref"), ("_remove", "_weakrefset"))
# Until Ctrl-C is tried again [s]: many times what such a question takes.
_LATER = 1e-3


class BestIterate:
    """The best of a solver's iterates so far.

    Parameters
    ----------
    goal_error : of the unknowns of an iterate [rad]

    Attributes
    ----------
    unknowns, cost, infeasibility : of the best iterate: the cheapest of the feasible ones, or else the least infeasible
    iterations : number of iterates reported
    stopped : whether the callback has stopped the solver
    error : what the callback raised, Ctrl-C included, where it cannot pass through the solver
    """

    def __init__(self, callback: IterationCallback | None, goal_error: Callable[[Array], float]) -> None:
        self._callback, self._goal_error = callback, goal_error
        self.unknowns: Array = np.empty(0)
        self.cost, self.infeasibility = np.inf, np.inf
        self.iterations = 0
        self.stopped = False
        self.error: BaseException | None = None

    def report(self, unknowns: Array, cost: float, infeasibility: float) -> bool:
        """Take note of an iterate; returns whether to stop at it."""
        better = (max(infeasibility, _FEASIBLE), cost) < (max(self.infeasibility, _FEASIBLE), self.cost)
        if better or not len(self.unknowns):
            self.unknowns, self.cost, self.infeasibility = unknowns, cost, infeasibility
        if self._callback is not None:
            self.stopped = self._callback(self.iterations, cost, infeasibility, self._goal_error(unknowns))
        self.iterations += 1
        return self.stopped


def ipopt_callback(best: BestIterate, unknowns: int, low: Array, high: Array) -> Any:
    """The `iteration_callback` of `casadi.nlpsol` with rows g between low and high."""
    import casadi

    class Report(casadi.Callback):
        def __init__(self) -> None:
            super().__init__()
            self.construct("report")

        def get_n_in(self) -> int:
            return casadi.nlpsol_n_out()

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            lengths = {"x": unknowns, "f": 1, "g": len(low), "lam_x": unknowns, "lam_g": len(low), "lam_p": 0}
            return casadi.Sparsity.dense(lengths[casadi.nlpsol_out(i)], 1)

        def eval(self, given: Any) -> list[int]:
            try:
                rows = np.array(given[2]).ravel()
                violation = np.maximum(low - rows, rows - high).max(initial=0.0)
                return [int(best.report(np.array(given[0]).ravel(), float(given[1]), float(violation)))]
            except BaseException as error:
                # CasADi wraps Ctrl-C where it comes while a matrix is converted.
                wrapped = isinstance(error, SystemError) and error.__cause__ is not None
                best.error = error.__cause__ if wrapped else error
                return [1]

    return Report()


@contextmanager
def heard_interrupts() -> Iterator[None]:
    """Ctrl-C is not lost where exceptions are: while CasADi asks in Python what an argument is, and takes any for a no,
    and while an object is taken apart.

    There it comes a moment later. Elsewhere it comes at once, and where a library makes another error of it, such as
    one half imported, it is Ctrl-C all the same.
    """
    before: Any = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return

    pressed = False

    def handler(number: int, frame: FrameType | None) -> None:
        nonlocal pressed
        pressed = True
        if _would_be_lost(frame):
            again = threading.Timer(_LATER, os.kill, (os.getpid(), signal.SIGINT))
            again.daemon = True
            again.start()
        else:
            before(number, frame)

    signal.signal(signal.SIGINT, handler)
    try:
        yield
    except Exception as error:
        if pressed:
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, before)


# Whether Ctrl-C has come to a process that does nothing but search.
_PRESSED = threading.Event()


def keep_interrupts() -> None:
    """From now on Ctrl-C ends the searches of this process, and nothing else."""
    signal.signal(signal.SIGINT, _kept)


def _kept(*_: Any) -> None:
    _PRESSED.set()


@contextmanager
def stopping_interrupts() -> Iterator[Callable[[], bool]]:
    """A function that says whether Ctrl-C has come, which does nothing else; outside the main thread it never does."""
    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    if signal.getsignal(signal.SIGINT) is _kept:
        yield _PRESSED.is_set
        return
    pressed = False

    def handler(*_: Any) -> None:
        nonlocal pressed
        pressed = True

    before = signal.signal(signal.SIGINT, handler)
    try:
        yield lambda: pressed
    finally:
        signal.signal(signal.SIGINT, before)


def _would_be_lost(frame: FrameType | None) -> bool:
    """Whether Python is in a question of CasADi, in the end of an object, or in what these call."""
    while frame is not None:
        code = frame.f_code
        question = _ASKS in code.co_name and os.path.basename(code.co_filename) == "casadi.py"
        ending = code.co_name == "__del__" or (code.co_name, frame.f_globals.get("__name__")) in _ENDS
        if question or ending:
            return True
        frame = frame.f_back
    return False
