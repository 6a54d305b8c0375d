"""A script as a process of its own, which is asked and answers: each request and each answer is a line of JSON."""

from __future__ import annotations

import json
import os
import selectors
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_TESTS = Path(__file__).parents[1]
_PIECE = 65536
"""So much of an answer is read at once [bytes]."""


class ProcessEnded(Exception):
    """A process that ended instead of answering."""


class AskedProcess:
    """The process, seen from the tests."""

    def __init__(self, *words: str, silent: bool = False, folder: Path | None = None, **environment: str) -> None:
        """Start it: words of a command line of Python, whether its standard error goes nowhere, and where it runs."""
        # Where it runs, folders that are given from here would be others.
        given = [os.path.abspath(place) for place in os.environ.get("PYTHONPATH", "").split(os.pathsep) if place]
        fixed = {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": os.pathsep.join([str(_TESTS), *given])}
        self._settings: dict[str, Any] = {
            "args": [sys.executable, *words],
            "stderr": subprocess.DEVNULL if silent else None,
            "cwd": folder,
            "env": {**os.environ, **fixed, **environment},
        }
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(stdin=subprocess.PIPE, stdout=subprocess.PIPE, **self._settings)
        self._rest = b""

    def ask(self, **request: Any) -> dict[str, Any]:
        """The answer to a request, and what `answer` raises."""
        self.send(request)
        return self.answer()

    def send(self, request: dict[str, Any]) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(json.dumps(request, default=str).encode() + b"\n")
        self.process.stdin.flush()

    def answer(self, seconds: float | None = None) -> dict[str, Any]:
        """The next answer. Raises ProcessEnded, and TimeoutError where there is none for so long."""
        assert self.process.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self.process.stdout, selectors.EVENT_READ)
            while b"\n" not in self._rest:
                if not selector.select(seconds):
                    raise TimeoutError(f"no answer in {seconds} s")
                piece = os.read(self.process.stdout.fileno(), _PIECE)
                if not piece:
                    raise ProcessEnded(f"the process ended with {self.process.wait()}")
                self._rest += piece
        line, self._rest = self._rest.split(b"\n", 1)
        return json.loads(line)

    def stop(self) -> None:
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()


class Answers:
    """Where the process itself writes its answers: standard output, which everything else there no longer reaches."""

    def __init__(self) -> None:
        self._stream = os.fdopen(os.dup(1), "w")
        os.dup2(2, 1)

    def say(self, answer: dict[str, Any]) -> None:
        print(json.dumps(answer), file=self._stream, flush=True)


def requests() -> Iterator[dict[str, Any]]:
    """What the process is asked, as it comes."""
    return map(json.loads, sys.stdin)
