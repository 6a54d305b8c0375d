"""Processes that compute chunks of cases for whoever asks, and what is done when one hangs or dies.

First a chunk is computed together. If the process dies or takes far too long, it is computed case by case in a new one:
the case at which that one ends has a status, and the others their results, with the same bits.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from ..errors import StudyError
from ._evaluate import DIED, TIMED_OUT, Results
from .study import Study

# [s] A process that has not begun by then will not.
_BEGINNING = 300.0
# [s] Between looks at whether a process is still there.
_LOOK = 0.5
# Processes in a row that end before they begin.
_MOST_STARTS = 3
# Of the time limit of a case: what each case of a chunk adds to the time of the chunk.
_SHARE_OF_A_CASE = 0.1
# One thread each: the processes share the processors, and sums have one order.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


class _Over(Exception):
    """The process hangs or is gone."""

    def __init__(self, status: int, said: str) -> None:
        super().__init__(said)
        self.status = status


class CaseWorker:
    """One process, started when it is first needed, and again when it was lost.

    Parameters
    ----------
    study : of which it computes cases
    recipe : study and inputs as bytes
    """

    def __init__(self, study: Study, recipe: bytes) -> None:
        self._study, self._recipe = study, recipe
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection | None = None
        self._lock, self._closed = threading.Lock(), False

    def chunk(self, number: int) -> Results:
        """The results of a chunk. Raises StudyError if processes do not start."""
        first, stop = self._study.chunk_range(number)
        limit = self._study.time_limit
        with contextlib.suppress(_Over):
            self._begin()
            self._ask("together", first, stop)
            return self._answer(None if limit is None else limit * (1.0 + _SHARE_OF_A_CASE * (stop - first)))
        self._check_open()
        return self._one_by_one(first, stop)

    def close(self) -> None:
        """End the process, from any thread."""
        with self._lock:
            self._closed = True
            self._end()

    def _one_by_one(self, first: int, stop: int) -> Results:
        found = Results.empty(self._study, np.arange(first, stop))
        index = first
        while index < stop:
            self._check_open()
            try:
                self._begin()
                self._ask("alone", index, stop)
                while index < stop:
                    found.put(index - first, self._answer(self._study.time_limit))
                    index += 1
            except _Over as over:
                self._check_open()
                name = "TimeLimit" if over.status == TIMED_OUT else "ProcessDied"
                found.fail(index - first, over.status, name, str(over))
                index += 1
        return found

    def _begin(self) -> None:
        for _ in range(_MOST_STARTS):
            if self._process is not None and self._process.poll() is None:
                return
            try:
                self._start()
                if isinstance(refusal := self._answer(_BEGINNING), StudyError):
                    raise refusal
            except _Over:
                self._check_open()
        if self._process is None or self._process.poll() is not None:
            raise StudyError("the processes that are to compute the cases end before they begin; see what they said")

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
        environment = {**os.environ, **dict.fromkeys(_ONE_THREAD, "1"), "PYTHONPATH": path}
        source = f"from shapephase.study._worker_process import serve; serve({theirs.fileno()}, {os.getpid()})"
        with self._lock:
            self._end()
            if self._closed:
                ours.close()
                theirs.close()
                raise _Over(DIED, "closed")
            self._process = subprocess.Popen(
                [sys.executable, "-c", source],
                pass_fds=[theirs.fileno()],
                env=environment,
                stdin=subprocess.DEVNULL,
                process_group=0,
            )
            self._connection = Connection(ours.detach())
        theirs.close()
        with self._lost():
            self._connected.send_bytes(self._recipe)

    def _ask(self, way: str, first: int, stop: int) -> None:
        with self._lost():
            self._connected.send((way, first, stop))

    def _answer(self, seconds: float | None) -> Any:
        end = math.inf if seconds is None else time.monotonic() + seconds
        with self._lost():
            # The process is watched too: a child of it may keep the connection open.
            while (left := end - time.monotonic()) > 0.0:
                is_gone = self._process is None or self._process.poll() is not None
                if self._connected.poll(0.0 if is_gone else min(left, _LOOK)):
                    return self._connected.recv()
                if is_gone:
                    raise EOFError
        self._stop()
        raise _Over(TIMED_OUT, f"not done after {seconds:g} s")

    @property
    def _connected(self) -> Connection:
        connection = self._connection
        if connection is None:
            raise EOFError
        return connection

    @contextlib.contextmanager
    def _lost(self) -> Iterator[None]:
        """A connection that ends means that the process has."""
        try:
            yield
        except (EOFError, OSError):
            code = self._stop()
            raise _Over(DIED, _ending(code)) from None

    def _stop(self) -> int | None:
        with self._lock:
            return self._end()

    def _end(self) -> int | None:
        """End the process if there is one, and say how it ended."""
        process, connection = self._process, self._connection
        self._process, self._connection = None, None
        if connection is not None:
            connection.close()
        if process is None:
            return None
        code = process.poll()
        if code is None:
            # A connection ends a moment before its process does.
            with contextlib.suppress(subprocess.TimeoutExpired):
                code = process.wait(0.2 if connection is not None and not self._closed else 0.0)
        # With the children that its cases have left.
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return code

    def _check_open(self) -> None:
        if self._closed:
            raise StudyError("stopped")


def _ending(code: int | None) -> str:
    if code is None:
        return "its process was lost"
    if code < 0:
        with contextlib.suppress(ValueError):
            return f"its process died by {signal.Signals(-code).name}"
    return f"its process ended with code {code}"
