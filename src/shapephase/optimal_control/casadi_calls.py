"""Small formulas run as CasADi functions: a fraction of what NumPy takes for arrays of a few entries."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array

Formula = Callable[[list[Any]], list[Any]]
# Functions of one thread; a buffer holds a few kilobytes, and a computation uses a few dozen.
_MOST_BUFFERS = 128


class _Buffers(threading.local):
    """The functions that a thread has called, each with the memory it works on; every thread has its own."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Any, Any, Any, list[int]]] = {}

    def for_function(self, function: Any) -> tuple[Any, Any, list[int]]:
        """The buffer of a function, the call that evaluates it, and the lengths of its results."""
        known = self._known.get(id(function))
        if known is None:
            if len(self._known) >= _MOST_BUFFERS:
                self._known.clear()
            # The function is kept alive, so that no other one gets its id.
            lengths = [function.numel_out(place) for place in range(function.n_out())]
            known = self._known[id(function)] = function, *function.buffer(), lengths
        return known[1:]


_buffers = _Buffers()


def call_casadi(function: Any, rows: int, *arguments: Array) -> list[Array]:
    """Evaluate a CasADi function on arrays, in memory of this thread, so that threads can call it at the same time.

    Arguments hold numbers in the order of the function's inputs (column-major); each result is (rows, entries / rows).
    """
    known = _buffers.for_function(function)
    results = [np.empty((rows, length // rows)) for length in known[2]]
    _evaluate(known, [np.ascontiguousarray(argument) for argument in arguments], results)
    return results


def call_casadi_into(function: Any, arguments: Sequence[Array], results: Sequence[Array]) -> None:
    """The same, all arrays being contiguous, with results where there is room for them."""
    _evaluate(_buffers.for_function(function), arguments, results)


def _evaluate(known: tuple[Any, Any, list[int]], arguments: Sequence[Array], results: Sequence[Array]) -> None:
    buffer, evaluate, _ = known
    for place, argument in enumerate(arguments):
        buffer.set_arg(place, argument.data)
    for place, result in enumerate(results):
        buffer.set_res(place, result.data)
    evaluate()


def map_rows(formula: Formula, entries: int, values: Array) -> Array:
    """A formula of numbers applied to every row: (N, entries) -> (N, results)."""
    count = len(values)
    return call_casadi(_mapped(formula, entries, count), count, values)[0] if count else np.empty((0, 0))


@lru_cache(maxsize=512)
def _mapped(formula: Formula, entries: int, count: int) -> Any:
    return row_function(formula, entries).map(count)


@lru_cache(maxsize=32)
def row_function(formula: Formula, entries: int) -> Any:
    """A formula of numbers as a CasADi function of one row."""
    import casadi

    row = casadi.SX.sym("row", entries)
    return casadi.Function(formula.__name__, [row], [casadi.vertcat(*formula(casadi.vertsplit(row)))])
