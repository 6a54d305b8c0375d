"""A process that runs `benchmarks.workloads` on some checkout of the library, asked from another process in turns."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src"


class WorkloadFailed(RuntimeError):
    """A workload raised an exception in the other process; its text."""


@dataclass(frozen=True)
class Setting:
    """Which checkout, and where what is compiled is kept (None: where it always is)."""

    name: str
    source: Path = SOURCE
    cache: str | None = None


class Contestant:
    """A process with one thread that answers calls of functions of `benchmarks.workloads`."""

    def __init__(self, setting: Setting) -> None:
        self.name = setting.name
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(setting.source), str(ROOT)]),
            # Older checkouts compile only where this says so.
            "SHAPEPHASE_FAST": "1",
        }
        environment |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        if setting.cache is not None:
            environment["XDG_CACHE_HOME"] = setting.cache
        # With -P the folder in which this is called is no source of modules.
        command = [sys.executable, "-P", "-m", "benchmarks.contestant"]
        self._process = subprocess.Popen(command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def __call__(self, workload: str, *arguments: Any) -> Any:
        """What a workload returns there. Raises WorkloadFailed."""
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        pickle.dump((workload, arguments), process.stdin)
        process.stdin.flush()
        failed, answer = pickle.load(process.stdout)
        if failed:
            raise WorkloadFailed(f"{self.name}: {answer}")
        return answer

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


def serve() -> None:
    """Answer calls from the standard input until it ends."""
    answers = os.fdopen(os.dup(1), "wb")
    # Whatever else is printed goes where errors go.
    os.dup2(2, 1)
    from . import workloads

    while True:
        try:
            workload, arguments = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            answer = False, getattr(workloads, workload)(*arguments)
        except Exception as error:
            answer = True, f"{type(error).__name__}: {error}"
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    serve()
