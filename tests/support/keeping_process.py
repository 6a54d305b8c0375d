"""A process that compiles a small function and keeps its machine code, each time in a process forked from it.

Run as a script this is the process: it reads requests as lines of JSON and answers each with a line of JSON.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import sys
import warnings
from pathlib import Path
from typing import Any

from support.asked_process import Answers, AskedProcess, requests


class KeepingProcess(AskedProcess):
    """The process, seen from the tests; it is asked for the arguments of `called`."""

    def __init__(self, **environment: str) -> None:
        super().__init__(__file__, **environment)


def twice(x: float) -> float:
    return 2.0 * x


def thrice(x: float) -> float:
    return 3.0 * x


def called(home: str, function: str = "twice", limit: int | None = None, source: str | None = None) -> dict[str, Any]:
    """Compile or load the function, and call it; whether it was found, and what was warned of.

    `source` is a file with a function `part`, called instead, as if the file were one of those of the kernels.
    """
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
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        made = kernel(known[function])
        value = made(7.0)
    compiled: Any = made._compiled
    found = bool(sum(compiled._cache_hits.values()))
    return {"value": value, "found": found, "said": [str(one.message) for one in said]}


def in_child(**request: Any) -> dict[str, Any]:
    """What `called` returns in a forked process."""
    receiving, sending = os.pipe()
    child = os.fork()
    if not child:
        code = 70
        try:
            os.write(sending, json.dumps(called(**request)).encode())
            code = 0
        finally:
            os._exit(code)
    os.close(sending)
    with os.fdopen(receiving, "rb") as stream:
        text = stream.read()
    _, status = os.waitpid(child, 0)
    return json.loads(text) if text else {"died": os.waitstatus_to_exitcode(status)}


def work() -> None:
    import numba

    # What Numba prepares once for all functions.
    numba.njit(twice)(1.0)
    answers = Answers()
    for request in requests():
        answers.say(in_child(**request))


if __name__ == "__main__":
    work()
