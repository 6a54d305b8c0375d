"""Every writer of commands and functions: what it writes is whole, by `write_whole` alone, which has tests of its own.

What `write_whole` does when it is killed, refused or led elsewhere is in test_files.py.
"""

from __future__ import annotations

import errno
import io
import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import app, main
from shapephase.cli.outcome import ExitCode
from support.long_runs import full_but
from support.places import ROOT

FLOWN = str(ROOT / "tests" / "data" / "flown_cat.csv")
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
READ = (("check", "--srdf"), ("plan", "--srdf"))  # files that are options, too


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
        arrays = np.load(io.BytesIO(content))
        return all(arrays[name] is not None for name in arrays.files)
    if kind == "csv":
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


def written_by_function(writer: str, target: Path) -> None:
    """Write a file as a program does."""
    if writer in ("path.npz", "path.csv"):
        path = sp.ShapePath.fourier([0.1], [[1.0]], [[0.2]], 1.0, joint_names=("hinge",))
        sp.write_shape_path(path, target, np.linspace(0.0, 1.0, 3000))
        return
    motion = sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.1, 0.2, 1.0])
    if writer == "motion.npz":
        motion.save(target)
    elif writer == "motion.csv":
        motion.write_csv(target, np.linspace(0.0, 1.0, 2000))
    elif writer == "figure.svg":
        from shapephase.plots.named_figures import write_figure

        write_figure("attitude", motion, target)
    else:
        body, path = sp.load_body("cat"), sp.examples.scenarios.cat_righting()
        sp.view(sp.reconstruct(sp.articulated(body, path), [0.0, 0.0, 0.02])).write(target)


def exit_code(words: list[str]) -> int:
    """How a command ends."""
    try:
        main(words)
    except SystemExit as stopped:
        return int(stopped.code or 0)
    return 0


@pytest.fixture
def writes(monkeypatch):
    """Files that `write_whole` has put in the places of old ones."""
    places, really = [], os.replace

    def recording(part: str | Path, place: Path) -> None:
        if Path(part).suffix == ".part":
            places.append(place)
        really(part, place)

    monkeypatch.setattr("shapephase.files.os.replace", recording)
    return places


def refused(captured) -> str:
    """One line on standard error, and nothing on standard output."""
    said = captured.err.splitlines()
    assert len(said) == 1, captured
    assert said[0].startswith("shapephase: cannot write ")
    assert captured.out == ""
    return said[0]


def test_every_writer_of_the_command_line_is_tried():
    offered = set()
    for name in app:
        if not name.startswith("-"):
            arguments = app[name].assemble_argument_collection()
            offered |= {(name, one.name) for one in arguments if "Path" in str(one.hint)}
    # A film takes a browser, and the two files of SPICE its library; they go the way of the others.
    assert offered - {("view", "--video"), ("rigid", "--video"), ("export", "--ck"), *READ} == {
        (words[0], words[-1]) for words in COMMANDS.values()
    }


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("writer", full_but(COMMANDS, "split.npz"))
def test_a_command_writes_a_whole_file_or_leaves_the_old_one(writer, tmp_path, writes, monkeypatch, capsys):
    target = tmp_path / f"target.{writer.split('.')[1]}"
    words = [word if isinstance(word, str) else word[0] for word in COMMANDS[writer]]
    assert exit_code([*words, str(target)]) == 0
    assert writes == [target]
    assert is_whole(target.read_bytes(), writer)
    target.write_bytes(b"old")
    capsys.readouterr()

    def full_disk(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("shapephase.files.os.fsync", full_disk)
    assert exit_code([*words, str(target)]) == ExitCode.OUTPUT
    assert refused(capsys.readouterr()).endswith(": No space left on device")
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]
    assert exit_code([*words, str(tmp_path)]) == ExitCode.OUTPUT
    refused(capsys.readouterr())


@pytest.mark.parametrize("writer", FUNCTIONS)
def test_a_function_writes_a_whole_file(writer, tmp_path, writes):
    target = tmp_path / f"target.{writer.split('.')[1]}"
    written_by_function(writer, target)
    assert writes == [target]
    assert is_whole(target.read_bytes(), writer)
