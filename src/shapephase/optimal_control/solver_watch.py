"""Solvers followed from iteration to iteration: told to whoever watches, and stopped when he asks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..arrays import Array

Watch = Callable[[int, float, float], bool]
"""Told the iteration, the cost and the largest constraint violated after each; says whether to stop there."""

# Of two iterates so nearly feasible, which the polish mends, the cheaper one is the better.
_FEASIBLE = 1e-3


class BestIterate:
    """A solver at work, and the best of its iterates.

    Attributes
    ----------
    unknowns, cost, infeasibility : of the best iterate: the cheapest of the feasible ones, or else the least infeasible
    iterations : how many were told
    stopped : whether it was asked to stop
    error : what `watch` raised, Ctrl-C included, where it cannot pass through the solver
    """

    def __init__(self, watch: Watch | None) -> None:
        self._watch = watch
        self.unknowns: Array = np.empty(0)
        self.cost, self.infeasibility = np.inf, np.inf
        self.iterations = 0
        self.stopped = False
        self.error: BaseException | None = None

    def stops(self, unknowns: Array, cost: float, infeasibility: float) -> bool:
        """Whether to stop at this iterate."""
        better = (max(infeasibility, _FEASIBLE), cost) < (max(self.infeasibility, _FEASIBLE), self.cost)
        if better or not len(self.unknowns):
            self.unknowns, self.cost, self.infeasibility = unknowns, cost, infeasibility
        self.stopped = self._watch is not None and self._watch(self.iterations, cost, infeasibility)
        self.iterations += 1
        return self.stopped


def ipopt_callback(followed: BestIterate, unknowns: int, low: Array, high: Array) -> Any:
    """The `iteration_callback` of `casadi.nlpsol` with rows g between low and high."""
    import casadi

    class Heard(casadi.Callback):
        def __init__(self) -> None:
            super().__init__()
            self.construct("heard")

        def get_n_in(self) -> int:
            return casadi.nlpsol_n_out()

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int) -> Any:
            sizes = {"x": unknowns, "f": 1, "g": len(low), "lam_x": unknowns, "lam_g": len(low), "lam_p": 0}
            return casadi.Sparsity.dense(sizes[casadi.nlpsol_out(i)], 1)

        def eval(self, given: Any) -> list[int]:
            try:
                rows = np.array(given[2]).ravel()
                violated = np.maximum(low - rows, rows - high).max(initial=0.0)
                return [int(followed.stops(np.array(given[0]).ravel(), float(given[1]), float(violated)))]
            except BaseException as error:
                # CasADi wraps Ctrl-C where it comes while a matrix is converted.
                wrapped = isinstance(error, SystemError) and error.__cause__ is not None
                followed.error = error.__cause__ if wrapped else error
                return [1]

    return Heard()
