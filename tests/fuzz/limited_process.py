"""A process that tries one input after the other, in children with limits of processor time and memory.

Run as a script this is the process. It has imported what the library imports late, so that a child is a fork and costs
milliseconds; a child tries some inputs, and those after one that ends it are for the next.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import resource
import shutil
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from fuzz.forked_reader import fork_readers
from fuzz.pieces import BODY, Trial
from fuzz.plain_readers import READERS
from support.asked_process import Answers, AskedProcess, requests

SECONDS = 10
"""Processor time of one input [s]; the limit of the kernel, in whole seconds."""
MOST_MEMORY = 2**31
"""Largest part of a child's memory that was ever in use [bytes]."""
_ROOM = 2**31 + 2**29
"""Addresses that a child may take beyond those of the process it was forked from [bytes]."""
_WIDE = 2**34
"""The same for an input that was refused for want of them [bytes]: now it shows how many of them it would use."""
_TRIES = 40
"""Inputs of one child: a fork costs as much as twenty small files."""
_PATIENCE = 300
"""A child that has not ended after so long hangs [s of the clock]; it has used next to no processor time."""
_CODES = (0, 2, 3, 4, 5, 6, 7, 8, 9, 10)
"""Exit codes that a command may have here: neither 1, a fault of the program, nor those of signals."""
_LONGEST_MESSAGE = 6000
"""Characters of an error: names of a body's joints are listed, and up to 200 columns of a file."""
_OF_MEMORY = (
    "MemoryError",
    "Unable to allocate",
    "bad_alloc",
    "malloc of size",
    "realloc of size",
    "std::length_error",
)
_BODY = "small.urdf"


class LimitedProcess(AskedProcess):
    """The process, from outside."""

    def __init__(self, folder: Path, *, long: bool) -> None:
        """Start it; `long`: for so many inputs that it is worth while to import everything beforehand."""
        self._folder = folder
        (folder / _BODY).write_text(BODY)
        fixed = {"OMP_NUM_THREADS": "1", "COLUMNS": "200", "MPLBACKEND": "agg"}
        super().__init__("-m", "fuzz.limited_process", *(["long"] if long else []), folder=folder, **fixed)
        self.answer()

    def tried(self, trial: Trial, *, by_command_line: bool = False) -> dict[str, Any]:
        """What became of an input: "outcome", "message", "faults", "seconds" [s of processor], "memory" [bytes]."""
        place = self._folder / "trial"
        shutil.rmtree(place, ignore_errors=True)
        (place / "folder").mkdir(parents=True)
        for name, content in trial.files.items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_bytes(content)
        return self.ask(
            kind="process" if by_command_line else trial.kind,
            folder=place,
            main=trial.main,
            options=dict(trial.options),
            arguments=list(trial.arguments),
        )


def _limit(room: int) -> None:
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (room, room))


def _limit_seconds() -> None:
    """So much processor time from now on, of this process and of each that it starts."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    end = int(used.ru_utime + used.ru_stime) + 1 + SECONDS
    resource.setrlimit(resource.RLIMIT_CPU, (end, resource.RLIM_INFINITY))
    signal.alarm(_PATIENCE)


def _used() -> tuple[float, int]:
    """Processor time [s] and most memory [bytes] of this process and those that it has waited for."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used), max(u.ru_maxrss for u in used) * 1024


def _redirected(place: Path) -> None:
    os.chdir(place)
    for number, name in ((1, "stdout.txt"), (2, "stderr.txt")):
        file = os.open(place / name, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, number)
        os.close(file)


