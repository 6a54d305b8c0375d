"""A client of Dask: chunks on its workers, few at a time, until the scheduler is gone."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import pickle
import threading
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import CancelledError
from hashlib import sha256
from typing import Any

from ..arguments import check_text
from ..arrays import Integers
from ..errors import MissingExtraError, SchedulerLostError, StudyError
from ..provenance import provenance
from ._identity import computing_versions, processor_text, version_differences
from ._workers import ChunkResults, WorkerPool, completed, recipe_of
from .cases import CaseTable

TASKS_PER_THREAD = 3  # submitted at once: one that runs and some that wait at its worker
FEWEST_TASKS = 4  # submitted at once while workers are still to come
PATIENCE = 20.0  # s: a connection lost for longer does not come back
_PAUSE = 0.5  # s before a lost chunk is submitted again
_MOST_LOSSES = 10  # of one chunk
_LOSSES = ("CancelledError", "KilledWorker", "FutureCancelledError", "CommClosedError")


@contextlib.contextmanager
def connected(address: str) -> Iterator[Any]:
    """Client of the scheduler at this address, a `distributed.Client`.

    Raises
    ------
    SchedulerLostError
        If it cannot be reached.
    MissingExtraError
        Without Dask.

    Examples
    --------
    >>> from distributed import LocalCluster
    >>> cluster = LocalCluster(n_workers=1, processes=False, dashboard_address=None)
    >>> with cluster, sp.study.connected(cluster.scheduler_address) as client:
    ...     print(client.submit(abs, -2).result())
    2
    """
    try:
        from distributed import Client
        from distributed.comm.addressing import resolve_address
    except ImportError:
        raise MissingExtraError("a cluster needs Dask; install it with: pip install 'shapephase[study]'") from None
    check_text(address, "address", "a text such as tcp://10.0.0.1:8786")
    # Lost connections are one error of ours, not many lines of a log.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # An invalid address is refused before a client has to be closed.
        resolve_address(address)
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise SchedulerLostError(f"there is no scheduler at {address!r:.80} ({type(error).__name__})") from None
    try:
        yield client
    finally:
        with contextlib.suppress(Exception):
            client.close(timeout=1.0)


def chunks_on_cluster(study: CaseTable, missing: Integers, client: Any) -> Iterator[ChunkResults]:
    """Yield the chunks in the order in which they are done.

    Raises
    ------
    SchedulerLostError
        If the scheduler is gone for 20 s, or its workers lose a chunk ten times.
    StudyError
        If a worker has other versions or other functions.
    """
    recipe, run = recipe_of(study), _ClusterRun(client)
    _check_workers(client)
    under_way: dict[int, Any] = {}
    try:
        yield from completed(
            missing.tolist(),
            lambda number: client.submit(compute_chunk, recipe, number, pure=False, retries=0),
            run.take,
            under_way,
            ahead=run.ahead,
            watch=run.check_scheduler,
        )
    finally:
        # A scheduler that is gone is not waited for.
        if client.status == "running":
            with contextlib.suppress(Exception):
                client.cancel(list(under_way.values()), force=True)


class _ClusterRun:
    """Losses of a run, of its scheduler and of its chunks."""

    def __init__(self, client: Any) -> None:
        self._client, self._last_seen = client, time.monotonic()
        self._losses = Counter[int]()

    def ahead(self) -> int:
        """Return the number of tasks to submit at once."""
        with contextlib.suppress(Exception):
            threads = sum(worker["nthreads"] for worker in self._client.scheduler_info(-1)["workers"].values())
            return max(FEWEST_TASKS, TASKS_PER_THREAD * threads)
        return FEWEST_TASKS

    def check_scheduler(self) -> None:
        """Raise SchedulerLostError if it has not been reached for long."""
        if self._client.status == "running":
            self._last_seen = time.monotonic()
        elif self._client.status in ("closed", "closing") or time.monotonic() - self._last_seen > PATIENCE:
            address = getattr(self._client.scheduler, "address", "")
            raise SchedulerLostError(
                f"the scheduler {address} is gone; what is stored is kept: start it again and go on by resume"
            )

    def take(self, number: int, future: Any) -> ChunkResults | None:
        """Return the results of a future; None if its worker or connection was lost, which is no fault of the chunk."""
        try:
            results = future.result(timeout=PATIENCE)
            future.release()
            return results
        except StudyError:
            raise
        except (Exception, asyncio.CancelledError) as error:
            loss = f"{type(error).__name__}: {error}"
            is_loss = isinstance(error, CancelledError | asyncio.CancelledError | TimeoutError | OSError)
            if not is_loss and type(error).__name__ not in _LOSSES:
                raise StudyError(f"a worker cannot compute: {loss}") from None
        time.sleep(_PAUSE)
        self.check_scheduler()
        self._losses[number] += 1
        if self._losses[number] >= _MOST_LOSSES:
            raise SchedulerLostError(f"the cluster has lost chunk {number} {_MOST_LOSSES} times: {loss}")
        return None


def _check_workers(client: Any) -> None:
    """Raise StudyError for a worker with other versions; those that come later refuse their first chunk."""
    here = provenance()["versions"]
    with contextlib.suppress(OSError, TimeoutError):
        reported: Any = client.run(provenance, on_error="return")
        for address, there in reported.items():
            if isinstance(there, Mapping) and (differing := version_differences(here, there["versions"])):
                raise _other_worker(address, differing)


def _other_worker(address: str, differing: str) -> StudyError:
    return StudyError(
        f"worker {address}: {differing}: its cases would not be the same; install the study's versions there with "
        "pip, and go on with resume=True (--resume)"
    )


_POOLS: dict[bytes, WorkerPool] = {}
_LOCK = threading.Lock()


def compute_chunk(recipe: bytes, number: int) -> ChunkResults:
    """Compute a chunk on a worker of Dask, in a process of its own, which may die without the worker."""
    key = sha256(recipe).digest()
    with _LOCK:
        if key not in _POOLS:
            from distributed import get_worker

            for former in list(_POOLS):
                _POOLS.pop(former).close()
            versions, content = pickle.loads(recipe)
            if differing := version_differences(versions, computing_versions()):
                raise _other_worker(get_worker().address, differing)
            study, _ = pickle.loads(content)
            _POOLS[key] = WorkerPool(study, recipe)
        pool = _POOLS[key]
    return number, pool.chunk(number), processor_text()
