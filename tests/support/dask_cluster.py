"""A scheduler and workers of Dask on this machine, started as one does in a shell, and killed."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from support.mortal_process import started

# [s] Between looks at a file that somebody else writes.
LOOK = 0.1


class Cluster:
    """A scheduler and two workers of one thread each, on 127.0.0.1; in a `with` block they are there.

    Parameters
    ----------
    folder : where they run
    environment : of their processes
    preload : a module that the workers load first
    """

    def __init__(self, folder: Path, environment: Mapping[str, str], preload: str | None = None) -> None:
        self._folder, self._environment = folder, environment
        self._preload = [] if preload is None else ["--preload", preload]
        self.workers: list[subprocess.Popen[Any]] = []

    def __enter__(self) -> Cluster:
        log = self._folder / "scheduler.log"
        with open(log, "w") as stream:
            self.scheduler = self._dask(["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"], stream)
        try:
            while not (found := re.search(r"Scheduler at:\s+(tcp://[\d.:]+)", log.read_text())):
                assert self.scheduler.poll() is None, log.read_text()
                time.sleep(LOOK)
            self.address = found[1]
            words = ["worker", self.address, "--nworkers", "1", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
            for number in range(2):
                with open(self._folder / f"worker_{number}.log", "w") as stream:
                    self.workers.append(self._dask([*words, *self._preload], stream))
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()

    def _dask(self, words: Sequence[str], log: Any) -> subprocess.Popen[Any]:
        command = [sys.executable, "-m", "dask", *words]
        return started(command, self._folder, self._environment, stdout=subprocess.DEVNULL, stderr=log)


def wait_for_lines(log: Path, count: int, running: subprocess.Popen[Any]) -> None:
    """Wait until a file has so many lines, which a process that still runs has others write."""
    while not log.exists() or len(log.read_text().splitlines()) < count:
        assert running.poll() is None, f"it ended with code {running.returncode}"
        time.sleep(LOOK)
