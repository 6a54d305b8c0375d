"""A study is run: chunks that are missing go to processes of this machine or to a cluster, and into the store."""

from __future__ import annotations

import itertools
import math
import os
import pickle
import queue
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import closing, contextmanager
from types import FrameType
from typing import Any

import numpy as np

from ..arguments import check_choice, check_file_name, check_flag, check_object
from ..arrays import Integers
from ..errors import MissingExtraError, RunStopped, StudyError, StudyStoreError
from ..letters import what_came
from ..warning_filters import quiet
from ._evaluate import DONE, Evaluator, Results
from ._new_stores import new_store, store_to_resume
from ._processor import computing_versions, processor_text
from ._workers import CaseWorker
from .progress import StudyProgress
from .store import StudyStore, open_study
from .study import Study

# [s] Ctrl-C is heard at least as often.
_LISTEN = 0.5
# Results that may wait to be stored, for each process.
_WAITING = 2

Found = tuple[int, Results, str]
"""Number of a chunk, what is in it, and which processor computed it."""
Chunks = Generator[Found, None, None]


def run_study(
    study: Study,
    store: str | os.PathLike[str],
    client: Any,
    *,
    workers: int | None,
    resume: bool,
    retry: str | None,
    progress: Callable[[StudyProgress], Any] | None,
) -> StudyStore:
    """As `Study.run`."""
    check_file_name(store, "store")
    check_flag(resume, "resume")
    if retry is not None:
        check_choice(retry, "retry", ("failed",))
    if client is not None:
        check_object(client, "Client", "client")
    if workers is not None and (client is not None or not isinstance(workers, int) or workers < 0):
        raise StudyError(f"workers: a whole number, 0 or more, is needed, without a client; got {what_came(workers)}")
    if workers == 0 and study.time_limit is not None:
        raise StudyError("time_limit: only a process of its own can be stopped; give one worker or more")
    target = store_to_resume(store, study) if retry else _target(study, store, resume)
    with target.locked():
        missing = target.missing_chunks()
        if retry:
            missing = np.union1d(missing, target.failed_chunks())
        watch = _Tally(study, target, missing, progress)
        if not len(missing):
            return target
        if client is not None:
            chunks = _on_cluster(study, missing, client)
        elif workers == 0:
            chunks = _in_this_process(study, missing)
        else:
            chunks = _on_this_machine(study, missing, workers)
        with closing(chunks):
            for number, results, processor in chunks:
                target.write(number, results, processor)
                watch.stored(results)
    return target


def recipe_of(study: Study) -> bytes:
    """A study and its inputs as bytes, functions that have no module with their code. Raises StudyError."""
    try:
        import cloudpickle
    except ImportError:
        cloudpickle = pickle  # type: ignore[assignment]
    try:
        # Versions come first: of others the study may not even be readable.
        return pickle.dumps((computing_versions(), cloudpickle.dumps((study, study.inputs))))
    except Exception as error:
        raise StudyError(f"the study cannot be sent to another process: {error}") from None


def _target(study: Study, store: str | os.PathLike[str], resume: bool) -> StudyStore:
    if not (resume and os.path.exists(store)):
        if os.path.exists(store):
            # What is there is looked at first: a store says so.
            open_study(store)
            raise StudyStoreError(
                f"{store}: there is a store already; go on with resume=True (--resume), or name another place"
            )
        return new_store(store, study)
    return store_to_resume(store, study)


class _Tally:
    """Counts, and tells whoever asked."""

    def __init__(
        self, study: Study, store: StudyStore, missing: Integers, tell: Callable[[StudyProgress], Any] | None
    ) -> None:
        statuses = store.statuses()
        for number in missing.tolist():
            statuses[slice(*study.chunk_range(number))] = 0
        self._cases, self._tell = study.cases, tell
        self._done, self._failed = int(np.count_nonzero(statuses)), int(np.count_nonzero(statuses > DONE))
        self._begun, self._at_first = time.monotonic(), self._done

    def stored(self, results: Results) -> None:
        """A chunk is in the store."""
        self._done += len(results.status)
        self._failed += int(np.count_nonzero(results.status > DONE))
        if self._tell is None:
            return
        passed = time.monotonic() - self._begun
        rate = (self._done - self._at_first) / passed if passed else 0.0
        left = (self._cases - self._done) / rate if rate else math.inf
        now = StudyProgress(done=self._done, cases=self._cases, failed=self._failed, rate=rate, remaining=left)
        if self._tell(now):
            raise RunStopped(f"stopped on request with {self._done} of {self._cases} cases stored")


def _in_this_process(study: Study, missing: Integers) -> Chunks:
    evaluator = Evaluator(study, study.inputs)
    with _noted_interrupts() as pressed:
        for number in missing.tolist():
            with quiet():
                results = evaluator.together(np.arange(*study.chunk_range(number)))
            if pressed:
                raise KeyboardInterrupt
            yield number, results, processor_text()


@contextmanager
def _noted_interrupts() -> Iterator[list[int]]:
    """Ctrl-C as a list that fills up: compiled code and functions of the user may lose its KeyboardInterrupt."""
    pressed: list[int] = []

    def note(number: int, _: FrameType | None) -> None:
        pressed.append(number)
        raise KeyboardInterrupt

    in_main = threading.current_thread() is threading.main_thread()
    is_default = in_main and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_default:
        signal.signal(signal.SIGINT, note)
    try:
        yield pressed
    finally:
        if is_default:
            signal.signal(signal.SIGINT, signal.default_int_handler)


def _on_this_machine(study: Study, missing: Integers, workers: int | None) -> Chunks:
    """The chunks, in the order in which processes of this machine have done them."""
    count = min(workers or _processors(), len(missing))
    recipe = recipe_of(study)
    pool = [CaseWorker(study, recipe) for _ in range(count)]
    waiting = itertools.chain(missing.tolist())
    done: queue.Queue[Found | Exception] = queue.Queue(_WAITING * count)
    lock, stop = threading.Lock(), threading.Event()

    def compute(worker: CaseWorker) -> None:
        try:
            while not stop.is_set():
                with lock:
                    number = next(waiting, None)
                if number is None:
                    return
                _put(done, (number, worker.chunk(number), processor_text()), stop)
        except Exception as error:
            _put(done, error, stop)

    threads = [threading.Thread(target=compute, args=(worker,), daemon=True) for worker in pool]
    for thread in threads:
        thread.start()
    try:
        for _ in range(len(missing)):
            yield _next(done)
    finally:
        stop.set()
        for worker in pool:
            worker.close()
        for thread in threads:
            thread.join()


def _on_cluster(study: Study, missing: Integers, client: Any) -> Chunks:
    try:
        from ._cluster import chunks_on_cluster
    except ImportError:
        raise MissingExtraError("a cluster needs Dask; install it with: pip install 'shapephase[study]'") from None
    return chunks_on_cluster(missing, client, recipe_of(study))


def _next(done: queue.Queue[Found | Exception]) -> Found:
    while True:
        try:
            found = done.get(timeout=_LISTEN)
        except queue.Empty:
            continue
        if isinstance(found, Exception):
            raise found
        return found


def _put(done: queue.Queue[Found | Exception], what: Found | Exception, stop: threading.Event) -> None:
    while not stop.is_set():
        try:
            done.put(what, timeout=_LISTEN)
            return
        except queue.Full:
            continue


def _processors() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
