"""Processes that compute chunks of cases, and what is done when one of them hangs or dies.

First a chunk is computed together. If the process dies or takes far too long, it is computed case by case in a new one:
the case at which that one ends has a status, and the others their results, with equal bits.
"""

from __future__ import annotations

import contextlib
import math
import os
import pickle
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from ..child_process import start_python
from ..errors import StudyError
from ._evaluate import Evaluator, Results, empty_results, fail
from ._identity import computing_versions
from .cases import CaseTable

_STARTING = 300.0  # s: imports of a process on a busy machine take half a minute
_INTERVAL = 0.5  # s between checks that the other process lives
_STARTS = 3  # attempts before the processes count as unable to start
_SHARE_OF_A_CASE = 0.1  # of the time limit, which each case of a chunk adds to that of the chunk

ChunkResults = tuple[int, Results, str]
"""Number of a chunk, its results, and the processor that computed it."""


def recipe_of(study: CaseTable) -> bytes:
    """Return a study and its inputs as bytes, functions that have no module with their code. Raises StudyError."""
    try:
        import cloudpickle
    except ImportError:
        cloudpickle = pickle  # type: ignore[assignment]
    try:
        # Versions come first: with others the study may not even be readable.
        return pickle.dumps((computing_versions(), cloudpickle.dumps((study, study.inputs))))
    except Exception as error:
        raise StudyError(f"the study cannot be sent to another process: {error}") from None


def completed(
    numbers: Iterable[int],
    submit: Callable[[int], Any],
    take: Callable[[int, Any], ChunkResults | None],
    under_way: dict[int, Any],
    *,
    ahead: Callable[[], int],
    watch: Callable[[], object] = bool,
) -> Iterator[ChunkResults]:
    """Yield chunks in the order in which they are done.

    `submit` makes a future of a chunk, and `take` returns its results, or None: it is submitted again. `under_way` are
    the futures that are not taken, at most `ahead`. `watch` is called every half second or more often.
    """
    done: queue.SimpleQueue[tuple[int, Any]] = queue.SimpleQueue()
    left = iter(numbers)

    def send(number: int) -> None:
        under_way[number] = future = submit(number)
        future.add_done_callback(lambda future: done.put((number, future)))

    while True:
        while len(under_way) < ahead() and (following := next(left, None)) is not None:
            send(following)
        if not under_way:
            return
        watch()
        with contextlib.suppress(queue.Empty):
            number, future = done.get(timeout=_INTERVAL)
            if (results := take(number, future)) is None:
                send(number)
                continue
            del under_way[number]
            yield results


class WorkerPool:
    """Processes of one study, as many as threads compute at once, replaced when they are lost."""

    def __init__(self, study: CaseTable, recipe: bytes) -> None:
        self._study, self._recipe = study, recipe
        self._processes: list[_Process] = []
        self._free: list[_Process] = []
        self._is_closed = False

    def chunk(self, number: int) -> Results:
        """Return the results of a chunk. Raises StudyError if processes do not start."""
        first, stop = self._study.chunk_range(number)
        limit = self._study.time_limit
        with contextlib.suppress(_LostError):
            seconds = None if limit is None else limit * (1.0 + _SHARE_OF_A_CASE * (stop - first))
            (results,) = self._results("together", first, stop, seconds)
            return results
        results, index = empty_results(self._study, np.arange(first, stop)), first
        while index < stop:
            try:
                for case_results in self._results("alone", index, stop, limit):
                    for name, rows in case_results.items():
                        results[name][index - first] = rows[0]
                    index += 1
            except _LostError as error:
                name = "TimeLimit" if error.status == "timed_out" else "ProcessDied"
                fail(self._study, results, index - first, error.status, name, str(error))
                index += 1
        return results

    def close(self) -> None:
        """End the processes, from any thread."""
        self._is_closed = True
        for process in list(self._processes):
            process.end()

    def _results(self, way: str, first: int, stop: int, seconds: float | None) -> Iterator[Results]:
        """Yield the results of cases together or alone. Raises _LostError."""
        process = self._ready()
        try:
            process.send((way, first, stop))
            for _ in range(1 if way == "together" else stop - first):
                yield process.receive(seconds)
        except _LostError:
            self._processes.remove(process)
            raise
        self._free.append(process)

    def _ready(self) -> _Process:
        """Return a process that waits for requests. Raises StudyError."""
        with contextlib.suppress(IndexError):
            return self._free.pop()
        for _ in range(_STARTS):
            if self._is_closed:
                raise StudyError("stopped")
            process = _Process(self._recipe)
            self._processes.append(process)
            if self._is_closed:
                process.end()
            try:
                refusal = process.receive(_STARTING)
            except _LostError:
                self._processes.remove(process)
                continue
            if isinstance(refusal, StudyError):
                raise refusal
            return process
        raise StudyError("the processes that are to compute the cases end before they begin; see what they printed")


