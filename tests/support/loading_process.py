"""A process that loads body files, watched from outside.

Run as a script this is the process: it reads requests as lines of JSON and answers each with lines of JSON, so that a
crash, a hang or a hunger for memory is seen from outside and tells which file did it.
"""

from __future__ import annotations

import os
import sys
import traceback
import warnings
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

from support.asked_process import Answers, AskedProcess, ProcessEnded, requests
from support.damaged_files import mutated
from support.reference_load import Effort, TooMuchWork
from support.warm_engines import WarmStart

HANG_SECONDS = 120
"""A process that has not answered in this time never will [s]; nothing is concluded from times below."""
MOST_MEMORY = 2**30
"""What loading one file may take [bytes]: three times what the largest body takes."""


class Worker(AskedProcess):
    """A process that loads files, started anew after a crash."""

    def __init__(self, memory: int = MOST_MEMORY) -> None:
        super().__init__(__file__, str(memory), silent=True)

    def start(self) -> None:
        super().start()
        assert self.answer(HANG_SECONDS) == {"ready": True}

    def outcomes(self, request: dict[str, Any], answers: int = 1) -> list[dict[str, Any]]:
        """The answers to a request; what stops the process is the last one."""
        self.send(request)
        found: list[dict[str, Any]] = []
        try:
            while len(found) < answers:
                found.append(self.answer(HANG_SECONDS))
        except (ProcessEnded, TimeoutError) as end:
            found.append({"outcome": "died" if isinstance(end, ProcessEnded) else "hang", "message": str(end)})
            self.stop()
            self.start()
        return found


def outcome_of(path: str, **options: str) -> dict[str, Any]:
    """Load a file here: "loads" with what is warned of and the mass, or the error."""
    import numpy as np

    import shapephase as sp

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            body = sp.load_body(path, **options)
        except sp.ShapePhaseError as error:
            return {"outcome": type(error).__name__, "message": str(error)}
        except BaseException as error:
            return {"outcome": "escaped", "message": repr(error)}
    shape = 0.1 * np.ones(body.n_shape)
    numbers = [body.mass, *body.locked_inertia(shape).ravel(), *body.internal_momentum(shape, shape)]
    return {
        "outcome": "loads" if np.isfinite(numbers).all() and body.mass > 0.0 else "not finite",
        "message": "; ".join(str(warning.message) for warning in caught),
        "mass": body.mass,
    }


def weighed_outcome(effort: Effort, path: str, **options: str) -> dict[str, Any]:
    """The outcome, or "slow" if it took more work than is allowed."""
    try:
        with effort.limited():
            return outcome_of(path, **options)
    except TooMuchWork as excess:
        return {"outcome": "slow", "message": str(excess)}


def written_mass(path: str) -> float:
    """The sum of the masses of a URDF, by another parser."""
    root = ElementTree.parse(path).getroot()
    return sum(float(mass.get("value", "nan")) for mass in root.findall("link/inertial/mass"))


def commanded(arguments: list[str], folder: str) -> dict[str, Any]:
    """The command line in a process of its own, forked from this one: how it ended and what it printed."""
    import resource

    printed, said = Path(folder) / "stdout.txt", Path(folder) / "stderr.txt"
    child = os.fork()
    if child == 0:
        for number, file in ((1, printed), (2, said)):
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        resource.setrlimit(resource.RLIMIT_CPU, (HANG_SECONDS, HANG_SECONDS))
        code = 70
        try:
            from shapephase.cli.main import main

            main(arguments)
            code = 0
        except SystemExit as stopped:
            code = int(stopped.code or 0)
        except BaseException:
            traceback.print_exc()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    _, status, used = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    return {
        "outcome": f"signal {-code}" if code < 0 else f"exit {code}",
        "message": said.read_text(encoding="utf-8", errors="replace"),
        "printed": printed.read_text(encoding="utf-8", errors="replace"),
        "memory": used.ru_maxrss * 1024,
    }


def work(memory: int) -> None:
    import resource

    answers = Answers()
    # What the commands import late, once for all the processes that are forked from this one.
    import shapephase.cli.main
    import shapephase.cli.motion
    import shapephase.cli.texts.result_text  # noqa: F401
    from shapephase.body.engines import engine_tree
    from shapephase.body.engines.formats import MJCF
    from shapephase.shape_space.files.formats import parser_process

    # MuJoCo and what else reads in a process of its own has limits of its own, in processes that start without these.
    engine_tree.run_alone = WarmStart(MJCF)
    parser_process.run_alone = WarmStart()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))

    effort = Effort()
    answers.say({"ready": True})
    for request in requests():
        if "command" in request:
            answers.say(commanded(request["command"], request["folder"]))
            continue
        path = request["path"]
        if "seeds" not in request:
            answers.say(weighed_outcome(effort, path, **request.get("options", {})))
            continue
        good = Path(request["base"]).read_bytes()
        for seed in range(*request["seeds"]):
            Path(path).write_bytes(mutated(good, seed))
            answer = weighed_outcome(effort, path, on_unphysical="warn" if seed % 2 else "error")
            if answer["outcome"] == "loads" and path.endswith(".urdf"):
                answer["written"] = written_mass(path)
            answers.say({"seed": seed, **answer})


if __name__ == "__main__":
    work(int(sys.argv[1]))
