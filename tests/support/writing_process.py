"""A process that writes files of every kind, each time in a process forked from it, which may be killed.

Run as a script this is the process: it reads requests as lines of JSON and answers each with a line of JSON. What a
writer needs is imported once, before the first one is forked.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import resource
import signal
import sys
import time
import traceback
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import Any

from support.asked_process import Answers, AskedProcess, requests

AS_NOBODY = 65534
FLOWN = str(Path(__file__).parents[1] / "data" / "flown_cat.csv")
CAT = ("cat", "cat_righting", "--momentum", "0", "0")
# What commands write: words before the name of the file; the last one differs between the two versions of it.
COMMANDS = {
    "split.npz": ("split", *CAT, ("0.02", "0.03"), "--out"),
    "split.html": ("split", *CAT, ("0.02", "0.03"), "--html"),
    "phases.csv": ("split", *CAT, ("0.02", "0.03"), "--phases"),
    **{
        f"samples.{kind}": ("split", *CAT, ("0.02", "0.03"), "--samples")
        for kind in ("csv", "parquet", "nc", "mat", "h5")
    },
    **{
        f"export.{kind}": ("export", *CAT, ("0.02", "0.03"), f"--{kind}")
        for kind in ("aem", "csv", "mcap", "parquet", "nc", "mat", "h5", "bvh", "mot")
    },
    "torques.csv": ("torques", *CAT, ("0.02", "0.03"), "--out"),
    "momentum.csv": ("momentum", *CAT, ("0.02", "0.03"), "--out"),
    **{f"momentum.{kind}": ("momentum", *CAT, ("0.02", "0.03"), "--figure") for kind in ("svg", "pdf", "png")},
    "momentum.html": ("momentum", *CAT, ("0.02", "0.03"), "--html"),
    "contributions.csv": ("contributions", *CAT, ("0.02", "0.03"), "--of", "rotation", "--out"),
    "contributions.svg": ("contributions", *CAT, ("0.02", "0.03"), "--of", "rotation", "--figure"),
    "contributions.html": ("contributions", *CAT, ("0.02", "0.03"), "--of", "rotation", "--html"),
    "view.html": ("view", *CAT, ("0.02", "0.03"), "--html"),
    "plot.svg": ("plot", "attitude", *CAT, ("0.02", "0.03"), "--out"),
    "plot.pdf": ("plot", "attitude", *CAT, ("0.02", "0.03"), "--out"),
    "plot.png": ("plot", "attitude", *CAT, ("0.02", "0.03"), "--out"),
    "explore.html": ("explore", "cat_two_halves", "--joints", "waist_pitch", ("waist_yaw", "waist_roll"), "--html"),
    "plan.csv": ("plan", "cat_two_halves", "--turn", ("10 about x", "12 about x"), "--out"),
    "plan.html": ("plan", "cat_two_halves", "--turn", ("10 about x", "12 about x"), "--html"),
    "reach.svg": ("reach", ("diver", "cat_two_halves"), "--out"),
    "reach.pdf": ("reach", ("diver", "cat_two_halves"), "--out"),
    "reach.png": ("reach", ("diver", "cat_two_halves"), "--out"),
    **{f"loop.{kind}": ("loop", *CAT[:2], "--component", ("x", "norm"), "--out") for kind in ("svg", "pdf", "png")},
    "audit.svg": ("audit", "cat_two_halves", FLOWN, "--flight", "0", ("0.9", "0.8"), "--figure"),
    "audit.pdf": ("audit", "cat_two_halves", FLOWN, "--flight", "0", ("0.9", "0.8"), "--figure"),
    "audit.png": ("audit", "cat_two_halves", FLOWN, "--flight", "0", ("0.9", "0.8"), "--figure"),
    "audit.html": ("audit", "cat_two_halves", FLOWN, "--flight", "0", ("0.9", "0.8"), "--html"),
    "conjugate.svg": ("conjugate", "1", "2", ("3", "4"), "--out"),
    "conjugate.pdf": ("conjugate", "1", "2", ("3", "4"), "--out"),
    "conjugate.png": ("conjugate", "1", "2", ("3", "4"), "--out"),
    "rigid.svg": ("rigid", "1", "2", "3", "--momentum", "1", "0", ("2", "4"), "--out"),
    "rigid.html": ("rigid", "1", "2", "3", "--momentum", "1", "0", ("2", "4"), "--html"),
}
FUNCTIONS = ("motion.npz", "motion.csv", "path.npz", "path.csv", "page.html", "figure.svg")
WRITERS = (*COMMANDS, *FUNCTIONS)


# [s] A few times what writing takes: then all moments of it are as probable.
_WRITING = 0.02


class WritingProcess(AskedProcess):
    """The process, seen from the tests; it is asked for the arguments of `_wrote` or `_killed`."""

    def __init__(self, *writers: str) -> None:
        # Two writes of the same are the same bytes.
        fixed = {"SOURCE_DATE_EPOCH": "0", "PYTHONHASHSEED": "0"}
        super().__init__(__file__, *writers, **fixed)


def _parquet_rows(stream: Any) -> int:
    from pyarrow.parquet import read_table

    return read_table(stream).num_rows


def _netcdf_rows(stream: Any) -> int:
    from scipy.io import netcdf_file

    with netcdf_file(stream, mmap=False) as file:
        return len(file.variables["time"][:])


def _matlab_rows(stream: Any) -> int:
    from scipy.io import loadmat

    return len(loadmat(stream)["time"])


def _hdf5_rows(stream: Any) -> int:
    import h5py

    with h5py.File(stream) as file:
        return len(file["time"][()])


_ARRAYS = {"parquet": _parquet_rows, "nc": _netcdf_rows, "mat": _matlab_rows, "h5": _hdf5_rows}
"""Samples in a file, by the library of its format."""


def is_whole(content: bytes, writer: str) -> bool:
    """Whether these are all bytes of a file of this kind, by another reader of the format."""
    kind = writer.split(".")[1]
    if kind == "npz":
        import numpy as np

        arrays = np.load(io.BytesIO(content))
        return all(arrays[name] is not None for name in arrays.files)
    if kind == "csv":
        import numpy as np

        lines = [line for line in content.decode().splitlines() if not line.startswith("#")]
        rows = np.genfromtxt(lines[1:], delimiter=",")
        return content.endswith(b"\n") and len(rows) > 100 and bool(np.isfinite(rows).all())
    if kind in _ARRAYS:
        return _ARRAYS[kind](io.BytesIO(content)) > 100
    if kind == "svg":
        return ElementTree.fromstring(content).tag.endswith("svg")
    if kind in ("bvh", "mot"):
        return content.endswith(b"\n") and len(content.splitlines()) > 200
    ends = {"html": b"</html>", "pdf": b"%%EOF", "png": b"IEND\xaeB`\x82", "aem": b"DATA_STOP", "mcap": b"\x89MCAP0"}
    return content.rstrip().endswith(ends[kind])


def _words(writer: str, version: int, target: str) -> list[str]:
    return [word if isinstance(word, str) else word[version] for word in COMMANDS[writer]] + [target]


def _write(writer: str, version: int, target: str) -> int:
    """Write a file as a user does; the exit code."""
    if writer in COMMANDS:
        from shapephase.cli.main import main

        try:
            main(_words(writer, version, target))
        except SystemExit as stopped:
            return int(stopped.code or 0)
        return 0
    from shapephase.cli.outcome import exit_code_of
    from shapephase.errors import ShapePhaseError

    try:
        _call(writer, version, target)
    except ShapePhaseError as error:
        print(f"shapephase: {error}", file=sys.stderr)
        return exit_code_of(error)
    return 0


def _call(writer: str, version: int, target: str) -> None:
    """As a program does."""
    import numpy as np

    import shapephase as sp

    if writer in ("path.npz", "path.csv"):
        path = sp.ShapePath.fourier([0.1], [[1.0 + version]], [[0.2]], 1.0, joint_names=("hinge",))
        sp.write_shape_path(path, target, np.linspace(0.0, 1.0, 3000))
        return
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.1, 0.2, 1.0 + version])
    if writer == "motion.npz":
        motion.save(target)
    elif writer == "motion.csv":
        motion.write_csv(target, np.linspace(0.0, 1.0, 2000))
    elif writer == "figure.svg":
        from shapephase.plots.named_figures import write_figure

        write_figure("attitude", motion, target)
    else:
        body, path = sp.load_body("cat"), sp.examples.scenarios.cat_righting()
        sp.view(sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.02 + 0.01 * version])).write(target)


def _in_child(
    do: Callable[[], int], streams: tuple[str, str], limit: int | None = None, before: Callable[[], Any] | None = None
) -> int:
    """Fork a process that does something with standard output and error in files; its number.

    With `before` this is done first, and the rest as a user who may do next to nothing.
    """
    child = os.fork()
    if child:
        return child
    code = 70
    try:
        if before is not None:
            before()
        for number, file in enumerate(streams, 1):
            os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND), number)
        if limit is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        if before is not None:
            os.setgroups([])
            os.setgid(AS_NOBODY)
            os.setuid(AS_NOBODY)
        code = do()
        sys.stdout.flush()
    except BaseException:
        traceback.print_exc()
    sys.stderr.flush()
    os._exit(code)


def _wrote(
    writer: str, target: str, folder: str, version: int = 0, limit: int | None = None, nobody: bool = False
) -> dict[str, Any]:
    """Write once; how it ended and what was said. `folder` is for standard output and error."""
    streams = (f"{folder}/stdout", f"{folder}/stderr")
    # What is imported late may be where only root may read.
    spare = f"{folder}/imported.{writer.split('.')[1]}"
    child = _in_child(
        lambda: _write(writer, version, target), streams, limit, (lambda: _write(writer, 1, spare)) if nobody else None
    )
    _, status = os.waitpid(child, 0)
    said = Path(streams[1]).read_text(encoding="utf-8", errors="replace")
    printed = Path(streams[0]).read_bytes().decode("latin-1")
    return {"code": os.waitstatus_to_exitcode(status), "printed": printed, "said": said}


def _killed(writer: str, target: str, folder: str, trials: int, seed: int, whole_commands: int = 4) -> dict[str, Any]:
    """Kill a writer of two versions in turn at random times.

    `trials` times while nothing is done but to write what was computed once, over and over; and some whole commands.
    """
    place = Path(target)
    writes, wholes, durations = [], [], []
    for version in (1, 0):
        start = time.monotonic()
        writes += _recorded(writer, version, target)
        durations.append(time.monotonic() - start)
        wholes.append(place.read_bytes())
    streams, chance = (f"{folder}/stdout", f"{folder}/stderr"), random.Random(seed)
    found = {"torn": 0, "interrupted": 0}
    for trial in range(trials + whole_commands):
        begun, told = os.pipe()
        is_command = trial >= trials
        again = (
            (lambda told=told: _again(writer, target, told))
            if is_command
            else (lambda told=told: _again_only(writes, told))
        )
        child = _in_child(again, streams)
        os.close(told)
        os.read(begun, 1)
        time.sleep(chance.uniform(0.0, max(durations) if is_command else _WRITING))
        os.kill(child, signal.SIGKILL)
        _, status = os.waitpid(child, 0)
        os.close(begun)
        assert os.WIFSIGNALED(status), Path(streams[1]).read_text()
        written = place.read_bytes()
        # Two pages of the same motion have other identifiers.
        found["torn"] += written not in wholes and not (is_command and is_whole(written, writer))
        found["interrupted"] += len(list(place.parent.iterdir())) > 1
    last = _wrote(writer, target, folder, 1)
    whole = place.read_bytes() == wholes[0] or is_whole(place.read_bytes(), writer)
    return {**found, "differ": wholes[0] != wholes[1], "code": last["code"], "whole": whole}


def _recorded(writer: str, version: int, target: str) -> list[Callable[[], None]]:
    """Write a file here, and how to write just that again."""
    from shapephase import files

    really, found = files.write_whole, []

    def recording(path: Any, write: Any) -> None:
        found.append(lambda: really(path, write))
        really(path, write)

    loaded = [module for name, module in sys.modules.items() if name.startswith("shapephase")]
    having = [module for module in loaded if getattr(module, "write_whole", None) is really]
    for module in having:
        module.write_whole = recording
    try:
        with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            assert _write(writer, version, target) == 0
    finally:
        for module in having:
            module.write_whole = really
    assert len(found) == 1
    return found


def _again(writer: str, target: str, told: int) -> int:
    """Write both versions in turn, from the beginning."""
    os.write(told, b" ")
    while True:
        for version in (0, 1):
            assert _write(writer, version, target) == 0


def _again_only(writes: list[Callable[[], None]], told: int) -> int:
    """Write both versions in turn, and nothing but that."""
    os.write(told, b" ")
    while True:
        for write in writes:
            write()


def _import_for(writer: str) -> None:
    """Import here what a process that is forked from here imports to write."""
    import importlib
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        listed, target = Path(folder) / "stdout", f"{folder}/target.{writer.split('.')[1]}"

        def listing() -> int:
            assert _write(writer, 0, target) == 0
            listed.write_text("\n".join(sys.modules))
            return 0

        _, status = os.waitpid(_in_child(listing, (os.devnull, f"{folder}/stderr")), 0)
        assert status == 0, Path(f"{folder}/stderr").read_text()
        for name in listed.read_text().split("\n"):
            # Some are made by other modules, and cannot be imported by their names.
            with contextlib.suppress(ImportError):
                importlib.import_module(name)


def work(writers: list[str]) -> None:
    for writer in writers:
        _import_for(writer)
    answers = Answers()
    for request in requests():
        answers.say(_killed(**request) if "trials" in request else _wrote(**request))


if __name__ == "__main__":
    work(sys.argv[1:])
