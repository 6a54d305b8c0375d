"""Engines imported once for many files: each is read as in a process of its own, which is forked from one that waits.

What reads, its limits and what comes back are those of the library; only the start of Python and the imports are saved.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import traceback
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from shapephase.body.engines.formats import FORMATS, MJCF
from support.asked_process import Answers, AskedProcess, ProcessEnded, requests

# For the process that waits, in place of a format.
ANYTHING = "anything"


class WarmEngines:
    """In place of `run_alone` of the module that asks engines; a process waits for each format that was asked for."""

    def __init__(self) -> None:
        self._waiting: dict[str, WarmEngine] = {}

    def __call__(
        self, source: str, words: tuple[str, ...], data: bytes, seconds: float
    ) -> subprocess.CompletedProcess[bytes]:
        name = words[1]
        if name not in self._waiting:
            self._waiting[name] = WarmEngine(name)
        return self._waiting[name](source, words, data, seconds)

    def stop(self) -> None:
        for engine in self._waiting.values():
            engine.stop()


class WarmStart(AskedProcess):
    """In place of `run_alone`: what is to run in a process of its own runs in one that is forked from one that waits.

    With what readers of bodies and of motions import, whose processes are told apart by their words alone.
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


class WarmEngine(WarmStart):
    """The same for one format, MJCF if none is named."""

    def __init__(self, name: str = MJCF) -> None:
        super().__init__(name)


def work_at_anything() -> None:
    """Import what most sources need, and run each in a process that is forked."""
    answers = Answers()
    import pinocchio  # noqa: F401
    import scipy.io  # noqa: F401

    from shapephase.body import loading  # noqa: F401
    from shapephase.shape_space.files.formats import parser_process  # noqa: F401

    for request in requests():
        child = os.fork()
        if child == 0:
            os.dup2(os.open(f"{request['folder']}/stdin", os.O_RDONLY), 0)
            # Not the one that requests come through, which may have read ahead.
            sys.stdin = os.fdopen(0, closefd=False)
            os._exit(_read(request, partial(exec, request["source"], {"__name__": "__main__"})))
        _, status = os.waitpid(child, 0)
        answers.say({"code": os.waitstatus_to_exitcode(status)})


def work(name: str) -> None:
    """Import the format's reader, which every file needs, and read in processes that are forked."""
    answers = Answers()
    from shapephase.body.engines.reading import read_in_this_process

    with tempfile.TemporaryDirectory() as folder:
        # Some engines write a log into the folder that they are imported in.
        os.chdir(folder)
        import_module(FORMATS[name].module, "shapephase.body.engines")
        os.chdir(os.path.sep)

    for request in requests():
        child = os.fork()
        if child == 0:
            code = _read(request, read_in_this_process)
            os._exit(code)
        _, status = os.waitpid(child, 0)
        answers.say({"code": os.waitstatus_to_exitcode(status)})


def _read(request: dict[str, Any], read: Any) -> int:
    for number, name in ((1, "stdout"), (2, "stderr")):
        os.dup2(os.open(f"{request['folder']}/{name}", os.O_WRONLY | os.O_CREAT), number)
    sys.argv = ["-c", *request["words"]]
    # The log of MuJoCo is written where the process runs.
    os.chdir(request["folder"])
    code: Any = 0
    try:
        read()
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
    work_at_anything() if sys.argv[1] == ANYTHING else work(sys.argv[1])
