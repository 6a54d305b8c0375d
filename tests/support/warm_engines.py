"""MuJoCo imported once for many files: each is read as in a process of its own, which is forked from one that waits.

What reads, its limits and what comes back are those of the library; only the start of Python and the imports are saved.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any

from support.asked_process import Answers, AskedProcess, ProcessEnded, requests


class WarmEngine(AskedProcess):
    """In place of `run_alone` of the module that asks engines."""

    def __init__(self) -> None:
        super().__init__(__file__, silent=True)

    def __call__(
        self, source: str, words: tuple[str, ...], data: bytes, seconds: float
    ) -> subprocess.CompletedProcess[bytes]:
        assert "read_in_this_process" in source
        assert not data
        with tempfile.TemporaryDirectory() as folder:
            self.send({"words": words, "folder": folder})
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


def work() -> None:
    answers = Answers()
    import shapephase.body.engines.mujoco_reading  # noqa: F401 (which every file needs)
    from shapephase.body.engines.reading import read_in_this_process

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
    work()
