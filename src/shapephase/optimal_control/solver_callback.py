"""Callback of a solver's iterations: reports progress, keeps the best iterate, stops the solver, passes errors on."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np

from ..arrays import Array

IterationCallback = Callable[[int, float, float, float], bool]
"""Called after each iteration with its number, cost, largest constraint violation and goal error [rad]; True stops the
solver."""

STOP_REQUESTED = threading.Event()
"""Ends the searches of this process: set by the Ctrl-C handler of a worker process, which does nothing else."""

_FEASIBLE = 1e-3  # scaled constraint violation up to which iterates are compared by cost: the polish removes this much


class BestIterate:
    """The best of a solver's iterates so far: the cheapest feasible one, or else the least infeasible.

    Parameters
    ----------
    goal_error : function of the unknowns [rad]

    Attributes
    ----------
    unknowns, cost, infeasibility : of the best iterate
    iterations : number of iterates reported
    stopped : whether the callback has stopped the solver
    error : exception raised in the callback, KeyboardInterrupt included; raised again when the solver has returned
    """

    def __init__(self, callback: IterationCallback | None, goal_error: Callable[[Array], float]) -> None:
        self._callback, self._goal_error = callback, goal_error
        self.unknowns: Array = np.empty(0)
        self.cost, self.infeasibility = np.inf, np.inf
        self.iterations = 0
        self.stopped = False
        self.error: BaseException | None = None

    def report(self, unknowns: Array, cost: float, infeasibility: float) -> bool:
        """Record an iterate; return whether to stop at it."""
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
                # A KeyboardInterrupt during the conversion of a matrix comes wrapped by CasADi.
                wrapped = isinstance(error, SystemError) and error.__cause__ is not None
                best.error = error.__cause__ if wrapped else error
                return [1]

    return Report()