class _Child:
    """A child that tries inputs one after the other, until one ends it or there were enough."""

    def __init__(self, room: int) -> None:
        self.tries, self.room = 0, room
        (requests, self._requests), (self._answers, answers) = os.pipe(), os.pipe()
        self._pid = os.fork()
        if self._pid == 0:
            os.close(self._requests)
            os.close(self._answers)
            with contextlib.suppress(BaseException), os.fdopen(requests) as lines, os.fdopen(answers, "w") as parts:
                gc.enable()
                os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
                _limit(room)
                for line in lines:
                    self._try(json.loads(line), parts)
            os._exit(70)
        os.close(requests)
        os.close(answers)
        self._lines = os.fdopen(self._answers)

    @staticmethod
    def _try(request: dict[str, Any], parts: Any) -> None:
        _redirected(Path(request["folder"]))
        _limit_seconds()
        before, _ = _used()
        for part in _TRIALS[request["kind"]](request):
            print(json.dumps(part), file=parts, flush=True)
        # Whoever waits for the next input may wait long.
        signal.alarm(0)
        seconds, memory = _used()
        print(json.dumps({"seconds": seconds - before, "memory": memory}), file=parts, flush=True)

    def tried(self, request: dict[str, Any]) -> tuple[dict[str, Any], int | None]:
        """What became of an input, and how the child ended if it did."""
        self.tries += 1
        answer: dict[str, Any] = {"outcome": "nothing", "message": "", "faults": []}
        with contextlib.suppress(BrokenPipeError):
            os.write(self._requests, json.dumps(request).encode() + b"\n")
        for line in self._lines:
            part = json.loads(line)
            answer["faults"] += part.pop("faults", [])
            answer |= part
            if "seconds" in part:
                return answer, None
        return answer, self.stop()

    def stop(self) -> int:
        with contextlib.suppress(OSError):
            os.close(self._requests)
        self._lines.close()
        return os.waitstatus_to_exitcode(os.waitpid(self._pid, 0)[1])


def _command_alone(request: dict[str, Any], room: int) -> tuple[dict[str, Any], int]:
    """A command in a child that is forked, or in a process that starts from nothing."""
    place = Path(request["folder"])
    child = os.fork()
    if child == 0:
        code = 70
        with contextlib.suppress(BaseException):
            _redirected(place)
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            gc.enable()
            _limit(room)
            _limit_seconds()
            if request["kind"] == "process":
                os.execv(sys.executable, [sys.executable, "-m", "shapephase", *request["arguments"]])
            code = _command(request)
        os._exit(code)
    _, status, used = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    said = (place / "stderr.txt").read_text(encoding="utf-8", errors="backslashreplace")
    answer = {"outcome": f"exit {code}", "message": said[-500:], "faults": []}
    answer |= {"seconds": used.ru_utime + used.ru_stime, "memory": used.ru_maxrss * 1024}
    if code >= 0:
        answer["faults"] += list(_command_faults(request, answer["outcome"], place))
    return answer, code


def _watched(request: dict[str, Any], child: _Child) -> dict[str, Any]:
    """Try an input, and say what is wrong with how that went."""
    if request["kind"] in ("command", "process"):
        answer, ended = _command_alone(request, child.room)
        ended = ended if ended < 0 else None
    else:
        answer, ended = child.tried(request)
    answer = {"seconds": 0.0, "memory": 0} | answer
    if ended is not None:
        said = (Path(request["folder"]) / "stderr.txt").read_text(errors="replace")[-2000:]
        how = f"signal {-ended} ({signal.Signals(-ended).name})" if ended < 0 else f"exit {ended}"
        answer["faults"].append(f"{how}; before it: {answer['outcome']} {said}")
    if answer["seconds"] > SECONDS:
        answer["faults"].append(f"{answer['seconds']:.1f} s of the processor")
    if answer["memory"] > MOST_MEMORY:
        answer["faults"].append(f"{answer['memory'] >> 20} MiB of memory")
    if child.room < _WIDE and any(word in answer["message"] for word in _OF_MEMORY):
        second = _Child(_room() + _WIDE)
        answer = _watched(request, second)
        with contextlib.suppress(OSError, ChildProcessError):
            second.stop()
    return answer


