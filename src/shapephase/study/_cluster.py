"""Chunks on a cluster of Dask: few at a time, and a scheduler that is gone ends the run."""

from __future__ import annotations

import asyncio
import contextlib
import pickle
import queue
import threading
import time
from collections.abc import Generator, Iterator, Mapping
from concurrent.futures import CancelledError
from hashlib import sha256
from typing import Any

from distributed import CancelledError as TaskCancelled
from distributed import Client, Future, get_worker

from ..arrays import Integers
from ..errors import SchedulerLostError, StudyError
from ..provenance import provenance
from ._evaluate import Results
from ._processor import computing_versions, other_versions, processor_text
from ._workers import CaseWorker
from .study import Study

# Tasks at once for each thread of the workers: one that runs and some that wait there.
_AHEAD = 3
# At least, also while workers are still to come.
_LEAST_AHEAD = 4
# [s] Between looks at the scheduler.
_LISTEN = 0.5
# [s] A connection that is lost for so long is not found again.
_PATIENCE = 20.0
# Times that a chunk is sent out again whose worker was lost.
_MOST_TRIES = 10

_Found = tuple[int, Results, str]


def chunks_on_cluster(missing: Integers, client: Client, recipe: bytes) -> Generator[_Found, None, None]:
    """The chunks in the order in which they are done.

    Raises
    ------
    SchedulerLostError
        If the scheduler is gone for 20 s, or its workers lose a chunk ten times.
    """
    done: queue.Queue[Future] = queue.Queue()
    numbers: dict[Any, int] = {}
    futures: dict[Any, Future] = {}
    tries: dict[int, int] = {}
    left = iter(missing.tolist())

    def send(number: int) -> None:
        future = client.submit(compute_chunk, recipe, number, pure=False, retries=0)
        numbers[future.key], futures[future.key] = number, future
        future.add_done_callback(done.put)

    watch = _SchedulerWatch(client)
    _check_workers(client)
    try:
        for _ in range(len(missing)):
            while len(futures) < _ahead(client) and (number := next(left, None)) is not None:
                send(number)
            while True:
                future = _next(done, watch)
                number = numbers.pop(future.key, None)
                if number is None:
                    continue
                del futures[future.key]
                with _losses(watch):
                    found = future.result(timeout=_PATIENCE)
                    future.release()
                    break
                tries[number] = tries.get(number, 0) + 1
                if tries[number] >= _MOST_TRIES:
                    raise SchedulerLostError(f"the cluster has lost chunk {number} {_MOST_TRIES} times: {watch.said}")
                send(number)
            yield found
    finally:
        # Nobody waits for a scheduler that is gone.
        if not watch.is_lost and client.status == "running":
            with contextlib.suppress(Exception):
                client.cancel(list(futures.values()), force=True)


def _check_workers(client: Client) -> None:
    """Raise StudyError for a worker with other versions; those that come later refuse their first chunk."""
    here = provenance()["versions"]
    with contextlib.suppress(OSError, TimeoutError):
        reported: Any = client.run(provenance, on_error="return")
        for address, there in reported.items():
            if isinstance(there, Mapping) and (differing := other_versions(here, there["versions"])):
                raise _other_worker(address, differing)


def _other_worker(address: str, differing: str) -> StudyError:
    return StudyError(
        f"worker {address}: {differing}: its cases would not be the same; install the study's versions there with "
        "pip, and go on with resume=True (--resume)"
    )


class _SchedulerWatch:
    """Whether the scheduler can still be reached."""

    def __init__(self, client: Client) -> None:
        self._client, self._last = client, time.monotonic()
        self.is_lost, self.said = False, ""

    def look(self) -> None:
        """Raise SchedulerLostError if it has not been there for long."""
        if self._client.status == "running":
            self._last = time.monotonic()
        elif self._client.status in ("closed", "closing") or time.monotonic() - self._last > _PATIENCE:
            self.is_lost = True
            address = getattr(self._client.scheduler, "address", "")
            raise SchedulerLostError(
                f"the scheduler {address} is gone; what is stored is kept: start it again and go on by resume"
            )


@contextlib.contextmanager
def _losses(watch: _SchedulerWatch) -> Iterator[None]:
    """A task whose worker or connection was lost is no fault: its chunk is sent out again."""
    try:
        yield
    except StudyError:
        raise
    except (CancelledError, TaskCancelled, asyncio.CancelledError, TimeoutError, OSError) as error:
        watch.said = f"{type(error).__name__}: {error}"
        time.sleep(_LISTEN)
        watch.look()
    except Exception as error:
        if type(error).__name__ not in ("KilledWorker", "FutureCancelledError", "CommClosedError"):
            raise StudyError(f"a worker cannot compute: {type(error).__name__}: {error}") from None
        watch.said = f"{type(error).__name__}: {error}"


def _ahead(client: Client) -> int:
    """Tasks that may be out."""
    with contextlib.suppress(Exception):
        threads = sum(worker["nthreads"] for worker in client.scheduler_info(n_workers=-1)["workers"].values())
        return max(_LEAST_AHEAD, _AHEAD * threads)
    return _LEAST_AHEAD


def _next(done: queue.Queue[Future], watch: _SchedulerWatch) -> Future:
    while True:
        watch.look()
        with contextlib.suppress(queue.Empty):
            return done.get(timeout=_LISTEN)


_FREE: list[tuple[bytes, CaseWorker]] = []
_LOCK = threading.Lock()


def compute_chunk(recipe: bytes, number: int) -> _Found:
    """One task, on a worker: its cases are computed in a process of their own, which may die without the worker."""
    key = sha256(recipe).digest()
    with _LOCK:
        for _, old in [entry for entry in _FREE if entry[0] != key]:
            old.close()
        _FREE[:] = [entry for entry in _FREE if entry[0] == key]
        worker = _FREE.pop()[1] if _FREE else None
    if worker is None:
        versions, content = pickle.loads(recipe)
        if differing := other_versions(versions, computing_versions()):
            raise _other_worker(get_worker().address, differing)
        study, _ = pickle.loads(content)
        assert isinstance(study, Study)
        worker = CaseWorker(study, recipe)
    results = worker.chunk(number)
    with _LOCK:
        _FREE.append((key, worker))
    return number, results, processor_text()
