"""Files are written whole or not at all, whenever the writer dies."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import shapephase as sp
from shapephase.files import write_whole

# Writes one of two motions over and over; says so once it has begun.
WRITER = """
import sys
import numpy as np
import shapephase as sp
target, kind = sys.argv[1:]
motions = [sp.reconstruct(sp.rigid(np.diag([1.0, 2.0, 3.0]), 1.0), [0.1, 0.2, size]) for size in (1.0, 2.0)]
path = [sp.ShapePath.fourier([0.1], [[size]], [[0.2]], 1.0, joint_names=("hinge",)) for size in (1.0, 2.0)]
print("ready", flush=True)
while True:
    for k in range(2):
        if kind == "save":
            motions[k].save(target)
        elif kind == "csv":
            motions[k].write_csv(target, np.linspace(0.0, 1.0, 2000))
        else:
            sp.write_shape_path(path[k], target)
"""


def sizes_in(target: Path, kind: str) -> float:
    """Which of the two motions a file holds; raises if it holds neither whole."""
    if kind == "save":
        return float(sp.load_motion(target).momentum[2])
    rows = np.genfromtxt(target, delimiter=",", names=True)
    if kind == "csv":
        assert len(rows) == 2000
        return float(np.round(3.0 * rows["omega_z_rad_s"][0], 9))
    assert rows["time"][-1] == 1.0
    return float(np.round(rows["hinge"][0] - 0.1, 9))


@pytest.mark.parametrize("kind", ["save", *(pytest.param(kind, marks=pytest.mark.full) for kind in ("csv", "path"))])
def test_a_killed_writer_leaves_a_whole_file(kind: str, tmp_path: Path):
    target = tmp_path / ("motion.npz" if kind == "save" else "motion.csv")
    rng = np.random.default_rng(3)
    for _ in range(4):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(target), kind],
            stdout=subprocess.PIPE,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
        assert writer.stdout is not None
        assert writer.stdout.readline() == b"ready\n"
        while not target.exists() and writer.poll() is None:
            time.sleep(0.002)
        time.sleep(rng.uniform(0.0, 0.05))
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        writer.stdout.close()
        assert sizes_in(target, kind) in (1.0, 2.0)


def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(tmp_path: Path):
    target = tmp_path / "kept.txt"
    target.write_text("old")

    def fail(stream):
        stream.write(b"half of the new")
        raise RuntimeError("the disk is on fire")

    with pytest.raises(RuntimeError, match="on fire"):
        write_whole(target, fail)
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_permissions_are_those_of_any_new_file(tmp_path: Path):
    plain, whole = tmp_path / "plain", tmp_path / "whole"
    plain.write_text("x")
    write_whole(whole, lambda stream: stream.write(b"x"))
    assert whole.stat().st_mode == plain.stat().st_mode
