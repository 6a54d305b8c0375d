"""Small formulas run as CasADi functions: a fraction of what NumPy takes for arrays of a few entries."""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from ..arrays import Array
from .compilation import compiled_or_interpreted

Formula = Callable[[list[Any]], list[Any]]
_MOST_BUFFERS = 128


class _Buffers(threading.local):
    """Of each thread its own: what it last called, with the memory that is worked on."""

    def __init__(self) -> None:
        self._known: dict[int, tuple[Any, Any, Any, list[int]]] = {}

    def of(self, function: Any) -> tuple[Any, Any, list[int]]:
        """The buffer of a function, what evaluates it, and the sizes of its results."""
        known = self._known.get(id(function))
        if known is None:
            if len(self._known) >= _MOST_BUFFERS:
                self._known.clear()
            # Held on to, so that no other function comes to have its identity.
            sizes = [function.numel_out(place) for place in range(function.n_out())]
            known = self._known[id(function)] = function, *function.buffer(), sizes
        return known[1:]


_buffers = _Buffers()


def call_casadi(function: Any, rows: int, *arguments: Array) -> list[Array]:
    """A CasADi function on arrays, on memory that nobody else sees, so that threads can call it at the same time.

    Arguments hold numbers in the order of the function's inputs (column-major); each result is (rows, entries / rows).
    """
    buffer, evaluate, sizes = _buffers.of(function)
    results = [np.empty((rows, size // rows)) for size in sizes]
    kept = [np.ascontiguousarray(argument) for argument in arguments]
    for place, argument in enumerate(kept):
        buffer.set_arg(place, argument.data)
    for place, result in enumerate(results):
        buffer.set_res(place, result.data)
    evaluate()
    return results


def map_rows(formula: Formula, entries: int, values: Array) -> Array:
    """A formula of numbers applied to every row: (N, entries) -> (N, results)."""
    count = len(values)
    return call_casadi(_mapped(formula, entries, count), count, values)[0] if count else np.empty((0, 0))


@lru_cache(maxsize=512)
def _mapped(formula: Formula, entries: int, count: int) -> Any:
    return compiled_or_interpreted(row_function(formula, entries)).map(count)


@lru_cache(maxsize=32)
def row_function(formula: Formula, entries: int) -> Any:
    """A formula of numbers as a CasADi function of one row."""
    import casadi

    row = casadi.SX.sym("row", entries)
    return casadi.Function(formula.__name__, [row], [casadi.vertcat(*formula(casadi.vertsplit(row)))])


def forget_functions() -> None:
    """Build the functions of many rows anew when next needed."""
    _mapped.cache_clear()
