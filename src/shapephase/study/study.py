"""A study: a body, a motion, what is varied, what is computed of each case; and the run that fills its store."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import closing
from contextvars import copy_context
from typing import Any

import numpy as np

from ..arguments import check_choice, check_file_name, check_flag, check_object
from ..arrays import Integers
from ..errors import RunStopped, StudyError
from ..integrator.stepping import processors
from ..letters import value_text
from ..run_progress import ProgressCallback, check_progress
from ._evaluate import DONE, Evaluator
from ._identity import processor_text
from ._workers import ChunkResults, WorkerPool, completed, recipe_of
from .cases import CaseTable
from .dask_client import chunks_on_cluster
from .store import StudyStore, new_store, store_to_resume

_GRACE = 1.0  # s that a batch has to end after Ctrl-C; most take less
_MINUTES = 120.0  # s: remaining time from which on it is given in minutes
_HOURS = 7200.0  # s: remaining time from which on it is given in hours


class Study(CaseTable):
    """One motion many times, with other bodies, momenta, paths.

    Every entry of `over` is a grid (a sequence of values) or a distribution. The cases are all combinations of the
    grids, in the order in which they are named, the last one fastest, and of each so many `draws`. What is drawn for a
    case depends on the seed, the name of the axis and the index of the case, so that results depend neither on chunks
    nor on who computes them.

    Attributes
    ----------
    body : a name, a file or a `RigidBody`
    motion : a name, a file, a function that makes a `ShapePath` of named numbers, or "module:function"; None for a
        rigid body
    over : what is varied, by its name: "momentum" (3,) or "momentum_x", "momentum_y", "momentum_z" [kg m^2/s];
        "attitude" (4,), a quaternion x y z w; "masses" and "inertias", factors of those of each moving part, and
        "centres" (3,), by how much their centres of mass are moved in radii of gyration, or "masses.LINK" of one part;
        "joint_noise", the standard deviation of noise at the samples of the path [rad or m]; "tolerance" [rad];
        "body", "motion" and "gauge", lists of them; and any parameter of the motion's function
    outputs : names of `OUTPUTS`, or `Output` of a function of the motion
    draws : of each point of the grids
    seed : of the random numbers
    chunk : cases that are computed and stored together
    momentum, attitude, tolerance, gauge, parameters : of what is not varied; the attitude a quaternion x y z w,
        None: the identity, also along motions of the library that commands begin otherwise
    time_limit : of one case [s]; None: none
    version : of the functions of the motion and the outputs, a text that changes when their results do; None: they are
        compared by their code and all that it refers to when the study is resumed
    root, root_body, packages, xacro_args, on_unphysical : how the bodies' files are read, as for `load_body`
    length_unit, person_mass : of the bodies' BVH files, as for `load_body` [m, kg]
    recording : arguments of `read_recorded_motion` for motions from files, `{"flight": "all"}`, and those of one file
        by its name, `{"a.csv": {"flight": (0.2, 1.1)}}`; momentum and attitude are then fitted to the base of each
        file, as `motion_from_recording` does; None: the momentum is as given

    Raises
    ------
    StudyError, UnknownNameError, ShapeError, InputFileNotFoundError
        For what cannot be computed as it is described. A file of a body or a motion that turns out to be damaged is a
        status of its cases.

    Examples
    --------
    >>> study = sp.study.Study("cat", "cat_righting", {"momentum_z": [0.0, 0.1], "masses": sp.study.LogNormal(0.05)},
    ...                        outputs=("turn",), draws=3, chunk=2)
    >>> store = study.run("masses.zarr", workers=0)
    >>> print(store.counts()["done"], np.degrees(store.values("turn")[0]).round(1))
    6 178.6
    """

    def run(
        self,
        store: str | os.PathLike[str],
        client: Any = None,
        *,
        workers: int | None = None,
        resume: bool = False,
        retry: str | None = None,
        progress: ProgressCallback | None = None,
    ) -> StudyStore:
        """Compute what is missing, and store it.

        Parameters
        ----------
        store : a folder, which the study makes (`out.zarr`)
        client : a `distributed.Client` of any cluster; None: processes of this machine
        workers : how many processes; None: one for each processor; 0: in this process, without time limits, and where
            a case that ends its process ends this one. A cluster has its own
        resume : go on with a store that is there already, which must be this study's
        retry : "failed": go on with a store, and compute its chunks with failed cases again
        progress : called after each chunk with the share that is done, from 0 to 1, and a text such as "1200 of 20000
            cases, 3 failed, 57.1/s, 5 min left"; if it returns something true, the run stops, as by Ctrl-C: what is
            stored is kept

        Raises
        ------
        StudyStoreError
            If there is a store and `resume` is not given, or it is another study's, or in use.
        OutputFileError
            If the store cannot be written to.
        SchedulerLostError
            If the cluster cannot be reached any more.
        MissingExtraError
            Without Zarr.
        RunStopped
            If `progress` stopped it.
        StudyError
            If `workers` is not a whole number of 0 or more, is given beside a client, or is 0 with a time limit.
        """
        check_file_name(store, "store")
        check_flag(resume, "resume")
        if retry is not None:
            check_choice(retry, "retry", ("failed",))
        if client is not None:
            check_object(client, "Client", "client")
        check_progress(progress)
        if workers is not None and (client is not None or not isinstance(workers, int) or workers < 0):
            raise StudyError(
                f"workers: a whole number, 0 or more, is needed, without a client; got {value_text(workers)}"
            )
        if workers == 0 and self.time_limit is not None:
            raise StudyError("time_limit: only a process of its own can be stopped; give one worker or more")
        goes_on = retry is not None or (resume and os.path.exists(store))
        target = store_to_resume(store, self) if goes_on else new_store(store, self)
        with target.locked():
            statuses, missing = target.statuses(), target.missing_chunks()
            if retry:
                missing = np.union1d(missing, target.failed_chunks())
            if not len(missing):
                return target
            for number in missing.tolist():
                statuses[slice(*self.chunk_range(number))] = 0
            if client is None:
                chunks = _chunks_here(self, missing, workers)
            else:
                chunks = chunks_on_cluster(self, missing, client)
            before = done = int(np.count_nonzero(statuses))
            failed, begun = int(np.count_nonzero(statuses > DONE)), time.monotonic()
            with closing(chunks):  # type: ignore[type-var]
                for number, results, processor in chunks:
                    target.write(number, results, processor)
                    done += len(results["status"])
                    failed += int(np.count_nonzero(results["status"] > DONE))
                    rate = (done - before) / max(time.monotonic() - begun, 1e-9)
                    text = _progress_text(done, self.cases, failed, rate)
                    if progress is not None and progress(done / self.cases, text) and done < self.cases:
                        raise RunStopped(f"stopped on request with {done} of {self.cases} cases stored")
        return target


def _chunks_here(study: Study, missing: Integers, workers: int | None) -> Iterator[ChunkResults]:
    """Yield chunks in the order in which threads or processes of this machine have done them."""
    count = 1 if workers == 0 else min(workers or processors(), len(missing))
    pool = Evaluator(study, study.inputs) if workers == 0 else WorkerPool(study, recipe_of(study))
    executor = ThreadPoolExecutor(count)
    # Cases in this process have a thread too: Ctrl-C interrupts the main one, whatever code of the user does with it.
    submit = _daemon_call if workers == 0 else executor.submit
    under_way: dict[int, Any] = {}
    try:
        yield from completed(
            missing.tolist(),
            lambda number: submit(copy_context().run, pool.chunk, number),
            lambda number, future: (number, future.result(), processor_text()),
            under_way,
            ahead=lambda: 2 * count if workers != 0 else 1,
        )
    finally:
        executor.shutdown(wait=False, cancel_futures=True)
        pool.close()
        wait(under_way.values(), timeout=_GRACE)


def _daemon_call(call: Callable[..., Any], *arguments: Any) -> Future[Any]:
    """Return the future of a call in a thread that does not keep this process from ending."""
    future: Future[Any] = Future()

    def run() -> None:
        try:
            future.set_result(call(*arguments))
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return future


def _progress_text(done: int, cases: int, failed: int, rate: float) -> str:
    seconds = (cases - done) / rate
    left = f"{seconds:.0f} s"
    if seconds >= _MINUTES:
        left = f"{seconds / 60.0:.0f} min" if seconds < _HOURS else f"{seconds / 3600.0:.1f} h"
    failures = f", {failed} failed" if failed else ""
    return f"{done} of {cases} cases{failures}, {rate:.3g}/s, {left} left"