def _room() -> int:
    """The addresses that this process has [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()


def _outcome(request: dict[str, Any], call: Any, names_file: bool = True) -> tuple[Any, list[str], dict[str, Any]]:
    """What a function of the library gives, what it warned of, and how that is told."""
    import shapephase as sp

    where = str(Path(request["folder"]) / request["main"])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = call(where)
        except sp.ShapePhaseError as error:
            told = {"outcome": type(error).__name__, "message": str(error)}
            faults = [f"a message of {len(str(error))} characters"] if len(str(error)) > _LONGEST_MESSAGE else []
            if names_file and where not in str(error) and not request["options"]:
                faults.append(f"the file is not named: {error}")
            return None, [], told | {"faults": faults}
        except BaseException:
            return None, [], {"outcome": "escaped", "faults": [traceback.format_exc()[-3000:]]}
    own = [str(warning.message) for warning in caught if warning.category.__module__.startswith("shapephase")]
    others = [w for w in caught if not w.category.__module__.startswith("shapephase")]
    faults = [f"a warning of others: {w.category.__name__}: {w.message} ({w.filename}:{w.lineno})" for w in others]
    return found, own, {"outcome": "accepted", "faults": faults}


def _checked(faults: Any) -> dict[str, Any]:
    """The faults of what was accepted, by the rules; also where these cannot be applied."""
    try:
        return {"faults": list(faults)}
    except BaseException:
        return {"faults": [f"a rule fails: {traceback.format_exc()[-3000:]}"]}


def _body(request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    import shapephase as sp
    from fuzz.rules import body_faults

    body, warned, told = _outcome(request, lambda where: sp.load_body(where, **request["options"]))
    yield told
    if body is not None:
        yield _checked(body_faults(Path(request["folder"]) / request["main"], body, warned, request["options"]))


def _motion(request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    import shapephase as sp
    from fuzz.rules import motion_faults
    from shapephase.shape_space.files.read import read_recorded_motion

    own = Path(request["folder"]) / "body.urdf"
    body = sp.load_body(own) if own.exists() else _small_body()
    recorded, _, told = _outcome(request, lambda where: read_recorded_motion(where, body, **request["options"]))
    yield told
    if recorded is not None:
        yield _checked(motion_faults(Path(request["folder"]) / request["main"], body, recorded, request["options"]))


def _trajectory(request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    import shapephase as sp
    from fuzz.trajectories import OF_AUDIT
    from fuzz.trajectory_rules import audit_faults, trajectory_faults

    body, options = _small_body(), dict(request["options"])
    asked = {name: options.pop(name) for name in OF_AUDIT if name in options}
    run, _, told = _outcome(request, lambda where: sp.read_trajectory(where, body, **options))
    yield told
    if run is None:
        return
    yield _checked(trajectory_faults(Path(request["folder"]) / request["main"], body, run))
    found, _, told = _outcome(request, lambda _: sp.audit(body, run, **asked), names_file=False)
    yield told
    if found is not None:
        yield _checked(audit_faults(found))


def _names(request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    from fuzz.rules import name_faults
    from shapephase.shape_space.files.mapping_files import read_names

    names, _, told = _outcome(request, read_names)
    yield told
    if names is not None:
        yield _checked(name_faults(Path(request["folder"]) / request["main"], names))


def _record(request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    import shapephase as sp
    from fuzz.rules import record_faults

    motion, _, told = _outcome(request, sp.load_motion)
    yield told
    if motion is not None:
        yield _checked(record_faults(motion))


def _study(request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    from fuzz.study_rules import study_faults
    from shapephase.study.study_file import read_study

    study, _, told = _outcome(request, read_study)
    yield told
    if study is not None:
        yield _checked(study_faults(Path(request["folder"]) / request["main"], study))


def _store(request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    from fuzz.study_rules import looked_at, store_faults

    found, _, told = _outcome(request, looked_at)
    yield told
    if found is not None:
        yield _checked(store_faults(Path(request["folder"]) / request["main"], found))


def _command(request: dict[str, Any]) -> int:
    from shapephase.cli.main import main

    code = 0
    try:
        main(request["arguments"])
    except SystemExit as stopped:
        code = int(stopped.code or 0)
    except BaseException:
        traceback.print_exc()
        code = 70
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    return code


def _command_faults(request: dict[str, Any], outcome: str, place: Path) -> Iterator[str]:
    """What is wrong with how a command ended: one of the documented codes, one line for an error, JSON as asked."""
    printed = (place / "stdout.txt").read_text(encoding="utf-8", errors="backslashreplace")
    said = (place / "stderr.txt").read_text(encoding="utf-8", errors="backslashreplace")
    code = outcome.removeprefix("exit ")
    if code not in map(str, _CODES) or "Traceback" in said + printed:
        yield f"{outcome}: {said[-3000:]}"
        return
    for file in place.glob("samples.*"):
        reader = READERS.get(file.suffix)
        if reader is not None and not all(np.isfinite(column).all() for column in reader(file.read_bytes()).values()):
            yield f"{file.name} has what is no number"
    lines = [line for line in said.splitlines() if not line.startswith(("shapephase: warning: ", "wrote "))]
    loud = {"-v", "--verbose"} & {*request["arguments"]}
    alone = len(lines) == (code != "0") and all(line.startswith("shapephase: ") for line in lines)
    # A search that found nothing tells its best try, and why in a warning; an audit that found a fault its table.
    if not (loud or alone or code in ("7", "10")):
        yield f"{outcome} with {len(lines)} lines: {said[-1000:]}"
    if "--json" not in request["arguments"] or (code == "0" and not printed.startswith("{")):
        return
    try:
        data = json.loads(printed, parse_constant=_no_constant)
    except ValueError as fault:
        yield f"{outcome}, and no JSON ({fault}): {printed[:1000]}"
        return
    if code not in ("0", "7", "10") and data.get("error", {}).get("exit_code") != int(code):
        yield f"{outcome}, and JSON says {data}"


def _no_constant(word: str) -> None:
    raise ValueError(f"{word} in JSON")


@cache
def _small_body() -> Any:
    import shapephase as sp

    return sp.load_body(_BODY)


def _warm_up(long: bool) -> None:
    """Do once what imports modules when it is first done."""
    import shapephase as sp

    body = _small_body()
    file = Path("good.csv")
    file.write_text("time," + ",".join(body.joint_names) + "\n0,0,0,0\n1,0.1,0.2,0.1\n2,0.2,0.1,0\n3,0,0,0\n")
    path = sp.read_shape_path(file, body)
    if not long:
        return
    from shapephase.cli.main import main

    fork_readers()
    sp.reconstruct(sp.articulated(body, path), [0.0, 0.1, 0.2], tolerance=1e-6).save("good.npz")
    sp.load_motion("good.npz").attitude([0.0, 1.0])
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        main(["check", "cat", "cat_righting"])
        main(["split", "cat", "cat_righting", "--momentum", "0", "0", "0.01", "--json"])


def _crash(_: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield {"outcome": "alive"}
    os.kill(os.getpid(), signal.SIGSEGV)


def _escape(request: dict[str, Any]) -> Iterator[dict[str, Any]]:
    yield _outcome(request, lambda _: 1 // 0)[2]


_TRIALS = {
    "body": _body,
    "motion": _motion,
    "trajectory": _trajectory,
    "names": _names,
    "record": _record,
    "study": _study,
    "store": _store,
    "command": _command,
    "crash": _crash,
    "escape": _escape,
}


def _work() -> None:
    answers = Answers()
    import shapephase.cli.main
    import shapephase.reconstruction.reconstruction
    import shapephase.shape_space.files.read  # noqa: F401

    _warm_up("long" in sys.argv)
    # What is there now is shared with the children, page by page, until somebody writes to it.
    gc.collect()
    gc.freeze()
    gc.disable()
    child = _Child(_room() + _ROOM)
    answers.say({"ready": True})
    for request in requests():
        answer = _watched(request, child)
        if answer["faults"] or child.tries >= _TRIES:
            with contextlib.suppress(OSError, ChildProcessError):
                child.stop()
            child = _Child(_room() + _ROOM)
        answers.say(answer)


if __name__ == "__main__":
    _work()
