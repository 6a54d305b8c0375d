"""A process that compiles a small function and keeps its machine code, each time in a process forked from it.

Run as a script this is the process: it reads requests as lines of JSON and answers each with a line of JSON.
"""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path
from typing import Any


class KeepingProcess:
    """The process, seen from the tests."""

    def __init__(self, **environment: str) -> None:
        path = os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
        self.process = subprocess.Popen(
            [sys.executable, __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": path, **environment},
        )

    def ask(self, **request: Any) -> dict[str, Any]:
        """The answer to a request: the arguments of `at_once` or `killed`."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps(request, default=str) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def stop(self) -> None:
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


def twice(x: float) -> float:
    return 2.0 * x


def thrice(x: float) -> float:
    return 3.0 * x


def called(home: str, function: str = "twice", limit: int | None = None) -> dict[str, Any]:
    """Compile or load the function, and call it; whether it was found, and what was warned of."""
    os.environ["XDG_CACHE_HOME"] = home
    if limit is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        from shapephase.integrator.fast.kernels.jit import kernel

        made = kernel({"twice": twice, "thrice": thrice}[function])
        value = made(7.0)
    found = bool(sum(made.stats.cache_hits.values()))
    return {"value": value, "found": found, "said": [str(one.message) for one in said]}


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
    """Kill a process at random times, from its start to after its end, with nothing kept yet; look what it left."""
    chance = random.Random(seed)
    start = time.monotonic()
    at_once(1, home=home)
    longest = 1.3 * (time.monotonic() - start)
    wrong = kept = littered = 0
    folder = next(Path(home).glob("shapephase/kernels-*/*"))
    for _ in range(trials):
        for file in folder.iterdir():
            file.unlink()
        child, receiving = _in_child(home=home)
        time.sleep(chance.uniform(0.0, longest))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(receiving)
        left = [file.name for file in folder.iterdir()]
        kept += any(name.endswith(".nbc") for name in left)
        littered += any(name.endswith(".part") for name in left)
        (after,) = at_once(1, home=home)
        wrong += after.get("value") != 14.0 or len(list(folder.iterdir())) != 1
    return {"trials": trials, "wrong": wrong, "kept": kept, "littered": littered}


def work() -> None:
    from numba import njit

    # What Numba prepares once for all functions.
    njit(twice)(1.0)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        answer = killed(**request) if "trials" in request else {"all": at_once(**request)}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    work()
