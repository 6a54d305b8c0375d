"""A process that compiles a small function and keeps its machine code, each time in a process forked from it.

Run as a script this is the process: it reads requests as lines of JSON and answers each with a line of JSON.
"""

from __future__ import annotations

import importlib
import json
import os
import random
import resource
import signal
import sys
import time
import warnings
from pathlib import Path
from types import FrameType
from typing import Any

from support.asked_process import Answers, AskedProcess, requests


class KeepingProcess(AskedProcess):
    """The process, seen from the tests; it is asked for the arguments of `at_once` or `killed`."""

    def __init__(self, **environment: str) -> None:
        super().__init__(__file__, **environment)


def twice(x: float) -> float:
    return 2.0 * x


def thrice(x: float) -> float:
    return 3.0 * x


def called(
    home: str,
    function: str = "twice",
    limit: int | None = None,
    moment: int | None = None,
    source: str | None = None,
) -> dict[str, Any]:
    """Compile or load the function, and call it; whether it was found, and what was warned of.

    Of all the moments in which files are written, so many are counted; at the one asked for the process kills itself.
    `source` is a file with a function `part`, called instead, as if the file were one of those of the kernels.
    """
    from shapephase import files
    from shapephase.integrator import kept_code
    from shapephase.integrator.machine_code import inline, kernel

    os.environ["XDG_CACHE_HOME"] = home
    known = {"twice": twice, "thrice": thrice}
    if source is not None:
        kept_code.SOURCES = (Path(source),)
        # A file that changes twice in a second is not compiled anew by Python.
        sys.dont_write_bytecode = True
        sys.path.insert(0, str(Path(source).parent))
        part = inline(importlib.import_module(Path(source).stem).part)
        known["twice"] = lambda x: part(x)
    if limit is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    moments = 0

    def watch(frame: FrameType, *_: object) -> None:
        nonlocal moments
        if frame.f_code.co_filename == files.__file__:
            if moments == moment:
                os.kill(os.getpid(), signal.SIGKILL)
            moments += 1

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        made = kernel(known[function])
        sys.setprofile(watch)
        value = made(7.0)
        sys.setprofile(None)
    compiled: Any = made._compiled
    found = bool(sum(compiled._cache_hits.values()))
    return {"value": value, "found": found, "said": [str(one.message) for one in said], "moments": moments}


def _in_child(**request: Any) -> tuple[int, int]:
    """A forked process that answers through a pipe: its number, and the pipe."""
    receiving, sending = os.pipe()
    child = os.fork()
    if child:
        os.close(sending)
        return child, receiving
    code = 70
    try:
        os.write(sending, json.dumps(called(**request)).encode())
        code = 0
    finally:
        os._exit(code)


def at_once(count: int, **request: Any) -> list[dict[str, Any]]:
    """So many processes at the same time."""
    answers = []
    for child, receiving in [_in_child(**request) for _ in range(count)]:
        with os.fdopen(receiving, "rb") as stream:
            text = stream.read()
        _, status = os.waitpid(child, 0)
        answers.append(json.loads(text) if text else {"died": os.waitstatus_to_exitcode(status)})
    return answers


def killed(home: str, trials: int, seed: int) -> dict[str, Any]:
    """Kill a process with nothing kept yet, and look what it left.

    So many die at random times, from the start to after the end, and so many at moments of writing, spread evenly from
    the first to the last; `kept` says how many of the latter had a file already.
    """
    chance = random.Random(seed)
    start = time.monotonic()
    (whole,) = at_once(1, home=home)
    longest = 1.3 * (time.monotonic() - start)
    moments = [round(k * (whole["moments"] - 1) / (trials - 1)) for k in range(trials)]
    found = {"trials": 0, "wrong": 0, "kept": 0, "littered": 0}
    folder = next(Path(home).glob("shapephase/kernels-*"))
    for moment in [None] * trials + moments:
        for file in folder.iterdir():
            file.unlink()
        child, receiving = _in_child(home=home, moment=moment)
        if moment is None:
            time.sleep(chance.uniform(0.0, longest))
            os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        os.close(receiving)
        assert moment is None or status == signal.SIGKILL
        left = [file.name for file in folder.iterdir()]
        found["trials"] += 1
        found["kept"] += moment is not None and any(name.endswith(".nbc") for name in left)
        found["littered"] += any(name.endswith(".part") for name in left)
        (after,) = at_once(1, home=home)
        kept = [file for file in folder.iterdir() if file.suffix != ".part"]
        found["wrong"] += after.get("value") != 14.0 or len(kept) != 1
    return found


def work() -> None:
    import numba

    # What Numba prepares once for all functions.
    numba.njit(twice)(1.0)
    answers = Answers()
    for request in requests():
        answers.say(killed(**request) if "trials" in request else {"all": at_once(**request)})


if __name__ == "__main__":
    work()
