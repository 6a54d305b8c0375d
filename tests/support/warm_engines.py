"""Engines imported once for many files: each is read as in a process of its own, which is forked from one that waits.

What reads, its limits and what comes back are those of the library; only the start of Python and the imports are saved.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import traceback
from importlib import import_module
from pathlib import Path
from typing import Any

from shapephase.body.engines.formats import FORMATS
from support.asked_process import Answers, AskedProcess, ProcessEnded, requests

# For the process that waits, in place of a format.
ANYTHING = "anything"
PARSERS = "shapephase.shape_space.files.formats.parser_process"


class WarmEngines:
    """In place of `run_alone` of the module that asks engines; a process waits for each format that was asked for."""

    def __init__(self) -> None:
        self._waiting: dict[str, WarmStart] = {}

    def __call__(
        self, source: str, words: tuple[str, ...], data: bytes, seconds: float
    ) -> subprocess.CompletedProcess[bytes]:
        name = words[1]
        if name not in self._waiting:
            self._waiting[name] = WarmStart(name)
        return self._waiting[name](source, words, data, seconds)

    def stop(self) -> None:
        for engine in self._waiting.values():
            engine.stop()


class WarmStart(AskedProcess):
    """In place of `run_alone`: what is to run in a process of its own runs in one that is forked from one that waits.

    With what a format of bodies imports, or what readers of bodies and of motions do.
    """

    def __init__(self, name: str = ANYTHING) -> None:
        super().__init__(__file__, name, silent=True)

    def __call__(
        self, source: str, words: tuple[str, ...], data: bytes, seconds: float
    ) -> subprocess.CompletedProcess[bytes]:
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "stdin").write_bytes(data)
            self.send({"source": source, "words": words, "folder": folder})
            try:
                code = self.answer(seconds)["code"]
            except (ProcessEnded, TimeoutError) as end:
                self.stop()
                self.start()
                if isinstance(end, TimeoutError):
                    raise subprocess.TimeoutExpired(words[0], seconds) from None
                raise
            printed, said = ((Path(folder) / name).read_bytes() for name in ("stdout", "stderr"))
        return subprocess.CompletedProcess(list(words), code, printed, said)


def _import_needed(name: str) -> None:
    """Import what every source of a format needs, or of any."""
    if name == ANYTHING:
        for module in ("pinocchio", "scipy.io", "shapephase.body.loading", PARSERS):
            import_module(module)
        return
    import_module("shapephase.body.engines.reading")
    with tempfile.TemporaryDirectory() as folder:
        # Some engines write a log into the folder that they are imported in.
        os.chdir(folder)
        import_module(FORMATS[name].module, "shapephase.body.engines")
        os.chdir(os.path.sep)


def work(name: str) -> None:
    """Import what every source needs, and run each in a process that is forked."""
    answers = Answers()
    _import_needed(name)
    for request in requests():
        child = os.fork()
        if child == 0:
            os._exit(_run(request))
        _, status = os.waitpid(child, 0)
        answers.say({"code": os.waitstatus_to_exitcode(status)})


def _run(request: dict[str, Any]) -> int:
    """Run a source, and return its exit code."""
    os.dup2(os.open(f"{request['folder']}/stdin", os.O_RDONLY), 0)
    # Not the one that requests come through, which may have read ahead.
    sys.stdin = os.fdopen(0, closefd=False)
    for number, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(os.open(f"{request['folder']}/{name}", os.O_WRONLY | os.O_CREAT), number)
    sys.argv = ["-c", *request["words"]]
    # The log of MuJoCo is written where the process runs.
    os.chdir(request["folder"])
    code: Any = 0
    try:
        exec(request["source"], {"__name__": "__main__"})
    except SystemExit as stopped:
        code = stopped.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    for stream in (sys.__stdout__, sys.__stderr__):
        assert stream is not None
        stream.flush()
    return int(code)


if __name__ == "__main__":
    work(sys.argv[1])
