"""Long recordings, fast turns and hostile names from the command line: answered in a line and in bounded memory."""

from __future__ import annotations

import json
import re
import subprocess
import sys

import numpy as np
import pytest

import shapephase as sp
from shapephase.cli.main import main
from shapephase.cli.outcome import ExitCode
from support.hostile_names import OF_FILES, star_urdf, swinging


def most_memory_of(*arguments):
    """A command that ends well, and the most memory that it had [bytes]."""
    source = (
        "import resource, subprocess, sys\n"
        "done = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=sys.stderr)\n"
        "print(done.returncode, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    command = [sys.executable, "-c", source, sys.executable, "-m", "shapephase", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    code, kilobytes = map(int, done.stdout.split())
    return code, 1024 * kilobytes, done.stderr


def test_a_momentum_of_a_billion_turns_is_one_line():
    code, memory, said = most_memory_of("split", "cat", "cat_righting", "--momentum", "1e9", "0", "0")
    assert code == ExitCode.NUMERICS
    assert re.fullmatch(r"shapephase: the body turns up to \S+ times in 2 s, which takes some .*\n", said)
    assert memory < 500e6


@pytest.mark.usefixtures("warm_readers")
def test_every_command_takes_hostile_names(tmp_path, monkeypatch, capsys):
    """Names with commas and semicolons, too: the motion is an NPZ file, whose columns are no line of text."""
    (tmp_path / "star.urdf").write_text(star_urdf(OF_FILES), encoding="utf-8")
    body = sp.load_body(tmp_path / "star.urdf")
    sp.write_shape_path(swinging(body), tmp_path / "star.npz", np.linspace(0.0, 1.0, 21))
    monkeypatch.chdir(tmp_path)
    for arguments in (
        "check star.urdf star.npz --json",
        "split star.urdf star.npz --momentum 0 0.1 1 --html star.html --json",
        "plot shape star.urdf star.npz --out star.pdf --json",
    ):
        main(arguments.split())
        said = capsys.readouterr()
        data = json.loads(said.out)
        assert data["warnings"] == []
        if "body" in data and arguments.startswith("check"):
            assert {joint["name"] for joint in data["body"]["joints"]} == {*OF_FILES}
        main(re.sub(r" --html \S+| --json", "", arguments).split())
        assert all(letter.isprintable() or letter == "\n" for letter in capsys.readouterr().out)


def swings(file, rows):
    """A recording of the diver's arms, a hundred samples a second."""
    times = 0.01 * np.arange(rows)
    arms = np.sin(np.outer(times, [1.0, 1.3]))
    with open(file, "w", encoding="utf-8") as stream:
        stream.write("time,left_shoulder_abduction,right_shoulder_abduction\n")
        np.savetxt(stream, np.column_stack([times, arms]), delimiter=",", fmt="%.9f")
    return file


@pytest.mark.full
@pytest.mark.parametrize("rows", [400_101, pytest.param(1_000_000, marks=pytest.mark.full)])
def test_a_recording_of_a_million_rows(tmp_path, rows):
    """It is read, and refused with what would do, in the memory that its numbers take."""
    file = tmp_path / "long.csv"
    # Arms that go up and down in a straight line, which are written quicker than a sine.
    file.write_text(
        "time,left_shoulder_abduction,right_shoulder_abduction\n"
        + "".join(f"{k // 100}.{k % 100:02}0000000,0.{k % 2}00000000,0.{k % 5}00000000\n" for k in range(rows))
    )
    code, memory, said = most_memory_of("split", "diver", file)
    assert code == ExitCode.TRAJECTORY
    assert said.count("\n") == 1
    assert f"a motion in {rows - 1} pieces" in said
    (rate,) = re.findall(r"resample=(\S+) or less", said)
    assert 0.9 * 400_000 < float(rate) * 0.01 * (rows - 1) <= 400_000
    assert memory < 200e6 + 600.0 * rows


@pytest.mark.full
@pytest.mark.parametrize(
    ("rows", "momentum"),
    [(2_000, 10), pytest.param(200_000, 0, marks=pytest.mark.full), pytest.param(200_000, 10, marks=pytest.mark.full)],
)
def test_a_long_recording_takes_bounded_memory(tmp_path, rows, momentum):
    file = swings(tmp_path / "long.csv", rows)
    # Rounding of so many samples alone comes to more than 1e-9 rad over half an hour of turning.
    tolerance = 1e-7 if rows > 100_000 and momentum else 1e-9
    options = ("--momentum", 0, 0, momentum, "--tolerance", tolerance)
    code, memory, _ = most_memory_of("split", "diver", file, *options)
    assert code == ExitCode.DONE
    assert memory < 450e6 + 30e3 * rows