class _LostError(Exception):
    """The process hangs or is gone."""

    def __init__(self, status: str, text: str) -> None:
        super().__init__(text)
        self.status = status


class _Process:
    """A process that computes cases, in a group of its own."""

    def __init__(self, recipe: bytes) -> None:
        ours, theirs = socket.socketpair()
        self._connection = Connection(ours.detach())
        source = f"from shapephase.study._workers import serve; serve({theirs.fileno()}, {os.getpid()})"
        options = {"pass_fds": [theirs.fileno()], "stdin": subprocess.DEVNULL, "process_group": 0}
        with theirs:
            self._process = start_python(source, folder=True, **options)
        with contextlib.suppress(_LostError):
            self.send(recipe)

    def send(self, message: Any) -> None:
        """Send a request. Raises _LostError."""
        with self._losses():
            self._connection.send(message)

    def receive(self, seconds: float | None) -> Any:
        """Return the next message. Raises _LostError, also where it takes longer than these seconds."""
        end = math.inf if seconds is None else time.monotonic() + seconds
        with self._losses():
            # The process is watched too: a child of it may keep the connection open.
            while (left := end - time.monotonic()) > 0.0:
                is_gone = self._process.poll() is not None
                if self._connection.poll(0.0 if is_gone else min(left, _INTERVAL)):
                    return self._connection.recv()
                if is_gone:
                    raise EOFError
        self.end()
        self._connection.close()
        raise _LostError("timed_out", f"not done after {seconds:g} s")

    def end(self) -> None:
        """End the process, with the children that its cases have left."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    @contextlib.contextmanager
    def _losses(self) -> Iterator[None]:
        """Turn the end of a connection into the end of its process."""
        try:
            yield
        except (EOFError, OSError):
            # A connection ends a moment before its process does.
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(_INTERVAL)
            code = self._process.returncode
            self.end()
            self._connection.close()
            raise _LostError("died", _ending(code)) from None


def _ending(code: int | None) -> str:
    if code is None:
        return "its process was lost"
    with contextlib.suppress(ValueError):
        return f"its process died by {signal.Signals(-code).name}"
    return f"its process ended with code {code}"


def serve(descriptor: int, parent: int) -> None:
    """Compute, in a process of its own, what is requested through a connection, until that or the parent ends."""
    # Ctrl-C goes to all processes of a terminal; the parent decides.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    # What cases print is not to wait in a buffer that nobody reads.
    sys.stdout = sys.stderr
    warnings.simplefilter("ignore")
    connection = Connection(descriptor)
    # A child of a case would keep the connection open when this process is gone.
    os.set_inheritable(descriptor, False)
    os.register_at_fork(after_in_child=connection.close)
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        _, recipe = pickle.loads(connection.recv())
        study, inputs = pickle.loads(recipe)
        for name, digest in study.function_inputs.items():
            if inputs.get(name, digest) != digest:
                connection.send(StudyError(f"{name} is another where it is computed than where the study was begun"))
                return
        evaluator = Evaluator(study, inputs)
        connection.send("ready")
        while True:
            way, first, stop = connection.recv()
            if way == "together":
                connection.send(evaluator.together(np.arange(first, stop)))
            for index in range(first, stop) if way == "alone" else ():
                connection.send(evaluator.alone(index))


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_INTERVAL)
    # The group of this process holds the children of its cases too.
    os.killpg(0, signal.SIGKILL)
