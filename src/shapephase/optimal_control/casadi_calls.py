"""CasADi functions called on arrays, from several threads at the same time."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from ..arrays import Array

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
    buffer, evaluate, lengths = _buffers.for_function(function)
    inputs = [np.ascontiguousarray(argument) for argument in arguments]
    results = [np.empty((rows, length // rows)) for length in lengths]
    for place, argument in enumerate(inputs):
        buffer.set_arg(place, argument.data)
    for place, result in enumerate(results):
        buffer.set_res(place, result.data)
    evaluate()
    return results
