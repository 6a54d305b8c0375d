"""Processes that compute chunks of cases, and what is done when one hangs or dies.

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

from ..errors import StudyError
from ._evaluate import Evaluator, Results, empty_results, fail
from ._versions import computing_versions
from .cases import CaseTable

_STARTING = 300.0  # s: imports of a process on a busy machine take half a minute
_INTERVAL = 0.5  # s between checks that the other process lives
_STARTS = 3  # attempts before the processes count as unable to start
_SHARE_OF_A_CASE = 0.1  # of the time limit, which each case of a chunk adds to that of the chunk
# One thread each: the processes share the processors, and sums have one order.
_ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

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

    Parameters
    ----------
    submit : makes a future of a chunk
    take : returns the results of a future that is done, or None: its chunk is submitted again
    under_way : the futures that are not taken, by the numbers of their chunks
    ahead : how many there may be
    watch : called at least every half second
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
    """Processes of one study, one for each thread that asks at the same time."""

    def __init__(self, study: CaseTable, recipe: bytes) -> None:
        self._study, self._recipe = study, recipe
        self._free: queue.SimpleQueue[_Worker] = queue.SimpleQueue()
        self._workers: list[_Worker] = []
        self._is_closed = False

    def chunk(self, number: int) -> Results:
        """Return the results of a chunk. Raises StudyError if processes do not start."""
        try:
            worker = self._free.get_nowait()
        except queue.Empty:
            worker = _Worker(self._study, self._recipe)
            self._workers.append(worker)
            if self._is_closed:
                worker.close()
        try:
            return worker.chunk(number)
        finally:
            self._free.put(worker)

    def close(self) -> None:
        """End the processes, from any thread."""
        self._is_closed = True
        for worker in self._workers:
            worker.close()


class _LostError(Exception):
    """The process hangs or is gone."""

    def __init__(self, status: str, text: str) -> None:
        super().__init__(text)
        self.status = status


class _Worker:
    """One process, started when it is first needed, and again when it was lost."""

    def __init__(self, study: CaseTable, recipe: bytes) -> None:
        self._study, self._recipe = study, recipe
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Any = None
        self._lock, self._is_closed = threading.Lock(), False

    def chunk(self, number: int) -> Results:
        first, stop = self._study.chunk_range(number)
        limit = self._study.time_limit
        with contextlib.suppress(_LostError):
            seconds = None if limit is None else limit * (1.0 + _SHARE_OF_A_CASE * (stop - first))
            return next(self._results("together", first, stop, seconds))
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
        with self._lock:
            self._is_closed = True
            _kill_group(self._process)

    def _results(self, way: str, first: int, stop: int, seconds: float | None) -> Iterator[Results]:
        """Yield the answers to one request. Raises _LostError, and StudyError if processes do not start."""
        for _ in range(_STARTS if self._process is None else 0):
            with contextlib.suppress(_LostError):
                self._start()
                if isinstance(refusal := self._answer(_STARTING), StudyError):
                    raise refusal
                break
        if self._process is None:
            raise StudyError("the processes that are to compute the cases end before they begin; see what they printed")
        with self._losses():
            self._connection.send((way, first, stop))
        for _ in range(1 if way == "together" else stop - first):
            yield self._answer(seconds)

    def _start(self) -> None:
        path = os.pathsep.join(entry or os.getcwd() for entry in sys.path)
        ours, theirs = socket.socketpair()
        source = f"from shapephase.study._workers import serve; serve({theirs.fileno()}, {os.getpid()})"
        with self._lock, theirs:
            self._connection = Connection(ours.detach())
            self._check_open()
            self._process = subprocess.Popen(
                [sys.executable, "-c", source],
                pass_fds=[theirs.fileno()],
                env={**os.environ, **dict.fromkeys(_ONE_THREAD, "1"), "PYTHONPATH": path},
                stdin=subprocess.DEVNULL,
                process_group=0,
            )
        with self._losses():
            self._connection.send_bytes(self._recipe)

    def _answer(self, seconds: float | None) -> Any:
        end = math.inf if seconds is None else time.monotonic() + seconds
        with self._losses():
            # The process is watched too: a child of it may keep the connection open.
            while (left := end - time.monotonic()) > 0.0:
                is_gone = self._process is None or self._process.poll() is not None
                if self._connection.poll(0.0 if is_gone else min(left, _INTERVAL)):
                    return self._connection.recv()
                if is_gone:
                    raise EOFError
        self._end()
        raise _LostError("timed_out", f"not done after {seconds:g} s")

    @contextlib.contextmanager
    def _losses(self) -> Iterator[None]:
        """Turn the end of a connection into the end of its process."""
        try:
            yield
        except (EOFError, OSError):
            code = self._end()
            self._check_open()
            raise _LostError("died", _ending(code)) from None

    def _end(self) -> int | None:
        """End the process, with the children that its cases have left, and return its own exit code."""
        process, self._process = self._process, None
        self._connection.close()
        if process is None:
            return None
        # A connection ends a moment before its process does.
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.2)
        code = process.returncode
        _kill_group(process)
        return code

    def _check_open(self) -> None:
        if self._is_closed:
            raise StudyError("stopped")


def _kill_group(process: subprocess.Popen[bytes] | None) -> None:
    if process is not None:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


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
        _, recipe = pickle.loads(connection.recv_bytes())
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
